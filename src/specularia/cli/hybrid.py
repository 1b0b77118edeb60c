"""`specularia hybrid`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from specularia.cli._common import Cull, Json, Quiet, Resolution, emit, session, table

__all__ = ["hybrid"]


def hybrid(
    measured: Annotated[Path, typer.Argument(metavar="M.nc", help="Measured model (Model M).")],
    traced: Annotated[
        Path, typer.Argument(metavar="C.nc", help="Traced model of the same pane, such as that inferred.")
    ],
    output: Annotated[list[Path], typer.Option("-o", "--output", help=".nc or .xml; may be given twice.")],
    resolution: Resolution = 7,
    cull: Cull = None,
    as_json: Json = False,
    quiet: Quiet = False,
) -> None:
    """Join a measured model and a traced one: measured where it was measured, traced beyond.

    Meant for grazing angles that no instrument reaches and for the back: the traced part is scaled so that
    there is no step at the last measured angle, and every angle says where it comes from.
    """
    import json

    from specularia import analysis, bsdf

    for path in output:
        if path.suffix not in (".nc", ".xml"):
            raise typer.BadParameter(f"{path.name} ends in neither .nc nor .xml", param_hint="-o")
    with session(quiet=quiet):
        model = analysis.hybrid(bsdf.read_model(measured), bsdf.read_model(traced))
        for path in output:
            if path.suffix == ".nc":
                bsdf.write(model, path)
            else:
                bsdf.write(model, path, resolution=resolution, cull=cull)
    rows: list[list[object]] = []
    sides = {}
    for side, one in model.tables.items():
        origin = json.loads(model.attributes[f"origin_{side}"])
        joined = model.attributes.get(f"joined_{side}")
        sides[side] = {"origin": origin, "joined": None if joined is None else json.loads(joined)}
        last = max((t for t, o in origin if o == "measured"), default=None)
        ratio = None if joined is None else json.loads(joined)["ratio"]
        rows.append([side, last, float(one.theta_i_deg[-1]), ratio])
    payload = {"written": [p.resolve() for p in output], "sides": sides}
    lines = table(["side", "measured to", "traced to", "scaled by"], rows)
    emit(payload, as_json=as_json, lines=[*lines, *(f"wrote {p}" for p in output)])
