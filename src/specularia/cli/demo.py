"""`specularia demo`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from specularia.cli._common import Json, Quiet, session

__all__ = ["demo"]


def demo(
    out: Annotated[
        Path, typer.Option("-o", "--out", metavar="DIR", help="Folder for the study and its results.")
    ] = Path("specularia-demo"),
    full: Annotated[
        bool, typer.Option("--full", help="Publication settings: much longer, less noise, finer pictures.")
    ] = False,
    seed: Annotated[
        int | None,
        typer.Option("--seed", min=0, help="Seed of the random streams, in place of that in [trace]."),
    ] = None,
    as_json: Json = False,
    quiet: Quiet = False,
) -> None:
    """Run the bundled study of a synthetic specimen, end to end, at quick settings that it states.

    The study's own files are copied to DIR, where they may be changed and run again with `specularia study
    run`.
    """
    with session(quiet=quiet):
        from specularia import study
        from specularia.cli.study import tell

        tell(study.run(study.write_demo(out, full=full), out, seed=seed), as_json=as_json)
