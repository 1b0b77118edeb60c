"""The model of this package: distributions tabulated at a list of incident angles, and how they are joined.

Each incident angle has two tables of the BSDF: one of the whole hemisphere, on equal cells of projected solid
angle (the Shirley-Chiu square), and a finer one around the undeflected direction, where panes of window glass
send most of their light. Between two incident angles a distribution is carried along with the undeflected
direction instead of being blended in place, so that one lobe stays one lobe: the point at the share t of the
way from the undeflected direction to the horizon goes to the share g(t) of the same way in the table, where

    g(t) = k t / (1 + (k - 1) t),   k = (way to the horizon here) / (way to the horizon there),

which keeps lengths near the lobe (g'(0) = k), keeps the horizon (g(1) = 1) and never folds (ours). The result
is scaled to tau(theta_i), which a monotone cubic interpolates between the angles; beyond the last one it
follows the transmission of a clear flat pane, down to 0 at 90 degrees, and counts as extrapolated.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from specularia.bsdf._tabulated_kernel import evaluate_points
from specularia.bsdf.model import Array, Quadrature
from specularia.conventions import SIDES, disk_to_square, square_to_disk
from specularia.errors import CoverageError, FormatError, PhysicsError
from specularia.files import read_netcdf, write_netcdf

__all__ = ["SideTable", "TabulatedModel", "read_model", "write_model"]

FORMAT = "specularia scattering model 1"
_STEPS = 6
"""Subdivisions between two incident angles at which the integral of the carried distribution is taken."""


@dataclass(frozen=True)
class SideTable:
    """One side of an isotropic model: the sample turned under the beam, so that phi_i = 0 says all.

    Attributes
    ----------
    theta_i_deg : [N] incident angles, ascending, 0 <= theta < 90.
    base : [N, n, n] BSDF in 1/sr, mean over the cells of the unit square; index [a, b] with
        (ux, uy) = `conventions.square_to_disk`(a, b).
    patch : [N, m, m] BSDF in 1/sr, mean over m x m cells, index [x, y], of the square
        |ux + sin theta_i| <= half_width, |uy| <= half_width; cells beyond the unit disk do not matter.
    half_width : half the side of that square, in direction cosines.
    tau, tau_se : [N] direct-hemispherical transmission or reflection, with standard error.
    origin : "measured", "traced" or what else these numbers come from.
    base_se : [N, n, n] standard error of `base`, or None where it is unknown.
    blend : "log" joins neighbouring angles by the logarithm of the BSDF (few angles, little noise),
        "linear" by its value (many angles, noise of counting).
    """

    theta_i_deg: Array
    base: NDArray[np.float32]
    patch: NDArray[np.float32]
    half_width: float
    tau: Array
    tau_se: Array
    origin: str
    base_se: NDArray[np.float32] | None = None
    blend: str = "log"

    def __post_init__(self) -> None:
        theta, n = np.asarray(self.theta_i_deg, float), len(self.theta_i_deg)
        if n == 0 or np.any(np.diff(theta) <= 0) or theta[0] < 0 or theta[-1] >= 90:
            raise PhysicsError(f"incident angles must ascend within 0 <= theta < 90 degrees, not {theta}.")
        for name, shape in (("base", (n, *self.base.shape[1:])), ("patch", (n, *self.patch.shape[1:]))):
            found = getattr(self, name)
            if found.ndim != 3 or found.shape != shape or found.shape[1] != found.shape[2]:
                raise PhysicsError(f"{name} must have the shape [{n}, k, k], not {found.shape}.")
            if not np.all(np.isfinite(found)):
                raise PhysicsError(f"{name} holds values that are not finite.")
        if len(self.tau) != n or len(self.tau_se) != n:
            raise PhysicsError(f"tau and tau_se must hold {n} values.")
        if self.blend not in ("log", "linear"):
            raise PhysicsError(f"blend must be 'log' or 'linear', not {self.blend!r}.")


@dataclass(frozen=True)
class TabulatedModel:
    """An isotropic scattering model held as tables; see the module's text for what happens between them.

    Attributes
    ----------
    tables : one `SideTable` per side that was measured or traced.
    band : what light it is for, such as "520 nm" or "Visible".
    attributes : provenance.

    Notes
    -----
    Where one transmission side is missing it is answered from the other by reciprocity,
    f_back(a -> b) = f_front(b -> a) (Helmholtz; Stokes), and `origin` says so.
    """

    tables: Mapping[str, SideTable]
    band: str
    attributes: Mapping[str, str] = field(default_factory=dict)

    def __post_init__(self) -> None:
        unknown = set(self.tables) - set(SIDES)
        if unknown or not self.tables:
            raise PhysicsError(
                f"a model needs sides out of {', '.join(SIDES)}; found {sorted(unknown) or 'none'}."
            )

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
    def extrapolated_beyond_deg(self) -> dict[str, float]:
        """Last incident angle of each side that has data of its own."""
        return {s: float(t.theta_i_deg[-1]) for s, t in self.tables.items()}

    def evaluate(
        self, side: str, theta_i_deg: ArrayLike, phi_i_deg: ArrayLike, ux: ArrayLike, uy: ArrayLike
    ) -> Array:
        """BSDF in 1/sr; arguments broadcast.

        NaN where (ux, uy) lies outside the unit disk or theta_i outside [0, 90).
        """
        self._table(side)
        theta, phi, x, y = np.broadcast_arrays(
            np.asarray(theta_i_deg, float),
            np.radians(phi_i_deg),
            np.asarray(ux, float),
            np.asarray(uy, float),
        )
        good = (theta >= 0) & (theta < 90) & (x * x + y * y <= 1.0)
        s = np.sin(np.radians(np.where(good, theta, 0.0)))
        if side not in self.tables:
            # Reciprocity: the outgoing direction of this side is the incident one of the other.
            x, y, s, phi = s * np.cos(phi), s * np.sin(phi), np.hypot(x, y), np.arctan2(y, x)
            s = np.minimum(s, 1.0 - 1e-12)
        prepared = self._prepared(side if side in self.tables else _opposite(side))
        # Turned about the normal so that the light comes from phi_i = 0.
        c, d = np.cos(phi), np.sin(phi)
        value = prepared.value(
            np.where(good, s, 0.0).ravel(), (x * c + y * d).ravel(), (y * c - x * d).ravel()
        ).reshape(good.shape)
        return np.where(good, value, np.nan)

    def direct_hemispherical(self, side: str, theta_i_deg: ArrayLike, phi_i_deg: ArrayLike = 0.0) -> Array:
        """Direct-hemispherical transmission or reflection; NaN for theta_i outside [0, 90)."""
        theta, _ = np.broadcast_arrays(np.asarray(theta_i_deg, float), np.asarray(phi_i_deg, float))
        good = (theta >= 0) & (theta < 90)
        if side in self.tables:
            return np.where(good, self._prepared(side).tau(np.where(good, theta, 0.0)), np.nan)
        self._table(side)
        out = np.full(theta.shape, np.nan)
        for k in np.ndindex(theta.shape):
            if good[k]:
                q = self.quadrature(side, float(theta[k]))
                out[k] = np.sum(q.weight * self.evaluate(side, theta[k], 0.0, q.ux, q.uy))
        return out

    def quadrature(self, side: str, theta_i_deg: float, phi_i_deg: float = 0.0) -> Quadrature:
        """Cells of both tables around the undeflected direction, with their projected solid angles."""
        table = self._table(side)
        x, y, weight = _cells(
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

    def _prepared(self, side: str) -> _Prepared:
        return self._prepared_sides[side]

    @cached_property
    def _prepared_sides(self) -> dict[str, _Prepared]:
        return {s: _Prepared(t, transmission=s.startswith("transmission")) for s, t in self.tables.items()}


def _opposite(side: str) -> str:
    """The transmission side that answers for this one by reciprocity; reflection has none."""
    return {"transmission_front": "transmission_back", "transmission_back": "transmission_front"}.get(
        side, ""
    )


class _Prepared:
    """A side's tables with everything that evaluation needs worked out once."""

    def __init__(self, table: SideTable, *, transmission: bool) -> None:
        self.table = table
        self.transmission = transmission
        self.nodes = np.sin(np.radians(np.asarray(table.theta_i_deg, float)))
        self.base = np.maximum(np.ascontiguousarray(table.base, np.float32), np.float32(0))
        self.patch = np.stack(
            [
                _fill_beyond_horizon(np.maximum(p, np.float32(0)), s, table.half_width)
                for p, s in zip(np.asarray(table.patch, np.float32), self.nodes)
            ]
        )
        self._tau = _tau_curve(table, transmission=transmission)
        ends = np.concatenate([[0.0] if self.nodes[0] > 0 else [], self.nodes, [1.0 - 1e-9]])
        self.grid = np.unique(np.concatenate([np.linspace(a, b, _STEPS + 1) for a, b in pairwise(ends)]))
        self.integral = np.array([self._integral(float(s)) for s in self.grid])

    def tau(self, theta_deg: Array) -> Array:
        return self._tau(theta_deg)

    def _shape(self, s: Array, x: Array, y: Array) -> Array:
        return evaluate_points(
            s, x, y, self.nodes, self.base, self.patch, self.table.half_width, self.table.blend == "log"
        )

    def _integral(self, s: float) -> float:
        x, y, weight = _cells(s, self.base.shape[1], self.patch.shape[1], self.table.half_width)
        return float(np.sum(weight * self._shape(np.full(x.shape, s), x, y)))

    def value(self, s: Array, x: Array, y: Array) -> Array:
        """BSDF for light from phi_i = 0 at sin theta_i = s, towards the direction cosines (x, y)."""
        # Most calls ask for one incident angle and many outgoing directions.
        angles = s[:1] if s.size and np.all(s == s[0]) else s
        integral = np.interp(angles, self.grid, self.integral)
        tau = self._tau(np.degrees(np.arcsin(angles)))
        with np.errstate(divide="ignore", invalid="ignore"):
            scale = np.where(integral > 0, tau / integral, 0.0)
        return self._shape(s, x, y) * scale


