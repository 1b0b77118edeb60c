"""Finds: counted by hand, refused with the line that is wrong."""

from __future__ import annotations

import csv
import json
import warnings
from pathlib import Path

import numpy as np
import pytest

from specularia import finds
from specularia.errors import FormatError, SpeculariaWarning

# Columns in another order than documented, an empty line, quotes, an umlaut, empty cells, several in a row.
TABLE = """\
colour,find_number,count,weight_g,thickness_mm,type,room,square
green,1/a,3,10.5,2.0,cylinder-blown,Saal 1,A1
green,1/b,1,0.5,1.99,cylinder-blown,Saal 1,A2
brown,2,10,20,,cylinder-blown,"Küche, Süd",B1

,3,1,4.0,5,cast,Saal 1,
aqua-green,4,5,1.5e1,2.999,,elsewhere,A1
"""

PLAN = {
    "type": "FeatureCollection",
    "features": [
        {  # 4 x 3 m with a hole of 1 x 2 m: 10 m2
            "type": "Feature",
            "properties": {"kind": "room", "name": "Saal 1"},
            "geometry": {
                "type": "Polygon",
                "coordinates": [
                    [[0, 0], [4, 0], [4, 3], [0, 3], [0, 0]],
                    [[1, 0.5], [2, 0.5], [2, 2.5], [1, 2.5], [1, 0.5]],
                ],
            },
        },
        {  # a triangle of 2 m2 and, apart from it, a square of 0.5 m2, the latter clockwise
            "type": "Feature",
            "properties": {"kind": "room", "name": "Küche, Süd"},
            "geometry": {
                "type": "MultiPolygon",
                "coordinates": [
                    [[[5, 0], [7, 0], [5, 2], [5, 0]]],
                    [[[8, 0], [8, 0.5], [9, 0.5], [9, 0], [8, 0]]],
                ],
            },
        },
        {
            "type": "Feature",
            "properties": {"kind": "room", "name": "empty"},
            "geometry": {"type": "Polygon", "coordinates": [[[0, 5], [2, 5], [2, 6], [0, 6], [0, 5]]]},
        },
        {"type": "Feature", "properties": {"kind": "wall"}, "geometry": None},
    ],
}


@pytest.fixture
def table(tmp_path: Path) -> Path:
    path = tmp_path / "finds.csv"
    path.write_text(TABLE, encoding="utf-8")
    return path


@pytest.fixture
def plan(tmp_path: Path) -> Path:
    path = tmp_path / "plan.geojson"
    path.write_text(json.dumps(PLAN), encoding="utf-8")
    return path


def test_an_irregular_table_is_counted_as_by_hand(table):
    result = finds.summary(table)
    assert (result.rows, result.total_count, result.total_weight_g) == (5, 20, 50.0)
    assert not result.synthetic
    by_colour = [
        (g.name, g.count, g.weight_g, g.count_share, g.weight_share) for g in result.groups["colour"]
    ]
    assert by_colour == [
        ("brown", 10, 20.0, 0.5, 0.4),
        ("aqua-green", 5, 15.0, 0.25, 0.3),
        ("green", 4, 11.0, 0.2, 0.22),
        ("not recorded", 1, 4.0, 0.05, 0.08),
    ]
    rooms = {g.name: (g.count, g.weight_g) for g in result.groups["room"]}
    assert rooms == {"Küche, Süd": (10, 20.0), "Saal 1": (5, 15.0), "elsewhere": (5, 15.0)}
    # Equal weights stand in the order of their names; the unrecorded come last.
    assert [g.name for g in result.groups["type"]] == ["cylinder-blown", "cast", "not recorded"]
    # 1.99 lies below 2 mm, 2.0 and 2.999 within 2-3 mm, 5 at the lower end of 5-6 mm.
    classes = [(g.name, g.count) for g in result.groups["thickness_class"]]
    assert classes == [("1-2 mm", 1), ("2-3 mm", 8), ("5-6 mm", 1), ("not recorded", 10)]
    for groups in result.groups.values():
        assert sum(g.count for g in groups) == 20
        assert sum(g.weight_share for g in groups) == pytest.approx(1.0)


def test_density_is_per_square_metre_of_the_room_without_its_holes(table, plan):
    with pytest.warns(SpeculariaWarning, match="5 of 20 fragments lie in no room of plan.geojson"):
        result = finds.summary(table, plan)
    saal, kitchen, empty = result.density["room"]
    assert (saal.area_m2, saal.count, saal.count_per_m2, saal.weight_g_per_m2) == (10.0, 5, 0.5, 1.5)
    assert (kitchen.area_m2, kitchen.count_per_m2, kitchen.weight_g_per_m2) == (2.5, 4.0, 8.0)
    assert (empty.name, empty.count, empty.count_per_m2) == ("empty", 0, 0.0)
    assert "square" not in result.density  # the plan has none


