"""What a surface is, drawn: Abbott curve, slopes, power spectrum and directions."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import matplotlib as mpl
import numpy as np
from numpy.typing import NDArray

from specularia.report import style

if TYPE_CHECKING:
    from specularia.surface import HeightMap
    from specularia.surface.spectra import Spectrum
    from specularia.surface.texture import Texture

__all__ = ["abbott_curve", "directions", "power_spectra", "slope_angles"]

_INK, _LINE, _SECOND = "#1a1a1a", "#0b6fa4", "#d1611e"


def abbott_curve(surface: HeightMap, texture: Texture, path: str | Path, *, synthetic: bool = False) -> Path:
    """Draw the distribution of heights and the material ratio curve with its core, peaks and valleys.

    Parameters
    ----------
    surface : the levelled map.
    texture : its parameters.
    path : PNG to write; a CSV of the same name gets ratio and height of the curve in steps of 0.1 %.
    synthetic : True labels the figure.
    """
    curve = texture.ratio
    z = surface.heights_um[surface.valid]
    z = z - z.mean()
    low, high = np.quantile(z, [0.0002, 0.9998])
    pad = 0.08 * max(float(high - low), 1e-12)
    with style.canvas(6.2, 2.9) as figure:
        left, right = figure.subplots(1, 2, sharey=True, width_ratios=(1, 2))
        left.hist(
            z,
            bins=np.linspace(low - pad, high + pad, 90),
            orientation="horizontal",
            color="#9bb8c9",
            density=True,
        )
        left.set(xlabel="density (1/µm)", ylabel="height above mean (µm)", ylim=(low - pad, high + pad))
        left.set_title(f"{style.letter(0)}  heights")
        right.plot(100 * curve.ratio, curve.height_um, color=_LINE)
        slope = curve.Sk_um
        start = (
            curve.height_um[np.searchsorted(curve.ratio, curve.Smr1)]
            if curve.Smr1 > 0
            else curve.height_um[0]
        )
        line = float(start)
        right.plot([0, 100], [line, line - slope], color=_SECOND, linewidth=0.9, linestyle="--")
        for ratio, level, name in ((curve.Smr1, line, "Smr1"), (curve.Smr2, line - slope, "Smr2")):
            right.axhline(level, color="#8a8a8a", linewidth=0.6)
            right.plot([100 * ratio] * 2, [low - pad, level], color="#8a8a8a", linewidth=0.6, linestyle=":")
            above = name == "Smr1"
            right.annotate(
                f"{name} {100 * ratio:.1f} %",
                (100 * ratio, low - pad),
                xytext=(3 if above else -3, 4),
                textcoords="offset points",
                fontsize=6.5,
                ha="left" if above else "right",
            )
        words = (
            f"Sk {curve.Sk_um:.3g} µm\nSpk {curve.Spk_um:.3g} µm\nSvk {curve.Svk_um:.3g} µm\n"
            f"Vmp {curve.Vmp_um:.3g} µm³/µm²\nVvv {curve.Vvv_um:.3g} µm³/µm²"
        )
        right.text(
            0.97,
            0.96,
            words,
            transform=right.transAxes,
            ha="right",
            va="top",
            fontsize=6.8,
            linespacing=1.35,
            bbox={"facecolor": "white", "edgecolor": "none", "pad": 1.5},
        )
        right.set(xlabel="material ratio (%)", xlim=(0, 100))
        right.set_title(f"{style.letter(1)}  material ratio (Abbott curve)")
        rows = [[float(p), float(c)] for p, c in zip(curve.ratio[::10], curve.height_um[::10])]
        style.write_csv(Path(path).with_suffix(".csv"), ["material_ratio", "height_um"], rows)
        return style.save(figure, path, synthetic=synthetic)


def slope_angles(texture: Texture, path: str | Path, *, synthetic: bool = False) -> Path:
    """Draw how steep the surface is, and in which directions.

    Parameters
    ----------
    texture : parameters of a map.
    path : PNG to write; an NPZ of the same name gets `angle_deg` (edges), `share_per_deg`, `azimuth_deg`
        (edges) and `azimuth_share`.
    synthetic : True labels the figure.
    """
    s = texture.slope
    with style.canvas(6.2, 3.2) as figure:
        grid = figure.add_gridspec(1, 2, width_ratios=(1.55, 1))
        axes = figure.add_subplot(grid[0])
        axes.stairs(s.share_per_deg, s.angle_deg, fill=True, color="#9bb8c9")
        top = 1.12 * float(s.share_per_deg.max())
        for value, name, height in (
            (s.median_deg, "median", 0.97),
            (s.p90_deg, "90 %", 0.87),
            (s.p99_deg, "99 %", 0.77),
        ):
            axes.axvline(value, color=_SECOND, linewidth=0.8)
            axes.text(
                value,
                height * top,
                f" {name} {value:.3g}°",
                fontsize=6.8,
                color=_SECOND,
                backgroundcolor=(1, 1, 1, 0.85),
            )
        axes.set(xlabel="angle to the mean plane (°)", ylabel="share per degree", ylim=(0, top))
        axes.set_xlim(0, min(float(s.angle_deg[-1]), max(1.6 * s.p99_deg, 1e-6)))
        axes.set_title(f"{style.letter(0)}  slopes, Sdq {texture.Sdq:.3g}")
        polar = figure.add_subplot(grid[1], projection="polar")
        edges = np.radians(s.azimuth_deg)
        polar.bar(
            edges[:-1],
            s.azimuth_share,
            width=np.diff(edges),
            align="edge",
            color="#9bb8c9",
            edgecolor="white",
            linewidth=0.3,
        )
        polar.set_yticklabels([])
        polar.tick_params(labelsize=6.5, pad=0)
        polar.set_title(f"{style.letter(1)}  direction of ascent", pad=12)
        polar.set_xlabel("weighted by slope²", fontsize=7)
        numbers = {k: getattr(s, k) for k in ("angle_deg", "share_per_deg", "azimuth_deg", "azimuth_share")}
        style.write_npz(Path(path).with_suffix(".npz"), numbers)
        return style.save(figure, path, synthetic=synthetic)


def power_spectra(spectrum: Spectrum, path: str | Path, *, synthetic: bool = False) -> Path:
    """Draw the power spectral densities: over rings, and along x and y.

    Parameters
    ----------
    spectrum : of a levelled map.
    path : PNG to write; an NPZ of the same name gets the arrays of the record.
    synthetic : True labels the figure.
    """
    with style.canvas(6.2, 2.9) as figure:
        left, right = figure.subplots(1, 2)
        if spectrum.frequency_per_um.size:
            left.loglog(spectrum.frequency_per_um, spectrum.radial_um4, color=_INK)
        left.set(xlabel="spatial frequency (1/µm)", ylabel="power spectral density (µm⁴)")
        left.set_title(f"{style.letter(0)}  mean over directions")
        right.loglog(spectrum.x_per_um, spectrum.x_um3, color=_LINE, label="along x", linewidth=0.9)
        if spectrum.y_per_um.size:
            right.loglog(spectrum.y_per_um, spectrum.y_um3, color=_SECOND, label="along y", linewidth=0.9)
        right.set(xlabel="spatial frequency (1/µm)", ylabel="power spectral density (µm³)")
        right.set_title(f"{style.letter(1)}  profiles")
        right.legend(loc="lower left")
        for axes, f in ((left, spectrum.frequency_per_um), (right, spectrum.x_per_um)):
            if f.size:
                wave = axes.secondary_xaxis("top", functions=(_inverse, _inverse))
                wave.set_xlabel("wavelength (µm)", fontsize=7)
                wave.tick_params(labelsize=6.5)
        names = ("frequency_per_um", "radial_um4", "x_per_um", "x_um3", "y_per_um", "y_um3")
        style.write_npz(Path(path).with_suffix(".npz"), {k: getattr(spectrum, k) for k in names})
        return style.save(figure, path, synthetic=synthetic)


def _inverse(value: NDArray[np.float64]) -> NDArray[np.float64]:
    with np.errstate(divide="ignore"):
        return np.asarray(1.0 / np.maximum(value, 1e-300))


def directions(surface: HeightMap, texture: Texture, path: str | Path, *, synthetic: bool = False) -> Path:
    """Draw the autocorrelation, with the contour that Sal and Str are read at, and the directions.

    Parameters
    ----------
    surface : the levelled map.
    texture : its parameters, with spacing.
    path : PNG to write; an NPZ of the same name gets `autocorrelation` (lags from -half to +half of the
        field, as drawn), `lag_x_um`, `lag_y_um`, `angle_deg`, `distance_um` and `angular`.
    synthetic : True labels the figure.
    """
    from specularia.surface.spectra import autocorrelation

    s = texture.spacing
    if s is None:
        raise ValueError("this map has no spacing parameters to draw")
    acf = autocorrelation(surface)
    reach = s.distance_um[np.isfinite(s.distance_um)]
    widest = 2.0 * float(reach.max()) if reach.size else np.inf
    middle = np.array(acf.shape) // 2
    rows, columns = (
        int(min(m, max(8, np.ceil(widest / p))))
        for m, p in zip(middle, (surface.pitch_y_um, surface.pitch_x_um))
    )
    part = acf[middle[0] - rows : middle[0] + rows + 1, middle[1] - columns : middle[1] + columns + 1]
    x = np.arange(-columns, columns + 1) * surface.pitch_x_um
    y = np.arange(-rows, rows + 1) * surface.pitch_y_um
    with style.canvas(6.2, 3.45) as figure:
        grid = figure.add_gridspec(1, 2, width_ratios=(1.25, 1))
        axes = figure.add_subplot(grid[0])
        limit = max(float(np.abs(part).max()), 1e-12)
        image = axes.imshow(
            part,
            origin="lower",
            extent=(x[0], x[-1], y[0], y[-1]),
            cmap=mpl.colormaps["RdBu_r"],
            vmin=-limit,
            vmax=limit,
        )
        axes.contour(x, y, part, levels=[0.2], colors=_INK, linewidths=0.8)
        axes.set(xlabel="lag x (µm)", ylabel="lag y (µm)")
        axes.set_title(f"{style.letter(0)}  autocorrelation, contour at 0.2")
        figure.colorbar(image, ax=axes, shrink=0.85)
        polar = figure.add_subplot(grid[1], projection="polar")
        angle = np.radians(np.concatenate([s.angle_deg, s.angle_deg + 180.0, [360.0]]))
        polar.plot(angle, np.concatenate([s.angular, s.angular, s.angular[:1]]), color=_LINE, linewidth=1.0)
        polar.fill(angle, np.concatenate([s.angular, s.angular, s.angular[:1]]), color=_LINE, alpha=0.2)
        lay = np.radians([s.Std_deg, s.Std_deg + 180.0])
        polar.plot(lay, [1, 1], color=_SECOND, linewidth=0.9, linestyle="--")
        polar.set_yticklabels([])
        polar.tick_params(labelsize=6.5, pad=0)
        less = "< " if s.bounded else ""
        polar.set_title(f"{style.letter(1)}  spectrum over direction", pad=12)
        polar.set_xlabel(f"Sal {s.Sal_um:.3g} µm, Str {less}{s.Str:.2f}, lay {s.Std_deg:.0f}°", fontsize=7)
        numbers = {"autocorrelation": part.astype(np.float32), "lag_x_um": x, "lag_y_um": y}
        more = {"angle_deg": s.angle_deg, "distance_um": s.distance_um, "angular": s.angular}
        style.write_npz(Path(path).with_suffix(".npz"), {**numbers, **more})
        return style.save(figure, path, synthetic=synthetic)
