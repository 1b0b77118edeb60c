"""From a focus stack to a height map with its uncertainty."""

from __future__ import annotations

import json
import warnings
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from specularia import progress, provenance
from specularia.errors import PhysicsError, SpeculariaWarning
from specularia.surface import focus
from specularia.surface.heightmap import HeightMap
from specularia.surface.stack import Stack, read_stack

__all__ = ["REASONS", "heights"]

REASONS = ("saturated", "dark", "edge", "ambiguous")
"""Why a pixel has no height, in the order in which they are looked for."""

_TILE_BYTES = 2 << 20
"""Brightness held at a time, as 32-bit floats; the work arrays take some ten times as much."""

_PILOT_PIXELS = 8192
_LEAST_SNR = 5.0
_RIVAL = 0.75
"""A second peak of at least this share of the first leaves the height open."""


@dataclass(frozen=True)
class _Pilot:
    """What a sample of pixels tells about the whole stack."""

    response: focus.Response
    noise: focus.Noise
    saturation: float


def heights(
    stack: Stack | str | Path,
    *,
    pitch_um: float | tuple[float, float] | None = None,
    step_um: float | None = None,
    first_row: str | None = None,
) -> HeightMap:
    """Height map of a confocal focus stack, with sigma, picture in focus and reliability of each pixel.

    The fit is that of `specularia.surface.focus.fit`; its standard uncertainty follows from the noise of the
    stack itself (a line of variance against brightness) and is widened where a pixel does not fit the model.

    Parameters
    ----------
    stack : a stack, or the path of one (see `read_stack`).
    pitch_um, step_um, first_row : override or complete what the file says; only with a path.

    Returns
    -------
    HeightMap : z0 + step * place of the peak, NaN (never filled) where the pixel is

        * saturated: a sample at full scale;
        * dark: the peak stands less than 5 standard deviations of its noise above the background;
        * edge: nearer than half a FWHM to the first or last slice;
        * ambiguous: another peak of at least 0.75 of its height, or the fit left the place where it started.

        Counts stand in the attribute `missing_because` as JSON.
    """
    if not isinstance(stack, Stack):
        stack = read_stack(stack, pitch_um=pitch_um, step_um=step_um, first_row=first_row)
    pilot = _pilot(stack)
    rows, columns = stack.shape
    height = np.full((rows, columns), np.nan)
    sigma, image, reliability = (np.full((rows, columns), np.nan) for _ in range(3))
    counts = dict.fromkeys(REASONS, 0)
    tile = max(1, _TILE_BYTES // (4 * stack.slices * columns))
    with progress.task(f"heights of {stack.name}", rows) as bar:
        for first in range(0, rows, tile):
            last = min(first + tile, rows)
            part = stack.rows(first, last).reshape(stack.slices, -1)
            z, s, bright, trust, why = _tile(part, pilot)
            height[first:last] = (stack.z0_um + stack.step_um * z).reshape(last - first, columns)
            sigma[first:last] = (abs(stack.step_um) * s).reshape(last - first, columns)
            image[first:last] = bright.reshape(last - first, columns)
            reliability[first:last] = trust.reshape(last - first, columns)
            for k, reason in enumerate(REASONS, 1):
                counts[reason] += int(np.count_nonzero(why == k))
            bar.advance(last - first)
    if sum(counts.values()) == rows * columns:
        raise PhysicsError(
            f"{stack.name}: no pixel has a height ({_sentence(counts)}). Is this a focus stack?"
        )
    if sum(counts.values()):
        warnings.warn(
            f"{stack.name}: {sum(counts.values())} of {rows * columns} pixels have no height "
            f"({_sentence(counts)}).",
            SpeculariaWarning,
            stacklevel=2,
        )
    parameters = {
        "pitch_um": stack.pitch_um,
        "step_um": stack.step_um,
        "z0_um": stack.z0_um,
        "estimator": "tapered fit of the learnt response",
        "response_fwhm_um": pilot.response.fwhm * abs(stack.step_um),
        "noise_floor": pilot.noise.floor,
        "noise_gain": pilot.noise.gain,
    }
    attributes = provenance.record(
        what=f"height map from the focus stack {stack.name}",
        inputs=[stack.source] if stack.source is not None else [],
        parameters=parameters,
        synthetic="synthetic" in stack.attributes,
    )
    attributes.update(stack.attributes)
    attributes["step_um"] = repr(stack.step_um)
    attributes["missing_because"] = json.dumps(counts)
    return HeightMap(
        height,
        *stack.pitch_um,
        sigma_um=sigma,
        image=image,
        reliability=reliability,
        name=stack.name,
        attributes=attributes,
    )


def _sentence(counts: dict[str, int]) -> str:
    return ", ".join(f"{n} {reason}" for reason, n in counts.items() if n)


def _pilot(stack: Stack) -> _Pilot:
    """Width of the response, noise and full scale, from rows spread evenly over the picture."""
    rows, columns = stack.shape
    wanted = int(np.clip(np.ceil(_PILOT_PIXELS / columns), 1, rows))
    chosen = np.unique(np.linspace(0, rows - 1, wanted).round().astype(int))
    part = np.concatenate([stack.rows(int(r), int(r) + 1)[:, 0] for r in chosen], axis=1)
    saturation = _full_scale(stack)
    part = part[:, (part < saturation).all(axis=0)]
    if part.shape[1] < 16:
        raise PhysicsError(f"{stack.name}: nearly every pixel is saturated. Take the stack with less light.")
    base = focus.background(part)
    width = focus.width_of(part, base)
    if width * focus.FWHM_PER_SIGMA < 2.0:
        warnings.warn(
            f"{stack.name}: the axial response is {width * focus.FWHM_PER_SIGMA:.1f} slices wide; "
            "below 2 the heights are drawn towards the slices. Take the stack with a smaller step.",
            SpeculariaWarning,
            stacklevel=3,
        )
    floor = (
        1.0 / 12.0 if stack.frames.dtype.kind in "ui" else float(np.finfo(np.float32).eps * part.max()) ** 2
    )
    # A first guess of the noise: half the mean square of differences of differences, free of smooth signal.
    second = np.diff(part, n=2, axis=0)
    noise = focus.Noise(max(float((1.4826 * np.median(np.abs(second))) ** 2 / 6.0), floor, 1e-30), 0.0)
    peak, _, _ = focus.coarse(part, width)
    contrast = part.max(axis=0) - base
    good = (contrast > 2 * _LEAST_SNR * np.sqrt(noise.floor)) & (contrast >= np.median(contrast))
    margin = focus.REACH * focus.FWHM_PER_SIGMA * width
    central = good & (peak >= margin) & (peak <= stack.slices - 1 - margin)
    use = central if np.count_nonzero(central) >= 64 else good
    if np.count_nonzero(use) < 16:
        raise PhysicsError(f"{stack.name}: hardly a pixel has a peak above the noise. Is this a focus stack?")
    part, base, peak = part[:, use], base[use], peak[use]
    away = np.abs(np.arange(stack.slices)[:, None] - peak) > 2 * margin
    deviation = (part - np.median(part, axis=0))[away].astype(np.float64)
    level = float(part[away].mean()) if away.any() else 0.0
    response = focus.Response(width)
    for _ in range(4):
        peaks = focus.fit(part, peak=peak, base=base, response=response, noise=noise)
        response = focus.learnt(response, peaks)
        noise = focus.noise_of(peaks, deviation, level, floor=max(floor, 1e-30))
    return _Pilot(response, noise, saturation)


def _full_scale(stack: Stack) -> float:
    """The brightness at which the camera clips, infinite where the stack does not reach one.

    Whole numbers: the stack's maximum where it is 2^k - 1, k from 8 up. Others: the maximum where more than
    one sample has exactly that value.
    """
    rows, columns = stack.shape
    step = max(1, _TILE_BYTES // (4 * stack.slices * columns))
    top, hits = -np.inf, 0
    for first in range(0, rows, step):
        part = stack.rows(first, min(first + step, rows))
        if not np.isfinite(part).all():
            raise PhysicsError(
                f"{stack.name}: brightness that is not a number in rows {first} to {first + step}."
            )
        here = float(part.max())
        count = int(np.count_nonzero(part == here))
        top, hits = (here, count) if here > top else (top, hits + (count if here == top else 0))
    if stack.frames.dtype.kind in "ui":
        value = int(top)
        clipped = value >= 255 and (value & (value + 1)) == 0
    else:
        clipped = hits > 1
    return top if clipped else np.inf


def _tile(
    part: NDArray[np.float32], pilot: _Pilot
) -> tuple[
    NDArray[np.float64], NDArray[np.float64], NDArray[np.float64], NDArray[np.float64], NDArray[np.uint8]
]:
    """Place, sigma (slices), brightness in focus, reliability, and index + 1 of the reason where missing."""
    slices = part.shape[0]
    base = focus.background(part)
    peak, smooth, second = focus.coarse(part, pilot.response.width)
    peaks = focus.fit(part, peak=peak, base=base, response=pilot.response, noise=pilot.noise)
    fwhm = pilot.response.fwhm
    top = base + peaks.height
    snr = peaks.height / np.sqrt(pilot.noise.variance(top))
    first = smooth[peak, np.arange(part.shape[1])] - base
    share = np.where(first > 0, (second - base) / np.where(first > 0, first, 1.0), 1.0)
    reliability = np.clip(1.0 - share, 0.0, 1.0)
    faults = (
        (part >= pilot.saturation).any(axis=0),
        ~(snr >= _LEAST_SNR) | ~(peaks.sigma < 0.5 * fwhm),
        (peaks.place < 0.5 * fwhm) | (peaks.place > slices - 1 - 0.5 * fwhm),
        (reliability < 1.0 - _RIVAL) | (np.abs(peaks.place - peak) > fwhm),
    )
    why = np.zeros(part.shape[1], np.uint8)
    for k, fault in enumerate(faults, 1):
        why[(why == 0) & fault] = k
    # Chance alone moves the misfit by sqrt(2 / samples); beyond three times that the model is wrong here.
    samples = np.maximum((peaks.taper > 0).sum(axis=0) - 3, 1)
    wrong = peaks.misfit > 1.0 + 3.0 * np.sqrt(2.0 / samples)
    sigma = peaks.sigma * np.where(wrong, np.sqrt(np.maximum(peaks.misfit, 1.0)), 1.0)
    missing = why > 0
    image = np.where(missing, part.max(axis=0), top)
    return (
        np.where(missing, np.nan, peaks.place),
        np.where(missing, np.nan, sigma),
        image,
        reliability,
        why,
    )
