"""Reading WINDOW 6/7 XML from anyone: Klems matrices and tensor trees, all bands and sides.

Tolerant of what real files hold: commas or blanks between values, tabs, units in any spelling, an empty
thickness, elements in any order, a ScatteringDataType that always says BTDF, bases defined in the file. Not
tolerant of data that cannot be right: a wrong count, words that are no numbers, an unknown basis.
"""

from __future__ import annotations

import re
import warnings
from collections.abc import Iterator
from pathlib import Path
from typing import Any
from xml.etree.ElementTree import Element, ParseError
from xml.sax.saxutils import escape, quoteattr

import numpy as np

from specularia.bsdf.klems import KlemsBasis, basis_named
from specularia.bsdf.tensor_tree import TensorTree, TreeSyntaxError
from specularia.bsdf.xml_model import KlemsPart, Part, TreePart, XmlModel
from specularia.bsdf.xml_write import DIRECTIONS, LENGTHS
from specularia.errors import CoverageError, FormatError, PhysicsError, SpeculariaWarning
from specularia.files import existing

__all__ = ["read_xml"]

_SIDES = {v.casefold(): k for k, v in DIRECTIONS.items()}
_BANDS = {b.casefold(): b for b in ("Visible", "Solar", "NIR", "CIE-X", "CIE-Y", "CIE-Z", "CIE-u", "CIE-v")}
_MILLIMETRES = {
    "meter": 1000.0,
    "metre": 1000.0,
    "m": 1000.0,
    "centimeter": 10.0,
    "centimetre": 10.0,
    "cm": 10.0,
    "millimeter": 1.0,
    "millimetre": 1.0,
    "mm": 1.0,
    "inch": 25.4,
    "in": 25.4,
    "foot": 304.8,
    "ft": 304.8,
}
_HIGHEST = 1e10
"""BSDF in 1/sr that no surface reaches: all light within a ten-thousandth of a degree."""
_FINEST = 12
"""log2 of the finest cells along an edge of a tree that is read."""
_NOTE = re.compile(rb"<!-- specularia\n(.*?)\n-->", re.DOTALL)


def read_xml(path: str | Path, *, band: str | None = None) -> XmlModel:
    """One band of a WINDOW XML file as a scattering model.

    Parameters
    ----------
    path : the file.
    band : Visible, Solar ...; None takes Visible, or CIE-Y, which is the same, or else the first band (the
        last two with a warning: Radiance knows Visible only).

    Raises
    ------
    FormatError : not such a file, or data that cannot be right; with file, line, expected and found.
    CoverageError : the band is not in the file.
    """
    models = _Reader(path).models()
    if band is None:
        band = next((b for b in ("Visible", "CIE-Y") if b in models), next(iter(models)))
        if band != "Visible":
            warnings.warn(
                f"{path}: no Visible band; {band} is used. Radiance would find nothing in it.",
                SpeculariaWarning,
                stacklevel=2,
            )
    for name, model in models.items():
        if name.casefold() == band.casefold():
            return model
    raise CoverageError(f"{path}: no band {band}; it holds {', '.join(models)}.")


def _local(element: Element) -> str:
    tag = element.tag
    return tag.rsplit("}", 1)[-1] if isinstance(tag, str) else ""


def _children(element: Element | None, name: str) -> Iterator[Element]:
    if element is not None:
        yield from (e for e in element if _local(e) == name)


def _child(element: Element | None, name: str) -> Element | None:
    return next(_children(element, name), None)


def _text(element: Element | None, name: str) -> str:
    found = _child(element, name)
    return " ".join((found.text or "").split()) if found is not None else ""


def _holds(element: Element) -> bool:
    return len(element) > 0 or bool((element.text or "").strip())


def _plain(element: Element) -> str:
    """An element as text, without the prefixes of its namespace, which other readers stumble over."""
    name = _local(element)
    start = " ".join([name, *(f"{k}={quoteattr(v)}" for k, v in element.attrib.items())])
    inner = escape(element.text or "") + "".join(_plain(e) + escape(e.tail or "") for e in element)
    return f"<{start}>{inner}</{name}>"


