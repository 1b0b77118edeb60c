"""Commands of `specularia daylight`."""

from __future__ import annotations

from enum import StrEnum
from pathlib import Path
from typing import Annotated, Any

import typer

from specularia.cli._common import Json, Quiet, Seed, emit, numbers, session, table

app = typer.Typer(no_args_is_help=True, help="The lit room: illuminance and luminance behind a pane.")


class Method(StrEnum):
    """How light gets from the panes to the surfaces of the room."""

    sources = "sources"
    plain = "plain"


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
        figures, ratios, plans, pictures = _figures(lit, output)
        result = {
            "points": [
                {
                    "name": p.name,
                    "model": p.model,
                    "illuminance_lx": p.illuminance_lx,
                    "se": p.se,
                    "interval_lx": p.interval_lx,
                    "direct_lx": p.direct_lx,
                    "indirect_lx": p.indirect_lx,
                    "daylight_factor_percent": p.daylight_factor_percent,
                    "chromaticity_xy": p.chromaticity_xy,
                    "colour_temperature_k": p.colour_temperature_k,
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
                    "picture": pictures[i.name].resolve() if i.name in pictures else None,
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
                    "sun_share": p.sun_share,
                    "chromaticity_xy": p.chromaticity_xy,
                }
                for p in lit.panes
            ],
            "intervals": lit.intervals,
            "colour": lit.colour,
            "grids": [_grid(g, output, plans) for g in lit.grids],
            "glare": [
                {
                    "view": g.view,
                    "model": g.model,
                    "dgp": g.dgp,
                    "vertical_illuminance_lx": g.vertical_illuminance_lx,
                    "sensor_illuminance_lx": g.sensor_illuminance_lx,
                    "sources": g.sources,
                    "source_luminance_cd_m2": g.source_luminance_cd_m2,
                    "source_sr": g.source_sr,
                }
                for g in lit.glare
            ],
            "ratios": ratios,
            "no_daylight_factor": lit.no_daylight_factor or None,
        }
        write_json(output / "daylight.json", {**result, "provenance": lit.provenance})
        emit(result, as_json=as_json, lines=[*_told(lit), f"written to {output.resolve()}"])


@app.command()
def day(
    room: Annotated[Path, typer.Argument(help="ROOM.toml with [place] or [weather], and dates in [day].")],
    output: Annotated[Path, typer.Option("-o", "--output", help="Folder for pictures and results.")],
    model: Annotated[
        list[str] | None, typer.Option("--model", help="NAME=FILE, as in `daylight run`; may be repeated.")
    ] = None,
    date: Annotated[
        list[str] | None, typer.Option("--date", help="YYYY-MM-DD, instead of [day]; may be repeated.")
    ] = None,
    calendar: Annotated[
        str | None, typer.Option("--calendar", help="gregorian or julian; needed for dates before 1583.")
    ] = None,
    hours: Annotated[
        str | None, typer.Option("--hours", help="First hour, last hour and step, as in 6,18,1.")
    ] = None,
    full: Annotated[
        bool, typer.Option("--full", help="Publication quality instead of what the room's file asks for.")
    ] = False,
    seed: Seed = 0,
    as_json: Json = False,
    quiet: Quiet = False,
) -> None:
    """Light a room hour by hour through chosen days, into one page with a time slider.

    Finished hours are kept: a run that was stopped goes on, and only what changed is done again.
    """
    models = _named_files(model or [])
    span = None if hours is None else numbers(hours, option="--hours")
    if span is not None and len(span) != 3:
        raise typer.BadParameter(f"{hours!r} is not first hour, last hour, step", param_hint="--hours")
    with session(quiet=quiet):
        from specularia import daylight
        from specularia.files import write_json
        from specularia.report.day_page import write_day
        from specularia.report.figures import day_curves

        found = daylight.day(
            room,
            folder=output,
            models=models,
            dates=date,
            calendar=calendar,
            hours=None if span is None else (span[0], span[1], span[2]),
            seed=seed,
            quality=daylight.FULL if full else None,
        )
        synthetic = "synthetic" in found.provenance
        result = found.record()
        has_points = bool(result["points"])
        files = {
            "html": write_day(found, output / "day.html", synthetic=synthetic).resolve(),
            "figure": day_curves(found, output / "day.png", synthetic=synthetic).resolve()
            if has_points
            else None,
        }
        result |= {"files": files, "provenance": found.provenance}
        write_json(output / "day.json", result)
        lines = table(
            ["date", "hour", "point", "model", "illuminance lx", "se"],
            [
                [p["date"], p["hour"], p["name"], p["model"], p["illuminance_lx"], p["se"]]
                for p in result["points"]
            ],
        )
        out = len(found.left_out)
        lines += [f"{out} of {out + len(found.hours)} hours left out for want of light"] if out else []
        emit(result, as_json=as_json, lines=[*lines, f"written to {output.resolve()}"])


