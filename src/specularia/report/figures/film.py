"""Transmission and reflection of a pane with thin films over the spectrum."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from specularia.report import style

if TYPE_CHECKING:
    from specularia.glass import FilmSpread

__all__ = ["film_figure", "write_film"]


def write_film(found: FilmSpread, path: str | Path) -> Path:
    """Write tau and rho with and without films as CSV, one row for each angle and wavelength."""
    rows = [
        [theta, w, *(values[i, k] for values in (found.tau, found.rho, found.tau_bare, found.rho_bare))]
        for i, theta in enumerate(found.theta_deg)
        for k, w in enumerate(found.wavelength_nm)
    ]
    header = ("theta_deg", "wavelength_nm", "tau", "rho", "tau_without", "rho_without")
    return style.write_csv(path, header, rows)


def film_figure(found: FilmSpread, path: str | Path, *, synthetic: bool = False) -> Path:
    """Draw tau and rho over the wavelength for each angle, the laser marked, and the colour of both.

    Parameters
    ----------
    found : of `glass.film_spread`.
    path : PNG to write; a CSV of the same name gets the numbers.
    synthetic : True labels the figure.
    """
    from specularia.glass.colour import srgb

    with style.canvas(7.0, 3.0) as figure:
        panels = figure.subplots(1, 2)
        for index, (axes, name, label) in enumerate(
            zip(panels, ("tau", "rho"), (r"transmission $\tau$", r"reflection $\rho$"))
        ):
            values, bare = getattr(found, name), getattr(found, f"{name}_bare")
            shown = srgb(getattr(found, f"{name}_xyz"))
            for k, theta in enumerate(found.theta_deg):
                colour = style.colour_of("", k)
                axes.plot(found.wavelength_nm, values[k], color=colour, label=f"{theta:g}°")
                axes.plot(found.wavelength_nm, bare[k], color=colour, linewidth=0.8, linestyle=":")
                axes.plot(
                    found.laser_nm, getattr(found, f"{name}_laser")[k], "o", color=colour, markersize=3.5
                )
                axes.plot(
                    0.97,
                    0.97 - 0.08 * k,
                    "s",
                    color=tuple(shown[k]),
                    transform=axes.transAxes,
                    markersize=7,
                    markeredgecolor=colour,
                    markeredgewidth=1.0,
                )
            axes.axvline(found.laser_nm, color="#d4d4d4", linewidth=0.7, zorder=0)
            axes.set(xlim=(380, 800), ylim=(0, None), xlabel="wavelength (nm)", ylabel=label)
            axes.set_title(f"{style.letter(index)} dotted: without films", loc="left")
        panels[0].legend(loc="lower right", ncols=2, title=r"$\theta_i$", fontsize=6.5)
        write_film(found, Path(path).with_suffix(".csv"))
        return style.save(figure, path, synthetic=synthetic)
