"""Tables of the page, made from records."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from specularia.analysis import CLEAR_SLAB
from specularia.report.records import TableBlock
from specularia.report.style import model_name

if TYPE_CHECKING:
    from specularia.analysis import Table1
    from specularia.finds import Summary

__all__ = ["finds_table", "transmission_table"]


def transmission_table(
    table: Table1, caption: str, *, csv: Path | None = None, synthetic: bool = False
) -> TableBlock:
    """The paper's Table 1: a row per source with its standard errors, then the ratios to the measurement.

    Four decimals, errors rounded up. An asterisk marks values beyond the last angle of a model's data.
    """

    def cell(value: float, error: float, star: bool) -> str:
        if np.isnan(value):
            return "–"
        # The error is rounded up: a smaller one than the last digit shown would only widen the table.
        shown = f"{value:.4f}" + (f" ± {np.ceil(error * 1e4 - 1e-6) / 1e4:.4f}" if error > 0 else "")
        return shown + ("*" if star else "")

    rows: list[list[str]] = []
    for r, name in enumerate(table.rows):
        cells = [cell(t, e, s) for t, e, s in zip(table.tau[r], table.se[r], table.extrapolated[r])]
        rows.append([model_name(name), *cells])
    for r, name in enumerate(table.rows):
        if np.isfinite(table.ratio[r]).any() and name != CLEAR_SLAB:
            cells = [cell(t, e, False) for t, e in zip(table.ratio[r], table.ratio_se[r])]
            rows.append([f"{model_name(name)} / measured", *cells])
    header = [f"τ ({table.band})" if table.band else "τ", *[f"{t:g}°" for t in table.theta_deg]]
    return TableBlock(header=header, rows=rows, caption=caption, csv=csv, synthetic=synthetic)


def finds_table(summary: Summary, grouping: str, caption: str, *, csv: Path | None = None) -> TableBlock:
    """Counts and weights of one grouping of the finds ("colour", "room", "type" or "thickness_class")."""
    rows = [
        [
            g.name,
            f"{g.count:,}",
            f"{100 * g.count_share:.1f} %",
            f"{g.weight_g / 1000:,.3f}",
            f"{100 * g.weight_share:.1f} %",
        ]
        for g in summary.groups[grouping]
    ]
    rows.append(["total", f"{summary.total_count:,}", "", f"{summary.total_weight_g / 1000:,.3f}", ""])
    header = [grouping.replace("_", " "), "fragments", "share", "weight (kg)", "share"]
    return TableBlock(header=header, rows=rows, caption=caption, csv=csv, synthetic=summary.synthetic)
