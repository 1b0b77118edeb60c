"""Rank-3 tensor trees from any scattering model: averaged over their cells, then reduced.

A tree at resolution g has 2^(g-1) incidence bins, uniform in sin(theta_i), and 2^g x 2^g outgoing cells. What
a renderer reads in a bin stands for every direction in it, so a bin holds the mean of the model over the bin
(weight sin d sin), and an outgoing cell the mean over the cell. Reduction then merges blocks of 2 x 2 x 2
cells, 4 x 4 x 4 and so on where the error that this makes is small.
"""

from __future__ import annotations

import warnings
from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from specularia.bsdf.azimuth import turned_mean
from specularia.bsdf.cells import cell_means, is_isotropic
from specularia.bsdf.model import Array, ScatteringModel
from specularia.bsdf.tabulated import TabulatedModel
from specularia.bsdf.tabulated_means import TabulatedMeans
from specularia.bsdf.tensor_tree import BRANCH, TensorTree
from specularia.bsdf.views import other_face
from specularia.errors import PhysicsError, SpeculariaWarning

__all__ = ["Built", "bin_edges", "bin_mean_tau", "build", "build_sides", "fill_cells", "reduce_cells"]

TOLERANCE = 0.01
"""Share of a bin's light that reduction may put elsewhere where no number of cells to remove is asked for."""
_TAU_KEPT = 2e-3
_ROUNDS = 10
_AZIMUTHS = 24


@dataclass(frozen=True)
class Built:
    """One side of a model as a tree, with what the reduction has done to it.

    Attributes
    ----------
    tree : the tree.
    theta_low_deg, theta_high_deg : edges of the incidence bins: [B], from grazing to normal, for rank 3, and
        [n, n] for rank 4.
    tau_model : direct-hemispherical value of the model averaged over each bin, of the same shape.
    tau_tree : the same of the tree.
    l1 : integral of |tree - cell means| over projected solid angle, over tau_model.
    removed : share of the cells that reduction has removed, 0 to 1.
    """

    tree: TensorTree
    theta_low_deg: Array
    theta_high_deg: Array
    tau_model: Array
    tau_tree: Array
    l1: Array
    removed: float


def bin_edges(resolution: int) -> Array:
    """sin(theta_i) at the edges of the incidence bins, [B + 1], from 1 down to 0, as the tree counts them.

    >>> bin_edges(3).tolist()
    [1.0, 0.75, 0.5, 0.25, 0.0]
    """
    bins = 1 << (resolution - 1)
    return 1.0 - np.arange(bins + 1) / bins


def angles_between(low: float, high: float, count: int) -> tuple[Array, Array]:
    """Angles in degrees and weights that average over low <= sin(theta) <= high with the weight sin d sin.

    Gauss-Legendre in cos(theta), where sin d sin = -cos d cos and where a transmission that vanishes at
    grazing incidence is smooth.
    """
    x, w = np.polynomial.legendre.leggauss(count)
    c0, c1 = np.sqrt(1.0 - high * high), np.sqrt(1.0 - low * low)
    c = 0.5 * (c0 + c1) + 0.5 * (c1 - c0) * x
    w = w * c
    return np.degrees(np.arccos(c)), w / w.sum()


def _points(high: float) -> int:
    """Angles to average over in a bin: towards grazing incidence tau bends, and most in the last bin."""
    return 24 if high == 1.0 else 8 if high > 0.9 else 4


def bin_mean_tau(model: ScatteringModel, side: str, *, low: float, high: float, count: int = 8) -> float:
    """Direct-hemispherical value averaged over low <= sin(theta_i) <= high; NaN where there are no data."""
    theta, w = angles_between(low, high, count)
    phi = np.zeros(1) if is_isotropic(model) else np.arange(_AZIMUTHS) * (360.0 / _AZIMUTHS)
    tau = np.mean([np.asarray(model.direct_hemispherical(side, theta, float(p)), float) for p in phi], axis=0)
    known = np.isfinite(tau)
    return float(np.sum(w[known] * tau[known]) / w[known].sum()) if known.any() else float("nan")


