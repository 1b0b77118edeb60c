"""EPW files read, WEA files written, and rooms under a weather file's hour."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from daylight_models import room

from specularia.daylight.moment import at
from specularia.daylight.outdoors import outdoors
from specularia.daylight.weather import read_weather
from specularia.daylight.when import Time
from specularia.errors import FormatError, SpeculariaWarning


@pytest.fixture
def oakland(shared_data: Path) -> Path:
    return shared_data / "weather" / "oakland.epw"


def test_the_weather_of_oakland_becomes_its_wea_line_by_line(
    shared_data: Path, tmp_path: Path, command
) -> None:  # type: ignore[no-untyped-def]
    truth = (shared_data / "weather" / "oakland.wea").read_text().splitlines()
    code, result, err = command(
        "daylight", "wea", shared_data / "weather" / "oakland.epw", "-o", tmp_path / "o.wea", "--json"
    )
    assert code == 0, err
    ours = (tmp_path / "o.wea").read_text().splitlines()
    assert ours == truth
    assert result["hours"] == 8760 == len(truth) - 6
    assert result["latitude_deg"] == 37.72 and result["longitude_deg"] == -122.22


def test_a_moment_gets_the_hour_that_it_lies_in(oakland: Path) -> None:
    """1 January, the row of hour 11 (10 to 11 o'clock): 712 and 95 W/m2."""
    job = weather_room(oakland)
    for hour, expected in [(10.0, (712, 95)), (10.5, (712, 95)), (10.99, (712, 95)), (11.0, (655, 129))]:
        sky = at(job, Time(date="2001-01-01", hour=hour)).sky
        assert sky.kind == "perez"
        assert (sky.direct_normal_irradiance_w_m2, sky.diffuse_horizontal_irradiance_w_m2) == expected
    # True solar time there is 9 minutes (longitude) and 3 (equation of time) behind the zone's.
    place = read_weather(oakland).place.model_copy(update={"time_zone": "solar"})
    solar = job.model_copy(update={"place": place})
    sky = at(solar, Time(date="2001-01-01", hour=10.85)).sky
    assert sky.direct_normal_irradiance_w_m2 == 655


def weather_room(file: Path, **changes: object):  # type: ignore[no-untyped-def]
    from specularia.daylight.job import RoomJob

    content = room().model_dump(exclude={"sky", "sun"}, exclude_none=True)
    return RoomJob.model_validate(content | {"weather": {"file": str(file)}} | changes)


def test_sun_and_sky_of_an_hour_give_the_global_illuminance_that_the_file_has_of_its_own(
    oakland: Path,
) -> None:
    """The file has it from another model, with the hour's own humidity: 1.6 % (median) apart over the year.

    Its diffuse part alone is what direct and global leave, and 8 % lower than ours.
    """
    job = weather_room(oakland)
    rows = [line.split(",") for line in oakland.read_text().splitlines()[8:]]
    ratios = []
    for month, hour in [(m, h) for m in (1, 4, 7, 10) for h in (9, 11, 13, 15)]:
        row = next(r for r in rows if r[1:4] == [str(month), "9", str(hour + 1)])
        then = at(job, Time(date=f"{row[0]}-{month:02d}-09", hour=hour + 0.5))
        out = outdoors(then)
        assert out.kind == "perez" and out.sun is not None
        ratios.append((out.sun_illuminance * out.sun[2] + out.sky_illuminance) / float(row[16]))
    assert np.median(ratios) == pytest.approx(1.0, abs=0.03)
    assert np.all(np.abs(np.array(ratios) - 1) < 0.1)


@pytest.mark.parametrize(
    ("date", "hour", "says"),
    [
        ("2020-02-29", 12.0, "no row of it"),
        ("2001-01-01", 2.5, "sun above the horizon"),
        ("2001-01-01", 7.5, "diffuse"),
    ],
)
def test_hours_without_light_or_without_a_row_are_refused(
    oakland: Path, tmp_path: Path, date, hour, says
) -> None:  # type: ignore[no-untyped-def]
    lines = oakland.read_text().splitlines()
    dark = [",".join([*r[:15], "0", *r[16:]]) for r in (line.split(",") for line in lines[8:])]
    (tmp_path / "dark.epw").write_text("\n".join(lines[:8] + dark))
    job = weather_room(tmp_path / "dark.epw")
    with pytest.raises(FormatError, match=says):
        at(job, Time(date=date, hour=hour))


def test_files_that_are_no_weather_are_refused_with_their_name(oakland: Path, tmp_path: Path) -> None:
    from specularia.daylight.weather import write_wea

    (tmp_path / "a.epw").write_text("not,a,weather,file\n1,2\n")
    with pytest.raises(FormatError, match=r"a\.epw: expected an EPW weather file"):
        read_weather(tmp_path / "a.epw")
    lines = oakland.read_text().splitlines()
    (tmp_path / "twice.epw").write_text("\n".join([*lines, lines[-1]]))
    with pytest.raises(FormatError, match="comes twice"):
        read_weather(tmp_path / "twice.epw")
    row = lines[20].split(",")
    lines[20] = ",".join([*row[:14], "9999", *row[15:]])
    (tmp_path / "missing.epw").write_text("\n".join(lines))
    with pytest.raises(FormatError, match=r"missing\.epw, line 21: .*9999"):
        write_wea(read_weather(tmp_path / "missing.epw"), tmp_path / "m.wea")
    assert not (tmp_path / "m.wea").exists()
    with pytest.raises(FormatError, match="9999"):
        at(weather_room(tmp_path / "missing.epw"), Time(date="2001-01-01", hour=12.5))


def test_weather_sets_the_sky_alone_and_tells_of_a_station_far_away(oakland: Path) -> None:
    with pytest.raises(ValueError, match=r"no \[sky\] beside \[weather\]"):
        weather_room(oakland, sky={"kind": "clear"})
    away = {"latitude_deg": 37.94, "longitude_deg": 27.34, "time_zone": "solar"}
    job = weather_room(oakland, place=away)
    with pytest.warns(SpeculariaWarning, match=r"station 1\d{4} km away"), pytest.raises(FormatError):
        # Noon at one is night at the other.
        at(job, Time(date="2001-06-21", hour=12.0))
