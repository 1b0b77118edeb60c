"""Kernels for trees of rank 4: means over pairs of cells, merging of blocks, emission of the tree.

Cells are stored as [i, j, a, b]: incident cell (i, j), outgoing cell (a, b), n x n outgoing ones. An
isotropic sample is stored for the incident quarter i, j >= n / 2 alone, the rest being that quarter turned by
90, 180 and 270 degrees, outgoing cells included; any other one is stored whole. What belongs to blocks of
2^k cells along each edge, k = 1, 2, ..., stands in one flat array, k after k; `offset[k]` is where level k
begins.
"""

from __future__ import annotations

import math
from typing import Any

import numba as nb
import numpy as np

_INLINE: dict[str, Any] = {"cache": True, "error_model": "numpy", "nogil": True, "inline": "always"}
_PLAIN: dict[str, Any] = {"cache": True, "error_model": "numpy", "nogil": True}
_PARALLEL: dict[str, Any] = {"cache": True, "error_model": "numpy", "parallel": True}


@nb.njit(**_INLINE)
def _block(cells, offset, k, i, j, a, b):  # type: ignore[no-untyped-def]
    """Place in a flat array of the block of level k with these numbers."""
    n = cells.shape[2] >> k
    return offset[k] + ((i * (cells.shape[1] >> k) + j) * n + a) * n + b


@nb.njit(**_INLINE)
def _twice_integrated(mean, second, x):  # type: ignore[no-untyped-def]
    """Second integral over azimuth at x bins, of values constant over each bin: exact within the bin."""
    k = int(x)
    t = x - k
    return second[k] + (second[k + 1] - second[k]) * t + 0.5 * mean[k] * (t * t - t)


@nb.njit(**_PLAIN)
def _pair(mean, second, bins, low_i, high_i, low_o, high_o):  # type: ignore[no-untyped-def]
    """Mean over azimuths of incidence low_i to high_i and outgoing ones low_o to high_o, all in bins."""
    shift = bins * math.ceil((high_i - low_o) / bins)
    first = low_o + shift - high_i
    a, b = high_i - low_i, high_o - low_o
    total = _twice_integrated(mean, second, first) - _twice_integrated(mean, second, first + a)
    total += _twice_integrated(mean, second, first + a + b) - _twice_integrated(mean, second, first + b)
    return max(total / (a * b), 0.0)


@nb.njit(**_PARALLEL)
def isotropic_cells(mean, second, bins, shell, low, high, weight):  # type: ignore[no-untyped-def]
    """Means over all pairs of an incident cell of the quarter and an outgoing cell, [n/2, n/2, n, n].

    Parameters
    ----------
    mean : [S, S, K] mean over an incident shell, an outgoing shell and a bin of azimuth between the two; K
        exceeds `bins`, the number of bins around the circle, and goes on into the second turn.
    second : [S, S, K + 1] twice summed along azimuth.
    shell : [n, n, m] shells that a cell of the square lies in.
    low, high : [n, n, m] azimuths between which it lies there, in bins.
    weight : [n, n, m] share of the cell there.
    """
    n, m = shell.shape[0], shell.shape[2]
    h = n // 2
    out = np.empty((h, h, n, n), np.float32)
    for ij in nb.prange(h * h):
        i, j = ij // h, ij % h
        for a in range(n):
            for b in range(n):
                total = 0.0
                for u in range(m):
                    p = shell[h + i, h + j, u]
                    lo, hi, share = low[h + i, h + j, u], high[h + i, h + j, u], weight[h + i, h + j, u]
                    for v in range(m):
                        q = shell[a, b, v]
                        there = _pair(mean[p, q], second[p, q], bins, lo, hi, low[a, b, v], high[a, b, v])
                        total += share * weight[a, b, v] * there
                out[i, j, a, b] = total
    return out


@nb.njit(**_PARALLEL)
def block_means(fine):  # type: ignore[no-untyped-def]
    """Means of blocks of 2 x 2 x 2 x 2 cells."""
    h, n = fine.shape[0] // 2, fine.shape[2] // 2
    out = np.empty((h, h, n, n), np.float32)
    for ij in nb.prange(h * h):
        i, j = ij // h, ij % h
        for a in range(n):
            for b in range(n):
                total = 0.0
                for c in range(16):
                    total += fine[
                        2 * i + (c & 1), 2 * j + (c >> 1 & 1), 2 * a + (c >> 2 & 1), 2 * b + (c >> 3 & 1)
                    ]
                out[i, j, a, b] = total / 16.0
    return out


