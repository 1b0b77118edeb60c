"""Rows of a CSV, XLSX or ODS file, looked at before they are taken apart.

A spreadsheet is a ZIP of XML. A small file can unpack to terabytes, and a single cell far down or a repeated
one can stand for a billion. What a file would unpack to is therefore counted, by unpacking it piece by piece,
before it is read.
"""

from __future__ import annotations

import csv
import io
import re
import zipfile
import zlib
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

from specularia.errors import FormatError
from specularia.finds.mapping import Mapping

__all__ = ["Row", "rows"]

MOST_BYTES: Final = 300_000_000
"""Bytes that a file may have, and that a spreadsheet may unpack to."""

MOST_PARTS: Final = 2_000
"""Files in a spreadsheet."""

MOST_CELLS: Final = 6_000_000
"""Cells of a sheet from its first corner to its last."""

_PIECE: Final = 1 << 20
_TAIL: Final = 2_000

# Only what lies beyond column Z or row 99,999 is looked at; all within together is fewer than `MOST_CELLS`.
_NEAR: Final = (26, 99_999)
_XLSX_FAR: Final = re.compile(
    rb"""\br\s{0,9}=\s{0,9}["'](?:([A-Z]{2,4})([0-9]{1,9})|[A-Z]?([0-9]{6,12}))["']"""
)
_ODS_REPEAT: Final = re.compile(
    rb"""number-(columns|rows)-repeated\s{0,9}=\s{0,9}["']([0-9]{1,12})["']([^>]{0,1000}?)(/?)>"""
)
_EMPTY_ROW: Final = re.compile(rb"\s*(<table:(covered-)?table-cell[^>]*/>\s*)+</table:table-row>")
_FORMULA: Final = re.compile(rb"<(?:\w+:)?f[ />]|table:formula=")


@dataclass(frozen=True)
class Row:
    """Cells of a row with its number in the file, counted from 1."""

    line: int
    cells: list[Any]


def rows(path: Path, mapping: Mapping) -> tuple[list[str], Iterator[Row], list[str]]:
    """Comments above the header, the rows with the header first, and what is to be said of the file.

    The content decides, not the name: a ZIP is a spreadsheet, all else a CSV.

    Raises
    ------
    FormatError : neither of the three, too large, or broken.
    """
    try:
        if path.stat().st_size > MOST_BYTES:
            raise FormatError(
                file=path, expected=f"at most {MOST_BYTES // 10**6} MB", found="more", advice="Split it."
            )
        with path.open("rb") as f:
            head = f.read(8)
    except OSError as error:
        raise FormatError(file=path, expected="a file", found=str(error.strerror)) from error
    if head.startswith(b"PK"):
        return [], *_sheet(path, mapping)
    if head.startswith(b"\xd0\xcf\x11\xe0"):
        raise FormatError(
            file=path,
            expected="CSV, XLSX or ODS",
            found="an old or an encrypted Excel file",
            advice="Save it as XLSX without a password.",
        )
    comments, lines = _csv(path, mapping)
    return comments, lines, []


def _csv(path: Path, mapping: Mapping) -> tuple[list[str], Iterator[Row]]:
    encoding = "utf-8-sig" if mapping.encoding == "utf-8" else mapping.encoding
    try:
        text = path.read_text(encoding=encoding)
    except (UnicodeError, OSError) as error:
        raise FormatError(
            file=path,
            expected=f"a CSV file in {mapping.encoding.upper()}",
            found=str(error),
            advice="Save it as CSV UTF-8, or name its encoding in a mapping file.",
        ) from error
    if "\x00" in text:
        raise FormatError(file=path, expected="text", found="a NUL byte", advice="This is no CSV file.")
    lines = text.splitlines(keepends=True)
    above = 0
    while above < len(lines) and lines[above].startswith("#"):
        above += 1

    def read() -> Iterator[Row]:
        reader = csv.reader(
            io.StringIO("".join(lines[above:]), newline=""), strict=True, delimiter=mapping.separator
        )
        try:
            for k, row in enumerate(reader, 1):
                if k >= mapping.header_row:
                    yield Row(above + reader.line_num, list(row))
        except csv.Error as error:
            raise FormatError(
                file=path,
                line=above + reader.line_num,
                expected="a row of comma-separated cells",
                found=str(error),
            ) from error

    return lines[:above], read()


