"""The shadow of the sample's mount: where it lies.

A gonio-photometer's sample hangs on a column that hides a strip of outgoing directions near the horizon. An
isotropic sample scatters alike on both sides of the plane of incidence (at normal incidence, alike at any
azimuth), so a dark patch that reaches the horizon on one side only is the mount's and not the sample's. Of
any other sample, and for a shadow that is its own mirror image, only steep edges on both sides give a mount
away.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from specularia.errors import PhysicsError
from specularia.gonio.table import Array

__all__ = ["Cells", "Mask", "find_shadow"]

_INNERMOST = np.radians(45.0)
"""Polar angle from which the search starts; mounts hide directions near the horizon."""

_DARK, _CORE = 0.5, 0.2
"""A cell is dark below this share of what is expected there; a shadow has cells below the second."""

_WIDEST = np.radians(90.0)
"""A dark patch wider than this in azimuth is taken for the sample's own."""

_FAINT = 1e-7
"""Share of the peak below which nothing tells a shadow from the tail of a lobe."""

_STEEP = 0.8
"""Share of the expected level that is reached within two cells of the edge of a shadow."""

_PER_CELL = 12
"""Points that a cell should hold for its mean to be trusted."""

_FINEST, _COARSEST = np.radians(3.0), np.radians(8.0)
"""Sizes of cells; a table that needs coarser ones is too sparse to be searched."""

Grid = NDArray[np.bool_]


@dataclass(frozen=True)
class Mask:
    """A shadow that the user gives: azimuths of scattered light, and the angle from the normal where it
    starts.

    Attributes
    ----------
    phi_min_deg, phi_max_deg : in the frame of `conventions`, counter-clockwise from the first to the second,
        so that 350 to 10 is a strip of 20 degrees.
    theta_min_deg : angle from the normal, 0 to 90; the shadow reaches from there to the horizon.

    Examples
    --------
    >>> Mask.parse("258,282,65")
    Mask(phi_min_deg=258.0, phi_max_deg=282.0, theta_min_deg=65.0)
    """

    phi_min_deg: float
    phi_max_deg: float
    theta_min_deg: float

    def __post_init__(self) -> None:
        angles = (self.phi_min_deg, self.phi_max_deg)
        if not (0 <= self.theta_min_deg < 90 and all(-360 <= a <= 360 for a in angles)):
            raise PhysicsError(
                "a mask is PHI_MIN,PHI_MAX,THETA_MIN in degrees, phi within -360 to 360 and theta "
                f"within 0 to 90, not {self.phi_min_deg:g},{self.phi_max_deg:g},{self.theta_min_deg:g}."
            )
        if not 0 < self.width_deg <= 180:
            raise PhysicsError(f"a mask is at most 180 degrees wide, not {self.width_deg:g}.")

    @property
    def width_deg(self) -> float:
        """In azimuth."""
        return (self.phi_max_deg - self.phi_min_deg) % 360.0

    @classmethod
    def parse(cls, text: str) -> Mask:
        """From "PHI_MIN,PHI_MAX,THETA_MIN"."""
        try:
            low, high, theta = (float(word) for word in text.split(","))
        except ValueError:
            raise PhysicsError(
                f"a mask is three numbers, PHI_MIN,PHI_MAX,THETA_MIN in degrees, not {text!r}."
            ) from None
        return cls(low, high, theta)

    def holds(self, x: Array, y: Array, *, azimuth_deg: float) -> NDArray[np.bool_]:
        """Which directions lie inside, given in the frame where the light comes from phi_i = 0."""
        phi = np.degrees(np.arctan2(y, x)) + azimuth_deg
        outer = np.hypot(x, y) >= np.sin(np.radians(self.theta_min_deg))
        return outer & ((phi - self.phi_min_deg) % 360.0 <= self.width_deg)


