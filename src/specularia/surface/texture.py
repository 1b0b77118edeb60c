"""What a surface is, in the parameters of ISO 25178-2: height, slope, spacing, material ratio and volume."""

from __future__ import annotations

from dataclasses import asdict, dataclass

import numpy as np
from numpy.typing import NDArray

from specularia.errors import PhysicsError
from specularia.surface.form import levelled
from specularia.surface.heightmap import HeightMap
from specularia.surface.roughness import roughness_of, slopes
from specularia.surface.spectra import Spacing, spacing

__all__ = ["MaterialRatio", "SlopeDistribution", "Texture", "material_ratio", "slope_distribution", "texture"]

Array = NDArray[np.float64]

_CURVE = 10_001
"""Points of the material ratio curve: a hundredth of a percent."""

_SECANT = 0.4
"""Share of the curve that the core's line is laid through (ISO 25178-2, ISO 13565-2)."""

_PEAKS, _VALLEYS = 0.1, 0.8
"""Material ratios between peaks, core and valleys for the volumes, the standard's defaults."""


@dataclass(frozen=True)
class MaterialRatio:
    """The Abbott-Firestone curve and what follows from it.

    Parameters
    ----------
    ratio, height_um : the curve: share of the area that lies at or above a height above the mean.
    Sk_um, Spk_um, Svk_um : core height, reduced peak height, reduced valley depth.
    Smr1, Smr2 : material ratios at the upper and lower end of the core, 0..1.
    Vmp_um, Vmc_um, Vvc_um, Vvv_um : volumes over the area (um3/um2) of the material of the peaks (above ratio
        0.1) and the core (0.1 to 0.8), and of the voids of the core and of the valleys (below 0.8).
    """

    ratio: Array
    height_um: Array
    Sk_um: float
    Spk_um: float
    Svk_um: float
    Smr1: float
    Smr2: float
    Vmp_um: float
    Vmc_um: float
    Vvc_um: float
    Vvv_um: float


@dataclass(frozen=True)
class SlopeDistribution:
    """How steep the surface is, and whereto.

    Parameters
    ----------
    angle_deg : edges of the classes of the angle between the surface and its mean plane, 0..90.
    share_per_deg : share of the pixels for each degree, one fewer; its integral is 1.
    azimuth_deg : edges of the classes of the direction of steepest ascent, 0..360, counter-clockwise from x.
    azimuth_share : weight of each class: mean square slope into this direction over that of all; sum 1.
    mean_deg, median_deg, p90_deg, p99_deg : mean and quantiles of the angle.
    """

    angle_deg: Array
    share_per_deg: Array
    azimuth_deg: Array
    azimuth_share: Array
    mean_deg: float
    median_deg: float
    p90_deg: float
    p99_deg: float


@dataclass(frozen=True)
class Texture:
    """Parameters of one levelled map.

    Parameters
    ----------
    Sa_um, Sq_um : arithmetic and root mean square height.
    Ssk, Sku : skewness and kurtosis (3 for normal heights).
    Sp_um, Sv_um, Sz_um : highest peak above the mean, deepest pit below it, their sum.
    Sdq, Sdr : root mean square slope; developed area over projected area, minus 1.
    ratio : see `MaterialRatio`.
    spacing : Sal, Str, Std; None for a profile, for a map with more than 20 % missing or of less than 16
    pixels.
    slope : see `SlopeDistribution`.
    missing : pixels that count for nothing.
    """

    Sa_um: float
    Sq_um: float
    Ssk: float
    Sku: float
    Sp_um: float
    Sv_um: float
    Sz_um: float
    Sdq: float
    Sdr: float
    ratio: MaterialRatio
    spacing: Spacing | None
    slope: SlopeDistribution
    missing: int

    def payload(self) -> dict[str, float | int | bool | None]:
        """All single numbers by the names of ISO 25178-2."""
        own = {k: v for k, v in asdict(self).items() if isinstance(v, float)}
        curve = {k: v for k, v in asdict(self.ratio).items() if isinstance(v, float)}
        steep = {f"slope_{k}": v for k, v in asdict(self.slope).items() if isinstance(v, float)}
        apart: dict[str, float | bool | None] = dict.fromkeys(
            ("Sal_um", "Str", "Str_is_upper_bound", "Std_deg")
        )
        if self.spacing is not None:
            s = self.spacing
            apart |= {"Sal_um": s.Sal_um, "Str": s.Str, "Str_is_upper_bound": s.bounded, "Std_deg": s.Std_deg}
        return {**own, **apart, **curve, **steep, "missing": self.missing}


