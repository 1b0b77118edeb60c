"""The faces of the glass: height maps (the paper's Fig. 7) and micrographs (Fig. 8)."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.patches import Rectangle
from numpy.typing import ArrayLike, NDArray

from specularia.report import style

if TYPE_CHECKING:
    from specularia.surface import HeightMap

__all__ = ["height_maps", "micrographs"]

Array = NDArray[np.float64]

_LARGEST = 900
"""Pixels along the longer side of a drawn map at most; larger maps are drawn as means of blocks."""


def height_maps(maps: Mapping[str, HeightMap], path: str | Path, *, synthetic: bool = False) -> Path:
    """Draw height maps side by side, each on its own scale of heights (the paper's Fig. 7).

    x runs to the right and y up, as the microscope saw the face; heights are positive out of the glass, from
    the lowest point of the map. Missing heights are hatched.

    Parameters
    ----------
    maps : by name, such as {"front": ..., "back": ...}.
    path : PNG to write; an NPZ of the same name gets, per map k, `name_k`, `heights_um_k` (row 0 at the
        lowest y, missing NaN, as given), `pitch_x_um_k` and `pitch_y_um_k`.
    synthetic : True labels the figure.

    Returns
    -------
    path of the PNG.
    """
    numbers: dict[str, Any] = {}
    with style.canvas(3.35 * len(maps), _height([m.heights_um for m in maps.values()], 2.35)) as figure:
        axes = figure.subplots(1, len(maps), squeeze=False)[0]
        for k, (name, surface) in enumerate(maps.items()):
            heights = np.asarray(surface.heights_um, float)
            numbers |= {
                f"name_{k}": name,
                f"heights_um_{k}": heights.astype(np.float32),
                f"pitch_x_um_{k}": surface.pitch_x_um,
                f"pitch_y_um_{k}": surface.pitch_y_um,
            }
            panel = axes[k]
            style.hatch(panel)
            width = heights.shape[1] * surface.pitch_x_um
            height = heights.shape[0] * surface.pitch_y_um
            picture = panel.imshow(
                _reduced(heights) - np.nanmin(heights),
                origin="lower",
                extent=(0, width, 0, height),
                cmap=mpl.colormaps["cividis"].with_extremes(bad=(0, 0, 0, 0)),
                interpolation="nearest",
            )
            _frame(panel, name, k, width)
            bar = figure.colorbar(picture, cax=panel.inset_axes((1.03, 0.0, 0.045, 1.0)))
            bar.set_label("height above lowest point (µm)")
            if np.isnan(heights).any():
                panel.legend(
                    handles=[style.no_data_patch("missing")],
                    loc="upper right",
                    fontsize=6,
                    frameon=True,
                    framealpha=0.9,
                )
        style.write_npz(Path(path).with_suffix(".npz"), numbers)
        return style.save(figure, path, synthetic=synthetic)


def micrographs(
    images: Mapping[str, ArrayLike],
    pitch_um: float | Mapping[str, float],
    path: str | Path,
    *,
    synthetic: bool = False,
) -> Path:
    """Draw all-in-focus images of the faces in grey, with a scale bar (the paper's Fig. 8).

    Parameters
    ----------
    images : by name, [row, column], relative brightness, row 0 at the lowest y; the grey scale runs from the
        0.5 % to the 99.5 % quantile of each.
    pitch_um : pixel size, > 0, the same for all, or one for each by name.
    path : PNG to write; an NPZ of the same name gets, per image k, `name_k`, `image_k` and `pitch_um_k`.
    synthetic : True labels the figure.

    Returns
    -------
    path of the PNG.
    """
    numbers: dict[str, Any] = {}
    with style.canvas(2.9 * len(images), _height(images.values(), 2.3)) as figure:
        axes = figure.subplots(1, len(images), squeeze=False)[0]
        for k, (name, image) in enumerate(images.items()):
            grey = np.asarray(image)
            pitch = pitch_um[name] if isinstance(pitch_um, Mapping) else pitch_um
            numbers |= {f"name_{k}": name, f"image_{k}": grey, f"pitch_um_{k}": pitch}
            low, high = np.nanquantile(grey, [0.005, 0.995])
            width = grey.shape[1] * pitch
            axes[k].imshow(
                _reduced(grey.astype(float)),
                origin="lower",
                extent=(0, width, 0, grey.shape[0] * pitch),
                cmap="gray",
                vmin=low,
                vmax=high,
                interpolation="nearest",
            )
            _frame(axes[k], name, k, width)
        style.write_npz(Path(path).with_suffix(".npz"), numbers)
        return style.save(figure, path, synthetic=synthetic)


def _height(images: Iterable[ArrayLike], width: float) -> float:
    """Height of the figure, inches, for panels of this width with titles and labels."""
    return width * max(s[0] / s[1] for s in map(np.shape, images)) + 0.85


def _reduced(image: Array) -> Array:
    """Means of blocks where the image has more pixels than the picture can show."""
    step = -(-max(image.shape) // _LARGEST)
    if step == 1:
        return image
    rows, columns = (n // step * step for n in image.shape)
    blocks = image[:rows, :columns].reshape(rows // step, step, columns // step, step)
    with np.errstate(invalid="ignore"):
        count = np.isfinite(blocks).sum(axis=(1, 3))
        total = np.nansum(blocks, axis=(1, 3))
        return np.where(count > 0, total / np.maximum(count, 1), np.nan)


def _frame(axes: Axes, name: str, index: int, width_um: float) -> None:
    """Title, axes in micrometres and a scale bar of a round length of about a quarter of the width."""
    axes.set_title(f"{style.letter(index)}  {name}")
    axes.set(xlabel="x (µm)", ylabel="y (µm)")
    for spine in axes.spines.values():
        spine.set_visible(True)
    exponent = 10.0 ** np.floor(np.log10(width_um / 4.0))
    length = max(m * exponent for m in (1.0, 2.0, 5.0) if m * exponent <= width_um / 4.0)
    bottom, top = axes.get_ylim()
    thick = 0.012 * (top - bottom)
    x, y = 0.05 * width_um, bottom + 0.05 * (top - bottom)
    pad = 0.02 * width_um
    axes.add_patch(
        Rectangle(
            (x - pad, y - pad),
            length + 2 * pad,
            0.09 * (top - bottom) + 2 * pad,
            facecolor="black",
            alpha=0.55,
            linewidth=0,
        )
    )
    axes.add_patch(Rectangle((x, y), length, thick, facecolor="white", linewidth=0))
    axes.text(
        x + length / 2,
        y + 2.0 * thick,
        f"{length:g} µm",
        color="white",
        fontsize=6.5,
        ha="center",
        va="bottom",
    )
