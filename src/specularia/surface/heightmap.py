"""The record of a measured relief, and what follows from it without any model."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

from specularia.errors import PhysicsError, SpeculariaError

__all__ = ["FLAGS", "HeightMap", "filled", "level", "plane", "rms_sigma"]

Array = NDArray[np.float64]

FLAGS: Final = {"saturated": 1, "dark": 2, "edge": 4, "double": 8, "steep": 16}
"""What can be wrong with a pixel of a focus stack, and its bit in `HeightMap.flags`."""


@dataclass(frozen=True)
class HeightMap:
    """Heights on a regular grid, [row = y, column = x], row 0 at the lowest y.

    Parameters
    ----------
    heights_um : [rows, columns], positive out of the glass as the microscope saw this face; NaN where nothing
        was measured. A profile is a map of one row.
    pitch_x_um, pitch_y_um : distance of neighbouring columns and rows, > 0; pitch_y_um is NaN for a profile.
    sigma_um : standard uncertainty of each height, same shape, where known.
    image : brightness in focus, same shape, where known.
    reliability : 0..1, same shape: the share of the focus peak by which it stands above the next one.
    flags : what is wrong with each pixel, same shape, unsigned 8-bit: sums of the values of `FLAGS`.
    name : for messages and captions.
    attributes : provenance, flat strings.
    """

    heights_um: Array
    pitch_x_um: float
    pitch_y_um: float
    sigma_um: Array | None = None
    image: Array | None = None
    name: str = ""
    attributes: Mapping[str, str] = field(default_factory=dict)
    reliability: Array | None = None
    flags: NDArray[np.uint8] | None = None

    def __post_init__(self) -> None:
        heights = np.ascontiguousarray(self.heights_um, dtype=np.float64)
        if heights.ndim != 2 or heights.size == 0:
            raise SpeculariaError(
                f"{self.name or 'height map'}: expected [row, column], found {heights.shape}."
            )
        object.__setattr__(self, "heights_um", heights)
        for key in ("sigma_um", "image", "reliability", "flags"):
            value = getattr(self, key)
            if value is not None and np.shape(value) != heights.shape:
                raise SpeculariaError(
                    f"{self.name or 'height map'}: {key} is {np.shape(value)}, the heights are "
                    f"{heights.shape}."
                )
        if not self.pitch_x_um > 0 or not (self.is_profile or self.pitch_y_um > 0):
            raise SpeculariaError(
                f"{self.name or 'height map'}: the pitch must be above 0 um, "
                f"found {self.pitch_x_um}, {self.pitch_y_um}."
            )

    @property
    def shape(self) -> tuple[int, int]:
        """(rows, columns)."""
        rows, columns = self.heights_um.shape
        return rows, columns

    @property
    def is_profile(self) -> bool:
        """True for a single row, which has no extent in y."""
        return self.heights_um.shape[0] == 1

    @property
    def field_um(self) -> tuple[float, float]:
        """Extent (x, y): number of pixels times pitch; the y extent of a profile is NaN."""
        rows, columns = self.shape
        return columns * self.pitch_x_um, float("nan") if self.is_profile else rows * self.pitch_y_um

    @property
    def valid(self) -> NDArray[np.bool_]:
        """True where a height was measured."""
        return np.isfinite(self.heights_um)

    @property
    def missing(self) -> int:
        """Number of pixels without a height."""
        return int(self.heights_um.size - np.count_nonzero(self.valid))

    @property
    def range_um(self) -> float:
        """Highest minus lowest measured height; NaN where nothing was measured."""
        measured = self.heights_um[self.valid]
        return float(np.ptp(measured)) if measured.size else float("nan")

    @property
    def x_um(self) -> Array:
        """Column positions, the first at 0."""
        return np.arange(self.shape[1], dtype=np.float64) * self.pitch_x_um

    @property
    def y_um(self) -> Array:
        """Row positions, the first and lowest at 0."""
        return np.arange(self.shape[0], dtype=np.float64) * (0.0 if self.is_profile else self.pitch_y_um)

    def with_heights(self, heights_um: Array, **attributes: str) -> HeightMap:
        """The same grid with other heights; attributes are added to the ones that stand."""
        return replace(self, heights_um=heights_um, attributes={**self.attributes, **attributes})


def plane(surface: HeightMap) -> tuple[float, float, float]:
    """Least-squares plane z = c + a x + b y through the measured pixels, as (c in um, a, b).

    x and y are counted from the first column and the lowest row. b is 0 for a profile.
    """
    valid = surface.valid
    if np.count_nonzero(valid) < 3:
        raise PhysicsError(f"{surface.name or 'height map'}: fewer than 3 measured pixels; no plane fits.")
    rows, columns = surface.shape
    x = np.broadcast_to(surface.x_um, (rows, columns))[valid]
    y = np.broadcast_to(surface.y_um[:, None], (rows, columns))[valid]
    z = surface.heights_um[valid]
    mx, my, mz = x.mean(), y.mean(), z.mean()
    x, y, z = x - mx, y - my, z - mz
    xx, yy, xy, xz, yz = x @ x, y @ y, x @ y, x @ z, y @ z
    if surface.is_profile:
        a, b = (xz / xx if xx > 0 else 0.0), 0.0
    else:
        determinant = xx * yy - xy * xy
        if not determinant > 1e-12 * xx * yy:
            raise PhysicsError(
                f"{surface.name or 'height map'}: the measured pixels lie on one line; no plane fits."
            )
        a = (xz * yy - yz * xy) / determinant
        b = (yz * xx - xz * xy) / determinant
    return float(mz - a * mx - b * my), float(a), float(b)


def level(surface: HeightMap) -> HeightMap:
    """The map minus its least-squares plane (missing pixels stay missing).

    Reference: the F-operation by total levelling of ISO 25178-2, with vertical instead of orthogonal
    distances (they differ by the cosine of the tilt).

    >>> y, x = np.mgrid[0:4, 0:5]
    >>> flat = level(HeightMap(7.0 + 0.1 * x - 0.2 * y, pitch_x_um=1.0, pitch_y_um=1.0))
    >>> bool(abs(flat.heights_um).max() < 1e-12)
    True
    """
    c, a, b = plane(surface)
    fitted = c + a * surface.x_um[None, :] + b * surface.y_um[:, None]
    return surface.with_heights(
        surface.heights_um - fitted, levelled=f"plane removed: slope x {a:.6g}, slope y {b:.6g}"
    )


def filled(surface: HeightMap, *, largest_share: float = 0.2) -> tuple[HeightMap, int]:
    """The map with its missing pixels interpolated, and how many there were.

    Missing heights are the solution of Laplace's equation with the measured neighbours as boundary values (a
    soap film): it makes no new hills or pits and meets the measured pixels. `sigma_um` stays NaN there, so
    they can still be told apart. Method: ours.

    Parameters
    ----------
    surface : any height map.
    largest_share : above this share of missing pixels the map is refused, since what is traced would then be
        interpolation rather than measurement.

    Raises
    ------
    PhysicsError : too many pixels are missing.
    """
    from specularia.surface.inpaint import soap_film

    missing = surface.missing
    share = missing / surface.heights_um.size
    if share > largest_share or missing == surface.heights_um.size:
        raise PhysicsError(
            f"{surface.name or 'height map'}: {missing} of {surface.heights_um.size} pixels "
            f"({share:.0%}) are missing; at most {largest_share:.0%} are interpolated. "
            "Measure again or cut out a whole part."
        )
    if missing == 0:
        return surface, 0
    heights = soap_film(surface.heights_um, pitch_x=surface.pitch_x_um, pitch_y=surface.pitch_y_um)
    sigma = surface.sigma_um
    if sigma is not None:
        sigma = np.where(surface.valid, sigma, np.nan)
    done = replace(surface, heights_um=heights, sigma_um=sigma)
    return replace(done, attributes={**surface.attributes, "interpolated_pixels": str(missing)}), missing


def rms_sigma(surface: HeightMap) -> float:
    """Root mean square of the standard uncertainties in um; NaN where the map has none."""
    if surface.sigma_um is None:
        return float("nan")
    known = surface.sigma_um[np.isfinite(surface.sigma_um)]
    return float(np.sqrt(np.mean(known**2))) if known.size else float("nan")
