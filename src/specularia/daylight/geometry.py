"""The box room as rectangles: faces, openings, panes and the frames of reference of each."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from typing import Final

import numpy as np
from numpy.typing import NDArray

from specularia.daylight.job import RoomJob, Wall, Window

__all__ = ["FACES", "Box", "Face", "Pane", "Rectangle", "pane_axes"]

Array = NDArray[np.float64]

FACES: Final = ("south", "north", "west", "east", "floor", "ceiling")

_OUTWARD: Final[dict[Wall, tuple[float, float, float]]] = {
    "south": (0.0, -1.0, 0.0),
    "north": (0.0, 1.0, 0.0),
    "west": (-1.0, 0.0, 0.0),
    "east": (1.0, 0.0, 0.0),
}


def pane_axes(wall: Wall) -> Array:
    """[3, 3] rows: the sample's x, y and z in the room, for a pane in this wall.

    z is the outward normal (the front is outdoors), y is up, x = y cross z points to the right of somebody
    who looks at the wall from outside.
    """
    up, out = np.array([0.0, 0.0, 1.0]), np.array(_OUTWARD[wall])
    return np.stack([np.cross(up, out), up, out])


@dataclass(frozen=True)
class Face:
    """One face of the box: point(u, v) = origin + u along + v across; `normal` points into the room."""

    name: str
    origin: Array
    along: Array
    across: Array
    normal: Array
    size: tuple[float, float]
    reflectance: float

    def point(self, u: Array | float, v: Array | float) -> Array:
        """[..., 3] points of the face."""
        u, v = np.broadcast_arrays(np.asarray(u, float), np.asarray(v, float))
        return self.origin + u[..., None] * self.along + v[..., None] * self.across

    def coordinates(self, points: Array) -> tuple[Array, Array, Array]:
        """(u, v, height above the face) of [..., 3] points."""
        d = points - self.origin
        return d @ self.along, d @ self.across, d @ self.normal


@dataclass(frozen=True)
class Rectangle:
    """u0 <= u <= u1, v0 <= v <= v1 on a face."""

    u0: float
    v0: float
    u1: float
    v1: float

    @property
    def area(self) -> float:
        """In m2."""
        return (self.u1 - self.u0) * (self.v1 - self.v0)

    def holds(self, u: Array, v: Array) -> NDArray[np.bool_]:
        """Whether points of the face lie in it, border included."""
        return (u >= self.u0) & (u <= self.u1) & (v >= self.v0) & (v <= self.v1)

    def overlaps(self, other: Rectangle) -> bool:
        """Whether the two share more than a border."""
        return (
            min(self.u1, other.u1) - max(self.u0, other.u0) > 1e-9
            and min(self.v1, other.v1) - max(self.v0, other.v0) > 1e-9
        )


@dataclass(frozen=True)
class Pane:
    """A pane in its opening; `axes` are the rows of `pane_axes`."""

    window: Window
    opening: Rectangle
    glass: Rectangle
    axes: Array
    centre: Array


class Box:
    """Faces and panes of a room.

    Attributes
    ----------
    faces : `Face` by name, in the order of `FACES`.
    panes : `Pane` of every window, in the order of the job.
    size : width, depth, height in m.
    """

    def __init__(self, job: RoomJob) -> None:
        w, d, h = job.room.width_m, job.room.depth_m, job.room.height_m
        self.job = job
        self.size = np.array([w, d, h])
        x, y, z = np.eye(3)
        zero, r = np.zeros(3), job.reflectance
        self.faces = {
            "south": Face("south", zero, x, z, y, (w, h), r.walls),
            "north": Face("north", d * y, x, z, -y, (w, h), r.walls),
            "west": Face("west", zero, y, z, x, (d, h), r.walls),
            "east": Face("east", w * x, y, z, -x, (d, h), r.walls),
            "floor": Face("floor", zero, x, y, z, (w, d), r.floor),
            "ceiling": Face("ceiling", h * z, x, y, -z, (w, d), r.ceiling),
        }
        self.panes = [self._pane(window) for window in job.window]

    def _pane(self, window: Window) -> Pane:
        face = self.faces[window.wall]
        centre = face.size[0] / 2 if window.centre_m is None else window.centre_m
        u0, v0 = centre - window.width_m / 2, window.sill_m
        u1, v1 = u0 + window.width_m, v0 + window.height_m
        f = window.frame_m
        return Pane(
            window=window,
            opening=Rectangle(u0, v0, u1, v1),
            glass=Rectangle(u0 + f, v0 + f, u1 - f, v1 - f),
            axes=pane_axes(window.wall),
            centre=face.point((u0 + u1) / 2, (v0 + v1) / 2),
        )

    def panes_in(self, face: str) -> list[int]:
        """Indices of the panes in a face."""
        return [k for k, pane in enumerate(self.panes) if pane.window.wall == face]

    def lines(self, face: str, spacing: float) -> tuple[Array, Array]:
        """Grid lines over a face, at most `spacing` apart, that follow every border of openings and panes."""
        f = self.faces[face]
        us, vs = {0.0, f.size[0]}, {0.0, f.size[1]}
        for k in self.panes_in(face):
            for r in (self.panes[k].opening, self.panes[k].glass):
                us |= {r.u0, r.u1}
                vs |= {r.v0, r.v1}
        return _filled(sorted(us), spacing), _filled(sorted(vs), spacing)

    def cells(self, face: str, spacing: float) -> list[tuple[Rectangle, int]]:
        """Rectangles that cover a face, each with its part: -2 bare face, -1 frame, k pane k."""
        us, vs = self.lines(face, spacing)
        rectangles = [
            Rectangle(float(a), float(c), float(b), float(d))
            for a, b in pairwise(us)
            for c, d in pairwise(vs)
        ]
        u = np.array([(r.u0 + r.u1) / 2 for r in rectangles])
        v = np.array([(r.v0 + r.v1) / 2 for r in rectangles])
        return list(zip(rectangles, (int(p) for p in self.part(face, u, v))))

    def part(self, face: str, u: Array, v: Array) -> NDArray[np.intp]:
        """What lies at (u, v) of a face: -2 bare face, -1 frame, k pane k."""
        part = np.full(u.shape, -2, dtype=np.intp)
        for k in self.panes_in(face):
            part[self.panes[k].opening.holds(u, v)] = -1
            part[self.panes[k].glass.holds(u, v)] = k
        return part

    def locate(self, points: Array) -> tuple[NDArray[np.intp], NDArray[np.intp], Array, Array]:
        """Which surface [K, 3] points lie on.

        Returns
        -------
        face : [K] index into `FACES` of the nearest face.
        part : [K] -2 for the bare face, -1 for a frame, k for pane k.
        u, v : [K] coordinates on that face.
        """
        heights = np.stack([np.abs(f.coordinates(points)[2]) for f in self.faces.values()])
        face = np.argmin(heights, axis=0)
        part = np.full(len(points), -2, dtype=np.intp)
        u, v = np.zeros(len(points)), np.zeros(len(points))
        for index, f in enumerate(self.faces.values()):
            here = np.flatnonzero(face == index)
            u[here], v[here], _ = f.coordinates(points[here])
            part[here] = self.part(f.name, u[here], v[here])
        return face, part, u, v

    def lifted(self, points: Array, by: float = 1e-4) -> Array:
        """Points moved into the room so that they lie at least `by` metres off every face.

        A millimetre would move illuminances on a steep flank of a lobe by half a per cent.
        """
        return np.clip(points, by, self.size - by)


def _filled(edges: list[float], spacing: float) -> Array:
    """Edges with lines put between them, evenly and at most `spacing` apart."""
    out = [edges[0]]
    for a, b in pairwise(edges):
        if b - a > 1e-9:
            n = max(int(np.ceil((b - a) / spacing - 1e-9)), 1)
            out.extend(float(a + (b - a) * k / n) for k in range(1, n + 1))
    return np.array(out)
