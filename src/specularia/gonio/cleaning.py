"""Cleaning of a table before it is integrated or modelled, and the record of what was done.

Rows at the horizon are left out, the shadow of the sample's mount is filled or bridged, rows that repeat a
direction are averaged, and the noise is told from the scatter of neighbours. Negative values are kept:
clipped, noise around a small value would add up. Every value that results is a weighted mean of rows, so that
the noise of rows that serve twice counts twice.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from specularia.errors import FormatError
from specularia.gonio.noise import Noise, estimate
from specularia.gonio.shadow import Cells, Grid, Mask, find_shadow
from specularia.gonio.table import Array, Table
from specularia.gonio.triangulation import merged

__all__ = ["Clean", "Step", "clean"]

_RINGS = 60
"""Classes of distance from the undeflected direction that tell how light usually falls off."""

_MOST_CARRIED = 10.0
"""Largest factor between the usual levels of a hidden cell and of the sides it is bridged from."""

_NORMAL = 1.0
"""Polar angle of incidence, degrees, below which light counts as coming along the normal."""


@dataclass(frozen=True)
class Step:
    """One thing that was done: a short name, how many rows it concerns, and a sentence."""

    name: str
    count: int
    text: str


@dataclass(frozen=True)
class Clean:
    """A table's directions, cleaned, turned so that the light comes from phi_i = 0.

    Attributes
    ----------
    x, y : [P] direction cosines.
    bsdf : [P] in 1/sr.
    mix : [P, R] matrix that makes `bsdf` of the BSDF of the table's R rows.
    row_variance : [R] of the noise of single rows, as BSDF, 1/sr^2.
    filled : [P] 0 where the value was measured, 1 where it comes from the mirror side, 2 where it is bridged.
    noise : of single values of the signal, BSDF times |cos theta_s|.
    steps : what was done.
    notes : what of that a user is told.
    """

    x: Array
    y: Array
    bsdf: Array
    mix: sparse.csr_matrix
    row_variance: Array
    filled: NDArray[np.int8]
    noise: Noise
    steps: tuple[Step, ...]
    notes: tuple[str, ...]


def clean(table: Table, *, masks: Sequence[Mask] = (), isotropic: bool = True) -> Clean:
    """Clean a table.

    Parameters
    ----------
    table : any.
    masks : shadows that the user gives; others are looked for as well.
    isotropic : True for a sample that scatters alike on both sides of the plane of incidence. A shadow is
        then filled from the mirror side, else bridged along the azimuth from its own two sides.
    """
    known = np.flatnonzero(~np.isnan(table.bsdf))
    rows = table.bsdf
    turn = np.radians(table.azimuth_deg)
    ux, uy = table.ux[known], table.uy[known]
    x = ux * np.cos(turn) + uy * np.sin(turn)
    y = uy * np.cos(turn) - ux * np.sin(turn)
    if x.size < 4 or np.ptp(x) < 1e-3 or np.ptp(y) < 1e-3:
        spread = f" within {np.ptp(x):.2g} x {np.ptp(y):.2g} in direction cosines" if x.size else ""
        raise FormatError(
            file=table.file or table.label,
            expected="points spread over the hemisphere",
            found=f"{x.size} directions{spread}",
        )
    steps = [_horizon_step(table, known)]
    negative = int(np.sum(table.values < 0))
    steps.append(Step("negative values", negative, f"{negative} negative values are kept"))

    mix: sparse.csr_matrix = sparse.csr_matrix(
        (np.ones(known.size), (np.arange(known.size), known)), shape=(known.size, len(rows))
    )
    x, y, mix, filled, shadow_steps = _shadows(x, y, rows[known], mix, table, masks, isotropic)
    steps += shadow_steps

    first, group, count = merged(x, y)
    average: sparse.csr_matrix = sparse.csr_matrix(
        (1.0 / count[group], (group, np.arange(group.size))), shape=(first.size, group.size)
    )
    x, y, filled = x[first], y[first], filled[first]
    if count.size < group.size:
        mix = (average @ mix).tocsr()
    else:
        mix = mix[first]
    repeated = group.size - first.size
    steps.append(
        Step(
            "repeated directions",
            int(repeated),
            f"{repeated} rows repeat a direction and are averaged with it",
        )
    )
    bsdf = mix @ np.nan_to_num(rows)

    cosine = np.sqrt(np.maximum(1.0 - x * x - y * y, 0.0))
    own = filled == 0
    noise = estimate(x[own], y[own], bsdf[own], cosine[own], count[own].astype(float))
    row_variance = np.zeros(len(rows))
    signal = rows[known] * table.cos_s[known]
    row_variance[known] = noise.variance(signal) / table.cos_s[known] ** 2
    steps.append(
        Step(
            "noise",
            int(own.sum()),
            f"noise of single values: {100 * noise.relative:.2g} % of the signal, a floor of "
            f"{noise.floor:.2g}, "
            f"and {noise.counting:.2g} times the signal in the variance, in 1/sr of DSF",
        )
    )
    return Clean(
        x=x,
        y=y,
        bsdf=bsdf,
        mix=mix,
        row_variance=row_variance,
        filled=filled,
        noise=noise,
        steps=tuple(s for s in steps if s.count),
        notes=tuple(s.text for s in shadow_steps),
    )


def _horizon_step(table: Table, known: NDArray[np.intp]) -> Step:
    left = len(table.values) - known.size
    return Step(
        "horizon", left, f"{left} rows within 0.06 degrees of the horizon carry no weight: a DSF is 0 there"
    )


def _shadows(
    x: Array,
    y: Array,
    bsdf: Array,
    mix: sparse.csr_matrix,
    table: Table,
    masks: Sequence[Mask],
    isotropic: bool,
) -> tuple[Array, Array, sparse.csr_matrix, NDArray[np.int8], list[Step]]:
    """Points with those in a shadow replaced; see `clean`."""
    normal = table.polar_deg < _NORMAL
    azimuth = table.azimuth_deg
    cells = Cells.of(x, y, bsdf)
    dark, region = find_shadow(cells, normal=normal, isotropic=isotropic)
    found = region
    named = [f"shadow of the mount, {cells.describe(dark, azimuth_deg=azimuth)}"] if dark.any() else []
    for mask in masks:
        region = region | mask.holds(*cells.centres, azimuth_deg=azimuth)
        named.append(
            f"shadow as given, phi_s {mask.phi_min_deg:g} to {mask.phi_max_deg:g} from "
            f"{mask.theta_min_deg:g} "
            "degrees off the normal"
        )

    def hidden(px: Array, py: Array) -> NDArray[np.bool_]:
        ring, column = cells.place(px, py)
        out = (ring >= 0) & found[ring, column]
        for mask in masks:
            out |= mask.holds(px, py, azimuth_deg=azimuth)
        return out

    inside = hidden(x, y)
    if not named:
        return x, y, mix, np.zeros(x.size, np.int8), []
    kept = np.flatnonzero(~inside)
    sign = -1.0 if normal else 1.0
    # The mirror side serves where it is not itself in the shadow.
    source = kept[hidden(sign * x[kept], -y[kept])] if isotropic else kept[:0]
    ring, column = cells.place(sign * x[source], -y[source])
    open_cells = region.copy()
    open_cells[ring[ring >= 0], column[ring >= 0]] = False
    profile = _profile(x[kept], y[kept], bsdf[kept], polar_deg=table.polar_deg)
    bridge_x, bridge_y, bridge = _bridged(cells, region, open_cells, kept, profile)
    new_x = np.concatenate([x[kept], sign * x[source], bridge_x])
    new_y = np.concatenate([y[kept], -y[source], bridge_y])
    made = sparse.vstack([mix[kept], mix[source], bridge @ mix]).tocsr()
    how = [
        f"{count} {where}"
        for count, where in (
            (source.size, "from the other side"),
            (bridge_x.size, "bridged along the azimuth"),
        )
        if count
    ]
    removed = int(inside.sum())
    text = f"{'; '.join(named)}: {removed} points replaced by {' and '.join(how) or 'none'}"
    filled = np.repeat(np.array([0, 1, 2], np.int8), [kept.size, source.size, bridge_x.size])
    return new_x, new_y, made, filled, [Step("shadow", removed, text)]


def _profile(x: Array, y: Array, bsdf: Array, *, polar_deg: float) -> Callable[[Array, Array], Array]:
    """Mean BSDF as a function of the distance from the undeflected direction, in direction cosines."""
    s = np.sin(np.radians(polar_deg))
    distance = np.hypot(x + s, y)
    order = np.argsort(distance)
    parts = np.array_split(order, min(_RINGS, max(order.size // 10, 1)))
    at = np.array([distance[p].mean() for p in parts])
    mean = np.array([bsdf[p].mean() for p in parts])

    def value(px: Array, py: Array) -> Array:
        found: Array = np.interp(np.hypot(px + s, py), at, mean)
        return found

    return value


def _bridged(
    cells: Cells,
    region: Grid,
    open_cells: Grid,
    kept: NDArray[np.intp],
    profile: Callable[[Array, Array], Array],
) -> tuple[Array, Array, sparse.csr_matrix]:
    """A point in the middle of each open cell, from both sides of the ring.

    The ends are the means of the nearest cells, on either side along the azimuth, that hold points outside
    the region. Light that a surface scatters depends mostly on the distance from the undeflected direction;
    so the ratio to the mean at that distance is blended linearly, and not the value.
    """
    here = kept[cells.ring[kept] >= 0]
    cell = cells.ring[here] * cells.columns + cells.column[here]
    size = cells.rings * cells.columns
    count = np.bincount(cell, minlength=size)
    ends = (count.reshape(region.shape) > 0) & ~region
    mean: sparse.csr_matrix = sparse.csr_matrix(
        (1.0 / count[cell], (cell, here)), shape=(size, cells.ring.size)
    )
    cx, cy = cells.centres
    usual = profile(cx, cy)
    places, sides, shares = [], [], []
    for i, j in np.argwhere(open_cells):
        there = np.flatnonzero(ends[i])
        if there.size < 2:
            continue
        after, before = (there - j) % cells.columns, (j - there) % cells.columns
        pair = [there[after.argmin()], there[before.argmin()]]
        share = np.array([before.min(), after.min()]) / (after.min() + before.min())
        if usual[i, j] > 0 and (usual[i, pair] > 0).all():
            share = share * np.clip(usual[i, j] / usual[i, pair], 1 / _MOST_CARRIED, _MOST_CARRIED)
        places.append(i * cells.columns + j)
        sides.append([i * cells.columns + k for k in pair])
        shares.append(share)
    where = np.array(places, dtype=np.intp)
    pick: sparse.csr_matrix = sparse.csr_matrix(
        (
            np.array(shares, dtype=float).ravel(),
            (np.repeat(np.arange(where.size), 2), np.array(sides, dtype=np.intp).ravel()),
        ),
        shape=(where.size, size),
    )
    return cx.ravel()[where], cy.ravel()[where], (pick @ mean).tocsr()
