"""Models in another basis, another resolution or another position.

Every conversion keeps, for each incident bin of the result, the direct-hemispherical value of the model
averaged over that bin.
"""

from __future__ import annotations

import warnings
from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from specularia import progress
from specularia.bsdf.azimuth import turned_mean
from specularia.bsdf.build_rank4 import build_tensor4
from specularia.bsdf.build_tree import _assemble, bin_edges, build, reduce_cells
from specularia.bsdf.cells import is_isotropic
from specularia.bsdf.chroma import XYZ, chroma_bands
from specularia.bsdf.klems import BASES, KlemsBasis
from specularia.bsdf.model import ScatteringModel
from specularia.bsdf.tabulated import TabulatedModel
from specularia.bsdf.tensor_tree import TensorTree
from specularia.bsdf.to_klems import klems_part, matrix_between
from specularia.bsdf.turn_over import flipped_part
from specularia.bsdf.views import AzimuthMean, Flipped, Rotated, other_face
from specularia.bsdf.xml_model import KlemsPart, Part, TreePart, XmlModel
from specularia.bsdf.xml_write import band_in_file, structure_of
from specularia.conventions import SIDES
from specularia.errors import PhysicsError, SpeculariaWarning

__all__ = ["KLEMS", "convert", "tree_at"]

KLEMS = {f"klems-{b.name.split()[-1].lower()}": b for b in BASES}
"""Klems bases by the names that `convert` takes."""
_ALL_ROUND = (np.arange(240) * 1.5).tolist()
"""Angles whose mean is isotropic: patches of the standard bases are multiples of their step wide."""
_RANK_3, _RANK_4 = 6, 5
"""Resolutions of trees unless others are asked for."""


def convert(
    model: ScatteringModel,
    *,
    basis: str | None = None,
    resolution: int | None = None,
    cull: float | None = None,
    flip: bool = False,
    rotate_deg: float = 0.0,
    isotropic: bool = False,
) -> XmlModel:
    """A model in another basis or position, ready to be written as XML.

    Parameters
    ----------
    model : any scattering model. All its bands are converted.
    basis : klems-full, klems-half, klems-quarter, tensor3 or tensor4; None keeps the one that a model from
        XML has, and takes tensor4 for tabulated models that are not isotropic, and tensor3 for any other.
    resolution : g of a tree, 2^g cells along an edge; 3 to 9 for tensor3 (6 unless given), 2 to 7 for tensor4
        (5 unless given). None keeps the tree of a model from XML as it is.
    cull : percentage of a tree's cells to remove; see `build` and `build_tensor4`.
    flip : turn the sample over about its y axis, so that front and back change places. First of the moves.
    rotate_deg : turn it about its normal, counter-clockwise seen from the front.
    isotropic : average it over all azimuths. A tensor3 is isotropic in any case.

    Notes
    -----
    A flip moves numbers and changes none of them, so that two of them are the identity; so is the rotation of
    an isotropic model. Where a geometry block would no longer fit it is left out, with a warning.

    Raises
    ------
    PhysicsError : an unknown basis, or a resolution out of range.
    """
    if basis is not None and basis not in (*KLEMS, "tensor3", "tensor4"):
        raise PhysicsError(f"no basis {basis!r}; there are {', '.join(KLEMS)}, tensor3 and tensor4.")
    settings = {"basis": basis, "resolution": resolution, "cull": cull}
    moves = {"flip": flip, "rotate_deg": rotate_deg, "isotropic": isotropic}
    each: dict[str, ScatteringModel]
    if isinstance(model, XmlModel):
        every = {**model.all_bands, model.band: model.parts}
        if set(XYZ) <= set(every):
            # Chromaticities are no BSDF; they are made again from X, Y and Z.
            every = {b: parts for b, parts in every.items() if b not in ("CIE-u", "CIE-v")}
        each = {b: replace(model, parts=parts, band=b, all_bands={}) for b, parts in every.items()}
    elif isinstance(model, TabulatedModel) and model.more:
        each = {b: model.in_band(b) for b in model.bands}
    else:
        return _convert(model, **settings, **moves)  # type: ignore[arg-type]
    bands = {b: _convert(one, **settings, **moves) for b, one in each.items()}  # type: ignore[arg-type]
    first = next(iter(bands)) if model.band not in bands else model.band
    all_bands = {b: m.parts for b, m in bands.items()}
    all_bands |= chroma_bands(all_bands)
    geometry = getattr(model, "geometry", "")
    if geometry and (flip or rotate_deg):
        geometry = ""
        warnings.warn(
            "the geometry block shows the sample as it lay before; it is left out.",
            SpeculariaWarning,
            stacklevel=2,
        )
    return replace(bands[first], bands=tuple(all_bands), all_bands=all_bands, geometry=geometry)


