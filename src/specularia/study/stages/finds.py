"""Stage finds: the catalogue counted, and drawn on the plan."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from specularia.study.stages.blocks import drawn_table, figure

if TYPE_CHECKING:
    from specularia.finds import Summary
    from specularia.study.engine import Work

__all__ = ["finds"]


def finds(work: Work) -> Mapping[str, Any]:
    """Count and weigh the finds by colour, and by area where there is a plan."""
    from specularia import finds as package
    from specularia.report import figures

    plans = work.files("plan")
    plan = package.read_plan(plans[0]) if plans else None
    mappings = work.files("mapping")
    table = package.read(work.file("table"), mappings[0] if mappings else None)
    summary = package.summary(table, plan)
    package.write_summary(summary, work.folder)
    synthetic = summary.synthetic
    blocks = []
    if plan is not None:
        for kind in summary.density:
            picture = figures.finds_on_plan(summary, plan, work.folder / f"finds_by_{kind}.png", kind=kind)
            caption = (
                f"Density of the finds on the plan, by {kind}: fragments and grams per square metre of each "
                "outline; colours follow the square root of the density. Counted as catalogued; an outline "
                "without finds is white."
            )
            blocks.append(figure(picture, caption, synthetic=synthetic, like="Fig. 2"))
    blocks += [
        figure(
            figures.finds_by_colour(summary, work.folder / "finds_by_colour.png"),
            "Share of fragments and of weight of each colour group; the lines are 95 % intervals, Wilson's "
            "for fragments, a bootstrap over rows for weight.",
            synthetic=synthetic,
            like="Fig. 3",
        ),
        _by_colour(summary, work.folder),
    ]
    if summary.thickness is not None and summary.area is not None:
        thick, area = summary.thickness, summary.area
        blocks.append(
            figure(
                figures.finds_thickness(summary, work.folder / "finds_thickness.png"),
                f"Thickness of {thick.measured_count:,} fragments: mean {thick.mean_mm:.2f} mm, median "
                f"{thick.quantiles_mm[2]:g} mm. At {area.density_g_cm3:g} g/cm³ the fragments cover "
                f"{area.area_m2:.2f} m² (95 % interval {area.low_m2:.2f} to {area.high_m2:.2f} m²).",
                synthetic=synthetic,
            )
        )
    return {
        "synthetic": summary.synthetic,
        "total_count": summary.total_count,
        "total_weight_g": summary.total_weight_g,
        "blocks": blocks,
    }


def _by_colour(summary: Summary, folder: Path) -> dict[str, Any]:
    """The table of colours, and its numbers in the units that it shows."""
    from specularia.finds.tables_out import write_rows
    from specularia.report import tables

    caption = (
        f"Finds of window glass by colour: {summary.total_count:,} fragments of "
        f"{summary.total_weight_g / 1000:.2f} kg in {summary.rows:,} rows of the catalogue, counted and "
        "weighed as catalogued; the intervals of the shares are in the figure above."
    )
    header = ["colour", "fragments", "fragments_percent", "weight_kg", "weight_percent"]
    rows: list[list[Any]] = [
        [g.name, g.count, 100 * g.count_share, g.weight_g / 1000, 100 * g.weight_share]
        for g in summary.groups["colour"]
    ]
    rows.append(["total", summary.total_count, None, summary.total_weight_g / 1000, None])
    csv = write_rows(folder / "table_by_colour.csv", header, rows)
    block = tables.finds_table(summary, "colour", caption)
    return drawn_table(block, synthetic=summary.synthetic, csv=csv.name)
