"""Pictures of the lit room in colour, as a screen can show them."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Final

import numpy as np
from numpy.typing import NDArray

from specularia.report import style
from specularia.report.figures.luminance import in_circle, is_fisheye

if TYPE_CHECKING:
    from specularia.daylight import Image

__all__ = ["colour_pictures", "screen"]

Array = NDArray[np.float64]

_TO_SRGB: Final = np.array(
    [
        [3.2404542, -1.5371385, -0.4985314],
        [-0.9692660, 1.8760108, 0.0415560],
        [0.0556434, -0.2040259, 1.0572252],
    ]
)
"""X, Y, Z under D65 to linear sRGB (IEC 61966-2-1)."""

_BRADFORD: Final = np.array([[0.8951, 0.2664, -0.1614], [-0.7502, 1.7135, 0.0367], [0.0389, -0.0685, 1.0296]])
"""X, Y, Z to the cone responses in which white is adapted (Lam 1985)."""

_D65: Final = np.array([0.95047, 1.0, 1.08883])

_KEY: Final = 0.18
"""Brightness that the geometric mean of a picture gets."""


def colour_pictures(images: Sequence[Image], path: str | Path, *, synthetic: bool = False) -> Path:
    """Draw rooms in colour, one panel for each image, all with one exposure.

    The brightest channel of each pixel is drawn in by Reinhard's global operator, v (1 + v / v_white^2) /
    (1 + v), with v counted from the geometric mean of all images and white at the brightest pixel (Reinhard
    et al. 2002, doi:10.1145/566654.566575); the others follow, so that chromaticities stay. White of equal
    energy, the sun's and the sky's here, is the screen's white (Bradford's adaptation).

    Parameters
    ----------
    images : records with `model`, `luminance` [row, column] in cd/m2 and `xyz` [row, column, 3]; those of one
        band (`xyz` None) come out grey.
    path : PNG to write; an NPZ of the same name gets `xyz_k` and `model_k` per image k.
    synthetic : True labels the figure.
    """
    tristimuli = [
        np.repeat(np.asarray(i.luminance, float)[..., None], 3, axis=2) if i.xyz is None else i.xyz
        for i in images
    ]
    shape = tristimuli[0].shape
    with style.canvas(3.2 * len(images), 3.2 * shape[0] / shape[1] + 0.55) as figure:
        axes = figure.subplots(1, len(images), squeeze=False)[0]
        for k, (image, picture) in enumerate(zip(images, screen(tristimuli))):
            if is_fisheye(image):
                picture = np.where(in_circle(picture.shape)[..., None], picture, 1.0)
            axes[k].imshow(picture, origin="upper")
            grey = "" if image.xyz is not None else " (one band: grey)"
            axes[k].set_title(f"{style.letter(k)}  {style.model_name(image.model)}{grey}")
            axes[k].set(xticks=[], yticks=[])
            for spine in axes[k].spines.values():
                spine.set_visible(False)
        axes[0].set_xlabel("one exposure for all panels, brightness compressed", loc="left", fontsize=6.5)
        numbers: dict[str, object] = {}
        for k, (image, xyz) in enumerate(zip(images, tristimuli)):
            numbers |= {f"xyz_{k}": xyz.astype(np.float32), f"model_{k}": image.model}
        style.write_npz(Path(path).with_suffix(".npz"), numbers)
        return style.save(figure, path, synthetic=synthetic)


def screen(tristimuli: Sequence[Array], *, white: float | None = None) -> list[Array]:
    """sRGB values from 0 to 1 of pictures [rows, columns, 3] in X, Y, Z, all exposed alike.

    With `white` in cd/m2 the scale is linear up to this luminance and brighter channels are cut off; without
    it brightness is compressed, see `colour_pictures`. Colours beyond sRGB are drawn towards grey of the same
    luminance.
    """
    adapted = np.linalg.inv(_BRADFORD) @ np.diag(_BRADFORD @ _D65 / (_BRADFORD @ np.ones(3))) @ _BRADFORD
    linear = []
    for xyz in tristimuli:
        grey, rgb = np.maximum(xyz[..., 1:2], 0.0), xyz @ (_TO_SRGB @ adapted).T
        low = rgb.min(axis=-1, keepdims=True)
        share = np.divide(grey, grey - low, out=np.ones_like(grey), where=low < 0.0)
        linear.append(np.maximum(grey + share * (rgb - grey), 0.0))
    if white is not None:
        return [_encoded(rgb / white) for rgb in linear]
    peaks = np.concatenate([v.max(axis=-1).ravel() for v in linear])
    lit = peaks[peaks > 0.0]
    if lit.size == 0:
        return linear
    scale = _KEY / float(np.exp(np.mean(np.log(lit))))
    most = scale * float(lit.max())
    out = []
    for rgb in linear:
        v = scale * rgb.max(axis=-1, keepdims=True)
        level = v * (1.0 + v / most**2) / (1.0 + v)
        out.append(_encoded(rgb * np.divide(level, v / scale, out=np.zeros_like(v), where=v > 0.0)))
    return out


def _encoded(v: Array) -> Array:
    v = np.clip(v, 0.0, 1.0)
    return np.where(v <= 0.0031308, 12.92 * v, 1.055 * np.maximum(v, 1e-9) ** (1 / 2.4) - 0.055)
