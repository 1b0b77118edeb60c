"""The record that every reader returns: one hemisphere of scattered light for one incident direction."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from specularia.conventions import SIDES, direction_cosines, pab_azimuth
from specularia.errors import PhysicsError

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
    warnings: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        if self.quantity not in ("BSDF", "DSF"):
            raise PhysicsError(f"a table holds BSDF or DSF, not {self.quantity!r}.")
        if self.side not in SIDES:
            raise PhysicsError(f"a side is one of {', '.join(SIDES)}, not {self.side!r}.")
        if not len(self.theta_s_deg) == len(self.phi_s_deg) == len(self.values):
            raise PhysicsError("theta_s, phi_s and values must have the same length.")

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
