"""Evaluation of tabulated models point by point; see `specularia.bsdf.tabulated` for the method.

Where a direction is looked up in the table of another incident direction is decided in two functions:
`_moved` carries it between incident angles, `_swung` between azimuths of incidence.
"""

from __future__ import annotations

import math

import numba as nb
import numpy as np

_FULLY_SEEN = 0.4
"""Cosine to the normal from which on a place in a table counts fully against a neighbouring azimuth's."""

_HARDLY_SEEN = 0.02
"""Share of that below which the place turned with the plane of incidence begins to stand in."""

_LEAST = 1e-3
"""What a place beyond the horizon still counts, so that there is always an answer."""


@nb.njit(cache=True, error_model="numpy", nogil=True)
def _horizon(s, ex, ey):  # type: ignore[no-untyped-def]
    """Way from the undeflected direction (-s, 0) along the unit vector (ex, ey) to the unit circle."""
    return s * ex + math.sqrt(max(1.0 - s * s * ey * ey, 0.0))


@nb.njit(cache=True, error_model="numpy", nogil=True)
def _shared_way(r, here, there):  # type: ignore[no-untyped-def]
    """Length r of a way that ends at the horizon after `here`, carried to one that ends after `there`."""
    if here <= 1e-12 or there <= 1e-12:
        return 0.0
    k = here / there
    share = min(r / here, 1.0)
    return there * k * share / (1.0 + (k - 1.0) * share)


@nb.njit(cache=True, error_model="numpy", nogil=True)
def _moved(dx, dy, s, t):  # type: ignore[no-untyped-def]
    """Between incident angles: the place in the table of sin theta_i = t of a direction at sin theta_i = s.

    Parameters
    ----------
    dx, dy : direction cosines less those of the undeflected direction (-s, 0), the light from phi_i = 0.

    Returns
    -------
    dx, dy : the same for the table, counted from (-t, 0). Along each way to the horizon lengths near the
        undeflected direction stay, the horizon goes to the horizon, and nothing folds.
    """
    r = math.sqrt(dx * dx + dy * dy)
    if r == 0.0 or s == t:
        return dx, dy
    ex, ey = dx / r, dy / r
    q = _shared_way(r, _horizon(s, ex, ey), _horizon(t, ex, ey))
    return q * ex, q * ey


@nb.njit(cache=True, error_model="numpy", nogil=True)
def _swung(dx, dy, t, turn):  # type: ignore[no-untyped-def]
    """Between azimuths: the place in a table whose light comes from an azimuth less by `turn` radians.

    To first order a pane shifts light by its slopes, in the frame of the sample, wherever the light comes
    from; that frame is turned against the table's own. What is deflected by r belongs to the first order
    where r is small against the cosine of incidence; effects of higher order turn with the plane of
    incidence. So the share 1 / (1 + (r tan theta_i)^2) of the turn is made (ours).

    Returns
    -------
    dx, dy : offset from the table's undeflected direction, not always within its hemisphere.
    """
    rr = dx * dx + dy * dy
    turn = (turn + math.pi) % (2.0 * math.pi) - math.pi
    a = turn / (1.0 + rr * t * t / max(1.0 - t * t, 1e-12))
    c, d = math.cos(a), math.sin(a)
    return dx * c - dy * d, dx * d + dy * c


@nb.njit(cache=True, error_model="numpy", nogil=True)
def _bilinear(tables, j, p, q):  # type: ignore[no-untyped-def]
    """Value of a table at (p, q) counted in cells from its corner; constant beyond the outermost centres."""
    # A slice `tables[j]` would count references in memory that all threads share.
    n = tables.shape[1]
    p = min(max(p - 0.5, 0.0), n - 1.0)
    q = min(max(q - 0.5, 0.0), n - 1.0)
    a = min(int(p), max(n - 2, 0))
    b = min(int(q), max(n - 2, 0))
    c, d = min(a + 1, n - 1), min(b + 1, n - 1)
    u, v = p - a, q - b
    low = (1 - v) * tables[j, a, b] + v * tables[j, a, d]
    return (1 - u) * low + u * ((1 - v) * tables[j, c, b] + v * tables[j, c, d])


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
def _look_up(dx, dy, t, base, patch, j, half_width):  # type: ignore[no-untyped-def]
    """Value of table j at an offset from its undeflected direction (-t, 0)."""
    # Over the outer tenth of the patch the fine table gives way to the coarse one, so that no step shows.
    inside = (half_width - max(abs(dx), abs(dy))) / (0.1 * half_width)
    fine = 0.0
    if inside > 0.0:
        m = patch.shape[1]
        scale = m / (2.0 * half_width)
        fine = _bilinear(patch, j, (dx + half_width) * scale, (dy + half_width) * scale)
        if inside >= 1.0:
            return fine
    a, b = _square(dx - t, dy)
    n = base.shape[1]
    coarse = _bilinear(base, j, a * n, b * n)
    return coarse if inside <= 0.0 else inside * fine + (1.0 - inside) * coarse


