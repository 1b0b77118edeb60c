"""How much of a pane's transmission and lobe hangs on the finest waves of its relief.

A tracer follows rays, and rays are right for waves of the relief much longer than light: at 520 nm sound from
20 um, marginal at 5 to 10, wrong below 3. A map with finer waves, true ones or noise, gives slopes that no
ray should see. So the relief is smoothed step by step and traced at each.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from specularia.errors import PhysicsError
from specularia.glass import Face, Medium, Slab, trace_paths
from specularia.glass.effort import REPLICATES
from specularia.glass.trace import Paths
from specularia.progress import task
from specularia.surface import HeightMap, filled, roughness

__all__ = [
    "Cutoff",
    "LobeWidth",
    "cutoff",
    "default_cutoffs",
    "lobe_width",
    "low_pass",
    "ray_limit_um",
    "short_wave_share",
    "tau_of_paths",
]

Array = NDArray[np.float64]

_LIMIT_UM_AT_520 = 3.0
_FWHM = 2.0 * np.sqrt(2.0 * np.log(2.0))
_BANDWIDTH = 0.2
"""Width of the kernel over the spread of the lobe's core."""
_LADDER_UM = (1.0, 2.0, 3.0, 5.0, 7.0, 10.0, 15.0, 20.0, 30.0, 50.0, 70.0, 100.0, 150.0, 200.0, 300.0, 500.0)


@dataclass(frozen=True)
class LobeWidth:
    """Full widths at half maximum of a lobe along its wide axis and across, and its angle from x; degrees."""

    fwhm_deg: float
    across_deg: float
    axis_deg: float


@dataclass(frozen=True)
class Cutoff:
    """Transmission and lobe of a pane over the cut-off of its relief.

    Parameters
    ----------
    cutoff_um : [N] rising; the first is 0: the maps as they are.
    theta_deg : [T] angles of incidence.
    Sdq : [N, F] rms slope of each rough face after the low pass, as traced.
    beyond : [N, F] share of the slope variance of each map that lies in waves shorter than the cut-off.
    beyond_limit : [F] the same at the limit of rays.
    limit_um : wave of the relief below which rays are wrong.
    tau, tau_se : [N, T] direct-hemispherical transmission and its standard error.
    fwhm_deg, across_deg : [N, T] of the transmitted lobe, along its wide axis and across.
    faces : names of the rough faces.
    wavelength_nm : of the light.
    """

    cutoff_um: Array
    theta_deg: Array
    Sdq: Array
    beyond: Array
    beyond_limit: Array
    limit_um: float
    tau: Array
    tau_se: Array
    fwhm_deg: Array
    across_deg: Array
    faces: tuple[str, ...]
    wavelength_nm: float

    def payload(self) -> dict[str, object]:
        """Plain lists by name; what belongs to a face or an angle is one list for each cut-off."""
        return {
            "wavelength_nm": self.wavelength_nm,
            "limit_um": self.limit_um,
            "faces": list(self.faces),
            "share_beyond_limit": self.beyond_limit.tolist(),
            "cutoff_um": self.cutoff_um.tolist(),
            "valid": (self.cutoff_um >= self.limit_um).tolist(),
            "theta_deg": self.theta_deg.tolist(),
            "Sdq": self.Sdq.tolist(),
            "share_beyond": self.beyond.tolist(),
            "tau": self.tau.tolist(),
            "tau_se": self.tau_se.tolist(),
            "fwhm_deg": self.fwhm_deg.tolist(),
            "fwhm_across_deg": self.across_deg.tolist(),
        }


def ray_limit_um(wavelength_nm: float) -> float:
    """Shortest wave of a relief that rays may be traced over, um: 3 um at 520 nm, in proportion elsewhere."""
    return _LIMIT_UM_AT_520 * wavelength_nm / 520.0


def default_cutoffs(maps: Sequence[HeightMap]) -> Array:
    """0 and round lengths from twice the coarsest pixel to a fourth of the smallest field, um."""
    finest = 2.0 * max(max(m.pitch_x_um, m.pitch_y_um) for m in maps)
    widest = min(min(m.field_um) for m in maps) / 4.0
    return np.array([0.0, *(c for c in _LADDER_UM if finest <= c <= widest)])


