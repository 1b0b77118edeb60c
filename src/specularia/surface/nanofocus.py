"""NanoFocus .nms height maps (usurf confocal microscopes), decoded here.

SurfaceTopography takes the pixel size of these files for millimetres where it is in nanometres, so its field
is 160 m wide, and scales the raw heights by 65534 where the stored extremes belong to 0 and 65535.

Layout, all little-endian: at 16 lowest and highest height in um (2 doubles); at 1368 columns and rows
(2 unsigned 32-bit), then the pixel size in x and y in nm (2 doubles); at 3468 the heights row by row
(unsigned 16-bit, linear from lowest to highest); then, in the files seen, one byte of brightness per pixel.
"""

from __future__ import annotations

import struct
from pathlib import Path

import numpy as np

from specularia.errors import FormatError
from specularia.surface.heightmap import HeightMap
from specularia.surface.origin import Given

__all__ = ["is_ours", "read"]

_MARK, _MARK_AT = b"OM_MS_", 0x21
_EXTREMES_AT, _GRID_AT, _HEADER = 16, 1368, 3468
_LARGEST = 100_000


def is_ours(path: Path, head: bytes) -> bool:
    """Whether the mark of these files stands at its place, or the file is called .nms."""
    return _MARK in head[_MARK_AT - 1 : _MARK_AT + 8] or path.suffix.lower() == ".nms"


def read(path: Path, given: Given) -> HeightMap:
    """Read an .nms file; the first stored row is the top of the microscope's picture."""
    data = path.read_bytes()
    if len(data) < _HEADER:
        raise FormatError(
            file=path,
            expected=f"an .nms header of {_HEADER} bytes",
            found=f"{len(data)} bytes",
            advice="The file is truncated: copy it again.",
        )
    lowest, highest = struct.unpack_from("<dd", data, _EXTREMES_AT)
    columns, rows, dx_nm, dy_nm = struct.unpack_from("<IIdd", data, _GRID_AT)
    if not (
        0 < columns <= _LARGEST and 0 < rows <= _LARGEST and dx_nm > 0 and dy_nm > 0 and highest >= lowest
    ):
        raise FormatError(
            file=path,
            expected="the grid and pixel size of an .nms file",
            found=f"{columns} x {rows} pixels of {dx_nm:g} x {dy_nm:g} nm, {lowest:g} to {highest:g} um",
            advice="This is another format, or another version of this one.",
        )
    size = rows * columns
    if len(data) < _HEADER + 2 * size:
        raise FormatError(
            file=path,
            expected=f"{_HEADER + 2 * size} bytes for {columns} x {rows} heights",
            found=f"{len(data)} bytes",
            advice="The file is truncated: copy it again.",
        )
    raw = np.frombuffer(data, "<u2", size, _HEADER).reshape(rows, columns)[::-1]
    heights = lowest + raw * ((highest - lowest) / 65535.0)
    image = None
    if len(data) == _HEADER + 3 * size:
        image = np.frombuffer(data, "u1", size, _HEADER + 2 * size).reshape(rows, columns)[::-1].astype(float)
    given.refuse_unit(path, "um and nm")
    pitch_x, pitch_y = given.checked_pitch(path, dx_nm * 1e-3, dy_nm * 1e-3)
    return HeightMap(
        heights,
        pitch_x,
        pitch_y,
        image=image,
        name=path.stem,
        attributes={"format": "nms", "row_order": "first stored row is the top of the picture"},
    )
