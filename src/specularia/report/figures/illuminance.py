"""Illuminance on grids as plans with isolux lines."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import LogNorm
from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter
from numpy.typing import NDArray

from specularia.report import style

if TYPE_CHECKING:
    from specularia.daylight import GridResult

__all__ = ["edges", "illuminance_plans", "set_plan"]

Array = NDArray[np.float64]

_STEPS = (1.0, 2.0, 5.0)
"""Isolux lines per decade, as multiples of its power of ten."""


def edges(at: Array) -> Array:
    """Borders of the equal cells whose middles stand at `at`; the first begins at 0."""
    step = 2.0 * float(at[0])
    return np.asarray(np.arange(at.size + 1) * step, float)


def set_plan(panel: Axes, grid: GridResult) -> tuple[Array, Array]:
    """Limits, equal scales and labels of a panel that shows a grid; the borders of its cells along x and y.

    A horizontal grid that runs east and north is shown in the room's metres, any other from its own corner.
    """
    x, y = edges(grid.along_m), edges(grid.across_m)
    east = _runs(grid, 0) and _runs(grid, 1)
    if east:
        first = grid.points_m[0, 0]
        x, y = x + (first[0] - grid.along_m[0]), y + (first[1] - grid.across_m[0])
    panel.set(
        xlim=(x[0], x[-1]),
        ylim=(y[0], y[-1]),
        aspect="equal",
        xlabel="x, eastward (m)" if east else "along (m)",
        ylabel="y, northward (m)" if east else "across (m)",
    )
    for spine in panel.spines.values():
        spine.set_visible(True)
    return x, y


def _runs(grid: GridResult, axis: int) -> bool:
    """Whether the grid's columns run east (axis 0), or its rows north (axis 1)."""
    p = grid.points_m
    if abs(float(grid.normal[2])) < 0.99:
        return False
    if p.shape[1 - axis] < 2:
        return True
    step = p[0, 1] - p[0, 0] if axis == 0 else p[1, 0] - p[0, 0]
    return float(step[axis]) > 0.99 * float(np.linalg.norm(step))


def illuminance_plans(grids: Sequence[GridResult], path: str | Path, *, synthetic: bool = False) -> Path:
    """Draw illuminance over one grid, a panel for each model, on one logarithmic scale, with isolux lines.

    Parameters
    ----------
    grids : records of one grid (`specularia.daylight.GridResult`), one for each model.
    path : PNG to write; an NPZ of the same name gets `along_m`, `across_m`, and `model_k`,
        `illuminance_lx_k`, `se_k` [rows, columns] of each panel k, row 0 at the lowest `across_m`, and
        `daylight_factor_percent_k` where there is one.
    synthetic : True labels the figure.

    Returns
    -------
    path of the PNG.
    """
    values = [np.asarray(g.illuminance_lx, float) for g in grids]
    positive = np.concatenate([v[v > 0] for v in values])
    low, high = (float(positive.min()), float(positive.max())) if positive.size else (0.1, 1.0)
    if high < 2.0 * low:
        low, high = low / 1.5, high * 1.5
    levels = [
        m * 10.0**e
        for e in range(int(np.floor(np.log10(low))), int(np.ceil(np.log10(high))) + 1)
        for m in _STEPS
        if low < m * 10.0**e < high
    ]
    first = grids[0]
    aspect = float(edges(first.across_m)[-1] / edges(first.along_m)[-1])
    width = float(np.clip(3.4 / max(aspect, 0.3), 1.6, 3.2))
    numbers: dict[str, object] = {"along_m": first.along_m, "across_m": first.across_m}
    with style.canvas(width * len(grids) + 1.3, width * aspect + 1.0) as figure:
        axes = figure.subplots(1, len(grids), squeeze=False)[0]
        for k, (grid, value) in enumerate(zip(grids, values)):
            panel = axes[k]
            x, y = set_plan(panel, grid)
            picture = panel.pcolormesh(
                x,
                y,
                np.where(value > 0, value, np.nan),
                norm=LogNorm(low, high),
                cmap="viridis",
                rasterized=True,
            )
            if min(value.shape) > 1 and levels:
                shown = np.where(value > 0, value, np.nan)
                middles = (0.5 * (a[1:] + a[:-1]) for a in (x, y))
                lines = panel.contour(*middles, shown, levels=levels, colors="white", linewidths=0.7)
                _label(panel, lines, grid)
            if k:
                panel.set_ylabel("")
            told = f"mean {style.number(grid.mean_lx, 3)} lx, least {style.number(grid.min_lx, 3)} lx"
            if grid.daylight_factor_percent is not None:
                told += f"\nmean daylight factor {float(grid.daylight_factor_percent.mean()):.3g} %"
            panel.set_title(f"{style.letter(k)}  {style.model_name(grid.model)}\n{told}", fontsize=7.0)
            numbers |= {f"model_{k}": grid.model, f"illuminance_lx_{k}": value, f"se_{k}": grid.se}
            if grid.daylight_factor_percent is not None:
                numbers[f"daylight_factor_percent_{k}"] = grid.daylight_factor_percent
        bar = figure.colorbar(picture, cax=axes[-1].inset_axes((1.05, 0.0, 0.06, 1.0)))
        bar.set_label("illuminance E (lx)")
        bar.ax.yaxis.set_major_locator(LogLocator(subs=_STEPS))
        bar.ax.yaxis.set_major_formatter(FuncFormatter(lambda v, _: style.number(v)))
        bar.ax.yaxis.set_minor_formatter(NullFormatter())
        style.write_npz(Path(path).with_suffix(".npz"), numbers)
        return style.save(figure, path, synthetic=synthetic)


def _label(panel: Axes, lines: Any, grid: GridResult) -> None:
    """Label isolux lines, each in its middle, and leave out labels that would lie on another one."""
    width, height = (edges(a)[-1] for a in (grid.along_m, grid.across_m))
    taken: list[Array] = []
    for outline in lines.get_paths():
        for part in outline.to_polygons(closed_only=False):
            if np.hypot(*np.diff(part, axis=0).T).sum() < 0.25 * width:
                continue
            top = part[int(np.argmax(part[:, 1]))]
            if all(abs(top[0] - t[0]) > 0.25 * width or abs(top[1] - t[1]) > 0.05 * height for t in taken):
                taken.append(top)
    if taken:
        panel.clabel(lines, fontsize=5.5, fmt=lambda v: style.number(v), manual=[tuple(t) for t in taken])
