"""Intervals, areas, densities and choices of finds, each against a truth of its own."""

from __future__ import annotations

import csv
import json
from pathlib import Path

import numpy as np
import pytest

from specularia import finds, twin
from specularia.errors import CoverageError, PhysicsError, SpeculariaWarning
from specularia.finds.intervals import Resampled, wilson
from specularia.report import figures
from specularia.twin.settings import FindsSettings


def made(n: int = 40, seed: int = 1, **given: object) -> finds.Finds:
    rng = np.random.default_rng(seed)
    fields = {
        "file": Path("t.csv"),
        "find_number": tuple(map(str, range(n))),
        "room": ("r",) * n,
        "square": ("",) * n,
        "colour": tuple(rng.choice(["yellow", "green", "blue"], n, p=[0.6, 0.3, 0.1])),
        "type": ("",) * n,
        "weight_g": rng.lognormal(0, 1, n),
        "thickness_mm": rng.uniform(2, 4, n),
        "count": np.ones(n, np.int64),
        "synthetic": True,
        "line": np.arange(2, n + 2),
    }
    return finds.Finds(**{**fields, **given})


def test_wilsons_interval_is_the_published_one_and_holds_the_share_as_often_as_it_says() -> None:
    # R. G. Newcombe, Stat. Med. 17 (1998) 857, table I, method 3.
    for count, total, low, high in [
        (81, 263, 0.2553, 0.3662), (15, 148, 0.0624, 0.1605), (0, 20, 0.0, 0.1611), (1, 29, 0.0061, 0.1718)
    ]:  # fmt: skip
        assert wilson(count, total) == pytest.approx((low, high), abs=5e-5)
    assert wilson(20, 20)[1] == 1.0
    draws = np.random.default_rng(0).binomial(200, 0.13, 4000)
    ends = np.array([wilson(int(k), 200) for k in draws])
    held = np.mean((ends[:, 0] <= 0.13) & (ends[:, 1] >= 0.13))
    assert held == pytest.approx(0.95, abs=0.015)


def test_the_bootstrap_of_a_share_of_weight_is_as_wide_as_its_linearised_variance() -> None:
    table = made(400)
    group = next(g for g in finds.summary(table).groups["colour"] if g.name == "green")
    here = np.array([c == "green" for c in table.colour])
    share = table.weight_g[here].sum() / table.weight_g.sum()
    off = table.weight_g * (here - share) / table.weight_g.sum()
    expected = 2 * 1.96 * np.sqrt(np.sum(off**2))
    assert group.weight_share == pytest.approx(share)
    assert group.weight_high - group.weight_low == pytest.approx(expected, rel=0.1)


def test_the_same_seed_gives_the_same_intervals_and_another_seed_others() -> None:
    table = made()
    a, b, c = finds.summary(table), finds.summary(table), finds.summary(table, seed=1)
    assert a.groups == b.groups and a.area == b.area
    assert (
        a.area.low_m2 != c.area.low_m2
        and a.groups["colour"] != c.groups["colour"]
        and a.area.area_m2 == c.area.area_m2
    )
    sums = Resampled(7, seed=3).sums([(np.zeros(7, np.intp), 1, np.ones(7))])[0]
    assert sums.shape == (1000, 1) and (sums == 7).all()


def test_the_area_of_a_broken_pane_is_that_of_the_pane() -> None:
    """A pane of 1.2 m2 and 3.1 mm in 300 pieces of 2.5 g/cm3, a third of them not measured."""
    rng = np.random.default_rng(4)
    share = rng.dirichlet(np.ones(300))
    thickness = np.full(300, 3.1)
    thickness[rng.permutation(300)[:100]] = np.nan
    table = made(300, weight_g=share * 1.2e4 * 0.31 * 2.5, thickness_mm=thickness)
    exact = finds.glazed_area(table, Resampled(300), density_g_cm3=2.5, density_se_g_cm3=0.0)
    assert exact.area_m2 == pytest.approx(1.2, rel=1e-12)
    assert exact.low_m2 == pytest.approx(1.2) and exact.high_m2 == pytest.approx(1.2)
    assert exact.harmonic_thickness_mm == pytest.approx(3.1)
    # Where all is measured, the area is off by what the density is off by.
    few = made(2, weight_g=np.array([50.0, 50.0]), thickness_mm=np.array([3.0, 3.0]))
    only = finds.glazed_area(few, Resampled(2), density_g_cm3=2.5, density_se_g_cm3=0.05)
    half = (only.high_m2 - only.low_m2) / 2
    assert half / only.area_m2 == pytest.approx(1.96 * 0.02, rel=0.1)
    with pytest.raises(PhysicsError):
        finds.glazed_area(table, Resampled(300), density_g_cm3=25.0)
    bare = made(5, thickness_mm=np.full(5, np.nan))
    assert finds.glazed_area(bare, Resampled(5)) is None
    assert finds.summary(bare).thickness is None and finds.summary(bare).area is None


