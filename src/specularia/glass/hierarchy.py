"""Bounds of a relief at several scales, packed with its heights into flat arrays for the tracer.

Time goes into fetching numbers from memory as much as into arithmetic, so bounds are small: single bytes, of
blocks of 4 x 4, 16 x 16, ... cells.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

__all__ = ["LEVELS", "STEP", "bounds", "pack", "steepest"]

LEVELS = 24
"""Room for levels in the layout: a relief has at most 2^23 cells along a side."""

STEP = 2
"""From one level that is kept to the next, blocks grow by 2^STEP along a side."""

_TOP = 254
"""The greatest height of a relief above its lowest one, in quanta of its bounds."""


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


def pack(
    reliefs: Sequence[NDArray[np.float32]],
) -> tuple[NDArray[np.float32], NDArray[np.uint8], NDArray[np.int64], NDArray[np.float64]]:
    """Heights and bounds of several reliefs one after the other.

    Parameters
    ----------
    reliefs : each [ny, nx], periodic, in um.

    Returns
    -------
    heights : of each relief, with the first row and column repeated after the last.
    bounds : seen from above (of heights) and from below (of negative heights), levels STEP, 2 STEP, ...; in
        quanta, rounded up.
    layout : [number of reliefs, 4 + 2 LEVELS]. Position of the heights, nx, ny, highest level kept; then the
        position of each level's bounds, first those from above, then those from below.
    quanta : [number of reliefs, 2, 2] for above and below (per, low): a height h is per * h - low quanta.
    """
    layout = np.zeros((len(reliefs), 4 + 2 * LEVELS), np.int64)
    quanta = np.zeros((len(reliefs), 2, 2))
    heights: list[NDArray[np.float32]] = []
    coarse: list[NDArray[np.uint8]] = []
    for row, units, relief in zip(layout, quanta, reliefs):
        ny, nx = relief.shape
        row[:3] = sum(h.size for h in heights), nx, ny
        heights.append(np.pad(relief, ((0, 1), (0, 1)), mode="wrap").ravel())
        for below, h in enumerate((relief, -relief)):
            low, high = float(h.min()), float(h.max())
            per = _TOP / (high - low) if high > low else 0.0
            units[below] = per, per * low
            levels = bounds(h)
            row[3] = (len(levels) - 1) // STEP * STEP
            for level in range(STEP, len(levels), STEP):
                row[4 + below * LEVELS + level] = sum(b.size for b in coarse)
                # A little more than the truth, since the tracer compares rounded numbers.
                part = np.ceil(per * levels[level].astype(float) - per * low + 1e-6)
                coarse.append(part.astype(np.uint8).ravel())
    return np.concatenate(heights), np.concatenate([*coarse, np.zeros(1, np.uint8)]), layout, quanta


def steepest(heights: NDArray[np.float32], *, pitch_x_um: float, pitch_y_um: float) -> float:
    """Greatest slope of the planes into which the cells of a periodic relief are cut (along 00-11)."""
    h = np.pad(heights.astype(float), ((0, 1), (0, 1)), mode="wrap")
    along_x = np.diff(h, axis=1) / pitch_x_um
    along_y = np.diff(h, axis=0) / pitch_y_um
    lower = along_x[:-1] ** 2 + along_y[:, 1:] ** 2
    upper = along_x[1:] ** 2 + along_y[:, :-1] ** 2
    return float(np.sqrt(max(lower.max(), upper.max())))
