"""Cells of a tree of rank 4 merged into larger ones where that moves little light."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from specularia.bsdf import _rank4_kernel as kernel
from specularia.bsdf.model import Array
from specularia.bsdf.tensor_tree import TensorTree

__all__ = ["TOLERANCE", "Reduced", "reduced"]

TOLERANCE = 0.02
"""Share of the light that reduction may put elsewhere, over all incident cells, unless told otherwise."""
_TAU_KEPT = 2e-3
_ATTEMPTS = 8


@dataclass(frozen=True)
class Reduced:
    """A reduced tree.

    Attributes
    ----------
    tree : the tree.
    tau : [n, n] what the outgoing cells of each incident cell add up to.
    l1 : [n, n] integral of |tree - cells| over projected solid angle, over what the cells add up to.
    removed : share of the cells that are gone, 0 to 1.
    """

    tree: TensorTree
    tau: Array
    l1: Array
    removed: float


@dataclass(frozen=True)
class _Pyramid:
    """Cells with the means of blocks of 2^k along each edge, k = 1, 2, ..., one after another."""

    cells: NDArray[np.float32]
    means: NDArray[np.float32]
    offset: NDArray[np.int64]

    def level(self, flat: NDArray[np.generic], k: int) -> NDArray[np.generic]:
        """One level of a flat array as [i, j, a, b]."""
        shape = tuple(s >> k for s in self.cells.shape)
        return flat[self.offset[k] : self.offset[k] + int(np.prod(shape))].reshape(shape)


def _pyramid(cells: NDArray[np.float32]) -> _Pyramid:
    levels, offset = [], [0, 0]
    fine = cells
    while fine.shape[0] > 1 and fine.shape[2] > 2:
        fine = kernel.block_means(fine)
        levels.append(fine.ravel())
        offset.append(offset[-1] + fine.size)
    return _Pyramid(cells, np.concatenate(levels), np.array(offset[:-1], np.int64))


def _quarters(part: Array) -> Array:
    """Sums over the stored quarter of incident cells, [n, n], made sums over all four of them."""
    return np.sum([np.rot90(part, k) for k in range(4)], axis=0)


def reduced(
    cells: NDArray[np.float32],
    rows: Array,
    columns: Array,
    *,
    cull: float | None = None,
    tolerance: float = TOLERANCE,
) -> Reduced:
    """Merge blocks of cells where that moves least light, and keep what rows and columns add up to.

    Cells that no merge has touched make up for what merging shifts between incident cells, and between
    outgoing ones. Where the incident cells of a block differ in what they let through, and too little of
    their light is left untouched, it counts more, and the merging is chosen again.

    Parameters
    ----------
    cells : [i, j, a, b] in 1/sr; the whole, or the quarter i, j >= n / 2 of an isotropic sample.
    rows, columns : [n, n] sums over outgoing and over incident cells, times the projected solid angle of one.
    cull : percentage of the cells to remove; None removes as many as `tolerance` allows.
    tolerance : largest integral of |reduced - cells| over rows, as a mean over the incident cells.
    """
    n = cells.shape[2]
    quarter = cells.shape[0] < n
    area = np.pi / n**2
    tau = rows[n // 2 :, n // 2 :] if quarter else rows
    floor = np.maximum(tau, 1e-3 * max(float(tau.max()), 1e-12))
    pyramid = _pyramid(cells)
    importance, limit = np.ones(tau.shape), tolerance
    for _ in range(_ATTEMPTS):
        scale = (importance * area / floor / tau.size).astype(np.float32)
        costs = [
            kernel.merge_costs(cells, pyramid.level(pyramid.means, k), k, scale)
            for k in range(1, pyramid.offset.size)
        ]
        merged, left = _merged(costs, cells.size, cull=cull, tolerance=limit)
        level = kernel.largest_merged(cells, merged, pyramid.offset)
        row, column, total = _kept(pyramid, level, rows=tau, columns=columns)
        l1 = kernel.light_moved(cells, pyramid.means, pyramid.offset, level, row, column) * area / floor
        off = np.abs(total - tau) / floor
        enough = cull is not None or l1.mean() <= tolerance
        if off.max() <= _TAU_KEPT and enough:
            break
        importance[off > _TAU_KEPT] *= 4.0
        if not enough:
            limit *= 0.97 * tolerance / float(l1.mean())
    tree = _tree(pyramid, level, row, column)
    if quarter:
        total, l1 = _everywhere(total), _everywhere(l1)
    return Reduced(tree=tree, tau=total, l1=l1, removed=1.0 - left / cells.size)


def _everywhere(quarter: Array) -> Array:
    """Values of the incident quarter i, j >= n / 2, turned into the other three."""
    h = quarter.shape[0]
    out = np.empty((2 * h, 2 * h))
    out[h:, h:] = quarter
    out[:h, h:] = np.rot90(quarter, 1)
    out[:h, :h] = np.rot90(quarter, 2)
    out[h:, :h] = np.rot90(quarter, 3)
    return out


def _merged(
    costs: list[NDArray[np.float32]], size: int, *, cull: float | None, tolerance: float
) -> tuple[NDArray[np.uint8], int]:
    """Choices of all levels, one after another, and the number of leaves."""

    def attempt(price: float) -> tuple[list[NDArray[np.uint8]], int, float]:
        none = np.zeros((0, 0, 0, 0), np.float32)
        best, leaves, moved = none, none.astype(np.int32), none
        chosen = []
        for cost in costs:
            choice, best, leaves, moved = kernel.choose(cost, best, leaves, moved, np.float32(price))
            chosen.append(choice)
        return chosen, int(leaves.sum(dtype=np.int64)), float(moved.sum(dtype=float))

    low, high = -13.0, 0.0
    for _ in range(14):
        middle = 0.5 * (low + high)
        _, left, light = attempt(10.0**middle)
        fits = light <= tolerance if cull is None else left >= (1.0 - cull / 100.0) * size
        low, high = (middle, high) if fits else (low, middle)
    chosen, left, _ = attempt(10.0**low)
    return np.concatenate([c.ravel() for c in chosen]), left


def _kept(
    pyramid: _Pyramid, level: NDArray[np.uint8], *, rows: Array, columns: Array
) -> tuple[Array, Array, Array]:
    """Factors for the cells that no merge has touched, by row and by column, and what rows then add up to."""
    cells, means, offset = pyramid.cells, pyramid.means, pyramid.offset
    n = cells.shape[2]
    area = np.pi / n**2
    row, column = np.ones(cells.shape[:2]), np.ones((n, n))

    def factor(wanted: Array, free: Array, rest: Array) -> Array:
        can = free * area > 0.02 * wanted
        return np.where(can, (wanted / area - rest) / np.where(can, free, 1.0), 1.0).clip(0.8, 1.25)

    for _ in range(4):
        free, rest = kernel.column_sums(cells, means, offset, level, row)
        if cells.shape[0] < n:
            free, rest = _quarters(free), _quarters(rest)
        column = factor(columns, free, rest)
        free, rest = kernel.row_sums(cells, means, offset, level, column)
        row = factor(rows, free, rest)
    return row, column, area * (row * free + rest)


def _tree(pyramid: _Pyramid, level: NDArray[np.uint8], row: Array, column: Array) -> TensorTree:
    """Leaves and grids in the order in which they are written."""
    low, high = [level.ravel()], [level.ravel()]
    least = most = level
    while least.shape[0] > 1 and least.shape[2] > 2:
        least, most = kernel.extremes(least, most)
        low.append(least.ravel())
        high.append(most.ravel())
    fixed = (
        pyramid.cells,
        pyramid.means,
        np.concatenate(low),
        np.concatenate(high),
        pyramid.offset,
        row,
        column,
    )
    nothing = np.zeros(0, np.int8), np.zeros(0, np.int64), np.zeros(0, np.int32), np.zeros(0, np.float32)
    nodes, children, filled = kernel.emit(*fixed, *nothing)
    log2, start = np.empty(nodes, np.int8), np.empty(nodes, np.int64)
    child, values = np.empty(children, np.int32), np.empty(filled, np.float32)
    kernel.emit(*fixed, log2, start, child, values)
    return TensorTree(rank=4, log2=log2, start=start, child=child, values=values)
