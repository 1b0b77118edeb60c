"""Rows of numbers, fast where they are right and exact about the place where they are not."""

from __future__ import annotations

import math
import warnings
from pathlib import Path
from typing import NoReturn

import numpy as np
from numpy.typing import NDArray

from specularia.errors import FormatError
from specularia.gonio.table import Array

__all__ = ["parse_rows", "unify_line_ends"]

_ALLOWED = np.zeros(256, bool)
_ALLOWED[list(b"0123456789+-.eE \t\n")] = True

_EXPECTED = "rows of three numbers: theta_s, phi_s, value"


def unify_line_ends(data: bytes) -> bytes:
    """Text with LF line ends, made from LF, CR-LF or CR, without a byte order mark."""
    return data.removeprefix(b"\xef\xbb\xbf").replace(b"\r\n", b"\n").replace(b"\r", b"\n")


def parse_rows(data: bytes, *, file: str | Path, first_line: int) -> tuple[Array, NDArray[np.int64]]:
    """Rows of three finite numbers separated by blanks or tabs.

    Parameters
    ----------
    data : the rows, with LF line ends; blank lines are skipped.
    file : for messages.
    first_line : number of the first line of `data` in the file.

    Returns
    -------
    values : [N, 3].
    lines : [N] line number of each row.

    Raises
    ------
    FormatError : with the line, for anything else: a comment, a comma, a word, nan or inf, a wrong number of
        columns, no row at all.
    """
    characters = np.frombuffer(data, np.uint8)
    if not _ALLOWED[characters].all():
        _locate(data, file=file, first_line=first_line)
    blank = characters <= 32
    starts = np.flatnonzero(~blank & np.concatenate([[True], blank[:-1]]))
    if starts.size == 0:
        raise FormatError(file=file, expected=_EXPECTED, found="no row of data")
    line_of = np.searchsorted(np.flatnonzero(characters == 10), starts)
    columns = np.bincount(line_of)
    if np.any((columns != 3) & (columns != 0)):
        _locate(data, file=file, first_line=first_line)
    try:
        with warnings.catch_warnings():
            # Text that is no number ends the parse, with a warning or an error depending on numpy's version.
            warnings.simplefilter("ignore")
            numbers = np.fromstring(data, dtype=float, sep=" ")
    except ValueError:
        _locate(data, file=file, first_line=first_line)
    if numbers.size != starts.size or not np.isfinite(numbers).all():
        _locate(data, file=file, first_line=first_line)
    return numbers.reshape(-1, 3), line_of[::3] + first_line


def _locate(data: bytes, *, file: str | Path, first_line: int) -> NoReturn:
    """Raise the FormatError of the first faulty line."""
    for number, raw in enumerate(data.decode("latin-1").split("\n"), first_line):
        line = raw.strip()
        if not line:
            continue

        def fault(found: str, advice: str = "", line_number: int = number) -> FormatError:
            return FormatError(file=file, line=line_number, expected=_EXPECTED, found=found, advice=advice)

        shown = repr(line[:60])
        if line.startswith("#"):
            raise fault(f"a comment inside the data, {shown}", "Move it above the first row.")
        if "," in line or ";" in line:
            raise fault(
                f"commas or semicolons, {shown}",
                "Write a decimal point, and blanks or tabs between the columns.",
            )
        words = line.split()
        for word in words:
            try:
                number_here = float(word)
            except ValueError:
                raise fault(f"{word!r}, which is no number, in {shown}") from None
            if not math.isfinite(number_here):
                raise fault(f"{word!r} in {shown}", "Remove rows without a measured value.")
        if len(words) != 3:
            raise fault(f"{len(words)} columns, {shown}")
    raise FormatError(file=file, expected=_EXPECTED, found="text that cannot be read as numbers")
