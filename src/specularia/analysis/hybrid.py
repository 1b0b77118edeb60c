"""Measurement where there is one, the traced pane where there is none, joined without a step."""

from __future__ import annotations

import warnings
from dataclasses import replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

from specularia.bsdf import SideTable, TabulatedModel
from specularia.bsdf.side_table import cell_centres
from specularia.conventions import SIDES
from specularia.errors import CoverageError, PhysicsError, SpeculariaWarning
from specularia.provenance import to_json

__all__ = ["hybrid"]

Array = NDArray[np.float64]

_APART_DEG: Final = 2.0
"""Least distance of the first traced angle from the last measured one."""

_LARGE: Final = 0.1
"""Relative difference of transmission where both meet that is warned about."""


def hybrid(measured: TabulatedModel, traced: TabulatedModel) -> TabulatedModel:
    """A model that is measured as far as measurement goes, and traced beyond.

    On a measured side the tables at measured angles stay as they are. Beyond the last of them come the traced
    ones, scaled by the ratio of both transmissions (or reflections) at that last angle, so that there is no
    step; between the two the distribution is carried over as between any two angles. Sides that were not
    measured are the traced ones, scaled by the ratio of the measured side of the same kind, as reciprocity
    asks of front and back; where neither was measured, they stay as traced.

    Parameters
    ----------
    measured : Model M of a sample that may be turned about its normal.
    traced : a model traced through the same pane under the turned beam, in the same band, such as that of an
        inferred glass; to larger angles of incidence.

    Returns
    -------
    TabulatedModel. Its attributes say of every tabulated angle where it comes from, in
    `origin_transmission_front` and so on, lists of [theta, origin]; `joined_transmission_front` holds the
    angle and the ratio.

    Raises
    ------
    PhysicsError : different bands, or an anisotropic model.
    CoverageError : the traced model lacks a side, or does not reach further than the measurement.
    """
    if measured.band != traced.band:
        raise PhysicsError(
            f"both models must be of one band, not of {measured.band} and {traced.band}; trace at the "
            "wavelength of the measurement."
        )
    if not (measured.isotropic and traced.isotropic):
        raise PhysicsError("a hybrid is made of isotropic models; fit and trace them as isotropic.")
    tables: dict[str, SideTable] = {}
    notes: dict[str, str] = {}
    ratios: dict[str, float] = {}
    for side in SIDES:
        if side in measured.tables:
            tables[side], ratio = _joined(measured, traced, side)
            last = float(measured.tables[side].theta_i_deg[-1])
            notes[f"joined_{side}"] = to_json({"theta_deg": last, "ratio": ratio})
            ratios[side.split("_")[0]] = ratio
            marks = [[float(t), "measured" if t <= last else "traced"] for t in tables[side].theta_i_deg]
            notes[f"origin_{side}"] = to_json(marks)
    for side in SIDES:
        if side not in tables and side in traced.tables:
            ratio = ratios.get(side.split("_")[0], 1.0)
            one = traced.tables[side]
            tables[side] = _scaled(one, ratio)
            notes[f"origin_{side}"] = to_json([[float(t), "traced"] for t in one.theta_i_deg])
    attributes = {
        **{k: v for k, v in measured.attributes.items() if not k.startswith("symmetry_")},
        "what": "Hybrid: measured scattering, continued by a traced pane.",
        "traced_model": to_json(dict(traced.attributes)),
        **notes,
    }
    if "synthetic" in traced.attributes:
        attributes["synthetic"] = traced.attributes["synthetic"]
    return TabulatedModel(tables=tables, band=measured.band, attributes=attributes)


