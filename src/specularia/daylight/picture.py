"""Luminance pictures: light straight from the panes by Radiance, reflected light from the radiosity."""

from __future__ import annotations

import warnings
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from specularia.conventions import LUMINOUS_EFFICACY
from specularia.daylight._grid import bilinear
from specularia.daylight.ambient import Ambient
from specularia.daylight.beam import beam_illuminance
from specularia.daylight.geometry import Box
from specularia.daylight.interreflection import Interreflection
from specularia.daylight.job import View
from specularia.daylight.scene import Scene
from specularia.errors import SpeculariaWarning
from specularia.files import atomic
from specularia.radiance import run

__all__ = ["IndirectField", "project", "rays", "render", "write_hdr"]

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


def render(
    view: View, *, scene: Scene, octree: str, field: IndirectField | Ambient, fineness: float
) -> Array:
    """Luminance picture [rows, columns] in cd/m2.

    One ray through the middle of each pixel; pixels next to which another surface begins get nine.

    Parameters
    ----------
    view : what is looked at.
    scene, octree : the panes as light sources.
    field : reflected light on the faces.
    fineness : see `Scene.illuminance`.
    """
    if isinstance(field, Ambient):
        return _from_files(view, scene, octree, field, fineness)
    box = scene.box
    assert isinstance(box, Box)
    columns, rows = view.size_px
    c, r = (a.ravel() for a in np.meshgrid(np.arange(columns), np.arange(rows)))

    def seen(column: NDArray[np.floating], row: NDArray[np.floating]) -> tuple[Array, NDArray[np.intp]]:
        directions = rays(view, np.asarray(column, float), np.asarray(row, float))
        origins = np.broadcast_to(np.array(view.position_m), directions.shape)
        luminance, points = scene.look(octree, origins, directions, fineness=fineness)
        face, part, u, v = box.locate(points)
        received = field.at(face, u, v)
        normals = np.array([f.normal for f in box.faces.values()])[face]
        glass = part >= 0
        # Radiance's light sources reflect nothing; what falls on a pane from panes in other walls comes here.
        received[glass] += scene.illuminance(octree, box.lifted(points[glass]), normals[glass])
        received += beam_illuminance(box, scene.lights, box.lifted(points), normals)
        rho = np.array([f.reflectance for f in box.faces.values()])[face]
        rho[glass] = scene.lights.reflectance[part[glass]]
        return luminance + rho / np.pi * received, face * (len(box.panes) + 3) + part

    luminance, surface = seen(c + 0.5, r + 0.5)
    picture, kind = luminance.reshape(rows, columns), surface.reshape(rows, columns)
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
        fine, _ = seen(np.add.outer(ec, dx).ravel(), np.add.outer(er, dy).ravel())
        picture[er, ec] = fine.reshape(-1, dx.size).mean(axis=1)
    return picture


def _from_files(view: View, scene: Scene, octree: str, ambient: Ambient, fineness: float) -> Array:
    """`render` in a room of the user's own: two by two rays a pixel."""
    if np.any(scene.lights.beam > 0.0):
        warnings.warn(
            f"view {view.name!r}: in a room from files, pictures through no glass and through a clear slab "
            "lack the patch of undeflected sun (points have it).",
            SpeculariaWarning,
            stacklevel=2,
        )
    columns, rows = view.size_px
    k = np.array([0.25, 0.75])
    c, r = np.meshgrid((np.arange(columns)[:, None] + k).ravel(), (np.arange(rows)[:, None] + k).ravel())
    directions = rays(view, c.ravel(), r.ravel())
    origins = np.broadcast_to(np.array(view.position_m), directions.shape)
    luminance, _ = scene.look(octree, origins, directions, fineness=fineness)
    luminance = luminance + ambient.luminance(origins, directions)
    return np.asarray(luminance.reshape(rows, 2, columns, 2).mean(axis=(1, 3)))


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
