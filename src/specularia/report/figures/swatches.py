"""The colour of glasses over thickness: patches as they would look, and their L*, a*, b*."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.patches import Rectangle

from specularia.report import style

if TYPE_CHECKING:
    from specularia.glass import Swatches

__all__ = ["swatch_figure", "write_swatches"]

_HEADER = (
    "glass", "thickness_mm", "X", "Y", "Z", "X_se", "Y_se", "Z_se", "L", "a", "b", "sRGB",
)  # fmt: skip


def write_swatches(found: Swatches, path: str | Path) -> Path:
    """Write colours as CSV: X, Y, Z relative to the illuminant with standard errors, L*, a*, b*, sRGB."""
    from specularia.glass.colour import srgb

    shown = srgb(found.xyz)
    rows = []
    for m, name in enumerate(found.glasses):
        for t, d in enumerate(found.thickness_mm):
            code = "#" + "".join(f"{round(255 * v):02x}" for v in shown[m, t])
            rows.append([name, d, *found.xyz[m, t], *found.xyz_se[m, t], *found.lab[m, t], code])
    return style.write_csv(path, _HEADER, rows)


def swatch_figure(found: Swatches, path: str | Path, *, synthetic: bool = False) -> Path:
    """Draw one row of patches for each glass over thickness, and the way of each through a*, b*.

    Parameters
    ----------
    found : of `glass.swatches`.
    path : PNG to write; a CSV of the same name gets the numbers.
    synthetic : True labels the figure.
    """
    from specularia.glass.colour import srgb

    shown = srgb(found.xyz)
    rows, columns = shown.shape[:2]
    with style.canvas(7.0, 0.75 + 0.62 * max(rows, 3)) as figure:
        patches, chroma = figure.subplots(1, 2, width_ratios=[2.4, 1.0])
        for m in range(rows):
            for t in range(columns):
                patches.add_patch(Rectangle((t, rows - 1 - m), 0.94, 0.9, color=tuple(shown[m, t])))
                dark = found.lab[m, t, 0] < 55
                patches.text(
                    t + 0.47,
                    rows - 1 - m + 0.12,
                    "  ".join(f"{v:.0f}" for v in found.lab[m, t]),
                    ha="center",
                    fontsize=5.0,
                    color="white" if dark else "#333333",
                )
        patches.set(xlim=(-0.05, columns), ylim=(-0.05, rows), xlabel="thickness (mm)")
        patches.set_xticks(np.arange(columns) + 0.47, [f"{d:g}" for d in found.thickness_mm])
        patches.set_yticks(np.arange(rows)[::-1] + 0.45, list(found.glasses))
        patches.tick_params(length=0)
        for side in ("left", "bottom"):
            patches.spines[side].set_visible(False)
        patches.set_title(
            f"{style.letter(0)} transmitted, {found.illuminant}, {found.theta_deg:g}°; numbers: L* a* b*",
            loc="left",
        )
        chroma.axhline(0.0, color="#d4d4d4", linewidth=0.6, zorder=0)
        chroma.axvline(0.0, color="#d4d4d4", linewidth=0.6, zorder=0)
        for m, name in enumerate(found.glasses):
            a, b = found.lab[m, :, 1], found.lab[m, :, 2]
            chroma.plot(a, b, color="#7a7a7a", linewidth=0.8)
            chroma.scatter(a, b, c=shown[m], edgecolors="#333333", linewidths=0.5, s=22, zorder=3)
            chroma.annotate(name, (a[-1], b[-1]), textcoords="offset points", xytext=(4, 3), fontsize=6.5)
        chroma.set(xlabel="a*", ylabel="b*")
        chroma.margins(x=0.25, y=0.15)
        chroma.set_title(f"{style.letter(1)} over thickness", loc="left")
        write_swatches(found, Path(path).with_suffix(".csv"))
        return style.save(figure, path, synthetic=synthetic)