def fill_cells(
    model: ScatteringModel,
    side: str,
    *,
    resolution: int,
    opposite: NDArray[np.float32] | None = None,
) -> tuple[NDArray[np.float32], Array]:
    """A model averaged over all cells of a tree.

    Parameters
    ----------
    model, side : what to average; a model that is not isotropic is averaged over azimuth as well.
    resolution : g, 3 to 9.
    opposite : the cells of the transmission side from which this one is made by reciprocity, where they are
        at hand; else they are made.

    Returns
    -------
    cells : [2^(g-1), 2^g, 2^g] in 1/sr, index [bin, a, b] in Radiance's frame (x_R = -ux).
    tau : [2^(g-1)] direct-hemispherical value that each bin adds up to.
    """
    n = 1 << resolution
    edges = bin_edges(resolution)
    count = 4 if resolution <= 6 else 3 if resolution == 7 else 2
    azimuths = np.zeros(1) if is_isotropic(model) else np.arange(_AZIMUTHS) * (360.0 / _AZIMUTHS)
    cells = np.zeros((n // 2, n, n), np.float32)
    if isinstance(model, TabulatedModel):
        model = turned_mean(model)
        if side not in model.tables and opposite is None:
            opposite, _ = fill_cells(model, other_face(side), resolution=resolution)
        return _fill_from_tables(TabulatedMeans(model, side, n=n), edges, cells, opposite)
    tau = np.full(n // 2, np.nan)
    for k in range(n // 2):
        low, high = float(edges[k + 1]), float(edges[k])
        # Towards grazing incidence tau bends within a bin.
        tau[k] = bin_mean_tau(model, side, low=low, high=high, count=_points(high))
        total, weight = np.zeros((n, n)), 0.0
        for theta, w in zip(*angles_between(low, high, count)):
            for phi in azimuths:
                mean = cell_means(model, side, theta_i_deg=float(theta), phi_i_deg=float(phi), n=n)
                if np.isfinite(mean[0, 0]):
                    total += w * mean
                    weight += w
        total /= max(weight, 1e-300)
        middle = slice(n // 2 - 1, n // 2 + 1)
        total[middle, middle] = total[middle, middle].mean()
        here = total.sum() * np.pi / n**2
        # Seen from Radiance x runs the other way: the square is mirrored in its first coordinate.
        cells[k] = (total * (tau[k] / here if here > 0 and np.isfinite(tau[k]) else 1.0))[::-1]
    return _extend(cells, tau, side, edges)


def _fill_from_tables(
    means: TabulatedMeans, edges: Array, cells: NDArray[np.float32], opposite: NDArray[np.float32] | None
) -> tuple[NDArray[np.float32], Array]:
    """`fill_cells` for an isotropic tabulated model, which has data everywhere."""
    bins, n, _ = cells.shape
    spans = [(float(low), float(high)) for high, low in pairwise(edges)]
    tau = (
        _light_by_reciprocity(opposite)
        if means.reciprocal and opposite is not None
        else np.array(
            [bin_mean_tau(means.model, means.side, low=a, high=b, count=_points(b)) for a, b in spans]
        )
    )
    count = max(128 // bins, 2 if bins > 64 else 3)
    for k, (low, high) in enumerate(spans):
        total = np.zeros((n, n))
        # Towards grazing incidence the distribution changes most within a bin.
        for theta, w in zip(*angles_between(low, high, 2 * count if high == 1.0 else count)):
            total += w * means.at(float(theta))
        middle = slice(n // 2 - 1, n // 2 + 1)
        total[middle, middle] = total[middle, middle].mean()
        here = total.sum() * np.pi / n**2
        cells[k] = (total * (tau[k] / here if here > 0 else 1.0))[::-1]
    return cells, tau


def _light_by_reciprocity(cells: NDArray[np.float32]) -> Array:
    """Direct-hemispherical value of each incidence bin of the opposite side, [B].

    The rings that the square's cells make around the middle are the incidence bins. With f(i -> j) the mean
    of the opposite side over light from ring i and into ring j, light from ring j of this side adds up to
    sum_i A_i f(i -> j), A_i the projected solid angle of ring i.
    """
    bins, n, _ = cells.shape
    way = np.abs(2 * np.arange(n) + 1 - n)
    ring = (np.maximum(way[:, None], way[None, :]) - 1) // 2
    count = np.bincount(ring.ravel())
    into = np.stack([np.bincount(ring.ravel(), c.ravel(), bins) for c in cells]) / count
    area = np.pi / n**2 * count
    # Bins run from grazing to normal incidence, rings outwards.
    return np.asarray(area[::-1] @ into)[::-1]


def _extend(
    cells: NDArray[np.float32], tau: Array, side: str, edges: Array
) -> tuple[NDArray[np.float32], Array]:
    """Bins without data take those of the nearest bin that has some, and a warning says so."""
    known = np.isfinite(tau)
    if known.all():
        return cells, tau
    if not known.any():
        raise PhysicsError(f"the model has no data for {side.replace('_', ' ')} at any angle.")
    holders = np.flatnonzero(known)
    nearest = holders[np.abs(np.arange(tau.size)[:, None] - holders[None, :]).argmin(axis=1)]
    last = float(np.degrees(np.arcsin(edges[holders[0]])))
    warnings.warn(
        f"{side.replace('_', ' ')}: no data for {np.count_nonzero(~known)} of {tau.size} incidence bins; "
        f"they repeat the nearest bin (data end at {last:.1f} degrees).",
        SpeculariaWarning,
        stacklevel=2,
    )
    return cells[nearest], tau[nearest]


def _light_moved(cells: NDArray[np.float32]) -> list[NDArray[np.float32]]:
    """For blocks of 2^k cells along each edge, k = 1, 2, ...: sum of |cell - mean|, [block, bin, a, b]."""
    bins, n, _ = cells.shape
    out = []
    k = 1
    while (1 << k) <= bins:
        s = 1 << k
        block = cells.reshape(bins // s, s, n // s, s, n // s, s)
        mean = block.mean(axis=(1, 3, 5), keepdims=True)
        out.append(np.abs(block - mean).sum(axis=(3, 5)))
        k += 1
    return out


def _merge_costs(
    cells: NDArray[np.float32], moved: list[NDArray[np.float32]], weight: Array
) -> list[NDArray[np.float32]]:
    """For blocks of 2^k cells along each edge, k = 0, 1, ...: the light moved; bins weigh weight [B]."""
    costs = [np.zeros(cells.shape, np.float32)]
    for light in moved:
        s = light.shape[1]
        costs.append((light * weight.reshape(-1, s, 1, 1)).sum(axis=1).astype(np.float32))
    return costs


def _merged(costs: list[NDArray[np.float32]], price: float) -> list[NDArray[np.bool_]]:
    """Which blocks become one leaf, where a leaf costs `price` and light moved costs as much as it is.

    From small blocks to large ones, a block is merged where that is cheaper than the best way to keep its
    eight parts: the least light moved for a number of leaves (Breiman, Friedman, Olshen and Stone 1984,
    Classification and Regression Trees, chapter 3).
    Parts of merged blocks count as merged.
    """
    best = np.full(costs[0].shape, price)
    out = [np.ones(costs[0].shape, bool)]
    for cost in costs[1:]:
        b, n, _ = cost.shape
        parts = best.reshape(b, 2, n, 2, n, 2).sum(axis=(1, 3, 5))
        out.append(cost + price <= parts)
        best = np.minimum(cost + price, parts)
    for k in range(len(out) - 1, 1, -1):
        out[k - 1] |= out[k].repeat(2, 0).repeat(2, 1).repeat(2, 2)
    return out


def _leaf_count(merged: list[NDArray[np.bool_]]) -> int:
    return merged[0].size - sum(7 * int(np.count_nonzero(m)) for m in merged[1:])


def _flattened(cells: NDArray[np.float32], merged: list[NDArray[np.bool_]]) -> NDArray[np.float32]:
    """Cells with every merged block replaced by its mean; larger blocks come last and win."""
    out = cells.copy()
    bins, n, _ = cells.shape
    for k in range(1, len(merged)):
        s = 1 << k
        view = out.reshape(bins // s, s, n // s, s, n // s, s)
        mean = cells.reshape(view.shape).mean(axis=(1, 3, 5), keepdims=True)
        view[...] = np.where(merged[k][:, None, :, None, :, None], mean, view)
    return out


def _keep_tau(flat: NDArray[np.float32], merged: list[NDArray[np.bool_]], tau: Array) -> NDArray[np.float32]:
    """Scale, in each bin, the cells that no merge has touched, so that the bin adds up to tau again."""
    n = flat.shape[1]
    touched = merged[1].repeat(2, 0).repeat(2, 1).repeat(2, 2) if len(merged) > 1 else np.zeros(1, bool)
    area = np.pi / n**2
    free = np.where(touched, 0.0, flat).sum(axis=(1, 2), dtype=float) * area
    missing = tau - flat.sum(axis=(1, 2), dtype=float) * area
    can = free > 0.05 * tau
    factor = np.where(can, 1.0 + missing / np.where(can, free, 1.0), 1.0)
    factor = np.clip(factor, 0.9, 1.1)[:, None, None]
    return np.where(touched, flat, flat * factor).astype(np.float32)


def reduce_cells(
    cells: NDArray[np.float32], tau: Array, *, cull: float | None = None, tolerance: float = TOLERANCE
) -> tuple[NDArray[np.float32], list[NDArray[np.bool_]]]:
    """Merge blocks of cells, those first where merging moves the least light.

    Parameters
    ----------
    cells : [B, n, n] from `fill_cells`.
    tau : [B] direct-hemispherical value of each bin.
    cull : percentage of the cells to remove; None removes as many as `tolerance` allows. The choice is made
        again a few times, with more weight on the bins that lost most, and the one that is kept has the
        smallest error, worst bin and mean.
    tolerance : largest integral of |reduced - cells| over projected solid angle, over tau, in any bin.

    Returns
    -------
    The reduced cells [B, n, n], each bin adding up to tau within 0.2 %, and for each size of block which ones
    have become one leaf.
    """
    area = np.pi / cells.shape[1] ** 2
    floor = np.maximum(tau, 1e-3 * max(tau.max(), 1e-12))
    moved = _light_moved(cells)

    def attempt(
        costs: list[NDArray[np.float32]], limit: float
    ) -> tuple[NDArray[np.float32], list[NDArray[np.bool_]], Array, Array]:
        merged = _merged(costs, limit)
        flat = _keep_tau(_flattened(cells, merged), merged, tau)
        l1 = np.abs(flat - cells).sum(axis=(1, 2), dtype=float) * area / floor
        off = np.abs(flat.sum(axis=(1, 2), dtype=float) * area - tau) / floor
        return flat, merged, l1, off

    def price(costs: list[NDArray[np.float32]]) -> float:
        low, high = -9.0, 0.5
        if not fits(costs, 10.0**low):
            low = -20.0
        for _ in range(12):
            middle = 0.5 * (low + high)
            low, high = (middle, high) if fits(costs, 10.0**middle) else (low, middle)
        return float(10.0**low)

    def fits(costs: list[NDArray[np.float32]], limit: float) -> bool:
        if cull is not None:
            return _leaf_count(_merged(costs, limit)) >= (1.0 - cull / 100.0) * cells.size
        _, _, l1, off = attempt(costs, limit)
        return bool(l1.max() <= tolerance and off.max() <= _TAU_KEPT)

    importance = np.ones(tau.size)
    best: tuple[NDArray[np.float32], list[NDArray[np.bool_]]] | None = None
    lowest = np.inf
    # Where a number of cells is to go, bins that lose more than others count more in the next choice.
    for _ in range(1 if cull is None else _ROUNDS):
        costs = _merge_costs(cells, moved, importance * area / floor)
        flat, merged, l1, off = attempt(costs, price(costs))
        # Light that is moved can be lived with; light that is lost or made cannot.
        badness = float(l1.max() + l1.mean() + 10.0 * max(off.max() - _TAU_KEPT, 0.0))
        if best is None or badness < lowest:
            best, lowest = (flat, merged), badness
        if off.max() <= _TAU_KEPT and l1.max() <= max(tolerance, 1.1 * float(l1.mean())):
            break
        importance *= np.sqrt((l1 / max(l1.mean(), 1e-12)).clip(0.7, 6.0))
        importance[off > _TAU_KEPT] *= 2.0
        importance /= importance.mean()
    assert best is not None
    return best


_Node = NDArray[np.float32] | list["_Node"]


def _assemble(cells: NDArray[np.float32], merged: list[NDArray[np.bool_]]) -> TensorTree:
    """A tree from reduced cells; grids wherever eight neighbours have the same depth."""
    clean = [np.ones(merged[0].shape, bool)]
    for m in merged[1:]:
        b, n, _ = m.shape
        clean.append(~m & clean[-1].reshape(b, 2, n, 2, n, 2).all(axis=(1, 3, 5)))

    def node(level: int, i: int, a: int, b: int) -> _Node:
        s = 1 << level
        if merged[level][i, a, b]:
            return cells[i * s : i * s + 1, a * s : a * s + 1, b * s : b * s + 1]
        if clean[level][i, a, b]:
            return cells[i * s : (i + 1) * s, a * s : (a + 1) * s, b * s : (b + 1) * s]
        kids = [
            node(level - 1, 2 * i + (c & 1), 2 * a + (c >> 1 & 1), 2 * b + (c >> 2 & 1)) for c in range(8)
        ]
        first = kids[0]
        if isinstance(first, np.ndarray) and all(
            isinstance(k, np.ndarray) and k.shape == first.shape for k in kids
        ):
            m = first.shape[0]
            out = np.empty((2 * m,) * 3, np.float32)
            for c, k in enumerate(kids):
                p, q, r = (c & 1) * m, (c >> 1 & 1) * m, (c >> 2 & 1) * m
                out[p : p + m, q : q + m, r : r + m] = k
            return out
        return kids

    top = len(merged) - 1
    unused = np.zeros((1, 1, 1), np.float32)
    root: list[_Node] = [unused if c & 1 else node(top, 0, c >> 1 & 1, c >> 2 & 1) for c in range(8)]
    log2: list[int] = []
    start: list[int] = []
    child: list[int] = []
    values: list[NDArray[np.float32]] = []
    filled = 0

    def put(item: _Node) -> int:
        nonlocal filled
        number = len(log2)
        if isinstance(item, np.ndarray):
            log2.append(item.shape[0].bit_length() - 1)
            start.append(filled)
            values.append(item.ravel())
            filled += item.size
            return number
        log2.append(BRANCH)
        start.append(len(child))
        slot = len(child)
        child.extend([0] * 8)
        for c, k in enumerate(item):
            child[slot + c] = put(k)
        return number

    put(root)
    return TensorTree(
        rank=3,
        log2=np.array(log2, np.int8),
        start=np.array(start, np.int64),
        child=np.array(child, np.int32),
        values=np.concatenate(values),
    )


def build(
    model: ScatteringModel,
    side: str,
    *,
    resolution: int = 6,
    cull: float | None = None,
    tolerance: float = TOLERANCE,
) -> Built:
    """One side of a model as a rank-3 tree.

    Parameters
    ----------
    model : any scattering model.
    side : one of its sides.
    resolution : g; 2^(g-1) incidence bins and 2^g x 2^g outgoing cells, 3 to 9.
    cull : percentage of the cells to remove, 0 to 100; None removes as many as `tolerance` allows.
    tolerance : see `reduce_cells`.
    """
    return next(build_sides(model, [side], resolution=resolution, cull=cull, tolerance=tolerance))[1]


def build_sides(
    model: ScatteringModel,
    sides: Sequence[str],
    *,
    resolution: int = 6,
    cull: float | None = None,
    tolerance: float = TOLERANCE,
) -> Iterator[tuple[str, Built]]:
    """Sides of a model as rank-3 trees, one after the other; parameters as for `build`.

    A side by reciprocity takes its light from the cells of its opposite, so that both trees agree, and comes
    after it.
    """
    if not 3 <= resolution <= 9:
        raise PhysicsError(f"a tree's resolution must lie between 3 and 9, not {resolution}.")
    if cull is not None and not 0 <= cull < 100:
        raise PhysicsError(f"cull is a percentage of the cells, 0 <= cull < 100, not {cull}.")

    def reduced(cells: NDArray[np.float32], tau: Array) -> Built:
        flat, merged = reduce_cells(cells, tau, cull=cull, tolerance=tolerance)
        area = np.pi / cells.shape[1] ** 2
        edges = np.degrees(np.arcsin(bin_edges(resolution)))
        return Built(
            tree=_assemble(flat, merged),
            theta_low_deg=edges[1:],
            theta_high_deg=edges[:-1],
            tau_model=tau,
            tau_tree=flat.sum(axis=(1, 2), dtype=float) * area,
            l1=np.abs(flat - cells).sum(axis=(1, 2), dtype=float) * area / np.maximum(tau, 1e-12),
            removed=1.0 - _leaf_count(merged) / cells.size,
        )

    if isinstance(model, TabulatedModel):
        model = turned_mean(model)
    own = model.tables if isinstance(model, TabulatedModel) else sides
    filled: dict[str, NDArray[np.float32]] = {}
    # One side is reduced while the next one is averaged.
    with ThreadPoolExecutor(1) as pool:
        waiting = []
        for side in sorted(sides, key=lambda s: s not in own):
            opposite = filled.get(other_face(side))
            filled[side], tau = fill_cells(model, side, resolution=resolution, opposite=opposite)
            waiting.append((side, pool.submit(reduced, filled[side], tau)))
        for side, future in waiting:
            yield side, future.result()
