"""Which directions outdoors each exit direction of a pane shows: the sky's share of what it emits.

The light towards an exit direction o is an integral over incident directions, taken by the model's own
quadrature for light that arrives on the back from o: by reciprocity f_front(i -> o) = f_back(o -> i), so that
the points crowd where the pane, seen from o, shows the sky most. The points depend on the model alone and
serve every sky, hour, wall and shaded place.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import RectBivariateSpline
from scipy.sparse import csr_array

from specularia.bsdf import ScatteringModel
from specularia.conventions import disk_to_square, square_to_disk
from specularia.daylight._grid import bilinear
from specularia.daylight.outdoors import Outdoors

__all__ = ["BINS", "RIM", "SkyTransfer", "bin_directions"]

Array = NDArray[np.float64]
Shares = Callable[[float, float], tuple[Array, Array, Array]]

RIM: Final = 0.99999
"""Largest sine of an exit or incident angle that the model is asked for: 89.74 degrees."""

_NEAR: Final = np.array([0.25, 0.5, 1.0, 1.75, 2.75])
"""Degrees from the normal of further nodes."""

BINS: Final = 64
"""Bins each way of the Shirley-Chiu square in which incident directions are gathered, of about 2 degrees."""


def bin_directions() -> Array:
    """[BINS^2, 3] directions in the middle of each bin, in the sample's frame."""
    k = (np.arange(BINS) + 0.5) / BINS
    x, y = square_to_disk(*(v.ravel() for v in np.meshgrid(k, k, indexing="ij")))
    return np.stack([x, y, np.sqrt(np.maximum(1.0 - x * x - y * y, 0.0))], axis=1)


@dataclass(frozen=True)
class _Seen:
    """What the nodes of a grid show of the outdoors.

    Attributes
    ----------
    sky : [nodes] cd/m2 if nothing stands outside.
    share, light : [nodes, BINS^2], sparse: how much of each bin's luminance a node shows, and that times the
        luminance.
    """

    sky: Array
    share: Any
    light: Any


