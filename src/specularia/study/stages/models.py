"""Stage model_c, and what both models have in common: their files and what is said of them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import TYPE_CHECKING, Any

from specularia.study.stages.blocks import table
from specularia.study.stages.surfaces import map_files

if TYPE_CHECKING:
    from specularia.bsdf import Built, SideTable, TabulatedModel
    from specularia.glass import Slab
    from specularia.study.engine import Work

__all__ = ["MODEL", "model_c", "read_models", "with_faces", "write_model"]

MODEL = "model.nc"
"""Name of the model in the result of a model stage."""

_NAMES = {"model_m": "M", "model_c": "C", "model_h": "H"}


def read_models(work: Work) -> dict[str, TabulatedModel]:
    """The models among the results that a stage needs, M before C before H."""
    from specularia import bsdf

    return {
        name: bsdf.read_model(work.results[stage] / MODEL)
        for stage, name in _NAMES.items()
        if stage in work.results
    }


def write_model(work: Work, name: str, model: TabulatedModel, *, synthetic: bool) -> dict[str, Any]:
    """Write a model for this package (model.nc) and for Radiance (model.xml), and say what was written."""
    from specularia import bsdf

    bsdf.write(model, work.folder / MODEL)
    written = bsdf.write(
        model,
        work.folder / "model.xml",
        resolution=work.parameters["resolution"],
        cull=work.parameters["cull"],
        name=f"specularia model {name}",
    )
    lines = [_row(side, tree, model.tables.get(side)) for side, tree in written.trees.items()]
    header = ["side", "origin", "θᵢ (°)", "cells merged in the XML", "τ or ρ of the XML off by"]
    caption = (
        f"Model {name}, band {model.band}: its sides, the angles of incidence of its data, and its "
        f"Radiance file (tensor tree of resolution {work.parameters['resolution']}): the share of cells "
        "that were merged, and the largest difference of τ or ρ from the model's mean over an "
        "incidence bin. Files: model.nc, model.xml."
    )
    return {
        "synthetic": synthetic,
        "band": model.band,
        "sides": list(model.sides),
        "blocks": [
            table(
                work.folder / f"model_{name.lower()}.csv",
                header,
                [shown for shown, _ in lines],
                caption,
                numbers=(_COLUMNS, [numbers for _, numbers in lines]),
                synthetic=synthetic,
            )
        ],
    }


_COLUMNS = ("side", "origin", "angles", "first_deg", "last_deg", "cells_merged_percent", "largest_difference")


def _row(side: str, tree: Built, held: SideTable | None) -> tuple[list[str], list[Any]]:
    """A side of a model and of its Radiance file: as the report shows it, and its numbers."""
    origin, angles = "reciprocity", "–"
    known: list[Any] = [None, None, None]
    if held is not None:
        known = [len(held.theta_i_deg), float(held.theta_i_deg[0]), float(held.theta_i_deg[-1])]
        angles = f"{known[0]}: {known[1]:g} to {known[2]:g}"
        origin = held.origin
    merged, off = 100 * float(tree.removed), float(abs(tree.tau_tree - tree.tau_model).max())
    shown = [side.replace("_", " "), origin, angles, f"{merged:.0f} %", f"{off:.1e}"]
    return shown, [side, origin, *known, merged, off]


def with_faces(work: Work, slab: Slab) -> Slab:
    """The slab with the heights of the study in place of those that its own settings name.

    What else the settings say of a face (fine relief, layers, a liquid) stays.
    """
    from specularia import glass, surface

    for name, file in map_files(work).items():
        height_map = surface.read(file)
        face: glass.Face = getattr(slab, name)
        changed: dict[str, Any] = {
            name: glass.Face.from_map(
                height_map,
                tiling=work.parameters["tiling"],
                name=f"{name} face",
                max_missing=face.max_missing,
                sealant_index=face.sealant_index,
                micro_slope=face.micro_slope,
                film=face.film,
                denoise=work.parameters["denoise"],
            ),
            "sources": (*slab.sources, file),
            "synthetic": slab.synthetic or "synthetic" in height_map.attributes,
        }
        slab = replace(slab, **changed)
    return slab


def model_c(work: Work) -> Mapping[str, Any]:
    """Trace light through the slab; faces of the study take the place of those that its glass names."""
    from specularia import glass

    slab = with_faces(work, glass.read_slab(work.file("settings"), seed=work.parameters["seed"]))
    model = glass.model(
        slab,
        paths=work.parameters["paths"],
        seed=work.parameters["seed"],
        wavelength_nm=work.parameters["wavelength_nm"],
    )
    return write_model(work, "C", model, synthetic=slab.synthetic)
