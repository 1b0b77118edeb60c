"""Another absorption, or another number of bubbles, for paths that were traced already."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from specularia.errors import PhysicsError

if TYPE_CHECKING:
    from specularia.glass.trace import Paths

__all__ = ["reweight"]


def reweight(
    paths: Paths,
    *,
    absorption_per_mm: float | None = None,
    traced_with_per_mm: float = 0.0,
    density_ratio: float = 1.0,
) -> Paths:
    """The same paths in glass of another absorption or with other numbers of bubbles, not traced again.

    Where a path goes is decided by index, relief and bubbles, and its polarisation by the interfaces;
    absorption only weighs it, by exp(-a L) with L its way in glass. So one trace of clear glass answers for
    every absorption, exactly, as long as the index is the same.

    Bodies placed in free flight are met by chance, as a Poisson process along the way. In glass with q times
    as many of each kind the same path is q^k exp(-(q - 1) m) times as likely, where k were drawn on it and m
    are expected on such a way (`Paths.bubbles_drawn`, `bubbles_expected`). Means over paths are right for
    every q; their noise grows as q leaves 1, so keep to a third up to three times what was traced where a
    path meets less than one body, and nearer where it meets several.

    Parameters
    ----------
    paths : as `trace_paths` gave them.
    absorption_per_mm : Napierian absorption wanted, >= 0; None keeps the one they were traced with.
    traced_with_per_mm : that one. Not above the wanted one, or else errors grow: light that was all but
        absorbed cannot be brought back.
    density_ratio : q, bodies per volume wanted over those traced, > 0.

    Returns
    -------
    Paths : with new `weight` and `absorbed`; light that ended in the glass stays there. With another density
        their sum is 1 on the mean only.
    """
    if absorption_per_mm is None:
        absorption_per_mm = traced_with_per_mm
    more = absorption_per_mm - traced_with_per_mm
    if not 0.0 <= traced_with_per_mm <= absorption_per_mm < float("inf"):
        raise PhysicsError(
            f"paths traced with an absorption of {traced_with_per_mm:g} per mm can be given that or more, "
            f"not {absorption_per_mm:g}."
        )
    if not 0.0 < density_ratio < float("inf"):
        raise PhysicsError(f"a ratio of densities is above 0, not {density_ratio:g}.")
    weight = paths.weight * np.exp(-more * paths.glass_length_mm)
    absorbed = paths.absorbed + (paths.weight - weight)
    if density_ratio != 1.0:
        if not paths.bubbles_expected.any():
            raise PhysicsError(
                "these paths were traced without bodies in free flight; no other number of them can be had."
            )
        likelihood = np.exp(
            paths.bubbles_drawn * np.log(density_ratio) - (density_ratio - 1.0) * paths.bubbles_expected
        )
        weight, absorbed = weight * likelihood, absorbed * likelihood
    return replace(paths, weight=weight, absorbed=absorbed)
