"""Directions, frames and names used everywhere outside readers and writers.

Directions point away from the sample. z is the front normal, y is up, x completes a right-handed
frame seen from the front. theta is counted from the front normal, phi counter-clockwise from x as seen
from the front. A scattering distribution is described on one *side*: which light (arriving on the
front or on the back) and where it goes (transmitted or reflected). On each side the incident direction
is its polar angle from the normal of the face it arrives on, 0 to 90 degrees, with its azimuth; the
outgoing direction is its pair of direction cosines (ux, uy) along the sample's x and y, which needs no
sign for the hemisphere. Undeflected and mirrored light both leave at (ux, uy) = -(ix, iy).
"""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import ArrayLike, NDArray

__all__ = [
    "LUMINOUS_EFFICACY",
    "SIDES",
    "direction_angles",
    "direction_cosines",
    "disk_to_square",
    "fold_azimuth",
    "from_radiance",
    "pab_azimuth",
    "square_to_disk",
    "to_radiance",
    "undeflected",
]

Array = NDArray[np.float64]

SIDES: Final = ("transmission_front", "transmission_back", "reflection_front", "reflection_back")
"""The four sides of a pane: what happens to light that arrives on the front, and on the back."""

LUMINOUS_EFFICACY: Final = 179.0
"""lm/W, the constant by which Radiance turns radiance into luminance."""


def direction_cosines(theta_deg: ArrayLike, phi_deg: ArrayLike) -> tuple[Array, Array, Array]:
    """Cartesian unit vector of the direction (theta, phi), angles in degrees.

    >>> [round(float(c), 6) for c in direction_cosines(180.0, 0.0)]
    [0.0, 0.0, -1.0]
    """
    theta, phi = np.radians(theta_deg), np.radians(phi_deg)
    s = np.sin(theta)
    return s * np.cos(phi), s * np.sin(phi), np.cos(theta)


def direction_angles(x: ArrayLike, y: ArrayLike, z: ArrayLike) -> tuple[Array, Array]:
    """(theta, phi) in degrees of a direction; phi lies in [0, 360)."""
    x, y, z = np.asarray(x, float), np.asarray(y, float), np.asarray(z, float)
    theta = np.degrees(np.arctan2(np.hypot(x, y), z))
    return theta, fold_azimuth(np.degrees(np.arctan2(y, x)))


def fold_azimuth(phi_deg: ArrayLike) -> Array:
    """Azimuth folded into [0, 360) degrees."""
    folded = np.mod(np.asarray(phi_deg, float), 360.0)
    return np.where(folded >= 360.0, 0.0, folded)


def undeflected(theta_i_deg: ArrayLike, phi_i_deg: ArrayLike) -> tuple[Array, Array]:
    """Where light from (theta_i, phi_i) leaves if nothing deflects it: (180 - theta_i, phi_i + 180)."""
    return 180.0 - np.asarray(theta_i_deg, float), fold_azimuth(np.asarray(phi_i_deg, float) + 180.0)


def pab_azimuth(phi_deg: ArrayLike, upphi_deg: float = 0.0) -> Array:
    """Azimuth of a pab-opto table turned into ours: phi + 90 - upphi, with the file's azimuth of up."""
    return fold_azimuth(np.asarray(phi_deg, float) + 90.0 - upphi_deg)


def to_radiance(x: ArrayLike, y: ArrayLike, z: ArrayLike) -> tuple[Array, Array, Array]:
    """A direction of ours in the frame of Radiance's BSDF library: x_R = -x, y_R = y, z_R = -z."""
    return -np.asarray(x, float), np.asarray(y, float), -np.asarray(z, float)


def from_radiance(x: ArrayLike, y: ArrayLike, z: ArrayLike) -> tuple[Array, Array, Array]:
    """The inverse of `to_radiance` (the half turn about y is its own inverse)."""
    return to_radiance(x, y, z)


def square_to_disk(a: ArrayLike, b: ArrayLike) -> tuple[Array, Array]:
    """Equal-area map of the unit square [0, 1]^2 onto the unit disk (Shirley and Chiu).

    A cell of area A of the square is a set of directions of projected solid angle pi * A. The map is the
    one of Radiance's tensor trees.

    References
    ----------
    Shirley, P. and Chiu, K. (1997), A low distortion map between disk and square,
    Journal of Graphics Tools 2(3), doi:10.1080/10867651.1997.10487479
    """
    p = 2.0 * np.asarray(a, float) - 1.0
    q = 2.0 * np.asarray(b, float) - 1.0
    wide = np.abs(p) > np.abs(q)
    r = np.where(wide, p, q)
    with np.errstate(divide="ignore", invalid="ignore"):
        phi = np.where(wide, (np.pi / 4) * (q / p), np.pi / 2 - (np.pi / 4) * (p / q))
    phi = np.where(r == 0.0, 0.0, phi)
    return r * np.cos(phi), r * np.sin(phi)


def disk_to_square(x: ArrayLike, y: ArrayLike) -> tuple[Array, Array]:
    """Inverse of `square_to_disk`; points outside the unit disk map outside [0, 1]^2."""
    x, y = np.asarray(x, float), np.asarray(y, float)
    r = np.hypot(x, y)
    phi = np.arctan2(y, x)
    phi = np.where(phi < -np.pi / 4, phi + 2 * np.pi, phi)
    k = 4.0 / np.pi
    p = np.select(
        [phi < np.pi / 4, phi < 3 * np.pi / 4, phi < 5 * np.pi / 4],
        [r, -(phi - np.pi / 2) * r * k, -r],
        (phi - 3 * np.pi / 2) * r * k,
    )
    q = np.select(
        [phi < np.pi / 4, phi < 3 * np.pi / 4, phi < 5 * np.pi / 4],
        [phi * r * k, r, -(phi - np.pi) * r * k],
        -r,
    )
    return 0.5 * (p + 1.0), 0.5 * (q + 1.0)
