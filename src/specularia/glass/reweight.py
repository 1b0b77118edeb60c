"""Another absorption for paths that were traced already."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from specularia.errors import PhysicsError

if TYPE_CHECKING:
    from specularia.glass.trace import Paths

__all__ = ["reweight"]


def reweight(paths: Paths, *, absorption_per_mm: float, traced_with_per_mm: float = 0.0) -> Paths:
    """The same paths in glass of another absorption, without tracing them again.

    Where a path goes is decided by index, relief and bubbles, and its polarisation by the interfaces;
    absorption only weighs it, by exp(-a L) with L its way in glass. So one trace of clear glass answers for
    every absorption, exactly, as long as the index is the same.

    Parameters
    ----------
    paths : as `trace_paths` gave them.
    absorption_per_mm : Napierian absorption wanted, >= 0.
    traced_with_per_mm : the one they were traced with. Not above the wanted one, or else errors grow: light
        that was all but absorbed cannot be brought back.

    Returns
    -------
    Paths : with new `weight` and `absorbed`; light that ended in the glass stays there.
    """
    more = absorption_per_mm - traced_with_per_mm
    if not 0.0 <= traced_with_per_mm <= absorption_per_mm < float("inf"):
        raise PhysicsError(
            f"paths traced with an absorption of {traced_with_per_mm:g} per mm can be given that or more, "
            f"not {absorption_per_mm:g}."
        )
    weight = paths.weight * np.exp(-more * paths.glass_length_mm)
    return replace(paths, weight=weight, absorbed=paths.absorbed + (paths.weight - weight))