@app.command()
def wea(
    weather: Annotated[Path, typer.Argument(help="Weather file in EPW.")],
    output: Annotated[Path, typer.Option("-o", "--output", help="WEA file to write.")],
    as_json: Json = False,
    quiet: Quiet = False,
) -> None:
    """Turn an EPW weather file into Radiance's WEA, which gendaymtx reads."""
    with session(quiet=quiet):
        from specularia.daylight import read_weather, write_wea
        from specularia.files import writable

        writable(output)
        found = read_weather(weather)
        path = write_wea(found, output)
        result = {
            "wea": path.resolve(),
            "hours": int(found.hour.size),
            "station": found.station,
            **found.place.model_dump(exclude={"orientation_deg"}),
        }
        lines = [f"{found.station}: {found.hour.size} hours, written to {path.resolve()}"]
        emit(result, as_json=as_json, lines=lines)


@app.command()
def sun(
    room: Annotated[Path, typer.Argument(help="ROOM.toml with [place] and [time], or with [sun].")],
    date: Annotated[
        str | None, typer.Option("--date", help="YYYY-MM-DD, instead of the file's; with --hour.")
    ] = None,
    hour: Annotated[
        float | None, typer.Option("--hour", help="With decimals: 10.5 is half past ten.")
    ] = None,
    calendar: Annotated[
        str | None, typer.Option("--calendar", help="gregorian or julian, of --date.")
    ] = None,
    as_json: Json = False,
    quiet: Quiet = False,
) -> None:
    """Say where the sun stands and how much light sun and sky give, without rendering anything."""
    with session(quiet=quiet):
        from specularia.daylight import outside_at

        result = outside_at(room, date=date, hour=hour, calendar=calendar)
        rows = [
            [name.replace("_", " "), f"{value:,.2f}" if isinstance(value, float) else value]
            for name, value in result.items()
            if value is not None
        ]
        lines = table(["outdoors", "value"], rows)
        emit(result, as_json=as_json, lines=lines)


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


def _told(lit: Any) -> list[str]:
    """Tables for a person to read."""
    factor = not lit.no_daylight_factor
    colour = any(p.chromaticity_xy for p in lit.points)
    lines = table(
        [
            "point",
            "model",
            "illuminance lx",
            "se",
            *(["daylight factor %"] if factor else []),
            *(["x", "y", "colour temperature K"] if colour else []),
        ],
        [
            [
                p.name,
                p.model,
                p.illuminance_lx,
                p.se,
                *([p.daylight_factor_percent] if factor else []),
                *([*(p.chromaticity_xy or (None, None)), p.colour_temperature_k] if colour else []),
            ]
            for p in lit.points
        ],
    )
    if lit.grids:
        lines += table(
            [
                "grid",
                "model",
                "mean lx",
                "least lx",
                "uniformity",
                *(["mean daylight factor %"] if factor else []),
            ],
            [
                [g.name, g.model, g.mean_lx, g.min_lx, g.uniformity, *([_mean_factor(g)] if factor else [])]
                for g in lit.grids
            ],
        )
    if not factor and (lit.points or lit.grids):
        lines.append(f"no daylight factor: {lit.no_daylight_factor}")
    lines += table(
        ["window", "model", "seen", "luminance cd/m2"],
        [[p.window, p.model, p.view, p.luminance_cd_m2] for p in lit.panes],
    )
    if lit.glare:
        lines += table(
            ["view", "model", "DGP", "E at the eye lx", "sources"],
            [[g.view, g.model, g.dgp, g.vertical_illuminance_lx, g.sources] for g in lit.glare],
        )
    return lines


def _mean_factor(grid: Any) -> float | None:
    values = grid.daylight_factor_percent
    return None if values is None else float(values.mean())


def _grid(grid: Any, folder: Path, plans: dict[str, Path]) -> dict[str, Any]:
    """A grid for the JSON; its arrays lie in an NPZ as well."""
    from specularia.daylight import file_name
    from specularia.report import style

    arrays = {
        "along_m": grid.along_m,
        "across_m": grid.across_m,
        "points_m": grid.points_m,
        "normal": grid.normal,
        "illuminance_lx": grid.illuminance_lx,
        "se": grid.se,
        "direct_lx": grid.direct_lx,
        "indirect_lx": grid.indirect_lx,
    }
    if grid.daylight_factor_percent is not None:
        arrays["daylight_factor_percent"] = grid.daylight_factor_percent
    if grid.chromaticity_xy is not None:
        arrays["chromaticity_xy"] = grid.chromaticity_xy
    npz = style.write_npz(folder / f"{file_name(f'{grid.model}_{grid.name}')}_grid.npz", arrays)
    return {
        "name": grid.name,
        "model": grid.model,
        "mean_lx": grid.mean_lx,
        "min_lx": grid.min_lx,
        "uniformity": grid.uniformity,
        "mean_daylight_factor_percent": _mean_factor(grid),
        "npz": npz.resolve(),
        "figure": plans[grid.name].resolve(),
        **{key: value.tolist() for key, value in arrays.items() if key != "points_m"},
    }


