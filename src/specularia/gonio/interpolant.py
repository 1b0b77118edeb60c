"""The distribution of one table: a continuous function of the outgoing direction, made from scattered points.

In the plane of direction cosines (ux, uy) area is projected solid angle, so tau is the plain integral of the
BSDF over the unit disk. The points are triangulated (Delaunay) and the BSDF is linear on each triangle; the
horizon takes the values of the nearest points. Only the integral also counts the curvature between points.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from specularia.errors import FormatError
from specularia.gonio._walk import interpolate
from specularia.gonio.shadow import fill_shadow
from specularia.gonio.table import Array, Table

__all__ = ["Distribution", "distribution"]

_RING = 720
"""Points on the horizon; the disk loses 1.3e-5 of its area to the polygon."""


@dataclass(frozen=True)
class Distribution:
    """BSDF of one table as a function of (ux, uy), turned so that the light comes from phi_i = 0.

    Attributes
    ----------
    x, y, values : [P] points and their BSDF in 1/sr, those on the horizon included.
    triangles, neighbours : [T, 3] Delaunay triangulation; neighbours lie opposite each vertex, -1 outside.
    integral : of the BSDF over projected solid angle: tau or rho.
    standard_error : of the integral, from the scatter of neighbouring points.
    coverage : share of the projected hemisphere between points, without gaps and what lies beyond them.
    notes : what was repaired.
    """

    x: Array
    y: Array
    values: Array
    triangles: NDArray[np.int32]
    neighbours: NDArray[np.int32]
    integral: float
    standard_error: float
    coverage: float
    notes: tuple[str, ...]

    def at(self, ux: Array, uy: Array) -> Array:
        """BSDF at directions; fast where they are given so that neighbours follow each other."""
        found = interpolate(
            self.x, self.y, self.values, self.triangles, self.neighbours, np.ravel(ux), np.ravel(uy)
        )
        return found.reshape(np.shape(ux))


def distribution(table: Table) -> Distribution:
    """Triangulate a table; see `Distribution`.

    Points within `table.GRAZING` of the horizon carry no weight. Directions that repeat count once, with the
    mean of their values. The shadow of the sample's mount is filled from the other side of the plane of
    incidence (`shadow.fill_shadow`), as an isotropic sample allows. Negative values are kept.
    """
    known = ~np.isnan(table.bsdf)
    bsdf = table.bsdf[known]
    turn = np.radians(table.azimuth_deg)
    ux, uy = table.ux[known], table.uy[known]
    x = ux * np.cos(turn) + uy * np.sin(turn)
    y = uy * np.cos(turn) - ux * np.sin(turn)
    x, y, bsdf, notes = fill_shadow(x, y, bsdf, polar_deg=table.polar_deg, azimuth_deg=table.azimuth_deg)
    x, y, bsdf = _merged(x, y, bsdf)
    if x.size < 4 or np.ptp(x) < 1e-3 or np.ptp(y) < 1e-3:
        raise FormatError(
            file=table.file or table.label,
            expected="points spread over the hemisphere",
            found=f"{x.size} directions within {np.ptp(x):.2g} x {np.ptp(y):.2g} in direction cosines",
        )
    measured = x.size
    ring_x, ring_y, ring_values, sources, shares = _horizon(x, y, bsdf)
    x, y = np.concatenate([x, ring_x]), np.concatenate([y, ring_y])
    values = np.concatenate([bsdf, ring_values])
    triangles, neighbours = _triangulate(x, y)
    weight = _weights(x, y, triangles)
    variance = _scatter(x, y, values, triangles, neighbours, measured)
    own = weight[:measured] + np.bincount(
        sources.ravel(), (shares * weight[measured:, None]).ravel(), minlength=measured
    )
    return Distribution(
        x=x,
        y=y,
        values=values,
        triangles=triangles,
        neighbours=neighbours,
        integral=float(np.sum(weight * values)),
        standard_error=float(np.sqrt(np.sum(own**2 * variance))),
        coverage=_coverage(x, y, triangles, measured),
        notes=tuple(notes),
    )


def _merged(x: Array, y: Array, values: Array) -> tuple[Array, Array, Array]:
    """Directions within 1e-7 of each other as one, with the mean value; sorted, which helps speed."""
    key = np.round(x * 1e7) + 1j * np.round(y * 1e7)
    _, first, group, count = np.unique(key, return_index=True, return_inverse=True, return_counts=True)
    return x[first], y[first], np.bincount(group.ravel(), values) / count


def _horizon(x: Array, y: Array, values: Array) -> tuple[Array, Array, Array, NDArray[np.intp], Array]:
    """Points on the horizon, each with the mean of the three nearest points, weighted by inverse distance."""
    from scipy.spatial import cKDTree

    azimuth = (np.arange(_RING) + 0.5) * (2 * np.pi / _RING)
    ring = np.stack([np.cos(azimuth), np.sin(azimuth)], axis=1)
    # Only the outer points can be nearest, and the tree of all would cost more than the search.
    outer = np.flatnonzero(np.hypot(x, y) > np.quantile(np.hypot(x, y), max(0.0, 1.0 - 2e4 / x.size)))
    outer = outer if outer.size >= 3 else np.arange(x.size)
    distance, nearest = cKDTree(np.stack([x[outer], y[outer]], axis=1)).query(ring, k=3)
    closeness = 1.0 / np.maximum(distance, 1e-9)
    shares = closeness / closeness.sum(axis=1, keepdims=True)
    sources = outer[nearest]
    return ring[:, 0], ring[:, 1], (values[sources] * shares).sum(axis=1), sources, shares


def _triangulate(x: Array, y: Array) -> tuple[NDArray[np.int32], NDArray[np.int32]]:
    from scipy.spatial import Delaunay

    found: Any = Delaunay(np.stack([x, y], axis=1))
    return found.simplices, found.neighbors


def _doubled(x: Array, y: Array, p: Any, q: Any, r: Any) -> Array:
    """Twice the signed area of triangles, positive counter-clockwise."""
    return (x[q] - x[p]) * (y[r] - y[p]) - (x[r] - x[p]) * (y[q] - y[p])


def _weights(x: Array, y: Array, triangles: NDArray[np.int32]) -> Array:
    """[P] weights that integrate a function over the triangulation from its values at the vertices.

    The linear interpolant's integral exceeds that of a function with the Hessian H by
    (A / 24) sum_edges e.H e on each triangle. Over a peak this averages out where triangles are alike, but
    not on a polar grid or where a coarse grid meets a refined one (on a polar grid, (step / sigma)^2 / 12 for
    a lobe at the pole). H e is the difference of the gradients at the edge's ends, and the gradient at a
    vertex the mean over the triangles around it, so the corrected integral is again a weighted sum of values:

        integral = sum_T A_T mean(f) - (1/24) sum_i g_i . c_i,   c_i = sum_T A_T (2 p_i - q - r).

    Ours; the error term is that of the trapezoidal rule on a triangle.
    """
    p, q, r = triangles.T
    twice = _doubled(x, y, p, q, r)
    corners = triangles.ravel()

    def gathered(per_triangle: list[Array]) -> Array:
        return np.bincount(corners, np.stack(per_triangle, axis=1).ravel(), x.size).astype(float)

    weight = gathered([twice / 6.0] * 3)
    around = np.maximum(6.0 * weight, 1e-300)
    order = ((p, q, r), (q, r, p), (r, p, q))
    lever_x = gathered([0.5 * twice * (2 * x[i] - x[j] - x[k]) for i, j, k in order]) / around
    lever_y = gathered([0.5 * twice * (2 * y[i] - y[j] - y[k]) for i, j, k in order]) / around
    sum_x = lever_x[triangles].sum(axis=1)
    sum_y = lever_y[triangles].sum(axis=1)
    bend = gathered([sum_x * (y[j] - y[k]) + sum_y * (x[k] - x[j]) for _, j, k in order])
    return weight - bend / 24.0


def _scatter(
    x: Array,
    y: Array,
    values: Array,
    triangles: NDArray[np.int32],
    neighbours: NDArray[np.int32],
    measured: int,
) -> Array:
    """Variance of the values of the first `measured` points, from how badly planes fit them.

    Two triangles that share an edge have four points and a plane three unknowns; the combination of the four
    values in which every plane cancels is left with noise (and with curvature, which a linear interpolant
    misses too). A point's variance is the mean over the pairs it belongs to.
    """
    one, corner = np.nonzero(neighbours > np.arange(len(triangles))[:, None])
    other = neighbours[one, corner]
    a = triangles[one, corner]
    b, c = triangles[one, (corner + 1) % 3], triangles[one, (corner + 2) % 3]
    d = triangles[other].sum(axis=1) - b - c

    # Coefficients of the affine dependence of four points in a plane.
    k = np.stack(
        [
            _doubled(x, y, b, c, d),
            -_doubled(x, y, a, c, d),
            _doubled(x, y, a, b, d),
            -_doubled(x, y, a, b, c),
        ]
    )
    points = np.stack([a, b, c, d])
    norm = (k**2).sum(axis=0)
    good = (norm > 0) & (points < measured).all(axis=0)
    square = ((k * values[points]).sum(axis=0)[good] ** 2) / norm[good]
    where = points[:, good]
    total = np.bincount(where.ravel(), np.tile(square, 4), minlength=measured)
    count = np.bincount(where.ravel(), minlength=measured)
    mean = square.mean() if square.size else 0.0
    return np.where(count > 0, total / np.maximum(count, 1), mean)


def _coverage(x: Array, y: Array, triangles: NDArray[np.int32], measured: int) -> float:
    """Share of the disk in triangles between measured points whose edges are not long for this table.

    Long is more than four times the distance to the nearest neighbour that nine points in ten stay below.
    """
    edges = np.stack(
        [
            np.hypot(x[triangles[:, i]] - x[triangles[:, j]], y[triangles[:, i]] - y[triangles[:, j]])
            for i, j in ((0, 1), (1, 2), (2, 0))
        ]
    )
    nearest = np.full(x.size, np.inf)
    for edge, (i, j) in zip(edges, ((0, 1), (1, 2), (2, 0))):
        np.minimum.at(nearest, triangles[:, i], edge)
        np.minimum.at(nearest, triangles[:, j], edge)
    limit = 4.0 * np.quantile(nearest[:measured], 0.9)
    inside = (triangles < measured).all(axis=1) & (edges.max(axis=0) <= limit)
    area = 0.5 * _doubled(x, y, *triangles[inside].T)
    return float(min(area.sum() / np.pi, 1.0))
