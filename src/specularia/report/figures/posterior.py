"""What was inferred of a glass: each parameter beside its prior, and each pair."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from specularia.report.style import COLOURS, canvas, save, write_csv

if TYPE_CHECKING:
    from specularia.analysis import Inferred

__all__ = ["posterior"]

LABELS: Final = {
    "absorption_per_mm": "absorption (1/mm)",
    "bubbles_per_cm3": "bubbles (1/cm³)",
    "bubble_diameter_mm": "bubble\ndiameter (mm)",
    "bubble_elongation": "bubble\nelongation",
    "micro_slope_front": "fine slope,\nfront",
    "micro_slope_back": "fine slope,\nback",
    "thickness_mm": "thickness (mm)",
}


def posterior(found: Inferred, path: str | Path) -> Path:
    """Draw the posterior as a corner: histograms over priors on the diagonal, pairs below it.

    Axes are logarithmic. The CSV beside the picture holds median, 95 % interval and prior of each parameter.
    """
    path = Path(path)
    n = len(found.names)
    with canvas(1.0 + 1.3 * n, 0.8 + 1.25 * n) as figure:
        axes = np.atleast_2d(figure.subplots(n, n, squeeze=False))
        logs = np.log(found.samples)
        for i in range(n):
            for j in range(n):
                if j > i:
                    axes[i, j].set_axis_off()
                elif i == j:
                    _own(axes[i, i], found, i)
                else:
                    _pair(axes[i, j], found, logs, i, j)
                if i < n - 1:
                    axes[i, j].tick_params(labelbottom=False, which="both")
                else:
                    axes[i, j].set_xlabel(LABELS[found.names[j]])
                if j > 0 and j < i:
                    axes[i, j].tick_params(labelleft=False, which="both")
            if i > 0:
                axes[i, 0].set_ylabel(LABELS[found.names[i]])
        save(figure, path, synthetic=found.synthetic)
    rows: list[list[Any]] = []
    for name in found.names:
        mid, low, high = found.interval(name)
        prior = found.priors[name]
        rows.append([name, mid, low, high, prior.median, prior.sigma])
    header = ["parameter", "median", "low_95", "high_95", "prior_median", "prior_sigma_ln"]
    write_csv(path.with_suffix(".csv"), header, rows)
    return path


def _range(found: Inferred, k: int) -> tuple[float, float]:
    """Of an axis: the 99.8 % interval, and half as much on either side."""
    low, high = np.quantile(np.log(found.samples[:, k]), [0.001, 0.999])
    more = 0.35 * (high - low) + 0.02
    return float(np.exp(low - more)), float(np.exp(high + more))


def _own(axes: Any, found: Inferred, k: int) -> None:
    name = found.names[k]
    prior, (low, high) = found.priors[name], _range(found, k)
    edges = np.geomspace(low, high, 41)
    counts, _ = np.histogram(found.samples[:, k], edges)
    width = np.log(edges[1] / edges[0])
    axes.stairs(counts / (len(found.samples) * width), edges, fill=True, color=COLOURS["M"], alpha=0.55)
    x = np.geomspace(low, high, 200)
    z = np.log(x / prior.median) / prior.sigma
    axes.plot(x, np.exp(-0.5 * z * z) / (prior.sigma * np.sqrt(2.0 * np.pi)), color="#1a1a1a", lw=0.9)
    mid, a, b = found.interval(name)
    axes.set_title(f"{mid:.3g}  ({a:.3g} to {b:.3g})", fontsize=6.5)
    axes.set_xscale("log")
    axes.set_xlim(low, high)
    axes.set_yticks([])
    axes.spines["left"].set_visible(False)
    _ticks(axes.xaxis, low, high)


def _pair(axes: Any, found: Inferred, logs: Any, i: int, j: int) -> None:
    x, y = found.samples[:, j], found.samples[:, i]
    thin = slice(None, None, max(1, len(x) // 1500))
    axes.plot(x[thin], y[thin], ".", ms=1.2, color=COLOURS["M"], alpha=0.35, rasterized=True)
    axes.set_xscale("log")
    axes.set_yscale("log")
    axes.set_xlim(*_range(found, j))
    axes.set_ylim(*_range(found, i))
    _ticks(axes.xaxis, *_range(found, j))
    _ticks(axes.yaxis, *_range(found, i))
    c = float(np.corrcoef(logs[:, i], logs[:, j])[0, 1])
    axes.text(0.96, 0.94, f"{c:+.2f}", transform=axes.transAxes, ha="right", va="top", fontsize=6.0)


def _ticks(axis: Any, low: float, high: float) -> None:
    """Two or three round values, written out."""
    from matplotlib.ticker import FixedLocator, FuncFormatter, NullFormatter, NullLocator

    steps = [m * 10.0**e for e in range(-5, 5) for m in (1, 2, 3, 5, 7)]
    inside = [v for v in steps if low <= v <= high]
    if len(inside) < 2:
        digits = 1 - int(np.floor(np.log10(high - low)))
        inside = sorted({round(v, digits) for v in np.linspace(low, high, 4)[1:-1]})
    if len(inside) > 3:
        inside = inside[:: (len(inside) + 2) // 3]
    axis.set_major_locator(FixedLocator(inside))
    axis.set_major_formatter(FuncFormatter(lambda v, _: f"{v:g}"))
    axis.set_minor_locator(NullLocator())
    axis.set_minor_formatter(NullFormatter())
