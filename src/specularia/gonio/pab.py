"""pab-opto tables: the text files of pab advanced technologies' gonio-photometers, and their raw exports.

A header of lines `#key value`, in any order, then rows of theta_s, phi_s, value. theta counts from the front
normal through both hemispheres, phi from the file's own axis, with `upphi` the azimuth of up.
"""

from __future__ import annotations

import re
from dataclasses import dataclass, field
from pathlib import Path

from specularia.conventions import pab_azimuth
from specularia.errors import FormatError, PhysicsError
from specularia.files import write_text
from specularia.gonio.raw import Raw, check_angles
from specularia.gonio.rows import THREE, parse_rows
from specularia.gonio.table import Table

__all__ = ["looks_right", "parse", "write"]

_QUANTITIES = {"DSF": "DSF", "BSDF": "BSDF", "BRDF": "BSDF", "BTDF": "BSDF"}
_KINDS = {"BRDF": "reflection", "BTDF": "transmission"}
_BANDS = {"CIE-X": "CIE-X", "CIE-Y": "", "CIE-Z": "CIE-Z", "CIE-XYZ": ""}
_XYZ = ("theta_s", "phi_s", "X", "Y", "Z")
_FORMAT = "a line '#format: theta phi DSF' (or BSDF, BRDF, BTDF)"
_INCIDENT = "a line '#incident_angle THETA PHI' (or #intheta and #inphi), in degrees"


def looks_right(head: bytes) -> bool:
    """True for a file that begins with a comment or with a number."""
    return re.match(rb"\s*(#|[-+.]?\d)", head) is not None


@dataclass
class _Header:
    """Header values with the lines they stand on, and the line that follows the header."""

    file: str
    entries: dict[str, tuple[int, str]] = field(default_factory=dict)
    end: int = 1

    def numbers(self, key: str, count: int) -> list[float] | None:
        """The first `count` numbers after a key; None where the key is missing."""
        if key not in self.entries:
            return None
        line, text = self.entries[key]
        try:
            found = [float(word) for word in text.split()[:count]]
        except ValueError:
            found = []
        if len(found) < count:
            raise FormatError(
                file=self.file,
                line=line,
                expected=f"#{key} with {count} number{'s' if count > 1 else ''}",
                found=repr(text),
            )
        return found

    def number(self, key: str) -> float | None:
        found = self.numbers(key, 1)
        return None if found is None else found[0]

    def text(self, key: str) -> str:
        return self.entries.get(key, (0, ""))[1].strip('"')


def parse(data: bytes, *, file: str, need_quantity: bool = True) -> list[Raw]:
    """Parse a table with LF line ends; `need_quantity` is False where the user states the quantity."""
    header, start, first_line = _split(data, file)
    theta_i, phi_i, noticed = _incident(header)
    colour = header.text("colorimetry").upper()
    if colour and colour not in _BANDS:
        noticed.append(f"#colorimetry {colour} is none of {', '.join(_BANDS)}; it is not heeded")
    columns = _XYZ if colour == "CIE-XYZ" else THREE
    quantity, unit, quantity_line = _quantity(header, need_quantity, several=columns is _XYZ)
    rows, lines = parse_rows(data[start:], file=file, first_line=first_line, columns=columns)
    if columns is _XYZ:
        noticed.append("three columns of values, CIE-XYZ: the Y is taken, X and Z are kept beside it")
    check_angles(rows[:, 0], rows[:, 1], lines, file=file, theta_max_deg=180.0)
    stated = header.number("datapoints_in_file")
    if stated is not None and int(stated) != len(rows):
        noticed.append(f"the header states {int(stated)} points, the file holds {len(rows)}")
    up = header.number("upphi") or 0.0
    wavelength = header.number("wavelength")
    return [
        Raw(
            file=file,
            theta_i_deg=theta_i,
            phi_i_deg=phi_i,
            up_phi_deg=up,
            theta_s_deg=rows[:, 0].copy(),
            phi_s_deg=pab_azimuth(rows[:, 1], up),
            values=rows[:, columns.index("Y") if columns is _XYZ else 2].copy(),
            lines=lines,
            quantity=quantity,
            unit=unit,
            quantity_line=quantity_line,
            kind=_KINDS.get(unit.upper(), ""),
            band=_BANDS.get(colour, "") if wavelength is None else f"{wavelength:g} nm",
            name=header.text("sample_name"),
            synthetic="synthetic" in header.entries,
            stated_integral=header.number("front_integral"),
            others={"CIE-X": rows[:, 2].copy(), "CIE-Z": rows[:, 4].copy()} if columns is _XYZ else {},
            warnings=tuple(noticed),
        )
    ]


def _split(data: bytes, file: str) -> tuple[_Header, int, int]:
    """The header, and the place and line number of the first row."""
    header, place, number = _Header(file), 0, 1
    while place < len(data):
        end = data.find(b"\n", place)
        end = len(data) if end < 0 else end
        line = data[place:end].decode("latin-1").strip()
        if line and not line.startswith("#"):
            break
        words = re.match(r"#+\s*([^\s:=]+)[\s:=]*(.*)", line)
        if words:
            header.entries.setdefault(words[1].lower(), (number, words[2].strip()))
        place, number = end + 1, number + 1
    header.end = number
    return header, min(place, len(data)), number


