"""Pictures of a face under white light, in focus everywhere, and what their shading says of its slopes."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from specularia.errors import FormatError, PhysicsError

__all__ = ["dark", "on_grid", "read_picture"]

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

_SIGMAS = 4.0
_LEAST_DROP = 0.02
"""Share of the plateaux' brightness by which a pixel must at least be darker to tell anything."""

_ASPECT = 0.02
"""How far the picture's shape may lie beside that of the map for both to be of one field."""


def read_picture(path: str | Path) -> Array:
    """Brightness of a picture, [rows, columns], row 0 at the lowest y.

    Colours are averaged. Pictures start with their top row, unless the file says that row 0 is the lowest.

    Raises
    ------
    FormatError : a file that is no picture.
    """
    import imageio.v3 as iio

    path = Path(path)
    try:
        raw = path.read_bytes()
        picture = np.asarray(iio.imread(raw, extension=path.suffix.lower()), float)
    except (OSError, ValueError, TypeError, RuntimeError) as error:
        raise FormatError(
            file=path,
            expected="a picture, such as TIFF, PNG or JPEG",
            found=str(error).splitlines()[0] if str(error) else "nothing readable",
            advice="Name the picture of the same field as the map, in focus everywhere.",
        ) from error
    if picture.ndim not in (2, 3):
        raise FormatError(
            file=path, expected="one picture", found=f"an array of {picture.ndim} axes: several pages?"
        )
    grey = picture[..., :3].mean(axis=2) if picture.ndim == 3 else picture
    return grey if b"row 0 = lowest y" in raw[:65536] else grey[::-1]


def on_grid(picture: Array, shape: tuple[int, int]) -> Array:
    """A picture of the same field as a map, averaged or interpolated to its pixels.

    Raises
    ------
    PhysicsError : its sides are not in the proportion of the map's.
    """
    from skimage import transform

    rows, columns = shape
    if abs(picture.shape[0] / picture.shape[1] / (rows / columns) - 1.0) > _ASPECT:
        raise PhysicsError(
            f"a picture of {picture.shape[0]} x {picture.shape[1]} pixels does not show the field of a map "
            f"of {rows} x {columns}. Crop it to the field of the map."
        )
    if picture.shape == shape:
        return np.asarray(picture, np.float64)
    resize: Any = transform.resize
    return np.asarray(resize(picture, shape, order=1, anti_aliasing=True, preserve_range=True))


def dark(picture: Array, plateaux: Mask) -> Mask:
    """Pixels darker than plateaux are: slopes that send the light past the objective.

    The picture is divided by the brightness of the plateaux around (a Gaussian of an eighth of the field over
    them), so uneven lighting does not count. Dark is what then lies more than four of the plateaux' standard
    deviations (from their median distance) below them, and two per cent at least; without its rim, where a
    plateau's last pixel shares the wall's shade. Ours.

    Parameters
    ----------
    picture : [rows, columns] brightness, of the map's grid.
    plateaux : pixels taken for the original surface so far.
    """
    from scipy.ndimage import binary_erosion, gaussian_filter

    if not plateaux.any():
        return np.zeros(picture.shape, bool)
    width = max(picture.shape) / 8.0
    weight = gaussian_filter(plateaux.astype(float), width)
    usual = gaussian_filter(np.where(plateaux, picture, 0.0), width) / np.maximum(weight, 1e-12)
    usual = np.where(weight > 1e-6, usual, np.median(picture[plateaux]))
    relative = picture / np.where(usual > 0.0, usual, 1.0)
    middle = float(np.median(relative[plateaux]))
    spread = 1.4826 * float(np.median(np.abs(relative[plateaux] - middle)))
    found = relative < middle - max(_SIGMAS * spread, _LEAST_DROP)
    return np.asarray(binary_erosion(found, border_value=1))