def _tau_curve(table: SideTable, *, transmission: bool) -> Any:
    """tau(theta in degrees): monotone cubic, even about 0; like a clear flat pane beyond the last angle."""
    from scipy.interpolate import PchipInterpolator

    theta, tau = np.asarray(table.theta_i_deg, float), np.asarray(table.tau, float)
    mirrored = theta > 0
    knots = np.concatenate([-theta[mirrored][::-1], theta])
    values = np.concatenate([tau[mirrored][::-1], tau])
    inside = PchipInterpolator(knots, values) if knots.size > 1 else (lambda t: np.full(np.shape(t), tau[0]))
    last = theta[-1]

    def curve(t: Array) -> Array:
        flat = _flat_pane(t) / _flat_pane(np.array(last))
        beyond = tau[-1] * flat if transmission else 1.0 - (1.0 - tau[-1]) * flat
        return np.where(t <= last, inside(np.minimum(t, last)), beyond)

    return curve


def _flat_pane(theta_deg: ArrayLike, index: float = 1.52) -> Array:
    """Transmission of a clear flat pane in unpolarised light: mean over s and p of (1 - R)/(1 + R)."""
    c = np.cos(np.radians(theta_deg))
    t = np.sqrt(1.0 - (1.0 - c * c) / index**2)
    rs = ((c - index * t) / (c + index * t)) ** 2
    rp = ((t - index * c) / (t + index * c)) ** 2
    return 0.5 * ((1 - rs) / (1 + rs) + (1 - rp) / (1 + rp))


