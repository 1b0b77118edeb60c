"""Height maps as NumPy files: the quickest way in from a program of one's own."""

from __future__ import annotations

import zipfile
import zlib
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from specularia.errors import FormatError
from specularia.surface.heightmap import HeightMap
from specularia.surface.origin import UNITS, Given, unit_in

__all__ = ["read"]


def read(path: Path, given: Given) -> HeightMap:
    """Read .npy (heights [row, column], row 0 at the lowest y, NaN where missing) or .npz.

    Heights are in um by definition of these two formats, unless `given.unit` states another unit. A .npy
    needs `given.pitch_um`. An .npz holds heights_um and may hold pitch_um or pitch_x_um and pitch_y_um,
    sigma_um and image.
    """
    kind = path.suffix.lower().lstrip(".")
    layers: dict[str, NDArray[Any]] = {}
    try:
        loaded = np.load(path, allow_pickle=False)
        if isinstance(loaded, np.ndarray):
            heights = loaded
        else:
            with loaded:
                layers = {k: loaded[k] for k in loaded.files}
            if "heights_um" not in layers:
                raise FormatError(
                    file=path, expected="an array heights_um", found=", ".join(layers) or "an empty archive"
                )
            heights = layers["heights_um"]
    except (ValueError, OSError, EOFError, KeyError, zipfile.BadZipFile, zlib.error) as error:
        raise FormatError(
            file=path,
            expected=f"a whole .{kind} file of numbers",
            found=f"one that cannot be read ({error})",
            advice="It may be truncated: make it again or copy it again.",
        ) from error
    if heights.ndim != 2 or heights.dtype.kind not in "fiu" or heights.size == 0:
        raise FormatError(
            file=path,
            expected="real numbers [row, column]",
            found=f"{heights.dtype} of shape {heights.shape}",
            advice="A focus stack [slice, row, column] goes to `specularia surface heights`.",
        )
    factor = 1.0 if given.unit is None else UNITS[unit_in(given.unit) or given.unit]
    if "pitch_um" in layers:
        own = float(layers["pitch_um"]), float(layers["pitch_um"])
    elif "pitch_x_um" in layers and "pitch_y_um" in layers:
        own = float(layers["pitch_x_um"]), float(layers["pitch_y_um"])
    else:
        own = given.needed_pitch(path)
    pitch = given.checked_pitch(path, *own)
    heights = heights.astype(np.float64)
    heights[~np.isfinite(heights)] = np.nan
    return HeightMap(
        heights * factor,
        *pitch,
        sigma_um=layers.get("sigma_um"),
        image=layers.get("image"),
        name=path.stem,
        attributes={"format": kind},
    )
