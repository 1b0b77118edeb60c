"""Stage fragment: the specimen over a printed sheet, seen through each model."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from specularia.study.stages.blocks import figure, table
from specularia.study.stages.models import read_models

if TYPE_CHECKING:
    from specularia.study.engine import Work

__all__ = ["fragment"]


def fragment(work: Work) -> Mapping[str, Any]:
    """Lay the specimen over print, look through each model, and say how the contrast fades with the gap."""
    from specularia import daylight
    from specularia.jobs import load_toml
    from specularia.report import figures

    models = read_models(work)
    synthetic = any(work.summary(name)["synthetic"] for name in work.results)
    given = work.files("settings")
    job = load_toml(given[0], daylight.FragmentJob) if given else daylight.FragmentJob()
    seen = daylight.look_through(job, models=models)
    picture = figures.fragment_pictures(
        seen.pictures,
        work.folder / "fragment.png",
        invented=seen.synthetic_outline,
        synthetic=synthetic,
    )
    stroke = seen.job.sheet.stroke_mm
    curve = figures.contrast_over_gap(
        seen.contrast, work.folder / "contrast.png", stroke_mm=stroke, synthetic=synthetic
    )
    light, sheet = seen.job.light, seen.job.sheet
    lamp = (
        f" and a lamp of {light.lamp_lx:,.0f} lx, {light.lamp_elevation_deg:g}° above the table"
        if light.lamp_lx
        else ""
    )
    silent = [c.model for c in seen.contrast if not c.reflects]
    caption = (
        "The specimen over a printed sheet, seen from above through each model, on one scale of luminance. "
        f"The sheet reflects {sheet.paper:g} (paper) and {sheet.ink:g} (ink) under an even hemisphere of "
        f"{light.diffuse_lx:,.0f} lx{lamp}; light between sheet and glass goes back and forth. Computed by "
        "convolution with the light that each model sends where, the same all over the piece; as noisy as "
        "the model, and no more." + (" The outline is invented." if seen.synthetic_outline else "")
    )
    if silent:
        names = " and ".join(f"Model {m}" for m in silent)
        caption += f" {names} holds no reflection, so none is seen."
    rows = [
        [f"Model {c.model}", f"{gap:g}", f"{c.at(gap):.3f}", f"{c.bare:.3f}"]
        for c in seen.contrast
        for gap in seen.job.gap_mm
    ]
    numbers = [[c.model, gap, c.at(gap), c.bare] for c in seen.contrast for gap in seen.job.gap_mm]
    return {
        "synthetic": synthetic,
        "blocks": [
            figure(picture, caption, synthetic=synthetic, like="Fig. 10"),
            figure(
                curve,
                f"Michelson contrast of bars of {stroke:g} mm under the middle of the glass over the gap "
                "between sheet and glass, exact in one dimension. Dashed: without what the top reflects; "
                "dotted: without glass.",
                synthetic=synthetic,
            ),
            table(
                work.folder / "contrast_at_gaps.csv",
                ["through", "gap (mm)", "contrast", "without glass"],
                rows,
                f"Michelson contrast of bars of {stroke:g} mm at the gaps that are drawn.",
                numbers=(["model", "gap_mm", "contrast", "contrast_bare"], numbers),
                synthetic=synthetic,
            ),
        ],
    }
