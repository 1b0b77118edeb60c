"""The texture of one surface as a folder of figures and tables, and pictures as files."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from specularia.files import atomic, make_folder, write_json
from specularia.report import style

if TYPE_CHECKING:
    from specularia.surface import HeightMap, Texture

__all__ = ["write_picture", "write_texture"]


def write_texture(
    surface: HeightMap, texture: Texture, folder: str | Path, *, exaggeration: float | None = None
) -> list[Path]:
    """Write the parameters (JSON, CSV) and the figures of a levelled map, each with its numbers beside it.

    Parameters
    ----------
    surface : the levelled map that the parameters are of.
    texture : its parameters.
    folder : made if missing.
    exaggeration : of the shaded relief, see `figures.relief`.

    Returns
    -------
    paths of the files; a profile has no maps, a map without spacing parameters no directions.
    """
    from specularia.report import figures
    from specularia.surface import power_spectrum

    folder = make_folder(folder)
    synthetic = "synthetic" in surface.attributes
    payload = texture.payload()
    files = [
        write_json(folder / "parameters.json", payload) or folder / "parameters.json",
        style.write_csv(folder / "parameters.csv", ["parameter", "value"], list(payload.items())),
        figures.abbott_curve(surface, texture, folder / "abbott_curve.png", synthetic=synthetic),
        figures.slope_angles(texture, folder / "slopes.png", synthetic=synthetic),
    ]
    if surface.missing <= 0.2 * surface.heights_um.size:
        spectrum = power_spectrum(surface)
        files.append(figures.power_spectra(spectrum, folder / "power_spectrum.png", synthetic=synthetic))
    if not surface.is_profile:
        name = surface.name or "surface"
        files.append(figures.height_maps({name: surface}, folder / "heights.png", synthetic=synthetic))
        files.append(
            figures.relief(surface, folder / "relief.png", exaggeration=exaggeration, synthetic=synthetic)
        )
    if texture.spacing is not None:
        files.append(figures.directions(surface, texture, folder / "directions.png", synthetic=synthetic))
    return files


def write_picture(picture: NDArray[Any], path: str | Path, kind: str) -> Path:
    """Write a picture with the type of number that its frames had (8 bits where the format holds no more)."""
    import imageio.v3 as iio

    path = Path(path)
    eight = path.suffix.lower() in (".jpg", ".jpeg")
    whole = np.dtype(kind).kind in "ui"
    if whole:
        top = np.iinfo(kind).max
        values = np.clip(np.rint(picture), 0, top)
        out = (values * (255.0 / top)).astype(np.uint8) if eight else values.astype(kind)
    elif path.suffix.lower() in (".tif", ".tiff"):
        out = picture.astype(np.float32)
    else:
        low, high = float(picture.min()), float(picture.max())
        out = np.rint(255.0 * (picture - low) / max(high - low, 1e-30)).astype(np.uint8)
    with atomic(path) as temporary:
        iio.imwrite(temporary, out)
    return path
