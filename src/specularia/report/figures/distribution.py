"""Hemispheres of the DSF: models (the paper's Fig. 9) and measured points (Fig. 6)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from numpy.typing import ArrayLike, NDArray

from specularia.report import style
from specularia.report.figures import _hemisphere

if TYPE_CHECKING:
    from matplotlib.figure import Figure as Canvas

    from specularia.bsdf import ScatteringModel
    from specularia.gonio import Table

__all__ = ["dsf", "measured_dsf"]

Array = NDArray[np.float64]

_CELL = 2.15
"""Size of one hemisphere on paper, inches."""


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

    DSF = BSDF |cos theta_s|, in 1/sr, on one logarithmic scale of five decades. The hemisphere is seen from the
    front of the sample (x to the right, y up, azimuth counter-clockwise); the distance from the middle is the
    polar angle from the normal of the face the light leaves by, as in the paper's Fig. 6 and 9. A cross marks
    where undeflected light leaves. Each pixel shows the mean of the DSF over its solid angle, so that a narrow
    lobe neither slips between pixels nor gains power.

    Parameters
    ----------
    models : by name, in the order of the rows.
    theta_deg : array [N], angles of incidence (degrees, 0 to 90), in the order of the columns. Where a model has
        no data, the panel is hatched.
    path : PNG to write; an NPZ of the same name gets `theta_i_deg` [N], `edge_deg` [n + 1], `solid_angle_sr`
        [n, n], `models` [R] and `dsf` [R, N, n, n] (rows from the lowest y up, columns from the lowest x). The
        sum of dsf * solid_angle_sr over a panel is its direct-hemispherical value.
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
            panels[r, c] = _mean_dsf(model, side, float(theta), phi_i_deg, grid)
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
                -0.07, 0.5, name, transform=axes[r, 0].transAxes, rotation=90, ha="right", va="center",
                fontsize=9, fontweight="bold",
            )
        _bar(figure, picture, axes)
        return style.save(figure, path, synthetic=synthetic)


def measured_dsf(
    tables: Sequence[Table], path: str | Path, *, columns: int = 3, synthetic: bool = False
) -> Path:
    """Draw measured DSF as the points lie: one hemisphere per table (the paper's Fig. 6).

    Each point is a disk as wide as the distance to its fourth neighbour; nothing is interpolated, smoothed or
    cleaned. Where no point lies, the hemisphere is hatched; points at or below zero take the colour below the
    scale. Orientation and scale as in `dsf`; tables of BSDF are multiplied by |cos theta_s|.

    Parameters
    ----------
    tables : one panel each, in this order.
    path : PNG to write; an NPZ of the same name gets, per table k, `theta_i_deg_k`, `phi_i_deg_k` (of the file),
        `theta_s_deg_k`, `phi_s_deg_k` (this package's frame) and `dsf_k` (1/sr), as measured.
    columns : panels in a row at most.
    synthetic : True labels the figure.

    Returns
    -------
    path of the PNG.
    """
    numbers: dict[str, object] = {"tables": [Path(t.file).name for t in tables]}
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
        images.append(_disks(table.theta_s_deg, table.phi_s_deg, values))
    style.write_npz(Path(path).with_suffix(".npz"), numbers)
    norm = _hemisphere.scale(*images)
    columns = min(columns, len(tables))
    rows = -(-len(tables) // columns)
    with style.canvas(_CELL * columns + 0.85, (_CELL + 0.2) * rows + 0.1) as figure:
        axes = figure.subplots(rows, columns, squeeze=False)
        for extra in axes.flat[len(tables) :]:
            extra.axis("off")
        for k, (table, image) in enumerate(zip(tables, images)):
            polar = min(table.theta_i_deg, 180.0 - table.theta_i_deg)
            picture = _hemisphere.draw(
                axes.flat[k], image, norm, theta_i_deg=polar, phi_i_deg=_incident_azimuth(table)
            )
            axes.flat[k].set_title(f"{style.letter(k)}  $\\theta_i$ = {polar:g}°", pad=9)
        _bar(figure, picture, axes)
        return style.save(figure, path, synthetic=synthetic)


def _mean_dsf(
    model: ScatteringModel, side: str, theta_i_deg: float, phi_i_deg: float, grid: _hemisphere.Pixels
) -> Array:
    """Mean DSF of each pixel; NaN throughout where the model has no data for the angle."""
    values = np.full(grid.ux.shape, np.nan)
    inside = np.isfinite(grid.ux)
    if np.isfinite(model.direct_hemispherical(side, theta_i_deg, phi_i_deg)):
        bsdf = model.evaluate(side, theta_i_deg, phi_i_deg, grid.ux[inside], grid.uy[inside])
        values[inside] = bsdf * grid.cosine[inside]
    return grid.mean(values)


def _as_dsf(table: Table) -> Array:
    """The table's values as DSF, 1/sr."""
    values = np.asarray(table.values, float)
    return values if table.quantity == "DSF" else values * np.abs(np.cos(np.radians(table.theta_s_deg)))


def _disks(theta_s_deg: Array, phi_s_deg: Array, values: Array, n: int = 360) -> Array:
    """Points as disks on a picture of n x n pixels; NaN between them. Where disks overlap the nearest wins."""
    from scipy.spatial import cKDTree

    polar = np.minimum(theta_s_deg, 180.0 - theta_s_deg)
    phi = np.radians(phi_s_deg)
    points = np.column_stack([polar * np.cos(phi), polar * np.sin(phi)])
    tree = cKDTree(points)
    pixel = 180.0 / n
    neighbours = min(4, len(points) - 1)
    spacing = tree.query(points, k=neighbours + 1)[0][:, -1] if neighbours else np.zeros(len(points))
    # At least a pixel, so that no lone point is lost; at most 3 degrees, so that gaps stay gaps.
    radius = np.clip(spacing, 0.75 * pixel, 3.0)
    centre = (np.arange(n) + 0.5) * pixel - 90.0
    x, y = np.meshgrid(centre, centre)
    distance, nearest = tree.query(np.column_stack([x.ravel(), y.ravel()]))
    drawn = (distance <= radius[nearest]) & (np.hypot(x, y).ravel() <= 90.0)
    return np.where(drawn, values[nearest], np.nan).reshape(n, n)


def _incident_azimuth(table: Table) -> float:
    """Azimuth of the incident direction in this package's frame."""
    return float(table.phi_i_deg)


def _bar(figure: Canvas, picture: Any, axes: Any) -> None:
    """The colour bar of all panels, with the meaning of the hatching and of the cross."""
    bar = figure.colorbar(picture, ax=axes, extend="both", fraction=0.03, pad=0.02, aspect=32, shrink=0.92)
    bar.set_label("DSF (1/sr)")
    bar.ax.tick_params(which="minor", length=0)
    handles = [
        Patch(facecolor=style.NO_DATA, edgecolor="#a0a0a0", hatch="//////", linewidth=0.0, label="no data"),
        Line2D([], [], marker="+", linestyle="none", color="#0094c6", label="undeflected"),
    ]
    figure.legend(handles=handles, loc="outside lower center", ncols=2, fontsize=6.5, handletextpad=0.5)
