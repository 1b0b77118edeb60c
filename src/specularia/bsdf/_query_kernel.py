"""Look-up of single values in tensor trees and Klems matrices; see `xml_model` for the frames.

Every function answers NaN where a direction is NaN or lies outside the unit disk. Pairs of directions are
taken in blocks; within one, arithmetic without branches (which compilers turn into vector instructions) comes
first and the access to memory last. Sines and arctangents are polynomials of double precision, therefore.
"""

from __future__ import annotations

import math
from typing import Any

import numba as nb
import numpy as np

_BLOCK = 512
_INLINE: dict[str, Any] = {"cache": True, "error_model": "numpy", "nogil": True, "inline": "always"}


@nb.njit(**_INLINE)
def _sin_cos(degrees):  # type: ignore[no-untyped-def]
    """Sine and cosine to 1e-13: Taylor polynomials within 45 degrees of the nearest multiple of 90."""
    quarter = math.floor(degrees * (1.0 / 90.0) + 0.5)
    r = (degrees - 90.0 * quarter) * (math.pi / 180.0)
    z = r * r
    s = 1.0 - z * (1 / 6 - z * (1 / 120 - z * (1 / 5040 - z * (1 / 362880 - z * (1 / 39916800)))))
    s = r * (s + z**6 * (1 / 6227020800))
    c = 1 / 40320 - z * (1 / 3628800 - z * (1 / 479001600 - z * (1 / 87178291200)))
    c = 1.0 - z * (0.5 - z * (1 / 24 - z * (1 / 720 - z * c)))
    turn = quarter - 4.0 * math.floor(quarter * 0.25)
    odd = turn == 1.0 or turn == 3.0
    sine, cosine = (c if odd else s), (s if odd else c)
    return (-sine if turn >= 2.0 else sine), (-cosine if turn == 1.0 or turn == 2.0 else cosine)


@nb.njit(**_INLINE)
def _octant(x, y):  # type: ignore[no-untyped-def]
    """Angle between (x, y) and the nearer axis over 45 degrees, 0 to 1 (rational function of Cephes)."""
    ax, ay = abs(x), abs(y)
    large, small = max(ax, ay), min(ax, ay)
    t = small / (large if large > 0.0 else 1.0)
    far = t > 0.4142135623730951
    t = (t - 1.0) / (t + 1.0) if far else t
    z = t * t
    p = -6.485021904942025371773e1 + z * (
        -1.228866684490136173410e2
        + z * (-7.500855792314704667340e1 + z * (-1.615753718733365076637e1 - z * 8.750608600031904122785e-1))
    )
    q = 4.328810604912902668951e2 + z * (1.650270098316988542046e2 + z * (2.485846490142306297962e1 + z))
    q = 1.945506571482613964425e2 + z * (4.853903996359136964868e2 + z * q)
    return (t + t * z * (p / q)) * (4.0 / math.pi) + (1.0 if far else 0.0)


@nb.njit(**_INLINE)
def _square(x, y):  # type: ignore[no-untyped-def]
    """Unit disk to unit square (Shirley and Chiu), as `conventions.disk_to_square`, kept within [0, 1)."""
    r = math.sqrt(x * x + y * y)
    minor = r * _octant(x, y)
    wide = abs(x) >= abs(y)
    p, q = (r if wide else minor), (minor if wide else r)
    p, q = 0.5 + 0.5 * (-p if x < 0.0 else p), 0.5 + 0.5 * (-q if y < 0.0 else q)
    return min(max(p, 0.0), 0.9999999999999999), min(max(q, 0.0), 0.9999999999999999)


@nb.njit(**_INLINE)
def _turn(x, y):  # type: ignore[no-untyped-def]
    """Azimuth of (x, y) over 360 degrees, 0 to 1."""
    a = 0.125 * _octant(x, y)
    a = 0.25 - a if abs(y) > abs(x) else a
    a = 0.5 - a if x < 0.0 else a
    return 1.0 - a if y < 0.0 else a


