"""`specularia twin`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from specularia.cli._common import Json, Quiet, Seed, emit, session, table

__all__ = ["twin"]


def twin(
    out: Annotated[Path, typer.Option("-o", "--out", help="Folder for the specimen; made if missing.")],
    settings: Annotated[
        Path | None,
        typer.Argument(metavar="[TWIN.toml]", help="Settings; left out: a specimen like the paper's."),
    ] = None,
    seed: Seed = 1,
    as_json: Json = False,
    quiet: Quiet = False,
) -> None:
    """Make a synthetic specimen with known truth.

    Writes true height maps, pit masks, bubbles and transmissions (truth), focus stacks and images
    (microscope), gonio-photometer tables (gonio), a finds table with a plan (site) and a lit room (room).
    Every file says that it is synthetic. The keys of TWIN.toml are listed in docs/theory/twin.md.
    """
    if seed < 0:
        raise typer.BadParameter(f"{seed} is below 0", param_hint="--seed")
    with session(quiet=quiet):
        import json

        from specularia.twin import make

        files = make(settings, out, seed=seed)
        truth = json.loads(files.truth.read_text(encoding="utf-8"))
        tau = truth["tau"]
        rows = [
            [theta, *(tau[band][key][k] for band in ("520 nm", "D65") for key in ("phi_0", "azimuth_mean"))]
            for k, theta in enumerate(truth["theta_deg"])
        ]
        header = ["theta_i", "tau 520 nm phi=0", "520 nm all phi", "D65 phi=0", "D65 all phi"]
        lines = [f"A synthetic specimen, seed {seed}, in {files.folder}", *table(header, rows)]
        payload = {
            "truth": files.truth,
            "folder": files.folder,
            "seed": seed,
            "theta_deg": truth["theta_deg"],
            "tau": tau,
            "tables": list(files.tables),
        }
        emit(payload, as_json=as_json, lines=[*lines, f"truth: {files.truth}"])
