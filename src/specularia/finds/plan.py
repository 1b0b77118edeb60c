"""The plan of a site: rooms and excavation squares as polygons in metres."""

from __future__ import annotations

import json
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from specularia.errors import FormatError
from specularia.files import existing

__all__ = ["KINDS", "Area", "Plan", "read_plan"]

KINDS: Final = ("room", "square")
"""What an area of a plan can be."""

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Area:
    """A named part of a plan.

    Parameters
    ----------
    kind : one of `KINDS`.
    name : as in the table of finds.
    polygons : one tuple of rings per polygon; each ring is an array [K, 2] of x, y in metres with the first
        point repeated at the end; the first ring is the outline, the others are holes.
    """

    kind: str
    name: str
    polygons: tuple[tuple[Array, ...], ...]

    @property
    def area_m2(self) -> float:
        """Area of the polygons less their holes, m2."""
        return float(
            sum(_ring_area(rings[0]) - sum(_ring_area(h) for h in rings[1:]) for rings in self.polygons)
        )


@dataclass(frozen=True)
class Plan:
    """The areas of a site, in metres."""

    file: Path
    areas: tuple[Area, ...]

    def of_kind(self, kind: str) -> tuple[Area, ...]:
        """Areas of one kind, in the order of the file."""
        return tuple(a for a in self.areas if a.kind == kind)


def read_plan(path: str | Path) -> Plan:
    """Read a plan: a GeoJSON FeatureCollection of polygons.

    Each has the properties "kind" ("room" or "square") and "name". Coordinates are metres in a local frame, x
    to the right and y up on the drawing. Features of another kind are left out; a room or square that stands
    twice is a fault.

    Raises
    ------
    FormatError : the file is not such a collection; it names the feature, counted from 1.
    """
    path = existing(path, what="a plan (GeoJSON)")
    try:
        data = json.loads(path.read_text(encoding="utf-8-sig"))
    except (UnicodeDecodeError, IsADirectoryError) as error:
        raise FormatError(file=path, expected="a GeoJSON file in UTF-8", found=str(error)) from error
    except json.JSONDecodeError as error:
        raise FormatError(file=path, line=error.lineno, expected="JSON", found=error.msg) from error
    if not isinstance(data, dict) or data.get("type") != "FeatureCollection":
        found = data.get("type") if isinstance(data, dict) else type(data).__name__
        raise FormatError(file=path, expected="a GeoJSON FeatureCollection", found=repr(found))
    areas: list[Area] = []
    seen: set[tuple[str, str]] = set()
    for k, feature in enumerate(data.get("features", ()), 1):
        properties = (feature or {}).get("properties") or {}
        kind, name = properties.get("kind"), str(properties.get("name", "")).strip()
        if kind not in KINDS:
            continue
        if not name:
            raise FormatError(file=path, expected=f"a name for the {kind} in feature {k}", found="none")
        if (kind, name) in seen:
            raise FormatError(file=path, expected=f"each {kind} once", found=f"{name!r} again in feature {k}")
        seen.add((kind, name))
        areas.append(Area(kind=kind, name=name, polygons=tuple(_polygons(feature, k, path))))
        if areas[-1].area_m2 <= 0.0:
            raise FormatError(file=path, expected=f"an area > 0 in feature {k} ({name})", found="none")
    if not areas:
        raise FormatError(
            file=path, expected='polygons with the property "kind" of "room" or "square"', found="none"
        )
    return Plan(file=path, areas=tuple(areas))


def _polygons(feature: Any, number: int, path: Path) -> Iterable[tuple[Array, ...]]:
    """Rings of the polygons of one feature, closed."""
    geometry: dict[str, Any] = feature.get("geometry") or {}
    kind: Any
    coordinates: Any
    kind, coordinates = geometry.get("type"), geometry.get("coordinates")
    if kind not in ("Polygon", "MultiPolygon"):
        raise FormatError(
            file=path, expected=f"a Polygon or MultiPolygon in feature {number}", found=repr(kind)
        )
    try:
        for polygon in [coordinates] if kind == "Polygon" else coordinates:
            rings = tuple(np.asarray(ring, float)[:, :2] for ring in polygon)
            if not rings or any(len(r) < 4 or not np.isfinite(r).all() for r in rings):
                raise ValueError("a ring of fewer than four finite points")
            if any(not np.array_equal(r[0], r[-1]) for r in rings):
                raise ValueError("a ring whose last point is not its first")
            yield rings
    except (TypeError, ValueError, IndexError) as error:
        raise FormatError(
            file=path,
            expected=f"closed rings of points [x, y] in metres in feature {number}",
            found=str(error),
        ) from error


def _ring_area(ring: Array) -> float:
    """Area inside a closed ring, m2 (the shoelace formula)."""
    x, y = (ring - ring[0]).T
    return float(0.5 * abs(np.sum(x[:-1] * y[1:] - x[1:] * y[:-1])))
