"""The published route to the lit room beside ours, where both must say the same."""

from __future__ import annotations

import json

import numpy as np
import pytest
from daylight_models import BLACK, Diffuser, Lobe, room, sensors

from specularia import daylight
from specularia.cli import main
from specularia.daylight.plain import STATED, Plain
from specularia.errors import CoverageError

UP = (0.0, 0.0, 1.0)
QUICK = Plain(
    options=("-ab", "2", "-aa", "0", "-ad", "4096", "-as", "0", "-lw", "1e-7", "-ss", "8"), resolution=5
)
SKY = {"sky": {"kind": "clear"}, "ground": {"reflectance": 0.2}}
SUN = {"elevation_deg": 50.0, "azimuth_deg": 25.0, "normal_illuminance_lx": 8e4}
FLOOR = [(2.5, 0.5, 0.0), (2.0, 1.5, 0.0), (0.5, 0.5, 0.0), (4.0, 3.0, 0.0)]


class Sideways(Lobe):
    """A lobe thrown to one side, which a mirrored or turned pane would throw to another."""

    isotropic = False


def both(job: daylight.RoomJob, model: object, **changes: object) -> tuple[list[daylight.Point], ...]:
    one = daylight.run(job, models={"m": model}, quality=daylight.Quality(sampling=0.5))
    two = daylight.run(job, models={"m": model}, method="plain", plain=QUICK)
    return one.points, two.points


def agree(ours: list[daylight.Point], plain: list[daylight.Point], share: float) -> bool:
    """Whether all points agree within 5 standard errors and a share of their value.

    Three runs know a point's standard error badly. The light of a pane is met by chance, so that the variance
    goes with the illuminance; pooled over the points that way the error is known well enough.
    """
    a, b = (np.array([p.illuminance_lx for p in points]) for points in (ours, plain))
    se = np.array([p.se for p in plain])
    assert np.all(se > 0.0) and np.all(se < 0.15 * b)
    pooled = np.sqrt(a * np.mean(se**2 / a))
    return bool(np.all(np.abs(a - b) <= 5 * pooled + share * a))


def test_the_plain_route_finds_the_light_of_a_diffuser_under_sun_sky_and_ground() -> None:
    ours, plain = both(room(sun=SUN, sensor=sensors(FLOOR, UP), **SKY), Diffuser(0.6))
    assert agree(ours, plain, 0.01)


@pytest.mark.parametrize("kind", ["uniform", "overcast"])
def test_its_sky_is_that_of_the_other_method(kind: str) -> None:
    """Without a sun, behind a broad lobe: what comes in is sky and ground alone."""
    job = room(
        sun={"elevation_deg": 40.0, "normal_illuminance_lx": 0.0},
        sky={"kind": kind, "horizontal_illuminance_lx": 1e4},
        ground={"reflectance": 0.3},
        sensor=sensors([(2.5, 1.0, 0.0), (2.5, 2.0, 3.0)], [UP, (0, 0, -1)]),
    )
    ours, plain = both(job, Lobe(40.0))
    assert agree(ours, plain, 0.04)


def test_a_lobe_thrown_to_one_side_lands_on_that_side() -> None:
    job = room(
        sun=SUN,
        sensor=sensors([(x, 1.5, 0.0) for x in (1.0, 1.75, 2.5, 3.25, 4.0)], UP),
    )
    coarse = Plain(options=QUICK.options, resolution=4, repeats=2)
    model = Sideways(30.0, shift=(0.25, 0.1), cells=60)
    few = daylight.Quality(sampling=0.2, repeats=2)
    ours = [p.illuminance_lx for p in daylight.run(job, models={"m": model}, quality=few).points]
    plain = [
        p.illuminance_lx for p in daylight.run(job, models={"m": model}, method="plain", plain=coarse).points
    ]
    # Cells of the tree are 7 degrees wide: the pattern is blurred, but not turned over.
    assert np.corrcoef(ours, plain)[0, 1] > 0.97
    assert np.corrcoef(ours, plain[::-1])[0, 1] < 0.5


def test_behind_an_opaque_pane_the_plain_room_reads_exactly_nothing() -> None:
    job = room(
        reflectance={"ceiling": 0.7, "walls": 0.7, "floor": 0.15},
        window={"inner_reveal_m": 0.3, "outer_reveal_m": 0.2, "outer_splay_deg": 20.0},
        sun=SUN,
        sensor=sensors([(2.5, 1.0, 0.0), (0.1, 5.9, 0.0), (2.5, 0.0, 2.5)], [UP, UP, (0, 1, 0)]),
        **SKY,
    )
    few = Plain(options=("-ab", "2", "-ad", "512", "-as", "0"), resolution=3, repeats=2)
    lit = daylight.run(job, models={"m": Diffuser(0.0)}, method="plain", plain=few)
    assert len(lit.points) == 3
    assert all(p.illuminance_lx == 0.0 and p.se == 0.0 for p in lit.points)


