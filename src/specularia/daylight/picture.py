"""Luminance pictures: light straight from the panes by Radiance, reflected light from the radiosity."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from specularia.conventions import LUMINOUS_EFFICACY
from specularia.daylight._grid import bilinear
from specularia.daylight.geometry import Box
from specularia.daylight.interreflection import Interreflection
from specularia.daylight.job import View
from specularia.daylight.scene import Scene
from specularia.errors import PhysicsError
from specularia.files import atomic
from specularia.radiance import run

__all__ = ["IndirectField", "filled", "project", "rays", "render", "write_hdr"]

Array = NDArray[np.float64]

_FINE: Array = (np.arange(3) + 0.5) / 3
"""Places within a pixel, across and down, of the rays of pixels in which surfaces meet."""


def _frame(view: View) -> tuple[Array, Array, Array]:
    """Direction, right (times the tangent of the half angle) and up (likewise) of a view."""
    forward, up = np.array(view.direction), np.array(view.up)
    right = np.cross(forward, up)
    right /= np.linalg.norm(right)
    half = np.tan(np.radians(view.horizontal_deg / 2))
    columns, rows = view.size_px
    return forward, right * half, np.cross(right, forward) * half * rows / columns


def rays(view: View, column: Array, row: Array) -> Array:
    """[K, 3] unit vectors through picture positions in pixels from the upper left corner."""
    forward, right, up = _frame(view)
    columns, rows = view.size_px
    d = forward + (2 * column / columns - 1)[:, None] * right + (1 - 2 * row / rows)[:, None] * up
    return d / np.linalg.norm(d, axis=1, keepdims=True)


def project(view: View, points: Array) -> Array:
    """[K, 2] picture positions (column, row) of points; NaN for those outside the picture."""
    forward, right, up = _frame(view)
    d = points - np.array(view.position_m)
    depth = d @ forward
    columns, rows = view.size_px
    with np.errstate(divide="ignore", invalid="ignore"):
        x = 0.5 * columns * (1 + (d @ right) / (right @ right) / depth)
        y = 0.5 * rows * (1 - (d @ up) / (up @ up) / depth)
    seen = (depth > 0) & (x >= 0) & (x <= columns) & (y >= 0) & (y <= rows)
    return np.where(seen[:, None], np.stack([x, y], axis=1), np.nan)


class IndirectField:
    """Reflected light on the faces of a room, exact at the nodes of a grid and bilinear between them.

    Parameters
    ----------
    box, light : the room and its radiosity.
    spacing : of the nodes in the middle of a face, m; they crowd towards the edges, where light changes most.
    """

    def __init__(self, box: Box, light: Interreflection, spacing: float) -> None:
        self._grids = []
        for face in box.faces.values():
            u, v = (_crowded(length, spacing) for length in face.size)
            uu, vv = np.meshgrid(u, v, indexing="ij")
            points = box.lifted(face.point(uu.ravel(), vv.ravel()))
            normals = np.broadcast_to(face.normal, points.shape).copy()
            self._grids.append((u, v, light.illuminance(points, normals).reshape(uu.shape)))

    def at(self, face: NDArray[np.intp], u: Array, v: Array) -> Array:
        """[K] lx at (u, v) of the faces with these indices."""
        out = np.zeros(len(face))
        for k, (nu, nv, table) in enumerate(self._grids):
            here = face == k
            out[here] = bilinear(nu, nv, table, u[here], v[here])
        return out


def _crowded(length: float, spacing: float) -> Array:
    n = max(int(np.ceil(0.5 * np.pi * length / spacing)), 2)
    return length * 0.5 * (1.0 - np.cos(np.pi * np.arange(n + 1) / n))


def render(view: View, *, scene: Scene, octree: str, field: IndirectField, fineness: float) -> Array:
    """Luminance picture [rows, columns] in cd/m2.

    One value in the middle of each pixel; pixels next to which another surface begins are the mean of nine.
    Light straight from the panes is traced in every fourth pixel each way, and between them wherever it does
    not change evenly (see `filled`).

    Parameters
    ----------
    view : what is looked at.
    scene, octree : the panes as light sources.
    field : reflected light on the faces.
    fineness : see `Scene.illuminance`.
    """
    columns, rows = view.size_px
    box = scene.box
    lit = np.array([_lit_by_panes(box, f.corners[0], f.normal) for f in box.faces.values()])
    reflectance = np.array([f.reflectance for f in box.faces.values()])
    inwards = np.array([f.normal for f in box.faces.values()])

    def straight(column: Array, row: Array) -> Array:
        directions = rays(view, column, row)
        origins = np.broadcast_to(np.array(view.position_m), directions.shape)
        return scene.look(octree, origins, directions, fineness=fineness)[0]

    def rest(column: Array, row: Array) -> tuple[Array, NDArray[np.intp]]:
        """Reflected luminance, and a number for the surface, at picture positions."""
        points = _hits(scene, octree, view, column, row)
        face, part, u, v = box.locate(points)
        received = field.at(face, u, v)
        glass = part >= 0
        # Radiance's light sources reflect nothing; what falls on a pane from panes in other walls comes here.
        more = np.flatnonzero(glass & lit[face])
        received[more] += scene.illuminance(octree, box.lifted(points[more]), inwards[face[more]])
        rho = reflectance[face]
        rho[glass] = scene.lights.reflectance[part[glass]]
        return rho / np.pi * received, face * (len(box.panes) + 3) + part

    c, r = (a.ravel() for a in np.meshgrid(np.arange(columns) + 0.5, np.arange(rows) + 0.5))
    reflected, surface = rest(c, r)
    kind = surface.reshape(rows, columns)
    direct = filled(kind, lambda rr, cc: straight(cc.astype(float) + 0.5, rr.astype(float) + 0.5))
    picture = direct + reflected.reshape(rows, columns)
    edge = np.zeros(kind.shape, dtype=bool)
    for one, other in (
        (np.s_[1:, :], np.s_[:-1, :]),
        (np.s_[:, 1:], np.s_[:, :-1]),
    ):
        differs = kind[one] != kind[other]
        edge[one] |= differs
        edge[other] |= differs
    er, ec = np.nonzero(edge)
    if er.size:
        dx, dy = (a.ravel() for a in np.meshgrid(_FINE, _FINE))
        fc, fr = np.add.outer(ec, dx).ravel(), np.add.outer(er, dy).ravel()
        fine, surface = rest(fc, fr)
        near = _from_neighbours(direct, kind, surface, fc, fr)
        unknown = np.flatnonzero(~np.isfinite(near))
        near[unknown] = straight(fc[unknown], fr[unknown])
        picture[er, ec] = (fine + near).reshape(-1, dx.size).mean(axis=1)
    return picture


def _lit_by_panes(box: Box, corner: Array, normal: Array) -> bool:
    """Whether some pane stands above the plane of a face."""
    centres = np.array([pane.centre for pane in box.panes])
    return bool(np.any((centres - corner) @ normal > 1e-6))


def _hits(scene: Scene, octree: str, view: View, column: Array, row: Array) -> Array:
    """[K, 3] where rays through picture positions end; nothing is lit."""
    directions = rays(view, column, row)
    origins = np.broadcast_to(np.array(view.position_m), directions.shape)
    data = np.hstack([origins, directions]).astype("<f4").tobytes()
    out = run(["rtrace", "-h", "-ff", "-op", "-ab", "0", octree], data=data, cwd=scene.folder)
    points = np.frombuffer(out, "<f4").reshape(-1, 3).astype(float)
    off = scene.box.distance(points) > 1e-3
    if off.any():
        raise PhysicsError(
            f"{off.sum()} of {off.size} view rays ended in no face of the room; it is not closed."
        )
    return points


def _from_neighbours(
    direct: Array, kind: NDArray[np.intp], surface: NDArray[np.intp], column: Array, row: Array
) -> Array:
    """[K] mean of the nearest pixels of the same surface, by inverse distance; NaN where there is none."""
    c, r = np.floor(column).astype(int), np.floor(row).astype(int)
    total, weight = np.zeros(len(c)), np.zeros(len(c))
    for dr in (-1, 0, 1):
        for dc in (-1, 0, 1):
            rr, cc = np.clip(r + dr, 0, kind.shape[0] - 1), np.clip(c + dc, 0, kind.shape[1] - 1)
            far = (rr + 0.5 - row) ** 2 + (cc + 0.5 - column) ** 2
            w = np.where(kind[rr, cc] == surface, 1.0 / (far + 0.02), 0.0)
            total += w * direct[rr, cc]
            weight += w
    return np.divide(total, weight, out=np.full(len(c), np.nan), where=weight > 0.0)


_STEP = 4
"""Pixels between those that are traced at first."""

_EVEN = 0.01
"""Relative deviation in the middle of a block up to which it counts as even."""

_STEEP = 0.25
"""Largest difference of a block's corners, over their mean."""


