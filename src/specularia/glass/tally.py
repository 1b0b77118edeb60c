"""What the paths of one incident direction add up to: shares of the light, and its distribution over cells.

Everything is summed for each randomised replicate by itself. The spread of the replicates gives the standard
errors of shares and of cells, however evenly the paths of one replicate were started.
"""
# Compiled functions carry no annotations: their types follow from the call.
# mypy: disallow-untyped-defs=False, disallow-untyped-calls=False

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numba as nb
import numpy as np
from numpy.typing import NDArray

from specularia.glass.effort import REPLICATES
from specularia.glass.kernel import BACK, FRONT, SIDES
from specularia.glass.merging import LARGEST_BLOCK, merge_sparse

if TYPE_CHECKING:
    from specularia.glass.trace import Paths

__all__ = ["BASE_CELLS", "HALF_WIDTH", "PATCH_CELLS", "Bins", "Distribution", "Tally", "mean_and_error"]

Array = NDArray[np.float64]

BASE_CELLS = 128
PATCH_CELLS = 96
HALF_WIDTH = 0.12
"""A base cell is 0.8 degrees wide around the normal; a patch cell, within 7 degrees of the undeflected
direction, 0.14 degrees."""

NOISE_CELLS = 64
"""Noise is stated on 64 x 64 cells of equal projected solid angle, those of an XML of resolution 6."""


def mean_and_error(per_replicate: Array) -> tuple[Array, Array]:
    """Mean over the last axis, the replicates, and its standard error."""
    error = per_replicate.std(axis=-1, ddof=1) / np.sqrt(per_replicate.shape[-1])
    return per_replicate.mean(axis=-1), error


@dataclass(frozen=True)
class Distribution:
    """Light that left one face: where it went and how much of it there was.

    Attributes
    ----------
    base, base_se : [n, n] BSDF in 1/sr and its standard error, see `bsdf.SideTable`.
    patch, patch_se : [m, m] the same around the undeflected direction.
    share, share_se : of the light that arrived.
    noise : expected integral of |BSDF - truth| over projected solid angle, over the share; see `Bins.noise`.
    """

    base: NDArray[np.float32]
    base_se: NDArray[np.float32]
    patch: NDArray[np.float32]
    patch_se: NDArray[np.float32]
    share: float
    share_se: float
    noise: float


class Bins:
    """Sums of path weights over the cells of base and patch, for each replicate; transmitted and reflected.

    Parameters
    ----------
    theta_deg : incident angle from the normal of the face the light arrives on.
    turn_deg : azimuth the light comes from; directions are binned in the frame turned so that it is 0.
    """

    def __init__(self, theta_deg: float, turn_deg: float = 0.0) -> None:
        self.sine = math.sin(math.radians(theta_deg))
        self.turn = math.radians(turn_deg)
        self.base = np.zeros((2, REPLICATES, BASE_CELLS**2))
        self.base_square = np.zeros((2, BASE_CELLS**2))
        self.patch = np.zeros((2, REPLICATES, PATCH_CELLS**2))
        self.patch_square = np.zeros((2, PATCH_CELLS**2))
        self.heaviest = np.zeros(2)

    def add(self, paths: Paths) -> None:
        """Count some paths."""
        _count(
            paths.ux,
            paths.uy,
            paths.weight,
            paths.exit_side,
            paths.replicate,
            BACK if paths.side == "front" else FRONT,
            FRONT if paths.side == "front" else BACK,
            math.cos(self.turn),
            math.sin(self.turn),
            self.sine,
            HALF_WIDTH,
            BASE_CELLS,
            PATCH_CELLS,
            self.base,
            self.base_square,
            self.patch,
            self.patch_square,
            self.heaviest,
        )

    def noise(self, kind: int) -> float:
        """Expected normalised L1 distance of the distribution from the truth.

        The integral of |estimate - truth| over projected solid angle, over the light, on `NOISE_CELLS`
        squared cells. The error of a cell counts as normal with its standard error s, whose mean modulus is
        sqrt(2 / pi) s. Where no light left, 0.
        """
        half = BASE_CELLS // NOISE_CELLS
        cells = self.base[kind].reshape(REPLICATES, NOISE_CELLS, half, NOISE_CELLS, half)
        cells = cells.sum(axis=2).sum(axis=-1)
        light = float(cells.sum())
        if light == 0.0:
            return 0.0
        spread = math.sqrt(REPLICATES) * cells.std(axis=0, ddof=1)
        return math.sqrt(2.0 / math.pi) * float(spread.sum()) / light

    def distribution(self, kind: int, paths: int, share: float, share_se: float) -> Distribution:
        """BSDF in 1/sr: weight over the cell's projected solid angle, per path; kind 0 is transmitted."""
        n, m = BASE_CELLS, PATCH_CELLS
        base, base_se = merge_sparse(
            self.base[kind].reshape(-1, n, n),
            self.base_square[kind].reshape(n, n),
            np.full((n, n), paths * np.pi / n**2),
        )
        # Cells cut by the horizon count with the part of them that directions can fall into.
        area = _inside_disk(self.sine) * (2.0 * HALF_WIDTH / m) ** 2
        patch, patch_se = merge_sparse(
            self.patch[kind].reshape(-1, m, m), self.patch_square[kind].reshape(m, m), paths * area
        )
        # Where no path arrived the truth may still be that of a single one in the largest block.
        least_base = self.heaviest[kind] * n**2 / (paths * np.pi * LARGEST_BLOCK**2)
        least_patch = self.heaviest[kind] / (paths * LARGEST_BLOCK**2 * (2.0 * HALF_WIDTH / m) ** 2)
        return Distribution(
            base=base.astype(np.float32),
            base_se=np.maximum(base_se, least_base).astype(np.float32),
            patch=patch.astype(np.float32),
            patch_se=np.maximum(patch_se, least_patch).astype(np.float32),
            share=share,
            share_se=share_se,
            noise=self.noise(kind),
        )


