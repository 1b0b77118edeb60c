"""Tables of ROOM.toml that say where and when: [place], [time], [weather], [day]."""

from __future__ import annotations

import datetime
import re
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import Field, field_validator, model_validator

from specularia.daylight.dates import Calendar, read_date, written
from specularia.jobs import FilePath, Job

__all__ = ["Day", "Place", "Time", "WeatherFile"]

_REFORM = 1583
"""First year that is the Gregorian calendar's from end to end."""

Hour = Annotated[float, Field(ge=0.0, le=24.0)]


class Place(Job):
    """[place]: where the room stands and which way it faces."""

    latitude_deg: Annotated[float, Field(ge=-90.0, le=90.0)]
    """North is positive."""
    longitude_deg: Annotated[float, Field(ge=-180.0, le=180.0)]
    """East is positive."""
    altitude_m: Annotated[float, Field(ge=-500.0, le=9000.0)] = 0.0
    """Above sea level; it sets the air pressure and thereby the refraction."""
    time_zone: Annotated[float, Field(ge=-14.0, le=14.0)] | Literal["solar"]
    """Hours ahead of UT (no summer time), or "solar": at 12 the sun stands due south (or north)."""
    orientation_deg: Annotated[float, Field(ge=-360.0, le=360.0)] = 0.0
    """Bearing of the room's north (+y), clockwise from true north: 90 turns its north wall to the east."""


def _text(value: Any) -> Any:
    """TOML knows dates of its own; written without quotes they mean the same year, month and day."""
    if isinstance(value, datetime.date) and not isinstance(value, datetime.datetime):
        return f"{value.year:04d}-{value.month:02d}-{value.day:02d}"
    return value


def _old(date: str) -> bool:
    return date[:-6].lstrip("+-").isdigit() and int(date[:-6]) < _REFORM


def _stated(dates: tuple[str, ...], calendar: Calendar | None) -> None:
    """Dates must exist, and old ones say their calendar."""
    for date in dates:
        if re.match(r"[+-]?\d{4}-", date) and not -1999 <= int(date[:-6]) <= 3000:
            raise ValueError(f"a year from -1999 to 3000, for which the sun is known, not {date}")
        if calendar is None:
            # A leap day that only the Julian calendar has must not hide that the calendar is missing.
            read_date(date, calendar="julian" if _old(date) else "gregorian")
            if _old(date):
                raise ValueError(
                    f'calendar = "julian" or "gregorian" with the date {date}, which lies before {_REFORM}: '
                    "in the year 620 the two are three days apart"
                )
        else:
            read_date(date, calendar=calendar)


class Time(Job):
    """[time]: a moment, in the time of `Place.time_zone`."""

    date: str
    """YYYY-MM-DD; years before 1 AD as astronomers count them (1 BC is 0000, 2 BC -0001)."""
    calendar: Calendar | None = None
    """Of the date; it must be given for years before 1583, and is Gregorian if it is left out."""
    hour: Hour
    """With decimals: 10.5 is half past ten."""

    _text = field_validator("date", mode="before")(_text)

    @model_validator(mode="after")
    def _exists(self) -> Time:
        _stated((self.date,), self.calendar)
        return self

    @property
    def day_number(self) -> int:
        """Julian day number of the date."""
        return read_date(self.date, calendar=self.calendar or "gregorian")

    @property
    def gregorian(self) -> str:
        """The date in the (proleptic) Gregorian calendar."""
        return written(self.day_number, calendar="gregorian")

    def __str__(self) -> str:
        minutes = round(self.hour * 60)
        calendar = f" ({(self.calendar or 'gregorian').capitalize()})"
        return f"{self.date}{calendar if self.calendar else ''} {minutes // 60:02d}:{minutes % 60:02d}"


class WeatherFile(Job):
    """[weather]: sky and sun from a weather file's irradiances, by the model of Perez."""

    file: FilePath
    """An EPW file. Its place and time zone hold where [place] is left out."""


class Day(Job):
    """[day]: the hours that `specularia daylight day` goes through."""

    dates: Annotated[tuple[str, ...], Field(min_length=1, max_length=366)]
    """Dates as in [time]."""
    calendar: Calendar | None = None
    """Of the dates, as in [time]."""
    from_hour: Hour = 4.0
    to_hour: Hour = 20.0
    """Last hour, itself included."""
    step_hours: Annotated[float, Field(ge=1.0 / 60.0, le=24.0)] = 1.0

    @field_validator("dates", mode="before")
    @classmethod
    def _texts(cls, value: Any) -> Any:
        return [_text(v) for v in value] if isinstance(value, (list, tuple)) else value

    @model_validator(mode="after")
    def _ordered(self) -> Day:
        _stated(self.dates, self.calendar)
        if self.to_hour < self.from_hour:
            raise ValueError("a to_hour that is not before from_hour")
        twice = sorted({d for d in self.dates if self.dates.count(d) > 1})
        if twice:
            raise ValueError(f"dates that differ; {', '.join(twice)} stands there twice")
        return self

    def times(self) -> list[Time]:
        """Every date with every hour, in order."""
        count = int(np.floor((self.to_hour - self.from_hour) / self.step_hours + 1e-6)) + 1
        hours = [round(self.from_hour + k * self.step_hours, 6) for k in range(count)]
        return [Time(date=d, calendar=self.calendar, hour=h) for d in self.dates for h in hours]
