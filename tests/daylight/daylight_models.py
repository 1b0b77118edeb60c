"""Analytic panes and rooms that the tests of the lit room share. All of them are synthetic."""

from __future__ import annotations

from typing import Any

import numpy as np

from specularia.bsdf import Quadrature
from specularia.conventions import square_to_disk
from specularia.daylight.job import RoomJob


def hemisphere(n: int) -> Quadrature:
    """Equal projected solid angles over the unit disk."""
    k = (np.arange(n) + 0.5) / n
    x, y = square_to_disk(*(v.ravel() for v in np.meshgrid(k, k, indexing="ij")))
    return Quadrature(ux=x, uy=y, weight=np.full(x.size, np.pi / x.size))


class Analytic:
    """A pane whose BSDF is `value(s_x, s_y, u_x, u_y)`, s being the cosines of the incident direction."""

    band = "Visible"
    sides = ("transmission_front", "transmission_back")

    def __init__(self, cells: int = 120) -> None:
        self._points = hemisphere(cells)

    def value(self, side: str, sx: Any, sy: Any, ux: Any, uy: Any) -> Any:
        raise NotImplementedError

    def evaluate(self, side: str, theta_i_deg: Any, phi_i_deg: Any, ux: Any, uy: Any) -> Any:
        s, phi = np.sin(np.radians(theta_i_deg)), np.radians(phi_i_deg)
        value = self.value(side, s * np.cos(phi), s * np.sin(phi), ux, uy)
        return np.where(np.asarray(ux) ** 2 + np.asarray(uy) ** 2 <= 1.0, value, np.nan)

    def quadrature(self, side: str, theta_i_deg: float, phi_i_deg: float = 0.0) -> Quadrature:
        return self._points

    def direct_hemispherical(self, side: str, theta_i_deg: Any, phi_i_deg: Any = 0.0) -> Any:
        theta, phi = np.broadcast_arrays(np.asarray(theta_i_deg, float), np.asarray(phi_i_deg, float))
        q, out = self._points, np.empty(theta.shape)
        for k in np.ndindex(theta.shape):
            out[k] = np.sum(q.weight * self.evaluate(side, theta[k], phi[k], q.ux, q.uy))
        return out


class Diffuser(Analytic):
    """A perfect Lambertian diffuser: luminance tau E / pi, the same in all directions."""

    def __init__(self, tau: float) -> None:
        super().__init__(cells=40)
        self.tau = tau

    def value(self, side: str, sx: Any, sy: Any, ux: Any, uy: Any) -> Any:
        return np.broadcast_to(
            self.tau / np.pi, np.broadcast_shapes(*(np.shape(v) for v in (sx, sy, ux, uy)))
        )


class Lobe(Analytic):
    """A Gaussian lobe in direction cosines, `shift` away from the undeflected direction.

    The front and the back are made reciprocal: f_back(a -> b) = f_front(b -> a).
    """

    def __init__(
        self, fwhm_deg: float, *, tau: float = 0.6, shift: tuple[float, float] = (0.0, 0.0), cells: int = 160
    ) -> None:
        super().__init__(cells)
        self.width = np.radians(fwhm_deg) / np.sqrt(8 * np.log(2))
        self.tau, self.shift = tau, shift

    def value(self, side: str, sx: Any, sy: Any, ux: Any, uy: Any) -> Any:
        # The sum s + u is 0 for undeflected light and the same both ways, so one formula serves both sides.
        rr = (ux + sx - self.shift[0]) ** 2 + (uy + sy - self.shift[1]) ** 2
        return self.tau * np.exp(-rr / (2 * self.width**2)) / (2 * np.pi * self.width**2)


BLACK = {"ceiling": 0.0, "walls": 0.0, "floor": 0.0, "frames": 0.0}


def room(**changes: Any) -> RoomJob:
    """A room of 5 x 6 x 3 m with a window of 0.8 x 1.1 m, black unless told otherwise."""
    window = {"wall": "south", "width_m": 0.8, "height_m": 1.1, "sill_m": 1.0, "pane_reflectance": 0.0}
    window |= changes.pop("window", {})
    content: dict[str, Any] = {
        "room": {"width_m": 5.0, "depth_m": 6.0, "height_m": 3.0},
        "reflectance": BLACK,
        "window": [window],
        "sky": {"kind": "none"},
        "ground": {"reflectance": 0.0},
    }
    return RoomJob.model_validate(content | changes)


def sensors(points: Any, normal: Any) -> list[dict[str, Any]]:
    """Sensors named by number at [K, 3] points, all with one normal or each with its own."""
    normals = np.broadcast_to(np.asarray(normal, float), np.shape(points))
    return [
        {"name": f"p{k}", "position_m": tuple(map(float, p)), "normal": tuple(map(float, n))}
        for k, (p, n) in enumerate(zip(points, normals))
    ]
