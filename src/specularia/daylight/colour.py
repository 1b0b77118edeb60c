"""Colour in rooms: tristimulus values, and the linear RGB of Radiance's primaries that carries them.

Sun and sky are white of equal energy, as Radiance's white is: X = Y = Z, R = G = B. Light is counted in
three channels R, G, B, each in the units of luminance or illuminance, so that grey light has three equal
numbers and Y = 0.265 R + 0.670 G + 0.065 B. Rooms of one band have a single channel, which is Y itself.
Colours more saturated than the primaries have a negative channel; everything before the picture's file is
linear and keeps it.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.optimize import minimize_scalar

from specularia.bsdf import Quadrature, ScatteringModel

__all__ = [
    "LUMINANCE",
    "RGB_TO_XYZ",
    "Coloured",
    "UvBand",
    "chromaticity",
    "colour_temperature",
    "luminous",
    "shown",
    "to_rgb",
    "to_xyz",
]

Array = NDArray[np.float64]

_PRIMARIES: Final = np.array([[0.640, 0.330], [0.290, 0.600], [0.150, 0.060]])
"""x, y of Radiance's red, green and blue (its src/common/color.h)."""

_WHITE: Final = np.array([1.0, 1.0, 1.0])
"""X, Y, Z of its white: equal energy."""


def _matrix() -> Array:
    x, y = _PRIMARIES.T
    columns = np.stack([x, y, 1.0 - x - y])
    return np.asarray(columns * np.linalg.solve(columns, _WHITE))


RGB_TO_XYZ: Final[Array] = _matrix()
LUMINANCE: Final[Array] = RGB_TO_XYZ[1]
"""What the channels count for in luminance; the sum is 1."""

_XYZ_TO_RGB: Final = np.linalg.inv(RGB_TO_XYZ)

_OFF_LOCUS: Final = 0.05
"""Distance from Planck's locus beyond which there is no colour temperature."""


@dataclass(frozen=True)
class Coloured:
    """A pane's scattering in colour: one model for each of X, Y and Z.

    Attributes
    ----------
    x, y, z : models whose values are tristimulus values under white of equal energy, so that for a grey pane
        all three are the same.
    """

    x: ScatteringModel
    y: ScatteringModel
    z: ScatteringModel


class UvBand:
    """X or Z of a model that states Y and the chromaticity (u', v') of CIE 1976, as trees in colour do.

    X = Y 9 u' / (4 v'), Z = Y (12 - 3 u' - 20 v') / (4 v').

    Parameters
    ----------
    y, u, v : models of Y, u' and v'.
    band : CIE-X or CIE-Z.
    """

    def __init__(self, y: ScatteringModel, u: ScatteringModel, v: ScatteringModel, *, band: str) -> None:
        self._y, self._u, self._v, self.band = y, u, v, band
        self.sides = tuple(s for s in y.sides if s in u.sides and s in v.sides)

    def evaluate(
        self, side: str, theta_i_deg: ArrayLike, phi_i_deg: ArrayLike, ux: ArrayLike, uy: ArrayLike
    ) -> Array:
        """BSDF in 1/sr; NaN outside the unit disk, 0 where there is no light to have a colour."""
        y, u, v = (m.evaluate(side, theta_i_deg, phi_i_deg, ux, uy) for m in (self._y, self._u, self._v))
        part = 9.0 * u if self.band == "CIE-X" else 12.0 - 3.0 * u - 20.0 * v
        with np.errstate(divide="ignore", invalid="ignore"):
            return np.where(np.isnan(y) | (v > 0.0), y * part / (4.0 * v), 0.0)

    def quadrature(self, side: str, theta_i_deg: float, phi_i_deg: float = 0.0) -> Quadrature:
        """That of Y."""
        return self._y.quadrature(side, theta_i_deg, phi_i_deg)

    def direct_hemispherical(self, side: str, theta_i_deg: ArrayLike, phi_i_deg: ArrayLike = 0.0) -> Array:
        """Sums over the quadrature; NaN where Y is."""
        theta, phi = np.broadcast_arrays(np.asarray(theta_i_deg, float), np.asarray(phi_i_deg, float))
        known = np.asarray(np.isfinite(self._y.direct_hemispherical(side, theta, phi)))
        out = np.full(theta.shape, np.nan)
        for k in np.ndindex(theta.shape):
            if known[k]:
                t, p = float(theta[k]), float(phi[k])
                q = self.quadrature(side, t, p)
                out[k] = np.sum(q.weight * self.evaluate(side, t, p, q.ux, q.uy))
        return out


