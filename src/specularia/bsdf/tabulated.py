"""The model of this package: distributions tabulated at some incident directions, and how they are joined.

Each incident direction has two tables of the BSDF: one of the whole hemisphere, on equal cells of projected
solid angle (the Shirley-Chiu square), and a finer one around the undeflected direction, where panes of window
glass send most of their light. Between two incident angles a distribution is carried along with the
undeflected direction instead of being blended in place, so that one lobe stays one lobe: the point at the
share t of the way from the undeflected direction to the horizon goes to the share g(t) of the same way in the
table, where

    g(t) = k t / (1 + (k - 1) t),   k = (way to the horizon here) / (way to the horizon there),

which keeps lengths near the lobe (g'(0) = k), keeps the horizon (g(1) = 1) and never folds (ours). Between
two azimuths of incidence it is carried in the same way in the frame of the sample: to first order a pane
deflects light by its slopes, which stay where they are when the light comes from elsewhere, so an elongated
lobe keeps its direction on the sample. The result is scaled to tau, which a monotone cubic interpolates
between the angles; beyond the last one it follows the transmission of a clear flat pane, down to 0 at 90
degrees, and counts as extrapolated.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from specularia.bsdf._prepared import Prepared
from specularia.bsdf.model import Array, Quadrature
from specularia.bsdf.side_table import SideTable, base_index, cell_centres
from specularia.bsdf.tabulated_cells import quadrature_cells
from specularia.conventions import SIDES
from specularia.errors import CoverageError, PhysicsError

__all__ = ["SideTable", "TabulatedModel", "base_index", "cell_centres"]

_FULL = 2.0 * np.pi


@dataclass(frozen=True)
class TabulatedModel:
    """A scattering model held as tables; see the module's text for what happens between them.

    Attributes
    ----------
    tables : one `SideTable` per side that was measured or traced.
    band : what light it is for, such as "520 nm" or "Visible".
    attributes : provenance.
    more : the tables of further bands of the same sample, such as CIE-X and CIE-Z beside Visible.

    Notes
    -----
    Where one transmission side is missing it is answered from the other by reciprocity,
    f_back(a -> b) = f_front(b -> a) (Helmholtz; Stokes), and `origin` says so.
    """

    tables: Mapping[str, SideTable]
    band: str
    attributes: Mapping[str, str] = field(default_factory=dict)
    more: Mapping[str, Mapping[str, SideTable]] = field(default_factory=dict)

    def __post_init__(self) -> None:
        unknown = set(self.tables) - set(SIDES)
        if unknown or not self.tables:
            raise PhysicsError(
                f"a model needs sides out of {', '.join(SIDES)}; found {sorted(unknown) or 'none'}."
            )

    @property
    def bands(self) -> tuple[str, ...]:
        """Bands that the model holds, its own first."""
        return (self.band, *self.more)

    def in_band(self, band: str) -> TabulatedModel:
        """The model of another of its bands, which keeps none of the others; CIE-Y and Visible are one."""
        wanted = ("Visible" if band.casefold() == "cie-y" else band).casefold()
        for name, tables in ((self.band, self.tables), *self.more.items()):
            if name.casefold() == wanted:
                return TabulatedModel(tables=tables, band=name, attributes=self.attributes)
        raise CoverageError(f"no band {band} in this model; it holds {', '.join(self.bands)}.")

    @property
    def sides(self) -> tuple[str, ...]:
        """Sides the model answers for, those by reciprocity included."""
        return tuple(s for s in SIDES if s in self.tables or _opposite(s) in self.tables)

    def origin(self, side: str) -> str:
        """Where the numbers of a side come from."""
        if side in self.tables:
            return self.tables[side].origin
        self._table(side)
        return f"reciprocity of {_opposite(side)}"

    @property
    def isotropic(self) -> bool:
        """Whether the sample may be turned about its normal."""
        return all(t.isotropic for t in self.tables.values())

    @property
    def extrapolated_beyond_deg(self) -> dict[str, float]:
        """Last incident angle of each side that has data of its own."""
        return {s: float(t.theta_i_deg[-1]) for s, t in self.tables.items()}

    def evaluate(
        self, side: str, theta_i_deg: ArrayLike, phi_i_deg: ArrayLike, ux: ArrayLike, uy: ArrayLike
    ) -> Array:
        """BSDF in 1/sr; arguments broadcast.

        NaN where (ux, uy) lies outside the unit disk or theta_i outside [0, 90).
        """
        return self._at(Prepared.value, side, theta_i_deg, phi_i_deg, ux, uy)

    def standard_error(
        self, side: str, theta_i_deg: ArrayLike, phi_i_deg: ArrayLike, ux: ArrayLike, uy: ArrayLike
    ) -> Array:
        """Standard error of `evaluate` in 1/sr; arguments broadcast.

        The noise of the tables, carried as their values are; to it is added what the interpolation may be off
        between the tabulated directions: how far the tables around disagree, once carried to the direction
        asked for, and the error of tau there. Beyond the last incident angle it grows on.

        NaN where `evaluate` gives NaN, and everywhere for tables without errors.
        """
        return self._at(Prepared.standard_error, side, theta_i_deg, phi_i_deg, ux, uy)

    def _at(
        self,
        what: Callable[[Prepared, Array, Array, Array, Array], Array],
        side: str,
        theta_i_deg: ArrayLike,
        phi_i_deg: ArrayLike,
        ux: ArrayLike,
        uy: ArrayLike,
    ) -> Array:
        """`what` of the side's tables at pairs of directions, NaN outside."""
        self._table(side)
        theta, phi = np.broadcast_arrays(np.asarray(theta_i_deg, float), np.asarray(phi_i_deg, float))
        x, y = np.asarray(ux, float), np.asarray(uy, float)
        shape = np.broadcast_shapes(theta.shape, x.shape, y.shape)
        if theta.size > 1 or side not in self.tables:
            # Otherwise one incident direction stands for all, which saves most of the work on it.
            theta, phi, x, y = np.broadcast_arrays(theta, phi, x, y)
        good = (theta >= 0) & (theta < 90) & (x * x + y * y <= 1.0)
        s = np.sin(np.radians(np.where((theta >= 0) & (theta < 90), theta, 0.0)))
        phi = np.mod(np.radians(phi), _FULL)
        if side not in self.tables:
            # Reciprocity: the outgoing direction of this side is the incident one of the other.
            x, y, s, phi = s * np.cos(phi), s * np.sin(phi), np.hypot(x, y), np.arctan2(y, x) % _FULL
            s = np.where(good, np.minimum(s, 1.0 - 1e-12), 0.0)
        # Turned about the normal so that the light comes from phi_i = 0.
        c, d = np.cos(phi), np.sin(phi)
        turned_x, turned_y = np.broadcast_to(x * c + y * d, shape), np.broadcast_to(y * c - x * d, shape)
        value = what(self._prepared(side), s.ravel(), phi.ravel(), turned_x.ravel(), turned_y.ravel())
        return np.where(good, value.reshape(shape), np.nan)

    def direct_hemispherical(self, side: str, theta_i_deg: ArrayLike, phi_i_deg: ArrayLike = 0.0) -> Array:
        """Direct-hemispherical transmission or reflection; NaN for theta_i outside [0, 90)."""
        theta, phi = np.broadcast_arrays(np.asarray(theta_i_deg, float), np.asarray(phi_i_deg, float))
        good = (theta >= 0) & (theta < 90)
        prepared = self._prepared(side)
        if side in self.tables:
            return np.where(good, prepared.tau(np.where(good, theta, 0.0), np.radians(phi) % _FULL), np.nan)
        out = np.full(theta.shape, np.nan)
        for k in np.ndindex(theta.shape):
            if good[k]:
                q = self.quadrature(side, float(theta[k]), float(phi[k]))
                out[k] = np.sum(q.weight * self.evaluate(side, theta[k], phi[k], q.ux, q.uy))
        return out

    def tau_interval(
        self, side: str, theta_i_deg: ArrayLike, phi_i_deg: ArrayLike = 0.0, *, level: float = 0.95
    ) -> tuple[Array, Array]:
        """Lower and upper end of the interval that holds `direct_hemispherical` with the probability `level`.

        At the tabulated angles it is that of their noise; between and beyond them it also has what the
        interpolation may be off. NaN for theta_i outside [0, 90).
        """
        theta, phi = np.broadcast_arrays(np.asarray(theta_i_deg, float), np.asarray(phi_i_deg, float))
        good = (theta >= 0) & (theta < 90)
        prepared = self._prepared(side)
        inner, turned = np.where(good, theta, 0.0), np.radians(phi) % _FULL
        low, high = prepared.tau_interval(inner, turned, level)
        if side not in self.tables:
            # Of the same width, relatively, as that of the side it is made from.
            share = self.direct_hemispherical(side, theta, phi) / prepared.tau(inner, turned)
            low, high = low * share, high * share
        return np.where(good, low, np.nan), np.where(good, high, np.nan)

    def quadrature(self, side: str, theta_i_deg: float, phi_i_deg: float = 0.0) -> Quadrature:
        """Cells of both tables around the undeflected direction, with their projected solid angles."""
        table = self._table(side)
        x, y, weight = quadrature_cells(
            float(np.sin(np.radians(theta_i_deg))),
            table.base.shape[1],
            table.patch.shape[1],
            table.half_width,
        )
        c, d = np.cos(np.radians(phi_i_deg)), np.sin(np.radians(phi_i_deg))
        return Quadrature(ux=x * c - y * d, uy=x * d + y * c, weight=weight)

    def _table(self, side: str) -> SideTable:
        table = self.tables.get(side) or self.tables.get(_opposite(side))
        if table is None:
            raise CoverageError(
                f"this model has no {side.replace('_', ' ')}; it holds {', '.join(self.sides)}."
            )
        return table

    def _prepared(self, side: str) -> Prepared:
        """The tables that answer for a side: its own, or the other side's by reciprocity."""
        self._table(side)
        return self._prepared_sides[side if side in self.tables else _opposite(side)]

    @cached_property
    def _prepared_sides(self) -> dict[str, Prepared]:
        return {s: Prepared(t, transmission=s.startswith("transmission")) for s, t in self.tables.items()}


def _opposite(side: str) -> str:
    """The transmission side that answers for this one by reciprocity; reflection has none."""
    return {"transmission_front": "transmission_back", "transmission_back": "transmission_front"}.get(
        side, ""
    )
