"""The distribution of one table: a continuous function of the outgoing direction, made from scattered points.

In the plane of direction cosines (ux, uy) area is projected solid angle, so tau is the plain integral of the
BSDF over the unit disk. The points are triangulated (Delaunay) and the BSDF is linear on each triangle; the
horizon takes the values of the nearest points. Only the integral also counts the curvature between points.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from specularia.gonio._walk import interpolate
from specularia.gonio.cleaning import Step, clean
from specularia.gonio.noise import Noise
from specularia.gonio.shadow import Mask
from specularia.gonio.table import Array, Table
from specularia.gonio.triangulation import doubled_area, triangulate, weights

__all__ = ["Distribution", "distribution"]

_RING = 720
"""Points on the horizon; the disk loses 1.3e-5 of its area to the polygon."""


@dataclass(frozen=True)
class Distribution:
    """BSDF of one table as a function of (ux, uy), turned so that the light comes from phi_i = 0.

    Attributes
    ----------
    x, y, values : [P] points and their BSDF in 1/sr, those on the horizon included.
    variance : [P] of the noise of `values`, 1/sr^2; on the horizon that of the mean taken over.
    triangles, neighbours : [T, 3] Delaunay triangulation; neighbours lie opposite each vertex, -1 outside.
    integral : of the BSDF over projected solid angle: tau or rho.
    standard_error : of the integral, from the noise of single values.
    weight : [P] weights of `values` whose sum is the integral.
    row_weight : [R] weights of the BSDF of the table's rows whose sum is the integral.
    coverage : share of the projected hemisphere between points, without gaps and what lies beyond them.
    covered : [T] True for triangles between points that are not far apart; the others bridge gaps or reach
        out to the horizon.
    filled : [measured] 0 where the value was measured, 1 where it comes from the mirror side of a shadow, 2
        where it bridges one; the points on the horizon, `measured` and later, have none.
    noise : of single values of the signal, BSDF times |cos theta_s|.
    steps : what the cleaning did.
    notes : what of that a user is told.
    """

    x: Array
    y: Array
    values: Array
    variance: Array
    triangles: NDArray[np.int32]
    neighbours: NDArray[np.int32]
    integral: float
    standard_error: float
    weight: Array
    row_weight: Array
    coverage: float
    covered: NDArray[np.bool_]
    filled: NDArray[np.int8]
    noise: Noise
    steps: tuple[Step, ...]
    notes: tuple[str, ...]

    @property
    def measured(self) -> int:
        """Points that do not lie on the horizon; they come first."""
        return self.filled.size

    def at(self, ux: Array, uy: Array) -> Array:
        """BSDF at directions; fast where they are given so that neighbours follow each other."""
        found = interpolate(
            self.x, self.y, self.values, self.triangles, self.neighbours, np.ravel(ux), np.ravel(uy)
        )
        return found.reshape(np.shape(ux))


def distribution(table: Table, *, masks: Sequence[Mask] = (), isotropic: bool = True) -> Distribution:
    """Clean a table (`cleaning.clean`) and triangulate it; see `Distribution`."""
    found = clean(table, masks=masks, isotropic=isotropic)
    x, y, bsdf = found.x, found.y, found.bsdf
    measured = x.size
    ring_x, ring_y, ring_values, sources, shares = _horizon(x, y, bsdf)
    x, y = np.concatenate([x, ring_x]), np.concatenate([y, ring_y])
    values = np.concatenate([bsdf, ring_values])
    triangles, neighbours = triangulate(x, y)
    weight = weights(x, y, triangles, neighbours)
    own = weight[:measured] + np.bincount(
        sources.ravel(), (shares * weight[measured:, None]).ravel(), minlength=measured
    )
    row_weight = found.mix.T @ own
    covered = _covered(x, y, triangles, measured)
    area = 0.5 * float(np.sum(doubled_area(x, y, *triangles[covered].T)))
    variance = found.mix.multiply(found.mix) @ found.row_variance
    return Distribution(
        x=x,
        y=y,
        values=values,
        variance=np.concatenate([variance, (shares**2 * variance[sources]).sum(axis=1)]),
        triangles=triangles,
        neighbours=neighbours,
        integral=float(np.sum(weight * values)),
        standard_error=float(np.sqrt(np.sum(row_weight**2 * found.row_variance))),
        weight=weight,
        row_weight=row_weight,
        coverage=min(area / np.pi, 1.0),
        covered=covered,
        filled=found.filled,
        noise=found.noise,
        steps=found.steps,
        notes=found.notes,
    )


def _horizon(x: Array, y: Array, values: Array) -> tuple[Array, Array, Array, NDArray[np.intp], Array]:
    """Points on the horizon, each with the mean of the three nearest points, weighted by inverse distance."""
    from scipy.spatial import cKDTree

    azimuth = (np.arange(_RING) + 0.5) * (2 * np.pi / _RING)
    ring = np.stack([np.cos(azimuth), np.sin(azimuth)], axis=1)
    # Only the outer points can be nearest, and the tree of all would cost more than the search.
    outer = np.flatnonzero(np.hypot(x, y) > np.quantile(np.hypot(x, y), max(0.0, 1.0 - 2e4 / x.size)))
    outer = outer if outer.size >= 3 else np.arange(x.size)
    distance, nearest = cKDTree(np.stack([x[outer], y[outer]], axis=1)).query(ring, k=3)
    closeness = 1.0 / np.maximum(distance, 1e-9)
    shares = closeness / closeness.sum(axis=1, keepdims=True)
    sources = outer[nearest]
    return ring[:, 0], ring[:, 1], (values[sources] * shares).sum(axis=1), sources, shares


def _covered(x: Array, y: Array, triangles: NDArray[np.int32], measured: int) -> NDArray[np.bool_]:
    """[T] triangles between measured points whose edges are not long for this table.

    Long is more than four times the distance to the nearest neighbour that nine points in ten stay below.
    """
    edges = np.stack(
        [
            np.hypot(x[triangles[:, i]] - x[triangles[:, j]], y[triangles[:, i]] - y[triangles[:, j]])
            for i, j in ((0, 1), (1, 2), (2, 0))
        ]
    )
    nearest = np.full(x.size, np.inf)
    for edge, (i, j) in zip(edges, ((0, 1), (1, 2), (2, 0))):
        np.minimum.at(nearest, triangles[:, i], edge)
        np.minimum.at(nearest, triangles[:, j], edge)
    limit = 4.0 * np.quantile(nearest[:measured], 0.9)
    return (triangles < measured).all(axis=1) & (edges.max(axis=0) <= limit)
