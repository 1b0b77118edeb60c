"""How a table of finds is to be read: its columns, words of other languages, units, what may pass."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Literal

from pydantic import Field, model_validator

from specularia.errors import FormatError
from specularia.files import existing
from specularia.jobs import Job, load_toml, parse_job

__all__ = ["Mapping", "read_mapping"]

FIELDS = (
    "find_number",
    "room",
    "square",
    "colour",
    "type",
    "count",
    "weight",
    "weight_unit",
    "thickness",
    "thickness_unit",
    "x",
    "y",
)
"""What a column can hold; `weight_unit` and `thickness_unit` are columns that name the unit of each row."""

Strictness = Literal["refuse", "note"]


class Mapping(Job):
    """A mapping file (TOML or JSON): how the words of a table are to be taken. Every key is optional."""

    columns: dict[str, str] = Field(default_factory=dict)
    """Our name = the table's name of each column: find_number, room, square, colour, type, count, weight,
    weight_unit, thickness, thickness_unit, x, y. With this table only find_number, weight and count (or
    `one_fragment_per_row`) must be there; without it all columns must, under their own names."""

    values: dict[str, dict[str, str]] = Field(default_factory=dict)
    """For colour, type, room and square: the table's word = ours. Capitals and spaces around do not count.
    A column that has such words knows no others but these and their translations."""

    unknown_words: Strictness = "refuse"
    """What happens to a word that `values` does not know: "refuse" the table, or "note" it and keep it."""

    weight_unit: Literal["g", "kg", "mg", "in cells"] = "g"
    """Unit of the column of weights; "in cells": each cell has its own, as in 0,3 kg."""

    thickness_unit: Literal["mm", "cm", "in cells"] = "mm"
    """Unit of the column of thicknesses, likewise."""

    coordinate_unit: Literal["m", "cm", "mm", "px"] = "m"
    """Unit of x and y: metres of the plan, or pixels of its picture (from the upper left corner)."""

    decimal: Literal[".", ","] = "."
    """Decimal mark of numbers that stand as text."""

    separator: Literal[",", ";", "\t"] = ","
    """Between the cells of a CSV."""

    encoding: Literal["utf-8", "cp1252", "latin-1", "utf-16"] = "utf-8"
    """Of a CSV."""

    sheet: str | None = None
    """Sheet of a spreadsheet; the first unless named."""

    header_row: int = Field(default=1, ge=1, le=1000)
    """Row of the column names, counted from 1; rows above are left out. In a CSV comments do not count."""

    empty: list[str] = Field(default_factory=list)
    """Cells that stand for nothing recorded, such as "-" or "k. A."."""

    missing_weight: Strictness = "refuse"
    """A row without a weight: "refuse" the table, or "note" it and count the row, not its weight."""

    duplicates: Strictness = "refuse"
    """A find number that stands twice: "refuse" the table, or "note" it and count both."""

    other_columns: Literal["refuse", "ignore"] = "refuse"
    """Columns that are neither ours nor named in `columns`."""

    one_fragment_per_row: bool = False
    """A table without a column of counts holds one fragment in each row."""

    @model_validator(mode="after")
    def _known(self) -> Mapping:
        for name in self.columns:
            if name not in FIELDS:
                raise ValueError(f"columns that are known ({', '.join(FIELDS)}), not {name}")
        for name in self.values:
            if name not in ("colour", "type", "room", "square"):
                raise ValueError(f"words for colour, type, room or square, not {name}")
        twice = [v for v in self.columns.values() if list(self.columns.values()).count(v) > 1]
        if twice:
            raise ValueError(f"each column once, not {twice[0]} twice")
        for unit in ("weight_unit", "thickness_unit"):
            if unit in self.columns and unit in self.model_fields_set:
                raise ValueError(f"either {unit} or a column of units, not both")
        return self


def read_mapping(path: str | Path) -> Mapping:
    """Read a mapping file: TOML, or JSON where its name ends in .json.

    Raises
    ------
    FormatError : an unknown key or value; it names the line.
    """
    path = existing(path, what="a mapping file (TOML or JSON)")
    if path.suffix.lower() != ".json":
        return load_toml(path, Mapping)
    try:
        text = path.read_text(encoding="utf-8-sig")
        data = json.loads(text)
    except json.JSONDecodeError as error:
        raise FormatError(file=path, line=error.lineno, expected="JSON", found=error.msg) from error
    except (UnicodeDecodeError, OSError) as error:
        raise FormatError(file=path, expected="a JSON file in UTF-8", found=str(error)) from error
    if not isinstance(data, dict):
        raise FormatError(file=path, expected="a JSON object", found=type(data).__name__)
    return parse_job(data, Mapping, file=path, text=text)
