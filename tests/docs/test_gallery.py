"""The scripts of the gallery and the tutorial: short, by themselves, public interface only, and they run."""

from __future__ import annotations

import ast
import importlib
import json
import re
import runpy
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest

ROOT = Path(__file__).resolve().parents[2]
DOCS = ROOT / "docs"
SCRIPTS = sorted((DOCS / "gallery").glob("*.py"))
TUTORIAL = DOCS / "tutorial.ipynb"
SUBJECTS = ("measure_to_model", "scan_to_model", "compare", "room", "heal", "explain")


def code_of(path: Path) -> str:
    if path.suffix == ".py":
        return path.read_text(encoding="utf-8")
    cells = json.loads(path.read_text(encoding="utf-8"))["cells"]
    return "\n\n".join("".join(c["source"]) for c in cells if c["cell_type"] == "code")


def in_reference(name: str) -> bool:
    text = (DOCS / "reference" / "python.md").read_text(encoding="utf-8")
    return re.search(rf"^\.\. automodule:: {re.escape(name)}$", text, re.M) is not None


def names_used(code: str) -> set[tuple[str, str]]:
    """(module, name) of everything that a script takes from this package."""
    tree = ast.parse(code)
    used: set[tuple[str, str]] = set()
    modules: dict[str, ModuleType] = {}
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            assert not any(alias.name.startswith("specularia") for alias in node.names)
        if isinstance(node, ast.ImportFrom) and (node.module or "").startswith("specularia"):
            for alias in node.names:
                try:
                    modules[alias.asname or alias.name] = importlib.import_module(
                        f"{node.module}.{alias.name}"
                    )
                except ModuleNotFoundError:
                    used.add((str(node.module), alias.name))
    for node in ast.walk(tree):
        if isinstance(node, ast.Attribute):
            parts, inner = [node.attr], node.value
            while isinstance(inner, ast.Attribute):
                parts.insert(0, inner.attr)
                inner = inner.value
            if isinstance(inner, ast.Name) and inner.id in modules:
                module = modules[inner.id]
                while len(parts) > 1 and isinstance(getattr(module, parts[0], None), ModuleType):
                    module = getattr(module, parts.pop(0))
                used.add((module.__name__, parts[0]))
    return used


def test_there_is_a_script_for_each_subject() -> None:
    assert [re.sub(r"^\d_", "", script.stem) for script in SCRIPTS] == list(SUBJECTS)


@pytest.mark.parametrize("path", [*SCRIPTS, TUTORIAL], ids=lambda path: path.stem)
def test_only_public_names_are_used(path: Path) -> None:
    used = names_used(code_of(path))
    assert len(used) >= 4
    for module, name in used:
        assert in_reference(module), module
        assert name in importlib.import_module(module).__all__, f"{module}.{name}"


@pytest.mark.parametrize("script", SCRIPTS, ids=lambda path: path.stem)
def test_a_script_is_short_and_says_that_its_data_are_synthetic(script: Path) -> None:
    code = code_of(script)
    assert len(code.splitlines()) <= 130
    assert "synthetic" in str(ast.get_docstring(ast.parse(code)))
    for call in ast.walk(ast.parse(code)):
        if isinstance(call, ast.Call) and ast.unparse(call.func).startswith("figures."):
            labelled = any(word.arg == "synthetic" for word in call.keywords)
            # A budget knows by itself that its pane is synthetic.
            assert labelled or ast.unparse(call.func) == "figures.budget"


def test_the_tutorial_is_kept_without_results() -> None:
    book = json.loads(TUTORIAL.read_text(encoding="utf-8"))
    code = [cell for cell in book["cells"] if cell["cell_type"] == "code"]
    assert len(code) >= 6
    assert all(not cell["outputs"] and cell["execution_count"] is None for cell in code)
    assert book["metadata"]["kernelspec"]["language"] == "python"
    assert TUTORIAL.stat().st_size < 40_000


@pytest.mark.slow
def test_the_tutorial_runs_and_ends_in_a_lit_room(tmp_path: Path) -> None:
    hooks: dict[str, Any] = runpy.run_path(str(DOCS / "hooks.py"))
    cells = hooks["run_cells"](TUTORIAL, tmp_path)
    printed = "".join(text for _, _, text, _ in cells)
    drawn = [picture for *_, pictures in cells for picture in pictures]
    assert len(drawn) >= 4
    assert all(picture.startswith(b"\x89PNG") for picture in drawn)
    found = dict(re.findall(r"^(M|C) +floor in the light +([\d.]+) lx", printed, re.M))
    light = {name: float(value) for name, value in found.items()}
    assert light.keys() == {"M", "C"}
    # Model C is told the true absorption, so both light the room alike.
    assert light["C"] == pytest.approx(light["M"], rel=0.25)
