"""Tables with a line of column names (CSV): several incident directions may share a file.

The columns are theta_i, phi_i, theta_s, phi_s and the value, in any order and under the names of `_NAMES`, in
the frame of `conventions` (theta from the front normal through both hemispheres, phi from the sample's x
axis, light that goes straight through leaves at phi_i + 180). A unit may follow the name: `theta_s [rad]`,
`phi_s_deg`, `DSF (1/sr)`. Columns are parted by commas, semicolons or tabs; with semicolons a comma is a
decimal point.
"""

from __future__ import annotations

import re
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from specularia.conventions import fold_azimuth
from specularia.errors import FormatError
from specularia.gonio.raw import Raw, check_angles
from specularia.gonio.rows import parse_rows
from specularia.gonio.table import Array

__all__ = ["looks_right", "parse"]

_ANGLES = ("theta_i", "phi_i", "theta_s", "phi_s")

_NAMES = {
    "theta_i": "theta_i thetai theta_in theta_inc theta_incident incident_theta intheta θ_i θi",
    "phi_i": "phi_i phii phi_in phi_inc phi_incident incident_phi inphi φ_i φi ϕ_i ϕi",
    "theta_s": "theta_s thetas theta_out theta_o theta_r theta_t theta_scattered scatter_theta θ_s θs",
    "phi_s": "phi_s phis phi_out phi_o phi_r phi_t phi_scattered scatter_phi φ_s φs ϕ_s ϕs",
    "value": "value values signal",
}
_ALIASES = {alias: name for name, aliases in _NAMES.items() for alias in aliases.split()}

_QUANTITIES = {"dsf": "DSF", "ccbsdf": "DSF", "bsdf": "BSDF", "brdf": "BSDF", "btdf": "BSDF"}
_KINDS = {"brdf": "reflection", "btdf": "transmission"}

_UNITS = {
    **dict.fromkeys(("", "deg", "degree", "degrees", "°"), 1.0),
    **dict.fromkeys(("rad", "radian", "radians"), 180.0 / np.pi),
}
_PER_STERADIAN = {"", "1/sr", "sr^-1", "sr-1", "/sr", "per_sr"}

_EXPECTED = (
    "a line of column names: theta_i, phi_i, theta_s, phi_s and one of DSF, BSDF, BRDF, BTDF, value "
    "(units in brackets)"
)


@dataclass(frozen=True)
class _Column:
    """What one column holds: an angle, "value", or "" for something else; with what it is multiplied."""

    name: str
    title: str
    label: str = ""
    unit: str = ""
    factor: float = 1.0


def looks_right(head: bytes) -> bool:
    """True where the first line that is no comment names a theta and separates by commas, semicolons or
    tabs."""
    line = _first_line(head)[0]
    named = re.match(r"[^\d\s#!<].*?(theta|θ)|theta|θ", line, re.IGNORECASE)
    return named is not None and _separator(line) is not None


def parse(data: bytes, *, file: str, need_quantity: bool = True) -> list[Raw]:
    """Parse a table with LF line ends: one record per incident direction, ascending."""
    line, number, start = _first_line(data)
    separator = _separator(line) or ","
    columns = [_column(cell, file=file, line=number) for cell in line.split(separator)]
    _check(columns, file=file, line=number, need_quantity=need_quantity)
    rows, lines = parse_rows(
        data[start:],
        file=file,
        first_line=number + 1,
        columns=[c.title for c in columns],
        separator="" if separator == "\t" else separator,
    )
    at = {c.name: k for k, c in enumerate(columns) if c.name}
    angle = {name: rows[:, at[name]] * columns[at[name]].factor for name in _ANGLES}
    stated = bool(columns[at["theta_s"]].unit or columns[at["phi_s"]].unit)
    check_angles(angle["theta_s"], angle["phi_s"], lines, file=file, theta_max_deg=180.0, stated=stated)
    # A file may well hold light from one direction near the normal: its incident angles prove no unit.
    incident = ("theta_i", "phi_i")
    theta, phi = angle["theta_i"], angle["phi_i"]
    check_angles(theta, phi, lines, file=file, theta_max_deg=180.0, names=incident, stated=True)
    grazing = np.flatnonzero(np.abs(angle["theta_i"] - 90.0) <= 0.05)
    if grazing.size:
        raise FormatError(
            file=file,
            line=int(lines[grazing[0]]),
            expected="theta_i within 0 to 180 degrees, not 90",
            found=f"{angle['theta_i'][grazing[0]]:g}",
        )
    value = columns[at["value"]]
    ignored = [c.title for c in columns if not c.name]
    noticed = [f"the columns {', '.join(ignored)} are not heeded"] if ignored else []
    known = value.unit in _PER_STERADIAN
    directions, group = _directions(angle["theta_i"], angle["phi_i"])
    if len(directions) > 1:
        noticed.append(f"{len(directions)} incident directions in one file")
    return [
        Raw(
            file=file,
            theta_i_deg=theta_i,
            phi_i_deg=phi_i,
            up_phi_deg=90.0,
            theta_s_deg=angle["theta_s"][chosen],
            phi_s_deg=fold_azimuth(angle["phi_s"][chosen]),
            values=rows[chosen, at["value"]],
            lines=lines[chosen],
            quantity=_QUANTITIES.get(value.label) if known else None,
            unit=value.title,
            quantity_line=number,
            kind=_KINDS.get(value.label, ""),
            warnings=tuple(noticed),
        )
        for k, (theta_i, phi_i) in enumerate(directions)
        for chosen in (group == k,)
    ]


