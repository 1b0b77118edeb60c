"""Stages explain and infer: why Model C and the measurement differ, and what the glass is like."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from specularia.study.stages.blocks import figure, table, text, with_error
from specularia.study.stages.measured import read_tables
from specularia.study.stages.models import with_faces

if TYPE_CHECKING:
    from specularia.analysis import Budget, Inferred
    from specularia.study.engine import Work

__all__ = ["explain", "infer"]


def explain(work: Work) -> Mapping[str, Any]:
    """Go from Model C as published to the measured tables, one cause at a time."""
    from specularia import analysis
    from specularia.glass import Patch, read_slab
    from specularia.report import figures

    given = work.parameters
    found = analysis.explain(
        with_faces(work, read_slab(work.file("settings"), seed=given["seed"])),
        read_tables(work),
        published=analysis.Published(Patch(given["patch_mm"], "clear"), given["resolution"]),
        order=given["order"],
        unsure=given["unsure"],
        aperture_deg=given["aperture_deg"],
        paths=given["paths"],
        seed=given["seed"],
        wavelength_nm=given["wavelength_nm"],
    )
    picture = figures.budget(found, work.folder / "budget.png")
    drawn = (
        "Error budget: from Model C as published (a patch of "
        f"{given['patch_mm']:g} mm with clear sides, s and p averaged, neither absorption nor bubbles, a "
        f"tensor tree of resolution {given['resolution']}) to the measured tables, one cause at a time. "
        "Transmission; width of the lobe, twice the deflection within which half of the light leaves; and "
        "background, the share deflected by more than 40°. Bars run from before a step to after it, lines "
        "are its 95 % interval; grey: nothing of the kind is known of the pane, or what stays unexplained. "
        f"{given['paths']:,} traced paths for each state and angle."
    )
    caption = (
        "The error budget of the direct-hemispherical transmission: effect of each step with the half-width "
        "of its 95 % interval, which holds tracing and what is stated as unsure of the pane. Effects depend "
        "on the order of the steps; the two largest are also given in the other order. The last lines "
        "compare whole distributions: the L1 distance of the last state from the table over its "
        "transmission, and what noise alone would give. File: budget.csv holds lobe width and background "
        "as well."
    )
    rows, numbers = _budget_rows(found)
    angles = [f"{t:g}" for t in found.theta_deg]
    columns = ["line", *(f"value_{t}_deg" for t in angles), *(f"half_width_95_{t}_deg" for t in angles)]
    return {
        "synthetic": found.synthetic,
        "theta_deg": found.theta_deg.tolist(),
        "effect": {s.name: s.effect[:, 0].tolist() for s in found.steps},
        "remainder": found.remainder[:, 0].tolist(),
        "blocks": [
            figure(picture, drawn, synthetic=found.synthetic),
            table(
                work.folder / "budget_transmission.csv",
                ["effect on τ", *(f"{t}°" for t in angles)],
                rows,
                caption,
                numbers=(columns, numbers),
                synthetic=found.synthetic,
            ),
        ],
    }


def _budget_rows(found: Budget) -> tuple[list[list[str]], list[list[Any]]]:
    """The table of the budget: as it is shown, and in full."""
    import numpy as np

    from specularia.report.figures.budget import LABELS

    none = np.full(found.theta_deg.size, np.nan)
    lines: list[tuple[str, Any, Any, bool]] = [
        ("Model C, published", found.start[:, 0], 1.96 * found.start_se[:, 0], False)
    ]
    for s in found.steps:
        words = LABELS[s.name] + ("" if s.present else " (none known)")
        lines.append((words, s.effect[:, 0], s.half_width[:, 0], True))
    lines += [
        ("unexplained", found.remainder[:, 0], found.remainder_half_width[:, 0], True),
        ("measured", found.measured[:, 0], 1.96 * found.measured_se[:, 0], False),
        *(
            (f"{LABELS[s.name]}, in the other order", s.effect[:, 0], s.half_width[:, 0], True)
            for s in found.swapped
        ),
        ("L1 distance of the last state", found.l1, none, False),
        ("L1 distance by noise alone", found.l1_noise, none, False),
    ]
    rows = [
        [words, *((("+" if sign and v >= 0 else "") + with_error(v, h)) for v, h in zip(value, half))]
        for words, value, half, sign in lines
    ]
    numbers = [[words, *value.tolist(), *half.tolist()] for words, value, half, _ in lines]
    return rows, numbers


def infer(work: Work) -> Mapping[str, Any]:
    """Infer absorption, bubbles and the finest relief of the pane from its maps and tables."""
    from specularia import analysis
    from specularia.files import write_csv
    from specularia.glass import read_slab
    from specularia.glass.write_settings import write_inferred
    from specularia.report import figures

    given = work.parameters
    settings = work.file("settings")
    found = analysis.infer(
        with_faces(work, read_slab(settings, seed=given["seed"])),
        read_tables(work),
        seek=given["seek"] or analysis.PARAMETERS,
        priors={name: analysis.Prior(*prior) for name, prior in given["priors"].items()},
        scale_error=given["scale_error"],
        hold_out=given["hold_out"],
        aperture_deg=given["aperture_deg"],
        paths=given["paths"],
        seed=given["seed"],
        wavelength_nm=given["wavelength_nm"],
    )
    picture = figures.posterior(found, work.folder / "posterior.png")
    write_csv(
        work.folder / "samples.csv",
        [*found.names, "discrepancy"],
        [[*sample, d] for sample, d in zip(found.samples.tolist(), found.discrepancy.tolist())],
    )
    write_inferred(
        settings,
        work.folder / "glass.toml",
        {n: found.interval(n)[0] for n in found.names},
        comment="Medians of what was inferred; see samples.csv for how sure they are."
        + ("\nsynthetic" if found.synthetic else ""),
    )
    drawn = (
        "What the measured tables say of the glass between these faces: on the diagonal the posterior of "
        "each parameter (blue) over its prior (black), with median and 95 % interval; below it each pair "
        "with the correlation of the logarithms. The whole distribution is compared, in cells of "
        f"deflection; {given['paths']:,} paths for each trace and angle, sampled by emcee "
        "(doi:10.1086/670067). Absorption and bubbles are known only times the thickness, stated as "
        f"{found.thickness_mm:g} mm."
    )
    blocks = [figure(picture, drawn, synthetic=found.synthetic), _parameters(work, found)]
    if found.held_out:
        blocks.append(_held_out(work, found))
    blocks.append(text(_warnings(found)))
    return {
        "synthetic": found.synthetic,
        "parameters": {n: list(found.interval(n)) for n in found.names},
        "blocks": blocks,
    }


def _parameters(work: Work, found: Inferred) -> dict[str, Any]:
    """Median, interval and prior of each parameter."""
    import numpy as np

    numbers: list[list[Any]] = [
        [n, *found.interval(n), found.priors[n].median, found.priors[n].sigma] for n in found.names
    ]
    column = found.bubble_column_per_cm2
    if column is not None:
        low, mid, high = (float(v) for v in np.quantile(column, [0.025, 0.5, 0.975]))
        numbers.append(["bubbles per cm² of the pane", mid, low, high, None, None])
    return table(
        work.folder / "inferred.csv",
        ["parameter", "median", "95 % from", "95 % to", "prior median", "prior σ of ln"],
        [[n, *("–" if v is None else f"{v:.4g}" for v in values)] for n, *values in numbers],
        "Posterior and lognormal prior of each parameter: median and the ends of the 95 % interval. "
        "Files: samples.csv, and glass.toml, the pane with the medians.",
        numbers=(["parameter", "median", "low_95", "high_95", "prior_median", "prior_sigma_ln"], numbers),
        synthetic=found.synthetic,
    )


def _held_out(work: Work, found: Inferred) -> dict[str, Any]:
    """Light at angles that were left out."""
    rows = [
        [
            f"{h.theta_deg:g}",
            with_error(h.measured, h.measured_se),
            f"{h.predicted:.4f}",
            f"{h.low:.4f} to {h.high:.4f}",
            "inside" if h.low <= h.measured <= h.high else "outside",
        ]
        for h in found.held_out
    ]
    columns = ["theta_i_deg", "measured", "standard_error", "predicted", "low_95", "high_95"]
    numbers = [[getattr(h, n) for n in _HELD_OUT] for h in found.held_out]
    return table(
        work.folder / "held_out.csv",
        ["θᵢ (°)", "measured", "predicted", "95 % interval", "measured is"],
        rows,
        "Each inner angle left out in turn: transmitted light in the cells of deflection that are compared, "
        "over the incident light (less than τ where other cells are too dim), predicted by panes inferred "
        "from the other angles.",
        numbers=(columns, numbers),
        synthetic=found.synthetic,
    )


_HELD_OUT = ("theta_deg", "measured", "measured_se", "predicted", "low", "high")


def _warnings(found: Inferred) -> str:
    """What the data cannot tell, in words."""
    said = [f"The data say little of {n}: its interval is nearly that of the prior." for n in found.open]
    said += [f"{name}: the interval reaches the end of what was traced." for name in found.at_edge]
    said += [f"{a} and {b} are not told apart (correlation {c:+.2f})." for a, b, c in found.twins]
    return " ".join(said) or "No parameter is left open by the data, and no two are taken for each other."
