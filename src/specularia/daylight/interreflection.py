"""Light that reaches a point after one or more reflections: radiosity of the box in closed form.

All surfaces inside scatter evenly, so the room is cut into rectangles of constant exitance M and

    M_i = rho_i (E_direct_i + sum_j F_ij M_j),      E_indirect(p) = sum_j F(p, j) M_j,

with F(p, j) the configuration factor of rectangle j at a point, a closed form (Lambert 1760; Baum, Rushmeier
and Winget 1989, doi:10.1145/74333.74367). An empty box is convex, and so is the niche of a window: within
either every rectangle is seen whole, with no sampling and no noise. From one to the other light passes
through the niche's mouth; how much of a rectangle is seen through it is tried at 16 points, and the factors
of all that is seen through a mouth add up to that of the mouth. No bounce is left out. The direct
illuminances come from Radiance and are scaled together so that the walls receive just the flux that the
panes emit.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from specularia.daylight._polygon_kernel import configuration_factors
from specularia.daylight.colour import to_rgb, to_xyz
from specularia.daylight.geometry import ROOM, Box, Rectangle

__all__ = ["Interreflection", "Mesh", "mesh"]

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Mesh:
    """The room cut into rectangles.

    Attributes
    ----------
    box : the room.
    quads : [N, 4, 3] corners.
    area : [N] m2.
    face : [N] index into `Box.names`.
    part : [N] what lies in its middle: -2 the bare face, -1 a frame, k pane k.
    rectangles : where they lie on their faces.
    points, normals : [N, K, 3] points spread evenly over each rectangle, and normals into the room there.
    factors : [N, N] configuration factors, mean over two by two Gauss points of the first index.
    """

    box: Box
    quads: Array
    area: Array
    face: NDArray[np.intp]
    part: NDArray[np.intp]
    rectangles: list[Rectangle]
    points: Array
    normals: Array
    factors: Array


def mesh(box: Box, spacing: float, *, points: float) -> Mesh:
    """Cut the room into rectangles at most `spacing` metres wide that keep to the openings of windows.

    `points` is the largest distance of the points in a rectangle, in metres.
    """
    n = int(np.ceil(spacing / points))
    s, t = np.meshgrid((np.arange(n) + 0.5) / n, (np.arange(n) + 0.5) / n)
    even = (s.ravel(), t.ravel())
    g = 0.5 - 0.5 / np.sqrt(3.0)
    two = (np.array([g, 1 - g, 1 - g, g]), np.array([g, g, 1 - g, 1 - g]))
    corners = (np.array([0, 1, 1, 0]), np.array([0, 0, 1, 1]))
    cells = [
        (index, face, cell)
        for index, face in enumerate(box.faces.values())
        for cell in box.cells(face.name, spacing, follow=False)
    ]

    def places(shape: tuple[Array, Array]) -> Array:
        return np.array(
            [
                face.point(r.u0 + (r.u1 - r.u0) * shape[0], r.v0 + (r.v1 - r.v0) * shape[1])
                for _, face, r in ((i, f, c.rectangle) for i, f, c in cells)
            ]
        )

    quads = places(corners)
    diagonals = quads[:, 2:] - quads[:, :2]
    normals = np.array([face.normal for _, face, _ in cells])
    spaces = np.array([face.space for _, face, _ in cells])
    factors = factors_through(
        box,
        places(two).reshape(-1, 3),
        np.repeat(normals, 4, axis=0),
        np.repeat(spaces, 4),
        quads,
        spaces,
    )
    return Mesh(
        box=box,
        quads=quads,
        area=np.linalg.norm(np.cross(diagonals[:, 0], diagonals[:, 1]), axis=1) / 2,
        face=np.array([index for index, _, _ in cells]),
        part=np.array([cell.part for _, _, cell in cells]),
        rectangles=[cell.rectangle for _, _, cell in cells],
        points=places(even),
        normals=np.repeat(normals[:, None, :], n * n, axis=1),
        factors=factors.reshape(len(cells), 4, len(cells)).mean(axis=1),
    )


def factors_through(
    box: Box,
    points: Array,
    normals: Array,
    spaces: NDArray[np.intp],
    quads: Array,
    quad_spaces: NDArray[np.intp],
) -> Array:
    """[P, Q] configuration factors of quadrilaterals at points, seen through the mouths of niches.

    `spaces` and `quad_spaces` say which space (`Box.spaces`) each lies in.
    """
    out = np.asarray(configuration_factors(points, normals, quads))
    niches = [k for k, w in enumerate(box.job.window) if w.inner_reveal_m > 0.0]
    for k in niches:
        for here, there in ((spaces == k, quad_spaces != k), (spaces != k, quad_spaces == k)):
            if here.any() and there.any():
                out[np.ix_(here, there)] *= _share_through(box, k, points[here], quads[there])
    # All that a point sees through a mouth fills the mouth.
    for k in niches:
        for here, there in ((spaces == k, quad_spaces != k), (spaces == ROOM, quad_spaces == k)):
            if here.any() and there.any():
                mouth = box.mouth_corners(k)[None]
                whole = configuration_factors(points[here], normals[here], mouth)[:, 0]
                held = out[np.ix_(here, there)].sum(axis=1)
                scale = np.divide(whole, held, out=np.zeros_like(held), where=held > 1e-9)
                out[np.ix_(here, there)] *= scale[:, None]
    return out


_TRIED = (np.arange(4) + 0.5) / 4


def _targets(quads: Array) -> Array:
    """[Q, 16, 3] points spread over quadrilaterals."""
    s, t = (v.ravel()[None, :, None] for v in np.meshgrid(_TRIED, _TRIED))
    a, b, c, d = (quads[:, k : k + 1] for k in range(4))
    return np.asarray((1 - t) * ((1 - s) * a + s * b) + t * ((1 - s) * d + s * c))


def _share_through(box: Box, window: int, points: Array, quads: Array) -> Array:
    """[P, Q] share of each quadrilateral that a point beyond a niche's mouth sees through it."""
    wall, mouth = box.faces[box.job.window[window].wall], box.mouths[window]
    targets = _targets(quads)
    pu, pv, ph = (v[:, None, None] for v in wall.coordinates(points))
    tu, tv, th = (v[None] for v in wall.coordinates(targets))
    part = np.divide(ph, ph - th, out=np.full(np.broadcast_shapes(ph.shape, th.shape), -1.0), where=ph != th)
    held = mouth.holds(pu + part * (tu - pu), pv + part * (tv - pv)) & (part >= 0.0) & (part <= 1.0)
    return np.asarray(held.mean(axis=2))


