"""Bubbles and inclusions in the glass: ellipsoids of revolution, as a list in a cell that repeats along the
pane, or by their statistics."""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal, Self

import numpy as np
from numpy.typing import NDArray

from specularia.errors import PhysicsError, SpeculariaWarning

__all__ = ["AIR", "BubbleKind", "Bubbles", "Inside", "sample_bubbles"]

Array = NDArray[np.float64]
Placing = Literal["cell", "free flight"]

COUNT = 1000
"""Bubbles wanted in a sampled cell: its sides are chosen between `CELL_MM` to hold about that many."""

CELL_MM = (2.0, 100.0)

COUNT_LIMIT = 50_000
"""More bubbles of a kind than this are not drawn into one cell: placing them takes the square of their
number."""

TRIES = 200
"""Places tried for one bubble before the glass counts as full."""


@dataclass(frozen=True)
class Inside:
    """What fills a bubble or an inclusion.

    Attributes
    ----------
    index : refractive index, 1 for air; None for that of the glass around it, which bends no light.
    absorption_per_mm : Napierian, >= 0; inf for an opaque body, which takes all light that meets it.
    """

    index: float | None = 1.0
    absorption_per_mm: float = 0.0

    def __post_init__(self) -> None:
        if self.index is not None and not 1.0 <= self.index < 5.0:
            raise PhysicsError(f"the index inside an inclusion lies between 1 and 5, not at {self.index}.")
        if not self.absorption_per_mm >= 0.0:
            raise PhysicsError(f"absorption_per_mm of an inclusion is >= 0, not {self.absorption_per_mm}.")

    @property
    def row(self) -> tuple[float, float]:
        """For the tracer: index (0 for that of the glass) and absorption in 1/um (-1 for opaque)."""
        opaque = np.isinf(self.absorption_per_mm)
        return self.index or 0.0, -1.0 if opaque else 1e-3 * self.absorption_per_mm


AIR = Inside()


