"""Delaunay triangulation of points in a plane by a sweep outwards; see `specularia.gonio.triangulation`.

Points are taken in the order of their distance from the middle of a small triangle near their centre. Each
is joined to the edges of the hull that it sees, found through a table of the hull by direction, and edges
are then turned until no triangle's circle holds the corner of its neighbour. Edge e of triangle t is number
3 t + e and runs from corner e to the next one; triangles run clockwise here.

References
---------- Sinclair, D. (2010), S-hull: a fast radial sweep-hull routine for Delaunay triangulation,
arXiv:1604.01428 Guibas, L. and Stolfi, J. (1985), Primitives for the manipulation of general subdivisions
and the computation of Voronoi diagrams, ACM Transactions on Graphics 4(2), doi:10.1145/282918.282923
"""

from __future__ import annotations

import math

import numba as nb
import numpy as np

_STACK = 512
"""Edges that wait to be looked at; further ones stay as they are, which the caller's check would find."""


@nb.njit(cache=True, error_model="numpy", nogil=True)
def _turn(x, y, a, b, c):  # type: ignore[no-untyped-def]
    """Twice the area of a triangle, positive clockwise."""
    return (y[a] - y[c]) * (x[b] - x[c]) - (x[a] - x[c]) * (y[b] - y[c])


@nb.njit(cache=True, error_model="numpy", nogil=True)
def _in_circle(x, y, a, b, c, p):  # type: ignore[no-untyped-def]
    """Whether p lies inside the circle through the clockwise triangle a, b, c."""
    dx, dy = x[a] - x[p], y[a] - y[p]
    ex, ey = x[b] - x[p], y[b] - y[p]
    fx, fy = x[c] - x[p], y[c] - y[p]
    ap, bp, cp = dx * dx + dy * dy, ex * ex + ey * ey, fx * fx + fy * fy
    return dx * (ey * cp - bp * fy) - dy * (ex * cp - bp * fx) + ap * (ex * fy - ey * fx) < 0.0


@nb.njit(cache=True, error_model="numpy", nogil=True)
def _circle(x, y, a, b, c):  # type: ignore[no-untyped-def]
    """Middle of the circle through three points, and its squared radius; infinite for points on one line."""
    dx, dy = x[b] - x[a], y[b] - y[a]
    ex, ey = x[c] - x[a], y[c] - y[a]
    bl, cl = dx * dx + dy * dy, ex * ex + ey * ey
    d = dx * ey - dy * ex
    if d == 0.0:
        return 0.0, 0.0, np.inf
    u, v = (ey * bl - dy * cl) * 0.5 / d, (dx * cl - ex * bl) * 0.5 / d
    return x[a] + u, y[a] + v, u * u + v * v


@nb.njit(cache=True, error_model="numpy", nogil=True)
def _slot(dx, dy, size):  # type: ignore[no-untyped-def]
    """Place of a direction in the table of the hull: grows with the angle, from 0 to size."""
    length = abs(dx) + abs(dy)
    p = dx / length if length > 0.0 else 0.0
    return int(math.floor((3.0 - p if dy > 0.0 else 1.0 + p) / 4.0 * size)) % size


@nb.njit(cache=True, error_model="numpy", nogil=True)
def _link(twin, a, b):  # type: ignore[no-untyped-def]
    """Make two edges each other's twin; -1 is the outside."""
    twin[a] = b
    if b != -1:
        twin[b] = a


@nb.njit(cache=True, error_model="numpy", nogil=True)
def _seed(x, y):  # type: ignore[no-untyped-def]
    """A small clockwise triangle near the centre of all points, or -1 where they lie on one line."""
    middle_x, middle_y = 0.5 * (x.min() + x.max()), 0.5 * (y.min() + y.max())
    a = np.argmin((x - middle_x) ** 2 + (y - middle_y) ** 2)
    b, least = -1, np.inf
    for i in range(x.size):
        d = (x[i] - x[a]) ** 2 + (y[i] - y[a]) ** 2
        if i != a and 0.0 < d < least:
            b, least = i, d
    c, least = -1, np.inf
    if b >= 0:
        for i in range(x.size):
            if i != a and i != b:
                _, _, r = _circle(x, y, a, b, i)
                if r < least:
                    c, least = i, r
    if c >= 0 and _turn(x, y, a, b, c) < 0.0:
        b, c = c, b
    return a, b, c


@nb.njit(cache=True, error_model="numpy", nogil=True)
def _make_legal(edge, x, y, corner, twin, before, of_hull, start, stack):  # type: ignore[no-untyped-def]
    """Turn edges from one on until no circle holds a neighbour's corner; returns the edge left of it."""
    waiting = 0
    left = 0
    a = edge
    while True:
        b = twin[a]
        a0 = a - a % 3
        left = a0 + (a + 2) % 3
        turned = False
        if b != -1:
            b0 = b - b % 3
            far = b0 + (b + 2) % 3
            p0, p1 = corner[left], corner[far]
            if _in_circle(x, y, p0, corner[a], corner[a0 + (a + 1) % 3], p1):
                corner[a], corner[b] = p1, p0
                outer = twin[far]
                if outer == -1:
                    # The edge that moved was the hull's: its owner must be told.
                    e = start
                    while True:
                        if of_hull[e] == far:
                            of_hull[e] = a
                            break
                        e = before[e]
                        if e == start:
                            break
                _link(twin, a, outer)
                _link(twin, b, twin[left])
                _link(twin, left, far)
                if waiting < stack.size:
                    stack[waiting] = b0 + (b + 1) % 3
                    waiting += 1
                turned = True
        if not turned:
            if waiting == 0:
                return left
            waiting -= 1
            a = stack[waiting]


