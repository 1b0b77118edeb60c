"""A model as a table that Mitsuba 3 renders through a plugin of its own.

Mitsuba's tabulated plugins, `measured` and `measured_polarized`, hold reflection only; a pane that transmits
has to bring a plugin. The export is a folder with the table, that plugin (a Python file that needs only
Mitsuba itself) and a scene that shows how both are used.
"""

from __future__ import annotations

from dataclasses import dataclass
from importlib import resources
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from specularia import progress
from specularia.bsdf.cells import cell_means, is_isotropic
from specularia.bsdf.model import Array, ScatteringModel
from specularia.errors import PhysicsError
from specularia.files import atomic, make_folder, write_json, write_text

__all__ = ["MitsubaExport", "export_mitsuba"]

_LAST_DEG = 89.9
"""Grazing light itself has no transmission; the last table stands for it."""
_STEP_DEG, _AZIMUTHS = 2.5, 24
_SCENE = """<scene version="3.0.0">
    <!-- First, in Python: import specularia_bsdf, from this folder. -->
    <integrator type="path"/>
    <sensor type="perspective">
        <transform name="to_world"><lookat origin="0, 0, -4" target="0, 0, 0" up="0, 1, 0"/></transform>
        <film type="hdrfilm"><integer name="width" value="64"/><integer name="height" value="64"/></film>
    </sensor>
    <emitter type="constant"/>
    <!-- The normal of the rectangle, +z, points out of the front; the camera is behind the pane. -->
    <shape type="rectangle">
        <bsdf type="specularia"><string name="filename" value="table.npz"/></bsdf>
    </shape>
</scene>
"""


@dataclass(frozen=True)
class MitsubaExport:
    """What was exported.

    Attributes
    ----------
    folder : where the files lie.
    files : `table.npz`, `specularia_bsdf.py` (the plugin), `scene.xml` and `about.json`.
    theta_deg : [K] incident angles of the table.
    tau : for each side the direct-hemispherical values [K] of the table, averaged over azimuth.
    """

    folder: Path
    files: tuple[Path, ...]
    theta_deg: Array
    tau: dict[str, Array]


def export_mitsuba(model: ScatteringModel, folder: str | Path, *, resolution: int = 7) -> MitsubaExport:
    """Write a model for Mitsuba 3.

    Parameters
    ----------
    model : any scattering model; all its sides are written, as one grey value.
    folder : is made; files of these names in it are replaced.
    resolution : g, 4 to 8; 2^g x 2^g outgoing cells for each of 37 incident angles (and, for a model that is
        not isotropic, each of 24 azimuths).

    Notes
    -----
    Cells hold means of the model and add up to its direct-hemispherical value at each incident angle. The
    plugin interpolates them bilinearly, which widens a lobe by about one cell (0.9 degrees at 2^7).

    Raises
    ------
    PhysicsError : a resolution out of range, or a side without data at any angle.
    """
    if not 4 <= resolution <= 8:
        raise PhysicsError(f"a table for Mitsuba is made at resolutions 4 to 8, not {resolution}.")
    n = 1 << resolution
    theta = np.arange(0.0, 90.0 + 0.5 * _STEP_DEG, _STEP_DEG)
    azimuths = 1 if is_isotropic(model) else _AZIMUTHS
    phi = np.arange(azimuths) * (360.0 / azimuths)
    tables: dict[str, NDArray[np.float32]] = {}
    with progress.task("tables for Mitsuba", len(model.sides) * theta.size) as task:
        for side in model.sides:
            table = np.zeros((theta.size, azimuths, n, n), np.float32)
            for k, t in enumerate(np.minimum(theta, _LAST_DEG)):
                for j, p in enumerate(phi):
                    table[k, j] = cell_means(model, side, theta_i_deg=float(t), phi_i_deg=float(p), n=n)
                task.advance()
            tables[side] = _known(table, side)
    tau = {s: t.sum(axis=(2, 3), dtype=float).mean(axis=1) * (np.pi / n**2) for s, t in tables.items()}
    about = {"band": model.band, "sides": list(tables), **dict(getattr(model, "attributes", {}))}
    plugin = resources.files("specularia.bsdf").joinpath("mitsuba_plugin.txt").read_text(encoding="utf-8")
    settings = {"theta_deg": theta, "azimuths": np.array(azimuths), "cells": np.array(n)}
    folder = make_folder(folder)
    with atomic(folder / "table.npz") as temporary:
        np.savez_compressed(temporary, **settings, **tables)  # type: ignore[arg-type]
    files = (
        folder / "table.npz",
        write_text(folder / "specularia_bsdf.py", plugin),
        write_text(folder / "scene.xml", _SCENE),
        write_json(folder / "about.json", about),
    )
    return MitsubaExport(folder=folder, files=files, theta_deg=theta, tau=tau)


def _known(table: NDArray[np.float32], side: str) -> NDArray[np.float32]:
    """Angles without data repeat the nearest one that has some."""
    good = np.flatnonzero(np.isfinite(table).all(axis=(1, 2, 3)))
    if not good.size:
        raise PhysicsError(f"the model has no data for {side.replace('_', ' ')} at any angle.")
    nearest = good[np.abs(np.arange(len(table))[:, None] - good[None, :]).argmin(axis=1)]
    return np.asarray(table[nearest], np.float32)
