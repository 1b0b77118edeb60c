"""Direct-hemispherical values between and beyond the incident directions of a table, with an interval."""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import PchipInterpolator
from scipy.special import ndtri

from specularia.bsdf.model import Array
from specularia.bsdf.side_table import SideTable
from specularia.bsdf.tau_law import TauLaw, flat_pane

__all__ = ["TauCurve", "TauOfSide", "flat_pane"]

Curve = Callable[[Array], Array]


class TauCurve:
    """tau over the incident angle, from the values at some angles; see `tau_law`.

    Transmission falls to 0 at 90 degrees; reflection rises to 1, as what it leaves falls to 0.
    """

    def __init__(self, theta_deg: Array, tau: Array, error: Array, *, transmission: bool) -> None:
        self.theta, self.tau, self.error = (np.asarray(v, float) for v in (theta_deg, tau, error))
        self.transmission = transmission
        self._law = TauLaw(self.theta, self.tau if transmission else 1.0 - self.tau)

    def value(self, theta_deg: Array) -> Array:
        found = self._law.value(theta_deg)
        return found if self.transmission else 1.0 - found

    def noise(self, theta_deg: Array) -> Array:
        """Standard error that the values' own errors make."""
        return np.interp(theta_deg, self.theta, self.error)

    def interpolation_error(self, theta_deg: Array) -> Array:
        """Standard deviation of the truth about the curve, from what curves of panes do between angles."""
        return self._law.error(theta_deg)


class TauOfSide:
    """tau over both incident angles: the curve through the means of the rings, times what azimuth does.

    In a ring tau over its mean is a monotone cubic of the azimuth; between two rings these ratios are joined
    linearly in theta, beyond the last they stay. Half-way between azimuths 90 degrees apart the ratio is
    unknown by as much as it scatters over the ring (what turns twice in a round may hide from four azimuths),
    and by less the closer they lie: s 4 u (1 - u) (gap / 90)^2, with the scatter s, u the share of the gap.
    """

    def __init__(
        self,
        table: SideTable,
        first: NDArray[np.int64],
        azimuth: Array,
        which: NDArray[np.int64],
        *,
        transmission: bool,
    ) -> None:
        theta, tau, error = (np.asarray(v, float) for v in (table.theta_i_deg, table.tau, table.tau_se))
        mean, spread = np.empty(first.size - 1), np.empty(first.size - 1)
        self._ratios: list[Curve] = []
        self._doubts: list[Curve] = []
        for r, (a, b) in enumerate(pairwise(first)):
            own = which[a:b]
            share = _turn_shares(azimuth[a:b]) if b - a > 1 else np.ones(1)
            mean[r] = np.sum(share * tau[own])
            spread[r] = np.sqrt(np.mean(error[own] ** 2))
            relative = tau[own] / mean[r] if mean[r] > 0 else np.ones(b - a)
            self._ratios.append(_around_turn(azimuth[a:b], relative))
            self._doubts.append(_doubt(azimuth[a:b], float(np.std(relative))))
        self.theta = theta[which[first[:-1]]]
        self.curve = TauCurve(self.theta, mean, spread, transmission=transmission)
        self._flat = azimuth.size == 0

    def _blended(self, curves: list[Curve], theta_deg: Array, phi: Array) -> Array:
        """Functions of the azimuth, one for each ring, joined linearly in theta."""
        shape = np.broadcast(theta_deg, phi).shape
        at_rings = np.stack([np.broadcast_to(f(phi), shape) for f in curves])
        k = np.clip(np.searchsorted(self.theta, theta_deg, side="right") - 1, 0, self.theta.size - 1)
        n = np.minimum(k + 1, self.theta.size - 1)
        gap = np.where(n > k, self.theta[n] - self.theta[k], 1.0)
        w = np.clip((theta_deg - self.theta[k]) / gap, 0.0, 1.0) * (n > k)
        below, above = (np.take_along_axis(at_rings, np.broadcast_to(j, shape)[None], 0)[0] for j in (k, n))
        return (1.0 - w) * below + w * above

    def _ratio(self, theta_deg: Array, phi: Array) -> Array:
        if self._flat:
            return np.ones(np.broadcast(theta_deg, phi).shape)
        return self._blended(self._ratios, theta_deg, phi)

    def value(self, theta_deg: Array, phi: Array) -> Array:
        """tau at incident angles in degrees and azimuths in radians."""
        return self.curve.value(theta_deg) * self._ratio(theta_deg, phi)

    def interpolation_error(self, theta_deg: Array, phi: Array) -> Array:
        """Standard error of `value` beyond that of noise."""
        along = self.curve.interpolation_error(theta_deg) * self._ratio(theta_deg, phi)
        if self._flat:
            return along
        return np.hypot(along, self.curve.value(theta_deg) * self._blended(self._doubts, theta_deg, phi))

    def interval(self, theta_deg: Array, phi: Array, level: float) -> tuple[Array, Array]:
        """Where tau lies with the probability `level`, within 0 to 1."""
        noise = self.curve.noise(theta_deg) * self._ratio(theta_deg, phi)
        width = ndtri(0.5 + 0.5 * level) * np.hypot(noise, self.interpolation_error(theta_deg, phi))
        middle = self.value(theta_deg, phi)
        return np.maximum(middle - width, 0.0), np.minimum(middle + width, np.maximum(middle, 1.0))


def _turn_shares(azimuth: Array) -> Array:
    """What share of the full turn lies nearest to each of some ascending azimuths."""
    gaps = np.diff(np.append(azimuth, azimuth[0] + 2.0 * np.pi))
    return np.asarray((gaps + np.roll(gaps, 1)) / (4.0 * np.pi))


def _around_turn(azimuth: Array, values: Array) -> Curve:
    """A monotone cubic through values at ascending azimuths, periodic over the full turn."""
    if azimuth.size < 2:
        return lambda phi: np.full(np.shape(phi), values[0])
    turn = 2.0 * np.pi
    knots = np.concatenate([azimuth[-2:] - turn, azimuth, azimuth[:2] + turn])
    curve = PchipInterpolator(knots, np.concatenate([values[-2:], values, values[:2]]))
    return lambda phi: curve(np.mod(phi, turn))


def _doubt(azimuth: Array, scatter: float) -> Curve:
    """How far a ratio may be off between ascending azimuths; see `TauOfSide`."""
    turn = 2.0 * np.pi
    if azimuth.size < 2:
        return lambda phi: np.full(np.shape(phi), 0.0)
    knots = np.append(azimuth, azimuth[0] + turn)

    def curve(phi: Array) -> Array:
        p = np.mod(phi - azimuth[0], turn) + azimuth[0]
        k = np.clip(np.searchsorted(knots, p, side="right") - 1, 0, azimuth.size - 1)
        gap = knots[k + 1] - knots[k]
        u = (p - knots[k]) / gap
        return np.asarray(scatter * 4.0 * u * (1.0 - u) * (gap / (0.5 * np.pi)) ** 2)

    return curve
