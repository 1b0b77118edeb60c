"""Tables as excavations keep them: other languages, mixed units, spreadsheets, and files made to do harm."""

from __future__ import annotations

import csv
import io
import json
import zipfile
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from specularia import finds
from specularia.errors import FormatError, SpeculariaWarning
from specularia.finds import spreadsheets

# German, French and English words; weights in g, kg and mg and two missing; thickness in mm and cm; a number
# that stands twice; decimal commas; a colour that nobody knows; a line of the excavation's own above.
TABLE = """\
Fundliste 2019;;;;;;;;
Fundnummer;Raum;Farbe;Gewicht;Einheit;Dicke;Machart;Anzahl;Bemerkung
W1;Saal;gelb;12,5;g;2,8 mm;Zylinder;3;
W2;Saal;jaune;0,25;kg;0,3 cm;cylindre;10;"groß; verbogen"
W3;salle;Grün;500;mg;;Zylinder;1;
W4;Küche;vert;-;;1,9 mm;moulé;2;nicht gewogen

W5;kitchen;green ;7,5;g;3,0 mm;cast;4;
W5;;mauve;1,5;g;k. A.;;1;Nummer doppelt
W7;Küche;;;;2,0 mm;;1;
"""

MAPPING = """\
thickness_unit = "in cells"
decimal = ","
separator = ";"
header_row = 2
empty = ["-", "k. A."]
missing_weight = "note"
duplicates = "note"
unknown_words = "note"
other_columns = "ignore"

[columns]
find_number = "Fundnummer"
room = "Raum"
colour = "Farbe"
weight = "Gewicht"
weight_unit = "Einheit"
thickness = "Dicke"
type = "Machart"
count = "Anzahl"

[values.colour]
gelb = "yellow"
jaune = "yellow"
"grün" = "green"
vert = "green"
green = "green"

[values.room]
saal = "hall"
salle = "hall"
"küche" = "kitchen"
kitchen = "kitchen"

[values.type]
zylinder = "cylinder-blown"
cylindre = "cylinder-blown"
"moulé" = "cast"
cast = "cast"
"""


@pytest.fixture
def irregular(tmp_path: Path) -> tuple[Path, Path]:
    table, mapping = tmp_path / "liste.csv", tmp_path / "mapping.toml"
    table.write_text(TABLE, encoding="utf-8")
    mapping.write_text(MAPPING, encoding="utf-8")
    return table, mapping


def test_an_irregular_table_in_three_languages_is_counted_as_by_hand(irregular):
    result = finds.summary(*irregular[:1], mapping=irregular[1])
    # 3 + 10 + 1 + 2 + 4 + 1 + 1 fragments; 12.5 + 250 + 0.5 + 7.5 + 1.5 g.
    assert (result.rows, result.total_count, result.total_weight_g) == (7, 22, 272.0)
    assert result.unweighed_count == 3
    colours = {g.name: (g.count, g.weight_g) for g in result.groups["colour"]}
    assert colours == {
        "yellow": (13, 262.5), "green": (7, 8.0), "mauve": (1, 1.5), "not recorded": (1, 0.0)
    }  # fmt: skip
    rooms = {g.name: (g.count, g.weight_g) for g in result.groups["room"]}
    assert rooms == {"hall": (14, 263.0), "kitchen": (7, 7.5), "not recorded": (1, 1.5)}
    types = {g.name: g.count for g in result.groups["type"]}
    assert types == {"cylinder-blown": 14, "cast": 6, "not recorded": 2}
    classes = [(g.name, g.count) for g in result.groups["thickness_class"]]
    assert classes == [("1-2 mm", 2), ("2-3 mm", 4), ("3-4 mm", 14), ("not recorded", 2)]
    assert [(n.line, n.column) for n in result.notes] == [
        (6, "weight"), (9, "find_number"), (9, "colour"), (10, "weight")
    ]  # fmt: skip
    assert "'W5' again (first in line 8)" in result.notes[1].text
    assert "'mauve'" in result.notes[2].text
    # 19 fragments of 20 with a thickness: (3 x 2.8 + 10 x 3 + 2 x 1.9 + 4 x 3 + 1 x 2) / 20.
    assert result.thickness.measured_count == 20
    assert result.thickness.mean_mm == pytest.approx(56.2 / 20)
    assert result.thickness.quantiles_mm[2] == 3.0
    # Weight over thickness of three rows, the rest as they are; 10 cm2 for a gram per mm at 1 g/cm3.
    over = 12.5 / 2.8 + 250 / 3.0 + 7.5 / 3.0
    assert result.area.area_m2 == pytest.approx(1e-3 * over / 2.5 * 272.0 / 270.0)
    assert result.area.measured_weight_g == 270.0
    assert result.area.harmonic_thickness_mm == pytest.approx(270.0 / over)


