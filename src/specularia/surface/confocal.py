"""Confocal stacks: what a sample of pixels tells about the instrument, and the heights of a tile."""

from __future__ import annotations

import warnings
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from specularia import progress
from specularia.errors import PhysicsError, SpeculariaWarning
from specularia.surface import focus, rivals
from specularia.surface.heightmap import FLAGS
from specularia.surface.stack import Stack

__all__ = ["Pilot", "learn", "rows_of"]

Array = NDArray[np.float64]

_PILOT_PIXELS = 8192
_PILOT_BYTES = 8 << 20
"""Of brightness, as 32-bit floats, that the sample holds at most, but for one row."""

_LEAST_SNR = 5.0
_LEAST_SIGNIFICANCE = 6.0
"""Of a peak to the matched filter: noise alone reaches 3 to 4."""

RIVAL = 0.25
"""A second peak of at least this share of the first means that two surfaces answer in one pixel."""

_RIVAL_SIGNIFICANCE = 5.0
_BROAD = 1.2
_STEADYING = 80
_SEEN = 0.05
"""Standard error of a slice's displacement, in slices, from which on it is not trusted."""

_FARTHEST = 2.0
_CLIPPED = 4
"""Samples at the highest value from which a pile-up there is taken for clipping."""


@dataclass(frozen=True)
class Pilot:
    """What a sample of pixels tells about the whole stack.

    Parameters
    ----------
    response, noise : shape of the axial response; variance against brightness.
    saturation : brightness at which the camera clips, infinite where nothing shows it.
    scatter : what the width of good peaks varies by, beside the noise of the fits, in slices.
    displaced : [slices] how far each slice lies above its even place, in slices; None where not asked for.
    """

    response: focus.Response
    noise: focus.Noise
    saturation: float
    scatter: float
    displaced: Array | None = None

    @property
    def fwhm(self) -> float:
        """Full width of the response at half maximum, in slices."""
        return self.response.fwhm

    def parameters(self, step_um: float) -> dict[str, Any]:
        """For provenance."""
        shaken = (
            {}
            if self.displaced is None
            else {"vibration_rms_um": float(np.std(self.displaced)) * abs(step_um)}
        )
        return {
            **shaken,
            "estimator": "tapered fit of the learnt response",
            "response_fwhm_um": self.fwhm * abs(step_um),
            "noise_floor": self.noise.floor,
            "noise_gain": self.noise.gain,
            "saturation": self.saturation,
        }


