"""Where the sun stands: place and time to elevation and azimuth, for dates of any age."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from specularia.daylight.dates import written
from specularia.daylight.when import Place, Time

__all__ = ["SunPosition", "sun_position"]

_EPOCH = 2440588
"""Julian day number of 1 January 1970."""

_TEMPERATURE_C = 12.0
"""Of the air, for the refraction; pvlib's default."""


@dataclass(frozen=True)
class SunPosition:
    """Where the sun stands.

    Attributes
    ----------
    elevation_deg : of its centre above the horizon, without refraction.
    apparent_elevation_deg : with refraction by the air: where its light comes from.
    azimuth_deg : clockwise from true north.
    julian_day : of the moment, in universal time (UT1).
    gregorian, julian : local date in the two calendars.
    delta_t_s : terrestrial minus universal time, s.
    solar_hour : true solar time: 12 where the sun stands highest.
    distance_au : of the sun, in its mean distances.
    """

    elevation_deg: float
    apparent_elevation_deg: float
    azimuth_deg: float
    julian_day: float
    gregorian: str
    julian: str
    delta_t_s: float
    solar_hour: float
    distance_au: float


def sun_position(place: Place, time: Time) -> SunPosition:
    """Elevation and azimuth of the sun at a place and time.

    Parameters
    ----------
    place : latitude, longitude, altitude and time zone.
    time : date in its calendar, and hour.

    Notes
    -----
    NREL's solar position algorithm (Reda and Andreas 2004, doi:10.1016/j.solener.2003.12.003) in pvlib:
    0.0003 degrees for the years -2000 to 6000. pvlib's usual entry takes dates from 1677 on; here it gets
    seconds since 1970, counted through whatever the calendar. Delta T follows Espenak and Meeus
    (NASA/TP-2006-214141); it moves the sun along the ecliptic only: 100 s are 0.001 degrees. Refraction is
    for standard air pressure at the place's altitude and 12 degrees C, as in
    `pvlib.solarposition.get_solarposition`.
    """
    from pvlib import atmosphere, spa

    year, month = int(time.gregorian[:-6]), int(time.gregorian[-5:-3])
    delta_t = float(spa.calculate_deltat(year, month))
    air = float(atmosphere.alt2pres(place.altitude_m)) / 100.0
    where = (place.latitude_deg, place.longitude_deg, place.altitude_m, air, _TEMPERATURE_C)

    def solve(unix: float, sidereal: bool = False) -> list[float]:
        found = spa.solar_position(np.array([unix]), *where, delta_t, 0.5667, numthreads=1, sst=sidereal)
        return [float(v[0]) for v in found[:5]]

    def hour_angle(unix: float) -> float:
        """Degrees past the meridian, -180 to 180."""
        sidereal, ascension, _ = solve(unix, sidereal=True)
        return (sidereal + place.longitude_deg - ascension + 180.0) % 360.0 - 180.0

    midnight = (time.day_number - _EPOCH) * 86400.0
    if place.time_zone == "solar":
        unix = midnight + (time.hour - place.longitude_deg / 15.0) * 3600.0
        # The first guess is off by the equation of time, 17 minutes; each step leaves 1/3000 of the error.
        for _ in range(4):
            ahead = (hour_angle(unix) - 15.0 * (time.hour - 12.0) + 180.0) % 360.0 - 180.0
            unix -= ahead * 240.0
    else:
        unix = midnight + (time.hour - place.time_zone) * 3600.0
    _, zenith, apparent, _, azimuth = solve(unix)
    return SunPosition(
        elevation_deg=90.0 - zenith,
        apparent_elevation_deg=apparent,
        azimuth_deg=azimuth,
        julian_day=unix / 86400.0 + 2440587.5,
        gregorian=time.gregorian,
        julian=written(time.day_number, calendar="julian"),
        delta_t_s=delta_t,
        solar_hour=12.0 + hour_angle(unix) / 15.0,
        distance_au=float(spa.earthsun_distance(np.array([unix]), delta_t, 1)[0]),
    )
