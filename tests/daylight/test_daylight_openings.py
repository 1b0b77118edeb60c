"""Niches, splays, lattices and what stands outside, against closed forms and brute force."""

from __future__ import annotations

import re
from typing import Any

import numpy as np
import pytest
from daylight_models import BLACK, Diffuser, Lobe, room, sensors

from specularia import daylight
from specularia.daylight.geometry import Box
from specularia.daylight.interreflection import mesh
from specularia.daylight.outdoors import outdoors
from specularia.daylight.panes import Glazing, lights
from specularia.errors import FormatError

UP = (0.0, 0.0, 1.0)
QUICK = daylight.Quality(sampling=0.5, repeats=2)
UNIFORM: dict[str, Any] = {
    "sky": {"kind": "uniform", "horizontal_illuminance_lx": 1e4},
    "sun": {"elevation_deg": 40.0, "normal_illuminance_lx": 0.0},
}


def factor(point: Any, normal: Any, corner: Any, a: Any, b: Any, n: int, blocked: Any = None) -> float:
    """Configuration factor of a parallelogram by plain summation; `blocked` hides parts of it."""
    k = (np.arange(n) + 0.5) / n
    s, t = (v.ravel()[:, None] for v in np.meshgrid(k, k))
    at = np.asarray(corner) + s * np.asarray(a) + t * np.asarray(b)
    d = at - np.asarray(point)
    r2 = np.sum(d * d, axis=1)
    facing = np.cross(a, b)
    cosines = np.abs(d @ facing) * np.maximum(d @ np.asarray(normal), 0.0) / r2
    free = 1.0 if blocked is None else ~blocked(at)
    return float(np.sum(cosines / r2 * free) / np.pi / n**2)


@pytest.mark.parametrize("splay", [0.0, 30.0])
def test_a_pane_in_a_niche_lights_a_black_room_through_its_mouth(splay: float) -> None:
    """Brute force over the pane: a ray counts where it crosses the wall's plane within the niche's mouth."""
    depth = 0.4
    points = np.array([(2.5, 0.3, 0.0), (2.5, 1.5, 0.0), (1.2, 0.5, 0.0), (4.4, 2.0, 0.0), (3.1, 0.8, 0.0)])
    job = room(
        window={"inner_reveal_m": depth, "inner_splay_deg": [splay, splay / 2, 0.0]},
        sensor=sensors(points, UP),
        **UNIFORM,
    )
    lit = daylight.run(job, models={"d": Diffuser(0.5)})
    jamb, sill = depth * np.tan(np.radians(splay)), depth * np.tan(np.radians(splay / 2))
    for p, found in zip(points, lit.points):

        def behind_the_wall(at: Any, p: Any = p) -> Any:
            share = p[1] / (p[1] - at[:, 1])
            x, z = (p[k] + share * (at[:, k] - p[k]) for k in (0, 2))
            return (x < 2.1 - jamb) | (x > 2.9 + jamb) | (z < 1.0 - sill) | (z > 2.1)

        truth = 2500.0 * factor(
            p, UP, (2.1, -depth, 1.0), (0.8, 0, 0), (0, 0, 1.1), 600, blocked=behind_the_wall
        )
        # A sliver of the pane, a five-hundredth of the brightest point's light, may be missed.
        assert found.illuminance_lx == pytest.approx(truth, rel=0.03, abs=0.1), p
    assert max(p.illuminance_lx for p in lit.points) > 10.0


def test_niche_and_room_exchange_light_in_both_directions_alike() -> None:
    job = room(
        window={"inner_reveal_m": 0.5, "inner_splay_deg": 25.0},
        room={"width_m": 3.0, "depth_m": 3.0, "height_m": 3.0},
    )
    m = mesh(Box(job), 0.3, points=0.3)
    assert m.factors.sum(axis=1) == pytest.approx(np.ones(len(m.area)), abs=2e-3)
    exchange = m.area[:, None] * m.factors
    names = m.box.names
    niche = np.array([names[f].startswith("window:") for f in m.face])
    for wall in ("floor", "north", "east"):
        here = np.array([names[f] == wall for f in m.face])
        there, back = exchange[np.ix_(here, niche)].sum(), exchange[np.ix_(niche, here)].sum()
        assert there == pytest.approx(back, rel=0.03)
        assert there > 0.0


def test_in_a_room_with_niches_the_mean_illuminance_is_that_of_an_integrating_sphere() -> None:
    """Light in = light swallowed, niches and their openings between them included."""
    rho, size = 0.6, (3.0, 4.0, 2.5)
    window = {"width_m": 0.6, "height_m": 0.8, "sill_m": 1.0, "inner_reveal_m": 0.3, "inner_splay_deg": 20.0}
    job = room(
        room={"width_m": size[0], "depth_m": size[1], "height_m": size[2]},
        reflectance={"ceiling": rho, "walls": rho, "floor": rho, "frames": rho},
        **UNIFORM,
    ).model_copy(
        update={
            "window": tuple(
                daylight.RoomJob.model_validate(
                    {
                        "room": {"width_m": 3, "depth_m": 4, "height_m": 2.5},
                        "window": [window | {"name": n, "wall": w, "pane_reflectance": rho}],
                        **UNIFORM,
                    }
                ).window[0]
                for n, w in (("a", "south"), ("b", "east"))
            )
        }
    )
    from specularia.daylight.interreflection import Interreflection

    box = Box(job)
    m = mesh(box, 0.3, points=0.3)
    flux = 100.0
    direct = np.zeros(m.points.shape[:2])
    direct[m.face == 4] = 1.0
    light = Interreflection(m, direct[..., None], np.full((len(m.area), 1), rho), flux)
    swallowed = float(np.sum((1 - rho) * light.received[:, 0] * m.area))
    assert swallowed == pytest.approx(flux, rel=0.01)


