"""Grids of points at which illuminance is wanted, and the daylight factor."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from specularia.daylight.geometry import Box
from specularia.daylight.job import Sensor
from specularia.daylight.outdoors import Outdoors
from specularia.daylight.own_geometry import OwnRoom
from specularia.daylight.results import GridResult, Point
from specularia.daylight.views import Grid
from specularia.errors import FormatError

__all__ = ["Place", "check_grids", "grid_sensors", "places", "reference_illuminance", "split"]

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Place:
    """Where the points of a grid lie.

    Attributes
    ----------
    grid : what it comes from.
    corner, edges : [3] corner, and the two edges [2, 3] of the rectangle in m.
    along, across : [columns], [rows] distances of the points along the two edges, m.
    points : [rows, columns, 3].
    normal : [3] of the lit side.
    """

    grid: Grid
    corner: Array
    edges: Array
    along: Array
    across: Array
    points: Array
    normal: Array


def places(box: Box | OwnRoom) -> list[Place]:
    """The points of every grid of a room, each in the middle of one of equal cells."""
    return [_place(grid, box) for grid in box.job.grid]


def _place(grid: Grid, box: Box | OwnRoom) -> Place:
    if grid.origin_m is not None:
        corner, edges = np.array(grid.origin_m), np.array([grid.along_m, grid.across_m], float)
        normal = np.cross(*edges)
    else:
        face = box.faces[grid.face or "floor"]
        m = grid.margin_m
        corner = face.point(m, m) + np.array([0.0, 0.0, grid.height_m or 0.0])
        edges = np.stack([face.along * (face.size[0] - 2 * m), face.across * (face.size[1] - 2 * m)])
        normal = face.normal
    length = np.linalg.norm(edges, axis=1)
    along, across = (_middles(float(a), grid.spacing_m) for a in length)
    u, v = along / length[0], across / length[1]
    points = corner + u[None, :, None] * edges[0] + v[:, None, None] * edges[1]
    return Place(grid, corner, edges, along, across, points, normal / np.linalg.norm(normal))


def _middles(length: float, spacing: float) -> Array:
    n = max(int(np.ceil(length / spacing - 1e-9)), 1)
    return np.asarray((np.arange(n) + 0.5) * (length / n), float)


def check_grids(box: Box, file: Path) -> None:
    """Raise a FormatError for a grid that leaves the room or whose margin leaves nothing."""
    for grid in box.job.grid:
        if grid.origin_m is None:
            size = box.faces[grid.face or "floor"].size
            if 2 * grid.margin_m >= min(size):
                raise FormatError(
                    file=file,
                    expected=f"a margin_m of grid {grid.name!r} below {min(size) / 2:g} m",
                    found=f"margin_m = {grid.margin_m:g}",
                )
        place = _place(grid, box)
        ends = np.array([place.corner, place.corner + place.edges[0], place.corner + place.edges[1]])
        ends = np.vstack([ends, place.corner + place.edges.sum(axis=0)])
        if np.any(ends < -1e-6) or np.any(ends > box.size + 1e-6):
            raise FormatError(
                file=file,
                expected=f"grid {grid.name!r} inside the room of {' x '.join(f'{v:g}' for v in box.size)} m",
                found=f"corners at {np.round(ends, 4).tolist()}",
            )
        for face in box.faces.values():
            flat = np.all(np.abs(face.coordinates(ends)[2]) < 1e-3)
            if flat and float(face.normal @ place.normal) < 0.0:
                raise FormatError(
                    file=file,
                    expected=f"grid {grid.name!r} on the {face.name} facing into the room",
                    found="one that faces into it",
                    advice="Change along_m and across_m round, or name the face.",
                )


def grid_sensors(box: Box | OwnRoom) -> list[Sensor]:
    """A sensor at every point of every grid, in the order in which `split` expects them."""
    return [
        Sensor.model_construct(name="", position_m=tuple(point), normal=tuple(place.normal))
        for place in places(box)
        for point in place.points.reshape(-1, 3).tolist()
    ]


def split(
    points: Sequence[Point], *, model: str, box: Box | OwnRoom, out: Outdoors
) -> tuple[list[Point], list[GridResult]]:
    """Named sensors, and grids, out of the results at the sensors followed by `grid_sensors`.

    Where there is one, the daylight factor is added: 100 E / E_outside.
    """
    outside, _ = reference_illuminance(out)
    count = len(box.job.sensor)
    named = list(points[:count])
    if outside is not None:
        named = [replace(p, daylight_factor_percent=100.0 * p.illuminance_lx / outside) for p in named]
    grids, at = [], count
    for place in places(box):
        shape = place.points.shape[:2]
        part = points[at : at + shape[0] * shape[1]]
        at += len(part)
        total, se, direct, indirect = (
            np.array([getattr(p, key) for p in part]).reshape(shape)
            for key in ("illuminance_lx", "se", "direct_lx", "indirect_lx")
        )
        grids.append(
            GridResult(
                name=place.grid.name,
                model=model,
                along_m=place.along,
                across_m=place.across,
                points_m=place.points,
                normal=place.normal,
                illuminance_lx=total,
                se=se,
                direct_lx=direct,
                indirect_lx=indirect,
                daylight_factor_percent=None if outside is None else 100.0 * total / outside,
                chromaticity_xy=None
                if any(p.chromaticity_xy is None for p in part)
                else np.array([p.chromaticity_xy for p in part]).reshape(*shape, 2),
            )
        )
    return named, grids


def reference_illuminance(out: Outdoors) -> tuple[float | None, str]:
    """Horizontal illuminance outside that daylight factors are counted from, or None and why there is none.

    A daylight factor belongs to an overcast sky without sun (CIE 16-1970; EN 17037).
    """
    if out.kind != "overcast":
        return None, f"a daylight factor belongs to an overcast sky; this one is {out.kind}"
    if out.sun_illuminance > 0.0:
        return None, "a daylight factor belongs to a sky without sun; this one has direct sun"
    if out.sky_illuminance <= 0.0:
        return None, "the sky sheds no light"
    return out.sky_illuminance, ""
