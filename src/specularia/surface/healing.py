"""The surface without its decay: pits found and bridged from what is left of the original surface.

Plateaux lie in one smooth surface, pits at all depths below it. So heights above a trial surface crowd at the
plateaux' level, however much of the map is pitted: their mode tells where the plateaux are, and their upper
half, which no pit can reach, how far plateaux scatter. A smooth surface is fitted to what lies within three
times that scatter, first a plane, then local planes of shrinking reach. What lies below it is a pit. Method:
ours; the regression is that of ISO 16610-71 (Gaussian, local planes), its weights are not.

Limits: a first version. It needs plateaux: where none is left within a pit's width, what it draws there is a
guess from afar. Streaks narrower than the pits are lost within them. A pit shallower than three times the
scatter of the plateaux is taken for plateau. Hills are kept.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from specularia.errors import PhysicsError
from specularia.surface.heightmap import HeightMap, filled, level, rms_sigma
from specularia.surface.roughness import roughness

__all__ = ["Healed", "heal"]

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

_FINEST_PX = 3.0
_SHORTEST_PX = 12.0
_ROUNDS = 6
_LID_ROUNDS = 20
_GROWTH = 16
_ENOUGH = 0.05
"""Share of plateau in a neighbourhood from which it is trusted fully."""
_COARSE_CELL = 3.0
"""Regression is done on cells of a third of the Gaussian's standard deviation: finer ones change little."""


@dataclass(frozen=True)
class Healed:
    """A healed map and what was done to it.

    Parameters
    ----------
    surface : plateaux as measured, pits bridged; no missing pixels.
    pits : [rows, columns], True where the height was replaced.
    pit_coverage : share of pits among all pixels.
    Sdq_before, Sdq_after : rms slope of the map given and of the healed one.
    tolerance_um : depth below the original surface from which a pixel counts as pit.
    parameters : settings, for provenance.
    """

    surface: HeightMap
    pits: Mask
    pit_coverage: float
    Sdq_before: float
    Sdq_after: float
    tolerance_um: float
    parameters: dict[str, float]


def heal(surface: HeightMap) -> Healed:
    """Find the pits of a map and bridge them from the plateaux around them.

    Parameters
    ----------
    surface : a map (no profile), at least 32 pixels each way, at most 20 % missing.

    Raises
    ------
    PhysicsError : a profile, a map too small, too many missing pixels, or less than 2 % of plateaux left.
    """
    if min(surface.shape) < 32:
        raise PhysicsError(
            f"{surface.name}: healing needs a map of at least 32 x 32 pixels, this one has {surface.shape}."
        )
    whole, _ = filled(surface)
    flat = level(whole)
    trend = whole.heights_um - flat.heights_um
    h = flat.heights_um
    noise = _noise(surface, h)
    base, tolerance = _original(h, noise)
    pits = _pits(h - base, tolerance)
    coverage = float(pits.mean())
    if coverage > 0.98:
        raise PhysicsError(
            f"{surface.name}: plateaux cover {1 - coverage:.1%}; "
            "nothing of the original surface is left to go by."
        )
    bridged = np.where(pits, _bridge(h, ~pits), h) + trend
    # What was measured of a pit says nothing about the surface that was there.
    sigma = None if whole.sigma_um is None else np.where(pits, np.nan, whole.sigma_um)
    healed = replace(whole, heights_um=bridged, sigma_um=sigma)
    return Healed(
        surface=healed,
        pits=pits,
        pit_coverage=coverage,
        Sdq_before=roughness(surface).Sdq,
        Sdq_after=roughness(healed).Sdq,
        tolerance_um=tolerance,
        parameters={"tolerance_um": tolerance, "noise_um": noise},
    )


def _noise(surface: HeightMap, h: Array) -> float:
    """Scatter of neighbouring heights in um: the map's own sigma, or from its calmest second differences."""
    known = rms_sigma(surface)
    if np.isfinite(known) and known > 0:
        return known
    second = (h[:, 2:] - 2.0 * h[:, 1:-1] + h[:, :-2]) / np.sqrt(6.0)
    return max(float(1.4826 * np.quantile(np.abs(second), 0.25) * 2.0), 1e-6 * float(np.ptp(h)))


