"""What is left of the original surface between the pits.

Two things tell a plateau. It is smooth, so its slopes crowd around those of the original surface, while
slopes of pits take all values and directions: in the plane of slopes (dz/dx, dz/dy) plateaux are a small
dense heap on a wide thin ground. And it lies on top: decay only takes away. Method: ours.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

__all__ = ["noise_of", "seeds", "without_specks"]

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

_SMOOTHING_PX = (1.0, 1.5, 2.0, 3.0, 4.0)
_CROWD = 0.02
"""Share of all pixels that the densest heap of slopes is looked for with."""
_ROUNDS = 25
_FEW = 0.01
_CALMEST = 0.15
_NARROW = 0.04
_REACH = 3.5
"""Half width of the heap in its own standard deviations."""


def noise_of(h: Array, near: Mask | None = None) -> float:
    """Standard deviation of the scatter of single heights, um: from the calmer half of second differences.

    Pixels outside `near` are left out. It is that of normal noise; curvature of calm parts adds to it little.
    """
    second = (h[:, 2:] - 2.0 * h[:, 1:-1] + h[:, :-2]) / np.sqrt(6.0)
    if near is not None:
        inside = near[:, 2:] & near[:, 1:-1] & near[:, :-2]
        if np.count_nonzero(inside) >= 50:
            return float(1.4826 * np.median(np.abs(second[inside])))
    return float(np.quantile(np.abs(second), 0.1) / 0.12566)


def seeds(h: Array, valid: Mask, *, pitch: tuple[float, float], noise: float) -> Mask:
    """Pixels whose slope is that of the plateaux, without specks.

    Slopes are Gaussian derivatives, of the smallest smoothing that brings the noise below the width of the
    heap.

    Parameters
    ----------
    h : heights, um, without gaps.
    valid : False where h was interpolated.
    pitch : (y, x) um per pixel.
    noise : standard deviation of single heights, um.
    """
    from scipy.ndimage import gaussian_filter

    found, gx, gy = valid, h, h
    for s in _SMOOTHING_PX:
        gx = gaussian_filter(h, s, order=(0, 1)) / pitch[1]
        gy = gaussian_filter(h, s, order=(1, 0)) / pitch[0]
        # Standard deviation of the slope of white noise under a Gaussian derivative.
        chance = noise / (np.sqrt(8.0 * np.pi) * s * s) / min(pitch)
        heap = _heap(gx[valid], gy[valid])
        found = without_specks(heap.holds(gx, gy) & valid, max(9, round(4.0 * s * s)))
        if chance < 0.7 * heap.width:
            break
    if found.mean() < _FEW:
        # No heap stands out: the calmest pixels have to do, and the field will tell which of them lie on top.
        steepness = np.hypot(gx - np.median(gx[valid]), gy - np.median(gy[valid]))
        calm = (steepness <= np.quantile(steepness[valid], _CALMEST)) & valid
        found = without_specks(calm, 9)
    return found


@dataclass(frozen=True)
class _Heap:
    """Normal laws of slopes, from the narrowest to the widest: the heap of the plateaux and its ground.

    The second belongs to the heap where it is that much narrower than the third: slopes of streaks are not
    normal, and what the first one leaves of them goes to the second.
    """

    centres: Array
    spreads: Array
    shares: Array

    @property
    def members(self) -> int:
        """How many of the laws are of the heap."""
        area = np.sqrt(np.linalg.det(self.spreads))
        return 2 if area[1] < _NARROW * area[2] else 1

    @property
    def width(self) -> float:
        """Standard deviation of the heap's slopes along its narrow axis."""
        k = self.members - 1
        return float(np.sqrt(np.linalg.eigvalsh(self.spreads[k])[0]))

    def densities(self, gx: Array, gy: Array) -> tuple[list[Array], list[Array]]:
        """Density of each law at slopes, and squared distances from its centre in its own measure."""
        densities, distances = [], []
        for centre, spread, share in zip(self.centres, self.spreads, self.shares):
            inverse = np.linalg.inv(spread)
            dx, dy = gx - centre[0], gy - centre[1]
            d = inverse[0, 0] * dx * dx + 2.0 * inverse[0, 1] * dx * dy + inverse[1, 1] * dy * dy
            densities.append(share * np.sqrt(np.linalg.det(inverse)) * np.exp(-0.5 * np.minimum(d, 700.0)))
            distances.append(d)
        return densities, distances

    def holds(self, gx: Array, gy: Array) -> Mask:
        """True where a slope rather belongs to the heap."""
        densities, distances = self.densities(gx, gy)
        m = self.members
        near = np.min(distances[:m], axis=0) < _REACH**2
        return np.asarray((sum(densities[:m]) > sum(densities[m:])) & near)


