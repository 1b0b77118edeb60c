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

__all__ = ["DIRECTIONS", "FILE_BANDS", "LENGTHS", "band_in_file", "document", "structure_of"]

FILE_BANDS = ("Visible", "Solar", "NIR", "CIE-X", "CIE-Z", "CIE-u", "CIE-v")
"""Bands that files name; everything else is written as Visible, with a note of what it was."""

DIRECTIONS = {
    "transmission_front": "Transmission Front",
    "transmission_back": "Transmission Back",
    "reflection_front": "Reflection Front",
    "reflection_back": "Reflection Back",
}


LENGTHS = ("Thickness", "Width", "Height")
"""Elements of the material that hold a length."""


def band_in_file(band: str) -> str:
    """The band under which a model is written: its own, or Visible."""
    for known in FILE_BANDS:
        if band.casefold() == known.casefold():
            return known
    return "Visible"


def structure_of(parts: Mapping[str, Part]) -> str:
    """IncidentDataStructure of a file with these sides; matrices are written as Columns."""
    found = {f"TensorTree{p.tree.rank}" if isinstance(p, TreePart) else "Columns" for p in parts.values()}
    if len(found) != 1:
        raise PhysicsError("one XML file holds matrices only or trees of one rank only.")
    return found.pop()


def document(
    parts: Mapping[str, Part],
    *,
    band: str,
    attributes: Mapping[str, str] | None = None,
    origins: Mapping[str, str] | None = None,
    geometry: str = "",
    more: Mapping[str, Mapping[str, Part]] | None = None,
) -> str:
    """The text of an XML file.

    Parameters
    ----------
    parts : sides; all of them matrices, or all of them trees of one rank.
    band : what light the data are for; one that files do not know is written as Visible and noted.
    attributes : name, manufacturer, thickness_mm, width_mm and height_mm go into the material; the rest, such
        as provenance, stands as "key: value" lines in a comment at the top.
    origins : for each side, where its numbers come from; goes into the comment.
    geometry : a Geometry element as text, where there is one.
    more : the sides of further bands, by the name that each has in the file, in their order there; where this
        band is among them it stands in its place and keeps its name.
    """
    material = dict(attributes or {})
    origins = origins or {}
    name = material.pop("name", "") or material.get("title", "") or "specularia model"
    manufacturer = material.pop("manufacturer", "")
    lengths = {k: material.pop(f"{k.lower()}_mm") for k in LENGTHS if f"{k.lower()}_mm" in material}
    for own in ("band", "measured_band", *SIDES):
        material.pop(own, None)
    written = band if band in (more or {}) else band_in_file(band)
    bands = {**(more or {}), written: parts}
    everything = [p for sides in bands.values() for p in sides.values()]
    structure = structure_of(dict(zip(map(str, range(len(everything))), everything)))
    notes = {"band": band, **material, **{s: origins[s] for s in SIDES if s in origins}}
    comment = "\n".join(f"{k}: {' '.join(str(v).split())}" for k, v in notes.items())
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
        f"<Manufacturer>{escape(manufacturer)}</Manufacturer>",
        "<DeviceType>Other</DeviceType>",
    ]
    lines += [f'<{key} unit="millimeter">{value}</{key}>' for key, value in lengths.items()]
    lines += ["</Material>", geometry or "<Geometry></Geometry>"]
    lines += ["<DataDefinition>", f"<IncidentDataStructure>{structure}</IncidentDataStructure>"]
    bases = {b.name: b for p in everything if isinstance(p, KlemsPart) for b in (p.incident, p.outgoing)}
    for basis in bases.values():
        lines += _basis_lines(basis)
    lines += ["</DataDefinition>"]
    for name_of_band, sides in bands.items():
        measured = band if name_of_band == written else name_of_band
        for side in SIDES:
            if side in sides:
                lines += _side_lines(sides[side], side, written=name_of_band, measured=measured)
    lines += ["</Layer>", "</Optical>", "</WindowElement>", ""]
    return "\n".join(lines)


def _side_lines(part: Part, side: str, *, written: str, measured: str) -> list[str]:
    if measured.casefold() == "visible":
        source, detector = "CIE Illuminant D65 1nm.ssp", "ASTM E308 1931 Y.dsp"
    else:
        renamed = measured.casefold() != written.casefold()
        source, detector = (f"{measured} (written as {written})" if renamed else measured), "none"
    return [
        "<WavelengthData>",
        "<LayerNumber>System</LayerNumber>",
        f'<Wavelength unit="Integral">{escape(written)}</Wavelength>',
        f"<SourceSpectrum>{escape(source)}</SourceSpectrum>",
        f"<DetectorSpectrum>{detector}</DetectorSpectrum>",
        "<WavelengthDataBlock>",
        f"<WavelengthDataDirection>{DIRECTIONS[side]}</WavelengthDataDirection>",
        *_data_lines(part, side),
        "</WavelengthDataBlock>",
        "</WavelengthData>",
    ]


def _basis_lines(basis: KlemsBasis) -> list[str]:
    lines = ["<AngleBasis>", f"<AngleBasisName>{escape(basis.name)}</AngleBasisName>"]
    for low, high, count in zip(basis.bounds_deg[:-1], basis.bounds_deg[1:], basis.phi_count):
        centre = 0.0 if low == 0 and count == 1 else 0.5 * (low + high)
        lines += [
            "<AngleBasisBlock>",
            f"<Theta>{centre:.10g}</Theta>",
            f"<nPhis>{count}</nPhis>",
            f"<ThetaBounds><LowerTheta>{low:.10g}</LowerTheta>"
            f"<UpperTheta>{high:.10g}</UpperTheta></ThetaBounds>",
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
