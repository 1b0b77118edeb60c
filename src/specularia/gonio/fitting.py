"""Measured tables to the measurement-based model, Model M."""

from __future__ import annotations

import os
import warnings
from collections.abc import Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np

from specularia.bsdf import SideTable, TabulatedModel
from specularia.conventions import SIDES
from specularia.errors import CoverageError, PhysicsError, SpeculariaWarning
from specularia.gonio.integration import Summary, check_set, summarise_all
from specularia.gonio.isotropy import SAME_ANGLE, Isotropy, isotropy, rings
from specularia.gonio.shadow import Mask
from specularia.gonio.table import Array, Table
from specularia.gonio.tabulating import CELLS, HALF_WIDTH, SUB, Image, Tabulated, tabulated
from specularia.provenance import record

__all__ = ["fit"]

_FROM_MIRROR = 1
"""What `Distribution.filled` says of points taken from the other side of the plane of incidence."""


def fit(
    tables: Sequence[Table],
    *,
    symmetry: str = "auto",
    summaries: Sequence[Summary] | None = None,
    masks: Sequence[Mask] = (),
) -> TabulatedModel:
    """Model M: the measured distributions as tables of a model, each with its measured tau.

    Each cell holds the mean of the linear interpolant over it, with the standard error that the noise of the
    points makes. In an isotropic model every table is turned by its own azimuth of incidence, so that the
    light comes from phi_i = 0, and tables that share theta_i are averaged. In the others each direction of
    incidence keeps its own.

    Parameters
    ----------
    tables : of one sample in one band, any sides, any order.
    symmetry : of the sample. "isotropic": it may be turned about its normal. "bilateral": it has a mirror
        plane through its normal, which is found from the tables. "none": neither. "auto": isotropic where no
        theta_i was measured at several azimuths; else what these say (see `isotropy`), and a warning says so.
    summaries : of the same tables, where they have been made already.
    masks : shadows that the user gives; see `summarise`.

    Returns
    -------
    model : its `tables` hold, per side, the measured directions, tau and standard error of tau. What the
        azimuths say of the sample's symmetry stands in its attributes: `symmetry_transmission_front`, ...

    Raises
    ------
    CoverageError : no table at all, tables of more than one band, or too few for the symmetry asked for.
    FormatError : a table whose numbers cannot be right; see `integrate`.
    """
    if symmetry not in ("auto", "isotropic", "bilateral", "none"):
        raise PhysicsError(f"symmetry must be 'auto', 'isotropic', 'bilateral' or 'none', not {symmetry!r}.")
    if not tables:
        raise CoverageError("a measured model takes one table at least.")
    bands = sorted({t.band for t in tables})
    if len(bands) > 1:
        raise CoverageError(
            f"one model is for one band, these tables are for {', '.join(bands)}; fit them one by one, or "
            "state the wavelength (--wavelength)."
        )
    if summaries is None:
        summaries = summarise_all(tables, masks=masks, isotropic=symmetry in ("auto", "isotropic"))
    sides, notes = {}, {}
    for side in SIDES:
        chosen = [s for s in summaries if s.table.side == side]
        if chosen:
            sides[side], note = _side(chosen, symmetry, masks)
            if note:
                notes[f"symmetry_{side}"] = note
    files = sorted({t.file for t in tables if t.file})
    name = tables[0].name or "a sample"
    return TabulatedModel(
        tables=sides,
        band=bands[0],
        attributes={
            **record(
                what=f"Model M: scattering of {name}, measured with a gonio-photometer",
                inputs=files,
                parameters={
                    "cells": CELLS,
                    "half_width": HALF_WIDTH,
                    "sub_samples": SUB,
                    "symmetry": symmetry,
                },
                synthetic=any(t.synthetic for t in tables),
            ),
            **notes,
        },
    )