@dataclass(frozen=True)
class Slopes:
    """Smoothed slopes of a map, by which its plateaux are compared with a field.

    Parameters
    ----------
    gx, gy : [rows, columns].
    smoothing : standard deviation of the Gaussian, pixels.
    tolerance : difference of slopes from which a pixel does not go the field's way.
    chance : standard deviation of slopes by noise alone.
    """

    gx: Array
    gy: Array
    smoothing: float
    tolerance: float
    chance: float
    pitch: tuple[float, float]

    @classmethod
    def of(cls, h: Array, *, pitch: tuple[float, float], noise: float, finest: float = 0.02) -> Slopes:
        """Slopes with the least smoothing that brings four times their noise below `finest`."""
        from scipy.ndimage import gaussian_filter

        chance, s = 0.0, _SMOOTHING_PX[0]
        for s in _SMOOTHING_PX:
            chance = 4.0 * noise / (np.sqrt(8.0 * np.pi) * s * s) / min(pitch)
            if chance < finest:
                break
        gx = gaussian_filter(h, s, order=(0, 1)) / pitch[1]
        gy = gaussian_filter(h, s, order=(1, 0)) / pitch[0]
        return cls(gx, gy, s, max(chance, finest), chance / 4.0, pitch)

    def agrees(self, base: Array) -> Mask:
        """True where the slopes are those of a smooth field, within the tolerance."""
        by, bx = np.gradient(base, *self.pitch)
        return np.asarray(np.hypot(self.gx - bx, self.gy - by) < self.tolerance)

    def anisotropy(self, plateau: Mask) -> tuple[float, float]:
        """How much longer than wide the plateaux' slopes lie (1 to 4), and the long axis from x, radians."""
        gx, gy = self.gx[plateau], self.gy[plateau]
        if gx.size < 100:
            return 1.0, 0.0
        # Walls caught by a plateau's edge have outlying slopes.
        middle = np.median(gx), np.median(gy)
        far = np.hypot(gx - middle[0], gy - middle[1])
        inside = far < 4.0 * np.median(far)
        spread = np.cov(gx[inside], gy[inside]) - self.chance**2 * np.eye(2)
        sizes, axes = np.linalg.eigh(spread)
        if sizes[1] <= self.chance**2:
            return 1.0, 0.0
        ratio = float(np.sqrt(sizes[1] / max(sizes[0], sizes[1] / 16.0)))
        return ratio, float(np.arctan2(axes[1, 1], axes[0, 1]))


def _heap(gx: Array, gy: Array) -> _Heap:
    """Three normal laws fitted to the slopes, from a narrow one at their mode to a wide one (EM)."""
    step = max(1, gx.size // 60_000)
    x, y = gx[::step], gy[::step]
    mode = np.array([_mode(x), _mode(y)])
    distance = np.hypot(x - mode[0], y - mode[1])
    narrow, wide = np.quantile(distance, _CROWD), np.sqrt(np.mean(distance**2))
    sizes = np.array([max(narrow, 1e-9), np.sqrt(max(narrow, 1e-9) * wide), wide])
    heap = _Heap(np.stack([mode] * 3), np.stack([s * s * np.eye(2) for s in sizes]), np.full(3, 1.0 / 3.0))
    for _ in range(_ROUNDS):
        parts, _ = heap.densities(x, y)
        total = np.maximum(sum(parts), 1e-300)
        centres, spreads, shares = [], [], []
        for part in parts:
            w = part / total
            n = max(float(w.sum()), 1e-9)
            cx, cy = float(w @ x) / n, float(w @ y) / n
            dx, dy = x - cx, y - cy
            xx, xy, yy = float(w @ (dx * dx)) / n, float(w @ (dx * dy)) / n, float(w @ (dy * dy)) / n
            centres.append([cx, cy])
            spreads.append(np.array([[xx, xy], [xy, yy]]) + 1e-14 * np.eye(2))
            shares.append(n / x.size)
        heap = _Heap(np.array(centres), np.array(spreads), np.array(shares))
    return heap


def _mode(values: Array) -> float:
    """Where values crowd most: the middle of the narrowest interval that holds 5 % of them."""
    v = np.sort(values)
    n = max(2, int(0.05 * v.size))
    first = int(np.argmin(v[n:] - v[:-n]))
    return float(np.median(v[first : first + n]))


def without_specks(mask: Mask, least: int) -> Mask:
    """The mask without connected parts of fewer than `least` pixels."""
    from scipy.ndimage import label

    parts, _ = label(mask)
    keep = np.bincount(parts.ravel()) >= least
    keep[0] = False
    return np.asarray(keep[parts])
