"""A room from files must be lit as the same room given as a box."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from daylight_models import Diffuser, Lobe, room, sensors

from specularia import daylight
from specularia.errors import FormatError, SpeculariaWarning

UP = (0.0, 0.0, 1.0)
QUICK = daylight.Quality(sampling=0.5, repeats=2)

PANE = [(2.1, 0, 1.0), (2.1, 0, 2.1), (2.9, 0, 2.1), (2.9, 0, 1.0)]
"""Corners of the window of `daylight_models.room`, its normal into the room."""


def quads() -> list[tuple[str, list[tuple[float, float, float]]]]:
    """The room of 5 x 6 x 3 m as polygons by material, the south wall in four pieces around the window."""
    w, d, h = 5.0, 6.0, 3.0

    def south(x0: float, z0: float, x1: float, z1: float) -> list[tuple[float, float, float]]:
        return [(x0, 0, z0), (x0, 0, z1), (x1, 0, z1), (x1, 0, z0)]

    return [
        ("floor", [(0, 0, 0), (w, 0, 0), (w, d, 0), (0, d, 0)]),
        ("ceiling", [(0, 0, h), (0, d, h), (w, d, h), (w, 0, h)]),
        ("walls", [(0, d, 0), (w, d, 0), (w, d, h), (0, d, h)]),
        ("walls", [(0, 0, 0), (0, d, 0), (0, d, h), (0, 0, h)]),
        ("walls", [(w, 0, 0), (w, 0, h), (w, d, h), (w, d, 0)]),
        ("walls", south(0, 0, w, 1.0)),
        ("walls", south(0, 2.1, w, h)),
        ("walls", south(0, 1.0, 2.1, 2.1)),
        ("walls", south(2.9, 1.0, w, 2.1)),
    ]


def scene(path: Path, rho: dict[str, float], pane: Any = PANE, extra: str = "", shell: Any = None) -> Path:
    text = [f"void plastic {name}\n0\n0\n5 {r} {r} {r} 0 0\n" for name, r in rho.items()]
    for k, (material, corners) in enumerate([*(shell or quads()), ("glass_pane", pane)]):
        numbers = " ".join(str(v) for c in corners for v in c)
        text.append(f"{material} polygon p{k}\n0\n0\n{3 * len(corners)} {numbers}\n")
    path.write_text("\n".join(text) + extra)
    return path


def own(file: Path, **changes: Any) -> daylight.RoomJob:
    content: dict[str, Any] = {
        "geometry": {"file": str(file), "pane_materials": ["glass_pane"]},
        "sky": {"kind": "none"},
        "ground": {"reflectance": 0.0},
    }
    return daylight.RoomJob.model_validate(content | changes)


BLACK = {"floor": 0.0, "ceiling": 0.0, "walls": 0.0}
GREY = {"floor": 0.3, "ceiling": 0.7, "walls": 0.5}
DIM = {"floor": 0.5, "ceiling": 0.3, "walls": 0.2}
SUN = {"elevation_deg": 45.0, "azimuth_deg": 20.0, "normal_illuminance_lx": 8e4}
FLOOR = sensors([(2.5, 1.0, 0.001), (1.8, 1.4, 0.001), (3.3, 2.0, 0.001)], UP)


def test_a_box_from_a_radiance_file_is_lit_as_the_box(tmp_path: Path) -> None:
    """An asymmetric lobe, so that a pane turned or mirrored on the way would show."""
    model = Lobe(12.0, shift=(0.2, 0.1))
    found = daylight.run(
        own(scene(tmp_path / "r.rad", BLACK), sun=SUN, sensor=FLOOR), models={"m": model}, quality=QUICK
    )
    box = daylight.run(room(sun=SUN, sensor=FLOOR), models={"m": model}, quality=QUICK)
    one, two = ([p.illuminance_lx for p in lit.points] for lit in (found, box))
    assert one == pytest.approx(two, rel=0.01, abs=0.01)
    assert max(one) > 100.0


def test_reflected_light_of_a_room_from_an_obj_file_is_that_of_the_radiosity(tmp_path: Path) -> None:
    (tmp_path / "m.rad").write_text(
        "\n".join(f"void plastic {n}\n0\n0\n5 {r} {r} {r} 0 0\n" for n, r in GREY.items())
    )
    corners: list[Any] = []
    lines: list[str] = []
    for material, polygon in [
        *quads(),
        ("glass_pane", PANE[:3]),
        ("glass_pane", [PANE[k] for k in (2, 3, 0)]),
    ]:
        first = len(corners) + 1
        corners += polygon
        lines.append(f"usemtl {material}\nf " + " ".join(str(first + k) for k in range(len(polygon))))
    obj = tmp_path / "r.obj"
    obj.write_text("\n".join(f"v {x} {y} {z}" for x, y, z in corners) + "\n" + "\n".join(lines) + "\n")
    geometry = {"file": str(obj), "materials": str(tmp_path / "m.rad"), "pane_materials": ["glass_pane"]}
    sky = {"sky": {"kind": "overcast", "horizontal_illuminance_lx": 1e4}, "sun": {"elevation_deg": 40.0}}
    points = sensors([(2.5, 2.5, 0.001), (0.5, 4.0, 0.001)], UP)
    found = daylight.run(
        own(obj, geometry=geometry, sensor=points, **sky), models={"d": Diffuser(0.7)}, quality=QUICK
    )
    box = daylight.run(
        room(reflectance={**GREY, "frames": 0.0}, sensor=points, **sky),
        models={"d": Diffuser(0.7)},
        quality=QUICK,
    )
    for a, b in zip(found.points, box.points):
        assert a.indirect_lx == pytest.approx(b.indirect_lx, rel=0.02)
        assert a.direct_lx == pytest.approx(b.direct_lx, rel=0.01)
        assert 0.0 < a.se < 0.1 * a.illuminance_lx


def test_a_picture_of_a_room_from_files_shows_the_pane_s_luminance_and_closed_walls(tmp_path: Path) -> None:
    view = {
        "name": "v",
        "position_m": [2.5, 4.0, 1.55],
        "direction": [0, -1, 0],
        "horizontal_deg": 60.0,
        "size_px": [12, 9],
    }
    sky = {"sky": {"kind": "uniform", "horizontal_illuminance_lx": 1e4}, "sun": {"elevation_deg": 40.0}}
    lit = daylight.run(
        own(scene(tmp_path / "r.rad", GREY), view=[view], **sky),
        models={"d": Diffuser(0.5)},
        folder=tmp_path / "out",
        quality=QUICK,
    )
    (image,) = lit.images
    # Behind the pane half of a uniform sky: E_v = 5,000 lx, L = tau E_v / pi.
    assert image.luminance[4, 6] == pytest.approx(0.5 * 5000 / np.pi, rel=0.01)
    assert np.all(image.luminance > 0.5)


def test_what_stands_before_a_pane_in_the_file_shades_it(tmp_path: Path) -> None:
    awning = "\nwalls polygon awning\n0\n0\n12 -50 0 2.1 55 0 2.1 55 -8 2.1 -50 -8 2.1\n"
    sun = {"elevation_deg": 45.0, "normal_illuminance_lx": 8e4}
    for extra, share in (("", 1.0), (awning, 0.0)):
        lit = daylight.run(
            own(scene(tmp_path / f"{share}.rad", BLACK, extra=extra), sun=sun, sensor=FLOOR[:1]),
            models={"d": Diffuser(0.5)},
            quality=QUICK,
        )
        assert lit.panes[0].sun_share == pytest.approx(share, abs=1e-6)


def test_files_that_cannot_be_a_room_are_refused(tmp_path: Path) -> None:
    def refused(job: daylight.RoomJob, says: str) -> None:
        with pytest.raises(FormatError, match=says):
            daylight.run(job, models={"d": Diffuser(0.5)}, quality=QUICK)

    refused(own(scene(tmp_path / "a.rad", BLACK, pane=PANE[::-1])), "faces outwards")
    refused(own(scene(tmp_path / "b.rad", BLACK, pane=[*PANE[:3], (2.95, 0, 0.9)])), "as a rectangle")
    wrong = scene(tmp_path / "c.rad", BLACK)
    refused(
        own(wrong, geometry={"file": str(wrong), "pane_materials": ["window"]}), "polygons of material window"
    )
    (tmp_path / "d.rad").write_text("void plastic floor 0 0 five")
    refused(own(tmp_path / "d.rad"), "d.rad")
    with pytest.raises(ValueError, match="either"):
        daylight.RoomJob.model_validate({"sky": {"kind": "none"}})


def test_round_things_are_counted_as_shading_nothing(tmp_path: Path) -> None:
    ball = "\nwalls sphere ball\n0\n0\n4 1 1 1 0.2\n"
    with pytest.warns(SpeculariaWarning, match="1 surfaces that are not polygons"):
        daylight.run(
            own(scene(tmp_path / "r.rad", BLACK, extra=ball), sensor=FLOOR[:1]),
            models={"d": Diffuser(0.5)},
            quality=QUICK,
        )


def test_undeflected_sun_and_what_it_sheds_on_are_in_a_room_from_files_as_in_the_box(tmp_path: Path) -> None:
    """Points in and beside the sun's patch, and the picture of the floor, through a clear slab."""
    inside, beside = (3.03, 1.46, 0.001), (0.8, 3.0, 0.001)
    view = {
        "name": "v",
        "position_m": [2.0, 3.2, 1.6],
        "direction": [0, -1, -0.9],
        "horizontal_deg": 70.0,
        "size_px": [16, 12],
    }
    more = {
        "sun": SUN,
        "sensor": sensors([inside, beside], UP),
        "view": [view],
        "references": ["clear slab"],
        "quality": {"sampling": 0.5, "repeats": 2},
    }
    file = scene(tmp_path / "r.rad", DIM)
    geometry = {"file": str(file), "pane_materials": ["glass_pane"], "pane_reflectance": 0.0}
    found = daylight.run(own(file, geometry=geometry, **more), folder=tmp_path / "own")
    box = daylight.run(room(reflectance={**DIM, "frames": 0.0}, **more), folder=tmp_path / "box")
    for a, b in zip(found.points, box.points):
        assert a.illuminance_lx - a.indirect_lx == pytest.approx(b.illuminance_lx - b.indirect_lx, rel=1e-3)
        # Sampling by chance finds the patch's light with some percent of noise.
        assert a.indirect_lx == pytest.approx(b.indirect_lx, rel=0.1)
    assert found.points[0].direct_lx > 1e4 > 10 > found.points[1].direct_lx
    one, two = found.images[0].luminance, box.images[0].luminance
    assert two.max() > 50 * np.median(two)
    # The patch is a few pixels wide; its borders are the mean of nine places in one picture, of four in the
    # other.
    assert one.mean() == pytest.approx(two.mean(), rel=0.1)
    assert np.median(np.abs(one / two - 1.0)) < 0.03
    bright = two > 0.9 * two.max()
    assert bright.sum() > 2
    assert np.median(one[bright]) == pytest.approx(np.median(two[bright]), rel=0.02)


