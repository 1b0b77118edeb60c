"""Heights without the instrument's noise, as far as the noise itself says what may be smoothed.

Noise of a few nanometres from pixel to pixel is small as a height and large as a slope: at a pitch of 1.5 um,
0.012 um of it tilt every facet by half a degree, and rays take that for relief. Around every pixel a
quadratic is fitted in windows of several sizes. A window in which the residuals are no larger than the noise
holds nothing finer than the quadratic, and its fit is kept; a pixel takes the mean of all kept fits that
cover it. Edges, where no window fits, stay as they were measured. The rule is that of adaptive local
polynomials (Katkovnik, Egiazarian and Astola 2006, doi:10.1117/3.660178), with a test of the residuals in
place of intersecting intervals, and windows that need not be centred.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

from specularia.errors import PhysicsError
from specularia.surface.heightmap import HeightMap

__all__ = ["Denoised", "denoise"]

Array = NDArray[np.float64]

WINDOWS: Final = (3, 5, 7, 11, 15)
"""Sides of the square windows, pixels."""

_TERMS: Final = ((0, 0), (0, 1), (1, 0), (0, 2), (1, 1), (2, 0))

_STRICTNESS: Final = 2.0
"""Standard deviations above its mean up to which a sum of squared residuals is noise alone."""


@dataclass(frozen=True)
class Denoised:
    """A map without its noise.

    Attributes
    ----------
    surface : heights, and in `sigma_um` what is left of their error; no less than it is, since windows that
        overlap are taken to err together.
    noise_um : root mean square of the noise that was assumed.
    smoothed_share : of the measured pixels, those in one window at least that was kept.
    removed_um : root mean square of what was taken off.
    """

    surface: HeightMap
    noise_um: float
    smoothed_share: float
    removed_um: float


def denoise(surface: HeightMap, *, noise_um: float | None = None) -> Denoised:
    """Take the noise off a map where it stands out from the relief.

    Parameters
    ----------
    surface : with independent noise from pixel to pixel. Missing pixels stay missing.
    noise_um : standard deviation of the noise, > 0; None takes `surface.sigma_um`. A map does not tell its
        noise from its finest relief, so one of the two must be known.

    Returns
    -------
    Denoised : relief finer than three pixels that is no larger than the noise is lost with it.
    """
    name = surface.name or "height map"
    if surface.is_profile or min(surface.shape) < WINDOWS[0]:
        raise PhysicsError(
            f"{name}: noise is taken off maps of {WINDOWS[0]} x {WINDOWS[0]} pixels at least, not "
            f"{surface.shape[0]} x {surface.shape[1]}."
        )
    if noise_um is not None:
        if not 0.0 < noise_um < float("inf"):
            raise PhysicsError(f"{name}: noise is above 0 um, not {noise_um:g}.")
        variance = np.full(surface.shape, noise_um**2)
    elif surface.sigma_um is not None:
        variance = np.asarray(surface.sigma_um, float) ** 2
    else:
        raise PhysicsError(
            f"{name}: the file does not say how uncertain its heights are; state the noise of the instrument."
        )
    valid = surface.valid & np.isfinite(variance) & (variance > 0.0)
    if not valid.any():
        raise PhysicsError(f"{name}: nowhere is the uncertainty of a height above 0; state the noise.")
    offset = float(surface.heights_um[valid].mean())
    h = np.where(valid, surface.heights_um - offset, 0.0)
    variance = np.where(valid, variance, 0.0)
    total, weight, spread = (np.zeros(surface.shape) for _ in range(3))
    for side in WINDOWS:
        if side > min(surface.shape):
            break
        basis, terms, squares = _fits(h, side)
        mean = _box(variance, side) / side**2
        freedom = side**2 - len(_TERMS)
        kept = squares <= mean * (freedom + _STRICTNESS * np.sqrt(2.0 * freedom))
        kept &= _whole(valid, side)
        mine = np.where(kept, side**2 / len(_TERMS), 0.0) / np.where(kept, mean, 1.0)
        for term, (i, j) in zip(terms, _TERMS):
            total += _spread(mine * term, basis[i], basis[j])
        weight += _box(mine, side)
        shape = sum(np.outer(basis[i], basis[j]) ** 2 for i, j in _TERMS)
        spread += _correlated(mine * np.sqrt(mean), np.sqrt(np.asarray(shape)))
    smooth = weight > 0.0
    safe = np.where(smooth, weight, 1.0)
    heights = np.where(smooth, total / safe + offset, surface.heights_um)
    sigma = np.where(smooth, spread / safe, np.sqrt(variance))
    measured = surface.valid
    sigma = np.where(valid, sigma, np.nan)
    noise = float(np.sqrt(np.mean(variance[valid])))
    removed = float(np.sqrt(np.mean((heights - surface.heights_um)[measured] ** 2)))
    made = surface.with_heights(heights, noise_removed=f"{noise:.4g} um")
    return Denoised(
        surface=replace(made, sigma_um=sigma),
        noise_um=noise,
        smoothed_share=float(np.mean(smooth[measured])),
        removed_um=removed,
    )


def _fits(h: Array, side: int) -> tuple[Array, list[Array], Array]:
    """Polynomials [3, side], terms of the quadratic around each pixel, and its sum of squared residuals."""
    x = np.arange(side) - 0.5 * (side - 1)
    basis = np.linalg.qr(np.stack([x**0, x, x * x], axis=1))[0].T
    rows = [_along(h, p, 0) for p in basis]
    terms = [_along(rows[i], basis[j], 1) for i, j in _TERMS]
    squares = _box(h * h, side)
    for term in terms:
        squares -= term * term
    return basis, terms, squares


def _along(values: Array, kernel: Array, axis: int) -> Array:
    from scipy.ndimage import correlate1d

    return np.asarray(correlate1d(values, kernel, axis=axis, mode="constant"))


def _spread(values: Array, down: Array, across: Array) -> Array:
    """Each window's value times its polynomial, added up over all windows that cover a pixel."""
    return _along(_along(values, down[::-1], 0), across[::-1], 1)


def _box(values: Array, side: int) -> Array:
    ones = np.ones(side)
    return _along(_along(values, ones, 0), ones, 1)


def _correlated(values: Array, kernel: Array) -> Array:
    """Correlation with a kernel that is symmetric both ways."""
    from scipy.ndimage import correlate

    return np.asarray(correlate(values, kernel, mode="constant"))


def _whole(valid: NDArray[np.bool_], side: int) -> NDArray[np.bool_]:
    """Where a window lies in the map and misses nothing."""
    return np.asarray(_box(valid.astype(float), side) > side**2 - 0.5)
