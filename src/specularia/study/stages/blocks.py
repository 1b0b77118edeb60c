"""What a stage leaves for the report: texts, figures, views and tables as plain values for its manifest."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from specularia.files import write_csv

if TYPE_CHECKING:
    from specularia.report import TableBlock

__all__ = ["drawn_table", "figure", "table", "text", "view", "with_error"]


def text(words: str, remarks: Sequence[str] = ()) -> dict[str, Any]:
    """A paragraph, and lines of a list below it."""
    return {"kind": "text", "text": words, "remarks": list(remarks)}


def figure(path: Path, caption: str, *, synthetic: bool, like: str = "") -> dict[str, Any]:
    """A picture in the stage's folder, by its name; its numbers lie beside it.

    `like` names its counterpart among the figures of the published study.
    """
    return {
        "kind": "figure",
        "path": path.name,
        "caption": caption,
        "synthetic": synthetic,
        "like": like,
    }


def view(path: Path, caption: str, *, still: Path, synthetic: bool) -> dict[str, Any]:
    """An interactive view in the stage's folder, and the picture that stands for it on paper."""
    return {
        "kind": "view",
        "path": path.name,
        "still": still.name,
        "caption": caption,
        "synthetic": synthetic,
    }


def table(
    csv: Path,
    header: Sequence[str],
    rows: Sequence[Sequence[Any]],
    caption: str,
    *,
    numbers: tuple[Sequence[str], Sequence[Sequence[Any]]],
    synthetic: bool,
) -> dict[str, Any]:
    """A table as it is shown, and the CSV with its numbers in full.

    Parameters
    ----------
    csv : file to write, in the stage's folder.
    header, rows : what the page shows.
    numbers : header and rows of the CSV; a row for each that is shown, in the units that are shown.
    """
    write_csv(csv, *numbers)
    return {
        "kind": "table",
        "header": list(header),
        "rows": [list(row) for row in rows],
        "caption": caption,
        "synthetic": synthetic,
        "csv": csv.name,
        "like": "",
    }


def drawn_table(block: TableBlock, *, synthetic: bool, csv: str, like: str = "") -> dict[str, Any]:
    """A table that `report.tables` made, with the CSV in the stage's folder that holds its numbers."""
    return {
        "kind": "table",
        "header": list(block.header),
        "rows": [list(row) for row in block.rows],
        "caption": block.caption,
        "synthetic": synthetic,
        "csv": csv,
        "like": like,
    }


def with_error(value: float, error: float, digits: int = 4) -> str:
    """A number with its standard error, which is rounded up: a smaller one would claim too much.

    >>> with_error(0.69712, 0.00003)
    '0.6971 ± 0.0001'
    """
    if math.isnan(value):
        return "–"
    if not error > 0.0:
        return f"{value:.{digits}f}"
    scale = 10**digits
    return f"{value:.{digits}f} ± {math.ceil(error * scale - 1e-6) / scale:.{digits}f}"
