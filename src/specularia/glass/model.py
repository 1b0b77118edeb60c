"""Model C: the scattering of a pane, tabulated from traced paths."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from time import perf_counter

import numpy as np
from numpy.typing import NDArray

from specularia.bsdf.tabulated import SideTable, TabulatedModel, base_index
from specularia.errors import PhysicsError
from specularia.glass.merging import LARGEST_BLOCK, merge_sparse
from specularia.glass.slab import Slab
from specularia.glass.trace import (
    CHUNK,
    REPLICATES,
    WAVELENGTH_NM,
    EnergyBalance,
    LightSide,
    Paths,
    compile_kernel,
    mean_and_error,
    replicates,
    trace_paths,
    warn_of_lost,
)
from specularia.progress import task
from specularia.provenance import record

__all__ = ["NODES_DEG", "Traced", "model", "traced_model"]

Array = NDArray[np.float64]

NODES_DEG = (0, 10, 20, 30, 40, 50, 55, 60, 65, 70, 75, 77.5, 80, 82.5, 85, 87, 88.5, 89.5)
"""Incident angles, dense where transmission falls: interpolated between them, tau of a clear flat pane is
right to 0.1 % up to the last."""

BASE_CELLS = 128
PATCH_CELLS = 96
HALF_WIDTH = 0.12
"""A base cell is 0.8 degrees wide around the normal; a patch cell, within 7 degrees of the undeflected
direction, 0.14 degrees."""


@dataclass(frozen=True)
class Traced:
    """A traced model with the energy balance of the paths it was made of.

    Attributes
    ----------
    model : the tables.
    balance : for light on the front; `lost` and `seconds` count both sides together.
    """

    model: TabulatedModel
    balance: EnergyBalance


def model(
    slab: Slab,
    *,
    paths: int = 200_000,
    seed: int = 0,
    wavelength_nm: float = WAVELENGTH_NM,
    theta_deg: Sequence[float] = NODES_DEG,
) -> TabulatedModel:
    """Trace a pane from both sides and tabulate all four: transmission and reflection, front and back.

    The sample is turned under the beam (each path has an azimuth of its own), so that the model is isotropic.

    Parameters
    ----------
    slab : the pane.
    paths : for each incident direction.
    seed : of all random streams.
    wavelength_nm : for index and absorption; it becomes the model's band.
    theta_deg : incident angles, ascending, 0 <= theta < 90.

    Returns
    -------
    TabulatedModel : BSDF as means over cells, merged where few paths arrived (see `merging`); `base_se` is
        the error of counting, where no path arrived that of a single one in the largest block. `tau_se` comes
        from the spread of replicates.
    """
    return traced_model(slab, paths=paths, seed=seed, wavelength_nm=wavelength_nm, theta_deg=theta_deg).model


def traced_model(
    slab: Slab,
    *,
    paths: int = 200_000,
    seed: int = 0,
    wavelength_nm: float = WAVELENGTH_NM,
    theta_deg: Sequence[float] = NODES_DEG,
) -> Traced:
    """As `model`, with the energy balance; parameters as there."""
    theta = np.asarray(theta_deg, float)
    if theta.ndim != 1 or theta.size == 0 or np.any(np.diff(theta) <= 0):
        raise PhysicsError("the incident angles of a model must ascend.")
    compile_kernel()
    tables: dict[str, SideTable] = {}
    lost, seconds = np.zeros(theta.size, np.int64), np.zeros(theta.size)
    balances: dict[LightSide, list[_Node]] = {}
    sides: tuple[LightSide, ...] = ("front", "back")
    with task("Tracing Model C", 2 * theta.size) as bar:
        for side in sides:
            nodes = []
            for k, t in enumerate(theta):
                node = _trace_node(slab, side, float(t), paths, seed, wavelength_nm)
                lost[k] += node.lost
                seconds[k] += node.seconds
                nodes.append(node)
                bar.advance()
            balances[side] = nodes
            tables[f"transmission_{side}"] = _table(theta, [n.transmitted for n in nodes])
            tables[f"reflection_{side}"] = _table(theta, [n.reflected for n in nodes])
    total, _ = replicates(paths)
    warn_of_lost(int(lost.sum()), 2 * total * theta.size)
    attributes = record(
        what=f"Scattering model traced through a pane's geometry (Model C) at {wavelength_nm:g} nm.",
        inputs=slab.sources,
        parameters={
            "thickness_mm": slab.thickness_mm,
            "index": slab.medium.index_at(wavelength_nm),
            "absorption_per_mm": slab.medium.absorption_at(wavelength_nm),
            "wavelength_nm": wavelength_nm,
            "polarised": slab.polarised,
            "bubbles": 0 if slab.all_bubbles is None else len(slab.all_bubbles),
            "front": slab.front.name,
            "front_tiling": "flat" if slab.front.is_flat else slab.front.tiling,
            "back": slab.back.name,
            "back_tiling": "flat" if slab.back.is_flat else slab.back.tiling,
            "paths_per_direction": total,
        },
        seed=seed,
        synthetic=slab.synthetic,
    )
    front = balances["front"]
    balance = EnergyBalance(
        theta_deg=theta,
        tau=np.array([n.transmitted.share for n in front]),
        tau_se=np.array([n.transmitted.error for n in front]),
        rho=np.array([n.reflected.share for n in front]),
        rho_se=np.array([n.reflected.error for n in front]),
        absorbed=np.array([n.absorbed for n in front]),
        absorbed_se=np.array([n.absorbed_error for n in front]),
        lost=lost,
        paths=total,
        seconds=seconds,
    )
    return Traced(
        model=TabulatedModel(tables=tables, band=f"{wavelength_nm:g} nm", attributes=attributes),
        balance=balance,
    )


@dataclass(frozen=True)
class _Distribution:
    """Light leaving one face: BSDF of base and patch, error of the base, share of the light and its error."""

    base: NDArray[np.float32]
    base_se: NDArray[np.float32]
    patch: NDArray[np.float32]
    share: float
    error: float


@dataclass(frozen=True)
class _Node:
    """One incident direction."""

    transmitted: _Distribution
    reflected: _Distribution
    absorbed: float
    absorbed_error: float
    lost: int
    seconds: float


def _trace_node(
    slab: Slab, side: LightSide, theta_deg: float, paths: int, seed: int, wavelength_nm: float
) -> _Node:
    """Trace one direction in chunks and bin what leaves either face."""
    total, each = replicates(paths)
    transmitted, reflected = _Bins(theta_deg), _Bins(theta_deg)
    absorbed = np.zeros(REPLICATES)
    lost, seconds = 0, 0.0
    slab.geometry  # noqa: B018 (made once, outside the time of tracing)
    for first in range(0, total, CHUNK):
        start = perf_counter()
        part = trace_paths(
            slab,
            side=side,
            theta_deg=theta_deg,
            phi_deg=None,
            paths=paths,
            # Independent streams for the two sides; the angles of one side share theirs, which keeps the
            # differences between neighbouring angles quiet.
            seed=2 * seed + (side == "back"),
            wavelength_nm=wavelength_nm,
            first=first,
            count=min(CHUNK, total - first),
        )
        seconds += perf_counter() - start
        absorbed += np.bincount(part.replicate, part.absorbed, REPLICATES)
        lost += part.lost
        transmitted.add(part, part.transmitted)
        reflected.add(part, part.reflected)
    share, error = mean_and_error(absorbed / each)
    return _Node(transmitted.done(each), reflected.done(each), float(share), float(error), lost, seconds)


class _Bins:
    """Sums of path weights over the cells of base and patch."""

    def __init__(self, theta_deg: float) -> None:
        self.sine = float(np.sin(np.radians(theta_deg)))
        self.base = np.zeros(BASE_CELLS**2)
        self.base_square = np.zeros(BASE_CELLS**2)
        self.patch = np.zeros(PATCH_CELLS**2)
        self.patch_square = np.zeros(PATCH_CELLS**2)
        self.replicate = np.zeros(REPLICATES)
        self.heaviest = 0.0

    def add(self, paths: Paths, which: NDArray[np.bool_]) -> None:
        ux, uy, weight = paths.ux[which], paths.uy[which], paths.weight[which]
        a, b = base_index(ux, uy, BASE_CELLS)
        cell = a * BASE_CELLS + b
        self.base += np.bincount(cell, weight, BASE_CELLS**2)
        self.base_square += np.bincount(cell, weight**2, BASE_CELLS**2)
        scale = PATCH_CELLS / (2.0 * HALF_WIDTH)
        x = np.floor((ux + self.sine + HALF_WIDTH) * scale).astype(np.intp)
        y = np.floor((uy + HALF_WIDTH) * scale).astype(np.intp)
        inside = (x >= 0) & (x < PATCH_CELLS) & (y >= 0) & (y < PATCH_CELLS)
        cell = (x * PATCH_CELLS + y)[inside]
        self.patch += np.bincount(cell, weight[inside], PATCH_CELLS**2)
        self.patch_square += np.bincount(cell, weight[inside] ** 2, PATCH_CELLS**2)
        self.replicate += np.bincount(paths.replicate[which], weight, REPLICATES)
        self.heaviest = max(self.heaviest, float(weight.max(initial=0.0)))

    def done(self, each: int) -> _Distribution:
        """BSDF in 1/sr: weight over the projected solid angle of the cell, per path."""
        paths = each * REPLICATES
        n, m = BASE_CELLS, PATCH_CELLS
        share, share_error = mean_and_error(self.replicate / each)
        base, base_se = merge_sparse(
            self.base.reshape(n, n), self.base_square.reshape(n, n), np.full((n, n), paths * np.pi / n**2)
        )
        # Where no path arrived the truth may still be that of a single one.
        base_se = np.maximum(base_se, self.heaviest * n**2 / (paths * np.pi * LARGEST_BLOCK**2))
        # Cells cut by the horizon count with the part of them that directions can fall into.
        area = _inside_disk(self.sine).reshape(m, m) * (2.0 * HALF_WIDTH / m) ** 2
        patch, _ = merge_sparse(self.patch.reshape(m, m), self.patch_square.reshape(m, m), paths * area)
        return _Distribution(
            base=base.astype(np.float32),
            base_se=base_se.astype(np.float32),
            patch=patch.astype(np.float32),
            share=float(share),
            error=float(share_error),
        )


def _inside_disk(sine: float, parts: int = 8) -> Array:
    """Share of each patch cell that lies inside the unit disk, counted on a finer grid; flat [m * m]."""
    fine = (np.arange(PATCH_CELLS * parts) + 0.5) * (2.0 * HALF_WIDTH / (PATCH_CELLS * parts)) - HALF_WIDTH
    inside = (fine[:, None] - sine) ** 2 + fine[None, :] ** 2 <= 1.0
    cells = inside.reshape(PATCH_CELLS, parts, PATCH_CELLS, parts).mean(axis=(1, 3))
    # A sliver thinner than the finer grid may still have caught a path.
    return np.where(cells > 0.0, cells, 0.5 / parts**2).ravel()


def _table(theta: Array, nodes: Sequence[_Distribution]) -> SideTable:
    return SideTable(
        theta_i_deg=theta,
        base=np.stack([n.base for n in nodes]),
        patch=np.stack([n.patch for n in nodes]),
        half_width=HALF_WIDTH,
        tau=np.array([n.share for n in nodes]),
        tau_se=np.array([n.error for n in nodes]),
        origin="traced",
        base_se=np.stack([n.base_se for n in nodes]),
        blend="linear",
    )
