"""A room at a moment: place and time, or an hour of a weather file, turned into a sun and a sky."""

from __future__ import annotations

import warnings
from pathlib import Path

import numpy as np

from specularia.daylight.job import RoomJob, Sky, Sun
from specularia.daylight.sun import SunPosition, sun_position
from specularia.daylight.weather import read_weather
from specularia.daylight.when import Place, Time
from specularia.errors import FormatError, SpeculariaWarning

__all__ = ["Dark", "at", "position_at"]

_FAR_KM = 100.0
"""Distance of a weather station from the place above which there is a warning."""


class Dark(FormatError):
    """No light at that hour: the sun is below the horizon, or the weather file has no diffuse light."""


def at(job: RoomJob, when: Time | None = None, *, file: str | Path = "ROOM.toml") -> RoomJob:
    """The job with [sun], and where weather sets it [sky], filled in for a moment.

    Parameters
    ----------
    job : a room with `place`, or with a weather file that says where it is.
    when : the moment; None takes the job's own `time`. A job without any, or one that already has its sun, is
        returned as it is.
    file : that errors name.

    Raises
    ------
    Dark : the sun is not above the horizon at that time, or a weather file's hour has no light.
    FormatError : no time, or one that the weather file does not hold.

    Notes
    -----
    The sun stands where its light comes from, refraction included.
    """
    if when is None:
        when = job.time
        if when is None and job.sun is None and job.needs_sun:
            raise FormatError(
                file=file,
                expected="a moment: [time] with date and hour, or the sun's angles in [sun]",
                found="neither",
                advice="To go through the hours of [day] use `specularia daylight day`.",
            )
        if when is None or job.sun is not None:
            return job
    place, position = position_at(job, when, file=file)
    if position.apparent_elevation_deg <= 0.0:
        raise Dark(
            file=file,
            expected="a sun above the horizon",
            found=f"an elevation of {position.apparent_elevation_deg:.2f} degrees at {when}",
            advice="Take an hour of daylight.",
        )
    changes: dict[str, object] = {"place": place, "time": when, "sun": _sun(position, place)}
    if job.weather is not None:
        direct, diffuse = read_weather(job.weather.file).irradiance(position.julian_day)
        if diffuse <= 0.0:
            raise Dark(
                file=job.weather.file,
                expected=f"diffuse light at {when}",
                found=f"a diffuse horizontal irradiance of {diffuse:g} W/m2 in that hour",
                advice="Take an hour of daylight.",
            )
        changes["sky"] = Sky(
            kind="perez",
            direct_normal_irradiance_w_m2=direct,
            diffuse_horizontal_irradiance_w_m2=diffuse,
        )
    return job.model_copy(update=changes)


def position_at(job: RoomJob, when: Time, *, file: str | Path = "ROOM.toml") -> tuple[Place, SunPosition]:
    """Where the room stands, and the sun then."""
    station = None if job.weather is None else read_weather(job.weather.file).place
    place = job.place or station
    if place is None:
        raise FormatError(
            file=file, expected="a table [place] (or [weather]) for a date and an hour", found="neither"
        )
    if station is not None and (far := _distance_km(place, station)) > _FAR_KM:
        warnings.warn(
            f"the weather comes from a station {far:.0f} km away from [place].",
            SpeculariaWarning,
            stacklevel=3,
        )
    return place, sun_position(place, when)


def _sun(position: SunPosition, place: Place) -> Sun:
    """The sun in the room's own compass: azimuth from the outward normal of its south wall."""
    azimuth = position.azimuth_deg - place.orientation_deg - 180.0
    return Sun(
        elevation_deg=position.apparent_elevation_deg,
        azimuth_deg=(azimuth + 180.0) % 360.0 - 180.0,
        wall="south",
    )


def _distance_km(a: Place, b: Place) -> float:
    """Along a great circle."""
    one, two = (np.radians([p.latitude_deg, p.longitude_deg]) for p in (a, b))
    half = np.sin((two - one) / 2.0) ** 2
    chord = half[0] + np.cos(one[0]) * np.cos(two[0]) * half[1]
    return float(2.0 * 6371.0 * np.arcsin(np.sqrt(min(float(chord), 1.0))))
