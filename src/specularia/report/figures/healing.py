"""A face before and after healing, and what it may have been."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import matplotlib as mpl
import numpy as np
from numpy.typing import NDArray

from specularia.report import style
from specularia.report.figures.surfaces import _frame, _reduced

if TYPE_CHECKING:
    from specularia.surface import Healed, HeightMap

__all__ = ["healed"]

Array = NDArray[np.float64]


def healed(
    given: HeightMap,
    result: Healed,
    path: str | Path,
    *,
    truth_um: Array | None = None,
    members: int = 2,
    synthetic: bool = False,
) -> Path:
    """Draw a pitted face, what is left of its original surface, the healed map and members of its ensemble.

    The pitted map has its own scale of heights; healed map, truth and members share one, from the mean plane
    of the healed map. Where the plateaux say too little of the height, the healed map is hatched.

    Parameters
    ----------
    given : the pitted map.
    result : of `surface.heal`.
    path : PNG to write; an NPZ of the same name gets the arrays that are drawn, whole.
    truth_um : the original surface of a synthetic face, if known.
    members : how many members to draw.
    synthetic : True labels the figure.
    """
    from specularia.surface import plane

    c, a, b = plane(result.surface)
    trend = c + a * result.surface.x_um[None, :] + b * result.surface.y_um[:, None]
    relief = {"healed": result.surface.heights_um - trend}
    if truth_um is not None:
        relief["original (truth)"] = truth_um - trend
    for k in range(min(members, len(result.members))):
        relief[f"member {k + 1}"] = result.members[k].astype(float) - trend
    numbers: dict[str, Any] = {
        "pitch_um": [given.pitch_x_um, given.pitch_y_um],
        "given_um": given.heights_um.astype(np.float32),
        "pitted": result.pits,
        "no_evidence": result.no_evidence,
        **{k.replace(" ", "_") + "_um": v.astype(np.float32) for k, v in relief.items()},
    }
    total = 2 + len(relief)
    columns = min(3, total)
    rows = -(-total // columns)
    width = given.shape[1] * given.pitch_x_um
    extent = (0.0, width, 0.0, given.shape[0] * given.pitch_y_um)
    shared = np.concatenate([v.ravel()[::7] for v in relief.values()])
    low, high = np.quantile(shared, [0.001, 0.999])
    panel_height = 1.75 * given.field_um[1] / given.field_um[0] + 0.75
    with style.canvas(2.75 * columns, panel_height * rows) as figure:
        panels = list(figure.subplots(rows, columns, squeeze=False).ravel())
        drop = _reduced(given.heights_um - trend)
        picture = panels[0].imshow(
            drop, origin="lower", extent=extent, cmap="cividis", interpolation="nearest"
        )
        _frame(panels[0], "pitted face", 0, width)
        figure.colorbar(picture, cax=panels[0].inset_axes((1.03, 0.0, 0.045, 1.0))).set_label("height (µm)")
        panels[1].imshow(
            _reduced((~result.pits).astype(float)),
            origin="lower",
            extent=extent,
            cmap="gray",
            vmin=0,
            vmax=1,
            interpolation="nearest",
        )
        _frame(panels[1], f"left of the original: {1 - result.pit_coverage:.0%} (white)", 1, width)
        for k, (name, values) in enumerate(relief.items(), start=2):
            shown = np.where(result.no_evidence, np.nan, values) if name == "healed" else values
            if name == "healed" and result.no_evidence.any():
                style.hatch(panels[k])
            picture = panels[k].imshow(
                _reduced(shown),
                origin="lower",
                extent=extent,
                cmap=mpl.colormaps["viridis"].with_extremes(bad=(0, 0, 0, 0)),
                vmin=low,
                vmax=high,
                interpolation="nearest",
            )
            _frame(panels[k], name, k, width)
            figure.colorbar(picture, cax=panels[k].inset_axes((1.03, 0.0, 0.045, 1.0))).set_label(
                "height (µm)"
            )
        for panel in panels[total:]:
            panel.set_visible(False)
        style.write_npz(Path(path).with_suffix(".npz"), numbers)
        return style.save(figure, path, synthetic=synthetic)
