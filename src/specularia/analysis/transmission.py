"""Direct-hemispherical transmission of the measurement, the models and a clear slab (the paper's Table 1)."""

from __future__ import annotations

import csv
import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from specularia.errors import CoverageError, PhysicsError, SpeculariaWarning
from specularia.files import atomic

if TYPE_CHECKING:
    from specularia.bsdf import ScatteringModel
    from specularia.gonio import Table

__all__ = ["CLEAR_SLAB", "MEASURED", "Table1", "TauPoints", "measured_tau", "table_1", "write_table_1"]

Array = NDArray[np.float64]

MEASURED = "measured"
"""Name of the measurement's row in `Table1`."""
CLEAR_SLAB = "clear slab"
"""Name of the row of the flat, clear pane in closed form."""


@dataclass(frozen=True)
class TauPoints:
    """Measured direct-hemispherical values.

    Parameters
    ----------
    theta_deg : array [N], angles of incidence, ascending, degrees.
    tau : array [N], direct-hemispherical transmission (or reflection).
    se : array [N], standard errors.
    band : the light of the measurement, such as "520 nm".
    """

    theta_deg: Array
    tau: Array
    se: Array
    band: str = ""


@dataclass(frozen=True)
class Table1:
    """Direct-hemispherical values of several sources at the same angles.

    Parameters
    ----------
    theta_deg : array [N], angles of incidence, degrees.
    rows : names of the R sources: "measured", the models in their order, "clear slab".
    tau : array [R, N]; NaN where a source has no value at an angle.
    se : array [R, N], standard errors; 0 for a closed form, NaN where unknown.
    ratio, ratio_se : arrays [R, N], value over the measured one with its standard error; NaN in the row of
        the measurement itself and where it has no value.
    extrapolated : array [R, N] of bool, True beyond the last angle of a model's data.
    band : the one band of all rows, or the bands joined where they differ.
    side : one of `conventions.SIDES`.
    """

    theta_deg: Array
    rows: tuple[str, ...]
    tau: Array
    se: Array
    ratio: Array
    ratio_se: Array
    extrapolated: NDArray[np.bool_]
    band: str
    side: str


def measured_tau(tables: Sequence[Table], *, side: str = "transmission_front") -> TauPoints:
    """Integrate the measured tables of one side and sort them by angle of incidence.

    Angles are polar angles from the normal of the face the light arrives on; tables of other sides are left
    out. Several tables at one angle each stay a point of their own.

    Raises
    ------
    CoverageError : no table of this side.
    PhysicsError : tables of more than one band.
    """
    from specularia.gonio import integrate

    chosen = [t for t in tables if t.side == side]
    bands = {t.band for t in chosen}
    if not chosen:
        raise CoverageError(f"no measured table of {side.replace('_', ' ')} among {len(tables)}.")
    if len(bands) > 1:
        raise PhysicsError(
            f"measured tables of several bands ({', '.join(sorted(bands))}); give those of one."
        )
    theta = np.array([t.polar_deg for t in chosen], float)
    values = np.array([integrate(t) for t in chosen], float)
    order = np.argsort(theta, kind="stable")
    return TauPoints(theta[order], values[order, 0], values[order, 1], band=bands.pop())


