"""Closed form of the light that a polygon sheds on a point; see `specularia.daylight.interreflection`."""

from __future__ import annotations

import math

import numba as nb
import numpy as np


@nb.njit(cache=True, error_model="numpy", nogil=True)
def _edge(a, b, n):  # type: ignore[no-untyped-def]
    """Angle under which the edge a-b is seen, times the normal's share along a x b (Lambert 1760)."""
    cx = a[1] * b[2] - a[2] * b[1]
    cy = a[2] * b[0] - a[0] * b[2]
    cz = a[0] * b[1] - a[1] * b[0]
    length = math.sqrt(cx * cx + cy * cy + cz * cz)
    if length < 1e-300:
        return 0.0
    angle = math.atan2(length, a[0] * b[0] + a[1] * b[1] + a[2] * b[2])
    return angle * (n[0] * cx + n[1] * cy + n[2] * cz) / length


@nb.njit(cache=True, error_model="numpy", nogil=True)
def configuration_factors(points, normals, quads):  # type: ignore[no-untyped-def]
    """Share of a point's cosine-weighted hemisphere that each quadrilateral fills.

    Parameters
    ----------
    points, normals : [P, 3].
    quads : [Q, 4, 3] convex and flat, corners in order; either sense of turning.

    Returns
    -------
    [P, Q], 0 to 1. What lies below the horizon of a point is cut off.
    """
    out = np.zeros((points.shape[0], quads.shape[0]))
    v = np.empty((4, 3))
    h = np.empty(4)
    leaves, enters = np.empty(3), np.empty(3)
    a, b = np.empty(3), np.empty(3)
    for p in range(points.shape[0]):
        n = normals[p]
        for q in range(quads.shape[0]):
            above = 0
            for k in range(4):
                h[k] = 0.0
                for d in range(3):
                    v[k, d] = quads[q, k, d] - points[p, d]
                    h[k] += n[d] * v[k, d]
                # A corner in the plane of the point counts as below: a coplanar polygon sheds no light.
                above += h[k] > 1e-12
            if above == 0:
                continue
            total = 0.0
            cut = False
            for k in range(4):
                m = (k + 1) % 4
                first, second = h[k] > 1e-12, h[m] > 1e-12
                if not first and not second:
                    continue
                for d in range(3):
                    a[d], b[d] = v[k, d], v[m, d]
                if first != second:
                    cut = True
                    share = h[k] / (h[k] - h[m])
                    for d in range(3):
                        crossing = v[k, d] + share * (v[m, d] - v[k, d])
                        if first:
                            b[d] = crossing
                            leaves[d] = crossing
                        else:
                            a[d] = crossing
                            enters[d] = crossing
                total += _edge(a, b, n)
            if cut:
                total += _edge(leaves, enters, n)
            out[p, q] = abs(total) / (2.0 * math.pi)
    return out
