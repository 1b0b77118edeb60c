"""A pane of finite size: what a sample, or a box in a ray tracer, loses through its sides."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, get_args

import numpy as np
from numpy.typing import NDArray

from specularia.errors import PhysicsError
from specularia.glass import kernel

__all__ = ["Patch", "Sides"]

Sides = Literal["absorbing", "clear", "reflecting"]

_CODES = {"absorbing": kernel.ABSORBING, "clear": kernel.CLEAR, "reflecting": kernel.REFLECTING}


@dataclass(frozen=True)
class Patch:
    """A square pane with upright plane sides.

    Attributes
    ----------
    width_mm : of its sides along x and y, > 0. The reliefs go on repeating up to the sides.
    sides : what becomes of light in the glass that meets a side. "absorbing" takes it, and it counts as
        absorbed. "clear" sides are polished glass: what they let out is missing from transmission, reflection
        and absorption alike, as from the open box of a ray tracer. "reflecting" ones are perfect mirrors.
    lit_mm : side of the square on which light falls, in the middle; None for the whole patch.
    centre_mm : (x, y) of the middle, in the slab's frame.
    """

    width_mm: float
    sides: Sides = "clear"
    lit_mm: float | None = None
    centre_mm: tuple[float, float] = (0.0, 0.0)

    def __post_init__(self) -> None:
        if not 0.0 < self.width_mm < float("inf"):
            raise PhysicsError(f"the width of a patch must be positive, not {self.width_mm} mm.")
        if self.sides not in get_args(Sides):
            raise PhysicsError(f"sides are {', '.join(get_args(Sides))}, not {self.sides!r}.")
        if self.lit_mm is not None and not 0.0 < self.lit_mm <= self.width_mm:
            raise PhysicsError(
                f"the lit square, {self.lit_mm} mm, lies within the patch of {self.width_mm} mm."
            )

    @property
    def row(self) -> NDArray[np.float64]:
        """[8] for the tracer, in um: sides, lowest and highest x, lowest and highest y, then corner (x, y)
        and width of the lit square."""
        x, y = 1e3 * self.centre_mm[0], 1e3 * self.centre_mm[1]
        half = 500.0 * self.width_mm
        lit = 1e3 * (self.width_mm if self.lit_mm is None else self.lit_mm)
        corners = [x - half, x + half, y - half, y + half, x - 0.5 * lit, y - 0.5 * lit, lit]
        return np.array([_CODES[self.sides], *corners], float)
