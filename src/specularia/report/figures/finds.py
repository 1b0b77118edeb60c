"""Finds by colour (the paper's Fig. 3) and on the plan of the site (Fig. 2)."""

from __future__ import annotations

from dataclasses import astuple, fields
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import matplotlib as mpl
import numpy as np
from matplotlib import patheffects
from matplotlib.axes import Axes
from matplotlib.colors import PowerNorm
from matplotlib.patches import PathPatch
from matplotlib.path import Path as Outline
from numpy.typing import NDArray

from specularia.finds.tables_out import neutral
from specularia.report import style

if TYPE_CHECKING:
    from specularia.finds import Area, Plan, Summary

__all__ = ["finds_by_colour", "finds_on_plan"]

Array = NDArray[np.float64]

_GLASS: Final = {
    "yellow": "#d9b43c",
    "brown": "#8a5a2b",
    "amber": "#b9752a",
    "olive": "#8b8b3a",
    "green": "#5f9a63",
    "aqua": "#7cc0bd",
    "blue": "#4f7fb5",
    "purple": "#7d5a94",
    "colourless": "#e6e9ea",
}
"""Fill of a bar by a word in the name of its colour group; others are grey."""


def finds_by_colour(summary: Summary, path: str | Path) -> Path:
    """Draw the share of fragments and the share of weight of each colour group (the paper's Fig. 3).

    Parameters
    ----------
    summary : of a table of finds; a synthetic one labels the figure.
    path : PNG to write; a CSV of the same name gets the columns colour, count, weight_g, count_share,
        weight_share, and the ends of their 95 % intervals, which the lines on the bars show.

    Returns
    -------
    path of the PNG.
    """
    groups = summary.groups["colour"]
    style.write_csv(
        Path(path).with_suffix(".csv"),
        ("colour", *[f.name for f in fields(groups[0])][1:]),
        [(neutral(g.name), *astuple(g)[1:]) for g in groups],
    )
    place = np.arange(len(groups), dtype=float)
    with style.canvas(5.6, 0.42 * len(groups) + 1.15) as figure:
        left, right = figure.subplots(1, 2, sharey=True)
        parts: tuple[tuple[Axes, list[float], list[tuple[float, float]], list[str], str], ...] = (
            (
                left,
                [g.count_share for g in groups],
                [(g.count_low, g.count_high) for g in groups],
                [f"{g.count:,}" for g in groups],
                f"(a)  fragments, total {summary.total_count:,}",
            ),
            (
                right,
                [g.weight_share for g in groups],
                [(g.weight_low, g.weight_high) for g in groups],
                [f"{g.weight_g / 1000:,.2f} kg" for g in groups],
                f"(b)  weight, total {summary.total_weight_g / 1000:,.2f} kg",
            ),
        )
        top = max(max(*shares, *(high for _, high in ends)) for _, shares, ends, _, _ in parts)
        for axes, shares, ends, labels, title in parts:
            axes.barh(
                place,
                [100 * s for s in shares],
                height=0.68,
                color=[_fill(g.name) for g in groups],
                edgecolor="#444444",
                linewidth=0.5,
            )
            for y, share, (low, high), label in zip(place, shares, ends, labels):
                axes.plot(
                    [100 * low, 100 * high], [y, y], color="#222222", linewidth=0.9, marker="|", markersize=4
                )
                axes.annotate(
                    f"{100 * share:.1f} %  ({label})",
                    (100 * max(share, high), y),
                    xytext=(3, 0),
                    textcoords="offset points",
                    va="center",
                    fontsize=6.5,
                )
            axes.set(xlim=(0, 100 * top * 1.55), xlabel="share (%), 95 % interval")
            axes.set_title(title, loc="left")
            axes.tick_params(axis="y", length=0)
        left.set_yticks(place, [g.name for g in groups])
        left.invert_yaxis()
        return style.save(figure, path, synthetic=summary.synthetic)