def test_intervals_of_the_area_hold_the_truth_as_often_as_they_say() -> None:
    """The thickness of 60 rows of 150 is known; the truth takes that of all."""
    rng = np.random.default_rng(8)
    held, trials, n = 0, 150, 150
    for k in range(trials):
        weight, thickness = rng.gamma(4.0, 1.0, n), rng.uniform(1.5, 4.5, n)
        truth = 1e-3 * np.sum(weight / thickness) / 2.5
        table = made(n, weight_g=weight, thickness_mm=np.where(np.arange(n) < 60, thickness, np.nan))
        found = finds.glazed_area(table, Resampled(n, seed=k, replicates=300), density_se_g_cm3=0.0)
        held += found.low_m2 <= truth <= found.high_m2
    assert 0.90 <= held / trials <= 0.99


SQUARE = [[0, 0], [6, 0], [6, 4], [0, 4], [0, 0]]


def plan_of(folder: Path, rings: list[list[list[float]]]) -> finds.Plan:
    feature = {
        "properties": {"kind": "room", "name": "r"},
        "geometry": {"type": "Polygon", "coordinates": rings},
    }
    path = folder / "plan.geojson"
    path.write_text(json.dumps({"type": "FeatureCollection", "features": [feature]}), encoding="utf-8")
    return finds.read_plan(path)


def test_the_smoothed_density_keeps_number_and_weight_and_is_flat_for_even_finds(tmp_path) -> None:
    plan = plan_of(tmp_path, [SQUARE])
    rng = np.random.default_rng(2)
    x, y = rng.uniform(0, 6, 4000), rng.uniform(0, 4, 4000)
    table = made(4000, x=x, y=y)
    found = finds.kernel_density(table, plan, bandwidth_m=0.6)
    cell = (found.x_m[1] - found.x_m[0]) ** 2
    assert np.nansum(found.count_per_m2) * cell == pytest.approx(4000)
    assert np.nansum(found.weight_g_per_m2) * cell == pytest.approx(table.weight_g.sum())
    # Walls take nothing away: otherwise a corner would hold a quarter of what the middle holds.
    ends = found.count_per_m2[:: found.y_m.size - 1, :: found.x_m.size - 1]
    for place in (*ends.ravel(), found.count_per_m2[0].mean(), found.count_per_m2[:, -1].mean()):
        # A kernel of 0.6 m holds some 750 finds, a quarter of it in a corner: 7 % by chance.
        assert place == pytest.approx(4000 / 24, rel=0.25)
    assert np.median(found.count_per_m2) == pytest.approx(4000 / 24, rel=0.03)
    scott = finds.kernel_density(table, plan).bandwidth_m
    sd = np.sqrt(np.std(x, ddof=1) * np.std(y, ddof=1))
    assert scott == pytest.approx(sd * 4000 ** (-1 / 6))


def test_a_heap_is_a_gaussian_of_the_kernels_width_where_no_wall_is_near(tmp_path) -> None:
    plan = plan_of(tmp_path, [SQUARE])
    table = made(3, x=np.full(3, 3.0), y=np.full(3, 2.0), count=np.array([1, 2, 5]))
    found = finds.kernel_density(table, plan, bandwidth_m=0.3)
    assert np.nanmax(found.count_per_m2) == pytest.approx(8 / (2 * np.pi * 0.09), rel=2e-3)
    r2 = (found.x_m[None, :] - 3.0) ** 2 + (found.y_m[:, None] - 2.0) ** 2
    at = np.unravel_index(np.argmin(np.abs(r2 - 0.09)), r2.shape)
    expected = 8 / (2 * np.pi * 0.09) * np.exp(-r2[at] / 0.18)
    assert found.count_per_m2[at] == pytest.approx(expected, rel=0.03)


def test_holes_and_the_outside_of_the_plan_hold_no_finds(tmp_path) -> None:
    hole = [[2, 1], [4, 1], [4, 3], [2, 3], [2, 1]]
    plan = plan_of(tmp_path, [SQUARE, hole])
    assert plan.areas[0].middle_m == pytest.approx((3.0, 2.0))
    table = made(4, x=np.array([1.0, 5.0, 5.0, 3.0]), y=np.array([1.0, 3.0, 3.2, 2.0]))
    with pytest.warns(SpeculariaWarning, match="1 of 4 rows with a place lie outside"):
        found = finds.kernel_density(table, plan, bandwidth_m=0.5)
    inside = np.isfinite(found.count_per_m2)
    cell = (found.x_m[1] - found.x_m[0]) ** 2
    assert inside.sum() * cell == pytest.approx(20.0, rel=0.02)
    assert np.nansum(found.count_per_m2) * cell == pytest.approx(3.0)
    assert (found.placed_count, found.at_m.shape) == (3, (4, 2))
    with pytest.raises(CoverageError, match="a density needs 3"):
        finds.kernel_density(made(4), plan)