def filled(
    kind: NDArray[np.intp],
    trace: Callable[[NDArray[np.intp], NDArray[np.intp]], Array],
    step: int = _STEP,
) -> Array:
    """A picture of which only some pixels are traced.

    Blocks whose corners lie `step` pixels apart are filled by bilinear interpolation where they show one
    surface, the pixel in their middle is what its corners say within 1 %, and these differ by a quarter at
    most; the others are split in four, down to single pixels (Whitted 1980, doi:10.1145/358876.358882).

    Parameters
    ----------
    kind : [rows, columns] number of the surface in each pixel.
    trace : gives values of pixels at these rows and columns.
    """
    rows, columns = kind.shape
    value = np.full(kind.shape, np.nan)

    def known(r: NDArray[np.intp], c: NDArray[np.intp]) -> Array:
        wanted = np.zeros(kind.shape, dtype=bool)
        wanted[r, c] = True
        rr, cc = np.nonzero(wanted & np.isnan(value))
        if rr.size:
            value[rr, cc] = trace(rr, cc)
        return value[r, c]

    borders = np.zeros((rows + 1, columns + 1), dtype=np.intp)
    down, across = np.zeros_like(kind), np.zeros_like(kind)
    down[1:], across[:, 1:] = kind[1:] != kind[:-1], kind[:, 1:] != kind[:, :-1]
    borders_down, borders_across = borders.copy(), borders
    borders_down[1:, 1:] = down.cumsum(axis=0).cumsum(axis=1)
    borders_across[1:, 1:] = across.cumsum(axis=0).cumsum(axis=1)

    def crossings(s: NDArray[np.intp], r0: Any, c0: Any, r1: Any, c1: Any) -> NDArray[np.intp]:
        """How many borders lie in rows r0..r1 and columns c0..c1, ends included."""
        return np.asarray(s[r1 + 1, c1 + 1] - s[r0, c1 + 1] - s[r1 + 1, c0] + s[r0, c0])

    if min(kind.shape) < 2:
        return trace(*np.nonzero(np.ones(kind.shape, dtype=bool))).reshape(kind.shape)
    ends = [np.unique(np.append(np.arange(0, n, step), n - 1)) for n in kind.shape]
    r0, c0 = (a.ravel() for a in np.meshgrid(ends[0][:-1], ends[1][:-1], indexing="ij"))
    r1, c1 = (a.ravel() for a in np.meshgrid(ends[0][1:], ends[1][1:], indexing="ij"))
    even: list[tuple[int, int, int, int]] = []
    while r0.size:
        corners = known(np.concatenate([r0, r0, r1, r1]), np.concatenate([c0, c1, c0, c1])).reshape(4, -1)
        wide = (r1 - r0 > 1) | (c1 - c0 > 1)
        one = wide & (
            crossings(borders_down, r0 + 1, c0, r1, c1) + crossings(borders_across, r0, c0 + 1, r1, c1) == 0
        )
        rm, cm = (r0 + r1) // 2, (c0 + c1) // 2
        middle = np.full(r0.size, np.nan)
        middle[one] = known(rm[one], cm[one])
        expected = _bilinear(corners, (rm - r0) / (r1 - r0), (cm - c0) / (c1 - c0))
        least = 1e-5 * float(np.nanmax(value))
        flat = one & (np.abs(middle - expected) <= _EVEN * np.abs(expected) + least)
        # An edge through the middle of a block can leave the middle what the corners say.
        flat &= np.ptp(corners, axis=0) <= _STEEP * np.abs(expected) + least
        even += list(zip(r0[flat].tolist(), c0[flat].tolist(), r1[flat].tolist(), c1[flat].tolist()))
        left = wide & ~flat
        a, b, c, d, m, n = (v[left] for v in (r0, c0, r1, c1, rm, cm))
        r0, c0 = np.concatenate([a, a, m, m]), np.concatenate([b, n, b, n])
        r1, c1 = np.concatenate([m, m, c, c]), np.concatenate([n, d, n, d])
        real = (r1 > r0) & (c1 > c0)
        r0, c0, r1, c1 = r0[real], c0[real], r1[real], c1[real]
    for p, q, s, t in even:
        block = value[p : s + 1, q : t + 1]
        y, x = np.linspace(0.0, 1.0, s - p + 1)[:, None], np.linspace(0.0, 1.0, t - q + 1)[None]
        made = _bilinear(np.array([block[0, 0], block[0, -1], block[-1, 0], block[-1, -1]]), y, x)
        block[...] = np.where(np.isnan(block), made, block)
    return value


