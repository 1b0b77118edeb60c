"""The tables of one side of a model: distributions measured or traced at a list of incident directions."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from specularia.bsdf.model import Array
from specularia.conventions import disk_to_square, square_to_disk
from specularia.errors import PhysicsError

__all__ = ["SYMMETRIES", "SideTable", "base_index", "cell_centres"]

SYMMETRIES = ("isotropic", "bilateral", "none")
"""What the sample may be turned or mirrored by: any angle, a plane through its normal, nothing."""


@dataclass(frozen=True)
class SideTable:
    """Distributions of one side, each in the frame turned so that its light comes from phi_i = 0.

    Attributes
    ----------
    theta_i_deg : [N] incident angles, 0 <= theta < 90; ascending, and in anisotropic tables equal for the
        azimuths of one ring.
    base : [N, n, n] BSDF in 1/sr, mean over the cells of the unit square; index [a, b] with
        (ux, uy) = `conventions.square_to_disk`(a, b).
    patch : [N, m, m] BSDF in 1/sr, mean over m x m cells, index [x, y], of the square
        |ux + sin theta_i| <= half_width, |uy| <= half_width; cells beyond the unit disk do not matter.
    half_width : half the side of that square, in direction cosines.
    tau, tau_se : [N] direct-hemispherical transmission or reflection, with standard error.
    origin : "measured", "traced" or what else these numbers come from.
    base_se, patch_se : standard errors of `base` and `patch`, same shapes, or None where they are unknown.
    blend : "log" joins neighbouring directions by the logarithm of the BSDF (few directions, little noise),
        "linear" by its value (many directions, noise of counting).
    phi_i_deg : [N] azimuths of incidence, ascending in each ring of equal theta; None in isotropic tables.
        At theta = 0 a ring needs one azimuth only: the one that its table is turned by.
    symmetry : "isotropic": the sample may be turned, one azimuth says all. "bilateral": it has a mirror plane
        through its normal, azimuths lie on one side of it, mirror_deg <= phi <= mirror_deg + 180. "none":
        azimuths lie in 0 <= phi < 360.
    mirror_deg : azimuth of the mirror plane.
    """

    theta_i_deg: Array
    base: NDArray[np.float32]
    patch: NDArray[np.float32]
    half_width: float
    tau: Array
    tau_se: Array
    origin: str
    base_se: NDArray[np.float32] | None = None
    blend: str = "log"
    phi_i_deg: Array | None = None
    symmetry: str = "isotropic"
    mirror_deg: float = 0.0
    patch_se: NDArray[np.float32] | None = None

    def __post_init__(self) -> None:
        theta, n = np.asarray(self.theta_i_deg, float), len(self.theta_i_deg)
        if self.symmetry not in SYMMETRIES:
            raise PhysicsError(f"symmetry must be one of {', '.join(SYMMETRIES)}, not {self.symmetry!r}.")
        if (self.phi_i_deg is None) != (self.symmetry == "isotropic"):
            raise PhysicsError("azimuths of incidence go with the symmetries 'bilateral' and 'none' only.")
        step = np.diff(theta)
        ascending = np.all(step > 0) if self.phi_i_deg is None else np.all(step >= 0)
        if n == 0 or not ascending or theta[0] < 0 or theta[-1] >= 90:
            raise PhysicsError(f"incident angles must ascend within 0 <= theta < 90 degrees, not {theta}.")
        if self.phi_i_deg is not None:
            self._check_azimuths(np.asarray(self.phi_i_deg, float), step)
        for name, shape in (("base", (n, *self.base.shape[1:])), ("patch", (n, *self.patch.shape[1:]))):
            found = getattr(self, name)
            if found.ndim != 3 or found.shape != shape or found.shape[1] != found.shape[2]:
                raise PhysicsError(f"{name} must have the shape [{n}, k, k], not {found.shape}.")
            error = getattr(self, f"{name}_se")
            if error is not None and error.shape != shape:
                raise PhysicsError(f"{name}_se must have the shape of {name}, {shape}, not {error.shape}.")
            for what, values in ((name, found), (f"{name}_se", error)):
                if values is not None and not np.all(np.isfinite(values)):
                    raise PhysicsError(f"{what} holds values that are not finite.")
        if len(self.tau) != n or len(self.tau_se) != n:
            raise PhysicsError(f"tau and tau_se must hold {n} values.")
        if self.blend not in ("log", "linear"):
            raise PhysicsError(f"blend must be 'log' or 'linear', not {self.blend!r}.")

    def _check_azimuths(self, phi: Array, step: Array) -> None:
        low, high = (0.0, 360.0) if self.symmetry == "none" else (self.mirror_deg, self.mirror_deg + 180.0)
        inside = (phi >= low - 1e-9) & ((phi < high) if self.symmetry == "none" else (phi <= high + 1e-9))
        if phi.shape != (len(self.theta_i_deg),) or not inside.all():
            raise PhysicsError(
                f"there must be {len(self.theta_i_deg)} azimuths within {low:g} to {high:g} degrees, "
                f"not {phi}."
            )
        if np.any((step == 0) & (np.diff(phi) <= 0)):
            raise PhysicsError(f"azimuths must ascend in each ring of equal theta, not {phi}.")

    @property
    def isotropic(self) -> bool:
        """Whether one azimuth of incidence stands for all."""
        return self.phi_i_deg is None


def cell_centres(n: int) -> tuple[Array, Array]:
    """(ux, uy), each [n, n], at the centres of the base cells.

    >>> x, y = cell_centres(2)
    >>> bool(x[1, 1] > 0 and y[1, 1] > 0)
    True
    """
    k = (np.arange(n) + 0.5) / n
    a, b = np.meshgrid(k, k, indexing="ij")
    return square_to_disk(a, b)


def base_index(ux: ArrayLike, uy: ArrayLike, n: int) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Indices [a, b] of the base cells that hold the directions (ux, uy)."""
    a, b = disk_to_square(ux, uy)
    return (
        np.clip((a * n).astype(np.intp), 0, n - 1),
        np.clip((b * n).astype(np.intp), 0, n - 1),
    )
