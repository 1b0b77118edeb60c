"""Figures, tables, the page and the viewer.

`figures` draws one picture per function and saves its numbers beside it; `page` writes one self-contained
HTML file from records; `viewer.write_view` writes an interactive picture of models that opens offline.
"""

from __future__ import annotations

from specularia.report import figures, tables, viewer
from specularia.report.document import page
from specularia.report.records import Block, Embed, Figure, Paragraph, Section, TableBlock

__all__ = [
    "Block",
    "Embed",
    "Figure",
    "Paragraph",
    "Section",
    "TableBlock",
    "figures",
    "page",
    "tables",
    "viewer",
]
