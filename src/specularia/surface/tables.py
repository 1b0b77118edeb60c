"""Text tables of coordinates: profiles (position, height) and maps (x, y, height)."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from specularia.errors import FormatError
from specularia.surface.heightmap import HeightMap
from specularia.surface.origin import UNITS, Given, unit_in

__all__ = ["is_table", "read"]

Array = NDArray[np.float64]

_SUFFIXES = (".csv", ".txt", ".xyz", ".dat", ".tsv")
_EVEN = 0.02
"""Positions may stray from an even grid by this share of the pitch: files round them."""


def is_table(path: Path, head: bytes) -> bool:
    """Whether the file starts with a line of two or three numbers, after at most one heading.

    Whether the rest is like it is for `read` to say: it names the line that is not.
    """
    if path.suffix.lower() not in _SUFFIXES or b"\0" in head:
        return False
    lines = [line for line in head.decode("utf-8", errors="replace").splitlines() if line.strip()]
    first = next((row for row in map(_numbers, lines[:2]) if row is not None), [])
    return len(first) in (2, 3)


def _split(line: str) -> list[str]:
    separator = next((s for s in ";\t," if s in line), None)
    return [w.strip() for w in line.split(separator)] if separator else line.split()


def _numbers(line: str) -> list[float] | None:
    try:
        return [float(w) for w in _split(line)]
    except ValueError:
        return None


def read(path: Path, given: Given) -> HeightMap:
    """Read a table of (position, height) or (x, y, height) on an even grid.

    Row 0 of the map is the lowest y, whatever the order of the lines; grid points that the table leaves out
    are missing. Units are taken from the heading; a length without one is um, with a warning, or
    `given.unit`.
    """
    heading, values = _parse(path)
    lateral, vertical = _units(path, heading, given)
    if values.shape[1] == 2:
        order = np.argsort(values[:, 0], kind="stable")
        _, pitch, index = _axis(path, values[order, 0], "positions")
        heights = np.full((1, int(index.max()) + 1), np.nan)
        _place(path, heights, np.zeros_like(index), index, values[order, 1])
        pitch_x, pitch_y = pitch * lateral, float("nan")
        kind = "profile"
    else:
        _, dx, column = _axis(path, values[:, 0], "x")
        _, dy, row = _axis(path, values[:, 1], "y")
        heights = np.full((int(row.max()) + 1, int(column.max()) + 1), np.nan)
        _place(path, heights, row, column, values[:, 2])
        pitch_x, pitch_y = dx * lateral, dy * lateral
        kind = "xyz"
    pitch_x, pitch_y = given.checked_pitch(path, pitch_x, pitch_y)
    return HeightMap(heights * vertical, pitch_x, pitch_y, name=path.stem, attributes={"format": kind})


def _parse(path: Path) -> tuple[list[str], Array]:
    """The heading's words (empty without one) and the numbers [line, column]."""
    try:
        lines = path.read_text(encoding="utf-8-sig").splitlines()
    except UnicodeDecodeError as error:
        raise FormatError(file=path, expected="a text table in UTF-8", found=str(error)) from error
    numbered = [(k, line) for k, line in enumerate(lines, 1) if line.strip()]
    heading: list[str] = []
    if numbered and _numbers(numbered[0][1]) is None:
        heading = _split(numbered[0][1])
        numbered = numbered[1:]
    rows: list[list[float]] = []
    for number, line in numbered:
        row = _numbers(line)
        if row is None or (rows and len(row) != len(rows[0])):
            expected = f"{len(rows[0])} numbers" if rows else "2 or 3 numbers"
            raise FormatError(
                file=path,
                line=number,
                expected=expected,
                found=repr(line[:60]),
                advice="The file may be cut short or hold something other than a table of points.",
            )
        rows.append(row)
    if len(rows) < 2:
        raise FormatError(file=path, expected="at least two points", found=f"{len(rows)}")
    values = np.array(rows)
    if not np.isfinite(values[:, :-1]).all():
        bad = int(np.flatnonzero(~np.isfinite(values[:, :-1]).all(axis=1))[0])
        raise FormatError(
            file=path, line=numbered[bad][0], expected="a finite position", found=f"{rows[bad]}"
        )
    return heading, values


def _units(path: Path, heading: list[str], given: Given) -> tuple[float, float]:
    """Micrometres per lateral and per height unit."""
    named = [unit_in(re.sub(r"^[xyzXYZ]\b", "", word)) for word in heading]
    lateral = named[0] if named else None
    vertical = named[-1] if len(named) > 1 else None
    if lateral is None and vertical is None:
        factor = given.needed_unit(path, "positions and heights")
        return factor, factor
    if lateral is None:
        return given.needed_unit(path, "positions", fallback=vertical or "um"), UNITS[vertical or "um"]
    if vertical is None:
        return UNITS[lateral], given.needed_unit(path, "heights", fallback=lateral)
    given.refuse_unit(path, f"{lateral} and {vertical}")
    return UNITS[lateral], UNITS[vertical]


def _axis(path: Path, positions: Array, name: str) -> tuple[float, float, NDArray[np.int64]]:
    """First position, pitch, and index of each position on the even grid that they lie on."""
    distinct = np.unique(positions)
    if distinct.size < 2:
        raise FormatError(file=path, expected=f"at least two different {name}", found="one")
    gaps = np.diff(distinct)
    # Rounded repeats of one position lie far closer together than two grid points do.
    pitch = float(np.median(gaps[gaps > 0.5 * np.median(gaps)]))
    steps = int(round((distinct[-1] - distinct[0]) / pitch))
    pitch = float((distinct[-1] - distinct[0]) / max(steps, 1))
    index = (positions - distinct[0]) / pitch
    nearest = np.rint(index)
    worst = float(np.max(np.abs(index - nearest)))
    if steps < 1 or worst > _EVEN:
        raise FormatError(
            file=path,
            expected=f"{name} on an even grid",
            found=f"some that lie {worst:.0%} of a pitch beside it",
            advice="Scattered points have to be put on a grid first.",
        )
    return float(distinct[0]), pitch, nearest.astype(np.int64)


def _place(path: Path, heights: Array, row: NDArray[np.int64], column: NDArray[np.int64], z: Array) -> None:
    if heights.size > 50 * z.size + 1000:
        raise FormatError(
            file=path, expected="a filled grid", found=f"{z.size} points for {heights.size} grid places"
        )
    flat = row * heights.shape[1] + column
    if np.unique(flat).size != flat.size:
        raise FormatError(file=path, expected="one height at each place", found="several at the same")
    heights[row, column] = z