class Tally:
    """Running sums of one incident direction.

    Parameters
    ----------
    bins : to count directions too, or None for the energy balance alone.
    """

    def __init__(self, bins: Bins | None = None) -> None:
        self.bins = bins
        self.sums = np.zeros((4, REPLICATES))
        self.paths = 0
        self.lost = 0

    def add(self, part: Paths) -> None:
        """Count some paths."""
        through = BACK if part.side == "front" else FRONT
        _sum(part.exit_side, part.weight, part.absorbed, part.replicate, through, self.sums)
        self.lost += part.lost
        self.paths += len(part)
        if self.bins is not None:
            self.bins.add(part)

    @property
    def shares(self) -> tuple[Array, Array]:
        """([4] light transmitted, reflected, absorbed, out of the sides of a patch; [4] standard errors)."""
        return mean_and_error(self.sums * (REPLICATES / self.paths))

    @property
    def error(self) -> float:
        """The larger of tau's relative standard error and the noise of the transmitted distribution."""
        share, error = self.shares
        if share[0] <= 0.0:
            return math.inf
        relative = float(error[0] / share[0])
        return relative if self.bins is None else max(relative, self.bins.noise(0))


def _inside_disk(sine: float, parts: int = 8) -> Array:
    """Share [m, m] of each patch cell that lies inside the unit disk, counted on a finer grid."""
    fine = (np.arange(PATCH_CELLS * parts) + 0.5) * (2.0 * HALF_WIDTH / (PATCH_CELLS * parts)) - HALF_WIDTH
    inside = (fine[:, None] - sine) ** 2 + fine[None, :] ** 2 <= 1.0
    cells = inside.reshape(PATCH_CELLS, parts, PATCH_CELLS, parts).mean(axis=(1, 3))
    # A sliver thinner than the finer grid may still have caught a path.
    return np.where(cells > 0.0, cells, 0.5 / parts**2)


@nb.njit(inline="always")
def _cell(x, y, n):
    """Index of the base cell of a direction, as `conventions.disk_to_square` puts it on the unit square."""
    r = math.sqrt(x * x + y * y)
    phi = math.atan2(y, x)
    if phi < -0.25 * math.pi:
        phi += 2.0 * math.pi
    # Quarter of the square, counted from the one around phi = 0; the others are that one turned.
    quarter = int((phi + 0.25 * math.pi) * (2.0 / math.pi))
    p = r
    q = r * (phi - quarter * 0.5 * math.pi) * (4.0 / math.pi)
    for _ in range(quarter):
        p, q = -q, p
    a = min(max(int(0.5 * (p + 1.0) * n), 0), n - 1)
    b = min(max(int(0.5 * (q + 1.0) * n), 0), n - 1)
    return a * n + b


@nb.njit(cache=True)
def _sum(exit_side, weight, absorbed, replicate, through, sums):
    """Add paths to the sums of `Tally`, one after the other."""
    for i in range(exit_side.size):
        r = replicate[i]
        sums[2, r] += absorbed[i]
        side = exit_side[i]
        if side == through:
            sums[0, r] += weight[i]
        elif side in (FRONT, BACK):
            sums[1, r] += weight[i]
        elif side == SIDES:
            sums[3, r] += weight[i]


@nb.njit(cache=True)
def _count(
    ux, uy, weight, exit_side, replicate, through, back, co, si, sine, half_width, n, m,
    base, base_square, patch, patch_square, heaviest,
):  # fmt: skip
    """Add paths to the sums of `Bins`, turned by the azimuth whose cosine and sine are co and si."""
    scale = m / (2.0 * half_width)
    for i in range(ux.size):
        if exit_side[i] == through:
            kind = 0
        elif exit_side[i] == back:
            kind = 1
        else:
            continue
        x = ux[i] * co + uy[i] * si
        y = uy[i] * co - ux[i] * si
        w = weight[i]
        c = _cell(x, y, n)
        base[kind, replicate[i], c] += w
        base_square[kind, c] += w * w
        heaviest[kind] = max(heaviest[kind], w)
        j = math.floor((x + sine + half_width) * scale)
        k = math.floor((y + half_width) * scale)
        if 0 <= j < m and 0 <= k < m:
            c = j * m + k
            patch[kind, replicate[i], c] += w
            patch_square[kind, c] += w * w
