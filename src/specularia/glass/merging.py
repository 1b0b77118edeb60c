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
    weight : [n, n] sums over each cell of the weights of its paths, or [R, n, n] for each of R replicates.
    square : [n, n] sums over each cell of the squares of the weights.
    area : [n, n] extent of each cell, > 0, in the unit that the density shall be per.
    enough : effective number of paths, weight^2 / square, above which a block is divided.

    Returns
    -------
    density, error : [n, n] weight per area, constant over each block; the error comes from the spread of the
        replicates, or is that of counting where there are none. The largest blocks have LARGEST_BLOCK cells
        along a side, or fewer where n cannot be divided by it.
    """
    n = square.shape[0]
    # Sums over blocks of 1, 2, 4, ... cells along a side.
    sums = [(weight.reshape(-1, n, n), square, area)]
    while (1 << (len(sums) - 1)) < LARGEST_BLOCK and n % (1 << len(sums)) == 0:
        sums.append(tuple(_halved(v) for v in sums[-1]))  # type: ignore[arg-type]
    largest = len(sums) - 1
    density, error = np.zeros((n, n)), np.zeros((n, n))
    reached = np.ones((n >> largest, n >> largest), bool)
    for level in range(largest, -1, -1):
        size = 1 << level
        each, q, a = sums[level]
        w = each.sum(axis=0)
        divided = reached & (w * w > enough * q) if level > 0 else np.zeros_like(reached)
        here = _cells(reached & ~divided, size)
        spread = np.sqrt(len(each)) * each.std(axis=0, ddof=1) if len(each) > 1 else np.sqrt(q)
        density[here] = _cells(w / a, size)[here]
        error[here] = _cells(spread / a, size)[here]
        if level > 0:
            reached = _cells(divided, 2)
    return density, error


def _halved(values: Array) -> Array:
    """Sums over blocks of 2 x 2 cells of the last two axes."""
    rows = values[..., ::2, :] + values[..., 1::2, :]
    return rows[..., ::2] + rows[..., 1::2]


def _cells(values: NDArray[np.generic], size: int) -> NDArray[np.generic]:
    """Each block's value on all its cells."""
    return np.repeat(np.repeat(values, size, axis=0), size, axis=1)