def texture(surface: HeightMap, *, method: str = "plane", order: int | None = None) -> Texture:
    """The parameters of a map, after levelling (see `levelled`).

    Missing pixels are left out of every mean; for Sal, Str and Std they are bridged by a soap film.

    References
    ----------
    ISO 25178-2:2021. Sdr is mean sqrt(1 + (dz/dx)^2 + (dz/dy)^2) - 1 with the slopes of `slopes`, as Sdq; a
    sum over triangles gives less, since it cuts what is between pixels.

    >>> x = np.arange(400) * 0.5
    >>> z = np.broadcast_to(2.0 * np.sin(2 * np.pi * x / 20.0), (40, 400))
    >>> t = texture(HeightMap(z, 0.5, 0.5))
    >>> round(t.Sq_um, 3), round(t.Sku, 2), round(t.Sz_um, 2)
    (1.414, 1.5, 4.0)
    """
    flat = levelled(surface, method=method, order=order)
    z = flat.heights_um[flat.valid]
    if z.size < 4:
        raise PhysicsError(f"{surface.name or 'height map'}: only {z.size} measured pixels.")
    z = z - z.mean()
    square = float(np.mean(z * z))
    sq = float(np.sqrt(square))
    rough = roughness_of(flat)
    dx, dy = slopes(flat)
    steepness = dx * dx + (0.0 if flat.is_profile else dy * dy)
    known = steepness[np.isfinite(steepness)]
    apart = None
    if min(flat.shape) >= 16 and flat.missing <= 0.2 * flat.heights_um.size and sq > 0:
        apart = spacing(flat)
    return Texture(
        Sa_um=rough.Sa_um,
        Sq_um=sq,
        Ssk=float(np.mean(z**3)) / sq**3 if sq > 0 else float("nan"),
        Sku=float(np.mean(z**4)) / square**2 if sq > 0 else float("nan"),
        Sp_um=float(z.max()),
        Sv_um=float(-z.min()),
        Sz_um=float(np.ptp(z)),
        Sdq=rough.Sdq,
        Sdr=float(np.mean(np.sqrt(1.0 + known) - 1.0)) if known.size else float("nan"),
        ratio=material_ratio(z),
        spacing=apart,
        slope=slope_distribution(flat),
        missing=flat.missing,
    )


def material_ratio(heights_um: Array) -> MaterialRatio:
    """Abbott curve, core parameters and volumes of heights, any shape; NaN are left out.

    The core's line is the secant over 40 % of the curve with the least slope; peaks and valleys become
    triangles of the same area.

    References
    ----------
    ISO 25178-2:2021 (Smr(c), Sk, Spk, Svk, Smr1, Smr2, Vmp, Vmc, Vvc, Vvv); ISO 13565-2:1996.
    """
    z = np.sort(heights_um[np.isfinite(heights_um)])[::-1]
    z = z - z.mean()
    p = np.linspace(0.0, 1.0, _CURVE)
    # Pixel i of n stands for the ratios i/n to (i + 1)/n.
    c = np.interp(p, (np.arange(z.size) + 0.5) / z.size, z)
    wide = int(round(_SECANT * (_CURVE - 1)))
    fall = (c[:-wide] - c[wide:]) / _SECANT
    at = np.flatnonzero(fall <= fall.min() * (1 + 1e-9) + 1e-300)
    k = int(at[at.size // 2])
    core = float(fall[k])
    upper = float(c[k] + core * p[k])
    lower = upper - core
    above, below = c > upper, c < lower
    # The curve falls: what is above the core lies on its left, what is below on its right.
    first = float(p[np.count_nonzero(above) - 1]) if above.any() else 0.0
    second = float(p[_CURVE - np.count_nonzero(below)]) if below.any() else 1.0
    step = p[1]
    peaks = float(np.sum(np.where(above, c - upper, 0.0)) * step)
    valleys = float(np.sum(np.where(below, lower - c, 0.0)) * step)

    def material(ratio: float) -> float:
        q = p <= ratio + 1e-12
        return float(np.trapezoid(c[q] - np.interp(ratio, p, c), p[q]))

    def void(ratio: float) -> float:
        q = p >= ratio - 1e-12
        return float(np.trapezoid(np.interp(ratio, p, c) - c[q], p[q]))

    return MaterialRatio(
        ratio=p,
        height_um=c,
        Sk_um=core,
        Spk_um=2.0 * peaks / first if first > 0 else 0.0,
        Svk_um=2.0 * valleys / (1.0 - second) if second < 1 else 0.0,
        Smr1=first,
        Smr2=second,
        Vmp_um=material(_PEAKS),
        Vmc_um=material(_VALLEYS) - material(_PEAKS),
        Vvc_um=void(_PEAKS) - void(_VALLEYS),
        Vvv_um=void(_VALLEYS),
    )


def slope_distribution(surface: HeightMap, *, classes: int = 90, sectors: int = 36) -> SlopeDistribution:
    """Angles and directions of the slopes of a levelled map (`slopes`), each pixel counting once."""
    dx, dy = slopes(surface)
    if surface.is_profile:
        dy = np.zeros_like(dx)
    known = np.isfinite(dx) & np.isfinite(dy)
    gx, gy = dx[known], dy[known]
    square = gx * gx + gy * gy
    angle = np.degrees(np.arctan(np.sqrt(square)))
    if angle.size == 0:
        angle = np.array([np.nan])
    largest = float(np.nanmax(angle)) if np.isfinite(angle).any() else 90.0
    edges = np.linspace(0.0, min(90.0, max(largest * 1.0001, 1e-6)), classes + 1)
    counts, _ = np.histogram(angle, edges)
    towards = np.degrees(np.arctan2(gy, gx)) % 360.0
    sides = np.linspace(0.0, 360.0, sectors + 1)
    weight, _ = np.histogram(towards, sides, weights=square)
    mean, (median, p90, p99) = float(np.mean(angle)), np.quantile(angle, [0.5, 0.9, 0.99])
    return SlopeDistribution(
        angle_deg=edges,
        share_per_deg=counts / max(counts.sum(), 1) / np.diff(edges),
        azimuth_deg=sides,
        azimuth_share=weight / max(float(weight.sum()), 1e-300),
        mean_deg=mean,
        median_deg=float(median),
        p90_deg=float(p90),
        p99_deg=float(p99),
    )
