"""The two faces of a pane: a flat plane, or a height map that is made to repeat."""

from __future__ import annotations

import warnings
from dataclasses import dataclass
from typing import Literal, Self

import numpy as np
from numpy.typing import NDArray

from specularia.errors import PhysicsError, SpeculariaWarning
from specularia.surface.heightmap import HeightMap, filled

__all__ = ["MISSING_LIMIT", "Face", "Tiling"]

Array = NDArray[np.float64]
Tiling = Literal["periodic", "mirror", "blend"]

MISSING_LIMIT = 0.05
"""Largest share of missing pixels that is filled; a map with more is refused."""

BLEND_SHARE = 0.125
"""Share of the field's width over which `blend` joins opposite edges."""

SEAM_LIMIT = 3.0
"""A periodic map whose steps across the seam exceed its steps inside by this factor is warned about."""


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
    """

    heights_um: Array | None
    pitch_x_um: float = 1.0
    pitch_y_um: float = 1.0
    tiling: Tiling = "periodic"
    name: str = "face"

    def __post_init__(self) -> None:
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

    @classmethod
    def flat(cls, name: str = "face") -> Self:
        """A flat face."""
        return cls(heights_um=None, name=name)

    @classmethod
    def from_map(cls, height_map: HeightMap, *, tiling: Tiling = "periodic", name: str = "") -> Self:
        """The face that a height map describes."""
        return cls(
            heights_um=height_map.heights_um,
            pitch_x_um=height_map.pitch_x_um,
            pitch_y_um=height_map.pitch_y_um,
            tiling=tiling,
            name=name or height_map.name or "face",
        )

    @property
    def is_flat(self) -> bool:
        """True where there is no relief."""
        return self.heights_um is None

    def tile(self) -> Array:
        """One period of the relief: complete, relative to its mean, row 0 and column 0 at the origin.

        Returns
        -------
        heights : [ny, nx] in um; the column after the last is the first again, and so are the rows.
        """
        if self.heights_um is None:
            return np.zeros((1, 1))
        h = fill(self.heights_um, pitch_x_um=self.pitch_x_um, pitch_y_um=self.pitch_y_um, name=self.name)
        if self.tiling == "mirror":
            h = np.concatenate([h, h[-2:0:-1]], axis=0)
            h = np.concatenate([h, h[:, -2:0:-1]], axis=1)
        elif self.tiling == "blend":
            h = _join(_join(h - h.mean()).T).T
        else:
            _check_seam(h, self.name)
        return np.ascontiguousarray(h - h.mean())


def fill(heights_um: Array, *, pitch_x_um: float = 1.0, pitch_y_um: float = 1.0, name: str = "map") -> Array:
    """Heights without gaps, filled by `surface.filled`.

    Warns with the count; refuses a map of which more than the share `MISSING_LIMIT` is missing.
    """
    gaps = HeightMap(heights_um, pitch_x_um, pitch_y_um, name=name)
    whole, count = filled(gaps, largest_share=MISSING_LIMIT)
    if count:
        warnings.warn(
            f"{name}: {count} missing pixels ({100 * count / heights_um.size:.2g} %) were filled from their "
            "surroundings.",
            SpeculariaWarning,
            stacklevel=3,
        )
    return whole.heights_um


def _join(h: Array) -> Array:
    """Join the first rows of a zero-mean map with its last ones, and drop the last ones."""
    k = max(2, round(BLEND_SHARE * h.shape[0]))
    a = 0.5 * np.pi * (np.arange(k) + 0.5)[:, None] / k
    head = np.sin(a) * h[:k] + np.cos(a) * h[-k:]
    return np.concatenate([head, h[k:-k]], axis=0)


def _check_seam(h: Array, name: str) -> None:
    """Warn where a map does not go on smoothly from its last row or column to its first."""
    for axis, word in ((0, "top and bottom"), (1, "left and right")):
        inside = float(np.sqrt(np.mean(np.diff(h, axis=axis) ** 2)))
        seam = float(np.sqrt(np.mean((np.take(h, 0, axis) - np.take(h, -1, axis)) ** 2)))
        if seam > SEAM_LIMIT * inside and seam > 1e-6:
            warnings.warn(
                f"{name}: repeated as it is, the {word} edges do not meet (steps of {seam:.3g} um across the "
                f"seam, {inside:.3g} um inside); tiling = 'mirror' or 'blend' avoids the false cliff.",
                SpeculariaWarning,
                stacklevel=4,
            )