def _original(h: Array, noise: float) -> tuple[Array, float]:
    """A smooth surface through the plateaux of h, and the depth below it from which a pixel is a pit."""
    side = float(min(h.shape))
    base, tolerance = _lid(h), 3.0 * noise
    scales = [np.inf]
    while scales[-1] > _SHORTEST_PX:
        scales.append(min(side / 2.0, scales[-1]) / 2.0)
    for scale in scales:
        for _ in range(_ROUNDS):
            residual = h - base
            centre = _mode(residual)
            above = residual[residual > centre] - centre
            scatter = 1.4826 * float(np.median(above)) if above.size else 0.0
            tolerance = 3.0 * max(scatter, noise)
            plateau = (np.abs(residual - centre) < tolerance).astype(np.float64)
            if np.isinf(scale):
                base = base + _plane(residual, plateau)
            else:
                fine, density = _regress(residual, plateau, scale)
                # Where a neighbourhood holds hardly any plateau, the surface of the longer reach stands.
                base = base + fine * np.clip(density / _ENOUGH, 0.0, 1.0)
    return _grown(h, base, tolerance), tolerance


def _grown(h: Array, base: Array, tolerance: float) -> Array:
    """The base after plateaux have grown into what continues them smoothly, such as the trough of a streak.

    Planes of short reach follow the plateaux beyond their edge; what lies within the tolerance of them joins.
    The wall of a pit falls away too fast for that.
    """
    from scipy.ndimage import binary_opening

    before = -1
    for _ in range(_GROWTH):
        # Opening takes away the thin lines along which walls of pits pass the level of the plateaux.
        plateau = binary_opening(np.abs(h - base) < tolerance, np.ones((3, 3), bool))
        count = int(np.count_nonzero(plateau))
        if count <= 1.0005 * before:
            break
        before = count
        fine, density = _regress(h, plateau.astype(np.float64), _FINEST_PX)
        base = np.where(density > _ENOUGH, fine, base)
    return base


def _mode(values: Array) -> float:
    """Where values crowd most: the median of the narrowest interval that holds 3 % of them."""
    v = np.sort(values, axis=None)
    v = v[:: max(1, v.size // 65536)]
    n = max(2, int(0.03 * v.size))
    first = int(np.argmin(v[n:] - v[:-n]))
    return float(np.median(v[first : first + n]))


def _lid(h: Array) -> Array:
    """The plane that lies on the map: asymmetric least squares, heights above it weighing 99 times more.

    Reference: Newey, W. K. and Powell, J. L. (1987), Asymmetric least squares estimation and testing,
    Econometrica 55(4), 819, doi:10.2307/1911031
    """
    plane = np.full(h.shape, float(np.max(h)))
    for _ in range(_LID_ROUNDS):
        plane = _plane(h, np.where(h > plane, 0.99, 0.01))
    return plane


def _plane(h: Array, weight: Array) -> Array:
    """Least-squares plane of h with weights, at every pixel."""
    y, x = np.mgrid[-1 : 1 : h.shape[0] * 1j, -1 : 1 : h.shape[1] * 1j]
    terms = (np.ones(h.shape), x, y)
    normal = np.array([[np.sum(weight * a * b) for a in terms] for b in terms])
    right = np.array([np.sum(weight * a * h) for a in terms])
    c = np.linalg.lstsq(normal, right, rcond=None)[0]
    return c[0] + c[1] * x + c[2] * y


def _pits(residual: Array, tolerance: float) -> Mask:
    """What lies deeper than the tolerance, without specks, widened to the rim."""
    from scipy.ndimage import binary_dilation

    deep = _without_specks(residual < -tolerance, 6)
    # The rim of a pit rises through the tolerance; one pixel more belongs to it.
    plateau = ~binary_dilation(deep)
    # Small islands of plateau are the parts of pits that cross its level.
    return ~_without_specks(plateau, 25)


def _without_specks(mask: Mask, least: int) -> Mask:
    """The mask without connected parts of fewer than `least` pixels."""
    from scipy.ndimage import label

    parts, _ = label(mask)
    keep = np.bincount(parts.ravel()) >= least
    keep[0] = False
    return keep[parts]


def _bridge(h: Array, plateau: Mask) -> Array:
    """Regression through the plateaux at the finest scale that reaches enough of them."""
    scale = _FINEST_PX
    weight = plateau.astype(np.float64)
    bridge, density = _regress(h, weight, scale)
    open_share = np.clip(1.0 - density / 0.25, 0.0, 1.0)
    while open_share.max() > 0 and scale < max(h.shape):
        scale *= 2.0
        coarse, density = _regress(h, weight, scale)
        bridge = (1.0 - open_share) * bridge + open_share * coarse
        open_share = open_share * np.clip(1.0 - density / 0.25, 0.0, 1.0)
    return bridge


def _regress(h: Array, weight: Array, scale: float) -> tuple[Array, Array]:
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
