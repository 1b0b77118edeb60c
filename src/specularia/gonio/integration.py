"""Direct-hemispherical values of measured tables, and what they say about the tables."""

from __future__ import annotations

import os
import warnings
from collections.abc import Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from specularia.errors import FormatError, SpeculariaWarning
from specularia.gonio.cleaning import Step
from specularia.gonio.interpolant import Distribution, distribution
from specularia.gonio.noise import Noise
from specularia.gonio.shadow import Mask
from specularia.gonio.systematic import bounds, lobe_outside
from specularia.gonio.table import Array, Table
from specularia.progress import task

__all__ = ["Summary", "check_set", "integral_shows", "integrate", "summarise", "summarise_all"]

_ABOVE_ONE = 0.01
"""How far tau may exceed 1 by calibration before the table is refused; 3 standard errors if that is more."""

_AGREES, _DISAGREES = 0.03, 0.06
"""Relative distance from the file's own integral within which a reading agrees, and beyond which not."""

_FULL = 0.9
"""Coverage below which the user is told."""


@dataclass(frozen=True)
class Summary:
    """What one table holds: see `specularia gonio info`.

    Attributes
    ----------
    table : the table; `points` and `negative` count its values.
    distribution : its continuous form.
    coverage : share of the projected hemisphere that was measured.
    tau, tau_se : direct-hemispherical transmission (or reflection) and its standard error, from the noise of
        the table and of the scan of the bare beam.
    tau_systematic : half-width of a bound on what else tau may be off by: gaps, shadow, discretisation,
        scale.
    systematic : its parts; see `systematic.bounds`.
    warnings : of the reader, and what was repaired or looks odd.
    """

    table: Table
    distribution: Distribution
    points: int
    negative: int
    coverage: float
    tau: float
    tau_se: float
    tau_systematic: float
    systematic: Mapping[str, float]
    warnings: tuple[str, ...]

    @property
    def steps(self) -> tuple[Step, ...]:
        """What the cleaning did."""
        return self.distribution.steps

    @property
    def noise(self) -> Noise:
        """Of single values of the signal, BSDF times |cos theta_s|."""
        return self.distribution.noise


def integrate(table: Table) -> tuple[float, float]:
    """Direct-hemispherical transmission (or reflection) of a table, with its standard error.

    The integral of the BSDF over projected solid angle (see `interpolant`), out to the horizon, with the
    shadow of the mount filled. The standard error is that of noise, estimated from the scatter of
    neighbouring points; `Summary.tau_systematic` bounds the rest. Neither knows of the instrument's
    calibration.

    Raises
    ------
    FormatError : where the integral shows that the numbers cannot be what the file says: tau above 1, or a
        header whose own integral is that of the other quantity.
    """
    summary = summarise(table)
    return summary.tau, summary.tau_se


def summarise(table: Table, *, masks: Sequence[Mask] = (), isotropic: bool = True) -> Summary:
    """Points, coverage and integral of a table, checked; see `integrate`.

    Parameters
    ----------
    table : any.
    masks : shadows that the user gives, besides those that are found.
    isotropic : False for a sample whose two sides of the plane of incidence may differ: a shadow is then
        bridged.
    """
    summary = _summarise(table, masks, isotropic)
    _warn(summary)
    return summary


def summarise_all(
    tables: Sequence[Table], *, masks: Sequence[Mask] = (), isotropic: bool = True
) -> list[Summary]:
    """`summarise` for several tables at once, on as many threads as there are processors.

    What is noticed is warned of in the order of the tables, and stands in each summary's `warnings`.
    """
    found = []
    processors = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count()
    with (
        task("integrating the measured tables", len(tables)) as progress,
        ThreadPoolExecutor(processors) as pool,
    ):
        for summary in pool.map(lambda table: _summarise(table, masks, isotropic), tables):
            _warn(summary)
            found.append(summary)
            progress.advance()
    return found


def _warn(summary: Summary) -> None:
    """Warn of what the integration noticed; the reader has warned of the rest."""
    for note in summary.warnings[len(summary.table.warnings) :]:
        warnings.warn(f"{summary.table.label}: {note}.", SpeculariaWarning, stacklevel=3)


def _summarise(table: Table, masks: Sequence[Mask], isotropic: bool) -> Summary:
    found = distribution(table, masks=masks, isotropic=isotropic)
    _check(table, found)
    parts = bounds(table, found, isotropic=isotropic)
    scale_se = table.scale_se * found.integral
    return Summary(
        table=table,
        distribution=found,
        points=len(table.values),
        negative=int(np.sum(table.values < 0)),
        coverage=found.coverage,
        tau=found.integral,
        tau_se=float(np.hypot(found.standard_error, scale_se)),
        tau_systematic=sum(parts.values()),
        systematic=parts,
        warnings=(*table.warnings, *_notes(table, found)),
    )


