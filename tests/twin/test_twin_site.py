"""The invented site: totals as published, and nothing that does not say it is invented."""

from __future__ import annotations

import json

import numpy as np
import pytest

from specularia.twin.settings import FindsSettings
from specularia.twin.site import Find, finds, finds_csv, plan_geojson


@pytest.fixture(scope="module")
def rows() -> list[Find]:
    return finds(FindsSettings(), np.random.default_rng(1))


def test_fragments_and_weight_add_up_to_the_set_totals(rows: list[Find]) -> None:
    assert sum(r.count for r in rows) == 5000
    assert sum(r.weight_g for r in rows) == pytest.approx(28000.0, abs=1e-6)
    assert all(r.weight_g > 0 and r.count >= 1 for r in rows)


@pytest.mark.parametrize(
    ("colours", "of_count", "of_weight"),
    [
        ({"yellow", "brown"}, 0.39, 0.53),
        ({"green", "aqua"}, 0.49, 0.41),
        ({"colourless", "blue"}, 0.12, 0.06),
    ],
)
def test_colour_groups_have_the_published_shares(
    rows: list[Find], colours: set[str], of_count: float, of_weight: float
) -> None:
    count = sum(r.count for r in rows if r.colour in colours) / 5000
    weight = sum(r.weight_g for r in rows if r.colour in colours) / 28000.0
    assert (count, weight) == (pytest.approx(of_count, abs=1e-3), pytest.approx(of_weight, abs=1e-4))


def test_three_thick_fragments_are_cast_and_the_rest_blown(rows: list[Find]) -> None:
    cast = [r for r in rows if "matt-glossy" in r.type]
    assert len(cast) == 3 and all(r.count == 1 and r.thickness_mm > 5.0 for r in cast)
    assert all(1.5 <= r.thickness_mm <= 5.0 for r in rows if r not in cast)


def test_every_row_and_feature_is_labelled_synthetic(rows: list[Find]) -> None:
    assert [r.find_number for r in rows] == [f"SYN-{n:04d}" for n in range(1, len(rows) + 1)]
    assert "synthetic" in finds_csv(rows).splitlines()[0]
    plan = json.loads(plan_geojson())
    assert "synthetic" in plan["synthetic"]
    assert all(f["properties"]["synthetic"] == "synthetic" for f in plan["features"])


def test_every_find_lies_in_a_square_of_its_room(rows: list[Find]) -> None:
    squares = {
        f["properties"]["name"]: f["properties"]["room"]
        for f in json.loads(plan_geojson())["features"]
        if f["properties"]["kind"] == "square"
    }
    assert all(squares[r.square] == r.room for r in rows)


def test_squares_tile_the_rooms() -> None:
    area = {"room": 0.0, "square": 0.0}
    for feature in json.loads(plan_geojson())["features"]:
        x, y = np.array(feature["geometry"]["coordinates"][0]).T
        area[feature["properties"]["kind"]] += 0.5 * abs(np.sum(x[:-1] * y[1:] - x[1:] * y[:-1]))
    assert area["room"] == area["square"] == 24.0 * 20.0