def _first_line(data: bytes) -> tuple[str, int, int]:
    """The first line that is neither blank nor a comment, its number, and where the next one starts."""
    place, number = 0, 0
    while place < len(data):
        end = data.find(b"\n", place)
        end = len(data) if end < 0 else end
        line = data[place:end].decode("utf-8", errors="replace").strip()
        place, number = end + 1, number + 1
        if line and not line.startswith("#"):
            return line, number, min(place, len(data))
    return "", number, len(data)


def _separator(line: str) -> str | None:
    return next((mark for mark in (";", ",", "\t") if mark in line), None)


def _column(cell: str, *, file: str, line: int) -> _Column:
    """Name and unit of a column's title."""
    title = cell.strip().strip('"').strip()
    words = re.match(r"([^\[(]*?)\s*(?:[\[(]\s*([^\])]*?)\s*[\])])?$", title)
    text, unit = (words[1], words[2] or "") if words else (title, "")
    text, unit = re.sub(r"[\s\-]+", "_", text.strip().lower()), unit.lower().replace(" ", "")
    suffix = re.match(r"(.*)_(deg|degree|degrees|rad|radian|radians)$", text)
    if suffix and not unit:
        text, unit = suffix[1], suffix[2]
    name = _ALIASES.get(text, "value" if text in _QUANTITIES else "")
    if name not in _ANGLES:
        return _Column(name, title, text, unit)
    if unit not in _UNITS:
        raise FormatError(file=file, line=line, expected=f"{name} in degrees or radians", found=f"{title!r}")
    return _Column(name, title, text, unit, _UNITS[unit])


def _check(columns: list[_Column], *, file: str, line: int, need_quantity: bool) -> None:
    """Every column that is needed, once."""
    names = [c.name for c in columns]
    shown = repr(", ".join(c.title for c in columns)[:120])
    missing = [n for n in (*_ANGLES, "value") if n not in names]
    if missing:
        raise FormatError(
            file=file, line=line, expected=_EXPECTED, found=f"no {' and no '.join(missing)} in {shown}"
        )
    twice = [n for n in dict.fromkeys(names) if n and names.count(n) > 1]
    if twice:
        raise FormatError(
            file=file,
            line=line,
            expected="one column of each kind",
            found=f"several for {' and '.join(twice)} in {shown}",
        )
    value = columns[names.index("value")]
    if need_quantity and (value.label not in _QUANTITIES or value.unit not in _PER_STERADIAN):
        raise FormatError(
            file=file,
            line=line,
            expected="DSF, BSDF, BRDF or BTDF in 1/sr as the name of the column of values",
            found=repr(value.title),
            advice="Name the quantity in the file, or say --quantity DSF or BSDF.",
        )


def _directions(theta: Array, phi: Array) -> tuple[list[tuple[float, float]], NDArray[np.intp]]:
    """Incident directions that differ by more than 1e-4 degrees, and which one each row belongs to."""
    key = np.round(theta * 1e4) * 1e8 + np.round(phi * 1e4)
    _, first, group = np.unique(key, return_index=True, return_inverse=True)
    return [(round(float(theta[k]), 6), round(float(phi[k]), 6)) for k in first], group.ravel()
