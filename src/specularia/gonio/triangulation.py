"""Triangulations of scattered points in a plane, and the rule that integrates over them."""

from __future__ import annotations

from typing import Any

import numba as nb
import numpy as np
from numpy.typing import NDArray

from specularia.gonio.table import Array

__all__ = ["doubled_area", "linear_weights", "merged", "triangulate", "weights"]

_ROUND = 1e-3
"""Sine of the sum of opposite angles below which four points lie on one circle."""

_MANY = 0.05
"""Share of such pairs of triangles from which on the points count as a grid."""

_SEED = 1


def triangulate(x: Array, y: Array) -> tuple[NDArray[np.int32], NDArray[np.int32]]:
    """[T, 3] counter-clockwise triangles (Delaunay) and their neighbours, opposite each vertex, -1 outside.

    By a sweep outwards (`_delaunay.sweep`); where rounding has left a point out of it or a triangle without
    area, by Qhull, which takes some fifteen times as long.
    """
    from specularia.gonio._delaunay import sweep

    triangles, neighbours, missed = sweep(np.ascontiguousarray(x), np.ascontiguousarray(y))
    # Of the triangles over P points whose hull has h edges there are 2 P - 2 - h (Euler).
    whole = len(triangles) == 2 * x.size - 2 - int(np.sum(neighbours < 0))
    if missed == 0 and whole and np.all(doubled_area(x, y, *triangles.T) > 0):
        return triangles, neighbours
    from scipy.spatial import Delaunay

    found: Any = Delaunay(np.stack([x, y], axis=1))
    return found.simplices, found.neighbors


def doubled_area(x: Array, y: Array, p: Any, q: Any, r: Any) -> Array:
    """Twice the signed area of triangles, positive counter-clockwise."""
    return (x[q] - x[p]) * (y[r] - y[p]) - (x[r] - x[p]) * (y[q] - y[p])


def weights(
    x: Array, y: Array, triangles: NDArray[np.int32], neighbours: NDArray[np.int32] | None = None
) -> Array:
    """[P] weights that integrate a function over the triangulation from its values at the vertices.

    The linear interpolant's integral exceeds that of a function with the Hessian H by
    (A / 24) sum_edges e.H e on each triangle. Over a peak this averages out where triangles are alike, but
    not on a polar grid or where a coarse grid meets a refined one (on a polar grid, (step / sigma)^2 / 12 for
    a lobe at the pole). H e is the difference of the gradients at the edge's ends, and the gradient at a
    vertex the mean over the triangles around it, so the corrected integral is again a weighted sum of values:

        integral = sum_T A_T mean(f) - (1/24) sum_i g_i . c_i,   c_i = sum_T A_T (2 p_i - q - r).

    On a grid, where four points lie on one circle, either diagonal is as good, but all of one slant are not
    as good as both in turn. Given the neighbours, the weights are the mean of two triangulations in which
    each such diagonal lies in one way and in the other, by chance. Ours; the error term is that of the
    trapezoidal rule on a triangle.
    """
    if neighbours is not None:
        both = _both_diagonals(x, y, triangles, neighbours)
        joined: Array = np.mean([weights(x, y, t) for t in both], axis=0)
        return joined
    return np.asarray(_corrected_weights(x, y, triangles))


@nb.njit(cache=True, error_model="numpy", nogil=True)
def _corrected_weights(x, y, triangles):  # type: ignore[no-untyped-def]
    """The weights of one triangulation; see `weights`."""
    size, count = x.size, len(triangles)
    # A third of the area around each point; then the levers c_i over that area, with which g_i enters.
    weight, lever_x, lever_y = np.zeros(size), np.zeros(size), np.zeros(size)
    for t in range(count):
        p, q, r = triangles[t, 0], triangles[t, 1], triangles[t, 2]
        twice = (x[q] - x[p]) * (y[r] - y[p]) - (x[r] - x[p]) * (y[q] - y[p])
        for i, j, k in ((p, q, r), (q, r, p), (r, p, q)):
            weight[i] += twice / 6.0
            lever_x[i] += 0.5 * twice * (2.0 * x[i] - x[j] - x[k])
            lever_y[i] += 0.5 * twice * (2.0 * y[i] - y[j] - y[k])
    for i in range(size):
        around = max(6.0 * weight[i], 1e-300)
        lever_x[i] /= around
        lever_y[i] /= around
    bend = np.zeros(size)
    for t in range(count):
        p, q, r = triangles[t, 0], triangles[t, 1], triangles[t, 2]
        sum_x = lever_x[p] + lever_x[q] + lever_x[r]
        sum_y = lever_y[p] + lever_y[q] + lever_y[r]
        for i, j, k in ((p, q, r), (q, r, p), (r, p, q)):
            bend[i] += sum_x * (y[j] - y[k]) + sum_y * (x[k] - x[j])
    return weight - bend / 24.0


def _both_diagonals(
    x: Array, y: Array, triangles: NDArray[np.int32], neighbours: NDArray[np.int32]
) -> list[NDArray[np.int32]]:
    """Two triangulations that differ in the diagonal wherever two triangles share a circle; one if few do."""
    one, corner = np.nonzero(neighbours > np.arange(len(triangles))[:, None])
    other = neighbours[one, corner]
    a, b, c = (triangles[one, (corner + k) % 3] for k in range(3))
    d = triangles[other].sum(axis=1) - b - c

    def angle(p: Any, q: Any, r: Any) -> tuple[Array, Array]:
        """Cosine and sine, not normalised, of the angle at p."""
        dot = (x[q] - x[p]) * (x[r] - x[p]) + (y[q] - y[p]) * (y[r] - y[p])
        return dot, doubled_area(x, y, p, q, r)

    (ca, sa), (cd, sd) = angle(a, b, c), angle(d, c, b)
    size = np.hypot(ca, sa) * np.hypot(cd, sd)
    found = np.flatnonzero(np.abs(sa * cd + ca * sd) < _ROUND * size)
    # Each triangle takes part once.
    found = found[np.unique(one[found], return_index=True)[1]]
    found = found[np.unique(other[found], return_index=True)[1]]
    found = found[~np.isin(one[found], other[found])]
    if found.size < _MANY * len(triangles):
        return [triangles]
    way = np.random.default_rng(_SEED).random(found.size) < 0.5
    both = []
    for chosen in (found[way], found[~way]):
        turned = triangles.copy()
        turned[one[chosen]] = np.stack([a, b, d], axis=1)[chosen]
        turned[other[chosen]] = np.stack([a, d, c], axis=1)[chosen]
        both.append(turned)
    return both


def linear_weights(x: Array, y: Array, triangles: NDArray[np.int32]) -> Array:
    """[P] weights of the plain rule: each triangle's area times the mean of its vertices."""
    twice = doubled_area(x, y, *triangles.T)
    return np.bincount(triangles.ravel(), np.repeat(twice / 6.0, 3), x.size).astype(float)


def merged(x: Array, y: Array) -> tuple[NDArray[np.intp], NDArray[np.intp], NDArray[np.intp]]:
    """Points within 1e-7 of each other as one: first of each group, group of each point, size of each group.

    The groups are sorted by place, which helps speed.
    """
    key = np.round(x * 1e7) + 1j * np.round(y * 1e7)
    _, first, group, count = np.unique(key, return_index=True, return_inverse=True, return_counts=True)
    return first, group.ravel(), count
