"""Commands of `specularia glass`."""

from __future__ import annotations

import warnings
from pathlib import Path
from typing import Annotated

import typer

from specularia.cli._common import Cull, Json, Quiet, Resolution, Seed, emit, numbers, session, table

app = typer.Typer(no_args_is_help=True, help="The pane as a slab between two reliefs: tracing and Model C.")


@app.callback()
def _group() -> None:
    """Keeps `trace` a command of its own name while it is the only one."""


@app.command()
def trace(
    glass: Annotated[
        Path,
        typer.Argument(metavar="GLASS.toml", help="The pane: faces, medium, bubbles.", show_default=False),
    ],
    output: Annotated[
        list[Path] | None,
        typer.Option(
            "-o", "--output", help="OUT.nc, the model itself, or OUT.xml, for Radiance; may be given twice."
        ),
    ] = None,
    paths: Annotated[
        int, typer.Option("--paths", min=1, help="For each incident direction and side.")
    ] = 200_000,
    tau_only: Annotated[
        bool, typer.Option("--tau-only", help="The energy balance alone, for light on the front; no model.")
    ] = False,
    theta: Annotated[
        str, typer.Option("--theta", help="With --tau-only: incident angles in degrees, A,B,...")
    ] = "0,20,40,60,82.5",
    phi: Annotated[
        float,
        typer.Option(
            "--phi",
            min=-360.0,
            max=360.0,
            help="With --tau-only: incident azimuth in degrees, not averaged over.",
        ),
    ] = 0.0,
    wavelength: Annotated[
        float, typer.Option("--wavelength", min=200.0, max=20000.0, help="In nm, for index and absorption.")
    ] = 520.0,
    resolution: Resolution = 6,
    cull: Cull = None,
    seed: Seed = 0,
    as_json: Json = False,
    quiet: Quiet = False,
) -> None:
    """Trace light through a pane: the geometry-based model (Model C), or its energy balance alone."""
    outputs = output or []
    if not tau_only and not outputs:
        raise typer.BadParameter("name OUT.nc or OUT.xml, or ask for --tau-only", param_hint="-o")
    wrong = [p for p in outputs if p.suffix.lower() not in (".nc", ".xml")]
    if wrong:
        raise typer.BadParameter(f"{wrong[0]} must end in .nc or .xml", param_hint="-o")
    angles = numbers(theta, option="--theta")
    if tau_only and not all(0.0 <= t < 90.0 for t in angles):
        raise typer.BadParameter("angles in 0 <= theta < 90 degrees are wanted", param_hint="--theta")
    if seed < 0:
        raise typer.BadParameter("a seed is not negative", param_hint="--seed")
    with session(quiet=quiet):
        from specularia import bsdf
        from specularia.errors import SpeculariaWarning
        from specularia.files import writable
        from specularia.glass import read_slab
        from specularia.glass import trace as balance_of
        from specularia.glass.model import traced_model

        if tau_only and outputs:
            warnings.warn(
                f"--tau-only computes no model: {outputs[0]} is not written.", SpeculariaWarning, stacklevel=1
            )
            outputs = []
        for path in outputs:
            writable(path)
        slab = read_slab(glass, seed=seed)
        if tau_only:
            found = balance_of(
                slab, theta_deg=angles, phi_deg=phi, paths=paths, seed=seed, wavelength_nm=wavelength
            )
        else:
            traced = traced_model(slab, paths=paths, seed=seed, wavelength_nm=wavelength)
            found = traced.balance
            for path in outputs:
                if path.suffix.lower() == ".nc":
                    bsdf.write_model(traced.model, path)
                else:
                    bsdf.write(traced.model, path, resolution=resolution, cull=cull)
        payload = {
            "theta_deg": found.theta_deg,
            "tau": found.tau,
            "tau_se": found.tau_se,
            "rho": found.rho,
            "rho_se": found.rho_se,
            "absorbed": found.absorbed,
            "lost": found.lost,
            "paths": found.paths,
            "seconds": found.seconds,
        }
        if outputs:
            payload["written"] = [str(p.resolve()) for p in outputs]
        rows = [
            [float(t), float(a), float(b), float(c), float(d), int(lost)]
            for t, a, b, c, d, lost in zip(
                found.theta_deg, found.tau, found.tau_se, found.rho, found.absorbed, found.lost
            )
        ]
        lines = table(["theta_i", "tau", "se", "rho", "absorbed", "lost"], rows)
        emit(payload, as_json=as_json, lines=[*lines, *(f"written: {p}" for p in outputs)])
