"""Where the finds lie, as a smooth density over the plan."""

from __future__ import annotations

import itertools
import warnings
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from specularia.errors import CoverageError, PhysicsError, SpeculariaWarning
from specularia.finds.catalogue import Finds
from specularia.finds.plan import Area, Plan

__all__ = ["KernelDensity", "kernel_density", "places"]

Array = NDArray[np.float64]

_CELLS = 400
_TRUNCATE = 4.0


@dataclass(frozen=True)
class KernelDensity:
    """Finds per square metre on a grid.

    Parameters
    ----------
    x_m, y_m : [C], [R] centres of the cells, metres.
    count_per_m2, weight_g_per_m2 : [R, C], row 0 at the lowest y; NaN outside the areas of the plan. Their
        integral is the number and the weight of the finds that have a place in them.
    bandwidth_m : standard deviation of the kernel.
    placed_count, placed_weight_g : of the finds that have a place.
    at_m : [N, 2] places of the rows; NaN where unknown.
    """

    x_m: Array
    y_m: Array
    count_per_m2: Array
    weight_g_per_m2: Array
    bandwidth_m: float
    placed_count: int
    placed_weight_g: float
    at_m: Array


def places(finds: Finds, plan: Plan) -> Array:
    """[N, 2] place of each row in metres: its coordinates, else the middle of its square; NaN without both.

    Raises
    ------
    CoverageError : coordinates in pixels and a plan without a picture.
    """
    out = np.full((len(finds.find_number), 2), np.nan)
    middle = {a.name: a.middle_m for a in plan.of_kind("square")}
    for k, square in enumerate(finds.square):
        if square in middle:
            out[k] = middle[square]
    if finds.x is not None and finds.y is not None:
        x, y = finds.x, finds.y
        if finds.coordinate_unit == "px":
            if plan.picture is None:
                raise CoverageError(
                    f"{finds.file.name} has coordinates in pixels and {plan.file.name} no picture: give a "
                    "plan in TOML with picture and metres_per_pixel."
                )
            x, y = plan.picture.metres(x, y)
        known = np.isfinite(x) & np.isfinite(y)
        out[known] = np.stack([x, y], axis=1)[known]
    return out


def kernel_density(finds: Finds, plan: Plan, *, bandwidth_m: float | None = None) -> KernelDensity:
    """Smooth the finds with a Gaussian kernel, kept within the areas of the plan.

    At each place the sum of kernels is divided by the part of a kernel there that lies within the areas
    (rooms and squares together; Diggle 1985), so that evenly strewn finds come out even up to the walls; the
    whole is then scaled to the number and weight that it stands for. Without areas nothing is cut.

    Parameters
    ----------
    finds : with coordinates, or with squares that the plan has.
    plan : areas, or a picture.
    bandwidth_m : standard deviation of the kernel; None takes Scott's rule, n^(-1/6) times the geometric mean
        of the standard deviations along x and y, with n rows.

    Raises
    ------
    CoverageError : fewer than 3 rows have a place.

    References
    ----------
    P. Diggle, J. R. Stat. Soc. C 34 (1985) 138, doi:10.2307/2347366. D. W. Scott, Multivariate Density
    Estimation, 1992, doi:10.1002/9780470316849.
    """
    from scipy.ndimage import gaussian_filter

    at = places(finds, plan)
    placed = np.isfinite(at[:, 0])
    if placed.sum() < 3:
        raise CoverageError(
            f"{finds.file.name}: {int(placed.sum())} rows have a place (coordinates, or a square of the "
            "plan); a density needs 3."
        )
    points = at[placed]
    if bandwidth_m is None:
        spread = points.std(axis=0, ddof=1)
        bandwidth_m = float(np.sqrt(max(spread[0] * spread[1], 0.0)) * len(points) ** (-1.0 / 6.0))
    if not 0.0 < bandwidth_m < np.inf:
        raise PhysicsError(f"a bandwidth of {bandwidth_m:g} m is none; name one with bandwidth_m.")
    corners = [rings[0] for a in plan.areas for rings in a.polygons]
    edge = 0.0 if corners else _TRUNCATE * bandwidth_m
    low, high = (np.concatenate([*corners, points]) for _ in range(2))
    low, high = low.min(axis=0) - edge, high.max(axis=0) + edge
    cell = max(float((high - low).max()) / _CELLS, 1e-9)
    if cell > bandwidth_m / 2.0:
        # A kernel narrower than the cells would not be one; half of it is as fine as a figure shows.
        cell = max(bandwidth_m / 2.0, float((high - low).max()) / (4 * _CELLS))
    columns, rows = (np.maximum(1, np.ceil((high - low) / cell - 1e-9))).astype(int)
    x, y = low[0] + (np.arange(columns) + 0.5) * cell, low[1] + (np.arange(rows) + 0.5) * cell
    inside = _inside(plan.areas, x, y) if plan.areas else np.ones((rows, columns), bool)
    column = np.clip(((points[:, 0] - low[0]) / cell).astype(int), 0, columns - 1)
    row = np.clip(((points[:, 1] - low[1]) / cell).astype(int), 0, rows - 1)
    lost = ~inside[row, column]
    if lost.any():
        warnings.warn(
            f"{int(lost.sum())} of {len(points)} rows with a place lie outside the areas of "
            f"{plan.file.name}; they are left out of the smoothed density.",
            SpeculariaWarning,
            stacklevel=2,
        )

    def smooth(values: Array) -> Array:
        return np.asarray(
            gaussian_filter(values, bandwidth_m / cell, mode="constant", truncate=_TRUNCATE), float
        )

    kept = smooth(inside.astype(float))
    out = []
    count = finds.count[placed].astype(float)
    weight = np.nan_to_num(finds.weight_g[placed])
    for value in (count, weight):
        held = np.zeros((rows, columns))
        np.add.at(held, (row[~lost], column[~lost]), value[~lost])
        dense = np.divide(smooth(held), kept, out=np.zeros_like(held), where=inside)
        whole = dense.sum() * cell**2
        dense *= held.sum() / whole if whole > 0 else 0.0
        out.append(np.where(inside, dense, np.nan))
    return KernelDensity(
        x_m=x,
        y_m=y,
        count_per_m2=out[0],
        weight_g_per_m2=out[1],
        bandwidth_m=bandwidth_m,
        placed_count=int(count[~lost].sum()),
        placed_weight_g=float(weight[~lost].sum()),
        at_m=at,
    )


def _inside(areas: tuple[Area, ...], x: Array, y: Array) -> NDArray[np.bool_]:
    """[R, C] whether the centre of a cell lies in one of the areas (even-odd rule along each row)."""
    out = np.zeros((y.size, x.size), bool)
    for area in areas:
        for rings in area.polygons:
            odd = np.zeros_like(out)
            for ring in rings:
                for (x0, y0), (x1, y1) in itertools.pairwise(ring):
                    crosses = (y0 > y) != (y1 > y)
                    if not crosses.any():
                        continue
                    at = x0 + (y[crosses] - y0) / (y1 - y0) * (x1 - x0)
                    odd[crosses] ^= x[None, :] < at[:, None]
            out |= odd
    return out
