"""Kinds of views, glare, grids and the daylight factor."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from daylight_models import Diffuser, room, sensors

from specularia import daylight
from specularia.daylight.camera import Camera
from specularia.daylight.views import View
from specularia.errors import FormatError
from specularia.jobs import load_toml
from specularia.radiance import run

SIZE = np.array([5.0, 6.0, 3.0])
QUICK = daylight.Quality(sampling=0.3, repeats=2)
GREY = {"ceiling": 0.7, "walls": 0.7, "floor": 0.15, "frames": 0.15}
EYE = {
    "name": "eye",
    "kind": "fisheye",
    "position_m": (1.3, 2.0, 1.3),
    "direction": (0.1, -1, 0.05),
    "size_px": (300, 300),
}

VIEWS = [
    {"position_m": (2.5, 4.0, 1.5), "direction": (0.3, -1, 0.1), "horizontal_deg": 75.0, "size_px": (40, 30)},
    {"kind": "fisheye", "position_m": (2.5, 4.0, 1.5), "direction": (0.3, -1, 0.1), "size_px": (40, 40)},
    {"kind": "plan", "size_px": (40, 60)},
]


@pytest.mark.parametrize("view", VIEWS, ids=["perspective", "fisheye", "plan"])
def test_radiance_casts_the_rays_of_the_view_that_the_header_names(view: dict[str, Any]) -> None:
    camera = Camera.of(View.model_validate(view), SIZE)
    columns, rows = camera.size_px
    command = ["vwrays", "-fd", "-x", str(columns), "-y", str(rows), *camera.header().split()]
    theirs = np.frombuffer(run(command), float).reshape(rows, columns, 6)
    c, r = np.meshgrid(np.arange(columns) + 0.5, np.arange(rows) + 0.5)
    origins, directions, inside = camera.rays(c.ravel(), r.ravel())
    theirs = theirs.reshape(-1, 6)
    # Radiance marks what lies outside a fisheye by a direction of length zero, or goes on beyond it.
    there = inside & (np.abs(theirs[:, 3:]).sum(axis=1) > 0)
    assert there.sum() > 0.75 * inside.size
    assert origins[there] == pytest.approx(theirs[there, :3], abs=1e-5)
    assert directions[there] == pytest.approx(theirs[there, 3:], abs=1e-5)


@pytest.mark.parametrize("view", VIEWS, ids=["perspective", "fisheye", "plan"])
def test_points_are_projected_to_where_their_ray_starts(view: dict[str, Any]) -> None:
    camera = Camera.of(View.model_validate(view), SIZE)
    columns, rows = camera.size_px
    rng = np.random.default_rng(1)
    c, r = rng.uniform(0, columns, 50), rng.uniform(0, rows, 50)
    origins, directions, inside = camera.rays(c, r)
    found = camera.project(origins + 1.7 * directions)
    assert found[inside] == pytest.approx(np.stack([c, r], axis=1)[inside])
    behind = camera.project(camera.position[None] - camera.forward)
    assert np.isnan(behind).all()


def position_index(direction: np.ndarray, sight: np.ndarray, up: np.ndarray) -> float:
    """Guth's position index above the line of sight, as in Wienold and Christoffersen 2006 (eq. 7)."""
    right = np.cross(sight, up)
    right /= np.linalg.norm(right)
    top = np.cross(right, sight)
    sigma = np.degrees(np.arccos(direction @ sight))
    x, y = direction @ right, direction @ top
    tau = np.degrees(np.arctan2(abs(x), y))
    return float(
        np.exp(
            (35.2 - 0.31889 * tau - 1.22 * np.exp(-2 * tau / 9)) * 1e-3 * sigma
            + (21 + 0.26667 * tau - 0.002963 * tau**2) * 1e-5 * sigma**2
        )
    )


@pytest.fixture(scope="module")
def lit(tmp_path_factory: pytest.TempPathFactory) -> daylight.DaylightResult:
    """A black room with an even diffuser under a uniform sky; the eye looks past and below the pane."""
    job = room(
        sky={"kind": "uniform", "horizontal_illuminance_lx": 4e4},
        sun={"elevation_deg": 40.0, "normal_illuminance_lx": 0.0},
        view=[EYE],
        sensor=[{"name": "eye", "position_m": EYE["position_m"], "normal": EYE["direction"]}],
    )
    return daylight.run(
        job, models={"d": Diffuser(0.6)}, folder=tmp_path_factory.mktemp("eye"), quality=QUICK
    )


