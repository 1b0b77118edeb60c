"""What stands outside and shades the panes: outer reveals and obstacles, seen from places on each pane.

A place gets the share of the sun that nothing hides, mean over its points and the sun's disc. In every bin of
incident directions its middle sees the sky or the ground, or the surface that stands before them. Such a
surface scatters evenly; it gets the sun where it sees it, and the light of the sky and the ground that it
sees itself. Light that goes back and forth between such surfaces is left out.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from specularia.daylight._triangle_kernel import first_hits
from specularia.daylight.geometry import Box, Pane, Rectangle
from specularia.daylight.job import Window
from specularia.daylight.obstacles import obstacle_faces
from specularia.daylight.outdoors import Outdoors, sun_disc
from specularia.daylight.outdoors import hemisphere as projected_hemisphere
from specularia.daylight.own_geometry import OwnRoom
from specularia.daylight.transfer import bin_directions

__all__ = ["Outside", "Shaded", "outer_reveal"]

Array = NDArray[np.float64]

_CELL_M = 0.12
"""Largest place on a pane that counts as one, m, at the quick sampling."""

_SUN_POINTS = 16
"""Points each way of a place from which the sun is looked for."""

_OFF = 1e-6
"""Metres that rays start outside the pane."""


@dataclass(frozen=True)
class Shaded:
    """How a pane sees the outdoors, place by place.

    Attributes
    ----------
    places : rectangles of the glazing's face that fill the pane.
    sun : [P] share of the sun's light that reaches each of them; 1 where there is none.
    hidden, instead : [P, BINS^2] as in `transfer.SkyTransfer.tables`.
    """

    places: list[Rectangle]
    sun: Array
    hidden: Array
    instead: Array

    @property
    def matters(self) -> bool:
        """Whether anything stands before the pane at all."""
        return bool(np.any(self.hidden > 0.0) or np.any(self.sun < 1.0))


class Outside:
    """Opaque triangles outside a room, lit by sun and sky.

    Parameters
    ----------
    box : the room; its outer reveals and obstacles are taken.
    outdoors : sun, sky and ground.

    Attributes
    ----------
    triangles : [T, 3, 3] m; none if nothing stands outside.
    """

    def __init__(self, box: Box | OwnRoom, outdoors: Outdoors) -> None:
        self.box, self.outdoors = box, outdoors
        polygons: list[tuple[Array, float]] = []
        for index, window in enumerate(box.job.window):
            polygons += [(p, box.job.reflectance.outside) for p in outer_reveal(box, index, window)]
        polygons += box.polygons
        for obstacle in box.job.obstacle:
            polygons += [(p, obstacle.reflectance) for p in obstacle_faces(obstacle)]
        fans = [np.stack([p[0], p[k], p[k + 1]]) for p, _ in polygons for k in range(1, len(p) - 1)]
        self.triangles: Array = np.array(fans).reshape(-1, 3, 3)
        shades = [r for p, r in polygons for _ in range(len(p) - 2)]
        self._reflectance = np.array(shades)
        e = self.triangles[:, 1:] - self.triangles[:, :1]
        normal = np.cross(e[:, 0], e[:, 1])
        self._normal = normal / np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-300)
        self._sky = np.array([[self._skylight(t, side) for t in range(len(fans))] for side in (1.0, -1.0)])

    def _skylight(self, triangle: int, side: float) -> float:
        """Illuminance by the sky and the ground that a triangle sees from its middle, lx."""
        normal = side * self._normal[triangle]
        d, w = projected_hemisphere(normal, 16, 48)
        at = self.triangles[triangle].mean(axis=0) + 1e-5 * normal
        hit, _ = first_hits(at[None], d, self.triangles)
        return float(np.sum(w * np.where(hit[0] < 0, self.outdoors.luminance(d), 0.0)))

    def shade(self, pane: Pane, sampling: float) -> Shaded:
        """How a pane sees the outdoors."""
        face, out = self.box.faces[pane.face], pane.axes[2]
        places = _places(pane.glass, _CELL_M / np.sqrt(sampling))
        middle = np.array([face.point((r.u0 + r.u1) / 2, (r.v0 + r.v1) / 2) for r in places]) + _OFF * out
        local = bin_directions()
        directions = local @ pane.axes
        hit, distance = first_hits(middle, directions, self.triangles)
        instead = np.zeros(hit.shape)
        there = hit >= 0
        p, d = np.nonzero(there)
        at = middle[p] + distance[there][:, None] * directions[d]
        instead[there] = self._luminance(hit[there], at, directions[d])
        return Shaded(places, self._sun(pane, places), there.astype(float), instead)

    def _sun(self, pane: Pane, places: list[Rectangle]) -> Array:
        sun = self.outdoors.sun
        if sun is None or self.outdoors.sun_illuminance <= 0.0 or float(sun @ pane.axes[2]) <= 0.0:
            return np.ones(len(places))
        directions, weights = sun_disc(sun)
        k = (np.arange(_SUN_POINTS) + 0.5) / _SUN_POINTS
        share = np.empty(len(places))
        for n, r in enumerate(places):
            u, v = np.meshgrid(r.u0 + (r.u1 - r.u0) * k, r.v0 + (r.v1 - r.v0) * k)
            points = self.box.faces[pane.face].point(u.ravel(), v.ravel()) + _OFF * pane.axes[2]
            hit, _ = first_hits(points, directions, self.triangles)
            share[n] = float(np.mean(hit < 0, axis=0) @ weights)
        return share

    def _luminance(self, triangle: NDArray[np.intp], at: Array, directions: Array) -> Array:
        """cd/m2 of triangles at these points, seen along these directions."""
        normal = self._normal[triangle]
        away = np.sum(normal * directions, axis=1) > 0.0
        normal = np.where(away[:, None], -normal, normal)
        light = self._sky[away.astype(int), triangle]
        sun = self.outdoors.sun
        if sun is not None and self.outdoors.sun_illuminance > 0.0:
            cosine = normal @ sun
            lit = np.flatnonzero(cosine > 0.0)
            hit, _ = first_hits(at[lit] + 1e-5 * normal[lit], sun[None], self.triangles)
            light[lit] += np.where(hit[:, 0] < 0, self.outdoors.sun_illuminance * cosine[lit], 0.0)
        return np.asarray(self._reflectance[triangle] / np.pi * light)


def _places(glass: Rectangle, cell: float) -> list[Rectangle]:
    us, vs = (
        np.linspace(a, b, max(int(np.ceil((b - a) / cell - 1e-9)), 1) + 1)
        for a, b in ((glass.u0, glass.u1), (glass.v0, glass.v1))
    )
    return [
        Rectangle(float(us[i]), float(vs[j]), float(us[i + 1]), float(vs[j + 1]))
        for i in range(us.size - 1)
        for j in range(vs.size - 1)
    ]


def outer_reveal(box: Box | OwnRoom, index: int, window: Window) -> list[Array]:
    """The four faces of a window's outer reveal, [4, 3] corners each."""
    depth = window.outer_reveal_m
    if depth <= 0.0:
        return []
    pane = next(p for p in box.panes if p.window == index)
    face, out = box.faces[pane.face], pane.axes[2]
    (width, height), (jambs, sill, head) = face.size, depth * np.tan(np.radians(window.outer_splay_deg))
    u, v = np.array([0.0, width, width, 0.0]), np.array([0.0, 0.0, height, height])
    inner = face.point(u, v)
    outer = face.point(u + jambs * np.array([-1, 1, 1, -1]), v + np.array([-sill, -sill, head, head]))
    outer = outer + depth * out
    order = [(k, (k + 1) % 4) for k in range(4)]
    return [np.stack([inner[a], inner[b], outer[b], outer[a]]) for a, b in order]
