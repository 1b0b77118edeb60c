"""Evaluation of tabulated models point by point; see `specularia.bsdf.tabulated` for the method."""

from __future__ import annotations

import math

import numba as nb
import numpy as np


@nb.njit(cache=True, error_model="numpy", nogil=True)
def _horizon(s, ex, ey):  # type: ignore[no-untyped-def]
    """Way from the undeflected direction (-s, 0) along the unit vector (ex, ey) to the unit circle."""
    return s * ex + math.sqrt(max(1.0 - s * s * ey * ey, 0.0))


@nb.njit(cache=True, error_model="numpy", nogil=True)
def _bilinear(table, p, q):  # type: ignore[no-untyped-def]
    """Value at (p, q) counted in cells from the table's corner; constant beyond the outermost centres."""
    n = table.shape[0]
    p = min(max(p - 0.5, 0.0), n - 1.0)
    q = min(max(q - 0.5, 0.0), n - 1.0)
    i = min(int(p), max(n - 2, 0))
    j = min(int(q), max(n - 2, 0))
    k, l = min(i + 1, n - 1), min(j + 1, n - 1)
    u, v = p - i, q - j
    return (1 - u) * ((1 - v) * table[i, j] + v * table[i, l]) + u * ((1 - v) * table[k, j] + v * table[k, l])


@nb.njit(cache=True, error_model="numpy", nogil=True)
def _square(x, y):  # type: ignore[no-untyped-def]
    """Unit disk to unit square (Shirley and Chiu), as `conventions.disk_to_square`."""
    r = math.sqrt(x * x + y * y)
    phi = math.atan2(y, x)
    k = 4.0 / math.pi
    if phi < -math.pi / 4:
        phi += 2 * math.pi
    if phi < math.pi / 4:
        p, q = r, phi * r * k
    elif phi < 3 * math.pi / 4:
        p, q = -(phi - math.pi / 2) * r * k, r
    elif phi < 5 * math.pi / 4:
        p, q = -r, -(phi - math.pi) * r * k
    else:
        p, q = (phi - 3 * math.pi / 2) * r * k, -r
    return 0.5 * (p + 1), 0.5 * (q + 1)


@nb.njit(cache=True, error_model="numpy", nogil=True)
def _carried(x, y, s, t, base, patch, half_width):  # type: ignore[no-untyped-def]
    """Value of the table of sin theta_i = t at the point that (x, y) of sin theta_i = s is carried to."""
    dx, dy = x + s, y
    r = math.sqrt(dx * dx + dy * dy)
    if r > 0.0 and s != t:
        ex, ey = dx / r, dy / r
        here, there = _horizon(s, ex, ey), _horizon(t, ex, ey)
        if here > 1e-12 and there > 1e-12:
            k = here / there
            share = min(r / here, 1.0)
            r = there * k * share / (1.0 + (k - 1.0) * share)
        else:
            r = 0.0
        dx, dy = r * ex, r * ey
    if abs(dx) <= half_width and abs(dy) <= half_width:
        m = patch.shape[0]
        scale = m / (2.0 * half_width)
        return _bilinear(patch, (dx + half_width) * scale, (dy + half_width) * scale)
    a, b = _square(dx - t, dy)
    n = base.shape[0]
    return _bilinear(base, a * n, b * n)


@nb.njit(cache=True, error_model="numpy", parallel=True)
def evaluate_points(s, x, y, nodes, base, patch, half_width, logarithmic):  # type: ignore[no-untyped-def]
    """Unscaled BSDF at K points.

    Parameters
    ----------
    s, x, y : [K] sin theta_i and outgoing direction cosines, the light coming from phi_i = 0.
    nodes : [N] sin theta_i of the tables, ascending.
    base, patch, half_width : see `tabulated.SideTable`.
    logarithmic : True to join neighbouring tables by logarithms.
    """
    out = np.empty(s.size)
    last = nodes.size - 1
    for i in nb.prange(s.size):
        k = np.searchsorted(nodes, s[i], side="right") - 1
        if k < 0 or k >= last:
            j = 0 if k < 0 else last
            out[i] = _carried(x[i], y[i], s[i], nodes[j], base[j], patch[j], half_width)
            continue
        w = (s[i] - nodes[k]) / (nodes[k + 1] - nodes[k])
        f = _carried(x[i], y[i], s[i], nodes[k], base[k], patch[k], half_width)
        if w == 0.0:
            out[i] = f
            continue
        g = _carried(x[i], y[i], s[i], nodes[k + 1], base[k + 1], patch[k + 1], half_width)
        if logarithmic and f > 0.0 and g > 0.0:
            out[i] = math.exp((1.0 - w) * math.log(f) + w * math.log(g))
        else:
            out[i] = (1.0 - w) * f + w * g
    return out
