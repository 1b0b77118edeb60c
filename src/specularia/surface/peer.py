"""Every other surface file, through SurfaceTopography.

Its arrays are [x, y] with y running down the picture; for formats that define y as a coordinate (ISO 25178-71
and -72) its first y is the lowest.
"""

from __future__ import annotations

import logging
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from specularia.errors import FormatError
from specularia.surface.heightmap import HeightMap
from specularia.surface.origin import UNITS, Given, unit_in

__all__ = ["read"]

_Y_IS_A_COORDINATE = ("x3p", "sdf")

_SUFFIXES = ("plu", "al3d", "sur", "x3p", "opd", "sdf")
"""Formats that carry their own name as suffix: a damaged one must not pass for a text file, say."""


@contextmanager
def _hushed() -> Iterator[None]:
    """The readers that try a file and fail write to the log, some of them the file itself."""
    before = logging.root.manager.disable
    logging.disable(logging.CRITICAL)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            yield
    finally:
        logging.disable(before)


def read(path: Path, given: Given) -> HeightMap:
    """Read the default channel of any file that SurfaceTopography knows."""
    from SurfaceTopography.Exceptions import CannotDetectFileFormat
    from SurfaceTopography.IO import open_topography

    try:
        with _hushed(), open_topography(str(path)) as reader:
            kind = reader.format()
            channel = reader.default_channel
            sized = channel.physical_sizes is not None
            own_unit = channel.unit
            sizes = {} if sized else {"physical_sizes": tuple(float(n) for n in channel.nb_grid_pts)}
            topography = reader.topography(**sizes)
            masked: Any = np.ma.asarray(topography.heights(), dtype=float)
            heights: NDArray[np.float64] = np.ma.filled(masked, np.nan)
            dim, extent = topography.dim, topography.physical_sizes
            uniform = topography.is_uniform
    except CannotDetectFileFormat as error:
        raise FormatError(
            file=path,
            expected="a surface file (.plu, .al3d, .sur, .x3p, .opd, .sdf, .nms, .nc, .npy and others)",
            found=f"{path.stat().st_size} bytes of something else",
            advice="It may be truncated or of a format that cannot be read; export it as .x3p or .sur.",
        ) from error
    except Exception as error:
        # The readers let through whatever a damaged file makes their parsers raise.
        raise FormatError(
            file=path,
            expected="a whole surface file",
            found=f"one that cannot be read ({type(error).__name__}: {error})",
            advice="It may be truncated: copy it again.",
        ) from error
    suffix = path.suffix.lower().lstrip(".")
    if suffix in _SUFFIXES and kind != suffix:
        raise FormatError(
            file=path,
            expected=f"a whole .{suffix} file",
            found=f"one that only reads as {kind}",
            advice="It may be truncated: copy it again.",
        )
    if not uniform:
        raise FormatError(file=path, expected="an even grid", found="uneven positions")
    unit = unit_in(own_unit) if isinstance(own_unit, str) else None
    if unit is None:
        factor = given.needed_unit(path, "lengths")
    else:
        factor = UNITS[unit]
        given.refuse_unit(path, unit)
    if dim == 1:
        heights = heights.reshape(1, -1)
    else:
        heights = heights.T if kind in _Y_IS_A_COORDINATE else heights.T[::-1]
    rows, columns = heights.shape
    if not sized:
        pitch = given.needed_pitch(path)
    else:
        dx = float(extent[0]) / columns * factor
        dy = float(extent[1]) / rows * factor if dim == 2 else float("nan")
        pitch = given.checked_pitch(path, dx, dy)
    order = "highest y is the top of the picture, as other programs show it"
    if kind in _Y_IS_A_COORDINATE:
        order = "y is a coordinate of the format"
    return HeightMap(
        heights * factor, *pitch, name=path.stem, attributes={"format": kind, "row_order": order}
    )