@pytest.mark.parametrize(("elevation", "azimuth"), [(50.0, 0.0), (35.0, 30.0)])
def test_an_outer_reveal_takes_the_sun_from_the_share_of_the_pane_that_the_closed_form_says(
    elevation: float, azimuth: float
) -> None:
    job = room(
        window={"outer_reveal_m": 0.3},
        sun={"elevation_deg": elevation, "azimuth_deg": azimuth, "normal_illuminance_lx": 8e4},
    )
    box = Box(job)
    found = lights(box, [Glazing(Diffuser(0.5))], outdoors(job), sampling=0.3)
    e, a = np.radians(elevation), np.radians(azimuth)
    # The shadow of the head falls by d tan e / cos a, that of a jamb by d tan a.
    lit = (1.1 - 0.3 * np.tan(e) / np.cos(a)) * (0.8 - 0.3 * np.tan(a)) / (0.8 * 1.1)
    assert found.sun[0] == pytest.approx(lit, abs=0.01)
    assert 0.1 < lit < 0.7


def test_at_75_degrees_a_reveal_of_0_3_m_leaves_no_sun_on_a_pane_of_1_1_m() -> None:
    sun = {"elevation_deg": 75.0, "normal_illuminance_lx": 8e4}
    for height, expected in ((1.1, 0.0), (1.8, 1 - 0.3 * np.tan(np.radians(75.0)) / 1.8)):
        job = room(window={"outer_reveal_m": 0.3, "height_m": height, "sill_m": 0.5}, sun=sun)
        found = lights(Box(job), [Glazing(Diffuser(0.5))], outdoors(job), sampling=0.3)
        assert found.sun[0] == pytest.approx(expected, abs=0.01)


def test_a_wide_black_roof_takes_the_sky_above_its_edge() -> None:
    """A black roof from the pane's head outwards, endless to the sides: E = E_sky (1 - cos beta) and so on.

    Seen from a point h below it, with its edge r away, it hides the sky above the elevation atan(h / r): a
    uniform sky of luminance L leaves E_v = L pi / 2 (1 - cos beta) at a wall (black ground).
    """
    reach, low = 1.5, 3.0
    roof = {
        "name": "roof",
        "corners_m": [(-300, -reach, low), (300, -reach, low), (300, 0, low), (-300, 0, low)],
        "reflectance": 0.0,
    }
    job = room(obstacle=[roof], window={"height_m": 0.2, "width_m": 0.2, "sill_m": 1.4}, **UNIFORM)
    free = room(window={"height_m": 0.2, "width_m": 0.2, "sill_m": 1.4}, **UNIFORM)
    shaded, open_sky = (
        lights(Box(j), [Glazing(Diffuser(0.5))], outdoors(j), sampling=1.0).skylit[0] for j in (job, free)
    )
    # A wall sees the fan of the sky up to the elevation beta of the roof's edge; for strips that are endless
    # along the wall the factor is (sin of the angle from the normal) / 2 each way.
    beta = np.arctan((low - 1.5) / reach)
    assert shaded / open_sky == pytest.approx(np.sin(beta), rel=0.02)


def test_a_sunlit_wall_across_the_court_lights_the_pane() -> None:
    """An endless sunlit wall that fills what the window sees has the luminance rho E / pi."""
    wall = {
        "name": "wall across",
        "corners_m": [(-4000, -1, -4000), (4000, -1, -4000), (4000, -1, 4000), (-4000, -1, 4000)],
        "reflectance": 0.5,
    }
    sun = {"elevation_deg": 30.0, "wall": "north", "normal_illuminance_lx": 8e4}
    job = room(obstacle=[wall], sun=sun, sky={"kind": "none"})
    with pytest.warns(Warning, match="behind the wall"):
        daylight.run(job, models={"d": Diffuser(0.5)}, quality=QUICK)
    found = lights(Box(job), [Glazing(Diffuser(0.5))], outdoors(job), sampling=0.3)
    # The sun reaches the wall across over the roofless room: triangles outside are all that stands there.
    exitance = 0.5 * 0.5 * 8e4 * np.cos(np.radians(30.0))
    assert found.skylit[0] / (0.8 * 1.1) == pytest.approx(exitance, rel=0.01)