def _fill_beyond_horizon(patch: NDArray[np.float32], s: float, half_width: float) -> NDArray[np.float32]:
    """Cells whose centre lies beyond the horizon take the value at the horizon below them.

    Interpolation just inside the horizon then does not mix in an arbitrary zero.
    """
    m = patch.shape[0]
    cell = 2 * half_width / m
    offset = (np.arange(m) + 0.5) * cell - half_width
    x, y = np.meshgrid(offset - s, offset, indexing="ij")
    r = np.hypot(x, y)
    outside = r > 1.0
    if not outside.any():
        return patch
    pull = (1.0 - 0.75 * cell) / np.maximum(r, 1e-9)
    i = np.clip(((x * pull + s + half_width) / cell).astype(int), 0, m - 1)
    j = np.clip(((y * pull + half_width) / cell).astype(int), 0, m - 1)
    return np.where(outside, patch[i, j], patch).astype(np.float32)


_SUB = (np.arange(4) + 0.5) / 4 - 0.5


def _cells(s: float, n: int, m: int, half_width: float) -> tuple[Array, Array, Array]:
    """Centres and projected solid angles of both tables' cells; cut cells count with their inner share."""
    k = (np.arange(n) + 0.5) / n
    a, b = (v.ravel() for v in np.meshgrid(k, k, indexing="ij"))
    x, y = square_to_disk(a, b)
    # A base cell is at most 4/n wide; only those near the border of the patch can be cut by it.
    reach = np.maximum(np.abs(x + s), np.abs(y)) - half_width
    weight = np.where(reach > 0, np.pi / n**2, 0.0)
    near = np.flatnonzero(np.abs(reach) < 4.0 / n)
    da, db = (v.ravel() / n for v in np.meshgrid(_SUB, _SUB, indexing="ij"))
    sx, sy = square_to_disk(a[near, None] + da, b[near, None] + db)
    free = (np.abs(sx + s) > half_width) | (np.abs(sy) > half_width)
    x, y, weight = _cut(x, y, weight, near, sx, sy, free, np.pi / n**2)

    cell = 2 * half_width / m
    offset = (np.arange(m) + 0.5) * cell - half_width
    px, py = (v.ravel() for v in np.meshgrid(offset - s, offset, indexing="ij"))
    depth = 1.0 - np.hypot(px, py)
    share = np.where(depth > 0, cell**2, 0.0)
    rim = np.flatnonzero(np.abs(depth) < cell)
    dx, dy = (v.ravel() * cell for v in np.meshgrid(_SUB, _SUB, indexing="ij"))
    rx, ry = px[rim, None] + dx, py[rim, None] + dy
    px, py, share = _cut(px, py, share, rim, rx, ry, rx * rx + ry * ry <= 1.0, cell**2)

    x, y, weight = np.concatenate([x, px]), np.concatenate([y, py]), np.concatenate([weight, share])
    kept = weight > 0
    return x[kept], y[kept], weight[kept] * (np.pi / weight.sum())


