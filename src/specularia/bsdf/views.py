"""A model seen otherwise: turned over, turned about its normal, averaged over azimuth."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from specularia.bsdf.cells import is_isotropic
from specularia.bsdf.model import Array, Quadrature, ScatteringModel
from specularia.conventions import SIDES

__all__ = ["AzimuthMean", "Flipped", "Rotated", "other_face"]


def other_face(side: str) -> str:
    """The side of that name on the other face.

    >>> other_face("reflection_back")
    'reflection_front'
    """
    return side.replace("front", "\0").replace("back", "front").replace("\0", "back")


def _swapped(origin: str) -> str:
    """Where a side's numbers come from, after the sample was turned over."""
    return other_face(origin) if origin.startswith("reciprocity of") else origin


@dataclass(frozen=True)
class _View:
    """What all views take over from the model behind them."""

    model: ScatteringModel

    @property
    def sides(self) -> tuple[str, ...]:
        return self.model.sides

    @property
    def band(self) -> str:
        return self.model.band

    @property
    def isotropic(self) -> bool:
        return is_isotropic(self.model)

    @property
    def attributes(self) -> Mapping[str, str]:
        return getattr(self.model, "attributes", {})

    def origin(self, side: str) -> str:
        known = getattr(self.model, "origin", None)
        return str(known(side)) if callable(known) else "model"


@dataclass(frozen=True)
class Flipped(_View):
    """A sample turned over about its y axis: front and back change places, up stays up, x runs opposite."""

    @property
    def sides(self) -> tuple[str, ...]:
        """Sides of the sample as it lies now."""
        return tuple(s for s in SIDES if other_face(s) in self.model.sides)

    def origin(self, side: str) -> str:
        """Where the numbers of a side come from."""
        return _swapped(super().origin(other_face(side)))

    def evaluate(
        self, side: str, theta_i_deg: ArrayLike, phi_i_deg: ArrayLike, ux: ArrayLike, uy: ArrayLike
    ) -> Array:
        """BSDF in 1/sr; arguments broadcast."""
        turned = 180.0 - np.asarray(phi_i_deg, float)
        return self.model.evaluate(other_face(side), theta_i_deg, turned, -np.asarray(ux, float), uy)

    def direct_hemispherical(self, side: str, theta_i_deg: ArrayLike, phi_i_deg: ArrayLike = 0.0) -> Array:
        """Direct-hemispherical transmission or reflection."""
        turned = 180.0 - np.asarray(phi_i_deg, float)
        return self.model.direct_hemispherical(other_face(side), theta_i_deg, turned)

    def quadrature(self, side: str, theta_i_deg: float, phi_i_deg: float = 0.0) -> Quadrature:
        """The model's own points, mirrored."""
        q = self.model.quadrature(other_face(side), theta_i_deg, 180.0 - phi_i_deg)
        return Quadrature(-q.ux, q.uy, q.weight)


@dataclass(frozen=True)
class Rotated(_View):
    """A sample turned about its normal by an angle, counter-clockwise seen from the front."""

    angle_deg: float

    def _back(self, ux: ArrayLike, uy: ArrayLike, sign: float = -1.0) -> tuple[Array, Array]:
        c, d = np.cos(np.radians(self.angle_deg)), sign * np.sin(np.radians(self.angle_deg))
        x, y = np.asarray(ux, float), np.asarray(uy, float)
        return x * c - y * d, x * d + y * c

    def evaluate(
        self, side: str, theta_i_deg: ArrayLike, phi_i_deg: ArrayLike, ux: ArrayLike, uy: ArrayLike
    ) -> Array:
        """BSDF in 1/sr; arguments broadcast."""
        turned = np.asarray(phi_i_deg, float) - self.angle_deg
        return self.model.evaluate(side, theta_i_deg, turned, *self._back(ux, uy))

    def direct_hemispherical(self, side: str, theta_i_deg: ArrayLike, phi_i_deg: ArrayLike = 0.0) -> Array:
        """Direct-hemispherical transmission or reflection."""
        return self.model.direct_hemispherical(
            side, theta_i_deg, np.asarray(phi_i_deg, float) - self.angle_deg
        )

    def quadrature(self, side: str, theta_i_deg: float, phi_i_deg: float = 0.0) -> Quadrature:
        """The model's own points, turned."""
        q = self.model.quadrature(side, theta_i_deg, phi_i_deg - self.angle_deg)
        return Quadrature(*self._back(q.ux, q.uy, 1.0), q.weight)


@dataclass(frozen=True)
class AzimuthMean(_View):
    """The mean of a sample turned about its normal to `count` equally spaced angles: isotropic."""

    count: int = 24

    @property
    def isotropic(self) -> bool:
        """By construction, down to the spacing of the angles."""
        return True

    @property
    def _turned(self) -> list[Rotated]:
        return [Rotated(self.model, (k + 0.5) * 360.0 / self.count) for k in range(self.count)]

    def evaluate(
        self, side: str, theta_i_deg: ArrayLike, phi_i_deg: ArrayLike, ux: ArrayLike, uy: ArrayLike
    ) -> Array:
        """BSDF in 1/sr; arguments broadcast."""
        total = sum(m.evaluate(side, theta_i_deg, phi_i_deg, ux, uy) for m in self._turned)
        return np.asarray(total / self.count)

    def direct_hemispherical(self, side: str, theta_i_deg: ArrayLike, phi_i_deg: ArrayLike = 0.0) -> Array:
        """Direct-hemispherical transmission or reflection, the same for all azimuths."""
        phi = 0.0 * np.asarray(phi_i_deg, float)
        total = sum(m.direct_hemispherical(side, theta_i_deg, phi) for m in self._turned)
        return np.asarray(total / self.count)

    def quadrature(self, side: str, theta_i_deg: float, phi_i_deg: float = 0.0) -> Quadrature:
        """The points of all turned samples together."""
        points = [m.quadrature(side, theta_i_deg, phi_i_deg) for m in self._turned]
        return Quadrature(
            np.concatenate([q.ux for q in points]),
            np.concatenate([q.uy for q in points]),
            np.concatenate([q.weight for q in points]) / self.count,
        )
