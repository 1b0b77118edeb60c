"""The table of finds: its columns, and a reader that refuses what it cannot be sure of."""

from __future__ import annotations

import csv
import difflib
import io
import itertools
import math
import re
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray

from specularia.errors import FormatError
from specularia.files import existing

__all__ = ["COLUMNS", "Finds", "read"]

COLUMNS: Final = {
    "find_number": "name of the row, unique in the table",
    "room": "name of the room, as on the plan; empty where unknown",
    "square": "name of the excavation square, as on the plan; empty where unknown",
    "colour": "colour group of the glass; empty where undetermined",
    "weight_g": "weight of all fragments of the row, grams, > 0",
    "thickness_mm": "thickness of the glass, millimetres, > 0; empty where not measured",
    "type": "how the pane was made, such as cylinder-blown; empty where undetermined",
    "count": "number of fragments in the row, a whole number >= 1",
}
"""Columns of the table and what they hold; all are required, in any order, and no others are allowed."""

_TEXT = ("room", "square", "colour", "type")


@dataclass(frozen=True)
class Finds:
    """A checked table of finds, one entry per row.

    Parameters
    ----------
    file : where it was read from.
    find_number, room, square, colour, type : text per row; "" where the cell is empty.
    weight_g : array [N], weight of all fragments of the row, grams.
    thickness_mm : array [N], millimetres; NaN where not measured.
    count : array [N] of integers, fragments in the row.
    synthetic : True where a comment of the table says so.
    """

    file: Path
    find_number: tuple[str, ...]
    room: tuple[str, ...]
    square: tuple[str, ...]
    colour: tuple[str, ...]
    type: tuple[str, ...]
    weight_g: NDArray[np.float64]
    thickness_mm: NDArray[np.float64]
    count: NDArray[np.int64]
    synthetic: bool


def read(path: str | Path) -> Finds:
    """Read a table of finds: CSV in UTF-8, separated by commas, with the columns of `COLUMNS`.

    Lines before the header that begin with # are comments; one with the word "synthetic" labels the table.

    Raises
    ------
    FormatError : a missing or unknown column, a unit other than that of the column's name, a weight,
        thickness or count that is not a plain positive number, a find number that is empty or stands twice,
        or a cell that a spreadsheet would run as a formula; it names the row's line in the file, counted from
        1.
    """
    path = existing(path, what="a table of finds (CSV)")
    try:
        text = path.read_text(encoding="utf-8-sig")
    except (UnicodeDecodeError, IsADirectoryError) as error:
        raise FormatError(
            file=path, expected="a CSV file in UTF-8", found=str(error), advice="Save it as CSV UTF-8."
        ) from error
    lines = text.splitlines(keepends=True)
    comments = list(itertools.takewhile(lambda line: line.startswith("#"), lines))
    above = len(comments)
    reader = csv.reader(io.StringIO("".join(lines[above:]), newline=""), strict=True)
    cells: dict[str, list[str]] = {name: [] for name in COLUMNS}
    numbers: dict[str, list[float]] = {"weight_g": [], "thickness_mm": [], "count": []}
    first_seen: dict[str, int] = {}
    header: list[str] = []
    try:
        for row in reader:
            line = above + reader.line_num
            if not any(c.strip() for c in row):
                continue
            if not header:
                header = [c.strip() for c in row]
                _check_header(header, path, line)
                continue
            if len(row) != len(header):
                raise FormatError(
                    file=path,
                    line=line,
                    expected=f"{len(header)} cells, as in the header",
                    found=str(len(row)),
                    advice="Put cells that hold a comma in quotes.",
                )
            named = {name: cell.strip() for name, cell in zip(header, row)}
            _check_text(named, first_seen, path, line)
            for name in ("find_number", *_TEXT):
                cells[name].append(named[name])
            for name, values in numbers.items():
                values.append(_number(named[name], name, path, line))
    except csv.Error as error:
        raise FormatError(
            file=path,
            line=above + reader.line_num,
            expected="a row of comma-separated cells",
            found=str(error),
        ) from error
    if not first_seen:
        raise FormatError(file=path, expected="a header and at least one row of finds", found="none")
    return Finds(
        file=path,
        find_number=tuple(cells["find_number"]),
        room=tuple(cells["room"]),
        square=tuple(cells["square"]),
        colour=tuple(cells["colour"]),
        type=tuple(cells["type"]),
        weight_g=np.array(numbers["weight_g"]),
        thickness_mm=np.array(numbers["thickness_mm"]),
        count=np.array(numbers["count"], np.int64),
        synthetic=any("synthetic" in c.lower() for c in comments),
    )


