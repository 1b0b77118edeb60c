"""Luminance pictures: light straight from the panes by Radiance, reflected light from the radiosity."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from specularia.conventions import LUMINOUS_EFFICACY
from specularia.daylight._grid import bilinear
from specularia.daylight.ambient import Ambient
from specularia.daylight.beam import beam_illuminance
from specularia.daylight.camera import Camera
from specularia.daylight.colour import luminous, shown
from specularia.daylight.geometry import Box
from specularia.daylight.interreflection import Interreflection
from specularia.daylight.scene import Scene
from specularia.files import atomic
from specularia.radiance import run

__all__ = ["IndirectField", "filled", "render", "write_hdr"]

Array = NDArray[np.float64]

_FINE: Array = (np.arange(3) + 0.5) / 3
"""Places within a pixel, across and down, of the rays of pixels in which surfaces meet."""

_STEP_OF_BEAM = 0.1
"""Change of the light from one pixel to the next, over the greater, that tells a border of direct sun."""

_NOTHING = -1_000_000
"""Number of no surface: outside the circle of a fisheye."""


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
            self._grids.append((u, v, light.illuminance(points, normals).reshape(*uu.shape, -1)))
        self._channels = light.exitance.shape[1]

    def at(self, face: NDArray[np.intp], u: Array, v: Array) -> Array:
        """[K, C] lx at (u, v) of the faces with these indices."""
        out = np.zeros((len(face), self._channels))
        for k, (nu, nv, table) in enumerate(self._grids):
            here = face == k
            for c in range(self._channels):
                out[here, c] = bilinear(nu, nv, table[..., c], u[here], v[here])
        return out


def _crowded(length: float, spacing: float) -> Array:
    n = max(int(np.ceil(0.5 * np.pi * length / spacing)), 2)
    return length * 0.5 * (1.0 - np.cos(np.pi * np.arange(n + 1) / n))


def render(
    camera: Camera,
    *,
    scene: Scene,
    octree: str,
    field: IndirectField | Ambient,
    fineness: float,
) -> Array:
    """Picture [rows, columns, C] in cd/m2, in the channels of `colour`; 0 outside the circle of a fisheye.

    One value in the middle of each pixel; pixels next to which another surface begins are the mean of nine.
    Light straight from the panes is traced on the panes themselves, in every fourth pixel each way of other
    surfaces, and between these wherever it does not change evenly (see `filled`).

    Parameters
    ----------
    camera : what is looked at.
    scene, octree : the panes as light sources.
    field : reflected light on the faces.
    fineness : see `Scene.illuminance`.
    """
    if isinstance(field, Ambient):
        return _from_files(camera, scene, octree, field, fineness)
    columns, rows = camera.size_px
    box = scene.box
    assert isinstance(box, Box)
    channels = scene.channels
    reflectance = np.array([[f.reflectance] if channels == 1 else f.rgb for f in box.faces.values()])
    of_panes = scene.lights.pane_reflectance
    inwards = np.array([f.normal for f in box.faces.values()])
    lit = np.array([_lit_by_panes(box, f.corners[0], f.normal) for f in box.faces.values()])

    def straight(column: Array, row: Array) -> Array:
        """Luminance by light straight from the panes, and of the panes themselves."""
        origins, directions, inside = camera.rays(column, row)
        value = np.zeros((len(column), channels))
        value[inside] = scene.look(octree, origins[inside], directions[inside], fineness=fineness)[0]
        return value

    def rest(column: Array, row: Array) -> tuple[Array, NDArray[np.intp], NDArray[np.bool_]]:
        """Luminance by all other light, a number for the surface, and whether it is a pane."""
        origins, directions, inside = camera.rays(column, row)
        value = np.zeros((len(column), channels))
        number = np.full(len(column), _NOTHING, dtype=np.intp)
        on_pane = np.zeros(len(column), dtype=bool)
        points = scene.hits(octree, origins[inside], directions[inside])
        face, part, u, v = box.locate(points)
        received, glass = field.at(face, u, v), part >= 0
        # Radiance's light sources reflect nothing; what falls on a pane from panes in other walls comes here.
        more = np.flatnonzero(glass & lit[face])
        received[more] += scene.illuminance(octree, box.lifted(points[more]), inwards[face[more]])
        if np.any(scene.lights.beam > 0.0):
            received = received + beam_illuminance(box, scene.lights, box.lifted(points), inwards[face])
        rho = reflectance[face]
        rho[glass] = of_panes[part[glass]]
        value[inside] = rho / np.pi * received
        number[inside] = face * (len(box.panes) + 3) + part
        on_pane[inside] = glass
        return value, number, on_pane

    c, r = (a.ravel() for a in np.meshgrid(np.arange(columns) + 0.5, np.arange(rows) + 0.5))
    reflected, surface, glass = rest(c, r)
    kind = surface.reshape(rows, columns)
    panes = glass.reshape(rows, columns)
    direct = filled(kind, lambda rr, cc: straight(np.add(cc, 0.5), np.add(rr, 0.5)), panes, channels=channels)
    picture = direct + reflected.reshape(rows, columns, channels)
    level, edge = luminous(reflected).reshape(rows, columns), np.zeros(kind.shape, dtype=bool)
    for one, other in (
        (np.s_[1:, :], np.s_[:-1, :]),
        (np.s_[:, 1:], np.s_[:, :-1]),
    ):
        differs = kind[one] != kind[other]
        if np.any(scene.lights.beam > 0.0):
            # Reflected light changes slowly on a surface; a step is the border of a sunbeam's patch.
            a, b = level[one], level[other]
            differs |= np.abs(a - b) > _STEP_OF_BEAM * np.maximum(a, b)
        edge[one] |= differs
        edge[other] |= differs
    er, ec = np.nonzero(edge)
    if er.size:
        dx, dy = (a.ravel() for a in np.meshgrid(_FINE, _FINE))
        fc, fr = np.add.outer(ec, dx).ravel(), np.add.outer(er, dy).ravel()
        fine, surface, on_pane = rest(fc, fr)
        near = _from_neighbours(direct, kind, surface, fc, fr)
        unknown = np.flatnonzero(~np.isfinite(near[:, 0]) | on_pane)
        near[unknown] = straight(fc[unknown], fr[unknown])
        picture[er, ec] = (fine + near).reshape(-1, dx.size, channels).mean(axis=1)
    return np.asarray(picture)


def _lit_by_panes(box: Box, corner: Array, normal: Array) -> bool:
    """Whether some pane stands above the plane of a face."""
    centres = np.array([pane.centre for pane in box.panes])
    return bool(np.any((centres - corner) @ normal > 1e-6))


def _from_neighbours(
    direct: Array, kind: NDArray[np.intp], surface: NDArray[np.intp], column: Array, row: Array
) -> Array:
    """[K, C] mean of the nearest pixels of the same surface, by inverse distance; NaN where there is none."""
    c, r = np.floor(column).astype(int), np.floor(row).astype(int)
    total, weight = np.zeros((len(c), direct.shape[2])), np.zeros((len(c), 1))
    for dr in (-1, 0, 1):
        for dc in (-1, 0, 1):
            rr, cc = np.clip(r + dr, 0, kind.shape[0] - 1), np.clip(c + dc, 0, kind.shape[1] - 1)
            far = (rr + 0.5 - row) ** 2 + (cc + 0.5 - column) ** 2
            w = np.where(kind[rr, cc] == surface, 1.0 / (far + 0.02), 0.0)[:, None]
            total += w * direct[rr, cc]
            weight += w
    return np.divide(total, weight, out=np.full(total.shape, np.nan), where=weight > 0.0)


_STEP = 4
"""Pixels between those that are traced at first."""

_EVEN = 0.01
"""Relative deviation in the middle of a block up to which it counts as even."""

_STEEP = 0.25
"""Largest difference of a block's corners, over their mean."""


