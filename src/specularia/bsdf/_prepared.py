"""One side of a tabulated model with all that its evaluation needs worked out once."""

from __future__ import annotations

from functools import cached_property
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from specularia.bsdf._tabulated_kernel import evaluate_points, spread_points
from specularia.bsdf._tabulated_tau import TauOfSide
from specularia.bsdf.model import Array
from specularia.bsdf.side_table import SideTable, base_index
from specularia.bsdf.tabulated_cells import fill_beyond_horizon, quadrature_cells

__all__ = ["Prepared"]

_DEGREE = 6
"""Of the polynomial in the angle, between two rings, that stands for the integral of the carried
distribution, taken at Chebyshev's points. It keeps the light of lobes of 1 to 3 degrees to parts in 1e4."""

_NODES = -np.cos(np.pi * np.arange(_DEGREE + 1) / _DEGREE)

_AZIMUTH_STEP = np.radians(12.0)
"""The same between azimuths: at most this far apart."""

_FULL = 2.0 * np.pi


class Prepared:
    """Tables of one side, the rings that their directions make, integrals, and tau over all directions."""

    def __init__(self, table: SideTable, *, transmission: bool) -> None:
        self.table = table
        sines = np.sin(np.radians(np.asarray(table.theta_i_deg, float)))
        self.rings, start = np.unique(sines, return_index=True)
        self.base = np.maximum(np.ascontiguousarray(table.base, np.float32), np.float32(0))
        self.patch = _filled(table.patch, sines, table.half_width)
        nodes = _nodes(table, np.append(start, sines.size))
        self.first, self.azimuth, self.which, self.mirrored = nodes
        self._tau = TauOfSide(table, *nodes[:3], transmission=transmission)
        inner = [0.0] if self.rings[0] > 0 else []
        self._ends = np.arcsin(np.concatenate([inner, self.rings, [1.0 - 1e-9]]))
        self._angles = np.append(
            np.concatenate([a + (b - a) * 0.5 * (_NODES[:-1] + 1.0) for a, b in pairwise(self._ends)]),
            self._ends[-1],
        )
        self.azimuths = _azimuth_grid(nodes[1])
        # One azimuth more than there are: the first again, a full turn later.
        self._integrals = np.full((self._angles.size, self.azimuths.size), np.nan)

    def tau(self, theta_deg: Array, phi: Array) -> Array:
        return self._tau.value(theta_deg, phi)

    def tau_interval(self, theta_deg: Array, phi: Array, level: float) -> tuple[Array, Array]:
        return self._tau.interval(theta_deg, phi, level)

    def _shape(self, s: Array, phi: Array, x: Array, y: Array) -> Array:
        t = self.table
        return evaluate_points(
            s,
            phi,
            x,
            y,
            self.rings,
            self.first,
            self.azimuth,
            self.which,
            self.mirrored,
            self.base,
            self.patch,
            t.half_width,
            t.blend == "log",
        )

    def _integral(self, i: NDArray[np.intp], j: NDArray[np.intp]) -> Array:
        """Integrals of the carried distribution at nodes of the grid, taken when they are first asked for."""
        missing = np.isnan(self._integrals[i, j])
        for a in np.unique(i[missing]):
            s = np.sin(self._angles[a : a + 1])
            x, y, weight = quadrature_cells(
                float(s[0]), self.base.shape[1], self.patch.shape[1], self.table.half_width
            )
            for b in np.unique(j[missing & (i == a)]):
                value = np.sum(weight * self._shape(s, self.azimuths[b : b + 1] % _FULL, x, y))
                self._integrals[a, b] = value
        return self._integrals[i, j]

    def _scale(self, s: Array, phi: Array) -> Array:
        """What makes the carried distribution's integral tau; 0 where there is no light."""
        theta = np.arcsin(s)
        interval, share = _between(theta, self._ends)
        integral = np.zeros(np.broadcast_shapes(s.shape, phi.shape))
        for j in range(_DEGREE + 1):
            weight = np.ones(s.shape)
            for k in range(_DEGREE + 1):
                if k != j:
                    weight *= (2.0 * share - 1.0 - _NODES[k]) / (_NODES[j] - _NODES[k])
            # Most calls are for one angle that is a node itself: no other integral is taken then.
            if weight.any():
                integral += weight * self._along_azimuth(interval * _DEGREE + j, phi)
        tau = self.tau(np.degrees(theta), phi)
        with np.errstate(divide="ignore", invalid="ignore"):
            return np.where(integral > 0, tau / integral, 0.0)

    def _along_azimuth(self, i: NDArray[np.intp], phi: Array) -> Array:
        if self.azimuths.size == 1:
            return self._integral(i, np.zeros_like(i))
        j, v = _between((phi - self.azimuths[0]) % _FULL + self.azimuths[0], self.azimuths)
        after = (j + 1) % (self.azimuths.size - 1)
        return (1.0 - v) * self._integral(i, j) + v * self._integral(i, after)

    def value(self, s: Array, phi: Array, x: Array, y: Array) -> Array:
        """BSDF for light from sin theta_i = s and azimuth phi (radians, 0 to 2 pi), each [K] or [1].

        (x, y) [K] are outgoing direction cosines in the frame turned so that the light comes from phi_i = 0.
        """
        return self._shape(s, phi, x, y) * self._scale(s, phi)

    def standard_error(self, s: Array, phi: Array, x: Array, y: Array) -> Array:
        """Standard error of `value` in 1/sr; NaN where the tables hold none."""
        t = self.table
        if t.base_se is None:
            return np.full(x.shape, np.nan)
        noise, apart = spread_points(
            s,
            phi,
            x,
            y,
            self.rings,
            self.first,
            self.azimuth,
            self.which,
            self.mirrored,
            self.base,
            self.patch,
            self._errors[0],
            self._errors[1],
            t.half_width,
        )
        scale = self._scale(s, phi)
        theta = np.degrees(np.arcsin(s))
        tau = self.tau(theta, phi)
        off = np.divide(self._tau.interpolation_error(theta, phi), tau, out=np.zeros_like(tau), where=tau > 0)
        return np.sqrt((noise**2 + apart**2) * scale**2 + (off * scale * self._shape(s, phi, x, y)) ** 2)

    @cached_property
    def _errors(self) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
        """Errors of both tables; where only those of the base are known, the patch's as for counted light."""
        t = self.table
        base = np.ascontiguousarray(t.base_se, np.float32)
        if t.patch_se is not None:
            return base, np.ascontiguousarray(t.patch_se, np.float32)
        n, m = self.base.shape[1], self.patch.shape[1]
        offset = ((np.arange(m) + 0.5) / m * 2.0 - 1.0) * t.half_width
        # The variance of a mean over counted light goes inversely with the cell's area.
        growth = np.float32(np.sqrt(np.pi / n**2) / (2.0 * t.half_width / m))
        patch = np.empty(self.patch.shape, np.float32)
        for k, s in enumerate(np.sin(np.radians(t.theta_i_deg))):
            x, y = np.meshgrid(offset - s, offset, indexing="ij")
            patch[k] = growth * base[k][base_index(x, y, n)]
        return base, patch


