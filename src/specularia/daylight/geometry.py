"""The box room as flat faces: walls with openings, niches of windows, panes and their frames of reference."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from typing import Final

import numpy as np
from numpy.typing import NDArray

from specularia.daylight._fields import Shade
from specularia.daylight.colour import LUMINANCE
from specularia.daylight.job import RoomJob, Wall, Window

__all__ = ["FACES", "Box", "Cell", "Face", "Pane", "Rectangle", "pane_axes"]

Array = NDArray[np.float64]

FACES: Final = ("south", "north", "west", "east", "floor", "ceiling")

_OUTWARD: Final[dict[Wall, tuple[float, float, float]]] = {
    "south": (0.0, -1.0, 0.0),
    "north": (0.0, 1.0, 0.0),
    "west": (-1.0, 0.0, 0.0),
    "east": (1.0, 0.0, 0.0),
}

ROOM: Final = -1
"""`Face.space` of the box itself; the niche of window k has k."""


def pane_axes(wall: Wall, turn_deg: float = 0.0) -> Array:
    """[3, 3] rows: the sample's x, y and z in the room, for a pane in this wall.

    z is the outward normal (the front is outdoors), y is up, x = y cross z points to the right of somebody
    who looks at the wall from outside; all turned by `turn_deg` about z.
    """
    up, out = np.array([0.0, 0.0, 1.0]), np.array(_OUTWARD[wall])
    c, s = np.cos(np.radians(turn_deg)), np.sin(np.radians(turn_deg))
    right = np.cross(up, out)
    return np.stack([c * right + s * up, c * up - s * right, out])


@dataclass(frozen=True)
class Rectangle:
    """u0 <= u <= u1, v0 <= v <= v1 on a face."""

    u0: float
    v0: float
    u1: float
    v1: float

    def holds(self, u: Array, v: Array) -> NDArray[np.bool_]:
        """Whether points of the face lie in it, border included."""
        return (u >= self.u0) & (u <= self.u1) & (v >= self.v0) & (v <= self.v1)

    def shared(self, other: Rectangle) -> float:
        """Area of what two rectangles have in common, m2."""
        width = min(self.u1, other.u1) - max(self.u0, other.u0)
        return max(width, 0.0) * max(min(self.v1, other.v1) - max(self.v0, other.v0), 0.0)

    @property
    def area(self) -> float:
        """In m2."""
        return (self.u1 - self.u0) * (self.v1 - self.v0)


@dataclass(frozen=True)
class Face:
    """A flat face whose lower and upper edges are parallel; `normal` points into the room.

    Attributes
    ----------
    corners : [4, 3] at (0, 0), (U, 0), (U, V), (0, V) in its own coordinates u and v, m; a rectangle, or, for
        the splayed reveals of a window, a trapezoid whose U is the mean of both edges.
    shade : reflectance, grey or R, G and B.
    space : `ROOM`, or the window in whose niche the face lies.
    holes : rectangles that are not there.
    """

    name: str
    corners: Array
    normal: Array
    shade: Shade
    space: int = ROOM
    holes: tuple[Rectangle, ...] = ()

    @property
    def reflectance(self) -> float:
        """For white light."""
        return float(LUMINANCE @ self.shade) if isinstance(self.shade, tuple) else self.shade

    @property
    def rgb(self) -> Array:
        """[3] reflectance in R, G and B."""
        return np.broadcast_to(np.asarray(self.shade, float), (3,))

    @property
    def along(self) -> Array:
        """Unit vector of growing u."""
        edge = self.corners[1] - self.corners[0] + self.corners[2] - self.corners[3]
        return np.asarray(edge / np.linalg.norm(edge))

    @property
    def across(self) -> Array:
        """Unit vector in the face, square to `along`, of growing v."""
        edge = self.corners[3] - self.corners[0]
        edge = edge - (edge @ self.along) * self.along
        return np.asarray(edge / np.linalg.norm(edge))

    @property
    def size(self) -> tuple[float, float]:
        """U and V in m."""
        c = self.corners
        width = 0.5 * (np.linalg.norm(c[1] - c[0]) + np.linalg.norm(c[2] - c[3]))
        return float(width), float((c[3] - c[0]) @ self.across)

    def point(self, u: Array | float, v: Array | float) -> Array:
        """[..., 3] points of the face."""
        width, height = self.size
        s, t = (a[..., None] for a in np.broadcast_arrays(np.asarray(u) / width, np.asarray(v) / height))
        a, b, c, d = self.corners
        return np.asarray((1 - t) * ((1 - s) * a + s * b) + t * ((1 - s) * d + s * c))

    def coordinates(self, points: Array) -> tuple[Array, Array, Array]:
        """(u, v, height above the face) of [..., 3] points."""
        width, height = self.size
        a, b, c, d = self.corners
        t = (points - a) @ self.across / height
        first, last = (d - a) @ self.along, np.linalg.norm(c - d)
        edge = np.linalg.norm(b - a)
        s = ((points - a) @ self.along - t * first) / (edge + t * (last - edge))
        return s * width, t * height, (points - a) @ self.normal

    def holds(self, u: Array, v: Array, by: float = 1e-6) -> NDArray[np.bool_]:
        """Whether points lie within the face, or at most `by` m beside it, and in none of its holes."""
        width, height = self.size
        inside = (u >= -by) & (u <= width + by) & (v >= -by) & (v <= height + by)
        for hole in self.holes:
            inside &= ~Rectangle(hole.u0 + by, hole.v0 + by, hole.u1 - by, hole.v1 - by).holds(u, v)
        return inside


@dataclass(frozen=True)
class Pane:
    """One pane of a window.

    Attributes
    ----------
    name : of the window, with row and column as seen from inside where it has several panes.
    window, face : index of the window in the job; name of the face that holds frame and panes.
    glass : the pane on that face.
    model : name of its own [[glass]], or None for the model under comparison.
    axes : rows of `pane_axes`.
    centre : [3] m.
    """

    name: str
    window: int
    face: str
    glass: Rectangle
    model: str | None
    axes: Array
    centre: Array


@dataclass(frozen=True)
class Cell:
    """A rectangle of a face; `part` is -2 for the bare face, -1 for a frame or bar, k for pane k."""

    rectangle: Rectangle
    part: int


class Box:
    """Faces and panes of a room.

    Attributes
    ----------
    faces : `Face` by name: first those of `FACES`, then of each window the face of frame and panes
        ("<window>: glazing") and, where it lies in a niche, its reveals.
    panes : `Pane` of every window, in the order of the job, rows from the top, as seen from inside.
    mouths : of each window, the opening of its niche on the wall's face.
    size : width, depth, height in m.
    text, polygons : of a room from files (`own_geometry.OwnRoom`); none here.
    """

    def __init__(self, job: RoomJob) -> None:
        w, d, h = job.box.width_m, job.box.depth_m, job.box.height_m
        self.job = job
        self.size = np.array([w, d, h])
        self.text = ""
        self.polygons: list[tuple[Array, float]] = []
        x, y, z = np.eye(3)
        zero, r = np.zeros(3), job.reflectance
        plan = {
            "south": (zero, w * x, h * z, y, r.walls),
            "north": (d * y, w * x, h * z, -y, r.walls),
            "west": (zero, d * y, h * z, x, r.walls),
            "east": (w * x, d * y, h * z, -x, r.walls),
            "floor": (zero, w * x, d * y, z, r.floor),
            "ceiling": (h * z, w * x, d * y, -z, r.ceiling),
        }
        self.mouths = [_mouth(k, plan[k.wall][1]) for k in job.window]
        self.faces: dict[str, Face] = {}
        for name, (o, a, b, normal, reflectance) in plan.items():
            holes = tuple(m for m, k in zip(self.mouths, job.window) if k.wall == name)
            corners = np.stack([o, o + a, o + a + b, o + b])
            self.faces[name] = Face(name, corners, normal, reflectance, holes=holes)
        self.panes: list[Pane] = []
        for index, window in enumerate(job.window):
            self._add(index, window)
        self.names = tuple(self.faces)

    def _add(self, index: int, window: Window) -> None:
        """The face of frame and panes, the reveals, and the panes of a window."""
        wall, mouth = self.faces[window.wall], self.mouths[index]
        opening, inner = _opening(window, wall.size[0]), window.inner_reveal_m
        space = index if inner > 0.0 else ROOM
        name = f"{window.name}: glazing"
        back = _corners(wall, opening) - inner * wall.normal
        frames = self.job.reflectance.frames
        glazing = Face(name, back, wall.normal, frames, space)
        self.faces[name] = glazing
        if inner > 0.0:
            front, middle = _corners(wall, mouth), back.mean(axis=0)
            shade = self.job.reflectance.reveals
            shade = wall.reflectance if shade is None else shade
            for k, side in enumerate(("sill", "end jamb", "head", "start jamb")):
                m = (k + 1) % 4
                corners = np.stack([front[k], front[m], back[m], back[k]])
                normal = np.cross(corners[1] - corners[0], corners[3] - corners[0])
                normal /= np.linalg.norm(normal)
                if normal @ (middle - corners.mean(axis=0)) < 0.0:
                    normal = -normal
                named = f"{window.name}: {side}"
                self.faces[named] = Face(named, corners, normal, shade, space)
        width, height = window.pane_size
        # Along the wall as the room sees it, from left to right: against the sample's x.
        leftwards = float(wall.along @ pane_axes(window.wall)[0]) > 0.0
        turns = {g.name: g.turn_deg for g in self.job.glass}
        for row in range(window.rows):
            for column in range(window.columns):
                model = window.panes[row][column] if window.panes else "*"
                place = window.columns - 1 - column if leftwards else column
                u = window.frame_m + place * (width + window.bar_m)
                v = window.height_m - window.frame_m - (row + 1) * height - row * window.bar_m
                glass = Rectangle(u, v, u + width, v + height)
                many = window.rows * window.columns > 1
                self.panes.append(
                    Pane(
                        name=f"{window.name} {row + 1}.{column + 1}" if many else window.name,
                        window=index,
                        face=name,
                        glass=glass,
                        model=None if model == "*" else model,
                        axes=pane_axes(window.wall, turns.get(model, 0.0)),
                        centre=glazing.point(u + width / 2, v + height / 2),
                    )
                )

    @property
    def coloured(self) -> bool:
        """Whether anything inside has a colour."""
        return any(np.ptp(f.rgb) > 0.0 for f in self.faces.values())

    @property
    def has_niches(self) -> bool:
        """Whether any pane lies behind the room side of its wall."""
        return any(w.inner_reveal_m > 0.0 for w in self.job.window)

    def mouth_corners(self, window: int) -> Array:
        """[4, 3] corners of the opening of a window's niche in its wall."""
        return _corners(self.faces[self.job.window[window].wall], self.mouths[window])

    def panes_in(self, face: str) -> list[int]:
        """Indices of the panes in a face."""
        return [k for k, pane in enumerate(self.panes) if pane.face == face]

    def cells(self, face: str, spacing: float, *, follow: bool) -> list[Cell]:
        """Rectangles at most `spacing` wide that cover a face.

        `follow` makes them keep to the borders of panes; without it the parts of a glazing are those at the
        cells' middles.
        """
        f = self.faces[face]
        us, vs = {0.0, f.size[0]}, {0.0, f.size[1]}
        borders = list(f.holes) + ([self.panes[k].glass for k in self.panes_in(face)] if follow else [])
        for r in borders:
            us |= {r.u0, r.u1}
            vs |= {r.v0, r.v1}
        lines = [_filled(sorted(edges), spacing) for edges in (us, vs)]
        found = [
            Rectangle(float(a), float(c), float(b), float(d))
            for a, b in pairwise(lines[0])
            for c, d in pairwise(lines[1])
        ]
        u = np.array([(r.u0 + r.u1) / 2 for r in found])
        v = np.array([(r.v0 + r.v1) / 2 for r in found])
        there = f.holds(u, v)
        return [Cell(r, int(p)) for r, p, t in zip(found, self.part(face, u, v), there) if t]

    def part(self, face: str, u: Array, v: Array) -> NDArray[np.intp]:
        """What lies at (u, v) of a face: -2 bare face, -1 frame or bar, k pane k."""
        panes = self.panes_in(face)
        part = np.full(u.shape, -1 if panes else -2, dtype=np.intp)
        for k in panes:
            part[self.panes[k].glass.holds(u, v)] = k
        return part

    def reflectance(self, face: str, rectangle: Rectangle, panes: Array) -> Array:
        """[C] mean reflectance of a rectangle of a face; `panes` [P, C] holds that of each pane's room side,
        for white light or in R, G and B."""
        f = self.faces[face]
        own = f.rgb if panes.shape[-1] == 3 else np.array([f.reflectance])
        value = own
        for k in self.panes_in(face):
            value = value + (panes[k] - own) * rectangle.shared(self.panes[k].glass) / rectangle.area
        return value

    def locate(self, points: Array) -> tuple[NDArray[np.intp], NDArray[np.intp], Array, Array]:
        """Which surface [K, 3] points lie on.

        Returns
        -------
        face : [K] index into `names` of the nearest face that holds the point.
        part : [K] -2 for the bare face, -1 for a frame, k for pane k.
        u, v : [K] coordinates on that face.
        """
        best = np.full(len(points), np.inf)
        face = np.zeros(len(points), dtype=np.intp)
        u, v = np.zeros(len(points)), np.zeros(len(points))
        for index, f in enumerate(self.faces.values()):
            fu, fv, height = f.coordinates(points)
            far = np.where(f.holds(fu, fv, by=1e-3), np.abs(height), np.inf)
            nearer = far < best - 1e-9
            best, face = np.where(nearer, far, best), np.where(nearer, index, face)
            u, v = np.where(nearer, fu, u), np.where(nearer, fv, v)
        part = np.full(len(points), -2, dtype=np.intp)
        for index, name in enumerate(self.faces):
            here = np.flatnonzero(face == index)
            part[here] = self.part(name, u[here], v[here])
        return face, part, u, v

    def distance(self, points: Array) -> Array:
        """[K] metres from [K, 3] points to the nearest surface; infinite where none lies beside a point."""
        best = np.full(len(points), np.inf)
        for f in self.faces.values():
            u, v, height = f.coordinates(points)
            best = np.minimum(best, np.where(f.holds(u, v, by=1e-3), np.abs(height), np.inf))
        return best

    def spaces(self, points: Array) -> NDArray[np.intp]:
        """[K] the space that [K, 3] points lie in: `ROOM`, a window's niche, or -2 for outside."""
        inside = np.all((points >= -1e-6) & (points <= self.size + 1e-6), axis=1)
        space = np.where(inside, ROOM, -2)
        for k, window in enumerate(self.job.window):
            if window.inner_reveal_m > 0.0:
                mine = [f for f in self.faces.values() if f.space == k]
                heights = np.stack([f.coordinates(points)[2] for f in mine])
                depth = (points - self.faces[window.wall].corners[0]) @ self.faces[window.wall].normal
                space[np.all(heights >= -1e-6, axis=0) & (depth <= 1e-6) & ~inside] = k
        return space

    def lifted(self, points: Array, by: float = 1e-4) -> Array:
        """Points moved into the room so that they lie at least `by` metres off every face.

        A millimetre would move illuminances on a steep flank of a lobe by half a per cent.
        """
        out = points.astype(float)
        space = self.spaces(points)
        inside = space == ROOM
        out[inside] = np.clip(points[inside], by, self.size - by)
        for k in np.unique(space[space >= 0]):
            here = np.flatnonzero(space == k)
            for f in self.faces.values():
                if f.space == k:
                    low = np.maximum(by - f.coordinates(out[here])[2], 0.0)
                    out[here] += low[:, None] * f.normal
        # In the opening of a niche there is no wall to keep off.
        for window, mouth in zip(self.job.window, self.mouths):
            if window.inner_reveal_m > 0.0:
                wall = self.faces[window.wall]
                u, v, height = wall.coordinates(points)
                free = inside & (np.abs(height) < by) & mouth.holds(u, v)
                out[free] = points[free]
        return out


