"""What a page is made of: sections of paragraphs, figures and tables."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

__all__ = ["Block", "Embed", "Figure", "Paragraph", "Section", "TableBlock"]

Cell = str | int | float | None


@dataclass(frozen=True)
class Paragraph:
    """Running text; the page escapes it.

    Parameters
    ----------
    text : the paragraph.
    remarks : lines of a list below it, in small print.
    """

    text: str
    remarks: Sequence[str] = ()


@dataclass(frozen=True)
class Figure:
    """A picture with its numbers.

    Parameters
    ----------
    path : PNG, embedded in the page.
    caption : states method, numbers, uncertainty and what is synthetic; the page numbers it.
    data : CSV or NPZ with the figure's numbers, offered as a download; None looks for one beside the picture.
    synthetic : True puts the label "synthetic" before the caption.
    like : the figure of another publication that this one is the counterpart of, as "Fig. 9".
    """

    path: Path
    caption: str
    data: Path | None = None
    synthetic: bool = False
    like: str = ""


@dataclass(frozen=True)
class TableBlock:
    """A table with its numbers.

    Parameters
    ----------
    header : names of the columns.
    rows : cells; text stands as it is, floats get three significant decimals, None and NaN a dash.
    caption : states method, numbers, uncertainty and what is synthetic; the page numbers it.
    csv : file with the same numbers in full, offered as a download; None offers the rows themselves.
    synthetic : True puts the label "synthetic" before the caption.
    like : the table of another publication that this one is the counterpart of, as "Table 1".
    """

    header: Sequence[str]
    rows: Sequence[Sequence[Cell]]
    caption: str
    csv: Path | None = None
    synthetic: bool = False
    like: str = ""


@dataclass(frozen=True)
class Embed:
    """A self-contained HTML file (such as a view of a model) shown within the page.

    Parameters
    ----------
    path : the HTML file; it is embedded whole.
    caption : numbered with the figures.
    synthetic : True puts the label "synthetic" before the caption.
    still : PNG that takes its place on paper, with its numbers beside it.
    """

    path: Path
    caption: str
    synthetic: bool = False
    still: Path | None = None


Block = Paragraph | Figure | TableBlock | Embed
"""What a section is made of."""


@dataclass(frozen=True)
class Section:
    """A titled part of a page."""

    title: str
    blocks: Sequence[Block]
