"""Hemispheres of the DSF: models (the paper's Fig. 9) and measured points (Fig. 6)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import matplotlib as mpl
import numpy as np
from matplotlib.colors import LogNorm
from matplotlib.lines import Line2D
from numpy.typing import ArrayLike, NDArray

from specularia.report import style
from specularia.report.figures import _hemisphere

if TYPE_CHECKING:
    from matplotlib.figure import Figure as Canvas

    from specularia.bsdf import ScatteringModel
    from specularia.gonio import Table

__all__ = ["dsf", "measured_dsf", "ratio_map"]

Array = NDArray[np.float64]

_CELL = 2.15
"""Size of one hemisphere on paper, inches."""

_REACH_DEG = 1.5
"""How far a measured point colours the hemisphere around it at most."""


def dsf(
    models: Mapping[str, ScatteringModel],
    theta_deg: ArrayLike,
    path: str | Path,
    *,
    side: str = "transmission_front",
    phi_i_deg: float = 0.0,
    synthetic: bool = False,
) -> Path:
    """Draw the DSF of models over the outgoing hemisphere: a row per model, a column per angle.

    DSF = BSDF |cos theta_s|, in 1/sr, on one logarithmic scale of five decades. The hemisphere is seen from
    the front of the sample (x to the right, y up, azimuth counter-clockwise); the distance from the middle is
    the polar angle from the normal of the face the light leaves by, as in the paper's Fig. 6 and 9. A cross
    marks where undeflected light leaves. Each pixel shows the mean of the DSF over its solid angle, so that a
    narrow lobe neither slips between pixels nor gains power.

    Parameters
    ----------
    models : by name, in the order of the rows.
    theta_deg : array [N], angles of incidence (degrees, 0 to 90), in the order of the columns. Where a model
        has no data, the panel is hatched.
    path : PNG to write; an NPZ of the same name gets `theta_i_deg` [N], `edge_deg` [n + 1], `solid_angle_sr`
        [n, n], `models` [R] and `dsf` [R, N, n, n] (rows from the lowest y up, columns from the lowest x).
        The sum of dsf * solid_angle_sr over a panel, NaN left out, is its direct-hemispherical value.
    side : one of `conventions.SIDES`.
    phi_i_deg : azimuth of the incident direction, degrees.
    synthetic : True labels the figure.

    Returns
    -------
    path of the PNG.
    """
    angles = np.atleast_1d(np.asarray(theta_deg, float))
    grid = _hemisphere.pixels()
    panels = np.empty((len(models), angles.size, *grid.solid_angle.shape), np.float32)
    for r, model in enumerate(models.values()):
        for c, theta in enumerate(angles):
            panels[r, c] = _hemisphere.mean_dsf(model, side, float(theta), phi_i_deg, grid)
    style.write_npz(
        Path(path).with_suffix(".npz"),
        {
            "theta_i_deg": angles,
            "phi_i_deg": phi_i_deg,
            "side": side,
            "models": list(models),
            "edge_deg": grid.edge_deg,
            "solid_angle_sr": grid.solid_angle.astype(np.float32),
            "dsf": panels,
        },
    )
    norm = _hemisphere.scale(panels)
    rows, columns = len(models), angles.size
    with style.canvas(_CELL * columns + 1.0, _CELL * rows + 0.25) as figure:
        axes = figure.subplots(rows, columns, squeeze=False)
        for r, name in enumerate(models):
            for c, theta in enumerate(angles):
                picture = _hemisphere.draw(
                    axes[r, c], panels[r, c], norm, theta_i_deg=float(theta), phi_i_deg=phi_i_deg
                )
                if r == 0:
                    axes[r, c].set_title(f"{style.letter(c)}  $\\theta_i$ = {theta:g}°", pad=9)
            axes[r, 0].text(
                -0.13,
                0.5,
                style.model_name(name),
                transform=axes[r, 0].transAxes,
                rotation=90,
                ha="right",
                va="center",
                fontsize=9,
                fontweight="bold",
            )
        _bar(figure, picture, axes, no_data=bool(np.isnan(panels[..., grid.solid_angle > 0]).any()))
        # The layout counts these panels as round; the names beside them need room of their own.
        layout: Any = figure.get_layout_engine()
        layout.set(rect=(0.03, 0.0, 0.97, 1.0))
        return style.save(figure, path, synthetic=synthetic)


def ratio_map(
    models: Mapping[str, ScatteringModel],
    theta_deg: ArrayLike,
    path: str | Path,
    *,
    side: str = "transmission_front",
    phi_i_deg: float = 0.0,
    synthetic: bool = False,
) -> Path:
    """Draw the DSF of a second model over that of a first one, a hemisphere per angle.

    Orientation as in `dsf`; the scale is logarithmic, from 1/8 (blue) over 1 (white) to 8 (red). Where both
    lie more than five decades below the highest value of the panel, or one holds no data, it is hatched.

    Parameters
    ----------
    models : two, by name: the second is divided by the first.
    theta_deg : array [N], angles of incidence, degrees.
    path : PNG to write; an NPZ of the same name gets `theta_i_deg` [N], `edge_deg` [n + 1] and `ratio`
        [N, n, n], NaN where it is hatched.
    side, phi_i_deg, synthetic : as in `dsf`.

    Returns
    -------
    path of the PNG.
    """
    angles = np.atleast_1d(np.asarray(theta_deg, float))
    grid = _hemisphere.pixels()
    (name_a, a), (name_b, b) = models.items()
    panels = []
    for theta in angles:
        one, two = (_hemisphere.mean_dsf(m, side, float(theta), phi_i_deg, grid) for m in (a, b))
        top = np.nanmax(np.fmax(one, two), initial=0.0)
        seen = (np.fmax(one, two) > top / 10.0**_hemisphere.DECADES) & np.isfinite(one) & np.isfinite(two)
        with np.errstate(divide="ignore", invalid="ignore"):
            panels.append(np.where(seen, np.clip(two / one, 1e-3, 1e3), np.nan))
    numbers = {"theta_i_deg": angles, "edge_deg": grid.edge_deg, "ratio": np.asarray(panels, np.float32)}
    style.write_npz(Path(path).with_suffix(".npz"), {**numbers, "models": list(models), "side": side})
    norm = LogNorm(vmin=1 / 8, vmax=8)
    with style.canvas(_CELL * angles.size + 1.0, _CELL + 0.45) as figure:
        axes = figure.subplots(1, angles.size, squeeze=False)
        for k, (theta, panel) in enumerate(zip(angles, panels)):
            picture = _hemisphere.draw(axes[0, k], panel, norm, theta_i_deg=float(theta), phi_i_deg=phi_i_deg)
            picture.set_cmap(mpl.colormaps["RdBu_r"].with_extremes(bad=(0, 0, 0, 0)))
            axes[0, k].set_title(f"{style.letter(k)}  $\\theta_i$ = {theta:g}°", pad=9)
        bar = figure.colorbar(picture, ax=axes, extend="both", fraction=0.03, pad=0.02, shrink=0.92)
        bar.set_label(f"{name_b} / {name_a}", fontsize=6.5)
        ticks = [1 / 8, 1 / 4, 1 / 2, 1, 2, 4, 8]
        bar.set_ticks(ticks, labels=["1/8", "1/4", "1/2", "1", "2", "4", "8"])
        bar.ax.minorticks_off()
        return style.save(figure, path, synthetic=synthetic)


def measured_dsf(
    tables: Sequence[Table], path: str | Path, *, columns: int = 3, synthetic: bool = False
) -> Path:
    """Draw measured DSF as the points lie: one hemisphere per table (the paper's Fig. 6).

    Each pixel takes the colour of the nearest point; nothing is interpolated, smoothed or cleaned. Where no
    point lies within 1.5 degrees, the hemisphere is hatched; points at or below zero take the colour below
    the scale. Orientation and scale as in `dsf`; tables of BSDF are multiplied by |cos theta_s|.

    Parameters
    ----------
    tables : one panel each, in this order.
    path : PNG to write; an NPZ of the same name gets, per table k, `theta_i_deg_k`, `phi_i_deg_k` (of the
        file), `theta_s_deg_k`, `phi_s_deg_k` (this package's frame) and `dsf_k` (1/sr), as measured.
    columns : panels in a row at most.
    synthetic : True labels the figure.

    Returns
    -------
    path of the PNG.
    """
    numbers: dict[str, object] = {"tables": [t.label for t in tables]}
    images = []
    for k, table in enumerate(tables):
        values = _as_dsf(table)
        numbers |= {
            f"theta_i_deg_{k}": table.theta_i_deg,
            f"phi_i_deg_{k}": table.phi_i_deg,
            f"theta_s_deg_{k}": table.theta_s_deg,
            f"phi_s_deg_{k}": table.phi_s_deg,
            f"dsf_{k}": values,
        }
        images.append(_nearest(table, values))
    style.write_npz(Path(path).with_suffix(".npz"), numbers)
    norm = _hemisphere.scale(*images)
    columns = min(columns, len(tables))
    rows = -(-len(tables) // columns)
    with style.canvas(_CELL * columns + 0.85, (_CELL + 0.2) * rows + 0.1) as figure:
        axes = figure.subplots(rows, columns, squeeze=False)
        for extra in axes.flat[len(tables) :]:
            extra.axis("off")
        for k, (table, image) in enumerate(zip(tables, images)):
            picture = _hemisphere.draw(
                axes.flat[k], image, norm, theta_i_deg=table.polar_deg, phi_i_deg=table.azimuth_deg
            )
            axes.flat[k].set_title(f"{style.letter(k)}  $\\theta_i$ = {table.polar_deg:g}°", pad=9)
        _bar(figure, picture, axes, no_data=True)
        return style.save(figure, path, synthetic=synthetic)


def _as_dsf(table: Table) -> Array:
    """The table's values as DSF, 1/sr."""
    values = np.asarray(table.values, float)
    return values if table.quantity == "DSF" else values * table.cos_s


def _nearest(table: Table, values: Array, n: int = 360) -> Array:
    """Picture [n, n] of the values of the nearest points; NaN where none is near or below the horizon."""
    from scipy.spatial import cKDTree

    polar = np.minimum(table.theta_s_deg, 180.0 - table.theta_s_deg)
    phi = np.radians(table.phi_s_deg)
    tree = cKDTree(np.column_stack([polar * np.cos(phi), polar * np.sin(phi)]))
    centre = (np.arange(n) + 0.5) * (180.0 / n) - 90.0
    x, y = np.meshgrid(centre, centre)
    distance, nearest = tree.query(np.column_stack([x.ravel(), y.ravel()]), distance_upper_bound=_REACH_DEG)
    drawn = np.isfinite(distance) & (np.hypot(x, y).ravel() <= 90.0)
    return np.where(drawn, np.append(values, np.nan)[nearest], np.nan).reshape(n, n)


def _bar(figure: Canvas, picture: Any, axes: Any, *, no_data: bool) -> None:
    """The colour bar of all panels, with the meaning of the cross and of the hatching."""
    bar = figure.colorbar(picture, ax=axes, extend="both", fraction=0.03, pad=0.02, aspect=32, shrink=0.92)
    bar.set_label("DSF (1/sr)")
    bar.ax.tick_params(which="minor", length=0)
    handles: list[Any] = [
        Line2D(
            [], [], marker="+", linestyle="none", color="#0094c6", markersize=5, label="undeflected direction"
        )
    ]
    if no_data:
        handles.append(style.no_data_patch("no data"))
    figure.legend(handles=handles, loc="outside lower center", ncols=2, fontsize=6.5, handletextpad=0.5)