@nb.njit(cache=True, error_model="numpy", nogil=True)
def _swung_value(dx, dy, t, turn, mirrored, base, patch, j, half_width):  # type: ignore[no-untyped-def]
    """Value of a table of another azimuth, and how much it counts against its neighbour's.

    A table knows nothing beyond its own horizon, where its neighbour may well see: it counts less the closer
    the place lies to it. Where neither sees, the place is turned with the plane of incidence instead.
    """
    ex, ey = _swung(dx, dy, t, turn)
    seen = min(math.sqrt(max(1.0 - (ex - t) ** 2 - ey * ey, 0.0)) / _FULLY_SEEN, 1.0)
    side = -1.0 if mirrored else 1.0
    f = 0.0
    lost = max(1.0 - seen / _HARDLY_SEEN, 0.0)
    if lost < 1.0:
        f += (1.0 - lost) * _look_up(ex, side * ey, t, base, patch, j, half_width)
    if lost > 0.0:
        f += lost * _look_up(dx, side * dy, t, base, patch, j, half_width)
    return f, seen + _LEAST


@nb.njit(cache=True, error_model="numpy", nogil=True)
def _in_ring(phi, first, last, azimuth):  # type: ignore[no-untyped-def]
    """The two nodes of a ring around an azimuth, and the share of the second; equal where it has one only."""
    count = last - first
    if count == 1:
        return first, first, 0.0
    j = first + np.searchsorted(azimuth[first:last], phi, side="right") - 1
    if j < first:
        j = last - 1
    k = j + 1 if j + 1 < last else first
    gap = (azimuth[k] - azimuth[j]) % (2.0 * math.pi)
    return j, k, ((phi - azimuth[j]) % (2.0 * math.pi)) / gap


@nb.njit(cache=True, error_model="numpy", nogil=True)
def _joined(f, g, w, logarithmic):  # type: ignore[no-untyped-def]
    """Two values, the second with the weight w."""
    if w <= 0.0:
        return f
    if w >= 1.0:
        return g
    if logarithmic and f > 0.0 and g > 0.0:
        return f * math.exp(w * math.log(g / f))
    return (1.0 - w) * f + w * g


@nb.njit(cache=True, error_model="numpy", nogil=True)
def _two_in_ring(  # type: ignore[no-untyped-def]
    x, y, s, phi, t, a, b, u, azimuth, table, mirrored, base, patch, half_width
):
    """Values of the nodes a and b of the ring of sin theta_i = t, and the share of b; see `_in_ring`."""
    dx, dy = _moved(x + s, y, s, t)
    j = table[a]
    if azimuth.size == 0:
        f = _look_up(dx, dy, t, base, patch, j, half_width)
        return f, f, 0.0
    f, v = _swung_value(dx, dy, t, phi - azimuth[a], mirrored[a], base, patch, j, half_width)
    if u == 0.0:
        return f, f, 0.0
    j = table[b]
    g, w = _swung_value(dx, dy, t, phi - azimuth[b], mirrored[b], base, patch, j, half_width)
    return f, g, u * w / ((1.0 - u) * v + u * w)


@nb.njit(cache=True, error_model="numpy", nogil=True)
def _between(s, rings, angles):  # type: ignore[no-untyped-def]
    """The two rings around sin theta_i = s and the share of the second; the nearest one outside.

    Shares go with the angle: with its sine, the ring next to grazing incidence would reach too far (at 70
    degrees between 60 and 82.5 it would count .59 instead of .44; traced panes want .3 to .5).
    """
    last = rings.size - 1
    k = min(max(np.searchsorted(rings, s, side="right") - 1, 0), last)
    n = min(k + 1, last)
    if n == k:
        return k, n, 0.0
    return k, n, min(max((math.asin(s) - angles[k]) / (angles[n] - angles[k]), 0.0), 1.0)


