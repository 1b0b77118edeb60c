"""The record that every reader returns: one hemisphere of scattered light for one incident direction."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from specularia.conventions import SIDES, direction_cosines, pab_azimuth
from specularia.errors import CoverageError, PhysicsError

__all__ = ["GRAZING", "Array", "Table"]

Array = NDArray[np.float64]

GRAZING = 1e-3
"""Cosine of theta_s (0.06 degrees off the horizon) below which a direction tells nothing about the BSDF."""


@dataclass(frozen=True)
class Table:
    """Scattered light measured in one hemisphere, for one incident direction.

    Attributes
    ----------
    file : where it was read from; empty for a table that was computed.
    quantity : "BSDF" (1/sr) or "DSF" (BSDF times |cos theta_s|, 1/sr).
    side : one of `conventions.SIDES`.
    theta_i_deg, phi_i_deg : incident direction as in the file; theta_i counts from the front normal, above 90
        the light arrives on the back.
    theta_s_deg, phi_s_deg : [P] scattered directions in the frame of `conventions`, degrees, theta_s from the
        front normal.
    values : [P] of the quantity; may be negative where a measured signal is lost in noise.
    up_phi_deg : azimuth of "up" in the frame of phi_i_deg; 90 where that frame is the one of `conventions`.
    band : what light it was measured in, such as "520 nm" or "Visible".
    name : of the sample.
    synthetic : True for numbers that a computer program made.
    quantity_line : line of the file that names the quantity, where there is one.
    stated_integral : the file's own integral over this hemisphere, where it gives one.
    scale_se : relative standard error of the scale that all values share, such as that of a scan of the bare
        beam; 0 where the file gives absolute values and no error of them.
    scale_bound : half-width of the bound on what else the scale may be off by, relative.
    others : further columns of the same quantity by their band, [P] each; see `in_band`.
    warnings : what the reader noticed; the numbers stand.
    """

    file: str
    quantity: str
    side: str
    theta_i_deg: float
    phi_i_deg: float
    theta_s_deg: Array
    phi_s_deg: Array
    values: Array
    up_phi_deg: float = 90.0
    band: str = "Visible"
    name: str = ""
    synthetic: bool = False
    quantity_line: int | None = None
    stated_integral: float | None = None
    scale_se: float = 0.0
    scale_bound: float = 0.0
    others: Mapping[str, Array] = field(default_factory=dict)
    warnings: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        if self.quantity not in ("BSDF", "DSF"):
            raise PhysicsError(f"a table holds BSDF or DSF, not {self.quantity!r}.")
        if self.side not in SIDES:
            raise PhysicsError(f"a side is one of {', '.join(SIDES)}, not {self.side!r}.")
        columns = (self.phi_s_deg, self.values, *self.others.values())
        if any(len(column) != len(self.theta_s_deg) for column in columns):
            raise PhysicsError("theta_s, phi_s and values must have the same length.")

    def in_band(self, band: str) -> Table:
        """The table of another of its columns, "CIE-X" or "CIE-Z"; "CIE-Y" and "Visible" are one.

        >>> y = np.ones(4)
        >>> one = Table("", "DSF", "transmission_front", 0.0, 0.0, y, y, y, others={"CIE-X": 2 * y})
        >>> float(one.in_band("CIE-X").values[0])
        2.0
        """
        wanted = "Visible" if band == "CIE-Y" else band
        if wanted == self.band:
            return self
        if wanted not in self.others:
            held = ", ".join(dict.fromkeys([self.band, *self.others]))
            raise CoverageError(f"{self.label} holds {held}, not {band}.")
        others = {k: v for k, v in self.others.items() if k != wanted}
        return replace(
            self, values=self.others[wanted], band=wanted, others={**others, self.band: self.values}
        )

    @property
    def label(self) -> str:
        """Short name for messages."""
        return Path(self.file).name if self.file else (self.name or "table")

    @property
    def kind(self) -> str:
        """ "transmission" or "reflection"."""
        return self.side.split("_")[0]

    @property
    def polar_deg(self) -> float:
        """Polar angle of incidence from the normal of the face that the light arrives on, degrees."""
        return min(self.theta_i_deg, 180.0 - self.theta_i_deg)

    @property
    def azimuth_deg(self) -> float:
        """Azimuth of incidence in the frame of `conventions`, degrees."""
        return float(pab_azimuth(self.phi_i_deg, self.up_phi_deg))

    @cached_property
    def _cosines(self) -> tuple[Array, Array, Array]:
        return direction_cosines(self.theta_s_deg, self.phi_s_deg)

    @property
    def ux(self) -> Array:
        """[P] direction cosines of the scattered directions along x."""
        return self._cosines[0]

    @property
    def uy(self) -> Array:
        """[P] direction cosines of the scattered directions along y."""
        return self._cosines[1]

    @property
    def cos_s(self) -> Array:
        """[P] |cos theta_s|."""
        return np.abs(self._cosines[2])

    @cached_property
    def bsdf(self) -> Array:
        """[P] BSDF in 1/sr; NaN where the direction is too close to the horizon to tell (`GRAZING`)."""
        cosine = self.cos_s
        known = cosine > GRAZING
        divisor = np.where(known, cosine, 1.0) if self.quantity == "DSF" else 1.0
        return np.where(known, self.values / divisor, np.nan)
