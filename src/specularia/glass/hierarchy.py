"""Bounds of a relief at all scales, packed with its heights into flat arrays for the tracer."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

__all__ = ["LEVELS", "bounds", "pack", "steepest"]

LEVELS = 24
"""Room for levels in the layout: a relief has at most 2^23 cells along a side."""


def bounds(heights: NDArray[np.float32]) -> list[NDArray[np.float32]]:
    """Greatest heights over blocks of 1, 2, 4, ... cells of a periodic relief.

    Parameters
    ----------
    heights : [ny, nx] samples at the corners of the cells. Cell (i, j) lies between rows i and i + 1, columns
        j and j + 1; the last row and column go on to the first.

    Returns
    -------
    levels : level l holds [ceil(ny / 2^l), ceil(nx / 2^l)] values; the last level has one. Blocks at the far
        sides are smaller where the sides are no powers of two.
    """
    m = np.maximum(heights, np.roll(heights, -1, axis=0))
    levels = [np.maximum(m, np.roll(m, -1, axis=1))]
    while levels[-1].size > 1:
        m = levels[-1]
        m = np.pad(m, ((0, m.shape[0] % 2), (0, m.shape[1] % 2)), mode="edge")
        levels.append(
            np.maximum(np.maximum(m[::2, ::2], m[1::2, ::2]), np.maximum(m[::2, 1::2], m[1::2, 1::2]))
        )
    return levels


def pack(reliefs: Sequence[NDArray[np.float32]]) -> tuple[NDArray[np.float32], NDArray[np.int64]]:
    """Heights and bounds of several reliefs one after the other.

    Parameters
    ----------
    reliefs : each [ny, nx], periodic, in um.

    Returns
    -------
    values : heights of each relief with the first row and column repeated after the last, then the bounds
        seen from above (greatest heights) and from below (greatest negative heights), levels 1 and up.
    layout : [number of reliefs, 4 + 2 LEVELS]. Position of the heights, nx, ny, highest level; then the
        position of each level's bounds, first those from above, then those from below.
    """
    parts: list[NDArray[np.float32]] = []
    layout = np.zeros((len(reliefs), 4 + 2 * LEVELS), np.int64)
    position = 0

    def append(values: NDArray[np.float32]) -> int:
        nonlocal position
        start = position
        parts.append(values.ravel())
        position += values.size
        return start

    for row, heights in zip(layout, reliefs):
        ny, nx = heights.shape
        row[:3] = append(np.pad(heights, ((0, 1), (0, 1)), mode="wrap")), nx, ny
        for below, h in enumerate((heights, -heights)):
            levels = bounds(h)
            row[3] = len(levels) - 1
            for level in range(1, len(levels)):
                row[4 + below * LEVELS + level] = append(levels[level])
    return np.concatenate(parts), layout


def steepest(heights: NDArray[np.float32], *, pitch_x_um: float, pitch_y_um: float) -> float:
    """Greatest slope of the planes into which the cells of a periodic relief are cut (along 00-11)."""
    h = np.pad(heights.astype(float), ((0, 1), (0, 1)), mode="wrap")
    along_x = np.diff(h, axis=1) / pitch_x_um
    along_y = np.diff(h, axis=0) / pitch_y_um
    lower = along_x[:-1] ** 2 + along_y[:, 1:] ** 2
    upper = along_x[1:] ** 2 + along_y[:, :-1] ** 2
    return float(np.sqrt(max(lower.max(), upper.max())))