def test_a_niche_and_an_outer_reveal_shade_alike_in_both_routes() -> None:
    deep = {"inner_reveal_m": 0.25, "outer_reveal_m": 0.4}
    # A black outer reveal: what it would reflect takes more bounces than are traced here.
    black = BLACK | {"outside": 0.0}
    job = room(window=deep, reflectance=black, sun=SUN, sensor=sensors(FLOOR[:2], UP), **SKY)
    free = room(sun=SUN, sensor=sensors(FLOOR[:2], UP), **SKY)
    ours, plain = both(job, Diffuser(0.6))
    unshaded = daylight.run(free, models={"m": Diffuser(0.6)}).points
    assert agree(ours, plain, 0.03)
    for b, c in zip(plain, unshaded):
        assert b.illuminance_lx < 0.8 * c.illuminance_lx


def test_one_run_has_no_standard_error_and_the_record_says_how_it_was_made(tmp_path) -> None:  # type: ignore[no-untyped-def]
    view = {"name": "in", "position_m": (2.5, 4.0, 1.5), "direction": (0, -1, 0), "size_px": (24, 18)}
    job = room(sun=SUN, sensor=sensors(FLOOR[:1], UP), view=[view])
    once = Plain(options=QUICK.options, resolution=4, repeats=1)
    lit = daylight.run(job, models={"m": Diffuser(0.5)}, folder=tmp_path, method="plain", plain=once)
    assert np.isnan(lit.points[0].se) and np.isnan(lit.points[0].direct_lx)
    assert "plain" in lit.provenance["method"] and "-ad 4096" in lit.provenance["radiance_options"]
    assert Plain().options == STATED
    (image,) = lit.images
    e, a = np.radians(50.0), np.radians(25.0)
    luminance = 0.5 / np.pi * 8e4 * np.cos(e) * np.cos(a)
    assert image.luminance.max() == pytest.approx(luminance, rel=0.02)
    assert lit.panes[0].luminance_cd_m2 == pytest.approx(luminance, rel=0.02)
    assert lit.panes[0].exitance_lm_m2 == pytest.approx(np.pi * luminance, rel=0.02)
    assert image.hdr.exists() and image.npz.exists()


def test_a_model_without_transmission_is_refused() -> None:
    class Mirror(Diffuser):
        sides = ("reflection_front",)

    with pytest.raises(CoverageError, match="lacks transmission"):
        daylight.run(room(sun=SUN), models={"m": Mirror(0.5)}, method="plain")


def test_the_command_takes_the_plain_route_and_refuses_full_with_it(tmp_path, capsys, monkeypatch) -> None:  # type: ignore[no-untyped-def]
    from specularia import bsdf
    from specularia.daylight import plain

    bsdf.write(Diffuser(0.5), tmp_path / "d.xml", resolution=4)
    (tmp_path / "ROOM.toml").write_text(
        "[room]\nwidth_m = 3.0\ndepth_m = 3.0\nheight_m = 2.5\n"
        "[reflectance]\nceiling = 0.0\nwalls = 0.0\nfloor = 0.0\nframes = 0.0\n"
        "[[window]]\nwidth_m = 1.0\nheight_m = 1.0\nsill_m = 1.0\npane_reflectance = 0.0\n"
        '[sun]\nelevation_deg = 40\nnormal_illuminance_lx = 5e4\n[sky]\nkind = "none"\n'
        '[[sensor]]\nname = "floor"\nposition_m = [1.5, 1.0, 0.0]\n'
    )
    words = ["daylight", "run", str(tmp_path / "ROOM.toml"), "-o", str(tmp_path / "lit")]
    words += ["--model", f"d={tmp_path / 'd.xml'}", "--method", "plain"]
    assert main([*words, "--full"]) == 2
    # The paper's options take minutes.
    quick = Plain(options=("-ab", "1", "-aa", "0", "-ad", "2048", "-as", "0"))
    monkeypatch.setattr(plain, "Plain", lambda: quick)
    capsys.readouterr()
    assert main([*words, "--json", "-q"]) == 0
    (point,) = json.loads(capsys.readouterr().out)["points"]
    assert main([*words[:-2], "--json", "-q"]) == 0
    (ours,) = json.loads(capsys.readouterr().out)["points"]
    # Three runs that hit the pane equally often differ by nothing.
    assert point["direct_lx"] is None and point["se"] >= 0.0
    # Of the sun alone: with one bounce the rays do not see the ground, which ours does. The view factor of a
    # square of 1 m that stands 1 m away and 1 m above the floor, by the midpoint rule.
    k = (np.arange(400) + 0.5) / 400
    x, z = np.meshgrid(k - 0.5, 1.0 + k)
    share = float(np.mean(z / (np.pi * (x * x + z * z + 1.0) ** 2)))
    sun = 0.5 * 5e4 * np.cos(np.radians(40.0)) * share
    # The ground reflects 0.2 of 5e4 sin 40, half of which the upright pane sees.
    ground = 0.5 * 0.2 * np.tan(np.radians(40.0))
    assert ours["illuminance_lx"] == pytest.approx(sun * (1.0 + ground), rel=3e-3)
    # Three runs of 2048 rays, of which those count that meet the pane: strata are no worse than chance.
    assert abs(point["illuminance_lx"] - sun) <= 4.0 * sun / np.sqrt(3 * 2048 * share)
