"""CSV files for people who open them in a spreadsheet: nothing that a cell holds is run."""

from __future__ import annotations

import csv
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from specularia.files import atomic

__all__ = ["neutral", "write_rows"]


def neutral(value: Any) -> Any:
    """A value that no spreadsheet takes for a formula: such text gets an apostrophe before it.

    >>> neutral("=1+1"), neutral("-A3"), neutral("A-3"), neutral(-3.0)
    ("'=1+1", "'-A3", 'A-3', -3.0)
    """
    if isinstance(value, str) and value.startswith(("=", "+", "-", "@", "\t", "\r", "\n", "|", "%")):
        return "'" + value
    if isinstance(value, np.generic):
        value = value.item()
    return "" if value is None or (isinstance(value, float) and value != value) else value


def write_rows(path: str | Path, header: Sequence[str], rows: Iterable[Sequence[Any]]) -> Path:
    """Write rows as CSV, whole or not at all; NaN and None are empty cells."""
    path = Path(path)
    with atomic(path) as temporary, temporary.open("w", newline="", encoding="utf-8") as f:
        writer = csv.writer(f, lineterminator="\n")
        writer.writerow(header)
        writer.writerows([neutral(v) for v in row] for row in rows)
    return path
