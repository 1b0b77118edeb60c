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

__all__ = [
    "Comparison",
    "Lobe",
    "centroid",
    "compare",
    "default_angles",
    "haze",
    "js_distance",
    "lobe",
    "write_csv",
]

_CELLS = 128
_STEP_DEG = 0.02
_ROUNDS = 5


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
    js_distance : Jensen-Shannon distance of the two distributions, each divided by its tau, to the base 2:
        0 for one shape, 1 for disjoint ones.
    haze_2_5_a, haze_2_5_b : share of the light that leaves by more than 2.5 degrees from the undeflected
        (or mirrored) direction; haze_8_a, haze_8_b : by more than 8 degrees.
    peak_a, peak_b : in 1/sr; fwhm_a_deg, fwhm_b_deg : as `lobe`.
    centroid_ux_a, centroid_uy_a, centroid_ux_b, centroid_uy_b : mean direction cosines of the light.
    """

    theta_deg: float
    tau_a: float
    tau_b: float
    l1: float
    peak_ratio: float
    fwhm_ratio: float
    js_distance: float = float("nan")
    haze_2_5_a: float = float("nan")
    haze_2_5_b: float = float("nan")
    haze_8_a: float = float("nan")
    haze_8_b: float = float("nan")
    peak_a: float = float("nan")
    peak_b: float = float("nan")
    fwhm_a_deg: float = float("nan")
    fwhm_b_deg: float = float("nan")
    centroid_ux_a: float = float("nan")
    centroid_uy_a: float = float("nan")
    centroid_ux_b: float = float("nan")
    centroid_uy_b: float = float("nan")


def js_distance(a: Array, b: Array) -> float:
    """Jensen-Shannon distance of two distributions over the same cells of equal size, 0 to 1.

    The square root of the divergence to the base 2; NaN where one of them holds no light. It does not depend
    on how much light there is, only on where it goes.

    References
    ----------
    Endres, D. M. and Schindelin, J. E. (2003), A new metric for probability distributions, IEEE Transactions
    on Information Theory 49(7), doi:10.1109/TIT.2003.813506
    """
    total_a, total_b = float(a.sum()), float(b.sum())
    if not (total_a > 0 and total_b > 0):
        return float("nan")
    p, q = a.ravel() / total_a, b.ravel() / total_b
    m = 0.5 * (p + q)

    def to_mean(x: Array) -> float:
        some = x > 0
        return float(np.sum(x[some] * np.log2(x[some] / m[some])))

    return float(np.sqrt(min(max(0.5 * (to_mean(p) + to_mean(q)), 0.0), 1.0)))


def haze(
    model: ScatteringModel, side: str, *, theta_i_deg: float, phi_i_deg: float = 0.0, cone_deg: float = 2.5
) -> float:
    """Share of the light that leaves by more than `cone_deg` from the undeflected (or mirrored) direction.

    The cone is summed over directions of its own, so that it may be narrower than any cell; the part of it
    below the horizon holds no light. At 0 degrees and 2.5 degrees it is the haze of ASTM D1003.
    """
    tau = float(model.direct_hemispherical(side, theta_i_deg, phi_i_deg))
    if not tau > 0:
        return float("nan")
    rings, spokes = 96, 192
    low = np.cos(np.radians(cone_deg))
    # Steps that grow from the middle outwards, so that a lobe much narrower than the cone is resolved.
    step = (np.arange(rings) + 0.5) / rings
    angle = np.radians(cone_deg) * step**2
    turn = 2 * np.pi * (np.arange(spokes) + 0.5) / spokes
    share = np.sin(angle) * step
    part = share / share.sum() * (1 - low) * (2 * np.pi / spokes)
    t, p = np.radians(theta_i_deg), np.radians(phi_i_deg + 180.0)
    along, up = np.sin(angle)[:, None] * np.cos(turn), np.cos(angle)[:, None] + 0.0 * turn
    across = np.sin(angle)[:, None] * np.sin(turn)
    x, z = up * np.sin(t) + along * np.cos(t), up * np.cos(t) - along * np.sin(t)
    ux, uy = x * np.cos(p) - across * np.sin(p), x * np.sin(p) + across * np.cos(p)
    f = np.where(z > 0, model.evaluate(side, theta_i_deg, phi_i_deg, ux, uy), 0.0)
    inside = float(np.sum(np.nan_to_num(f) * np.maximum(z, 0.0) * part[:, None]))
    return 1.0 - inside / tau


def centroid(
    model: ScatteringModel, side: str, *, theta_i_deg: float, phi_i_deg: float = 0.0
) -> tuple[float, float]:
    """Mean direction cosines (ux, uy) of the light that leaves; NaN where there is none."""
    q = model.quadrature(side, theta_i_deg, phi_i_deg)
    light = q.weight * np.nan_to_num(model.evaluate(side, theta_i_deg, phi_i_deg, q.ux, q.uy))
    total = float(light.sum())
    if not total > 0:
        return float("nan"), float("nan")
    return float(light @ q.ux) / total, float(light @ q.uy) / total


def lobe(model: ScatteringModel, side: str, *, theta_i_deg: float, phi_i_deg: float = 0.0) -> Lobe:
    """The lobe of a distribution: its highest value and its width.

    The highest of the model's own points is followed uphill to less than a hundredth of their distance. The
    width is taken along the plane of incidence, between the first places on either side where the BSDF falls
    below half of the peak, linearly between steps of 0.02 degrees; a distribution that never does so has the
    width of the half circle, 180.
    """
    q = model.quadrature(side, theta_i_deg, phi_i_deg)
    values = np.nan_to_num(model.evaluate(side, theta_i_deg, phi_i_deg, q.ux, q.uy))
    top = int(values.argmax())
    peak, ux, uy = float(values[top]), float(q.ux[top]), float(q.uy[top])
    step = 0.5 * float(np.sqrt(q.weight[top]))
    around = np.arange(-2, 3)
    for _ in range(_ROUNDS):
        x, y = (v.ravel() for v in np.meshgrid(ux + step * around, uy + step * around, indexing="ij"))
        near = np.nan_to_num(model.evaluate(side, theta_i_deg, phi_i_deg, x, y))
        best = int(near.argmax())
        if near[best] > peak:
            peak, ux, uy = float(near[best]), float(x[best]), float(y[best])
        step *= 0.4
    c, d = np.cos(np.radians(phi_i_deg)), np.sin(np.radians(phi_i_deg))
    x0, y0 = ux * c + uy * d, uy * c - ux * d
    across = np.sqrt(max(1.0 - y0 * y0, 1e-12))
    alpha = np.degrees(np.arcsin(np.clip(x0 / across, -1.0, 1.0)))
    width = 0.0
    for sign in (-1.0, 1.0):
        angle = alpha + sign * np.arange(0.0, 180.0, _STEP_DEG)
        angle = angle[np.abs(angle) < 90.0]
        if angle.size == 0:
            continue
        sx = across * np.sin(np.radians(angle))
        f = np.nan_to_num(model.evaluate(side, theta_i_deg, phi_i_deg, sx * c - y0 * d, sx * d + y0 * c))
        below = np.flatnonzero(f < 0.5 * peak)
        steps = float(angle.size)
        if below.size:
            k = int(below[0])
            steps = float(k)
            if k > 0 and f[k - 1] > f[k]:
                steps = k - 1 + float((f[k - 1] - 0.5 * peak) / (f[k - 1] - f[k]))
        width += steps * _STEP_DEG
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
    where = {"theta_i_deg": theta, "phi_i_deg": phi}
    hazes = {c: [haze(m, side, cone_deg=c, **where) for m in (a, b)] for c in (2.5, 8.0)}
    middle = [centroid(m, side, **where) for m in (a, b)]
    la, lb = (lobe(m, side, theta_i_deg=theta, phi_i_deg=phi) for m in (a, b))
    return Comparison(
        theta_deg=theta,
        tau_a=tau_a,
        tau_b=tau_b,
        l1=apart / tau_a if tau_a > 0 else float("nan"),
        peak_ratio=lb.peak / la.peak if la.peak > 0 else float("nan"),
        fwhm_ratio=lb.fwhm_deg / la.fwhm_deg if la.fwhm_deg > 0 else float("nan"),
        js_distance=js_distance(cells[0], cells[1]),
        haze_2_5_a=hazes[2.5][0],
        haze_2_5_b=hazes[2.5][1],
        haze_8_a=hazes[8.0][0],
        haze_8_b=hazes[8.0][1],
        peak_a=la.peak,
        peak_b=lb.peak,
        fwhm_a_deg=la.fwhm_deg,
        fwhm_b_deg=lb.fwhm_deg,
        centroid_ux_a=middle[0][0],
        centroid_uy_a=middle[0][1],
        centroid_ux_b=middle[1][0],
        centroid_uy_b=middle[1][1],
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
