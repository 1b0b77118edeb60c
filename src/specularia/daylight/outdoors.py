"""What the panes see of the world outside: sun, sky and ground as luminance over direction."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from specularia.conventions import LUMINOUS_EFFICACY
from specularia.daylight.geometry import pane_axes
from specularia.daylight.job import RoomJob
from specularia.radiance import run

__all__ = ["SUN_DIAMETER_DEG", "Outdoors", "incident_illuminance", "outdoors", "sun_disc"]

Array = NDArray[np.float64]

SUN_DIAMETER_DEG = 0.533
"""Apparent diameter of the sun, its mean over the year."""

_GENSKY_SUN_DEG = 0.5
"""Diameter that gensky gives the sun with its radiance; only the product, an illuminance, is used here."""


@dataclass(frozen=True)
class Outdoors:
    """Sun, sky and ground; directions point from the room to what is seen, in the room's frame.

    Attributes
    ----------
    kind : clear, overcast, uniform or none.
    zenith : luminance of the zenith in cd/m2.
    sun : [3] unit vector towards the sun, or None.
    sun_illuminance : of the direct sun on a plane square to it, lx.
    ground : luminance of the ground in cd/m2.
    sky_illuminance : of the sky alone on the horizontal, lx.
    """

    kind: str
    zenith: float
    sun: Array | None
    sun_illuminance: float
    ground: float
    sky_illuminance: float

    def luminance(self, directions: Array) -> Array:
        """cd/m2 of sky (z > 0) and ground, without the sun's disc, for [..., 3] unit vectors."""
        sky = self.zenith * _relative(self.kind, directions, self.sun)
        return np.where(directions[..., 2] > 0.0, sky, self.ground)


def _relative(kind: str, directions: Array, sun: Array | None) -> Array:
    """Luminance over that of the zenith, for directions above the horizon.

    CIE clear: f(gamma) phi(z) / (f(z_s) phi(0)) with f = 0.91 + 10 exp(-3 gamma) + 0.45 cos^2 gamma and
    phi = 1 - exp(-0.32 / cos z); CIE overcast: (1 + 2 cos z) / 3 (CIE S 003:1996; Radiance's skybright.cal).
    """
    z = np.maximum(directions[..., 2], 1e-3)
    if kind == "uniform":
        return np.ones(z.shape)
    if kind == "overcast":
        return (1.0 + 2.0 * z) / 3.0
    if kind == "none" or sun is None:
        return np.zeros(z.shape)

    def around(cosine: Array) -> Array:
        return 0.91 + 10.0 * np.exp(-3.0 * np.arccos(np.clip(cosine, -1.0, 1.0))) + 0.45 * cosine**2

    at_zenith = around(np.asarray(sun[2])) * (1.0 - np.exp(-0.32))
    return around(directions @ sun) * (1.0 - np.exp(-0.32 / z)) / at_zenith


def outdoors(job: RoomJob) -> Outdoors:
    """Sun, sky and ground of a room's job; what the job leaves open comes from gensky.

    Notes
    -----
    gensky's values follow from the elevation of the sun alone (turbidity 2.45); its radiances count 179 lm/W.
    """
    sun, sun_lx = None, 0.0
    if job.sun is not None:
        sun = sun_direction(job)
        sun_lx = job.sun.normal_illuminance_lx or 0.0
        if job.sun_shines and sun_lx == 0.0:
            radiance = _gensky(job.sun.elevation_deg, "+s")[0]
            solid_angle = 2.0 * np.pi * (1.0 - np.cos(np.radians(_GENSKY_SUN_DEG / 2)))
            sun_lx = radiance * solid_angle * LUMINOUS_EFFICACY
    zenith, given = 0.0, job.sky.horizontal_illuminance_lx
    share = _horizontal_share(job.sky.kind, sun)
    if job.sky.kind != "none":
        if given is not None:
            zenith = given / share
        elif job.sun is not None:
            switch = {"clear": "+s", "overcast": "-c", "uniform": "-u"}[job.sky.kind]
            zenith = _gensky(job.sun.elevation_deg, switch)[1] * LUMINOUS_EFFICACY
    sky_lx = zenith * share
    horizontal = sky_lx + (sun_lx * max(float(sun[2]), 0.0) if sun is not None else 0.0)
    return Outdoors(
        kind=job.sky.kind,
        zenith=float(zenith),
        sun=sun,
        sun_illuminance=float(sun_lx),
        ground=job.ground.reflectance * horizontal / np.pi,
        sky_illuminance=float(sky_lx),
    )


def sun_direction(job: RoomJob) -> Array:
    """[3] unit vector towards the sun."""
    assert job.sun is not None
    x, _, out = pane_axes(job.sun.wall)
    e, a = np.radians(job.sun.elevation_deg), np.radians(job.sun.azimuth_deg)
    # Clockwise from above, from the outward normal, is to the left of somebody who looks at the wall from
    # outside: against the sample's x.
    return np.cos(e) * (np.cos(a) * out - np.sin(a) * x) + np.sin(e) * np.array([0.0, 0.0, 1.0])


def _gensky(elevation_deg: float, switch: str) -> tuple[float, float]:
    """(radiance of the sun, radiance of the zenith) that gensky gives, W/(m2 sr)."""
    text = run(["gensky", "-ang", f"{elevation_deg:.6f}", "0", switch]).decode()
    words = [w for line in text.splitlines() if not line.startswith("#") for w in line.split()]
    sun = float(words[words.index("solar") + 4]) if "solar" in words else 0.0
    brightness = words.index("skybright.cal")
    return sun, float(words[brightness + 4])


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


def _horizontal_share(kind: str, sun: Array | None) -> float:
    """Horizontal illuminance of the sky for a zenith of 1 cd/m2."""
    d, w = hemisphere(np.array([0.0, 0.0, 1.0]))
    return float(np.sum(w * _relative(kind, d, sun)))


def incident_illuminance(out: Outdoors, normal: Array) -> tuple[float, float]:
    """(sun, sky and ground) illuminance in lx on the outer side of a plane with this outward normal."""
    d, w = hemisphere(np.asarray(normal, float))
    direct = 0.0 if out.sun is None else out.sun_illuminance * max(float(out.sun @ normal), 0.0)
    return direct, float(np.sum(w * out.luminance(d)))


def sun_disc(sun: Array, diameter_deg: float = SUN_DIAMETER_DEG) -> tuple[Array, Array]:
    """Seven directions [7, 3] with weights [7] (sum 1) that average over the sun's disc.

    The centre with 1/4 and six points at sqrt(2/3) of the radius with 1/8 each integrate polynomials up to
    the fifth degree over a disc exactly (Stroud 1971, Approximate Calculation of Multiple Integrals, S2 5-1).
    """
    a = np.cross(sun, [0.0, 0.0, 1.0] if abs(sun[2]) < 0.9 else [1.0, 0.0, 0.0])
    a /= np.linalg.norm(a)
    b = np.cross(sun, a)
    r = np.tan(np.radians(diameter_deg / 2)) * np.sqrt(2.0 / 3.0)
    phi = np.arange(6) * (np.pi / 3)
    ring = sun + r * (np.cos(phi)[:, None] * a + np.sin(phi)[:, None] * b)
    ring /= np.linalg.norm(ring, axis=1, keepdims=True)
    return np.vstack([sun, ring]), np.array([0.25] + [0.125] * 6)
