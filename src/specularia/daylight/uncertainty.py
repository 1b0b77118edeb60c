"""How far the uncertainty of a scattering model carries into the room.

Light in a room is proportional to what the panes transmit. Where a model states an interval for its
direct-hemispherical transmission (the noise of a measurement and what lies between its angles; the spread
between patches of a height map or between members of a healed ensemble), the same relative error is passed
on: for the sun's share of the light that at the sun's incident angle, for the sky's share the mean over
incident angles, weighed with what passes. The noise of the distribution's shape averages out over a lobe and
is not in it. Where models of the members themselves are given, each lights the room by itself, and the spread
of the results holds the shape too.
"""

from __future__ import annotations

import json
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtri, stdtrit

from specularia.bsdf import ScatteringModel
from specularia.daylight.geometry import Box
from specularia.daylight.own_geometry import OwnRoom
from specularia.daylight.panes import Glazing, Lights

__all__ = ["LEVEL", "relative_error", "spread_interval"]

Array = NDArray[np.float64]

LEVEL = 0.95
"""Probability of all intervals of the lit room."""

_FRONT = "transmission_front"


def _error(model: Any, theta_deg: Array) -> Array | None:
    """Relative standard error of the transmission at incident angles, or None if the model states none."""
    if not hasattr(model, "tau_interval"):
        return None
    tau = model.direct_hemispherical(_FRONT, theta_deg)
    low, high = model.tau_interval(_FRONT, theta_deg, level=LEVEL)
    error = np.maximum(high - tau, tau - low) / ndtri(0.5 + 0.5 * LEVEL)
    attributes = getattr(model, "attributes", {})
    for name, spread in (("patches", "tau_error"), ("ensemble", "tau_sd")):
        if name in attributes:
            between = json.loads(attributes[name])
            error = np.hypot(error, np.interp(theta_deg, between["theta_deg"], between[spread]))
    return np.divide(error, tau, out=np.zeros_like(error), where=tau > 0.0)


def relative_error(box: Box | OwnRoom, glazing: list[Glazing], lights: Lights) -> float | None:
    """Relative standard error of all light that enters, or None if the model of a pane states no uncertainty.

    Errors of the same model are taken as common to all panes, those of different models as independent.
    """
    x, w = np.polynomial.legendre.leggauss(12)
    nodes = np.degrees(np.arcsin(np.sqrt(0.5 * (x + 1.0))))
    parts: dict[int, float] = {}
    for index, (pane, glass) in enumerate(zip(box.panes, glazing)):
        model: ScatteringModel = glass.model
        errors = _error(model, nodes)
        if errors is None:
            return None
        tau = model.direct_hemispherical(_FRONT, nodes)
        sky = float(np.sum(w * tau * errors) / np.sum(w * tau)) if np.any(tau > 0.0) else 0.0
        sun = 0.0
        if lights.sun_direction is not None and (cosine := float(lights.sun_direction @ pane.axes[2])) > 0.0:
            at_sun = _error(model, np.array([np.degrees(np.arccos(min(cosine, 1.0)))]))
            sun = 0.0 if at_sun is None else float(at_sun[0])
        light = lights.sunlit[index] * sun + lights.skylit[index] * sky
        parts[id(model)] = parts.get(id(model), 0.0) + float(light)
    return float(np.sqrt(sum(v * v for v in parts.values())) / lights.flux) if lights.flux > 0.0 else 0.0


def spread_interval(values: Array, middle: Array, se: Array) -> tuple[Array, Array]:
    """Where one more member would lie: [M, K] values of members, results [K] and their standard errors.

    middle +- t sqrt(s^2 (1 + 1 / M) + se^2), Student's t with M - 1 degrees of freedom, s the standard
    deviation between members; not below 0.
    """
    m = len(values)
    s = values.std(axis=0, ddof=1)
    half = stdtrit(m - 1, 0.5 + 0.5 * LEVEL) * np.sqrt(s * s * (1.0 + 1.0 / m) + se * se)
    return np.maximum(middle - half, 0.0), middle + half
