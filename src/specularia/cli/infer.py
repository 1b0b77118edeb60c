"""`specularia infer`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from specularia.cli._common import Json, Quiet, Seed, emit, named_numbers, session, table

__all__ = ["infer"]


def infer(
    glass: Annotated[
        Path,
        typer.Argument(metavar="GLASS.toml", help="The pane: maps, index, thickness; what is known."),
    ],
    tables: Annotated[list[Path], typer.Argument(metavar="TABLE...", help="Measured tables of the pane.")],
    output: Annotated[Path, typer.Option("-o", "--output", metavar="DIR", help="Folder of the results.")],
    seek: Annotated[
        str | None,
        typer.Option(
            "--seek",
            metavar="NAME,...",
            help="What to infer: absorption_per_mm, bubbles_per_cm3, bubble_diameter_mm, bubble_elongation, "
            "micro_slope_front, micro_slope_back; and thickness_mm. Without it all but the last.",
        ),
    ] = None,
    prior: Annotated[
        list[str] | None,
        typer.Option(
            "--prior",
            metavar="NAME=MEDIAN,SIGMA",
            help="A lognormal prior in place of the built-in one; SIGMA is of the natural logarithm.",
        ),
    ] = None,
    scale_error: Annotated[
        float, typer.Option("--scale-error", min=0.0, help="Relative error of the tables' common scale.")
    ] = 0.005,
    aperture: Annotated[
        float, typer.Option("--aperture-deg", help="Full width at half maximum of the instrument's response.")
    ] = 0.3,
    hold_out: Annotated[
        bool, typer.Option("--hold-out/--no-hold-out", help="Predict each inner angle from the others.")
    ] = True,
    paths: Annotated[int, typer.Option("--paths", min=1000, help="For each trace and angle.")] = 160_000,
    wavelength: Annotated[float, typer.Option("--wavelength", help="Of the light, nm.")] = 520.0,
    seed: Seed = 0,
    as_json: Json = False,
    quiet: Quiet = False,
) -> None:
    """Infer absorption, bubbles and the finest relief of a pane from its maps and measured tables.

    The whole distribution is compared, not transmission alone. Writes samples of the posterior, a table with
    intervals, a figure with all pairs, and says which numbers the data cannot tell apart.
    """
    import numpy as np

    from specularia import analysis, gonio
    from specularia.files import atomic, make_folder
    from specularia.glass import read_slab
    from specularia.glass.write_settings import write_inferred
    from specularia.report import figures

    known = (*analysis.PARAMETERS, "thickness_mm")
    given = named_numbers(prior, names=known, form="NAME=MEDIAN,SIGMA", option="--prior")
    priors = {name: analysis.Prior(*both) for name, both in given.items()}
    names = analysis.PARAMETERS if seek is None else tuple(s.strip() for s in seek.split(",") if s.strip())
    for name in names:
        if name not in known:
            raise typer.BadParameter(f"{name!r} is none of {', '.join(known)}", param_hint="--seek")
    with session(quiet=quiet):
        slab = read_slab(glass, seed=seed)
        measured = [t for file in tables for t in gonio.read(file)]
        make_folder(output)
        found = analysis.infer(
            slab,
            measured,
            seek=names,
            priors=priors,
            scale_error=scale_error,
            hold_out=hold_out,
            aperture_deg=aperture,
            paths=paths,
            seed=seed,
            wavelength_nm=wavelength,
        )
        picture = figures.posterior(found, output / "posterior.png")
        samples = output / "samples.csv"
        with atomic(samples) as temporary:
            columns = np.column_stack([found.samples, found.discrepancy])
            head = ",".join([*found.names, "discrepancy"])
            np.savetxt(temporary, columns, fmt="%.6g", delimiter=",", header=head, comments="")
        said = "Medians of what specularia infer found; see samples.csv for how sure they are."
        pane = write_inferred(
            glass,
            output / "glass.toml",
            {n: found.interval(n)[0] for n in found.names},
            comment=f"synthetic\n{said}" if found.synthetic else said,
        )
    rows: list[list[object]] = []
    parameters = []
    for name in found.names:
        mid, low, high = found.interval(name)
        rows.append([name, mid, low, high, found.priors[name].median, found.priors[name].sigma])
        parameters.append(
            {
                "name": name,
                "median": mid,
                "low_95": low,
                "high_95": high,
                "prior_median": found.priors[name].median,
                "prior_sigma_ln": found.priors[name].sigma,
                "at_edge": name in found.at_edge,
                "open": name in found.open,
            }
        )
    column = found.bubble_column_per_cm2
    payload = {
        "parameters": parameters,
        "correlation": found.correlation,
        "cannot_tell_apart": [{"a": a, "b": b, "correlation": c} for a, b, c in found.twins],
        "bubble_column_per_cm2": None if column is None else np.quantile(column, [0.5, 0.025, 0.975]),
        "thickness_mm": found.thickness_mm,
        "discrepancy": float(np.median(found.discrepancy)),
        "emulator_error": found.emulator_error,
        "held_out": [vars(h) for h in found.held_out],
        "figure": picture.resolve(),
        "samples": samples.resolve(),
        "glass": pane.resolve(),
    }
    lines = table(["parameter", "median", "2.5 %", "97.5 %", "prior median", "prior sigma"], rows)
    lines += [
        f"the data say little of {name}: the interval is nearly that of the prior" for name in found.open
    ]
    lines += [f"{name}: the interval reaches the end of what was traced" for name in found.at_edge]
    lines += [f"{a} and {b} are not told apart (correlation {c:+.2f})" for a, b, c in found.twins]
    said = f"{glass.name} says {found.thickness_mm:g} mm"
    lines.append(f"absorption and bubbles are known only times the thickness; {said}")
    for h in found.held_out:
        verdict = "inside" if h.low <= h.measured <= h.high else "outside"
        lines.append(
            f"{h.theta_deg:g} degrees, left out: predicted {h.predicted:.4f} ({h.low:.4f} to {h.high:.4f}), "
            f"measured {h.measured:.4f}, {verdict}"
        )
    emit(payload, as_json=as_json, lines=[*lines, f"figure: {picture}"])
