"""Means of a distribution over cells: of the Shirley-Chiu square, or of direction cosines."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import maximum_filter, minimum_filter

from specularia.bsdf.model import Array, ScatteringModel
from specularia.conventions import disk_to_square, square_to_disk

__all__ = ["Slice", "cell_means", "cell_points", "grid", "is_isotropic", "refined_means", "transmitted_slice"]

_FINEST = 16
"""At most this many points along the edge of a cell."""
_POINTS_ACROSS = 128
"""Where nothing calls for more, points along the edge of the whole square; two a cell if it is coarse."""
_SLICE_POINTS, _SLICE_FINEST = 2048, 128
"""A slice has so many points along its edge where cells are uneven, and at most so many along one of them."""
_SLICE_EFFORT = 2**23
"""Points in all uneven cells of a slice, at most; bounds time and memory."""
_KEPT = 512
"""Up to so many points along the edge of the square their direction cosines are kept between calls."""


def is_isotropic(model: ScatteringModel) -> bool:
    """Whether the sample may be turned about its normal; models that deny it say `isotropic = False`."""
    return bool(getattr(model, "isotropic", True))


def grid(n: int) -> tuple[Array, Array]:
    """Direction cosines (ux, uy), each [n, n], at the centres of equal cells of the Shirley-Chiu square."""
    k = (np.arange(n) + 0.5) / n
    a, b = np.meshgrid(k, k, indexing="ij")
    return square_to_disk(a, b)


def _points(
    n: int, k: int, to_disk: Callable[[Array, Array], tuple[Array, Array]], cells: NDArray[np.intp]
) -> tuple[Array, Array]:
    """Direction cosines, each [cells, k, k], of k x k points in some of n x n cells."""
    if to_disk is square_to_disk and cells.size * 4 > n * n and n * k <= _KEPT:
        x, y = _all_points(n, k)
        return (x, y) if cells.size == n * n else (x[cells], y[cells])
    step = (np.arange(k) + 0.5) / k
    a = ((cells // n)[:, None, None] + step[None, :, None]) / n
    b = ((cells % n)[:, None, None] + step[None, None, :]) / n
    return to_disk(*np.broadcast_arrays(a, b))


@lru_cache(maxsize=4)
def _all_points(n: int, k: int) -> tuple[Array, Array]:
    x, y = (v.reshape(n, k, n, k).transpose(0, 2, 1, 3).reshape(n * n, k, k) for v in grid(n * k))
    x.flags.writeable = y.flags.writeable = False
    return x, y


def refined_means(
    value: Callable[[Array, Array], Array],
    to_disk: Callable[[Array, Array], tuple[Array, Array]],
    count: NDArray[np.intp],
    *,
    finest: int = _FINEST,
) -> Array:
    """Mean of `value` over n x n cells of the unit square, of the points that lie in the unit disk.

    A cell with many of the model's own quadrature points (`count` [n, n]) gets as many points here, so that a
    lobe narrower than the cell is not missed; at most `finest` along its edge.
    """
    n = count.shape[0]
    least = max(2 if n < 256 else 1, _POINTS_ACROSS // n)
    wanted = np.ceil(0.5 * np.log2(np.maximum(count.ravel(), 1)))
    points = np.clip(2**wanted, least, max(least, finest)).astype(int)
    out = np.empty(n * n)
    for k in np.unique(points):
        cells = np.flatnonzero(points == k)
        v = value(*_points(n, int(k), to_disk, cells))
        inside = np.isfinite(v)
        number = inside.sum(axis=(1, 2))
        total = np.where(inside, v, 0.0).sum(axis=(1, 2))
        out[cells] = np.where(number > 0, total / np.maximum(number, 1), np.nan)
    return out.reshape(n, n)


def cell_points(a: Array, b: Array, n: int) -> NDArray[np.intp]:
    i = np.clip((a * n).astype(int), 0, n - 1)
    j = np.clip((b * n).astype(int), 0, n - 1)
    return np.bincount(i * n + j, minlength=n * n).reshape(n, n)


def _uneven(means: Array, most: int) -> NDArray[np.bool_]:
    """Cells that differ from their neighbours: they, too, are uneven inside, as where a leaf of a tree ends.

    The differences of the cells left out come to less than a thousandth of the light, unless more than `most`
    cells would be taken: then the `most` uneven ones are.
    """
    high = maximum_filter(np.nan_to_num(means, nan=-np.inf), 3)
    low = minimum_filter(np.nan_to_num(means, nan=np.inf), 3)
    steps = np.where(np.isfinite(means), high - low, 0.0).ravel()
    order = np.argsort(steps)
    even = np.cumsum(steps[order]) <= 1e-3 * np.nansum(means)
    even |= steps[order] == 0.0
    even[:-most] = True
    chosen = np.ones(steps.size, bool)
    chosen[order[even]] = False
    return chosen.reshape(means.shape)


def cell_means(
    model: ScatteringModel, side: str, *, theta_i_deg: float, phi_i_deg: float = 0.0, n: int
) -> Array:
    """BSDF averaged over equal cells of projected solid angle.

    The cells are scaled together so that they add up to the model's direct-hemispherical value.

    Parameters
    ----------
    model, side : what to average.
    theta_i_deg, phi_i_deg : incident direction.
    n : cells along an edge of the square.

    Returns
    -------
    [n, n] in 1/sr, index [a, b] of `conventions.square_to_disk`, seen in the frame turned about the normal so
    that the light comes from azimuth 0. NaN where the model has no data for this direction.
    """
    tau = float(model.direct_hemispherical(side, theta_i_deg, phi_i_deg))
    if not np.isfinite(tau):
        return np.full((n, n), np.nan)
    q = model.quadrature(side, theta_i_deg, phi_i_deg)
    c, d = np.cos(np.radians(phi_i_deg)), np.sin(np.radians(phi_i_deg))

    def value(x: Array, y: Array) -> Array:
        return model.evaluate(side, theta_i_deg, phi_i_deg, x * c - y * d, x * d + y * c)

    own = cell_points(*disk_to_square(q.ux * c + q.uy * d, q.uy * c - q.ux * d), n)
    out = np.nan_to_num(refined_means(value, square_to_disk, own))
    total = out.sum() * np.pi / n**2
    return out * (tau / total) if total > 0 else out


@dataclass(frozen=True)
class Slice:
    """The transmitted distribution for one incident direction.

    Attributes
    ----------
    ux, uy : [N] centres of the cells along either axis, over -1 to 1.
    bsdf : [N, N] in 1/sr, mean over each cell, axis 0 ux, axis 1 uy; NaN where the centre lies outside the
        unit disk. The sum times (2 / N)^2 is the direct-hemispherical transmission, but for the light in
        cells that the rim of the disk cuts.
    side : transmission_front, or transmission_back for light on the back.
    """

    ux: Array
    uy: Array
    bsdf: Array
    side: str


def transmitted_slice(
    model: ScatteringModel, *, theta_deg: float, phi_deg: float = 0.0, size: int = 201
) -> Slice:
    """The transmitted distribution on a square grid of direction cosines.

    Parameters
    ----------
    model : any scattering model.
    theta_deg, phi_deg : incident direction from the front normal; theta above 90 is light on the back.
    size : N, cells along either axis.
    """
    side = "transmission_front" if theta_deg < 90 else "transmission_back"
    theta = theta_deg if theta_deg < 90 else 180.0 - theta_deg
    q = model.quadrature(side, theta, phi_deg)
    own = cell_points(0.5 * (q.ux + 1), 0.5 * (q.uy + 1), size)
    finest = int(np.clip(_SLICE_POINTS // size, _FINEST, _SLICE_FINEST))

    def means(count: NDArray[np.intp]) -> Array:
        return refined_means(
            lambda x, y: model.evaluate(side, theta, phi_deg, x, y),
            lambda a, b: (2 * a - 1, 2 * b - 1),
            count,
            finest=finest,
        )

    bsdf = means(own)
    # The model's own quadrature tells of lobes that fell between the points.
    f = q.weight * model.evaluate(side, theta, phi_deg, q.ux, q.uy)
    x, y = (np.clip((0.5 * (v + 1) * size).astype(int), 0, size - 1) for v in (q.ux, q.uy))
    lobes = np.bincount(x * size + y, f, minlength=size**2).reshape(bsdf.shape) * (size / 2.0) ** 2
    seen = np.fmax(bsdf, np.where(np.isfinite(bsdf), np.nan_to_num(lobes), np.nan))
    bsdf = means(np.where(_uneven(seen, _SLICE_EFFORT // finest**2), finest**2, own))
    centre: Array = np.asarray((np.arange(size) + 0.5) * (2.0 / size) - 1.0, np.float64)
    outside = np.hypot(centre[:, None], centre[None, :]) > 1.0
    return Slice(ux=centre, uy=centre, bsdf=np.where(outside, np.nan, bsdf), side=side)
