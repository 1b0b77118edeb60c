"""A measured distribution as the two tables of the model: means of the interpolant over cells, and errors."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from specularia.conventions import square_to_disk
from specularia.gonio._walk import means
from specularia.gonio.interpolant import Distribution
from specularia.gonio.table import Array

__all__ = ["CELLS", "HALF_WIDTH", "SUB", "Image", "Tabulated", "tabulated"]

CELLS = 256
"""Cells along each side of the base table and of the patch."""

HALF_WIDTH = 0.15
"""Half the side of the patch: cells of 0.0012 in direction cosines, 0.07 degrees at the normal."""

SUB = 3
"""Samples of the interpolant along each side of a cell."""


@dataclass(frozen=True)
class Image:
    """How a distribution is seen: mirrored in the plane of incidence, then turned about the normal."""

    mirrored: bool = False
    turn_deg: float = 0.0

    def source(self, x: Array, y: Array) -> tuple[Array, Array]:
        """Where the distribution holds what the image shows at (x, y)."""
        c, d = np.cos(np.radians(self.turn_deg)), np.sin(np.radians(self.turn_deg))
        u, v = x * c + y * d, y * c - x * d
        return u, -v if self.mirrored else v


@dataclass(frozen=True)
class Tabulated:
    """Means over the cells of `SideTable`'s two tables, and variances, [n, n] each; 0 beyond the horizon."""

    base: NDArray[np.float32]
    patch: NDArray[np.float32]
    base_variance: NDArray[np.float32]
    patch_variance: NDArray[np.float32]

    @classmethod
    def mean(cls, parts: Sequence[Tabulated]) -> Tabulated:
        """The mean of independent tables."""
        n = len(parts)

        def average(name: str) -> NDArray[np.float32]:
            return np.asarray(sum(getattr(p, name) for p in parts) / n, np.float32)

        share = np.float32(1.0 / n)
        return cls(
            base=average("base"),
            patch=average("patch"),
            base_variance=share * average("base_variance"),
            patch_variance=share * average("patch_variance"),
        )


def tabulated(
    found: Distribution,
    *,
    theta_deg: float,
    images: Sequence[Image] = (Image(),),
    cells: int = CELLS,
    sub: int = SUB,
) -> Tabulated:
    """The mean of some images of a distribution over the cells of both tables.

    Parameters
    ----------
    found : turned so that its light comes from phi_i = 0, at the incident angle theta_deg.
    images : under which the sample is the same.
    cells : along each side of either table.
    sub : samples along each side of a cell.
    """
    step = (np.arange(sub) + 0.5) / sub
    k = np.arange(cells)

    def samples(corner: NDArray[np.floating], edge: float) -> tuple[Array, Array]:
        """[cells * cells, sub * sub] coordinates; every other row runs back, so that all are neighbours."""
        line = corner[:, None] + step * edge
        a, b = np.broadcast_arrays(line[:, None, :, None], line[None, :, None, :])
        order = np.where(k[:, None] % 2 == 0, k[None, :], cells - 1 - k[None, :])
        rows = k[:, None]
        return a[rows, order].reshape(cells**2, -1), b[rows, order].reshape(cells**2, -1)

    def restored(flat: Array) -> NDArray[np.float32]:
        out = flat.reshape(cells, cells).astype(np.float32)
        out[1::2] = out[1::2, ::-1]
        return out

    def mean(x: Array, y: Array) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
        total, spread = np.zeros(cells**2), np.zeros(cells**2)
        for image in images:
            u, v = image.source(x, y)
            value, variance = means(
                found.x, found.y, found.values, found.variance, found.triangles, found.neighbours, u, v
            )
            total += value / len(images)
            # Cells near the mirror hold the same points twice: the errors are taken as fully dependent.
            spread += np.sqrt(variance) / len(images)
        return restored(total), restored(spread**2)

    base, base_variance = mean(*square_to_disk(*samples(k / cells, 1.0 / cells)))
    edge = 2.0 * HALF_WIDTH / cells
    x, y = samples(k * edge - HALF_WIDTH, edge)
    patch, patch_variance = mean(x - np.sin(np.radians(theta_deg)), y)
    return Tabulated(base=base, patch=patch, base_variance=base_variance, patch_variance=patch_variance)
