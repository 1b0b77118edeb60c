"""Direct-hemispherical transmission over the incident angle, from a few values: a curve and its error.

Over q = sqrt(cos theta) the transmission of panes, flat or rough, clear or tinted, is a smooth curve that
starts at 0 where the light grazes (q = 0). It is taken as a Gaussian process in q with the Matern 5/2 kernel:
its mean is the curve, its standard deviation says how far the truth may lie beside it, between the angles and
beyond them. Length and amplitude were set once, on traced panes (docs/theory/bsdf.md). Ours.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from specularia.bsdf.model import Array

__all__ = ["TauLaw", "flat_pane"]

LENGTH = 0.5
"""Length of the kernel in sqrt(cos theta)."""

AMPLITUDE = 0.3
"""Standard deviation of the process over the largest of the values."""

NOISE = 2e-3
"""Standard deviation of the values themselves over the largest."""

RIPPLE, RIPPLE_DEG = 5e-3, 3.0
"""What the truth ripples about a smooth curve, over the largest value, and within how many degrees: which
places of the two faces meet changes with the angle. A traced pane whose faces share a period of 0.77 mm lies
up to 0.8 % beside the curve, and so does a real diffuser (EDS10, at 10 degrees between 0 and 20)."""

BEYOND = 0.4
"""Share of what the curve loses beyond the last angle that counts as further error there."""

FEW = 3
"""With fewer angles than this the process describes the departure from a clear flat pane."""

_GRID = 4000


def flat_pane(theta_deg: ArrayLike, index: float = 1.52) -> Array:
    """Transmission of a clear flat pane in unpolarised light: mean over s and p of (1 - R)/(1 + R)."""
    c = np.cos(np.radians(theta_deg))
    t = np.sqrt(1.0 - (1.0 - c * c) / index**2)
    rs = ((c - index * t) / (c + index * t)) ** 2
    rp = ((t - index * c) / (t + index * c)) ** 2
    return 0.5 * ((1 - rs) / (1 + rs) + (1 - rp) / (1 + rp))


@dataclass(frozen=True)
class TauLaw:
    """tau over theta through given values.

    Attributes
    ----------
    theta_deg : [N] incident angles, ascending, 0 <= theta < 90.
    tau : [N] values, >= 0.

    Notes
    -----
    With K the kernel's matrix at the q_i and at q = 0 (where the value is 0), and k(q) its column,

        m(q) = k(q) (K + C^2)^-1 y,   s(q)^2 = A^2 - k(q) K^-1 k(q) + B^2 (1 - exp(-(d / D)^2)),
        k(q, q') = A^2 (1 + r + r^2 / 3) exp(-r),   r = sqrt(5) |q - q'| / L,

    A, L = `AMPLITUDE`, `LENGTH`, B, D = `RIPPLE`, `RIPPLE_DEG` with d the way to the nearest given angle,
    and C = `NOISE`, amplitudes times the largest value (Rasmussen and Williams 2006, Gaussian Processes
    for Machine Learning, 2.2 and 4.2, ISBN 978-0-262-18253-9). C keeps the scatter of close neighbours
    from being carried on far away; what m then misses the values by, at most some parts in a thousand, is
    added by straight lines in cos theta. Beyond the last angle s is joined by `BEYOND` times the loss
    since there. Fewer than `FEW` values are taken as departures from `flat_pane`, scaled to the value
    nearest to the normal.

    >>> law = TauLaw(np.array([0.0, 20.0, 40.0, 60.0, 82.5]), np.array([0.92, 0.92, 0.91, 0.84, 0.36]))
    >>> float(law.value(60.0)), bool(law.value(90.0) < 1e-6), bool(law.error(70.0) > law.error(50.0))
    (0.84, True, True)
    """

    theta_deg: Array
    tau: Array

    def value(self, theta_deg: ArrayLike) -> Array:
        """tau at any 0 <= theta <= 90; 0 at 90, never below 0."""
        return np.interp(_q(theta_deg), self._curve[0], self._curve[1])

    def error(self, theta_deg: ArrayLike) -> Array:
        """Standard deviation of the truth about `value`; 0 at the given angles, without their own noise."""
        return np.interp(_q(theta_deg), self._curve[0], self._curve[2])

    @cached_property
    def _curve(self) -> tuple[Array, Array, Array]:
        """q ascending, value and error there; the given angles are among them."""
        own = _q(self.theta_deg)[::-1]
        given = np.asarray(self.tau, float)[::-1]
        scale = float(given.max())
        grid = np.unique(np.concatenate([np.linspace(0.0, 1.0, _GRID + 1), own]))
        if scale <= 0.0:
            return grid, np.zeros(grid.size), np.zeros(grid.size)
        prior = np.zeros(grid.size)
        if given.size < FEW:
            prior = flat_pane(_degrees(grid))
            prior *= given[-1] / prior[np.searchsorted(grid, own[-1])]
        knots = np.concatenate([[0.0], own])
        place = np.searchsorted(grid, knots)
        y = np.concatenate([[0.0], given]) - prior[place]
        column = _kernel(grid, knots)
        k = column[place]
        noise = np.full(knots.size, NOISE**2)
        noise[0] = 0.0
        smooth = prior + column @ np.linalg.solve(k + np.diag(noise + 1e-12), y)
        missed = np.interp(
            -(grid**2), -(knots[::-1] ** 2), (np.concatenate([[0.0], given]) - smooth[place])[::-1]
        )
        value = np.clip(smooth + missed, 0.0, None)
        # A trace of the identity keeps angles that nearly coincide from making the matrix singular.
        weight = np.linalg.solve(k + 1e-12 * np.eye(knots.size), column.T)
        nearest = np.min(np.abs(_degrees(grid)[:, None] - _degrees(own)), axis=1)
        variance = np.clip(AMPLITUDE**2 - np.sum(column * weight.T, axis=1), 0.0, None)
        variance += RIPPLE**2 * -np.expm1(-((nearest / RIPPLE_DEG) ** 2))
        error = scale * np.sqrt(variance)
        beyond = grid < own[0]
        error[beyond] = np.hypot(error[beyond], BEYOND * (given[0] - value[beyond]))
        value[place], error[place] = np.concatenate([[0.0], given]), 0.0
        return grid, value, error


def _q(theta_deg: ArrayLike) -> Array:
    return np.sqrt(np.clip(np.cos(np.radians(theta_deg)), 0.0, 1.0))


def _degrees(q: Array) -> Array:
    return np.degrees(np.arccos(q * q))


def _kernel(a: Array, b: Array) -> Array:
    r = np.sqrt(5.0) * np.abs(a[:, None] - b[None, :]) / LENGTH
    return np.asarray(AMPLITUDE**2 * (1.0 + r + r * r / 3.0) * np.exp(-r))