def table_1(
    measured: TauPoints | None,
    models: Mapping[str, ScatteringModel],
    theta_deg: ArrayLike | None = None,
    *,
    index: float,
    thickness_mm: float,
    absorption_per_mm: float = 0.0,
    side: str = "transmission_front",
    phi_i_deg: float = 0.0,
) -> Table1:
    """Set measured and modelled direct-hemispherical transmission side by side, all at one wavelength.

    The last row is a clear slab in closed form: two parallel smooth faces, all reflections between them, the
    polarisation kept (see `glass.closed_form.flat_slab`).

    Parameters
    ----------
    measured : measured values (see `measured_tau`); None leaves the row and the ratios empty.
    models : by name, in the order of their rows. Rows of another band than the measurement's give a warning.
    theta_deg : array [N], degrees, 0 <= theta < 90; None takes the measured angles.
    index : refractive index of the clear slab at this wavelength, > 1.
    thickness_mm : its thickness, mm, > 0.
    absorption_per_mm : its Napierian absorption, 1/mm, >= 0; 0 for clear glass.
    side : "transmission_front" or "transmission_back".
    phi_i_deg : azimuth of the incident direction, degrees; rotation-invariant models do not depend on it.

    Notes
    -----
    A model's standard error is interpolated linearly between the angles of its data. The ratio's standard
    error is |ratio| sqrt((se/tau)^2 + (se_m/tau_m)^2), which takes both errors as independent: model M was
    fitted to the measurement itself, so the ratio of its row shows the error of the fit, and its standard
    error is an upper bound.
    """
    from specularia.glass.closed_form import flat_slab

    if theta_deg is not None:
        theta = np.atleast_1d(np.asarray(theta_deg, float))
    elif measured is not None:
        theta = np.unique(measured.theta_deg)
    else:
        raise PhysicsError("angles are needed where there is no measurement: give theta_deg.")
    names: list[str] = []
    tau: list[Array] = []
    se: list[Array] = []
    last: list[float] = []
    bands: dict[str, str] = {}
    if measured is not None:
        names.append(MEASURED)
        found, error = _measured_at(theta, measured)
        tau.append(found)
        se.append(error)
        last.append(np.inf)
        bands[MEASURED] = measured.band
    for name, model in models.items():
        names.append(name)
        tau.append(np.asarray(model.direct_hemispherical(side, theta, phi_i_deg), float))
        se.append(_standard_error(model, side, theta))
        last.append(getattr(model, "extrapolated_beyond_deg", {}).get(side, np.inf))
        bands[name] = model.band
    names.append(CLEAR_SLAB)
    clear = flat_slab(theta, index=index, absorption_per_mm=absorption_per_mm, thickness_mm=thickness_mm)
    tau.append(np.asarray(clear[0], float))
    se.append(np.zeros(theta.size))
    last.append(np.inf)
    if len(set(bands.values())) > 1:
        listed = ", ".join(f"{k}: {v or 'unknown'}" for k, v in bands.items())
        warnings.warn(
            f"the rows of the table are of different bands ({listed}); the ratios mix colour and scattering.",
            SpeculariaWarning,
            stacklevel=2,
        )
    values, errors = np.array(tau), np.array(se)
    ratio, ratio_se = np.full(values.shape, np.nan), np.full(values.shape, np.nan)
    if measured is not None:
        with np.errstate(divide="ignore", invalid="ignore"):
            ratio[1:] = values[1:] / values[0]
            ratio_se[1:] = np.abs(ratio[1:]) * np.hypot(errors[1:] / values[1:], errors[0] / values[0])
    return Table1(
        theta_deg=theta,
        rows=tuple(names),
        tau=values,
        se=errors,
        ratio=ratio,
        ratio_se=ratio_se,
        extrapolated=theta[None, :] > np.array(last)[:, None],
        band=" / ".join(dict.fromkeys(b for b in bands.values() if b)),
        side=side,
    )


def write_table_1(table: Table1, path: str | Path) -> Path:
    """Write the table as CSV, one line per source and angle; empty cells where there is no value."""
    path = Path(path)
    with atomic(path) as temporary, temporary.open("w", newline="", encoding="utf-8") as f:
        writer = csv.writer(f, lineterminator="\n")
        writer.writerow(
            [
                "source",
                "theta_i_deg",
                "tau",
                "tau_se",
                "ratio_to_measured",
                "ratio_se",
                "extrapolated",
                "band",
            ]
        )
        for r, name in enumerate(table.rows):
            for c, theta in enumerate(table.theta_deg):
                numbers = (table.tau[r, c], table.se[r, c], table.ratio[r, c], table.ratio_se[r, c])
                cells = ["" if np.isnan(v) else repr(float(v)) for v in numbers]
                writer.writerow([name, repr(float(theta)), *cells, int(table.extrapolated[r, c]), table.band])
    return path


def _measured_at(theta: Array, points: TauPoints, tolerance_deg: float = 0.01) -> tuple[Array, Array]:
    """Measured values and standard errors; means at angles measured several times, NaN at others."""
    same = np.abs(theta[:, None] - np.asarray(points.theta_deg, float)[None]) <= tolerance_deg
    n = same.sum(axis=1)
    tau = (same * np.asarray(points.tau, float)).sum(axis=1) / np.maximum(n, 1)
    se = np.sqrt((same * np.asarray(points.se, float) ** 2).sum(axis=1)) / np.maximum(n, 1)
    return np.where(n > 0, tau, np.nan), np.where(n > 0, se, np.nan)


def _standard_error(model: ScatteringModel, side: str, theta: Array) -> Array:
    """Standard error of a tabulated model's tau; NaN where the model does not carry one."""
    table = getattr(model, "tables", {}).get(side)
    if table is None:
        return np.full(theta.size, np.nan)
    return np.interp(theta, table.theta_i_deg, table.tau_se, right=np.nan)
