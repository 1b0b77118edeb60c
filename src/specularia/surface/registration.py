"""Frames of a focus series laid over each other: shift, magnification ("breathing") and turn, sub-pixel.

A similarity is estimated between neighbouring frames, which are blurred nearly alike, by Gauss-Newton steps
on their brightness, from coarse to fine (Lucas and Kanade 1981; Baker and Matthews 2004,
doi:10.1023/B:VISI.0000011205.11775.fd), with a free gain and offset of the brightness and weights that let
single bright reflections pass (Huber). Chained outwards from the middle frame they give each frame's place.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

__all__ = ["Similarity", "between", "chained", "warped"]

Array = NDArray[np.float64]
Image = NDArray[np.float32]

_SMALLEST = 64
"""Pixels along the shorter side of the coarsest level."""

_LARGEST = 1024
"""Pixels along the longer side of the finest level: more would add time, hardly accuracy."""

_STEPS = 30


@dataclass(frozen=True)
class Similarity:
    """Where a place of the reference frame lies in another frame.

    With x, y in pixels from the middle of the frame, x' = (1 + a) x - b y + dx, y' = b x + (1 + a) y + dy.

    Parameters
    ----------
    a, b : magnification minus one, and turn in radians, both small.
    dx, dy : shift in pixels.
    gain : brightness of the reference over that of the frame.
    """

    a: float = 0.0
    b: float = 0.0
    dx: float = 0.0
    dy: float = 0.0
    gain: float = 1.0

    def after(self, first: Similarity) -> Similarity:
        """The similarity that does `first` and then this one."""
        p, q = complex(1 + self.a, self.b), complex(1 + first.a, first.b)
        shift = p * complex(first.dx, first.dy) + complex(self.dx, self.dy)
        whole = p * q
        return Similarity(whole.real - 1.0, whole.imag, shift.real, shift.imag, self.gain * first.gain)

    def inverse(self) -> Similarity:
        """The similarity that undoes this one."""
        p = 1.0 / complex(1 + self.a, self.b)
        shift = -p * complex(self.dx, self.dy)
        return Similarity(p.real - 1.0, p.imag, shift.real, shift.imag, 1.0 / self.gain)

    def scaled(self, factor: float) -> Similarity:
        """The same similarity on frames with `factor` times as many pixels along a side."""
        return Similarity(self.a, self.b, self.dx * factor, self.dy * factor, self.gain)


def warped(image: Image, place: Similarity, *, order: int = 3) -> Image:
    """A frame as it would look from the place of the reference; its border goes on beyond its edge."""
    from scipy.ndimage import affine_transform

    rows, columns = image.shape
    middle = np.array([(rows - 1) / 2, (columns - 1) / 2])
    matrix = np.array([[1 + place.a, place.b], [-place.b, 1 + place.a]])
    offset = middle + np.array([place.dy, place.dx]) - matrix @ middle
    return affine_transform(image, matrix, offset, order=order, mode="nearest", output=np.float32)


def between(reference: Image, frame: Image) -> Similarity:
    """The similarity that lays `frame` over `reference`, [row, column] brightness both."""
    from scipy.ndimage import gaussian_filter

    largest = max(reference.shape)
    factor = 1
    while largest / factor > _LARGEST:
        factor *= 2
    factors = [factor]
    while min(reference.shape) / factors[-1] >= 2 * _SMALLEST:
        factors.append(2 * factors[-1])
    found = Similarity()
    for f in reversed(factors):
        pair = [gaussian_filter(_binned(image, f), 1.5) for image in (reference, frame)]
        found = _refined(pair[0], pair[1], found.scaled(1.0 / f)).scaled(float(f))
    return found


def chained(pairs: list[Similarity], reference: int) -> list[Similarity]:
    """Places of all frames relative to one of them.

    Parameters
    ----------
    pairs : for each frame but the last, the similarity that lays the next frame over it.
    reference : index of the frame that stays where it is.
    """
    places = [Similarity()] * (len(pairs) + 1)
    for k in range(reference, len(pairs)):
        places[k + 1] = pairs[k].after(places[k])
    for k in range(reference - 1, -1, -1):
        places[k] = pairs[k].inverse().after(places[k + 1])
    return places


def _binned(image: Image, factor: int) -> Image:
    rows, columns = (n // factor * factor for n in image.shape)
    blocks = image[:rows, :columns].reshape(rows // factor, factor, columns // factor, factor)
    return blocks.mean(axis=(1, 3), dtype=np.float32)


def _refined(reference: Image, frame: Image, start: Similarity) -> Similarity:
    rows, columns = reference.shape
    y, x = np.mgrid[0:rows, 0:columns].astype(np.float32)
    x, y = x - (columns - 1) / 2, y - (rows - 1) / 2
    edge = max(2, min(rows, columns) // 16)
    inner = (slice(edge, -edge), slice(edge, -edge))
    found = start
    x, y, wanted = x[inner].ravel(), y[inner].ravel(), reference[inner].ravel().astype(np.float64)
    for _ in range(_STEPS):
        moved = warped(frame, found, order=1)
        gy, gx = (g[inner].ravel() for g in (np.gradient(moved, axis=0), np.gradient(moved, axis=1)))
        here = moved[inner].ravel().astype(np.float64)
        # Columns: brightness, constant, and the derivatives by a, b, dx, dy.
        slopes = np.stack([here, np.ones_like(here), x * gx + y * gy, x * gy - y * gx, gx, gy])
        gain = float(np.std(wanted) / max(float(np.std(here)), 1e-12))
        residual = wanted - gain * here
        residual -= np.median(residual)
        scale = 1.4826 * float(np.median(np.abs(residual))) + 1e-12
        weight = np.minimum(1.0, 1.5 * scale / np.maximum(np.abs(residual), 1e-12))
        weighted = slopes * weight
        normal = weighted @ slopes.T
        size = np.sqrt(np.maximum(np.diag(normal), 1e-30))
        normal = normal / np.outer(size, size) + 1e-9 * np.eye(6)
        solved = np.linalg.solve(normal, (weighted @ wanted) / size) / size
        g = float(solved[0])
        if not (np.isfinite(solved).all() and g > 0.1):
            return start
        a, b, dx, dy = (float(v) / g for v in solved[2:])
        # Derivatives are those of the moved frame, so the step comes before what is there.
        found = found.after(Similarity(a, b, dx, dy))
        found = Similarity(found.a, found.b, found.dx, found.dy, g)
        if abs(dx) + abs(dy) + (abs(a) + abs(b)) * max(rows, columns) < 2e-3:
            break
    return found
