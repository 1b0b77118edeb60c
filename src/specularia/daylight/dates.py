"""Dates of the Julian and the Gregorian calendar as days counted through, years before 1 AD included."""

from __future__ import annotations

import re
from typing import Literal

__all__ = ["Calendar", "civil_date", "julian_day_number", "read_date", "written"]

Calendar = Literal["gregorian", "julian"]

_PATTERN = re.compile(r"([+-]?\d{4})-(\d{2})-(\d{2})")

_FIRST_YEAR = -4799
"""The formulas below count from 1 March 4801 BC."""


def julian_day_number(year: int, month: int, day: int, *, calendar: Calendar) -> int:
    """Number of the Julian day that begins at noon of a date.

    Parameters
    ----------
    year : astronomical count: 1 BC is 0, 2 BC is -1; not before -4799.
    month, day : 1 to 12, 1 to 31; whether the month has that day is not looked at.
    calendar : of the date. Both are carried back before their introduction ("proleptic").

    Notes
    -----
    Days since 1 March 4801 BC, months counted from March (Explanatory Supplement to the Astronomical Almanac,
    3rd ed., 2013, 15.11).

    >>> julian_day_number(2000, 1, 1, calendar="gregorian")
    2451545
    """
    before_march = month < 3
    y = year + 4800 - before_march
    m = month - 3 + 12 * before_march
    days = day + (153 * m + 2) // 5 + 365 * y + y // 4
    return days - 32083 if calendar == "julian" else days - y // 100 + y // 400 - 32045


def civil_date(number: int, *, calendar: Calendar) -> tuple[int, int, int]:
    """Year, month and day on whose noon a Julian day begins (the inverse; same source)."""
    f = number + 1401
    if calendar == "gregorian":
        f += (4 * number + 274277) // 146097 * 3 // 4 - 38
    e = 4 * f + 3
    h = 5 * (e % 1461 // 4) + 2
    day, month = h % 153 // 5 + 1, (h // 153 + 2) % 12 + 1
    return e // 1461 - 4716 + (14 - month) // 12, month, day


def read_date(text: str, *, calendar: Calendar) -> int:
    """Julian day number of a date written YYYY-MM-DD, as in 0620-06-21.

    Raises
    ------
    ValueError : not of that form, or no day of the calendar.
    """
    found = _PATTERN.fullmatch(text)
    if not found:
        raise ValueError(f"a date like 0620-06-21 (year, month, day), not {text!r}")
    year, month, day = (int(part) for part in found.groups())
    if year >= _FIRST_YEAR and 1 <= month <= 12 and 1 <= day <= 31:
        number = julian_day_number(year, month, day, calendar=calendar)
        if civil_date(number, calendar=calendar) == (year, month, day):
            return number
    raise ValueError(f"a day of the {calendar.capitalize()} calendar, not {text}")


def written(number: int, *, calendar: Calendar) -> str:
    """YYYY-MM-DD of a Julian day number."""
    year, month, day = civil_date(number, calendar=calendar)
    sign = "-" if year < 0 else ""
    return f"{sign}{abs(year):04d}-{month:02d}-{day:02d}"
