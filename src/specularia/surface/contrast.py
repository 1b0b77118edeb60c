"""Stacks of photographs: heights from where each place is sharpest, and one picture in focus everywhere.

A photograph keeps its brightness out of focus and loses its detail. So the frames are first laid over each
other (`registration`), then each gets a measure of sharpness, the modified Laplacian (Nayar and Nakagawa
1994, doi:10.1109/34.308479) squared and averaged over a small window, and the height is that of its peak
along z: a Gaussian through the samples around the largest one, by least squares of logarithms, with the
background of sharpness (noise of the camera, detail of all depths) taken away first.
"""

from __future__ import annotations

import tempfile
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from specularia import progress
from specularia.errors import PhysicsError
from specularia.surface.heightmap import FLAGS
from specularia.surface.registration import Similarity, between, chained, warped
from specularia.surface.stack import Stack, release

__all__ = ["Focused", "measure", "picture", "rows_of", "scatter", "sharpness"]

Array = NDArray[np.float64]
Image = NDArray[np.float32]

RIVAL = 0.7
"""A second peak of sharpness of at least this share of the first leaves the height open."""

_LEAST_RATIO = 3.0
"""Peak of sharpness over its background below which a place has no detail to be judged by."""

_SHAPE = 0.05
"""Error of a height in slices, since the curve of sharpness is not quite a Gaussian."""

_SCATTER_WINDOW = 3.0
"""Neighbourhood that the uncertainty of a height is judged in, in widths of the window of sharpness."""


@dataclass(frozen=True)
class Focused:
    """A stack whose frames lie over each other, with the sharpness of each; both lie in nameless files.

    Parameters
    ----------
    frames : [slices, rows, columns] or with colours at the end; 32-bit floats.
    sharp : [slices, rows, columns].
    places : where the frames were, relative to the middle one.
    window : standard deviation of the window of sharpness in pixels.
    noise : sharpness of the noise of a picture.
    saturation : brightness at which the camera clips.
    """

    frames: NDArray[np.float32]
    sharp: NDArray[np.float32]
    places: tuple[Similarity, ...]
    window: float
    noise: float
    saturation: float


def sharpness(image: Image, window: float) -> Image:
    """Mean square of the modified Laplacian |d2/dx2| + |d2/dy2| under a Gaussian of `window` pixels."""
    from scipy.ndimage import correlate1d, gaussian_filter

    second = np.array([1.0, -2.0, 1.0], np.float32)
    laplacian = np.abs(correlate1d(image, second, axis=0)) + np.abs(correlate1d(image, second, axis=1))
    return gaussian_filter(laplacian * laplacian, window, truncate=3.0).astype(np.float32)