def test_the_illuminance_at_the_eye_is_the_same_in_the_fisheye_and_at_a_sensor(
    lit: daylight.DaylightResult,
) -> None:
    (glare,), (point,), (image,) = lit.glare, lit.points, lit.images
    weights = Camera.of(image.view, SIZE).cosine_weights()
    assert weights.sum() == pytest.approx(np.pi, rel=1e-5)
    assert float((weights * image.luminance).sum()) == pytest.approx(point.illuminance_lx, rel=0.01)
    assert glare.vertical_illuminance_lx == pytest.approx(point.illuminance_lx, rel=0.01)
    assert glare.sensor_illuminance_lx == pytest.approx(point.illuminance_lx, rel=0.002)
    assert image.luminance[0, 0] == 0.0 and image.luminance[-1, -1] == 0.0


def test_the_daylight_glare_probability_is_that_of_the_published_formula(
    lit: daylight.DaylightResult,
) -> None:
    """One source of known luminance and solid angle; the rest of the room is black."""
    eye = np.array(EYE["position_m"])
    sight = np.array(EYE["direction"], float)
    sight /= np.linalg.norm(sight)
    n = 60
    x, z = np.meshgrid(2.1 + 0.8 * (np.arange(n) + 0.5) / n, 1.0 + 1.1 * (np.arange(n) + 0.5) / n)
    d = np.stack([x, np.zeros_like(x), z], axis=-1) - eye
    r = np.linalg.norm(d, axis=-1)
    d /= r[..., None]
    omega = 0.8 * 1.1 / n**2 * -d[..., 1] / r**2
    luminance = 0.6 * 2e4 / np.pi
    ev = float(np.sum(luminance * omega * (d @ sight)))
    middle = (d * omega[..., None]).sum(axis=(0, 1))
    p = position_index(middle / np.linalg.norm(middle), sight, np.array([0, 0, 1.0]))
    assert p > 1.3, "a source straight ahead would not test the position index"
    source = luminance**2 * omega.sum() / (ev**1.87 * p**2)
    dgp = 5.87e-5 * ev + 0.0918 * np.log10(1 + source) + 0.16
    (glare,) = lit.glare
    assert glare.sources == 1
    # Pixels on the edge of the pane, darker and in part beside it, count to the source.
    assert 0.98 * luminance < glare.source_luminance_cd_m2 < luminance
    assert glare.source_sr == pytest.approx(omega.sum(), rel=0.02)
    assert glare.vertical_illuminance_lx == pytest.approx(ev, rel=0.01)
    assert glare.dgp == pytest.approx(dgp, abs=0.003)
    # Without the source's term the value would be far off.
    assert dgp - (5.87e-5 * ev + 0.16) > 0.05


def test_a_plan_shows_the_floor_from_above_with_north_at_the_top(tmp_path: Path) -> None:
    points = [(2.25, 0.65, 0.0), (4.55, 1.05, 0.0), (1.05, 5.05, 0.0)]
    job = room(
        reflectance=GREY,
        sky={"kind": "overcast", "horizontal_illuminance_lx": 1e4},
        view=[{"name": "floor", "kind": "plan", "size_px": (100, 60)}],
        sensor=[
            *sensors(points, (0, 0, 1)),
            {"name": "ceiling", "position_m": (1, 1, 3), "normal": (0, 0, -1)},
        ],
    )
    lit = daylight.run(job, models={"d": Diffuser(0.6)}, folder=tmp_path, quality=QUICK)
    (image,) = lit.images
    # 5 x 6 m fitted into 100 x 60 pixels.
    assert image.luminance.shape == (60, 50)
    assert set(image.pixels) == {"p0", "p1", "p2"}
    for (x, y, _), point in zip(points, lit.points):
        column, row = image.pixels[point.name]
        assert (column, row) == pytest.approx((10 * x, 10 * (6 - y)))
        seen = image.luminance[int(row), int(column)]
        assert seen == pytest.approx(0.15 / np.pi * point.illuminance_lx, rel=0.03)
    assert [p.view for p in lit.panes] == ["normal"]
    assert "-vtl" in run(["getinfo", image.hdr]).decode()


