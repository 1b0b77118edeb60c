"""[[view]] and [[grid]]: how a room is looked at, and where illuminance is wanted by the square metre."""

from __future__ import annotations

from typing import Annotated, Any, Literal

import numpy as np
from pydantic import Field, field_validator, model_validator

from specularia.daylight._fields import Metres, Name, Vector, Wall, unit
from specularia.jobs import Job

__all__ = ["Grid", "View"]

Pixels = Annotated[int, Field(ge=8, le=4096)]


class View(Job):
    """[[view]]: a luminance picture."""

    name: Name = "view"
    kind: Literal["perspective", "fisheye", "plan"] = "perspective"
    """perspective; fisheye: the whole half space before the eye, angles from the middle to scale
    (equidistant, Radiance's -vta with 180 degrees); plan: straight down from just below the ceiling, in
    parallel, north at the top: the floor and what stands on it."""
    position_m: Vector | None = None
    """Of the eye; a plan takes none."""
    direction: Vector | None = None
    """Where the eye looks; any length; a plan takes none."""
    up: Vector = (0.0, 0.0, 1.0)
    horizontal_deg: Annotated[float, Field(gt=1.0, lt=170.0)] = 60.0
    """Of a perspective: full horizontal angle; the vertical one follows from square pixels."""
    size_px: tuple[Pixels, Pixels] = (240, 180)
    """Columns, rows. Left out: 240 x 180; a fisheye has 400 x 400, a plan 240 along its longer side. A plan
    is fitted into this size, with square pixels."""
    glare: bool | None = None
    """Of a fisheye: whether its discomfort glare (DGP) is worked out. Left out: yes."""

    _unit = field_validator("direction", "up")(lambda v: v if v is None else unit(v))

    @model_validator(mode="before")
    @classmethod
    def _size_of_its_kind(cls, data: Any) -> Any:
        if isinstance(data, dict) and "size_px" not in data:
            size = {"fisheye": (400, 400), "plan": (240, 240)}.get(data.get("kind", ""))
            return data if size is None else {**data, "size_px": size}
        return data

    @model_validator(mode="after")
    def _can_be(self) -> View:
        if self.kind == "plan":
            for key in ("position_m", "direction", "up", "horizontal_deg"):
                if key in self.model_fields_set:
                    raise ValueError(f"no {key} for a plan, which shows the whole floor from above")
        else:
            for key in ("position_m", "direction"):
                if getattr(self, key) is None:
                    raise ValueError(f"{key} of a {self.kind} view")
            if np.linalg.norm(np.cross(np.array(self.direction), self.up)) < 1e-3:
                raise ValueError("an up that is not along direction")
        if self.kind == "fisheye" and self.size_px[0] != self.size_px[1]:
            raise ValueError("as many rows as columns in the size_px of a fisheye")
        if self.glare and self.kind != "fisheye":
            raise ValueError("glare for views of kind fisheye only")
        return self

    @property
    def wants_glare(self) -> bool:
        """Whether DGP is worked out for this view."""
        return self.kind == "fisheye" and self.glare is not False


class Grid(Job):
    """[[grid]]: illuminance at the middles of equal cells of a horizontal plane, a face or any rectangle."""

    name: Name
    height_m: Annotated[float, Field(ge=0.0)] | None = None
    """A horizontal plane at this height above the floor, lit from above."""
    face: Wall | Literal["floor", "ceiling"] | None = None
    """A face of the room, lit from inside."""
    origin_m: Vector | None = None
    """A corner of a rectangle, with its two edges `along_m` and `across_m`; it is lit from the side of
    along x across."""
    along_m: Vector | None = None
    across_m: Vector | None = None
    margin_m: Annotated[float, Field(ge=0.0)] = 0.0
    """Of a plane or face: what is left out along its border."""
    spacing_m: Metres = 0.5
    """Largest distance of points."""

    @model_validator(mode="after")
    def _one_place(self) -> Grid:
        edges = (self.origin_m, self.along_m, self.across_m)
        ways = [self.height_m is not None, self.face is not None, any(e is not None for e in edges)]
        if sum(ways) != 1:
            raise ValueError("one of height_m, face, or origin_m with along_m and across_m")
        if ways[2]:
            if any(e is None for e in edges):
                raise ValueError("origin_m, along_m and across_m together")
            if self.margin_m:
                raise ValueError("no margin_m where origin_m, along_m and across_m are given")
            a, b = np.array(self.along_m), np.array(self.across_m)
            size = float(np.linalg.norm(a) * np.linalg.norm(b))
            if size < 1e-9 or abs(float(a @ b)) > 1e-3 * size:
                raise ValueError("along_m and across_m that are square to each other and not zero")
        return self