def filled(
    kind: NDArray[np.intp],
    trace: Callable[[NDArray[np.intp], NDArray[np.intp]], Array],
    always: NDArray[np.bool_] | None = None,
    step: int = _STEP,
    channels: int = 1,
) -> Array:
    """A picture [rows, columns, C] of which only some pixels are traced.

    Blocks whose corners lie `step` pixels apart are filled by bilinear interpolation where they show one
    surface, the pixel in their middle is what its corners say within 1 %, and these differ by a quarter at
    most; the others are split in four, down to single pixels (Whitted 1980, doi:10.1145/358876.358882).

    Parameters
    ----------
    kind : [rows, columns] number of the surface in each pixel.
    trace : gives values [K, C] of pixels at these rows and columns; every channel must be even.
    always : [rows, columns] pixels that are traced in any case.
    """
    rows, columns = kind.shape
    value = np.full((rows, columns, channels), np.nan)

    def known(r: NDArray[np.intp], c: NDArray[np.intp]) -> Array:
        wanted = np.zeros(kind.shape, dtype=bool)
        wanted[r, c] = True
        rr, cc = np.nonzero(wanted & np.isnan(value[..., 0]))
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
        return trace(*np.nonzero(np.ones(kind.shape, dtype=bool))).reshape(value.shape)
    if always is not None and always.any():
        known(*np.nonzero(always))
    ends = [np.unique(np.append(np.arange(0, n, step), n - 1)) for n in kind.shape]
    r0, c0 = (a.ravel() for a in np.meshgrid(ends[0][:-1], ends[1][:-1], indexing="ij"))
    r1, c1 = (a.ravel() for a in np.meshgrid(ends[0][1:], ends[1][1:], indexing="ij"))
    even: list[tuple[int, int, int, int]] = []
    while r0.size:
        corners = known(np.concatenate([r0, r0, r1, r1]), np.concatenate([c0, c1, c0, c1]))
        corners = corners.reshape(4, -1, channels)
        wide = (r1 - r0 > 1) | (c1 - c0 > 1)
        one = wide & (
            crossings(borders_down, r0 + 1, c0, r1, c1) + crossings(borders_across, r0, c0 + 1, r1, c1) == 0
        )
        rm, cm = (r0 + r1) // 2, (c0 + c1) // 2
        middle = np.full((r0.size, channels), np.nan)
        middle[one] = known(rm[one], cm[one])
        expected = _bilinear(corners, ((rm - r0) / (r1 - r0))[:, None], ((cm - c0) / (c1 - c0))[:, None])
        least = 1e-5 * float(np.nanmax(value))
        flat = one & np.all(np.abs(middle - expected) <= _EVEN * np.abs(expected) + least, axis=1)
        # An edge through the middle of a block can leave the middle what the corners say.
        flat &= np.all(np.ptp(corners, axis=0) <= _STEEP * np.abs(expected) + least, axis=1)
        even += list(zip(r0[flat].tolist(), c0[flat].tolist(), r1[flat].tolist(), c1[flat].tolist()))
        left = wide & ~flat
        a, b, c, d, m, n = (v[left] for v in (r0, c0, r1, c1, rm, cm))
        r0, c0 = np.concatenate([a, a, m, m]), np.concatenate([b, n, b, n])
        r1, c1 = np.concatenate([m, m, c, c]), np.concatenate([n, d, n, d])
        real = (r1 > r0) & (c1 > c0)
        r0, c0, r1, c1 = r0[real], c0[real], r1[real], c1[real]
    for p, q, s, t in even:
        block = value[p : s + 1, q : t + 1]
        y = np.linspace(0.0, 1.0, s - p + 1)[:, None, None]
        x = np.linspace(0.0, 1.0, t - q + 1)[None, :, None]
        made = _bilinear(np.array([block[0, 0], block[0, -1], block[-1, 0], block[-1, -1]]), y, x)
        block[...] = np.where(np.isnan(block), made, block)
    return value


