"""Intervals of shares: Wilson's for counts, a bootstrap over rows for weights and what is made of them."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

__all__ = ["REPLICATES", "Resampled", "wilson"]

Array = NDArray[np.float64]

REPLICATES = 1000
"""Times that the rows are drawn anew, with replacement."""

_DRAWN = 20_000_000
"""Rows drawn altogether at most: tables of more than 20,000 rows need fewer times for the same digits."""


def wilson(count: int, total: int, *, level: float = 0.95) -> tuple[float, float]:
    """Interval of a share, each of the `total` being drawn by itself.

    Parameters
    ----------
    count, total : 0 <= count <= total, total > 0.
    level : probability that the interval holds the share.

    References
    ----------
    E. B. Wilson, J. Am. Stat. Assoc. 22 (1927) 209, doi:10.1080/01621459.1927.10502953.

    Examples
    --------
    >>> low, high = wilson(5, 10)
    >>> round(low, 4), round(high, 4)
    (0.2366, 0.7634)
    """
    from statistics import NormalDist

    z = NormalDist().inv_cdf(0.5 + level / 2.0)
    share, extra = count / total, z * z / total
    middle = (share + extra / 2.0) / (1.0 + extra)
    half = z / (1.0 + extra) * math.sqrt(share * (1.0 - share) / total + extra / (4.0 * total))
    # Without this, rounding lets the end stand a hair off 0 or 1 where it belongs there.
    return (0.0 if count == 0 else middle - half), (1.0 if count == total else middle + half)


class Resampled:
    """Rows of a table drawn anew with replacement, again and again (Efron's bootstrap).

    Rows stand for bags: fragments of one bag were found together and are kept together.

    Parameters
    ----------
    n : rows of the table.
    seed : of the draws; the same seed, the same intervals.
    replicates : times that they are drawn; None takes `REPLICATES`, or fewer for tables of many rows.

    References
    ----------
    B. Efron, Ann. Stat. 7 (1979) 1, doi:10.1214/aos/1176344552.
    """

    def __init__(self, n: int, *, seed: int = 0, replicates: int | None = None) -> None:
        self.n, self.seed = n, seed
        self.replicates = replicates or int(np.clip(_DRAWN // max(n, 1), 200, REPLICATES))

    def sums(self, columns: Sequence[tuple[NDArray[np.intp], int, Array]]) -> list[Array]:
        """Sums per group in each replicate.

        Parameters
        ----------
        columns : (group of each row [n], number of groups, value of each row [n]) for each sum.

        Returns
        -------
        an array [replicates, groups] for each; all from the same draws.
        """
        rng = np.random.default_rng([self.seed, self.n])
        out = [np.empty((self.replicates, groups)) for _, groups, _ in columns]
        for r in range(self.replicates):
            times = np.bincount(rng.integers(0, self.n, self.n), minlength=self.n)
            for found, (group, groups, value) in zip(out, columns):
                found[r] = np.bincount(group, weights=times * value, minlength=groups)
        return out

    @staticmethod
    def ends(values: ArrayLike, *, level: float = 0.95) -> tuple[Array, Array]:
        """Percentiles over the first axis that hold the probability `level` between them; NaN is left out."""
        found = np.asarray(values, float)
        if not np.isfinite(found).any():
            nothing = np.full(found.shape[1:], np.nan)
            return nothing, nothing
        low, high = np.nanpercentile(found, [50 * (1 - level), 50 * (1 + level)], axis=0)
        return low, high