def _joined(measured: TabulatedModel, traced: TabulatedModel, side: str) -> tuple[SideTable, float]:
    """The table of a measured side, and the ratio that the traced part is scaled by."""
    m = measured.tables[side]
    if side not in traced.tables:
        raise CoverageError(f"the traced model has no {side.replace('_', ' ')}, which was measured.")
    c = traced.tables[side]
    last = float(m.theta_i_deg[-1])
    beyond = np.flatnonzero(np.asarray(c.theta_i_deg) > last + _APART_DEG)
    if beyond.size == 0:
        raise CoverageError(
            f"the traced model ends at {c.theta_i_deg[-1]:g} degrees; the measurement goes to {last:g}."
        )
    own = float(m.tau[-1])
    other = float(traced.direct_hemispherical(side, last))
    ratio = own / other
    if abs(ratio - 1.0) > _LARGE:
        warnings.warn(
            f"{side.replace('_', ' ')}: the traced pane passes {other:.4g} at {last:g} degrees where "
            f"{own:.4g} was measured; the part beyond is scaled by {ratio:.3f}.",
            SpeculariaWarning,
            stacklevel=3,
        )
    # The error of the join is common to all angles beyond it.
    joint = float(np.hypot(m.tau_se[-1] / own, np.interp(last, c.theta_i_deg, c.tau_se) / other))
    base, patch, base_se, patch_se = _on_cells_of(m, traced, side, beyond)
    tau = ratio * np.asarray(c.tau, float)[beyond]
    tau_se = np.hypot(ratio * np.asarray(c.tau_se, float)[beyond], tau * joint)

    def errors(one: NDArray[np.float32] | None, more: Array) -> NDArray[np.float32] | None:
        return None if one is None else np.concatenate([one, (ratio * more).astype(np.float32)])

    return replace(
        m,
        theta_i_deg=np.concatenate([m.theta_i_deg, np.asarray(c.theta_i_deg)[beyond]]),
        base=np.concatenate([m.base, (ratio * base).astype(np.float32)]),
        patch=np.concatenate([m.patch, (ratio * patch).astype(np.float32)]),
        base_se=errors(m.base_se, base_se),
        patch_se=errors(m.patch_se, patch_se),
        tau=np.concatenate([m.tau, tau]),
        tau_se=np.concatenate([m.tau_se, tau_se]),
        origin=f"measured to {last:g} degrees of incidence, traced beyond",
    ), ratio


def _on_cells_of(
    m: SideTable, traced: TabulatedModel, side: str, beyond: NDArray[np.intp]
) -> tuple[Array, Array, Array, Array]:
    """Traced distributions and their errors as means over the cells of another table."""
    c = traced.tables[side]
    n, k = m.base.shape[1], m.patch.shape[1]
    same = c.base.shape[1] == n and c.patch.shape[1] == k and c.half_width == m.half_width
    if same and c.base_se is not None and c.patch_se is not None:
        parts = (c.base[beyond], c.patch[beyond], c.base_se[beyond], c.patch_se[beyond])
        return tuple(np.asarray(p, float) for p in parts)  # type: ignore[return-value]
    x, y = cell_centres(n)
    edge = (np.arange(k) + 0.5) * (2.0 * m.half_width / k) - m.half_width
    px, py = np.meshgrid(edge, edge, indexing="ij")
    out: list[list[Array]] = [[], [], [], []]
    for t in np.asarray(c.theta_i_deg, float)[beyond]:
        s = np.sin(np.radians(t))
        for j, what in ((0, traced.evaluate), (2, traced.standard_error)):
            out[j].append(np.nan_to_num(what(side, t, 0.0, x, y)))
            out[j + 1].append(np.nan_to_num(what(side, t, 0.0, px - s, py)))
    return tuple(np.stack(o) for o in out)  # type: ignore[return-value]


def _scaled(one: SideTable, ratio: float) -> SideTable:
    """A table times a number."""

    def times(values: NDArray[np.float32] | None) -> NDArray[np.float32] | None:
        return None if values is None else (ratio * values).astype(np.float32)

    base, patch = times(one.base), times(one.patch)
    assert base is not None and patch is not None
    return replace(
        one,
        base=base,
        patch=patch,
        base_se=times(one.base_se),
        patch_se=times(one.patch_se),
        tau=ratio * np.asarray(one.tau, float),
        tau_se=ratio * np.asarray(one.tau_se, float),
    )