def low_pass(surface: HeightMap, cutoff_um: float) -> HeightMap:
    """The map without waves much shorter than the cut-off: a Gaussian that halves waves of just this length.

    The border is continued by its mirror image. Reference: ISO 16610-61, Linear areal filters: Gaussian
    filters. 0 leaves the map as it is; it must have no missing pixels.
    """
    from scipy.ndimage import gaussian_filter

    if cutoff_um == 0.0:
        return surface
    sigma = np.sqrt(np.log(2.0) / np.pi) * cutoff_um / np.sqrt(2.0 * np.pi)
    smooth = gaussian_filter(
        surface.heights_um,
        (sigma / surface.pitch_y_um, sigma / surface.pitch_x_um),
        mode="reflect",
        truncate=5.0,
    )
    return surface.with_heights(smooth, low_pass=f"Gaussian, {cutoff_um:g} um")


def short_wave_share(surface: HeightMap, cutoffs_um: Array) -> Array:
    """Share of the slope variance in waves shorter than each cut-off, 0 to 1 (1 at an infinite one).

    From the cosine transform of the map, whose mirror images meet without a step: power times wavenumber
    squared.
    """
    from scipy.fft import dctn

    h = surface.heights_um
    power = dctn(h - h.mean(), norm="ortho") ** 2
    qy = np.arange(h.shape[0])[:, None] / (2.0 * h.shape[0] * surface.pitch_y_um)
    qx = np.arange(h.shape[1])[None, :] / (2.0 * h.shape[1] * surface.pitch_x_um)
    q2 = qx * qx + qy * qy
    order = np.argsort(q2, axis=None)
    slope = (power * q2).ravel()[order]
    total = np.concatenate([[0.0], np.cumsum(slope)])
    if not total[-1] > 0.0:
        return np.zeros(len(cutoffs_um))
    with np.errstate(divide="ignore"):
        edge = np.where(cutoffs_um > 0, 1.0 / np.asarray(cutoffs_um) ** 2, np.inf)
    return np.asarray(1.0 - total[np.searchsorted(q2.ravel()[order], edge, side="right")] / total[-1])


def lobe_width(paths: Paths, theta_deg: float) -> LobeWidth:
    """Full width at half maximum of the transmitted lobe, of light that may leave in any direction.

    Directions are turned into angles from the undeflected one, in the plane of incidence and out of it; the
    lobe's axes are those of its core (within twice the median distance). Along each axis the density of the
    projected angles is smoothed by a Gaussian of a fifth of the core's spread, the width is read between the
    half heights next to the peak, and the kernel's own width is taken off in squares. Ours.

    Parameters
    ----------
    paths : of one incident direction in the plane phi = 0.
    theta_deg : its polar angle.
    """
    through = paths.transmitted
    ux, uy, weight = paths.ux[through], paths.uy[through], paths.weight[through]
    if ux.size < 100:
        return LobeWidth(float("nan"), float("nan"), float("nan"))
    uz = np.sqrt(np.maximum(1.0 - ux * ux - uy * uy, 0.0))
    t = np.radians(theta_deg)
    # Undeflected light leaves at ux = -sin theta; turned there, the lobe is seen along its own axis.
    a = ux * np.cos(t) + uz * np.sin(t)
    along, out = (
        np.degrees(np.arctan2(a, uz * np.cos(t) - ux * np.sin(t))),
        np.degrees(np.arcsin(np.clip(uy, -1, 1))),
    )
    x, y = along - np.median(along), out - np.median(out)
    distance = np.hypot(x, y)
    core = distance <= 2.0 * np.median(distance)
    spread = np.cov(x[core], y[core])
    sizes, axes = np.linalg.eigh(spread)
    if sizes[1] < 1e-16:
        return LobeWidth(0.0, 0.0, 0.0)
    widths = [
        _fwhm(x * axes[0, k] + y * axes[1, k], weight, float(np.sqrt(max(sizes[k], 0.0)))) for k in (1, 0)
    ]
    angle = float(np.degrees(np.arctan2(axes[1, 1], axes[0, 1]))) % 180.0
    return LobeWidth(widths[0], widths[1], angle)


