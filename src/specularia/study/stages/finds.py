"""Stage finds: the catalogue counted, and drawn on the plan."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from specularia.study.stages.blocks import drawn_table, figure

if TYPE_CHECKING:
    from specularia.study.engine import Work

__all__ = ["finds"]


def finds(work: Work) -> Mapping[str, Any]:
    """Count and weigh the finds by colour, and by area where there is a plan."""
    from specularia import finds as package
    from specularia.report import figures, tables

    plans = work.files("plan")
    plan = package.read_plan(plans[0]) if plans else None
    mappings = work.files("mapping")
    table = package.read(work.file("table"), mappings[0] if mappings else None)
    summary = package.summary(table, plan)
    package.write_summary(summary, work.folder)
    caption = (
        f"Finds of window glass by colour: {summary.total_count:,} fragments of "
        f"{summary.total_weight_g / 1000:.2f} kg in {summary.rows:,} rows of the catalogue."
    )
    blocks = [
        drawn_table(
            tables.finds_table(summary, "colour", caption), synthetic=summary.synthetic, csv="by_colour.csv"
        ),
        figure(
            figures.finds_by_colour(summary, work.folder / "finds_by_colour.png"),
            "Share of fragments and of weight of each colour group; the lines are 95 % intervals, Wilson's "
            "for fragments, a bootstrap over rows for weight.",
            synthetic=summary.synthetic,
        ),
    ]
    if summary.thickness is not None and summary.area is not None:
        thick, area = summary.thickness, summary.area
        blocks.append(
            figure(
                figures.finds_thickness(summary, work.folder / "finds_thickness.png"),
                f"Thickness of {thick.measured_count:,} fragments: mean {thick.mean_mm:.2f} mm, median "
                f"{thick.quantiles_mm[2]:g} mm. At {area.density_g_cm3:g} g/cm³ the fragments cover "
                f"{area.area_m2:.2f} m² (95 % interval {area.low_m2:.2f} to {area.high_m2:.2f} m²).",
                synthetic=summary.synthetic,
            )
        )
    if plan is not None:
        for kind in summary.density:
            picture = figures.finds_on_plan(summary, plan, work.folder / f"finds_by_{kind}.png", kind=kind)
            caption = f"Density of the finds on the plan, by {kind}: fragments and grams per square metre."
            blocks.append(figure(picture, caption, synthetic=summary.synthetic))
    return {
        "synthetic": summary.synthetic,
        "total_count": summary.total_count,
        "total_weight_g": summary.total_weight_g,
        "blocks": blocks,
    }
