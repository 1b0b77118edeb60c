"""Figures of the measurement-based model: tau with its interval, and cross-validation."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from specularia.report import style

if TYPE_CHECKING:
    from specularia.bsdf import ScatteringModel, TabulatedModel
    from specularia.gonio.cross_validation import HeldOut

__all__ = ["held_out", "tau_with_interval"]

_DASHES = (0, (3, 2))


def tau_with_interval(
    model: TabulatedModel,
    side: str,
    path: str | Path,
    *,
    theta_deg: ArrayLike,
    measured: ArrayLike,
    error: ArrayLike,
    level: float = 0.95,
    peer: ScatteringModel | None = None,
    synthetic: bool = False,
) -> Path:
    """Draw the direct-hemispherical value of a model over the angle of incidence, with its interval.

    Beyond the last measured angle the line is dashed, the interval hatched and the ground grey: extrapolated.

    Parameters
    ----------
    model, side : what is drawn, for light from the azimuth 0.
    path : PNG to write; a CSV of the same name gets the columns series, theta_i_deg, tau, low, high,
        extrapolated.
    theta_deg, measured, error : [N] measured values with their standard errors.
    level : of the interval.
    peer : a second model, drawn as a thin line.
    synthetic : True labels the figure.
    """
    theta = np.append(np.arange(0.0, 90.0, 0.5), [89.75])
    last = model.extrapolated_beyond_deg[side]
    theta = np.unique(np.append(theta, last))
    tau = np.asarray(model.direct_hemispherical(side, theta), float)
    low, high = model.tau_interval(side, theta, level=level)
    beyond = theta > last
    rows = [("model", *v, int(b)) for v, b in zip(np.stack([theta, tau, low, high], axis=1), beyond)]
    where, values, errors = (np.asarray(v, float) for v in (theta_deg, measured, error))
    rows += [("measured", t, v, v - 2 * e, v + 2 * e, 0) for t, v, e in zip(where, values, errors)]
    with style.canvas(4.6, 3.2) as figure:
        axes = figure.subplots()
        inside, outside = theta <= last, theta >= last
        axes.axvspan(last, 90.0, color="#f2f2f2", linewidth=0, zorder=0)
        axes.fill_between(
            theta[inside],
            low[inside],
            high[inside],
            color=style.COLOURS["M"],
            alpha=0.25,
            linewidth=0,
            label=f"{100 * level:g} % interval",
        )
        axes.fill_between(
            theta[outside],
            low[outside],
            high[outside],
            facecolor="none",
            edgecolor=style.COLOURS["M"],
            alpha=0.5,
            hatch="//////",
            linewidth=0,
        )
        axes.plot(theta[inside], tau[inside], color=style.COLOURS["M"], label="Model M")
        axes.plot(
            theta[outside], tau[outside], color=style.COLOURS["M"], linestyle=_DASHES, label="extrapolated"
        )
        if peer is not None:
            other = np.asarray(peer.direct_hemispherical(side, theta), float)
            rows += [("radiance", t, v, np.nan, np.nan, 0) for t, v in zip(theta, other)]
            axes.plot(theta, other, color=style.COLOURS["C"], linewidth=0.9, label="pabopto2bsdf, bsdf2ttree")
        axes.errorbar(
            where,
            values,
            yerr=2.0 * errors,
            color=style.COLOURS["measured"],
            linestyle="none",
            marker="o",
            markersize=3.5,
            capsize=2.5,
            elinewidth=0.9,
            label="measured (± 2 s.e.)",
            zorder=5,
            clip_on=False,
        )
        symbol = r"\tau" if side.startswith("transmission") else r"\rho"
        top = max(float(np.nanmax(values)), float(np.nanmax(tau))) if values.size else float(np.nanmax(tau))
        axes.set(xlim=(0, 90), ylim=(0, min(1.0, 1.1 * top)), xlabel=r"angle of incidence $\theta_i$ (°)")
        axes.set_ylabel(rf"direct-hemispherical ${symbol}_{{\mathrm{{dh}}}}$")
        axes.set_xticks(range(0, 91, 15))
        axes.grid(color="#e6e6e6", linewidth=0.6)
        axes.set_axisbelow(True)
        axes.legend(loc="best")
        style.write_csv(
            Path(path).with_suffix(".csv"),
            ("series", "theta_i_deg", "tau", "low", "high", "extrapolated"),
            [(a, float(b), float(c), float(d), float(e), int(f)) for a, b, c, d, e, f in rows],
        )
        return style.save(figure, path, synthetic=synthetic)


def held_out(found: Sequence[HeldOut], path: str | Path, *, synthetic: bool = False) -> Path:
    """Draw cross-validation: error of the predicted tau with its interval, and L1, over the angle left out.

    Parameters
    ----------
    found : of one side or several; each side has its own marker.
    path : PNG to write; a CSV of the same name gets one row per table left out.
    synthetic : True labels the figure.
    """
    sides = list(dict.fromkeys(f.side for f in found))
    with style.canvas(5.6, 2.6) as figure:
        left, right = figure.subplots(1, 2)
        for k, side in enumerate(sides):
            own = [f for f in found if f.side == side]
            theta = np.array([f.theta_deg for f in own])
            measured = np.array([f.measured for f in own])
            off = 100.0 * np.array([f.off for f in own])
            ends = 100.0 * np.array([[f.predicted - f.low, f.high - f.predicted] for f in own]).T / measured
            colour = style.colour_of("M" if k == 0 else side, k)
            marker = "osD^"[k]
            label = side.replace("_", " ")
            left.errorbar(
                theta,
                off,
                yerr=np.maximum(ends, 0.0),
                color=colour,
                marker=marker,
                linestyle="none",
                markersize=4,
                capsize=2.5,
                elinewidth=0.9,
                label=label,
            )
            right.plot(
                theta,
                100.0 * np.array([f.l1 for f in own]),
                color=colour,
                marker=marker,
                linestyle="none",
                markersize=4,
                label=label,
            )
        left.axhline(0.0, color="#777777", linewidth=0.8)
        reach = 1.15 * max(abs(100.0 * (end / f.measured - 1.0)) for f in found for end in (f.low, f.high))
        left.set_ylim(-reach, reach)
        left.set_ylabel("predicted tau, off by (%)")
        left.set_title(f"bars: {100 * found[0].level:g} % interval", fontsize=7.5)
        right.set_ylabel(r"$L_1$ of the distribution over $\tau$ (%)")
        right.set_ylim(0.0, 1.15 * max(100.0 * f.l1 for f in found) or 1.0)
        for panel in (left, right):
            panel.set(xlim=(0, 90), xlabel=r"angle of incidence left out, $\theta_i$ (°)")
            panel.set_xticks(range(0, 91, 15))
            panel.grid(color="#e6e6e6", linewidth=0.6)
            panel.set_axisbelow(True)
        if len(sides) > 1:
            right.legend(loc="best")
        names = ["side", "theta_deg", "phi_deg", "left_out", "measured", "measured_se", "predicted"]
        names += ["low", "high", "level", "l1", "l1_raw", "l1_noise"]
        style.write_csv(
            Path(path).with_suffix(".csv"), names, [tuple(getattr(f, n) for n in names) for f in found]
        )
        return style.save(figure, path, synthetic=synthetic)
