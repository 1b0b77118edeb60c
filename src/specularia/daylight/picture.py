"""Luminance pictures: light straight from the panes by Radiance, reflected light from the radiosity."""

from __future__ import annotations

from collections.abc import Sequence
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

    One ray through the middle of each pixel; pixels next to which another surface begins get nine.

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

    def seen(column: NDArray[np.floating], row: NDArray[np.floating]) -> tuple[Array, NDArray[np.intp]]:
        origins, directions, inside = camera.rays(np.asarray(column, float), np.asarray(row, float))
        luminance, surface = np.zeros(inside.shape), np.full(inside.shape, _NOTHING, dtype=np.intp)
        luminance[inside], surface[inside] = _look(
            origins[inside],
            directions[inside],
            scene=scene,
            octree=octree,
            field=field,
            panes=panes,
            fineness=fineness,
        )
        return luminance, surface

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


def _look(
    origins: Array,
    directions: Array,
    *,
    scene: Scene,
    octree: str,
    field: IndirectField,
    panes: Sequence[float],
    fineness: float,
) -> tuple[Array, NDArray[np.intp]]:
    """Luminance [K] along rays, and a number for the surface that each one meets."""
    luminance, points = scene.look(octree, origins, directions, fineness=fineness)
    box = scene.box
    face, part, u, v = box.locate(points)
    bare = np.array([f.reflectance for f in box.faces.values()])
    received = field.at(face, u, v)
    normals = np.array([f.normal for f in box.faces.values()])[face]
    glass = part >= 0
    # Radiance's light sources reflect nothing; what falls on a pane from panes in other walls comes here.
    received[glass] += scene.illuminance(octree, box.lifted(points[glass]), normals[glass])
    rho = by_part(face, part, bare, box.job.reflectance.frames, panes)
    return luminance + rho / np.pi * received, face * 1000 + part


def write_hdr(path: Path, luminance: Array, camera: Camera, *, what: str) -> Path:
    """Write a Radiance picture, grey, radiance = luminance / 179, with the view in its header."""
    rows, columns = luminance.shape
    header = f"#?RADIANCE\n{what}\nVIEW= {camera.header()}\n\n-Y {rows} +X {columns}\n"
    values = np.repeat((luminance / LUMINOUS_EFFICACY).astype("<f4").ravel(), 3)
    data = run(["pvalue", "-r", "-df"], data=header.encode() + values.tobytes())
    with atomic(path) as temporary:
        temporary.write_bytes(data)
    return path