def _convert(
    model: ScatteringModel,
    *,
    basis: str | None,
    resolution: int | None,
    cull: float | None,
    flip: bool,
    rotate_deg: float,
    isotropic: bool,
) -> XmlModel:
    if isinstance(model, TabulatedModel) and not model.isotropic:
        basis = basis or "tensor4"
        if basis == "tensor3" and not isotropic:
            _warn_of_mean(stacklevel=4)
        if basis == "tensor3" or isotropic:
            model = turned_mean(model)
    origin = {s: Flipped(model).origin(s) for s in Flipped(model).sides}
    if not flip:
        origin = {s: _origin(model, s) for s in model.sides}
    turn = bool(rotate_deg % 360.0) and not (is_isotropic(model) or isotropic)
    average = isotropic and not is_isotropic(model)
    view: ScatteringModel = Flipped(model) if flip else model
    view = Rotated(view, rotate_deg) if turn else view
    own = model.parts if isinstance(model, XmlModel) else {}
    as_it_is = bool(own) and _same(own, basis, resolution) and cull is None and not turn and not average
    parts: dict[str, Part] = {}
    if as_it_is:
        parts = {other_face(s) if flip else s: flipped_part(p) if flip else p for s, p in own.items()}
        origin = {s: o for s, o in origin.items() if s in parts}
    else:
        into = _klems_target(own, basis, resolution, cull)
        if into is not None:
            angles = _ALL_ROUND if average else [rotate_deg if turn else 0.0]
            for side, p in own.items():
                now = flipped_part(p) if flip else p
                assert isinstance(now, KlemsPart)
                parts[other_face(side) if flip else side] = matrix_between(now, into, angles)
            origin = {s: o for s, o in origin.items() if s in parts}
        else:
            parts = _resampled(view, own, basis=basis, resolution=resolution, cull=cull, average=average)
    band = model.band if isinstance(model, XmlModel) else band_in_file(model.band)
    attributes = {k: v for k, v in dict(getattr(model, "attributes", {})).items() if k not in SIDES}
    if band != model.band:
        attributes["measured_band"] = model.band
    attributes |= {s: o for s, o in origin.items() if o != "file"}
    return XmlModel(
        parts=parts, band=band, structure=structure_of(parts), bands=(band,), attributes=attributes
    )


def _warn_of_mean(stacklevel: int) -> None:
    warnings.warn(
        "a tree of rank 3 is isotropic: the sample is averaged over all azimuths (tensor4 keeps them).",
        SpeculariaWarning,
        stacklevel=stacklevel,
    )


def _origin(model: ScatteringModel, side: str) -> str:
    known = getattr(model, "origin", None)
    return str(known(side)) if callable(known) else "model"


def _same(own: Mapping[str, Part], basis: str | None, resolution: int | None) -> bool:
    """Whether parts stand in this basis and at this resolution already."""
    for p in own.values():
        if isinstance(p, KlemsPart):
            wanted = (p.incident, p.outgoing) if basis is None else (KLEMS.get(basis),) * 2
            same = resolution is None and wanted == (p.incident, p.outgoing)
        elif isinstance(p, TreePart):
            same = basis in (None, f"tensor{p.tree.rank}") and resolution in (None, p.tree.resolution)
        else:
            same = False
        if not same:
            return False
    return True