def measure(stack: Stack, *, window: float = 3.0, register: bool = True) -> Focused:
    """Register the frames of a stack of photographs and measure their sharpness.

    Parameters
    ----------
    stack : frames in order of height; the middle one stays where it is.
    window : standard deviation of the window of sharpness, pixels.
    register : False for frames that lie over each other as they are.
    """
    slices, (rows, columns) = stack.slices, stack.shape
    if min(rows, columns) < 64:
        raise PhysicsError(f"{stack.name}: photographs need at least 64 x 64 pixels, not {rows} x {columns}.")
    places = [Similarity()] * slices
    with progress.task(f"frames of {stack.name} laid over each other", slices) as bar:
        if register:
            pairs, last = [], stack.frame(0)
            for k in range(1, slices):
                frame = stack.frame(k)
                pairs.append(between(last, frame))
                last = frame
                stack.release()
                bar.advance()
            places = chained(pairs, slices // 2)
    for k, place in enumerate(places):
        if max(abs(place.a), abs(place.b)) > 0.3 or max(abs(place.dx) / columns, abs(place.dy) / rows) > 0.3:
            raise PhysicsError(
                f"{stack.name}: frame {k + 1} does not lie over the middle one (shift {place.dx:.0f}, "
                f"{place.dy:.0f} pixels, magnification {1 + place.a:.3f}). "
                "Is this a focus stack, and do all frames show the same?"
            )
    colours = stack.frames.shape[3:]
    frames = _on_disk((slices, rows, columns, *colours))
    sharp = _on_disk((slices, rows, columns))
    whole = stack.frames.dtype.kind in "ui"
    top = float(np.iinfo(stack.frames.dtype).max) if whole else np.inf
    noise = []
    with progress.task(f"sharpness of {stack.name}", slices) as bar:
        for k, place in enumerate(places):
            raw = np.asarray(stack.frames[k], np.float32)
            still = place == Similarity()
            grey = raw.mean(axis=2) if colours else raw
            # Judged before the frame is moved: interpolation would blur it.
            # A frame that shows the scene m times as large shows second derivatives m^-2 times as large.
            judged = sharpness(grey, window) * np.float32((1.0 + place.a) ** 4)
            sharp[k] = judged if still else warped(judged, place, order=1)
            if not colours:
                frames[k] = raw if still else warped(raw, place)
            for c in range(colours[0] if colours else 0):
                frames[k, ..., c] = raw[..., c] if still else warped(raw[..., c], place)
            # The noise of the camera is what is left where nothing is sharp.
            noise.append(float(np.quantile(sharp[k][::4, ::4], 0.05)))
            release(frames)
            release(sharp)
            stack.release()
            bar.advance()
    return Focused(frames, sharp, tuple(places), window, max(float(np.median(noise)), 1e-12), top)


def rows_of(focused: Focused, first: int, last: int) -> Mapping[str, NDArray[Any]]:
    """Heights of rows first..last-1, [rows, columns] each, as those of `confocal.rows_of`."""
    sharp = np.asarray(focused.sharp[:, first:last])
    frames = np.asarray(focused.frames[:, first:last])
    slices = sharp.shape[0]
    peak = np.argmax(sharp, axis=0)
    base = sharp.min(axis=0)
    top = np.take_along_axis(sharp, peak[None], 0)[0]
    place = _gaussian_peak(sharp, peak, base)
    inside = (peak > 0) & (peak < slices - 1)
    # A rival is a second maximum of its own: sharpness has to fall and rise again on the way to it.
    rival = np.zeros_like(top)
    for side in (1, -1):
        low, best = top.copy(), np.zeros_like(top)
        for k in range(1, slices):
            index = peak + side * k
            value = np.take_along_axis(sharp, np.clip(index, 0, slices - 1)[None], 0)[0]
            exists = (index >= 0) & (index < slices)
            low = np.where(exists, np.minimum(low, value), low)
            again = exists & (value - low > 0.25 * (top - base))
            best = np.where(again, np.maximum(best, value - base), best)
        rival = np.maximum(rival, best)
    share = rival / np.maximum(top - base, 1e-30)
    grey = frames.mean(axis=3) if frames.ndim == 4 else frames
    darkest = frames.min(axis=3) if frames.ndim == 4 else frames
    clipped = np.take_along_axis(darkest, peak[None], 0)[0] >= 0.999 * focused.saturation
    faults = {
        "saturated": clipped,
        "dark": (top < _LEAST_RATIO * np.maximum(base, 1e-30)) | (top < _LEAST_RATIO * focused.noise),
        "edge": ~inside,
        "double": share >= RIVAL,
    }
    flags = np.zeros(peak.shape, np.uint8)
    for name, fault in faults.items():
        flags |= np.where(fault, np.uint8(FLAGS[name]), np.uint8(0))
    return {
        "place": np.where(flags > 0, np.nan, place),
        "image": _blend(grey, sharp),
        "reliability": np.clip(1.0 - share, 0.0, 1.0),
        "flags": flags,
    }


def scatter(place: Array, window: float) -> Array:
    """Standard uncertainty of heights: how they scatter about a smooth surface; NaN where there is none.

    The neighbourhood is wider than the window of sharpness, within which heights share their errors; relief
    that it does not follow counts as uncertainty, since the window cannot resolve it either.
    """
    from scipy.ndimage import gaussian_filter

    width = _SCATTER_WINDOW * window
    known = np.isfinite(place)
    weight = gaussian_filter(known.astype(np.float64), width)
    smooth = gaussian_filter(np.where(known, place, 0.0), width) / np.maximum(weight, 1e-9)
    square = gaussian_filter(np.where(known, (place - smooth) ** 2, 0.0), width) / np.maximum(weight, 1e-9)
    return np.where(known, np.sqrt(np.maximum(square, 0.0) + _SHAPE**2), np.nan)


def picture(focused: Focused) -> NDArray[np.float32]:
    """The picture in focus everywhere, [row, column(, colour)]: the frames, weighted by sharpness."""
    rows = focused.sharp.shape[1]
    out = np.empty(focused.frames.shape[1:], np.float32)
    step = max(1, (32 << 20) // (4 * focused.frames[:, :1].size))
    for first in range(0, rows, step):
        last = min(first + step, rows)
        part, sharp = np.asarray(focused.frames[:, first:last]), np.asarray(focused.sharp[:, first:last])
        out[first:last] = _blend(part, sharp)
        release(focused.frames)
        release(focused.sharp)
    return out


def _blend(frames: NDArray[np.float32], sharp: NDArray[np.float32]) -> NDArray[np.float32]:
    # The fourth power lets the sharpest frame stand nearly alone where one is, and averages where none is.
    top = sharp.max(axis=0)
    weight = np.where(top > 0, sharp / np.where(top > 0, top, 1.0), np.float32(1.0)) ** 4
    weight /= weight.sum(axis=0)
    if frames.ndim > sharp.ndim:
        weight = weight[..., None]
    return (frames * weight).sum(axis=0)


def _gaussian_peak(sharp: NDArray[np.float32], peak: NDArray[np.int64], base: NDArray[np.float32]) -> Array:
    """Place of a Gaussian through the samples of more than a third of the peak, next to it without a gap."""
    slices = sharp.shape[0]
    top = np.take_along_axis(sharp, peak[None], 0)[0] - base
    reach = max(1, (slices - 1) // 2)
    sums = np.zeros((8, *peak.shape))
    open_left, open_right = np.ones(peak.shape, bool), np.ones(peak.shape, bool)

    def add(offset: int, allowed: NDArray[np.bool_]) -> NDArray[np.bool_]:
        index = peak + offset
        exists = allowed & (index >= 0) & (index < slices)
        value = np.take_along_axis(sharp, np.clip(index, 0, slices - 1)[None], 0)[0] - base
        share = np.clip(value / np.maximum(top, 1e-30), 1e-6, None)
        use = exists & ((share > 0.33) | (abs(offset) == 1))
        # The error of a logarithm is that of the value over the value.
        weight = np.where(use, np.maximum(share, 0.05) ** 2, 0.0)
        logarithm = np.log(share)
        for k in range(5):
            sums[k] += weight * offset**k
        for k in range(3):
            sums[5 + k] += weight * logarithm * offset**k
        return use

    add(0, np.ones(peak.shape, bool))
    for offset in range(1, reach + 1):
        open_right = add(offset, open_right)
        open_left = add(-offset, open_left)
    s0, s1, s2, s3, s4, t0, t1, t2 = sums
    # Least squares of c0 + c1 x + c2 x^2 by Cramer's rule.
    determinant = s0 * (s2 * s4 - s3 * s3) - s1 * (s1 * s4 - s2 * s3) + s2 * (s1 * s3 - s2 * s2)
    c1 = s0 * (t1 * s4 - s3 * t2) - t0 * (s1 * s4 - s2 * s3) + s2 * (s1 * t2 - t1 * s2)
    c2 = s0 * (s2 * t2 - t1 * s3) - s1 * (s1 * t2 - t1 * s2) + t0 * (s1 * s3 - s2 * s2)
    good = (np.abs(determinant) > 1e-12) & (c2 * np.sign(determinant) < 0)
    shift = np.where(good, -0.5 * c1 / np.where(c2 == 0, -1.0, c2), 0.0)
    return np.asarray(peak + np.clip(shift, -1.0, 1.0), np.float64)


def _on_disk(shape: tuple[int, ...]) -> NDArray[np.float32]:
    with tempfile.TemporaryFile() as store:
        return np.memmap(store, dtype=np.float32, mode="w+", shape=shape)
