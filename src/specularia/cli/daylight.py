"""Commands of `specularia daylight`."""

from __future__ import annotations

from enum import StrEnum
from pathlib import Path
from typing import Annotated, Any

import typer

from specularia.cli._common import Json, Quiet, Seed, emit, session, table

app = typer.Typer(no_args_is_help=True, help="The lit room: illuminance and luminance behind a pane.")


class Method(StrEnum):
    """How light gets from the panes to the surfaces of the room."""

    sources = "sources"
    plain = "plain"


@app.callback()
def _group() -> None:
    """Keeps `run` a command of its own while it is the only one."""


@app.command()
def run(
    room: Annotated[Path, typer.Argument(help="ROOM.toml: room, windows, sun, sky, sensors and views.")],
    output: Annotated[Path, typer.Option("-o", "--output", help="Folder for pictures and results.")],
    model: Annotated[
        list[str] | None,
        typer.Option(
            "--model", help="NAME=FILE, a model (.nc or .xml) for the panes; repeat it to compare models."
        ),
    ] = None,
    full: Annotated[
        bool, typer.Option("--full", help="Publication quality instead of what the room's file asks for.")
    ] = False,
    method: Annotated[
        Method,
        typer.Option(
            "--method",
            help="sources: panes as tabulated light sources. plain: BSDF polygons and ambient sampling by "
            "Radiance at the paper's options, slow, for comparison.",
        ),
    ] = Method.sources,
    seed: Seed = 0,
    as_json: Json = False,
    quiet: Quiet = False,
) -> None:
    """Light a room through each model: pictures, illuminance at named points, luminance of the panes."""
    models = _named_files(model or [])
    if full and method is Method.plain:
        raise typer.BadParameter("--method plain has the paper's options only", param_hint="--full")
    with session(quiet=quiet):
        from specularia import daylight
        from specularia.files import write_json

        lit = daylight.run(
            room,
            models=models,
            folder=output,
            seed=seed,
            quality=daylight.FULL if full else None,
            method=method.value,
        )
        figures = _maps(lit, output)
        result = {
            "points": [
                {
                    "name": p.name,
                    "model": p.model,
                    "illuminance_lx": p.illuminance_lx,
                    "se": p.se,
                    "direct_lx": p.direct_lx,
                    "indirect_lx": p.indirect_lx,
                }
                for p in lit.points
            ],
            "images": [
                {
                    "name": i.name,
                    "model": i.model,
                    "hdr": i.hdr.resolve(),
                    "npz": i.npz.resolve(),
                    "figure": figures[i.name].resolve(),
                }
                for i in lit.images
            ],
            "panes": [
                {
                    "window": p.window,
                    "model": p.model,
                    "view": p.view,
                    "luminance_cd_m2": p.luminance_cd_m2,
                    "exitance_lm_m2": p.exitance_lm_m2,
                    "sun_lx": p.sun_lx,
                    "sky_lx": p.sky_lx,
                }
                for p in lit.panes
            ],
        }
        write_json(output / "daylight.json", {**result, "provenance": lit.provenance})
        lines = table(
            ["point", "model", "illuminance lx", "se"],
            [[p.name, p.model, p.illuminance_lx, p.se] for p in lit.points],
        )
        lines += table(
            ["window", "model", "seen", "luminance cd/m2"],
            [[p.window, p.model, p.view, p.luminance_cd_m2] for p in lit.panes],
        )
        emit(result, as_json=as_json, lines=[*lines, f"written to {output.resolve()}"])


def _named_files(options: list[str]) -> dict[str, Path]:
    models: dict[str, Path] = {}
    for option in options:
        name, equals, file = option.partition("=")
        if not (name and equals and file):
            raise typer.BadParameter(f"{option!r} is not NAME=FILE, like M=model_m.nc", param_hint="--model")
        if name in models:
            raise typer.BadParameter(f"the name {name!r} stands there twice", param_hint="--model")
        models[name] = Path(file)
    return models


def _maps(lit: Any, folder: Path) -> dict[str, Path]:
    """One luminance map per view, with all models on one scale."""
    from specularia.daylight import file_name
    from specularia.report.figures import luminance_maps

    return {
        view: luminance_maps(
            [i for i in lit.images if i.name == view],
            folder / f"luminance_{file_name(view)}.png",
            points=lit.points,
            synthetic="synthetic" in lit.provenance,
        )
        for view in dict.fromkeys(i.name for i in lit.images)
    }
