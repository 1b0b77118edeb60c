"""Commands of `specularia gonio`."""

from __future__ import annotations

import warnings
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from specularia.cli._common import Cull, Json, Quiet, Resolution, emit, session, table

if TYPE_CHECKING:
    from specularia.bsdf import TabulatedModel
    from specularia.gonio import Summary, Table

app = typer.Typer(no_args_is_help=True, help="Measured scattering: gonio-photometer tables and Model M.")

Files = Annotated[
    list[Path],
    typer.Argument(help="Measured tables: pab-opto (also raw exports) or VIAVI text.", show_default=False),
]


class QuantityName(StrEnum):
    """What the values of a table may be."""

    DSF = "DSF"
    BSDF = "BSDF"


class SideName(StrEnum):
    """Where the scattered light of a table may go."""

    transmission = "transmission"
    reflection = "reflection"


Quantity = Annotated[
    QuantityName | None,
    typer.Option("--quantity", case_sensitive=False, help="What the values are, against what the files say."),
]
Side = Annotated[
    SideName | None,
    typer.Option(
        "--side",
        case_sensitive=False,
        help="Which side was measured, against the rule that theta_s < 90 is the side of the light.",
    ),
]
Wavelength = Annotated[
    float | None,
    typer.Option("--wavelength", min=200.0, max=20000.0, help="Of the light, nm; else the band is Visible."),
]


@app.command()
def info(
    files: Files,
    quantity: Quantity = None,
    side: Side = None,
    wavelength: Wavelength = None,
    as_json: Json = False,
    quiet: Quiet = False,
) -> None:
    """What each table holds: quantity, side, incident direction, points, integral, oddities."""
    with session(quiet=quiet):
        from specularia import gonio
        from specularia.errors import SpeculariaWarning

        summaries = _summaries(files, quantity, side, wavelength)
        odd = [
            f"{name.replace('_', ' ')}: {note}."
            for name in dict.fromkeys(s.table.side for s in summaries)
            for note in gonio.check_set([s for s in summaries if s.table.side == name])
        ]
        for note in odd:
            warnings.warn(note, SpeculariaWarning, stacklevel=1)
        rows = [
            [
                s.table.label,
                s.table.quantity,
                s.table.kind,
                s.table.theta_i_deg,
                s.table.phi_i_deg,
                s.points,
                s.negative,
                s.coverage,
                s.tau,
                s.tau_se,
            ]
            for s in summaries
        ]
        header = ["file", "quantity", "side", "theta_i", "phi_i"]
        header += ["points", "negative", "coverage", "tau/rho", "se"]
        payload = {"files": [_entry(s) for s in summaries], "warnings": odd}
        emit(payload, as_json=as_json, lines=table(header, rows))


@app.command()
def fit(
    files: Files,
    output: Annotated[
        list[Path],
        typer.Option(
            "-o", "--output", help="OUT.nc, the model itself, or OUT.xml, for Radiance; may be given twice."
        ),
    ],
    quantity: Quantity = None,
    side: Side = None,
    wavelength: Wavelength = None,
    resolution: Resolution = 6,
    cull: Cull = None,
    as_json: Json = False,
    quiet: Quiet = False,
) -> None:
    """Make the measurement-based model (Model M) of tables measured on one sample."""
    wrong = [p for p in output if p.suffix.lower() not in (".nc", ".xml")]
    if wrong:
        raise typer.BadParameter(f"{wrong[0]} must end in .nc or .xml", param_hint="-o")
    with session(quiet=quiet):
        from specularia import bsdf, gonio
        from specularia.files import writable

        for path in output:
            writable(path)
        summaries = _summaries(files, quantity, side, wavelength)
        model = gonio.fit([s.table for s in summaries], summaries=summaries)
        results = {name: _side_result(model, name) for name in model.tables}
        for path in output:
            if path.suffix.lower() == ".nc":
                bsdf.write_model(model, path)
            else:
                bsdf.write(model, path, resolution=resolution, cull=cull)
                written = bsdf.read(path)
                for name, result in results.items():
                    result["xml"] = written.direct_hemispherical(name, result["theta_deg"])
        first = "transmission_front" if "transmission_front" in results else next(iter(results))
        lines = [f"band {model.band}, written to {', '.join(str(p) for p in output)}"]
        for name, result in results.items():
            columns = [k for k in ("theta_deg", "measured", "measured_se", "model", "xml") if k in result]
            rows = [[float(v) for v in row] for row in zip(*(result[k] for k in columns))]
            lines += ["", name.replace("_", " "), *table(columns, rows)]
            lines.append(f"extrapolated beyond {result['extrapolated_beyond_deg']:g} degrees")
        payload = {
            **results[first],
            "band": model.band,
            "sides": results,
            "files": [_entry(s) for s in summaries],
            "written": [str(p.resolve()) for p in output],
        }
        emit(payload, as_json=as_json, lines=lines)


def _summaries(
    files: list[Path], quantity: QuantityName | None, side: SideName | None, wavelength: float | None
) -> list[Summary]:
    from specularia import gonio

    tables: list[Table] = []
    for path in files:
        tables += gonio.read(
            path,
            quantity=quantity.value if quantity else None,
            side=side.value if side else None,
            wavelength_nm=wavelength,
        )
    return gonio.summarise_all(tables)


def _entry(summary: Summary) -> dict[str, Any]:
    one = summary.table
    symbol = "tau" if one.kind == "transmission" else "rho"
    return {
        "file": one.file,
        "quantity": one.quantity,
        "side": one.kind,
        "light_on": one.side.split("_")[1],
        "theta_i_deg": one.theta_i_deg,
        "phi_i_deg": one.phi_i_deg,
        "band": one.band,
        "points": summary.points,
        "negative": summary.negative,
        "coverage": summary.coverage,
        symbol: summary.tau,
        "tau_se": summary.tau_se,
        "warnings": list(summary.warnings),
    }


def _side_result(model: TabulatedModel, side: str) -> dict[str, Any]:
    measured = model.tables[side]
    return {
        "theta_deg": measured.theta_i_deg,
        "measured": measured.tau,
        "measured_se": measured.tau_se,
        "model": model.direct_hemispherical(side, measured.theta_i_deg),
        "extrapolated_beyond_deg": model.extrapolated_beyond_deg[side],
    }
