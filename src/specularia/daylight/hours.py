"""The hours of chosen days: the room lit at each, kept one by one so that a run that was stopped goes on."""

from __future__ import annotations

import json
import warnings
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pydantic import ValidationError

from specularia.bsdf import ScatteringModel
from specularia.daylight.checks import room_of
from specularia.daylight.colour import Coloured
from specularia.daylight.job import Quality, RoomJob
from specularia.daylight.lit import run
from specularia.daylight.moment import Dark, at, position_at
from specularia.daylight.outdoors import outdoors
from specularia.daylight.panes import Glazing, named_glazing
from specularia.daylight.results import DaylightResult, Point
from specularia.daylight.sun import SunPosition
from specularia.daylight.when import Day, Time
from specularia.errors import FormatError, SpeculariaWarning
from specularia.files import make_folder, write_json
from specularia.jobs import load_toml
from specularia.progress import note, task
from specularia.provenance import digest, file_digest, record, versions

__all__ = ["DayHour", "DayImage", "DayResult", "day"]


@dataclass(frozen=True)
class DayImage:
    """A luminance picture of one hour.

    Attributes
    ----------
    model, name : of the scattering model and of the view.
    npz : holds `luminance` [rows, columns] in cd/m2, row 0 at the top.
    pixels : columns, rows of every sensor in view, as in `Image`.
    """

    model: str
    name: str
    npz: Path
    pixels: dict[str, tuple[float, float]]

    def luminance(self) -> NDArray[np.float64]:
        """The picture, read from its file."""
        with np.load(self.npz) as held:
            return np.asarray(held["luminance"], float)


@dataclass(frozen=True)
class DayHour:
    """The room at one hour.

    Attributes
    ----------
    time, position : the hour, and where the sun stands in the world.
    sky : kind of the sky.
    sun_normal_lx, sky_horizontal_lx : of the sun on a plane square to it, and of the sky on the ground.
    points, images : sensors and views, for each model in turn.
    """

    time: Time
    position: SunPosition
    sky: str
    sun_normal_lx: float
    sky_horizontal_lx: float
    points: list[Point]
    images: list[DayImage]


@dataclass(frozen=True)
class DayResult:
    """All hours of the chosen days.

    Attributes
    ----------
    name : of the room.
    clock : what its hours count: true solar time, or hours ahead of UT.
    hours : those with light, in order.
    left_out : those without: the time and why.
    provenance : inputs, parameters, seed and versions.
    """

    name: str
    clock: str
    hours: list[DayHour]
    left_out: list[tuple[Time, str]]
    provenance: dict[str, str]

    @property
    def dates(self) -> list[str]:
        """Dates that have an hour of light."""
        return list(dict.fromkeys(h.time.date for h in self.hours))

    @property
    def models(self) -> list[str]:
        """Names of the models, in order."""
        hour = self.hours[0]
        return list(dict.fromkeys([p.model for p in hour.points] + [i.model for i in hour.images]))

    def record(self) -> dict[str, Any]:
        """Everything but the pictures, for JSON: one row per hour, point and model."""
        return {
            "clock": self.clock,
            "points": [
                {
                    "date": h.time.date,
                    "calendar": h.time.calendar or "gregorian",
                    "hour": h.time.hour,
                    **asdict(p),
                }
                for h in self.hours
                for p in h.points
            ],
            "hours": [
                {
                    "date": h.time.date,
                    "calendar": h.time.calendar or "gregorian",
                    "hour": h.time.hour,
                    "sun": asdict(h.position),
                    "sky": h.sky,
                    "sun_normal_lx": h.sun_normal_lx,
                    "sky_horizontal_lx": h.sky_horizontal_lx,
                    "images": [{"name": i.name, "model": i.model, "npz": i.npz.resolve()} for i in h.images],
                }
                for h in self.hours
            ],
            "left_out": [
                {"date": t.date, "calendar": t.calendar or "gregorian", "hour": t.hour, "why": why}
                for t, why in self.left_out
            ],
        }