def _bilinear(corners: Array, y: Array, x: Array) -> Array:
    a, b, c, d = corners
    return np.asarray((1 - y) * ((1 - x) * a + x * b) + y * ((1 - x) * c + x * d))


def write_hdr(path: Path, luminance: Array, view: View, *, what: str) -> Path:
    """Write a Radiance picture, grey, radiance = luminance / 179, with the view in its header."""
    rows, columns = luminance.shape
    vertical = 2 * np.degrees(np.arctan(np.tan(np.radians(view.horizontal_deg / 2)) * rows / columns))
    p, d, u = view.position_m, view.direction, view.up
    header = (
        f"#?RADIANCE\n{what}\n"
        f"VIEW= -vtv -vp {p[0]:.6g} {p[1]:.6g} {p[2]:.6g} -vd {d[0]:.6g} {d[1]:.6g} {d[2]:.6g} "
        f"-vu {u[0]:.6g} {u[1]:.6g} {u[2]:.6g} -vh {view.horizontal_deg:.6g} -vv {vertical:.6g}\n\n"
        f"-Y {rows} +X {columns}\n"
    )
    values = np.repeat((luminance / LUMINOUS_EFFICACY).astype("<f4").ravel(), 3)
    data = run(["pvalue", "-r", "-df"], data=header.encode() + values.tobytes())
    with atomic(path) as temporary:
        temporary.write_bytes(data)
    return path
