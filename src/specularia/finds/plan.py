"""The plan of a site: rooms and excavation squares as polygons in metres, or a picture with its scale."""

from __future__ import annotations

import json
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from specularia.errors import FormatError
from specularia.files import existing
from specularia.jobs import Job, load_toml

__all__ = ["KINDS", "Area", "Picture", "Plan", "PlanFile", "read_plan"]

KINDS: Final = ("room", "square")
"""What an area of a plan can be."""

Array = NDArray[np.float64]

_MOST_PIXELS: Final = 50_000_000


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
    def middle_m(self) -> tuple[float, float]:
        """Centre of area of the polygons, x and y in metres."""
        parts = [_centre(ring, k > 0) for rings in self.polygons for k, ring in enumerate(rings)]
        total = sum(a for a, _, _ in parts)
        return sum(a * x for a, x, _ in parts) / total, sum(a * y for a, _, y in parts) / total

    @property
    def area_m2(self) -> float:
        """Area of the polygons less their holes, m2."""
        return float(
            sum(_ring_area(rings[0]) - sum(_ring_area(h) for h in rings[1:]) for rings in self.polygons)
        )


@dataclass(frozen=True)
class Picture:
    """A drawing of the site with its scale.

    Parameters
    ----------
    file : PNG, JPEG or TIFF.
    metres_per_pixel : scale.
    origin_px : column and row, from the upper left corner, of the place where x and y are 0.
    shape : rows and columns of the picture.
    """

    file: Path
    metres_per_pixel: float
    origin_px: tuple[float, float]
    shape: tuple[int, int]

    def metres(self, column: Array, row: Array) -> tuple[Array, Array]:
        """Places on the picture in metres of the plan: x to the right, y up."""
        scale = self.metres_per_pixel
        return (column - self.origin_px[0]) * scale, (self.origin_px[1] - row) * scale

    @property
    def extent_m(self) -> tuple[float, float, float, float]:
        """Left, right, lower and upper edge of the picture in metres."""
        x, y = self.metres(np.array([0.0, self.shape[1]]), np.array([float(self.shape[0]), 0.0]))
        return float(x[0]), float(x[1]), float(y[0]), float(y[1])


@dataclass(frozen=True)
class Plan:
    """The areas of a site in metres, a picture of it, or both."""

    file: Path
    areas: tuple[Area, ...]
    picture: Picture | None = None

    def of_kind(self, kind: str) -> tuple[Area, ...]:
        """Areas of one kind, in the order of the file."""
        return tuple(a for a in self.areas if a.kind == kind)


class PlanFile(Job):
    """A plan that is a picture with a scale (TOML); files lie in its own folder or below."""

    picture: str
    """PNG, JPEG or TIFF."""

    metres_per_pixel: float = Field(gt=0.0, le=1000.0)
    """Scale of the picture."""

    origin_px: tuple[float, float] = (0.0, 0.0)
    """Column and row, from the upper left corner, of the place where x and y are 0."""

    areas: str | None = None
    """GeoJSON with rooms and squares, in metres from that place."""


def read_plan(path: str | Path) -> Plan:
    """Read a plan: a GeoJSON FeatureCollection of polygons, or a TOML file that scales a picture.

    Each has the properties "kind" ("room" or "square") and "name". Coordinates are metres in a local frame, x
    to the right and y up on the drawing. Features of another kind are left out; a room or square that stands
    twice is a fault.

    A TOML file has the keys of `PlanFile`.

    Raises
    ------
    FormatError : the file is not such a collection; it names the feature, counted from 1. Also a file that
        leads out of the folder of the plan.
    """
    path = existing(path, what="a plan (GeoJSON, or TOML with a picture)")
    if path.suffix.lower() == ".toml":
        return _pictured(path)
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


def _pictured(path: Path) -> Plan:
    """A plan that is a picture, with areas where it names some."""
    from PIL import Image, UnidentifiedImageError

    job = load_toml(path, PlanFile)
    file = _inside(path, job.picture, "picture")
    try:
        with Image.open(file, formats=["PNG", "JPEG", "TIFF"]) as image:
            columns, rows = image.size
    except (UnidentifiedImageError, OSError, Image.DecompressionBombError) as error:
        raise FormatError(file=file, expected="a picture (PNG, JPEG or TIFF)", found=str(error)) from error
    if columns * rows > _MOST_PIXELS:
        raise FormatError(
            file=file,
            expected=f"at most {_MOST_PIXELS // 10**6} million pixels",
            found=f"{columns * rows // 10**6} million",
            advice="Make it smaller and change metres_per_pixel.",
        )
    areas = () if job.areas is None else read_plan(_geojson(path, job.areas)).areas
    return Plan(path, areas, Picture(file, job.metres_per_pixel, job.origin_px, (rows, columns)))


def _geojson(plan: Path, name: str) -> Path:
    file = _inside(plan, name, "areas")
    if file.suffix.lower() == ".toml":
        raise FormatError(file=plan, expected="areas: a GeoJSON file", found=repr(name))
    return file


def _inside(plan: Path, name: str, key: str) -> Path:
    """A file that a plan names, if it lies in the plan's folder or below, wherever links may lead."""
    folder = plan.resolve().parent
    file = (folder / name).resolve()
    if Path(name).is_absolute() or not file.is_relative_to(folder):
        raise FormatError(
            file=plan,
            expected=f"{key}: a file in the folder of the plan or below",
            found=repr(name),
            advice="Copy it there.",
        )
    return existing(file, what=f"the {key} that {plan.name} names")


def _centre(ring: Array, hole: bool) -> tuple[float, float, float]:
    """Signed area of a closed ring, negative for a hole, and its centre."""
    x, y = (ring - ring[0]).T
    cross = x[:-1] * y[1:] - x[1:] * y[:-1]
    twice = float(cross.sum())
    if twice == 0.0:
        return 0.0, 0.0, 0.0
    cx = float(((x[:-1] + x[1:]) * cross).sum()) / (3.0 * twice) + float(ring[0, 0])
    cy = float(((y[:-1] + y[1:]) * cross).sum()) / (3.0 * twice) + float(ring[0, 1])
    return 0.5 * abs(twice) * (-1.0 if hole else 1.0), cx, cy


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
