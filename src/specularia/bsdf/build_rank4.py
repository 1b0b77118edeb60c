"""Rank-4 tensor trees from any scattering model: averaged over pairs of cells, then reduced.

A tree of rank 4 at resolution g has 2^g x 2^g incident cells and as many outgoing ones, all of them equal in
projected solid angle. A renderer that looks at the sun through it reads one cell for all eye directions in
another cell, so what it finds is the direct-hemispherical value averaged over the cell that holds the sun:
nothing depends on where in the cell the sun stands, and on the normal the four cells that meet are alike.

Both sums over a pair of hemispheres are kept: light from an incident cell adds up to its
direct-hemispherical value (what is seen under a sky), and light into an outgoing cell to that of the other
face (what is seen under a sun, which is read in reverse).
"""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from functools import partial
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from specularia import progress
from specularia.bsdf import _rank4_kernel as kernel
from specularia.bsdf._query_kernel import tree_cells
from specularia.bsdf.build_tree import Built, angles_between, bin_mean_tau
from specularia.bsdf.cells import cell_points, is_isotropic, refined_means
from specularia.bsdf.model import Array, ScatteringModel
from specularia.bsdf.reduce_rank4 import TOLERANCE, reduced
from specularia.bsdf.tabulated import TabulatedModel
from specularia.bsdf.tabulated_means import TabulatedMeans
from specularia.bsdf.tensor_tree import TensorTree
from specularia.bsdf.xml_model import TreePart, XmlModel
from specularia.conventions import disk_to_square, square_to_disk
from specularia.errors import PhysicsError, SpeculariaWarning

__all__ = ["TOLERANCE", "build_tensor4", "incident_tau"]

_Filled = tuple[NDArray[np.float32], Array, Array]
"""Cells, and what rows and columns of them add up to."""

_FINEST = 8


def build_tensor4(
    model: ScatteringModel,
    *,
    resolution: int = 6,
    cull: float | None = None,
    tolerance: float = TOLERANCE,
    sides: Sequence[str] | None = None,
) -> dict[str, Built]:
    """Sides of a model as trees of rank 4.

    Parameters
    ----------
    model : any scattering model.
    resolution : g, 2 to 7; 2^g cells along each of the four edges.
    cull : percentage of the cells to remove, 0 to 100; None removes as many as `tolerance` allows.
    tolerance : largest integral of |tree - cell means| over projected solid angle, over the
        direct-hemispherical value, as a mean over all incident cells.
    sides : which ones; None takes all that the model answers for.

    Returns
    -------
    For each side the tree and what reduction has done to it; the arrays of `Built` are [n, n] here, one
    entry for each incident cell, index as in the file: cells of the Shirley-Chiu square at (ux, -uy) of the
    incident direction.

    Notes
    -----
    Needs 0.9 GB at 2^7 for an isotropic model, and 2 GB for any other one.
    """
    if not 2 <= resolution <= 7:
        raise PhysicsError(f"a tree of rank 4 is made at resolutions 2 to 7, not {resolution}.")
    if cull is not None and not 0 <= cull < 100:
        raise PhysicsError(f"cull is a percentage of the cells, 0 <= cull < 100, not {cull}.")
    wanted = tuple(model.sides if sides is None else sides)
    made: dict[str, _Filled] = {}
    fill = _isotropic if is_isotropic(model) else partial(_anisotropic, made=made)
    out: dict[str, Built] = {}
    radius = _radius_deg(1 << resolution)
    with progress.task(f"building trees of rank 4 at 2^{resolution}", len(wanted)) as task:
        for side in wanted:
            cells, rows, columns = fill(model, side, resolution=resolution)
            r = reduced(cells, rows, columns, cull=cull, tolerance=tolerance)
            out[side] = Built(r.tree, *radius, rows, r.tau, r.l1, r.removed)
            task.advance()
    return out


def _radius_deg(n: int) -> tuple[Array, Array]:
    """Polar angles between which each cell of the square lies, [n, n] each."""
    k = np.abs(2.0 * np.arange(n + 1) / n - 1.0)
    low, high = np.minimum(k[1:], k[:-1]), np.maximum(k[1:], k[:-1])
    square = [np.maximum(v[:, None], v[None, :]) for v in (low, high)]
    return np.degrees(np.arcsin(square[0])), np.degrees(np.arcsin(square[1]))