def _between(v: Array, grid: Array) -> tuple[NDArray[np.intp], Array]:
    """Index of the grid's node below each value and the share of the next one."""
    i = np.clip(np.searchsorted(grid, v, side="right") - 1, 0, max(grid.size - 2, 0))
    if grid.size == 1:
        return i, np.zeros_like(v)
    return i, np.clip((v - grid[i]) / (grid[i + 1] - grid[i]), 0.0, 1.0)


def _filled(patch: NDArray[np.float32], sines: Array, half_width: float) -> NDArray[np.float32]:
    low = np.maximum(np.asarray(patch, np.float32), np.float32(0))
    return np.stack([fill_beyond_horizon(p, s, half_width) for p, s in zip(low, sines)])


def _nodes(
    table: SideTable, start: NDArray[np.intp]
) -> tuple[NDArray[np.int64], Array, NDArray[np.int64], NDArray[np.bool_]]:
    """Nodes ring by ring: first of each ring, azimuth in radians, table, whether seen in the mirror."""
    if table.phi_i_deg is None:
        count = len(table.theta_i_deg)
        return np.arange(count + 1), np.empty(0), np.arange(count), np.zeros(count, bool)
    first, azimuth, which, mirrored = [0], [], [], []
    for a, b in pairwise(start):
        phi, own = np.asarray(table.phi_i_deg[a:b], float), np.arange(a, b)
        seen = np.zeros(b - a, bool)
        if table.symmetry == "bilateral":
            # In the mirror's own plane an azimuth is its own image.
            image = np.abs(np.sin(np.radians(phi - table.mirror_deg))) > 1e-6
            image &= table.theta_i_deg[a] > 0
            phi = np.concatenate([phi, 2.0 * table.mirror_deg - phi[image]])
            own = np.concatenate([own, own[image]])
            seen = np.concatenate([seen, np.ones(np.count_nonzero(image), bool)])
        turned = np.radians(phi) % _FULL
        order = np.argsort(turned)
        azimuth.append(turned[order])
        which.append(own[order])
        mirrored.append(seen[order])
        first.append(first[-1] + phi.size)
    return np.array(first), np.concatenate(azimuth), np.concatenate(which), np.concatenate(mirrored)


def _azimuth_grid(azimuth: Array) -> Array:
    """Azimuths at which integrals are taken, the first again at the end; a single 0 without azimuths."""
    if azimuth.size == 0:
        return np.zeros(1)
    nodes = np.unique(np.round(azimuth, 9))
    nodes = np.append(nodes, nodes[0] + _FULL)
    parts = [np.linspace(a, b, int(np.ceil((b - a) / _AZIMUTH_STEP)) + 1)[:-1] for a, b in pairwise(nodes)]
    return np.append(np.concatenate(parts), nodes[-1])