def _incident(header: _Header) -> tuple[float, float, list[str]]:
    pair = header.numbers("incident_angle", 2)
    theta, phi = header.number("intheta"), header.number("inphi")
    noticed = []
    if pair is None:
        if theta is None or phi is None:
            raise FormatError(
                file=header.file,
                line=header.end,
                expected=f"{_INCIDENT}, above the rows",
                found="a header without the incident direction",
            )
        pair = [theta, phi]
    elif (theta is not None and abs(theta - pair[0]) > 0.01) or (
        phi is not None and abs((phi - pair[1] + 180) % 360 - 180) > 0.01
    ):
        noticed.append(
            f"#incident_angle {pair[0]:g} {pair[1]:g} and #intheta {theta}, #inphi {phi} differ; "
            "#incident_angle is taken"
        )
    if not (0 <= pair[0] <= 180 and abs(pair[0] - 90) > 0.05 and abs(pair[1]) <= 360):
        key = "incident_angle" if "incident_angle" in header.entries else "intheta"
        raise FormatError(
            file=header.file,
            line=header.entries[key][0],
            expected="an incident direction, theta within 0 to 180 degrees, not 90, phi within -360 to 360",
            found=f"{pair[0]:g} {pair[1]:g}",
        )
    return pair[0], pair[1], noticed


def _quantity(header: _Header, need: bool, *, several: bool) -> tuple[str | None, str, int | None]:
    """Quantity, the file's word for it and its line; `several` columns may be announced for CIE-XYZ."""
    if "format" not in header.entries:
        if not need:
            return None, "", None
        raise FormatError(
            file=header.file,
            line=header.end,
            expected=f"{_FORMAT} above the rows",
            found="a header without the quantity",
            advice="Add the line, or say --quantity DSF or BSDF.",
        )
    line, text = header.entries["format"]
    words = text.split()
    if [w.lower() for w in words[:2]] != ["theta", "phi"] or (len(words) < 3 and need):
        raise FormatError(
            file=header.file,
            line=line,
            expected=_FORMAT,
            found=repr(text),
            advice="Name the quantity, or say --quantity DSF or BSDF.",
        )
    if several and len(words) > 3:
        # "DSF_X DSF_Y DSF_Z" or "DSF X Y Z": what stands before the letters is the quantity.
        words = [
            *words[:2],
            *dict.fromkeys(w for w in (re.sub(r"[-_:]?[XYZ]$", "", v) for v in words[2:]) if w),
        ]
    if len(words) > 3 and not words[3].startswith("["):
        raise FormatError(
            file=header.file,
            line=line,
            expected=f"{_FORMAT}: one quantity",
            found=repr(text),
            advice="Keep one column of values, or say '#colorimetry: CIE-XYZ' of columns X, Y and Z.",
        )
    unit = words[2] if len(words) > 2 else ""
    return _QUANTITIES.get(re.sub(r"\[.*\]$", "", unit).upper()), unit, line


def write(table: Table, path: str | Path) -> Path:
    """Write a table as a pab-opto file, in the frame its incident azimuth is given in.

    The file can be read by `gonio.read` and by Radiance's `pabopto2bsdf`. Angles are kept to 1e-4 degrees,
    values to seven digits; a table with columns for CIE-X and CIE-Z keeps them.
    """
    if any(ord(c) < 32 for c in table.name + table.band):
        raise PhysicsError("the name of a sample and its band must stand on one line.")
    lines = [f'#sample_name "{table.name}"'] if table.name else []
    if table.synthetic:
        lines.append("#synthetic: made by a computer program, not measured")
    columns = [table.values]
    if table.band == "Visible" and {"CIE-X", "CIE-Z"} <= set(table.others):
        lines.append("#colorimetry: CIE-XYZ")
        columns = [table.others["CIE-X"], table.values, table.others["CIE-Z"]]
    elif table.band in ("Visible", "CIE-X", "CIE-Z"):
        lines.append(f"#colorimetry: {table.band.replace('Visible', 'CIE-Y')}")
    elif table.band.endswith(" nm"):
        lines.append(f"#wavelength {table.band}")
    else:
        raise PhysicsError(
            f"a pab-opto table is for one wavelength or Visible and has no place for the band {table.band}."
        )
    lines += [
        f"#format: theta phi {table.quantity}",
        f"#upphi {table.up_phi_deg:.10g}",
        f"#incident_angle {table.theta_i_deg:.10g} {table.phi_i_deg:.10g}",
        f"#datapoints_in_file {len(table.values)}",
    ]
    azimuth = pab_azimuth(table.phi_s_deg, 180.0 - table.up_phi_deg)
    rows = ("%.4f %.4f" + " %.6e" * len(columns) + "\n") * len(table.values)
    numbers = [x for row in zip(table.theta_s_deg, azimuth, *columns) for x in row]
    return write_text(path, "\n".join(lines) + "\n" + rows % tuple(numbers))
