"""Measured tables to the measurement-based model, Model M."""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from itertools import groupby

import numpy as np
from numpy.typing import NDArray

from specularia.bsdf import SideTable, TabulatedModel
from specularia.conventions import SIDES, square_to_disk
from specularia.errors import CoverageError, SpeculariaWarning
from specularia.gonio.integration import Summary, check_set, summarise_all
from specularia.gonio.interpolant import Distribution
from specularia.gonio.table import Array, Table
from specularia.provenance import record

__all__ = ["fit"]

_CELLS = 256
"""Cells along each side of the base table and of the patch."""

_HALF_WIDTH = 0.15
"""Half the side of the patch: cells of 0.0012 in direction cosines, 0.07 degrees at the normal."""

_SUB = 3
"""Samples of the interpolant along each side of a cell."""

_SAME_ANGLE = 0.02
"""Polar angles of incidence closer than this, in degrees, are one."""


def fit(tables: Sequence[Table], *, summaries: Sequence[Summary] | None = None) -> TabulatedModel:
    """Model M: the measured distributions as tables of an isotropic model, each with its measured tau.

    Every table is turned by its own azimuth of incidence, so that the light comes from phi_i = 0; tables that
    share theta_i are averaged. Each cell holds the mean of the linear interpolant over it.

    Parameters
    ----------
    tables : of one sample in one band, any sides, any order.
    summaries : of the same tables, where they have been made already.

    Returns
    -------
    model : its `tables` hold, per side, the measured angles, tau and standard error of tau.

    Raises
    ------
    CoverageError : no table at all, or tables of more than one band.
    FormatError : a table whose numbers cannot be right; see `integrate`.
    """
    if not tables:
        raise CoverageError("a measured model takes one table at least.")
    bands = sorted({t.band for t in tables})
    if len(bands) > 1:
        raise CoverageError(
            f"one model is for one band, these tables are for {', '.join(bands)}; fit them one by one, or "
            "state the wavelength (--wavelength)."
        )
    if summaries is None:
        summaries = summarise_all(tables)
    sides = {}
    for side in SIDES:
        chosen = [s for s in summaries if s.table.side == side]
        if chosen:
            sides[side] = _side(chosen)
    files = sorted({t.file for t in tables if t.file})
    return TabulatedModel(
        tables=sides,
        band=bands[0],
        attributes=record(
            what=f"Model M: scattering of {tables[0].name or 'a sample'}, measured with a gonio-photometer",
            inputs=files,
            parameters={"cells": _CELLS, "half_width": _HALF_WIDTH, "sub_samples": _SUB},
            synthetic=any(t.synthetic for t in tables),
        ),
    )


def _side(summaries: Sequence[Summary]) -> SideTable:
    """All tables of one side, by ascending angle."""
    side = summaries[0].table.side.replace("_", " ")
    for note in check_set(summaries):
        _warn(f"{side}: {note}.")
    ordered = sorted(summaries, key=lambda s: s.table.polar_deg)
    groups = [list(g) for _, g in groupby(ordered, key=lambda s: round(s.table.polar_deg / _SAME_ANGLE))]
    if len(groups) == 1:
        _warn(
            f"{side}: one incident angle only, {ordered[0].table.polar_deg:g}; the model carries its "
            "distribution to all others."
        )
    base = np.zeros((len(groups), _CELLS, _CELLS), np.float32)
    patch = np.zeros_like(base)
    theta, tau, error = (np.zeros(len(groups)) for _ in range(3))
    for k, group in enumerate(groups):
        theta[k] = np.mean([s.table.polar_deg for s in group])
        tau[k] = np.mean([s.tau for s in group])
        error[k] = np.sqrt(np.sum([s.tau_se**2 for s in group])) / len(group)
        if len(group) > 1:
            azimuths = ", ".join(f"{s.table.phi_i_deg:g}" for s in group)
            apart = max(s.tau for s in group) - min(s.tau for s in group)
            _warn(
                f"{side}: {len(group)} tables at theta_i = {theta[k]:g} (phi_i = {azimuths}) are averaged; "
                f"their integrals differ by {apart:.4f}."
            )
        for s in group:
            base[k] += _base_cells(s.distribution) / len(group)
            patch[k] += _patch_cells(s.distribution, theta[k]) / len(group)
    return SideTable(
        theta_i_deg=theta,
        base=base,
        patch=patch,
        half_width=_HALF_WIDTH,
        tau=tau,
        tau_se=error,
        origin="measured",
    )


def _base_cells(found: Distribution) -> NDArray[np.float32]:
    """[n, n] mean BSDF over the cells of the unit square."""
    k = (np.arange(_CELLS * _SUB) + 0.5) / (_CELLS * _SUB)
    a, b = np.meshgrid(k, k, indexing="ij")
    return _blocks(found.at(*square_to_disk(a, b)), np.ones_like(a))


def _patch_cells(found: Distribution, theta_deg: float) -> NDArray[np.float32]:
    """[m, m] mean BSDF over the cells of the patch around the undeflected direction; 0 beyond the horizon."""
    k = ((np.arange(_CELLS * _SUB) + 0.5) / (_CELLS * _SUB) * 2.0 - 1.0) * _HALF_WIDTH
    x, y = np.meshgrid(k - np.sin(np.radians(theta_deg)), k, indexing="ij")
    return _blocks(found.at(x, y), (x * x + y * y <= 1.0).astype(float))


def _blocks(values: Array, weight: Array) -> NDArray[np.float32]:
    """Weighted mean over blocks of _SUB x _SUB; 0 where there is no weight."""

    def total(v: Array) -> Array:
        return v.reshape(_CELLS, _SUB, _CELLS, _SUB).sum(axis=(1, 3))

    share = total(weight)
    return (total(values * weight) / np.maximum(share, 1e-12) * (share > 0)).astype(np.float32)


def _warn(text: str) -> None:
    warnings.warn(text, SpeculariaWarning, stacklevel=3)
