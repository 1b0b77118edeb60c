"""The VIAVI (RPC Photonics) text format for measured scattering.

A title line and a line `!!BSDF Data`, the incident direction, then rows of theta_s, phi_s, BSDF. theta_s
counts from the normal on the side the light leaves from, and light that goes straight through has
phi_s = phi_i, so both angles are turned into the frame of `conventions`. The format does not say whether the
light was transmitted or reflected.
"""

from __future__ import annotations

import re

from specularia.conventions import fold_azimuth
from specularia.errors import FormatError
from specularia.gonio.raw import Raw, check_angles
from specularia.gonio.rows import parse_rows

__all__ = ["looks_right", "parse"]

_KINDS = {"BSDF": "", "BTDF": "transmission", "BRDF": "reflection"}


def looks_right(head: bytes) -> bool:
    """True for a file that begins with two exclamation marks."""
    return head.lstrip().startswith(b"!!")


def parse(data: bytes, *, file: str, need_quantity: bool = True) -> list[Raw]:
    """Parse a table with LF line ends."""
    place, number, title, label, quantity_line = 0, 1, "", "", None
    line = ""
    while place < len(data):
        end = data.find(b"\n", place)
        end = len(data) if end < 0 else end
        line = data[place:end].decode("latin-1").strip()
        place, number = end + 1, number + 1
        found = re.match(r"!!\s*(\w+)\s+Data\s*$", line, re.IGNORECASE)
        if found:
            label, quantity_line = found[1].upper(), number - 1
        elif line.startswith("!!"):
            title = title or line.removeprefix("!!").strip()
        elif line:
            break
    if need_quantity and label not in _KINDS:
        raise FormatError(
            file=file,
            line=quantity_line,
            expected="a line '!!BSDF Data'",
            found=repr(label) if label else "a header without the quantity",
            advice="Add the line, or say --quantity DSF or BSDF.",
        )
    try:
        theta_i, phi_i = (float(word) for word in line.split())
    except ValueError:
        theta_i, phi_i = -1.0, 0.0
    if not (0 <= theta_i < 89.95 and abs(phi_i) <= 360):
        raise FormatError(
            file=file,
            line=number - 1,
            expected="the incident direction, theta within 0 to 90 and phi, before the rows",
            found=repr(line[:60]),
        )
    rows, lines = parse_rows(data[place:], file=file, first_line=number)
    check_angles(rows[:, 0], rows[:, 1], lines, file=file, theta_max_deg=90.0)
    kind = _KINDS.get(label, "")
    assumed = "the format does not name its side: taken as transmission (else --side reflection)"
    reflected = kind == "reflection"
    return [
        Raw(
            file=file,
            theta_i_deg=theta_i,
            phi_i_deg=phi_i,
            up_phi_deg=90.0,
            theta_s_deg=rows[:, 0] if reflected else 180.0 - rows[:, 0],
            phi_s_deg=fold_azimuth(rows[:, 1] + 180.0),
            values=rows[:, 2].copy(),
            lines=lines,
            quantity="BSDF",
            unit=label,
            quantity_line=quantity_line,
            name=re.sub(r"\s+", " ", title),
            assumed="" if kind else assumed,
        )
    ]
