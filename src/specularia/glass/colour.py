"""Colour of a pane from one trace: the CIE bands as weights of paths by their way in glass.

Where a path goes does not depend on absorption, and on wavelength only through the index, which changes by
half a percent over the visible and counts as constant here. So the light that a path brings at any wavelength
is its light in clear glass times exp(-a(wavelength) L), and the tristimulus values of all paths are sums over
the paths of one trace.

Bands are relative to the illuminant: each of X, Y and Z is 1 for a pane that takes nothing away. Neutral
glass then has three equal bands, which is what Radiance, whose white has equal X, Y and Z, shows as grey.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cache
from typing import TYPE_CHECKING, Final

import numpy as np
from numpy.typing import ArrayLike, NDArray

from specularia.errors import PhysicsError
from specularia.glass.medium import Medium
from specularia.glass.tally import Tally

if TYPE_CHECKING:
    from specularia.glass.trace import Paths

__all__ = ["CIE_BANDS", "Colouring", "Viewing", "colouring", "delta_e", "lab", "srgb", "viewing"]

Array = NDArray[np.float64]

CIE_BANDS: Final = ("CIE-X", "Visible", "CIE-Z")
"""Names of X, Y and Z in models and in XML files; Visible is Y."""

OBSERVER: Final = "CIE 1931 2 Degree Standard Observer"

WAVELENGTHS_NM: Final = np.arange(380.0, 780.1, 5.0)
"""Sums over the spectrum go from 380 to 780 nm in steps of 5 nm (CIE 15:2018, 7.2.2)."""

LONGEST_MM: Final = 1e4
"""Ways are tabulated up to this; no path that matters is longer."""


@dataclass(frozen=True)
class Viewing:
    """Under what light and by whom a colour is seen.

    Attributes
    ----------
    illuminant : of the CIE, such as D65, E or A.
    weights : [3, W] for X, Y and Z at `WAVELENGTHS_NM`; each row adds up to 1.
    white : [3] X, Y, Z of the illuminant itself, Y = 1.
    """

    illuminant: str
    weights: Array
    white: Array


@cache
def viewing(illuminant: str = "D65") -> Viewing:
    """The weights of a spectrum under an illuminant, for the CIE 1931 2 degree observer.

    Parameters
    ----------
    illuminant : a name that colour-science knows: A, C, D50, D55, D65, D75, E, FL1, ...

    References
    ----------
    CIE 15:2018, Colorimetry, 4th edition, doi:10.25039/TR.015.2018; tables from colour-science.
    """
    from colour import MSDS_CMFS, SDS_ILLUMINANTS

    if illuminant not in SDS_ILLUMINANTS:
        raise PhysicsError(f"no illuminant {illuminant!r}; known are {', '.join(sorted(SDS_ILLUMINANTS))}.")
    light, observer = SDS_ILLUMINANTS[illuminant], MSDS_CMFS[OBSERVER]
    power = np.interp(WAVELENGTHS_NM, light.wavelengths, light.values)
    weights = np.array(
        [np.interp(WAVELENGTHS_NM, observer.wavelengths, observer.values[:, k]) * power for k in range(3)]
    )
    total = weights.sum(axis=1)
    return Viewing(illuminant, weights / total[:, None], total / total[1])


@dataclass(frozen=True)
class Colouring:
    """Weights of paths in the three bands, by their way in glass.

    Attributes
    ----------
    illuminant : see `Viewing`.
    absorption_per_mm : [W] Napierian, at `WAVELENGTHS_NM`.
    weights : [3, W] of `Viewing`.
    way_mm, log_share : [K] and [3, K], the logarithm of `share` at some ways, for speed.
    """

    illuminant: str
    absorption_per_mm: Array
    weights: Array
    way_mm: Array
    log_share: Array

    def share(self, way_mm: ArrayLike) -> Array:
        """[3, ...] share of X, Y and Z that is left after a way in glass: sum of weight exp(-a L)."""
        way = np.asarray(way_mm, float)
        left = np.exp(-way.reshape(-1, 1) * self.absorption_per_mm)
        return (self.weights @ left.T).reshape(3, *way.shape)

    def quick_share(self, way_mm: Array, bands: Sequence[int] = (0, 1, 2)) -> Array:
        """[bands, N] `share` of some bands for ways [N] from the table, right to 1e-5 of itself."""
        # The table's ways are 0 and then even in the logarithm, so that the place in it needs no search.
        last = self.way_mm.size - 2
        per = last / np.log(self.way_mm[-1] / self.way_mm[1])
        place = 1.0 + per * np.log(np.maximum(way_mm, 1e-300) / self.way_mm[1])
        k = np.clip(place, 0, last).astype(np.int64)
        k[way_mm < self.way_mm[1]] = 0
        part = np.minimum((way_mm - self.way_mm[k]) / (self.way_mm[k + 1] - self.way_mm[k]), 1.0)
        found = np.empty((len(bands), way_mm.size))
        for row, band in enumerate(bands):
            table = self.log_share[band]
            found[row] = np.exp(table[k] + part * (table[k + 1] - table[k]))
        far = way_mm > LONGEST_MM
        if far.any():
            found[:, far] = self.share(way_mm[far])[list(bands)]
        return found

    def apply(self, paths: Paths, band: int, *, thickness_ratio: float = 1.0) -> Paths:
        """Paths of clear glass as they carry one band through this glass.

        Parameters
        ----------
        paths : traced without absorption of the glass; inclusions may have absorbed.
        band : 0 for X, 1 for Y, 2 for Z.
        thickness_ratio : thickness wanted over the one that was traced. Ways grow with it, directions stay:
            exact for flat panes, and good while relief is thin against the pane.
        """
        left = paths.weight * self.quick_share(thickness_ratio * paths.glass_length_mm, (band,))[0]
        return replace(paths, weight=left, absorbed=paths.absorbed + (paths.weight - left))


def colouring(medium: Medium, *, illuminant: str = "D65") -> Colouring:
    """How a glass colours light, from its absorption at 380 to 780 nm.

    Raises
    ------
    CoverageError : the medium's spectrum does not reach over 380 to 780 nm.
    """
    seen = viewing(illuminant)
    absorption = np.array([medium.absorption_at(float(w)) for w in WAVELENGTHS_NM])
    way = np.concatenate([[0.0], np.geomspace(1e-3, LONGEST_MM, 6000)])
    out = Colouring(illuminant, absorption, seen.weights, way, np.empty((3, 0)))
    return replace(out, log_share=np.log(np.maximum(out.share(way), 1e-300)))


class BandTallies:
    """Running sums of one incident direction in all three bands; takes the place of a `Tally`.

    Parameters
    ----------
    make : makes an empty tally, called once for each band.
    how : weights of the bands.
    """

    def __init__(self, make: Callable[[], Tally], how: Colouring) -> None:
        self.how = how
        self.bands = tuple(make() for _ in CIE_BANDS)

    def add(self, part: Paths) -> None:
        """Count some paths of clear glass, in each band with its weights."""
        for k, tally in enumerate(self.bands):
            tally.add(self.how.apply(part, k))

    @property
    def paths(self) -> int:
        """Number of paths counted."""
        return self.bands[1].paths

    @property
    def error(self) -> float:
        """Error of the visible band; see `Tally.error`."""
        return self.bands[1].error


def lab(xyz: ArrayLike) -> Array:
    """CIE 1976 L*, a*, b* of X, Y, Z relative to the illuminant ([..., 3]), with the illuminant as white.

    >>> [float(v) for v in lab([1.0, 1.0, 1.0]).round(6) + 0.0]
    [100.0, 0.0, 0.0]
    """
    from colour import XYZ_to_Lab

    # The transformation looks at ratios to the white alone, and here these are what is given.
    return np.asarray(XYZ_to_Lab(np.asarray(xyz, float), illuminant=np.array([1.0, 1.0]) / 3.0))


def srgb(xyz: ArrayLike) -> Array:
    """sRGB of X, Y, Z relative to the illuminant ([..., 3]), cut to 0..1; the illuminant is shown as
    white."""
    from colour import XYZ_to_sRGB

    white = np.array([0.95047, 1.0, 1.08883])
    return np.clip(np.asarray(XYZ_to_sRGB(np.asarray(xyz, float) * white)), 0.0, 1.0)


def delta_e(first: ArrayLike, second: ArrayLike) -> Array:
    """Colour difference CIE Delta E 2000 of two colours in L*, a*, b* ([..., 3]).

    References
    ----------
    Sharma, Wu and Dalal (2005), doi:10.1002/col.20070
    """
    from colour import delta_E

    return np.asarray(delta_E(np.asarray(first, float), np.asarray(second, float), method="CIE 2000"))