def _opening(window: Window, length: float) -> Rectangle:
    """The window's opening, frame included, in coordinates of its wall."""
    centre = length / 2 if window.centre_m is None else window.centre_m
    u0, v0 = centre - window.width_m / 2, window.sill_m
    return Rectangle(u0, v0, u0 + window.width_m, v0 + window.height_m)


def _mouth(window: Window, edge: Array) -> Rectangle:
    """Where the window's niche opens into the room."""
    o = _opening(window, float(np.linalg.norm(edge)))
    jambs, sill, head = window.inner_reveal_m * np.tan(np.radians(window.inner_splay_deg))
    return Rectangle(o.u0 - jambs, o.v0 - sill, o.u1 + jambs, o.v1 + head)


def _corners(face: Face, r: Rectangle) -> Array:
    return face.point(np.array([r.u0, r.u1, r.u1, r.u0]), np.array([r.v0, r.v0, r.v1, r.v1]))


def _filled(edges: list[float], spacing: float) -> Array:
    """Edges with lines put between them, evenly and at most `spacing` apart."""
    out = [edges[0]]
    for a, b in pairwise(edges):
        if b - a > 1e-9:
            n = max(int(np.ceil((b - a) / spacing - 1e-9)), 1)
            out.extend(float(a + (b - a) * k / n) for k in range(1, n + 1))
    return np.array(out)
