"""Klems angle bases: BSDFs as matrices between patches of the hemisphere.

Patches are rings in theta, each divided evenly in azimuth, the first patch of a ring centred on azimuth 0. A
matrix holds the BSDF in 1/sr, constant on each pair of patches: rows are outgoing, columns incident patches.
The half and quarter bases are those of Radiance 6; a file that defines a basis of that name with other bounds
is read with its own.

References
----------
Klems, J. H. (1994), A new method for predicting the solar heat gain of complex fenestration systems,
ASHRAE Transactions 100(1).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

from specularia.bsdf._query_kernel import patch_numbers
from specularia.bsdf.model import Array
from specularia.errors import PhysicsError

__all__ = ["BASES", "KlemsBasis", "basis_named"]


@dataclass(frozen=True)
class KlemsBasis:
    """A division of the hemisphere into patches.

    Attributes
    ----------
    name : as in files, such as "LBNL/Klems Full".
    bounds_deg : [R + 1] theta at the edges of the rings, from 0 to 90.
    phi_count : [R] patches in each ring.
    """

    name: str
    bounds_deg: tuple[float, ...]
    phi_count: tuple[int, ...]

    def __post_init__(self) -> None:
        bounds = np.asarray(self.bounds_deg)
        if len(bounds) != len(self.phi_count) + 1 or np.any(np.diff(bounds) <= 0) or bounds[0] != 0:
            raise PhysicsError(f"angle basis {self.name}: its rings must ascend from 0, not {bounds}.")
        if min(self.phi_count) < 1 or abs(bounds[-1] - 90.0) > 1e-6:
            raise PhysicsError(
                f"angle basis {self.name}: it must reach 90 degrees with 1 or more patches a ring."
            )

    @property
    def patches(self) -> int:
        """Number of patches."""
        return sum(self.phi_count)

    @cached_property
    def first(self) -> NDArray[np.int64]:
        """[R + 1] number of the first patch of each ring."""
        return np.concatenate([[0], np.cumsum(self.phi_count)]).astype(np.int64)

    @cached_property
    def solid_angle(self) -> Array:
        """[patches] projected solid angle in sr; they add up to pi."""
        s2 = np.sin(np.radians(self.bounds_deg)) ** 2
        return np.repeat(np.pi * np.diff(s2) / self.phi_count, self.phi_count)

    def index(self, x: ArrayLike, y: ArrayLike) -> NDArray[np.int64]:
        """Patch that holds the direction with the direction cosines (x, y); its azimuth is atan2(y, x)."""
        x, y = np.broadcast_arrays(np.asarray(x, float), np.asarray(y, float))
        return np.asarray(patch_numbers(x.ravel(), y.ravel(), *self.arrays)).reshape(x.shape)

    @cached_property
    def arrays(self) -> tuple[Array, NDArray[np.int64], NDArray[np.int64], NDArray[np.int64]]:
        """The basis as compiled look-up takes it.

        Squared sines at the edges of the rings, the ring at the lower end of each of 1024 equal steps of the
        squared sine, patches in each ring, its first patch.
        """
        edges = np.sin(np.radians(np.asarray(self.bounds_deg))) ** 2
        near = np.searchsorted(edges, np.arange(1025) / 1024, side="right") - 1
        near = np.minimum(near, len(self.phi_count) - 1)
        return edges, near.astype(np.int64), np.asarray(self.phi_count, np.int64), self.first

    @cached_property
    def opposite(self) -> NDArray[np.int64]:
        """[patches] the patch half a turn away in azimuth."""
        x, y, _ = self.points(1, 1)
        return self.index(-x, -y)

    def points(self, radial: int, across: int) -> tuple[Array, Array, Array]:
        """Direction cosines and projected solid angles of radial x across equal parts of every patch."""
        x, y, w = [], [], []
        s2 = np.sin(np.radians(self.bounds_deg)) ** 2
        for ring, count in enumerate(self.phi_count):
            r = np.sqrt(s2[ring] + (np.arange(radial) + 0.5) / radial * (s2[ring + 1] - s2[ring]))
            phi = 2 * np.pi * (np.arange(count * across) + 0.5 - across / 2) / (count * across)
            rr, pp = (v.ravel() for v in np.meshgrid(r, phi, indexing="ij"))
            if count == 1 and radial * across == 1:
                rr = np.zeros(1)
            x.append(rr * np.cos(pp))
            y.append(rr * np.sin(pp))
            w.append(np.full(rr.size, np.pi * (s2[ring + 1] - s2[ring]) / rr.size))
        return np.concatenate(x), np.concatenate(y), np.concatenate(w)


def _basis(name: str, bounds: Sequence[float], count: Sequence[int]) -> KlemsBasis:
    return KlemsBasis(name=name, bounds_deg=tuple(bounds), phi_count=tuple(count))


BASES = (
    _basis("LBNL/Klems Full", (0, 5, 15, 25, 35, 45, 55, 65, 75, 90), (1, 8, 16, 20, 24, 24, 24, 16, 12)),
    _basis("LBNL/Klems Half", (0, 6.5, 19.5, 32.5, 45.5, 58.5, 71.5, 90), (1, 8, 12, 16, 20, 12, 8)),
    _basis("LBNL/Klems Quarter", (0, 9, 27, 45, 63, 90), (1, 8, 12, 12, 8)),
)


def basis_named(name: str, own: Sequence[KlemsBasis] = ()) -> KlemsBasis | None:
    """The basis of that name, out of a file's own ones and then the standard ones; None if there is none."""
    wanted = " ".join(name.split()).casefold()
    for basis in (*own, *BASES):
        if " ".join(basis.name.split()).casefold() == wanted:
            return basis
    return None
