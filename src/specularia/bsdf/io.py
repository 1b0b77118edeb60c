"""Models from files and into files, whatever their format."""

from __future__ import annotations

import warnings
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from specularia import progress
from specularia.bsdf import xml_write
from specularia.bsdf.azimuth import azimuth_loss
from specularia.bsdf.build_rank4 import build_tensor4
from specularia.bsdf.build_tree import Built, build_sides
from specularia.bsdf.chroma import chroma_bands
from specularia.bsdf.model import Array, ScatteringModel
from specularia.bsdf.tabulated import TabulatedModel
from specularia.bsdf.tabulated_io import read_model, write_model
from specularia.bsdf.xml_model import Part, TreePart, XmlModel
from specularia.bsdf.xml_read import read_xml
from specularia.errors import FormatError, OutputError, PhysicsError, SpeculariaWarning
from specularia.files import existing, write_text

__all__ = ["Written", "direct_hemispherical", "evaluate", "read", "write"]


@dataclass(frozen=True)
class Written:
    """What was written.

    Attributes
    ----------
    path : the file.
    model : the model as it stands in the file.
    trees : for each side of an XML file made from another model, how the tree compares with the model.
    """

    path: Path
    model: ScatteringModel
    trees: Mapping[str, Built]


def read(path: str | Path, *, band: str | None = None) -> TabulatedModel | XmlModel:
    """A scattering model from a file; its content decides how it is read.

    Parameters
    ----------
    path : a WINDOW XML file (Klems or tensor tree, from anyone) or a netCDF file of this package.
    band : for files with several bands, the one to take; None takes Visible in XML, and all in netCDF.

    Raises
    ------
    FormatError : neither of the two, or broken.
    """
    path = existing(path, what="a BSDF file (.nc or .xml)")
    try:
        with path.open("rb") as f:
            head = f.read(512)
    except OSError as error:
        raise FormatError(
            file=path, expected="a BSDF file (.nc or .xml)", found=str(error.strerror)
        ) from error
    if head.startswith((b"\x89HDF\r\n\x1a\n", b"CDF")):
        model = read_model(path)
        return model if band is None or not model.more else model.in_band(band)
    if head.lstrip(b"\xef\xbb\xbf \t\r\n").startswith(b"<") or head.startswith((b"\xff\xfe", b"\xfe\xff")):
        return read_xml(path, band=band)
    raise FormatError(
        file=path,
        expected="netCDF or WINDOW XML",
        found=f"a file that begins with {head[:12]!r}" if head else "an empty file",
    )


def write(
    model: ScatteringModel,
    path: str | Path,
    *,
    resolution: int | None = None,
    cull: float | None = None,
    basis: str | None = None,
    name: str | None = None,
    thickness_mm: float | None = None,
) -> Written:
    """Write a model; the ending of the path decides the format.

    Parameters
    ----------
    model : what to write.
    path : ends in .nc (tabulated models only) or .xml.
    resolution : g of a tree, 3 to 9 for tensor3 and 2 to 7 for tensor4: 2^g x 2^g outgoing cells, and
        2^(g-1) or 2^g x 2^g incident ones. None writes a model that came from XML with its own matrices or
        trees (unless `basis` says tensor4), and any other one with 6.
    cull : percentage of the tree's cells to remove; None removes as many as move 1 % of the light (tensor3)
        or 2 % (tensor4).
    basis : tensor3, small and isotropic, or tensor4, which keeps direct sun right at every angle and also
        holds samples that are not isotropic. None takes tensor4 for tabulated models that are not, and
        tensor3 for any other.
    name : of the material; None takes the model's.
    thickness_mm : of the pane; None takes the model's attribute of that name, where there is one.

    Notes
    -----
    All sides of the model are written. A transmission side that was not measured is made by reciprocity and
    labelled so: renderers need it, since they do not sample rank-3 trees in reverse.
    """
    path = Path(path)
    if path.suffix == ".nc":
        if not isinstance(model, TabulatedModel):
            raise OutputError(f"{path}: only tabulated models can be written as .nc; name an .xml file.")
        return Written(path=write_model(model, path), model=model, trees={})
    if path.suffix != ".xml":
        raise OutputError(f"{path}: a model is written as .nc or .xml.")
    attributes = dict(getattr(model, "attributes", {}))
    if thickness_mm is not None:
        attributes["thickness_mm"] = f"{thickness_mm:g}"
    if name is not None:
        attributes["name"] = name
    parts: dict[str, Part]
    more: dict[str, Mapping[str, Part]] = {}
    trees: dict[str, Built] = {}
    if basis is None:
        basis = "tensor4" if isinstance(model, TabulatedModel) and not model.isotropic else "tensor3"
    if basis not in ("tensor3", "tensor4"):
        raise PhysicsError(f"a tree is written as tensor3 or tensor4, not {basis!r}.")
    if isinstance(model, XmlModel) and resolution is None and (basis == "tensor3" or model.rank == 4):
        parts = dict(model.parts)
        more = dict(model.all_bands)
    else:
        if isinstance(model, XmlModel) and len(model.bands) > 1:
            warnings.warn(
                f"{path.name}: only the band {model.band} is written, out of {', '.join(model.bands)}.",
                SpeculariaWarning,
                stacklevel=2,
            )
        how = {"basis": basis, "resolution": 6 if resolution is None else resolution, "cull": cull}
        trees = _build_all(model, path, **how)  # type: ignore[arg-type]
        parts = {s: TreePart(t.tree) for s, t in trees.items()}
        others = model.more if isinstance(model, TabulatedModel) else {}
        if others:
            assert isinstance(model, TabulatedModel)
            found = {b: _build_all(model.in_band(b), path, **how) for b in others}  # type: ignore[arg-type]
            more = {b: {s: TreePart(t.tree) for s, t in sides.items()} for b, sides in found.items()}
            more |= chroma_bands({**more, model.band: parts})
            order = sorted({*more, model.band}, key=lambda b: "CIE-Y" if b == "Visible" else b)
            more = {b: more.get(b, parts) for b in order}
    origins = {s: _origin(model, s) for s in parts}
    measured = attributes.get("measured_band", model.band)
    text = xml_write.document(
        parts,
        band=measured if xml_write.band_in_file(measured) == model.band else model.band,
        attributes=attributes,
        origins=origins,
        geometry=getattr(model, "geometry", ""),
        more=more,
    )
    write_text(path, text)
    band = model.band if model.band in more else xml_write.band_in_file(model.band)
    all_bands = {**more, band: parts}
    written = XmlModel(
        parts=parts,
        band=band,
        structure=xml_write.structure_of(parts),
        bands=tuple(all_bands),
        attributes={**attributes, **origins},
        geometry=getattr(model, "geometry", ""),
        all_bands=all_bands,
    )
    return Written(path=path, model=written, trees=trees)


