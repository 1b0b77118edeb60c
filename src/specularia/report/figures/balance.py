"""Where the light goes, over the angle of incidence."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from specularia.report import style

if TYPE_CHECKING:
    from specularia.glass import EnergyBalance

__all__ = ["energy_balance", "write_balance"]

_PARTS = (
    ("tau", "transmitted", "#0b6fa4"),
    ("rho", "reflected", "#d1611e"),
    ("absorbed", "absorbed", "#8a6d00"),
)
_COLUMNS = ("theta_deg", "tau", "tau_se", "rho", "rho_se", "absorbed", "absorbed_se", "lost", "paths")


def write_balance(found: EnergyBalance, path: str | Path) -> Path:
    """Write an energy balance as CSV: shares of the light with standard errors, one row for each angle."""
    return style.write_csv(path, _COLUMNS, list(zip(*(getattr(found, c) for c in _COLUMNS))))


def energy_balance(found: EnergyBalance, path: str | Path, *, synthetic: bool = False) -> Path:
    """Draw the shares of the light over the angle of incidence, with bands of two standard errors.

    Parameters
    ----------
    found : of `glass.trace`.
    path : PNG to write; a CSV of the same name gets the numbers, see `write_balance`.
    synthetic : True labels the figure.
    """
    with style.canvas(4.6, 3.2) as figure:
        axes = figure.subplots()
        for name, label, colour in _PARTS:
            share, error = np.asarray(getattr(found, name)), np.asarray(getattr(found, f"{name}_se"))
            if name == "absorbed" and not share.any():
                continue
            axes.fill_between(
                found.theta_deg, share - 2 * error, share + 2 * error, color=colour, alpha=0.25, linewidth=0
            )
            few = len(share) <= 40
            axes.plot(
                found.theta_deg, share, color=colour, label=label, marker="o" if few else "", markersize=2.5
            )
        axes.set(xlim=(0, 90), ylim=(0, 1), xlabel=r"angle of incidence $\theta_i$ (°)")
        axes.set_ylabel("share of the light (band: ± 2 s.e.)")
        axes.set_xticks(range(0, 91, 15))
        axes.grid(color="#e6e6e6", linewidth=0.6)
        axes.set_axisbelow(True)
        axes.legend(loc="best")
        write_balance(found, Path(path).with_suffix(".csv"))
        return style.save(figure, path, synthetic=synthetic)
