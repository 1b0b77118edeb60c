"""What diffraction changes in the lobe of a pane, as a step of the error budget."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

from specularia.analysis.lobe_shape import LobeShape, shape_of_light, standard_error
from specularia.errors import PhysicsError
from specularia.glass import Medium, Slab, trace_paths
from specularia.glass.agreement import INSIDE
from specularia.glass.effort import REPLICATES
from specularia.glass.wave import far_fields

__all__ = ["FARTHEST_DEG", "Diffraction", "diffraction"]

Array = NDArray[np.float64]

FARTHEST_DEG: Final = 40.0
"""Incident angle up to which waves are set against rays. At 60 degrees and slopes of 0.1 the lobe of the wave
model came out a tenth wider than that of the rays, for lack of higher orders and of shadows."""

_MEMBERS, _WINDOW_UM = 8, 380.0
"""Windows of a pane without a period of up to four times as long; a whole period takes up to 6000 samples."""


@dataclass(frozen=True)
class Diffraction:
    """Waves less rays, for light that crosses the pane without being reflected inside.

    Attributes
    ----------
    effect : [3] change of the quantities of `lobe_shape.QUANTITIES`; of the first none, since the wave model
        has no reflections.
    se : [3] its standard error: paths, places of the windows, and what the second order in the slopes changes
        in the wave model, which stands for the orders that it leaves out.
    """

    effect: Array
    se: Array


def diffraction(
    slab: Slab, *, theta_deg: float, phi_deg: float, paths: int, seed: int, wavelength_nm: float
) -> Diffraction:
    """Compare waves and rays at one incident direction, 0 <= theta <= `FARTHEST_DEG`.

    The maps alone are compared: bubbles, films and relief below the cut-off are left out, absorption weighs
    all light alike.
    """
    if not 0.0 <= theta_deg <= FARTHEST_DEG:
        raise PhysicsError(f"waves are compared up to {FARTHEST_DEG:g} degrees, not at {theta_deg:g}.")
    bare = replace(
        slab,
        medium=Medium(index=slab.medium.index),
        bubbles=None,
        bubble_kinds=(),
        front=replace(slab.front, micro_slope=0.0, film=None),
        back=replace(slab.back, micro_slope=0.0, film=None),
        patch=None,
    )
    rays = _of_rays(bare, theta_deg, phi_deg, paths, seed, wavelength_nm)
    second, first = (
        _of_waves(bare, theta_deg, phi_deg, seed, wavelength_nm, order=order) for order in (2, 1)
    )
    effect = second.mean - rays.mean
    beyond = second.mean - first.mean
    se = np.sqrt(rays.se**2 + np.nan_to_num(standard_error(second.values)) ** 2 + beyond**2)
    for values in (effect, se):
        values[0] = 0.0
    return Diffraction(effect, se)


def _of_rays(
    slab: Slab, theta_deg: float, phi_deg: float, paths: int, seed: int, wavelength_nm: float
) -> LobeShape:
    traced = trace_paths(
        slab, theta_deg=theta_deg, phi_deg=phi_deg, paths=paths, seed=seed, wavelength_nm=wavelength_nm
    )
    straight = traced.transmitted & (traced.glass_length_mm <= INSIDE * slab.thickness_mm)
    ux, uy = _turned(traced.ux[straight], traced.uy[straight], phi_deg)
    arrived = np.bincount(traced.replicate, minlength=REPLICATES).astype(float)
    return shape_of_light(
        ux,
        uy,
        traced.weight[straight],
        traced.replicate[straight],
        theta_deg=theta_deg,
        per_replicate=arrived,
    )


def _of_waves(
    slab: Slab, theta_deg: float, phi_deg: float, seed: int, wavelength_nm: float, *, order: int
) -> LobeShape:
    """A replicate for each window."""
    shapes = []
    for one in far_fields(
        slab,
        wavelength_nm=wavelength_nm,
        theta_deg=theta_deg,
        phi_deg=phi_deg,
        members=_MEMBERS,
        window_um=_WINDOW_UM,
        seed=seed,
        order=order,
    ):
        leaves = one.ux**2 + one.uy**2 <= 1.0
        ux, uy = _turned(one.ux[leaves], one.uy[leaves], phi_deg)
        light = one.power[leaves]
        found = shape_of_light(
            ux,
            uy,
            light,
            np.zeros(light.size, np.int64),
            theta_deg=theta_deg,
            per_replicate=np.ones(1),
        )
        shapes.append(found.values[0])
    return LobeShape(np.array(shapes))


def _turned(ux: Array, uy: Array, phi_deg: float) -> tuple[Array, Array]:
    """Directions in the frame in which the light comes from phi = 0."""
    c, s = np.cos(np.radians(phi_deg)), np.sin(np.radians(phi_deg))
    return ux * c + uy * s, uy * c - ux * s
