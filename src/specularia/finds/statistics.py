"""Counts and weights of finds by group, and their density on the plan."""

from __future__ import annotations

import csv
import math
import warnings
from collections.abc import Mapping, Sequence
from dataclasses import astuple, dataclass, fields
from pathlib import Path

import numpy as np

from specularia.errors import SpeculariaWarning
from specularia.files import atomic, make_folder
from specularia.finds.catalogue import Finds, read
from specularia.finds.plan import KINDS, Plan, read_plan

__all__ = ["Density", "Group", "Summary", "summary", "write_summary"]

UNKNOWN = "not recorded"
"""Name of the group of finds whose cell is empty."""


@dataclass(frozen=True)
class Group:
    """Finds that share a property, with their shares of the whole table (0 to 1)."""

    name: str
    count: int
    weight_g: float
    count_share: float
    weight_share: float


@dataclass(frozen=True)
class Density:
    """Finds on one area of the plan."""

    name: str
    area_m2: float
    count: int
    weight_g: float
    count_per_m2: float
    weight_g_per_m2: float


@dataclass(frozen=True)
class Summary:
    """Statistics of a table of finds.

    Parameters
    ----------
    file : the table.
    rows : number of rows; a row may hold several fragments.
    total_count : fragments.
    total_weight_g : grams.
    groups : by colour, room, type and thickness_class; largest weight first, thickness in its order.
    density : by kind of area ("room", "square"), in the order of the plan; empty without a plan.
    synthetic : True where the table is synthetic.
    """

    file: Path
    rows: int
    total_count: int
    total_weight_g: float
    groups: Mapping[str, tuple[Group, ...]]
    density: Mapping[str, tuple[Density, ...]]
    synthetic: bool


def summary(table: Finds | str | Path, plan: Plan | str | Path | None = None) -> Summary:
    """Count and weigh finds by colour, room, type and thickness class, and relate them to the plan.

    Parameters
    ----------
    table : a table of finds, or the path of one (see `read`).
    plan : rooms and squares, or the path of a GeoJSON file (see `read_plan`); None leaves the density out.

    Notes
    -----
    A thickness class is one millimetre wide and holds its lower end: 2-3 mm is 2 <= thickness < 3. Finds on
    no area of the plan count in the totals and groups but in no density; a warning gives their number.
    """
    finds = table if isinstance(table, Finds) else read(table)
    drawn = plan if plan is None or isinstance(plan, Plan) else read_plan(plan)
    groups = {name: _groups(finds, getattr(finds, name)) for name in ("colour", "room", "type")}
    classes = [_thickness_class(t) for t in finds.thickness_mm]
    by_thickness = _groups(finds, [label for _, label in classes])
    lower_end = {label: low for low, label in classes}
    groups["thickness_class"] = tuple(sorted(by_thickness, key=lambda g: lower_end[g.name]))
    return Summary(
        file=finds.file,
        rows=len(finds.find_number),
        total_count=int(finds.count.sum()),
        total_weight_g=math.fsum(finds.weight_g),
        groups=groups,
        density={} if drawn is None else _density(finds, drawn),
        synthetic=finds.synthetic,
    )


def write_summary(result: Summary, folder: str | Path) -> list[Path]:
    """Write one CSV per grouping (`by_colour.csv`, ...) and per density (`density_room.csv`, ...)."""
    folder = make_folder(folder)
    tables: dict[str, Sequence[Group] | Sequence[Density]] = {f"by_{k}": g for k, g in result.groups.items()}
    tables |= {f"density_{k}": d for k, d in result.density.items()}
    paths = []
    for name, rows in tables.items():
        path = folder / f"{name}.csv"
        kind = Group if name.startswith("by_") else Density
        with atomic(path) as temporary, temporary.open("w", newline="", encoding="utf-8") as f:
            writer = csv.writer(f, lineterminator="\n")
            writer.writerow([field.name for field in fields(kind)])
            writer.writerows(astuple(row) for row in rows)
        paths.append(path)
    return paths


def _groups(finds: Finds, labels: Sequence[str]) -> tuple[Group, ...]:
    """Sums per label, largest weight first, the unrecorded last."""
    named = np.array([label or UNKNOWN for label in labels])
    all_count, all_weight = int(finds.count.sum()), math.fsum(finds.weight_g)
    groups = []
    for name in np.unique(named):
        here = named == name
        count, weight = int(finds.count[here].sum()), math.fsum(finds.weight_g[here])
        groups.append(Group(str(name), count, weight, count / all_count, weight / all_weight))
    return tuple(sorted(groups, key=lambda g: (g.name == UNKNOWN, -g.weight_g, g.name)))


def _thickness_class(thickness_mm: float) -> tuple[float, str]:
    """Lower end and label of the class; the unmeasured come last."""
    if np.isnan(thickness_mm):
        return np.inf, UNKNOWN
    low = int(np.floor(thickness_mm))
    return float(low), f"{low}-{low + 1} mm"


def _density(finds: Finds, plan: Plan) -> dict[str, tuple[Density, ...]]:
    out: dict[str, tuple[Density, ...]] = {}
    for kind in KINDS:
        areas = plan.of_kind(kind)
        if not areas:
            continue
        place = np.array(getattr(finds, kind))
        known = {a.name for a in areas}
        lost = [p not in known for p in place]
        if any(lost):
            others = sorted({str(p) or UNKNOWN for p in place[lost]})
            named = ", ".join(others[:5]) + (", ..." if len(others) > 5 else "")
            warnings.warn(
                f"{int(finds.count[lost].sum())} of {int(finds.count.sum())} fragments lie in no {kind} of "
                f"{plan.file.name} ({named}); they are left out of the density by {kind}.",
                SpeculariaWarning,
                stacklevel=3,
            )
        rows = []
        for area in areas:
            here = place == area.name
            count, weight, size = (
                int(finds.count[here].sum()),
                math.fsum(finds.weight_g[here]),
                area.area_m2,
            )
            rows.append(Density(area.name, size, count, weight, count / size, weight / size))
        out[kind] = tuple(rows)
    return out