@nb.njit(cache=True, error_model="numpy", parallel=True)
def evaluate_points(  # type: ignore[no-untyped-def]
    s, phi, x, y, rings, first, azimuth, table, mirrored, base, patch, half_width, logarithmic
):
    """Unscaled BSDF at K points.

    Parameters
    ----------
    s, phi : [K] or [1] sin theta_i and azimuth of incidence in radians, 0 <= phi < 2 pi.
    x, y : [K] outgoing direction cosines in the frame turned so that the light comes from phi_i = 0.
    rings : [R] sin theta_i of the rings of nodes, ascending.
    first : [R + 1] the nodes of ring r are first[r] to first[r + 1] - 1.
    azimuth : [V] of the nodes, radians, ascending in each ring; empty where the sample is isotropic.
    table, mirrored : [V] number of the node's table, and whether it is seen in a mirror.
    base, patch, half_width : see `side_table.SideTable`.
    logarithmic : True to join neighbouring tables by logarithms.
    """
    out = np.empty(x.size)
    angles = np.arcsin(rings)
    # One incident angle for all points, as in most calls, is placed between the rings once.
    k0, n0, w0 = _between(s[0], rings, angles)
    for i in nb.prange(x.size):
        si = s[min(np.int64(i), s.size - 1)]
        pi = phi[min(np.int64(i), phi.size - 1)]
        k, n, w = k0, n0, w0
        if s.size > 1:
            k, n, w = _between(si, rings, angles)
        value = 0.0
        for r in range(k, n + 1 if w > 0.0 else k + 1):
            a, b, u = _in_ring(pi, first[r], first[r + 1], azimuth)
            f, g, u = _two_in_ring(
                x[i], y[i], si, pi, rings[r], a, b, u, azimuth, table, mirrored, base, patch, half_width
            )
            found = _joined(f, g, u, logarithmic)
            value = found if r == k else _joined(value, found, w, logarithmic)
        out[i] = value
    return out


@nb.njit(cache=True, error_model="numpy", parallel=True)
def spread_points(  # type: ignore[no-untyped-def]
    s, phi, x, y, rings, first, azimuth, table, mirrored, base, patch, base_se, patch_se, half_width
):
    """Unscaled errors of the BSDF at K points: noise of the tables, and disagreement of those around.

    Parameters as in `evaluate_points`; `base_se` and `patch_se` are the errors of `base` and `patch`.

    Returns
    -------
    noise : [K] standard error that the tables' own errors make.
    apart : [K] w (1 - w) |f - g| for the two rings around, and the same for the azimuths in each; beyond the
        last ring |f - g| of the last two, times the way from the last over the way between them.
    """
    noise, apart = np.empty(x.size), np.empty(x.size)
    last = rings.size - 1
    angles = np.arcsin(rings)
    for i in nb.prange(x.size):
        si = s[min(np.int64(i), s.size - 1)]
        pi = phi[min(np.int64(i), phi.size - 1)]
        k, n, w = _between(si, rings, angles)
        spread = w * (1.0 - w)
        if k == last and last > 0 and si > rings[last]:
            k, n, w = last - 1, last, 1.0
            spread = (si - rings[last]) / (rings[last] - rings[last - 1])
        variance, within, value = 0.0, 0.0, 0.0
        for r in range(k, n + 1):
            share = 1.0 - w if r == k else w
            a, b, u = _in_ring(pi, first[r], first[r + 1], azimuth)
            f, g, u = _two_in_ring(
                x[i], y[i], si, pi, rings[r], a, b, u, azimuth, table, mirrored, base, patch, half_width
            )
            e, h, _ = _two_in_ring(
                x[i], y[i], si, pi, rings[r], a, b, u, azimuth, table, mirrored, base_se, patch_se, half_width
            )
            variance += (share * (1.0 - u) * e) ** 2 + (share * u * h) ** 2
            within += share * u * (1.0 - u) * abs(f - g)
            found = (1.0 - u) * f + u * g
            if r == k:
                value = found
            if n == k:
                break
        noise[i] = math.sqrt(variance)
        apart[i] = math.hypot(within, spread * abs(found - value))
    return noise, apart
