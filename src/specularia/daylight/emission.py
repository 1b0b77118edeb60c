"""What a pane emits into the room: luminance over exit direction, worked out from its scattering model.

Sun and sky are far away and the pane is flat, so the luminance depends on the direction alone:

    L(o) = integral f(i -> o) L_out(i) |cos theta_i| d omega_i.

The sun's share is f averaged over its disc times its illuminance on the pane. The sky's share is integrated
over incident directions by the model's own quadrature for light that arrives on the back from o: by
reciprocity f_front(i -> o) = f_back(o -> i), so that the points crowd where the pane, seen from o, shows the
sky most.

The map is kept over the stereographic coordinates of the exit direction, s = u_x / (1 + c) and
t = u_y / (1 + c), where c is the cosine to the normal into the room. They stay well behaved at grazing exit,
which direction cosines do not, and a table that is linear between its nodes is what Radiance reads
(`brightdata`).
"""

from __future__ import annotations

import warnings
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from specularia.bsdf import ScatteringModel
from specularia.conventions import disk_to_square
from specularia.daylight._grid import bilinear
from specularia.daylight.outdoors import Outdoors, sun_disc
from specularia.errors import CoverageError, SpeculariaWarning

__all__ = ["EmissionMap", "back_reflectance", "emission_map"]

Array = NDArray[np.float64]

_RIM = 0.99999
"""Largest sine of an exit or incident angle that the model is asked for: 89.74 degrees."""


_CELLS = 64
"""Cells each way of the Shirley-Chiu square in which the sky's directions are gathered."""


@dataclass(frozen=True)
class EmissionMap:
    """Luminance of a pane over exit direction, bilinear between its nodes.

    Attributes
    ----------
    s, t : ascending nodes of the stereographic coordinates along the sample's x and y, from -1 to 1.
    luminance : [len(s), len(t)] cd/m2; nodes outside the unit circle hold the value of the rim below them.
    """

    s: Array
    t: Array
    luminance: Array

    def towards(self, ux: Array, uy: Array) -> Array:
        """cd/m2 towards the direction cosines (ux, uy); NaN outside the unit disk."""
        rr = np.asarray(ux, float) ** 2 + np.asarray(uy, float) ** 2
        c = np.sqrt(np.maximum(1.0 - rr, 0.0))
        value = bilinear(self.s, self.t, self.luminance, ux / (1.0 + c), uy / (1.0 + c))
        return np.where(rr <= 1.0, value, np.nan)

    def coarsened(self) -> EmissionMap:
        """The map on every second node, with the same exitance, to see what its interpolation costs."""
        i, j = (np.unique(np.append(np.arange(0, a.size, 2), a.size - 1)) for a in (self.s, self.t))
        half = EmissionMap(self.s[i], self.t[j], self.luminance[np.ix_(i, j)])
        held = half.exitance()
        return replace(half, luminance=half.luminance * (self.exitance() / held)) if held > 0.0 else half

    def exitance(self) -> float:
        """Luminous flux per area that leaves into the room, lm/m2: the integral of the bilinear map."""
        s, t, w = _gauss_points(self.s, self.t)
        return float(np.sum(w * bilinear(self.s, self.t, self.luminance, s, t)))

    def width_deg(self) -> float:
        """How finely the pane must be sampled: the width of a spot that much of the light goes through.

        The lesser of the diameter of a round spot that takes the brightest tenth of the light, and twice the
        diameter of one as large as what is brighter than half the peak: even a needle that holds little light
        shows up many times over where it is sampled too thinly.
        """
        s, t, w = _gauss_points(self.s, self.t)
        rr = s * s + t * t
        value = bilinear(self.s, self.t, self.luminance, s, t)
        order = np.argsort(-value)
        flux = np.cumsum((w * value)[order])
        solid = np.cumsum((w * (1.0 + rr) / np.maximum(1.0 - rr, 1e-6))[order])
        tenth = np.interp(0.1 * flux[-1], flux, solid)
        peak = solid[np.count_nonzero(value > 0.5 * value.max()) - 1]
        return float(np.degrees(np.sqrt(4.0 / np.pi * min(tenth, 4.0 * peak))))


