"""Two faces of a blown pane: a slightly streaky surface and the pits that decay has eaten into it."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from specularia.errors import PhysicsError
from specularia.twin.settings import FaceSettings, MapSettings

__all__ = ["FaceTruth", "make_face", "pits", "pristine"]

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

_HARMONICS = 12
_OVERSHOOT = 0.002
"""How far the pitted share may lie beside the wanted one."""
_MOST_OVERSHOTS = 2000
"""Pits too large for what is left to cover before the share counts as impossible."""
_STRAY = 0.25
"""Share of pits that keep to no cluster."""
_FLATNESS = 0.25
"""How much flatter than a paraboloid the floor of a caldera is."""


@dataclass(frozen=True)
class FaceTruth:
    """A face as it was blown and as it is now.

    Attributes
    ----------
    pristine_um, decayed_um : heights [row = y, column = x], positive out of the glass, 0 in the mean plane of
        the pristine surface; periodic. decayed <= pristine everywhere.
    pitted : where the decay is, same shape.
    """

    pristine_um: Array
    decayed_um: Array
    pitted: Mask


def pristine(*, pixels: int, pitch_um: float, slope: float, rng: np.random.Generator) -> Array:
    """Height of a blown surface with streaks along y.

    A sum of harmonics of the field, so that the map tiles: wavelengths from the field's width down to a
    twelfth of it across the streaks, and nearly constant along them. Amplitudes fall as the wavelength does;
    the whole is scaled to the wanted rms slope across the streaks. Ours.

    Parameters
    ----------
    pixels : N, along each side.
    pitch_um : distance between pixels.
    slope : rms of the slope along x, 0 for a flat surface.
    rng : random stream for amplitudes and phases.

    Returns
    -------
    array [N, N], um, mean 0.
    """
    turn = 2.0 * np.pi / (pixels * pitch_um)
    along = turn * pitch_um * np.arange(pixels)
    x, y = along[None, :], along[:, None]
    height = np.zeros((pixels, pixels))
    square = 0.0
    for kx in range(1, _HARMONICS + 1):
        for ky in (-1, 0, 1):
            amplitude = rng.normal() / kx * (1.0 if ky == 0 else 0.6)
            height += amplitude * np.cos(kx * x + ky * y + rng.uniform(0.0, 2.0 * np.pi))
            square += 0.5 * (amplitude * kx * turn) ** 2
    return height * (slope / math.sqrt(square))


def pits(
    settings: FaceSettings, *, pixels: int, pitch_um: float, rng: np.random.Generator
) -> tuple[Array, Array, Mask]:
    """Depth of the decay and where it is.

    Calderas (flat-floored bowls with a slightly irregular outline) are put down one by one, the deeper one
    winning where two overlap, until they cover the wanted share; one that would overshoot it is made smaller.
    Secondary pits, small paraboloids, are then added on top wherever they fit inside the calderas, so they
    change the relief and not the share. Ours.

    Returns
    -------
    primary, secondary : depth, arrays [N, N], >= 0; the unit of `primary` is arbitrary, of `secondary` um.
    pitted : mask [N, N].
    """
    field = pixels * pitch_um
    depth = np.zeros((pixels, pixels))
    covered = np.zeros((pixels, pixels), bool)
    count = max(1, round(settings.clusters_per_mm2 * (field / 1000.0) ** 2))
    centres = rng.uniform(0.0, field, (count, 2)) if settings.clusters_per_mm2 > 0 else None
    low, high = (min(r, 0.45 * field) for r in settings.radius_um)
    wanted = settings.pitted_share * depth.size
    ceiling = (settings.pitted_share + _OVERSHOOT) * depth.size
    inside, overshot = 0, 0
    while inside < max(wanted - _OVERSHOOT * depth.size, 1.0):
        # Radii with a density falling as 1/R; each pit that covers too much makes the next ones smaller.
        radius = max(low * (high / low) ** rng.random() * 0.8**overshot, 2.0 * pitch_um)
        if centres is None or rng.random() < _STRAY:
            place = rng.uniform(0.0, field, 2)
        else:
            place = centres[rng.integers(len(centres))] + rng.normal(0.0, settings.cluster_radius_um, 2)
        rows, columns, q = _footprint(place, radius, _outline(rng), pixels=pixels, pitch_um=pitch_um)
        steepness = rng.uniform(0.25, 1.0)
        gain = int(np.count_nonzero((q < 1.0) & ~covered[rows, columns]))
        if inside + gain > ceiling:
            overshot += 1
            if overshot > _MOST_OVERSHOTS:
                raise PhysicsError(
                    f"a pitted share of {settings.pitted_share:g} cannot be met on {pixels} x {pixels} "
                    f"pixels within {_OVERSHOOT:g}. Take more pixels."
                )
            continue
        inside += gain
        bowl = steepness * radius * np.clip(1.0 - q, 0.0, None) * (1.0 + _FLATNESS * q)
        depth[rows, columns] = np.maximum(depth[rows, columns], bowl)
        covered[rows, columns] |= q < 1.0
    return depth, _secondary(settings, covered, pitch_um=pitch_um, rng=rng), covered


def _secondary(settings: FaceSettings, covered: Mask, *, pitch_um: float, rng: np.random.Generator) -> Array:
    """Depth of the small pits that lie wholly inside `covered`, um."""
    pixels = covered.shape[0]
    extra = np.zeros(covered.shape)
    if settings.secondary_depth == 0.0:
        return extra
    low, high = settings.secondary_radius_um
    # As many as would cover the field once if they lay side by side.
    number = round((pixels * pitch_um) ** 2 / (math.pi * 0.25 * (low + high) ** 2))
    for place in rng.uniform(0.0, pixels * pitch_um, (number, 2)):
        radius = rng.uniform(low, high)
        rows, columns, q = _footprint(place, radius, None, pixels=pixels, pitch_um=pitch_um)
        if np.all(covered[rows, columns] | (q >= 1.0)):
            bowl = settings.secondary_depth * rng.uniform(0.6, 1.0) * radius * np.clip(1.0 - q, 0.0, None)
            extra[rows, columns] = np.maximum(extra[rows, columns], bowl)
    return extra


def _outline(rng: np.random.Generator) -> Array:
    """Amplitude and phase of the second and third harmonic of a pit's outline."""
    return np.array(
        [rng.uniform(0.0, 0.12), rng.uniform(0.0, 6.3), rng.uniform(0.0, 0.06), rng.uniform(0.0, 6.3)]
    )


