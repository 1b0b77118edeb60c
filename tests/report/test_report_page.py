"""The page: everything embedded, nothing fetched, every number to be had."""

from __future__ import annotations

import base64
import re
from html.parser import HTMLParser
from pathlib import Path

import numpy as np
import pytest

from specularia import report
from specularia.analysis import Table1
from specularia.errors import FormatError, OutputError
from specularia.provenance import record
from specularia.report import Embed, Figure, Paragraph, Section, TableBlock, figures, style, tables, viewer


class Links(HTMLParser):
    """All addresses of a page, by attribute, and its visible text."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.addresses: list[tuple[str, str, str]] = []
        self.names: list[str] = []
        self.words: list[str] = []
        self._quiet = 0
        self.feed(text)

    def handle_starttag(self, tag, attrs):
        self._quiet += tag in ("style", "script")
        for name, value in attrs:
            if name in ("src", "href", "action", "poster", "data", "srcset"):
                self.addresses.append((tag, name, value))
            if name == "download":
                self.names.append(value)

    def handle_endtag(self, tag):
        self._quiet -= tag in ("style", "script")

    def handle_data(self, data):
        if not self._quiet:
            self.words.append(data)

    @property
    def text(self) -> str:
        return re.sub(r"\s+", " ", " ".join(self.words))


def decoded(uri: str) -> bytes:
    return base64.b64decode(uri.split(",", 1)[1])


@pytest.fixture
def sections(lobe, tmp_path) -> list[Section]:
    models = {"Model M": lobe(), "Model C": lobe(width=0.05)}
    tau = figures.tau_curves(models, tmp_path / "tau.png", synthetic=True)
    cut = figures.sections(models, [20.0], tmp_path / "sections.png")
    view = viewer.write_view(models, tmp_path / "view.html", theta_deg=[0.0, 40.0])
    table = style.write_csv(tmp_path / "table.csv", ["a", "b"], [[1, 2.5]])
    return [
        Section(
            "First & foremost",
            [
                Paragraph("No <script>alert(1)</script> runs.", ["nor <b>bold</b>"]),
                Figure(tau, "Tau.", synthetic=True),
            ],
        ),
        Section(
            "Second",
            [
                TableBlock(["name", "x"], [["one", 1.23456], ["none", None], ["nan", float("nan")]], "Rows."),
                Embed(view, "A view."),
                Figure(cut, 'Cuts of "models".'),
                TableBlock(["a", "b"], [[1, 2.5]], "From a file.", csv=table),
            ],
        ),
    ]


PROVENANCE = {
    "model M": {"title": "a model", "parameters": '{"paths": 1000, "deep": {"er": null}}', "seed": "7"}
}


def test_a_page_refers_to_nothing_outside_itself(sections, tmp_path):
    html = report.page("A study", sections, PROVENANCE, tmp_path / "page.html").read_text(encoding="utf-8")
    links = Links(html)
    assert len([a for a in links.addresses if a[0] == "img"]) == 2
    for _, _, address in links.addresses:
        assert address.startswith(("data:", "#")), address[:80]
    assert "@import" not in html
    assert not re.search(r"url\((?!data:)", html)
    assert "default-src 'none'" in html


def test_pictures_and_numbers_are_embedded_byte_for_byte(sections, tmp_path):
    links = Links(
        report.page("A study", sections, PROVENANCE, tmp_path / "page.html").read_text(encoding="utf-8")
    )
    pictures = [decoded(a[2]) for a in links.addresses if a[0] == "img"]
    assert pictures == [(tmp_path / "tau.png").read_bytes(), (tmp_path / "sections.png").read_bytes()]
    files = dict(
        zip(links.names, [decoded(a[2]) for a in links.addresses if a[0] == "a" and a[2].startswith("data:")])
    )
    assert files["tau.csv"] == (tmp_path / "tau.csv").read_bytes()
    assert files["table.csv"] == (tmp_path / "table.csv").read_bytes()
    assert files["table-1.csv"].decode() == "name,x\none,1.23456\nnone,\nnan,nan\n"


def test_figures_and_tables_are_numbered_in_their_order_and_text_is_escaped(sections, tmp_path):
    html = report.page("A <study>", sections, PROVENANCE, tmp_path / "page.html").read_text(encoding="utf-8")
    assert "<li>nor &lt;b&gt;bold&lt;/b&gt;</li>" in html
    text = Links(html).text
    assert re.findall(r"(?:Figure|Table) \d+\.", text) == [
        "Figure 1.",
        "Table 1.",
        "Figure 2.",
        "Figure 3.",
        "Table 2.",
    ]
    assert "<script>alert(1)" not in html
    assert "<title>A &lt;study&gt;</title>" in html
    assert "1.235" in text  # four significant digits
    assert text.count("–") >= 2  # nothing, and not a number
    assert "contains synthetic data" in text
    assert "paths 1000" in text and "er –" in text  # JSON in the provenance is unfolded


def test_equal_inputs_give_equal_pages_and_the_date_is_the_callers(sections, tmp_path):
    first = report.page("A study", sections, PROVENANCE, tmp_path / "a.html").read_bytes()
    assert report.page("A study", sections, PROVENANCE, tmp_path / "b.html").read_bytes() == first
    dated = report.page("A study", sections, PROVENANCE, tmp_path / "c.html", date="1 May").read_text(
        encoding="utf-8"
    )
    assert dated.replace(" · 1 May", "").encode() == first


def test_large_files_of_numbers_are_linked_beside_the_page(tmp_path, lobe):
    (tmp_path / "deep").mkdir()
    picture = figures.tau_curves({"M": lobe()}, tmp_path / "deep" / "tau.png")
    big = style.write_npz(tmp_path / "deep" / "big.npz", {"x": np.random.default_rng(1).random(400_000)})
    page = report.page("S", [Section("s", [Figure(picture, "c", data=big)])], {}, tmp_path / "page.html")
    links = Links(page.read_text(encoding="utf-8"))
    assert ("a", "href", "deep/big.npz") in links.addresses
    assert page.stat().st_size < 1_000_000


def test_a_missing_or_broken_picture_is_refused_and_no_page_is_left(tmp_path):
    (tmp_path / "broken.png").write_text("not a picture")
    for name in ("broken.png", "none.png"):
        with pytest.raises(FormatError):
            report.page("S", [Section("s", [Figure(tmp_path / name, "c")])], {}, tmp_path / "page.html")
    assert not (tmp_path / "page.html").exists()
    with pytest.raises(OutputError):
        report.page("S", [], {}, tmp_path / "nowhere" / "page.html")


def test_a_view_has_a_picture_for_paper_with_its_numbers(lobe, tmp_path):
    models = {"M": lobe()}
    still = figures.sections(models, [20.0], tmp_path / "still.png")
    view = viewer.write_view(models, tmp_path / "view.html", theta_deg=[0.0, 40.0])
    section = Section("s", [Embed(view, "A view.", still=still)])
    html = report.page("S", [section], {}, tmp_path / "p.html").read_text(encoding="utf-8")
    outside = re.sub(r'srcdoc="[^"]*"', "", html)
    links = Links(outside)
    assert [decoded(a[2]) for a in links.addresses if a[0] == "img"] == [still.read_bytes()]
    assert '<img class="printonly"' in outside
    assert "still.csv" in links.names


def test_files_and_counterparts_are_named_in_the_caption(lobe, tmp_path):
    (tmp_path / "deep").mkdir()
    tau = figures.tau_curves({"M": lobe()}, tmp_path / "deep" / "tau.png")
    blocks = [Figure(tau, "Tau.", like="Fig. 3"), TableBlock(["a"], [[1]], "Rows.", like="Table 1")]
    text = Links(report.page("S", [Section("s", blocks)], {}, tmp_path / "p.html").read_text()).text
    assert "Tau. Counterpart in the published study: Fig. 3. Numbers: deep/tau.csv" in text
    assert "Rows. Counterpart in the published study: Table 1. Numbers: table-1.csv" in text


def test_provenance_records_are_shown(tmp_path):
    made = record(what="a thing", inputs=[], parameters={"paths": 12}, seed=3, synthetic=True)
    text = Links(report.page("S", [], {"thing": made}, tmp_path / "p.html").read_text(encoding="utf-8")).text
    for word in ("a thing", "paths 12", "seed 3", "synthetic: made by a computer program", "numpy"):
        assert word in text


def test_transmission_table_holds_values_errors_and_ratios():
    table = Table1(
        theta_deg=np.array([0.0, 85.0]),
        rows=("measured", "C", "clear slab"),
        tau=np.array([[0.7, np.nan], [0.86, 0.25], [0.918, 0.5]]),
        se=np.array([[3e-5, np.nan], [0.001, np.nan], [0.0, 0.0]]),
        ratio=np.array([[np.nan, np.nan], [0.86 / 0.7, np.nan], [0.918 / 0.7, np.nan]]),
        ratio_se=np.array([[np.nan, np.nan], [0.0038, np.nan], [0.0026, np.nan]]),
        extrapolated=np.array([[False, False], [False, True], [False, False]]),
        band="520 nm",
        side="transmission_front",
    )
    block = tables.transmission_table(table, "caption")
    assert block.header == ["τ (520 nm)", "0°", "85°"]
    assert block.rows == [
        ["measured", "0.7000 ± 0.0001", "–"],
        ["Model C", "0.8600 ± 0.0010", "0.2500*"],
        ["clear slab", "0.9180", "0.5000"],
        ["Model C / measured", "1.2286 ± 0.0038", "–"],
    ]


@pytest.mark.parametrize("width", [1280, 390])
def test_the_page_opens_in_a_browser_without_a_word_of_complaint(sections, tmp_path, browse, width):
    page = report.page("A study", sections, PROVENANCE, tmp_path / "page.html")
    html, log = browse(page, width=width)
    assert "Provenance" in Links(html).text
    assert "CONSOLE" not in log
    # The embedded view ran: it told its height, and the page took it.
    assert re.search(r'<iframe[^>]* style="height: \d{3,4}', html)


def test_the_browser_would_complain_about_a_request(tmp_path: Path, browse):
    """Without this the test above could pass by hearing nothing."""
    page = report.page("A study", [], {}, tmp_path / "page.html")
    text = page.read_text(encoding="utf-8")
    page.write_text(text.replace("</main>", '<img src="https://example.org/x.png"></main>'), encoding="utf-8")
    assert "CONSOLE" in browse(page)[1]


def test_columns_of_words_stand_left_and_columns_of_numbers_right(tmp_path):
    block = TableBlock(["a", "b", "c"], [["x", "front.nc", "1.2 ± 0.1"], ["y", None, None]], "c")
    html = report.page("S", [Section("s", [block])], {}, tmp_path / "p.html").read_text(encoding="utf-8")
    assert '<td class="words">front.nc</td><td>1.2 ± 0.1</td>' in html
    assert '<td class="words">–</td><td>–</td>' in html