def _build_all(
    model: ScatteringModel, path: Path, *, basis: str, resolution: int, cull: float | None
) -> dict[str, Built]:
    """Trees of all sides; a warning where reduction changes the light of a bin."""
    trees: dict[str, Built] = {}
    with progress.task(f"building the tensor tree of {path.name}", len(model.sides)) as task:
        for side, built in _built(model, basis=basis, resolution=resolution, cull=cull):
            trees[side] = built
            if basis == "tensor3":
                _warn_of_azimuths(model, side, path)
            task.advance()
            floor = np.maximum(built.tau_model, 1e-3 * max(float(built.tau_model.max()), 1e-12))
            off = float(np.max(np.abs(built.tau_tree - built.tau_model) / floor))
            if off > 2e-3:
                warnings.warn(
                    f"{path.name}: reduction changes the {side.replace('_', ' ')} of an incidence bin by "
                    f"{100 * off:.1f} %; remove fewer cells (a smaller cull).",
                    SpeculariaWarning,
                    stacklevel=3,
                )
    return {s: trees[s] for s in model.sides}


def _built(
    model: ScatteringModel, *, basis: str, resolution: int, cull: float | None
) -> Iterator[tuple[str, Built]]:
    """Trees of all sides, one after the other."""
    if basis == "tensor3":
        yield from build_sides(model, model.sides, resolution=resolution, cull=cull)
    else:
        for side in model.sides:
            yield from build_tensor4(model, resolution=resolution, cull=cull, sides=[side]).items()


def _warn_of_azimuths(model: ScatteringModel, side: str, path: Path) -> None:
    """A tree of rank 3 holds the mean over azimuth: say how much of the light it puts elsewhere."""
    lost = azimuth_loss(model, side)
    if lost > 0.0:
        warnings.warn(
            f"{path.name}: the {side.replace('_', ' ')} is not isotropic, and a tree of rank 3 holds its "
            f"mean over azimuth, which differs by {100 * lost:.0f} % of the light; tensor4 keeps it.",
            SpeculariaWarning,
            stacklevel=4,
        )


def _origin(model: ScatteringModel, side: str) -> str:
    origin = getattr(model, "origin", None)
    return str(origin(side)) if callable(origin) else "model"


def evaluate(
    model: ScatteringModel,
    side: str,
    *,
    theta_i_deg: ArrayLike,
    phi_i_deg: ArrayLike = 0.0,
    ux: ArrayLike,
    uy: ArrayLike,
) -> Array:
    """BSDF in 1/sr of a model; arguments broadcast; NaN outside the unit disk.

    Parameters
    ----------
    model, side : what is asked.
    theta_i_deg, phi_i_deg : incident direction; theta_i from the normal of the face the light arrives on.
    ux, uy : outgoing direction cosines along the sample's x and y.
    """
    return model.evaluate(side, theta_i_deg, phi_i_deg, ux, uy)


def direct_hemispherical(
    model: ScatteringModel, side: str, *, theta_i_deg: ArrayLike, phi_i_deg: ArrayLike = 0.0
) -> Array:
    """Direct-hemispherical transmission or reflection of a model; NaN where it has no data."""
    return model.direct_hemispherical(side, theta_i_deg, phi_i_deg)