def test_the_columns_may_stand_in_any_order_and_comments_label_the_table(table):
    rows = list(csv.reader(table.read_text(encoding="utf-8").splitlines()))
    turned = "\n".join(",".join(f'"{c}"' for c in reversed(r)) for r in rows if r)
    other = table.with_name("other.csv")
    other.write_text("# synthetic: invented\n# by a test\n" + turned, encoding="utf-8-sig")
    result = finds.summary(other)
    assert result.groups == finds.summary(table).groups
    assert result.synthetic


FAULTS = [
    ("weight_g", "weight_kg", 1, "the column weight_g", "'weight_kg'"),
    ("thickness_mm", "thickness_cm", 1, "the column thickness_mm", "'thickness_cm'"),
    ("colour,", "color,", 1, "a known column", "Did you mean colour?"),
    ("colour,", "count,", 1, "each column once", "'count' twice"),
    (",square", "", 1, "the columns", "no square"),
    ("3,10.5,", "3,10.5 g,", 2, "weight as a number > 0 in g", "'10.5 g'"),
    ("3,10.5,", '3,"10,5",', 2, "weight as a number > 0 in g", "decimal mark as a point"),
    ("3,10.5,", "3,-10.5,", 2, "weight as a number > 0 in g", "'-10.5'"),
    ("3,10.5,", "3,0,", 2, "weight as a number > 0 in g", "'0'"),
    ("3,10.5,", "3,nan,", 2, "weight as a number > 0 in g", "'nan'"),
    ("3,10.5,", "3,1e999,", 2, "weight as a number > 0 in g", "'1e999'"),
    ("3,10.5,", "3,,", 2, "weight as a number > 0 in g", "an empty cell"),
    ("5,1.5e1,", "5.5,1.5e1,", 7, "count as a whole number >= 1", "'5.5'"),
    ("5,1.5e1,", "0,1.5e1,", 7, "count as a whole number >= 1", "'0'"),
    ("2.999", "3 mm", 7, "thickness as a number > 0 in mm", "the unit stands in the column's name"),
    ("1/b", "1/a", 3, "each find number once", "first in line 2"),
    ("1/b", "", 3, "a find number", "an empty cell"),
    ("elsewhere", "=1+1", 7, "plain text in room", "formula"),
    ("elsewhere", "else,where", 7, "8 cells", "9"),
    ("elsewhere", '"elsewhere', 7, "a row of comma-separated cells", "unexpected end"),
]


@pytest.mark.parametrize(("old", "new", "line", "expected", "found"), FAULTS)
def test_faults_are_named_with_their_line(table, old, new, line, expected, found):
    assert TABLE.count(old) == 1
    table.write_text(TABLE.replace(old, new), encoding="utf-8")
    with pytest.raises(FormatError) as error:
        finds.read(table)
    assert error.value.line == line
    assert expected in error.value.expected
    assert found in str(error.value)


def test_other_files_are_refused_as_tables(tmp_path):
    for name, content in {
        "empty.csv": b"",
        "header.csv": TABLE.splitlines()[0].encode(),
        "semicolons.csv": TABLE.replace(",", ";").encode(),
        "latin.csv": TABLE.encode("latin-1"),
        "binary.csv": bytes(range(256)),
    }.items():
        (tmp_path / name).write_bytes(content)
        with pytest.raises(FormatError):
            finds.read(tmp_path / name)
    with pytest.raises(FormatError, match="found nothing"):
        finds.read(tmp_path / "missing.csv")


def broken_plans() -> dict[str, str]:
    def changed(**geometry: object) -> str:
        plan = json.loads(json.dumps(PLAN))
        plan["features"][0]["geometry"] |= geometry
        return json.dumps(plan)

    twice = json.loads(json.dumps(PLAN))
    twice["features"].append(twice["features"][0])
    unnamed = json.loads(json.dumps(PLAN))
    del unnamed["features"][0]["properties"]["name"]
    return {
        "not json": '{"type": ',
        "not a collection": "[]",
        "no areas": '{"type": "FeatureCollection", "features": []}',
        "a line": changed(type="LineString"),
        "open": changed(coordinates=[[[0, 0], [1, 0], [1, 1], [0, 1]]]),
        "no area": changed(coordinates=[[[0, 0], [1, 0], [2, 0], [0, 0]]]),
        "text": changed(coordinates=[[["a", 0], [1, 0], [2, 0], ["a", 0]]]),
        "nothing": changed(coordinates=None),
        "twice": json.dumps(twice),
        "unnamed": json.dumps(unnamed),
    }


