"""From picture positions to rays and back: perspective, fisheye and plan, as Radiance defines them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from specularia.daylight.views import View

__all__ = ["Camera"]

Array = NDArray[np.float64]

_BELOW_CEILING = 2e-3
"""Metres below the ceiling from which a plan looks down."""


@dataclass(frozen=True)
class Camera:
    """A view of a room, placed.

    Attributes
    ----------
    kind : perspective, fisheye or plan.
    size_px : columns, rows.
    position : [3] of the eye; the middle of the picture of a plan.
    forward, right, up : [3] unit vectors.
    half : half of the picture's width and height: tangents (perspective), right angles (fisheye, both 1) or
        metres (plan).
    """

    kind: str
    size_px: tuple[int, int]
    position: Array
    forward: Array
    right: Array
    up: Array
    half: tuple[float, float]

    @classmethod
    def of(cls, view: View, room: Array) -> Camera:
        """The camera of a view in a room of this width, depth and height in metres."""
        if view.kind == "plan":
            columns, rows = view.size_px
            scale = min(columns / room[0], rows / room[1])
            x, y, z = np.eye(3)
            return cls(
                kind="plan",
                size_px=(max(round(room[0] * scale), 1), max(round(room[1] * scale), 1)),
                position=np.array([room[0] / 2, room[1] / 2, room[2] - _BELOW_CEILING]),
                forward=-z,
                right=x,
                up=y,
                half=(float(room[0]) / 2, float(room[1]) / 2),
            )
        forward = np.array(view.direction, float)
        right = np.cross(forward, view.up)
        right /= np.linalg.norm(right)
        half = (1.0, 1.0)
        if view.kind == "perspective":
            tangent = float(np.tan(np.radians(view.horizontal_deg / 2)))
            half = (tangent, tangent * view.size_px[1] / view.size_px[0])
        return cls(
            kind=view.kind,
            size_px=view.size_px,
            position=np.array(view.position_m, float),
            forward=forward,
            right=right,
            up=np.cross(right, forward),
            half=half,
        )

    def rays(self, column: Array, row: Array) -> tuple[Array, Array, NDArray[np.bool_]]:
        """Origins [K, 3], unit directions [K, 3], and whether there is a picture at these positions [K].

        Positions count pixels from the upper left corner. A fisheye shows nothing outside its circle.
        """
        columns, rows = self.size_px
        x = (2.0 * np.asarray(column, float) / columns - 1.0) * self.half[0]
        y = (1.0 - 2.0 * np.asarray(row, float) / rows) * self.half[1]
        across = x[:, None] * self.right + y[:, None] * self.up
        inside = np.ones(x.shape, dtype=bool)
        if self.kind == "plan":
            return self.position + across, np.broadcast_to(self.forward, across.shape).copy(), inside
        if self.kind == "perspective":
            d = self.forward + across
            d /= np.linalg.norm(d, axis=1, keepdims=True)
        else:
            r = np.hypot(x, y)
            inside = r < 1.0
            # np.sinc(r / 2) is sin(angle) / angle for the angle of r times 90 degrees.
            d = np.cos(np.pi / 2 * r)[:, None] * self.forward
            d = d + (np.pi / 2 * np.sinc(r / 2))[:, None] * across
        return np.broadcast_to(self.position, d.shape).copy(), d, inside

    def project(self, points: Array) -> Array:
        """[K, 2] picture positions (column, row) of points [K, 3]; NaN for those outside the picture."""
        d = points - self.position
        depth, x, y = d @ self.forward, d @ self.right, d @ self.up
        columns, rows = self.size_px
        with np.errstate(divide="ignore", invalid="ignore"):
            if self.kind == "perspective":
                x, y = x / depth, y / depth
            elif self.kind == "fisheye":
                length = np.hypot(x, y)
                share = np.where(length > 0, np.arctan2(length, depth) / (np.pi / 2) / length, 0.0)
                x, y = x * share, y * share
            x, y = x / self.half[0], y / self.half[1]
            seen = (depth > 0) & (np.abs(x) <= 1) & (np.abs(y) <= 1)
        place = np.stack([0.5 * columns * (1 + x), 0.5 * rows * (1 - y)], axis=1)
        return np.where(seen[:, None], place, np.nan)

    def towards_eye(self, points: Array) -> Array:
        """[K, 3] vectors from points [K, 3] to the eye, of any length."""
        if self.kind == "plan":
            return np.broadcast_to(-self.forward, points.shape)
        return self.position - points

    def cosine_weights(self) -> Array:
        """[rows, columns] solid angle times the cosine to the direction of sight, sr, of a fisheye's pixels.

        In an equidistant picture d omega = sin(a) / a times the area in radians; 3 x 3 points to a pixel.
        """
        columns, rows = self.size_px
        k = (np.arange(3 * columns) + 0.5) / 3
        c, r = np.meshgrid(2 * k / columns - 1, 2 * k[: 3 * rows] / rows - 1)
        a = np.pi / 2 * np.hypot(c, r)
        value = np.where(a < np.pi / 2, np.sinc(a / np.pi) * np.cos(a), 0.0) * (np.pi / columns) ** 2
        return value.reshape(rows, 3, columns, 3).mean(axis=(1, 3))

    def header(self) -> str:
        """The view in the words of Radiance."""
        kind = {"perspective": "v", "fisheye": "a", "plan": "l"}[self.kind]
        if self.kind == "perspective":
            h, v = (2 * np.degrees(np.arctan(t)) for t in self.half)
        elif self.kind == "fisheye":
            h = v = 180.0
        else:
            h, v = (2 * m for m in self.half)
        vectors = zip(("vp", "vd", "vu"), (self.position, self.forward, self.up))
        placed = " ".join(f"-{name} " + " ".join(f"{c + 0.0:.6g}" for c in vec) for name, vec in vectors)
        return f"-vt{kind} {placed} -vh {h:.6g} -vv {v:.6g}"
