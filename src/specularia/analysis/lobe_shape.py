"""Three numbers that say what a pane does to light: how much passes, how wide the lobe is, and the rest.

The same three are taken of traced paths and of a measured table, so that one can be set against the other.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from specularia.gonio.interpolant import Distribution

__all__ = ["ASIDE_DEG", "QUANTITIES", "LobeShape", "deflection", "shape_of_distribution", "shape_of_light"]

Array = NDArray[np.float64]

ASIDE_DEG: Final = 40.0
"""Light deflected further than this counts as background."""

QUANTITIES: Final = ("tau", "width_deg", "background")
"""Names of the columns of `LobeShape.values`."""

_EDGES_DEG: Final = np.concatenate([[0.0], np.geomspace(0.02, 180.0, 1500)])


@dataclass(frozen=True)
class LobeShape:
    """Transmitted light of one incident direction, of R replicates.

    Attributes
    ----------
    values : [R, 3] the quantities of `QUANTITIES` for each replicate: direct-hemispherical transmission;
        width of the lobe, twice the angle of deflection within which half of the transmitted light leaves,
        degrees (of a Gaussian lobe the full width at half maximum); share of the transmitted light that is
        deflected by more than `ASIDE_DEG`.
    """

    values: Array

    @property
    def mean(self) -> Array:
        """[3] means over the replicates."""
        return self.values.mean(axis=0)

    @property
    def se(self) -> Array:
        """[3] standard errors of the means; NaN with one replicate."""
        return standard_error(self.values)


def standard_error(values: Array) -> Array:
    """Standard error of the mean over the first axis; NaN where there is one value only."""
    if len(values) < 2:
        return np.full(values.shape[1:], np.nan)
    return np.asarray(values.std(axis=0, ddof=1) / np.sqrt(len(values)))


def deflection(ux: Array, uy: Array, theta_deg: float) -> Array:
    """Angle in degrees between transmitted light and undeflected light that came from (theta, 0).

    >>> deflection(np.array([-0.5]), np.array([0.0]), 30.0).round(6).tolist()
    [0.0]
    """
    t = np.radians(theta_deg)
    uz = np.sqrt(np.maximum(1.0 - ux * ux - uy * uy, 0.0))
    # From the chord, which is exact for small angles too.
    chord = np.sqrt((ux + np.sin(t)) ** 2 + uy * uy + (uz - np.cos(t)) ** 2)
    return np.asarray(np.degrees(2.0 * np.arcsin(np.minimum(0.5 * chord, 1.0))))


def shape_of_light(
    ux: Array,
    uy: Array,
    weight: Array,
    replicate: NDArray[np.int64],
    *,
    theta_deg: float,
    per_replicate: Array,
) -> LobeShape:
    """Shape of light that left in single directions.

    Parameters
    ----------
    ux, uy, weight : [K] direction cosines and weights of transmitted light, the light coming from (theta, 0).
    replicate : [K] number of the replicate each belongs to, 0 to R - 1.
    theta_deg : incident angle.
    per_replicate : [R] light that arrived, in the unit of the weights.
    """
    n = len(per_replicate)
    place = np.searchsorted(_EDGES_DEG, deflection(ux, uy, theta_deg), side="right") - 1
    place = np.clip(place, 0, _EDGES_DEG.size - 2)
    steps = _EDGES_DEG.size - 1
    cells = np.asarray(np.bincount(replicate * steps + place, weight, n * steps), float)
    return LobeShape(_shape(cells.reshape(n, steps), per_replicate))


def shape_of_distribution(found: Distribution, theta_deg: float) -> LobeShape:
    """The same of a measured distribution, turned so that its light comes from phi = 0; one replicate."""
    centre = np.sqrt(_EDGES_DEG[1:] * np.maximum(_EDGES_DEG[:-1], 0.5 * _EDGES_DEG[1]))
    around = (np.arange(180) + 0.5) * (2.0 * np.pi / 180)
    d, psi = np.radians(centre)[:, None], around[None, :]
    # Directions at deflection d from the undeflected one, the exit normal being z here.
    t = np.radians(theta_deg)
    side, out, along = np.sin(d) * np.cos(psi), np.sin(d) * np.sin(psi), np.cos(d) + 0.0 * psi
    ux = side * np.cos(t) - along * np.sin(t)
    uz = side * np.sin(t) + along * np.cos(t)
    seen = uz > 0.0
    value = np.zeros(ux.shape)
    value[seen] = found.at(ux[seen], out[seen]) * uz[seen]
    rings = np.radians(_EDGES_DEG)
    area = 2.0 * np.pi * (np.cos(rings[:-1]) - np.cos(rings[1:]))
    cells = value.mean(axis=1) * area
    shape = _shape(cells[None, :], np.ones(1))
    # The integral over the triangles is the better one of the whole; it makes tau what `gonio info` says.
    shape[0, 0] = found.integral
    return LobeShape(shape)


def _shape(cells: Array, arrived: Array) -> Array:
    """[R, 3] from the light [R, B] within the steps of deflection."""
    light = cells.sum(axis=1)
    sums = np.cumsum(cells, axis=1)
    half = np.empty(len(cells))
    for r, (row, whole) in enumerate(zip(sums, light)):
        k = int(np.searchsorted(row, 0.5 * whole))
        before = row[k - 1] if k else 0.0
        part = (0.5 * whole - before) / (row[k] - before) if row[k] > before else 0.0
        half[r] = _EDGES_DEG[k] + part * (_EDGES_DEG[k + 1] - _EDGES_DEG[k])
    k = int(np.searchsorted(_EDGES_DEG, ASIDE_DEG))
    inside = (ASIDE_DEG - _EDGES_DEG[k - 1]) / (_EDGES_DEG[k] - _EDGES_DEG[k - 1])
    near = sums[:, k - 2] + inside * cells[:, k - 1]
    with np.errstate(invalid="ignore", divide="ignore"):
        return np.column_stack([light / arrived, 2.0 * half, 1.0 - near / light])
