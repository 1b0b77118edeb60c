"""Area that the fragments once covered, from their weight and thickness."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from specularia.errors import PhysicsError
from specularia.finds.catalogue import Finds
from specularia.finds.intervals import Resampled

__all__ = ["SODA_LIME_DENSITY", "GlazedArea", "glazed_area"]

SODA_LIME_DENSITY: Final = (2.5, 0.03)
"""Density of soda-lime-silica glass and its spread between compositions, g/cm3."""


@dataclass(frozen=True)
class GlazedArea:
    """Area of the fragments, laid side by side.

    Parameters
    ----------
    area_m2, low_m2, high_m2 : with its 95 % interval.
    weight_g : that it is made from.
    measured_weight_g : share of it in rows that have their own thickness.
    harmonic_thickness_mm : the thickness that turns all of the weight into the area.
    density_g_cm3, density_se_g_cm3 : of the glass.
    """

    area_m2: float
    low_m2: float
    high_m2: float
    weight_g: float
    measured_weight_g: float
    harmonic_thickness_mm: float
    density_g_cm3: float
    density_se_g_cm3: float


def glazed_area(
    finds: Finds,
    resampled: Resampled,
    *,
    density_g_cm3: float = SODA_LIME_DENSITY[0],
    density_se_g_cm3: float = SODA_LIME_DENSITY[1],
) -> GlazedArea | None:
    """Area = sum of weight / (density * thickness) over the rows; None where no thickness was measured.

    Rows without a thickness take the mean of 1 / thickness of those with one, weighed by weight: they are
    supposed to be like them. Rows without a weight are left out. The weight being known, the interval holds
    the error of the density, taken as normal, and what the mean of the measured rows may be off for the
    others, from rows drawn anew (bootstrap); errors of weighing and of the calliper are not in it. It is the
    area of what was found, not of what was glazed: fragments that were not found, were taken away or melted
    are not in it.

    Parameters
    ----------
    finds : the table.
    resampled : draws of its rows.
    density_g_cm3, density_se_g_cm3 : of the glass, with its standard error.
    """
    if not 1.0 < density_g_cm3 < 9.0 or not 0.0 <= density_se_g_cm3 < 0.2 * density_g_cm3:
        raise PhysicsError(
            f"a glass of {density_g_cm3:g} +- {density_se_g_cm3:g} g/cm3 is none; the density lies between "
            "1 and 9 g/cm3 with an error below a fifth of it."
        )
    weight = np.where(np.isnan(finds.weight_g), 0.0, finds.weight_g)
    known = np.isfinite(finds.thickness_mm) & (weight > 0)
    if not known.any():
        return None
    over = np.divide(weight, finds.thickness_mm, out=np.zeros_like(weight), where=known)
    measured = np.where(known, weight, 0.0)
    mean = over.sum() / measured.sum()
    others, number = float(weight.sum() - measured.sum()), int(np.sum(~known & (weight > 0)))
    # What the mean of the measured rows is off, and what that of the others is off it.
    off = np.zeros(resampled.replicates)
    if number:
        one = np.zeros(len(weight), np.intp)
        sizes = 1.0, float(np.sqrt(known.sum() / number))
        for k, size in enumerate(sizes):
            again = Resampled(resampled.n, seed=resampled.seed + k, replicates=resampled.replicates)
            above, below = again.sums([(one, 1, over), (one, 1, measured)])
            with np.errstate(divide="ignore", invalid="ignore"):
                off += size * ((above / below)[:, 0] - mean)
    rng = np.random.default_rng([resampled.seed, resampled.n, 1])
    density = density_g_cm3 + density_se_g_cm3 * rng.standard_normal(resampled.replicates)
    # g / (g/cm3 * mm) is 10 cm2, a thousandth of a square metre.
    whole = float(over.sum() + others * mean)
    low, high = Resampled.ends((whole + others * off) * 1e-3 / density)
    found = whole * 1e-3 / density_g_cm3
    total = float(weight.sum())
    return GlazedArea(
        area_m2=found,
        low_m2=float(low),
        high_m2=float(high),
        weight_g=total,
        measured_weight_g=float(measured.sum()),
        harmonic_thickness_mm=total / (density_g_cm3 * found) * 1e-3,
        density_g_cm3=density_g_cm3,
        density_se_g_cm3=density_se_g_cm3,
    )