def day(
    room: str | Path | RoomJob,
    *,
    folder: str | Path,
    models: Mapping[str, ScatteringModel | Coloured | str | Path] | None = None,
    dates: Sequence[str] | None = None,
    calendar: str | None = None,
    hours: tuple[float, float, float] | None = None,
    seed: int = 0,
    quality: Quality | None = None,
) -> DayResult:
    """Light a room at the hours of chosen days.

    Every hour is a run of its own (`run`), with sun and sky of that hour. It is kept in `folder`/hours; hours
    that are there already, made from the same room, models, seed and versions, are not made again.

    Parameters
    ----------
    room : a ROOM.toml with [place] (or [weather]), or its content.
    folder : for pictures and results.
    models : scattering models, or files that hold them, by name, as in `run`. Hours of models that are no
        files are made anew each time: nothing says whether they changed.
    dates, calendar, hours : instead of what the room's [day] says; the last: first hour, last hour, step.
        With neither, the day of [time].
    seed, quality : as in `run`.

    Raises
    ------
    FormatError : no date, a room that cannot be, or no hour of light at all; before anything is rendered.
    """
    file = Path("room") if isinstance(room, RoomJob) else Path(room)
    job = room if isinstance(room, RoomJob) else load_toml(room, RoomJob)
    if quality is not None:
        job = job.model_copy(update={"quality": quality})
    times = _wanted(job, file, dates, calendar, hours).times()
    lit, dark = _sorted(job, times, file)
    given: dict[str, Any] = {m.name: m.file for m in job.model} | dict(models or {})
    if not given and not job.references:
        raise FormatError(
            file=file,
            expected="at least one scattering model for the panes",
            found="none",
            advice="Add [[model]] to the room or give --model NAME=FILE.",
        )
    inputs = {name: Path(m) for name, m in given.items() if isinstance(m, (str, Path))}
    others = [g.file for g in job.glass] + [f for m in job.model for f in m.members] + job.other_bands
    if job.geometry is not None:
        others += [f for f in (job.geometry.file, job.geometry.materials) if f is not None]
    every = {**inputs, **{f"file {k}": path for k, path in enumerate(others)}}
    named = {name: file_digest(path) if path.exists() else None for name, path in every.items()}
    folder = make_folder(folder)
    done: list[DayHour] = []
    synthetic, new = False, 0
    # Read once, so that what follows from a model alone is worked out for the first hour only.
    glazing: dict[str, Glazing] = {}
    with task("hours", len(lit)) as progress:
        for then in lit:
            assert then.time is not None
            place = make_folder(folder / "hours" / _name(then.time))
            key = _key(then, named, seed) if len(inputs) == len(given) else None
            held = _kept(place, key)
            if held is None:
                glazing = glazing or named_glazing(job.model, models or {})
                with _sun_may_be_behind():
                    result = run(then, models=glazing, folder=place, seed=seed)
                held = _held(result)
                # Written last: an hour without it was not finished.
                write_json(place / "hour.json", {"key": key, **held})
                new += 1
            synthetic |= bool(held["synthetic"])
            done.append(_hour(job, then, held, place, file))
            progress.advance()
    note(f"{len(done)} hours of light, {new} of them new; {len(dark)} without light left out")
    provenance = record(
        what=f"daylight through the day in {job.name}",
        inputs=[*([] if isinstance(room, RoomJob) else [file]), *every.values(), *_weather(job)],
        parameters={"room": job, "times": [str(t) for t in times]},
        seed=seed,
        synthetic=synthetic,
    )
    zone = lit[0].place.time_zone if lit[0].place else 0.0
    clock = "true solar time" if isinstance(zone, str) else f"UT{zone:+g} h"
    return DayResult(job.name, clock, done, dark, provenance)


