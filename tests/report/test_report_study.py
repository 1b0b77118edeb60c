"""The report of a study: every number has its file; a browser shows and prints what Python wrote."""

from __future__ import annotations

import base64
import csv
import json
import re
import shutil
import subprocess
from dataclasses import dataclass, field
from html import unescape
from pathlib import Path

import numpy as np
import pytest

from specularia import gonio, study, surface
from specularia.gonio import Table

pytestmark = pytest.mark.filterwarnings("ignore::specularia.errors.SpeculariaWarning")

TAU = {0.0: 0.6, 40.0: 0.5, 70.0: 0.3}

DAY = "86400"
"""Seconds since 1970 that stand for today, by the convention of reproducible builds."""

SMALL = """
[gonio]
tables = ["gonio/*.dat"]
[xml]
resolution = 5
[fragment]
settings = "fragment.toml"
[finds]
table = "finds.csv"
[report]
title = "A small study"
note = "Everything in it is synthetic."
dsf_theta_deg = [20]
"""

WHOLE = (
    SMALL
    + """
[surface]
front = "front.nc"
back = "back.nc"
tiling = "periodic"
[glass]
settings = "glass.toml"
[trace]
paths = 1000
[healing]
ensemble = 3
theta_deg = [0, 40]
paths = 1000
[room]
settings = "room.toml"
[explain]
order = ["endless", "absorption"]
unsure = { absorption = 0.1 }
aperture_deg = 3.0
paths = 1000
[infer]
seek = ["absorption_per_mm"]
aperture_deg = 3.0
paths = 1000
"""
)

GLASS = """
thickness_mm = 3.0
[medium]
index = 1.52
absorption_per_mm = 0.05
[front]
flat = true
[back]
flat = true
"""

FRAGMENT = """
gap_mm = [0, 5]
contrast_gap_mm = [0, 2, 5]
[picture]
pixel_mm = 1.0
"""

ROOM = """
name = "a room"
[room]
width_m = 4
depth_m = 4
height_m = 3
[[window]]
name = "window"
wall = "south"
width_m = 1.0
height_m = 1.0
sill_m = 1.0
[sun]
elevation_deg = 45
azimuth_deg = 0.0
wall = "south"
[[sensor]]
name = "floor"
position_m = [2, 1, 0]
normal = [0, 0, 1]
[[view]]
name = "towards the window"
position_m = [2, 3.5, 1.6]
direction = [0, -1, 0]
horizontal_deg = 60
size_px = [24, 18]
[quality]
sampling = 0.2
repeats = 2
"""


def write_tables(folder: Path) -> None:
    """Even scatterers with known integrals."""
    folder.mkdir()
    rng = np.random.default_rng(3)
    for theta, tau in TAU.items():
        theta_s = 180.0 - np.degrees(np.arcsin(np.sqrt(rng.random(6000))))
        phi_s = 360.0 * rng.random(6000)
        values = np.full(6000, tau / np.pi) * np.abs(np.cos(np.radians(theta_s)))
        table = Table("", "DSF", "transmission_front", theta, 0.0, theta_s, phi_s, values, band="520 nm")
        gonio.write(table, folder / f"t{theta:g}.dat")


def write_faces(folder: Path) -> None:
    """Faces of a slope of their own with a few pits."""
    rng = np.random.default_rng(5)
    y, x = np.mgrid[:64, :64]
    for name in ("front", "back"):
        heights = 0.3 * np.sin(2 * np.pi * x / 64) + 0.002 * rng.standard_normal((64, 64))
        for _ in range(5):
            cx, cy = rng.uniform(8, 56, 2)
            r2 = (x - cx) ** 2 + (y - cy) ** 2
            heights -= np.where(r2 < 25, 4.0 * (1 - r2 / 25), 0.0)
        made = surface.HeightMap(heights, 1.5, 1.5, attributes={"synthetic": "made for a test"})
        surface.write(made, folder / f"{name}.nc")


def write_study(folder: Path, text: str) -> Path:
    """All files of a study; its STUDY.toml."""
    write_tables(folder / "gonio")
    write_faces(folder)
    rng = np.random.default_rng(7)
    rows = ["find_number,room,square,colour,weight_g,thickness_mm,type,count"]
    for k in range(60):
        colour = ("brown", "green", "aqua")[k % 3]
        rows.append(f"{k},hall,A1,{colour},{rng.uniform(1, 9):.2f},{rng.uniform(2, 4):.2f},blown,{1 + k % 4}")
    (folder / "finds.csv").write_text("\n".join(rows) + "\n")
    for name, content in {
        "glass.toml": GLASS,
        "fragment.toml": FRAGMENT,
        "room.toml": ROOM,
        "study.toml": text,
    }.items():
        (folder / name).write_text(content)
    return folder / "study.toml"


