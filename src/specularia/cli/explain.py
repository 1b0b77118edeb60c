"""`specularia explain`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from specularia.cli._common import Json, Quiet, Seed, emit, named_numbers, session, table

__all__ = ["explain"]


def explain(
    glass: Annotated[
        Path,
        typer.Argument(metavar="GLASS.toml", help="The pane with all that is known of it."),
    ],
    tables: Annotated[list[Path], typer.Argument(metavar="TABLE...", help="Measured tables of the pane.")],
    output: Annotated[
        Path, typer.Option("-o", "--output", metavar="DIR", help="Folder for table and figure.")
    ],
    order: Annotated[
        str | None,
        typer.Option(
            "--order",
            metavar="STEP,...",
            help="Steps in their order; those not named are left out. Without it all: endless, polarisation, "
            "absorption, bubbles, height noise, micro-relief, diffraction (not for synthetic tables, which "
            "rays made), tree, instrument.",
        ),
    ] = None,
    patch: Annotated[float, typer.Option("--patch-mm", help="Width of the published finite patch.")] = 8.4,
    resolution: Annotated[
        int, typer.Option("--resolution", min=5, max=8, help="Of the published tensor tree.")
    ] = 6,
    aperture: Annotated[
        float, typer.Option("--aperture-deg", help="Full width at half maximum of the instrument's response.")
    ] = 0.3,
    unsure: Annotated[
        list[str] | None,
        typer.Option(
            "--unsure",
            metavar="STEP=SHARE",
            help="Relative standard error of what absorption, bubbles or micro-relief bring in, as 0.1.",
        ),
    ] = None,
    paths: Annotated[int, typer.Option("--paths", min=1000, help="For each state and angle.")] = 1_000_000,
    wavelength: Annotated[float, typer.Option("--wavelength", help="Of the light, nm.")] = 520.0,
    seed: Seed = 0,
    as_json: Json = False,
    quiet: Quiet = False,
) -> None:
    """Say why Model C and the measurement differ: an error budget, one cause at a time.

    Begins with Model C as published (a finite patch with clear sides, no polarisation, no absorption, no
    bubbles, a tensor tree) and ends at the tables. For each step: its effect on transmission, on the width of
    the lobe and on the background beyond 40 degrees of deflection, with an interval.
    """
    from specularia import analysis, gonio
    from specularia.analysis.explain import POWER
    from specularia.files import make_folder
    from specularia.glass import Patch, read_slab
    from specularia.report import figures

    grown = [n for n in analysis.STEPS if n in POWER]
    given = named_numbers(unsure, names=grown, form="STEP=SHARE", option="--unsure")
    errors = {name: share for name, (share,) in given.items()}
    steps = None if order is None else [s.strip() for s in order.split(",") if s.strip()]
    for name in steps or ():
        if name not in analysis.STEPS:
            raise typer.BadParameter(
                f"{name!r} is no step; there are {', '.join(analysis.STEPS)}", param_hint="--order"
            )
    with session(quiet=quiet):
        slab = read_slab(glass, seed=seed)
        measured = [t for file in tables for t in gonio.read(file)]
        make_folder(output)
        found = analysis.explain(
            slab,
            measured,
            published=analysis.Published(Patch(patch, "clear"), resolution),
            order=steps,
            unsure=errors,
            aperture_deg=aperture,
            paths=paths,
            seed=seed,
            wavelength_nm=wavelength,
        )
        picture = figures.budget(found, output / "budget.png")
    share = found.remainder[:, 0] / found.measured[:, 0]
    payload = {
        "theta_deg": found.theta_deg,
        "quantities": ["tau", "width_deg", "background"],
        "start": found.start,
        "measured": found.measured,
        "steps": [
            {
                "name": s.name,
                "present": s.present,
                "before": s.before,
                "after": s.after,
                "effect": s.effect,
                "half_width_95": s.half_width,
            }
            for s in found.steps
        ],
        "swapped": [
            {"name": s.name, "effect": s.effect, "half_width_95": s.half_width} for s in found.swapped
        ],
        "remainder": found.remainder,
        "remainder_half_width_95": found.remainder_half_width,
        "remainder_over_tau": share,
        "l1": found.l1,
        "l1_noise": found.l1_noise,
        "l1_remainder": found.l1_remainder,
        "figure": picture.resolve(),
        "numbers": picture.with_suffix(".csv").resolve(),
    }
    header = ["effect on tau", *(f"{t:g}" for t in found.theta_deg)]
    rows: list[list[object]] = [["Model C, published", *map(float, found.start[:, 0])]]
    for s in found.steps:
        rows.append([s.name if s.present else f"{s.name} (none known)", *map(float, s.effect[:, 0])])
        rows.append(["  +- (95 %)", *map(float, s.half_width[:, 0])])
    rows.append(["unexplained", *map(float, found.remainder[:, 0])])
    rows.append(["  +- (95 %)", *map(float, found.remainder_half_width[:, 0])])
    rows.append(["measured", *map(float, found.measured[:, 0])])
    rows.append(["L1 of the last state", *map(float, found.l1)])
    rows.append(["  of the noise alone", *map(float, found.l1_noise)])
    rows.append(["  less the noise", *map(float, found.l1_remainder)])
    for s in found.swapped:
        rows.append([f"{s.name}, in the other order", *map(float, s.effect[:, 0])])
    emit(payload, as_json=as_json, lines=[*table(header, rows), f"figure: {picture}"])