def _check(table: Table, found: Distribution) -> None:
    """Raise the FormatError of `integrate`."""
    symbol = "tau" if table.kind == "transmission" else "rho"
    other = "BSDF" if table.quantity == "DSF" else "DSF"
    if found.integral > 1.0 + max(_ABOVE_ONE, 3.0 * found.standard_error):
        alternative = distribution(replace(table, quantity=other)).integral
        hint = f"; as {other} it would be {alternative:.4g}" if alternative <= 1.0 else ""
        raise FormatError(
            file=table.file or table.label,
            line=table.quantity_line,
            expected=f"{symbol} of 1 at most",
            found=f"{symbol} = {found.integral:.4g} at theta_i = {table.theta_i_deg:g}{hint}",
            advice="Check the scale of the values and whether they are DSF or BSDF (--quantity).",
        )
    if table.stated_integral is not None and integral_shows(table, found) == other:
        raise FormatError(
            file=table.file or table.label,
            line=table.quantity_line,
            expected=f"{table.quantity} with the header's front_integral, {table.stated_integral:.4g}",
            found=f"{found.integral:.4g}, while the values are {other} by that integral",
            advice=f"Say --quantity {other}, or mend the header.",
        )


def integral_shows(table: Table, found: Distribution | None = None) -> str | None:
    """The quantity that the file's own integral proves the values to be, or None where it proves nothing.

    Proved is the reading whose integral agrees with the header's while the other one's does not.
    """
    if not table.stated_integral or table.stated_integral <= 0:
        return None
    off = {}
    for quantity in ("DSF", "BSDF"):
        read = found if found is not None and quantity == table.quantity else None
        read = read or distribution(replace(table, quantity=quantity))
        off[quantity] = abs(read.integral / table.stated_integral - 1.0)
    best, worst = sorted(off, key=lambda q: off[q])
    return best if off[best] <= _AGREES and off[worst] >= _DISAGREES else None


def check_set(summaries: Sequence[Summary]) -> list[str]:
    """Notes on a set of tables of one side: several incident azimuths, tau that rises with theta_i.

    Transmission through a pane falls as the light gets oblique; BSDF read as DSF lack the cosine and rise.
    """
    notes = []
    azimuths = sorted({round(s.table.phi_i_deg % 360.0, 2) % 360.0 for s in summaries})
    if len(azimuths) > 1:
        notes.append(
            f"tables at phi_i = {', '.join(f'{a:g}' for a in azimuths)} in one set; a model turns each by "
            "its own azimuth, as for an isotropic sample, unless several at one theta_i show, or --symmetry "
            "says, that it is not"
        )
    ordered = sorted(summaries, key=lambda s: s.table.polar_deg)
    for one, two in pairwise(ordered):
        margin = max(0.03 * one.tau, 3.0 * np.hypot(one.tau_se, two.tau_se))
        if one.table.kind == "transmission" and two.tau > one.tau + margin:
            notes.append(
                f"tau rises from {one.tau:.3f} at theta_i = {one.table.polar_deg:g} to {two.tau:.3f} at "
                f"{two.table.polar_deg:g}; for a pane it should fall. If these {one.table.quantity} are "
                f"{'BSDF' if one.table.quantity == 'DSF' else 'DSF'}, say --quantity"
            )
            break
    return notes


def _notes(table: Table, found: Distribution) -> list[str]:
    notes = list(found.notes)
    if found.coverage < _FULL:
        notes.append(
            f"{100 * found.coverage:.0f} % of the projected hemisphere is covered; the rest is bridged from "
            "its edges and carried on to the horizon"
        )
    if lobe_outside(table, found):
        notes.append(
            f"the undeflected direction, {table.polar_deg:g} degrees off the normal, lies outside the data; "
            "a lobe there is not counted"
        )
    if found.integral > 1.0:
        notes.append(f"the integral is {found.integral:.4f}, above 1 by less than calibration may be off")
    slope = _horizon_exponent(table)
    limits = {"BSDF": 0.9, "DSF": 0.5}
    if slope is not None and table.quantity == "BSDF" and slope > limits["BSDF"]:
        notes.append(
            f"towards the horizon the values fall like cos(theta_s)^{slope:.1f}, as DSF do; if they are not "
            "BSDF, say --quantity DSF"
        )
    if slope is not None and table.quantity == "DSF" and slope < limits["DSF"]:
        notes.append(
            f"towards the horizon the values go like cos(theta_s)^{slope:.1f}, as BSDF do; if they are not "
            "DSF, say --quantity BSDF"
        )
    return notes


def _horizon_exponent(table: Table) -> float | None:
    """Exponent p in values ~ cos(theta_s)^p between 5 and 15 degrees off the horizon, away from the lobe.

    BSDF stay level or fall somewhat (by Fresnel's transmittance, p up to 0.8 there), DSF have p higher by 1.
    None where the signal does not stand out from its scatter.
    """
    away = np.cos(np.radians(table.phi_s_deg - table.azimuth_deg)) > -0.5
    level = []
    for low, high in ((75.0, 78.0), (84.0, 87.0)):
        ring = (table.cos_s < np.cos(np.radians(low))) & (table.cos_s > np.cos(np.radians(high))) & away
        values: Array = table.values[ring]
        if values.size < 20:
            return None
        median = float(np.median(values))
        error = 1.25 * np.subtract(*np.percentile(values, [75, 25])) / 1.35 / np.sqrt(values.size)
        if median < 10.0 * error:
            return None
        level.append((np.log(np.mean(table.cos_s[ring])), np.log(median)))
    (a, b), (c, d) = level
    return float((d - b) / (c - a))
