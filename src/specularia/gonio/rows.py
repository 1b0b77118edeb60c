"""Rows of numbers, fast where they are right and exact about the place where they are not."""

from __future__ import annotations

import math
import warnings
from collections.abc import Sequence
from pathlib import Path
from typing import NoReturn

import numpy as np
from numpy.typing import NDArray

from specularia.errors import FormatError
from specularia.gonio.table import Array

__all__ = ["THREE", "parse_rows", "unify_line_ends"]

_ALLOWED = np.zeros(256, bool)
_ALLOWED[list(b"0123456789+-.eE \t\n")] = True

THREE = ("theta_s", "phi_s", "value")
"""Columns of a table for one incident direction."""


def unify_line_ends(data: bytes) -> bytes:
    """Text with LF line ends, made from LF, CR-LF or CR, without a byte order mark."""
    return data.removeprefix(b"\xef\xbb\xbf").replace(b"\r\n", b"\n").replace(b"\r", b"\n")


def parse_rows(
    data: bytes,
    *,
    file: str | Path,
    first_line: int,
    columns: Sequence[str] = THREE,
    separator: str = "",
) -> tuple[Array, NDArray[np.int64]]:
    """Rows of finite numbers, one for each column.

    Parameters
    ----------
    data : the rows, with LF line ends; blank lines are skipped.
    file : for messages.
    first_line : number of the first line of `data` in the file.
    columns : names of the columns.
    separator : between the columns; "" is blanks and tabs. With ";" a comma is a decimal point.

    Returns
    -------
    values : [N, columns].
    lines : [N] line number of each row.

    Raises
    ------
    FormatError : with the line, for anything else: a comment, a comma, a word, nan or inf, a wrong number of
        columns, no row at all.
    """
    count = len(columns)
    plain = _plain(data, separator)

    def locate() -> NoReturn:
        _locate(data, file=file, first_line=first_line, columns=columns, separator=separator)

    characters = np.frombuffer(plain, np.uint8)
    if not _ALLOWED[characters].all():
        locate()
    blank = characters <= 32
    starts = np.flatnonzero(~blank & np.concatenate([[True], blank[:-1]]))
    if starts.size == 0:
        raise FormatError(file=file, expected=_expected(columns), found="no row of data")
    line_of = np.searchsorted(np.flatnonzero(characters == 10), starts)
    found = np.bincount(line_of)
    if np.any((found != count) & (found != 0)):
        locate()
    try:
        with warnings.catch_warnings():
            # Text that is no number ends the parse, with a warning or an error depending on numpy's version.
            warnings.simplefilter("ignore")
            numbers = np.fromstring(plain, dtype=float, sep=" ")
    except ValueError:
        locate()
    if numbers.size != starts.size or not np.isfinite(numbers).all():
        locate()
    return numbers.reshape(-1, count), line_of[::count] + first_line


def _plain(text: bytes, separator: str) -> bytes:
    """Numbers with decimal points, separated by blanks."""
    if separator == ";":
        return text.replace(b",", b".").replace(b";", b" ")
    return text.replace(separator.encode(), b" ") if separator else text


def _expected(columns: Sequence[str]) -> str:
    count = "three" if len(columns) == 3 else "five" if len(columns) == 5 else str(len(columns))
    return f"rows of {count} numbers: {', '.join(columns)}"


def _locate(
    data: bytes, *, file: str | Path, first_line: int, columns: Sequence[str], separator: str
) -> NoReturn:
    """Raise the FormatError of the first faulty line."""
    expected = _expected(columns)
    for number, raw in enumerate(data.decode("latin-1").split("\n"), first_line):
        line = raw.strip()
        if not line:
            continue

        def fault(found: str, advice: str = "", line_number: int = number) -> FormatError:
            return FormatError(file=file, line=line_number, expected=expected, found=found, advice=advice)

        shown = repr(line[:60])
        if line.startswith("#"):
            raise fault(f"a comment inside the data, {shown}", "Move it above the first row.")
        if not separator and ("," in line or ";" in line):
            raise fault(
                f"commas or semicolons, {shown}",
                "Write a decimal point, and blanks or tabs between the columns; or give the file a line with "
                "the names of its columns, as CSV.",
            )
        words = _plain(line.encode("latin-1"), separator).decode("latin-1").split()
        for word in words:
            try:
                number_here = float(word)
            except ValueError:
                raise fault(f"{word!r}, which is no number, in {shown}") from None
            if not math.isfinite(number_here):
                raise fault(f"{word!r} in {shown}", "Remove rows without a measured value.")
        if len(words) != len(columns):
            raise fault(f"{len(words)} columns, {shown}")
    raise FormatError(file=file, expected=expected, found="text that cannot be read as numbers")
