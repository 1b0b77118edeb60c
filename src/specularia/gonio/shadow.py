"""The shadow of the sample's mount: found by its darkness against the mirror image, filled from there.

A gonio-photometer's sample hangs on a column that hides a strip of outgoing directions near the horizon. An
isotropic sample scatters alike on both sides of the plane of incidence (at normal incidence, alike at any
azimuth), so a dark patch that reaches the horizon on one side only is the mount's and not the sample's.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from specularia.gonio.table import Array

__all__ = ["fill_shadow"]

_INNERMOST = np.radians(45.0)
"""Polar angle from which the search starts; mounts hide directions near the horizon."""

_DARK, _CORE = 0.5, 0.2
"""A cell is dark below this share of its mirror image; a shadow has cells below the second."""

_WIDEST = np.radians(60.0)
"""A dark patch wider than this in azimuth is taken for the sample's own."""

_PER_CELL = 12
"""Points that a cell should hold for its median to be trusted."""


def fill_shadow(
    x: Array, y: Array, bsdf: Array, *, polar_deg: float, azimuth_deg: float
) -> tuple[Array, Array, Array, list[str]]:
    """Replace the points in a shadow by mirrored ones; a table that is too sparse to tell is left as it is.

    Parameters
    ----------
    x, y : [P] direction cosines, the light coming from phi_i = 0.
    bsdf : [P] in 1/sr.
    polar_deg, azimuth_deg : of the light; the azimuth only serves the message.

    Returns
    -------
    x, y, bsdf : the same with shadowed points removed and mirrored ones added.
    notes : what was done, with counts; empty where no shadow was found.

    Notes
    -----
    A shadow that lies in the plane of incidence of oblique light is its own mirror image and is not found.
    Ours.
    """
    step = np.sqrt(_PER_CELL * 2 * np.pi / x.size)
    if step > np.radians(6.0):
        return x, y, bsdf, []
    step = max(step, np.radians(3.0))
    columns = 2 * int(np.pi / step)
    rings = int((np.pi / 2 - _INNERMOST) / step)
    polar = np.arcsin(np.minimum(np.hypot(x, y), 1.0))
    azimuth = np.mod(np.arctan2(y, x), 2 * np.pi)
    ring = np.floor((polar - _INNERMOST) / (np.pi / 2 - _INNERMOST) * rings).astype(int)
    ring = np.minimum(ring, rings - 1)
    column = np.minimum((azimuth / (2 * np.pi) * columns).astype(int), columns - 1)
    outer = ring >= 0
    median, error = _medians(ring[outer] * columns + column[outer], bsdf[outer], rings * columns)
    median, error = median.reshape(rings, columns), error.reshape(rings, columns)

    normal = polar_deg < 1.0
    mirror = (np.arange(columns) + columns // 2) % columns if normal else np.arange(columns)[::-1]
    there = median[:, mirror]
    with np.errstate(invalid="ignore"):
        doubt = 6.0 * np.hypot(error, error[:, mirror])
        dark = (median < _DARK * there) & (there - median > doubt)
        core = dark & (median < _CORE * there)
        # Where the mirror image itself drowns in noise, darkness could not be seen.
        telling = there > doubt
    found = _patches(dark, core, telling=telling, widest=int(_WIDEST / (2 * np.pi) * columns))
    if not found.any():
        return x, y, bsdf, []

    widened = _widened(found)
    inside = np.zeros(x.size, bool)
    inside[outer] = widened[ring[outer], column[outer]]
    source = np.zeros(x.size, bool)
    source[outer] = widened[:, mirror][ring[outer], column[outer]] & ~inside[outer]
    sign = -1.0 if normal else 1.0
    which = np.flatnonzero(found.any(axis=0))
    middle = np.angle(np.mean(np.exp(2j * np.pi * (which + 0.5) / columns)))
    first = np.degrees(_INNERMOST + np.flatnonzero(found.any(axis=1))[0] * (np.pi / 2 - _INNERMOST) / rings)
    note = (
        f"shadow of the mount, {len(which) * 360 / columns:.0f} degrees wide around phi_s = "
        f"{(np.degrees(middle) + azimuth_deg + 180) % 360 - 180:.0f}, from {first:.0f} degrees off the "
        f"normal to the horizon: {int(inside.sum())} points replaced by {int(source.sum())} from the other "
        "side"
    )
    kept = ~inside
    return (
        np.concatenate([x[kept], sign * x[source]]),
        np.concatenate([y[kept], -y[source]]),
        np.concatenate([bsdf[kept], bsdf[source]]),
        [note],
    )


def _medians(cell: NDArray[np.intp], values: Array, cells: int) -> tuple[Array, Array]:
    """Median of each cell and its standard error; NaN where a cell holds fewer than four points."""
    order = np.lexsort((values, cell))
    values = values[order]
    count = np.bincount(cell, minlength=cells)
    start = np.cumsum(count) - count

    def quantile(share: float) -> Array:
        at = start + share * np.maximum(count - 1, 0)
        low = np.minimum(at.astype(int), values.size - 1)
        high = np.minimum(low + 1, np.maximum(start + count - 1, 0))
        return values[low] + (at - low) * (values[np.minimum(high, values.size - 1)] - values[low])

    enough = count >= 4
    median = np.where(enough, quantile(0.5), np.nan)
    # For normal noise the quartiles lie 1.35 sigma apart, and a median scatters 1.25 times as far as a mean.
    spread = (quantile(0.75) - quantile(0.25)) / 1.35 * 1.25 / np.sqrt(np.maximum(count, 1))
    return median, np.where(enough, spread, np.nan)


def _patches(
    dark: NDArray[np.bool_], core: NDArray[np.bool_], *, telling: NDArray[np.bool_], widest: int
) -> NDArray[np.bool_]:
    """Dark patches that have a core, reach the outermost cell that could tell, and are not too wide."""
    from scipy.ndimage import label

    out = np.zeros_like(dark)
    free = np.flatnonzero(~dark.any(axis=0))
    if not dark.any() or not free.size:
        return out
    # Azimuth closes on itself: cut the ring where nothing is dark.
    names, count = label(np.roll(dark, -free[0], axis=1))
    names = np.roll(names, free[0], axis=1)
    further_out = np.logical_or.accumulate(telling[::-1], axis=0)[::-1]
    rim = telling & ~np.concatenate([further_out[1:], np.zeros((1, dark.shape[1]), bool)])
    for name in range(1, count + 1):
        patch = names == name
        if (patch & core).any() and (patch & rim).any() and patch.any(axis=0).sum() <= widest:
            out |= patch
    return out


def _widened(found: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Two cells more on each side and inwards, and all out to the horizon: the penumbra."""
    out = found.copy()
    for shift in (-2, -1, 1, 2):
        out |= np.roll(found, shift, axis=1)
    grown = out.copy()
    for shift in (1, 2):
        grown[:-shift] |= out[shift:]
    # Outwards a shadow does not end before the horizon.
    return np.maximum.accumulate(grown, axis=0)
