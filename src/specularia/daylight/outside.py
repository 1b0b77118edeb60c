"""A summary of sun and sky over a room at a moment, without any rendering."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from pydantic import ValidationError

from specularia.daylight.job import RoomJob
from specularia.daylight.moment import at, position_at
from specularia.daylight.outdoors import outdoors
from specularia.daylight.when import Time
from specularia.errors import FormatError
from specularia.jobs import load_toml

__all__ = ["outside_at"]


def outside_at(
    room: str | Path | RoomJob,
    *,
    date: str | None = None,
    hour: float | None = None,
    calendar: str | None = None,
) -> dict[str, Any]:
    """Angles of the sun, calendars and illuminances at a moment; the units are in the names.

    Parameters
    ----------
    room : a ROOM.toml or its content.
    date, hour, calendar : of the moment; None takes those of the room's [time]. Without any moment the angles
        in [sun] are told back.

    Raises
    ------
    FormatError : a date that is none, or a sun that is not above the horizon.
    """
    file = Path("room") if isinstance(room, RoomJob) else Path(room)
    job = room if isinstance(room, RoomJob) else load_toml(room, RoomJob)
    when = _moment(job.time, file, date=date, hour=hour, calendar=calendar)
    out: dict[str, Any] = {}
    if when is not None:
        place, position = position_at(job, when, file=file)
        out = {
            "date_gregorian": position.gregorian,
            "date_julian": position.julian,
            "hour": when.hour,
            "time_zone": place.time_zone,
            "solar_hour": position.solar_hour,
            "julian_day_ut": position.julian_day,
            "delta_t_s": position.delta_t_s,
            "sun_elevation_deg": position.elevation_deg,
            "sun_apparent_elevation_deg": position.apparent_elevation_deg,
            "sun_azimuth_deg": position.azimuth_deg,
        }
    job = at(job, when, file=file)
    seen = outdoors(job)
    if job.sun is not None:
        out |= {
            "room_elevation_deg": job.sun.elevation_deg,
            "room_azimuth_deg": job.sun.azimuth_deg,
            "room_azimuth_from": f"outward normal of the {job.sun.wall} wall, clockwise",
        }
    return out | {
        "sky": seen.kind,
        "direct_normal_irradiance_w_m2": job.sky.direct_normal_irradiance_w_m2,
        "diffuse_horizontal_irradiance_w_m2": job.sky.diffuse_horizontal_irradiance_w_m2,
        "sun_normal_lx": seen.sun_illuminance,
        "sky_horizontal_lx": seen.sky_illuminance,
        "zenith_cd_m2": seen.zenith,
        "ground_cd_m2": seen.ground,
    }


def _moment(own: Time | None, file: Path, **given: Any) -> Time | None:
    """The file's time with what was given put in its place."""
    given = {name: value for name, value in given.items() if value is not None}
    if not given:
        return own
    if "date" in given or own is None:
        if not {"date", "hour"} <= {*given, *(() if own is None else ("hour",))}:
            raise FormatError(file=file, expected="a date and an hour", found=f"only {', '.join(given)}")
        kept = {} if own is None else {"hour": own.hour}
    else:
        kept = own.model_dump(exclude_none=True)
    try:
        return Time.model_validate(kept | given)
    except ValidationError as error:
        said = error.errors()[0]["msg"].removeprefix("Value error, ")
        raise FormatError(
            file="--date, --hour", expected=said, found=", ".join(map(str, given.values()))
        ) from error
