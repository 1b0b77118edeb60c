"""Commands of `specularia finds`."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from specularia.cli._common import Json, Quiet, Seed, emit, session, table

if TYPE_CHECKING:
    from specularia.finds import Summary

app = typer.Typer(no_args_is_help=True, help="Statistics of a catalogue of finds.")


@app.callback()
def _group() -> None:
    pass


@app.command()
def summary(
    catalogue: Annotated[Path, typer.Argument(metavar="TABLE", help="Table of finds (CSV, XLSX or ODS).")],
    output: Annotated[Path, typer.Option("-o", "--output", help="Folder for the tables and figures.")],
    plan: Annotated[
        Path | None,
        typer.Option(
            "--plan", help="Rooms and squares in metres (GeoJSON), or a picture with its scale (TOML)."
        ),
    ] = None,
    mapping: Annotated[
        Path | None,
        typer.Option("--mapping", help="Names of columns, words of other languages, units (TOML or JSON)."),
    ] = None,
    bandwidth: Annotated[
        float | None,
        typer.Option(
            "--bandwidth", min=0.001, help="Of the smoothed density, metres; Scott's rule unless given."
        ),
    ] = None,
    density: Annotated[
        float, typer.Option("--density", min=1.0, max=9.0, help="Density of the glass, g/cm3.")
    ] = 2.5,
    density_se: Annotated[
        float, typer.Option("--density-se", min=0.0, max=1.0, help="Its standard error, g/cm3.")
    ] = 0.03,
    choose: Annotated[
        int | None, typer.Option("--choose", min=1, help="Number of fragments to choose for measurement.")
    ] = None,
    by: Annotated[
        str,
        typer.Option("--by", help="Strata of the choice: colour, type, room, square, thickness_class."),
    ] = "colour,thickness_class",
    seed: Seed = 0,
    as_json: Json = False,
    quiet: Quiet = False,
) -> None:
    """Count and weigh finds by colour, room, type and thickness class; with a plan, also per square metre.

    Columns of TABLE without a mapping: find_number, room, square, colour, weight_g, thickness_mm, type,
    count.
    """
    from specularia import files, finds
    from specularia.report import figures

    with session(quiet=quiet):
        drawn = None if plan is None else finds.read_plan(plan)
        read = finds.read(catalogue, mapping)
        result = finds.summary(read, drawn, density_g_cm3=density, density_se_g_cm3=density_se, seed=seed)
        strata = [word.strip() for word in by.split(",") if word.strip()]
        chosen = () if choose is None else finds.choose(read, choose, by=strata, seed=seed)
        smooth = None
        if drawn is not None and (read.x is not None or drawn.of_kind("square")):
            smooth = finds.kernel_density(read, drawn, bandwidth_m=bandwidth)
        folder = files.make_folder(output)
        written = finds.write_summary(result, folder)
        written.append(figures.finds_by_colour(result, folder / "finds_by_colour.png"))
        if result.thickness is not None:
            written.append(figures.finds_thickness(result, folder / "finds_thickness.png"))
        if drawn is not None:
            written += [
                figures.finds_on_plan(result, drawn, folder / f"finds_on_plan_{kind}.png", kind=kind)
                for kind in result.density
            ]
        if drawn is not None and smooth is not None:
            written.append(
                figures.finds_density(smooth, drawn, folder / "finds_density.png", synthetic=result.synthetic)
            )
        if chosen:
            written.append(finds.write_choice(chosen, folder / "chosen.csv"))
    payload = {
        "total_count": result.total_count,
        "total_weight_g": result.total_weight_g,
        "unweighed_count": result.unweighed_count,
        "rows": result.rows,
        "groups": {name: [vars(g) for g in groups] for name, groups in result.groups.items()},
        "density": {kind: [vars(d) for d in areas] for kind, areas in result.density.items()},
        "thickness": None if result.thickness is None else vars(result.thickness),
        "area": None if result.area is None else vars(result.area),
        "smoothed": None
        if smooth is None
        else {
            "bandwidth_m": smooth.bandwidth_m,
            "placed_count": smooth.placed_count,
            "placed_weight_g": smooth.placed_weight_g,
        },
        "chosen": [vars(c) for c in chosen],
        "notes": [vars(n) for n in result.notes],
        "intervals": {
            "level": 0.95,
            "count_share": "Wilson, each fragment for itself",
            "weight_share": "bootstrap over rows",
            "area_m2": "bootstrap over rows, with the error of the density",
        },
        "synthetic": result.synthetic,
        "files": written,
    }
    emit(payload, as_json=as_json, lines=[*_lines(result), "", f"Tables and figures: {folder}"])


def _lines(result: Summary) -> list[str]:
    """The summary for a person to read."""

    def ends(low: float, high: float) -> str:
        return f"{100 * low:.1f}-{100 * high:.1f}"

    lines = [
        f"{result.total_count:,} fragments in {result.rows:,} rows, {result.total_weight_g / 1000:,.2f} kg"
    ]
    if result.unweighed_count:
        lines.append(f"{result.unweighed_count:,} fragments have no weight.")
    for name, groups in result.groups.items():
        rows = [
            [
                g.name,
                f"{g.count:,}",
                f"{100 * g.count_share:.1f} %",
                ends(g.count_low, g.count_high),
                f"{g.weight_g:,.1f}",
                f"{100 * g.weight_share:.1f} %",
                ends(g.weight_low, g.weight_high),
            ]
            for g in groups
        ]
        header = [name.replace("_", " "), "fragments", "share", "95 %", "weight (g)", "share", "95 %"]
        lines += ["", *table(header, rows)]
    if result.thickness is not None:
        t = result.thickness
        lines += [
            "",
            f"Thickness of {t.measured_count:,} fragments: mean {t.mean_mm:.2f} mm "
            f"({t.mean_low_mm:.2f}-{t.mean_high_mm:.2f}), median {t.quantiles_mm[2]:g} mm",
        ]
    if result.area is not None:
        a = result.area
        lines.append(
            f"Area of the fragments: {a.area_m2:.2f} m2 ({a.low_m2:.2f}-{a.high_m2:.2f}) at "
            f"{a.density_g_cm3:g} g/cm3"
        )
    if result.notes:
        lines += ["", f"{len(result.notes):,} notes on rows (notes.csv):"]
        lines += [f"  row {n.line}, {n.column}: {n.text}" for n in result.notes[:10]]
    return lines