class SkyTransfer:
    """Incident directions and their weights for exit directions on a polar grid.

    Parameters
    ----------
    model : needs transmission_back.
    sampling : density of the grid, times the quick one of about 30 x 48 directions.

    Attributes
    ----------
    theta, phi : nodes of the grid in degrees, theta from the normal into the room; phi closes at 360.
    """

    def __init__(self, model: ScatteringModel, *, sampling: float = 1.0) -> None:
        self._fill(partial(_shares, model), _isotropic(model), sampling)

    @classmethod
    def of(cls, shares: Shares, *, isotropic: bool, sampling: float) -> SkyTransfer:
        """From a function of exit angle and azimuth in degrees: ux, uy and weights of what is shown."""
        made = cls.__new__(cls)
        made._fill(shares, isotropic, sampling)
        # What is seen straight through has edges, such as the horizon, that a spline would overshoot.
        made._order = 1
        return made

    def _fill(self, shares: Shares, isotropic: bool, sampling: float) -> None:
        n = int(np.ceil(24 * np.sqrt(sampling)))
        self._order = 3
        even = np.linspace(0.0, 90.0, n + 1)
        # Close to the normal a needle of light may rise within a degree.
        self.theta = np.concatenate([[0.0], _NEAR[0.7 * even[1] > _NEAR], even[1:]])
        self.theta[-1] = np.degrees(np.arcsin(RIM))
        self.phi = np.linspace(0.0, 360.0, 2 * n + 1)
        self.isotropic = isotropic
        self._last: tuple[Outdoors, Array, _Seen] | None = None
        self._points: list[list[tuple[Array, Array, Array]]] = []
        for j, theta in enumerate(self.theta):
            turns = self.phi[:1] if isotropic or j == 0 else self.phi[:-1]
            self._points.append([shares(float(theta), float(p)) for p in turns])

    def tables(
        self, *, axes: Array, outdoors: Outdoors, hidden: Array | None = None, instead: Array | None = None
    ) -> Array:
        """Luminance towards the nodes of the grid, from places that see the outdoors differently.

        Parameters
        ----------
        axes : [3, 3] rows: the sample's x, y, z (outwards) in the room's frame.
        outdoors : sky and ground.
        hidden : [P, BINS^2] share of each bin of incident directions that something hides from each place.
        instead : [P, BINS^2] luminance in cd/m2, over the whole bin, of what hides it.

        Returns
        -------
        [P, theta, phi] cd/m2; one place if nothing is hidden.
        """
        seen = self._seen(axes, outdoors)
        flat = seen.sky[:, None]
        if hidden is not None and instead is not None:
            flat = flat + seen.share @ instead.T - seen.light @ hidden.T
        out = np.empty((flat.shape[1], self.theta.size, self.phi.size))
        out[:, :, :-1] = flat.T.reshape(-1, self.theta.size, self.phi.size - 1)
        out[:, :, -1] = out[:, :, 0]
        return out

    def _seen(self, axes: Array, outdoors: Outdoors) -> _Seen:
        """What the nodes show of these outdoors; kept for the next pane that looks the same way."""
        if self._last is not None and self._last[0] is outdoors and np.array_equal(self._last[1], axes):
            return self._last[2]
        shares, lights, bins, sky = [], [], [], []
        for row in self._points:
            for k in range(self.phi.size - 1):
                x, y, share = row[k if len(row) > 1 else 0]
                turn = np.radians(self.phi[k]) if self.isotropic else 0.0
                c, d = np.cos(turn), np.sin(turn)
                x, y = x * c - y * d, x * d + y * c
                outward = np.sqrt(np.maximum(1.0 - x * x - y * y, 0.0))
                light = share * outdoors.luminance(np.stack([x, y, outward], axis=1) @ axes)
                shares.append(share)
                lights.append(light)
                bins.append(_bin(x, y))
                sky.append(light.sum())
        ends = np.cumsum([0, *(len(b) for b in bins)])
        places, shape = np.concatenate(bins), (len(bins), BINS**2)
        found = _Seen(
            np.array(sky),
            *(csr_array((np.concatenate(v), places, ends), shape=shape) for v in (shares, lights)),
        )
        self._last = (outdoors, axes.copy(), found)
        return found

    def at(self, table: Array, ux: Array, uy: Array) -> Array:
        """Values of one of `tables` towards direction cosines, by cubic splines between the nodes."""
        at = np.degrees(np.arcsin(np.minimum(np.hypot(ux, uy), RIM)))
        around = np.mod(np.degrees(np.arctan2(uy, ux)), 360.0)
        if self._order == 1:
            return bilinear(self.theta, self.phi, table, at, around)
        phi = np.concatenate([self.phi[-4:-1] - 360.0, self.phi, self.phi[1:4] + 360.0])
        turned = np.concatenate([table[:, -4:-1], table, table[:, 1:4]], axis=1)
        spline = RectBivariateSpline(self.theta, phi, turned)
        return np.maximum(spline(at.ravel(), around.ravel(), grid=False).reshape(at.shape), 0.0)


def _bin(x: Array, y: Array) -> NDArray[np.intp]:
    i, j = (np.clip((v * BINS).astype(np.intp), 0, BINS - 1) for v in disk_to_square(x, y))
    return np.asarray(i * BINS + j)


def _shares(model: ScatteringModel, theta_deg: float, phi_deg: float) -> tuple[Array, Array, Array]:
    """Directions outdoors (ux, uy) and how much of each one's luminance an exit direction shows.

    The model's own points are gathered in the bins, each at the centroid of what it holds: the sky changes
    little over a bin, and a few thousand directions say all.
    """
    q = model.quadrature("transmission_back", theta_deg, phi_deg)
    f = model.evaluate("transmission_back", theta_deg, phi_deg, q.ux, q.uy)
    part = q.weight * np.where(np.isfinite(f), f, 0.0)
    cell = _bin(q.ux, q.uy)
    total, x, y = (np.bincount(cell, v, BINS**2).astype(float) for v in (part, part * q.ux, part * q.uy))
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