@nb.njit(cache=True, error_model="numpy", nogil=True)
def _add(corner, twin, count, p, q, r, a, b, c):  # type: ignore[no-untyped-def]
    """A triangle with its corners and the twins of its edges; returns the number of its first edge."""
    corner[count], corner[count + 1], corner[count + 2] = p, q, r
    _link(twin, count, a)
    _link(twin, count + 1, b)
    _link(twin, count + 2, c)
    return count


@nb.njit(cache=True, error_model="numpy", nogil=True)
def sweep(x, y):  # type: ignore[no-untyped-def]
    """Triangulate.

    Parameters
    ----------
    x, y : [P] points, no two the same.

    Returns
    -------
    triangles : [T, 3] corners, counter-clockwise.
    neighbours : [T, 3] triangle opposite each corner, -1 outside.
    missed : points that are in no triangle, for rounding left no edge of the hull that they see.
    """
    n = x.size
    corner, twin = np.empty(6 * n, np.int32), np.empty(6 * n, np.int32)
    a, b, c = _seed(x, y)
    if c < 0:
        return np.empty((0, 3), np.int32), np.empty((0, 3), np.int32), n
    mx, my, _ = _circle(x, y, a, b, c)
    order = np.argsort((x - mx) ** 2 + (y - my) ** 2)
    after, before = np.empty(n, np.int32), np.empty(n, np.int32)
    of_hull = np.empty(n, np.int32)
    size = int(math.ceil(math.sqrt(n)))
    table, stack = np.full(size, -1, np.int32), np.empty(_STACK, np.int32)
    after[a], after[b], after[c] = b, c, a
    before[a], before[b], before[c] = c, a, b
    of_hull[a], of_hull[b], of_hull[c] = 0, 1, 2
    for i in (a, b, c):
        table[_slot(x[i] - mx, y[i] - my, size)] = i
    hull = a
    count = 3 + _add(corner, twin, 0, a, b, c, -1, -1, -1)
    missed = 0
    for i in order:
        if i in (a, b, c):
            continue
        # From the hull's corner in the direction of the point, go on to the first edge that it sees.
        key = _slot(x[i] - mx, y[i] - my, size)
        first = hull
        for j in range(size):
            first = table[(key + j) % size]
            if first != -1 and first != after[first]:
                break
        first = before[first]
        e = first
        seen = True
        while _turn(x, y, i, e, after[e]) >= 0.0:
            e = after[e]
            if e == first:
                seen = False
                break
        if not seen:
            missed += 1
            continue
        t = _add(corner, twin, count, e, i, after[e], -1, -1, of_hull[e])
        count += 3
        of_hull[i] = _make_legal(t + 2, x, y, corner, twin, before, of_hull, hull, stack)
        of_hull[e] = t
        # Forward, and backward where the search began at once, over all further edges that it sees.
        n_next = after[e]
        q = after[n_next]
        while _turn(x, y, i, n_next, q) < 0.0:
            t = _add(corner, twin, count, n_next, i, q, of_hull[i], -1, of_hull[n_next])
            count += 3
            of_hull[i] = _make_legal(t + 2, x, y, corner, twin, before, of_hull, hull, stack)
            after[n_next] = n_next
            n_next = q
            q = after[n_next]
        if e == first:
            q = before[e]
            while _turn(x, y, i, q, e) < 0.0:
                t = _add(corner, twin, count, q, i, e, -1, of_hull[e], of_hull[q])
                count += 3
                _make_legal(t + 2, x, y, corner, twin, before, of_hull, hull, stack)
                of_hull[q] = t
                after[e] = e
                e = q
                q = before[e]
        hull = e
        before[i], after[e] = e, i
        before[n_next], after[i] = i, n_next
        table[key] = i
        table[_slot(x[e] - mx, y[e] - my, size)] = e
    total = count // 3
    triangles, neighbours = np.empty((total, 3), np.int32), np.empty((total, 3), np.int32)
    for t in range(total):
        p, q, r = corner[3 * t], corner[3 * t + 1], corner[3 * t + 2]
        # Edge 1 lies opposite corner 0, edge 2 opposite 1, edge 0 opposite 2; the last two change places.
        triangles[t, 0], triangles[t, 1], triangles[t, 2] = p, r, q
        for k, edge in ((0, 1), (1, 0), (2, 2)):
            other = twin[3 * t + edge]
            neighbours[t, k] = -1 if other < 0 else other // 3
    return triangles, neighbours, missed
