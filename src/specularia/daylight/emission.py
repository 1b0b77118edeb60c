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
from specularia.daylight._grid import bilinear
from specularia.daylight.outdoors import Outdoors, sun_disc
from specularia.daylight.transfer import RIM, SkyTransfer
from specularia.errors import CoverageError, SpeculariaWarning

__all__ = ["EmissionMap", "back_reflectance", "emission_map", "sun_map"]

Array = NDArray[np.float64]


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

    def plus(self, table: Array, transfer: SkyTransfer, share: float = 1.0) -> EmissionMap:
        """`share` of this map and the sky's light, a table of `SkyTransfer`, together."""
        sky = transfer.at(table, *_exit_cosines(self.s, self.t))
        return replace(self, luminance=share * self.luminance + sky)

    def coarsened(self) -> EmissionMap:
        """The map on every second node, with the same exitance, to see what its interpolation costs."""
        i, j = (np.unique(np.append(np.arange(0, a.size, 2), a.size - 1)) for a in (self.s, self.t))
        half = EmissionMap(self.s[i], self.t[j], self.luminance[np.ix_(i, j)])
        held = half.exitance()
        return replace(half, luminance=half.luminance * (self.exitance() / held)) if held > 0.0 else half

    def with_lobe(self, sun: Array, exitance: float) -> EmissionMap:
        """The map and a narrow lobe around the undeflected direction.

        `sun` [3] points to the sun in the sample's frame. The lobe holds `exitance` lm/m2 and is as narrow as
        the nodes allow, 5 degrees at least.
        """
        s, t = -sun[0] / (1.0 + sun[2]), -sun[1] / (1.0 + sun[2])
        width = max(np.radians(5.0) / 4.7, float(np.diff(self.s).max()), float(np.diff(self.t).max()))
        shape = np.exp(-((self.s[:, None] - s) ** 2 + (self.t[None, :] - t) ** 2) / (2.0 * width**2))
        held = replace(self, luminance=shape).exitance()
        return replace(self, luminance=self.luminance + shape * (exitance / held))

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
    """Nodes from -1 to 1, 0.7 degrees apart, but 0.3 degrees around the sun's undeflected direction."""
    coarse = 0.006 / sampling
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
    u = np.minimum(2.0 * r / (1.0 + r * r), RIM)
    u = np.where(r < 1.0, u, RIM)
    scale = np.divide(u, r, out=np.zeros_like(r), where=r > 0)
    return a * scale, b * scale


def emission_map(
    model: ScatteringModel, *, axes: Array, outdoors: Outdoors, sampling: float = 1.0
) -> EmissionMap:
    """Luminance that a pane shows to the room under this sun and sky, nothing outside standing in the way.

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
    total = sun_map(model, axes=axes, outdoors=outdoors, sampling=sampling)
    if outdoors.zenith > 0.0 or outdoors.ground > 0.0:
        transfer = SkyTransfer(model, sampling=sampling)
        total = total.plus(transfer.tables(axes=axes, outdoors=outdoors)[0], transfer)
    return total


def sun_map(model: ScatteringModel, *, axes: Array, outdoors: Outdoors, sampling: float = 1.0) -> EmissionMap:
    """The sun's share of `emission_map`; black where the sun stands behind the pane."""
    sun = outdoors.sun if outdoors.sun_illuminance > 0.0 else None
    if sun is None or float(axes[2] @ sun) <= 0.0:
        s = t = _axis(None, sampling)
        return EmissionMap(s, t, np.zeros((s.size, t.size)))
    x, y, z = axes @ sun
    s, t = _axis(-x / (1.0 + z), sampling), _axis(-y / (1.0 + z), sampling)
    ux, uy = _exit_cosines(s, t)
    return EmissionMap(s, t, _sun_share(model, axes, sun, outdoors.sun_illuminance, s, t, ux, uy))


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
    up = local[:, 2] > 1.0 - RIM
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
