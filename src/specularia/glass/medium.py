"""What the pane is made of: refractive index and absorption, constant or by wavelength."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from specularia.errors import CoverageError, FormatError, PhysicsError
from specularia.files import existing

__all__ = ["Medium", "Spectrum"]

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Spectrum:
    """A quantity by wavelength, joined by straight lines.

    Attributes
    ----------
    wavelength_nm : [K] ascending.
    values : [K].
    """

    wavelength_nm: Array
    values: Array

    def __post_init__(self) -> None:
        w, v = np.asarray(self.wavelength_nm, float), np.asarray(self.values, float)
        object.__setattr__(self, "wavelength_nm", w)
        object.__setattr__(self, "values", v)
        if w.ndim != 1 or w.shape != v.shape or w.size < 2 or np.any(np.diff(w) <= 0):
            raise PhysicsError("a spectrum needs at least two wavelengths in ascending order.")

    def at(self, wavelength_nm: ArrayLike) -> Array:
        """Values at wavelengths in nm; a CoverageError outside the data."""
        w = np.asarray(wavelength_nm, float)
        if np.any((w < self.wavelength_nm[0]) | (w > self.wavelength_nm[-1])):
            raise CoverageError(
                f"the spectrum covers {self.wavelength_nm[0]:g} to {self.wavelength_nm[-1]:g} nm; "
                f"{w.min():g} to {w.max():g} nm was asked for."
            )
        return np.interp(w, self.wavelength_nm, self.values)

    @classmethod
    def read_csv(cls, path: str | Path) -> Self:
        """Read rows "wavelength in nm, value"; lines that start with # and one line of names are passed
        over."""
        path = existing(path, what="a spectrum in CSV")
        wavelengths: list[float] = []
        values: list[float] = []
        try:
            lines = path.read_text(encoding="utf-8").splitlines()
        except (UnicodeDecodeError, OSError) as error:
            raise FormatError(file=path, expected="a text file", found=str(error)) from error
        names_passed = False
        for number, line in enumerate(lines, 1):
            if not line.strip() or line.lstrip().startswith("#"):
                continue
            cells = [c.strip() for c in line.split(",")]
            try:
                w, v = (float(c) for c in cells)
            except ValueError:
                if not wavelengths and not names_passed:
                    names_passed = True
                    continue
                raise FormatError(
                    file=path, line=number, expected="wavelength in nm, value in 1/mm", found=repr(line)
                ) from None
            if not (np.isfinite(w) and np.isfinite(v) and v >= 0):
                raise FormatError(
                    file=path,
                    line=number,
                    expected="finite numbers, the value not negative",
                    found=repr(line),
                )
            if wavelengths and w <= wavelengths[-1]:
                raise FormatError(
                    file=path, line=number, expected=f"a wavelength above {wavelengths[-1]:g}", found=f"{w:g}"
                )
            wavelengths.append(w)
            values.append(v)
        if len(wavelengths) < 2:
            raise FormatError(
                file=path, expected="at least two rows of wavelength and value", found=f"{len(wavelengths)}"
            )
        return cls(np.array(wavelengths), np.array(values))


@dataclass(frozen=True)
class Medium:
    """Glass.

    Attributes
    ----------
    index : refractive index against air, > 1; or six Sellmeier coefficients (B1, B2, B3, C1, C2, C3 in um^2)
        of n^2 = 1 + sum B w^2 / (w^2 - C), w the wavelength in um (Sellmeier 1871,
        doi:10.1002/andp.18712190612).
    absorption_per_mm : Napierian, >= 0: the transmittance of a way L is exp(-a L). A number or a spectrum.
    """

    index: float | tuple[float, ...] = 1.52
    absorption_per_mm: float | Spectrum = 0.0

    def __post_init__(self) -> None:
        if isinstance(self.index, tuple):
            if len(self.index) != 6:
                raise PhysicsError(f"sellmeier needs 6 coefficients, not {len(self.index)}.")
        elif not 1.0 < self.index < 5.0:
            raise PhysicsError(f"the index of glass lies between 1 and 5, not at {self.index}.")
        if not isinstance(self.absorption_per_mm, Spectrum) and not (
            0.0 <= self.absorption_per_mm < float("inf")
        ):
            raise PhysicsError(f"absorption_per_mm must be finite and >= 0, not {self.absorption_per_mm}.")

    def index_at(self, wavelength_nm: float) -> float:
        """Refractive index at a wavelength in nm.

        >>> bk7 = (1.03961212, 0.231792344, 1.01046945, 0.00600069867, 0.0200179144, 103.560653)
        >>> round(Medium(index=bk7).index_at(587.6), 4)
        1.5168
        """
        if not isinstance(self.index, tuple):
            return self.index
        w2 = (wavelength_nm / 1000.0) ** 2
        n2 = 1.0 + sum(b * w2 / (w2 - c) for b, c in zip(self.index[:3], self.index[3:]))
        if not n2 > 1.0:
            raise PhysicsError(f"the Sellmeier coefficients give n^2 = {n2:.4g} at {wavelength_nm:g} nm.")
        return float(np.sqrt(n2))

    def absorption_at(self, wavelength_nm: float) -> float:
        """Absorption in 1/mm at a wavelength in nm."""
        if isinstance(self.absorption_per_mm, Spectrum):
            return float(self.absorption_per_mm.at(wavelength_nm))
        return self.absorption_per_mm