def test_pixels_of_a_picture_become_metres_with_y_up(tmp_path) -> None:
    from PIL import Image

    Image.new("L", (400, 300), 200).save(tmp_path / "drawing.png")
    file = tmp_path / "plan.toml"
    file.write_text(
        'picture = "drawing.png"\nmetres_per_pixel = 0.02\norigin_px = [50, 250]\n', encoding="utf-8"
    )
    table = tmp_path / "t.csv"
    rows = ["n,g,c,x_px,y_px", "a,1,1,50,250", "b,2,1,150,250", "c,3,2,50,150", "d,1,1,,"]
    table.write_text("\n".join(rows), encoding="utf-8")
    mapping = finds.Mapping(columns={"find_number": "n", "weight": "g", "count": "c"}, coordinate_unit="px")
    plan, read = finds.read_plan(file), finds.read(table, mapping)
    np.testing.assert_allclose(finds.places(read, plan), [[0, 0], [2, 0], [0, 2], [np.nan, np.nan]])
    found = finds.kernel_density(read, plan, bandwidth_m=0.4)
    cell = (found.x_m[1] - found.x_m[0]) ** 2
    # Nothing is cut where there are no areas; the kernel ends at four of its widths.
    assert np.nansum(found.count_per_m2) * cell == pytest.approx(4.0, rel=1e-3)
    picture = figures.finds_density(found, plan, tmp_path / "density.png")
    assert picture.stat().st_size > 10_000 and (tmp_path / "density.npz").exists()


def test_a_choice_holds_every_stratum_and_shares_the_rest_in_proportion() -> None:
    colour = ("a",) * 60 + ("b",) * 30 + ("c",) * 9 + ("d",)
    table = made(100, colour=colour, thickness_mm=np.full(100, 2.5))
    chosen = finds.choose(table, 20, by=["colour"], seed=5)
    counts = {c: sum(x.stratum == c for x in chosen) for c in "abcd"}
    # By hand: one each, then by largest lag of 12, 6, 1.8 and 0.2.
    assert counts == {"a": 12, "b": 6, "c": 1, "d": 1}
    assert [c.stratum for c in chosen] == sorted(c.stratum for c in chosen)
    assert len({c.find_number for c in chosen}) == 20
    assert all(table.find_number[c.line - 2] == c.find_number for c in chosen)
    assert chosen == finds.choose(table, 20, by=["colour"], seed=5)
    assert chosen != finds.choose(table, 20, by=["colour"], seed=6)
    assert len(finds.choose(table, 3, by=["colour"])) == 3
    assert {c.stratum for c in finds.choose(table, 3, by=["colour"])} == {"a", "b", "c"}
    assert len(finds.choose(table, 500)) == 100
    with pytest.raises(PhysicsError):
        finds.choose(table, 5, by=["weight"])
    # Every row of a stratum comes up: over many seeds each of 30 about equally often.
    hits = np.zeros(100)
    for seed in range(400):
        for c in finds.choose(table, 20, by=["colour"], seed=seed):
            hits[c.line - 2] += 1
    b = hits[60:90]
    assert b.sum() == 400 * 6
    assert (
        np.sum((b - 80.0) ** 2 / (80.0 * (1 - 6 / 30))) < 60
    )  # chi-squared, 29 degrees of freedom: p > 0.0006


def test_the_demos_totals_are_those_of_its_generator(tmp_path, command) -> None:
    settings = FindsSettings()
    rows = twin.site.finds(settings, np.random.default_rng(3))
    (tmp_path / "finds.csv").write_text(twin.site.finds_csv(rows), encoding="utf-8")
    (tmp_path / "plan.geojson").write_text(twin.site.plan_geojson(), encoding="utf-8")
    code, out, err = command(
        "finds", "summary", tmp_path / "finds.csv", "--plan", tmp_path / "plan.geojson",
        "-o", tmp_path / "out", "--choose", "12", "--json",
    )  # fmt: skip
    assert code == 0 and "lie in no" not in err
    assert out["synthetic"] is True
    assert out["total_count"] == settings.fragments == sum(r.count for r in rows)
    assert out["total_weight_g"] == pytest.approx(1000 * settings.weight_kg, abs=0.051)
    for grouping in ("colour", "room", "type"):
        held = {g["name"]: (g["count"], g["weight_g"]) for g in out["groups"][grouping]}
        for name, (count, weight) in held.items():
            own = [r for r in rows if getattr(r, grouping) == name]
            assert count == sum(r.count for r in own)
            assert weight == pytest.approx(sum(r.weight_g for r in own))
    area = sum(r.weight_g / r.thickness_mm for r in rows) * 1e-3 / 2.5
    assert out["area"]["area_m2"] == pytest.approx(area)
    assert out["smoothed"]["placed_count"] == settings.fragments
    with (tmp_path / "out" / "chosen.csv").open(newline="", encoding="utf-8") as f:
        chosen = list(csv.DictReader(f))
    assert len(chosen) == 12 and {c["colour"] for c in chosen} >= {"yellow", "brown", "green", "aqua"}
    for name in ("finds_density.png", "finds_density.npz", "finds_thickness.png", "finds_by_colour.png"):
        assert (tmp_path / "out" / name).stat().st_size > 1000
