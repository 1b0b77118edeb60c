"""An invented house and the window glass that an excavation of it might have listed."""

from __future__ import annotations

import csv
import io
import json
from dataclasses import dataclass
from typing import Any

import numpy as np

from specularia.twin.settings import FindsSettings

__all__ = ["COLUMNS", "ROOMS", "Find", "finds", "finds_csv", "plan_geojson"]

COLUMNS = (
    "find_number",
    "room",
    "square",
    "colour",
    "weight_g",
    "thickness_mm",
    "type",
    "count",
)
"""Columns of the table; the find numbers, all SYN-, label each row."""

ROOMS: dict[str, tuple[tuple[float, float, float, float], float]] = {
    "entrance": ((0.0, 14.0, 6.0, 20.0), 0.4),
    "workshop": ((6.0, 14.0, 14.0, 20.0), 0.3),
    "shop": ((14.0, 14.0, 24.0, 20.0), 0.3),
    "west chamber": ((0.0, 6.0, 6.0, 14.0), 1.0),
    "courtyard": ((6.0, 6.0, 18.0, 14.0), 0.2),
    "east chamber": ((18.0, 6.0, 24.0, 14.0), 0.8),
    "marble hall": ((0.0, 0.0, 10.0, 6.0), 3.0),
    "mosaic room": ((10.0, 0.0, 18.0, 6.0), 2.4),
    "corner room": ((18.0, 0.0, 24.0, 6.0), 1.6),
}
"""Rooms of the house: corners (x0, y0, x1, y1) in metres and how rich in glass a square metre of them is."""

_SQUARE_M = 2.0
_NOTE = "synthetic: invented site, made by a computer program"

# Colour group: share of the number of fragments, share of the weight, both per cent. Their sums follow the
# published house: yellow and brown 39 and 53, green and aqua 49 and 41.
_COLOURS = {
    "yellow": (17.0, 22.0),
    "brown": (22.0, 31.0),
    "green": (27.0, 23.0),
    "aqua": (22.0, 18.0),
    "colourless": (9.0, 4.5),
    "blue": (3.0, 1.5),
}
_BLOWN, _CAST = "cylinder-blown", "matt-glossy (cast)"
_CAST_FRAGMENTS = 3


@dataclass(frozen=True)
class Find:
    """One row of the table: fragments of one colour from one square, bagged together."""

    find_number: str
    room: str
    square: str
    colour: str
    weight_g: float
    thickness_mm: float
    type: str
    count: int


def _squares() -> list[tuple[str, str, tuple[float, float, float, float], float]]:
    """Name, room, corners in metres and weight (richness, doubled along walls) of each grid square."""
    out = []
    for room, ((x0, y0, x1, y1), richness) in ROOMS.items():
        for y in np.arange(y0, y1, _SQUARE_M):
            for x in np.arange(x0, x1, _SQUARE_M):
                at_wall = x == x0 or y == y0 or x + _SQUARE_M == x1 or y + _SQUARE_M == y1
                name = f"{chr(ord('A') + round(x / _SQUARE_M))}{round(y / _SQUARE_M) + 1}"
                corners = (float(x), float(y), float(x + _SQUARE_M), float(y + _SQUARE_M))
                out.append((name, room, corners, richness * (2.0 if at_wall else 1.0)))
    return out


def finds(settings: FindsSettings, rng: np.random.Generator) -> list[Find]:
    """Finds whose numbers and weights by colour are exactly the set ones, to a fragment and 0.1 g.

    Fragments of one colour are bagged (most bags hold one or two), weights are log-normal, thickness lies
    between 1.5 and 5 mm as in the published house; three fragments are thick cast glass. Ours.
    """
    squares = _squares()
    chance = np.array([s[3] for s in squares])
    chance = chance * rng.gamma(2.0, 1.0, len(squares))
    chance /= chance.sum()
    counts = _shared_out(settings.fragments, [c for c, _ in _COLOURS.values()])
    tenths = _shared_out(round(settings.weight_kg * 10_000), [w for _, w in _COLOURS.values()])
    rows: list[dict[str, Any]] = []
    for colour, number, weight in zip(_COLOURS, counts, tenths):
        bags: list[int] = []
        while sum(bags) < number:
            bags.append(min(int(rng.geometric(0.55)), number - sum(bags)))
        heavy = [float(rng.lognormal(0.0, 0.9, n).sum()) for n in bags]
        weights = _shared_out(weight, heavy, least=1)
        for n, w in zip(bags, weights):
            name, room, _, _ = squares[int(rng.choice(len(squares), p=chance))]
            thickness = float(np.clip(rng.normal(2.7, 0.7), 1.5, 5.0))
            rows.append(
                {
                    "room": room,
                    "square": name,
                    "colour": colour,
                    "weight_g": w / 10.0,
                    "thickness_mm": round(thickness, 1),
                    "type": _BLOWN,
                    "count": n,
                }
            )
    single = [k for k, row in enumerate(rows) if row["count"] == 1 and row["colour"] == "aqua"]
    for k in rng.choice(single, _CAST_FRAGMENTS, replace=False):
        rows[k] |= {"type": _CAST, "thickness_mm": round(float(rng.uniform(5.2, 7.5)), 1)}
    order = rng.permutation(len(rows))
    return [Find(find_number=f"SYN-{n:04d}", **rows[k]) for n, k in enumerate(order, 1)]


def _shared_out(total: int, parts: list[float], *, least: int = 0) -> list[int]:
    """A whole number shared out in proportion to `parts` by largest remainder, at least `least` to each."""
    exact = np.asarray(parts) / np.sum(parts) * (total - least * len(parts)) + least
    floor = np.floor(exact).astype(int)
    floor[np.argsort(floor - exact, kind="stable")[: total - int(floor.sum())]] += 1
    return [int(n) for n in floor]


def finds_csv(rows: list[Find]) -> str:
    """The table as CSV text below a comment that says what it is."""
    text = io.StringIO()
    text.write(f"# {_NOTE}\n")
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(COLUMNS)
    writer.writerows([getattr(row, name) for name in COLUMNS] for row in rows)
    return text.getvalue()


def plan_geojson() -> str:
    """The plan of the house: rooms and grid squares as polygons in local metres, each labelled synthetic."""

    def feature(
        kind: str, name: str, room: str, corners: tuple[float, float, float, float]
    ) -> dict[str, Any]:
        x0, y0, x1, y1 = corners
        ring = [[x0, y0], [x1, y0], [x1, y1], [x0, y1], [x0, y0]]
        properties = {"kind": kind, "name": name, "synthetic": "synthetic"}
        if kind == "square":
            properties["room"] = room
        return {
            "type": "Feature",
            "properties": properties,
            "geometry": {"type": "Polygon", "coordinates": [ring]},
        }

    features = [feature("room", name, name, corners) for name, (corners, _) in ROOMS.items()]
    features += [feature("square", name, room, corners) for name, room, corners, _ in _squares()]
    plan = {
        "type": "FeatureCollection",
        "name": "plan of an invented house (synthetic)",
        "synthetic": _NOTE,
        "units": "metres, local grid; x east, y north",
        "features": features,
    }
    return json.dumps(plan, indent=1) + "\n"
