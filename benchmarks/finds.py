"""Seconds that a catalogue of 100,000 rows takes, as CSV, XLSX and ODS.

    python benchmarks/finds.py [ROWS]

Prints the time to read and check each, to count it with its intervals, and the whole of `specularia finds
summary` on the CSV with its tables and figures, as a program of its own. The bar for reading and counting is
10 seconds. The table is synthetic.
"""

from __future__ import annotations

import csv
import sys
import tempfile
import time
import zipfile
from pathlib import Path
from xml.sax.saxutils import escape

import numpy as np

from specularia import finds
from specularia.cli import main

_NAMES = "".join(
    f' xmlns:{n}="urn:oasis:names:tc:opendocument:xmlns:{n}:1.0"' for n in ("office", "table", "text")
)


def table(rows: int) -> list[list[object]]:
    rng = np.random.default_rng(0)
    colour = rng.choice(["yellow", "brown", "green", "aqua", "colourless", "blue", ""], rows)
    room, weight, thickness = (
        rng.integers(0, 200, rows),
        rng.lognormal(1, 1, rows),
        rng.normal(2.7, 0.5, rows),
    )
    count = rng.geometric(0.6, rows)
    return [
        [
            f"S-{k}",
            f"room {room[k]}",
            f"A{room[k]}",
            str(colour[k]),
            round(float(weight[k]) + 0.01, 2),
            round(float(np.clip(thickness[k], 1, 6)), 1),
            "cylinder-blown",
            int(count[k]),
        ]
        for k in range(rows)
    ]


def write_xlsx(path: Path, rows: list[list[object]]) -> None:
    import openpyxl

    book = openpyxl.Workbook(write_only=True)
    sheet = book.create_sheet("Finds")
    for row in rows:
        sheet.append(row)
    book.save(path)


def write_ods(path: Path, rows: list[list[object]]) -> None:
    def cell(value: object) -> str:
        if isinstance(value, str):
            text = escape(value)
            return (
                f'<table:table-cell office:value-type="string"><text:p>{text}</text:p></table:table-cell>'
                if text
                else "<table:table-cell/>"
            )
        return f'<table:table-cell office:value-type="float" office:value="{value}"/>'

    body = "".join(f"<table:table-row>{''.join(map(cell, row))}</table:table-row>" for row in rows)
    kind = "application/vnd.oasis.opendocument.spreadsheet"
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("mimetype", kind)
        archive.writestr(
            "content.xml",
            f'<?xml version="1.0"?><office:document-content{_NAMES}><office:body><office:spreadsheet>'
            f'<table:table table:name="Finds">{body}</table:table>'
            "</office:spreadsheet></office:body></office:document-content>",
        )
        archive.writestr(
            "META-INF/manifest.xml",
            '<m:manifest xmlns:m="urn:oasis:names:tc:opendocument:xmlns:manifest:1.0">'
            f'<m:file-entry m:full-path="/" m:media-type="{kind}"/></m:manifest>',
        )


def run(rows: int) -> None:
    content: list[list[object]] = [list(finds.COLUMNS), *table(rows)]
    with tempfile.TemporaryDirectory() as folder:
        base = Path(folder)
        with (base / "t.csv").open("w", newline="", encoding="utf-8") as f:
            csv.writer(f).writerows(content)
        write_xlsx(base / "t.xlsx", content)
        write_ods(base / "t.ods", content)
        print(f"{rows:,} rows (synthetic)")
        for kind in ("csv", "xlsx", "ods"):
            begun, used = time.perf_counter(), time.process_time()
            read = finds.read(base / f"t.{kind}")
            there = time.perf_counter()
            finds.summary(read)
            done = time.perf_counter()
            print(
                f"{kind:>5}: read {there - begun:5.2f} s, counted {done - there:5.2f} s, together "
                f"{done - begun:5.2f} s ({time.process_time() - used:5.2f} s of processor time; bar: 10 s)"
            )
        begun = time.perf_counter()
        code = main(["finds", "summary", str(base / "t.csv"), "-o", str(base / "out"), "-q", "--json"])
        print(f"command: {time.perf_counter() - begun:.2f} s with tables and figures", file=sys.stderr)
        assert code == 0


if __name__ == "__main__":
    run(int(sys.argv[1]) if len(sys.argv) > 1 else 100_000)
