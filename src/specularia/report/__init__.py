"""Figures, tables, the page and the viewer.

`figures` draws one picture per function and saves its numbers beside it; `page` writes one self-contained
HTML file from records; `viewer.write_view` writes an interactive picture of models that opens offline;
`day_page.write_day` writes a day in a lit room, hour by hour, in the same way.
"""

from __future__ import annotations

from specularia.report import day_page, figures, tables, viewer
from specularia.report.document import page
from specularia.report.records import Block, Embed, Figure, Paragraph, Section, TableBlock

__all__ = [
    "Block",
    "Embed",
    "Figure",
    "Paragraph",
    "Section",
    "TableBlock",
    "day_page",
    "figures",
    "page",
    "tables",
    "viewer",
]