def _cut(
    x: Array, y: Array, weight: Array, which: NDArray[np.intp], sx: Array, sy: Array, inside: Any, area: float
) -> tuple[Array, Array, Array]:
    """Move cut cells to the centre of their inner part and weigh them with its share."""
    count = inside.sum(axis=1)
    some = np.maximum(count, 1)
    x[which] = np.where(count > 0, (sx * inside).sum(axis=1) / some, x[which])
    y[which] = np.where(count > 0, (sy * inside).sum(axis=1) / some, y[which])
    weight[which] = area * count / inside.shape[1]
    return x, y, weight


def cell_centres(n: int) -> tuple[Array, Array]:
    """(ux, uy), each [n, n], at the centres of the base cells.

    >>> x, y = cell_centres(2)
    >>> bool(x[1, 1] > 0 and y[1, 1] > 0)
    True
    """
    k = (np.arange(n) + 0.5) / n
    a, b = np.meshgrid(k, k, indexing="ij")
    return square_to_disk(a, b)


def base_index(ux: ArrayLike, uy: ArrayLike, n: int) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Indices [a, b] of the base cells that hold the directions (ux, uy)."""
    a, b = disk_to_square(ux, uy)
    return (
        np.clip((a * n).astype(np.intp), 0, n - 1),
        np.clip((b * n).astype(np.intp), 0, n - 1),
    )


def write_model(model: TabulatedModel, path: str | Path) -> Path:
    """Write a model as netCDF-4: one group per side, provenance on the root."""
    import xarray as xr

    groups: dict[str, xr.Dataset] = {}
    for side, t in model.tables.items():
        variables: dict[str, Any] = {
            "bsdf_base": (("theta_i", "a", "b"), t.base, {"units": "1/sr"}),
            "bsdf_patch": (("theta_i", "x", "y"), t.patch, {"units": "1/sr"}),
            "tau": (("theta_i",), np.asarray(t.tau, float), {"units": "1"}),
            "tau_se": (("theta_i",), np.asarray(t.tau_se, float), {"units": "1"}),
        }
        if t.base_se is not None:
            variables["bsdf_base_se"] = (("theta_i", "a", "b"), t.base_se, {"units": "1/sr"})
        groups[side] = xr.Dataset(
            variables,
            coords={"theta_i": ("theta_i", np.asarray(t.theta_i_deg, float), {"units": "degree"})},
            attrs={"origin": t.origin, "half_width": float(t.half_width), "blend": t.blend},
        )
    root = {"format": FORMAT, "band": model.band, **model.attributes}
    return write_netcdf(path, groups, root)


def read_model(path: str | Path) -> TabulatedModel:
    """Read a model written by `write_model`; a FormatError for any other file."""
    groups = read_netcdf(path)
    attributes = {str(k): str(v) for k, v in groups["/"].attrs.items()}
    if attributes.pop("format", None) != FORMAT:
        raise FormatError(
            file=path,
            expected=f"a scattering model (attribute format = {FORMAT!r})",
            found="another netCDF file",
            advice="Models are written by `gonio fit` and `glass trace`.",
        )
    band = attributes.pop("band", "Visible")
    try:
        tables = {
            side: SideTable(
                theta_i_deg=g["theta_i"].values.astype(float),
                base=g["bsdf_base"].values,
                patch=g["bsdf_patch"].values,
                half_width=float(g.attrs["half_width"]),
                tau=g["tau"].values.astype(float),
                tau_se=g["tau_se"].values.astype(float),
                origin=str(g.attrs["origin"]),
                base_se=g["bsdf_base_se"].values if "bsdf_base_se" in g else None,
                blend=str(g.attrs["blend"]),
            )
            for side, g in groups.items()
            if side in SIDES
        }
        return TabulatedModel(tables=tables, band=band, attributes=attributes)
    except (KeyError, PhysicsError) as error:
        raise FormatError(
            file=path, expected="the tables of a scattering model", found=f"none or broken ones ({error})"
        ) from error
