"""What a view holds of scattering models: values at fixed outgoing directions, coded in 16 bits."""

from __future__ import annotations

import base64
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any, Final

import numpy as np
from numpy.typing import NDArray

from specularia.report.figures.curves import near_plane

if TYPE_CHECKING:
    from specularia.bsdf import ScatteringModel
    from specularia.gonio import Table

__all__ = ["GRID", "Directions", "Grid", "coded", "errors_coded", "measured_data", "side_data"]

Array = NDArray[np.float64]

NO_DATA, FLOOR, FIRST, LAST = 0, 1, 2, 65535
"""Codes of a value: no data; at or below zero; lowest and highest value of the logarithmic scale."""

ERROR_LOW, ERROR_HIGH, ERROR_STEPS = -4.0, 2.0, 254
"""Decades of the relative standard error between the codes 1 and 255; 0 means none."""

_MOST_POINTS: Final = 1500
"""Measured points that a section draws of one table at most."""


@dataclass(frozen=True)
class Grid:
    """Outgoing directions of a view: the hemisphere evenly, finer around the undeflected direction.

    All are points of the equidistant projection (x, y in degrees; distance from the middle is the polar
    angle).

    Parameters
    ----------
    step_deg : distance of the points that cover the hemisphere.
    fine_deg : distance of those around the undeflected direction.
    fine_half : steps from that direction to the edge of the fine square.
    section_deg : distance of the points in the plane of incidence.
    """

    step_deg: float = 2.0
    fine_deg: float = 0.5
    fine_half: int = 24
    section_deg: float = 0.5

    @cached_property
    def base(self) -> Array:
        """Points [K, 2] over the hemisphere, row by row from the lowest y up."""
        n = round(180.0 / self.step_deg)
        at = (np.arange(n) + 0.5) * self.step_deg - 90.0
        x, y = np.meshgrid(at, at)
        inside = np.hypot(x, y) < 90.0
        return np.stack([x[inside], y[inside]], axis=1)

    @cached_property
    def fine(self) -> Array:
        """Offsets [K, 2] of the fine points from the undeflected direction."""
        at = np.arange(-self.fine_half, self.fine_half + 1) * self.fine_deg
        x, y = np.meshgrid(at, at)
        return np.stack([x.ravel(), y.ravel()], axis=1)

    @cached_property
    def section(self) -> Array:
        """Signed polar angles [K] in the plane of incidence, degrees; positive towards the light."""
        n = round(180.0 / self.section_deg)
        return np.asarray((np.arange(n) + 0.5) * self.section_deg - 90.0, float)

    @property
    def stride(self) -> int:
        """Values of one incident direction."""
        return len(self.base) + len(self.fine) + len(self.section)

    def points(self, theta_i_deg: float, phi_i_deg: float) -> tuple[Array, Array]:
        """Direction cosines (ux, uy) of all points [stride]; NaN below the horizon."""
        c, s = np.cos(np.radians(phi_i_deg)), np.sin(np.radians(phi_i_deg))
        centre = -theta_i_deg * np.array([c, s])
        along = self.section[:, None] * np.array([c, s])
        x, y = np.concatenate([self.base, self.fine + centre, along]).T
        polar = np.hypot(x, y)
        # In this projection the direction cosines are sin(polar) / polar times the place.
        scale = np.where(polar < 90.0, np.radians(1.0) * np.sinc(polar / 180.0), np.nan)
        return x * scale, y * scale


GRID: Final = Grid()


@dataclass(frozen=True)
class Directions:
    """Incident directions of a view: every polar angle with every azimuth, degrees."""

    theta_deg: tuple[float, ...]
    phi_deg: tuple[float, ...] = (0.0,)

    @property
    def count(self) -> int:
        return len(self.theta_deg) * len(self.phi_deg)


def coded(values: Array) -> tuple[NDArray[np.uint16], float, float]:
    """Logarithms as 16-bit codes, with log10 of the first code and the step between two.

    At most ten decades below the largest value are told apart; the step is then 0.035 %.
    """
    positive = values[np.isfinite(values) & (values > 0)]
    high = float(np.log10(positive.max())) if positive.size else 0.0
    low = max(high - 10.0, float(np.log10(positive.min()))) if positive.size else -1.0
    step = max(high - low, 1e-9) / (LAST - FIRST)
    with np.errstate(divide="ignore", invalid="ignore"):
        code = FIRST + np.rint((np.log10(values) - low) / step)
    code = np.where(values > 0, np.clip(code, FIRST, LAST), FLOOR)
    return np.where(np.isfinite(values), code, NO_DATA).astype(np.uint16), low, step


