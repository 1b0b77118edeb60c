"""Means of a tabulated model over the cells of a tree, by as few look-ups as its tables need.

`cells.cell_means` asks any model through its public face; it samples a cell by how many of the model's own
quadrature points lie in it, and the transmission of a side that is made by reciprocity takes a quadrature
of its own. Here the tables are looked up directly: a few points in every cell, more where the fine table
around the undeflected direction is, and the scale of a side by reciprocity read from a fine curve.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from specularia.bsdf.model import Array
from specularia.bsdf.tabulated import TabulatedModel
from specularia.conventions import square_to_disk
from specularia.errors import PhysicsError

__all__ = ["TabulatedMeans"]

_SPACING = 1.0 / 1024.0
"""Of points near the undeflected direction, in edges of the square: 8 along a cell of 2^7."""

_SCALES = 4097
"""Incident sines at which the scale of a side by reciprocity is taken."""


class TabulatedMeans:
    """Cell means of one side of a model, one incident angle at a time.

    Parameters
    ----------
    model : any tabulated model.
    side : one of its sides, those by reciprocity included where the model is isotropic.
    n : cells along an edge of the Shirley-Chiu square.
    sparse : by how much fewer points along an edge, for cells that are averaged over incident directions too.
    """

    def __init__(self, model: TabulatedModel, side: str, *, n: int, sparse: float = 1.0) -> None:
        self.model, self.side, self.n = model, side, n
        self.reciprocal = side not in model.tables
        self._prepared = model._prepared(side)
        self.table = self._prepared.table
        self._near = int(np.clip(1.0 / (sparse * n * _SPACING), 4, 16 / sparse))
        # Between the centres of four cells of the coarse table one point has the mean of them.
        self._far = int(np.clip(np.ceil(self._prepared.base.shape[1] / (2 * sparse * n)), 1, 4 / sparse))
        k = (np.arange(n * self._far) + 0.5) / (n * self._far)
        x, y = square_to_disk(*np.meshgrid(k, k, indexing="ij"))
        self._x, self._y = (self._cell_by_cell(v) for v in (x, y))
        if self.reciprocal:
            if not model.isotropic:
                raise PhysicsError("by reciprocity only an isotropic model is averaged here.")
            # Closer together towards grazing incidence, where the scale falls to 0.
            self._cosines = np.linspace(1.0, 0.0, _SCALES)[:-1]
            sines = np.sqrt(1.0 - self._cosines**2)
            self._scales = self._prepared._scale(sines, np.zeros(1))

    def at(self, theta_deg: float, phi_deg: float = 0.0) -> NDArray[np.float64]:
        """[n, n] means in 1/sr for one incident direction, index [a, b] of the square.

        The cells of a side by reciprocity add up to its light within 0.2 %.
        """
        s = float(np.sin(np.radians(theta_deg)))
        n = self.n
        # No cell is wider than four times the edge of the square's cells in direction cosines.
        reach = self.table.half_width + 4.0 / n
        phi = float(np.radians(phi_deg)) % (2.0 * np.pi)
        x, y = _turned(self._x, self._y, phi)
        near = np.flatnonzero((np.abs(x[:, 0] + s) < reach) & (np.abs(y[:, 0]) < reach))
        far = np.ones(n * n, bool)
        far[near] = False
        out = np.empty(n * n)
        out[far] = self._value(s, x[far], y[far], phi).mean(axis=1)
        step = (np.arange(self._near) + 0.5) / self._near
        a = ((near // n)[:, None, None] + step[None, :, None]) / n
        b = ((near % n)[:, None, None] + step[None, None, :]) / n
        fx, fy = (v.reshape(near.size, -1) for v in square_to_disk(*np.broadcast_arrays(a, b)))
        out[near] = self._value(s, *_turned(fx, fy, phi), phi).mean(axis=1)
        if not self.reciprocal:
            total = float(out.sum()) * np.pi / n**2
            tau = float(self.model.direct_hemispherical(self.side, theta_deg, phi_deg))
            out *= tau / total if total > 0 else 1.0
        return out.reshape(n, n)

    def _cell_by_cell(self, v: Array) -> Array:
        """[n n, points] from a grid over the whole square."""
        n, k = self.n, self._far
        return np.ascontiguousarray(v.reshape(n, k, n, k).transpose(0, 2, 1, 3).reshape(n * n, k * k))

    def _value(self, s: float, x: Array, y: Array, phi: float = 0.0) -> Array:
        """BSDF at directions turned by -phi, up to a factor common to all where the cells are scaled."""
        ux, uy = x.ravel(), y.ravel()
        if not self.reciprocal:
            return self._prepared._shape(np.array([s]), np.array([phi]), ux, uy).reshape(x.shape)
        zero = np.zeros(1)
        # f_back(a -> b) = f_front(b -> a), turned so that b lies at the azimuth 0.
        r = np.minimum(np.hypot(ux, uy), 1.0 - 1e-12)
        c, d = ux / np.maximum(r, 1e-12), uy / np.maximum(r, 1e-12)
        scale = np.interp(np.sqrt(1.0 - r * r), self._cosines[::-1], self._scales[::-1])
        return (self._prepared._shape(r, zero, s * c, -s * d) * scale).reshape(x.shape)


def _turned(x: Array, y: Array, phi: float) -> tuple[Array, Array]:
    """Directions in the frame in which light from the azimuth phi comes from phi_i = 0."""
    if phi == 0.0:
        return x, y
    c, d = np.cos(phi), np.sin(phi)
    return x * c + y * d, y * c - x * d