def _side(summaries: list[Summary], symmetry: str, masks: Sequence[Mask]) -> tuple[SideTable, str]:
    """All tables of one side, and what their azimuths say."""
    side = summaries[0].table.side.replace("_", " ")
    for note in check_set(summaries):
        _warn(f"{side}: {note}.")
    report = isotropy(summaries)
    if symmetry == "auto":
        symmetry = report.symmetry if report else "isotropic"
    if report:
        _warn(f"{side}: {report.sentence}. Modelled as {_MODELLED[symmetry]}.")
    if symmetry != "isotropic" and any(_FROM_MIRROR in s.distribution.filled for s in summaries):
        # What an isotropic sample allows, this one does not: the shadow is bridged instead.
        summaries = summarise_all([s.table for s in summaries], masks=masks, isotropic=False)
    groups = rings(summaries)
    if len(groups) == 1:
        _warn(
            f"{side}: one incident angle only, {summaries[0].table.polar_deg:g}; the model carries its "
            "distribution to all others."
        )
    for ring in groups if report is None else []:
        if len(ring) > 1:
            apart = max(s.tau for s in ring) - min(s.tau for s in ring)
            _warn(
                f"{side}: {len(ring)} tables at theta_i = {ring[0].table.polar_deg:g} are averaged; their "
                f"integrals differ by {apart:.4f}."
            )
    plane = _plane(summaries, report) if symmetry == "bilateral" else 0.0
    nodes = [n for ring in groups for n in _nodes(ring, symmetry, plane)]
    with ThreadPoolExecutor(_processors()) as pool:
        made = list(pool.map(lambda node: node.tabulated(), nodes))
    return SideTable(
        theta_i_deg=np.array([n.theta_deg for n in nodes]),
        phi_i_deg=None if symmetry == "isotropic" else np.array([n.phi_deg for n in nodes]),
        base=np.stack([m.base for m in made]),
        patch=np.stack([m.patch for m in made]),
        half_width=HALF_WIDTH,
        tau=np.array([n.tau for n in nodes]),
        tau_se=np.array([n.tau_se for n in nodes]),
        origin="measured",
        base_se=np.stack([np.sqrt(m.base_variance) for m in made]),
        patch_se=np.stack([np.sqrt(m.patch_variance) for m in made]),
        symmetry=symmetry,
        mirror_deg=plane,
    ), report.sentence if report else ""


_MODELLED: Mapping[str, str] = {
    "isotropic": "isotropic: tables of one theta_i are turned to one azimuth and averaged",
    "bilateral": "symmetric about that plane",
    "none": "anisotropic",
}


@dataclass(frozen=True)
class _Node:
    """One direction of incidence of the model, and the tables that tell of it."""

    theta_deg: float
    phi_deg: float
    parts: tuple[tuple[Summary, tuple[Image, ...]], ...]

    @property
    def tau(self) -> float:
        return float(np.mean([s.tau for s, _ in self.parts]))

    @property
    def tau_se(self) -> float:
        """Of noise; where several tables are averaged, that of their scatter if it is more."""
        count = len(self.parts)
        noise = float(np.sqrt(np.sum([s.tau_se**2 for s, _ in self.parts]))) / count
        if count == 1:
            return noise
        return max(noise, float(np.std([s.tau for s, _ in self.parts], ddof=1)) / np.sqrt(count))

    def tabulated(self) -> Tabulated:
        made = [tabulated(s.distribution, theta_deg=self.theta_deg, images=i) for s, i in self.parts]
        return made[0] if len(made) == 1 else Tabulated.mean(made)


def _nodes(ring: Sequence[Summary], symmetry: str, plane: float) -> list[_Node]:
    """Directions of incidence of one ring, by ascending azimuth."""
    theta = float(np.mean([s.table.polar_deg for s in ring]))
    if symmetry == "isotropic":
        return [_Node(theta, 0.0, tuple((s, (Image(),)) for s in ring))]
    if theta <= SAME_ANGLE:
        # Light along the normal: all tables show one distribution, turned by their azimuths.
        turned = []
        for s in ring:
            turn = s.table.azimuth_deg - plane
            both = (Image(turn_deg=turn), Image(mirrored=True, turn_deg=-turn))
            turned.append((s, both if symmetry == "bilateral" else both[:1]))
        return [_Node(theta, plane, tuple(turned))]
    parts: dict[float, list[tuple[Summary, tuple[Image, ...]]]] = {}
    for s in ring:
        phi, images = _folded(s.table.azimuth_deg, symmetry, plane)
        near = next((p for p in parts if abs(p - phi) <= SAME_ANGLE), phi)
        parts.setdefault(near, []).append((s, images))
    return [_Node(theta, phi, tuple(parts[phi])) for phi in sorted(parts)]


def _folded(phi: float, symmetry: str, plane: float) -> tuple[float, tuple[Image, ...]]:
    """Azimuth of a table in the part that the model keeps, and how it is seen there."""
    if symmetry == "none":
        return phi % 360.0, (Image(),)
    past = (phi - plane) % 360.0
    for own in (0.0, 180.0, 360.0):
        if abs(past - own) <= SAME_ANGLE:
            return plane + own % 360.0, (Image(), Image(mirrored=True))
    return (plane + past, (Image(),)) if past < 180.0 else (plane + 360.0 - past, (Image(mirrored=True),))


def _plane(summaries: Sequence[Summary], report: Isotropy | None) -> float:
    """Azimuth of the mirror plane of a sample that is said to have one."""
    if report is not None and report.mirror_deg is not None:
        return report.mirror_deg
    phi: Array = np.sort(np.mod([s.table.azimuth_deg for s in summaries], 360.0))
    raise CoverageError(
        "a mirror plane is found from tables of one theta_i at several azimuths; there are none here, only "
        f"phi_i = {', '.join(f'{p:g}' for p in np.unique(phi))}. Leave the symmetry at 'auto' or 'isotropic'."
    )


def _processors() -> int:
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def _warn(text: str) -> None:
    warnings.warn(text, SpeculariaWarning, stacklevel=3)
