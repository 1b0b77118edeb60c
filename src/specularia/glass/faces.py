"""The two faces of a pane: a flat plane, or a height map that is made to repeat."""

from __future__ import annotations

import warnings
from dataclasses import dataclass, replace
from typing import Self

import numpy as np
from numpy.typing import NDArray

from specularia.errors import PhysicsError, SpeculariaWarning
from specularia.glass import tiling as tilings
from specularia.glass.thin_film import Film
from specularia.glass.tiling import Tiling, TilingReport
from specularia.surface.denoise import denoise as remove_noise
from specularia.surface.heightmap import HeightMap, filled

__all__ = ["MISSING_LIMIT", "Face", "Tiling"]

Array = NDArray[np.float64]

MISSING_LIMIT = 0.05
"""Largest share of missing pixels that is filled, where nothing else is said."""

SLOPE_CHANGE = 0.05
"""Relative change of the rms slope by tiling that is warned about."""


@dataclass(frozen=True)
class Face:
    """One face of a pane, as its microscope saw it: heights out of the glass, x to the right, y up.

    Attributes
    ----------
    heights_um : [row = y, column = x] at least 2 x 2, or None for a flat face. NaN marks missing pixels.
    pitch_x_um, pitch_y_um : pixel size, > 0.
    tiling : how the map goes on beyond its field. "periodic" repeats it as it is. "mirror" repeats it with
        its mirror image, which always fits but doubles the period. "blend" joins opposite edges over an
        eighth of the field by weights whose squares add up to 1, which keeps the variance of the relief
        (Heitz and Neyret 2018, doi:10.1145/3233304), and gives up that eighth.
    name : for messages.
    max_missing : a map of which a larger share is missing is refused, 0 to 1; otherwise gaps are filled.
    sealant_index : index of a liquid that fills the relief up to a plane surface, > 1; None for none. The
        plane stands at the highest point of the relief, and the liquid does not absorb.
    micro_slope : rms slope, along any one direction, of relief too fine for the map, 0 to 0.5. Its slopes are
        Gaussian and add to those of the map at every meeting with light (`kernel.micro_facet`).
    film : thin layers on the surface, see `thin_film.Film`.
    measured_um : the heights with the noise of the instrument, where `heights_um` is without it
        (`surface.denoise`); same shape. Only `analysis.explain` looks at it.
    """

    heights_um: Array | None
    pitch_x_um: float = 1.0
    pitch_y_um: float = 1.0
    tiling: Tiling = "periodic"
    name: str = "face"
    max_missing: float = MISSING_LIMIT
    sealant_index: float | None = None
    micro_slope: float = 0.0
    film: Film | None = None
    measured_um: Array | None = None

    def __post_init__(self) -> None:
        if not 0.0 <= self.micro_slope <= 0.5:
            raise PhysicsError(f"{self.name}: micro_slope lies between 0 and 0.5, not at {self.micro_slope}.")
        if self.film is not None and self.sealant_index is not None:
            raise PhysicsError(f"{self.name}: a thin film under a liquid is not provided for; choose one.")
        if self.sealant_index is not None and not 1.0 < self.sealant_index < 5.0:
            raise PhysicsError(
                f"{self.name}: the index of a sealant lies between 1 and 5, not at {self.sealant_index}."
            )
        if self.heights_um is None:
            return
        h = np.asarray(self.heights_um, float)
        object.__setattr__(self, "heights_um", h)
        if h.ndim != 2 or min(h.shape) < 2:
            raise PhysicsError(
                f"{self.name}: a height map has two dimensions of at least 2 pixels, not {h.shape}."
            )
        if not (self.pitch_x_um > 0 and self.pitch_y_um > 0):
            raise PhysicsError(
                f"{self.name}: the pixel size must be positive, not {self.pitch_x_um} x {self.pitch_y_um} um."
            )
        if self.tiling not in ("periodic", "mirror", "blend"):
            raise PhysicsError(f"{self.name}: tiling must be periodic, mirror or blend, not {self.tiling!r}.")
        if self.tiling == "blend" and min(h.shape) < 16:
            raise PhysicsError(f"{self.name}: blend needs at least 16 x 16 pixels, not {h.shape}.")
        if not 0.0 <= self.max_missing <= 1.0:
            raise PhysicsError(f"{self.name}: max_missing is a share of 0 to 1, not {self.max_missing}.")
        if self.measured_um is not None and np.shape(self.measured_um) != h.shape:
            raise PhysicsError(
                f"{self.name}: measured_um is {np.shape(self.measured_um)}, the heights are {h.shape}."
            )

    @classmethod
    def flat(
        cls,
        name: str = "face",
        *,
        sealant_index: float | None = None,
        micro_slope: float = 0.0,
        film: Film | None = None,
    ) -> Self:
        """A flat face."""
        return cls(
            heights_um=None, name=name, sealant_index=sealant_index, micro_slope=micro_slope, film=film
        )

    @classmethod
    def from_map(
        cls,
        height_map: HeightMap,
        *,
        tiling: Tiling | None = None,
        name: str = "",
        max_missing: float = MISSING_LIMIT,
        sealant_index: float | None = None,
        micro_slope: float = 0.0,
        film: Film | None = None,
        denoise: bool | float = False,
    ) -> Self:
        """The face that a height map describes.

        `tiling` None repeats a map whose opposite edges meet as it is, and any other with its mirror image.
        `denoise` True takes the noise off that the map's `sigma_um` states, a number that many um of it.
        """
        noisy = None
        if denoise is not False:
            noisy = height_map.heights_um
            height_map = remove_noise(height_map, noise_um=None if denoise is True else denoise).surface
        return cls(
            heights_um=height_map.heights_um,
            pitch_x_um=height_map.pitch_x_um,
            pitch_y_um=height_map.pitch_y_um,
            tiling=tiling or tilings.choose(height_map.heights_um),
            name=name or height_map.name or "face",
            max_missing=max_missing,
            sealant_index=sealant_index,
            micro_slope=micro_slope,
            film=film,
            measured_um=noisy,
        )

    def as_measured(self) -> Self:
        """The face with the noise of its heights, where that was taken off."""
        return (
            self if self.measured_um is None else replace(self, heights_um=self.measured_um, measured_um=None)
        )

    @property
    def is_flat(self) -> bool:
        """True where there is no relief."""
        return self.heights_um is None

    def tile(self) -> Array:
        """One period of the relief: complete, relative to its mean, row 0 and column 0 at the origin.

        Warns with counts where pixels were filled, where a map said to be periodic does not close, and where
        the tiling changes the slopes.

        Returns
        -------
        heights : [ny, nx] in um; the column after the last is the first again, and so are the rows.
        """
        if self.heights_um is None:
            return np.zeros((1, 1))
        whole, count = self._filled()
        if count:
            warnings.warn(
                f"{self.name}: {count} missing pixels ({100 * count / whole.size:.2g} %) were filled from "
                "their surroundings.",
                SpeculariaWarning,
                stacklevel=2,
            )
        period = tilings.tiled(whole, self.tiling)
        if self.tiling == "periodic":
            tilings.warn_of_seam(whole, self.name)
        else:
            both = tilings.slopes(whole, period, pitch_x_um=self.pitch_x_um, pitch_y_um=self.pitch_y_um)
            before, after = (float(np.sqrt(np.mean(s**2))) for s in both)
            share = tilings.blended_share(whole.shape, self.tiling)
            if abs(after - before) > SLOPE_CHANGE * before:
                warnings.warn(
                    f"{self.name}: tiling = {self.tiling!r} changes the rms slope from {before:.4g} to "
                    f"{after:.4g} (blended: {100 * share:.2g} % of the area).",
                    SpeculariaWarning,
                    stacklevel=2,
                )
        return period

    def report(self) -> TilingReport:
        """What tiling does to the slopes of the map; a PhysicsError for a flat face."""
        whole, count = self._filled()
        return tilings.report(
            whole,
            tilings.tiled(whole, self.tiling),
            self.tiling,
            pitch_x_um=self.pitch_x_um,
            pitch_y_um=self.pitch_y_um,
            filled=count,
        )

    def _filled(self) -> tuple[Array, int]:
        """The map without gaps, filled by `surface.filled`, and how many pixels were missing."""
        if self.heights_um is None:
            raise PhysicsError(f"{self.name}: a flat face has no map.")
        gaps = HeightMap(self.heights_um, self.pitch_x_um, self.pitch_y_um, name=self.name)
        whole, count = filled(gaps, largest_share=self.max_missing)
        return whole.heights_um, count

    def cut(self, parts: int) -> list[list[Face]]:
        """parts x parts pieces of the map, [row][column], each tiled by mirror; a flat face stays flat.

        Rows and columns that are left over when the map is divided are given up.
        """
        if self.heights_um is None:
            return [[self] * parts for _ in range(parts)]
        whole, _ = self._filled()
        ny, nx = (n // parts for n in whole.shape)
        if min(ny, nx) < 2:
            raise PhysicsError(
                f"{self.name}: {self.heights_um.shape} pixels cannot be cut into {parts} x {parts}."
            )
        return [
            [
                replace(
                    self,
                    heights_um=whole[i * ny : (i + 1) * ny, j * nx : (j + 1) * nx],
                    measured_um=None,
                    tiling="mirror",
                    name=f"{self.name} [{i}, {j}]",
                )
                for j in range(parts)
            ]
            for i in range(parts)
        ]