def test_a_grid_is_read_as_sensors_at_its_points_are_and_sums_itself_up(tmp_path: Path) -> None:
    grids = [
        {"name": "plane", "height_m": 0.8, "margin_m": 0.5, "spacing_m": 1.3},
        {"name": "wall", "face": "east", "spacing_m": 2.0},
        {
            "name": "desk",
            "origin_m": (1, 1, 0.7),
            "along_m": (1.5, 0, 0),
            "across_m": (0, 0.8, 0),
            "spacing_m": 1,
        },
    ]
    job = room(
        reflectance=GREY,
        sky={"kind": "overcast", "horizontal_illuminance_lx": 1e4},
        grid=grids,
        sensor=sensors([(1.0, 1.0, 0.8), (5.0, 0.75 + 1.5, 1.125)], [(0, 0, 1), (-1, 0, 0)]),
    )
    lit = daylight.run(job, models={"d": Diffuser(0.6)}, quality=QUICK)
    plane, wall, desk = lit.grids
    # 4 x 5 m in steps of at most 1.3 m: 4 columns 1 m apart, 4 rows 1.25 m apart.
    assert plane.illuminance_lx.shape == (4, 4)
    assert plane.points_m[0, 0].tolist() == pytest.approx([1.0, 1.125, 0.8])
    assert plane.points_m[3, 1].tolist() == pytest.approx([2.0, 4.875, 0.8])
    assert wall.points_m.shape == (2, 3, 3) and wall.normal.tolist() == [-1, 0, 0]
    assert np.all(wall.points_m[..., 0] == 5.0)
    assert desk.points_m[0, 1].tolist() == pytest.approx([2.125, 1.4, 0.7]) and desk.normal.tolist() == [
        0,
        0,
        1,
    ]
    assert len(lit.points) == 2
    again = daylight.run(
        room(
            reflectance=GREY,
            sky={"kind": "overcast", "horizontal_illuminance_lx": 1e4},
            sensor=sensors(plane.points_m.reshape(-1, 3)[:3], (0, 0, 1)),
        ),
        models={"d": Diffuser(0.6)},
        quality=QUICK,
    )
    assert plane.illuminance_lx.ravel()[:3] == pytest.approx(
        [p.illuminance_lx for p in again.points], rel=1e-6
    )
    assert plane.mean_lx == pytest.approx(plane.illuminance_lx.mean())
    assert plane.uniformity == pytest.approx(plane.illuminance_lx.min() / plane.illuminance_lx.mean())
    assert plane.direct_lx + plane.indirect_lx == pytest.approx(plane.illuminance_lx)


def test_the_daylight_factor_is_the_share_of_the_overcast_sky_and_missing_under_any_other() -> None:
    """In a black room it is tau E_v / E_h times the configuration factor of the pane."""
    from test_daylight_points import window_factor

    at = (2.5, 1.5, 0.0)
    sky = {"kind": "overcast", "horizontal_illuminance_lx": 1e4}
    grid = [{"name": "g", "origin_m": (2, 1, 0), "along_m": (1, 0, 0), "across_m": (0, 1, 0), "spacing_m": 1}]
    content = {"sensor": sensors([at], (0, 0, 1)), "grid": grid}
    fine = daylight.Quality(sampling=1.0, repeats=2)
    lit = daylight.run(room(sky=sky, **content), models={"d": Diffuser(0.6)}, quality=fine)
    # A wall sees (8 + 3 pi) / (14 pi) of an overcast sky's horizontal illuminance (Moon and Spencer 1942).
    vertical = (8 + 3 * np.pi) / (14 * np.pi)
    truth = 100 * 0.6 * vertical * window_factor(at[0], at[1], 2.1, 2.9, 1.0, 2.1)
    assert lit.points[0].daylight_factor_percent == pytest.approx(truth, rel=0.01)
    assert lit.grids[0].daylight_factor_percent[0, 0] == pytest.approx(truth, rel=0.01)
    assert lit.no_daylight_factor == ""
    for changes, says in (
        ({"sky": {"kind": "clear"}, "sun": {"elevation_deg": 40.0}}, "clear"),
        ({"sky": sky, "sun": {"elevation_deg": 40.0, "normal_illuminance_lx": 1e4}}, "direct sun"),
    ):
        other = daylight.run(room(**changes, **content), models={"d": Diffuser(0.6)}, quality=QUICK)
        assert other.points[0].daylight_factor_percent is None
        assert other.grids[0].daylight_factor_percent is None
        assert says in other.no_daylight_factor


ROOM = """
[room]
width_m = 4.0
depth_m = 5.0
height_m = 2.8
[[window]]
width_m = 0.8
height_m = 1.1
sill_m = 1.0
[sky]
kind = "none"
"""


