"""Stages table_1 and dsf: measured, modelled and computed side by side."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from specularia.study.stages.blocks import drawn_table, figure, text
from specularia.study.stages.models import read_models

if TYPE_CHECKING:
    from specularia.bsdf import TabulatedModel
    from specularia.study.engine import Work

__all__ = ["dsf", "table_1"]

SIDE = "transmission_front"
CUSTOMARY_DEG = (0.0, 20.0, 40.0, 60.0, 82.5)
"""Angles of incidence where nothing was measured."""


def _transmitting(work: Work) -> dict[str, TabulatedModel]:
    """The models that can answer for transmission; one of reflection tables alone cannot."""
    return {name: model for name, model in read_models(work).items() if SIDE in model.sides}


def _nothing_to_compare(work: Work) -> dict[str, Any]:
    """What a stage says where no model is of transmission."""
    return {
        "synthetic": any(work.summary(name)["synthetic"] for name in work.results),
        "blocks": [text("No model of this study is of transmission, so there is nothing to compare here.")],
    }


def table_1(work: Work) -> Mapping[str, Any]:
    """Direct-hemispherical transmission of the measurement, the models and a clear slab."""
    import numpy as np

    from specularia import analysis
    from specularia.glass.closed_form import flat_slab
    from specularia.report import figures, tables

    models = _transmitting(work)
    if not models:
        return _nothing_to_compare(work)
    given = work.parameters
    points = (
        [p for p in work.summary("measured")["integrals"] if p["side"] == SIDE]
        if "measured" in work.results
        else []
    )
    points.sort(key=lambda p: p["theta_deg"])
    measured = None
    if points:
        measured = analysis.TauPoints(
            theta_deg=np.array([p["theta_deg"] for p in points]),
            tau=np.array([p["value"] for p in points]),
            se=np.array([p["se"] for p in points]),
            band=points[0]["band"],
        )
    theta = np.unique(measured.theta_deg) if measured is not None else np.array(CUSTOMARY_DEG)
    slab = {"index": given["index"], "thickness_mm": given["thickness_mm"]}
    result = analysis.table_1(measured, models, theta, side=SIDE, **slab)
    csv = analysis.write_table_1(result, work.folder / "table_1.csv")
    synthetic = any(work.summary(name)["synthetic"] for name in work.results)
    light = f"{given['wavelength_nm']:g} nm"
    caption = (
        f"Direct-hemispherical transmission at {result.band}, light arriving on the front, with standard "
        "errors (of noise for the measurement and the model fitted to it, of tracing for a traced one; not "
        "those of what is put into a model), and ratios to the measurement. Clear slab: two parallel smooth "
        f"faces of index {given['index']:.4g} at {light} without absorption, all reflections between them, "
        "polarisation kept, in closed form. * beyond the last angle of the model's data."
    )
    fine = np.linspace(0.0, 89.5, 180)
    curve = flat_slab(fine, index=given["index"], absorption_per_mm=0.0, thickness_mm=given["thickness_mm"])[
        0
    ]
    picture = figures.tau_curves(
        models,
        work.folder / "tau.png",
        measured=measured,
        slab=(fine, curve),
        side=SIDE,
        synthetic=synthetic,
    )
    drawn = (
        "Direct-hemispherical transmission over the angle of incidence: models as lines, dashed where they "
        "are extrapolated, measured values with two standard errors, the clear slab in grey."
    )
    return {
        "synthetic": synthetic,
        "theta_deg": result.theta_deg,
        "rows": dict(zip(result.rows, result.tau)),
        "ratio": dict(zip(result.rows, result.ratio)),
        "blocks": [
            drawn_table(
                tables.transmission_table(result, caption), synthetic=synthetic, csv=csv.name, like="Table 1"
            ),
            figure(picture, drawn, synthetic=synthetic),
        ],
    }


def dsf(work: Work) -> Mapping[str, Any]:
    """Draw the distributions of the models side by side."""
    from specularia.report import figures

    models = _transmitting(work)
    if not models:
        return _nothing_to_compare(work)
    theta = work.parameters["theta_deg"]
    synthetic = any(work.summary(name)["synthetic"] for name in work.results)
    angles = ", ".join(f"{t:g}" for t in theta)
    # The lobe of a healed pane is a dot in a hemisphere, and the others would be dark beside it.
    wide = {name: m for name, m in models.items() if name != "H"} or models
    picture = figures.dsf(wide, theta, work.folder / "dsf.png", side=SIDE, synthetic=synthetic)
    order = "from top to bottom of" if len(wide) > 1 else "of"
    caption = (
        f"Differential scattering function, {order} Model {', '.join(wide)}, at θᵢ = {angles}°, seen from "
        "the front, on one logarithmic scale of five decades. The cross marks where undeflected light "
        "leaves; each pixel is a mean over its solid angle."
        + (" An angle that was not measured is interpolated by Model M." if "M" in wide else "")
        + (
            " Model H is left to the next figure: its lobe is too narrow for this one."
            if wide != models
            else ""
        )
    )
    blocks = [figure(picture, caption, synthetic=synthetic, like="Fig. 9")]
    cut = figures.sections(models, theta, work.folder / "sections.png", side=SIDE, synthetic=synthetic)
    caption = (
        f"All models in the plane of incidence, θᵢ = {angles}°; undeflected light leaves at "
        "-θᵢ. What flickers in a traced model is the noise of its paths."
    )
    blocks.append(figure(cut, caption, synthetic=synthetic))
    return {"synthetic": synthetic, "blocks": blocks}
