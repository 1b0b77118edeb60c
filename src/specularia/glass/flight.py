"""Bubbles met in free flight: the tables from which the tracer draws them along each way."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from specularia.errors import PhysicsError
from specularia.glass.bubbles import BubbleKind

__all__ = ["HIGHEST", "pack"]

Array = NDArray[np.float64]

HIGHEST = 0.98
"""Height of the largest bubble over that of the glass between the shells, as where a list is drawn."""

QUANTILES = 1024


def pack(
    kinds: Sequence[BubbleKind], *, thickness_mm: float, low_mm: float, high_mm: float
) -> tuple[Array, Array]:
    """Tables of the tracer, lengths in um.

    The bubbles of a kind are as many as `sample_bubbles` draws: per_cm3 times the volume of the pane between
    its mean planes, each anywhere where it lies wholly in low < z < high. Those of diameter D and height r D
    therefore stand c / (high - low - r D) to a volume, c their number per area, and rays meet them in
    proportion to D^2 / (high - low - r D).

    Returns
    -------
    kinds : [K, 9] sum of D^2 per volume in 1/um, elongation, axis, low, high, what is inside (`Inside.row`).
    sizes : [K, Q] quantiles of D among the bubbles that rays meet.
    """
    room = 1e3 * (high_mm - low_mm)
    rows, sizes = np.empty((len(kinds), 9)), np.empty((len(kinds), QUANTILES + 1))
    for k, kind in enumerate(kinds):
        axis = np.asarray(kind.axis, float) / np.linalg.norm(kind.axis)
        # Half axes and height of a bubble of diameter 1.
        long = 0.5 * kind.elongation ** (2.0 / 3.0)
        short = long / kind.elongation
        height = 2.0 * float(np.sqrt(short**2 + (long**2 - short**2) * axis[2] ** 2))
        largest = HIGHEST * room / height
        median = 1e3 * kind.median_mm
        if kind.sigma > 0.0:
            # D^2 moves the mean of a lognormal distribution by twice its variance.
            centre = np.log(median) + 2.0 * kind.sigma**2
            edges = np.exp(centre + kind.sigma * np.linspace(-7.0, 4.5, 8193))
            edges = edges[edges < largest]
        else:
            edges = np.full(2, median) if median < largest else np.empty(0)
        if edges.size < 2:
            raise PhysicsError(
                f"bubbles of median diameter {kind.median_mm:g} mm do not fit into "
                f"{1e-3 * room:.4g} mm of glass."
            )
        if kind.sigma > 0.0:
            size = np.sqrt(edges[1:] * edges[:-1])
            number = np.exp(-0.5 * (np.log(size / median) / kind.sigma) ** 2) * np.diff(np.log(edges))
            met = number * size**2 / (room - height * size)
            mean = met.sum() / number.sum()
            share = np.concatenate([[0.0], np.cumsum(met)]) / met.sum()
            sizes[k] = np.interp(np.linspace(0.0, 1.0, QUANTILES + 1), share, edges)
        else:
            mean = median**2 / (room - height * median)
            sizes[k] = median
        per_area = kind.per_cm3 * 1e-12 * 1e3 * thickness_mm
        rows[k] = [per_area * mean, kind.elongation, *axis, 1e3 * low_mm, 1e3 * high_mm, *kind.inside.row]
    return rows, sizes
