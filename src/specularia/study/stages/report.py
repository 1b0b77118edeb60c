"""Stage report: one page with everything the study made, and where it comes from."""

from __future__ import annotations

import os
import shutil
import time
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
    "finds": "The finds",
    "twin": "The synthetic specimen",
    "measured": "Measured distributions",
    "model_m": "Model M, from the measurement",
    "surfaces": "The faces of the glass",
    "model_c": "Model C, from the geometry",
    "table_1": "Direct-hemispherical transmission",
    "dsf": "Distributions of the models",
    "view": "The models, to be turned about",
    "fragment": "The specimen over a printed sheet",
    "room": "The lit room",
    "healed_front": "The front as it may have been",
    "healed_back": "The back as it may have been",
    "model_h": "Model H, the pane as it may have been",
    "explain": "Why Model C and the measurement differ",
    "infer": "What the glass is like",
}
"""Sections of the page: what the published study has, in its order, then what goes beyond it."""

_PUBLISHED = "“Daylight scattering by late antique window glass from Ephesus” (CHNT 24, Vienna, 2019)"
"""The study whose figures and tables the page follows."""


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
            "versions": "as of the study" if manifest["versions"] == here else manifest["versions"],
            "synthetic": "yes: made by a computer program, not measured" if name in synthetic else "no",
        }
    page(work.parameters["title"], sections, provenance, work.folder / PAGE, date=_today())
    return {"synthetic": bool(synthetic), "page": PAGE}


def _today() -> str:
    """The day on which the page is made, by SOURCE_DATE_EPOCH where that is set (reproducible-builds.org)."""
    seconds = float(os.environ.get("SOURCE_DATE_EPOCH") or time.time())
    return time.strftime("%d %B %Y", time.gmtime(seconds)).lstrip("0")


def _opening(note: str, synthetic: list[str]) -> list[str]:
    """Paragraphs under the title."""
    texts = [" ".join(part.split()) for part in note.split("\n\n") if part.strip()]
    if synthetic:
        texts.append(
            "Synthetic: the specimen of this study was made by a computer program, and so were its "
            "measurements. What follows from it is labelled synthetic, here and in every figure."
        )
    texts.append(
        f"Figures and tables follow the order of the published study {_PUBLISHED} as far as "
        "this study has the data, and captions name the counterpart there; what goes beyond it comes "
        "after. The numbers of every figure and table are in the file that its caption names, which also "
        "lies beside this page. The provenance of all is at the end."
    )
    return texts


def _block(block: Mapping[str, Any], source: Path, folder: Path) -> Block:
    """A block of the page; its files are copied beside the page, so that the folder can be moved."""
    from specularia.report import Embed, Figure, Paragraph, TableBlock
    from specularia.report.style import numbers_beside

    if block["kind"] == "text":
        return Paragraph(block["text"], block["remarks"])
    folder.mkdir(parents=True, exist_ok=True)
    if block["kind"] == "figure":
        path = shutil.copy2(source / block["path"], folder)
        numbers = numbers_beside(source / block["path"])
        data = None if numbers is None else Path(shutil.copy2(numbers, folder))
        return Figure(
            Path(path), block["caption"], data=data, synthetic=block["synthetic"], like=block["like"]
        )
    if block["kind"] == "view":
        for file in (block["still"], numbers_beside(source / block["still"]), block["path"]):
            if file is not None:
                shutil.copy2(source / file, folder)
        return Embed(
            folder / block["path"],
            block["caption"],
            synthetic=block["synthetic"],
            still=folder / block["still"],
        )
    csv = None if block["csv"] is None else Path(shutil.copy2(source / block["csv"], folder))
    return TableBlock(
        header=block["header"],
        rows=block["rows"],
        caption=block["caption"],
        csv=csv,
        synthetic=block["synthetic"],
        like=block["like"],
    )