def run(folder: Path, text: str) -> Path:
    """The page of a study that is written to a folder and run there."""
    done = study.run(write_study(folder, text), folder / "out")
    assert done.report is not None
    return done.report


@pytest.fixture(scope="module")
def built(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The page of the small study."""
    return run(tmp_path_factory.mktemp("report"), SMALL)


@dataclass
class Shown:
    """A table as it stands on the page."""

    number: str
    file: str
    content: bytes
    header: list[str] = field(default_factory=list)
    rows: list[list[str]] = field(default_factory=list)


def words(html: str) -> str:
    """The text of a piece of HTML."""
    return re.sub(r"\s+", " ", unescape(re.sub(r"<[^>]+>", "", html))).strip()


def tables_of(page: str) -> list[Shown]:
    """Every table of a page but those in its views, with the file that its caption offers."""
    found = []
    for block in re.findall(r'<div class="tableblock".*?</table>', page, re.S):
        link = re.search(r'Numbers: <a href="([^"]*)" download="[^"]*">([^<]*)</a>', block)
        assert link, f"no file of numbers for {words(block)[:80]}"
        number = re.search(r"<b>(Table \d+)\.</b>", block)
        assert number
        media, _, content = link.group(1).partition(",")
        assert media == "data:text/csv;charset=utf-8;base64"
        table = Shown(number.group(1), link.group(2), base64.b64decode(content))
        for row in re.findall(r"<tr>(.*?)</tr>", block, re.S):
            cells = [words(c) for c in re.findall(r"<t[hd][^>]*>(.*?)</t[hd]>", row, re.S)]
            if table.header:
                table.rows.append(cells)
            else:
                table.header = cells
        found.append(table)
    return found


NUMBER = re.compile(r"(?<![\w.])[+-]?\d(?:[\d,]*\d)?(?:\.\d+)?(?:e[+-]?\d+)?(?![\w]|\.\d)")


def numbers_in(text: str) -> list[str]:
    """Numbers as they are written; those that are a part of a name are none."""
    return NUMBER.findall(text)


def half_a_unit(written: str) -> float:
    """Half a unit in the last place of a written number."""
    mantissa, _, exponent = written.partition("e")
    return 0.5 * 10.0 ** (int(exponent or 0) - len(mantissa.partition(".")[2]))


def stands_in(written: str, after: str, values: list[float]) -> bool:
    """Whether a number is one of the values, rounded; standard errors (after ±) are rounded up."""
    shown, half = float(written.replace(",", "")), half_a_unit(written.replace(",", ""))
    up = 2.0 if after == "±" else 1.0
    return any(-half * 1.000001 <= shown - v <= up * half * 1.000001 for v in values)


def check_numbers(page: Path) -> int:
    """Every number of every table is in its CSV, in the same row where both have as many; how many."""
    seen = 0
    for table in tables_of(page.read_text(encoding="utf-8")):
        assert (page.parent / table.file).read_bytes() == table.content
        lines = list(csv.reader(table.content.decode().splitlines()))
        each = [[float(n.replace(",", "")) for cell in line for n in numbers_in(cell)] for line in lines[1:]]
        everything = [v for line in each for v in line]
        for k, row in enumerate(table.rows):
            held = each[k] if len(each) == len(table.rows) else everything
            for cell in row:
                for n in NUMBER.finditer(cell):
                    before = cell[: n.start()].strip()[-1:]
                    assert stands_in(n.group(), before, held), f"{table.number}: {n.group()} of {row}"
                    seen += 1
        # Angles stand over columns, in the file as numbers or within the names of its columns.
        names = [float(n) for name in lines[0] for n in re.findall(r"\d+(?:\.\d+)?", name)]
        for head in table.header:
            for n in numbers_in(head.replace("°", "")):
                assert stands_in(n, "", everything + names), f"{table.number}: {n} over a column"
    return seen


def test_every_number_of_every_table_is_in_the_file_that_its_caption_names(built: Path) -> None:
    assert check_numbers(built) > 60


@pytest.mark.slow
def test_every_number_of_a_study_with_all_stages_is_in_its_file(tmp_path: Path) -> None:
    page = run(tmp_path, WHOLE)
    titles = re.findall(r"<h2>(.*?)</h2>", page.read_text(encoding="utf-8"))
    assert titles == [
        "What this is",
        "The finds",
        "Measured distributions",
        "Model M, from the measurement",
        "The faces of the glass",
        "Model C, from the geometry",
        "Direct-hemispherical transmission",
        "Distributions of the models",
        "The models, to be turned about",
        "The specimen over a printed sheet",
        "The lit room",
        "The front as it may have been",
        "The back as it may have been",
        "Model H, the pane as it may have been",
        "Why Model C and the measurement differ",
        "What the glass is like",
        "Provenance",
    ]
    assert check_numbers(page) > 200


def test_a_number_that_is_not_in_its_file_is_found_out(built: Path, tmp_path: Path) -> None:
    """Without this the tests above could pass by looking at nothing."""
    shutil.copytree(built.parent, tmp_path / "report")
    page = tmp_path / "report" / built.name
    text = page.read_text(encoding="utf-8")
    changed = re.sub(r"<td>0\.(\d)", lambda m: f"<td>0.{(int(m.group(1)) + 1) % 10}", text, count=1)
    assert changed != text
    page.write_text(changed, encoding="utf-8")
    with pytest.raises(AssertionError, match="Table"):
        check_numbers(page)


def test_a_page_made_anew_of_the_same_inputs_differs_in_its_date_alone(
    built: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("SOURCE_DATE_EPOCH", DAY)
    again = run(tmp_path, SMALL).read_text(encoding="utf-8")
    first = built.read_text(encoding="utf-8")
    dated = re.compile(r'(<p class="meta">specularia [^ ]+ · )([^<]*?)(?= ·|</p>)')
    assert dated.search(again).group(2) == "2 January 1970"
    assert dated.search(first).group(2) != "2 January 1970"
    assert dated.sub(r"\1", again) == dated.sub(r"\1", first)


def test_every_figure_has_its_numbers_beside_the_page(built: Path) -> None:
    text = built.read_text(encoding="utf-8")
    figures = re.findall(r"<figure.*?</figure>", text, re.S)
    assert len(figures) >= 7
    for figure in figures:
        named = re.search(r">(figures/[^<]*\.(?:csv|npz))</a>", figure)
        assert named, words(figure)[-200:]
        assert (built.parent / named.group(1)).stat().st_size > 100


def test_captions_name_the_counterparts_of_the_published_study_in_its_order(built: Path) -> None:
    found = re.findall(r"Counterpart in the published study: ((?:Fig\.|Table) \d+)", built.read_text())
    assert found == ["Fig. 3", "Fig. 6", "Table 1", "Fig. 9", "Fig. 10"]


def acting(page: Path, script: str, *, printed: bool = False) -> Path:
    """A copy beside the page in which something is done once it stands; `printed` by the rules of paper."""
    made = page.with_name("acted.html")
    text = page.read_text(encoding="utf-8")
    if printed:
        head, _, rest = text.partition("</style>")
        assert "@media print" in head
        text = head.replace("@media print", "@media all") + "</style>" + rest
    head, _, tail = text.rpartition("</body>")
    made.write_text(f"{head}<script>{script}</script></body>{tail}", encoding="utf-8")
    return made


LOOK = """
addEventListener("load", () => setTimeout(() => {
  const all = document.documentElement, box = e => e.getBoundingClientRect();
  const inside = e => { for (let p = e.parentElement; p; p = p.parentElement)
    if (getComputedStyle(p).overflowX === "auto") return true; return false; };
  const shown = [...document.querySelectorAll("main *")].filter(e => e.offsetParent !== null && !inside(e));
  const say = (k, v) => all.setAttribute("data-" + k, v);
  say("sideways", all.scrollWidth - all.clientWidth);
  say("beyond", shown.filter(e => box(e).right > all.clientWidth + 1).map(e => e.tagName).join(" "));
  say("frames", [...document.querySelectorAll("iframe")].filter(e => box(e).height > 0).length);
  say("stills", [...document.querySelectorAll("img.printonly")].filter(e => box(e).height > 0).length);
  say("tallest", Math.max(...[...document.querySelectorAll("figure")].map(e => box(e).height)));
  say("widest", Math.max(...[...document.querySelectorAll("figure img, table")].map(e => box(e).width)));
  say("asked", performance.getEntriesByType("resource").filter(e => !/^(data|about):/.test(e.name)).length);
  say("cells", JSON.stringify([...document.querySelectorAll(".tableblock")].map(b =>
    [...b.querySelectorAll("tr")].map(r => [...r.children].map(c => c.innerText.trim())))));
}, 500));
"""


def seen_by(html: str) -> dict[str, str]:
    """What `LOOK` said of the page."""
    head = re.match(r"<!DOCTYPE html>\s*<html([^>]*)>", html)
    assert head
    return {k: unescape(v) for k, v in re.findall(r'data-(\w+)="([^"]*)"', head.group(1))}


@pytest.mark.parametrize("width", [1280, 500])
def test_a_browser_shows_what_python_wrote_and_asks_for_nothing(built: Path, browse, width: int) -> None:
    html, log = browse(acting(built, LOOK), width=width)
    assert "CONSOLE" not in log
    found = seen_by(html)
    assert found["asked"] == "0"
    assert found["sideways"] == "0" and found["beyond"] == ""
    assert found["frames"] == "1" and found["stills"] == "0"
    # The view ran: it told its height, and the page took it.
    assert re.search(r'<iframe[^>]* style="height: \d{3,4}', html)
    cells = json.loads(found["cells"])
    assert cells == [[t.header, *t.rows] for t in tables_of(built.read_text(encoding="utf-8"))]
    summary = json.loads((built.parents[1] / _folder(built, "table_1") / "stage.json").read_text())["summary"]
    (transmission,) = (t for t in cells if t[0][0].startswith("τ (520"))
    row = next(r for r in transmission if r[0] == "Model M")
    assert [float(c.split(" ")[0]) for c in row[1:]] == pytest.approx(summary["rows"]["M"], abs=5e-5)


def _folder(page: Path, stage: str) -> str:
    return next(p.name for p in page.parents[1].iterdir() if p.name.startswith(stage))


def test_on_paper_the_view_is_a_picture_and_nothing_is_cut(built: Path, browse) -> None:
    # As wide as A4 and as high as Letter, less the margins of the print rules, at 96 dots per inch.
    width, height = round(178 / 25.4 * 96), round(243 / 25.4 * 96)
    html, log = browse(acting(built, LOOK, printed=True), width=width)
    assert "CONSOLE" not in log
    found = seen_by(html)
    assert found["frames"] == "0" and found["stills"] == "1"
    assert found["sideways"] == "0" and found["beyond"] == ""
    assert float(found["widest"]) <= width
    assert float(found["tallest"]) <= height


@pytest.mark.parametrize("width", [1280, 390])
def test_pictures_of_the_page_are_left_to_look_at(
    built: Path, chromium: str, tmp_path: Path, width: int
) -> None:
    """A frame is as narrow as a phone, which a window cannot be."""
    frame = built.with_name(f"frame_{width}.html")
    frame.write_text(
        f'<body style="margin:0"><iframe src="{built.name}" width={width} height=2400 style="border:0">'
    )
    picture = tmp_path / f"report_{width}.png"
    subprocess.run(
        [
            *(chromium, "--headless", "--no-sandbox", "--disable-gpu", "--disable-dev-shm-usage"),
            *("--hide-scrollbars", "--virtual-time-budget=4000", f"--user-data-dir={tmp_path / 'p'}"),
            *(f"--window-size={max(width, 500)},2400", f"--screenshot={picture}", frame.as_uri()),
        ],
        capture_output=True,
        timeout=120,
        check=True,
    )
    assert picture.stat().st_size > 20_000


def test_it_prints_to_a_pdf_of_several_pages(built: Path, chromium: str, tmp_path: Path) -> None:
    pdf = tmp_path / "report.pdf"
    subprocess.run(
        [
            *(chromium, "--headless", "--no-sandbox", "--disable-gpu", "--disable-dev-shm-usage"),
            *("--virtual-time-budget=4000", f"--user-data-dir={tmp_path / 'p'}"),
            *("--no-pdf-header-footer", f"--print-to-pdf={pdf}", built.as_uri()),
        ],
        capture_output=True,
        timeout=120,
        check=True,
    )
    content = pdf.read_bytes()
    assert content.startswith(b"%PDF")
    assert 3 <= len(re.findall(rb"/Type\s*/Page\b", content)) <= 30