def _gauss_points(s: Array, t: Array) -> tuple[Array, Array, Array]:
    """Two by two Gauss points in every cell within the unit circle, with their projected solid angles."""

    def points(axis: Array) -> tuple[Array, Array]:
        middle, half = 0.5 * (axis[1:] + axis[:-1]), 0.5 * np.diff(axis)
        offset = half / np.sqrt(3.0)
        return np.stack([middle - offset, middle + offset], 1).ravel(), np.repeat(half, 2)

    (ps, ws), (pt, wt) = points(s), points(t)
    a, b = np.meshgrid(ps, pt, indexing="ij")
    rr = a * a + b * b
    # d omega = 4 ds dt / (1 + r^2)^2 and c = (1 - r^2) / (1 + r^2).
    w = np.outer(ws, wt) * np.where(rr < 1.0, 4.0 * (1.0 - rr) / (1.0 + rr) ** 3, 0.0)
    kept = w > 0
    return a[kept], b[kept], w[kept]


def _axis(centre: float | None, sampling: float) -> Array:
    """Nodes from -1 to 1, 1.6 degrees apart, but 0.3 degrees around the sun's undeflected direction."""
    coarse = 0.014 / sampling
    if centre is None:
        return np.linspace(-1.0, 1.0, int(np.ceil(2.0 / coarse)) + 1)

    def arm(length: float) -> Array:
        steps = [0.0]
        while steps[-1] < length:
            steps.append(steps[-1] + min(max(0.0025 / sampling, 0.04 / sampling * steps[-1]), coarse))
        return np.array(steps) * (length / steps[-1])

    left, right = arm(centre + 1.0), arm(1.0 - centre)
    return np.concatenate([centre - left[:0:-1], centre + right])


def _exit_cosines(s: Array, t: Array) -> tuple[Array, Array]:
    """Direction cosines of the nodes; nodes beyond the unit circle are drawn back to the rim."""
    a, b = np.meshgrid(s, t, indexing="ij")
    r = np.hypot(a, b)
    u = np.minimum(2.0 * r / (1.0 + r * r), _RIM)
    u = np.where(r < 1.0, u, _RIM)
    scale = np.divide(u, r, out=np.zeros_like(r), where=r > 0)
    return a * scale, b * scale


def emission_map(
    model: ScatteringModel, *, axes: Array, outdoors: Outdoors, sampling: float = 1.0
) -> EmissionMap:
    """Luminance that a pane shows to the room under this sun and sky.

    Parameters
    ----------
    model : needs transmission_front; the sky's share uses transmission_back (by reciprocity, see the module).
    axes : [3, 3] rows: the sample's x, y, z (outwards) in the room's frame.
    outdoors : sun, sky and ground.
    sampling : density of nodes and sky directions, times the quick one.

    Raises
    ------
    CoverageError : where the model does not know the sun's incident direction.
    """
    sun = outdoors.sun if outdoors.sun_illuminance > 0.0 else None
    if sun is not None and float(axes[2] @ sun) > 0.0:
        x, y, z = axes @ sun
        s, t = _axis(-x / (1.0 + z), sampling), _axis(-y / (1.0 + z), sampling)
        ux, uy = _exit_cosines(s, t)
        total = _sun_share(model, axes, sun, outdoors.sun_illuminance, s, t, ux, uy)
    else:
        s = t = _axis(None, sampling)
        ux, uy = _exit_cosines(s, t)
        total = np.zeros(ux.shape)
    if outdoors.zenith > 0.0 or outdoors.ground > 0.0:
        total += _sky_share(model, axes, outdoors, sampling, ux, uy)
    return EmissionMap(s=s, t=t, luminance=total)


def _sun_share(
    model: ScatteringModel,
    axes: Array,
    sun: Array,
    normal_lx: float,
    s: Array,
    t: Array,
    ux: Array,
    uy: Array,
) -> Array:
    directions, weights = sun_disc(sun)
    local = directions @ axes.T
    up = local[:, 2] > 1.0 - _RIM
    total, flux = np.zeros(ux.shape), 0.0
    for (x, y, z), w in zip(local[up], weights[up]):
        theta, phi = np.degrees(np.arctan2(np.hypot(x, y), z)), np.degrees(np.arctan2(y, x))
        tau = float(model.direct_hemispherical("transmission_front", theta, phi))
        if not np.isfinite(tau):
            raise CoverageError(
                f"the sun falls on the pane at {theta:.1f} degrees from its normal, where the model has "
                "no data. Use a model that reaches that angle, or another sun."
            )
        total += w * normal_lx * z * model.evaluate("transmission_front", theta, phi, ux, uy)
        flux += w * normal_lx * z * tau
    held = EmissionMap(s, t, total).exitance()
    if flux <= 0.0 or held <= 0.0:
        return total
    if abs(held / flux - 1.0) > 0.03:
        warnings.warn(
            f"the sun's share of the pane's emission map holds {held / flux:.3f} of the light that the model "
            "transmits: the lobe is narrower than the map resolves. It is scaled to the right flux; raise "
            "quality.sampling.",
            SpeculariaWarning,
            stacklevel=2,
        )
    return total * (flux / held)


