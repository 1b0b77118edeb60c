"""A bound on what the integral of a table may be off by, beyond noise: parts that add up to a half-width.

Noise says how far repeated measurements of the same directions would scatter. What was not measured, what was
filled in, and features between the points are wrong alike in each of them, and are judged here from the table
itself. Ours throughout.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from specularia.gonio.interpolant import Distribution
from specularia.gonio.shadow import Cells
from specularia.gonio.table import Array, Table
from specularia.gonio.triangulation import doubled_area, linear_weights, triangulate, weights

__all__ = ["bounds", "lobe_outside"]

_SECTORS = 36
"""Sectors in azimuth in which the way to the horizon is judged."""

_BAND = 0.02
"""Least width, in sin^2 theta, of the bands whose difference tells the trend towards the horizon."""

_HORIZON_DOUBT = 0.25
"""Share of what is carried on to the horizon that is doubted whatever the trend: the BSDF may fall there."""

_STEEPEST = 3.0
"""Largest exponent by which a lobe that is cut is taken to rise further."""

_BEYOND = 0.01
"""How far, in direction cosines, the undeflected direction may lie beyond the data and still be judged by
trend."""

_FILL_DOUBT = 0.02
"""Relative doubt of values from the mirror side, at least."""

_BRIDGE_DOUBT = 0.1
"""Relative doubt of values bridged across a gap, at least."""

_LOBE = 0.35
"""Radius, in direction cosines, around the undeflected direction that tells nothing about shadows."""

_MANY = 40000
"""Points from which on quarters are integrated instead of halves."""

_RESOLVED = 6
"""Points above half of the peak below which the peak counts as unresolved."""

_SEED = 1


def bounds(table: Table, found: Distribution, *, isotropic: bool = True) -> dict[str, float]:
    """Half-widths, in units of tau, of what the integral may be off by; their sum bounds the error.

    Parameters
    ----------
    table : the table.
    found : its distribution.
    isotropic : as for `cleaning.clean`.

    Returns
    -------
    parts :
        "horizon": the annulus beyond the outermost points, to which their values are carried on; the linear
        trend of the last two bands carried on instead, or the exponential one up to a lobe that is cut, and
        a quarter of what is there.
        "lobe": 1 - tau where the undeflected direction itself lies beyond the data.
        "gaps": bridged between points far apart; half of the range at their rims, and a tenth.
        "shadow": filled in; the relative difference of both sides of the plane of incidence (or along the
        azimuth where bridged) elsewhere, two (ten) per cent at least.
        "asymmetry": of an isotropic sample, the difference of the two sides far from the lobe beyond noise; a
        shadow that was not found would show there.
        "discretisation": the change when half of the points are left out (half of that for three quarters),
            noise
        included as the two cannot be told apart; or half of that from the plain to the corrected rule if it
        is more; the whole peak where it is unresolved.
        "scale": of the scan of the bare beam.
    """
    own = found.weight[: found.measured]
    parts = {
        "horizon": _horizon(table, found),
        "lobe": max(1.0 - found.integral, 0.0) if lobe_outside(table, found) else 0.0,
        "gaps": _gaps(found),
        "shadow": _shadow(table, found, own),
        "asymmetry": _asymmetry(table, found, own) if isotropic else 0.0,
        "discretisation": _discretisation(found),
        "scale": table.scale_bound * abs(found.integral),
    }
    return {name: float(value) for name, value in parts.items()}


def _horizon(table: Table, found: Distribution) -> float:
    m = found.measured
    rim = (found.triangles >= m).any(axis=1)
    corners = found.triangles[rim]
    area = 0.5 * doubled_area(found.x, found.y, *corners.T)
    carried = found.values[corners].mean(axis=1)
    sector = _sector(found.x[corners].mean(axis=1), found.y[corners].mean(axis=1))
    gap = np.bincount(sector, area, _SECTORS)
    content = np.bincount(sector, area * carried, _SECTORS)

    x, y, values = found.x[:m], found.y[:m], found.values[:m]
    square, where = x * x + y * y, _sector(x, y)
    outermost = np.zeros(_SECTORS)
    np.maximum.at(outermost, where, square)
    missing = 1.0 - outermost
    band = np.maximum(missing, _BAND)
    depth = (outermost[where] - square) / band[where]
    mean, error = [], []
    for k in (0, 1):
        inside = (depth >= k) & (depth < k + 1)
        count = np.maximum(np.bincount(where[inside], minlength=_SECTORS), 1)
        mean.append(np.bincount(where[inside], values[inside], _SECTORS) / count)
        error.append(np.bincount(where[inside], found.variance[:m][inside], _SECTORS) / count**2)
    rise = mean[0] - mean[1]
    doubt = error[0] + error[1]
    content = np.abs(content)
    trend = np.sqrt(np.maximum(rise**2 - doubt, 0.0)) * missing / band * gap
    # What falls towards the horizon cannot fall below zero; what rises towards the lobe may rise more
    # steeply.
    trend = np.where(rise < 0, np.minimum(trend, content), trend)
    ahead = np.where(_facing_lobe(), np.clip(_undeflected(table) ** 2 - outermost, 0.0, missing), 0.0)
    rising = (rise > 3.0 * np.sqrt(doubt)) & (mean[1] > 0)
    with np.errstate(divide="ignore", invalid="ignore"):
        growth = np.where(rising, np.minimum(np.log(mean[0] / mean[1]) * ahead / band, _STEEPEST), 0.0)
    trend = np.maximum(trend, np.maximum(mean[0], 0.0) * np.expm1(growth) * gap)
    return float(np.sum(trend) + _HORIZON_DOUBT * np.sum(content))


def lobe_outside(table: Table, found: Distribution) -> bool:
    """Whether the undeflected direction lies beyond the outermost points, so that a lobe there is not
    counted."""
    x, y = found.x[: found.measured], found.y[: found.measured]
    near = _facing_lobe()[_sector(x, y)]
    outermost = float(np.hypot(x[near], y[near]).max()) if near.any() else 0.0
    return _undeflected(table) > outermost + _BEYOND


def _undeflected(table: Table) -> float:
    """Distance of the undeflected direction from the normal, in direction cosines."""
    return float(np.sin(np.radians(table.polar_deg)))


def _facing_lobe() -> NDArray[np.bool_]:
    """[sectors] those within 20 degrees of where undeflected light leaves, opposite to phi_i = 0."""
    middle = (np.arange(_SECTORS) + 0.5) / _SECTORS * 2 * np.pi
    facing: NDArray[np.bool_] = np.cos(middle) < -np.cos(np.radians(20.0))
    return facing


def _sector(x: Array, y: Array) -> NDArray[np.intp]:
    turn = np.mod(np.arctan2(y, x) / (2 * np.pi), 1.0)
    return np.minimum((turn * _SECTORS).astype(np.intp), _SECTORS - 1)


def _gaps(found: Distribution) -> float:
    bridged = ~found.covered & (found.triangles < found.measured).all(axis=1)
    corners = found.triangles[bridged]
    area = 0.5 * doubled_area(found.x, found.y, *corners.T)
    there = found.values[corners]
    return float(np.sum(area * (0.5 * np.ptp(there, axis=1) + _BRIDGE_DOUBT * np.abs(there.mean(axis=1)))))


def _shadow(table: Table, found: Distribution, own: Array) -> float:
    """What was filled in, times how far the sample deviates elsewhere from what the filling assumes."""
    if not found.filled.any():
        return 0.0
    m = found.measured
    content = np.abs(own * found.values[:m])
    cells = Cells.of(found.x[:m], found.y[:m], found.values[:m])
    median, error = cells.medians
    touched = np.zeros(median.shape, bool)
    ring, column = cells.place(found.x[:m][found.filled], found.y[:m][found.filled])
    touched[ring[ring >= 0], column[ring >= 0]] = True
    rings = touched.any(axis=1)
    mirror = cells.mirror(normal=table.polar_deg < 1.0)
    reach = int(np.ceil(touched.sum(axis=1).max() / 2)) + 1
    total = 0.0
    for kind, expected, least in (
        (1, median[:, mirror], _FILL_DOUBT),
        (2, 0.5 * (np.roll(median, reach, axis=1) + np.roll(median, -reach, axis=1)), _BRIDGE_DOUBT),
    ):
        share = float(content[found.filled == kind].sum())
        if not share:
            continue
        other = touched | touched[:, mirror] if kind == 1 else touched
        use = np.isfinite(median) & np.isfinite(expected) & np.greater(expected, 0.0) & ~other
        use[~rings] = False
        off = ((median - expected) ** 2 - 2.0 * error**2)[use] / expected[use] ** 2
        total += share * max(least, float(np.sqrt(max(np.median(off), 0.0))) if off.size else 0.0)
    return total


def _asymmetry(table: Table, found: Distribution, own: Array) -> float:
    x, y = found.x[: found.measured], found.y[: found.measured]
    s = np.sin(np.radians(table.polar_deg))
    far = (np.hypot(x, y) > np.sqrt(0.5)) & (np.hypot(x + s, y) > _LOBE)
    worst = 0.0
    for along in (y, x) if table.polar_deg < 1.0 else (y,):
        lever = np.clip(along / 0.1, -1.0, 1.0) * far * own
        square = np.sum(lever * found.values[: found.measured]) ** 2
        worst = max(worst, square - np.sum(lever**2 * found.variance[: found.measured]))
    return float(np.sqrt(max(worst, 0.0)))


def _discretisation(found: Distribution) -> float:
    m, weight = found.measured, found.weight
    plain = linear_weights(found.x, found.y, found.triangles)
    corrected = 0.5 * abs(float(np.sum((plain - weight) * found.values)))
    parts = 4 if m > _MANY else 2
    rng = np.random.default_rng(_SEED)
    squares = []
    for _ in range(2):
        kept = np.concatenate([np.sort(rng.permutation(m)[: m // parts]), np.arange(m, found.x.size)])
        triangles, _ = triangulate(found.x[kept], found.y[kept])
        thin = -weight
        thin[kept] += weights(found.x[kept], found.y[kept], triangles)
        squares.append(np.sum(thin * found.values) ** 2)
    moved = float(np.sqrt(np.mean(squares))) * (0.5 if parts == 4 else 1.0)
    peak = found.values[:m].max()
    bright = np.flatnonzero(found.values[:m] > 0.5 * peak)
    unresolved = 0.0
    if 0 < bright.size < _RESOLVED:
        unresolved = abs(float(np.sum(weight[bright] * found.values[bright])))
    return max(moved, corrected, unresolved)