class Interreflection:
    """Exitance of every rectangle of a mesh, and what it sheds on any point.

    Parameters
    ----------
    mesh : the room.
    direct : [N, K, C] illuminance in lx straight from the panes at the mesh's points, in the channels of
        `colour`.
    reflectance : [N, C] of each rectangle.
    flux : lm that the panes emit, Y, or [3] X, Y and Z; 0 leaves `direct` as it is.

    Attributes
    ----------
    exitance : [N, C] lm/m2 of reflected light.
    received : [N, C] lx, direct and indirect.
    balance : [C] flux that `direct` held, over `flux`, before it was scaled: of Y, or of X, Y and Z, which
        are never negative as a channel may be.
    """

    def __init__(self, mesh: Mesh, direct: Array, reflectance: Array, flux: float | Array) -> None:
        first, colour = direct.mean(axis=1), direct.shape[2] == 3
        first = to_xyz(first) if colour else first
        held, wanted = mesh.area @ first, np.atleast_1d(flux)
        known = (wanted > 0.0) & (held > 0.0)
        self.balance: Array = np.divide(held, wanted, out=np.ones_like(held), where=wanted > 0.0)
        first = first / np.where(known, self.balance, 1.0)
        first = to_rgb(first) if colour else first
        self.mesh = mesh
        self.received: Array = np.empty_like(first)
        # A grey room has one matrix for all channels.
        for rho in np.unique(reflectance, axis=1).T:
            same = np.all(reflectance == rho[:, None], axis=0)
            transfer = np.eye(len(first)) - mesh.factors * rho[None, :]
            self.received[:, same] = np.linalg.solve(transfer, first[:, same])
        self.exitance: Array = reflectance * self.received

    def illuminance(self, points: Array, normals: Array) -> Array:
        """[K, C] lx of reflected light at points [K, 3] with normals [K, 3] inside the room."""
        m = self.mesh
        spaces = np.array([f.space for f in m.box.faces.values()])[m.face]
        return factors_through(m.box, points, normals, m.box.spaces(points), m.quads, spaces) @ self.exitance


def reflectances(mesh: Mesh, panes: Array) -> Array:
    """[N, C] reflectance of each rectangle of a mesh; `panes` [P, C] gives that of each pane's room side."""
    names = mesh.box.names
    return np.array([mesh.box.reflectance(names[f], r, panes) for f, r in zip(mesh.face, mesh.rectangles)])
