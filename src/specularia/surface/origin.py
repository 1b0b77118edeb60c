"""Units and pixel sizes: what a file says, what its user says, and what happens where neither does."""

from __future__ import annotations

import math
import re
import warnings
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from specularia.errors import FormatError, SpeculariaError, SpeculariaWarning

__all__ = ["UNITS", "Given", "unit_in"]

UNITS: Final = {"m": 1e6, "cm": 1e4, "mm": 1e3, "um": 1.0, "nm": 1e-3, "pm": 1e-6}
"""Micrometres in one of each unit."""

_SPELLINGS = {
    "µm": "um",
    "μm": "um",
    "micron": "um",
    "microns": "um",
    "micrometer": "um",
    "micrometers": "um",
    "micrometre": "um",
    "micrometres": "um",
    "nanometer": "nm",
    "nanometers": "nm",
    "nanometre": "nm",
    "nanometres": "nm",
    "millimeter": "mm",
    "millimeters": "mm",
    "millimetre": "mm",
    "millimetres": "mm",
}


def unit_in(text: str) -> str | None:
    """The length unit that a column heading or a header field names, or None.

    >>> unit_in("X_(microns)"), unit_in("z [nm]"), unit_in("y1"), unit_in("µm")
    ('um', 'nm', None, 'um')
    """
    for word in re.findall(r"[A-Za-zµμ]+", text):
        word = _SPELLINGS.get(word.lower(), word)
        if word in UNITS:
            return word
    return None


@dataclass(frozen=True)
class Given:
    """What the caller states about a file that does not state it itself.

    Parameters
    ----------
    pitch_um : pixel size, one number or (x, y).
    unit : one of `UNITS`, the unit of every length that the file leaves without one.
    """

    pitch_um: float | tuple[float, float] | None = None
    unit: str | None = None

    def __post_init__(self) -> None:
        if self.unit is not None and unit_in(self.unit) is None:
            raise SpeculariaError(f"unit {self.unit!r} is not known; use one of {', '.join(UNITS)}.")
        if self.pitch is not None and not all(math.isfinite(p) and p > 0 for p in self.pitch):
            raise SpeculariaError(f"pitch_um must be above 0, found {self.pitch_um}.")

    @property
    def pitch(self) -> tuple[float, float] | None:
        """(x, y) in um, or None."""
        if self.pitch_um is None:
            return None
        if isinstance(self.pitch_um, tuple):
            return float(self.pitch_um[0]), float(self.pitch_um[1])
        return float(self.pitch_um), float(self.pitch_um)

    def checked_pitch(self, path: Path, x_um: float, y_um: float) -> tuple[float, float]:
        """The file's own pixel size; a FormatError where the caller states another one."""
        for own, stated in zip((x_um, y_um), self.pitch or (x_um, y_um)):
            if math.isfinite(own) and abs(stated - own) > 1e-3 * own:
                raise FormatError(
                    file=path,
                    expected=f"a pixel size of {stated:g} um, as stated",
                    found=f"{own:g} um in the file",
                    advice="Leave the stated pixel size out, or check which of the two is right.",
                )
        return x_um, y_um

    def needed_pitch(self, path: Path) -> tuple[float, float]:
        """The caller's pixel size for a file that holds none; a FormatError where there is none."""
        if self.pitch is None:
            raise FormatError(
                file=path,
                expected="a pixel size",
                found="none in the file",
                advice="State it: --pitch in um, pitch_um in a job file or in Python.",
            )
        return self.pitch

    def refuse_unit(self, path: Path, own: str) -> None:
        """A FormatError where the caller states a unit for a file that has its own."""
        if self.unit is not None:
            raise FormatError(
                file=path,
                expected=f"a file without units, since {self.unit} was stated for it",
                found=f"lengths in {own}",
                advice="Leave the unit out.",
            )

    def needed_unit(self, path: Path, what: str, *, fallback: str = "um") -> float:
        """Micrometres per unit of a length without unit: as stated, else assumed with a warning."""
        if self.unit is not None:
            return UNITS[unit_in(self.unit) or self.unit]
        warnings.warn(
            f"{path.name}: the file gives no unit for {what}; {fallback} is assumed. State it with --unit.",
            SpeculariaWarning,
            stacklevel=2,
        )
        return UNITS[fallback]
