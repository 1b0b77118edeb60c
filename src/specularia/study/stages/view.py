"""Stage view: the models in an interactive view, with the measured points."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from specularia.study.stages.blocks import view
from specularia.study.stages.measured import read_tables
from specularia.study.stages.models import read_models

if TYPE_CHECKING:
    from specularia.study.engine import Work

__all__ = ["interactive"]

_SIDES = ("transmission_front", "reflection_front")
_LARGEST_MB = 3.0
_PANELS = 3


def interactive(work: Work) -> Mapping[str, Any]:
    """Write the view of all models that goes into the page, and the picture that stands for it on paper."""
    from specularia.report import figures, viewer

    models = read_models(work)
    tables = read_tables(work) if work.parameters["gonio"] else []
    synthetic = any(work.summary(name)["synthetic"] for name in work.results if name.startswith("model_"))
    sides = [s for s in _SIDES if any(s in m.sides for m in models.values())] or None
    file = viewer.write_view(
        models,
        work.folder / "view.html",
        measured=[t for t in tables if sides is None or t.side in sides],
        sides=sides,
        largest_mb=_LARGEST_MB,
        title="Model " + ", ".join(models),
        synthetic=synthetic,
    )
    side = sides[0] if sides else next(iter(models.values())).sides[0]
    drawn = {name: m for name, m in models.items() if side in m.sides}
    found = sorted({t.polar_deg for t in tables if t.side == side and t.polar_deg < 90.0})
    theta = found[:: max(1, -(-len(found) // _PANELS))][:_PANELS] or [0.0, 40.0]
    still = figures.sections(
        drawn, theta, work.folder / "view_still.png", side=side, measured=tables, synthetic=synthetic
    )
    points = "; dots are measured points within 1° of the plane of incidence" if tables else ""
    caption = (
        f"The DSF of Model {', '.join(models)} over the incident direction{points}. Values are those of the "
        "models at fixed directions, none interpolated. A side that was not measured is made by "
        "reciprocity where the view says so. On paper: sections through the plane of incidence"
        + (" at measured angles." if found else ".")
    )
    return {"synthetic": synthetic, "blocks": [view(file, caption, still=still, synthetic=synthetic)]}
