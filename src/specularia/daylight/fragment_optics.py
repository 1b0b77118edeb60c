"""What a scattering pane over a sheet does to light: directions, displacements and their convolutions.

Light from the direction of the eye (or the lamp) that meets the top leaves the underside in the directions u
of the model, each with the share f(u) |cos theta| d omega. It meets the sheet displaced by

    s(u) = g u / sqrt(1 - u^2) + h (u / sqrt(n^2 - u^2) - d / sqrt(n^2 - d^2)),

with the gap g, the height h within the glass at which it scatters, the index n, and d the undeflected
direction. The parallel displacement that a clear slab gives to undeflected light is left out, so that the
edge of the glass meets itself: the piece is a flat outline, its thickness counts only for the blur (ours).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from specularia.bsdf import ScatteringModel
from specularia.conventions import square_to_disk
from specularia.daylight.fragment_job import Sample
from specularia.errors import CoverageError

__all__ = ["Fan", "Placed", "even_sky", "lambert_transfer"]

Array = NDArray[np.float64]

_RIM = 0.9999
"""Largest sine of a direction: light closer to grazing would come from metres away."""

_MANY = 12
"""Points each way at most, into which the cell of one direction is cut for a picture."""


@dataclass(frozen=True)
class Fan:
    """Directions below the glass for light from one direction above it.

    Attributes
    ----------
    ux, uy : [K] direction cosines on the table.
    share : [K] of the light from above, its sum is tau.
    size : [K] side of the square of direction cosines that each one stands for.
    straight : [2] the undeflected direction.
    """

    ux: Array
    uy: Array
    share: Array
    size: Array
    straight: tuple[float, float]

    def displaced(self, ux: Array, uy: Array, *, gap: float, depth: float, index: float) -> Array:
        """[..., 2] where light in these directions meets the sheet, mm from where it left the glass."""
        d = np.array(self.straight)
        u = np.stack([ux, uy], axis=-1)
        rr = np.minimum((u * u).sum(axis=-1, keepdims=True), _RIM**2)
        out = gap * u / np.sqrt(1.0 - rr)
        return out + depth * (u / np.sqrt(index**2 - rr) - d / np.sqrt(index**2 - d @ d))

    def kernel(
        self, shape: tuple[int, int], pixel: float, *, gap: float, depth: float, index: float
    ) -> Array:
        """[rows, columns] shares over displacement, zero at [0, 0], wrapped round at the ends.

        Each direction is spread over its cell, so that a coarse set of directions leaves no ghosts.
        """
        out = np.zeros(shape)
        rr = np.minimum(self.ux**2 + self.uy**2, _RIM**2)
        # The longest stretch of a cell on the sheet is along the direction's own azimuth.
        stretch = gap * (1.0 - rr) ** -1.5 + depth * index**2 * (index**2 - rr) ** -1.5
        count = np.clip(np.ceil(self.size * stretch / pixel), 1, _MANY).astype(int)
        for n in np.unique(count):
            here = (count == n) & (self.share != 0.0)
            if not here.any():
                continue
            step = ((np.arange(n) + 0.5) / n - 0.5)[None, :] * self.size[here, None]
            x = (self.ux[here, None] + step)[:, :, None]
            y = (self.uy[here, None] + step)[:, None, :]
            x, y = np.broadcast_arrays(x, y)
            # Parts of a cell beyond the horizon are drawn back to it.
            back = np.minimum(1.0, _RIM / np.maximum(np.hypot(x, y), 1e-12))
            at = self.displaced(x * back, y * back, gap=gap, depth=depth, index=index) / pixel
            part = np.broadcast_to(self.share[here, None, None] / n**2, x.shape)
            _splat(out, at[..., 0].ravel(), at[..., 1].ravel(), part.ravel())
        return out

    def transfer(self, frequency: Array, *, gap: float, depth: float, index: float) -> NDArray[np.complex128]:
        """[F] Fourier transform of the shares over displacement along x, at cycles per mm; tau at 0.

        Counted from the mean displacement, so that a shift of the whole picture leaves no phase.
        """
        s = self.displaced(self.ux, self.uy, gap=gap, depth=depth, index=index)[:, 0]
        held = float(self.share.sum())
        s = s - (self.share @ s / held if held > 0.0 else 0.0)
        rr = np.minimum(self.ux**2 + self.uy**2, _RIM**2)
        c, k = 1.0 - rr, index**2 - rr
        along = gap * (c**-0.5 + self.ux**2 * c**-1.5) + depth * (k**-0.5 + self.ux**2 * k**-1.5)
        across = self.ux * self.uy * (gap * c**-1.5 + depth * k**-1.5)
        f = np.asarray(frequency, float)[:, None]
        spread = np.sinc(f * along * self.size) * np.sinc(f * across * self.size)
        return np.asarray((spread * np.exp(-2j * np.pi * f * s)) @ self.share, complex)


def _splat(out: Array, column: Array, row: Array, part: Array) -> None:
    """Add parts at places in pixels to the four pixels around each, wrapped round at the ends."""
    rows, columns = out.shape
    c0, r0 = np.floor(column), np.floor(row)
    p, q = column - c0, row - r0
    ci, ri = c0.astype(np.int64), r0.astype(np.int64)
    for dr, dc, w in ((0, 0, (1 - q) * (1 - p)), (0, 1, (1 - q) * p), (1, 0, q * (1 - p)), (1, 1, q * p)):
        flat = ((ri + dr) % rows) * columns + (ci + dc) % columns
        out += np.bincount(flat, part * w, out.size).reshape(out.shape)


class Placed:
    """A model as the piece of glass lies on the table.

    Parameters
    ----------
    model : needs both transmissions.
    sample : which face is up, and how it is turned.
    """

    def __init__(self, model: ScatteringModel, sample: Sample, *, name: str) -> None:
        self.model, self.sample, self.name = model, sample, name
        self.up, self.down = ("front", "back") if sample.front == "up" else ("back", "front")

    @property
    def reflects(self) -> bool:
        """Whether the model knows what its top reflects."""
        return f"reflection_{self.up}" in self.model.sides

    def fan(self, theta_deg: float, phi_deg: float) -> Fan:
        """What leaves the underside for light from this direction above."""
        side, phi = f"transmission_{self.up}", self._azimuth(phi_deg)
        self._known(side, theta_deg, phi)
        q = self.model.quadrature(side, theta_deg, phi)
        f = self.model.evaluate(side, theta_deg, phi, q.ux, q.uy)
        share = q.weight * np.where(np.isfinite(f), f, 0.0)
        # Directions that together bring less than a hundred-thousandth of the light only cost time.
        order = np.argsort(share)
        kept = np.sort(order[np.cumsum(share[order]) > 1e-5 * share.sum()])
        held = float(share[kept].sum())
        share, size = share[kept] * (share.sum() / held if held > 0 else 0.0), np.sqrt(q.weight[kept])
        x, y = self._to_table(q.ux[kept], q.uy[kept])
        s = np.sin(np.radians(theta_deg))
        straight = (float(-s * np.cos(np.radians(phi_deg))), float(-s * np.sin(np.radians(phi_deg))))
        return Fan(ux=x, uy=y, share=share, size=size, straight=straight)

    def transmission_from_below(self) -> Fan:
        """For an even sky: directions below the glass, with the share of its light that each brings.

        By reciprocity the luminance under the glass in the direction u is that of the sky times tau for light
        from u on the underside; tau is averaged over the azimuth and linear between 12 polar angles.
        """
        nodes = np.linspace(0.0, 88.0, 12)
        turns = np.array([0.0, 60.0, 130.0, 250.0])
        tau = np.array(
            [self.model.direct_hemispherical(f"transmission_{self.down}", nodes, float(t)) for t in turns]
        ).mean(axis=0)
        if not np.isfinite(tau[nodes < 80.0]).all():
            raise CoverageError(
                f"model {self.name!r} has no transmission for light on its {self.down} at "
                f"{nodes[~np.isfinite(tau)][0]:.0f} degrees. Use a model that reaches 80 degrees."
            )
        good = np.isfinite(tau)
        sky = even_sky()
        angle = np.degrees(np.arcsin(np.hypot(sky.ux, sky.uy)))
        held = np.interp(angle, np.append(nodes[good], 90.0), np.append(tau[good], 0.0))
        return Fan(ux=sky.ux, uy=sky.uy, share=sky.share * held, size=sky.size, straight=(0.0, 0.0))

    def underside(self) -> float:
        """Diffuse-diffuse reflectance of the underside; 0.15 (clear glass) where the model has none."""
        if self.sample.reflectance is not None:
            return self.sample.reflectance
        side = f"reflection_{self.down}"
        if side not in self.model.sides:
            return 0.15
        x, w = np.polynomial.legendre.leggauss(6)
        rho = self.model.direct_hemispherical(side, np.degrees(np.arcsin(np.sqrt(0.5 * (x + 1.0)))))
        good = np.isfinite(rho)
        if not good.any():
            raise CoverageError(f"model {self.name!r} has no value for its {side.replace('_', ' ')}.")
        return float(np.sum((w * rho)[good]) / np.sum(w[good]))

    def reflected(
        self, eye: tuple[float, float], lamp: tuple[float, float], *, diffuse_lx: float, lamp_lx: float
    ) -> float:
        """cd/m2 that the top reflects to the eye; 0 for a model without reflection. Angles are theta, phi."""
        if not self.reflects:
            return 0.0
        side, phi = f"reflection_{self.up}", self._azimuth(eye[1])
        total = self._known(side, eye[0], phi) * diffuse_lx / np.pi
        if lamp_lx > 0.0:
            s = np.sin(np.radians(eye[0]))
            a = np.radians(phi)
            f = self.model.evaluate(side, lamp[0], self._azimuth(lamp[1]), s * np.cos(a), s * np.sin(a))
            if not np.isfinite(f):
                raise CoverageError(f"model {self.name!r} has no reflection of the lamp to the eye.")
            total += float(f) * lamp_lx * float(np.cos(np.radians(lamp[0])))
        return total

    def _known(self, side: str, theta_deg: float, phi_deg: float) -> float:
        value = float(self.model.direct_hemispherical(side, theta_deg, phi_deg))
        if not np.isfinite(value):
            raise CoverageError(
                f"model {self.name!r} has no {side.replace('_', ' ')} at {theta_deg:g} degrees. Use a model "
                "that reaches that angle, or another eye or lamp."
            )
        return value

    def _azimuth(self, phi_deg: float) -> float:
        """Azimuth on the table in the frame of the sample; turned over, its x points the other way."""
        phi = phi_deg - self.sample.turn_deg
        return float(np.mod(phi if self.sample.front == "up" else 180.0 - phi, 360.0))

    def _to_table(self, ux: Array, uy: Array) -> tuple[Array, Array]:
        x = ux if self.sample.front == "up" else -ux
        c, s = np.cos(np.radians(self.sample.turn_deg)), np.sin(np.radians(self.sample.turn_deg))
        return x * c - uy * s, x * s + uy * c


def even_sky(cells: int = 64) -> Fan:
    """Directions of equal projected solid angle; shares that add up to one."""
    k = (np.arange(cells) + 0.5) / cells
    x, y = square_to_disk(*(v.ravel() for v in np.meshgrid(k, k, indexing="ij")))
    n = x.size
    return Fan(
        ux=x, uy=y, share=np.full(n, 1.0 / n), size=np.full(n, np.sqrt(np.pi / n)), straight=(0.0, 0.0)
    )


def lambert_transfer(frequency: Array, distance: float) -> Array:
    """Fourier transform of D^2 / (pi (r^2 + D^2)^2): light of an even scatterer on a plane D mm away.

    2 pi f D K_1(2 pi f D), by Hankel's transform; 1 at f = 0. For frequencies in cycles per mm.
    """
    from scipy.special import k1

    x = 2.0 * np.pi * np.asarray(frequency, float) * distance
    # k1 of 700 and more is no number; there is no light left there either.
    return np.where(x < 1e-9, 1.0, x * k1(np.clip(x, 1e-9, 650.0)))