def errors_coded(values: Array, errors: Array) -> NDArray[np.uint8]:
    """Relative standard errors as 8-bit codes, to 3 %; 0 where there is none to give."""
    with np.errstate(divide="ignore", invalid="ignore"):
        decade = np.log10(errors / values)
    code = 1 + np.rint((decade - ERROR_LOW) / (ERROR_HIGH - ERROR_LOW) * ERROR_STEPS)
    known = np.isfinite(decade) & (values > 0)
    return np.where(known, np.clip(code, 1, 1 + ERROR_STEPS), 0).astype(np.uint8)


def side_data(model: ScatteringModel, side: str, directions: Directions, grid: Grid = GRID) -> dict[str, Any]:
    """One side of a model: codes of the BSDF and its standard error, and direct-hemispherical values."""
    values, errors = [], []
    standard_error = getattr(model, "standard_error", None)
    top = 0.0
    # One call for the curve and for the angles of the slider: a side made by reciprocity integrates for each.
    fine = np.unique([*np.arange(0.0, 90.0, 2.0), 89.9, *directions.theta_deg])
    over = [np.asarray(model.direct_hemispherical(side, fine, phi), float) for phi in directions.phi_deg]
    tau = np.array(over).T[np.searchsorted(fine, directions.theta_deg)]
    for t, theta in enumerate(directions.theta_deg):
        for p, phi in enumerate(directions.phi_deg):
            ux, uy = grid.points(theta, phi)
            inside = np.isfinite(ux)
            found, off = np.full(grid.stride, np.nan), np.full(grid.stride, np.nan)
            if np.isfinite(tau[t, p]):
                found[inside] = model.evaluate(side, theta, phi, ux[inside], uy[inside])
                if standard_error is not None:
                    off[inside] = standard_error(side, theta, phi, ux[inside], uy[inside])
                dsf = found[inside] * np.sqrt(1.0 - ux[inside] ** 2 - uy[inside] ** 2)
                top = max(top, float(np.nanmax(dsf, initial=0.0)))
            values.append(found)
            errors.append(off)
    table = np.stack(values)
    codes, low, step = coded(table)
    error_codes = errors_coded(table, np.stack(errors))
    own = getattr(model, "tables", {}).get(side)
    knots: list[list[float]] = []
    if own is not None and getattr(model, "isotropic", False):
        knots = [
            [round(float(v), 7) for v in k]
            for k in zip(own.theta_i_deg, np.ravel(own.tau), np.ravel(own.tau_se))
        ]
    return {
        "codes": base64.b64encode(codes.astype("<u2").tobytes()).decode(),
        "low": low,
        "step": step,
        "top": top,
        "errors": base64.b64encode(error_codes.tobytes()).decode() if error_codes.any() else None,
        "tau": [[_number(v) for v in row] for row in tau],
        "curves": [_curve(model, side, phi, fine, t) for phi, t in zip(directions.phi_deg, over)],
        "knots": knots,
        "last": getattr(model, "extrapolated_beyond_deg", {}).get(side),
        "origin": model.origin(side) if hasattr(model, "origin") else "",
    }


def _curve(
    model: ScatteringModel, side: str, phi_i_deg: float, theta: Array, tau: Array
) -> list[list[float | None]]:
    """Rows [theta, tau, low, high] of the direct-hemispherical value with its 95 % interval, where known."""
    ends: Sequence[Array] = (np.full(theta.shape, np.nan),) * 2
    if hasattr(model, "tau_interval"):
        # That of a side made by reciprocity is as wide, relatively, as that of the side it is made from;
        # asking for the latter spares integrating the former anew.
        own = getattr(model, "tables", {side: None})
        source = side if side in own else next(s for s in own if s.startswith("transmission"))
        ends = model.tau_interval(source, theta, phi_i_deg, level=0.95)
        if source != side:
            with np.errstate(divide="ignore", invalid="ignore"):
                share = tau / np.asarray(model.direct_hemispherical(source, theta, phi_i_deg), float)
            ends = (ends[0] * share, ends[1] * share)
    rows = zip(theta, tau, *ends)
    return [[_number(v) for v in row] for row in rows if np.isfinite(row[1])]


def _number(value: float) -> float | None:
    """Seven digits are more than any drawing shows; None is JSON's word for no data."""
    return float(f"{value:.7g}") if np.isfinite(value) else None


def measured_data(tables: Sequence[Table]) -> list[Mapping[str, Any]]:
    """Points [signed polar angle, DSF] of each table near its plane of incidence."""
    out: list[Mapping[str, Any]] = []
    for table in tables:
        angle, dsf = near_plane([table], table.side, table.polar_deg)
        keep = np.isfinite(dsf)
        angle, dsf = angle[keep], dsf[keep]
        order = np.argsort(angle)[:: max(1, -(-angle.size // _MOST_POINTS))]
        out.append(
            {
                "side": table.side,
                "theta": float(f"{table.polar_deg:.6g}"),
                "phi": float(f"{table.azimuth_deg:.6g}"),
                "band": table.band,
                "points": [[round(float(a), 3), float(f"{v:.5g}")] for a, v in zip(angle[order], dsf[order])],
            }
        )
    return out