def incident_tau(model: ScatteringModel, side: str, *, resolution: int) -> Array:
    """Direct-hemispherical value averaged over each incident cell, [n, n]; NaN where there are no data.

    Index [a, b] as in the file: the cell of the Shirley-Chiu square at (ux, -uy).
    """
    n = 1 << resolution
    if is_isotropic(model):
        shell, _, _, weight = _geometry(n, _shells(n), 8 * n)
        return (_shell_tau(model, side, n // 2 * _shells(n))[shell] * weight).sum(axis=2)
    k = 4 if n <= 32 else 2
    out = np.empty((n, n))
    for i in range(n):
        where = [_directions(i, j, n, k) for j in range(n)]
        theta, phi = (np.array(v) for v in zip(*where))
        out[i] = np.asarray(model.direct_hemispherical(side, theta, phi), float).mean(axis=1)
    return out


def _shells(n: int) -> int:
    """Parts of each ring of cells, along the radius, over which an isotropic sample is averaged."""
    return 4 if n <= 64 else 2


def _opposite(side: str) -> str:
    """The side whose light comes back along the same paths."""
    kind, face = side.split("_")
    return f"{kind}_{'back' if face == 'front' else 'front'}" if kind == "transmission" else side


def _follows(model: ScatteringModel, side: str) -> bool:
    """Whether a side is answered from the opposite one by reciprocity."""
    origin = getattr(model, "origin", None)
    return callable(origin) and str(origin(side)) == f"reciprocity of {_opposite(side)}"


def _geometry(n: int, parts: int, bins: int) -> tuple[NDArray[np.int64], Array, Array, Array]:
    """Where cells of the square lie, as shells of radius and azimuths.

    A cell lies in one ring of the square; at each radius it covers one interval of azimuth, whose ends are
    proportional to 1 / radius. Cells on the diagonals are triangles that meet there.

    Returns
    -------
    shell, low, high, weight, each [n, n, parts]: shell number out of n / 2 * parts, azimuths in bins, and the
    share of the cell that lies in the shell.
    """
    half = n // 2
    a, b = np.meshgrid(np.arange(n) - half, np.arange(n) - half, indexing="ij")
    # The lower and upper edge of |p| and |q|, in cells.
    p0, q0 = np.where(a >= 0, a, -a - 1), np.where(b >= 0, b, -b - 1)
    ring = np.maximum(p0, q0)
    step = (np.arange(parts) + 0.5) / parts
    r = ring[..., None] + step
    quarter = np.where(a >= 0, np.where(b >= 0, 0, 3), np.where(b >= 0, 1, 2))[..., None]
    minor = np.minimum(p0, q0)[..., None]
    # Azimuth from the nearer axis, 0 to 1 over 45 degrees.
    near, far = minor / r, np.minimum((minor + 1) / r, 1.0)
    diagonal = (p0 == q0)[..., None]
    far = np.where(diagonal, 2.0 - near, far)
    # Within a quarter of the circle, counted from its first axis: x in the first and third, y in the others.
    from_first = np.where(quarter % 2 == 0, (p0 >= q0)[..., None], (q0 >= p0)[..., None]) | diagonal
    low = 2.0 * quarter + np.where(from_first, near, 2.0 - far)
    high = 2.0 * quarter + np.where(from_first, far, 2.0 - near)
    weight = np.where(diagonal, step, 0.5)
    shell = (ring[..., None] * parts + np.arange(parts)).astype(np.int64)
    return shell, low * (bins / 8), high * (bins / 8), weight / weight.sum(axis=2, keepdims=True)


def _shell_tau(model: ScatteringModel, side: str, shells: int) -> Array:
    """Direct-hemispherical value averaged over shells of sin(theta_i), [shells]."""
    edge = np.arange(shells + 1) / shells
    return np.array(
        [
            bin_mean_tau(model, side, low=float(lo), high=float(hi), count=8 if hi > 0.9 else 3)
            for lo, hi in pairwise(edge)
        ]
    )


def _polar_means(model: ScatteringModel, side: str, theta: float, shells: int, bins: int) -> Array:
    """Means over shells of the outgoing radius and bins of azimuth, [shells, bins].

    Azimuth is that of the file, counted from the undeflected direction. Bins that hold many of the model's
    own points are averaged over as many.
    """
    q = model.quadrature(side, theta, 0.0)
    r, phi = np.hypot(q.ux, q.uy), np.arctan2(q.uy, -q.ux) % (2 * np.pi)
    i = np.minimum((r * shells).astype(int), shells - 1)
    j = np.minimum((phi * (bins / (2 * np.pi))).astype(int), bins - 1)
    own = np.bincount(i * bins + j, minlength=shells * bins)
    points = np.clip(2 ** np.ceil(0.5 * np.log2(np.maximum(own, 1))), 1, _FINEST).astype(int)
    out = np.empty(shells * bins)
    for k in np.unique(points):
        cells = np.flatnonzero(points == k)
        step = (np.arange(k) + 0.5) / k
        radius = ((cells // bins)[:, None, None] + step[None, :, None]) / shells
        turn = ((cells % bins)[:, None, None] + step[None, None, :]) * (2 * np.pi / bins)
        value = model.evaluate(side, theta, 0.0, -radius * np.cos(turn), radius * np.sin(turn))
        out[cells] = (np.nan_to_num(value) * radius).sum(axis=(1, 2)) / (radius.sum(axis=(1, 2)) * k)
    return out.reshape(shells, bins)


def _balanced(sums: Array, rows: Array, columns: Array | None) -> tuple[Array, Array]:
    """Factors of rows and columns of `sums` that give them these totals, rows exactly.

    Iterative proportional fitting (Deming and Stephan 1940, doi:10.1214/aoms/1177731829).
    """
    u, v = np.ones(sums.shape[0]), np.ones(sums.shape[1])
    for _ in range(8):
        if columns is not None:
            total = u @ sums
            v = np.where(total > 0, columns / np.where(total > 0, total, 1.0), 1.0).clip(0.5, 2.0)
        total = sums @ v
        u = np.where(total > 0, rows / np.where(total > 0, total, 1.0), 1.0)
    return u, v


def _isotropic(
    model: ScatteringModel, side: str, *, resolution: int
) -> tuple[NDArray[np.float32], Array, Array]:
    """Cells of the incident quarter [n/2, n/2, n, n], and what rows and columns add up to, [n, n] each."""
    n = 1 << resolution
    shells, bins = n // 2 * _shells(n), max(8 * n, 64)
    source = _opposite(side) if _follows(model, side) else side
    edge = np.arange(shells + 1) / shells
    mean = np.zeros((shells, shells, bins), np.float32)
    for k in range(shells):
        for theta, w in zip(*angles_between(float(edge[k]), float(edge[k + 1]), 2 if n <= 32 else 1)):
            mean[k] += w * _polar_means(model, source, float(theta), shells, bins)
    tau = _shell_tau(model, source, shells)
    known = np.isfinite(tau)
    if not known.all():
        mean, tau = _extended(mean, tau, source)
    other = _shell_tau(model, _opposite(side), shells) if _opposite(source) in model.sides else None
    area = np.pi * np.diff(edge**2)
    if source != side:
        # f_back(a -> b) = f_front(b -> a): both change places, and the azimuth between them its sign.
        mean = np.ascontiguousarray(mean.transpose(1, 0, 2)[:, :, ::-1])
        columns: Array | None = tau
        rows = _shell_tau(model, side, shells)
    else:
        rows = tau
        columns = other if other is not None and np.isfinite(other).all() else None
    # sums[i, o]: light of an incident shell into an outgoing one.
    between = mean.mean(axis=2, dtype=float)
    if columns is None:
        u, v = _balanced(between * area, rows, None)
    else:
        # Light between two shells is f area_i area_o; it adds up to rows area_i and to columns area_o.
        u, v = _balanced(between * np.outer(area, area), rows * area, columns * area)
    mean *= (u[:, None] * v[None, :]).astype(np.float32)[..., None]
    shell, low, high, weight = _geometry(n, _shells(n), bins)
    extended = np.concatenate([mean, mean[:, :, : bins // 2 + 2]], axis=2)
    first = np.concatenate([np.zeros((shells, shells, 1)), np.cumsum(extended, axis=2, dtype=float)], axis=2)
    second = np.zeros((shells, shells, extended.shape[2] + 1))
    np.cumsum(first[:, :, :-1] + 0.5 * extended, axis=2, out=second[:, :, 1:])
    del first, mean
    cells = kernel.isotropic_cells(extended, second, bins, shell, low, high, weight)
    total = (rows[shell] * weight).sum(axis=2)
    into = total if columns is None else (columns[shell] * weight).sum(axis=2)
    return cells, total, into


def _extended(mean: NDArray[np.float32], tau: Array, side: str) -> tuple[NDArray[np.float32], Array]:
    """Shells without data take those of the nearest shell that has some, and a warning says so."""
    holders = np.flatnonzero(np.isfinite(tau))
    if not holders.size:
        raise PhysicsError(f"the model has no data for {side.replace('_', ' ')} at any angle.")
    nearest = holders[np.abs(np.arange(tau.size)[:, None] - holders[None, :]).argmin(axis=1)]
    last = float(np.degrees(np.arcsin((holders[-1] + 1) / tau.size)))
    warnings.warn(
        f"{side.replace('_', ' ')}: no data for {tau.size - holders.size} of {tau.size} rings of incidence; "
        f"they repeat the nearest one (data end at {last:.1f} degrees).",
        SpeculariaWarning,
        stacklevel=2,
    )
    return mean[nearest], tau[nearest]


def _directions(i: int, j: int, n: int, k: int) -> tuple[Array, Array]:
    """theta_i, phi_i [k * k] in degrees within one incident cell."""
    step = (np.arange(k) + 0.5) / k
    a, b = np.meshgrid((i + step) / n, (j + step) / n, indexing="ij")
    x, y = square_to_disk(a.ravel(), b.ravel())
    return np.degrees(np.arcsin(np.minimum(np.hypot(x, y), 1.0))), np.degrees(np.arctan2(-y, x))


def _anisotropic(model: ScatteringModel, side: str, *, resolution: int, made: dict[str, _Filled]) -> _Filled:
    """Cells [n, n, n, n], each incident one of up to 2 x 2 directions, and what rows and columns add up to.

    What is in `made` is not made again; the side is added to it.
    """
    if side not in made:
        made[side] = _each_direction(model, side, resolution=resolution, made=made)
    return made[side]


def _each_direction(
    model: ScatteringModel, side: str, *, resolution: int, made: dict[str, _Filled]
) -> _Filled:
    n = 1 << resolution
    part = model.parts.get(side) if isinstance(model, XmlModel) else None
    if isinstance(part, TreePart) and part.tree.rank == 4:
        return _regridded(part.tree, resolution)
    if _follows(model, side):
        # f_back(a -> b) = f_front(b -> a). A direction's incident and outgoing cells lie opposite each other.
        cells, into, out_of = _anisotropic(model, _opposite(side), resolution=resolution, made=made)
        turned = cells[::-1, ::-1, ::-1, ::-1].transpose(2, 3, 0, 1)
        return np.ascontiguousarray(turned), out_of[::-1, ::-1], into[::-1, ::-1]
    rows = incident_tau(model, side, resolution=resolution)
    if not np.isfinite(rows).all():
        raise PhysicsError(f"the model has no data for {side.replace('_', ' ')} in some incident cells.")
    # The finer the cells, the less a distribution changes within one.
    means, within = None, [0, 1, 2, 3]
    if isinstance(model, TabulatedModel):
        means = TabulatedMeans(model, side, n=n, sparse=2.0 if n <= 32 else 4.0)
        within = within if n <= 32 else [0, 3] if n <= 64 else [0]
    cells = np.zeros((n, n, n, n), np.float32)
    for i in range(n):
        for j in range(n):
            theta, phi = _directions(i, j, n, 2 if len(within) > 1 else 1)
            for k in within:
                if means is None:
                    mean = _square_means(model, side, float(theta[k]), float(phi[k]), n)
                else:
                    mean = means.at(float(theta[k]), float(phi[k]))[::-1]
                cells[i, j] += mean / len(within)
    columns, other = None, _opposite(side)
    if other in model.sides and not _follows(model, other):
        columns = incident_tau(model, other, resolution=resolution)[::-1, ::-1]
    area = np.pi / n**2
    for _ in range(4):
        if columns is not None and np.isfinite(columns).all():
            total = cells.sum(axis=(0, 1), dtype=float) * area
            cells *= (columns / np.where(total > 0, total, 1.0)).clip(0.5, 2.0).astype(np.float32)
        total = cells.sum(axis=(2, 3), dtype=float) * area
        cells *= np.where(total > 0, rows / np.where(total > 0, total, 1.0), 1.0).astype(np.float32)[
            ..., None, None
        ]
    return cells, rows, cells.sum(axis=(0, 1), dtype=float) * area


def _regridded(tree: TensorTree, resolution: int) -> tuple[NDArray[np.float32], Array, Array]:
    """Cells of another tree of rank 4: their means, or its cells divided; their sums stay."""
    old = 1 << tree.resolution
    cells = np.asarray(tree_cells(*tree.arrays, tree.resolution)).reshape((old,) * 4)
    for _ in range(tree.resolution - resolution):
        cells = kernel.block_means(cells)
    for axis in range(4):
        cells = cells.repeat(1 << max(resolution - tree.resolution, 0), axis)
    area = np.pi / cells.shape[0] ** 2
    return (
        cells,
        cells.sum(axis=(2, 3), dtype=float) * area,
        cells.sum(axis=(0, 1), dtype=float) * area,
    )


def _square_means(model: ScatteringModel, side: str, theta: float, phi: float, n: int) -> Array:
    """Means over the outgoing cells of a file, which counts x the other way."""
    q = model.quadrature(side, theta, phi)
    own = cell_points(*disk_to_square(-q.ux, q.uy), n)
    return np.nan_to_num(
        refined_means(lambda x, y: model.evaluate(side, theta, phi, -x, y), square_to_disk, own)
    )