def _fwhm(values: Array, weight: Array, spread: float) -> float:
    """Width of the peak of a density at half of its height."""
    from scipy.ndimage import gaussian_filter1d

    if spread < 1e-9:
        return 0.0
    kernel = _BANDWIDTH * spread
    step = kernel / 8.0
    reach = 12.0 * spread
    edges = np.arange(-reach, reach + step, step)
    density = gaussian_filter1d(np.histogram(values, edges, weights=weight)[0].astype(float), 8.0)
    peak = int(np.argmax(density))
    half = 0.5 * density[peak]
    below = np.flatnonzero(density < half)
    right, left = below[below > peak], below[below < peak]
    if not right.size or not left.size:
        return float("nan")
    r, l = right[0], left[-1]
    high = r - (half - density[r]) / (density[r - 1] - density[r])
    low = l + (half - density[l]) / (density[l + 1] - density[l])
    width = (high - low) * step
    return float(np.sqrt(max(width**2 - (_FWHM * kernel) ** 2, 0.0)))


def cutoff(
    front: HeightMap | None,
    back: HeightMap | None = None,
    *,
    cutoffs_um: Sequence[float] | None = None,
    theta_deg: Sequence[float] = (0.0, 60.0),
    index: float = 1.52,
    thickness_mm: float = 3.0,
    paths: int = 200_000,
    seed: int = 0,
    wavelength_nm: float = 520.0,
) -> Cutoff:
    """Trace a clear pane whose relief is smoothed step by step.

    Parameters
    ----------
    front, back : maps of the faces as their microscopes saw them; a face without a map is flat. Up to 5 % of
        missing pixels are filled.
    cutoffs_um : >= 0, 0 for the maps as they are; `default_cutoffs` if None.
    theta_deg : incident angles, 0 <= theta < 90, light on the front at phi = 0.
    index, thickness_mm : of the pane, which absorbs nothing.
    paths : per angle and cut-off. All cut-offs share their random numbers, so that they differ by the relief
        alone.
    """
    given = {name: m for name, m in (("front", front), ("back", back)) if m is not None}
    if not given:
        raise PhysicsError("a cut-off needs at least one height map.")
    for name, m in given.items():
        if m.is_profile:
            raise PhysicsError(f"{name}: {m.name} is a profile; light is traced through maps.")
    whole = {name: filled(m, largest_share=0.05)[0] for name, m in given.items()}
    steps = default_cutoffs(list(whole.values())) if cutoffs_um is None else np.unique([0.0, *cutoffs_um])
    if not (np.isfinite(steps).all() and steps.min() >= 0.0):
        raise PhysicsError("cut-offs are lengths in um, not below 0.")
    limit = ray_limit_um(wavelength_nm)
    angles = np.asarray(theta_deg, float)
    shape = (steps.size, angles.size)
    tau, se, wide, across = (np.empty(shape) for _ in range(4))
    sdq = np.empty((steps.size, len(whole)))
    with task("tracing over cut-offs", tau.size) as progress:
        for i, step in enumerate(steps):
            smooth = {name: low_pass(m, float(step)) for name, m in whole.items()}
            sdq[i] = [roughness(m).Sdq for m in smooth.values()]
            slab = Slab(
                thickness_mm=thickness_mm,
                medium=Medium(index=index, absorption_per_mm=0.0),
                front=Face.from_map(smooth["front"], name="front")
                if "front" in smooth
                else Face.flat("front"),
                back=Face.from_map(smooth["back"], name="back") if "back" in smooth else Face.flat("back"),
            )
            for j, theta in enumerate(angles):
                traced = trace_paths(
                    slab, theta_deg=float(theta), paths=paths, seed=seed, wavelength_nm=wavelength_nm
                )
                tau[i, j], se[i, j] = tau_of_paths(traced)
                lobe = lobe_width(traced, float(theta))
                wide[i, j], across[i, j] = lobe.fwhm_deg, lobe.across_deg
                progress.advance()
    return Cutoff(
        cutoff_um=steps,
        theta_deg=angles,
        Sdq=sdq,
        beyond=np.stack([short_wave_share(m, steps) for m in whole.values()], axis=1),
        beyond_limit=np.array([short_wave_share(m, np.array([limit]))[0] for m in whole.values()]),
        limit_um=limit,
        tau=tau,
        tau_se=se,
        fwhm_deg=wide,
        across_deg=across,
        faces=tuple(whole),
        wavelength_nm=wavelength_nm,
    )


def tau_of_paths(paths: Paths) -> tuple[float, float]:
    """Direct-hemispherical transmission of traced paths and its standard error, from their replicates."""
    through = np.where(paths.transmitted, paths.weight, 0.0)
    each = np.bincount(paths.replicate, through, REPLICATES) / np.bincount(
        paths.replicate, minlength=REPLICATES
    )
    return float(each.mean()), float(each.std(ddof=1) / np.sqrt(REPLICATES))
