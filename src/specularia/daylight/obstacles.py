"""Shapes of what stands outside."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from specularia.daylight.job import Obstacle

__all__ = ["obstacle_faces"]

Array = NDArray[np.float64]


def obstacle_faces(obstacle: Obstacle) -> list[Array]:
    """[K, 3] corners of each flat face of an obstacle."""
    if obstacle.corners_m is not None:
        return [np.array(obstacle.corners_m)]
    assert obstacle.box_m is not None
    low, high = (f(np.array(obstacle.box_m), axis=0) for f in (np.min, np.max))
    found = []
    for axis in range(3):
        a, b = (k for k in range(3) if k != axis)
        for end in (low, high):
            corners = np.tile(low, (4, 1))
            corners[:, axis] = end[axis]
            corners[1:3, a] = high[a]
            corners[2:, b] = high[b]
            found.append(corners)
    return found
