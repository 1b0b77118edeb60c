"""Calendars, the sun's place and skies over it, against pvlib, PyEphem, Meeus and Radiance."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from daylight_models import room

from specularia.daylight.dates import civil_date, julian_day_number, written
from specularia.daylight.moment import at
from specularia.daylight.outdoors import incident_illuminance, outdoors, sun_direction
from specularia.daylight.perez import perez_sky
from specularia.daylight.sky import relative_luminance
from specularia.daylight.sun import sun_position
from specularia.daylight.when import Day, Place, Time
from specularia.errors import FormatError, SpeculariaWarning
from specularia.jobs import load_toml
from specularia.radiance import run

EPHESUS = Place(latitude_deg=37.94, longitude_deg=27.34, altitude_m=20.0, time_zone=0.0)
NOON = Time(date="0620-06-21", calendar="julian", hour=12.0)


@pytest.mark.parametrize(
    ("date", "calendar", "number"),
    [
        # Meeus, Astronomical Algorithms (1998), chapter 7: days that begin at noon.
        ((2000, 1, 1), "gregorian", 2451545),
        ((1957, 10, 4), "gregorian", 2436116),
        ((1582, 10, 15), "gregorian", 2299161),
        ((1582, 10, 4), "julian", 2299160),
        ((333, 1, 27), "julian", 1842713),
        ((837, 4, 10), "julian", 2026872),
        ((-1000, 7, 12), "julian", 1356001),
        ((-4712, 1, 1), "julian", 0),
    ],
)
def test_days_are_counted_as_astronomers_do(date, calendar, number) -> None:  # type: ignore[no-untyped-def]
    assert julian_day_number(*date, calendar=calendar) == number
    assert civil_date(number, calendar=calendar) == date


def test_every_day_of_five_thousand_years_has_one_date_in_each_calendar() -> None:
    for number in range(julian_day_number(-1999, 1, 1, calendar="julian"), 2_816_788, 97):
        for calendar in ("julian", "gregorian"):
            assert julian_day_number(*civil_date(number, calendar=calendar), calendar=calendar) == number
    # numpy's calendar is the proleptic Gregorian.
    days = np.arange("0300-01-01", "0700-01-01", 31, dtype="datetime64[D]")
    ours = [written(int(d) + 2440588, calendar="gregorian") for d in days.astype(int)]
    assert ours == [str(d) for d in days]


def test_the_sun_stands_where_pvlib_says() -> None:
    import pandas as pd
    from pvlib.solarposition import get_solarposition

    rng = np.random.default_rng(1)
    times = pd.date_range("1990-01-03", "2030-12-30", periods=40, tz="UTC").round("s")
    places = zip(rng.uniform(-66, 66, 40), rng.uniform(-180, 180, 40), rng.uniform(0, 2000, 40))
    seen = 0
    for time, (latitude, longitude, altitude) in zip(times, places):
        zone = float(np.round(longitude / 15))
        place = Place(latitude_deg=latitude, longitude_deg=longitude, altitude_m=altitude, time_zone=zone)
        local = time + pd.Timedelta(hours=zone)
        hour = (local - local.normalize()) / pd.Timedelta(hours=1)
        ours = sun_position(place, Time(date=str(local.date()), hour=hour))
        peer = get_solarposition(pd.DatetimeIndex([time]), latitude, longitude, altitude=altitude).iloc[0]
        assert ours.elevation_deg == pytest.approx(peer["elevation"], abs=0.001)
        assert ours.apparent_elevation_deg == pytest.approx(peer["apparent_elevation"], abs=0.001)
        across = (ours.azimuth_deg - peer["azimuth"] + 180) % 360 - 180
        assert abs(across) * np.cos(np.radians(ours.elevation_deg)) < 0.001
        seen += ours.elevation_deg > 0
    assert 10 < seen < 35


@pytest.mark.parametrize(
    ("date", "hour", "elevation", "azimuth"),
    [
        # PyEphem 4.2.1 (VSOP87 by XEphem), no refraction; its dates before 1582 are Julian.
        ("-0098-09-01", 12.0, 52.49565, 228.15776),
        ("0325-03-20", 10.0, 51.81878, 172.47491),
        ("0532-02-23", 8.0, 31.74631, 136.42827),
        ("0620-06-21", 9.5, 73.34118, 146.55201),
        ("0620-12-21", 9.0, 26.08733, 161.17946),
        ("1066-10-14", 9.0, 39.95921, 161.86919),
    ],
)
def test_the_sun_of_late_antiquity_stands_where_another_ephemeris_says(
    date: str, hour: float, elevation: float, azimuth: float
) -> None:
    ours = sun_position(EPHESUS, Time(date=date, calendar="julian", hour=hour))
    assert ours.elevation_deg == pytest.approx(elevation, abs=0.001)
    assert ours.azimuth_deg == pytest.approx(azimuth, abs=0.001)


# Meeus (1998), table 27.A and the terms of table 27.C: ephemeris days of equinoxes, years -1000 to 1000.
MEAN = {
    "march": (1721139.29189, 365242.13740, 0.06134, 0.00111, -0.00071),
    "september": (1721325.70455, 365242.49558, -0.11677, -0.00297, 0.00074),
}
TERMS = np.array(
    [
        *[(485, 324.96, 1934.136), (203, 337.23, 32964.467), (199, 342.08, 20.186), (182, 27.85, 445267.112)],
        *[(156, 73.14, 45036.886), (136, 171.52, 22518.443), (77, 222.54, 65928.934), (74, 296.72, 3034.906)],
        *[(70, 243.58, 9037.513), (58, 119.81, 33718.147), (52, 297.17, 150.678), (50, 21.02, 2281.226)],
        *[(45, 247.54, 29929.562), (44, 325.15, 31555.956), (29, 60.93, 4443.417), (18, 155.12, 67555.328)],
        *[(17, 288.79, 4562.452), (16, 198.04, 62894.029), (14, 199.76, 31436.921), (12, 95.39, 14577.848)],
        *[(12, 287.11, 31931.756), (12, 320.81, 34777.259), (9, 227.73, 1222.114), (8, 15.45, 16859.074)],
    ]
)


def equinox(year: int, which: str) -> float:
    """Julian ephemeris day after Meeus."""
    mean = sum(c * (year / 1000) ** k for k, c in enumerate(MEAN[which]))
    t = (mean - 2451545.0) / 36525
    w = np.radians(35999.373 * t - 2.47)
    stretch = 1 + 0.0334 * np.cos(w) + 0.0007 * np.cos(2 * w)
    return float(
        mean + 1e-5 * np.sum(TERMS[:, 0] * np.cos(np.radians(TERMS[:, 1] + TERMS[:, 2] * t))) / stretch
    )


@pytest.mark.parametrize(
    ("year", "which", "date"),
    [
        (325, "march", "0325-03-20"),
        (325, "september", "0325-09-22"),
        (532, "march", "0532-03-18"),
        (620, "march", "0620-03-17"),
        (620, "september", "0620-09-20"),
    ],
)
def test_at_the_equinoxes_of_antiquity_the_sun_stands_on_the_equator(
    year: int, which: str, date: str
) -> None:
    """Seen from the pole its elevation is its declination less its parallax of 8.8 seconds of arc."""
    pole = Place(latitude_deg=90.0, longitude_deg=0.0, time_zone=0.0)
    noon = sun_position(pole, Time(date=date, calendar="julian", hour=12.0))
    day = equinox(year, which) - noon.delta_t_s / 86400
    assert written(int(np.floor(day + 0.5)), calendar="julian") == date
    hour = (day + 0.5) % 1 * 24
    then = sun_position(pole, Time(date=date, calendar="julian", hour=hour))
    # Declination changes by 0.4 degrees a day: 0.001 degrees are 4 minutes.
    assert then.elevation_deg + 8.8 / 3600 == pytest.approx(0.0, abs=0.001)
    assert abs(noon.elevation_deg) > 0.01


def test_true_solar_time_puts_the_sun_due_south_at_noon_and_mirrors_the_day() -> None:
    place = EPHESUS.model_copy(update={"time_zone": "solar"})
    for date in ("0620-02-11", "0620-06-21", "0620-11-03"):
        noon, early, late = (
            sun_position(place, Time(date=date, calendar="julian", hour=h)) for h in (12.0, 9.0, 15.0)
        )
        assert noon.azimuth_deg == pytest.approx(180.0, abs=0.001)
        assert noon.solar_hour == pytest.approx(12.0, abs=1e-5)
        # Only the declination moves between the two.
        assert early.elevation_deg == pytest.approx(late.elevation_deg, abs=0.1)
        assert early.azimuth_deg == pytest.approx(360.0 - late.azimuth_deg, abs=0.1)
    mean = sun_position(EPHESUS, Time(date="0620-11-03", calendar="julian", hour=12.0 - 27.34 / 15))
    assert 10 < 60 * (mean.solar_hour - 12.0) < 17.0, "the equation of time of November"


@pytest.mark.parametrize(
    ("table", "says"),
    [
        ({"date": "0620-06-21", "hour": 12.0}, "calendar"),
        ({"date": "2023-02-29", "hour": 12.0}, "a day of the Gregorian calendar"),
        ({"date": "0700-02-29", "calendar": "gregorian", "hour": 12.0}, "a day of the Gregorian calendar"),
        ({"date": "21.6.620", "calendar": "julian", "hour": 12.0}, "a date like 0620-06-21"),
        ({"date": "-2500-06-21", "calendar": "julian", "hour": 12.0}, "a year from -1999 to 3000"),
        ({"date": "2020-06-21", "hour": 24.5}, "less than or equal to 24"),
    ],
)
def test_dates_that_cannot_be_are_refused(table: dict[str, object], says: str) -> None:
    with pytest.raises(ValueError, match=says):
        Time.model_validate(table)


def test_a_leap_day_of_the_julian_calendar_and_dates_of_toml_are_dates(tmp_path: Path) -> None:
    assert Time(date="0700-02-29", calendar="julian", hour=1.0).gregorian == "0700-03-04"
    (tmp_path / "t.toml").write_text('date = 0620-06-21\ncalendar = "julian"\nhour = 12')
    assert load_toml(tmp_path / "t.toml", Time).gregorian == "0620-06-24"
    day = Day(dates=("2020-06-21",), from_hour=9, to_hour=10.5, step_hours=0.5)
    assert [t.hour for t in day.times()] == [9.0, 9.5, 10.0, 10.5]


def dated(**changes: object):  # type: ignore[no-untyped-def]
    place = EPHESUS.model_dump() | {
        "time_zone": "solar",
        "orientation_deg": changes.pop("orientation_deg", 0),
    }
    content = {"place": place, "time": NOON.model_dump(), "sky": {"kind": "clear"}}
    return room(**(content | changes))


def test_turning_the_room_turns_the_sun_the_other_way() -> None:
    """A room whose north wall faces east has its south wall to the west: at noon the sun is on its right,
    seen by somebody who looks to its north, which is its east wall."""
    up = np.sin(np.radians(75.66622))
    along = np.sqrt(1 - up * up)
    for bearing, towards in [
        (0, (0, -1)),
        (90, (1, 0)),
        (180, (0, 1)),
        (-90, (-1, 0)),
        (45, (0.5**0.5, -(0.5**0.5))),
    ]:
        sun = sun_direction(dated(orientation_deg=bearing))
        assert sun == pytest.approx([along * towards[0], along * towards[1], up], abs=1e-4)
    # In the afternoon the sun stands in the west.
    late = at(dated(), Time(date="0620-06-21", calendar="julian", hour=15.0))
    assert sun_direction(late)[0] < -0.3


def test_a_sun_below_the_horizon_and_a_job_without_a_moment_are_refused() -> None:
    night = NOON.model_copy(update={"hour": 22.0})
    with pytest.raises(FormatError, match=r"sun above the horizon, found an elevation of -2.* at 0620-06-21"):
        at(dated(), night)
    with pytest.raises(FormatError, match="a moment"):
        outdoors(dated(time=None))
    with pytest.raises(ValueError, match="not both"):
        dated(sun={"elevation_deg": 40.0})
    with pytest.raises(ValueError, match=r"\[place\]"):
        room(time=NOON.model_dump(), sky={"kind": "none"})


def test_a_room_lit_by_date_is_that_lit_by_the_suns_angles() -> None:
    by_date = outdoors(dated(orientation_deg=30))
    place = EPHESUS.model_copy(update={"time_zone": "solar"})
    s = sun_position(place, NOON)
    angles = {"elevation_deg": s.apparent_elevation_deg, "azimuth_deg": s.azimuth_deg - 180 - 30}
    by_angle = outdoors(room(sun=angles, sky={"kind": "clear"}))
    assert by_date.sun == pytest.approx(by_angle.sun)
    assert by_date.sun_illuminance == by_angle.sun_illuminance > 5e4
    assert by_date.zenith == by_angle.zenith


def seen_by_radiance(folder: Path, sky: str, directions: np.ndarray) -> np.ndarray:
    """Luminance of a sky's description (made with -g 0) without its sun, in these directions.

    Radiance blends the sky into the ground, weights (z + 1.01)^10 and (z + 1.01)^-10; this is taken back.
    """
    body = sky[sky.index("void brightfunc") :]
    (folder / "sky.rad").write_text(
        body + "\nskyfunc glow glowing\n0\n0\n4 1 1 1 0\n\nglowing source dome\n0\n0\n4 0 0 1 360\n"
    )
    (folder / "sky.oct").write_bytes(run(["oconv", "sky.rad"], cwd=folder))
    rays = "\n".join("0 0 0 " + " ".join(f"{c:.9f}" for c in d) for d in directions).encode()
    seen = run(["rtrace", "-h", "sky.oct"], data=rays, cwd=folder)
    share = 1 / (1 + (directions[:, 2] + 1.01) ** -20)
    return np.array(seen.split(), float).reshape(-1, 3)[:, 1] * 179 / share


def dome() -> np.ndarray:
    """Directions from near the horizon up."""
    e, a = (
        v.ravel() for v in np.meshgrid(np.radians([2, 12, 25, 40, 60, 80]), np.radians(range(0, 360, 24)))
    )
    return np.stack([np.cos(e) * np.sin(a), np.cos(e) * np.cos(a), np.sin(e)], axis=1)


@pytest.mark.parametrize("elevation", [10.0, 35.0, 65.0])
def test_the_intermediate_sky_is_that_of_gensky(elevation: float, tmp_path: Path) -> None:
    job = room(sky={"kind": "intermediate"}, sun={"elevation_deg": elevation, "azimuth_deg": 40.0})
    out = outdoors(job)
    sky = run(["gensky", "-ang", str(elevation), "40", "+i", "-g", "0"]).decode()
    peer = seen_by_radiance(tmp_path, sky, dome())
    assert out.luminance(dome()) == pytest.approx(peer, rel=0.002)
    assert np.ptp(peer) > 0.5 * peer.mean()
    assert 0 < out.sun_illuminance < 3e4


@pytest.mark.parametrize(
    ("elevation", "direct", "diffuse"),
    [
        (45, 0, 60),
        (45, 20, 120),
        (30, 100, 200),
        (60, 200, 250),
        (25, 300, 150),
        (15, 600, 120),
        (45, 600, 120),
        (70, 900, 80),
    ],
)
def test_the_sky_of_perez_is_that_of_gendaylit(elevation, direct, diffuse, tmp_path: Path) -> None:  # type: ignore[no-untyped-def]
    """All eight classes of clearness. Given angles, gendaylit takes the sun's distance of day number 0."""
    x = 2 * np.pi * -1 / 365
    near = (
        1.00011
        + 0.034221 * np.cos(x)
        + 0.00128 * np.sin(x)
        + 0.000719 * np.cos(2 * x)
        + 7.7e-5 * np.sin(2 * x)
    )
    ours = perez_sky(
        sun_elevation_deg=elevation,
        direct_normal_w_m2=direct,
        diffuse_horizontal_w_m2=diffuse,
        extraterrestrial_w_m2=1367 * near,
    )
    text = {
        unit: run(["gendaylit", "-ang", elevation, 40, "-W", direct, diffuse, "-O", unit, "-g", 0]).decode()
        for unit in (0, 1, 2)
    }
    scale = {u: float(t.split("\n10 ")[-1].split()[0]) for u, t in text.items()}
    # The same shape in lumens and in watts: the ratio of the scales is the luminous efficacy.
    assert ours.diffuse_illuminance == pytest.approx(diffuse * scale[2] / scale[1], rel=1e-3)
    disc = 2 * np.pi * (1 - np.cos(np.radians(0.533 / 2)))
    sun = float(text[2].split("light solar\n0\n0\n3 ")[1].split()[0]) * disc
    assert ours.direct_illuminance == pytest.approx(sun, rel=1e-3)
    e, a = np.radians(elevation), np.radians(40)
    toward = np.array([-np.cos(e) * np.sin(a), -np.cos(e) * np.cos(a), np.sin(e)])
    peer = seen_by_radiance(tmp_path, text[0], dome())
    shape = relative_luminance("perez", dome(), toward, ours)
    assert shape / shape.mean() == pytest.approx(peer / peer.mean(), rel=0.002)


