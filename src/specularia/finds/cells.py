"""Single cells of a table of finds: words, numbers with or without a unit, counts."""

from __future__ import annotations

import math
import re
from pathlib import Path
from typing import Any, Final

from specularia.errors import FormatError
from specularia.finds.mapping import Mapping

__all__ = ["UNITS", "Reader"]

UNITS: Final = {
    "weight": {"g": 1.0, "kg": 1000.0, "mg": 0.001},
    "thickness": {"mm": 1.0, "cm": 10.0},
}
"""Units of a quantity and what they are in grams and in millimetres."""

_LENGTH: Final = {"m": 1.0, "cm": 0.01, "mm": 0.001, "px": 1.0}
_NUMBER: Final = r"[0-9]+(?:\.[0-9]*)?(?:[eE][+-]?[0-9]+)?|\.[0-9]+"
_PLAIN: Final = re.compile(_NUMBER)
_SIGNED: Final = re.compile(rf"[+-]?(?:{_NUMBER})")
_WITH_UNIT: Final = re.compile(r"(\S.*?)\s*([A-Za-zµ]+)\.?")


class Reader:
    """Turns cells into values, by the rules of a mapping.

    Parameters
    ----------
    path : of the table, for errors.
    mapping : what to go by.
    named : True where units stand in the names of the columns.
    """

    def __init__(self, path: Path, mapping: Mapping, *, named: bool) -> None:
        self.path, self.mapping, self.named = path, mapping, named
        self._empty = {e.strip().casefold() for e in mapping.empty}
        self._words = {
            name: {_folded(k): v for k, v in words.items()} for name, words in mapping.values.items()
        }
        self._known = {name: set(words.values()) for name, words in mapping.values.items()}
        self._taken: dict[tuple[str, str], str] = {}
        self._measured: dict[tuple[str, type, Any, Any], float] = {}

    def word(self, cell: Any, name: str, line: int) -> str:
        """Text of a cell in our words; "" where nothing is recorded."""
        text = _text(cell)
        if name == "find_number":
            return self._word(text, name, line)
        # The words of a table are few: each is looked at once.
        if (name, text) not in self._taken:
            self._taken[name, text] = self._word(text, name, line)
        return self._taken[name, text]

    def _word(self, text: str, name: str, line: int) -> str:
        if text.casefold() in self._empty:
            return ""
        if text.startswith(("=", "+", "@")):
            raise self._wrong(
                line,
                f"plain text in {name}",
                f"{text!r}",
                "A spreadsheet would run this as a formula.",
            )
        return self._words.get(name, {}).get(_folded(text), text)

    def known(self, word: str, name: str) -> bool:
        """Whether a word is one of ours; all are where the mapping has none for the column."""
        return name not in self._known or word in self._known[name]

    def quantity(self, cell: Any, name: str, line: int, *, unit: Any = None) -> float:
        """A weight in grams or a thickness in millimetres; NaN for an empty cell."""
        if cell is None or cell == "":
            return math.nan
        key = (name, type(cell), cell, unit)  # True is no 1.
        if key not in self._measured:
            self._measured[key] = self._quantity(cell, name, line, unit)
        return self._measured[key]

    def _quantity(self, cell: Any, name: str, line: int, unit: Any) -> float:
        fixed: str = self.mapping.weight_unit if name == "weight" else self.mapping.thickness_unit
        units = UNITS[name]
        if isinstance(cell, (int, float)) and not isinstance(cell, bool):
            text = repr(float(cell))
        else:
            text = _text(cell)
            if not text or text.casefold() in self._empty:
                return math.nan
        own = _text(unit)
        if own:
            fixed = own.rstrip(".")
            if fixed not in units:
                raise self._wrong(line, f"a unit of {name} ({', '.join(units)})", repr(own))
        elif f"{name}_unit" in self.mapping.columns:
            raise self._wrong(line, f"the unit of the {name}", "an empty cell")
        elif fixed == "in cells":
            match = _WITH_UNIT.fullmatch(text)
            if match is None or match[2] not in units:
                raise self._wrong(line, f"{name} with its unit ({', '.join(units)})", repr(text))
            text, fixed = match[1], match[2]
        plain = text
        if self.mapping.decimal == "," and not isinstance(cell, (int, float)):
            plain = (
                text.replace(",", ".") if text.count(",") == 1 and "." not in text else text.replace(",", "?")
            )
        if _PLAIN.fullmatch(plain) and 0.0 < float(plain) * units[fixed] < math.inf:
            return _scaled(plain, fixed, units)
        advice = ""
        if self.mapping.decimal == "." and re.fullmatch(r"[0-9]+,[0-9]+", text):
            advice = "Write the decimal mark as a point."
            if not self.named:
                advice = 'Set decimal = ",".'
        elif re.fullmatch(r"[0-9.,]+\s*[a-zµ]+", text, re.IGNORECASE):
            stands = (
                f"stands in the column's name ({name}_{fixed})" if self.named else f"is said to be {fixed}"
            )
            advice = f"Write the number alone; the unit {stands}."
        raise self._wrong(line, f"{name} as a number > 0 in {fixed}", repr(text), advice)

    def count(self, cell: Any, line: int) -> float:
        """A whole number of fragments."""
        text = _text(cell)
        if isinstance(cell, float) and cell.is_integer():
            text = str(int(cell))
        if re.fullmatch(r"[0-9]{1,9}", text) and int(text) >= 1:
            return float(text)
        raise self._wrong(line, "count as a whole number >= 1", repr(text) if text else "an empty cell")

    def coordinate(self, cell: Any, name: str, line: int) -> float:
        """A coordinate in metres or pixels; NaN where it is unknown."""
        text = _text(cell)
        if not text or text.casefold() in self._empty:
            return math.nan
        if self.mapping.decimal == "," and isinstance(cell, str):
            text = text.replace(",", ".") if "." not in text else "?"
        if _SIGNED.fullmatch(text) and math.isfinite(float(text)):
            return float(text) * _LENGTH[self.mapping.coordinate_unit]
        raise self._wrong(line, f"{name} as a number in {self.mapping.coordinate_unit}", repr(_text(cell)))

    def _wrong(self, line: int, expected: str, found: str, advice: str = "") -> FormatError:
        return FormatError(file=self.path, line=line, expected=expected, found=found, advice=advice)


def _scaled(text: str, unit: str, units: dict[str, float]) -> float:
    """Decimal digits stay exact: 0.3 kg are 300 g, not 299.99999999999994."""
    shift = round(math.log10(units[unit]))
    return float(f"{text}e{shift}") if "e" not in text.lower() else float(text) * units[unit]


def _text(cell: Any) -> str:
    """A cell as text; whole numbers without the point that spreadsheets give them."""
    if cell is None:
        return ""
    if isinstance(cell, str):
        return cell.strip()
    if isinstance(cell, float) and cell.is_integer() and abs(cell) < 1e15:
        return str(int(cell))
    return str(cell).strip()


def _folded(text: str) -> str:
    return re.sub(r"\s+", " ", text.strip()).casefold()