@pytest.mark.parametrize(
    ("key", "line", "found"),
    [
        ('missing_weight = "note"', 6, "an empty cell (2 more|an empty cell. (1 more in line 10"),
        ('duplicates = "note"', 9, "'W5' again (first in line 8)"),
        ('unknown_words = "note"', 9, "'mauve'"),
        ('other_columns = "ignore"', 2, "'Bemerkung'"),
        ('empty = ["-", "k. A."]', 6, "the unit of the weight"),
        ('decimal = ","', 3, "'12,5'"),
        ('separator = ";"', 2, "semicolons"),
    ],
)
def test_what_the_mapping_does_not_allow_is_refused_with_its_row(irregular, key, line, found):
    table, mapping = irregular
    mapping.write_text(MAPPING.replace(key + "\n", ""), encoding="utf-8")
    with pytest.raises(FormatError) as error:
        finds.read(table, mapping)
    assert error.value.line == line
    assert any(part in str(error.value) for part in found.split("|"))


def test_all_faults_are_named_at_once(irregular):
    table, mapping = irregular
    text = TABLE.replace(";12,5;g;", ";12,5;oz;").replace(";4;\n", ";0;\n")
    table.write_text(text, encoding="utf-8")
    with pytest.raises(FormatError) as error:
        finds.read(table, mapping)
    assert error.value.line == 3
    assert "expected a unit of weight (g, kg, mg), found 'oz'" in str(error.value)
    assert "(1 more in line 8.)" in str(error.value)


def test_units_are_exact_and_only_those_that_are_known():
    from specularia.finds.cells import Reader

    def read(text: str, unit: str, decimal: str = ".") -> float:
        mapping = finds.Mapping(weight_unit=unit, decimal=decimal)
        return Reader(Path("t.csv"), mapping, named=False).quantity(text, "weight", 1)

    assert read("0.3", "kg") == 300.0
    assert read("1234", "mg") == 1.234
    assert read("0,3 kg", "in cells", ",") == 300.0
    assert read("12.5g", "in cells") == 12.5
    assert read("5e-1", "g") == 0.5
    for bad in ("12 oz", "12", "g", "-3 g", "0 g", "1,5 g", "1.5.2 g", "1e999 g", "nan g", "0x10 g"):
        with pytest.raises(FormatError):
            read(bad, "in cells")
    for bad in ("1.234,5", "1,2,3", "12 g"):
        with pytest.raises(FormatError):
            read(bad, "g", ",")


def test_a_json_mapping_says_the_same_as_toml(irregular):
    import tomllib

    _, mapping = irregular
    other = mapping.with_suffix(".json")
    other.write_text(json.dumps(tomllib.loads(MAPPING)), encoding="utf-8")
    assert finds.read_mapping(other) == finds.read_mapping(mapping)
    with pytest.raises(FormatError, match="Did you mean decimal"):
        other.write_text('{"decimals": ","}', encoding="utf-8")
        finds.read_mapping(other)


def cells() -> list[list[object]]:
    head = list(finds.COLUMNS)
    rows = [
        ["1/a", "Saal 1", "A1", "green", 10.5, 2.0, "cylinder-blown", 3],
        ["1/b", "Saal 1", "A2", "green", 0.5, 1.99, "cylinder-blown", 1],
        [2, "Küche", None, "brown", 20, None, None, 10],
        [None] * 8,
        ["3", 1.16, "", "", 4, 5, "cast", 1],
    ]
    return [head, *rows]


def xlsx(path: Path, rows: list[list[object]]) -> Path:
    openpyxl = pytest.importorskip("openpyxl")
    book = openpyxl.Workbook()
    for row in rows:
        book.active.append(row)
    book.save(path)
    return path