@dataclass(frozen=True)
class Cells:
    """Cells in polar angle and azimuth beyond 45 degrees from the normal, with what they hold.

    Attributes
    ----------
    rings, columns : their number.
    ring, column : [P] of each point; ring -1 for points nearer to the normal.
    bsdf : [P] at the points.
    """

    rings: int
    columns: int
    ring: NDArray[np.intp]
    column: NDArray[np.intp]
    bsdf: Array

    @classmethod
    def of(cls, x: Array, y: Array, bsdf: Array) -> Cells:
        """Cells as small as the number of points allows."""
        step = float(np.clip(np.sqrt(_PER_CELL * 2 * np.pi / x.size), _FINEST, _COARSEST))
        columns = 2 * int(np.pi / step)
        rings = int((np.pi / 2 - _INNERMOST) / step)
        return cls(rings, columns, *_place(x, y, rings, columns), bsdf)

    @property
    def enough(self) -> bool:
        """Whether cells of the coarsest size would hold points enough."""
        return bool(_PER_CELL * 2 * np.pi / self.bsdf.size <= _COARSEST**2)

    @cached_property
    def centres(self) -> tuple[Array, Array]:
        """(x, y), each [rings, columns], of the middle of each cell."""
        polar = _INNERMOST + (np.arange(self.rings) + 0.5) / self.rings * (np.pi / 2 - _INNERMOST)
        azimuth = (np.arange(self.columns) + 0.5) * 2 * np.pi / self.columns
        return np.sin(polar)[:, None] * np.cos(azimuth), np.sin(polar)[:, None] * np.sin(azimuth)

    @cached_property
    def medians(self) -> tuple[Array, Array]:
        """[rings, columns] median of each cell and its standard error; NaN where a cell holds too few
        points."""
        outer = self.ring >= 0
        cell = self.ring[outer] * self.columns + self.column[outer]
        median, error = _medians(cell, self.bsdf[outer], self.rings * self.columns)
        shape = (self.rings, self.columns)
        return median.reshape(shape), error.reshape(shape)

    def mirror(self, *, normal: bool) -> NDArray[np.intp]:
        """[columns] the column across the plane of incidence; at normal incidence the opposite one."""
        columns = np.arange(self.columns)
        return (columns + self.columns // 2) % self.columns if normal else columns[::-1]

    def place(self, x: Array, y: Array) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
        """Ring and column of any directions."""
        return _place(x, y, self.rings, self.columns)

    def describe(self, found: Grid, *, azimuth_deg: float) -> str:
        """Width, azimuth and extent of the cells of a grid."""
        which = np.flatnonzero(found.any(axis=0))
        middle = np.angle(np.mean(np.exp(2j * np.pi * (which + 0.5) / self.columns)))
        inmost = np.flatnonzero(found.any(axis=1))[0]
        first = np.degrees(_INNERMOST + inmost * (np.pi / 2 - _INNERMOST) / self.rings)
        return (
            f"{len(which) * 360 / self.columns:.0f} degrees wide around phi_s = "
            f"{(np.degrees(middle) + azimuth_deg + 180) % 360 - 180:.0f}, from {first:.0f} degrees off the "
            "normal to the horizon"
        )


def _place(x: Array, y: Array, rings: int, columns: int) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    polar = np.arcsin(np.minimum(np.hypot(x, y), 1.0))
    azimuth = np.mod(np.arctan2(y, x), 2 * np.pi)
    ring = np.floor((polar - _INNERMOST) / (np.pi / 2 - _INNERMOST) * rings).astype(np.intp)
    column = np.minimum((azimuth / (2 * np.pi) * columns).astype(np.intp), columns - 1)
    return np.maximum(np.minimum(ring, rings - 1), -1), column


def find_shadow(cells: Cells, *, normal: bool, isotropic: bool) -> tuple[Grid, Grid]:
    """Cells in a shadow: as they are dark, and widened by the penumbra.

    Parameters
    ----------
    cells : of the directions, the light coming from phi_i = 0.
    normal : True for light along the normal.
    isotropic : False where nothing may be concluded from the mirror side.

    Notes
    -----
    Against the mirror side: dark patches that reach the horizon, or the last cell before it that stands out
    from noise. Against both sides: the same where, along the azimuth, the level of both sides of the patch (a
    closing of the medians) is reached within two cells of its edges; of an isotropic sample only patches that
    touch the plane of incidence are looked for in this way, since every other one has a mirror side. Ours.
    """
    none = np.zeros((cells.rings, cells.columns), bool)
    if not cells.enough:
        return none, none
    found = none
    if isotropic:
        mirror = cells.mirror(normal=normal)
        median, error = cells.medians
        found = _patches(cells, median[:, mirror], error[:, mirror])
    if not (isotropic and normal):
        own = _steep(cells)
        if isotropic:
            own &= own[:, cells.mirror(normal=False)]
        found = found | own
    return (found, _widened(found)) if found.any() else (none, none)


def _patches(cells: Cells, expected: Array, error: Array) -> Grid:
    """Patches darker than expected that have a core, reach the outermost cell that could tell, and are
    narrow."""
    from scipy.ndimage import label

    median, own_error = cells.medians
    with np.errstate(invalid="ignore"):
        doubt = 6.0 * np.hypot(own_error, error)
        # Where what is expected itself drowns in noise, or is next to nothing, darkness could not be seen.
        telling = expected > np.maximum(doubt, _FAINT * cells.bsdf.max())
        dark = (median < _DARK * expected) & (expected - median > doubt) & telling
        core = dark & (median < _CORE * expected)
    out = np.zeros_like(dark)
    free = np.flatnonzero(~dark.any(axis=0))
    if not dark.any() or not free.size:
        return out
    # Azimuth closes on itself: cut the ring where nothing is dark.
    names, count = label(np.roll(dark, -free[0], axis=1))
    names = np.roll(names, free[0], axis=1)
    further_out = np.logical_or.accumulate(telling[::-1], axis=0)[::-1]
    rim = telling & ~np.concatenate([further_out[1:], np.zeros((1, dark.shape[1]), bool)])
    widest = int(_WIDEST / (2 * np.pi) * cells.columns)
    for name in range(1, count + 1):
        patch = names == name
        if (patch & core).any() and (patch & rim).any() and patch.any(axis=0).sum() <= widest:
            out |= patch
    return out


def _steep(cells: Cells) -> Grid:
    """Patches that are dark against both of their sides along the azimuth, with steep edges."""
    from scipy.ndimage import label, maximum_filter1d, minimum_filter1d

    median, error = cells.medians
    width = int(_WIDEST / (2 * np.pi) * cells.columns) | 1
    known = np.where(np.isnan(median), -np.inf, median)
    closed = minimum_filter1d(maximum_filter1d(known, width, axis=1, mode="wrap"), width, axis=1, mode="wrap")
    found = _patches(cells, closed, error)
    out = np.zeros_like(found)
    free = np.flatnonzero(~found.any(axis=0))
    if not found.any() or not free.size:
        return out
    names, count = label(np.roll(found, -free[0], axis=1))
    names = np.roll(names, free[0], axis=1)
    for name in range(1, count + 1):
        patch = names == name
        edges = []
        for shift in (-1, 1):
            edge = np.argwhere(patch & ~np.roll(patch, -shift, axis=1))
            beyond = (edge[:, 1] + 2 * shift) % cells.columns
            edges.append(np.nanmedian(known[edge[:, 0], beyond] / closed[edge[:, 0], edge[:, 1]]))
        if min(edges) >= _STEEP:
            out |= patch
    return out


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


def _widened(found: Grid) -> Grid:
    """Two cells more on each side and inwards, and all out to the horizon: the penumbra."""
    out = found.copy()
    for shift in (-2, -1, 1, 2):
        out |= np.roll(found, shift, axis=1)
    grown = out.copy()
    for shift in (1, 2):
        grown[:-shift] |= out[shift:]
    # Outwards a shadow does not end before the horizon.
    return np.maximum.accumulate(grown, axis=0)
