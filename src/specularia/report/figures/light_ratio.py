"""Luminance pictures and illuminance grids of models over those of a first model."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import matplotlib as mpl
import numpy as np
from matplotlib.colors import LogNorm
from matplotlib.figure import Figure
from numpy.typing import NDArray

from specularia.report import style
from specularia.report.figures.illuminance import edges, set_plan

if TYPE_CHECKING:
    from specularia.daylight import GridResult, Image

__all__ = ["illuminance_ratios", "luminance_ratios"]

Array = NDArray[np.float64]

_DECADES = 4.0
"""Where both lie more than this far below the brightest of the first one, their ratio is not shown."""

_ENDS = (1.5, 2.0, 4.0, 8.0)
"""Ends that the scale may have: 1/x to x."""


def luminance_ratios(images: Sequence[Image], path: str | Path, *, synthetic: bool = False) -> Path:
    """Draw the luminance of the second and later pictures over that of the first, pixel by pixel.

    The scale is logarithmic and even about 1 (white): below it blue, above it red. It is the same for all
    panels and ends at 1.5, 2, 4 or 8, the least that holds 99 % of the pixels. Hatched where both luminances
    are more than four decades below the brightest, or one is 0.

    Parameters
    ----------
    images : records of one view with `model` and `luminance` [row, column], two or more.
    path : PNG to write; an NPZ of the same name gets `ratio_k` [row, column], NaN where hatched or outside a
        fisheye, and `models_k` (first, second).
    synthetic : True labels the figure.

    Returns
    -------
    path of the PNG.
    """
    first = np.asarray(images[0].luminance, float)
    ratios = [_ratio(first, np.asarray(i.luminance, float)) for i in images[1:]]
    norm = _norm(ratios)
    shape = first.shape
    fisheye = getattr(getattr(images[0], "view", None), "kind", "perspective") == "fisheye"
    width = 3.2
    with style.canvas(width * len(ratios) + 1.0, width * shape[0] / shape[1] + 0.5) as figure:
        axes = figure.subplots(1, len(ratios), squeeze=False)[0]
        numbers: dict[str, object] = {}
        for k, (image, ratio) in enumerate(zip(images[1:], ratios)):
            panel = axes[k]
            if not fisheye:
                style.hatch(panel)
            picture = panel.imshow(ratio, norm=norm, cmap=_map(), origin="upper", zorder=1)
            panel.set(xticks=[], yticks=[])
            for spine in panel.spines.values():
                spine.set_visible(not fisheye)
            panel.set_title(_title(k, image.model, images[0].model))
            numbers |= {f"ratio_{k}": ratio.astype(np.float32), f"models_{k}": [images[0].model, image.model]}
        _bar(figure, picture, list(axes), "ratio of luminances")
        style.write_npz(Path(path).with_suffix(".npz"), numbers)
        return style.save(figure, path, synthetic=synthetic)


def illuminance_ratios(grids: Sequence[GridResult], path: str | Path, *, synthetic: bool = False) -> Path:
    """Draw the illuminance on a grid through the second and later models over that through the first.

    Scale and hatching as in `luminance_ratios`.

    Parameters
    ----------
    grids : records of one grid, two or more.
    path : PNG to write; an NPZ of the same name gets `along_m`, `across_m`, `ratio_k` [rows, columns], row 0
        at the lowest `across_m`, and `models_k`.
    synthetic : True labels the figure.

    Returns
    -------
    path of the PNG.
    """
    first = grids[0]
    ratios = [_ratio(first.illuminance_lx, g.illuminance_lx) for g in grids[1:]]
    norm = _norm(ratios)
    aspect = float(edges(first.across_m)[-1] / edges(first.along_m)[-1])
    width = float(np.clip(3.4 / max(aspect, 0.3), 1.6, 3.2))
    numbers: dict[str, object] = {"along_m": first.along_m, "across_m": first.across_m}
    with style.canvas(width * len(ratios) + 1.3, width * aspect + 0.8) as figure:
        axes = figure.subplots(1, len(ratios), squeeze=False)[0]
        for k, (grid, ratio) in enumerate(zip(grids[1:], ratios)):
            panel = axes[k]
            style.hatch(panel)
            picture = panel.pcolormesh(
                *set_plan(panel, first), ratio, norm=norm, cmap=_map(), rasterized=True
            )
            if k:
                panel.set_ylabel("")
            panel.set_title(_title(k, grid.model, first.model))
            numbers |= {f"ratio_{k}": ratio, f"models_{k}": [first.model, grid.model]}
        _bar(figure, picture, list(axes), "ratio of illuminances")
        style.write_npz(Path(path).with_suffix(".npz"), numbers)
        return style.save(figure, path, synthetic=synthetic)


def _ratio(first: Array, second: Array) -> Array:
    floor = float(np.nanmax(first, initial=0.0)) / 10.0**_DECADES
    with np.errstate(divide="ignore", invalid="ignore"):
        shown = (first > 0) & (second > 0) & (np.maximum(first, second) > floor)
        return np.where(shown, second / first, np.nan)


def _norm(ratios: Sequence[Array]) -> LogNorm:
    away = np.concatenate([np.abs(np.log(r[np.isfinite(r)])) for r in ratios])
    held = float(np.exp(np.quantile(away, 0.99))) if away.size else 1.0
    end = next((e for e in _ENDS if e >= held), _ENDS[-1])
    return LogNorm(vmin=1.0 / end, vmax=end)


def _map() -> Any:
    return mpl.colormaps["RdBu_r"].with_extremes(bad=(0, 0, 0, 0))


def _title(k: int, second: str, first: str) -> str:
    return f"{style.letter(k)}  {style.model_name(second)} / {style.model_name(first)}"


def _bar(figure: Figure, picture: Any, axes: list[Any], label: str) -> None:
    bar = figure.colorbar(picture, ax=axes, extend="both", fraction=0.04, pad=0.02)
    end = float(picture.norm.vmax)
    ticks = [t for t in (0.125, 0.25, 0.5, 2 / 3, 0.8, 1.0, 1.25, 1.5, 2.0, 4.0, 8.0) if 1 / end <= t <= end]
    if end > 2.0:
        ticks = [t for t in ticks if t not in (2 / 3, 0.8, 1.25, 1.5)]
    names = {0.125: "1/8", 0.25: "1/4", 0.5: "1/2", 2 / 3: "1/1.5", 0.8: "1/1.25"}
    bar.set_ticks(ticks, labels=[names.get(t, f"{t:g}") for t in ticks])
    bar.ax.minorticks_off()
    bar.set_label(label)
