"""What a confocal microscope would record of a known surface: focus stack and all-in-focus image."""

from __future__ import annotations

import json
import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from specularia.files import atomic
from specularia.twin.settings import MicroscopeSettings

__all__ = [
    "FocusStack",
    "axial_response",
    "focus_stack",
    "returned",
    "white_light",
    "write_image",
    "write_stack",
]

Array = NDArray[np.float64]

_SINC2_HALF = 0.442946
"""x at which (sin(pi x) / (pi x))^2 is one half."""
_FLOOR = 0.04
"""Light that returns from the steepest flank, by its roughness, over that of a level surface."""
_COUNTS = 40000.0
"""uint16 value of the mean signal of a level pixel in focus."""
_OFFSET = 400.0
"""uint16 value of no light, above 0 so that read noise is not cut off."""


@dataclass(frozen=True)
class FocusStack:
    """Slices of a focus series.

    Attributes
    ----------
    slices : uint16 [slice, row = y, column = x].
    z0_um, step_um : slice k was taken at z0 + k * step, out of the glass, in the datum of the heights.
    """

    slices: NDArray[np.uint16]
    z0_um: float
    step_um: float


def axial_response(z_um: NDArray[np.floating], *, fwhm_um: float) -> NDArray[np.floating]:
    """Response of a confocal microscope to a mirror out of focus by z: (sin u / u)^2, 1 in focus.

    References
    ----------
    Corle, T. R., Chou, C.-H. and Kino, G. S. (1986), Depth response of confocal optical microscopes,
    Optics Letters 11(12), 770, doi:10.1364/OL.11.000770
    """
    return np.sinc(z_um * (2.0 * _SINC2_HALF / fwhm_um)) ** 2


def returned(heights_um: Array, *, pitch_um: float, half_bright_slope: float) -> Array:
    """Share of the light that a surface element sends back into the objective, 0 to 1, by its slope.

    1 / (1 + (slope / half_bright_slope)^2) and a small floor. Slopes are central differences on the periodic
    map. Ours: a smooth stand-in for an objective of limited aperture over a slightly rough surface.
    """
    gx = (np.roll(heights_um, -1, 1) - np.roll(heights_um, 1, 1)) / (2.0 * pitch_um)
    gy = (np.roll(heights_um, -1, 0) - np.roll(heights_um, 1, 0)) / (2.0 * pitch_um)
    return _FLOOR + (1.0 - _FLOOR) / (1.0 + (gx * gx + gy * gy) / half_bright_slope**2)


def focus_stack(
    heights_um: Array, settings: MicroscopeSettings, *, pitch_um: float, rng: np.random.Generator
) -> FocusStack:
    """Focus series of a surface under a red laser.

    Each pixel answers with `axial_response` around its height, scaled by `returned`, with shot noise
    (normal, of variance equal to the signal in electrons) and read noise.
    """
    step = settings.step_um
    z0 = math.floor((float(heights_um.min()) - settings.margin_um) / step) * step
    number = math.ceil((float(heights_um.max()) + settings.margin_um - z0) / step) + 1
    signal = settings.electrons * returned(
        heights_um, pitch_um=pitch_um, half_bright_slope=settings.half_bright_slope
    ).astype(np.float32)
    height = heights_um.astype(np.float32)
    slices = np.empty((number, *heights_um.shape), np.uint16)
    for k in range(number):
        offset = np.float32(z0 + k * step) - height
        electrons = signal * axial_response(offset, fwhm_um=settings.fwhm_slices * step)
        slices[k] = _recorded(electrons, settings, rng)
    return FocusStack(slices, z0, step)


def white_light(
    heights_um: Array, settings: MicroscopeSettings, *, pitch_um: float, rng: np.random.Generator
) -> NDArray[np.uint16]:
    """All-in-focus image under white light, uint16 as `heights_um`: only slope shades it."""
    signal = settings.electrons * returned(
        heights_um, pitch_um=pitch_um, half_bright_slope=settings.half_bright_slope
    ).astype(np.float32)
    return _recorded(signal, settings, rng)


def _recorded(
    electrons: NDArray[np.floating], settings: MicroscopeSettings, rng: np.random.Generator
) -> NDArray[np.uint16]:
    """Electrons with shot and read noise, as the camera's counts."""
    sigma = np.sqrt(electrons + np.float32(settings.read_noise_electrons**2))
    noisy = electrons + sigma * rng.standard_normal(electrons.shape, dtype=np.float32)
    counts = noisy * np.float32(_COUNTS / settings.electrons) + np.float32(_OFFSET)
    return np.clip(np.rint(counts), 0, 65535).astype(np.uint16)


def write_stack(stack: FocusStack, path: Path, *, pitch_um: float, label: str) -> Path:
    """Write a stack as a multi-page TIFF; its description is JSON: pitch, step, z of the first slice,
    label."""
    import tifffile

    words = {
        "pitch_um": pitch_um,
        "step_um": stack.step_um,
        "z0_um": stack.z0_um,
        "axes": "slice, row (row 0 = lowest y), column",
        "synthetic": label,
    }
    with atomic(path) as temporary:
        tifffile.imwrite(
            temporary,
            stack.slices,
            photometric="minisblack",
            description=json.dumps(words),
            metadata=None,
            software="specularia (synthetic)",
            resolution=(1e4 / pitch_um, 1e4 / pitch_um),
            resolutionunit="CENTIMETER",
        )
    return path


def write_image(image: NDArray[np.uint16], path: Path, *, pitch_um: float, label: str) -> Path:
    """Write the all-in-focus image as a TIFF described like the stack."""
    import tifffile

    words = {"pitch_um": pitch_um, "axes": "row (row 0 = lowest y), column", "synthetic": label}
    with atomic(path) as temporary:
        tifffile.imwrite(
            temporary,
            image,
            photometric="minisblack",
            description=json.dumps(words),
            metadata=None,
            software="specularia (synthetic)",
        )
    return path
