"""Leave-one-angle-out: what Model M says of a measured angle that it has not seen.

Each incident angle between the first and the last is left out in turn, the model is made of the others, and
what it gives there is held against the measurement: the integral with its interval, and the distribution.
In a set with several azimuths of incidence that is modelled with them, every other azimuth is left out as
well.
"""

from __future__ import annotations

import warnings
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any, Protocol

import numpy as np

from specularia.bsdf import TabulatedModel
from specularia.conventions import SIDES
from specularia.errors import CoverageError, SpeculariaWarning
from specularia.gonio.fitting import fit
from specularia.gonio.integration import Summary
from specularia.gonio.interpolant import Distribution
from specularia.gonio.isotropy import SAME_ANGLE
from specularia.gonio.table import Array
from specularia.progress import task

__all__ = ["HeldOut", "cross_validate", "distance"]

_BIN = 0.005
"""Edge of the cells on which distributions are compared, in direction cosines."""

_SUB = 2
"""Samples along the edge of such a cell."""


@dataclass(frozen=True)
class HeldOut:
    """One table against a model made without it.

    Attributes
    ----------
    side, theta_deg, phi_deg : what was left out; azimuth in the frame of `conventions`.
    left_out : "angle", every table of this theta_i, or "azimuth", every other azimuth.
    measured, measured_se : integral of the table and its noise.
    predicted : the same by the model.
    low, high : the model's interval for it, at `level`.
    l1 : integral of |model - table| over projected solid angle, over `measured`, without the table's noise.
    l1_raw, l1_noise : the same with it, and that of the noise alone.
    """

    side: str
    theta_deg: float
    phi_deg: float
    left_out: str
    measured: float
    measured_se: float
    predicted: float
    low: float
    high: float
    level: float
    l1: float
    l1_raw: float
    l1_noise: float

    @property
    def off(self) -> float:
        """Relative error of the predicted integral."""
        return self.predicted / self.measured - 1.0

    @property
    def holds(self) -> bool:
        """Whether the measured integral lies in the interval."""
        return bool(self.low <= self.measured <= self.high)


def cross_validate(
    summaries: Sequence[Summary], model: TabulatedModel | None = None, *, level: float = 0.95
) -> list[HeldOut]:
    """Hold every inner angle of a set of tables against the model of the others.

    Parameters
    ----------
    summaries : of tables of one sample in one band.
    model : of all of them, whose symmetry the models of the others take over; None makes one.
    level : of the interval, between 0 and 1.

    Returns
    -------
    One record per table left out, by side, angle and azimuth.

    Raises
    ------
    CoverageError : no side has three incident angles, or azimuths to leave out.

    Notes
    ----- Distributions are compared on cells of 0.005 in direction cosines. The noise of the table's
    values, drawn at random with their estimated variance and interpolated as they are, gives `l1_noise`,
    which is subtracted in quadrature; the noise of the tables that the model is made of stays in `l1`, as
    it stays in the model.
    """
    model = _quiet_fit(summaries, "auto") if model is None else model
    folds = [fold for side in SIDES if side in model.tables for fold in _folds(summaries, model, side)]
    if not folds:
        raise CoverageError(
            "cross-validation leaves out angles between the first and the last: it takes three incident "
            "angles on one side, or more."
        )
    found = []
    with task("cross-validation", len(folds)) as progress:
        for kind, left, rest in folds:
            without = _quiet_fit(rest, model.tables[left[0].table.side].symmetry)
            found += [_held_out(without, s, kind, level) for s in left]
            progress.advance()
    return found


class Evaluated(Protocol):
    """Anything with values of a BSDF in 1/sr at directions, as `bsdf.ScatteringModel.evaluate` gives them."""

    def evaluate(self, side: str, theta_i_deg: Any, phi_i_deg: Any, ux: Any, uy: Any) -> Array: ...


def distance(model: Evaluated, side: str, found: Distribution, *, theta_deg: float, phi_deg: float) -> Array:
    """L1 distance of a model from a measured distribution, and that of the measurement's noise from zero.

    Parameters
    ----------
    model, side : whose distribution.
    found : the measured one, turned so that its light comes from phi_i = 0.
    theta_deg, phi_deg : direction of the light.

    Returns
    -------
    [2] integrals over projected solid angle of |cell mean of the difference| and of |cell mean of the noise|.
    """
    n = round(2.0 / _BIN)
    k = (np.arange(n * _SUB) + 0.5) / (n * _SUB) * 2.0 - 1.0
    x, y = np.meshgrid(k, k, indexing="ij")
    inside = x * x + y * y <= 1.0
    # Points along a column follow each other closely, which the search through the triangles needs.
    x, y = x[inside], y[inside]
    c, d = np.cos(np.radians(phi_deg)), np.sin(np.radians(phi_deg))
    predicted = model.evaluate(side, theta_deg, phi_deg, x * c - y * d, x * d + y * c)
    draw = np.random.default_rng(0).standard_normal(found.values.size) * np.sqrt(found.variance)
    cell = (np.floor((x + 1.0) / _BIN) * n + np.floor((y + 1.0) / _BIN)).astype(np.intp)
    area = (_BIN / _SUB) ** 2
    return np.array(
        [
            np.abs(np.bincount(cell, values, minlength=n * n)).sum() * area
            for values in (predicted - found.at(x, y), replace(found, values=draw).at(x, y))
        ]
    )


def _folds(
    summaries: Sequence[Summary], model: TabulatedModel, side: str
) -> Iterator[tuple[str, list[Summary], list[Summary]]]:
    """What is left out, and what is left, fold by fold."""
    own = [s for s in summaries if s.table.side == side]
    rings: dict[int, list[Summary]] = {}
    for s in sorted(own, key=lambda s: (s.table.polar_deg, s.table.azimuth_deg)):
        rings.setdefault(round(s.table.polar_deg / SAME_ANGLE), []).append(s)
    for ring in list(rings.values())[1:-1]:
        yield "angle", ring, _without(own, ring)
    full = [ring for ring in rings.values() if len(ring) > 3]
    if full and not model.tables[side].isotropic:
        for first in (0, 1):
            left = [s for ring in full for s in ring[first::2]]
            yield "azimuth", left, _without(own, left)


def _without(some: Sequence[Summary], left: Sequence[Summary]) -> list[Summary]:
    """Those that are not left out; records that hold arrays are told apart by identity."""
    gone = {id(s) for s in left}
    return [s for s in some if id(s) not in gone]


def _quiet_fit(summaries: Sequence[Summary], symmetry: str) -> TabulatedModel:
    """The model of some of the tables; what there is to say of them has been said of the whole set."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", SpeculariaWarning)
        return fit([s.table for s in summaries], summaries=summaries, symmetry=symmetry)


def _held_out(model: TabulatedModel, summary: Summary, kind: str, level: float) -> HeldOut:
    t = summary.table
    theta, phi = t.polar_deg, t.azimuth_deg
    low, high = model.tau_interval(t.side, theta, phi, level=level)
    raw, noise = distance(model, t.side, summary.distribution, theta_deg=theta, phi_deg=phi) / summary.tau
    return HeldOut(
        side=t.side,
        theta_deg=theta,
        phi_deg=phi,
        left_out=kind,
        measured=summary.tau,
        measured_se=summary.tau_se,
        predicted=float(model.direct_hemispherical(t.side, theta, phi)),
        low=float(low),
        high=float(high),
        level=level,
        l1=float(np.sqrt(max(raw**2 - noise**2, 0.0))),
        l1_raw=float(raw),
        l1_noise=float(noise),
    )
