"""Luminance pictures: light straight from the panes by Radiance, reflected light from the radiosity."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from specularia.conventions import LUMINOUS_EFFICACY
from specularia.daylight._grid import bilinear
from specularia.daylight.camera import Camera
from specularia.daylight.geometry import Box
from specularia.daylight.interreflection import Interreflection, by_part
from specularia.daylight.scene import Scene
from specularia.files import atomic
from specularia.radiance import run

__all__ = ["IndirectField", "render", "write_hdr"]

Array = NDArray[np.float64]

_FINE: Array = (np.arange(3) + 0.5) / 3
"""Places within a pixel, across and down, of the rays of pixels in which surfaces meet."""

_STEP = 4
"""Pixels from ray to ray in a first pass; a power of two."""

_EVEN = 0.03
"""Share by which luminance may change between neighbours to be interpolated."""

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


def render(
    camera: Camera,
    *,
    scene: Scene,
    octree: str,
    field: IndirectField,
    panes: Sequence[float],
    fineness: float,
) -> Array:
    """Luminance picture [rows, columns] in cd/m2; 0 outside the circle of a fisheye.

    One ray through the middle of each pixel; pixels next to which another surface begins get nine. Where the
    light on one opaque surface changes by less than `_EVEN` over four pixels, it is interpolated in between.

    Parameters
    ----------
    camera : what is looked at.
    scene, octree : the panes as light sources.
    field : reflected light on the faces.
    panes : reflectance of each pane's room side.
    fineness : see `Scene.illuminance`.
    """
    columns, rows = camera.size_px
    c, r = (a.ravel() for a in np.meshgrid(np.arange(columns), np.arange(rows)))
    origins, directions, inside = camera.rays(np.asarray(c + 0.5, float), np.asarray(r + 0.5, float))
    surface = np.full(inside.shape, _NOTHING, dtype=np.intp)
    face, part, _, _ = scene.box.locate(scene.hits(octree, origins[inside], directions[inside]))
    surface[inside] = face * 1000 + part
    glass = np.zeros(inside.shape, dtype=bool)
    glass[inside] = part >= 0
    kind = surface.reshape(rows, columns)

    def seen(column: NDArray[np.floating], row: NDArray[np.floating]) -> Array:
        origins, directions, inside = camera.rays(np.asarray(column, float), np.asarray(row, float))
        luminance = np.zeros(inside.shape)
        luminance[inside] = _look(
            origins[inside],
            directions[inside],
            scene=scene,
            octree=octree,
            field=field,
            panes=panes,
            fineness=fineness,
        )
        return luminance

    picture = _traced(kind, glass.reshape(rows, columns), lambda r, c: seen(c + 0.5, r + 0.5))
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
        fine = seen(np.add.outer(ec, dx).ravel(), np.add.outer(er, dy).ravel())
        picture[er, ec] = fine.reshape(-1, dx.size).mean(axis=1)
    return picture


def _traced(
    kind: NDArray[np.intp],
    always: NDArray[np.bool_],
    trace: Callable[[NDArray[np.intp], NDArray[np.intp]], Array],
) -> Array:
    """Luminance [rows, columns]: traced on every fourth pixel, then finer where it is not smooth.

    Parameters
    ----------
    kind : [rows, columns] number of the surface in each pixel.
    always : pixels that are traced in any case.
    trace : luminance of the pixels (row, column).
    """
    rows, columns = kind.shape
    picture = np.zeros(kind.shape)
    r, c = (a.ravel() for a in np.meshgrid(np.arange(rows), np.arange(columns), indexing="ij"))
    first = (r % _STEP == 0) & (c % _STEP == 0)
    picture[r[first], c[first]] = trace(r[first], c[first])
    half = _STEP // 2
    while half:
        new = (r % half == 0) & (c % half == 0) & ((r % (2 * half) != 0) | (c % (2 * half) != 0))
        nr, nc = r[new], c[new]
        dr, dc = half * ((nr // half) % 2), half * ((nc // half) % 2)
        here = kind[nr, nc]
        smooth = (nr + dr < rows) & (nc + dc < columns) & ~always[nr, nc]
        around = []
        for sr, sc in ((-1, -1), (-1, 1), (1, -1), (1, 1)):
            ar, ac = np.minimum(nr + sr * dr, rows - 1), np.minimum(nc + sc * dc, columns - 1)
            smooth &= kind[ar, ac] == here
            around.append(picture[ar, ac])
        high, low = np.max(around, axis=0), np.min(around, axis=0)
        smooth &= high - low <= _EVEN * high
        picture[nr[smooth], nc[smooth]] = np.mean(around, axis=0)[smooth]
        rough = ~smooth & (here != _NOTHING)
        picture[nr[rough], nc[rough]] = trace(nr[rough], nc[rough])
        half //= 2
    return picture


def _look(
    origins: Array,
    directions: Array,
    *,
    scene: Scene,
    octree: str,
    field: IndirectField,
    panes: Sequence[float],
    fineness: float,
) -> Array:
    """Luminance [K] along rays."""
    if len(origins) == 0:
        return np.zeros(0)
    luminance, points = scene.look(octree, origins, directions, fineness=fineness)
    box = scene.box
    face, part, u, v = box.locate(points)
    bare = np.array([f.reflectance for f in box.faces.values()])
    received = field.at(face, u, v)
    if len({pane.window.wall for pane in box.panes}) > 1:
        # Radiance's light sources reflect nothing; what falls on a pane from other walls' panes comes here.
        glass = part >= 0
        normals = np.array([f.normal for f in box.faces.values()])[face]
        received[glass] += scene.illuminance(octree, box.lifted(points[glass]), normals[glass])
    rho = by_part(face, part, bare, box.job.reflectance.frames, panes)
    return luminance + rho / np.pi * received


def write_hdr(path: Path, luminance: Array, camera: Camera, *, what: str) -> Path:
    """Write a Radiance picture, grey, radiance = luminance / 179, with the view in its header."""
    rows, columns = luminance.shape
    header = f"#?RADIANCE\n{what}\nVIEW= {camera.header()}\n\n-Y {rows} +X {columns}\n"
    values = np.repeat((luminance / LUMINOUS_EFFICACY).astype("<f4").ravel(), 3)
    data = run(["pvalue", "-r", "-df"], data=header.encode() + values.tobytes())
    with atomic(path) as temporary:
        temporary.write_bytes(data)
    return path