def _wanted(
    job: RoomJob,
    file: Path,
    dates: Sequence[str] | None,
    calendar: str | None,
    hours: tuple[float, float, float] | None,
) -> Day:
    """The room's [day] with what was given put in its place."""
    table: dict[str, Any] = {} if job.day is None else job.day.model_dump(exclude_none=True)
    if job.day is None and job.time is not None:
        table = {"dates": [job.time.date], "calendar": job.time.calendar}
    if dates:
        table |= {"dates": list(dates), "calendar": None}
    if calendar is not None:
        table["calendar"] = calendar
    if hours is not None:
        table |= dict(zip(("from_hour", "to_hour", "step_hours"), hours))
    if "dates" not in table:
        raise FormatError(
            file=file,
            expected="dates to go through",
            found="none",
            advice="Add a table [day] with dates, or give --date.",
        )
    if job.sun is not None:
        raise FormatError(
            file=file,
            expected="a room whose sun follows from date and hour",
            found="the sun's angles in [sun]",
            advice="Leave [sun] out; [place] says where the room is.",
        )
    if job.weather is None and job.sky.kind == "perez":
        raise FormatError(
            file=file,
            expected="a sky that follows the hour",
            found="one irradiance for all hours in [sky]",
            advice="Give a weather file in [weather], or another kind of sky.",
        )
    try:
        return Day.model_validate(table)
    except ValidationError as error:
        said = error.errors()[0]
        raise FormatError(
            file=file,
            expected=".".join(map(str, ["[day]", *said["loc"]]))
            + ": "
            + said["msg"].removeprefix("Value error, "),
            found=str(table),
        ) from error


def _sorted(job: RoomJob, times: Sequence[Time], file: Path) -> tuple[list[RoomJob], list[tuple[Time, str]]]:
    """The room at each hour of light, checked, and the hours without light."""
    lit: list[RoomJob] = []
    dark: list[tuple[Time, str]] = []
    for time in times:
        try:
            lit.append(at(job, time, file=file))
        except Dark as error:
            dark.append((time, error.found))
    if not lit:
        raise FormatError(
            file=file,
            expected="at least one hour of light",
            found=f"{len(dark)} without, such as {dark[0][0]} ({dark[0][1]})",
            advice="Look at the hours, the place and its time zone.",
        )
    with _sun_may_be_behind():
        for then in lit:
            room_of(then, file)
    return lit, dark


@contextmanager
def _sun_may_be_behind() -> Iterator[None]:
    """In the course of a day it is no news that the sun stands behind a window's wall."""
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", message="the sun stands behind", category=SpeculariaWarning)
        yield


def _name(time: Time) -> str:
    return f"{time.date}_{time.hour:05.2f}"


def _key(then: RoomJob, models: Mapping[str, str | None], seed: int) -> str:
    """What an hour's result follows from; where the files lie does not matter."""
    return digest(
        {
            "room": then.model_dump(exclude={"name", "model", "weather", "day"}),
            "models": dict(models),
            "seed": seed,
            "versions": versions(),
        }
    )


def _held(result: DaylightResult) -> dict[str, Any]:
    """What is kept of an hour besides its pictures."""
    return {
        "points": [asdict(p) for p in result.points],
        "images": [
            {"model": i.model, "name": i.name, "npz": i.npz.name, "pixels": i.pixels} for i in result.images
        ],
        "synthetic": "synthetic" in result.provenance,
    }


def _kept(place: Path, key: str | None) -> dict[str, Any] | None:
    """An hour that was finished from the same inputs, or None."""
    try:
        held = json.loads((place / "hour.json").read_text(encoding="utf-8"))
    except (OSError, json.JSONDecodeError):
        return None
    if key is None or not isinstance(held, dict) or held.get("key") != key:
        return None
    return held if all((place / i["npz"]).is_file() for i in held["images"]) else None


def _hour(job: RoomJob, then: RoomJob, held: Mapping[str, Any], place: Path, file: Path) -> DayHour:
    assert then.time is not None
    seen = outdoors(then)
    return DayHour(
        time=then.time,
        position=position_at(job, then.time, file=file)[1],
        sky=seen.kind,
        sun_normal_lx=seen.sun_illuminance,
        sky_horizontal_lx=seen.sky_illuminance,
        points=[Point(**p) for p in held["points"]],
        images=[
            DayImage(
                i["model"], i["name"], place / i["npz"], {k: (v[0], v[1]) for k, v in i["pixels"].items()}
            )
            for i in held["images"]
        ],
    )


def _weather(job: RoomJob) -> list[Path]:
    return [] if job.weather is None else [job.weather.file]
