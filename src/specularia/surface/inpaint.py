"""Heights interpolated into holes: plain arrays in, plain arrays out."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

__all__ = ["soap_film"]

Array = NDArray[np.float64]


def soap_film(heights: Array, *, pitch_x: float = 1.0, pitch_y: float = 1.0) -> Array:
    """Fill NaN by the solution of Laplace's equation; measured pixels are kept to the last bit.

    Parameters
    ----------
    heights : [rows, columns], at least one finite value.
    pitch_x, pitch_y : grid spacings, any one unit.

    Returns
    -------
    array : same shape. At the border of the map the film meets it squarely (no flux). The five-point scheme
        keeps every filled value between the lowest and the highest of the measured values around its hole.
    """
    from scipy import sparse
    from scipy.sparse.linalg import cg, spsolve

    hole = ~np.isfinite(heights)
    n = int(np.count_nonzero(hole))
    if n == 0:
        return heights.copy()
    rows, columns = heights.shape
    index = np.full(heights.shape, -1, dtype=np.int64)
    index[hole] = np.arange(n)
    diagonal, right = np.zeros(n), np.zeros(n)
    i_all, j_all, v_all = [], [], []
    r, c = np.nonzero(hole)
    weight_x, weight_y = 1.0, (pitch_x / pitch_y) ** 2 if pitch_y > 0 else 0.0
    for dr, dc, weight in ((0, 1, weight_x), (0, -1, weight_x), (1, 0, weight_y), (-1, 0, weight_y)):
        rr, cc = r + dr, c + dc
        inside = (rr >= 0) & (rr < rows) & (cc >= 0) & (cc < columns)
        k = np.nonzero(inside)[0]
        rr, cc = rr[k], cc[k]
        diagonal[k] += weight
        neighbour = index[rr, cc]
        known = neighbour < 0
        right[k[known]] += weight * heights[rr[known], cc[known]]
        i_all.append(k[~known])
        j_all.append(neighbour[~known])
        v_all.append(np.full(np.count_nonzero(~known), -weight))
    i_all.append(np.arange(n))
    j_all.append(np.arange(n))
    v_all.append(diagonal)
    matrix = sparse.csr_matrix(
        (np.concatenate(v_all), (np.concatenate(i_all), np.concatenate(j_all))), shape=(n, n)
    )
    if n <= 500_000:
        film = spsolve(matrix.tocsc(), right)
    else:
        # A direct factorisation of more unknowns takes gigabytes; the matrix is symmetric and positive.
        start = np.full(n, float(np.mean(heights[~hole])))
        film, _ = cg(matrix, right, x0=start, rtol=1e-8, M=sparse.diags(1.0 / diagonal), maxiter=20_000)
    out = heights.copy()
    out[hole] = film
    return out
