"""Interpolation on grids whose lines need not be evenly spaced."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def bilinear(s: Array, t: Array, table: Array, x: Array, y: Array) -> Array:
    """Values of table [len(s), len(t)] at (x, y); carried on linearly beyond the ends."""
    i = np.clip(np.searchsorted(s, x, side="right") - 1, 0, s.size - 2)
    j = np.clip(np.searchsorted(t, y, side="right") - 1, 0, t.size - 2)
    p = (x - s[i]) / (s[i + 1] - s[i])
    q = (y - t[j]) / (t[j + 1] - t[j])
    low = (1 - q) * table[i, j] + q * table[i, j + 1]
    high = (1 - q) * table[i + 1, j] + q * table[i + 1, j + 1]
    return (1 - p) * low + p * high
