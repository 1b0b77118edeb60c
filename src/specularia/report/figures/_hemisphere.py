"""The hemisphere as a round picture: pixels, grid lines, the common logarithmic scale."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Final

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import Colormap, LogNorm
from matplotlib.patches import Circle
from numpy.typing import NDArray

from specularia.report.style import hatch

if TYPE_CHECKING:
    from specularia.bsdf import ScatteringModel

__all__ = ["COLOURS", "CROSS", "DECADES", "Pixels", "colours", "draw", "mean_dsf", "pixels", "scale"]

Array = NDArray[np.float64]

DECADES: Final = 5
"""Decades of the logarithmic scale of all DSF figures."""

CROSS: Final = "#39d0ff"
"""Colour of the cross at the undeflected direction."""

COLOURS: Final = "inferno"
"""Colour map of all DSF figures."""


@dataclass(frozen=True)
class Pixels:
    """Square pixels over a hemisphere in equidistant projection (distance from the middle: polar angle).

    Parameters
    ----------
    edge_deg : array [n + 1], borders of the pixels along either axis, -90 to 90.
    ux, uy : arrays [n, n, s, s], direction cosines of s x s directions in each pixel; NaN below the horizon.
        The first index is the row, from the lowest y up.
    cosine : array like ux, |cos theta_s|.
    solid_angle : array [n, n], solid angle (sr) of the part of each pixel above the horizon.
    """

    edge_deg: Array
    ux: Array
    uy: Array
    cosine: Array
    solid_angle: Array

    def mean(self, values: Array) -> Array:
        """Mean over the directions of each pixel [n, n]; NaN where no direction has a value."""
        inside = np.isfinite(values)
        n = inside.sum(axis=(2, 3))
        total = np.where(inside, values, 0.0).sum(axis=(2, 3))
        return np.where(n > 0, total / np.maximum(n, 1), np.nan)


def pixels(n: int = 300, oversample: int = 3) -> Pixels:
    """Pixels of a hemisphere: n x n, each with oversample^2 directions."""
    edge = np.linspace(-90.0, 90.0, n + 1)
    fine = (np.arange(n * oversample) + 0.5) * (180.0 / (n * oversample)) - 90.0
    x, y = np.meshgrid(fine, fine)
    theta = np.radians(np.hypot(x, y))
    inside = theta < np.pi / 2
    # In this projection the solid angle of an area dA (in square radians) is sin(theta) / theta dA.
    stretch = np.sinc(theta / np.pi)
    part = np.radians(180.0 / (n * oversample)) ** 2
    ux = np.where(inside, np.radians(x) * stretch, np.nan)
    uy = np.where(inside, np.radians(y) * stretch, np.nan)
    solid = np.where(inside, stretch * part, 0.0)

    def blocks(a: Array) -> Array:
        return a.reshape(n, oversample, n, oversample).swapaxes(1, 2)

    return Pixels(
        edge_deg=edge,
        ux=blocks(ux),
        uy=blocks(uy),
        cosine=blocks(np.where(inside, np.cos(theta), np.nan)),
        solid_angle=blocks(solid).sum(axis=(2, 3)),
    )


def mean_dsf(model: ScatteringModel, side: str, theta_i_deg: float, phi_i_deg: float, grid: Pixels) -> Array:
    """Mean DSF of each pixel; NaN throughout where the model has no data for the angle."""
    values = np.full(grid.ux.shape, np.nan)
    inside = np.isfinite(grid.ux)
    if np.isfinite(model.direct_hemispherical(side, theta_i_deg, phi_i_deg)):
        bsdf = model.evaluate(side, theta_i_deg, phi_i_deg, grid.ux[inside], grid.uy[inside])
        values[inside] = bsdf * grid.cosine[inside]
    return grid.mean(values)


def colours() -> Colormap:
    """The colour map of DSF pictures; no-data is transparent, so that the hatching under it shows."""
    return mpl.colormaps[COLOURS].with_extremes(bad=(0, 0, 0, 0), under=(0.0, 0.0, 0.02))


def scale(*values: Array) -> LogNorm:
    """Five decades that end at the next half decade above the largest value of all panels."""
    top = max((float(np.nanmax(v)) for v in values if np.isfinite(v).any()), default=1.0)
    top = top if top > 0.0 else 1.0
    upper = 10.0 ** (np.ceil(2.0 * np.log10(top)) / 2.0)
    return LogNorm(vmin=upper / 10.0**DECADES, vmax=upper)


def draw(axes: Axes, image: Array, norm: LogNorm, *, theta_i_deg: float, phi_i_deg: float = 0.0) -> Any:
    """Draw one hemisphere with its polar grid; returns the mappable for the colour bar.

    The cross, open so that it hides no peak, marks where undeflected or mirrored light leaves. Values at or
    below zero take the colour below the scale: they were measured, so they are not no-data.
    """
    axes.set(xlim=(-101, 101), ylim=(-101, 101), aspect="equal")
    axes.axis("off")
    disk = Circle((0, 0), 90.0)
    hatch(axes, disk)
    floor = norm.vmin / 10.0  # type: ignore[operator]
    shown = np.where(np.isfinite(image), np.maximum(image, floor), np.nan)
    picture = axes.imshow(
        shown, origin="lower", extent=(-90, 90, -90, 90), cmap=colours(), norm=norm, interpolation="nearest"
    )
    clip = Circle((0, 0), 90.0, transform=axes.transData, facecolor="none")
    axes.add_patch(clip)
    picture.set_clip_path(clip)
    for ring in (30.0, 60.0):
        axes.add_patch(Circle((0, 0), ring, fill=False, edgecolor="white", alpha=0.45, linewidth=0.5))
        a = np.radians(67.5)
        axes.text(
            ring * np.cos(a),
            ring * np.sin(a),
            f"{ring:.0f}°",
            color="white",
            alpha=0.8,
            fontsize=5.5,
            ha="center",
            va="center",
        )
    axes.add_patch(Circle((0, 0), 90.0, fill=False, edgecolor="#333333", linewidth=0.7))
    for phi in range(0, 360, 30):
        a = np.radians(phi)
        c, s = np.cos(a), np.sin(a)
        axes.plot([90 * c, 93 * c], [90 * s, 93 * s], color="#333333", linewidth=0.6, clip_on=False)
        axes.plot([30 * c, 90 * c], [30 * s, 90 * s], color="white", alpha=0.18, linewidth=0.4)
        if phi % 90 == 0:
            axes.text(
                99 * c,
                99 * s,
                f"{phi}°",
                fontsize=6,
                color="#333333",
                ha="center" if phi % 180 else ("left" if c > 0 else "right"),
                va="center" if phi % 180 == 0 else ("bottom" if s > 0 else "top"),
            )
    a = np.radians(phi_i_deg + 180.0)
    x, y = theta_i_deg * np.cos(a), theta_i_deg * np.sin(a)
    for dx, dy in ((1, 0), (-1, 0), (0, 1), (0, -1)):
        axes.plot([x + 4 * dx, x + 8 * dx], [y + 4 * dy, y + 8 * dy], color=CROSS, linewidth=0.8)
    return picture
