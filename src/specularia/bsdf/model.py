"""What a scattering model is: the interface that measured, traced and tabulated models share."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol, runtime_checkable

import numpy as np
from numpy.typing import ArrayLike, NDArray

__all__ = ["Array", "Quadrature", "ScatteringModel"]

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Quadrature:
    """Outgoing directions with weights that integrate a distribution over its hemisphere.

    Attributes
    ----------
    ux, uy : [K] direction cosines along the sample's x and y.
    weight : [K] projected solid angle in sr; the weights add up to pi.
    """

    ux: Array
    uy: Array
    weight: Array


@runtime_checkable
class ScatteringModel(Protocol):
    """Answers, for any pair of directions on a side, how much light is scattered.

    Incident directions are given on each side by the polar angle from the normal of the face that the light
    arrives on, 0 <= theta_i < 90 degrees, and by the azimuth phi_i; outgoing directions by direction cosines
    (ux, uy), which are also the coordinates of projected solid angle: dux duy = |cos theta_s| d omega.
    """

    @property
    def sides(self) -> tuple[str, ...]:
        """Sides (see `conventions.SIDES`) that the model can answer for."""

    @property
    def band(self) -> str:
        """What light the model is for: a wavelength ("520 nm"), Visible, Solar, CIE-X, CIE-Y or CIE-Z."""

    def evaluate(
        self, side: str, theta_i_deg: ArrayLike, phi_i_deg: ArrayLike, ux: ArrayLike, uy: ArrayLike
    ) -> Array:
        """BSDF in 1/sr; arguments broadcast; NaN where (ux, uy) lies outside the unit disk."""

    def direct_hemispherical(self, side: str, theta_i_deg: ArrayLike, phi_i_deg: ArrayLike = 0.0) -> Array:
        """Share of the incident light that leaves on this side; NaN where the model has no data."""

    def quadrature(self, side: str, theta_i_deg: float, phi_i_deg: float = 0.0) -> Quadrature:
        """Directions refined where the distribution is narrow; sum(weight * evaluate) is tau or rho."""
