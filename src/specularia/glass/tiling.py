"""How a map of limited extent is made to repeat, and what that does to its slopes."""

from __future__ import annotations

import warnings
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from specularia.errors import SpeculariaWarning
from specularia.surface.heightmap import HeightMap
from specularia.surface.roughness import roughness

__all__ = ["Tiling", "TilingReport", "blended_share", "choose", "report", "slopes", "tiled", "warn_of_seam"]

Array = NDArray[np.float64]
Tiling = Literal["periodic", "mirror", "blend"]

BLEND_SHARE = 0.125
"""Share of the field's width over which `blend` joins opposite edges."""

SEAM_LIMIT = 3.0
"""A map said to be periodic whose steps across the seam exceed its steps inside by this factor is warned
about."""

CLOSED = 2.0
"""Where nothing is said, a map counts as periodic if its steps across the seam exceed those inside by less
than this factor."""


_SLOPE_BINS = 1 << 14


@dataclass(frozen=True)
class TilingReport:
    """What tiling did to a map.

    Attributes
    ----------
    tiling : "periodic", "mirror" or "blend".
    shape : of one period, [rows, columns].
    filled : missing pixels that were filled.
    blended : share of the area of a period in which two parts of the map are mixed.
    rms_slope : root mean square slope of the planes that light meets, of the map and of the period with its
        seams.
    Sdq : root mean square gradient, see `surface.roughness`, of the map and of the period.
    distance : largest difference between the cumulative distributions of the slopes before and after
        (Kolmogorov's distance), 0 to 1.
    """

    tiling: Tiling
    shape: tuple[int, int]
    filled: int
    blended: float
    rms_slope: tuple[float, float]
    Sdq: tuple[float, float]
    distance: float


def choose(heights_um: Array) -> Tiling:
    """ "periodic" for a map whose opposite edges meet, "mirror" for any other; NaN are passed over."""
    return "periodic" if max(_seams(heights_um)) < CLOSED else "mirror"


def tiled(heights_um: Array, tiling: Tiling) -> Array:
    """One period [ny, nx] of a complete map, relative to its mean."""
    h = heights_um
    if tiling == "mirror":
        h = np.concatenate([h, h[-2:0:-1]], axis=0)
        h = np.concatenate([h, h[:, -2:0:-1]], axis=1)
    elif tiling == "blend":
        h = _join(_join(h - h.mean()).T).T
    return np.ascontiguousarray(h - h.mean())


def slopes(heights_um: Array, period: Array, *, pitch_x_um: float, pitch_y_um: float) -> tuple[Array, Array]:
    """Slopes of all planes that light meets, of a complete map and of its period; pixel sizes in um."""
    return (
        _slopes(heights_um, pitch_x_um, pitch_y_um),
        _slopes(np.pad(period, ((0, 1), (0, 1)), mode="wrap"), pitch_x_um, pitch_y_um),
    )


def blended_share(shape: tuple[int, ...], tiling: Tiling) -> float:
    """Share of the area of a period in which two parts of a map of this shape are mixed."""
    if tiling != "blend":
        return 0.0
    rows, columns = (_overlap(n) / (n - _overlap(n)) for n in shape)
    return 1.0 - (1.0 - rows) * (1.0 - columns)


def report(
    heights_um: Array, period: Array, tiling: Tiling, *, pitch_x_um: float, pitch_y_um: float, filled: int
) -> TilingReport:
    """Compare the slopes of a complete map with those of its period; pixel sizes in um."""
    before, after = slopes(heights_um, period, pitch_x_um=pitch_x_um, pitch_y_um=pitch_y_um)
    # Cumulative shares at many slopes: sorting tens of millions of them would take long.
    top = max(float(before.max()), float(after.max()), 1e-12)
    counts = [np.histogram(s, bins=_SLOPE_BINS, range=(0.0, top))[0] for s in (before, after)]
    shares = [np.cumsum(c) / s.size for c, s in zip(counts, (before, after))]
    rough = [roughness(HeightMap(h, pitch_x_um, pitch_y_um)).Sdq for h in (heights_um, period)]
    return TilingReport(
        tiling=tiling,
        shape=(period.shape[0], period.shape[1]),
        filled=filled,
        blended=blended_share(heights_um.shape, tiling),
        rms_slope=(float(np.sqrt(np.mean(before**2))), float(np.sqrt(np.mean(after**2)))),
        Sdq=(float(rough[0]), float(rough[1])),
        distance=float(np.abs(shares[0] - shares[1]).max()),
    )


def warn_of_seam(heights_um: Array, name: str) -> None:
    """Warn where a map does not go on smoothly from its last row or column to its first."""
    for ratio, word in zip(_seams(heights_um), ("top and bottom", "left and right")):
        if ratio > SEAM_LIMIT:
            warnings.warn(
                f"{name}: repeated as it is, the {word} edges do not meet (steps across the seam are "
                f"{ratio:.3g} times those inside); tiling = 'mirror' or 'blend' avoids the false cliff.",
                SpeculariaWarning,
                stacklevel=4,
            )


def _seams(h: Array) -> tuple[float, float]:
    """Root mean square step across the seam over that inside, from last to first row, and column."""
    ratios = []
    for axis in (0, 1):
        with np.errstate(invalid="ignore"):
            inside = np.sqrt(np.nanmean(np.diff(h, axis=axis) ** 2)) if h.shape[axis] > 1 else 0.0
            steps = np.take(h, 0, axis) - np.take(h, -1, axis)
        steps = steps[np.isfinite(steps)]
        seam = float(np.sqrt(np.mean(steps**2))) if steps.size else float("inf")
        # A flat map has no steps at all.
        ratios.append(seam / max(float(inside), 1e-6) if seam > 1e-6 else 0.0)
    return ratios[0], ratios[1]


def _overlap(n: int) -> int:
    """Rows that are mixed where a map of n rows is joined with itself."""
    return max(2, round(BLEND_SHARE * n))


def _join(h: Array) -> Array:
    """Join the first rows of a zero-mean map with its last ones, and drop the last ones."""
    k = _overlap(h.shape[0])
    a = 0.5 * np.pi * (np.arange(k) + 0.5)[:, None] / k
    head = np.sin(a) * h[:k] + np.cos(a) * h[-k:]
    return np.concatenate([head, h[k:-k]], axis=0)


def _slopes(h: Array, pitch_x_um: float, pitch_y_um: float) -> Array:
    """Slopes of all planes into which the cells between samples are cut, see `kernel.meet_relief`."""
    along_x = np.diff(h, axis=1) / pitch_x_um
    along_y = np.diff(h, axis=0) / pitch_y_um
    lower = np.hypot(along_x[:-1], along_y[:, 1:])
    upper = np.hypot(along_x[1:], along_y[:, :-1])
    return np.concatenate([lower.ravel(), upper.ravel()])