def _klems_target(
    own: Mapping[str, Part], basis: str | None, resolution: int | None, cull: float | None
) -> KlemsBasis | None:
    """The basis that a model of matrices only goes into; None for any other conversion."""
    matrices = [p for p in own.values() if isinstance(p, KlemsPart)]
    if not matrices or len(matrices) < len(own) or resolution is not None or cull is not None:
        return None
    return matrices[0].incident if basis is None else KLEMS.get(basis)


def _resampled(
    view: ScatteringModel,
    own: Mapping[str, Part],
    *,
    basis: str | None,
    resolution: int | None,
    cull: float | None,
    average: bool,
) -> dict[str, Part]:
    first = next(iter(own.values()), None)
    if basis is None:
        if isinstance(first, KlemsPart) and resolution is None:
            angles: KlemsBasis | None = first.incident
        else:
            angles = None
            basis = f"tensor{first.tree.rank}" if isinstance(first, TreePart) else "tensor3"
    else:
        angles = KLEMS.get(basis)
    if isinstance(first, TreePart) and resolution is None:
        resolution = first.tree.resolution if basis == f"tensor{first.tree.rank}" else None
    if angles is not None and (resolution is not None or cull is not None):
        raise PhysicsError("resolution and cull are for trees; a Klems matrix has its patches.")
    if basis == "tensor3" and not is_isotropic(view) and not average:
        _warn_of_mean(stacklevel=5)
    if average and basis != "tensor3":
        view = AzimuthMean(view)
    parts: dict[str, Part] = {}
    with progress.task(f"converting to {angles.name if angles else basis}", len(view.sides)) as task:
        for side in view.sides:
            if angles is not None:
                parts[side] = klems_part(view, side, angles)
            elif basis == "tensor3":
                known = view.parts.get(side) if isinstance(view, XmlModel) else None
                if isinstance(known, TreePart) and known.tree.rank == 3:
                    parts[side] = tree_at(known.tree, resolution=resolution or _RANK_3, cull=cull)
                else:
                    parts[side] = TreePart(
                        build(view, side, resolution=resolution or _RANK_3, cull=cull).tree
                    )
            else:
                built = build_tensor4(view, resolution=resolution or _RANK_4, cull=cull, sides=[side])
                parts[side] = TreePart(built[side].tree)
            task.advance()
    return parts


def tree_at(tree: TensorTree, *, resolution: int, cull: float | None = None) -> TreePart:
    """A tree of rank 3 at another resolution: means of its cells, or its cells divided."""
    if not 3 <= resolution <= 9:
        raise PhysicsError(f"a tree's resolution must lie between 3 and 9, not {resolution}.")
    n = 1 << tree.resolution
    t, a = (np.arange(n // 2) + 0.5) / n, (np.arange(n) + 0.5) / n
    position = np.stack([v.ravel() for v in np.meshgrid(t, a, a, indexing="ij")], axis=-1)
    cells = np.maximum(tree.lookup(position), 0.0).reshape(n // 2, n, n)
    if resolution < tree.resolution:
        f = 1 << (tree.resolution - resolution)
        weight = -np.diff(bin_edges(tree.resolution) ** 2).reshape(-1, f, 1, 1)
        blocks = cells.reshape(n // 2, n // f, f, n // f, f).mean(axis=(2, 4)).reshape(-1, f, n // f, n // f)
        cells = (blocks * weight).sum(axis=1) / weight.sum(axis=1)
    for axis in range(3):
        cells = cells.repeat(1 << max(resolution - tree.resolution, 0), axis)
    cells = cells.astype(np.float32)
    tau = cells.sum(axis=(1, 2), dtype=float) * np.pi / cells.shape[1] ** 2
    return TreePart(_assemble(*reduce_cells(cells, tau, cull=cull)))
