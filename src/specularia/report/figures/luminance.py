"""Luminance maps of the lit room (the paper's Fig. 11)."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import matplotlib as mpl
import numpy as np
from matplotlib import patheffects
from matplotlib.axes import Axes
from matplotlib.colors import LogNorm
from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter
from numpy.typing import NDArray

from specularia.report import style

if TYPE_CHECKING:
    from specularia.daylight import Image, Point

__all__ = ["in_circle", "is_fisheye", "luminance_maps"]

Array = NDArray[np.float64]

_ISOLINES = (1.0, 3.0)
"""Isolines per decade of luminance, as multiples of its power of ten."""

_GENTLE = 0.03
"""Decades of luminance per pixel up to which an isoline gets a label."""


def luminance_maps(
    images: Sequence[Image],
    path: str | Path,
    *,
    points: Sequence[Point] = (),
    limits_cd_m2: tuple[float, float] | None = None,
    synthetic: bool = False,
) -> Path:
    """Draw luminance in false colour with isolines, on one fixed logarithmic scale for all images.

    Parameters
    ----------
    images : records with `model`, `name`, `luminance` [row, column] in cd/m2, row 0 at the top, and `pixels`;
        one panel each.
    path : PNG to write; an NPZ of the same name gets `luminance_k`, `model_k` and `name_k` per image k, and,
        where points are given, `point_name`, `point_model`, `point_illuminance_lx` and `point_se_lx`.
    points : illuminances (records with `name`, `model`, `illuminance_lx`, `se`), labelled in the panel of
        their model: at their pixel where the image has one for the name (`pixels`), else in a line below the
        picture.
    limits_cd_m2 : ends of the scale; None takes three decades that end above the 99.9 % quantile of all
        images.
    synthetic : True labels the figure.

    Returns
    -------
    path of the PNG.
    """
    maps = [_seen(i) for i in images]
    low, high = limits_cd_m2 if limits_cd_m2 is not None else _limits(maps)
    norm = LogNorm(low, high)
    levels = [
        m * 10.0**e
        for e in range(int(np.floor(np.log10(low))), int(np.ceil(np.log10(high))) + 1)
        for m in _ISOLINES
        if low < m * 10.0**e < high
    ]
    shape = maps[0].shape
    width = 3.2
    # More than two side by side would leave no room for letters.
    columns = min(2, len(images))
    count = -(-len(images) // columns)
    with style.canvas(width * columns + 0.9, (width * shape[0] / shape[1] + 0.55) * count + 0.3) as figure:
        axes = figure.subplots(count, columns, squeeze=False).ravel()
        for empty in axes[len(images) :]:
            empty.set_axis_off()
        for k, (image, values) in enumerate(zip(images, maps)):
            panel = axes[k]
            round_ = _kind(image) == "fisheye"
            picture = panel.imshow(
                values,
                cmap=mpl.colormaps["inferno"].with_extremes(bad="white" if round_ else style.NO_DATA),
                norm=norm,
                origin="upper",
            )
            shown = np.where(np.nan_to_num(values) > 0, values, np.nan)
            lines = panel.contour(shown, levels=levels, colors="white", linewidths=0.45, alpha=0.75)
            _label(panel, lines, shown, [image.pixels[p.name] for p in points if p.name in image.pixels])
            panel.set_title(f"{style.letter(k)}  {style.model_name(image.model)}")
            panel.set(
                xticks=[], yticks=[], xlim=(-0.5, values.shape[1] - 0.5), ylim=(values.shape[0] - 0.5, -0.5)
            )
            for spine in panel.spines.values():
                spine.set_visible(not round_)
            if _kind(image) == "plan":
                _north(panel)
            below = []
            for point in (p for p in points if p.model == image.model):
                if point.name not in image.pixels:
                    below.append(f"{point.name}: {_lux(point.illuminance_lx)}")
                    continue
                # Pixels are counted from their corners there, from their centres in this picture.
                column, row = (v - 0.5 for v in image.pixels[point.name])
                panel.plot(
                    column,
                    row,
                    marker="o",
                    markersize=2.6,
                    color="white",
                    markeredgecolor="black",
                    markeredgewidth=0.5,
                )
                panel.annotate(
                    f"E = {_lux(point.illuminance_lx)}",
                    (column, row),
                    xytext=(0, 4),
                    textcoords="offset points",
                    ha="center",
                    va="bottom",
                    fontsize=6.3,
                    color="white",
                    fontweight="bold",
                    path_effects=[patheffects.withStroke(linewidth=1.6, foreground="black")],
                )
            if below:
                panel.set_xlabel(_wrapped(below), fontsize=6.5, labelpad=4)
        bar = figure.colorbar(
            picture, cax=axes[columns - 1].inset_axes((1.03, 0.0, 0.04, 1.0)), extend="both"
        )
        bar.set_label("luminance L (cd/m²)")
        bar.ax.yaxis.set_major_locator(LogLocator(subs=_ISOLINES))
        bar.ax.yaxis.set_major_formatter(FuncFormatter(lambda v, _: style.number(v)))
        bar.ax.yaxis.set_minor_formatter(NullFormatter())
        for level in levels:
            bar.ax.axhline(level, color="white", linewidth=0.45)
        numbers: dict[str, object] = {}
        for k, (image, values) in enumerate(zip(images, maps)):
            numbers |= {
                f"luminance_{k}": values.astype(np.float32),
                f"model_{k}": image.model,
                f"name_{k}": image.name,
            }
        if points:
            numbers |= {
                "point_name": [p.name for p in points],
                "point_model": [p.model for p in points],
                "point_illuminance_lx": [p.illuminance_lx for p in points],
                "point_se_lx": [p.se for p in points],
            }
        style.write_npz(Path(path).with_suffix(".npz"), numbers)
        return style.save(figure, path, synthetic=synthetic)


def _kind(image: Image) -> str:
    """perspective, fisheye or plan; perspective for records without a view."""
    return str(getattr(getattr(image, "view", None), "kind", "perspective"))


def _seen(image: Image) -> Array:
    """Luminance, NaN outside the circle of a fisheye."""
    values = np.asarray(image.luminance, float)
    return np.where((values > 0) & in_circle(values.shape), values, np.nan) if is_fisheye(image) else values


def is_fisheye(image: Image) -> bool:
    """Whether a record was taken with a fisheye."""
    return _kind(image) == "fisheye"


def in_circle(shape: tuple[int, ...]) -> NDArray[np.bool_]:
    """[rows, columns] pixels of a fisheye that its circle covers whole; those on its rim are partly black."""
    y, x = (2.0 * (np.arange(n) + 0.5) / n - 1.0 for n in shape[:2])
    return np.asarray(np.hypot(x[None, :], y[:, None]) < 1.0 - np.sqrt(2.0) / shape[1])


def _north(panel: Axes) -> None:
    """A small arrow to the north, which is up in a plan."""
    panel.annotate(
        "N",
        (0.05, 0.97),
        xytext=(0.05, 0.87),
        xycoords="axes fraction",
        textcoords="axes fraction",
        ha="center",
        va="center",
        fontsize=6.3,
        color="white",
        arrowprops={"arrowstyle": "-|>", "color": "white", "linewidth": 0.8, "shrinkA": 3, "shrinkB": 0},
        path_effects=[patheffects.withStroke(linewidth=1.4, foreground="black")],
    )


def _label(panel: Axes, lines: Any, luminance: Array, taken: Sequence[tuple[float, float]]) -> None:
    """Label isolines where the luminance changes slowly, away from the labels of points.

    At the edges of panes, where many isolines crowd, labels would only blot.
    """
    with np.errstate(invalid="ignore"):
        slope = np.hypot(*np.gradient(np.log10(luminance)))
    places = []
    for outline in lines.get_paths():
        for part in outline.to_polygons(closed_only=False):
            if len(part) < 2 or np.hypot(*np.diff(part, axis=0).T).sum() < 0.2 * luminance.shape[1]:
                continue
            columns = np.clip(np.rint(part[:, 0]).astype(int), 0, luminance.shape[1] - 1)
            rows = np.clip(np.rint(part[:, 1]).astype(int), 0, luminance.shape[0] - 1)
            margin = np.minimum(part, np.subtract(luminance.shape[::-1], part)).min(axis=1)
            free = margin > 0.05 * luminance.shape[1]
            for column, row in taken:
                beside = np.abs(part[:, 0] - column) > 0.12 * luminance.shape[1]
                free &= beside | (np.abs(part[:, 1] - row) > 0.12 * luminance.shape[0])
            steepness = np.where(free, slope[rows, columns], np.inf)
            best = int(np.argmin(np.nan_to_num(steepness, nan=np.inf)))
            if steepness[best] < _GENTLE:
                places.append(part[best])
    if places:
        panel.clabel(
            lines, fontsize=4.8, inline=True, inline_spacing=1, manual=places, fmt=lambda v: f"{v:g}"
        )


def _limits(maps: Sequence[Array]) -> tuple[float, float]:
    """Three decades ending at the next 1, 2 or 5 above nearly all of the luminances."""
    positive = np.concatenate([m[np.isfinite(m) & (m > 0)] for m in maps])
    top = float(np.quantile(positive, 0.999)) if positive.size else 1.0
    exponent = 10.0 ** np.floor(np.log10(top))
    high = next(m * exponent for m in (1.0, 2.0, 5.0, 10.0) if m * exponent >= top)
    return high / 1000.0, high


def _lux(value: float) -> str:
    """Illuminance to three significant digits."""
    return f"{style.number(value, 3)} lx"


def _wrapped(parts: Sequence[str], each: int = 2) -> str:
    return "\n".join("   ".join(parts[i : i + each]) for i in range(0, len(parts), each))