@nb.njit(**_PARALLEL)
def merge_costs(cells, means, level, scale):  # type: ignore[no-untyped-def]
    """Sum over each block of 2^level cells along an edge of |cell - mean of the block| times scale [i, j]."""
    s = 1 << level
    out = np.zeros(means.shape, np.float32)
    for ij in nb.prange(means.shape[0] * means.shape[1]):
        i, j = ij // means.shape[1], ij % means.shape[1]
        for p in range(i * s, i * s + s):
            for q in range(j * s, j * s + s):
                price = scale[p, q]
                for a in range(cells.shape[2]):
                    for b in range(means.shape[3]):
                        middle = means[i, j, a >> level, b]
                        moved = np.float32(0.0)
                        for d in range(b * s, b * s + s):
                            moved += abs(cells[p, q, a, d] - middle)
                        out[i, j, a >> level, b] += moved * price
    return out


@nb.njit(**_PARALLEL)
def choose(cost, best, leaves, moved, price):  # type: ignore[no-untyped-def]
    """Whether each block is one leaf, where a leaf costs `price` and light moved costs as much as it is.

    `best`, `leaves` and `moved` are what the blocks of half the edge cost at best, how many leaves they are
    then, and the light that this moves. Returns (merged, best, leaves, moved) of these blocks.
    """
    h, n = cost.shape[0], cost.shape[2]
    merged = np.zeros(cost.shape, np.uint8)
    new_best = np.empty(cost.shape, np.float32)
    new_leaves = np.empty(cost.shape, np.int32)
    new_moved = np.empty(cost.shape, np.float32)
    for ij in nb.prange(h * h):
        i, j = ij // h, ij % h
        for a in range(n):
            for b in range(n):
                apart, count, light = 0.0, 0, 0.0
                if best.size == 0:
                    apart, count = 16.0 * price, 16
                else:
                    for c in range(16):
                        p, q, r, s = (
                            2 * i + (c & 1),
                            2 * j + (c >> 1 & 1),
                            2 * a + (c >> 2 & 1),
                            2 * b + (c >> 3 & 1),
                        )
                        apart += best[p, q, r, s]
                        count += leaves[p, q, r, s]
                        light += moved[p, q, r, s]
                alone = cost[i, j, a, b] + price
                if alone <= apart:
                    merged[i, j, a, b] = 1
                    new_best[i, j, a, b], new_leaves[i, j, a, b] = alone, 1
                    new_moved[i, j, a, b] = cost[i, j, a, b]
                else:
                    new_best[i, j, a, b], new_leaves[i, j, a, b] = apart, count
                    new_moved[i, j, a, b] = light
    return merged, new_best, new_leaves, new_moved


@nb.njit(**_PARALLEL)
def largest_merged(cells, merged, offset):  # type: ignore[no-untyped-def]
    """For each block of two cells along an edge the level of the leaf that holds it, 0 where it is none.

    `merged` holds the choices at levels 1, 2, ...
    """
    h, n = cells.shape[0] // 2, cells.shape[2] // 2
    out = np.zeros((h, h, n, n), np.uint8)
    for ij in nb.prange(h * h):
        i, j = ij // h, ij % h
        for a in range(n):
            for b in range(n):
                for k in range(offset.size - 1, 0, -1):
                    d = k - 1
                    if merged[_block(cells, offset, k, i >> d, j >> d, a >> d, b >> d)]:
                        out[i, j, a, b] = k
                        break
    return out


@nb.njit(**_PARALLEL)
def row_sums(cells, means, offset, level, column):  # type: ignore[no-untyped-def]
    """Sums over outgoing cells of (cells that no merge has touched, times column [a, b]; all others)."""
    out = np.zeros((2, cells.shape[0], cells.shape[1]))
    for ij in nb.prange(cells.shape[0] * cells.shape[1]):
        i, j = ij // cells.shape[1], ij % cells.shape[1]
        for a in range(cells.shape[2]):
            for b in range(cells.shape[3]):
                k = level[i >> 1, j >> 1, a >> 1, b >> 1]
                if k == 0:
                    out[0, i, j] += cells[i, j, a, b] * column[a, b]
                else:
                    out[1, i, j] += means[_block(cells, offset, k, i >> k, j >> k, a >> k, b >> k)]
    return out


@nb.njit(**_PARALLEL)
def column_sums(cells, means, offset, level, row):  # type: ignore[no-untyped-def]
    """Sums over the stored incident cells of (untouched cells times row [i, j]; all others), [2, n, n]."""
    n = cells.shape[2]
    out = np.zeros((2, n, n))
    for a in nb.prange(n):
        for i in range(cells.shape[0]):
            for j in range(cells.shape[1]):
                for b in range(n):
                    k = level[i >> 1, j >> 1, a >> 1, b >> 1]
                    if k == 0:
                        out[0, a, b] += cells[i, j, a, b] * row[i, j]
                    else:
                        out[1, a, b] += means[_block(cells, offset, k, i >> k, j >> k, a >> k, b >> k)]
    return out