@nb.njit(**_INLINE)
def _incident(first, second, angles):  # type: ignore[no-untyped-def]
    """(sin theta, cos phi, sin phi) from angles in degrees or from direction cosines.

    NaN for sin theta where the direction is none; light on the normal comes from azimuth 0.
    """
    if angles:
        s, _ = _sin_cos(first)
        d, c = _sin_cos(second)
        some = s != 0.0
        good = first >= 0.0 and first < 90.0
        return (s if good else math.nan), (c if some else 1.0), (d if some else 0.0)
    s = math.sqrt(first * first + second * second)
    some = s > 0.0
    scale = 1.0 / (s if some else 1.0)
    return (s if s <= 1.0 else math.nan), (first * scale if some else 1.0), second * scale


@nb.njit(cache=True, error_model="numpy", nogil=True)
def _descend(rank, log2, start, child, values, p):  # type: ignore[no-untyped-def]
    """Value of the leaf that holds the position p, whose entries are used up."""
    for k in range(rank):
        p[k] = min(max(p[k], 0.0), 0.9999999999999999)
    node = 0
    while log2[node] < 0:
        which = 0
        for k in range(rank):
            p[k] *= 2.0
            if p[k] >= 1.0:
                p[k] -= 1.0
                which |= 1 << k
        node = child[start[node] + which]
    edge = 1 << log2[node]
    flat = 0
    for k in range(rank):
        flat = flat * edge + min(int(p[k] * edge), edge - 1)
    return values[start[node] + flat]


@nb.njit(cache=True, error_model="numpy", parallel=True)
def tree_positions(rank, log2, start, child, values, position):  # type: ignore[no-untyped-def]
    """Values [K] at positions [K, rank] in the unit cube."""
    out = np.empty(position.shape[0], np.float32)
    for i in nb.prange(position.shape[0]):
        out[i] = _descend(rank, log2, start, child, values, position[i].copy())
    return out


@nb.njit(cache=True, error_model="numpy", parallel=True)
def tree_cells(rank, log2, start, child, values, resolution):  # type: ignore[no-untyped-def]
    """All cells of the finest size as one array in C order, negative values as zero."""
    edge = 1 << resolution
    count = 1 << (rank * resolution)
    out = np.empty(count, np.float32)
    for i in nb.prange(count):
        p = np.empty(rank)
        for k in range(rank):
            p[k] = (((i >> (resolution * (rank - 1 - k))) & (edge - 1)) + 0.5) / edge
        out[i] = max(_descend(rank, log2, start, child, values, p), np.float32(0.0))
    return out


@nb.njit(**_INLINE)
def _place(rank, below, s, c, d, ux, uy):  # type: ignore[no-untyped-def]
    """Position in a tree; `below` is the distance that rank 3 keeps from the middle of the first axis."""
    if rank == 3:
        a, b = _square(-(ux * c + uy * d), uy * c - ux * d)
        return max((0.5 - below) - 0.5 * s, 0.0), a, b, 0.0
    i, j = _square(s * c, -s * d)
    a, b = _square(-ux, uy)
    return i, j, a, b


@nb.njit(cache=True, error_model="numpy", parallel=True)
def tree_values(rank, log2, start, child, values, below, first, second, ux, uy, angles):  # type: ignore[no-untyped-def]
    """BSDF of a tree between K pairs of our directions, negative values as zero.

    Incident directions are (theta, phi) in degrees if `angles`, and else direction cosines.
    """
    out = np.empty(first.size)
    for i in nb.prange(first.size):
        s, c, d = _incident(first[i], second[i], angles)
        if s <= 1.0 and ux[i] * ux[i] + uy[i] * uy[i] <= 1.0:
            p = np.empty(4)
            p[0], p[1], p[2], p[3] = _place(rank, below, s, c, d, ux[i], uy[i])
            out[i] = max(_descend(rank, log2, start, child, values, p), 0.0)
        else:
            out[i] = np.nan
    return out


@nb.njit(cache=True, error_model="numpy", nogil=True)
def _cell_numbers(rank, resolution, below, first, second, ux, uy, angles, index):  # type: ignore[no-untyped-def]
    """Number in C order of the cells that hold pairs of directions; -1 for directions that are none."""
    edge = float(1 << resolution)
    n = np.int32(1 << resolution)
    for i in range(first.size):
        x, y = ux[i], uy[i]
        s, c, d = _incident(first[i], second[i], angles)
        good = s <= 1.0 and x * x + y * y <= 1.0
        p, q, a, b = _place(rank, below, s if good else 0.0, c, d, x if good else 0.0, y if good else 0.0)
        at = (np.int32(p * edge) * n + np.int32(q * edge)) * n + np.int32(a * edge)
        if rank == 4:
            at = at * n + np.int32(b * edge)
        index[i] = at if good else np.int32(-1)


