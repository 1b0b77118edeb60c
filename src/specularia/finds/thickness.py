"""Distribution of the thickness of the glass."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from specularia.finds.intervals import Resampled

__all__ = ["Thickness", "thickness"]

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Thickness:
    """How thick the measured fragments are.

    Parameters
    ----------
    measured_count : fragments in rows with a thickness.
    mean_mm, mean_low_mm, mean_high_mm : mean over fragments with its 95 % interval (bootstrap over rows).
    sd_mm : standard deviation.
    quantiles_mm : thickness below which 5, 25, 50, 75 and 95 % of the fragments lie.
    edges_mm : [B + 1] bounds of classes; a class holds its lower end.
    count : [B] fragments in each.
    """

    measured_count: int
    mean_mm: float
    mean_low_mm: float
    mean_high_mm: float
    sd_mm: float
    quantiles_mm: tuple[float, ...]
    edges_mm: Array
    count: NDArray[np.int64]


def thickness(
    thickness_mm: Array, count: NDArray[np.int64], resampled: Resampled, *, width_mm: float = 0.2
) -> Thickness | None:
    """The distribution over fragments; each of a row has the row's thickness. None where none was measured.

    Parameters
    ----------
    thickness_mm : [N] millimetres, NaN where not measured.
    count : [N] fragments.
    resampled : draws of the rows, for the interval of the mean.
    width_mm : of the classes.
    """
    known = np.isfinite(thickness_mm)
    if not known.any():
        return None
    t, n = thickness_mm[known], count[known]
    total = int(n.sum())
    mean = float(np.sum(t * n) / total)
    all_n = np.where(known, count, 0).astype(float)
    one = np.zeros(len(count), np.intp)
    above, below = resampled.sums([(one, 1, np.where(known, thickness_mm, 0.0) * all_n), (one, 1, all_n)])
    with np.errstate(divide="ignore", invalid="ignore"):
        low, high = Resampled.ends((above / below)[:, 0])
    order = np.argsort(t)
    reached = np.cumsum(n[order]) / total
    at = np.minimum(np.searchsorted(reached, [0.05, 0.25, 0.5, 0.75, 0.95]), t.size - 1)
    # Half a millionth of a class lets 2.8 / 0.2, which is 14 less a rounding, stand in the class it begins.
    place = np.floor(t / width_mm + 5e-7).astype(int)
    first = int(place.min())
    counts = np.bincount(place - first, weights=n).astype(np.int64)
    return Thickness(
        measured_count=total,
        mean_mm=mean,
        mean_low_mm=float(low),
        mean_high_mm=float(high),
        sd_mm=float(np.sqrt(np.sum(n * (t - mean) ** 2) / max(total - 1, 1))),
        quantiles_mm=tuple(float(v) for v in t[order][at]),
        edges_mm=np.asarray((first + np.arange(counts.size + 1)) * width_mm, float),
        count=counts,
    )
