"""Two scattering models side by side."""

from __future__ import annotations

import csv
import io
from collections.abc import Sequence
from dataclasses import dataclass, fields
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from specularia.bsdf.cells import cell_means
from specularia.bsdf.model import Array, ScatteringModel
from specularia.files import write_text

__all__ = ["Comparison", "Lobe", "compare", "default_angles", "lobe", "write_csv"]

_CELLS = 128
_STEP_DEG = 0.02


@dataclass(frozen=True)
class Lobe:
    """The highest point of a distribution and how wide it is there.

    Attributes
    ----------
    peak : BSDF in 1/sr.
    ux, uy : where it stands.
    fwhm_deg : full width at half of the peak, along the plane of incidence.
    """

    peak: float
    ux: float
    uy: float
    fwhm_deg: float


@dataclass(frozen=True)
class Comparison:
    """Two models at one incident direction; B against A.

    Attributes
    ----------
    theta_deg : polar angle of the incident direction.
    tau_a, tau_b : direct-hemispherical values.
    l1 : integral of |B - A| over projected solid angle, over tau_a; 0 for equal models, 2 for disjoint ones.
    peak_ratio, fwhm_ratio : peak and width of the lobe of B over those of A.
    """

    theta_deg: float
    tau_a: float
    tau_b: float
    l1: float
    peak_ratio: float
    fwhm_ratio: float


def lobe(model: ScatteringModel, side: str, *, theta_i_deg: float, phi_i_deg: float = 0.0) -> Lobe:
    """The lobe of a distribution: its highest value at the model's own points, and its width.

    The width is taken along the plane of incidence, between the first places on either side where the BSDF
    falls below half of the peak; a distribution that never does so has the width of the half circle, 180.
    """
    q = model.quadrature(side, theta_i_deg, phi_i_deg)
    values = np.nan_to_num(model.evaluate(side, theta_i_deg, phi_i_deg, q.ux, q.uy))
    top = int(values.argmax())
    peak, ux, uy = float(values[top]), float(q.ux[top]), float(q.uy[top])
    c, d = np.cos(np.radians(phi_i_deg)), np.sin(np.radians(phi_i_deg))
    x, y = ux * c + uy * d, uy * c - ux * d
    across = np.sqrt(max(1.0 - y * y, 1e-12))
    alpha = np.degrees(np.arcsin(np.clip(x / across, -1.0, 1.0)))
    width = 0.0
    for sign in (-1.0, 1.0):
        angle = alpha + sign * np.arange(0.0, 180.0, _STEP_DEG)
        angle = angle[np.abs(angle) < 90.0]
        if angle.size == 0:
            continue
        sx = across * np.sin(np.radians(angle))
        f = model.evaluate(side, theta_i_deg, phi_i_deg, sx * c - y * d, sx * d + y * c)
        below = np.flatnonzero(np.nan_to_num(f) < 0.5 * peak)
        width += (float(below[0]) if below.size else float(angle.size)) * _STEP_DEG
    return Lobe(peak=peak, ux=ux, uy=uy, fwhm_deg=width)


def default_angles(*models: ScatteringModel, side: str) -> list[float]:
    """Angles at which models are compared unless others are asked for: those that tables hold, or 0 to 75."""
    for model in models:
        tables = getattr(model, "tables", {})
        if side in tables:
            return [float(t) for t in tables[side].theta_i_deg]
    return [0.0, 20.0, 40.0, 60.0, 75.0]


def compare(
    a: ScatteringModel,
    b: ScatteringModel,
    *,
    theta_deg: ArrayLike | None = None,
    phi_deg: float = 0.0,
    side: str = "transmission_front",
) -> list[Comparison]:
    """Compare two models angle by angle.

    Parameters
    ----------
    a, b : the models; `a` is the one that errors are counted against.
    theta_deg : [N] incident angles; None takes those of the tables, or 0, 20, 40, 60, 75.
    phi_deg : azimuth of the incident direction.
    side : the side compared.

    Returns
    -------
    One record per angle; values are NaN where a model has no data.
    """
    angles = default_angles(a, b, side=side) if theta_deg is None else np.atleast_1d(theta_deg).tolist()
    return [_compare_at(a, b, side, float(t), phi_deg) for t in angles]


def _compare_at(a: ScatteringModel, b: ScatteringModel, side: str, theta: float, phi: float) -> Comparison:
    tau_a, tau_b = (float(m.direct_hemispherical(side, theta, phi)) for m in (a, b))
    if not (np.isfinite(tau_a) and np.isfinite(tau_b)):
        return Comparison(theta, tau_a, tau_b, *([float("nan")] * 3))
    cells: list[Array] = [cell_means(m, side, theta_i_deg=theta, phi_i_deg=phi, n=_CELLS) for m in (a, b)]
    apart = float(np.abs(cells[1] - cells[0]).sum() * np.pi / _CELLS**2)
    la, lb = (lobe(m, side, theta_i_deg=theta, phi_i_deg=phi) for m in (a, b))
    return Comparison(
        theta_deg=theta,
        tau_a=tau_a,
        tau_b=tau_b,
        l1=apart / tau_a if tau_a > 0 else float("nan"),
        peak_ratio=lb.peak / la.peak if la.peak > 0 else float("nan"),
        fwhm_ratio=lb.fwhm_deg / la.fwhm_deg if la.fwhm_deg > 0 else float("nan"),
    )


def write_csv(rows: Sequence[Comparison], path: str | Path) -> Path:
    """Write a comparison as a table of comma-separated values with a header."""
    out = io.StringIO()
    writer = csv.writer(out, lineterminator="\n")
    names = [f.name for f in fields(Comparison)]
    writer.writerow(names)
    for row in rows:
        writer.writerow([f"{getattr(row, n):.6g}" for n in names])
    return write_text(path, out.getvalue())