def _sky_share(
    model: ScatteringModel, axes: Array, outdoors: Outdoors, sampling: float, ux: Array, uy: Array
) -> Array:
    """The sky's share on a polar grid of exit directions, interpolated linearly to the map's nodes."""
    n = int(np.ceil(24 * np.sqrt(sampling)))
    theta = np.linspace(0.0, 90.0, n + 1)
    theta[-1] = np.degrees(np.arcsin(_RIM))
    phi = np.linspace(0.0, 360.0, 2 * n + 1)
    same = _isotropic(model)
    table = np.empty((n + 1, 2 * n + 1))
    for j in range(n + 1):
        x, y, share = _shares(model, float(theta[j]), 0.0)
        for k in range(2 * n):
            if not same and k > 0 and j > 0:
                x, y, share = _shares(model, float(theta[j]), float(phi[k]))
            turn = np.radians(phi[k]) if same else 0.0
            c, d = np.cos(turn), np.sin(turn)
            outward = np.sqrt(np.maximum(1.0 - x * x - y * y, 0.0))
            seen = np.stack([x * c - y * d, x * d + y * c, outward], axis=1) @ axes
            table[j, k] = share @ outdoors.luminance(seen)
    table[:, -1] = table[:, 0]
    at = np.degrees(np.arcsin(np.minimum(np.hypot(ux, uy), _RIM)))
    return bilinear(theta, phi, table, at, np.mod(np.degrees(np.arctan2(uy, ux)), 360.0))


def _shares(model: ScatteringModel, theta_deg: float, phi_deg: float) -> tuple[Array, Array, Array]:
    """Directions outdoors (ux, uy) and how much of each one's luminance an exit direction shows.

    The model's own points are gathered in cells of equal projected solid angle, about 2 degrees wide, each at
    the centroid of what it holds: the sky changes little over a cell, and a few thousand directions say all.
    """
    q = model.quadrature("transmission_back", theta_deg, phi_deg)
    f = model.evaluate("transmission_back", theta_deg, phi_deg, q.ux, q.uy)
    part = q.weight * np.where(np.isfinite(f), f, 0.0)
    a, b = disk_to_square(q.ux, q.uy)
    i, j = (np.clip((v * _CELLS).astype(np.intp), 0, _CELLS - 1) for v in (a, b))
    cell = i * _CELLS + j
    total, x, y = (np.bincount(cell, v, _CELLS**2).astype(float) for v in (part, part * q.ux, part * q.uy))
    kept = total > 0.0
    return x[kept] / total[kept], y[kept] / total[kept], total[kept]


def _isotropic(model: ScatteringModel) -> bool:
    """Whether turning the pane about its normal changes nothing, tried at some directions.

    Tables in cells may answer otherwise where a direction falls on a border, so a few may differ.
    """
    rng = np.random.default_rng(0)
    theta, turn, azimuth = (
        rng.uniform(0.0, 80.0, 64),
        rng.uniform(0.0, 360.0, 64),
        rng.uniform(0, 2 * np.pi, 64),
    )
    r = np.sqrt(rng.uniform(0.0, 0.95, 64))
    one = model.evaluate("transmission_back", theta, 0.0, r * np.cos(azimuth), r * np.sin(azimuth))
    azimuth = azimuth + np.radians(turn)
    other = model.evaluate("transmission_back", theta, turn, r * np.cos(azimuth), r * np.sin(azimuth))
    return int(np.sum(np.isclose(one, other, rtol=1e-4, atol=1e-9, equal_nan=True))) >= 58


def back_reflectance(model: ScatteringModel) -> float | None:
    """Diffuse-diffuse reflectance of the pane's room side, or None if the model has no reflection there.

    integral of rho(theta) d sin^2 theta, by six Gauss points.
    """
    if "reflection_back" not in model.sides:
        return None
    x, w = np.polynomial.legendre.leggauss(6)
    theta = np.degrees(np.arcsin(np.sqrt(0.5 * (x + 1.0))))
    rho = model.direct_hemispherical("reflection_back", theta)
    good = np.isfinite(rho)
    return float(np.sum((0.5 * w * rho)[good]) / np.sum(0.5 * w[good])) if good.any() else None
