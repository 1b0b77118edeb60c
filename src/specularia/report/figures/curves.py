"""Curves over angle: tau(theta), and sections of the DSF through the plane of incidence."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from specularia.report import style

if TYPE_CHECKING:
    from specularia.analysis import TauPoints
    from specularia.bsdf import ScatteringModel
    from specularia.gonio import Table

__all__ = ["sections", "tau_curves"]

Array = NDArray[np.float64]


def tau_curves(
    models: Mapping[str, ScatteringModel],
    path: str | Path,
    *,
    measured: TauPoints | None = None,
    slab: tuple[ArrayLike, ArrayLike] | None = None,
    side: str = "transmission_front",
    phi_i_deg: float = 0.0,
    synthetic: bool = False,
) -> Path:
    """Draw direct-hemispherical transmission (or reflection) over the angle of incidence.

    Models are lines, dashed where they extrapolate beyond their last angle of data; measured values are
    points with error bars of two standard errors; the clear slab is a thin grey line.

    Parameters
    ----------
    models : by name, at most six.
    path : PNG to write; a CSV of the same name gets the columns series, theta_i_deg, tau, se, extrapolated.
    measured : measured values with standard errors (`analysis.TauPoints`).
    slab : (theta_deg [K], tau [K]) of the clear slab in closed form.
    side : one of `conventions.SIDES`.
    phi_i_deg : azimuth of the incident direction, degrees.
    synthetic : True labels the figure.

    Returns
    -------
    path of the PNG.
    """
    theta = np.concatenate([np.arange(0.0, 89.0, 1.0), [89.0, 89.5, 89.9]])
    rows: list[tuple[str, float, float, float, bool]] = []
    with style.canvas(4.6, 3.2) as figure:
        axes = figure.subplots()
        if slab is not None:
            x, y = (np.asarray(v, float) for v in slab)
            axes.plot(x, y, color=style.COLOURS["clear slab"], linewidth=1.0, label="clear slab, closed form")
            rows += [("clear slab", a, b, 0.0, False) for a, b in zip(x, y)]
        for k, (name, model) in enumerate(models.items()):
            tau = np.asarray(model.direct_hemispherical(side, theta, phi_i_deg), float)
            last = getattr(model, "extrapolated_beyond_deg", {}).get(side, 90.0)
            beyond = theta > last
            colour = style.colour_of(name, k)
            # The joint of the full and the dashed line is the last angle with data.
            at_last = np.asarray(model.direct_hemispherical(side, np.array([last]), phi_i_deg), float)
            inner = np.append(theta[~beyond], last) if beyond.any() else theta
            axes.plot(
                inner,
                np.append(tau[~beyond], at_last) if beyond.any() else tau,
                color=colour,
                label=style.model_name(name),
            )
            if beyond.any():
                axes.plot(
                    np.insert(theta[beyond], 0, last),
                    np.insert(tau[beyond], 0, at_last),
                    color=colour,
                    linestyle=(0, (3, 2)),
                )
            rows += [(name, a, b, np.nan, bool(c)) for a, b, c in zip(theta, tau, beyond)]
        if measured is not None:
            axes.errorbar(
                measured.theta_deg,
                measured.tau,
                yerr=2.0 * np.asarray(measured.se, float),
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
            rows += [("measured", *v, False) for v in zip(measured.theta_deg, measured.tau, measured.se)]
        if any(r[4] for r in rows):
            axes.plot([], [], color="#555555", linestyle=(0, (3, 2)), label="extrapolated")
        symbol = r"\tau" if side.startswith("transmission") else r"\rho"
        axes.set(xlim=(0, 90), ylim=(0, 1), xlabel=r"angle of incidence $\theta_i$ (°)")
        axes.set_ylabel(rf"direct-hemispherical ${symbol}_{{\mathrm{{dh}}}}$")
        axes.set_xticks(range(0, 91, 15))
        axes.grid(color="#e6e6e6", linewidth=0.6)
        axes.set_axisbelow(True)
        axes.legend(loc="best")
        style.write_csv(
            Path(path).with_suffix(".csv"),
            ("series", "theta_i_deg", "tau", "se", "extrapolated"),
            [(a, float(b), float(c), float(d), int(e)) for a, b, c, d, e in rows],
        )
        return style.save(figure, path, synthetic=synthetic)


def sections(
    models: Mapping[str, ScatteringModel],
    theta_deg: Sequence[float],
    path: str | Path,
    *,
    side: str = "transmission_front",
    phi_i_deg: float = 0.0,
    measured: Sequence[Table] = (),
    synthetic: bool = False,
) -> Path:
    """Draw the DSF of models in the plane of incidence, one panel per angle, logarithmic.

    The horizontal axis is the signed polar angle of the outgoing direction: positive on the side the light
    comes from (phi_s = phi_i), negative on the other, so that undeflected light leaves at -theta_i.

    Parameters
    ----------
    models : by name.
    theta_deg : angles of incidence, degrees.
    path : PNG to write; a CSV of the same name gets the columns model, theta_i_deg, theta_s_signed_deg, dsf.
    side : one of `conventions.SIDES`.
    phi_i_deg : azimuth of the incident direction, degrees.
    measured : tables; the points of those of this side and angle that lie within 1 degree of the plane of
        incidence are drawn as dots, and stand in the CSV as "measured".
    synthetic : True labels the figure.

    Returns
    -------
    path of the PNG.
    """
    angle = np.linspace(-89.75, 89.75, 719)
    u, cosine = np.sin(np.radians(angle)), np.cos(np.radians(angle))
    c, d = np.cos(np.radians(phi_i_deg)), np.sin(np.radians(phi_i_deg))
    rows: list[tuple[str, float, float, float]] = []
    with style.canvas(2.35 * len(theta_deg) + 0.5, 2.6) as figure:
        axes = figure.subplots(1, len(theta_deg), squeeze=False, sharey=True)[0]
        top = 0.0
        for k, (panel, theta) in enumerate(zip(axes, theta_deg)):
            for j, (name, model) in enumerate(models.items()):
                values = np.asarray(model.evaluate(side, theta, phi_i_deg, u * c, u * d), float) * cosine
                rows += [(name, float(theta), float(a), float(v)) for a, v in zip(angle, values)]
                panel.plot(
                    angle, values, color=style.colour_of(name, j), linewidth=1.1, label=style.model_name(name)
                )
                top = max(top, float(np.nanmax(values, initial=0.0)))
            found, values = near_plane(measured, side, float(theta))
            rows += [("measured", float(theta), float(a), float(v)) for a, v in zip(found, values)]
            if found.size:
                panel.plot(
                    found,
                    values,
                    color=style.COLOURS["measured"],
                    linestyle="none",
                    marker=".",
                    markersize=1.6,
                    markeredgewidth=0.0,
                    alpha=0.6,
                    label="measured",
                    zorder=1,
                )
            panel.axvline(-theta, color="#999999", linewidth=0.7, linestyle=":")
            panel.set_title(f"{style.letter(k)}  $\\theta_i$ = {theta:g}°")
            panel.set(xlim=(-90, 90), xlabel=r"signed $\theta_s$ (°)")
            panel.set_xticks(range(-90, 91, 30))
            panel.grid(color="#e6e6e6", linewidth=0.6)
        upper = 10.0 ** (np.ceil(2.0 * np.log10(top)) / 2.0) if top > 0 else 1.0
        axes[0].set(yscale="log", ylim=(upper / 1e5, upper), ylabel="DSF (1/sr)")
        axes[-1].legend(loc="upper right")
        style.write_csv(
            Path(path).with_suffix(".csv"), ("model", "theta_i_deg", "theta_s_signed_deg", "dsf"), rows
        )
        return style.save(figure, path, synthetic=synthetic)


def near_plane(tables: Sequence[Table], side: str, theta_i_deg: float) -> tuple[Array, Array]:
    """Signed polar angle and DSF of measured points within 1 degree of the plane of incidence."""
    angles, values = [np.zeros(0)], [np.zeros(0)]
    for table in tables:
        if table.side != side or abs(table.polar_deg - theta_i_deg) > 0.05:
            continue
        polar = np.minimum(table.theta_s_deg, 180.0 - table.theta_s_deg)
        turn = np.radians(table.phi_s_deg - table.azimuth_deg)
        near = np.abs(polar * np.sin(turn)) < 1.0
        dsf = np.asarray(table.values, float) * (1.0 if table.quantity == "DSF" else table.cos_s)
        angles.append((polar * np.sign(np.cos(turn)))[near])
        values.append(dsf[near])
    return np.concatenate(angles), np.concatenate(values)
