"""A choice of fragments to measure, in which every kind of glass has its share."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import astuple, dataclass, fields
from pathlib import Path

import numpy as np

from specularia.errors import PhysicsError
from specularia.finds.catalogue import Finds
from specularia.finds.statistics import labels
from specularia.finds.tables_out import write_rows

__all__ = ["Chosen", "choose", "write_choice"]


@dataclass(frozen=True)
class Chosen:
    """A row that was chosen.

    Parameters
    ----------
    find_number, line : name and place in the file.
    stratum : what it stands for, such as "yellow, 2-3 mm".
    stratum_count : fragments in the stratum.
    colour, type, room, weight_g, thickness_mm, count : as in the table.
    """

    find_number: str
    line: int
    stratum: str
    stratum_count: int
    colour: str
    type: str
    room: str
    weight_g: float
    thickness_mm: float
    count: int


def choose(
    finds: Finds, size: int, *, by: Sequence[str] = ("colour", "thickness_class"), seed: int = 0
) -> tuple[Chosen, ...]:
    """Choose rows at random, from each stratum in proportion to its fragments.

    Every stratum gets one first, the largest ones if there are more strata than places; the others are shared
    out by largest remainder, and none gets more than it has rows. Within a stratum all rows are equally
    likely.

    Parameters
    ----------
    finds : the table.
    size : rows to choose; all of them where the table has no more.
    by : what makes a stratum: of "colour", "type", "room", "square" and "thickness_class".
    seed : of the draws.

    Returns
    -------
    rows by stratum, those with most fragments first.
    """
    if size < 1:
        raise PhysicsError(f"a choice of {size} fragments is none; choose at least 1.")
    known = ("colour", "type", "room", "square", "thickness_class")
    if not by or any(name not in known for name in by):
        raise PhysicsError(f"strata are made by {', '.join(known)}, not by {', '.join(by) or 'nothing'}.")
    joined = [", ".join(parts) for parts in zip(*(labels(finds, name) for name in by))]
    names, index = np.unique(joined, return_inverse=True)
    count = np.bincount(index, weights=finds.count).astype(np.int64)
    rows = np.bincount(index)
    places = _places(count, rows, size)
    rng = np.random.default_rng(seed)
    out = []
    for k in np.lexsort((names, -count)):
        here = np.flatnonzero(index == k)
        for i in sorted(rng.choice(here, places[k], replace=False)) if places[k] else ():
            out.append(
                Chosen(
                    find_number=finds.find_number[i],
                    line=int(finds.line[i]) if finds.line.size else int(i) + 2,
                    stratum=str(names[k]),
                    stratum_count=int(count[k]),
                    colour=finds.colour[i],
                    type=finds.type[i],
                    room=finds.room[i],
                    weight_g=float(finds.weight_g[i]),
                    thickness_mm=float(finds.thickness_mm[i]),
                    count=int(finds.count[i]),
                )
            )
    return tuple(out)


def write_choice(chosen: Sequence[Chosen], path: str | Path) -> Path:
    """Write a choice as CSV."""
    return write_rows(path, [f.name for f in fields(Chosen)], map(astuple, chosen))


def _places(count: np.ndarray, rows: np.ndarray, size: int) -> np.ndarray:
    """Rows to take from each stratum."""
    size = min(size, int(rows.sum()))
    places = np.zeros(len(count), int)
    places[np.argsort(-count, kind="stable")[:size]] = 1
    while places.sum() < size:
        room = places < rows
        # The one that lags its share most, as largest remainders do.
        lag = np.where(room, size * count / count.sum() - places, -np.inf)
        places[int(np.argmax(lag))] += 1
    return places
