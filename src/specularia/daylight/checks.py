"""What cannot be right about a room, found before any rendering."""

from __future__ import annotations

import warnings
from collections.abc import Mapping
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from specularia.bsdf import ScatteringModel
from specularia.daylight.geometry import Box
from specularia.daylight.grids import check_grids
from specularia.daylight.outdoors import sun_direction
from specularia.errors import CoverageError, FormatError, SpeculariaWarning

__all__ = ["check_models", "check_room"]

Array = NDArray[np.float64]

_TOUCH = 1e-6
"""Metres within which a point counts as on a face."""


def check_room(box: Box, file: Path) -> None:
    """Raise a FormatError for geometry or a sun that cannot be; warn where the sun misses a pane."""
    _check_windows(box, file)
    _check_sun(box, file)
    for sensor in box.job.sensor:
        _check_sensor(box, sensor.name, np.array(sensor.position_m), np.array(sensor.normal), file)
    check_grids(box, file)
    for view in box.job.view:
        if view.position_m is None:
            continue
        at = np.array(view.position_m)
        if np.any(at < 0.01) or np.any(at > box.size - 0.01):
            raise FormatError(
                file=file,
                expected=f"view {view.name!r} at least 0.01 m inside the room of {_size(box)}",
                found=f"position_m = {list(view.position_m)}, in a wall or outside",
            )


def _size(box: Box) -> str:
    return " x ".join(f"{v:g}" for v in box.size) + " m"


def _check_windows(box: Box, file: Path) -> None:
    for k, pane in enumerate(box.panes):
        width, height = box.faces[pane.window.wall].size
        o = pane.opening
        if o.u0 < -_TOUCH or o.v0 < -_TOUCH or o.u1 > width + _TOUCH or o.v1 > height + _TOUCH:
            raise FormatError(
                file=file,
                expected=f"window {pane.window.name!r} within its wall of {width:g} x {height:g} m",
                found=f"an opening at {o.u0:g} to {o.u1:g} m along and {o.v0:g} to {o.v1:g} m up the wall",
            )
        for other in box.panes[:k]:
            if other.window.wall == pane.window.wall and other.opening.overlaps(o):
                raise FormatError(
                    file=file,
                    expected="windows that do not overlap",
                    found=f"{other.window.name!r} and {pane.window.name!r} in the {pane.window.wall} wall do",
                    advice="Set centre_m (and sill_m) of each.",
                )


def _check_sun(box: Box, file: Path) -> None:
    if box.job.sun is None:
        return
    if box.job.sun.elevation_deg <= 0.0:
        raise FormatError(
            file=file,
            expected="a sun above the horizon",
            found=f"elevation_deg = {box.job.sun.elevation_deg:g}",
            advice="Leave the table [sun] out for a room without sun.",
        )
    sun = sun_direction(box.job)
    behind = [p.window.name for p in box.panes if float(p.axes[2] @ sun) <= 0.0]
    if behind and box.job.sun_shines:
        warnings.warn(
            f"the sun stands behind the wall of {len(behind)} of {len(box.panes)} windows "
            f"({', '.join(behind)}): only sky and ground light them.",
            SpeculariaWarning,
            stacklevel=2,
        )


def _check_sensor(box: Box, name: str, at: Array, normal: Array, file: Path) -> None:
    if np.any(at < -_TOUCH) or np.any(at > box.size + _TOUCH):
        raise FormatError(
            file=file,
            expected=f"sensor {name!r} inside the room of {_size(box)}",
            found=f"position_m = {at.tolist()}, in a wall or outside",
        )
    for face in box.faces.values():
        height = float(face.coordinates(at)[2])
        if height < 1e-3 and float(face.normal @ normal) < -1e-6:
            raise FormatError(
                file=file,
                expected=f"sensor {name!r} on the {face.name} facing into the room",
                found=f"normal = {normal.tolist()}, into the {face.name}",
                advice=f"Use normal = {[float(v) for v in face.normal]}.",
            )


def check_models(models: Mapping[str, ScatteringModel]) -> None:
    """Raise a CoverageError for a model that does not know what passes from outdoors into the room."""
    for name, model in models.items():
        missing = {"transmission_front", "transmission_back"} - set(model.sides)
        if missing:
            raise CoverageError(
                f"model {name!r} lacks {' and '.join(sorted(missing)).replace('_', ' ')} (it holds "
                f"{', '.join(model.sides)}); a pane needs what passes from outdoors into the room."
            )
