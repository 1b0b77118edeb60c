"""Transmission and lobe width over the cut-off of the relief."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from specularia.report import style

if TYPE_CHECKING:
    from specularia.analysis import Cutoff

__all__ = ["cutoff"]


def cutoff(found: Cutoff, path: str | Path, *, synthetic: bool = False) -> Path:
    """Draw transmission, lobe width and slope variance beyond over the low-pass cut-off of the relief.

    Cut-offs are on a logarithmic axis; the maps as they are stand at its left end. Waves that rays cannot be
    traced over are shaded.

    Parameters
    ----------
    found : of `analysis.cutoff`.
    path : PNG to write; a CSV of the same name gets a row for each cut-off and angle.
    synthetic : True labels the figure.
    """
    steps = found.cutoff_um
    rough = steps[steps > 0]
    left = 0.6 * (rough.min() if rough.size else 1.0)
    x = np.where(steps > 0, steps, left)
    edge = 0.8 * min(left, found.limit_um)
    with style.canvas(7.2, 2.6) as figure:
        panels = figure.subplots(1, 3)
        for j, theta in enumerate(found.theta_deg):
            colour = style.colour_of(f"{theta:g}", j)
            label = f"$\\theta_i$ = {theta:g}°"
            low, high = found.tau[:, j] - 2 * found.tau_se[:, j], found.tau[:, j] + 2 * found.tau_se[:, j]
            panels[0].fill_between(x, low, high, color=colour, alpha=0.25, linewidth=0)
            panels[0].plot(x, found.tau[:, j], color=colour, marker="o", markersize=2.5, label=label)
            panels[1].plot(x, found.fwhm_deg[:, j], color=colour, marker="o", markersize=2.5, label=label)
            panels[1].plot(x, found.across_deg[:, j], color=colour, linestyle=":", marker="o", markersize=2.0)
        for k, name in enumerate(found.faces):
            line = ("-", "--")[k]
            panels[2].plot(
                x, 100 * found.beyond[:, k], line, color="#1a1a1a", marker="o", markersize=2.5, label=name
            )
        panels[0].set_ylabel("transmission (band: ± 2 s.e.)")
        panels[1].set_ylabel("FWHM (°), dotted: across")
        panels[1].set_ylim(bottom=0)
        panels[2].set_ylabel("slope variance beyond (%)")
        panels[2].set_ylim(0, 102)
        for k, panel in enumerate(panels):
            panel.set_xscale("log")
            panel.set_xlim(edge, 1.15 * x.max())
            panel.axvspan(edge, found.limit_um, color="#d1611e", alpha=0.12, linewidth=0)
            panel.axvline(found.limit_um, color="#d1611e", linewidth=0.8)
            panel.set_title(f"{style.letter(k)}")
            panel.set_xlabel("cut-off of the relief (µm)")
            panel.grid(color="#e6e6e6", linewidth=0.6)
            panel.set_axisbelow(True)
            panel.legend(loc="best")
        panels[0].annotate(
            "rays wrong",
            (found.limit_um, 0.03),
            xycoords=("data", "axes fraction"),
            xytext=(-3, 0),
            textcoords="offset points",
            ha="right",
            va="bottom",
            rotation=90,
            fontsize=6.5,
            color="#8c2d04",
        )
        header = ["cutoff_um", "theta_deg", "tau", "tau_se", "fwhm_deg", "fwhm_across_deg"]
        header += [f"{what}_{f}" for f in found.faces for what in ("Sdq", "share_beyond")]
        rows = [
            [
                steps[i],
                found.theta_deg[j],
                found.tau[i, j],
                found.tau_se[i, j],
                found.fwhm_deg[i, j],
                found.across_deg[i, j],
            ]
            + [v[i, k] for k in range(len(found.faces)) for v in (found.Sdq, found.beyond)]
            for i in range(steps.size)
            for j in range(found.theta_deg.size)
        ]
        style.write_csv(Path(path).with_suffix(".csv"), header, rows)
        return style.save(figure, path, synthetic=synthetic)
