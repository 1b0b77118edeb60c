"""The error budget as waterfalls: from the published Model C to the measurement, one step at a time."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from specularia.report.style import COLOURS, canvas, letter, save, write_csv

if TYPE_CHECKING:
    from specularia.analysis import Budget

__all__ = ["budget"]

LABELS: Final = {
    "endless": "endless pane",
    "polarisation": "polarisation",
    "absorption": "absorption",
    "bubbles": "bubbles",
    "height noise": "noise of the heights",
    "micro-relief": "relief below the cut-off",
    "diffraction": "diffraction",
    "tree": "no tensor tree",
    "instrument": "instrument",
}

_AXES: Final = ("transmission", "lobe width (°)", "background (%)")
_SCALE: Final = (1.0, 1.0, 100.0)

_MORE, _LESS = "#2a8f6d", "#a8447f"


def budget(found: Budget, path: str | Path) -> Path:
    """Draw the steps at every angle: transmission, width of the lobe and background, a row of panels each.

    Bars run from the state before a step to the one after it, with the 95 % interval of the step; the last
    bar is what remains. The CSV beside the picture holds all numbers, and the two largest steps in the other
    order.
    """
    path = Path(path)
    names = [LABELS.get(s.name, s.name) for s in found.steps]
    rows = ["Model C, published", *names, "unexplained", "measured"]
    angles = found.theta_deg.size
    with canvas(1.7 + 1.35 * angles, 0.9 + 3 * (0.17 * len(rows) + 0.55)) as figure:
        axes = np.atleast_2d(figure.subplots(3, angles, sharey=True))
        for q in range(3):
            for k in range(angles):
                _panel(axes[q, k], found, q, k)
                axes[q, k].set_title(f"{letter(q * angles + k)} {found.theta_deg[k]:g}°", loc="left")
                axes[q, k].set_xlabel(_AXES[q])
            axes[q, 0].set_yticks(range(len(rows)), rows)
            axes[q, 0].set_ylim(len(rows) - 0.4, -0.6)
        save(figure, path, synthetic=found.synthetic)
    _numbers(found, path.with_suffix(".csv"))
    return path


def _panel(axes: Any, found: Budget, q: int, k: int) -> None:
    scale = _SCALE[q]
    at = scale * found.start[k, q]
    axes.plot(at, 0, "o", color=COLOURS["C"], ms=4.0)
    for row, step in enumerate(found.steps, start=1):
        before, after = scale * step.before[k, q], scale * step.after[k, q]
        colour = "#b8b8b8" if not step.present else (_MORE if after >= before else _LESS)
        axes.barh(row, after - before, left=before, height=0.62, color=colour)
        half = scale * step.half_width[k, q]
        axes.errorbar(after, row, xerr=half, color="#1a1a1a", lw=0.8, capsize=1.5, capthick=0.8)
        axes.plot([before, before], [row - 1, row], color="#9a9a9a", lw=0.6, zorder=0)
        at = after
    row = len(found.steps) + 1
    measured = scale * found.measured[k, q]
    axes.plot([at, at], [row - 1, row], color="#9a9a9a", lw=0.6, zorder=0)
    axes.barh(row, measured - at, left=at, height=0.62, color="#7a7a7a")
    half = scale * found.remainder_half_width[k, q]
    axes.errorbar(measured, row, xerr=half, color="#1a1a1a", lw=0.8, capsize=1.5, capthick=0.8)
    axes.plot([measured, measured], [row, row + 1], color="#9a9a9a", lw=0.6, zorder=0)
    axes.plot(measured, row + 1, "s", color=COLOURS["measured"], ms=4.0)
    axes.use_sticky_edges = False
    axes.margins(x=0.12)
    axes.locator_params(axis="x", nbins=3)


def _numbers(found: Budget, path: Path) -> None:
    header = [
        "order",
        "step",
        "known_of_the_pane",
        "theta_i_deg",
        *(
            f"{q}_{n}"
            for q in ("tau", "width_deg", "background")
            for n in ("before", "after", "effect", "half_width_95")
        ),
    ]
    rows: list[list[Any]] = []
    for order, steps in (("stated", found.steps), ("swapped", found.swapped)):
        for step in steps:
            for k, theta in enumerate(found.theta_deg):
                cells: list[Any] = [order, step.name, int(step.present), float(theta)]
                for q in range(3):
                    cells += [float(v[k, q]) for v in (step.before, step.after, step.effect, step.half_width)]
                rows.append(cells)
    for k, theta in enumerate(found.theta_deg):
        cells = ["stated", "unexplained", 1, float(theta)]
        for q in range(3):
            last, measured = float(found.steps[-1].after[k, q]), float(found.measured[k, q])
            half = float(found.remainder_half_width[k, q])
            cells += [last, measured, measured - last, half]
        rows.append(cells)
    write_csv(path, header, rows)