def _check_header(header: list[str], path: Path, line: int) -> None:
    """Refuse a header with other names, saying which column was likely meant."""
    if len(header) == 1 and any(c in header[0] for c in ";\t"):
        raise FormatError(
            file=path,
            line=line,
            expected="columns separated by commas",
            found="semicolons or tabs",
            advice="Export the table again with commas.",
        )
    for name in header:
        if name in COLUMNS:
            continue
        stem = name.rsplit("_", 1)[0].lower()
        meant = next((c for c in ("weight_g", "thickness_mm") if c.rsplit("_", 1)[0] == stem), None)
        if meant is not None:
            raise FormatError(
                file=path,
                line=line,
                expected=f"the column {meant}",
                found=f"{name!r}",
                advice=f"Convert the values to {meant.rsplit('_', 1)[1]} and rename the column.",
            )
        near = difflib.get_close_matches(name, COLUMNS, n=1)
        raise FormatError(
            file=path,
            line=line,
            expected="a known column",
            found=f"{name!r}",
            advice=f"Did you mean {near[0]}?" if near else f"Known columns: {', '.join(COLUMNS)}.",
        )
    if len(set(header)) != len(header):
        twice = next(name for name in header if header.count(name) > 1)
        raise FormatError(file=path, line=line, expected="each column once", found=f"{twice!r} twice")
    missing = [name for name in COLUMNS if name not in header]
    if missing:
        raise FormatError(
            file=path,
            line=line,
            expected=f"the columns {', '.join(COLUMNS)}",
            found=f"no {', '.join(missing)}",
            advice="A column may be empty, but it must be there.",
        )


def _check_text(named: dict[str, str], first_seen: dict[str, int], path: Path, line: int) -> None:
    """Refuse empty or repeated find numbers and cells that a spreadsheet would run."""
    for name in ("find_number", *_TEXT):
        if named[name].startswith(("=", "+", "@")):
            raise FormatError(
                file=path,
                line=line,
                expected=f"plain text in {name}",
                found=f"{named[name]!r}",
                advice="A spreadsheet would run this as a formula.",
            )
    number = named["find_number"]
    if not number:
        raise FormatError(file=path, line=line, expected="a find number", found="an empty cell")
    if number in first_seen:
        raise FormatError(
            file=path,
            line=line,
            expected="each find number once",
            found=f"{number!r} again (first in line {first_seen[number]})",
        )
    first_seen[number] = line


def _number(cell: str, name: str, path: Path, line: int) -> float:
    """A positive number; NaN for an empty thickness; a FormatError for all else."""
    if not cell and name == "thickness_mm":
        return math.nan
    if name == "count":
        expected = "count as a whole number >= 1"
        good = re.fullmatch(r"[0-9]{1,9}", cell) is not None and int(cell) >= 1
    else:
        quantity, unit = name.rsplit("_", 1)
        expected = f"{quantity} as a number > 0 in {unit}"
        good = re.fullmatch(r"[0-9]+(\.[0-9]*)?([eE][+-]?[0-9]+)?|\.[0-9]+", cell) is not None
        good = good and 0.0 < float(cell) < math.inf
    if good:
        return float(cell)
    advice = ""
    if re.fullmatch(r"[0-9]+,[0-9]+", cell):
        advice = "Write the decimal mark as a point."
    elif re.fullmatch(r"[0-9.,]+\s*[a-zµ]+", cell, re.IGNORECASE):
        advice = f"Write the number alone; the unit stands in the column's name ({name})."
    raise FormatError(
        file=path, line=line, expected=expected, found=repr(cell) if cell else "an empty cell", advice=advice
    )
