"""Commands of `specularia finds`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from specularia.cli._common import Json, Quiet, emit, session, table

app = typer.Typer(no_args_is_help=True, help="Statistics of a catalogue of finds.")


@app.callback()
def _group() -> None:
    pass


@app.command()
def summary(
    catalogue: Annotated[Path, typer.Argument(metavar="TABLE", help="Table of finds (CSV).")],
    output: Annotated[Path, typer.Option("-o", "--output", help="Folder for the tables and figures.")],
    plan: Annotated[
        Path | None, typer.Option("--plan", help="Rooms and squares in metres (GeoJSON), for the density.")
    ] = None,
    as_json: Json = False,
    quiet: Quiet = False,
) -> None:
    """Count and weigh finds by colour, room, type and thickness class; with a plan, also per square metre.

    Columns of TABLE: find_number, room, square, colour, weight_g, thickness_mm, type, count.
    """
    from specularia import files, finds
    from specularia.report import figures

    with session(quiet=quiet):
        drawn = None if plan is None else finds.read_plan(plan)
        result = finds.summary(catalogue, drawn)
        folder = files.make_folder(output)
        written = finds.write_summary(result, folder)
        written.append(figures.finds_by_colour(result, folder / "finds_by_colour.png"))
        if drawn is not None:
            written += [
                figures.finds_on_plan(result, drawn, folder / f"finds_on_plan_{kind}.png", kind=kind)
                for kind in result.density
            ]
    lines = [
        f"{result.total_count:,} fragments in {result.rows:,} rows, {result.total_weight_g / 1000:,.2f} kg"
    ]
    for name, groups in result.groups.items():
        rows = [
            [
                g.name,
                f"{g.count:,}",
                f"{100 * g.count_share:.1f} %",
                f"{g.weight_g:,.1f}",
                f"{100 * g.weight_share:.1f} %",
            ]
            for g in groups
        ]
        lines += ["", *table([name.replace("_", " "), "fragments", "share", "weight (g)", "share"], rows)]
    payload = {
        "total_count": result.total_count,
        "total_weight_g": result.total_weight_g,
        "rows": result.rows,
        "groups": {name: [vars(g) for g in groups] for name, groups in result.groups.items()},
        "density": {kind: [vars(d) for d in areas] for kind, areas in result.density.items()},
        "synthetic": result.synthetic,
        "files": written,
    }
    emit(payload, as_json=as_json, lines=[*lines, "", f"Tables and figures: {folder}"])