def to_xyz(rgb: Array) -> Array:
    """[..., 3] tristimulus values of linear RGB.

    >>> to_xyz(np.ones(3)).round(12).tolist()
    [1.0, 1.0, 1.0]
    """
    return np.asarray(rgb @ RGB_TO_XYZ.T)


def to_rgb(xyz: Array) -> Array:
    """[..., 3] linear RGB in Radiance's primaries of tristimulus values."""
    return np.asarray(xyz @ _XYZ_TO_RGB.T)


def luminous(channels: Array) -> Array:
    """[...] Y of light in channels [..., 1] (Y itself) or [..., 3] (R, G, B)."""
    return channels[..., 0] if channels.shape[-1] == 1 else np.asarray(channels @ LUMINANCE)


def chromaticity(xyz: Array) -> Array:
    """[..., 2] x, y of tristimulus values; NaN where it is dark."""
    total = xyz.sum(axis=-1, keepdims=True)
    return np.divide(xyz[..., :2], total, out=np.full((*xyz.shape[:-1], 2), np.nan), where=total > 0.0)


def colour_temperature(xy: Array) -> float | None:
    """Correlated colour temperature in K of a chromaticity [2]; None where it has none.

    The point of Planck's locus nearest in (u, v) of CIE 1960, from 1000 to 15000 K; none is given more than
    0.05 away from the locus (CIE 15:2018). The locus after Krystek 1985, doi:10.1002/col.5080100109.

    >>> round(colour_temperature(np.array([0.31272, 0.32903])), -1)
    6500.0
    """
    if not np.isfinite(xy).all():
        return None
    x, y = xy
    u, v = np.array([4.0 * x, 6.0 * y]) / (-2.0 * x + 12.0 * y + 3.0)

    def apart(mired: float) -> float:
        t = 1e6 / mired
        pu = (0.860117757 + 1.54118254e-4 * t + 1.28641212e-7 * t * t) / (
            1.0 + 8.42420235e-4 * t + 7.08145163e-7 * t * t
        )
        pv = (0.317398726 + 4.22806245e-5 * t + 4.20481691e-8 * t * t) / (
            1.0 - 2.89741816e-5 * t + 1.61456053e-7 * t * t
        )
        return float(np.hypot(pu - u, pv - v))

    low, high = 1e6 / 15000.0, 1e6 / 1000.0
    found = minimize_scalar(apart, bounds=(low, high), method="bounded", options={"xatol": 1e-4})
    at_an_end = min(found.x - low, high - found.x) < 0.01
    return None if at_an_end or found.fun > _OFF_LOCUS else float(1e6 / found.x)


def shown(rgb: Array) -> Array:
    """[..., 3] linear RGB without negative channels: drawn towards grey of the same luminance.

    >>> shown(np.array([[-0.1, 1.0, 0.5], [0.3, 0.2, 0.1]])).min() >= 0.0
    np.True_
    """
    grey = np.maximum(rgb @ LUMINANCE, 0.0)[..., None]
    low = rgb.min(axis=-1, keepdims=True)
    share = np.divide(grey, grey - low, out=np.ones_like(grey), where=low < 0.0)
    return np.asarray(np.maximum(grey + np.minimum(share, 1.0) * (rgb - grey), 0.0))
