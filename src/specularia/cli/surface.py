"""Commands of `specularia surface`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from specularia.cli._common import Json, Quiet, emit, session, table

app = typer.Typer(no_args_is_help=True, help="Height maps: what they hold, from focus stacks, healed.")

SURFACE_FILE = "A surface file: .plu, .al3d, .sur, .x3p, .opd, .nms, .sdf, .nc, .npy, .csv and others."
Map = Annotated[Path, typer.Argument(metavar="MAP", help=SURFACE_FILE)]


def _netcdf(path: Path) -> Path:
    if path.suffix.lower() != ".nc":
        raise typer.BadParameter(f"{path} must end in .nc")
    return path


Output = Annotated[
    Path,
    typer.Option("-o", "--output", metavar="MAP.nc", callback=_netcdf, help="The height map to write."),
]
Unit = Annotated[str | None, typer.Option("--unit", help="Unit of a file that names none: m, mm, um or nm.")]
Pitch = Annotated[float | None, typer.Option("--pitch", help="Pixel size in um, for a file that holds none.")]


@app.command()
def info(
    path: Map, pitch: Pitch = None, unit: Unit = None, as_json: Json = False, quiet: Quiet = False
) -> None:
    """What a surface file holds: grid, field, span of heights, missing pixels, roughness."""
    from specularia.surface import describe

    with session(quiet=quiet):
        payload = describe(path, pitch_um=pitch, unit=unit).payload()
    shown = {k: v for k, v in payload.items() if k != "warnings"}
    shown["shape"] = "{} rows x {} columns".format(*payload["shape"])  # type: ignore[misc]
    emit(payload, as_json=as_json, lines=table((str(path), ""), list(shown.items())))


@app.command()
def heights(
    stack: Annotated[
        Path,
        typer.Argument(
            metavar="STACK", help="A multi-page TIFF, an OME-TIFF, an .npy or a folder of pictures."
        ),
    ],
    output: Output,
    pitch: Annotated[
        float | None, typer.Option("--pitch", help="Pixel size in um; overrides the file's.")
    ] = None,
    step: Annotated[
        float | None,
        typer.Option("--step", help="Step between slices in um, out of the glass; overrides the file's."),
    ] = None,
    first_row: Annotated[
        str | None,
        typer.Option("--first-row", metavar="bottom|top", help="Whether row 0 of a picture is its lowest y."),
    ] = None,
    as_json: Json = False,
    quiet: Quiet = False,
) -> None:
    """A confocal focus stack to a height map with the uncertainty of each pixel."""
    import json

    from specularia import surface
    from specularia.files import writable

    if first_row not in (None, "bottom", "top"):
        raise typer.BadParameter("is 'bottom' or 'top'", param_hint="--first-row")
    with session(quiet=quiet):
        writable(output)
        taken = surface.read_stack(stack, pitch_um=pitch, step_um=step, first_row=first_row)
        made = surface.heights(taken)
        surface.write(made, output)
    x, y = taken.pitch_um
    payload = {
        "pitch_um": x if x == y else [x, y],
        "step_um": taken.step_um,
        "shape": list(made.shape),
        "missing": made.missing,
        "missing_because": json.loads(made.attributes["missing_because"]),
        "range_um": made.range_um,
        "rms_sigma_um": surface.rms_sigma(made),
    }
    lines = [
        f"{output}: {made.shape[0]} rows x {made.shape[1]} columns of {x:g} x {y:g} um, "
        f"{taken.slices} slices",
        f"heights span {made.range_um:.4g} um, rms sigma {payload['rms_sigma_um']:.3g} um, "
        f"{made.missing} missing",
    ]
    emit(payload, as_json=as_json, lines=lines)


@app.command()
def heal(
    path: Map,
    output: Output,
    pitch: Pitch = None,
    unit: Unit = None,
    as_json: Json = False,
    quiet: Quiet = False,
) -> None:
    """The surface without its deterioration: pits found and bridged from the plateaux around them."""
    from specularia import provenance, surface
    from specularia.files import writable

    with session(quiet=quiet):
        writable(output)
        given = surface.read(path, pitch_um=pitch, unit=unit)
        healed = surface.heal(given)
        source = provenance.record(
            what=f"healed height map of {path.name}",
            inputs=[path],
            parameters=healed.parameters,
            synthetic="synthetic" in given.attributes,
        )
        surface.write(healed.surface, output, source)
    payload = {
        "pit_coverage": healed.pit_coverage,
        "Sdq_before": healed.Sdq_before,
        "Sdq_after": healed.Sdq_after,
        "parameters": healed.parameters,
    }
    lines = [
        f"{output}: pits cover {healed.pit_coverage:.1%} of the surface",
        f"rms slope Sdq {healed.Sdq_before:.4g} before, {healed.Sdq_after:.4g} after",
    ]
    emit(payload, as_json=as_json, lines=lines)