@pytest.mark.parametrize("fault", list(broken_plans()))
def test_broken_plans_are_refused(tmp_path, fault):
    path = tmp_path / "plan.geojson"
    path.write_text(broken_plans()[fault], encoding="utf-8")
    with pytest.raises(FormatError):
        finds.read_plan(path)


def test_the_written_tables_hold_the_numbers_exactly(table, plan, tmp_path):
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", SpeculariaWarning)
        result = finds.summary(table, plan)
    written = finds.write_summary(result, tmp_path / "out")
    assert {p.name for p in written} == {
        "by_colour.csv", "by_room.csv", "by_type.csv", "by_thickness_class.csv", "density_room.csv",
        "thickness.csv", "glazed_area.csv",
    }  # fmt: skip
    with (tmp_path / "out" / "by_colour.csv").open(newline="", encoding="utf-8") as f:
        rows = list(csv.DictReader(f))
    for row, group in zip(rows, result.groups["colour"], strict=True):
        assert (row["name"], int(row["count"]), float(row["weight_g"])) == (
            group.name,
            group.count,
            group.weight_g,
        )
        assert float(row["weight_share"]) == group.weight_share


def test_the_command_counts_draws_and_prints_one_json_object(command, table, plan, tmp_path):
    code, out, err = command("finds", "summary", table, "--plan", plan, "-o", tmp_path / "out", "--json")
    assert code == 0
    assert (out["total_count"], out["total_weight_g"], out["synthetic"]) == (20, 50.0, False)
    brown = out["groups"]["colour"][0]
    assert {k: brown[k] for k in ("name", "count", "weight_g", "count_share", "weight_share")} == {
        "name": "brown", "count": 10, "weight_g": 20.0, "count_share": 0.5, "weight_share": 0.4
    }  # fmt: skip
    assert brown["count_low"] < 0.5 < brown["count_high"]
    assert brown["weight_low"] < 0.4 < brown["weight_high"]
    assert out["thickness"]["measured_count"] == 10
    assert out["area"]["low_m2"] < out["area"]["area_m2"] < out["area"]["high_m2"]
    assert out["density"]["room"][0]["count_per_m2"] == 0.5
    assert err.count("lie in no room") == 1
    for name in (
        "finds_by_colour.png",
        "finds_thickness.png",
        "thickness.csv",
        "finds_by_colour.csv",
        "finds_on_plan_room.png",
        "density_room.csv",
    ):
        assert (tmp_path / "out" / name).stat().st_size > 0
    with (tmp_path / "out" / "finds_by_colour.csv").open(newline="", encoding="utf-8") as f:
        assert [float(r["weight_g"]) for r in csv.DictReader(f)] == [20.0, 15.0, 11.0, 4.0]
    with (tmp_path / "out" / "finds_on_plan_room.csv").open(newline="", encoding="utf-8") as f:
        assert [float(r["count_per_m2"]) for r in csv.DictReader(f)] == [0.5, 4.0, 0.0]


def test_bad_data_end_with_code_3_and_leave_nothing(command, table, tmp_path):
    table.write_text(TABLE.replace("10.5", "10.5 g"), encoding="utf-8")
    code, _, err = command("finds", "summary", table, "-o", tmp_path / "out")
    assert code == 3
    assert "finds.csv, line 2: expected weight as a number > 0 in g, found '10.5 g'" in err
    assert not (tmp_path / "out").exists()
    code, _, err = command("finds", "summary", tmp_path / "none.csv", "-o", tmp_path / "out")
    assert code == 3
    table.write_text(TABLE, encoding="utf-8")
    (tmp_path / "file").write_text("in the way")
    code, _, err = command("finds", "summary", table, "-o", tmp_path / "file")
    assert code == 3 and "file" in err
    code, _, _ = command("finds", "summary", table)
    assert code == 2


def test_a_long_table_is_summed_exactly(tmp_path):
    rng = np.random.default_rng(5)
    n = 20_000
    tenths = rng.integers(1, 500, n)
    colour = rng.integers(0, 4, n)
    lines = [f"S-{k},r{k % 7},,{'abcd'[colour[k]]},{tenths[k] / 10},2.5,t,1" for k in range(n)]
    path = tmp_path / "long.csv"
    path.write_text(",".join(finds.COLUMNS) + "\n" + "\n".join(lines), encoding="utf-8")
    result = finds.summary(path)
    assert result.total_weight_g == tenths.sum() / 10
    assert {g.name: g.weight_g for g in result.groups["colour"]} == {
        "abcd"[c]: tenths[colour == c].sum() / 10 for c in range(4)
    }
