"""Pixels in which more than one surface answers: a second peak, or two that have run into one.

At a step, a pixel's footprint covers an upper and a lower level, and its brightness has a peak at each.
Farther apart than about one width of the response they stand alone; nearer, they merge into one broad peak
whose top is neither level. Kernels on plain arrays; z in slices. The method is ours: a matched filter of what
the fit leaves.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from specularia.surface.focus import FWHM_PER_SIGMA, Noise, Peaks, Response

__all__ = ["broadened", "second_peak"]

Array = NDArray[np.float64]

_APART = 1.1
"""Distance from which two peaks stand alone, in widths at half maximum."""


def second_peak(
    brightness: NDArray[np.float32], base: Array, peaks: Peaks, response: Response, noise: Noise
) -> tuple[Array, Array]:
    """The largest peak that is left beside the fitted one.

    The fitted peak is taken away and the rest is filtered with the response: the height of a peak at z is the
    least-squares one, sum(g r) / sum(g^2), its error the noise over sqrt(sum(g^2)).

    Parameters
    ----------
    brightness : [slices, N].
    base : [N] background.
    peaks, response, noise : of the fit.

    Returns
    -------
    share : [N] its height over that of the fitted peak, 0 where nothing is left.
    significance : [N] its height over its own noise.
    """
    from scipy.ndimage import correlate1d

    slices, width = brightness.shape[0], response.width
    # A peak broader than the typical one is taken away as broad as it is: what is left is not part of it.
    shape, _ = response.at(peaks.u * peaks.width / np.clip(peaks.width, 0.8 * width, 1.2 * width))
    rest = np.zeros((slices + 1, brightness.shape[1]), np.float32)
    np.subtract(brightness, base.astype(np.float32), out=rest[:slices])
    # The row that was added takes what is outside.
    index = np.where((peaks.index >= 0) & (peaks.index < slices), peaks.index, slices)
    without = np.take_along_axis(rest, index, axis=0) - (peaks.height * shape).astype(np.float32)
    np.put_along_axis(rest, index, without, axis=0)
    rest = rest[:slices]
    half = int(np.ceil(2.5 * width))
    kernel = response.at(np.arange(-half, half + 1) / width)[0].astype(np.float32)
    energy = float(np.sum(kernel.astype(np.float64) ** 2))
    height = correlate1d(rest, kernel / energy, axis=0, mode="constant")
    every = np.arange(slices, dtype=np.float32)[:, None]
    height[np.abs(every - peaks.place.astype(np.float32)) < _APART * FWHM_PER_SIGMA * width] = -np.inf
    found = height.max(axis=0).astype(np.float64)
    found = np.where(np.isfinite(found), np.maximum(found, 0.0), 0.0)
    share = found / np.maximum(peaks.height, 1e-30)
    return share, found / np.sqrt(noise.variance(base + found) / energy)


def broadened(peaks: Peaks, *, typical: float, scatter: float, least: float) -> NDArray[np.bool_]:
    """Whether a peak is broader than the response can be, beyond chance.

    Two peaks of shares p and 1 - p, d apart, have the variance w^2 + p (1 - p) d^2: the peak is at least as
    broad as 1.2 w where equal peaks are 1.3 w apart.

    Parameters
    ----------
    peaks : fits.
    typical, scatter : median width of good peaks, and what it varies by beside the noise of the fits
    (slices).
    least : width over typical that is never called broad.
    """
    error = np.sqrt(np.maximum(peaks.covariance[2][2], 0.0) + scatter**2)
    return (peaks.width > least * typical) & (peaks.width > typical + 4.5 * error)