def test_panes_of_a_room_from_files_reflect_as_those_of_the_box(tmp_path: Path) -> None:
    view = {
        "name": "v",
        "position_m": [2.5, 3.0, 1.5],
        "direction": [0, -1, 0],
        "horizontal_deg": 20.0,
        "size_px": [8, 8],
    }
    # The sun is behind the wall, the sky black: all that the pane shows is light from the room.
    second = "\nglass_pane polygon north\n0\n0\n12 2.1 6 1.0 2.9 6 1.0 2.9 6 2.1 2.1 6 2.1\n"
    north = {"elevation_deg": 45.0, "azimuth_deg": 160.0, "normal_illuminance_lx": 8e4}
    walls = [q for q in quads() if q[1][0] != (0, 6.0, 0) or q[1][1] != (5.0, 6.0, 0)]
    assert len(walls) == len(quads()) - 1

    def piece(x0: float, z0: float, x1: float, z1: float) -> Any:
        return "walls", [(x0, 6.0, z0), (x1, 6.0, z0), (x1, 6.0, z1), (x0, 6.0, z1)]

    pieces = [piece(0, 0, 5, 1.0), piece(0, 2.1, 5, 3.0), piece(0, 1.0, 2.1, 2.1), piece(2.9, 1.0, 5, 2.1)]
    file = scene(tmp_path / "r.rad", GREY, extra=second, shell=[*walls, *pieces])
    more = {"sun": north, "view": [view], "quality": {"sampling": 0.5, "repeats": 2}}
    window = {"width_m": 0.8, "height_m": 1.1, "sill_m": 1.0, "pane_reflectance": 0.3}
    windows = [{**window, "name": w, "wall": w} for w in ("south", "north")]
    box = room(reflectance={**GREY, "frames": 0.0}, **more).model_dump() | {"window": windows}
    jobs = [daylight.RoomJob.model_validate(box)]
    for rho in (0.3, 0.0):
        geometry = {"file": str(file), "pane_materials": ["glass_pane"], "pane_reflectance": rho}
        jobs.append(own(file, geometry=geometry, **more))
    seen = []
    for k, job in enumerate(jobs):
        with pytest.warns(SpeculariaWarning, match="1 of 2 windows"):
            lit = daylight.run(job, models={"d": Diffuser(0.5)}, folder=tmp_path / str(k))
        seen.append(float(lit.images[0].luminance[3, 3]))
    assert seen[2] == pytest.approx(0.0, abs=0.01)
    assert seen[0] > 1.0
    assert seen[1] == pytest.approx(seen[0], rel=0.06)


