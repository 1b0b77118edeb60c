"""The noise of a table, told from the table itself.

Around a point, a cubic surface is fitted to its nearest neighbours; what it leaves is noise. The
variances of points of like signal are then joined to a law of three terms,

    variance = floor^2 + counting |signal| + (relative signal)^2 ,

the noise of a detector in the dark, of counting, and of a gain or a source that fluctuates (ours).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from specularia.gonio.table import Array

__all__ = ["Noise", "estimate"]

_NEIGHBOURS = 22
"""Points of one fit, of which ten unknowns use up ten."""

_MOST = 4000
"""Fits that are made; more do not tell more."""

_BINS = 24
"""Classes of like signal."""

_FEWEST = 8
"""Fits that a class needs for a median."""


@dataclass(frozen=True)
class Noise:
    """Standard deviation of single values of a signal: floor, counting and relative part.

    >>> round(float(Noise(floor=0.3, counting=0.0, relative=0.01).variance(np.array(40.0))), 3)
    0.25
    """

    floor: float
    counting: float
    relative: float

    def variance(self, signal: Array) -> Array:
        """Of single values, in the square of the signal's unit."""
        return self.floor**2 + self.counting * np.abs(signal) + (self.relative * signal) ** 2


def estimate(
    x: Array, y: Array, values: Array, gain: Array, count: Array, *, signal: Array | None = None
) -> Noise:
    """Estimate the noise of a signal from the scatter of neighbouring points.

    Parameters
    ----------
    x, y : [P] places in a plane, no two the same.
    values : [P] of a function that is smooth there.
    gain : [P] what turns their noise into that of the signal; nearly constant among neighbours.
    count : [P] how many single values each one is the mean of.
    signal : [P] whose law is asked for; `values * gain`, as smoothed by the fits, where it is not given.

    Notes
    -----
    Medians over each class keep features that a cubic surface cannot follow, such as a peak between few
    points, from counting as noise.
    """
    from scipy.optimize import nnls
    from scipy.spatial import cKDTree

    size = x.size
    k = min(_NEIGHBOURS, size)
    if k < 12:
        return Noise(0.0, 0.0, 0.0)
    # An even stride through points that are sorted by place samples all of them alike.
    chosen = np.unique(np.linspace(0, size - 1, min(size, _MOST)).astype(np.intp))
    places = np.stack([x, y], axis=1)
    _, near = cKDTree(places).query(places[chosen], k=k)
    level, variance, freedom = _residuals(x, y, values, near)
    weight = count[near].mean(axis=1)
    variance = variance * gain[chosen] ** 2 * weight
    signal = np.abs(level * gain[chosen]) if signal is None else np.abs(signal[chosen])
    good = freedom > 0
    if not good.any():
        return Noise(0.0, 0.0, 0.0)
    variance, signal, freedom = variance[good], signal[good], freedom[good]

    order = np.argsort(signal)
    # The median of a mean of n squares lies below its mean (Wilson and Hilferty 1931).
    unbiased = variance / (1.0 - 2.0 / (9.0 * freedom)) ** 3
    # Classes of equal size, the topmost ones split further: a narrow peak is a small share of the points.
    bins = int(np.clip(order.size // (2 * _FEWEST), 1, _BINS))
    shares = np.concatenate(
        [np.linspace(0.0, 1.0, bins + 1)[:-1], 1.0 - (1.0 / bins) / 3.0 ** np.arange(1, 4), [1.0]]
    )
    edges = np.unique((shares * order.size).astype(np.intp))
    classes = [c for c in np.split(order, edges[1:-1]) if c.size >= min(_FEWEST, order.size)]
    classes = classes or [order]
    middle = np.array([np.median(unbiased[c]) for c in classes])
    level = np.array([np.median(signal[c]) for c in classes])
    top = float(signal.max())
    if top <= 0.0 or middle.max() <= (1e-9 * top) ** 2:
        return Noise(0.0, 0.0, 0.0)
    # Relative residuals, so that the faint classes count as much as the bright ones.
    scale = np.sqrt([c.size for c in classes]) / np.maximum(middle, (1e-9 * top) ** 2)
    terms = np.stack([np.full(level.size, top**2), level * top, level**2], axis=1)
    found, _ = nnls(terms * scale[:, None], middle * scale)
    return Noise(
        floor=float(np.sqrt(found[0]) * top),
        counting=float(found[1] * top),
        relative=float(np.sqrt(found[2])),
    )


def _residuals(x: Array, y: Array, values: Array, near: Array) -> tuple[Array, Array, Array]:
    """Level, variance and degrees of freedom of cubic fits to [n, k] neighbours, the centre first."""
    dx, dy = x[near] - x[near[:, :1]], y[near] - y[near[:, :1]]
    reach = np.maximum(np.hypot(dx, dy).max(axis=1, keepdims=True), 1e-12)
    dx, dy = dx / reach, dy / reach
    terms = np.stack([dx**i * dy**j for i in range(4) for j in range(4 - i)], axis=2)
    basis, strength, _ = np.linalg.svd(terms, full_matrices=False)
    # Neighbours on one circle or line leave some surfaces undetermined; those take no freedom.
    used = strength > 1e-5 * strength[:, :1]
    there = values[near]
    share = np.einsum("nki,nk->ni", basis, there) * used
    left = there - np.einsum("nki,ni->nk", basis, share)
    freedom = near.shape[1] - used.sum(axis=1)
    variance = (left**2).sum(axis=1) / np.maximum(freedom, 1)
    return there.mean(axis=1), variance, freedom
