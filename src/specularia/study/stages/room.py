"""Stage room: the lit room with each model in its window."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from specularia.study.stages.blocks import figure, table
from specularia.study.stages.models import read_models

if TYPE_CHECKING:
    from specularia.daylight import DaylightResult
    from specularia.study.engine import Work

__all__ = ["room"]


def _reading(point: Any) -> str:
    """An illuminance with its error and, where the model states one, its interval."""
    text = f"{point.illuminance_lx:,.0f} ± {point.se:.1f}"
    if point.interval_lx is None:
        return text
    return f"{text} ({point.interval_lx[0]:,.0f} to {point.interval_lx[1]:,.0f})"


_POINT = ("illuminance_lx", "standard_error_lx", "low_95_lx", "high_95_lx")


def _numbers(point: Any) -> list[float | None]:
    """The same in full, in the order of `_POINT`."""
    return [point.illuminance_lx, point.se, *(point.interval_lx or (None, None))]


def room(work: Work) -> Mapping[str, Any]:
    """Light the room through each model; illuminance at its points and luminance maps of its views."""
    from specularia import daylight
    from specularia.report import figures

    models = read_models(work)
    synthetic = any(work.summary(name)["synthetic"] for name in work.results if name.startswith("model_"))
    lit = daylight.run(
        work.file("settings"), models=models, folder=work.folder / "pictures", seed=work.parameters["seed"]
    )
    names = list(dict.fromkeys(p.model for p in lit.points))
    value = {(p.name, p.model): p for p in lit.points}
    places = list(dict.fromkeys(p.name for p in lit.points))
    rows = [[place, *(_reading(value[place, m]) for m in names)] for place in places]
    blocks = []
    for view in dict.fromkeys(i.name for i in lit.images):
        images = [i for i in lit.images if i.name == view]
        stem = "luminance_" + "".join(c if c.isalnum() else "_" for c in view)
        picture = figures.luminance_maps(
            images,
            work.folder / f"{stem}.png",
            points=lit.points,
            synthetic=synthetic,
        )
        shown = " and ".join(f"Model {i.model}" for i in images)
        caption = (
            f"Luminance (cd/m²) of the view “{view}” with {shown} in the window, on one fixed logarithmic "
            "scale, with isolines; numbers are illuminances (lx) at the named points, with standard errors "
            "in the table below."
        )
        blocks.append(figure(picture, caption, synthetic=synthetic, like="Fig. 11"))
    if rows:
        caption = (
            "Illuminance (lx) at the named points, direct and interreflected, with the standard error of the "
            "computation. In brackets the 95 % interval that the model's own uncertainty gives as well: "
            "noise of a measurement and what lies between its angles, or the spread of the transmission "
            "between members of a healed ensemble. It does not hold how far the shape of their lobes "
            "differs, which matters in the sun's patch. Sky and room are taken as known."
        )
        columns = ["point", *(f"{key}_{m}" for m in names for key in _POINT)]
        numbers = [[place, *(v for m in names for v in _numbers(value[place, m]))] for place in places]
        head = ["point", *(f"Model {m}" for m in names)]
        csv = work.folder / "illuminance.csv"
        blocks.append(table(csv, head, rows, caption, numbers=(columns, numbers), synthetic=synthetic))
    panes = [
        [p.window, f"Model {p.model}", p.view, f"{p.luminance_cd_m2:,.0f}", f"{p.exitance_lm_m2:,.0f}"]
        for p in lit.panes
    ]
    outside = "; ".join(
        dict.fromkeys(
            f"{p.window}: sun {p.sun_lx:,.0f} lx, sky and ground {p.sky_lx:,.0f} lx" for p in lit.panes
        )
    )
    header = ["window", "through", "seen", "luminance (cd/m²)", "exitance (lm/m²)"]
    caption = (
        "The panes: luminance towards the eye (or straight into the room) and light emitted into the room "
        f"per area. Illuminance on their outer side: {outside}."
    )
    columns = ["window", "model", "view", "luminance_cd_m2", "exitance_lm_m2"]
    numbers = [[p.window, p.model, p.view, p.luminance_cd_m2, p.exitance_lm_m2] for p in lit.panes]
    csv = work.folder / "panes.csv"
    blocks.append(table(csv, header, panes, caption, numbers=(columns, numbers), synthetic=synthetic))
    blocks += _grids(lit, work.folder, synthetic) + _glare(lit, work.folder, synthetic)
    return {
        "synthetic": synthetic,
        "points": [
            {
                "name": p.name,
                "model": p.model,
                "illuminance_lx": p.illuminance_lx,
                "se": p.se,
                "interval_lx": p.interval_lx,
            }
            for p in lit.points
        ],
        "blocks": blocks,
    }


def _grids(lit: DaylightResult, folder: Path, synthetic: bool) -> list[dict[str, Any]]:
    """A plan of each grid with all models on one scale."""
    from specularia.daylight import file_name
    from specularia.report import figures

    blocks = []
    for name in dict.fromkeys(g.name for g in lit.grids):
        grids = [g for g in lit.grids if g.name == name]
        path = folder / f"illuminance_{file_name(name)}.png"
        shown = " and ".join(f"Model {g.model}" for g in grids)
        factor = lit.no_daylight_factor and f" No daylight factor: {lit.no_daylight_factor}."
        caption = (
            f"Illuminance (lx) on the grid “{name}” with {shown} in the window, on one fixed logarithmic "
            f"scale, with isolux lines.{factor}"
        )
        plan = figures.illuminance_plans(grids, path, synthetic=synthetic)
        blocks.append(figure(plan, caption, synthetic=synthetic))
    return blocks


def _glare(lit: DaylightResult, folder: Path, synthetic: bool) -> list[dict[str, Any]]:
    """Daylight glare probability of the fisheye views."""
    if not lit.glare:
        return []
    rows = [
        [g.view, f"Model {g.model}", f"{g.dgp:.3f}", f"{g.vertical_illuminance_lx:,.0f}", str(g.sources)]
        for g in lit.glare
    ]
    header = ["view", "through", "DGP", "illuminance at the eye (lx)", "sources"]
    caption = (
        "Daylight glare probability by evalglare (Wienold and Christoffersen 2006), sources brighter than "
        "2,000 cd/m²."
    )
    columns = ["view", "model", "dgp", "vertical_illuminance_lx", "sources"]
    numbers = [[g.view, g.model, g.dgp, g.vertical_illuminance_lx, g.sources] for g in lit.glare]
    csv = folder / "glare.csv"
    return [table(csv, header, rows, caption, numbers=(columns, numbers), synthetic=synthetic)]
