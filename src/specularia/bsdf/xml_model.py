"""Scattering models that stand in WINDOW XML files: Klems matrices and tensor trees.

In these files, as in Radiance, a direction of ours (ux, uy) has x_R = -ux, y_R = uy on all four sides, and
"Front" is light arriving on our front. A tree of rank 3 is looked up with the undeflected direction turned to
x_R > 0, which is our phi_i = 0; a Klems patch of the incident direction is found from the direction the light
travels to, so that undeflected light stays in the patch of the same number.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

from specularia.bsdf._query_kernel import cell_values, klems_values, tree_cells, tree_values
from specularia.bsdf.cells import grid
from specularia.bsdf.klems import KlemsBasis
from specularia.bsdf.model import Array, Quadrature
from specularia.bsdf.tensor_tree import TensorTree
from specularia.conventions import SIDES, disk_to_square, square_to_disk
from specularia.errors import CoverageError

__all__ = ["KlemsPart", "Part", "TreePart", "XmlModel", "circle_sum", "column_sum"]

_FTINY = 1e-6
"""Radiance keeps this distance from the middle of a rank-3 tree: normal incidence reads its lower half."""
_MANY, _CELLS_LOG2 = 20_000, 24
"""From this many values on a tree is read through a table of all its cells, if it has no more than 2^24."""


class Part(Protocol):
    """The data of one side."""

    @property
    def isotropic(self) -> bool: ...

    @property
    def negative(self) -> int: ...

    def value(self, first: Array, second: Array, ux: Array, uy: Array, *, angles: bool = False) -> Array:
        """BSDF in 1/sr between the incident direction cosines (first, second) and the outgoing ones, all [K].

        With `angles` the incident directions are (theta, phi) in degrees. NaN where either direction lies
        outside the unit disk, or theta outside [0, 90).
        """

    def tau(self, ix: Array, iy: Array) -> Array:
        """Direct-hemispherical value for incident direction cosines [K]."""

    def quadrature(self, ix: float, iy: float) -> Quadrature: ...


@dataclass(frozen=True)
class KlemsPart:
    """A matrix between the patches of two bases.

    Attributes
    ----------
    matrix : [outgoing patches, incident patches] BSDF in 1/sr.
    incident, outgoing : the bases.
    """

    matrix: Array
    incident: KlemsBasis
    outgoing: KlemsBasis

    @property
    def isotropic(self) -> bool:
        return False

    @property
    def negative(self) -> int:
        return int(np.count_nonzero(self.matrix < 0))

    def value(self, first: Array, second: Array, ux: Array, uy: Array, *, angles: bool = False) -> Array:
        matrix = np.ascontiguousarray(self.matrix, float)
        bases = self.incident.arrays, self.outgoing.arrays
        return np.asarray(klems_values(matrix, *bases, first, second, ux, uy, angles))

    def tau(self, ix: Array, iy: Array) -> Array:
        sums = self.outgoing.solid_angle @ np.maximum(self.matrix, 0.0)
        return np.asarray(sums[self.incident.index(ix, -iy)])

    def quadrature(self, ix: float, iy: float) -> Quadrature:
        x, y, w = self.outgoing.points(2, 2)
        return Quadrature(ux=-x, uy=y, weight=w)

    def reversed(self) -> KlemsPart:
        """The matrix for light from the other side, by reciprocity: rows and columns change places."""
        return KlemsPart(
            matrix=self.matrix[np.ix_(self.outgoing.opposite, self.incident.opposite)].T,
            incident=self.outgoing,
            outgoing=self.incident,
        )


@dataclass(frozen=True)
class TreePart:
    """A tensor tree seen with our directions."""

    tree: TensorTree

    @property
    def isotropic(self) -> bool:
        return self.tree.rank == 3

    @property
    def negative(self) -> int:
        return self.tree.negative

    def position(self, ix: Array, iy: Array, ux: Array, uy: Array) -> Array:
        """Positions [K, rank] in the tree; all arguments [K]."""
        s = np.hypot(ix, iy)
        if self.tree.rank == 3:
            c, d = (
                np.where(s > 0, ix / np.where(s > 0, s, 1), 1.0),
                np.where(s > 0, iy / np.where(s > 0, s, 1), 0.0),
            )
            a, b = disk_to_square(-(ux * c + uy * d), uy * c - ux * d)
            return np.stack([(0.5 - _FTINY) - 0.5 * s, a, b], axis=-1)
        return np.stack([*disk_to_square(ix, -iy), *disk_to_square(-ux, uy)], axis=-1)

    @cached_property
    def _cells(self) -> NDArray[np.float32]:
        return np.asarray(tree_cells(*self.tree.arrays, self.tree.resolution))

    def value(self, first: Array, second: Array, ux: Array, uy: Array, *, angles: bool = False) -> Array:
        rank, resolution = self.tree.rank, self.tree.resolution
        if ux.size >= _MANY and rank * resolution <= _CELLS_LOG2:
            # Many values are worth a table of all cells, which is read at once instead of level by level.
            table = (rank, resolution, self._cells)
            return np.asarray(cell_values(*table, _FTINY, first, second, ux, uy, angles))
        return np.asarray(tree_values(*self.tree.arrays, _FTINY, first, second, ux, uy, angles))

    def _incident(self, ix: float, iy: float) -> Array:
        zero = np.zeros(1)
        return self.position(np.array([ix]), np.array([iy]), zero, zero)[0, : self.tree.rank - 2]

    def tau(self, ix: Array, iy: Array) -> Array:
        out = np.empty(ix.shape)
        for k in range(ix.size):
            _, _, size, value = self.tree.outgoing(self._incident(float(ix[k]), float(iy[k])))
            out[k] = np.pi * np.sum(size**2 * np.maximum(value, 0.0))
        return out

    def quadrature(self, ix: float, iy: float) -> Quadrature:
        a, b, size, _ = self.tree.outgoing(self._incident(ix, iy))
        x, y = square_to_disk(a + 0.5 * size, b + 0.5 * size)
        ux, uy = -x, y
        s = float(np.hypot(ix, iy))
        if self.tree.rank == 3 and s > 0:
            c, d = ix / s, iy / s
            ux, uy = ux * c - uy * d, ux * d + uy * c
        return Quadrature(ux=ux, uy=uy, weight=np.pi * size**2)


@dataclass(frozen=True)
class ReversedTree:
    """The other transmission side of a tree, by reciprocity.

    Looked up as it stands, a tree of rank 3 would give this side a direct-hemispherical value that jumps
    within each ring of its cells (see `circle_sum`). The values are scaled to the mean over the ring.
    """

    part: TreePart

    @property
    def isotropic(self) -> bool:
        return self.part.isotropic

    @property
    def negative(self) -> int:
        return self.part.negative

    def value(self, first: Array, second: Array, ux: Array, uy: Array, *, angles: bool = False) -> Array:
        ix, iy = first, second
        if angles:
            sine = np.where((first >= 0) & (first < 90), np.sin(np.radians(first)), np.nan)
            ix, iy = sine * np.cos(np.radians(second)), sine * np.sin(np.radians(second))
        s = np.hypot(ix, iy)
        # On the normal itself one cell would stand for all azimuths; next to it all four around it do.
        return self.part.value(ux, uy, np.where(s == 0, 1e-9, ix), iy) * self._scale(s)

    @cached_property
    def _rings(self) -> tuple[Array, Array, Array]:
        """Radii, `circle_sum` at them, and its mean over each ring (by Simpson's rule, weight s ds)."""
        rings = 1 << (self.part.tree.resolution - 1)
        radii = (np.arange(rings)[:, None] + np.array([1e-9, 0.5, 1 - 1e-9])) / rings
        sums = circle_sum(self.part.tree, radii.ravel()).reshape(radii.shape)
        weight = radii * np.array([1.0, 4.0, 1.0])
        return radii.ravel(), sums.ravel(), (sums * weight).sum(axis=1) / weight.sum(axis=1)

    def _ring_mean(self, s: Array) -> Array:
        mean = self._rings[2]
        return mean[np.minimum((np.nan_to_num(s) * mean.size).astype(int), mean.size - 1)]

    def _scale(self, s: Array) -> Array:
        if self.part.tree.rank == 4:
            return np.ones(np.shape(s))
        radii, sums, _ = self._rings
        here = np.interp(s, radii, sums)
        return np.where(here > 0, self._ring_mean(s) / np.where(here > 0, here, 1.0), 1.0)

    def tau(self, ix: Array, iy: Array) -> Array:
        if self.part.tree.rank == 3:
            return self._ring_mean(np.hypot(ix, iy))
        out = np.empty(ix.shape)
        for k in range(ix.size):
            q = self.quadrature(float(ix[k]), float(iy[k]))
            one = np.ones(q.ux.size)
            out[k] = np.sum(q.weight * self.value(ix[k] * one, iy[k] * one, q.ux, q.uy))
        return out

    def quadrature(self, ix: float, iy: float) -> Quadrature:
        # The cells of a tree of rank 4 are those of this grid; a tree of rank 3 has rings across it.
        n = 1 << max(self.part.tree.resolution, 5 if self.part.tree.rank == 4 else 8)
        x, y = grid(n)
        return Quadrature(ux=-x.ravel(), uy=y.ravel(), weight=np.full(n * n, np.pi / n**2))


def circle_sum(tree: TensorTree, s: Array) -> Array:
    """What a tree of rank 3 sends towards a polar angle, from all incident directions together.

    The integral over the incident hemisphere of the BSDF towards (s, phi), averaged over phi: by reciprocity
    the direct-hemispherical value of the other side. Cells of the square are rings cut into pieces whose
    angular width shrinks as 1/s, so within a ring the sum does not stay constant as it should: for lobes
    narrow in azimuth it goes as (middle of the ring) / s. On the normal all azimuths read one and the same
    cell.

    Parameters
    ----------
    tree : of rank 3.
    s : [N] sine of the polar angle, 0 <= s < 1.

    Returns
    -------
    [N], between 0 and 1 for trees that conserve energy.
    """
    bins = 1 << (tree.resolution - 1)
    edges = 1.0 - np.arange(bins + 1) / bins
    t = (np.arange(bins) + 0.5) / (2 * bins)
    out = np.empty(len(s))
    for k, radius in enumerate(s):
        # In the unit square the circle is a square, whose sides cross cells at multiples of 1/bins.
        cuts = np.unique(np.clip(np.arange(-bins, bins + 1) / bins, -radius, radius))
        along, length = 0.5 * (cuts[1:] + cuts[:-1]), np.diff(cuts)
        if radius == 0:
            along, length = np.zeros(1), np.ones(1)
        edge = np.full(along.size, radius)
        p = np.concatenate([edge, along, -edge, along])
        q = np.concatenate([along, edge, along, -edge])
        weight = np.tile(length / (4 * length.sum()), 4)
        position = np.stack(
            [np.repeat(t, p.size), np.tile(0.5 + 0.5 * p, bins), np.tile(0.5 + 0.5 * q, bins)], axis=-1
        )
        mean = np.maximum(tree.lookup(position), 0.0).reshape(bins, -1) @ weight
        out[k] = np.pi * np.sum((edges[:-1] ** 2 - edges[1:] ** 2) * mean)
    return out


def column_sum(tree: TensorTree, ux: Array, uy: Array) -> Array:
    """What a tree of rank 4 sends into the cell that holds (ux, uy) [N], from all incident cells together."""
    a, b = disk_to_square(-ux, uy)
    out = np.empty(a.shape)
    for k in range(a.size):
        _, _, size, value = tree.incoming(np.array([a[k], b[k]]))
        out[k] = np.pi * np.sum(size**2 * np.maximum(value, 0.0))
    return out


@dataclass(frozen=True)
class XmlModel:
    """One band of an XML file as a scattering model.

    Attributes
    ----------
    parts : the sides that the file holds.
    band : Visible, Solar, CIE-X ...
    attributes : what else the file says about the material.
    structure : IncidentDataStructure of the file: Columns, Rows, TensorTree3 or TensorTree4.
    bands : all bands of the file.
    geometry : the file's Geometry element as text, empty where it has none.
    all_bands : the sides of every band of the file, this one included.
    """

    parts: Mapping[str, Part]
    band: str
    structure: str
    bands: tuple[str, ...]
    attributes: Mapping[str, str] = field(default_factory=dict)
    geometry: str = ""
    all_bands: Mapping[str, Mapping[str, Part]] = field(default_factory=dict)

    @property
    def sides(self) -> tuple[str, ...]:
        """Sides the model answers for; a missing transmission side is answered by reciprocity."""
        return tuple(s for s in SIDES if s in self.parts or _opposite(s) in self.parts)

    def origin(self, side: str) -> str:
        """Where the numbers of a side come from: the file's own word, "file", or reciprocity."""
        if side in self.parts:
            return self.attributes.get(side, "file")
        self._part(side)
        return f"reciprocity of {_opposite(side)}"

    @property
    def isotropic(self) -> bool:
        """Whether all sides are trees of rank 3."""
        return all(p.isotropic for p in self.parts.values())

    @property
    def rank(self) -> int | None:
        """3 or 4 for tensor trees, None for matrices."""
        trees = [p.tree.rank for p in self.parts.values() if isinstance(p, TreePart)]
        return trees[0] if trees else None

    @property
    def resolution(self) -> int | None:
        """log2 of the finest cells along an edge, for trees; None for matrices."""
        trees = [p.tree.resolution for p in self.parts.values() if isinstance(p, TreePart)]
        return max(trees) if trees else None

    @property
    def basis(self) -> str:
        """Name of the angle basis."""
        names = {p.incident.name for p in self.parts.values() if isinstance(p, KlemsPart)}
        return ", ".join(sorted(names)) if names else "LBNL/Shirley-Chiu"

    def evaluate(
        self, side: str, theta_i_deg: ArrayLike, phi_i_deg: ArrayLike, ux: ArrayLike, uy: ArrayLike
    ) -> Array:
        """BSDF in 1/sr; arguments broadcast; NaN outside the unit disk or for theta_i outside [0, 90)."""
        part = self._part(side)
        arguments = (np.asarray(v, float) for v in (theta_i_deg, phi_i_deg, ux, uy))
        theta, phi, x, y = np.broadcast_arrays(*arguments)
        value = part.value(theta.ravel(), phi.ravel(), x.ravel(), y.ravel(), angles=True)
        return value.reshape(theta.shape)

    def direct_hemispherical(self, side: str, theta_i_deg: ArrayLike, phi_i_deg: ArrayLike = 0.0) -> Array:
        """Direct-hemispherical transmission or reflection; NaN for theta_i outside [0, 90)."""
        part = self._part(side)
        theta, phi = np.broadcast_arrays(np.asarray(theta_i_deg, float), np.radians(phi_i_deg))
        good = (theta >= 0) & (theta < 90)
        out = np.full(theta.shape, np.nan)
        s = np.sin(np.radians(theta[good]))
        out[good] = part.tau(s * np.cos(phi[good]), s * np.sin(phi[good]))
        return out

    def quadrature(self, side: str, theta_i_deg: float, phi_i_deg: float = 0.0) -> Quadrature:
        """Points whose weights integrate the distribution exactly: leaves of a tree, parts of patches."""
        s, phi = np.sin(np.radians(theta_i_deg)), np.radians(phi_i_deg)
        return self._part(side).quadrature(float(s * np.cos(phi)), float(s * np.sin(phi)))

    @cached_property
    def _answering(self) -> dict[str, Part]:
        """The parts that answer for each side, those by reciprocity included."""
        out: dict[str, Part] = {}
        for side in self.sides:
            other = self.parts.get(_opposite(side))
            if side in self.parts:
                out[side] = self.parts[side]
            elif isinstance(other, KlemsPart):
                out[side] = other.reversed()
            elif isinstance(other, TreePart):
                out[side] = ReversedTree(other)
        return out

    def _part(self, side: str) -> Part:
        if side not in self._answering:
            raise CoverageError(
                f"no {side.replace('_', ' ')} in the band {self.band} of this file, "
                f"only {', '.join(self.sides)}."
            )
        return self._answering[side]


def _opposite(side: str) -> str:
    return {"transmission_front": "transmission_back", "transmission_back": "transmission_front"}.get(
        side, ""
    )
