"""Commands of `specularia study`."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from specularia.cli._common import Json, Quiet, emit, session, table

if TYPE_CHECKING:
    from specularia.study import StudyRun

app = typer.Typer(no_args_is_help=True, help="A study of your own files, from the instruments to the report.")

Study = Annotated[Path, typer.Argument(metavar="STUDY.toml", help="The study; `study new` writes one.")]
StudySeed = Annotated[
    int | None,
    typer.Option("--seed", min=0, help="Seed of the random streams, in place of that in [trace]."),
]


@app.command()
def run(
    study: Study,
    out: Annotated[Path, typer.Option("-o", "--out", metavar="DIR", help="Folder for the results.")],
    only: Annotated[
        list[str] | None,
        typer.Option(
            "--only", metavar="STAGE", help="This stage and what it needs; may be given several times."
        ),
    ] = None,
    start: Annotated[
        str | None,
        typer.Option("--from", metavar="STAGE", help="This stage and all that follows from it, again."),
    ] = None,
    dry_run: Annotated[
        bool, typer.Option("--dry-run", help="Say what would run, and why; do nothing.")
    ] = False,
    seed: StudySeed = None,
    as_json: Json = False,
    quiet: Quiet = False,
) -> None:
    """Run a study: only what has changed or is missing. A run that was killed goes on."""
    with session(quiet=quiet):
        from specularia import study as package

        try:
            steps = package.steps(study, out, only=only or (), start=start, seed=seed)
        except ValueError as error:
            raise typer.BadParameter(str(error), param_hint="--only or --from") from error
        if dry_run:
            rows = [(s.stage.name, s.action, s.why) for s in steps]
            payload = {"stages": [dict(zip(("stage", "action", "why"), row)) for row in rows]}
            emit(payload, as_json=as_json, lines=[f"{n}: {action} ({why})" for n, action, why in rows])
            return
        done = package.run(study, out, only=only or (), start=start, seed=seed)
        tell(done, as_json=as_json)


@app.command()
def new(
    folder: Annotated[Path, typer.Argument(metavar="DIR", help="Folder for the study; made if missing.")],
    files: Annotated[
        list[Path] | None,
        typer.Argument(
            metavar="[FILES]...",
            help="Tables, stacks, maps, pictures, finds, settings of glass and room, in any order.",
        ),
    ] = None,
    as_json: Json = False,
    quiet: Quiet = False,
) -> None:
    """Write a commented STUDY.toml that names the files given, sorted by what they are."""
    with session(quiet=quiet):
        from specularia import study as package

        made = package.new(folder, files or ())
        lines = [f"{path}: {kind}" for path, kind in made.sorted_as.items()]
        lines += [f"{path}: nothing that a study reads" for path in made.unknown]
        lines += [
            f"written: {path}" + (" (the demo's: edit it)" if path != made.study else "")
            for path in made.written
        ]
        payload = {
            "study": made.study.resolve(),
            "written": [p.resolve() for p in made.written],
            "files": {str(p): kind for p, kind in made.sorted_as.items()},
            "unknown": list(made.unknown),
        }
        emit(payload, as_json=as_json, lines=lines)


@app.command()
def check(study: Study, as_json: Json = False, quiet: Quiet = False) -> None:
    """Read all that a study names and say what is wrong, before any work. Exit code 3 if something is."""
    with session(quiet=quiet):
        from specularia.study import check as look

        problems = look(study)
        emit({"problems": problems}, as_json=as_json, lines=problems or [f"{study}: nothing wrong."])
    if problems:
        raise typer.Exit(3)


def tell(done: StudyRun, *, as_json: bool) -> None:
    """Say what a run did; the last line names the report."""
    rows = [[name, seconds if name in done.computed else "kept"] for name, seconds in done.seconds.items()]
    lines = [
        *table(("stage", "seconds"), rows),
        f"report: {done.report}" if done.report else "report: left alone",
    ]
    payload = {
        "report": done.report,
        "seconds": done.seconds,
        "computed": list(done.computed),
        "folders": done.folders,
    }
    emit(payload, as_json=as_json, lines=lines)