@nb.njit(**_PARALLEL)
def light_moved(cells, means, offset, level, row, column):  # type: ignore[no-untyped-def]
    """Sum over outgoing cells of |reduced - cells| for each stored incident cell."""
    out = np.zeros((cells.shape[0], cells.shape[1]))
    for ij in nb.prange(cells.shape[0] * cells.shape[1]):
        i, j = ij // cells.shape[1], ij % cells.shape[1]
        for a in range(cells.shape[2]):
            for b in range(cells.shape[3]):
                k = level[i >> 1, j >> 1, a >> 1, b >> 1]
                v = cells[i, j, a, b]
                if k == 0:
                    out[i, j] += v * abs(row[i, j] * column[a, b] - 1.0)
                else:
                    out[i, j] += abs(means[_block(cells, offset, k, i >> k, j >> k, a >> k, b >> k)] - v)
    return out


@nb.njit(**_PARALLEL)
def extremes(low, high):  # type: ignore[no-untyped-def]
    """Least and greatest of blocks of 2 x 2 x 2 x 2."""
    h, n = low.shape[0] // 2, low.shape[2] // 2
    least, most = np.empty((h, h, n, n), np.uint8), np.empty((h, h, n, n), np.uint8)
    for ij in nb.prange(h * h):
        i, j = ij // h, ij % h
        for a in range(n):
            for b in range(n):
                x, y = np.uint8(255), np.uint8(0)
                for c in range(16):
                    p, q = 2 * i + (c & 1), 2 * j + (c >> 1 & 1)
                    r, s = 2 * a + (c >> 2 & 1), 2 * b + (c >> 3 & 1)
                    x, y = min(x, low[p, q, r, s]), max(y, high[p, q, r, s])
                least[i, j, a, b], most[i, j, a, b] = x, y
    return least, most


@nb.njit(**_INLINE)
def _stored(i, j, a, b, edge, quarter):  # type: ignore[no-untyped-def]
    """Where a block of the whole tree, `edge` blocks along each edge of it, is stored."""
    if not quarter:
        return i, j, a, b
    half = edge // 2
    if i >= half and j >= half:
        return i - half, j - half, a, b
    if i < half and j >= half:
        return j - half, half - 1 - i, b, edge - 1 - a
    if i < half:
        return half - 1 - i, half - 1 - j, edge - 1 - a, edge - 1 - b
    return half - 1 - j, i - half, edge - 1 - b, a


@nb.njit(**_INLINE)
def _rounded(value):  # type: ignore[no-untyped-def]
    """Four significant digits; nothing below 1e-8 per sr."""
    if value < 1e-8:
        return np.float32(0.0)
    scale = 10.0 ** (3.0 - math.floor(math.log10(value)))
    return np.float32(math.floor(value * scale + 0.5) / scale)


@nb.njit(**_PLAIN)
def emit(cells, means, least, most, offset, row, column, log2, start, child, values):  # type: ignore[no-untyped-def]
    """Write the tree, or count its parts where `log2` is empty; returns numbers of (nodes, children, values).

    `least` and `most` are the extremes of `largest_merged` for blocks of level 1, 2, ... Where they agree, a
    block is a grid.
    """
    top, quarter = offset.size, cells.shape[0] < cells.shape[2]
    writing = log2.size > 0
    nodes, children, filled = 0, 0, 0
    stack = np.empty((16 * (top + 1), 6), np.int64)
    stack[0] = top, 0, 0, 0, 0, -1
    depth = 1
    while depth > 0:
        depth -= 1
        level, i, j, a, b, slot = stack[depth]
        if writing and slot >= 0:
            child[slot] = nodes
        uniform, size = False, 0
        if level < top:
            p, q, r, s = _stored(i, j, a, b, 1 << (top - level), quarter)
            k = _block(cells, offset, level, p, q, r, s)
            low, high = least[k], most[k]
            uniform = low == high or low >= level
            size = min(np.int64(low), level)
        if uniform:
            edge = 1 << (level - size)
            if writing:
                log2[nodes], start[nodes] = level - size, filled
                whole = 1 << (top - size)
                at = filled
                for di in range(edge):
                    for dj in range(edge):
                        for da in range(edge):
                            for db in range(edge):
                                p, q, r, s = _stored(
                                    i * edge + di, j * edge + dj, a * edge + da, b * edge + db, whole, quarter
                                )
                                if size == 0:
                                    value = cells[p, q, r, s] * row[p, q] * column[r, s]
                                else:
                                    value = float(means[_block(cells, offset, size, p, q, r, s)])
                                values[at] = _rounded(value)
                                at += 1
            filled += edge**4
            nodes += 1
            continue
        if writing:
            log2[nodes], start[nodes] = -1, children
        nodes += 1
        for c in range(15, -1, -1):
            stack[depth] = (
                level - 1,
                2 * i + (c & 1),
                2 * j + (c >> 1 & 1),
                2 * a + (c >> 2 & 1),
                2 * b + (c >> 3 & 1),
                children + c,
            )
            depth += 1
        children += 16
    return nodes, children, filled
