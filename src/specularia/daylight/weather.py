"""Weather files: EPW read, Radiance's WEA written."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from specularia.daylight.dates import civil_date
from specularia.daylight.when import Place
from specularia.errors import FormatError
from specularia.files import existing, write_text

__all__ = ["Weather", "read_weather", "write_wea"]

Array = NDArray[np.float64]

_MISSING = 9999.0
"""What EPW writes where an irradiance is not known."""


@dataclass(frozen=True)
class Weather:
    """The hours of a weather file.

    Attributes
    ----------
    file : it came from.
    station, country : names.
    place : latitude, longitude, altitude, and the time zone of the hours.
    date : [hours, 2] month and day.
    hour : [hours] 1 to 24; hour h is the one that ends at h o'clock.
    direct_normal, diffuse_horizontal : [hours] mean irradiances over the hour, W/m2; NaN where missing.
    """

    file: Path
    station: str
    country: str
    place: Place
    date: NDArray[np.int64]
    hour: NDArray[np.int64]
    direct_normal: Array
    diffuse_horizontal: Array

    def irradiance(self, julian_day: float) -> tuple[float, float]:
        """Direct normal and diffuse horizontal irradiance (W/m2) of the hour that a moment lies in.

        Parameters
        ----------
        julian_day : the moment, UT. Its year is not looked at: month and day (Gregorian) choose the row.

        Raises
        ------
        FormatError : a moment that the file does not hold, such as 29 February, or a missing value.
        """
        assert not isinstance(self.place.time_zone, str)
        local = julian_day + 0.5 + self.place.time_zone / 24.0
        # A Julian day of two million is known to 0.04 ms: ten o'clock must not become a little before ten.
        hours = round(local * 24.0, 5)
        number, hour = int(hours // 24.0), int(hours % 24.0) + 1
        _, month, day = civil_date(number, calendar="gregorian")
        rows = np.flatnonzero((self.date[:, 0] == month) & (self.date[:, 1] == day) & (self.hour == hour))
        if rows.size == 0:
            raise FormatError(
                file=self.file, expected=f"the hour {month}-{day}, {hour} of 24", found="no row of it"
            )
        direct, diffuse = float(self.direct_normal[rows[0]]), float(self.diffuse_horizontal[rows[0]])
        if not np.isfinite(direct + diffuse):
            raise FormatError(
                file=self.file,
                expected=f"irradiances in the hour {month}-{day}, {hour} of 24",
                found="9999, which means missing",
                advice="Take another hour or another file.",
            )
        return direct, diffuse


def read_weather(file: str | Path) -> Weather:
    """Read an EPW file with pvlib.

    Raises
    ------
    FormatError : no EPW file, one with several records an hour, or one with an hour twice.
    """
    file = existing(file, what="a weather file (EPW)")
    return _read(file, file.stat().st_mtime_ns)


@lru_cache(maxsize=4)
def _read(file: Path, _changed: int) -> Weather:
    from pvlib import iotools

    try:
        table, head = iotools.read_epw(str(file))
        station = Place(
            latitude_deg=head["latitude"],
            longitude_deg=head["longitude"],
            altitude_m=head["altitude"],
            time_zone=head["TZ"],
        )
        date = table[["month", "day"]].to_numpy(dtype=np.int64)
        hour = table["hour"].to_numpy(dtype=np.int64)
        direct, diffuse = (table[k].to_numpy(dtype=float) for k in ("dni", "dhi"))
    except (ValueError, KeyError, IndexError, OSError, TypeError) as error:
        raise FormatError(
            file=file,
            expected="an EPW weather file (a LOCATION line, seven more header lines, then the hours)",
            found=f"one that cannot be read ({error})",
        ) from error
    keys = np.column_stack([date, hour])
    if len(np.unique(keys, axis=0)) != len(keys):
        raise FormatError(
            file=file,
            expected="one record for each hour of one year",
            found="an hour that comes twice",
        )
    return Weather(
        file=file,
        station=str(head["city"]),
        country=str(head["country"]),
        place=station,
        date=date,
        hour=hour,
        direct_normal=np.where(direct >= _MISSING, np.nan, direct),
        diffuse_horizontal=np.where(diffuse >= _MISSING, np.nan, diffuse),
    )


def write_wea(weather: Weather, path: str | Path) -> Path:
    """Write Radiance's weather file: month, day, middle of the hour, direct normal and diffuse horizontal.

    Its header counts longitude and the time zone's meridian positive to the west; units 1 means W/m2.

    Raises
    ------
    FormatError : an irradiance is missing; the line of the weather file is named.
    """
    missing = np.flatnonzero(~np.isfinite(weather.direct_normal + weather.diffuse_horizontal))
    if missing.size:
        raise FormatError(
            file=weather.file,
            line=int(missing[0]) + 9,
            expected="irradiances in every hour",
            found=f"9999, which means missing, in {missing.size} of {weather.hour.size} hours",
        )
    place = weather.place
    assert not isinstance(place.time_zone, str)
    lines = [
        f"place {weather.station}_{weather.country}",
        f"latitude {place.latitude_deg}",
        f"longitude {0.0 - place.longitude_deg}",
        f"time_zone {0.0 - 15.0 * place.time_zone:g}",
        f"site_elevation {place.altitude_m}",
        "weather_data_file_units 1",
    ]
    lines += [
        f"{month} {day} {hour - 0.5:.3f} {direct:g} {diffuse:g}"
        for (month, day), hour, direct, diffuse in zip(
            weather.date, weather.hour, weather.direct_normal, weather.diffuse_horizontal
        )
    ]
    return write_text(path, "\n".join(lines) + "\n")
