"""Cells that caught too few paths share what they caught with their neighbours.

A histogram of traced paths is exact on average but speckled where light is weak. As in a quadtree, a square
block of cells is divided only while it holds enough paths; what stays together shows its mean. Every block
keeps its light, so tau is untouched, and lobes keep their resolution because there are paths enough (ours).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

__all__ = ["ENOUGH", "LARGEST_BLOCK", "merge_sparse"]

Array = NDArray[np.float64]

ENOUGH = 64.0
"""Paths (of equal weight) above which a block is divided, so that most are known to some 12 to 25 %."""

LARGEST_BLOCK = 32
"""Cells along the side of the largest block."""


def merge_sparse(weight: Array, square: Array, area: Array, *, enough: float = ENOUGH) -> tuple[Array, Array]:
    """Density of binned paths, cells merged where they caught few, and its standard error.

    Parameters
    ----------
    weight, square : [n, n] sums over each cell of the weights of its paths and of their squares.
    area : [n, n] extent of each cell, > 0, in the unit that the density shall be per.
    enough : effective number of paths, weight^2 / square, above which a block is divided.

    Returns
    -------
    density, error : [n, n] weight per area, constant over each block; the error is that of counting. The
        largest blocks have LARGEST_BLOCK cells along a side, or fewer where n cannot be divided by it.
    """
    n = weight.shape[0]
    largest = 0
    while (1 << largest) < LARGEST_BLOCK and n % (2 << largest) == 0:
        largest += 1
    density, error = np.zeros((n, n)), np.zeros((n, n))
    reached = np.ones((n >> largest, n >> largest), bool)
    for level in range(largest, -1, -1):
        size = 1 << level
        w, q, a = (_blocks(v, size) for v in (weight, square, area))
        divided = reached & (w * w > enough * q) if level > 0 else np.zeros_like(reached)
        here = _cells(reached & ~divided, size)
        density[here] = _cells(w / a, size)[here]
        error[here] = _cells(np.sqrt(q) / a, size)[here]
        if level > 0:
            reached = _cells(divided, 2)
    return density, error


def _blocks(values: Array, size: int) -> Array:
    """Sums over blocks of size x size cells."""
    k = values.shape[0] // size
    return values.reshape(k, size, k, size).sum(axis=(1, 3))


def _cells(values: NDArray[np.generic], size: int) -> NDArray[np.generic]:
    """Each block's value on all its cells."""
    return np.repeat(np.repeat(values, size, axis=0), size, axis=1)
