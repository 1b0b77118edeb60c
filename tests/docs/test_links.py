"""Links in the README, the documentation and the notes of validation lead somewhere."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator
from functools import cache
from itertools import pairwise
from pathlib import Path

import pytest
from markdown_it import MarkdownIt
from markdown_it.token import Token

ROOT = Path(__file__).resolve().parents[2]
MADE = ("docs/reference/commands.md", "docs/examples", "docs/tutorial.md")
"""Pages that are made when the documentation is built, and are not in the repository."""
PARSER = MarkdownIt("commonmark").enable("table")


def pages() -> list[Path]:
    """Every page of text that is kept."""
    found = [
        page
        for pattern in ("*.md", "docs/**/*.md", "docs/*.ipynb", "validation/*.md")
        for page in ROOT.glob(pattern)
        if not page.relative_to(ROOT).as_posix().startswith((*MADE, "docs/_build"))
    ]
    return sorted(found)


def text_of(page: Path) -> str:
    """The page as Markdown; of a notebook its cells of text."""
    if page.suffix == ".ipynb":
        cells = json.loads(page.read_text(encoding="utf-8"))["cells"]
        return "\n\n".join("".join(c["source"]) for c in cells if c["cell_type"] == "markdown")
    return page.read_text(encoding="utf-8")


def tokens(text: str) -> Iterator[Token]:
    for token in PARSER.parse(text):
        yield token
        yield from token.children or ()


def targets(text: str) -> list[str]:
    """Targets of all links and pictures, and of the figures of MyST."""
    found = [
        str(token.attrs["href" if token.type == "link_open" else "src"])
        for token in tokens(text)
        if token.type in ("link_open", "image")
    ]
    return found + re.findall(r"^```\{(?:figure|image|include)\} (\S+)", text, re.M)


@cache
def anchors(page: Path) -> frozenset[str]:
    """Headings as GitHub and MyST make anchors of them."""
    found: set[str] = set()
    parsed = PARSER.parse(text_of(page))
    for opening, inline in pairwise(parsed):
        if opening.type == "heading_open":
            words = "".join(c.content for c in inline.children or () if c.type in ("text", "code_inline"))
            slug = re.sub(r"[^\w\- ]", "", words.lower()).strip().replace(" ", "-")
            number = 1
            unique = slug
            while unique in found:
                unique, number = f"{slug}-{number}", number + 1
            found.add(unique)
    return frozenset(found)


def faults(page: Path, text: str) -> list[str]:
    """Links of a page that lead nowhere."""
    wrong = []
    for target in targets(text):
        path, _, anchor = target.partition("#")
        if re.match(r"https://doi\.org/", target):
            if not re.match(r"https://doi\.org/10\.\d{4,}/\S+$", target):
                wrong.append(f"{target}: no DOI")
            continue
        if re.match(r"(https?|mailto):", target):
            continue
        goal = (page.parent / path).resolve() if path else page
        if not goal.is_relative_to(ROOT):
            wrong.append(f"{target}: outside the repository")
        elif goal.relative_to(ROOT).as_posix().startswith(MADE):
            continue
        elif not goal.exists():
            wrong.append(f"{target}: no such file")
        elif anchor and anchor not in anchors(goal):
            wrong.append(f"{target}: no such heading")
    return wrong


@pytest.mark.parametrize("page", pages(), ids=lambda page: page.relative_to(ROOT).as_posix())
def test_every_link_leads_to_a_file_and_a_heading(page: Path) -> None:
    assert not faults(page, text_of(page))


def test_the_check_sees_links_that_lead_nowhere() -> None:
    page = ROOT / "README.md"
    text = (
        "[a](docs/nowhere.md) [b](docs/conventions.md#no-heading) [c](docs/conventions.md#quantities)\n\n"
        "[d](https://doi.org/10.1/short) ![e](docs/images/none.png) `[f](in-code.md)`\n\n"
        "```\n[g](in-a-block.md)\n```\n\n| h |\n|---|\n| [i](../outside.md) |\n"
    )
    assert [fault.split(":")[0] for fault in faults(page, text)] == [
        "docs/nowhere.md",
        "docs/conventions.md#no-heading",
        "https",
        "docs/images/none.png",
        "../outside.md",
    ]


@pytest.mark.parametrize(
    ("page", "wanted"),
    [
        ("README.md", ("docs/gallery", "docs/tutorial.ipynb", "docs/howto/own_study.md", "docs/radiance.md")),
        ("docs/index.md", ("examples/index", "tutorial.md", "howto/own_study.md", "radiance.md")),
    ],
)
def test_readme_and_index_lead_to_gallery_tutorial_own_data_and_radiance(
    page: str, wanted: tuple[str, ...]
) -> None:
    assert set(wanted) <= set(targets(text_of(ROOT / page)))