@nb.njit(cache=True, error_model="numpy", parallel=True)
def cell_values(rank, resolution, cells, below, first, second, ux, uy, angles):  # type: ignore[no-untyped-def]
    """As `tree_values`, for a tree as `tree_cells` gives it."""
    out = np.empty(first.size)
    for block in nb.prange((first.size + _BLOCK - 1) // _BLOCK):
        begin, end = block * _BLOCK, min(block * _BLOCK + _BLOCK, first.size)
        index = np.empty(_BLOCK, np.int32)
        part = (first[begin:end], second[begin:end], ux[begin:end], uy[begin:end])
        _cell_numbers(rank, resolution, below, *part, angles, index)
        for j in range(end - begin):
            out[begin + j] = cells[index[j]] if index[j] >= 0 else np.nan
    return out


@nb.njit(**_INLINE)
def _ring(r2, edge2, near):  # type: ignore[no-untyped-def]
    """Ring that holds a squared sine; `near` gives the ring at the lower end of equal steps of it."""
    ring = near[int(min(r2, 1.0) * (near.size - 1))]
    while ring < edge2.size - 2 and r2 >= edge2[ring + 1]:
        ring += 1
    return ring


@nb.njit(**_INLINE)
def _patch(ring, turn, count, first):  # type: ignore[no-untyped-def]
    """Number of the patch at an azimuth, as a share of the circle, in a ring."""
    k = int(turn * count[ring] + 0.5)
    return first[ring] + (0 if k >= count[ring] else k)


@nb.njit(cache=True, error_model="numpy", nogil=True)
def patch_numbers(x, y, edge2, near, count, first):  # type: ignore[no-untyped-def]
    """Klems patches [K] that hold the direction cosines (x, y); `edge2` are squared sines of the rings.

    On one core: it is asked for some thousand directions at a time, which take less than to wake the others.
    """
    out = np.empty(x.size, np.int64)
    for i in range(x.size):
        out[i] = _patch(_ring(x[i] * x[i] + y[i] * y[i], edge2, near), _turn(x[i], y[i]), count, first)
    return out


@nb.njit(cache=True, error_model="numpy", nogil=True)
def _polar(first, second, ux, uy, angles, turn, r2):  # type: ignore[no-untyped-def]
    """Azimuths and squared sines, [incident, outgoing]; -1 for directions that are none."""
    for i in range(first.size):
        x, y = ux[i], uy[i]
        s, c, d = _incident(first[i], second[i], angles)
        good = s <= 1.0 and x * x + y * y <= 1.0
        turn[0, i], turn[1, i] = _turn(c, -d), _turn(-x, y)
        r2[0, i], r2[1, i] = (s * s if good else -1.0), x * x + y * y


@nb.njit(cache=True, error_model="numpy", parallel=True)
def klems_values(matrix, incident, outgoing, first, second, ux, uy, angles):  # type: ignore[no-untyped-def]
    """BSDF of a matrix [outgoing, incident] between K pairs of our directions, negative values as zero.

    `incident` and `outgoing` are bases as (edge2, near, count, first) of `patch_numbers`.
    """
    edge2_i, near_i, count_i, first_i = incident
    edge2_o, near_o, count_o, first_o = outgoing
    out = np.empty(first.size)
    for block in nb.prange((first.size + _BLOCK - 1) // _BLOCK):
        begin, end = block * _BLOCK, min(block * _BLOCK + _BLOCK, first.size)
        turn, r2 = np.empty((2, _BLOCK)), np.empty((2, _BLOCK))
        _polar(first[begin:end], second[begin:end], ux[begin:end], uy[begin:end], angles, turn, r2)
        for j in range(end - begin):
            if r2[0, j] >= 0.0:
                column = _patch(_ring(r2[0, j], edge2_i, near_i), turn[0, j], count_i, first_i)
                row = _patch(_ring(r2[1, j], edge2_o, near_o), turn[1, j], count_o, first_o)
                out[begin + j] = max(matrix[row, column], 0.0)
            else:
                out[begin + j] = np.nan
    return out