def test_a_lattice_lights_as_one_pane_with_the_bars_light_taken_away() -> None:
    """Twenty panes with bars pass their share of the area; single panes keep their own models."""
    far = sensors([(2.5, 5.9, 0.0), (0.2, 5.0, 1.0)], (0, -1.0, 0.0))
    plain = room(sensor=far, **UNIFORM)
    bars = room(window={"rows": 5, "columns": 4, "bar_m": 0.02}, sensor=far, **UNIFORM)
    whole, lattice = (
        [p.illuminance_lx for p in daylight.run(j, models={"d": Diffuser(0.5)}, quality=QUICK).points]
        for j in (plain, bars)
    )
    left = (0.8 - 3 * 0.02) * (1.1 - 4 * 0.02) / (0.8 * 1.1)
    assert np.array(lattice) / whole == pytest.approx(left, rel=0.01)


def test_panes_are_counted_from_the_left_as_seen_from_inside() -> None:
    job = room(window={"rows": 1, "columns": 2, "pane_reflectance": 0.0})
    for wall in ("south", "north", "east", "west"):
        window = job.window[0].model_copy(update={"wall": wall})
        box = Box(job.model_copy(update={"window": (window,)}))
        out = box.panes[0].axes[2]
        # Somebody inside looks along `out`; left is up x forward.
        left = np.cross(UP, out)
        assert (box.panes[0].centre - box.panes[1].centre) @ left > 0.3, wall


def test_a_turned_pane_throws_its_light_where_the_turned_sample_does() -> None:
    """A lobe shifted along the sample's x, the sample turned by 90 degrees: shifted along y."""
    sun = {"elevation_deg": 30.0, "normal_illuminance_lx": 8e4}
    shift = 0.2
    job = room(sun=sun, sky={"kind": "none"})
    out = outdoors(job)
    box = Box(job)
    from dataclasses import replace

    from specularia.daylight.geometry import pane_axes

    box.panes[0] = replace(box.panes[0], axes=pane_axes("south", 90.0))
    turned = lights(box, [Glazing(Lobe(12.0, shift=(shift, 0.0)))], out, sampling=1.0).maps[0]
    straight = lights(Box(job), [Glazing(Lobe(12.0, shift=(0.0, shift)))], out, sampling=1.0).maps[0]
    d = np.array([0.1, 0.9, -0.35])
    d /= np.linalg.norm(d)
    a, b = pane_axes("south", 90.0) @ d, pane_axes("south") @ d
    one, other = turned.towards(a[0], a[1]), straight.towards(b[0], b[1])
    assert float(one) == pytest.approx(float(other), rel=0.01)
    assert float(one) > 10.0


def test_a_pane_of_its_own_model_is_the_only_one_that_changes(tmp_path: Any) -> None:
    from specularia import bsdf

    file = tmp_path / "opaque.xml"
    bsdf.write(Diffuser(1e-6), file, resolution=3)
    names = [["*", "own"], ["*", "*"]]
    window = {"rows": 2, "columns": 2, "bar_m": 0.1, "panes": names}
    far = sensors([(2.5, 5.9, 1.5)], (0, -1.0, 0.0))
    base: dict[str, Any] = {"reflectance": BLACK, "sensor": far, **UNIFORM}
    mixed = room(window=window, glass=[{"name": "own", "file": str(file)}], **base)
    all_alike = room(window={k: v for k, v in window.items() if k != "panes"}, **base)
    one, other = (
        daylight.run(j, models={"d": Diffuser(0.5)}, quality=QUICK).points[0].illuminance_lx
        for j in (mixed, all_alike)
    )
    assert one / other == pytest.approx(0.75, rel=0.02)
    assert [p.window for p in daylight.run(mixed, models={"d": Diffuser(0.5)}, quality=QUICK).panes] == [
        "window 1.1",
        "window 1.2",
        "window 2.1",
        "window 2.2",
    ]


@pytest.mark.parametrize(
    ("change", "says"),
    [
        ({"panes": [["*"]], "rows": 2}, "rows and columns say"),
        ({"panes": [["missing"]]}, "a [[glass]] for every name in panes"),
        ({"inner_reveal_m": 0.5, "inner_splay_deg": 60.0, "sill_m": 0.5}, "within its wall"),
        ({"columns": 5, "bar_m": 0.3}, "some pane"),
    ],
)
def test_windows_that_cannot_be_are_refused(change: dict[str, Any], says: str) -> None:
    with pytest.raises((ValueError, FormatError), match=re.escape(says)):
        daylight.run(room(window=change), models={"d": Diffuser(0.5)})


def test_an_obstacle_needs_one_flat_convex_shape() -> None:
    for wrong in (
        {"name": "o"},
        {"name": "o", "corners_m": [(0, 0, 0), (1, 0, 0), (1, 1, 0)], "box_m": [(0, 0, 0), (1, 1, 1)]},
        {"name": "o", "corners_m": [(0, 0, 0), (1, 0, 0), (1, 1, 0.4), (0, 1, 0)]},
        {"name": "o", "corners_m": [(0, 0, 0), (2, 0, 0), (1, 0.1, 0), (0, 2, 0)]},
        {"name": "o", "box_m": [(0, 0, 0), (1, 0, 1)]},
    ):
        with pytest.raises(ValueError, match="o"):
            room(obstacle=[wrong])
