"""Simple ways to guess the surface below which pits were eaten, for comparison with healing by a field."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

__all__ = ["base", "lid_plane", "regress"]

Array = NDArray[np.float64]

_LID_ROUNDS = 20
_CROWD_ROUNDS = 30
_CROWD = 0.03
_ROBUST_ROUNDS = 40
_CUTOFF_SHARE, _RADIUS_SHARE = 0.5, 0.125
"""Cut-off of the Gaussian and radius of the disc over the shorter side of the map, where none is given."""
_LARGEST = 512
"""Pixels along the longer side of the map that the morphological filter works on."""
_COARSE_CELL = 3.0
"""Regression is done on cells of a third of the Gaussian's standard deviation: finer ones change little."""


def base(
    method: str, h: Array, *, pitch: tuple[float, float], reach_um: float | None
) -> tuple[Array, dict[str, float | str]]:
    """The base surface of h by one of "flat", "gaussian", "closing", and the settings it was made with.

    Parameters
    ----------
    h : [rows, columns] heights without gaps, um.
    pitch : (y, x) um per pixel.
    reach_um : cut-off wavelength of "gaussian" (half of the shorter side if None), radius of the largest
        disc of "closing" (an eighth of it).
    """
    if method == "flat":
        return _flat(h), {}
    side = min(h.shape[0] * pitch[0], h.shape[1] * pitch[1])
    reach = (
        (_CUTOFF_SHARE if method == "gaussian" else _RADIUS_SHARE) * side if reach_um is None else reach_um
    )
    if method == "gaussian":
        return robust_gaussian(h, cutoff_px=reach / float(np.sqrt(pitch[0] * pitch[1]))), {"reach_um": reach}
    return _closing(h, reach / float(np.sqrt(pitch[0] * pitch[1]))), {"reach_um": reach}


def lid_plane(h: Array) -> Array:
    """The plane that lies on the map: asymmetric least squares, heights above it weighing 99 times more.

    Reference: Newey, W. K. and Powell, J. L. (1987), Asymmetric least squares estimation and testing,
    Econometrica 55(4), 819, doi:10.2307/1911031
    """
    plane = np.full(h.shape, float(np.max(h)))
    for _ in range(_LID_ROUNDS):
        plane = _plane(h, np.where(h > plane, 0.99, 0.01))
    return plane


