"""Luminance of the sky over direction, and how much light sun and sky give by gensky."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from specularia.conventions import LUMINOUS_EFFICACY
from specularia.daylight.perez import PerezSky
from specularia.radiance import run

__all__ = ["gensky_amounts", "hemisphere", "horizontal_share", "relative_luminance"]

Array = NDArray[np.float64]

_GENSKY_SUN_DEG = 0.5
"""Diameter that gensky gives the sun with its radiance; only the product, an illuminance, is used here."""

_SWITCHES = {"clear": "+s", "none": "+s", "intermediate": "+i", "overcast": "-c", "uniform": "-u"}


def relative_luminance(
    kind: str, directions: Array, sun: Array | None, perez: PerezSky | None = None
) -> Array:
    """Luminance over that of the zenith, for directions above the horizon.

    Parameters
    ----------
    kind : clear, intermediate, overcast, uniform, perez or none.
    directions : [..., 3] unit vectors.
    sun : [3] unit vector towards the sun.
    perez : the sky of that kind.

    Notes
    -----
    With z the angle from the zenith, gamma that from the sun and z_s the sun's from the zenith:

    * clear: f(gamma) phi(z) / (f(z_s) phi(0)), f = 0.91 + 10 exp(-3 gamma) + 0.45 cos^2 gamma and
      phi = 1 - exp(-0.32 / cos z) (CIE S 003:1996);
    * overcast: (1 + 2 cos z) / 3 (the same);
    * intermediate: g(z, gamma) / g(0, z_s), g = [(1.35 sin(5.631 - 3.59 z) + 3.12) sin(4.396 - 2.6 z_s)
      + 6.37 - z] exp(-0.563 gamma [(2.629 - z)(1.562 - z_s) + 0.812]), angles in radians (Matsuura and Iwata
      1990, as in Radiance's skybright.cal).
    """
    z = np.maximum(directions[..., 2], 1e-3)
    if kind == "uniform":
        return np.ones(z.shape)
    if kind == "overcast":
        return (1.0 + 2.0 * z) / 3.0
    if kind == "none" or sun is None:
        return np.zeros(z.shape)
    cosine = np.clip(directions @ sun, -1.0, 1.0)
    up = np.array([0.0, 0.0, 1.0])
    if kind == "perez":
        assert perez is not None
        return perez.relative(directions, sun) / float(perez.relative(up, sun))
    if kind == "intermediate":
        zs = float(np.arccos(np.clip(sun[2], -1.0, 1.0)))
        return _intermediate(np.arccos(np.minimum(z, 1.0)), np.arccos(cosine), zs) / _intermediate(
            np.zeros(()), np.asarray(zs), zs
        )

    def around(cosine: Array) -> Array:
        return 0.91 + 10.0 * np.exp(-3.0 * np.arccos(cosine)) + 0.45 * cosine**2

    at_zenith = around(np.asarray(sun[2])) * (1.0 - np.exp(-0.32))
    return around(cosine) * (1.0 - np.exp(-0.32 / z)) / at_zenith


def _intermediate(z: Array, gamma: Array, zs: float) -> Array:
    """g(z, gamma) of the CIE intermediate sky."""
    level = (1.35 * np.sin(5.631 - 3.59 * z) + 3.12) * np.sin(4.396 - 2.6 * zs) + 6.37 - z
    return level * np.exp(-0.563 * gamma * ((2.629 - z) * (1.562 - zs) + 0.812))


def hemisphere(normal: Array, polar: int = 180, azimuths: int = 360) -> tuple[Array, Array]:
    """Directions [K, 3] about a normal and projected solid angles [K], midpoints of cos^2 and azimuth."""
    sine = np.sqrt((np.arange(polar) + 0.5) / polar)
    phi = (np.arange(azimuths) + 0.5) * (2.0 * np.pi / azimuths)
    s, p = (v.ravel() for v in np.meshgrid(sine, phi, indexing="ij"))
    a = np.cross(normal, [0.0, 0.0, 1.0] if abs(normal[2]) < 0.9 else [1.0, 0.0, 0.0])
    a /= np.linalg.norm(a)
    b = np.cross(normal, a)
    d = (s * np.cos(p))[:, None] * a + (s * np.sin(p))[:, None] * b + np.sqrt(1.0 - s * s)[:, None] * normal
    return d, np.full(s.size, np.pi / s.size)


def horizontal_share(kind: str, sun: Array | None, perez: PerezSky | None = None) -> float:
    """Horizontal illuminance of the sky for a zenith of 1 cd/m2."""
    d, w = hemisphere(np.array([0.0, 0.0, 1.0]))
    return float(np.sum(w * relative_luminance(kind, d, sun, perez)))


def gensky_amounts(kind: str, elevation_deg: float) -> tuple[float, float]:
    """What gensky gives a sky of this kind: (sun square to it in lx, luminance of the zenith in cd/m2).

    Its values follow from the elevation of the sun alone (turbidity 2.45); its radiances count 179 lm/W.
    """
    text = run(["gensky", "-ang", f"{elevation_deg:.6f}", "0", _SWITCHES[kind]]).decode()
    words = [w for line in text.splitlines() if not line.startswith("#") for w in line.split()]
    sun = float(words[words.index("solar") + 4]) if "solar" in words else 0.0
    zenith = float(words[words.index("skybright.cal") + 4])
    solid_angle = 2.0 * np.pi * (1.0 - np.cos(np.radians(_GENSKY_SUN_DEG / 2)))
    return sun * solid_angle * LUMINOUS_EFFICACY, zenith * LUMINOUS_EFFICACY
