"""Pictures: what the pane shows, what lies where, and files that Radiance reads back."""

from __future__ import annotations

import numpy as np
import pytest
from daylight_models import Lobe, room, sensors

from specularia import daylight
from specularia.radiance import run

VIEW = {
    "name": "in",
    "position_m": (2.5, 4.0, 1.5),
    "direction": (0, -1, 0),
    "horizontal_deg": 60.0,
    "size_px": (120, 90),
}
GREY = {"ceiling": 0.7, "walls": 0.7, "floor": 0.15, "frames": 0.15}


@pytest.fixture(scope="module")
def lit(tmp_path_factory: pytest.TempPathFactory) -> daylight.DaylightResult:
    job = room(
        reflectance=GREY,
        window={"frame_m": 0.05},
        sun={"elevation_deg": 50.0, "azimuth_deg": 25.0, "normal_illuminance_lx": 8e4},
        view=[VIEW],
        sensor=[
            *sensors([(1.0, 0.0, 0.5), (2.8, 0.4, 0.0), (2.5, 0.3, 3.0)], [(0, 1, 0), (0, 0, 1), (0, 0, -1)]),
            {"name": "behind the eye", "position_m": (2.5, 6.0, 1.0), "normal": (0, -1, 0)},
            {"name": "facing away", "position_m": (2.5, 2.0, 1.0), "normal": (0, -1, 0)},
        ],
    )
    return daylight.run(
        job, models={"lobe": Lobe(30.0, shift=(0.1, 0.55))}, folder=tmp_path_factory.mktemp("pictures")
    )


def test_the_pane_in_the_picture_has_the_luminance_of_the_model(lit: daylight.DaylightResult) -> None:
    (image,) = lit.images
    model = Lobe(30.0, shift=(0.1, 0.55))
    e, a = np.radians(50.0), np.radians(25.0)
    sun = np.array([-np.cos(e) * np.sin(a), -np.cos(e) * np.cos(a), np.sin(e)])
    scale = 60.0  # pixels from the middle to the border, at the tangent of 30 degrees
    compared = 0
    for row, column in [(36, 52), (36, 67), (45, 60), (54, 55), (50, 66)]:
        tx = (column + 0.5 - 60) / scale * np.tan(np.radians(30))
        tz = -(row + 0.5 - 45) / scale * np.tan(np.radians(30))
        # The eye looks south: the right of the picture is west.
        hit = np.array([2.5 - 4.0 * tx, 0.0, 1.5 + 4.0 * tz])
        assert 2.15 < hit[0] < 2.85 and 1.05 < hit[2] < 2.05
        o = np.array([2.5, 4.0, 1.5]) - hit
        o /= np.linalg.norm(o)
        truth = 8e4 * -sun[1] * model.value("transmission_front", sun[0], sun[2], o[0], o[2])
        assert image.luminance[row, column] == pytest.approx(truth, rel=0.01)
        compared += 1
    assert compared == 5
    shown = next(p for p in lit.panes if p.view == "in")
    towards = np.array([2.5, 4.0, 1.5]) - np.array([2.5, 0.0, 1.55])
    towards /= np.linalg.norm(towards)
    truth = 8e4 * -sun[1] * model.value("transmission_front", sun[0], sun[2], towards[0], towards[2])
    assert shown.luminance_cd_m2 == pytest.approx(truth, rel=0.01)


def test_luminance_under_a_sensor_is_its_illuminance_times_reflectance_over_pi(
    lit: daylight.DaylightResult,
) -> None:
    (image,) = lit.images
    assert set(image.pixels) == {"p0", "p1", "p2"}
    for point, rho in zip(lit.points, (0.7, 0.15, 0.7)):
        column, row = image.pixels[point.name]
        seen = image.luminance[int(row), int(column)]
        assert seen == pytest.approx(rho / np.pi * point.illuminance_lx, rel=0.04)


