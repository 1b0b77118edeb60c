"""First hits of rays among triangles, one by one: what stands outside a window has few of them."""

from __future__ import annotations

import math

import numba as nb
import numpy as np


@nb.njit(cache=True, error_model="numpy", nogil=True, parallel=True)
def first_hits(origins, directions, triangles):  # type: ignore[no-untyped-def]
    """Index of the triangle that each ray meets first, and how far away.

    Parameters
    ----------
    origins : [O, 3].
    directions : [D, 3] unit vectors; every origin sends a ray each way.
    triangles : [T, 3, 3] corners; both sides count.

    Returns
    -------
    hit : [O, D] index of the triangle, -1 where there is none.
    distance : [O, D], infinite where there is none.

    References
    ----------
    Moller and Trumbore 1997, doi:10.1080/10867651.1997.10487468.
    """
    hit = np.full((origins.shape[0], directions.shape[0]), -1, dtype=np.int64)
    distance = np.full((origins.shape[0], directions.shape[0]), np.inf)
    for k in nb.prange(origins.shape[0] * directions.shape[0]):
        o, d = k // directions.shape[0], k % directions.shape[0]
        dx, dy, dz = directions[d, 0], directions[d, 1], directions[d, 2]
        for t in range(triangles.shape[0]):
            ax, ay, az = triangles[t, 0, 0], triangles[t, 0, 1], triangles[t, 0, 2]
            ex, ey, ez = triangles[t, 1, 0] - ax, triangles[t, 1, 1] - ay, triangles[t, 1, 2] - az
            fx, fy, fz = triangles[t, 2, 0] - ax, triangles[t, 2, 1] - ay, triangles[t, 2, 2] - az
            px, py, pz = dy * fz - dz * fy, dz * fx - dx * fz, dx * fy - dy * fx
            volume = ex * px + ey * py + ez * pz
            if abs(volume) < 1e-14:
                continue
            sx, sy, sz = origins[o, 0] - ax, origins[o, 1] - ay, origins[o, 2] - az
            u = (sx * px + sy * py + sz * pz) / volume
            # A ray through the edge that two triangles share must not slip between them.
            if u < -1e-9 or u > 1.0 + 1e-9:
                continue
            qx, qy, qz = sy * ez - sz * ey, sz * ex - sx * ez, sx * ey - sy * ex
            v = (dx * qx + dy * qy + dz * qz) / volume
            if v < -1e-9 or u + v > 1.0 + 1e-9:
                continue
            far = (fx * qx + fy * qy + fz * qz) / volume
            if 1e-7 < far < distance[o, d] and math.isfinite(far):
                distance[o, d] = far
                hit[o, d] = t
    return hit, distance