class _Reader:
    """One pass over one file."""

    def __init__(self, path: str | Path) -> None:
        self.path = existing(path, what="a BSDF file")
        try:
            raw = self.raw = self.path.read_bytes()
        except OSError as error:
            raise self._fault("a readable file", str(error.strerror)) from error
        self.root = self._parse()
        self.data_lines = [
            raw.count(b"\n", 0, m.start()) + 1 for m in re.finditer(rb"<(?:\w+:)?ScatteringData[\s>]", raw)
        ]

    def _fault(self, expected: str, found: str, line: int | None = None, advice: str = "") -> FormatError:
        return FormatError(file=self.path, line=line, expected=expected, found=found, advice=advice)

    def _parse(self) -> Element:
        from defusedxml.common import DefusedXmlException
        from defusedxml.ElementTree import fromstring

        try:
            root: Element = fromstring(self.raw, forbid_dtd=True)
        except DefusedXmlException as error:
            raise self._fault("plain XML", "a document type or entities, which are refused") from error
        except ParseError as error:
            line = error.position[0] if error.position else None
            raise self._fault(
                "well-formed XML", str(error), line, "The file may be truncated: copy it again."
            ) from error
        except (ValueError, LookupError) as error:
            raise self._fault("well-formed XML", str(error)) from error
        if _local(root) != "WindowElement":
            raise self._fault("the root element WindowElement", _local(root) or "another", 1)
        return root

    def models(self) -> dict[str, XmlModel]:
        """One scattering model per band."""
        layers = list(_children(_child(self.root, "Optical"), "Layer"))
        if not layers:
            raise self._fault("an optical layer", "none")
        if len(layers) > 1:
            warnings.warn(
                f"{self.path}: {len(layers)} layers; the first one is read, as Radiance does.",
                SpeculariaWarning,
                stacklevel=2,
            )
        layer = layers[0]
        material = _child(layer, "Material")
        structure = _text(_child(layer, "DataDefinition"), "IncidentDataStructure")
        kinds = {k.casefold(): k for k in ("Columns", "Rows", "TensorTree3", "TensorTree4")}
        if structure.casefold() not in kinds:
            raise self._fault(
                "IncidentDataStructure Columns, Rows, TensorTree3 or TensorTree4", structure or "none"
            )
        structure = kinds[structure.casefold()]
        own = [self._basis(e) for e in _children(_child(layer, "DataDefinition"), "AngleBasis")]
        parts = self._parts(layer, structure, own)
        attributes = self._attributes(material)
        geometry = next((g for e in (layer, material) for g in _children(e, "Geometry") if _holds(g)), None)
        return {
            band: XmlModel(
                parts=sides,
                band=band,
                structure=structure,
                bands=tuple(parts),
                attributes=attributes,
                geometry=self._geometry(geometry),
                all_bands=parts,
            )
            for band, sides in parts.items()
        }

    def _geometry(self, element: Element | None) -> str:
        try:
            return "" if element is None else _plain(element)
        except RecursionError as error:
            raise self._fault("a Geometry element", "one that is nested without end") from error

    def _attributes(self, material: Element | None) -> dict[str, str]:
        out = {"name": _text(material, "Name"), "manufacturer": _text(material, "Manufacturer")}
        for name in LENGTHS:
            length = self._length_mm(material, name)
            if length is not None:
                out[f"{name.lower()}_mm"] = f"{length:.10g}"
        note = _NOTE.search(self.raw)
        if note:
            for line in note.group(1).decode(errors="replace").splitlines():
                key, _, value = line.partition(": ")
                out["measured_band" if key == "band" else key] = value
        return {k: v for k, v in out.items() if v}

    def _length_mm(self, material: Element | None, name: str) -> float | None:
        element = _child(material, name)
        text = (element.text or "").strip() if element is not None else ""
        if element is None or not text:
            return None
        unit = (element.get("unit") or "meter").strip().casefold()
        factor = _MILLIMETRES.get(unit.removesuffix("s"), _MILLIMETRES.get(unit))
        try:
            value = float(text)
        except ValueError:
            value = float("nan")
        if factor is None or not np.isfinite(value) or value < 0:
            warnings.warn(
                f"{self.path}: the {name.lower()} {text!r} in {unit!r} is not understood and left out.",
                SpeculariaWarning,
                stacklevel=2,
            )
            return None
        return value * factor

    def _basis(self, element: Element) -> KlemsBasis:
        name = _text(element, "AngleBasisName")
        bounds, counts = [0.0], []
        for block in _children(element, "AngleBasisBlock"):
            limits = _child(block, "ThetaBounds")
            try:
                low, high = float(_text(limits, "LowerTheta")), float(_text(limits, "UpperTheta"))
                count = int(_text(block, "nPhis"))
            except ValueError as error:
                raise self._fault(f"numbers in the angle basis {name!r}", str(error)) from error
            if not (abs(low - bounds[-1]) <= 1e-4 or low == -high) or not np.isfinite(high):
                raise self._fault(f"rings of the angle basis {name!r} that join", f"{low} after {bounds[-1]}")
            bounds.append(high)
            counts.append(count)
        try:
            return KlemsBasis(name=name, bounds_deg=tuple(bounds), phi_count=tuple(counts))
        except (PhysicsError, ValueError) as error:
            raise self._fault("an angle basis", str(error)) from error

    def _parts(self, layer: Element, structure: str, own: list[KlemsBasis]) -> dict[str, dict[str, Part]]:
        out: dict[str, dict[str, Part]] = {}
        lines = iter(self.data_lines)
        skipped: list[str] = []
        for data in _children(layer, "WavelengthData"):
            named = _text(data, "Wavelength")
            band = _BANDS.get(named.casefold(), named)
            for block in _children(data, "WavelengthDataBlock"):
                direction = _text(block, "WavelengthDataDirection")
                element = _child(block, "ScatteringData")
                line = next(lines, None) if element is not None else None
                side = _SIDES.get(direction.casefold())
                if side is None or not band:
                    skipped.append(direction or "no direction")
                    continue
                if element is None or not (element.text or "").strip():
                    raise self._fault(f"ScatteringData for {direction}", "none", line)
                if len(element):
                    raise self._fault(
                        "numbers only in ScatteringData", f"an element {_local(element[0])}", line
                    )
                sides = out.setdefault(band, {})
                if side in sides:
                    raise self._fault(
                        f"{direction} once in the band {band}",
                        "it a second time",
                        line,
                        "Remove one of them.",
                    )
                sides[side] = (
                    self._tree(element.text or "", int(structure[-1]), line)
                    if structure.startswith("TensorTree")
                    else self._matrix(element.text or "", block, structure, own, line)
                )
        if not out:
            raise self._fault("WavelengthData with one of the four directions", ", ".join(skipped) or "none")
        if skipped:
            warnings.warn(
                f"{self.path}: {len(skipped)} data blocks are not understood and left out ({skipped[0]}).",
                SpeculariaWarning,
                stacklevel=2,
            )
        if len({frozenset(sides) for sides in out.values()}) > 1:
            held = "; ".join(f"{b}: {', '.join(s)}" for b, s in out.items())
            warnings.warn(
                f"{self.path}: the bands hold different sides ({held}).", SpeculariaWarning, stacklevel=2
            )
        negative = sum(p.negative for sides in out.values() for p in sides.values())
        if negative:
            warnings.warn(
                f"{self.path}: {negative} negative values; they count as zero, as in Radiance.",
                SpeculariaWarning,
                stacklevel=2,
            )
        return out

    def _tree(self, text: str, rank: int, line: int | None) -> TreePart:
        self._plain_numbers(text, line)
        try:
            with np.errstate(over="ignore"):
                tree = TensorTree.from_text(text, rank)
        except TreeSyntaxError as error:
            where = None if line is None else line + error.line - 1
            raise self._fault(error.expected, error.found, where) from error
        if tree.resolution > _FINEST:
            raise self._fault(f"cells of 2^-{_FINEST} at least", f"2^-{tree.resolution}", line)
        self._possible(tree.values, line)
        return TreePart(tree)

    def _matrix(
        self, text: str, block: Element, structure: str, own: list[KlemsBasis], line: int | None
    ) -> KlemsPart:
        found = {}
        for kind in ("ColumnAngleBasis", "RowAngleBasis"):
            name = _text(block, kind)
            basis = basis_named(name, own)
            if basis is None:
                raise self._fault(f"a known {kind}", repr(name), line)
            found[kind] = basis
        values = self._numbers(text, line)
        columns, rows = found["ColumnAngleBasis"], found["RowAngleBasis"]
        if values.size != columns.patches * rows.patches:
            raise self._fault(
                f"{rows.patches} x {columns.patches} = {rows.patches * columns.patches} values",
                str(values.size),
                line,
            )
        if structure == "Columns":
            return KlemsPart(
                matrix=values.reshape(rows.patches, columns.patches), incident=columns, outgoing=rows
            )
        # "Rows": each row is an incident patch; Radiance keeps the names of the bases where they are.
        return KlemsPart(
            matrix=values.reshape(columns.patches, rows.patches).T, incident=columns, outgoing=rows
        )

    def _plain_numbers(self, text: str, line: int | None) -> None:
        """Refuse what Python takes for a number and Radiance does not: 1_000, or digits of other scripts."""
        if text.isascii() and "_" not in text:
            return
        bad = next(k for k, c in enumerate(text) if c == "_" or not c.isascii())
        where = None if line is None else line + text.count("\n", 0, bad)
        raise self._fault("numbers", repr(text[max(bad - 8, 0) : bad + 8].strip()), where)

    def _possible(self, values: Any, line: int | None) -> None:
        if values.size and np.abs(values).max() > _HIGHEST:
            raise self._fault(f"a BSDF below {_HIGHEST:g} per steradian", f"{np.abs(values).max():g}", line)

    def _numbers(self, text: str, line: int | None) -> Any:
        self._plain_numbers(text, line)
        words = re.sub(r"[,;]", " ", text).split()
        try:
            values = np.array(words, dtype=float)
        except ValueError:
            bad = next(w for w in words if not _is_number(w))
            where = None if line is None else line + text.count("\n", 0, text.find(bad))
            raise self._fault("numbers", repr(bad[:20]), where) from None
        if not np.all(np.isfinite(values)):
            raise self._fault("finite numbers", "nan or infinity", line)
        self._possible(values, line)
        return values


def _is_number(word: str) -> bool:
    try:
        float(word)
    except ValueError:
        return False
    return True
