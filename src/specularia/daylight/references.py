"""Panes to compare with: no glass, a clear slab, and a diffuser that loses nothing.

The first two let light pass undeflected. Their sun is not an emission map, which could not hold half a
degree, but a beam: a point is lit where the way to the sun passes through the pane.
"""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import ArrayLike, NDArray

from specularia.bsdf import Quadrature, ScatteringModel
from specularia.conventions import square_to_disk
from specularia.daylight.panes import Glazing
from specularia.daylight.transfer import SkyTransfer
from specularia.glass.closed_form import flat_slab

__all__ = ["REFERENCES", "Diffuser", "Undeflected", "reference"]

Array = NDArray[np.float64]

REFERENCES: Final = ("no glass", "clear slab", "diffuser")

_INDEX = 1.52
_FINER = 9.0
"""The sky is seen sharply through these: their table of exit directions has so many times the nodes."""


class Diffuser:
    """A pane that spreads all the light that falls on it evenly into the room: BSDF 1 / pi."""

    band = "Visible"
    sides = ("transmission_front", "transmission_back")

    def __init__(self, cells: int = 96) -> None:
        k = (np.arange(cells) + 0.5) / cells
        x, y = square_to_disk(*(v.ravel() for v in np.meshgrid(k, k, indexing="ij")))
        self._points = Quadrature(ux=x, uy=y, weight=np.full(x.size, np.pi / x.size))

    def evaluate(
        self, side: str, theta_i_deg: ArrayLike, phi_i_deg: ArrayLike, ux: ArrayLike, uy: ArrayLike
    ) -> Array:
        """1 / pi inside the unit disk, NaN outside."""
        x, y, _, _ = np.broadcast_arrays(ux, uy, theta_i_deg, phi_i_deg)
        return np.where(x * x + y * y <= 1.0, 1.0 / np.pi, np.nan)

    def direct_hemispherical(self, side: str, theta_i_deg: ArrayLike, phi_i_deg: ArrayLike = 0.0) -> Array:
        """1 at every incident direction."""
        return np.ones(np.broadcast_shapes(np.shape(theta_i_deg), np.shape(phi_i_deg)))

    def quadrature(self, side: str, theta_i_deg: float, phi_i_deg: float = 0.0) -> Quadrature:
        """Equal cells of projected solid angle."""
        return self._points


class Undeflected(Glazing):
    """A pane through which light passes straight on: no glass, or a clear slab that absorbs nothing.

    Attributes
    ----------
    index : of the slab; 1 is no glass.
    """

    def __init__(self, index: float) -> None:
        super().__init__(_UNSEEN)
        self.index = index

    def tau(self, theta_deg: Array | float) -> Array:
        """Transmission at incident angles, by Fresnel's equations with all reflections inside the slab."""
        theta = np.asarray(theta_deg, float)
        return np.ones(theta.shape) if self.index == 1.0 else flat_slab(theta, index=self.index).transmitted

    def undeflected(self, theta_deg: float) -> float:
        """All the light that it transmits."""
        return float(self.tau(theta_deg))

    def transfer(self, sampling: float) -> SkyTransfer:
        """Every exit direction shows the one straight behind it."""
        if sampling not in self._transfer:

            def shares(theta_deg: float, phi_deg: float) -> tuple[Array, Array, Array]:
                s, phi = np.sin(np.radians(theta_deg)), np.radians(phi_deg)
                x, y = np.array([-s * np.cos(phi)]), np.array([-s * np.sin(phi)])
                return x, y, np.atleast_1d(self.tau(theta_deg))

            self._transfer[sampling] = SkyTransfer.of(shares, isotropic=True, sampling=_FINER * sampling)
        return self._transfer[sampling]

    @property
    def reflectance(self) -> float:
        """Diffuse-diffuse reflectance of its room side."""
        if self.index == 1.0:
            return 0.0
        x, w = np.polynomial.legendre.leggauss(12)
        theta = np.degrees(np.arcsin(np.sqrt(0.5 * (x + 1.0))))
        return float(0.5 * np.sum(w * flat_slab(theta, index=self.index).reflected))


_UNSEEN: ScatteringModel = Diffuser(cells=4)


def reference(name: str) -> Glazing:
    """The pane of one of `REFERENCES`."""
    if name == "diffuser":
        glazing = Glazing(Diffuser())
        glazing.assumed_reflectance = 0.0
        return glazing
    return Undeflected(1.0 if name == "no glass" else _INDEX)
