"""The hours of a day: what is lit, what is left out, what is kept when a run stops."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from daylight_models import Diffuser, Lobe, room, sensors
from test_daylight_room_file import tabulated

from specularia import daylight
from specularia.daylight import hours as module
from specularia.errors import FormatError

PLACE = {"latitude_deg": 37.94, "longitude_deg": 27.34, "time_zone": "solar"}
DAY = {"dates": ["0620-06-21"], "calendar": "julian", "from_hour": 3.0, "to_hour": 15.0, "step_hours": 6.0}
QUICK = {"sampling": 0.2, "repeats": 2}

ROOM = """
name = "test"
[room]
width_m = 4.0
depth_m = 5.0
height_m = 2.8
[[window]]
width_m = 0.8
height_m = 1.1
sill_m = 1.0
[place]
latitude_deg = 37.94
longitude_deg = 27.34
time_zone = "solar"
[day]
dates = ["0620-06-21"]
calendar = "julian"
from_hour = 3
to_hour = 15
step_hours = 6
[[sensor]]
name = "floor"
position_m = [2.0, 1.0, 0.0]
[[view]]
position_m = [2.0, 4.5, 1.5]
direction = [0, -1, 0]
size_px = [16, 12]
[quality]
sampling = 0.06
repeats = 2
[[model]]
name = "A"
file = "m.nc"
"""


def test_morning_and_afternoon_mirror_each_other_in_a_room_that_faces_south(tmp_path: Path) -> None:
    """Same elevation, mirrored azimuth: a point gets after noon what its mirror image got before."""
    points = [(1.7, 1.0, 0.0), (3.3, 1.0, 0.0)]
    job = room(
        place=PLACE,
        sky={"kind": "clear"},
        day=DAY | {"from_hour": 10.5, "to_hour": 13.5, "step_hours": 3.0},
        sensor=sensors(points, (0, 0, 1)),
        quality=QUICK,
    )
    found = daylight.day(job, folder=tmp_path, models={"lobe": Lobe(25.0, cells=80)})
    east_in = {h.time.hour: [p.illuminance_lx for p in h.points] for h in found.hours}
    assert east_in[13.5][::-1] == pytest.approx(east_in[10.5], rel=0.02)
    # The sun is in the east in the morning and shines west.
    assert east_in[10.5][0] > 1.5 * east_in[10.5][1]


def test_a_turned_room_gets_its_light_when_the_sun_comes_round(tmp_path: Path) -> None:
    """A room whose north points west: its south wall faces east and is lit in the morning alone."""
    job = room(
        place=PLACE | {"orientation_deg": -90.0},
        sky={"kind": "none"},
        day=DAY | {"from_hour": 8.0, "to_hour": 16.0, "step_hours": 8.0},
        sensor=sensors([(2.5, 3.0, 0.0)], (0, 0, 1)),
        quality=QUICK,
    )
    found = daylight.day(job, folder=tmp_path, models={"d": Diffuser(0.5)})
    morning, afternoon = (h.points[0].illuminance_lx for h in found.hours)
    assert morning > 10.0
    assert afternoon == 0.0


def through_a_diffuser(real: Any, job: Any, words: dict[str, Any]) -> Any:
    """A run as asked for, but through a pane that is quicker than one from a file."""
    bare = job.model_copy(update={"model": ()})
    return real(bare, **(words | {"models": {"A": Diffuser(0.5)}}))


@pytest.fixture
def counted(monkeypatch: pytest.MonkeyPatch) -> list[float]:
    """Hours that are really rendered."""
    done: list[float] = []
    real = module.run

    def run(job: Any, **words: Any) -> Any:
        done.append(job.time.hour)
        return through_a_diffuser(real, job, words)

    monkeypatch.setattr(module, "run", run)
    return done


def test_an_hour_of_the_day_is_what_a_run_at_that_time_gives_and_is_kept(tmp_path: Path, counted) -> None:  # type: ignore[no-untyped-def]
    tabulated(tmp_path / "m.nc")
    path = tmp_path / "ROOM.toml"
    path.write_text(ROOM)
    first = daylight.day(path, folder=tmp_path / "out")
    assert counted == [9.0, 15.0]
    assert [(t.hour, "elevation of -" in why) for t, why in first.left_out] == [(3.0, True)]
    path.write_text(ROOM + '[time]\ndate = "0620-06-21"\ncalendar = "julian"\nhour = 9\n')
    alone = daylight.run(path, models={"A": Diffuser(0.5)}, folder=tmp_path / "alone")
    assert first.hours[0].points == alone.points
    assert first.hours[0].images[0].luminance() == pytest.approx(alone.images[0].luminance, rel=1e-6)
    path.write_text(ROOM)
    again = daylight.day(path, folder=tmp_path / "out")
    assert counted == [9.0, 15.0], "nothing changed"
    assert [h.points for h in again.hours] == [h.points for h in first.hours]
    assert again.hours[1].images == first.hours[1].images
    # One more hour is done alone; another seed makes an hour anew.
    daylight.day(path, folder=tmp_path / "out", hours=(9.0, 15.0, 3.0))
    assert counted == [9.0, 15.0, 12.0]
    daylight.day(path, folder=tmp_path / "out", hours=(9.0, 9.0, 1.0), seed=1)
    assert counted[3:] == [9.0]


def test_a_run_that_was_stopped_goes_on_where_it_was(tmp_path: Path, monkeypatch) -> None:  # type: ignore[no-untyped-def]
    tabulated(tmp_path / "m.nc")
    path = tmp_path / "ROOM.toml"
    path.write_text(ROOM)
    real, done = module.run, []

    def run(job: Any, **words: Any) -> Any:
        if job.time.hour == 15.0 and 15.0 not in done:
            done.append(15.0)
            # What a kill leaves: pictures of an hour without its record.
            through_a_diffuser(real, job, words)
            raise KeyboardInterrupt
        done.append(job.time.hour)
        return through_a_diffuser(real, job, words)

    monkeypatch.setattr(module, "run", run)
    with pytest.raises(KeyboardInterrupt):
        daylight.day(path, folder=tmp_path / "out")
    found = daylight.day(path, folder=tmp_path / "out")
    assert done == [9.0, 15.0, 15.0]
    assert [h.time.hour for h in found.hours] == [9.0, 15.0]


def test_the_command_leaves_a_page_a_figure_and_all_numbers(tmp_path: Path, command) -> None:  # type: ignore[no-untyped-def]
    tabulated(tmp_path / "m.nc")
    path = tmp_path / "ROOM.toml"
    path.write_text(ROOM.replace("[[model]]\n", '[[model]]\nname = "B"\nfile = "m.nc"\n[[model]]\n'))
    out = tmp_path / "out"
    code, result, err = command("daylight", "day", path, "-o", out, "--hours", "3,9,6", "--json", "-q")
    assert code == 0, err
    rows = [(p["date"], p["calendar"], p["hour"], p["name"], p["model"]) for p in result["points"]]
    assert rows == [("0620-06-21", "julian", 9.0, "floor", m) for m in ("B", "A")]
    a, b = result["points"]
    assert a["illuminance_lx"] == b["illuminance_lx"] > 10 and a["se"] > 0
    assert [(x["hour"], x["date"]) for x in result["left_out"]] == [(3.0, "0620-06-21")]
    hour = result["hours"][0]
    assert hour["sun"]["gregorian"] == "0620-06-24"
    assert all(Path(i["npz"]).is_file() for i in hour["images"])
    assert json.loads((out / "day.json").read_text())["points"] == result["points"]
    assert Path(result["files"]["html"]).is_file() and Path(result["files"]["figure"]).is_file()
    assert "synthetic" in result["provenance"]
    code, text, err = command("daylight", "day", path, "-o", out, "--hours", "3,9,6")
    assert code == 0 and "1 of 2 hours left out for want of light" in text
    assert "1 hours of light, 0 of them new; 1 without light left out" in err


@pytest.mark.parametrize(
    ("change", "words", "says"),
    [
        (
            ("from_hour = 3", "from_hour = 0"),
            {"hours": (0.0, 3.0, 1.0)},
            "at least one hour of light, found 4",
        ),
        (('calendar = "julian"', ""), {}, "calendar"),
        (('dates = ["0620-06-21"]', 'dates = ["0620-06-31"]'), {}, "a day of the Julian calendar"),
        (("[day]", "[sun]\nelevation_deg = 40\n[day]"), {}, "whose sun follows from date"),
        (("latitude_deg = 37.94", "latitude_deg = 97.94"), {}, "latitude_deg"),
        (("[place]", "[place]\nnorth_deg = 5"), {}, "north_deg"),
        (("[[sensor]]", "[sky]\nkind = 'perez'\n[[sensor]]"), {}, "direct_normal_irradiance_w_m2"),
        (("position_m = [2.0, 1.0, 0.0]", "position_m = [2.0, 9.0, 0.0]"), {}, "sensor 'floor'"),
        (("", ""), {"dates": ["0620-6-1"], "calendar": "julian"}, "a date like"),
        (("", ""), {"hours": (9.0, 3.0, 1.0)}, "a to_hour that is not before from_hour"),
        (('[[model]]\nname = "A"\nfile = "m.nc"\n', ""), {}, "at least one scattering model"),
    ],
)
def test_a_day_that_cannot_be_is_refused_before_any_rendering(
    tmp_path: Path, change: tuple[str, str], words: dict[str, Any], says: str
) -> None:
    path = tmp_path / "ROOM.toml"
    assert change[0] in ROOM
    path.write_text(ROOM.replace(*change) if change[0] else ROOM)
    with pytest.raises(FormatError) as caught:
        daylight.day(path, folder=tmp_path / "out", **words)
    assert says in str(caught.value)
    assert "ROOM.toml" in str(caught.value)
    assert not (tmp_path / "out").exists()


def test_a_day_of_a_weather_file_goes_by_its_hours(shared_data: Path, tmp_path: Path) -> None:
    content = room(sensor=sensors([(2.5, 1.0, 0.0)], (0, 0, 1)), quality=QUICK)
    job = daylight.RoomJob.model_validate(
        content.model_dump(exclude={"sky", "sun"}, exclude_none=True)
        | {
            "weather": {"file": str(shared_data / "weather" / "oakland.epw")},
            "day": {"dates": ["2001-01-01"], "from_hour": 6.5, "to_hour": 12.5, "step_hours": 6.0},
        }
    )
    found = daylight.day(job, folder=tmp_path, models={"d": Diffuser(0.5)})
    (hour,) = found.hours
    assert (hour.time.hour, hour.sky, found.clock) == (12.5, "perez", "UT-8 h")
    assert len(found.left_out) == 1
    # Row of hour 13 (12 to 13 o'clock).
    row = (shared_data / "weather" / "oakland.epw").read_text().splitlines()[8 + 12].split(",")
    assert 95 < hour.sun_normal_lx / float(row[14]) < 125
    assert np.isfinite(hour.points[0].illuminance_lx) and hour.points[0].illuminance_lx > 50
