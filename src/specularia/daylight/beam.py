"""Sunlight that passes a pane undeflected."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from specularia.daylight._triangle_kernel import first_hits
from specularia.daylight.geometry import Box
from specularia.daylight.outdoors import sun_disc
from specularia.daylight.own_geometry import OwnRoom
from specularia.daylight.panes import Lights

__all__ = ["beam_illuminance"]

Array = NDArray[np.float64]


def beam_illuminance(box: Box | OwnRoom, lights: Lights, points: Array, normals: Array) -> Array:
    """[K, 1] lx of undeflected sunlight, which is white, at points [K, 3] with normals [K, 3]: mean over the
    sun's disc.

    A point is lit where the way to the sun passes through a pane, through the mouth of its niche, and by all
    that stands outside.
    """
    out = np.zeros(len(points))
    if lights.sun_direction is None or not np.any(lights.beam > 0.0):
        return out[:, None]
    directions, weights = sun_disc(lights.sun_direction)
    spaces = None if isinstance(box, OwnRoom) else box.spaces(points)
    for index in np.flatnonzero(lights.beam > 0.0):
        pane = box.panes[index]
        face = box.faces[pane.face]
        for d, w in zip(directions, weights):
            towards = float(-(d @ face.normal))
            cosine = np.maximum(normals @ d, 0.0)
            far = face.coordinates(points)[2] / max(towards, 1e-9)
            at = points + far[:, None] * d
            u, v, _ = face.coordinates(at)
            lit = (cosine > 0.0) & (far >= 0.0) & pane.glass.holds(u, v) & (towards > 0.0)
            if isinstance(box, Box) and (window := box.job.window[pane.window]).inner_reveal_m > 0.0:
                wall = box.faces[window.wall]
                height = wall.coordinates(points)[2]
                mu, mv, _ = wall.coordinates(points + (height / max(towards, 1e-9))[:, None] * d)
                lit &= (spaces == pane.window) | box.mouths[pane.window].holds(mu, mv)
            here = np.flatnonzero(lit)
            if here.size and len(lights.triangles):
                # In a room from files something may also stand between the point and the pane.
                start = points[here] + 1e-5 * normals[here] if isinstance(box, OwnRoom) else at[here]
                hit, _ = first_hits(start + 1e-6 * pane.axes[2], d[None], lights.triangles)
                here = here[hit[:, 0] < 0]
            out[here] += w * lights.beam[index] * cosine[here]
    return out[:, None]
