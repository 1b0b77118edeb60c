"""Illuminance through the day."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.ticker import FuncFormatter, MaxNLocator

from specularia.report import style

if TYPE_CHECKING:
    from specularia.daylight import DayResult

__all__ = ["day_curves"]


def day_curves(result: DayResult, path: str | Path, *, synthetic: bool = False) -> Path:
    """Draw illuminance over the hour: a row per point, a column per date, a line per model.

    Dates share the scale of a point. Bars are two standard errors of the computation each way.

    Parameters
    ----------
    result : of `specularia.daylight.day`, with at least one point.
    path : PNG to write; a CSV of the same name gets date, hour, point, model, illuminance and standard error.
    synthetic : True labels the figure.

    Returns
    -------
    path of the PNG.
    """
    dates, models = result.dates, result.models
    names = list(dict.fromkeys(p.name for h in result.hours for p in h.points))
    calendar = {h.time.date: h.time.calendar for h in result.hours}
    hours = [h.time.hour for h in result.hours]
    with style.canvas(max(2.3 * len(dates), 2.4) + 0.6, 1.5 * len(names) + 0.8) as figure:
        axes = figure.subplots(len(names), len(dates), squeeze=False, sharex=True, sharey="row")
        for r, name in enumerate(names):
            for c, date in enumerate(dates):
                panel = axes[r, c]
                for k, model in enumerate(models):
                    rows = [
                        (h.time.hour, p.illuminance_lx, p.se)
                        for h in result.hours
                        for p in h.points
                        if (h.time.date, p.name, p.model) == (date, name, model)
                    ]
                    t, lux, se = np.array(rows).T
                    panel.errorbar(
                        t,
                        lux,
                        yerr=2 * se,
                        color=style.colour_of(model, k),
                        label=style.model_name(model),
                        marker="o",
                        markersize=2.6,
                        elinewidth=0.9,
                    )
                panel.set_xlim(min(hours) - 0.5, max(hours) + 0.5)
                panel.xaxis.set_major_locator(MaxNLocator(6, integer=True))
                panel.yaxis.set_major_formatter(FuncFormatter(lambda v, _: f"{v:,.5g}"))
                panel.grid(True, color="#e6e6e6", linewidth=0.6)
                panel.set_axisbelow(True)
                if r == 0:
                    old = calendar[date]
                    panel.set_title(f"{date} ({old.capitalize()})" if old else date)
                if c == 0:
                    panel.set_ylabel(f"{name}\nilluminance E (lx)")
                if r == len(names) - 1:
                    panel.set_xlabel(f"hour ({result.clock})")
            axes[r, 0].set_ylim(bottom=0.0)
        figure.legend(*axes[0, 0].get_legend_handles_labels(), loc="outside upper center", ncols=len(models))
        style.write_csv(
            Path(path).with_suffix(".csv"),
            ["date", "hour", "point", "model", "illuminance_lx", "se_lx"],
            [
                [h.time.date, h.time.hour, p.name, p.model, p.illuminance_lx, p.se]
                for h in result.hours
                for p in h.points
            ],
        )
        return style.save(figure, path, synthetic=synthetic)
