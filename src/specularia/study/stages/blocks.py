"""What a stage leaves for the report: texts, figures and tables as plain values for its manifest."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from specularia.report import TableBlock

__all__ = ["drawn_table", "figure", "table", "text"]


def text(words: str) -> dict[str, Any]:
    """A paragraph."""
    return {"kind": "text", "text": words}


def figure(path: Path, caption: str, *, synthetic: bool) -> dict[str, Any]:
    """A picture in the stage's folder, by its name; its numbers lie beside it."""
    return {"kind": "figure", "path": path.name, "caption": caption, "synthetic": synthetic}


def table(
    header: Sequence[str],
    rows: Sequence[Sequence[Any]],
    caption: str,
    *,
    synthetic: bool,
    csv: str | None = None,
) -> dict[str, Any]:
    """A table; `csv` names a file in the stage's folder with the numbers in full."""
    return {
        "kind": "table",
        "header": list(header),
        "rows": [list(row) for row in rows],
        "caption": caption,
        "synthetic": synthetic,
        "csv": csv,
    }


def drawn_table(block: TableBlock, *, synthetic: bool, csv: str) -> dict[str, Any]:
    """A table that `report.tables` made."""
    return table(block.header, block.rows, block.caption, synthetic=synthetic, csv=csv)