def finds_on_plan(summary: Summary, plan: Plan, path: str | Path, *, kind: str = "room") -> Path:
    """Draw the density of finds on the plan: fragments and grams per m2 (the paper's Fig. 2).

    Colours follow the square root of the density, so that sparse areas can be told apart beside a rich one;
    areas without finds are white.

    Parameters
    ----------
    summary : made with this plan; a synthetic one labels the figure.
    plan : outlines in metres; north is not implied.
    path : PNG to write; a CSV of the same name gets the columns of `finds.Density`.
    kind : "room" or "square": which areas carry the density; rooms are always outlined.

    Returns
    -------
    path of the PNG.
    """
    rows = {d.name: d for d in summary.density[kind]}
    style.write_csv(
        Path(path).with_suffix(".csv"),
        (kind, "area_m2", "count", "weight_g", "count_per_m2", "weight_g_per_m2"),
        [
            (neutral(d.name), d.area_m2, d.count, d.weight_g, d.count_per_m2, d.weight_g_per_m2)
            for d in rows.values()
        ],
    )
    points = np.concatenate([rings[0] for a in plan.areas for rings in a.polygons])
    (x0, y0), (x1, y1) = points.min(axis=0), points.max(axis=0)
    width = 3.3
    height = float(np.clip(width * (y1 - y0) / (x1 - x0), 1.6, 5.0))
    with style.canvas(2 * width + 0.6, height + 0.75) as figure:
        parts = (("count_per_m2", "fragments", "fragments per m²"), ("weight_g_per_m2", "weight", "g per m²"))
        for k, (axes, (attribute, title, unit)) in enumerate(zip(figure.subplots(1, 2), parts)):
            values = {n: getattr(d, attribute) for n, d in rows.items()}
            top = max(values.values()) or 1.0
            norm = PowerNorm(0.5, 0.0, top)
            colours = mpl.colormaps["YlGnBu"]
            for area in plan.of_kind(kind):
                value = values[area.name]
                axes.add_patch(
                    PathPatch(
                        _outline(area),
                        facecolor=colours(norm(value)) if value > 0 else "white",
                        edgecolor="#555555",
                        linewidth=0.4,
                    )
                )
            for area in plan.of_kind("room"):
                axes.add_patch(PathPatch(_outline(area), facecolor="none", edgecolor="black", linewidth=1.0))
                x, y = _middle(area)
                axes.text(
                    x,
                    y,
                    area.name,
                    fontsize=6,
                    ha="center",
                    va="center",
                    color="black",
                    path_effects=[patheffects.withStroke(linewidth=1.4, foreground="white")],
                )
            margin = 0.02 * max(x1 - x0, y1 - y0)
            axes.set(
                xlim=(x0 - margin, x1 + margin),
                ylim=(y0 - margin, y1 + margin),
                aspect="equal",
                xlabel="x (m)",
                ylabel="y (m)" if k == 0 else "",
            )
            axes.set_title(f"{style.letter(k)}  {title}", loc="left")
            bar = figure.colorbar(
                mpl.cm.ScalarMappable(norm, colours),
                ax=axes,
                orientation="horizontal",
                aspect=30,
                pad=0.03,
                shrink=0.8,
            )
            bar.set_ticks(_ticks(top))
            bar.set_label(unit)
        return style.save(figure, path, synthetic=summary.synthetic)


def _ticks(top: float) -> list[float]:
    """0 and the values 1, 2 and 5 times powers of ten that a square-root scale up to `top` has room for."""
    exponents = range(int(np.floor(np.log10(top))) - 2, int(np.floor(np.log10(top))) + 1)
    values = [m * 10.0**e for e in exponents for m in (1, 2, 5)]
    return [0.0, *(v for v in values if 0.02 * top <= v <= top)]


def _fill(name: str) -> str:
    """Colour of a bar: that of the last known word in the group's name (yellow-green is green)."""
    found = sorted(
        (name.lower().rfind(word), colour) for word, colour in _GLASS.items() if word in name.lower()
    )
    return found[-1][1] if found else "#b5b5b5"


def _outline(area: Area) -> Outline:
    """All rings of an area as one path, whose holes stay open."""
    vertices: list[Any] = []
    codes: list[Any] = []
    for rings in area.polygons:
        for k, ring in enumerate(rings):
            # Holes are drawn only where they turn the other way than the outline.
            turn = np.sum(ring[:-1, 0] * ring[1:, 1] - ring[1:, 0] * ring[:-1, 1])
            vertices.append(ring if (turn > 0) == (k == 0) else ring[::-1])
            codes += [Outline.MOVETO, *[Outline.LINETO] * (len(ring) - 2), Outline.CLOSEPOLY]
    return Outline(np.concatenate(vertices), codes)


def _middle(area: Area) -> tuple[float, float]:
    """A place for the label: deep inside the area's largest polygon, there as near its middle as may be."""
    rings = max(area.polygons, key=lambda r: float(np.ptp(r[0][:, 0]) * np.ptp(r[0][:, 1])))
    outline = Outline(rings[0])
    (x0, y0), (x1, y1) = rings[0].min(axis=0), rings[0].max(axis=0)
    x, y = (v.ravel() for v in np.meshgrid(np.linspace(x0, x1, 42)[1:-1], np.linspace(y0, y1, 42)[1:-1]))
    grid = np.column_stack([x, y])
    inside = outline.contains_points(grid)
    for hole in rings[1:]:
        inside &= ~Outline(hole).contains_points(grid)
    if not inside.any():
        return float(rings[0][:, 0].mean()), float(rings[0][:, 1].mean())
    depth = np.min([_distance(grid, ring) for ring in rings], axis=0)
    depth = np.where(inside, depth, -1.0)
    off = np.hypot(x - (x0 + x1) / 2, y - (y0 + y1) / 2)
    best = int(np.argmin(np.where(depth >= 0.9 * depth.max(), off, np.inf)))
    return float(grid[best, 0]), float(grid[best, 1])


def _distance(points: Array, ring: Array) -> Array:
    """Distance of points [K, 2] to the nearest edge of a closed ring."""
    a, b = ring[:-1], ring[1:]
    along = b - a
    length2 = np.maximum(np.sum(along**2, axis=1), 1e-300)
    t = np.clip(np.einsum("kec,ec->ke", points[:, None] - a, along) / length2, 0.0, 1.0)
    nearest = a + t[..., None] * along
    return np.asarray(np.sqrt(np.sum((points[:, None] - nearest) ** 2, axis=2)).min(axis=1))