@dataclass(frozen=True)
class Bubbles:
    """An explicit list of bubbles or inclusions.

    Attributes
    ----------
    centre_mm : [N, 3] in the slab's frame; z = 0 is half-way between the mean planes of the faces.
    long_mm, short_mm : [N] half axes, along the axis of revolution and across it, 0 < short <= long.
    axis : [N, 3] of the long half axis; any length but 0.
    cell_mm : the list repeats along x and y with these periods; a bubble is at most half as wide.
    inside : what fills them: [N] or one for all.

    Notes
    -----
    Bubbles that overlap are each a hollow of its own: light inside one does not notice the other.
    """

    centre_mm: Array
    long_mm: Array
    short_mm: Array
    axis: Array
    cell_mm: tuple[float, float]
    inside: tuple[Inside, ...] = (AIR,)

    def __post_init__(self) -> None:
        for name in ("centre_mm", "long_mm", "short_mm", "axis"):
            object.__setattr__(self, name, np.asarray(getattr(self, name), float))
        n = len(self.centre_mm)
        if self.centre_mm.shape != (n, 3) or self.axis.shape != (n, 3):
            raise PhysicsError("centres and axes of bubbles have the shape [N, 3].")
        if self.long_mm.shape != (n,) or self.short_mm.shape != (n,):
            raise PhysicsError("half axes of bubbles have the shape [N].")
        if len(self.inside) == 1:
            object.__setattr__(self, "inside", self.inside * n)
        if len(self.inside) != n:
            raise PhysicsError(f"{len(self.inside)} fillings for {n} bubbles.")
        length = np.linalg.norm(self.axis, axis=1)
        for name in ("centre_mm", "long_mm", "short_mm", "axis"):
            if not np.all(np.isfinite(getattr(self, name))):
                raise PhysicsError(f"{name} of the bubbles holds values that are not finite.")
        if not (np.all(self.short_mm > 0) and np.all(self.long_mm >= self.short_mm)):
            raise PhysicsError("half axes of bubbles must satisfy 0 < short <= long.")
        if not (np.all(length > 0) and min(self.cell_mm) > 0):
            raise PhysicsError("axes of bubbles must not vanish, and their cell must have a size.")
        object.__setattr__(self, "axis", self.axis / np.maximum(length, 1e-300)[:, None])
        if n and np.any(2 * self.reach_mm[:, :2] > 0.5 * np.asarray(self.cell_mm)):
            raise PhysicsError("a bubble is wider than half the cell in which the list repeats.")

    def __len__(self) -> int:
        return len(self.centre_mm)

    @property
    def reach_mm(self) -> Array:
        """[N, 3] half the extent of each bubble along x, y and z."""
        return np.sqrt(
            self.short_mm[:, None] ** 2 + (self.long_mm**2 - self.short_mm**2)[:, None] * self.axis**2
        )

    @property
    def volume_mm3(self) -> Array:
        """[N] volumes."""
        return 4.0 / 3.0 * np.pi * self.long_mm * self.short_mm**2

    def check_within(self, low_mm: float, high_mm: float) -> None:
        """Refuse bubbles that reach beyond low < z < high, the glass between the shells of relief."""
        z, reach = self.centre_mm[:, 2], self.reach_mm[:, 2]
        out = np.flatnonzero((z - reach <= low_mm) | (z + reach >= high_mm))
        if out.size:
            k = int(out[0])
            raise PhysicsError(
                f"{out.size} of {len(self)} bubbles reach beyond the glass between the reliefs, "
                f"{low_mm:.4g} to {high_mm:.4g} mm; number {k} spans {z[k] - reach[k]:.4g} to "
                f"{z[k] + reach[k]:.4g} mm. Move or remove them."
            )

    @classmethod
    def join(cls, parts: Sequence[Bubbles]) -> Self:
        """Several lists in one cell."""
        if len({p.cell_mm for p in parts}) != 1:
            raise PhysicsError("lists of bubbles can only be joined when they repeat with the same cell.")
        return cls(
            centre_mm=np.concatenate([p.centre_mm for p in parts]),
            long_mm=np.concatenate([p.long_mm for p in parts]),
            short_mm=np.concatenate([p.short_mm for p in parts]),
            axis=np.concatenate([p.axis for p in parts]),
            cell_mm=parts[0].cell_mm,
            inside=tuple(i for p in parts for i in p.inside),
        )

    def filled_with(self, inside: Inside) -> Self:
        """The same bodies with something else inside."""
        return replace(self, inside=(inside,) * len(self))


@dataclass(frozen=True)
class BubbleKind:
    """A kind of bubbles or inclusions by its statistics.

    Attributes
    ----------
    per_cm3 : number per volume of glass, > 0.
    median_mm, sigma : of the diameter d of the sphere of equal volume: ln d is normal, with mean ln(median)
        and standard deviation sigma >= 0.
    elongation : long axis over short axis, >= 1.
    axis : direction of the long axis.
    inside : what fills them.
    placing : "cell" draws a list of them, without overlap, into a cell that repeats. "free flight" draws
        those that a path meets along its way, independently for each way, from the same statistics: there is
        no cell, and the answer is the mean over all panes that the statistics describe.
    """

    per_cm3: float
    median_mm: float
    sigma: float = 0.0
    elongation: float = 1.0
    axis: tuple[float, float, float] = (0.0, 1.0, 0.0)
    inside: Inside = AIR
    placing: Placing = "cell"


