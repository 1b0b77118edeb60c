"""Kinds of values that the tables of ROOM.toml and FRAGMENT.toml share."""

from __future__ import annotations

from typing import Annotated, Literal

import numpy as np
from pydantic import Field

__all__ = ["Metres", "Name", "Shade", "Share", "Vector", "Wall", "unit"]

Wall = Literal["south", "north", "west", "east"]
Share = Annotated[float, Field(ge=0.0, lt=1.0)]
Shade = Share | tuple[Share, Share, Share]
"""A reflectance: grey, or linear R, G and B in Radiance's primaries."""
Metres = Annotated[float, Field(gt=0.0, le=1000.0)]
Name = Annotated[str, Field(min_length=1, max_length=80)]
Vector = tuple[float, float, float]


def unit(value: Vector) -> Vector:
    """The direction with length one; a ValueError for one that has none."""
    length = float(np.linalg.norm(value))
    if not np.isfinite(length) or length < 1e-9:
        raise ValueError("a direction, three numbers that are not all zero")
    x, y, z = (float(v) / length for v in value)
    return x, y, z
