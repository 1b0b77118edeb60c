"""Point location in a triangulation; see `specularia.gonio.interpolant` for what it is for."""

from __future__ import annotations

import numba as nb
import numpy as np


@nb.njit(cache=True, error_model="numpy", nogil=True)
def interpolate(x, y, values, triangles, neighbours, qx, qy):  # type: ignore[no-untyped-def]
    """Linear interpolation at query points that follow each other closely.

    Each search walks from the triangle of the query before, across the edge that has the query on its other
    side, until no edge does (visibility walk, which ends in any Delaunay triangulation).

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
        px, py = qx[i], qy[i]
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
        p, q, r = triangles[t, 0], triangles[t, 1], triangles[t, 2]
        if total > 0.0:
            out[i] = (b0 * values[p] + b1 * values[q] + b2 * values[r]) / total
        else:
            out[i] = (values[p] + values[q] + values[r]) / 3.0
    return out