def ods(path: Path, body: str) -> Path:
    """A file as LibreOffice writes it, with one sheet of the given rows."""
    names = "".join(
        f' xmlns:{n}="urn:oasis:names:tc:opendocument:xmlns:{n}:1.0"' for n in ("office", "table", "text")
    )
    content = (
        f'<?xml version="1.0"?><office:document-content{names}><office:body><office:spreadsheet>'
        f'<table:table table:name="Finds">{body}</table:table>'
        "</office:spreadsheet></office:body></office:document-content>"
    )
    kind = "application/vnd.oasis.opendocument.spreadsheet"
    manifest = "urn:oasis:names:tc:opendocument:xmlns:manifest:1.0"
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("mimetype", kind)
        archive.writestr("content.xml", content)
        archive.writestr(
            "META-INF/manifest.xml",
            f'<m:manifest xmlns:m="{manifest}"><m:file-entry m:full-path="/" m:media-type="{kind}"/>'
            "</m:manifest>",
        )
    return path


def ods_row(row: list[object]) -> str:
    out = ""
    for value in row:
        if value is None:
            out += "<table:table-cell/>"
        elif isinstance(value, str):
            out += f'<table:table-cell office:value-type="string"><text:p>{value}</text:p></table:table-cell>'
        else:
            out += f'<table:table-cell office:value-type="float" office:value="{value}"/>'
    return f"<table:table-row>{out}</table:table-row>"


# What spreadsheet programs put below and beside the last cell.
FILL = (
    '<table:table-row table:number-rows-repeated="1048000"><table:table-cell '
    'table:number-columns-repeated="16384"/></table:table-row>'
)


@pytest.mark.parametrize("kind", ["xlsx", "ods"])
def test_a_spreadsheet_is_read_as_the_csv_of_the_same_cells(tmp_path, kind):
    text = io.StringIO()
    csv.writer(text).writerows(cells())
    plain = tmp_path / "plain.csv"
    plain.write_text(text.getvalue(), encoding="utf-8")
    if kind == "xlsx":
        sheet = xlsx(tmp_path / "finds.xlsx", cells())
    else:
        sheet = ods(tmp_path / "finds.ods", "".join(map(ods_row, cells())) + FILL)
    a, b = finds.read(plain), finds.read(sheet)
    for name in ("find_number", "room", "square", "colour", "type"):
        assert getattr(a, name) == getattr(b, name)
    assert a.find_number == ("1/a", "1/b", "2", "3")
    assert a.room[3] == "1.16"
    np.testing.assert_array_equal(a.weight_g, b.weight_g)
    np.testing.assert_array_equal(a.thickness_mm, b.thickness_mm)
    np.testing.assert_array_equal(a.count, b.count)
    # Rows are those of the sheet, the empty one between counted.
    assert list(b.line) == [2, 3, 4, 6]
    rows = cells()
    rows[2][4] = "0,5"
    bad = (
        xlsx(tmp_path / "bad.xlsx", rows)
        if kind == "xlsx"
        else ods(tmp_path / "bad.ods", "".join(map(ods_row, rows)))
    )
    with pytest.raises(FormatError) as error:
        finds.read(bad)
    assert error.value.line == 3


def test_a_sheet_is_named_and_formulas_are_told(tmp_path):
    openpyxl = pytest.importorskip("openpyxl")
    book = openpyxl.Workbook()
    book.active.append(["something else"])
    second = book.create_sheet("Glas")
    for row in cells():
        second.append(row)
    second["I9"] = "=1+1"
    book.save(tmp_path / "two.xlsx")
    mapping = finds.Mapping(sheet="Glas", other_columns="ignore")
    with pytest.warns(SpeculariaWarning, match="1 cells hold formulas"):
        assert finds.read(tmp_path / "two.xlsx", mapping).count.sum() == 15
    with pytest.raises(FormatError, match="'Sheet', 'Glas'"):
        finds.read(tmp_path / "two.xlsx", finds.Mapping(sheet="Finds"))


def packed(path: Path, parts: dict[str, bytes]) -> Path:
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, data in parts.items():
            archive.writestr(name, data)
    return path