def test_light_that_is_thrown_to_one_side_is_on_that_side_of_the_picture(
    lit: daylight.DaylightResult,
) -> None:
    """Sun from the west of south, light thrown east: the left side of a picture towards the south."""
    (image,) = lit.images
    floor = image.luminance[85:, 20:100]
    assert floor[:, :40].mean() > 1.3 * floor[:, 40:].mean()
    assert np.all(floor[:, :40] > floor[:, :39:-1])


def test_the_hdr_file_says_the_same_as_the_array_and_no_pixel_is_empty(lit: daylight.DaylightResult) -> None:
    (image,) = lit.images
    values = np.array(run(["pvalue", "-h", "-H", "-d", image.hdr]).split(), float).reshape(90, 120, 3)
    luminance = 179 * values[..., 1]
    assert luminance == pytest.approx(image.luminance, rel=0.01, abs=1e-3 * image.luminance.max() / 255)
    assert np.all(np.isfinite(image.luminance)) and np.all(image.luminance > 0)
    stored = np.load(image.npz)
    assert stored["luminance"] == pytest.approx(image.luminance, rel=1e-6)
    assert str(stored["units"]) == "cd/m2"
    header = run(["getinfo", image.hdr]).decode()
    assert "VIEW= -vtv -vp 2.5 4 1.5 -vd 0 -1 0" in header


def test_a_pane_reflects_the_light_of_the_room(tmp_path) -> None:  # type: ignore[no-untyped-def]
    """A window that the sun misses, lit by another one, shows reflectance times illuminance over pi."""
    south = {"name": "lit", "wall": "south", "width_m": 1.0, "height_m": 1.0, "sill_m": 1.0}
    north = {"name": "dark", "wall": "north", "width_m": 1.0, "height_m": 1.0, "sill_m": 1.0}
    job = room(window={}).model_dump()
    job |= {
        "window": [south | {"pane_reflectance": 0.0}, north | {"pane_reflectance": 0.4}],
        "reflectance": GREY,
        "sun": {"elevation_deg": 30.0, "normal_illuminance_lx": 5e4},
        "view": [VIEW | {"position_m": (2.5, 2.0, 1.5), "direction": (0, 1, 0)}],
        "sensor": sensors([(2.5, 6.0, 1.5)], (0, -1, 0)),
    }
    with pytest.warns(daylight_warning(), match="1 of 2 windows"):
        lit = daylight.run(
            daylight.RoomJob.model_validate(job),
            models={"m": Lobe(30.0)},
            folder=tmp_path,
            quality=daylight.Quality(sampling=0.5),
        )
    (image,), (point,) = lit.images, lit.points
    assert image.luminance[45, 60] == pytest.approx(0.4 / np.pi * point.illuminance_lx, rel=0.03)
    assert point.direct_lx > 0 and point.indirect_lx > 0


def daylight_warning() -> type[Warning]:
    from specularia.errors import SpeculariaWarning

    return SpeculariaWarning


def test_a_picture_traced_in_some_pixels_is_that_of_all_of_them() -> None:
    """Smooth light is filled in; a narrow patch, a border of surfaces and uneven sizes are not smeared."""
    from specularia.daylight.picture import filled

    rows, columns = np.meshgrid(np.arange(97), np.arange(131), indexing="ij")
    kind = (columns > 60).astype(int)
    truth = np.where(kind == 1, 300.0, 100.0) * np.exp(-((columns - 20.0) ** 2 + (rows - 50.0) ** 2) / 3000.0)
    truth += np.where(kind == 0, 80.0 / (1.0 + np.exp(-(rows - 30.0) / 0.7)), 0.0)
    traced = []

    def trace(r: np.ndarray, c: np.ndarray) -> np.ndarray:
        traced.append(len(r))
        return truth[r, c]

    got = filled(kind, lambda r, c: trace(r, c)[:, None])[..., 0]
    assert np.max(np.abs(got / truth - 1.0)) < 0.03
    assert np.sqrt(np.mean((got / truth - 1.0) ** 2)) < 0.005
    assert sum(traced) < 0.5 * truth.size
    with_a_flat_line = filled(np.zeros((1, 40), dtype=int), lambda r, c: np.ones((len(r), 1)))
    assert np.all(with_a_flat_line == 1.0)