def _footprint(
    place: Array, radius: float, outline: Array | None, *, pixels: int, pitch_um: float
) -> tuple[NDArray[np.intp], NDArray[np.intp], Array]:
    """Rows [n, 1] and columns [1, n] around a pit, folded into the period, and (r / R)^2 there [n, n]."""
    reach = math.ceil(1.2 * radius / pitch_um) + 1
    if 2 * reach + 1 > pixels:
        reach = (pixels - 1) // 2
    cx, cy = place / pitch_um
    columns = math.floor(cx) + np.arange(-reach, reach + 1)
    rows = math.floor(cy) + np.arange(-reach, reach + 1)
    dx, dy = (columns - cx)[None, :] * pitch_um, (rows - cy)[:, None] * pitch_um
    q = (dx * dx + dy * dy) / (radius * radius)
    if outline is not None:
        angle = np.arctan2(dy, dx)
        a2, p2, a3, p3 = outline
        q = q / (1.0 + a2 * np.cos(2.0 * angle + p2) + a3 * np.cos(3.0 * angle + p3)) ** 2
    return (rows % pixels)[:, None], (columns % pixels)[None, :], q


def make_face(settings: FaceSettings, maps: MapSettings, rng: np.random.Generator) -> FaceTruth:
    """A pristine face and the same face decayed, with the pitted share and the relief that were set.

    The depth of the calderas is scaled, by bisection, so that highest minus lowest point of the decayed
    surface is `relief_um`. A relief of 0 leaves the pristine surface.

    Raises
    ------
    PhysicsError : the relief is smaller than streaks and secondary pits make it by themselves, or the share
        cannot be met on so few pixels.
    """
    smooth = pristine(pixels=maps.pixels, pitch_um=maps.pitch_um, slope=settings.streak_slope, rng=rng)
    if settings.pitted_share == 0.0 or settings.relief_um == 0.0:
        return FaceTruth(smooth, smooth.copy(), np.zeros(smooth.shape, bool))
    primary, secondary, covered = pits(settings, pixels=maps.pixels, pitch_um=maps.pitch_um, rng=rng)
    least = float(np.ptp(smooth - secondary))
    if settings.relief_um <= least:
        raise PhysicsError(
            f"relief_um = {settings.relief_um:g} leaves no depth for the pits: streaks and secondary pits "
            f"make {least:.3g} um by themselves. Give more relief, or less streak_slope or secondary_depth."
        )
    low, high = 0.0, 10.0 * settings.relief_um / float(primary.max())
    for _ in range(60):
        scale = 0.5 * (low + high)
        if np.ptp(smooth - scale * primary - secondary) > settings.relief_um:
            high = scale
        else:
            low = scale
    return FaceTruth(smooth, smooth - low * primary - secondary, covered)
