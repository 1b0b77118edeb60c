"""Height maps from microscopes' files: a registry of readers and the checks that all of them pass through.

Each reader tells from the first bytes and the suffix whether a file is its own. Readers of ours stand first;
everything else goes to SurfaceTopography. Whatever a reader returns is then checked for plausibility, since
a unit that is off by 1e3 or 1e6 leaves no other trace.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable
from pathlib import Path

import numpy as np

from specularia.errors import FormatError, SpeculariaWarning
from specularia.files import existing
from specularia.surface import arrays, nanofocus, netcdf, peer, tables
from specularia.surface.heightmap import HeightMap
from specularia.surface.origin import Given

__all__ = ["check", "read"]

_FIELD_UM = (0.05, 1e6)
"""Extents that a microscope or a scanned pane can have: 50 nm to 1 m."""

_PITCH_UM = (1e-5, 1e4)
"""Pixel sizes: an atom's to a centimetre."""

_HEAD = 4096


def _netcdf(path: Path, given: Given) -> HeightMap:
    found = netcdf.read(path)
    given.refuse_unit(path, "um")
    given.checked_pitch(path, found.pitch_x_um, found.pitch_y_um)
    return found.with_heights(found.heights_um, format="nc")


_REGISTRY: tuple[tuple[Callable[[Path, bytes], bool], Callable[[Path, Given], HeightMap]], ...] = (
    (lambda path, head: path.suffix.lower() == ".nc", _netcdf),
    (lambda path, head: path.suffix.lower() in (".npy", ".npz"), arrays.read),
    (nanofocus.is_ours, nanofocus.read),
    (tables.is_table, tables.read),
    (lambda path, head: True, peer.read),
)


def read(
    path: str | Path, *, pitch_um: float | tuple[float, float] | None = None, unit: str | None = None
) -> HeightMap:
    """Read a height map from any supported file.

    Parameters
    ----------
    path : a microscope's own file (through SurfaceTopography, or our readers of .nms and of text tables), our
        .nc, .npy or .npz.
    pitch_um : pixel size (one number or x, y) for a file that holds none; must agree with one that does.
    unit : m, mm, um, nm ... for a file that names none (otherwise um is assumed, with a warning).

    Returns
    -------
    HeightMap : row 0 at the lowest y, missing pixels NaN. Its attribute `format` names the format;
        `row_order` says what the rows of the file were taken for.

    Raises
    ------
    FormatError : no file, a damaged one, an unknown format, no pixel size, or one that cannot be right.
    """
    path = existing(path, what="a height map")
    if path.is_dir():
        raise FormatError(
            file=path, expected="a file", found="a folder", advice="A folder of images is a focus stack."
        )
    try:
        with path.open("rb") as f:
            head = f.read(_HEAD)
    except OSError as error:
        raise FormatError(file=path, expected="a readable file", found=str(error.strerror)) from error
    if not head:
        raise FormatError(file=path, expected="a height map", found="an empty file")
    given = Given(pitch_um, unit)
    parse = next(parse for accepts, parse in _REGISTRY if accepts(path, head))
    surface = parse(path, given)
    check(surface, file=path)
    return surface


def check(surface: HeightMap, *, file: Path) -> None:
    """Refuse what cannot be a measured surface, warn of what is unlikely.

    Refused: a field outside 50 nm to 1 m or a pixel outside 0.01 nm to 1 cm (a unit misread), no measured
    pixel. Warned of: a span of heights above the larger side of the field or of nothing, more than half of
    the pixels missing, pixels that are not square, a profile.
    """
    field_x, field_y = surface.field_um
    for extent, pitch in ((field_x, surface.pitch_x_um), (field_y, surface.pitch_y_um)):
        if np.isnan(extent):
            continue
        if not (_FIELD_UM[0] <= extent <= _FIELD_UM[1] and _PITCH_UM[0] <= pitch <= _PITCH_UM[1]):
            raise FormatError(
                file=file,
                expected="a field between 50 nm and 1 m",
                found=f"{extent:.6g} um in pixels of {pitch:.6g} um",
                advice="A unit was misread or misstated: check the pixel size, or state unit and pitch.",
            )
    if surface.missing == surface.heights_um.size:
        raise FormatError(file=file, expected="measured heights", found="none: every pixel is missing")

    def warn(text: str) -> None:
        warnings.warn(f"{file.name}: {text}", SpeculariaWarning, stacklevel=4)

    share = surface.missing / surface.heights_um.size
    if share > 0.5:
        warn(f"{surface.missing} of {surface.heights_um.size} pixels ({share:.0%}) are missing.")
    if surface.range_um > np.nanmax(surface.field_um):
        warn(
            f"heights span {surface.range_um:.4g} um over a field of {np.nanmax(surface.field_um):.4g} um; "
            "the height unit may be wrong."
        )
    elif surface.range_um == 0 and surface.heights_um.size - surface.missing > 1:
        warn("every height is the same; this may be another channel than the heights.")
    if surface.is_profile:
        warn("this is a profile, not a map: one row, no extent in y.")
    elif abs(surface.pitch_x_um / surface.pitch_y_um - 1.0) > 0.01:
        warn(f"pixels are not square: {surface.pitch_x_um:.6g} x {surface.pitch_y_um:.6g} um.")
