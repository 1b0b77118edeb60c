"""The table of finds: its columns, and a reader that refuses what it cannot be sure of."""

from __future__ import annotations

import difflib
import math
import re
import warnings
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from specularia.errors import FormatError, SpeculariaWarning
from specularia.files import existing
from specularia.finds.cells import Reader
from specularia.finds.mapping import Mapping, read_mapping
from specularia.finds.spreadsheets import Row, rows

__all__ = ["COLUMNS", "Finds", "Note", "read"]

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
"""Columns of the table and what they hold; without a mapping file all are required, in any order."""

COORDINATES: Final = {
    "x_m": "place of the find in the plan's metres, to the right; empty where unknown",
    "y_m": "likewise, up on the drawing",
}
"""Columns that a table may have beside them; either both or none."""

_TEXT = ("room", "square", "colour", "type")
_MOST_FAULTS = 1000


@dataclass(frozen=True)
class Note:
    """Something about a row that the reader was told to let pass, or that is worth a look."""

    line: int
    column: str
    text: str


@dataclass(frozen=True)
class Finds:
    """A checked table of finds, one entry per row.

    Parameters
    ----------
    file : where it was read from.
    find_number, room, square, colour, type : text per row; "" where the cell is empty.
    weight_g : array [N], weight of all fragments of the row, grams; NaN where the reader was told that
        weights may be missing.
    thickness_mm : array [N], millimetres; NaN where not measured.
    count : array [N] of integers, fragments in the row.
    synthetic : True where a comment of the table says so.
    line : array [N] of integers, place in the file, counted from 1.
    x, y : arrays [N] of coordinates; NaN where unknown, None in tables without.
    coordinate_unit : of x and y: "m" on the plan, "px" on its picture.
    notes : what was let pass, with row numbers.
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
    line: NDArray[np.int64] = field(default_factory=lambda: np.zeros(0, np.int64))
    x: NDArray[np.float64] | None = None
    y: NDArray[np.float64] | None = None
    coordinate_unit: str = "m"
    notes: tuple[Note, ...] = ()


def read(path: str | Path, mapping: Mapping | str | Path | None = None) -> Finds:
    """Read a table of finds from CSV, XLSX or ODS, with the columns of `COLUMNS` or of a mapping.

    Lines of a CSV before the header that begin with # are comments; one with the word "synthetic" labels the
    table. Nothing is guessed: units, decimal marks, words of other languages and what may be missing are said
    in the mapping.

    Parameters
    ----------
    path : CSV (UTF-8 and commas unless the mapping says otherwise), XLSX or ODS.
    mapping : a `Mapping`, or the path of one in TOML or JSON.

    Raises
    ------
    FormatError : a missing or unknown column, a unit other than that of the column, a weight, thickness or
        count that is not a positive number, a find number that is empty or stands twice, an unknown word, a
        cell that a spreadsheet would run as a formula; it names the row's line in the file, counted from 1,
        and the lines of further faults. Also a spreadsheet that unpacks to more than a table of finds can.
    """
    path = existing(path, what="a table of finds (CSV, XLSX or ODS)")
    told = mapping if isinstance(mapping, Mapping) else None if mapping is None else read_mapping(mapping)
    comments, lines, said = rows(path, told or Mapping())
    for text in said:
        warnings.warn(text, SpeculariaWarning, stacklevel=2)
    table = _Table(path, told)
    for row in lines:
        if any(not _blank(c) for c in row.cells):
            table.take(row)
    return table.finish(synthetic=any("synthetic" in c.lower() for c in comments))


def _blank(cell: Any) -> bool:
    return cell is None or (isinstance(cell, str) and not cell.strip())


class _Table:
    """What has been read so far; faults are gathered, so that all can be mended at once."""

    def __init__(self, path: Path, told: Mapping | None) -> None:
        self.path, self.strict, self.mapping = path, told is None, told or Mapping()
        self.place: dict[str, int] = {}
        self.width = 0
        self.reader = Reader(path, self.mapping, named=self.strict)
        self.faults: list[FormatError] = []
        self.notes: list[Note] = []
        self.first_seen: dict[str, int] = {}
        self.text: dict[str, list[str]] = {name: [] for name in ("find_number", *_TEXT)}
        self.number: dict[str, list[float]] = {
            name: [] for name in ("weight", "thickness", "count", "x", "y")
        }
        self.lines: list[int] = []

    def take(self, row: Row) -> None:
        if not self.place:
            header = [str(c).strip() for c in row.cells]
            self.place, self.width = (
                _header(header, self.path, row.line, self.mapping, self.strict),
                len(header),
            )
            return
        if len(row.cells) != self.width:
            self._fault(
                FormatError(
                    file=self.path,
                    line=row.line,
                    expected=f"{self.width} cells, as in the header",
                    found=str(len(row.cells)),
                    advice="Put cells that hold a comma in quotes.",
                )
            )
            return
        try:
            self._row(row.line, {name: row.cells[k] for name, k in self.place.items()})
        except FormatError as error:
            self._fault(error)

    def _fault(self, error: FormatError) -> None:
        self.faults.append(error)
        if len(self.faults) >= _MOST_FAULTS:
            self._refuse()

    def _row(self, line: int, cells: dict[str, Any]) -> None:
        reader = self.reader
        words = {name: reader.word(cells.get(name), name, line) for name in ("find_number", *_TEXT)}
        self._number(words["find_number"], line)
        for name in _TEXT:
            if words[name] and not reader.known(words[name], name):
                self._let_pass(self.mapping.unknown_words, line, name, f"a known {name}", repr(words[name]))
        weight = reader.quantity(cells.get("weight"), "weight", line, unit=cells.get("weight_unit"))
        if math.isnan(weight):
            expected = f"weight as a number > 0{' in g' if self.strict else ''}"
            self._let_pass(self.mapping.missing_weight, line, "weight", expected, "an empty cell")
        placed = "x" in self.place
        values = {
            "weight": weight,
            "thickness": reader.quantity(
                cells.get("thickness"), "thickness", line, unit=cells.get("thickness_unit")
            ),
            "count": 1.0 if "count" not in self.place else reader.count(cells["count"], line),
            "x": reader.coordinate(cells["x"], "x", line) if placed else math.nan,
            "y": reader.coordinate(cells["y"], "y", line) if placed else math.nan,
        }
        for name, text in words.items():
            self.text[name].append(text)
        for name, value in values.items():
            self.number[name].append(value)
        self.lines.append(line)

    def _number(self, number: str, line: int) -> None:
        """A find number is there, and once."""
        if not number:
            raise FormatError(file=self.path, line=line, expected="a find number", found="an empty cell")
        if number in self.first_seen:
            found = f"{number!r} again (first in line {self.first_seen[number]})"
            self._let_pass(self.mapping.duplicates, line, "find_number", "each find number once", found)
        self.first_seen.setdefault(number, line)

    def _let_pass(self, strictness: str, line: int, column: str, expected: str, found: str) -> None:
        if strictness == "refuse":
            raise FormatError(file=self.path, line=line, expected=expected, found=found)
        self.notes.append(Note(line, column, f"expected {expected}, found {found}"))

    def _refuse(self) -> None:
        first, more = self.faults[0], self.faults[1:]
        advice = first.advice
        if more:
            where = ", ".join(str(e.line) for e in more[:20]) + (", ..." if len(more) > 20 else "")
            count = f"{len(more)}{' or' if len(self.faults) >= _MOST_FAULTS else ''} more"
            advice = f"{advice} ({count} in line{'s' if len(more) > 1 else ''} {where}.)".strip()
        raise FormatError(
            file=self.path, line=first.line, expected=first.expected, found=first.found, advice=advice
        )

    def finish(self, *, synthetic: bool) -> Finds:
        if self.faults:
            self._refuse()
        if not self.lines:
            raise FormatError(file=self.path, expected="a header and at least one row of finds", found="none")
        self.notes += _spellings(self.text, self.lines)
        weight = np.array(self.number["weight"])
        if not np.isfinite(weight).any():
            raise FormatError(file=self.path, expected="a weight in at least one row", found="none")
        placed = "x" in self.place
        return Finds(
            file=self.path,
            find_number=tuple(self.text["find_number"]),
            room=tuple(self.text["room"]),
            square=tuple(self.text["square"]),
            colour=tuple(self.text["colour"]),
            type=tuple(self.text["type"]),
            weight_g=weight,
            thickness_mm=np.array(self.number["thickness"]),
            count=np.array(self.number["count"], np.int64),
            synthetic=synthetic,
            line=np.array(self.lines, np.int64),
            x=np.array(self.number["x"]) if placed else None,
            y=np.array(self.number["y"]) if placed else None,
            coordinate_unit="px" if self.mapping.coordinate_unit == "px" else "m",
            notes=tuple(sorted(self.notes, key=lambda n: n.line)),
        )


def _spellings(text: dict[str, list[str]], lines: list[int]) -> list[Note]:
    """Words that differ from another one only by capitals or spaces: likely one and the same."""
    notes = []
    for name in _TEXT:
        words: dict[str, int] = {}
        for word, line in zip(text[name], lines):
            words.setdefault(word, line)
        first: dict[str, tuple[str, int]] = {}
        for word, line in words.items():
            other, seen = first.setdefault(re.sub(r"\s+", " ", word).casefold(), (word, line))
            if other != word:
                found = f"{word!r}, which row {seen} spells {other!r}; they count as two"
                notes.append(Note(line, name, found))
    return notes


def _header(header: list[str], path: Path, line: int, mapping: Mapping, strict: bool) -> dict[str, int]:
    """Place of each field in the rows; a FormatError for a header with other names."""

    def wrong(expected: str, found: str, advice: str = "") -> FormatError:
        return FormatError(file=path, line=line, expected=expected, found=found, advice=advice)

    if len(header) == 1 and any(c in header[0] for c in ";\t"):
        raise wrong(
            "columns separated by commas",
            "semicolons or tabs",
            "Export the table again with commas, or name the separator in a mapping file.",
        )
    named = [h for h in header if h]
    if len(set(named)) != len(named):
        twice = next(name for name in named if named.count(name) > 1)
        raise wrong("each column once", f"{twice!r} twice")
    if strict:
        own = {**COLUMNS, **COORDINATES}
        for name in header:
            if name not in own:
                raise _unknown(name, wrong)
        missing = [name for name in COLUMNS if name not in header]
        if missing:
            raise wrong(
                f"the columns {', '.join(COLUMNS)}",
                f"no {', '.join(missing)}",
                "A column may be empty, but it must be there; a mapping file can name others.",
            )
        place = {name.rsplit("_", 1)[0] if name.endswith(("_g", "_mm", "_m")) else name: header.index(name)
                 for name in header}  # fmt: skip
    else:
        place = _mapped(header, mapping, wrong)
    if ("x" in place) != ("y" in place):
        raise wrong("both coordinates or none", "one of them")
    return place


def _mapped(header: list[str], mapping: Mapping, wrong: Callable[..., FormatError]) -> dict[str, int]:
    """Place of each field, by the names of the mapping and, for those it leaves out, by ours."""
    ours: dict[str, Iterable[str]] = {
        **{name: (name,) for name in ("find_number", *_TEXT, "count")},
        "weight": ("weight", f"weight_{mapping.weight_unit}"),
        "thickness": ("thickness", f"thickness_{mapping.thickness_unit}"),
        "weight_unit": ("weight_unit",),
        "thickness_unit": ("thickness_unit",),
        "x": ("x", f"x_{mapping.coordinate_unit}"),
        "y": ("y", f"y_{mapping.coordinate_unit}"),
    }
    place: dict[str, int] = {}
    for name, theirs in mapping.columns.items():
        if theirs not in header:
            near = difflib.get_close_matches(theirs, header, n=1)
            raise wrong(
                f"the column {theirs!r} ({name})", "none", f"Did you mean {near[0]!r}?" if near else ""
            )
        place[name] = header.index(theirs)
    for name, known in ours.items():
        if name not in place:
            free = [h for h in known if h in header and header.index(h) not in place.values()]
            if free:
                place[name] = header.index(free[0])
    others = [h for k, h in enumerate(header) if k not in place.values() and h]
    if others and mapping.other_columns == "refuse":
        raise wrong(
            "columns that are ours or named in the mapping",
            ", ".join(map(repr, others[:10])),
            'Name them under [columns], or set other_columns = "ignore".',
        )
    needed = ["find_number", "weight"] + ([] if mapping.one_fragment_per_row else ["count"])
    missing = [name for name in needed if name not in place]
    if missing:
        advice = "Name them under [columns]."
        if missing == ["count"]:
            advice += " If each row is one fragment, set one_fragment_per_row = true."
        raise wrong(f"columns for {', '.join(needed)}", f"no {', '.join(missing)}", advice)
    return place


def _unknown(name: str, wrong: Callable[..., FormatError]) -> FormatError:
    """A column that is not ours, and which was likely meant."""
    stem = name.rsplit("_", 1)[0].lower()
    meant = next((c for c in ("weight_g", "thickness_mm") if c.rsplit("_", 1)[0] == stem), None)
    if meant is not None:
        return wrong(
            f"the column {meant}",
            f"{name!r}",
            f"Convert the values to {meant.rsplit('_', 1)[1]} and rename the column, or name its unit in a "
            "mapping file.",
        )
    near = difflib.get_close_matches(name, COLUMNS, n=1)
    return wrong(
        "a known column",
        f"{name!r}",
        f"Did you mean {near[0]}?"
        if near
        else f"Known columns: {', '.join(COLUMNS)}. A mapping file can name others.",
    )