def sample_bubbles(
    kinds: Sequence[BubbleKind],
    *,
    thickness_mm: float,
    low_mm: float,
    high_mm: float,
    seed: int,
    cell_mm: tuple[float, float] | None = None,
) -> Bubbles:
    """Draw bubbles of several kinds, placed at random without overlap (random sequential addition).

    Parameters
    ----------
    kinds : at least one. The number of each is per_cm3 times the volume of the cell, rounded.
    thickness_mm : of the pane, for its volume.
    low_mm, high_mm : every bubble lies wholly in low < z < high. A diameter too large for that, or for half
        the cell, is drawn again, with a warning that counts them.
    seed : of the draw.
    cell_mm : periods along x and y; None for a square that holds about `COUNT` bubbles.
    """
    if cell_mm is None:
        density = sum(k.per_cm3 for k in kinds) / 1000.0
        side = float(np.clip(np.sqrt(COUNT / (density * thickness_mm)), *CELL_MM))
        for k in kinds:
            large = k.median_mm * np.exp(4.0 * k.sigma) * k.elongation ** (2.0 / 3.0)
            side = max(side, 4.0 * min(large, (high_mm - low_mm) * k.elongation))
        cell_mm = (side, side)
    volume_cm3 = cell_mm[0] * cell_mm[1] * thickness_mm / 1000.0
    rng = np.random.default_rng([seed, 0xB0BB1E])
    parts, redrawn = [], 0
    for kind in kinds:
        count = round(kind.per_cm3 * volume_cm3)
        if count > COUNT_LIMIT:
            raise PhysicsError(
                f"a cell of {cell_mm[0]:g} x {cell_mm[1]:g} mm would hold {count} bubbles of one kind; "
                f"at most {COUNT_LIMIT} are drawn. Use a smaller cell."
            )
        axis = np.asarray(kind.axis, float) / np.linalg.norm(kind.axis)
        long, again = _sizes(kind, count, float(axis[2]), high_mm - low_mm, 0.5 * min(cell_mm), rng)
        redrawn += again
        short = long / kind.elongation
        reach = np.sqrt(short**2 + (long**2 - short**2) * axis[2] ** 2)
        parts.append((kind, axis, long, short, reach))
    if redrawn:
        warnings.warn(
            f"{redrawn} bubble diameters did not fit the glass between the reliefs and were drawn again.",
            SpeculariaWarning,
            stacklevel=2,
        )
    placed: list[Bubbles] = []
    for kind, axis, long, short, reach in parts:
        centres = _place(placed, kind, axis, long, short, reach, low_mm, high_mm, cell_mm, rng)
        axes = np.tile(axis, (len(long), 1))
        placed.append(Bubbles(centres, long, short, axes, cell_mm, (kind.inside,) * len(long)))
    return Bubbles.join(placed)


def _sizes(
    kind: BubbleKind, count: int, axis_z: float, high_mm: float, wide_mm: float, rng: np.random.Generator
) -> tuple[Array, int]:
    """Long half axes of a kind, and how many were drawn again because the bubble was too high or too wide."""
    long = np.empty(count)
    todo = np.arange(count)
    again = 0
    for _ in range(TRIES):
        diameter = kind.median_mm * np.exp(kind.sigma * rng.standard_normal(todo.size))
        # Volume of the spheroid: long * short^2 = (d / 2)^3 with short = long / elongation.
        long[todo] = 0.5 * diameter * kind.elongation ** (2.0 / 3.0)
        short = long[todo] / kind.elongation
        height = 2.0 * np.sqrt(short**2 + (long[todo] ** 2 - short**2) * axis_z**2)
        todo = todo[(height > 0.98 * high_mm) | (2.0 * long[todo] > wide_mm)]
        if todo.size == 0:
            return long, again
        again += todo.size
    raise PhysicsError(
        f"bubbles of median diameter {kind.median_mm:g} mm do not fit into {high_mm:.4g} mm of glass "
        f"and a cell of {2 * wide_mm:.4g} mm."
    )