@pytest.mark.parametrize(
    ("more", "says"),
    [
        ('[[view]]\nkind = "plan"\nposition_m = [1, 1, 1]', "no position_m for a plan"),
        ('[[view]]\nkind = "fisheye"\ndirection = [0, -1, 0]', "position_m of a fisheye"),
        (
            '[[view]]\nkind = "fisheye"\nposition_m = [1, 1, 1]\ndirection = [0, 1, 0]\nsize_px = [80, 60]',
            "rows",
        ),
        ("[[view]]\nposition_m = [1, 1, 1]\ndirection = [0, 1, 0]\nglare = true", "fisheye only"),
        ('[[view]]\nkind = "fish"', "perspective"),
        ('[[grid]]\nname = "g"', "one of height_m, face"),
        ('[[grid]]\nname = "g"\nface = "floor"\nheight_m = 1', "one of height_m, face"),
        ('[[grid]]\nname = "g"\nheight_m = 3.0', "inside the room"),
        ('[[grid]]\nname = "g"\nface = "floor"\nmargin_m = 2.0', "margin_m of grid"),
        (
            '[[grid]]\nname = "g"\norigin_m = [1, 1, 1]\nalong_m = [1, 0, 0]\nacross_m = [1, 1, 0]',
            "square to",
        ),
        (
            '[[grid]]\nname = "g"\norigin_m = [1, 1, 0]\nalong_m = [0, 1, 0]\nacross_m = [1, 0, 0]',
            "facing into",
        ),
    ],
)
def test_views_and_grids_that_cannot_be_are_refused(tmp_path: Path, more: str, says: str) -> None:
    path = tmp_path / "ROOM.toml"
    path.write_text(ROOM + more)
    with pytest.raises(FormatError) as caught:
        daylight.run(path, models={"d": Diffuser(0.5)})
    assert says in str(caught.value)


def test_a_fisheye_and_a_plan_have_sizes_of_their_own(tmp_path: Path) -> None:
    path = tmp_path / "ROOM.toml"
    eye = '[[view]]\nname = "a"\nkind = "fisheye"\nposition_m = [1, 1, 1]\ndirection = [0, 1, 0]\n'
    path.write_text(ROOM + eye + "glare = false\n" + '[[view]]\nname = "b"\nkind = "plan"\n')
    a, b = load_toml(path, daylight.RoomJob).view
    assert a.size_px == (400, 400) and not a.wants_glare
    assert Camera.of(b, np.array([4.0, 5.0, 2.8])).size_px == (192, 240)


def test_the_command_gives_grids_glare_and_ratios_between_models(tmp_path: Path, command) -> None:  # type: ignore[no-untyped-def]
    from test_daylight_room_file import tabulated

    model = tabulated(tmp_path / "m.nc")
    path = tmp_path / "ROOM.toml"
    path.write_text(
        ROOM.replace('kind = "none"', 'kind = "overcast"\nhorizontal_illuminance_lx = 1e4')
        + '[[view]]\nname = "eye"\nkind = "fisheye"\nposition_m = [2, 3, 1.2]\ndirection = [0, -1, 0]\n'
        + 'size_px = [100, 100]\n[[grid]]\nname = "g"\nheight_m = 0.8\nspacing_m = 2\n'
        + "[quality]\nsampling = 0.3\nrepeats = 2\n"
    )
    out = tmp_path / "out"
    words = ("daylight", "run", path, "-o", out, "--model", f"A={model}", "--model", f"B={model}")
    code, text, err = command(*words, "-q")
    assert code == 0, err
    for said in ("uniformity", "daylight factor %", "DGP"):
        assert said in text
    result = json.loads((out / "daylight.json").read_text())
    a, b = result["grids"]
    assert (a["model"], b["model"]) == ("A", "B") and a["illuminance_lx"] == b["illuminance_lx"]
    assert np.shape(a["illuminance_lx"]) == (3, 2) and a["mean_daylight_factor_percent"] > 0
    assert np.load(a["npz"])["points_m"].shape == (3, 2, 3) and Path(a["figure"]).is_file()
    assert [g["model"] for g in result["glare"]] == ["A", "B"]
    assert all(0.15 < g["dgp"] < 0.6 for g in result["glare"])
    assert result["no_daylight_factor"] is None
    assert {("view" in r, "grid" in r) for r in result["ratios"]} == {(True, False), (False, True)}
    assert all(Path(r["figure"]).is_file() and r["models"] == ["A", "B"] for r in result["ratios"])
