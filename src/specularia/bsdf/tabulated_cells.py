"""Cells of the two tables of an incident direction: where they lie, what solid angle they stand for."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from specularia.bsdf.model import Array
from specularia.conventions import square_to_disk

__all__ = ["fill_beyond_horizon", "quadrature_cells"]

_LEAST = 128
"""Cells along each edge that light is summed over, at least."""

_SUB = (np.arange(4) + 0.5) / 4 - 0.5


def fill_beyond_horizon(patch: NDArray[np.float32], s: float, half_width: float) -> NDArray[np.float32]:
    """Cells whose centre lies beyond the horizon take the value at the horizon below them.

    Interpolation just inside the horizon then does not mix in an arbitrary zero.
    """
    m = patch.shape[0]
    cell = 2 * half_width / m
    offset = (np.arange(m) + 0.5) * cell - half_width
    x, y = np.meshgrid(offset - s, offset, indexing="ij")
    r = np.hypot(x, y)
    outside = r > 1.0
    if not outside.any():
        return patch
    pull = (1.0 - 0.75 * cell) / np.maximum(r, 1e-9)
    i = np.clip(((x * pull + s + half_width) / cell).astype(int), 0, m - 1)
    j = np.clip(((y * pull + half_width) / cell).astype(int), 0, m - 1)
    return np.where(outside, patch[i, j], patch).astype(np.float32)


def quadrature_cells(s: float, n: int, m: int, half_width: float) -> tuple[Array, Array, Array]:
    """Centres and projected solid angles of both tables' cells; cut cells count with their inner share.

    Tables of fewer than `_LEAST` cells along an edge, n of the whole or m of the fine one, bend between the
    centres of their cells and are taken at more places.
    """
    n, m = max(n, _LEAST), max(m, _LEAST)
    k = (np.arange(n) + 0.5) / n
    a, b = (v.ravel() for v in np.meshgrid(k, k, indexing="ij"))
    x, y = square_to_disk(a, b)
    # A base cell is at most 4/n wide; only those near the border of the patch can be cut by it.
    reach = np.maximum(np.abs(x + s), np.abs(y)) - half_width
    weight = np.where(reach > 0, np.pi / n**2, 0.0)
    near = np.flatnonzero(np.abs(reach) < 4.0 / n)
    da, db = (v.ravel() / n for v in np.meshgrid(_SUB, _SUB, indexing="ij"))
    sx, sy = square_to_disk(a[near, None] + da, b[near, None] + db)
    free = (np.abs(sx + s) > half_width) | (np.abs(sy) > half_width)
    x, y, weight = _cut(x, y, weight, near, sx, sy, free, np.pi / n**2)

    cell = 2 * half_width / m
    offset = (np.arange(m) + 0.5) * cell - half_width
    px, py = (v.ravel() for v in np.meshgrid(offset - s, offset, indexing="ij"))
    depth = 1.0 - np.hypot(px, py)
    share = np.where(depth > 0, cell**2, 0.0)
    rim = np.flatnonzero(np.abs(depth) < cell)
    dx, dy = (v.ravel() * cell for v in np.meshgrid(_SUB, _SUB, indexing="ij"))
    rx, ry = px[rim, None] + dx, py[rim, None] + dy
    px, py, share = _cut(px, py, share, rim, rx, ry, rx * rx + ry * ry <= 1.0, cell**2)

    x, y, weight = np.concatenate([x, px]), np.concatenate([y, py]), np.concatenate([weight, share])
    kept = weight > 0
    return x[kept], y[kept], weight[kept] * (np.pi / weight.sum())


def _cut(
    x: Array, y: Array, weight: Array, which: NDArray[np.intp], sx: Array, sy: Array, inside: Any, area: float
) -> tuple[Array, Array, Array]:
    """Move cut cells to the centre of their inner part and weigh them with its share."""
    count = inside.sum(axis=1)
    some = np.maximum(count, 1)
    x[which] = np.where(count > 0, (sx * inside).sum(axis=1) / some, x[which])
    y[which] = np.where(count > 0, (sy * inside).sum(axis=1) / some, y[which])
    weight[which] = area * count / inside.shape[1]
    return x, y, weight