def learn(stack: Stack, *, vibration: bool = False) -> Pilot:
    """Width of the response, noise and full scale, from rows spread evenly over the picture.

    Parameters
    ----------
    stack : confocal brightness.
    vibration : True looks for slices that do not lie at their even places.
    """
    rows, columns = stack.shape
    pixels = min(_PILOT_PIXELS, _PILOT_BYTES // (4 * stack.slices))
    wanted = int(np.clip(np.ceil(pixels / columns), 1, rows))
    chosen = np.unique(np.linspace(0, rows - 1, wanted).round().astype(int))
    part = stack.sample(chosen)
    saturation = _full_scale(stack)
    part = part[:, (part < saturation).all(axis=0)]
    if part.shape[1] < 16:
        raise PhysicsError(f"{stack.name}: nearly every pixel is saturated. Take the stack with less light.")
    base = focus.background(part)
    width = focus.width_of(part, base)
    floor = 1.0 / 12.0
    if stack.frames.dtype.kind not in "ui":
        floor = float(np.finfo(np.float32).eps * np.abs(part).max()) ** 2
    # A first guess of the noise: half the mean square of differences of differences, free of smooth signal.
    second = np.diff(part, n=2, axis=0)
    noise = focus.Noise(max(float((1.4826 * np.median(np.abs(second))) ** 2 / 6.0), floor, 1e-30), 0.0)
    found = focus.significance(part, base, width, noise)
    good = (found > _LEAST_SIGNIFICANCE) & (found >= np.median(found))
    peak = focus.coarse(part, width)
    margin = focus.REACH * focus.FWHM_PER_SIGMA * width
    central = good & (peak >= margin) & (peak <= stack.slices - 1 - margin)
    use = central if np.count_nonzero(central) >= 64 else good
    if np.count_nonzero(use) < 16:
        raise PhysicsError(
            f"{stack.name}: hardly a pixel has a peak above the noise. Is this a focus stack of a confocal "
            "microscope? For photographs through focus state --kind contrast."
        )
    part, base, peak = part[:, use], base[use], peak[use]
    away = np.abs(np.arange(stack.slices)[:, None] - peak) > 2 * margin
    deviation = (part - np.median(part, axis=0))[away].astype(np.float64)
    level = float(part[away].mean()) if away.any() else 0.0
    response = focus.Response(width)
    for _ in range(4):
        peaks = focus.fit(part, peak=peak, base=base, response=response, noise=noise)
        response = focus.learnt(response, peaks)
        noise = focus.noise_of(peaks, deviation, level, floor=max(floor, 1e-30))
    displaced = None
    if vibration:
        displaced = np.zeros(stack.slices)
        for _ in range(_STEADYING):
            peaks = focus.fit(part, peak=peak, base=base, response=response, noise=noise, displaced=displaced)
            more, error = focus.displacements(peaks, stack.slices)
            # A slice that hardly a pixel sees stays where it is.
            before, seen = displaced, error < _SEEN
            displaced = _without_line(displaced + np.where(seen, more, 0.0), seen)
            displaced = np.clip(displaced, -_FARTHEST, _FARTHEST)
            response = focus.learnt(response, peaks)
            noise = focus.noise_of(peaks, deviation, level, floor=max(floor, 1e-30))
            if np.abs(displaced - before).max() < 5e-4:
                break
    if response.fwhm < 2.0:
        warnings.warn(
            f"{stack.name}: the axial response is {response.fwhm:.1f} slices wide; below 2 the heights are "
            "drawn towards the slices. Take the stack with a smaller step.",
            SpeculariaWarning,
            stacklevel=4,
        )
    spread = 1.4826 * float(np.median(np.abs(peaks.width - np.median(peaks.width))))
    chance = float(np.median(np.maximum(peaks.covariance[2][2], 0.0)))
    return Pilot(response, noise, saturation, float(np.sqrt(max(spread**2 - chance, 0.0))), displaced)


def _without_line(displaced: Array, known: NDArray[np.bool_]) -> Array:
    """Displacements without their mean and slope, which no stack can tell from height and step."""
    if np.count_nonzero(known) < 3:
        return np.zeros_like(displaced)
    k = np.arange(displaced.size)
    line = np.polynomial.Polynomial.fit(k[known], displaced[known], 1)
    return np.where(known, displaced - line(k), 0.0)


def _full_scale(stack: Stack) -> float:
    """The brightness at which the camera clips, infinite where the stack does not reach one.

    The stack's maximum, where it is 2^k - 1 (whole numbers, k from 8 up), or where more samples stand exactly
    at it than in the percent of the range below it: light that is not clipped thins out towards its maximum.
    """
    low, top, hits, near = np.inf, -np.inf, 0, 0
    with progress.task(f"full scale of {stack.name}", stack.slices) as bar:
        for k in range(stack.slices):
            frame = stack.frame(k)
            if not np.isfinite(frame).all():
                raise PhysicsError(f"{stack.name}: brightness that is not a number in slice {k + 1}.")
            low, here = min(low, float(frame.min())), float(frame.max())
            if here > top:
                # What stood near the old maximum is near the new one only if that is hardly higher.
                near = near + hits if here - top < 0.01 * (here - low) else 0
                top, hits = here, 0
            close = frame[frame > top - 0.01 * (top - low)]
            exact = int(np.count_nonzero(close == top))
            hits, near = hits + exact, near + close.size - exact
            bar.advance()
            stack.release()
    whole = stack.frames.dtype.kind in "ui" and top >= 255 and (int(top) & (int(top) + 1)) == 0
    return top if whole or (hits >= _CLIPPED and hits > near and top > low) else np.inf


def rows_of(part: NDArray[np.float32], pilot: Pilot) -> Mapping[str, NDArray[Any]]:
    """Heights of a tile.

    Parameters
    ----------
    part : brightness [slices, N].

    Returns
    -------
    arrays : [N] each. `place` and `sigma` in slices, NaN where a fault leaves no height; `image`, the
        brightness in focus; `reliability`, 0..1; `flags`, see `HeightMap`.
    """
    slices = part.shape[0]
    response, noise = pilot.response, pilot.noise
    base = focus.background(part)
    peak = focus.coarse(part, response.width)
    peaks = focus.fit(part, peak=peak, base=base, response=response, noise=noise, displaced=pilot.displaced)
    fwhm = pilot.fwhm
    top = base + peaks.height
    snr = peaks.height / np.sqrt(noise.variance(top))
    certain = peaks.height / np.sqrt(np.maximum(peaks.covariance[0][0], 1e-60))
    share, significant = rivals.second_peak(part, base, peaks, response, noise)
    dark = ~(snr >= _LEAST_SNR) & ~(certain >= 2.0 * _LEAST_SNR) | ~(peaks.sigma < 0.5 * fwhm)
    dark |= ~(certain >= _LEAST_SIGNIFICANCE)
    double = (share >= RIVAL) & (significant >= _RIVAL_SIGNIFICANCE)
    double |= rivals.broadened(peaks, typical=response.width, scatter=pilot.scatter, least=_BROAD)
    double |= np.abs(peaks.place - peak) > fwhm  # the fit has left the place where it started
    faults = {
        "saturated": (part >= pilot.saturation).any(axis=0),
        "dark": dark,
        "edge": (peaks.place < 0.5 * fwhm) | (peaks.place > slices - 1 - 0.5 * fwhm),
        "double": double & ~dark,
    }
    flags = np.zeros(part.shape[1], np.uint8)
    for name, fault in faults.items():
        flags |= np.where(fault, np.uint8(FLAGS[name]), np.uint8(0))
    # Chance alone moves the misfit by sqrt(2 / samples); beyond three times that the model is wrong here.
    samples = np.maximum((peaks.taper > 0).sum(axis=0) - 3, 1)
    wrong = peaks.misfit > 1.0 + 3.0 * np.sqrt(2.0 / samples)
    sigma = peaks.sigma * np.where(wrong, np.sqrt(np.maximum(peaks.misfit, 1.0)), 1.0)
    missing = flags > 0
    return {
        "place": np.where(missing, np.nan, peaks.place),
        "sigma": np.where(missing, np.nan, sigma),
        "image": np.where(missing, part.max(axis=0), top),
        "reliability": np.clip(1.0 - np.where(significant >= _RIVAL_SIGNIFICANCE, share, 0.0), 0.0, 1.0),
        "flags": flags,
    }
