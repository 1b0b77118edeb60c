"""Point location in a triangulation; see `specularia.gonio.interpolant` for what it is for."""

from __future__ import annotations

import numba as nb
import numpy as np


@nb.njit(cache=True, error_model="numpy", nogil=True)
def _locate(x, y, triangles, neighbours, px, py, t):  # type: ignore[no-untyped-def]
    """Triangle that holds (px, py), and the point's barycentric coordinates there, searched from triangle t.

    The search walks across the edge that has the point on its other side, until no edge does (visibility
    walk, which ends in any Delaunay triangulation).
    """
    b0 = b1 = b2 = 0.0
    # The bound only guards against triangles without area, among which rounding could turn in circles.
    for _ in range(4 * triangles.shape[0]):
        p, q, r = triangles[t, 0], triangles[t, 1], triangles[t, 2]
        b0 = (x[q] - px) * (y[r] - py) - (x[r] - px) * (y[q] - py)
        b1 = (x[r] - px) * (y[p] - py) - (x[p] - px) * (y[r] - py)
        b2 = (x[p] - px) * (y[q] - py) - (x[q] - px) * (y[p] - py)
        if b0 <= b1 and b0 <= b2:
            k, lowest = 0, b0
        elif b1 <= b2:
            k, lowest = 1, b1
        else:
            k, lowest = 2, b2
        if lowest >= -1e-18 or neighbours[t, k] < 0:
            break
        t = neighbours[t, k]
    b0, b1, b2 = max(b0, 0.0), max(b1, 0.0), max(b2, 0.0)
    total = b0 + b1 + b2
    if total > 0.0:
        return t, b0 / total, b1 / total, b2 / total
    return t, 1.0 / 3.0, 1.0 / 3.0, 1.0 / 3.0


@nb.njit(cache=True, error_model="numpy", nogil=True)
def interpolate(x, y, values, triangles, neighbours, qx, qy):  # type: ignore[no-untyped-def]
    """Linear interpolation at query points that follow each other closely.

    Parameters
    ----------
    x, y, values : [P] vertices.
    triangles : [T, 3] vertices of each triangle, counter-clockwise.
    neighbours : [T, 3] triangle opposite each vertex, -1 outside the hull.
    qx, qy : [Q] queries; one outside the hull takes the value at the edge where the walk leaves it.
    """
    out = np.empty(qx.size)
    t = 0
    for i in range(qx.size):
        t, b0, b1, b2 = _locate(x, y, triangles, neighbours, qx[i], qy[i], t)
        out[i] = b0 * values[triangles[t, 0]] + b1 * values[triangles[t, 1]] + b2 * values[triangles[t, 2]]
    return out


@nb.njit(cache=True, error_model="numpy", nogil=True)
def means(x, y, values, variance, triangles, neighbours, qx, qy):  # type: ignore[no-untyped-def]
    """Means of the linear interpolant over groups of points, and the variance that the vertices' noise makes.

    Parameters
    ----------
    x, y, values, variance, triangles, neighbours : as in `interpolate`; variance [P] of the values.
    qx, qy : [C, S] the points of each group; those outside the unit disk do not count.

    Returns
    -------
    mean, variance : [C]; 0 where no point counts.
    """
    mean, spread = np.zeros(qx.shape[0]), np.zeros(qx.shape[0])
    # What each vertex weighs in the group at hand; most groups touch a few, which are listed to be cleared.
    weight = np.zeros(x.size)
    touched = np.empty(3 * qx.shape[1], np.int64)
    t = 0
    for i in range(qx.shape[0]):
        count, number = 0, 0
        for j in range(qx.shape[1]):
            if qx[i, j] * qx[i, j] + qy[i, j] * qy[i, j] > 1.0:
                continue
            t, b0, b1, b2 = _locate(x, y, triangles, neighbours, qx[i, j], qy[i, j], t)
            number += 1
            for k in range(3):
                vertex = triangles[t, k]
                if weight[vertex] == 0.0:
                    touched[count] = vertex
                    count += 1
                weight[vertex] += b0 if k == 0 else b1 if k == 1 else b2
        for j in range(count):
            vertex = touched[j]
            share = weight[vertex] / number
            mean[i] += share * values[vertex]
            spread[i] += share * share * variance[vertex]
            weight[vertex] = 0.0
    return mean, spread