def test_the_sky_of_perez_gives_the_ground_the_diffuse_light_it_was_made_from(tmp_path: Path) -> None:
    sky = {
        "kind": "perez",
        "direct_normal_irradiance_w_m2": 500.0,
        "diffuse_horizontal_irradiance_w_m2": 150.0,
    }
    job = room(sky=sky, sun={"elevation_deg": 40.0, "azimuth_deg": 20.0})
    out = outdoors(job)
    assert out.perez is not None
    flat = incident_illuminance(out, np.array([0.0, 0.0, 1.0]))
    assert flat[1] == pytest.approx(out.perez.diffuse_illuminance, rel=1e-9)
    assert flat[0] == pytest.approx(out.perez.direct_illuminance * np.sin(np.radians(40)), rel=1e-9)
    assert 95 < out.sun_illuminance / 500 < 125 and 110 < out.sky_illuminance / 150 < 150
    # gendaylit scales by 145 patches, so its own sky misses the diffuse illuminance by some per cent.
    text = run(["gendaylit", "-ang", 40, 20, "-W", 500, 150, "-O", 0, "-g", 0]).decode()
    body = text[text.index("void brightfunc") :]
    (tmp_path / "s.rad").write_text(
        body + "\nskyfunc glow glowing\n0\n0\n4 1 1 1 0\n\nglowing source dome\n0\n0\n4 0 0 1 360\n"
    )
    (tmp_path / "s.oct").write_bytes(run(["oconv", "s.rad"], cwd=tmp_path))
    options = "-h -I -ab 1 -ad 40000 -as 0 -lw 1e-8"
    seen = run(["rtrace", *options.split(), "s.oct"], data=b"0 0 0 0 0 1", cwd=tmp_path)
    assert flat[1] == pytest.approx(float(seen.split()[1]) * 179, rel=0.03)