def _place(
    placed: Sequence[Bubbles],
    kind: BubbleKind,
    axis: Array,
    long: Array,
    short: Array,
    reach: Array,
    low_mm: float,
    high_mm: float,
    cell_mm: tuple[float, float],
    rng: np.random.Generator,
) -> Array:
    """Centres [N, 3] without overlap, large bubbles first, rows in the order of `long`.

    Bubbles of one kind are compared in the space in which they are spheres, which is exact; those of
    different kinds by their enclosing spheres, which keeps them a little further apart than need be.
    """
    cell = np.array([*cell_mm, np.inf])
    others = np.concatenate([b.centre_mm for b in placed]) if placed else np.empty((0, 3))
    other_radius = np.concatenate([b.long_mm for b in placed]) if placed else np.empty(0)
    centres = np.empty((len(long), 3))
    order = np.argsort(-long)
    for done, k in enumerate(order):
        for _ in range(TRIES):
            p = rng.random(3) * [*cell_mm, high_mm - low_mm - 2 * reach[k]]
            p[2] += low_mm + reach[k]
            to_others = _nearest_image(others - p, cell)
            if np.any(np.sum(to_others**2, axis=1) < (other_radius + long[k]) ** 2):
                continue
            earlier = order[:done]
            way = _nearest_image(centres[earlier] - p, cell)
            along = way @ axis
            square = np.sum(way**2, axis=1) - along**2 + (along / kind.elongation) ** 2
            if np.any(square < (short[earlier] + short[k]) ** 2):
                continue
            centres[k] = p
            break
        else:
            raise PhysicsError(
                f"no room for bubble {done + 1} of {len(long)} without overlap; "
                "lower per_cm3 or the diameters."
            )
    return centres


def _nearest_image(way: Array, cell: Array) -> Array:
    """Ways [N, 3] to the nearest of all periodic images."""
    finite = np.where(np.isfinite(cell), cell, 1.0)
    return way - np.where(np.isfinite(cell), np.round(way / finite) * finite, 0.0)


def pack(bubbles: Bubbles | None) -> tuple[Array, NDArray[np.int64], NDArray[np.int64], Array]:
    """The arrays of the tracer, lengths in um.

    Returns
    -------
    matrices : [N, 11] centre, then xx, yy, zz, xy, xz, yz of M with |M (p - centre)| = 1 on the bubble's
        wall, and what is inside (`Inside.row`).
    first, member : cell c of a plane grid has the bubbles member[first[c]:first[c+1]] over it.
    grid : [4] cells along x and y, and their sizes.
    """
    if bubbles is None or len(bubbles) == 0:
        return np.empty((0, 11)), np.zeros(2, np.int64), np.zeros(0, np.int64), np.ones(4)
    n = len(bubbles)
    long, short, axis = 1e3 * bubbles.long_mm, 1e3 * bubbles.short_mm, bubbles.axis
    m = (1.0 / short)[:, None, None] * np.eye(3) + (1.0 / long - 1.0 / short)[:, None, None] * (
        axis[:, :, None] * axis[:, None, :]
    )
    matrices = np.column_stack(
        [
            1e3 * bubbles.centre_mm,
            m[:, 0, 0], m[:, 1, 1], m[:, 2, 2], m[:, 0, 1], m[:, 0, 2], m[:, 1, 2],
            np.array([i.row for i in bubbles.inside]),
        ]
    )  # fmt: skip
    # About one bubble to a cell, and cells no smaller than a typical bubble. Two along each side at least:
    # then only one image of a bubble, at most half a period wide, can reach over a cell.
    period = 1e3 * np.asarray(bubbles.cell_mm)
    reach = 1e3 * bubbles.reach_mm[:, :2]
    typical = 2.0 * float(np.median(reach))
    cells = np.clip(np.minimum(np.sqrt(n), period / typical).astype(int), 2, 1024)
    size = period / cells
    low = np.floor((matrices[:, :2] - reach) / size).astype(int)
    high = np.floor((matrices[:, :2] + reach) / size).astype(int)
    number: list[int] = []
    owner: list[int] = []
    for k in range(n):
        for j in range(low[k, 1], high[k, 1] + 1):
            for i in range(low[k, 0], high[k, 0] + 1):
                number.append((j % cells[1]) * int(cells[0]) + i % cells[0])
                owner.append(k)
    # A bubble wider than the grid has cells is listed once in each.
    pairs = np.unique(np.column_stack([number, owner]), axis=0)
    first = np.searchsorted(pairs[:, 0], np.arange(cells[0] * cells[1] + 1)).astype(np.int64)
    return (
        np.ascontiguousarray(matrices),
        first,
        np.ascontiguousarray(pairs[:, 1], dtype=np.int64),
        np.array([*cells, *size], float),
    )
