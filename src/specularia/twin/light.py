"""The colour of the glass, and daylight as the eye weighs it."""

from __future__ import annotations

import csv
import io
from typing import Any

import numpy as np
from numpy.typing import NDArray

from specularia.twin.settings import GlassSettings

__all__ = ["WAVELENGTHS_NM", "absorption", "absorption_csv", "photopic_d65"]

Array = NDArray[np.float64]

WAVELENGTHS_NM: Array = np.arange(380.0, 781.0, 5.0)
"""Wavelengths of the spectra."""


def absorption(wavelength_nm: Array | float, settings: GlassSettings) -> Array:
    """Napierian absorption of a synthetic yellowish glass, 1/mm.

    a = red + (a520 - red) exp(-(wavelength - 520) / decay): an Urbach-like tail of an ultraviolet band, as
    iron gives old glass; clear in the red. The numbers are invented, chosen so that 3 mm lose about a fifth
    at 520 nm.

    >>> from specularia.twin.settings import GlassSettings
    >>> round(float(absorption(520.0, GlassSettings())), 6)
    0.07
    """
    step = settings.absorption_520_per_mm - settings.absorption_red_per_mm
    fall = np.exp(-(np.asarray(wavelength_nm, float) - 520.0) / settings.absorption_decay_nm)
    return settings.absorption_red_per_mm + step * fall


def absorption_csv(settings: GlassSettings) -> str:
    """The curve as CSV text: wavelength_nm, absorption_per_mm."""
    text = io.StringIO()
    text.write("# synthetic: an invented absorption curve, not a measurement of any glass\n")
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(["wavelength_nm", "absorption_per_mm"])
    for wavelength, value in zip(WAVELENGTHS_NM, absorption(WAVELENGTHS_NM, settings)):
        writer.writerow([f"{wavelength:g}", f"{value:.9f}"])
    return text.getvalue()


def photopic_d65() -> Array:
    """Weights of `WAVELENGTHS_NM` for daylight as the eye weighs it: V(lambda) times CIE D65, sum 1.

    References
    ----------
    CIE 018:2019, The basis of physical photometry, doi:10.25039/TR.018.2019 (V);
    ISO/CIE 11664-2:2022, CIE standard illuminants (D65). Both tables from colour-science.
    """
    from colour import SDS_ILLUMINANTS, SDS_LEFS

    def table(spectrum: Any) -> Array:
        return np.interp(WAVELENGTHS_NM, spectrum.wavelengths, spectrum.values, left=0.0, right=0.0)

    weight = table(SDS_LEFS["CIE 1924 Photopic Standard Observer"]) * table(SDS_ILLUMINANTS["D65"])
    return weight / weight.sum()