def _figures(
    lit: Any, folder: Path
) -> tuple[dict[str, Path], list[dict[str, Any]], dict[str, Path], dict[str, Path]]:
    """Luminance maps by view, ratios of models, plans by grid, pictures in colour by view where there is any;
    all models of a figure share one scale."""
    from specularia.daylight import file_name
    from specularia.report import figures

    synthetic = "synthetic" in lit.provenance
    maps, plans, ratios, pictures = {}, {}, [], {}
    for view in dict.fromkeys(i.name for i in lit.images):
        images = [i for i in lit.images if i.name == view]
        maps[view] = figures.luminance_maps(
            images, folder / f"luminance_{file_name(view)}.png", points=lit.points, synthetic=synthetic
        )
        if any(i.xyz is not None for i in images):
            path = folder / f"colour_{file_name(view)}.png"
            pictures[view] = figures.colour_pictures(images, path, synthetic=synthetic)
        if len(images) > 1:
            path = folder / f"luminance_ratio_{file_name(view)}.png"
            figure = figures.luminance_ratios(images, path, synthetic=synthetic).resolve()
            ratios += [
                {"view": view, "models": [images[0].model, i.model], "figure": figure} for i in images[1:]
            ]
    for name in dict.fromkeys(g.name for g in lit.grids):
        grids = [g for g in lit.grids if g.name == name]
        plans[name] = figures.illuminance_plans(
            grids, folder / f"illuminance_{file_name(name)}.png", synthetic=synthetic
        )
        if len(grids) > 1:
            path = folder / f"illuminance_ratio_{file_name(name)}.png"
            figure = figures.illuminance_ratios(grids, path, synthetic=synthetic).resolve()
            ratios += [
                {"grid": name, "models": [grids[0].model, g.model], "figure": figure} for g in grids[1:]
            ]
    return maps, ratios, plans, pictures


@app.command()
def fragment(
    job: Annotated[Path, typer.Argument(help="FRAGMENT.toml: the sample, the printed sheet, the light.")],
    output: Annotated[Path, typer.Option("-o", "--output", help="Folder for pictures and results.")],
    model: Annotated[
        list[str] | None,
        typer.Option("--model", help="NAME=FILE, a model (.nc or .xml); repeat it to compare models."),
    ] = None,
    as_json: Json = False,
    quiet: Quiet = False,
) -> None:
    """Look at the sample over a printed sheet through each model: pictures, contrast over the gap."""
    models = _named_files(model or [])
    with session(quiet=quiet):
        from specularia import daylight
        from specularia.files import make_folder, write_json
        from specularia.report import figures

        seen = daylight.look_through(job, models=models)
        make_folder(output)
        synthetic = "synthetic" in seen.provenance
        pictures = figures.fragment_pictures(
            seen.pictures, output / "fragment.png", invented=seen.synthetic_outline, synthetic=synthetic
        )
        curves = figures.contrast_over_gap(
            seen.contrast,
            output / "contrast.png",
            stroke_mm=seen.job.sheet.stroke_mm,
            synthetic=synthetic,
        )
        result = {
            "pictures": [
                {
                    "model": p.model,
                    "gap_mm": p.gap_mm,
                    "mean_cd_m2": float((p.luminance * p.covered).sum() / p.covered.sum()),
                }
                for p in seen.pictures
            ],
            "contrast": [
                {
                    "model": c.model,
                    "gap_mm": c.gap_mm.tolist(),
                    "contrast": c.contrast.tolist(),
                    "transmitted": c.transmitted.tolist(),
                    "bare": c.bare,
                    "reflects": c.reflects,
                }
                for c in seen.contrast
            ],
            "outline": "synthetic" if seen.synthetic_outline else "given",
            "figures": {"pictures": pictures.resolve(), "contrast": curves.resolve()},
        }
        write_json(output / "fragment.json", {**result, "provenance": seen.provenance})
        lines = table(
            ["model", "gap mm", "contrast"],
            [[c.model, gap, c.at(gap)] for c in seen.contrast for gap in seen.job.gap_mm],
        )
        lines += [
            f"{c.model}: no reflection in the model, so none in the pictures"
            for c in seen.contrast
            if not c.reflects
        ]
        emit(result, as_json=as_json, lines=[*lines, f"written to {output.resolve()}"])
