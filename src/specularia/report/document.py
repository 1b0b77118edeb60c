"""One self-contained HTML page: pictures, numbers and views embedded, nothing fetched from elsewhere."""

from __future__ import annotations

import base64
import csv
import io
import json
import os
import re
import struct
from collections.abc import Mapping, Sequence
from itertools import zip_longest
from pathlib import Path
from typing import Any, Final

from specularia import __version__
from specularia.errors import FormatError
from specularia.files import existing, write_text
from specularia.report.records import Block, Embed, Figure, Paragraph, Section, TableBlock
from specularia.report.style import DPI, numbers_beside

__all__ = ["page"]

_EMBED: Final = 500_000
"""Bytes up to which a file of numbers is embedded; larger ones are linked beside the page."""

_MEDIA: Final = {".csv": "text/csv;charset=utf-8", ".npz": "application/zip"}


def page(
    title: str,
    sections: Sequence[Section],
    provenance: Mapping[str, Any],
    path: str | Path,
    *,
    date: str | None = None,
) -> Path:
    """Write one HTML page that opens offline: no request leaves it, and its content-security policy says so.

    Figures (and embedded views) are numbered in their order, tables likewise. Pictures are embedded; so are
    files of numbers up to 0.5 MB, larger ones are linked by their path relative to the page. Each is named
    with its path, which stands on paper as well. Text is escaped.

    Parameters
    ----------
    title : of the page.
    sections : in their order.
    provenance : what was made from what: name of a product to its attributes (see `provenance.record`);
        values that are JSON objects are shown as nested lists.
    path : HTML file to write.
    date : shown under the title; None leaves it out, so that equal inputs give equal bytes.

    Returns
    -------
    path of the page.
    """
    import jinja2

    environment = jinja2.Environment(
        loader=jinja2.PackageLoader("specularia.report"),
        autoescape=True,
        trim_blocks=True,
        lstrip_blocks=True,
        undefined=jinja2.StrictUndefined,
    )
    path = Path(path)
    counts = {"Figure": 0, "Table": 0}
    html = environment.get_template("page.html.j2").render(
        title=title,
        version=__version__,
        date=date,
        synthetic=any(getattr(b, "synthetic", False) for s in sections for b in s.blocks),
        sections=[
            {"title": s.title, "blocks": [_rendered(b, counts, path.parent) for b in s.blocks]}
            for s in sections
        ],
        provenance={name: _unfolded(value) for name, value in provenance.items()},
    )
    return write_text(path, html)


def _rendered(block: Block, counts: dict[str, int], folder: Path) -> dict[str, Any]:
    """What the template shows of a block."""
    if isinstance(block, Paragraph):
        return {"kind": "paragraph", "text": block.text, "remarks": list(block.remarks)}
    word = "Table" if isinstance(block, TableBlock) else "Figure"
    counts[word] += 1
    out: dict[str, Any] = {
        "number": f"{word} {counts[word]}",
        "anchor": f"{word.lower()}-{counts[word]}",
        "caption": block.caption,
        "synthetic": block.synthetic,
        "alt": block.caption.split(". ")[0],
        "download": None,
        "like": getattr(block, "like", ""),
    }
    if isinstance(block, Figure):
        out |= {"kind": "figure", **_picture(block.path, block.data, folder)}
    elif isinstance(block, Embed):
        out |= {
            "kind": "embed",
            "html": existing(block.path, what="an HTML file").read_text(encoding="utf-8"),
            "still": None if block.still is None else _picture(block.still, None, folder),
        }
        if out["still"]:
            out["download"] = out["still"]["download"]
    else:
        rows = [[_cell(c) for c in row] for row in block.rows]
        out |= {
            "kind": "table",
            "header": list(block.header),
            "rows": rows,
            "words": [any(map(_is_words, column)) for column in zip_longest(*rows, fillvalue="")]
            or [False] * len(block.header),
            "download": _rows_download(block, out["anchor"])
            if block.csv is None
            else _download(existing(block.csv, what="a CSV"), folder),
        }
    return out


def _picture(path: Path, data: Path | None, folder: Path) -> dict[str, Any]:
    """A picture as the template shows it, and its numbers."""
    content = existing(path, what="a PNG").read_bytes()
    width, height = _png_size(content, path)
    numbers = data or numbers_beside(path)
    return {
        "image": _data_uri(content, "image/png"),
        "width": width,
        "height": height,
        # On screen all figures are enlarged alike, so that their letters have one size.
        "paper_in": width / DPI,
        "download": None if numbers is None else _download(existing(numbers, what="its numbers"), folder),
    }


def _cell(value: Any) -> str:
    if value is None or (isinstance(value, float) and value != value):
        return "–"
    return f"{value:.4g}" if isinstance(value, float) else str(value)


def _is_words(cell: str) -> bool:
    """Whether a cell holds words, which stand left, and not a number, which stands right."""
    return re.match(r"[\d.+–−-]|$", cell) is None


def _data_uri(content: bytes, media: str) -> str:
    return f"data:{media};base64,{base64.b64encode(content).decode()}"


def _download(file: Path, folder: Path) -> dict[str, str]:
    """Link to a file of numbers: embedded where it is small, else by its relative path."""
    size = file.stat().st_size
    relative = Path(os.path.relpath(file.resolve(), folder.resolve())).as_posix()
    if size <= _EMBED:
        media = _MEDIA.get(file.suffix, "application/octet-stream")
        return {"href": _data_uri(file.read_bytes(), media), "name": file.name, "file": relative, "size": ""}
    return {"href": relative, "name": file.name, "file": relative, "size": f"{size / 1e6:.1f} MB"}


def _rows_download(block: TableBlock, name: str) -> dict[str, str]:
    """Link to the rows of a table as they were given."""
    buffer = io.StringIO(newline="")
    writer = csv.writer(buffer, lineterminator="\n")
    writer.writerow(block.header)
    writer.writerows(block.rows)
    uri = _data_uri(buffer.getvalue().encode(), _MEDIA[".csv"])
    return {"href": uri, "name": f"{name}.csv", "file": f"{name}.csv", "size": ""}


def _png_size(content: bytes, path: Path) -> tuple[int, int]:
    """Width and height from the header, so that the page does not jump while it loads."""
    if content[:8] != b"\x89PNG\r\n\x1a\n":
        raise FormatError(file=path, expected="a PNG picture", found=repr(content[:8]))
    width, height = struct.unpack(">II", content[16:24])
    return int(width), int(height)


def _unfolded(value: Any) -> Any:
    """JSON objects in strings as mappings, paths as text, empty values as a dash."""
    if isinstance(value, str) and value[:1] in "{[" and value:
        try:
            return _unfolded(json.loads(value))
        except json.JSONDecodeError:
            return value
    if isinstance(value, Mapping):
        return {str(k): _unfolded(v) for k, v in value.items()} or "–"
    if isinstance(value, (list, tuple)):
        return ", ".join(str(_unfolded(v)) for v in value) or "–"
    return "–" if value is None or value == "" else str(value)
