"""Power spectra, autocorrelation and direction of a levelled map.

Frequencies are in waves per um (1 / wavelength), power spectral densities such that their integral over
frequency is the mean square height.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from specularia.surface.heightmap import HeightMap, filled

__all__ = ["Spacing", "Spectrum", "autocorrelation", "power_spectrum", "spacing"]

Array = NDArray[np.float64]

_FALL = 0.2
"""Autocorrelation that Sal and Str are read at, the default of ISO 25178-2."""


@dataclass(frozen=True)
class Spacing:
    """Spacing parameters.

    Parameters
    ----------
    Sal_um : shortest distance at which the autocorrelation falls to 0.2.
    Str : Sal over the longest such distance, 0 (one direction) to 1 (all alike).
    bounded : True where the autocorrelation does not fall that far within half of the field in some
        direction: Str is then an upper bound.
    Std_deg : direction of the lay, counter-clockwise from x, 0..180: across the direction in which the
        spectrum holds most. It says little where Str is near 1.
    angle_deg, distance_um : the distance in each direction, infinite where it is not reached.
    angular : spectrum over direction (of the waves, not the lay) at these angles, its largest value 1.
    """

    Sal_um: float
    Str: float
    bounded: bool
    Std_deg: float
    angle_deg: Array
    distance_um: Array
    angular: Array


@dataclass(frozen=True)
class Spectrum:
    """Power spectral densities.

    Parameters
    ----------
    frequency_per_um, radial_um4 : mean of the two-dimensional density over rings of one frequency.
    x_per_um, x_um3 : density along x, mean over the rows; one-sided.
    y_per_um, y_um3 : along y; empty for a profile.
    window : name of the window that was laid over the map.
    """

    frequency_per_um: Array
    radial_um4: Array
    x_per_um: Array
    x_um3: Array
    y_per_um: Array
    y_um3: Array
    window: str


def _whole(surface: HeightMap) -> Array:
    done, _ = filled(surface)
    z = done.heights_um
    return np.asarray(z - z.mean())


def power_spectrum(surface: HeightMap, *, window: str = "hann") -> Spectrum:
    """Power spectral densities of a levelled map.

    Parameters
    ----------
    surface : levelled; gaps of up to 20 % are bridged by a soap film, more are refused.
    window : "hann", or "none" for periodic maps. A window keeps the ends of the map, which do not meet, from
        adding a false f^-2; its loss of power is made up for.

    References
    ----------
    Jacobs, Junge, Pastewka (2017), Quantitative characterization of surface topography using spectral
    analysis, doi:10.1088/2051-672X/aa51f8 (their C_iso and C_1D, with frequency in place of 2 pi times it).
    """
    z = _whole(surface)
    rows, columns = z.shape
    dx = surface.pitch_x_um
    dy = 1.0 if surface.is_profile else surface.pitch_y_um

    def taper(n: int) -> Array:
        if window == "none" or n < 4:
            return np.ones(n)
        return 0.5 - 0.5 * np.cos(2 * np.pi * (np.arange(n) + 0.5) / n)

    def along(lines: Array, pitch: float) -> tuple[Array, Array]:
        n = lines.shape[1]
        w = taper(n)
        power = (np.abs(np.fft.rfft(lines * w, axis=1)) ** 2).mean(axis=0) * pitch / np.sum(w * w)
        power[1 : (n + 1) // 2] *= 2.0  # the negative frequencies
        return np.asarray(np.fft.rfftfreq(n, pitch)[1:], float), np.asarray(power[1:], float)

    x_per_um, x_um3 = along(z, dx)
    if surface.is_profile:
        none = np.zeros(0)
        return Spectrum(none, none, x_per_um, x_um3, none, none, window)
    y_per_um, y_um3 = along(z.T, dy)
    both = taper(rows)[:, None] * taper(columns)[None, :]
    power = np.abs(np.fft.rfft2(z * both)) ** 2 * (dx * dy / np.sum(both * both))
    fx, fy = np.fft.rfftfreq(columns, dx), np.fft.fftfreq(rows, dy)
    f = np.hypot(fx[None, :], fy[:, None])
    # Columns but the first (and the last of an even number) stand for two.
    twice = np.full(fx.size, 2.0)
    twice[0] = 1.0
    if columns % 2 == 0:
        twice[-1] = 1.0
    step = max(1.0 / (columns * dx), 1.0 / (rows * dy))
    nyquist = min(0.5 / dx, 0.5 / dy)
    ring = np.rint(f / step).astype(np.int64)
    weight = np.broadcast_to(twice, f.shape).ravel()
    count = np.bincount(ring.ravel(), weight)
    total = np.bincount(ring.ravel(), weight * power.ravel())
    place = np.bincount(ring.ravel(), weight * f.ravel())
    keep = np.flatnonzero((count > 0) & (np.arange(count.size) * step <= nyquist))[1:]
    return Spectrum(
        place[keep] / count[keep], total[keep] / count[keep], x_per_um, x_um3, y_per_um, y_um3, window
    )


def autocorrelation(surface: HeightMap) -> Array:
    """Autocorrelation of a levelled map, [lag y, lag x], at lags from -half to +half of the field.

    Each lag is averaged over the pairs of pixels that it has: no wrap-around, no bias towards zero; missing
    pixels make no pairs.
    """
    from scipy import fft

    z = surface.heights_um - np.nanmean(surface.heights_um)
    known = np.isfinite(z)
    rows, columns = z.shape
    size = (
        fft.next_fast_len(rows + rows // 2, real=True),
        fft.next_fast_len(columns + columns // 2, real=True),
    )

    def correlated(a: Array) -> Array:
        return np.asarray(fft.irfft2(np.abs(fft.rfft2(a, size)) ** 2, size))

    pairs = correlated(known.astype(np.float64))
    total = correlated(np.where(known, z, 0.0))
    y, x = np.arange(-(rows // 2), rows // 2 + 1), np.arange(-(columns // 2), columns // 2 + 1)
    pick = np.ix_(y % size[0], x % size[1])
    out = total[pick] / np.maximum(pairs[pick], 0.5)
    return np.asarray(out / out[rows // 2, columns // 2])


def spacing(surface: HeightMap) -> Spacing:
    """Sal, Str and Std of a levelled map.

    References
    ----------
    ISO 25178-2:2021 (autocorrelation length, texture aspect ratio, texture direction).
    """
    from scipy.ndimage import map_coordinates, uniform_filter1d

    dx, dy = surface.pitch_x_um, surface.pitch_y_um
    acf = autocorrelation(surface)
    middle = np.array(acf.shape) // 2
    longest = min(middle[1] * dx, middle[0] * dy)
    radius = np.arange(0.0, longest, 0.5 * min(dx, dy))
    angle = np.arange(0.0, 180.0, 1.0)
    cos, sin = np.cos(np.radians(angle))[:, None], np.sin(np.radians(angle))[:, None]
    rays = map_coordinates(acf, [middle[0] + sin * radius / dy, middle[1] + cos * radius / dx], order=1)
    below = rays < _FALL
    reached = below.any(axis=1)
    k = np.maximum(np.argmax(below, axis=1), 1)
    row = np.arange(angle.size)
    before, after = rays[row, k - 1], rays[row, k]
    share = np.clip((before - _FALL) / np.maximum(before - after, 1e-12), 0.0, 1.0)
    distance = np.where(reached, radius[k - 1] + share * (radius[1] - radius[0]), np.inf)
    shortest = float(distance.min())
    widest = float(distance.max()) if reached.all() else float(longest)

    z = _whole(surface)
    rows, columns = z.shape
    w = [0.5 - 0.5 * np.cos(2 * np.pi * (np.arange(n) + 0.5) / n) for n in z.shape]
    power = np.fft.fftshift(np.abs(np.fft.fft2(z * w[0][:, None] * w[1][None, :])) ** 2)
    # From two waves per field on, below which the window blurs all directions into one.
    lowest, nyquist = 2.0 / min(columns * dx, rows * dy), min(0.5 / dx, 0.5 / dy)
    f = np.arange(lowest, nyquist, 0.5 / max(columns * dx, rows * dy))
    at = [rows // 2 + sin * f * (rows * dy), columns // 2 + cos * f * (columns * dx)]
    angular = uniform_filter1d((map_coordinates(power, at, order=1) * f).sum(axis=1), 5, mode="wrap")
    return Spacing(
        Sal_um=shortest if np.isfinite(shortest) else float("nan"),
        Str=shortest / widest if np.isfinite(shortest) else float("nan"),
        bounded=not bool(reached.all()),
        Std_deg=float((angle[int(np.argmax(angular))] + 90.0) % 180.0),
        angle_deg=angle,
        distance_um=distance,
        angular=angular / max(float(angular.max()), 1e-300),
    )
