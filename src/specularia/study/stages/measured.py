"""Stages measured and model_m: the tables of the gonio-photometer, and the model fitted to them."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from specularia.study.stages.blocks import figure, table, text, with_error

if TYPE_CHECKING:
    from specularia.gonio import Table
    from specularia.study.engine import Work

__all__ = ["measured", "model_m", "read_tables"]

_PANELS = 6
"""Measured distributions drawn at most."""


def read_tables(work: Work) -> list[Table]:
    """All tables of the study, in the order of their files; a file may hold both hemispheres."""
    from specularia import gonio

    given = work.parameters.get("gonio", work.parameters)
    said = {key: given[key] for key in ("quantity", "side", "wavelength_nm")}
    return [part for file in work.files("tables") for part in gonio.read(file, **said)]


def measured(work: Work) -> Mapping[str, Any]:
    """Integrate the tables, say what each holds and draw those of transmitted light."""
    from specularia import gonio
    from specularia.report import figures

    summaries = [gonio.summarise(t) for t in read_tables(work)]
    tables = [s.table for s in summaries]
    synthetic = any(t.synthetic for t in tables)
    bands = ", ".join(sorted({t.band for t in tables}))
    rows = [
        [
            s.table.label,
            f"{s.table.quantity}, {s.table.side.replace('_', ' ')}",
            f"{s.table.theta_i_deg:g}, {s.table.phi_i_deg:g}",
            f"{s.points:,}",
            f"{100 * s.coverage:.1f} %",
            with_error(s.tau, s.tau_se),
        ]
        for s in summaries
    ]
    header = ["file", "holds", "θᵢ, φᵢ (°)", "points", "coverage", "τ or ρ"]
    caption = (
        f"The measured tables ({bands}) and their direct-hemispherical integrals with the standard error of "
        "their noise, from the points themselves. Incident directions as in the files; coverage is of the "
        "projected hemisphere."
    )
    columns = [
        "file",
        "quantity",
        "side",
        "theta_i_deg",
        "phi_i_deg",
        "points",
        "coverage_percent",
        "tau_or_rho",
        "standard_error",
    ]
    numbers = [
        [
            s.table.label,
            s.table.quantity,
            s.table.side,
            s.table.theta_i_deg,
            s.table.phi_i_deg,
            s.points,
            100 * s.coverage,
            s.tau,
            s.tau_se,
        ]
        for s in summaries
    ]
    csv = work.folder / "measured_tables.csv"
    blocks = [table(csv, header, rows, caption, numbers=(columns, numbers), synthetic=synthetic)]
    remarks = [f"{s.table.label}: {'; '.join(s.warnings)}." for s in summaries if s.warnings]
    if remarks:
        blocks.append(text("What reading the tables brought up:", remarks))
    shown = ([t for t in tables if t.kind == "transmission"] or tables)[:_PANELS]
    picture = figures.measured_dsf(shown, work.folder / "measured_dsf.png", synthetic=synthetic)
    angles = ", ".join(f"{t.theta_i_deg:g}" for t in shown)
    caption = (
        f"Measured differential scattering function at θᵢ = {angles}°, seen from the front, on "
        "one logarithmic scale of five decades: the points as they lie, neither cleaned nor interpolated. "
        "Hatched: no data. The cross marks where undeflected light leaves."
    )
    blocks.append(figure(picture, caption, synthetic=synthetic, like="Fig. 6"))
    return {
        "synthetic": synthetic,
        "integrals": [
            {
                "side": s.table.side,
                "band": s.table.band,
                "theta_deg": s.table.polar_deg,
                "value": s.tau,
                "se": s.tau_se,
            }
            for s in summaries
        ],
        "blocks": blocks,
    }


def model_m(work: Work) -> Mapping[str, Any]:
    """Fit Model M to the tables; write it for this package (model.nc) and for Radiance (model.xml)."""
    from specularia import gonio
    from specularia.study.stages.models import write_model

    tables = read_tables(work)
    return write_model(work, "M", gonio.fit(tables), synthetic=any(t.synthetic for t in tables))
