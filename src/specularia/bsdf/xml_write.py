"""Writing WINDOW 6/7 XML that Radiance and others read."""

from __future__ import annotations

import re
from collections.abc import Mapping
from xml.sax.saxutils import escape

import numpy as np

from specularia.bsdf.klems import KlemsBasis
from specularia.bsdf.xml_model import KlemsPart, Part, TreePart
from specularia.conventions import SIDES
from specularia.errors import PhysicsError

__all__ = ["FILE_BANDS", "band_in_file", "document"]

FILE_BANDS = ("Visible", "Solar", "NIR", "CIE-X", "CIE-Z", "CIE-u", "CIE-v")
"""Bands that files name; everything else is written as Visible, with a note of what it was."""

DIRECTIONS = {
    "transmission_front": "Transmission Front",
    "transmission_back": "Transmission Back",
    "reflection_front": "Reflection Front",
    "reflection_back": "Reflection Back",
}


def band_in_file(band: str) -> str:
    """The band under which a model is written: its own, or Visible."""
    for known in FILE_BANDS:
        if band.casefold() == known.casefold():
            return known
    return "Visible"


def document(
    parts: Mapping[str, Part],
    *,
    band: str,
    name: str,
    attributes: Mapping[str, str],
    origins: Mapping[str, str],
    thickness_mm: float | None = None,
    geometry: str | None = None,
) -> str:
    """The text of an XML file with one band.

    Parameters
    ----------
    parts : sides; all of them matrices, or all of them trees of one rank.
    band : what light the data are for; one that files do not know is written as Visible and noted.
    name : of the material.
    attributes : provenance; it stands as "key: value" lines in a comment at the top.
    origins : for each side, where its numbers come from.
    thickness_mm : of the pane, where known.
    geometry : text of a Geometry element to keep, where there is one.
    """
    structures = {_structure(p) for p in parts.values()}
    if len(structures) != 1:
        raise PhysicsError("one XML file holds matrices only or trees of one rank only.")
    (structure,) = structures
    written = band_in_file(band)
    notes = {"band": band, **attributes, **{s: origins[s] for s in SIDES if s in origins}}
    comment = "\n".join(f"{k}: {' '.join(str(v).split())}" for k, v in notes.items())
    measured = band if written == "Visible" and band.casefold() != "visible" else ""
    source = "CIE Illuminant D65 1nm.ssp" if not measured else f"{measured} (written as Visible)"
    lines = [
        '<?xml version="1.0" encoding="UTF-8"?>',
        # Two hyphens in a row may not stand in an XML comment.
        f"<!-- specularia\n{re.sub('-(?=-)|-$', '- ', comment)}\n-->",
        '<WindowElement xmlns="http://windows.lbl.gov" xmlns:xsi="http://www.w3.org/2001/XMLSchema-instance" '
        'xsi:schemaLocation="http://windows.lbl.gov/BSDF-v1.4.xsd">',
        "<WindowElementType>System</WindowElementType>",
        "<FileType>BSDF</FileType>",
        "<Optical>",
        "<Layer>",
        "<Material>",
        f"<Name>{escape(name)}</Name>",
        "<Manufacturer></Manufacturer>",
        "<DeviceType>Other</DeviceType>",
    ]
    if thickness_mm is not None:
        lines.append(f'<Thickness unit="millimeter">{thickness_mm:g}</Thickness>')
    lines += ["</Material>", geometry or "<Geometry></Geometry>"]
    lines += ["<DataDefinition>", f"<IncidentDataStructure>{structure}</IncidentDataStructure>"]
    bases = {b.name: b for p in parts.values() if isinstance(p, KlemsPart) for b in (p.incident, p.outgoing)}
    for basis in bases.values():
        lines += _basis_lines(basis)
    lines += ["</DataDefinition>"]
    for side in SIDES:
        if side in parts:
            lines += [
                "<WavelengthData>",
                "<LayerNumber>System</LayerNumber>",
                f'<Wavelength unit="Integral">{written}</Wavelength>',
                f"<SourceSpectrum>{escape(source)}</SourceSpectrum>",
                "<DetectorSpectrum>ASTM E308 1931 Y.dsp</DetectorSpectrum>",
                "<WavelengthDataBlock>",
                f"<WavelengthDataDirection>{DIRECTIONS[side]}</WavelengthDataDirection>",
                *_data_lines(parts[side], side),
                "</WavelengthDataBlock>",
                "</WavelengthData>",
            ]
    lines += ["</Layer>", "</Optical>", "</WindowElement>", ""]
    return "\n".join(lines)


def _structure(part: Part) -> str:
    return f"TensorTree{part.tree.rank}" if isinstance(part, TreePart) else "Columns"


def _basis_lines(basis: KlemsBasis) -> list[str]:
    lines = ["<AngleBasis>", f"<AngleBasisName>{escape(basis.name)}</AngleBasisName>"]
    for low, high, count in zip(basis.bounds_deg[:-1], basis.bounds_deg[1:], basis.phi_count):
        centre = 0.0 if low == 0 and count == 1 else 0.5 * (low + high)
        lines += [
            "<AngleBasisBlock>",
            f"<Theta>{centre:g}</Theta>",
            f"<nPhis>{count}</nPhis>",
            f"<ThetaBounds><LowerTheta>{low:g}</LowerTheta><UpperTheta>{high:g}</UpperTheta></ThetaBounds>",
            "</AngleBasisBlock>",
        ]
    return [*lines, "</AngleBasis>"]


def _data_lines(part: Part, side: str) -> list[str]:
    if isinstance(part, TreePart):
        kind, text = ["<AngleBasis>LBNL/Shirley-Chiu</AngleBasis>"], part.tree.to_text()
    elif isinstance(part, KlemsPart):
        kind = [
            f"<ColumnAngleBasis>{escape(part.incident.name)}</ColumnAngleBasis>",
            f"<RowAngleBasis>{escape(part.outgoing.name)}</RowAngleBasis>",
        ]
        text = "\n".join(", ".join(f"{v:.7g}" for v in row) for row in np.maximum(part.matrix, 0.0))
    else:
        raise PhysicsError("a side made by reciprocity is written as a tree; build one first.")
    return [
        *kind,
        f"<ScatteringDataType>{'BTDF' if side.startswith('transmission') else 'BRDF'}</ScatteringDataType>",
        "<ScatteringData>",
        text,
        "</ScatteringData>",
    ]
