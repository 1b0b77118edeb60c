"""Stage report: one page with everything the study made, and where it comes from."""

from __future__ import annotations

import shutil
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from specularia.provenance import versions

if TYPE_CHECKING:
    from specularia.report import Block
    from specularia.study.engine import Work

__all__ = ["PAGE", "report"]

PAGE = "report.html"
"""Name of the page in the result of the stage."""

_TITLES = {
    "twin": "The synthetic specimen",
    "measured": "Measured distributions",
    "model_m": "Model M, from the measurement",
    "surfaces": "The faces of the glass",
    "model_c": "Model C, from the geometry",
    "healed_front": "The front as it may have been",
    "healed_back": "The back as it may have been",
    "model_h": "Model H, the pane as it may have been",
    "table_1": "Direct-hemispherical transmission",
    "dsf": "Distributions of the models",
    "room": "The lit room",
    "finds": "The finds",
}
"""Sections of the page in their order."""


def report(work: Work) -> Mapping[str, Any]:
    """Put texts, figures and tables of all stages on one page, with the provenance of each stage."""
    from specularia.report import Paragraph, Section, page

    manifests = {name: work.manifest(name) for name in work.results}
    synthetic = sorted(name for name, m in manifests.items() if m["summary"].get("synthetic"))
    sections = [Section("What this is", [Paragraph(t) for t in _opening(work.parameters["note"], synthetic)])]
    for name, title in _TITLES.items():
        if name in manifests:
            blocks = [
                _block(b, work.results[name], work.folder / "figures" / name)
                for b in manifests[name]["summary"].get("blocks", ())
            ]
            sections.append(Section(title, blocks))
    here = versions()
    provenance = {"study": {"title": work.parameters["title"], **work.parameters["study"], "versions": here}}
    for name, manifest in manifests.items():
        provenance[name] = {
            "key": manifest["key"],
            "inputs": {file: digest for found in manifest["inputs"].values() for file, digest in found},
            "parameters": manifest["parameters"],
            "from stages": ", ".join(manifest["needs"]),
            "files in them": ", ".join(f"{s}/{p}" for found in manifest["within"].values() for s, p in found),
            "seconds": manifest["seconds"],
            "versions": "as of the study" if manifest["versions"] == here else manifest["versions"],
            "synthetic": "yes: made by a computer program, not measured" if name in synthetic else "no",
        }
    page(work.parameters["title"], sections, provenance, work.folder / PAGE)
    return {"synthetic": bool(synthetic), "page": PAGE}


def _opening(note: str, synthetic: list[str]) -> list[str]:
    """Paragraphs under the title."""
    texts = [" ".join(part.split()) for part in note.split("\n\n") if part.strip()]
    if synthetic:
        texts.append(
            "Synthetic: the specimen of this study was made by a computer program, and so were its "
            "measurements. What follows from it is labelled synthetic. Stages concerned: "
            + ", ".join(synthetic)
            + "."
        )
    return texts or ["Everything that this study made, with its provenance at the end."]


def _block(block: Mapping[str, Any], source: Path, folder: Path) -> Block:
    """A block of the page; its files are copied beside the page, so that the folder can be moved."""
    from specularia.report import Figure, Paragraph, TableBlock
    from specularia.report.style import numbers_beside

    if block["kind"] == "text":
        return Paragraph(block["text"])
    folder.mkdir(parents=True, exist_ok=True)
    if block["kind"] == "figure":
        path = shutil.copy2(source / block["path"], folder)
        numbers = numbers_beside(source / block["path"])
        data = None if numbers is None else Path(shutil.copy2(numbers, folder))
        return Figure(Path(path), block["caption"], data=data, synthetic=block["synthetic"])
    csv = None if block["csv"] is None else Path(shutil.copy2(source / block["csv"], folder))
    return TableBlock(
        header=block["header"],
        rows=block["rows"],
        caption=block["caption"],
        csv=csv,
        synthetic=block["synthetic"],
    )