def _sheet(path: Path, mapping: Mapping) -> tuple[Iterator[Row], list[str]]:
    """Rows of one sheet, by calamine; its cells are text, numbers, dates, truths or ''."""
    formulas = _looked_at(path)
    from python_calamine import CalamineWorkbook

    try:
        with CalamineWorkbook.from_path(str(path)) as book:
            names = list(book.sheet_names)
            if not names:
                raise FormatError(file=path, expected="a sheet", found="none")
            name = mapping.sheet if mapping.sheet is not None else names[0]
            if name not in names:
                raise FormatError(
                    file=path, expected=f"the sheet {name!r}", found=", ".join(map(repr, names[:20]))
                )
            table = book.get_sheet_by_name(name).to_python(skip_empty_area=False)
    except FormatError:
        raise
    except (KeyboardInterrupt, SystemExit, MemoryError):
        raise
    except BaseException as error:  # A fault within calamine is no Exception.
        raise FormatError(
            file=path,
            expected="an XLSX or ODS file",
            found=f"one that cannot be read ({error})",
            advice="Save it again, or as CSV.",
        ) from error
    said = []
    if formulas:
        said.append(
            f"{path.name}: {formulas:,} cells hold formulas; the values stored with them count. If the file "
            "was not saved by a spreadsheet program, they may be missing."
        )
    if mapping.sheet is None and len(names) > 1:
        said.append(f"{path.name}: the first of {len(names)} sheets is read, {names[0]!r}.")

    def read() -> Iterator[Row]:
        for k, cells in enumerate(table, 1):
            if k >= mapping.header_row:
                yield Row(k, cells)

    return read(), said


def _looked_at(path: Path) -> int:
    """Unpack a spreadsheet piece by piece and throw it away; refuse it where it grows too large.

    Returns the number of formulas.
    """
    total = formulas = 0

    def refuse(found: str) -> FormatError:
        return FormatError(
            file=path,
            expected="a spreadsheet of ordinary size",
            found=found,
            advice="It is not read; save the sheet of finds alone, or as CSV.",
        )

    try:
        with zipfile.ZipFile(path) as archive:
            parts = archive.infolist()
            if len(parts) > MOST_PARTS:
                raise refuse(f"{len(parts):,} parts")
            names = {p.filename for p in parts}
            if not names & {"content.xml", "xl/workbook.xml", "xl/workbook.bin"}:
                raise FormatError(file=path, expected="an XLSX or ODS file", found="another kind of ZIP")
            for part in parts:
                if part.flag_bits & 1:
                    raise FormatError(
                        file=path, expected="a spreadsheet without a password", found="an encrypted one"
                    )
                sheet = part.filename.startswith("xl/worksheets/") or part.filename == "content.xml"
                far, times, before = _NEAR, _Repeats(), b""
                with archive.open(part) as f:
                    while True:
                        piece = f.read(_PIECE)
                        total += len(piece)
                        if total > MOST_BYTES:
                            raise refuse(f"more than {MOST_BYTES // 10**6} MB once unpacked")
                        if sheet:
                            if b"<!DOCTYPE" in piece or b"<!ENTITY" in piece:
                                raise refuse("a document type in its XML")
                            formulas += len(_FORMULA.findall(piece))
                            window = before + piece
                            for match in _XLSX_FAR.finditer(window):
                                far = (
                                    max(far[0], _column(match[1] or b"A")),
                                    max(far[1], int(match[2] or match[3])),
                                )
                            times.count(window, len(window) - _TAIL if piece else len(window))
                            before = window[-_TAIL:]
                        if not piece:
                            break
                if far[0] * far[1] > MOST_CELLS:
                    raise refuse(f"a cell in column {far[0]:,} or row {far[1]:,}")
                if times.cells > MOST_CELLS:
                    raise refuse(f"repeated cells that stand for {times.cells:,} or more")
    except (zipfile.BadZipFile, zlib.error, EOFError, NotImplementedError, OSError, RuntimeError) as error:
        raise FormatError(
            file=path,
            expected="an XLSX or ODS file",
            found=f"one that cannot be unpacked ({error})",
            advice="It may be truncated: copy it again.",
        ) from error
    return formulas


def _column(letters: bytes) -> int:
    number = 0
    for c in letters:
        number = 26 * number + c - 64
    return number


@dataclass
class _Repeats:
    """What the repeated cells and rows of an ODS sheet stand for, at least.

    Programs fill sheets to their last row and column with repeated empty cells; those cost nothing.
    """

    columns: int = 0
    rows: int = 0
    widest: int = 1
    deepest: int = 1

    @property
    def cells(self) -> int:
        return max(self.columns, self.rows, self.widest * self.deepest)

    def count(self, window: bytes, end: int) -> None:
        """Count what begins in a window before its end; what follows comes again in the next."""
        for match in _ODS_REPEAT.finditer(window):
            if match.start() >= end:
                break
            kind, number, last, closed = match.groups()
            opened = window[window.rfind(b"<", 0, match.start()) : match.start()]
            if kind == b"rows":
                empty = _EMPTY_ROW.match(window, match.end())
                if closed or (empty is not None and b"office:" not in empty.group()):
                    continue
                self.rows += int(number)
                self.deepest = max(self.deepest, int(number))
            elif not closed or b"office:" in opened + last:
                self.columns += int(number)
                self.widest = max(self.widest, int(number))