def harmful(folder: Path) -> dict[str, Path]:
    """Small files that unpack to large ones, or whose few cells stand for many."""
    zeros = bytes(spreadsheets.MOST_BYTES + 1_000_000)
    good = xlsx(folder / "good.xlsx", cells())
    with zipfile.ZipFile(good) as archive:
        parts = {n: archive.read(n) for n in archive.namelist()}
    sheet = "xl/worksheets/sheet1.xml"
    far = parts[sheet].replace(b'r="A2"', b'r="XFD1048576"')
    style = parts[sheet].replace(b'<c r="A2"', b"<c " + b's="0" ' + b"\n" * 500 + b'r="XFD1048576"')
    low = parts[sheet].replace(b'<row r="2"', b'<row r="104857600"')
    cell = '<table:table-cell office:value-type="float" office:value="1" table:number-columns-repeated="{}"/>'
    rows = "".join(map(ods_row, cells()))
    wide = f'<table:table-row table:number-rows-repeated="{{}}">{cell}</table:table-row>'
    typed = parts[sheet].replace(b"<worksheet", b'<!DOCTYPE a [<!ENTITY b "b">]><worksheet', 1)
    made = {
        "zeros": packed(folder / "zeros.xlsx", {**parts, "xl/media/a.bin": zeros}),
        "shared strings": packed(folder / "strings.xlsx", {**parts, "xl/sharedStrings.xml": zeros}),
        "far cell": packed(folder / "far.xlsx", {**parts, sheet: far}),
        "far cell behind blanks": packed(folder / "blanks.xlsx", {**parts, sheet: style}),
        "far row": packed(folder / "low.xlsx", {**parts, sheet: low}),
        "parts": packed(folder / "parts.xlsx", {**parts, **{f"xl/{k}": b"" for k in range(2100)}}),
        "entities": packed(folder / "entities.xlsx", {**parts, sheet: typed}),
        "repeated cell": ods(folder / "cell.ods", rows + wide.format(1, 1_000_000_000)),
        "repeated row": ods(folder / "row.ods", rows + wide.format(1_000_000_000, 1)),
        "repeated both": ods(folder / "both.ods", rows + wide.format(90_000, 90_000)),
        "repeated text": ods(
            folder / "text.ods",
            rows + '<table:table-row><table:table-cell table:number-columns-repeated="99000000" '
            'office:value-type="string"><text:p>x</text:p></table:table-cell></table:table-row>',
        ),
    }
    assert all(p.stat().st_size < 2_000_000 for p in made.values())
    return made


def test_files_that_unpack_to_too_much_are_refused_before_they_are_read(tmp_path, monkeypatch):
    import python_calamine

    # As the limit is, but for the time that this test takes.
    monkeypatch.setattr(spreadsheets, "MOST_BYTES", 30_000_000)

    class Reached(BaseException):
        pass

    def reached(*_, **__):
        raise Reached

    for name, path in harmful(tmp_path).items():
        with monkeypatch.context() as patch:
            patch.setattr(python_calamine.CalamineWorkbook, "from_path", reached, raising=True)
            with pytest.raises(FormatError) as error:
                finds.read(path)
        assert "ordinary size" in str(error.value), (name, str(error.value))


