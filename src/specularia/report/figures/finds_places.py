"""Thickness of the finds, and their smoothed density over the plan."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import matplotlib as mpl
import numpy as np
from matplotlib.colors import PowerNorm
from matplotlib.patches import PathPatch

from specularia.report import style
from specularia.report.figures.finds import _outline, _ticks

if TYPE_CHECKING:
    from specularia.finds import KernelDensity, Plan, Summary

__all__ = ["finds_density", "finds_thickness"]


def finds_thickness(summary: Summary, path: str | Path) -> Path:
    """Draw how thick the fragments are: a histogram with the mean, its interval, and the quartiles.

    Parameters
    ----------
    summary : of a table in which thickness was measured; a synthetic one labels the figure.
    path : PNG to write; a CSV of the same name gets the columns from_mm, to_mm, fragments.

    Returns
    -------
    path of the PNG.
    """
    found = summary.thickness
    if found is None:
        raise ValueError("this table has no thickness")
    edges = found.edges_mm
    style.write_csv(
        Path(path).with_suffix(".csv"),
        ("from_mm", "to_mm", "fragments"),
        list(zip(edges[:-1], edges[1:], found.count)),
    )
    with style.canvas(4.4, 2.9) as figure:
        axes = figure.subplots()
        axes.bar(
            edges[:-1],
            found.count,
            width=np.diff(edges),
            align="edge",
            color="#7cc0bd",
            edgecolor="#444444",
            linewidth=0.4,
        )
        for k, q in enumerate(found.quantiles_mm[1:4]):
            label = "quartiles" if k == 0 else None
            axes.axvline(q, color="#666666", linestyle=(0, (3, 2)), linewidth=0.9, label=label)
        axes.axvspan(found.mean_low_mm, found.mean_high_mm, color="#d1611e", alpha=0.3, linewidth=0)
        axes.axvline(found.mean_mm, color="#d1611e", linewidth=1.3, label="mean, 95 % interval")
        axes.set(xlim=(0, edges[-1] + 0.2), xlabel="thickness (mm)", ylabel="fragments")
        axes.set_title(
            f"{found.measured_count:,} fragments measured, {found.mean_mm:.2f} ± {found.sd_mm:.2f} mm (s.d.)",
            loc="left",
        )
        axes.legend(loc="upper right")
        return style.save(figure, path, synthetic=summary.synthetic)


def finds_density(density: KernelDensity, plan: Plan, path: str | Path, *, synthetic: bool = False) -> Path:
    """Draw the smoothed density of finds: fragments and grams per m2, over the plan or its picture.

    Colours follow the square root of the density, as in `finds_on_plan`.

    Parameters
    ----------
    density : made with this plan.
    plan : outlines in metres, a picture, or both.
    path : PNG to write; an NPZ of the same name gets `x_m`, `y_m`, `count_per_m2`, `weight_g_per_m2` and
        `bandwidth_m`.
    synthetic : True labels the figure.

    Returns
    -------
    path of the PNG.
    """
    arrays: dict[str, Any] = {
        name: getattr(density, name)
        for name in ("x_m", "y_m", "count_per_m2", "weight_g_per_m2", "bandwidth_m")
    }
    style.write_npz(Path(path).with_suffix(".npz"), arrays)
    x, y = density.x_m, density.y_m
    half = 0.5 * (x[1] - x[0]) if x.size > 1 else 0.5
    extent = (float(x[0] - half), float(x[-1] + half), float(y[0] - half), float(y[-1] + half))
    shown = extent if plan.picture is None else plan.picture.extent_m
    width = 3.3
    height = float(np.clip(width * (shown[3] - shown[2]) / (shown[1] - shown[0]), 1.6, 5.0))
    with style.canvas(2 * width + 0.6, height + 0.85) as figure:
        parts = (
            (density.count_per_m2, "fragments", "fragments per m²"),
            (density.weight_g_per_m2, "weight", "g per m²"),
        )
        for k, (axes, (values, title, unit)) in enumerate(zip(figure.subplots(1, 2), parts)):
            top = float(np.nanmax(values)) or 1.0
            norm = PowerNorm(0.5, 0.0, top)
            if plan.picture is not None:
                from PIL import Image

                with Image.open(plan.picture.file) as image:
                    image.thumbnail((2000, 2000))
                    drawing = np.asarray(image.convert("L"))
                axes.imshow(drawing, cmap="gray", extent=plan.picture.extent_m, interpolation="bilinear")
            axes.imshow(
                values,
                origin="lower",
                extent=extent,
                cmap="YlGnBu",
                norm=norm,
                alpha=0.6 if plan.picture is not None else 1.0,
            )
            for area in plan.areas:
                edge, line = ("black", 1.0) if area.kind == "room" else ("#777777", 0.3)
                axes.add_patch(PathPatch(_outline(area), facecolor="none", edgecolor=edge, linewidth=line))
            axes.plot(
                *density.at_m.T, linestyle="none", marker=".", markersize=1.5, color="#444444", alpha=0.5
            )
            axes.set(
                xlim=shown[:2],
                ylim=shown[2:],
                aspect="equal",
                xlabel="x (m)",
                ylabel="y (m)" if k == 0 else "",
            )
            axes.set_title(f"{style.letter(k)}  {title}, kernel of {density.bandwidth_m:.2g} m", loc="left")
            bar = figure.colorbar(
                mpl.cm.ScalarMappable(norm, mpl.colormaps["YlGnBu"]),
                ax=axes,
                orientation="horizontal",
                aspect=30,
                pad=0.03,
                shrink=0.8,
            )
            bar.set_ticks(_ticks(top))
            bar.set_label(unit)
        return style.save(figure, path, synthetic=synthetic)
