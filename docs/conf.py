"""Sphinx settings, and the hooks that write the command reference from the program and run the tutorial."""

from __future__ import annotations

import re
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import specularia
from specularia.jobs import Job

sys.path.insert(0, str(Path(__file__).parent))  # for hooks.py

project = "specularia"
author = "The specularia contributors"
copyright = author
version = release = specularia.__version__

extensions = [
    "myst_parser",
    "sphinx.ext.autodoc",
    "sphinx.ext.mathjax",
    "sphinx.ext.napoleon",
    "sphinx_gallery.gen_gallery",
]
myst_enable_extensions = ["dollarmath", "amsmath", "deflist", "colon_fence"]
myst_heading_anchors = 3
exclude_patterns = ["_build", "gallery", "**/work", "sg_execution_times.rst"]
html_theme = "furo"
html_title = f"specularia {release}"
html_static_path: list[str] = []
nitpicky = False
# What a parameter is stands where numpydoc has its type; words of these sentences are no references.
suppress_warnings = ["ref.python"]

autodoc_member_order = "bysource"
autodoc_typehints = "signature"
autodoc_type_aliases = {"ArrayLike": "ArrayLike", "NDArray": "NDArray"}
autodoc_preserve_defaults = True
napoleon_google_docstring = False
napoleon_numpy_docstring = True
napoleon_use_rtype = False
napoleon_use_ivar = True

# The scripts in gallery are run, each when it or its page is new; `-D plot_gallery=0` only shows them.
sphinx_gallery_conf = {
    "examples_dirs": "gallery",
    "gallery_dirs": "examples",
    "filename_pattern": r"\.py$",
    "within_subsection_order": "FileNameSortKey",
    "image_scrapers": ("hooks.pictures",),
    "reset_modules": ("hooks.before_script",),
    "download_all_examples": False,
    "show_signature": False,
    "write_computation_times": False,
    "min_reported_time": 3600,
    "capture_repr": (),
    "remove_config_comments": True,
}


def setup(app: Any) -> None:
    """Write the pages that are made before Sphinx looks for them; take docstrings as they are meant."""
    app.connect("config-inited", lambda app, _: write_commands(Path(app.srcdir)))
    app.connect("config-inited", lambda app, _: write_tutorial(Path(app.srcdir)))
    app.connect("autodoc-process-docstring", plain_text, priority=400)  # before napoleon
    app.connect("autodoc-process-signature", no_signature_of_jobs)


def plain_text(app: Any, what: str, name: str, thing: Any, options: Any, lines: list[str]) -> None:
    """Read docstrings as they are meant.

    Bars are absolute values, a bracket may follow a name in backquotes, and a colon in the one sentence about
    an attribute does not end a type.
    """
    if what == "data" and (found := comment_below(name)):
        lines[:] = found  # and not what dict or tuple say of themselves
    lines[:] = [re.sub(r"(`[^`]+`)(?=[\w(])", r"\1\\ ", line.replace("|", "\\|")) for line in lines]
    if what in ("attribute", "data", "property"):
        lines[:0] = ["..", ""]  # an empty comment, where napoleon looks for the type


def comment_below(name: str) -> list[str]:
    """What stands below a constant in the module that a package takes it from."""
    from sphinx.pycode import ModuleAnalyzer

    package, _, constant = name.rpartition(".")
    value = getattr(sys.modules[package], constant)
    for module in [m for m in sys.modules if m.startswith(f"{package}.")]:
        if vars(sys.modules[module]).get(constant) is value:
            analyzer = ModuleAnalyzer.for_module(module)
            analyzer.analyze()
            if found := analyzer.attr_docs.get(("", constant)):
                return list(found)
    return []


def write_tutorial(source: Path) -> None:
    """Run the notebook and write its page (not kept in the repository)."""
    if (source / "tutorial.ipynb").exists():
        import hooks

        hooks.write_notebook(source / "tutorial.ipynb", source / "tutorial.md", source / "examples")


def no_signature_of_jobs(app: Any, what: str, name: str, thing: Any, *_: Any) -> tuple[str, None] | None:
    """Tables of job files are shown by their keys; their signature would only repeat them."""
    return ("", None) if what == "class" and issubclass(thing, Job) else None


def write_commands(source: Path) -> None:
    """Walk the commands of the program and write one page on all of them (not kept in the repository)."""
    from typer.main import get_command

    from specularia.cli import _build

    root = get_command(_build())
    lines = [
        "# Commands",
        "",
        "Made from the program itself. Every command also answers `--help`. Exit codes: 0 fine, 1 fault of "
        "the program, 2 wrong usage, 3 bad data (the message names file, line, what was expected and what "
        "was found).",
        "",
    ]
    for words, command in walk(root, ["specularia"]):
        lines += section(words, command)
    page = source / "reference" / "commands.md"
    text = "\n".join(lines)
    if not page.exists() or page.read_text(encoding="utf-8") != text:
        page.write_text(text, encoding="utf-8")


def walk(command: Any, words: list[str]) -> Iterator[tuple[list[str], Any]]:
    """Each command with the words that call it, groups before their commands."""
    yield words, command
    for name, child in getattr(command, "commands", {}).items():
        yield from walk(child, [*words, name])


def section(words: list[str], command: Any) -> list[str]:
    """Heading, what it does, how it is called, its arguments and options."""
    context = command.make_context(" ".join(words), [], resilient_parsing=True)
    usage = command.get_usage(context).removeprefix("Usage: ")
    lines = [f"{'#' * min(len(words) + 1, 4)} {' '.join(words)}", ""]
    lines += [paragraph(command.help or ""), "", "```text", usage, "```", ""]
    for parameter in command.params:
        found = parameter.get_help_record(context)
        if found is not None:
            lines += [f"`{found[0].strip()}`", f": {paragraph(found[1]) or '.'}", ""]
    return lines


def paragraph(text: str) -> str:
    """Help text as one paragraph per block, with the marks of Markdown made plain where help has none."""
    blocks = [" ".join(block.split()) for block in text.replace("\b", "").split("\n\n")]
    return "\n\n".join(blocks).replace("[", "\\[").replace("<", "&lt;")