def _bilinear(corners: Array, y: Array, x: Array) -> Array:
    a, b, c, d = corners
    return np.asarray((1 - y) * ((1 - x) * a + x * b) + y * ((1 - x) * c + x * d))


def _from_files(camera: Camera, scene: Scene, octree: str, ambient: Ambient, fineness: float) -> Array:
    """`render` in a room of the user's own: two by two rays a pixel."""
    columns, rows = camera.size_px
    k = np.array([0.25, 0.75])
    c, r = np.meshgrid((np.arange(columns)[:, None] + k).ravel(), (np.arange(rows)[:, None] + k).ravel())
    origins, directions, inside = camera.rays(c.ravel(), r.ravel())
    origins, directions = origins[inside], directions[inside]
    light = np.zeros((inside.size, scene.channels))
    seen, points = scene.look(octree, origins, directions, fineness=fineness)
    seen += ambient.luminance(origins, directions)
    if np.any(scene.lights.beam > 0.0):
        rho, at, normals = scene.diffuse(origins, directions)
        met = np.flatnonzero(np.isfinite(at).all(axis=1) & (rho.max(axis=1) > 0.0))
        # What a ray meets beyond a pane, which is no hole here, is not in the room.
        met = met[np.abs(at[met] - points[met]).max(axis=1) < 1e-3]
        lit = beam_illuminance(scene.box, scene.lights, at[met], normals[met])
        seen[met] += rho[met] / np.pi * lit
    seen += _on_panes(scene, octree, points)
    light[inside] = seen
    return np.asarray(light.reshape(rows, 2, columns, 2, -1).mean(axis=(1, 3)))


def _on_panes(scene: Scene, octree: str, points: Array) -> Array:
    """[K, C] cd/m2 at points on panes by light straight from other panes: sources reflect nothing."""
    out = np.zeros((len(points), scene.channels))
    if len(scene.box.panes) < 2:
        return out
    for k, pane in enumerate(scene.box.panes):
        face = scene.box.faces[pane.face]
        u, v, height = face.coordinates(points)
        here = np.flatnonzero(pane.glass.holds(u, v) & (np.abs(height) < 1e-4))
        normals = np.broadcast_to(face.normal, (here.size, 3))
        light = scene.illuminance(octree, points[here] + 1e-4 * face.normal, normals)
        out[here] = scene.lights.pane_reflectance[k] / np.pi * light
    return out


def write_hdr(path: Path, picture: Array, camera: Camera, *, what: str) -> Path:
    """Write a Radiance picture [rows, columns, C], radiance = luminance / 179, with the view in its header.

    Colours beyond Radiance's primaries are drawn towards grey until no channel is negative; their luminance
    stays.
    """
    rows, columns, channels = picture.shape
    rgb = np.repeat(picture, 3, axis=2) if channels == 1 else shown(picture)
    header = f"#?RADIANCE\n{what}\nVIEW= {camera.header()}\n\n-Y {rows} +X {columns}\n"
    values = (rgb / LUMINOUS_EFFICACY).astype("<f4").ravel()
    data = run(["pvalue", "-r", "-df"], data=header.encode() + values.tobytes())
    with atomic(path) as temporary:
        temporary.write_bytes(data)
    return path
