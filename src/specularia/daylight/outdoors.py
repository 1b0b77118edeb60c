"""What the panes see of the world outside: sun, sky and ground as luminance over direction."""

from __future__ import annotations

import warnings
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from specularia.daylight.geometry import pane_axes
from specularia.daylight.job import RoomJob
from specularia.daylight.moment import at
from specularia.daylight.perez import SOLAR_CONSTANT_W_M2, PerezSky, perez_sky
from specularia.daylight.sky import gensky_amounts, hemisphere, horizontal_share, relative_luminance
from specularia.daylight.sun import sun_position
from specularia.errors import SpeculariaWarning

__all__ = [
    "SUN_DIAMETER_DEG",
    "Outdoors",
    "hemisphere",
    "incident_illuminance",
    "outdoors",
    "sun_direction",
    "sun_disc",
]

Array = NDArray[np.float64]

SUN_DIAMETER_DEG = 0.533
"""Apparent diameter of the sun, its mean over the year."""

_GENSKY_FADES_DEG = 9.2
"""Elevation below which gensky takes the sine of the sun's elevation as 0.16."""


@dataclass(frozen=True)
class Outdoors:
    """Sun, sky and ground; directions point from the room to what is seen, in the room's frame.

    Attributes
    ----------
    kind : clear, intermediate, overcast, uniform, perez or none.
    zenith : luminance of the zenith in cd/m2.
    sun : [3] unit vector towards the sun, or None.
    sun_illuminance : of the direct sun on a plane square to it, lx.
    ground : luminance of the ground in cd/m2.
    sky_illuminance : of the sky alone on the horizontal, lx.
    perez : shape of the sky where its kind is perez.
    """

    kind: str
    zenith: float
    sun: Array | None
    sun_illuminance: float
    ground: float
    sky_illuminance: float
    perez: PerezSky | None = None

    def luminance(self, directions: Array) -> Array:
        """cd/m2 of sky (z > 0) and ground, without the sun's disc, for [..., 3] unit vectors."""
        sky = self.zenith * relative_luminance(self.kind, directions, self.sun, self.perez)
        return np.where(directions[..., 2] > 0.0, sky, self.ground)


def outdoors(job: RoomJob) -> Outdoors:
    """Sun, sky and ground of a room's job; what the job leaves open comes from gensky, or from Perez's model.

    A job that gives place and time instead of angles is taken at that time (see `at`).
    """
    job = at(job)
    kind, sky = job.sky.kind, job.sky
    sun, sun_lx, zenith = None, 0.0, 0.0
    perez = _perez(job) if kind == "perez" else None
    if job.sun is not None:
        sun = sun_direction(job)
        if job.sun.normal_illuminance_lx is not None:
            sun_lx = job.sun.normal_illuminance_lx
        elif perez is not None:
            sun_lx = perez.direct_illuminance
        elif job.sun_shines:
            sun_lx = gensky_amounts(kind, job.sun.elevation_deg)[0]
            if job.sun.elevation_deg < _GENSKY_FADES_DEG:
                warnings.warn(
                    "below 9 degrees gensky's direct sun does not fade as the real one does: its light is "
                    "too much. Give normal_illuminance_lx, or irradiances ([weather], or a sky of kind "
                    "perez).",
                    SpeculariaWarning,
                    stacklevel=2,
                )
    share = horizontal_share(kind, sun, perez)
    if perez is not None:
        zenith = perez.diffuse_illuminance / share
    elif kind != "none" and sky.horizontal_illuminance_lx is not None:
        zenith = sky.horizontal_illuminance_lx / share
    elif kind != "none" and job.sun is not None:
        zenith = gensky_amounts(kind, job.sun.elevation_deg)[1]
    sky_lx = zenith * share
    horizontal = sky_lx + (sun_lx * max(float(sun[2]), 0.0) if sun is not None else 0.0)
    return Outdoors(
        kind=kind,
        zenith=float(zenith),
        sun=sun,
        sun_illuminance=float(sun_lx),
        ground=job.ground.reflectance * horizontal / np.pi,
        sky_illuminance=float(sky_lx),
        perez=perez,
    )


def _perez(job: RoomJob) -> PerezSky:
    """The sky of the job's irradiances; the sun's distance is that of the date, where there is one."""
    direct, diffuse = job.sky.direct_normal_irradiance_w_m2, job.sky.diffuse_horizontal_irradiance_w_m2
    assert job.sun is not None and direct is not None and diffuse is not None
    distance = sun_position(job.place, job.time).distance_au if job.place and job.time else 1.0
    found = perez_sky(
        sun_elevation_deg=job.sun.elevation_deg,
        direct_normal_w_m2=direct,
        diffuse_horizontal_w_m2=diffuse,
        extraterrestrial_w_m2=SOLAR_CONSTANT_W_M2 / distance**2,
    )
    if found.outside:
        warnings.warn(
            "some irradiances lie outside of what Perez's sky was fitted to (clearness 1 to 12.1, brightness "
            "0.01 to 0.6); its shape and luminous efficacy are taken at the edge of that range.",
            SpeculariaWarning,
            stacklevel=3,
        )
    return found


def sun_direction(job: RoomJob) -> Array:
    """[3] unit vector towards the sun."""
    sun = at(job).sun
    assert sun is not None
    x, _, out = pane_axes(sun.wall)
    e, a = np.radians(sun.elevation_deg), np.radians(sun.azimuth_deg)
    # Clockwise from above, from the outward normal, is to the left of somebody who looks at the wall from
    # outside: against the sample's x.
    return np.cos(e) * (np.cos(a) * out - np.sin(a) * x) + np.sin(e) * np.array([0.0, 0.0, 1.0])


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
