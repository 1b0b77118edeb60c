"""What cannot be right about a room, found before any rendering."""

from __future__ import annotations

import warnings
from collections.abc import Mapping
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from specularia.bsdf import ScatteringModel
from specularia.daylight.geometry import ROOM, Box
from specularia.daylight.grids import check_grids
from specularia.daylight.job import RoomJob
from specularia.daylight.outdoors import sun_direction
from specularia.daylight.own_geometry import OwnRoom
from specularia.errors import CoverageError, FormatError, SpeculariaWarning

__all__ = ["check_models", "check_room", "check_sun", "room_of"]

Array = NDArray[np.float64]

_TOUCH = 1e-6
"""Metres within which a point counts as on a face."""


def room_of(job: RoomJob, file: Path) -> Box | OwnRoom:
    """The room of a job, after the checks of this module."""
    if job.geometry is not None:
        own = OwnRoom(job, file)
        check_sun(own, file)
        needs_box = [f"view {v.name!r}, a plan," for v in job.view if v.position_m is None]
        needs_box += [f"grid {g.name!r} by face or height" for g in job.grid if g.origin_m is None]
        if needs_box:
            raise FormatError(
                file=file,
                expected="views and grids placed by coordinates in a room from files",
                found=f"{needs_box[0]} that needs a box",
                advice="Give a grid origin_m, along_m and across_m; for a plan look from above.",
            )
        return own
    box = Box(job)
    check_room(box, file)
    return box


def check_room(box: Box, file: Path) -> None:
    """Raise a FormatError for geometry or a sun that cannot be; warn where the sun misses a pane."""
    _check_windows(box, file)
    check_sun(box, file)
    for sensor in box.job.sensor:
        _check_sensor(box, sensor.name, np.array(sensor.position_m), np.array(sensor.normal), file)
    check_grids(box, file)
    for view in box.job.view:
        if view.position_m is None:
            continue
        at = np.array([view.position_m])
        if box.spaces(at)[0] < ROOM or box.distance(at)[0] < 0.01:
            raise FormatError(
                file=file,
                expected=f"view {view.name!r} at least 0.01 m inside the room of {_size(box)}",
                found=f"position_m = {list(view.position_m)}, in a wall or outside",
            )


def _size(box: Box) -> str:
    return " x ".join(f"{v:g}" for v in box.size) + " m"


def _check_windows(box: Box, file: Path) -> None:
    for k, (window, o) in enumerate(zip(box.job.window, box.mouths)):
        width, height = box.faces[window.wall].size
        if o.u0 < -_TOUCH or o.v0 < -_TOUCH or o.u1 > width + _TOUCH or o.v1 > height + _TOUCH:
            raise FormatError(
                file=file,
                expected=f"window {window.name!r} within its wall of {width:g} x {height:g} m",
                found=f"an opening at {o.u0:g} to {o.u1:g} m along and {o.v0:g} to {o.v1:g} m up the wall, "
                "its splay included",
            )
        for other, mouth in zip(box.job.window[:k], box.mouths):
            if other.wall == window.wall and mouth.shared(o) > 1e-9:
                raise FormatError(
                    file=file,
                    expected="windows that do not overlap",
                    found=f"{other.name!r} and {window.name!r} in the {window.wall} wall do",
                    advice="Set centre_m (and sill_m) of each.",
                )


def check_sun(box: Box | OwnRoom, file: Path) -> None:
    """Raise a FormatError for a sun below the horizon; warn where it stands behind panes."""
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
    # All panes of a window look the same way; those of a room from files are asked one by one.
    names = {p.window if box.job.window else k: p for k, p in enumerate(box.panes)}
    turned = {k: float(p.axes[2] @ sun) <= 0.0 for k, p in names.items()}
    behind = [
        box.job.window[k].name if box.job.window else names[k].name for k, away in turned.items() if away
    ]
    total = len(turned)
    if behind and box.job.sun_shines:
        warnings.warn(
            f"the sun stands behind the wall of {len(behind)} of {total} windows "
            f"({', '.join(behind)}): only sky and ground light them.",
            SpeculariaWarning,
            stacklevel=2,
        )


def _check_sensor(box: Box, name: str, at: Array, normal: Array, file: Path) -> None:
    if box.spaces(at[None])[0] < ROOM:
        raise FormatError(
            file=file,
            expected=f"sensor {name!r} inside the room of {_size(box)}",
            found=f"position_m = {at.tolist()}, in a wall or outside",
        )
    for face in box.faces.values():
        u, v, height = face.coordinates(at)
        if abs(height) < 1e-3 and face.holds(u, v) and float(face.normal @ normal) < -1e-6:
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
