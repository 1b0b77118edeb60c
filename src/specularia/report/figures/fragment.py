"""The fragment over a printed sheet (the paper's Fig. 10), and contrast of print over the gap."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.colors import PowerNorm
from matplotlib.ticker import FuncFormatter

from specularia.report import style
from specularia.report.figures.colour import screen

if TYPE_CHECKING:
    from specularia.daylight.fragment import Contrast, FragmentPicture

__all__ = ["contrast_over_gap", "fragment_pictures"]


def fragment_pictures(
    pictures: Sequence[FragmentPicture], path: str | Path, *, invented: bool = False, synthetic: bool = False
) -> Path:
    """Draw the fragment as the eye sees it: a row for each model, a column for each gap, one scale for all.

    Grey stands for luminance, with the steps of a photograph (power 1/2.2); models of three bands are in
    colour.

    Parameters
    ----------
    pictures : records with `model`, `gap_mm`, `luminance` [row, column] in cd/m2, row 0 at the top,
        `covered`, `extent_mm` and `xyz` [row, column, 3] or None; each model at the same gaps.
    path : PNG to write; an NPZ of the same name gets `luminance_k`, `model_k`, `gap_mm_k` and `extent_mm_k`.
    invented : True says below the pictures that the outline is not that of a find.
    synthetic : True labels the figure.

    Returns
    -------
    path of the PNG.
    """
    models = list(dict.fromkeys(p.model for p in pictures))
    gaps = list(dict.fromkeys(p.gap_mm for p in pictures))
    top = max(float(np.quantile(p.luminance, 0.999)) for p in pictures)
    norm = PowerNorm(1 / 2.2, vmin=0.0, vmax=top)
    left, right, bottom, upper = pictures[0].extent_mm
    width = 2.5 if len(gaps) > 1 else 3.6
    height = width * (upper - bottom) / (right - left)
    with style.canvas(width * len(gaps) + 0.95, (height + 0.24) * len(models) + 0.15) as figure:
        axes = figure.subplots(len(models), len(gaps), squeeze=False)
        for k, picture in enumerate(pictures):
            panel = axes[models.index(picture.model), gaps.index(picture.gap_mm)]
            grey = panel.imshow(
                picture.luminance,
                cmap="gray",
                norm=norm,
                extent=picture.extent_mm,
                origin="upper",
                # More pixels than the figure has are averaged, or print would fall between them.
                interpolation="antialiased",
            )
            if picture.xyz is not None:
                shown = screen([picture.xyz], white=top)[0]
                panel.imshow(shown, extent=picture.extent_mm, origin="upper", interpolation="antialiased")
            panel.contour(
                picture.covered,
                levels=[0.5],
                colors="#c8a24a",
                linewidths=0.6,
                extent=picture.extent_mm,
                origin="upper",
            )
            panel.set(xticks=[], yticks=[])
            for spine in panel.spines.values():
                spine.set_visible(True)
            panel.set_title(
                f"{style.letter(k)}  {style.model_name(picture.model)}, gap {picture.gap_mm:g} mm"
            )
        if invented:
            figure.suptitle("synthetic outline", x=0.005, y=0.012, ha="left", va="bottom", fontsize=6.5)
        panel = axes[-1, 0]
        x0, y0 = left + 0.03 * (right - left), bottom + 0.045 * (upper - bottom)
        panel.fill_between(
            [x0 - 1.5, x0 + 11.5], y0 - 1.5, y0 + 5.0, color="white", alpha=0.85, linewidth=0, zorder=3
        )
        panel.plot([x0, x0 + 10.0], [y0, y0], color="black", linewidth=1.6, zorder=4, solid_capstyle="butt")
        panel.text(x0 + 5.0, y0 + 0.7, "10 mm", ha="center", va="bottom", fontsize=6.0, zorder=4)
        bar = figure.colorbar(grey, ax=axes, fraction=0.03, pad=0.015, shrink=0.9, extend="max")
        bar.set_label("luminance L (cd/m²)")
        bar.ax.yaxis.set_major_formatter(FuncFormatter(lambda v, _: style.number(v)))
        numbers: dict[str, object] = {}
        for k, picture in enumerate(pictures):
            numbers |= {
                f"luminance_{k}": picture.luminance.astype(np.float32),
                f"model_{k}": picture.model,
                f"gap_mm_{k}": picture.gap_mm,
                **({} if picture.xyz is None else {f"xyz_{k}": picture.xyz.astype(np.float32)}),
                f"extent_mm_{k}": picture.extent_mm,
            }
        style.write_npz(Path(path).with_suffix(".npz"), numbers)
        return style.save(figure, path, synthetic=synthetic)


def contrast_over_gap(
    curves: Sequence[Contrast], path: str | Path, *, stroke_mm: float, synthetic: bool = False
) -> Path:
    """Draw Michelson contrast of bars over the gap between sheet and glass, a line for each model.

    Parameters
    ----------
    curves : records with `model`, `gap_mm`, `contrast`, `transmitted`, `bare` and `reflects`.
    path : PNG to write; a CSV of the same name gets `gap_mm`, and `contrast` and `transmitted` of each model.
    stroke_mm : width of a bar, for the label.
    synthetic : True labels the figure.

    Returns
    -------
    path of the PNG.
    """
    path = Path(path)
    gaps = np.asarray(curves[0].gap_mm)
    with style.canvas(4.6, 3.0) as figure:
        axes = figure.subplots()
        for k, curve in enumerate(curves):
            colour = style.colour_of(curve.model, k)
            axes.plot(curve.gap_mm, curve.contrast, color=colour, label=style.model_name(curve.model))
            if curve.reflects:
                axes.plot(curve.gap_mm, curve.transmitted, color=colour, linestyle=(0, (4, 2)), linewidth=1.0)
        if any(c.reflects for c in curves):
            axes.plot(
                [], [], color="#555555", linestyle=(0, (4, 2)), linewidth=1.0, label="without reflection"
            )
        axes.axhline(curves[0].bare, color="#7a7a7a", linewidth=0.8, linestyle=":", label="without glass")
        # Linear to 0.1 mm, so that glass on the sheet has its place; logarithmic beyond.
        axes.set_xscale("symlog", linthresh=0.1, linscale=0.35)
        axes.xaxis.set_major_formatter(FuncFormatter(lambda v, _: f"{v:g}"))
        axes.set(
            xlim=(0.0, float(gaps.max())),
            ylim=(0.0, 1.0),
            xlabel="gap between sheet and glass (mm)",
            ylabel=f"contrast of bars of {stroke_mm:g} mm",
        )
        axes.legend(loc="best")
        header, columns = ["gap_mm"], [gaps]
        for curve in curves:
            header += [f"contrast_{curve.model}", f"transmitted_{curve.model}"]
            columns += [curve.contrast, curve.transmitted]
        style.write_csv(path.with_suffix(".csv"), header, np.stack(columns, axis=1).tolist())
        return style.save(figure, path, synthetic=synthetic)
