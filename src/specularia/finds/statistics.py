"""Counts and weights of finds by group, with their intervals, and their density on the plan."""

from __future__ import annotations

import math
import warnings
from collections.abc import Mapping as Mapped
from collections.abc import Sequence
from dataclasses import astuple, dataclass, field, fields
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from specularia.errors import SpeculariaWarning
from specularia.files import make_folder
from specularia.finds.area import SODA_LIME_DENSITY, GlazedArea, glazed_area
from specularia.finds.catalogue import Finds, Note, read
from specularia.finds.intervals import Resampled, wilson
from specularia.finds.mapping import Mapping
from specularia.finds.plan import KINDS, Plan, read_plan
from specularia.finds.tables_out import write_rows
from specularia.finds.thickness import Thickness, thickness

__all__ = ["GROUPINGS", "UNKNOWN", "Density", "Group", "Summary", "labels", "summary", "write_summary"]

UNKNOWN = "not recorded"
"""Name of the group of finds whose cell is empty."""

GROUPINGS = ("colour", "room", "type", "thickness_class")
"""What finds are grouped by."""


@dataclass(frozen=True)
class Group:
    """Finds that share a property, with their shares of the whole table (0 to 1) and 95 % intervals.

    Parameters
    ----------
    name, count, weight_g : of the group; rows without a weight count in `count` alone.
    count_share, weight_share : of the table's fragments and weight.
    count_low, count_high : Wilson's interval of the share of fragments, each taken for itself.
    weight_low, weight_high : of the share of weight, from rows drawn anew (bootstrap).
    """

    name: str
    count: int
    weight_g: float
    count_share: float
    weight_share: float
    count_low: float
    count_high: float
    weight_low: float
    weight_high: float


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
    total_weight_g : grams, of the rows that have a weight.
    groups : by colour, room, type and thickness_class; largest weight first, thickness in its order.
    density : by kind of area ("room", "square"), in the order of the plan; empty without a plan.
    synthetic : True where the table is synthetic.
    unweighed_count : fragments in rows without a weight.
    thickness : distribution of thickness; None where none was measured.
    area : glazed area; None where no thickness was measured.
    notes : what the reader let pass, with row numbers.
    """

    file: Path
    rows: int
    total_count: int
    total_weight_g: float
    groups: Mapped[str, tuple[Group, ...]]
    density: Mapped[str, tuple[Density, ...]]
    synthetic: bool
    unweighed_count: int = 0
    thickness: Thickness | None = None
    area: GlazedArea | None = None
    notes: tuple[Note, ...] = field(default=())


def summary(
    table: Finds | str | Path,
    plan: Plan | str | Path | None = None,
    *,
    mapping: Mapping | str | Path | None = None,
    density_g_cm3: float = SODA_LIME_DENSITY[0],
    density_se_g_cm3: float = SODA_LIME_DENSITY[1],
    seed: int = 0,
) -> Summary:
    """Count and weigh finds by colour, room, type and thickness class, and relate them to the plan.

    Parameters
    ----------
    table : a table of finds, or the path of one (see `read`).
    plan : rooms and squares, or the path of a GeoJSON file (see `read_plan`); None leaves the density out.
    mapping : how a table given by its path is to be read.
    density_g_cm3, density_se_g_cm3 : density of the glass and its standard error, for the glazed area.
    seed : of the draws that intervals come from.

    Notes
    -----
    A thickness class is one millimetre wide and holds its lower end: 2-3 mm is 2 <= thickness < 3. Finds on
    no area of the plan count in the totals and groups but in no density; a warning gives their number.

    Intervals hold 95 %. They say how far shares would vary if another such catalogue were collected, not
    how complete this one is. Those of fragments take each for itself (Wilson), those of weight keep the
    fragments of a row together (bootstrap).
    """
    finds = table if isinstance(table, Finds) else read(table, mapping)
    drawn = plan if plan is None or isinstance(plan, Plan) else read_plan(plan)
    resampled = Resampled(len(finds.find_number), seed=seed)
    groups = _groups(finds, resampled)
    classes = {label: low for low, label in map(_thickness_class, finds.thickness_mm)}
    by_thickness = sorted(groups["thickness_class"], key=lambda g: classes[g.name])
    groups["thickness_class"] = tuple(by_thickness)
    unweighed = np.isnan(finds.weight_g)
    return Summary(
        file=finds.file,
        rows=len(finds.find_number),
        total_count=int(finds.count.sum()),
        total_weight_g=math.fsum(finds.weight_g[~unweighed]),
        groups=groups,
        density={} if drawn is None else _density(finds, drawn),
        synthetic=finds.synthetic,
        unweighed_count=int(finds.count[unweighed].sum()),
        thickness=thickness(finds.thickness_mm, finds.count, resampled),
        area=glazed_area(finds, resampled, density_g_cm3=density_g_cm3, density_se_g_cm3=density_se_g_cm3),
        notes=finds.notes,
    )


def write_summary(result: Summary, folder: str | Path) -> list[Path]:
    """Write the tables of a summary as CSV.

    One per grouping (`by_colour.csv`, ...) and per density (`density_room.csv`, ...), the distribution of
    thickness and the glazed area where there are any, and `notes.csv` with what the reader let pass. Text
    that a spreadsheet would run as a formula gets an apostrophe before it.
    """
    folder = make_folder(folder)
    tables: dict[str, Sequence[Group] | Sequence[Density]] = {f"by_{k}": g for k, g in result.groups.items()}
    tables |= {f"density_{k}": d for k, d in result.density.items()}
    paths = []
    for name, rows in tables.items():
        kind = Group if name.startswith("by_") else Density
        header = [f.name for f in fields(kind)]
        paths.append(write_rows(folder / f"{name}.csv", header, map(astuple, rows)))
    if result.thickness is not None:
        found = result.thickness
        rows_ = zip(found.edges_mm[:-1], found.edges_mm[1:], found.count)
        paths.append(write_rows(folder / "thickness.csv", ["from_mm", "to_mm", "fragments"], rows_))
    if result.area is not None:
        header = [f.name for f in fields(GlazedArea)]
        paths.append(write_rows(folder / "glazed_area.csv", header, [astuple(result.area)]))
    if result.notes:
        notes = [astuple(n) for n in result.notes]
        paths.append(write_rows(folder / "notes.csv", ["row", "column", "note"], notes))
    return paths


def labels(finds: Finds, grouping: str) -> NDArray[np.str_]:
    """[N] the group of each row ("colour", "room", "square", "type" or "thickness_class")."""
    if grouping == "thickness_class":
        return np.array([label for _, label in map(_thickness_class, finds.thickness_mm)])
    return np.array([label or UNKNOWN for label in getattr(finds, grouping)])


def _groups(finds: Finds, resampled: Resampled) -> dict[str, tuple[Group, ...]]:
    """Sums per label of each grouping, largest weight first, the unrecorded last."""
    weight = np.where(np.isnan(finds.weight_g), 0.0, finds.weight_g)
    all_count, all_weight = int(finds.count.sum()), math.fsum(weight)
    named = {g: np.unique(labels(finds, g), return_inverse=True) for g in GROUPINGS}
    drawn = resampled.sums([(index, len(names), weight) for names, index in named.values()])
    out = {}
    for (grouping, (names, index)), sums in zip(named.items(), drawn):
        with np.errstate(divide="ignore", invalid="ignore"):
            low, high = Resampled.ends(sums / sums.sum(axis=1, keepdims=True))
        order = np.argsort(index, kind="stable")
        parts = np.split(order, np.searchsorted(index[order], np.arange(1, len(names))))
        groups = []
        for k, (name, here) in enumerate(zip(names, parts)):
            count, heavy = int(finds.count[here].sum()), math.fsum(weight[here])
            ends = wilson(count, all_count)
            groups.append(
                Group(
                    str(name),
                    count,
                    heavy,
                    count / all_count,
                    heavy / all_weight,
                    *ends,
                    float(low[k]),
                    float(high[k]),
                )
            )
        out[grouping] = tuple(sorted(groups, key=lambda g: (g.name == UNKNOWN, -g.weight_g, g.name)))
    return out


def _thickness_class(thickness_mm: float) -> tuple[float, str]:
    """Lower end and label of the class; the unmeasured come last."""
    if np.isnan(thickness_mm):
        return np.inf, UNKNOWN
    low = int(np.floor(thickness_mm))
    return float(low), f"{low}-{low + 1} mm"


def _density(finds: Finds, plan: Plan) -> dict[str, tuple[Density, ...]]:
    out: dict[str, tuple[Density, ...]] = {}
    weight = np.where(np.isnan(finds.weight_g), 0.0, finds.weight_g)
    for kind in KINDS:
        areas = plan.of_kind(kind)
        if not areas:
            continue
        names = list(getattr(finds, kind))
        known = {a.name for a in areas}
        lost = np.array([p not in known for p in names])
        if lost.any():
            others = sorted({p or UNKNOWN for p, gone in zip(names, lost) if gone})
            named = ", ".join(others[:5]) + (", ..." if len(others) > 5 else "")
            warnings.warn(
                f"{int(finds.count[lost].sum())} of {int(finds.count.sum())} fragments lie in no {kind} of "
                f"{plan.file.name} ({named}); they are left out of the density by {kind}.",
                SpeculariaWarning,
                stacklevel=3,
            )
        place = np.array(names)
        rows = []
        for area in areas:
            here = place == area.name
            count, heavy, size = int(finds.count[here].sum()), math.fsum(weight[here]), area.area_m2
            rows.append(Density(area.name, size, count, heavy, count / size, heavy / size))
        out[kind] = tuple(rows)
    return out