def _flat(h: Array) -> Array:
    """The plane where heights crowd most, from the lid downwards."""
    plane = lid_plane(h)
    for _ in range(_CROWD_ROUNDS):
        residual = h - plane
        v = np.sort(residual, axis=None)[:: max(1, residual.size // 65536)]
        n = max(2, int(_CROWD * v.size))
        first = int(np.argmin(v[n:] - v[:-n]))
        centre = float(np.median(v[first : first + n]))
        above = residual[residual > centre] - centre
        scatter = 1.4826 * float(np.median(above)) if above.size else 0.0
        step = _plane(residual, (np.abs(residual - centre) <= max(2.0 * scatter, 1e-12)).astype(float))
        plane = plane + step
        if np.abs(step).max() < 1e-3 * max(scatter, 1e-12):
            break
    return plane


def _plane(h: Array, weight: Array) -> Array:
    """Least-squares plane of h with weights, at every pixel."""
    y, x = np.mgrid[-1 : 1 : h.shape[0] * 1j, -1 : 1 : h.shape[1] * 1j]
    terms = (np.ones(h.shape), x, y)
    normal = np.array([[np.sum(weight * a * b) for a in terms] for b in terms])
    right = np.array([np.sum(weight * a * h) for a in terms])
    c = np.linalg.lstsq(normal, right, rcond=None)[0]
    return np.asarray(c[0] + c[1] * x + c[2] * y)


def robust_gaussian(h: Array, *, cutoff_px: float) -> Array:
    """Robust Gaussian regression of first order: Tukey's weights, c = 4.4 medians of the absolute residual.

    The Gaussian of cut-off wavelength L is exp(-pi (r / (a L))^2), a = sqrt(ln 2 / pi) (ISO 16610-61).

    Reference: ISO 16610-71:2014, Robust areal filters: Gaussian regression filters.
    """
    sigma = np.sqrt(np.log(2.0) / np.pi) * cutoff_px / np.sqrt(2.0 * np.pi)
    weight = np.ones(h.shape)
    out = h
    last = np.inf
    for _ in range(_ROBUST_ROUNDS):
        out, _ = regress(h, weight, float(sigma))
        residual = h - out
        c = 4.4 * float(np.median(np.abs(residual)))
        if c <= 0.0 or abs(c - last) < 1e-3 * c:
            break
        last = c
        weight = np.where(np.abs(residual) < c, (1.0 - (residual / c) ** 2) ** 2, 0.0)
    return out


def _closing(h: Array, radius_px: float) -> Array:
    """Closing and opening in turns with discs of doubling radius up to the largest (scale space).

    Reference: ISO 16610-49, Morphological scale space techniques, with discs on the areal map (ISO 16610-85).
    """
    from scipy.ndimage import gaussian_filter
    from skimage.morphology import closing, disk, opening

    cell = -(-max(h.shape) // _LARGEST)
    # Noise would lift what is built of highest points.
    small = _gather(gaussian_filter(h, 1.0, mode="nearest"), cell)
    radius, last = 2.0, radius_px / cell
    while True:
        r = max(1, round(min(radius, last)))
        shape: Any = disk(r, decomposition="sequence")  # type: ignore[no-untyped-call]
        padded = np.pad(small, r, mode="reflect") if r < min(small.shape) else small
        done = opening(closing(padded, shape), shape)
        small = done[r:-r, r:-r] if padded is not small else done
        if radius >= last:
            return _spread(small, cell, h.shape)
        radius *= 2.0


def regress(h: Array, weight: Array, scale: float) -> tuple[Array, Array]:
    """Local-plane Gaussian regression of h with weights, and the local mean of the weights.

    At each place the plane that minimises sum g w (h - plane)^2, g a Gaussian of standard deviation `scale`
    pixels, evaluated there (ISO 16610-71, regression of first order). Where the weights lie so much to one
    side that a plane is badly determined, its slope is drawn towards zero.
    """
    from scipy.ndimage import gaussian_filter

    cell = max(1, int(scale // _COARSE_CELL))
    w, wh = _gather(weight, cell), _gather(weight * h, cell)
    rows, columns = w.shape
    s = scale / cell
    # Coordinates in units of the Gaussian's width keep the moments of one size.
    y, x = (np.arange(rows) / s)[:, None], (np.arange(columns) / s)[None, :]

    def smooth(a: Array) -> Array:
        return gaussian_filter(a, s, mode="constant", truncate=3.5)

    m0, mx, my, mh = smooth(w), smooth(w * x), smooth(w * y), smooth(wh)
    mxx, mxy, myy = smooth(w * x * x), smooth(w * x * y), smooth(w * y * y)
    mxh, myh = smooth(wh * x), smooth(wh * y)
    safe = np.maximum(m0, 1e-12)
    ax, ay, ah = mx / safe, my / safe, mh / safe
    cxx, cyy, cxy = mxx / safe - ax * ax + 0.02, myy / safe - ay * ay + 0.02, mxy / safe - ax * ay
    cxh, cyh = mxh / safe - ax * ah, myh / safe - ay * ah
    determinant = np.maximum(cxx * cyy - cxy * cxy, 1e-9)
    bx, by = (cxh * cyy - cyh * cxy) / determinant, (cyh * cxx - cxh * cxy) / determinant
    value = ah + bx * (x - ax) + by * (y - ay)
    density = m0 / np.maximum(smooth(np.ones_like(w)), 1e-12)
    return _spread(value, cell, h.shape), _spread(density, cell, h.shape)


def _gather(a: Array, cell: int) -> Array:
    """Means over cells of cell x cell pixels; cells that hang over the border count what they hold."""
    if cell == 1:
        return a
    rows, columns = -(-a.shape[0] // cell), -(-a.shape[1] // cell)
    padded = np.zeros((rows * cell, columns * cell))
    padded[: a.shape[0], : a.shape[1]] = a
    return padded.reshape(rows, cell, columns, cell).mean(axis=(1, 3))


def _spread(a: Array, cell: int, shape: tuple[int, ...]) -> Array:
    """Values of cells carried to every pixel, linear between the cells' centres."""
    from scipy.ndimage import map_coordinates

    if cell == 1:
        return a[: shape[0], : shape[1]]
    y = (np.arange(shape[0]) + 0.5) / cell - 0.5
    x = (np.arange(shape[1]) + 0.5) / cell - 0.5
    return map_coordinates(a, np.meshgrid(y, x, indexing="ij"), order=1, mode="nearest")