def test_broken_and_foreign_archives_are_refused(tmp_path):
    good = xlsx(tmp_path / "good.xlsx", cells())
    whole = good.read_bytes()
    cases = {
        "truncated.xlsx": whole[: len(whole) // 2],
        "flipped.xlsx": whole[:300] + bytes(200) + whole[500:],
        "old.xls": b"\xd0\xcf\x11\xe0\xa1\xb1\x1a\xe1" + bytes(600),
        "nul.csv": ",".join(finds.COLUMNS).encode() + b"\n\x00\x00",
    }
    for name, data in cases.items():
        (tmp_path / name).write_bytes(data)
        with pytest.raises(FormatError):
            finds.read(tmp_path / name)
    with pytest.raises(FormatError, match="another kind of ZIP"):
        finds.read(packed(tmp_path / "other.zip", {"a.txt": b"a"}))


def test_text_that_a_spreadsheet_would_run_is_neutralised_in_what_is_written(tmp_path, command):
    dangerous = ['-2+3+cmd|" /C calc"!A0', "|calc", "%0A=1", "-HYPERLINK(1)"]
    head = ",".join(finds.COLUMNS)
    rows = [
        ",".join(['"' + d.replace('"', '""') + '"', '"' + d.replace('"', '""') + '"', "A1",
                  '"' + d.replace('"', '""') + '"', "1", "2", "t", "1"])
        for d in dangerous
    ]  # fmt: skip
    table = tmp_path / "t.csv"
    table.write_text(head + "\n" + "\n".join(rows), encoding="utf-8")
    plan = tmp_path / "plan.geojson"
    ring = [[0, 0], [2, 0], [2, 2], [0, 2], [0, 0]]
    features = [
        {"properties": {"kind": kind, "name": name}, "geometry": {"type": "Polygon", "coordinates": [ring]}}
        for kind, name in [("room", dangerous[0]), ("square", "A1")]
    ]
    plan.write_text(json.dumps({"type": "FeatureCollection", "features": features}), encoding="utf-8")
    code, _, _ = command(
        "finds", "summary", table, "--plan", plan, "-o", tmp_path / "out", "--choose", "4", "-q",
        "--bandwidth", "0.5",
    )  # fmt: skip
    assert code == 0
    seen = 0
    for file in sorted((tmp_path / "out").glob("*.csv")):
        with file.open(newline="", encoding="utf-8") as f:
            for row in csv.reader(f):
                for cell in row:
                    assert not cell.startswith(("=", "+", "-", "@", "|", "%", "\t")), (file.name, cell)
                    seen += cell.startswith("'")
    assert seen >= 4 * 5
    for bad in ("=1+1", "+1", "@SUM(1)"):
        table.write_text(f"{head}\n1,{bad},,a,1,,t,1\n", encoding="utf-8")
        with pytest.raises(FormatError, match="formula"):
            finds.read(table)


def test_a_plan_leads_nowhere_out_of_its_folder(tmp_path):
    from PIL import Image

    inside, outside = tmp_path / "plan", tmp_path / "elsewhere"
    inside.mkdir(), outside.mkdir()
    Image.new("L", (40, 20)).save(outside / "secret.png")
    Image.new("L", (40, 20)).save(inside / "drawing.png")
    (inside / "link.png").symlink_to(outside / "secret.png")
    file = inside / "plan.toml"
    for name in (
        "../elsewhere/secret.png",
        str(outside / "secret.png"),
        "link.png",
        "a/../../elsewhere/secret.png",
    ):
        file.write_text(f'picture = "{name}"\nmetres_per_pixel = 0.1\n', encoding="utf-8")
        with pytest.raises(FormatError, match="in the folder of the plan or below"):
            finds.read_plan(file)
        areas = f'picture = "drawing.png"\nareas = "{name}"\nmetres_per_pixel = 0.1\n'
        file.write_text(areas, encoding="utf-8")
        with pytest.raises(FormatError, match="in the folder of the plan or below"):
            finds.read_plan(file)
    file.write_text(
        'picture = "drawing.png"\nareas = "plan.toml"\nmetres_per_pixel = 0.1\n', encoding="utf-8"
    )
    with pytest.raises(FormatError, match="GeoJSON"):
        finds.read_plan(file)
    file.write_text(
        'picture = "drawing.png"\nmetres_per_pixel = 0.1\norigin_px = [10, 20]\n', encoding="utf-8"
    )
    plan = finds.read_plan(file)
    assert plan.picture.extent_m == pytest.approx((-1.0, 3.0, 0.0, 2.0))


def test_a_deep_sheet_of_a_spreadsheet_program_is_read_in_bounded_memory(tmp_path):
    """Filling to the last row and column is not content; 1,048,000 empty rows become none."""
    made = ods(tmp_path / "filled.ods", "".join(map(ods_row, cells())) + FILL + ods_row([None]))
    assert finds.read(made).count.sum() == 15


def test_damaged_spreadsheets_are_read_or_refused_and_nothing_else(tmp_path):
    whole = xlsx(tmp_path / "good.xlsx", cells()).read_bytes()
    rng = np.random.default_rng(3)
    refused = 0
    for k in range(40):
        data = bytearray(whole)
        for at in rng.integers(0, len(whole), 1 + k % 5):
            data[at] ^= int(rng.integers(1, 256))
        path = tmp_path / "damaged.xlsx"
        path.write_bytes(bytes(data))
        try:
            finds.read(path)
        except FormatError:
            refused += 1
    assert refused > 20


@settings(max_examples=80, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(st.lists(st.text(alphabet="a1,;.-=+\t\"'\u00e4 \n\r\x00kgm", max_size=30), max_size=6), st.booleans())
def test_any_text_below_the_header_is_read_or_refused_and_nothing_else(tmp_path, lines, mapped):
    path = tmp_path / "fuzz.csv"
    path.write_text(",".join(finds.COLUMNS) + "\n" + "\n".join(lines), encoding="utf-8", newline="")
    mapping = (
        finds.Mapping(missing_weight="note", duplicates="note", weight_unit="in cells") if mapped else None
    )
    try:
        read = finds.read(path, mapping)
    except FormatError:
        return
    assert np.isfinite(read.weight_g).any() and (read.count >= 1).all()
