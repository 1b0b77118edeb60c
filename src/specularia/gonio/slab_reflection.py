"""Reflection for a sample whose reflection was not measured: that of a flat, clear slab.

A pane without reflection is black to a camera that looks at it from the bright side. Until it is measured,
the reflection of a flat slab in closed form (Fresnel, with all reflections between its faces) is the least
that can be said of glass. It is a mirror: all its light leaves at (ux, uy) = -(ix, iy). A table, and a tree
made of it, cannot hold a direction without width, so the light is spread evenly over a small square around
it, and in a tree over the cells that the square touches; what is reflected in all stays as it is.
"""

from __future__ import annotations

import warnings
from dataclasses import replace

import numpy as np

from specularia.bsdf import SideTable, TabulatedModel
from specularia.bsdf._tabulated_tau import flat_pane
from specularia.errors import PhysicsError, SpeculariaWarning

__all__ = ["with_slab_reflection"]

_THETA = np.concatenate([np.arange(0.0, 60.0, 10.0), np.arange(60.0, 80.0, 5.0), np.arange(80.0, 90.0, 1.0)])
_HALF_WIDTH = 0.004
"""Half the edge of the square, in direction cosines: 0.23 degrees at the normal."""
_BASE, _PATCH = 16, 8


def with_slab_reflection(model: TabulatedModel, *, index: float = 1.52) -> TabulatedModel:
    """The model with the reflection of a flat, clear slab on those faces where none was measured.

    Parameters
    ----------
    model : that answers for transmission.
    index : of refraction of the slab, 1 < index <= 3.

    Notes
    ----- For either polarisation a slab with the reflectance R of one face reflects 2 R / (1 + R);
    unpolarised light takes the mean. Absorption in the glass and the roughness of its faces are left out.
    Where that and the transmission of the model add up to more than 1, the reflection is lowered to what is
    left, and a warning says so.

    Examples
    --------
    >>> import numpy as np
    >>> float(np.round(1.0 - flat_pane(0.0, 1.52), 4))
    0.0817
    """
    if not 1.0 < index <= 3.0:
        raise PhysicsError(f"a slab's index of refraction lies between 1 and 3, not {index:g}.")
    tables = dict(model.tables)
    for face in ("front", "back"):
        side, through = f"reflection_{face}", f"transmission_{face}"
        if side in tables:
            continue
        rho = 1.0 - flat_pane(_THETA, index)
        if through in model.sides:
            left = np.maximum(1.0 - model.direct_hemispherical(through, _THETA), 0.0)
            over = rho > left + 5e-3
            if over.any():
                warnings.warn(
                    f"{side.replace('_', ' ')}: a flat slab of index {index:g} and the measured transmission "
                    f"add up to more than 1 at {np.count_nonzero(over)} of {over.size} angles, first at "
                    f"{_THETA[over][0]:g} degrees; the reflection is lowered to what is left.",
                    SpeculariaWarning,
                    stacklevel=2,
                )
            rho = np.minimum(rho, left)
        tables[side] = SideTable(
            theta_i_deg=_THETA,
            base=np.zeros((_THETA.size, _BASE, _BASE), np.float32),
            patch=np.ones((_THETA.size, _PATCH, _PATCH), np.float32),
            half_width=_HALF_WIDTH,
            tau=rho,
            tau_se=np.zeros_like(rho),
            origin=f"Fresnel reflection of a flat clear slab of index {index:g}; computed, not measured",
            blend="linear",
        )
    return replace(model, tables=tables)
