"""A model of what iron, manganese and sulphur absorb in natron glass, and three glasses made with it.

This is a model, not a measurement of any find. Each ion absorbs in bands that are Gaussians of the
wavenumber, its ferric edge towards the ultraviolet an exponential. Which ions absorb where is long known
(Bamford 1977, Colour Generation and Control in Glass, Elsevier); for Roman glass see Bidegaray et al. (2020),
doi:10.1007/s12520-020-01050-0, on iron's redox, manganese, thickness and colour, and Arletti et al. (2013),
doi:10.1007/s00339-012-7341-4, on their oxidation states; for the amber band, Beerkens (2003), Glass Science
and Technology 76(4), 166-175. Extinctions and widths are round numbers chosen here, of the size that these
sources discuss; where a spectrum was measured, take that.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import ArrayLike, NDArray

from specularia.errors import PhysicsError
from specularia.glass.medium import Spectrum

__all__ = ["BANDS", "GLASSES", "Band", "IronManganese"]

Array = NDArray[np.float64]

DENSITY_G_PER_L: Final = 2500.0
"""Of soda-lime-silica glass, rounded; chosen here."""

FE2O3_G_PER_MOL: Final = 159.69
MNO_G_PER_MOL: Final = 70.94

WAVELENGTHS_NM: Final = np.arange(340.0, 1101.0, 5.0)
"""Where spectra of the model are tabulated."""


@dataclass(frozen=True)
class Band:
    """One absorption band of an ion.

    Attributes
    ----------
    peak_nm : position of its maximum (from the sources above).
    width_per_cm : full width at half maximum in wavenumbers (chosen here).
    extinction : decadic molar extinction at the maximum, L / (mol cm) (chosen here).
    """

    peak_nm: float
    width_per_cm: float
    extinction: float

    def shape(self, wavelength_nm: ArrayLike) -> Array:
        """1 at the maximum."""
        off = 1e7 / np.asarray(wavelength_nm, float) - 1e7 / self.peak_nm
        return np.exp(-4.0 * np.log(2.0) * (off / self.width_per_cm) ** 2)


BANDS: Final = {
    "Fe2+": (Band(1050.0, 6900.0, 27.0),),
    "Fe3+": (Band(380.0, 1300.0, 8.0), Band(420.0, 1800.0, 3.0), Band(440.0, 1500.0, 3.0)),
    "Mn3+": (Band(490.0, 6000.0, 27.0),),
    "amber": (Band(410.0, 4800.0, 1.0),),
}
"""Bands by ion. That of Fe2+ reaches into the red and makes glass blue; Mn3+ makes it purple. The amber band,
of Fe3+ beside S2- in reduced glass, is given by its absorption at the peak, since the share of iron in it is
not known."""

FERRIC_EDGE: Final = (380.0, 4.0, 2000.0)
"""Edge of Fe3+ towards the ultraviolet: extinction 4 at 380 nm, falling e-fold in 2000 per cm (chosen
here)."""


@dataclass(frozen=True)
class IronManganese:
    """Glass by what colours it.

    Attributes
    ----------
    fe2o3_percent : all iron, as Fe2O3 in percent by weight, 0 to 10.
    ferrous : share of the iron that is Fe2+, 0 to 1.
    mno_percent : all manganese, as MnO in percent by weight, 0 to 10.
    mn3 : share of the manganese that is Mn3+, 0 to 1; the rest, Mn2+, is all but colourless.
    amber_per_mm : Napierian absorption of the amber band at 410 nm, >= 0.
    """

    fe2o3_percent: float = 0.0
    ferrous: float = 0.5
    mno_percent: float = 0.0
    mn3: float = 0.0
    amber_per_mm: float = 0.0

    def __post_init__(self) -> None:
        for name, most in (
            ("fe2o3_percent", 10.0),
            ("ferrous", 1.0),
            ("mno_percent", 10.0),
            ("mn3", 1.0),
            ("amber_per_mm", 1e3),
        ):
            if not 0.0 <= getattr(self, name) <= most:
                raise PhysicsError(f"{name} lies between 0 and {most:g}, not at {getattr(self, name)}.")

    def absorption_per_mm(self, wavelength_nm: ArrayLike) -> Array:
        """Napierian absorption in 1/mm: Lambert's and Beer's law over all bands.

            a = ln 10 / 10 * sum over ions of c sum over bands of extinction * shape,

        c in mol/L; extinctions add up, ions do not act on each other.

        >>> float(IronManganese(fe2o3_percent=0.5).absorption_per_mm(1050.0).round(3))
        0.487
        """
        w = np.asarray(wavelength_nm, float)
        iron = 2.0 * 0.01 * self.fe2o3_percent * DENSITY_G_PER_L / FE2O3_G_PER_MOL
        manganese = 0.01 * self.mno_percent * DENSITY_G_PER_L / MNO_G_PER_MOL
        start, extinction, fall = FERRIC_EDGE
        edge = extinction * np.exp((1e7 / w - 1e7 / start) / fall)
        decadic = iron * self.ferrous * _sum("Fe2+", w)
        decadic = decadic + iron * (1.0 - self.ferrous) * (_sum("Fe3+", w) + edge)
        decadic = decadic + manganese * self.mn3 * _sum("Mn3+", w)
        return np.log(10.0) / 10.0 * decadic + self.amber_per_mm * _sum("amber", w)

    def spectrum(self) -> Spectrum:
        """The absorption as a spectrum, 340 to 1100 nm in steps of 5 nm."""
        return Spectrum(WAVELENGTHS_NM, self.absorption_per_mm(WAVELENGTHS_NM))


def _sum(ion: str, wavelength_nm: Array) -> Array:
    return np.sum([band.extinction * band.shape(wavelength_nm) for band in BANDS[ion]], axis=0)


GLASSES: Final = {
    "aqua": IronManganese(fe2o3_percent=0.5, ferrous=0.75, mno_percent=0.4),
    "green": IronManganese(fe2o3_percent=1.1, ferrous=0.55, mno_percent=0.8, amber_per_mm=0.1),
    "yellow-brown": IronManganese(
        fe2o3_percent=1.1, ferrous=0.15, mno_percent=1.5, mn3=0.06, amber_per_mm=0.35
    ),
}
"""Three window glasses after the colours of finds; their contents are chosen here and measured on none."""
