"""Light that reaches a point after one or more reflections: radiosity of the box in closed form.

All surfaces inside scatter evenly, so the room is cut into rectangles of constant exitance M and

    M_i = rho_i (E_direct_i + sum_j F_ij M_j),      E_indirect(p) = sum_j F(p, j) M_j,

with F(p, j) the configuration factor of rectangle j at a point, a closed form (Lambert 1760; Baum, Rushmeier
and Winget 1989, doi:10.1145/74333.74367). An empty box is convex, so every rectangle is seen whole: no
sampling, no noise, no bounce left out. The direct illuminances come from Radiance and are scaled together so
that the walls receive just the flux that the panes emit.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from specularia.daylight._polygon_kernel import configuration_factors
from specularia.daylight.geometry import Box

__all__ = ["Interreflection", "Mesh", "mesh"]

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Mesh:
    """The room cut into rectangles.

    Attributes
    ----------
    quads : [N, 4, 3] corners.
    area : [N] m2.
    face : [N] index into `geometry.FACES`.
    part : [N] -2 for the bare face, -1 for a frame, k for pane k.
    points, normals : [N, K, 3] points spread evenly over each rectangle, and normals into the room there.
    factors : [N, N] configuration factors, mean over two by two Gauss points of the first index.
    """

    quads: Array
    area: Array
    face: NDArray[np.intp]
    part: NDArray[np.intp]
    points: Array
    normals: Array
    factors: Array


def mesh(box: Box, spacing: float, *, points: float) -> Mesh:
    """Cut the room into rectangles at most `spacing` metres wide that follow openings and panes.

    `points` is the largest distance of the points in a rectangle, in metres.
    """
    quads, area, faces, parts = [], [], [], []
    gauss, spread, normals = [], [], []
    n = int(np.ceil(spacing / points))
    even = tuple(a.ravel() for a in np.meshgrid((np.arange(n) + 0.5) / n, (np.arange(n) + 0.5) / n))
    g = 0.5 - 0.5 / np.sqrt(3.0)
    two = (np.array([g, 1 - g, 1 - g, g]), np.array([g, g, 1 - g, 1 - g]))
    corners = (np.array([0, 1, 1, 0]), np.array([0, 0, 1, 1]))
    for index, face in enumerate(box.faces.values()):
        for r, part in box.cells(face.name, spacing):
            q, a, e = (
                face.point(r.u0 + (r.u1 - r.u0) * p, r.v0 + (r.v1 - r.v0) * q)
                for p, q in (corners, two, even)
            )
            quads.append(q)
            gauss.append(a)
            spread.append(e)
            area.append(r.area)
            faces.append(index)
            parts.append(part)
            normals.append(face.normal)
    many, cells = np.array(normals), np.array(quads)
    factors = configuration_factors(np.concatenate(gauss), np.repeat(many, 4, axis=0), cells)
    return Mesh(
        quads=cells,
        area=np.array(area),
        face=np.array(faces),
        part=np.array(parts),
        points=np.array(spread),
        normals=np.repeat(many[:, None, :], n * n, axis=1),
        factors=factors.reshape(len(cells), 4, len(cells)).mean(axis=1),
    )


class Interreflection:
    """Exitance of every rectangle of a mesh, and what it sheds on any point.

    Parameters
    ----------
    mesh : the room.
    direct : [N, K] illuminance in lx straight from the panes at the mesh's points.
    reflectance : [N] of each rectangle.
    flux : lm that the panes emit; 0 leaves `direct` as it is.

    Attributes
    ----------
    exitance : [N] lm/m2 of reflected light.
    received : [N] lx, direct and indirect.
    balance : flux that `direct` held, over `flux`, before it was scaled.
    """

    def __init__(self, mesh: Mesh, direct: Array, reflectance: Array, flux: float) -> None:
        first = direct.mean(axis=1)
        held = float(np.sum(first * mesh.area))
        self.balance = held / flux if flux > 0.0 else 1.0
        if flux > 0.0 and held > 0.0:
            first = first / self.balance
        self.mesh = mesh
        transfer = np.eye(len(first)) - mesh.factors * reflectance[None, :]
        self.received: Array = np.linalg.solve(transfer, first)
        self.exitance: Array = reflectance * self.received

    def illuminance(self, points: Array, normals: Array) -> Array:
        """[K] lx of reflected light at points [K, 3] with normals [K, 3] inside the room."""
        return np.asarray(configuration_factors(points, normals, self.mesh.quads)) @ self.exitance


def reflectances(box: Box, mesh: Mesh, panes: Sequence[float]) -> Array:
    """[N] reflectance of each rectangle of a mesh; `panes` gives that of each pane's room side."""
    bare = np.array([f.reflectance for f in box.faces.values()])
    return by_part(mesh.face, mesh.part, bare, box.job.reflectance.frames, panes)


def by_part(
    face: NDArray[np.intp], part: NDArray[np.intp], bare: Array, frames: float, panes: Sequence[float]
) -> Array:
    """Reflectance where surfaces are given by face and part, as `Box.locate` does."""
    out = np.where(part == -1, frames, bare[face])
    for k, value in enumerate(panes):
        out = np.where(part == k, value, out)
    return out