def test_a_second_run_of_a_room_from_files_gives_the_same_numbers(tmp_path: Path) -> None:
    view = {
        "name": "v",
        "position_m": [2.5, 4.0, 1.55],
        "direction": [0, -1, 0],
        "horizontal_deg": 60.0,
        "size_px": [8, 8],
    }
    sky = {"sky": {"kind": "uniform", "horizontal_illuminance_lx": 1e4}, "sun": {"elevation_deg": 40.0}}
    job = own(scene(tmp_path / "r.rad", DIM), view=[view], sensor=FLOOR[:1], **sky)
    one, two = (
        daylight.run(job, models={"d": Diffuser(0.5)}, folder=tmp_path / str(k), quality=QUICK)
        for k in range(2)
    )
    assert one.points == two.points
    assert 0.0 < one.points[0].se < 0.05 * one.points[0].illuminance_lx
    assert np.array_equal(one.images[0].luminance, two.images[0].luminance)


def test_materials_in_colour_give_their_colour_to_the_light(tmp_path: Path) -> None:
    """A red floor under a white ceiling: what the ceiling gets from the floor has the floor's colour."""
    text = scene(tmp_path / "r.rad", BLACK).read_text()
    red = text.replace(
        "void plastic floor\n0\n0\n5 0.0 0.0 0.0 0 0", "void plastic floor\n0\n0\n5 .6 .1 .1 0 0"
    )
    assert red != text
    (tmp_path / "red.rad").write_text(red)
    up = [{"name": "c", "position_m": (2.5, 2.0, 2.999), "normal": (0, 0, -1)}]
    lit = daylight.run(
        own(tmp_path / "red.rad", sensor=up, sun=SUN), models={"d": Lobe(20.0, cells=64)}, quality=QUICK
    )
    (point,) = lit.points
    assert point.chromaticity_xy is not None
    # Straight from the pane comes white; from the floor, R : G : B = 6 : 1 : 1.
    from specularia.daylight.colour import to_rgb

    x, y = point.chromaticity_xy
    r, g, b = to_rgb(np.array([x / y, 1.0, (1 - x - y) / y]) * point.illuminance_lx)
    straight = point.direct_lx
    assert (r - straight) / (g - straight) == pytest.approx(6.0, rel=1e-3)
    assert b == pytest.approx(g, rel=1e-3)