@pytest.mark.parametrize(
    ("sky", "says"),
    [
        ({"kind": "perez"}, "direct_normal_irradiance_w_m2"),
        ({"kind": "clear", "diffuse_horizontal_irradiance_w_m2": 100.0}, "and with no other"),
        (
            {
                "kind": "perez",
                "direct_normal_irradiance_w_m2": 1.0,
                "diffuse_horizontal_irradiance_w_m2": 1.0,
                "horizontal_illuminance_lx": 5.0,
            },
            "no horizontal_illuminance_lx",
        ),
    ],
)
def test_a_sky_with_the_wrong_amounts_is_refused(sky: dict[str, object], says: str) -> None:
    with pytest.raises(ValueError, match=says):
        room(sky=sky, sun={"elevation_deg": 40.0})


def test_a_low_sun_of_gensky_comes_with_a_warning_and_one_from_irradiance_without(recwarn) -> None:  # type: ignore[no-untyped-def]
    with pytest.warns(SpeculariaWarning, match="below 9 degrees"):
        outdoors(room(sky={"kind": "clear"}, sun={"elevation_deg": 5.0}))
    irradiance = {"direct_normal_irradiance_w_m2": 150.0, "diffuse_horizontal_irradiance_w_m2": 30.0}
    faded = outdoors(room(sky={"kind": "perez"} | irradiance, sun={"elevation_deg": 5.0}))
    outdoors(room(sky={"kind": "clear"}, sun={"elevation_deg": 10.0}))
    assert not recwarn.list
    assert 0 < faded.sun_illuminance < 1.5e4
