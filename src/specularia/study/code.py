"""Which code a stage runs: a digest of its own source and of everything of this package that it imports."""

from __future__ import annotations

import ast
import hashlib
import inspect
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any

import specularia

__all__ = ["closure", "code_digest"]

_ROOT = Path(specularia.__file__).parent
_DATA = {".html", ".css", ".js", ".j2", ".json", ".csv", ".svg", ".rad", ".cal", ".txt"}
"""Suffixes of files that code of this package reads as a part of itself."""


def code_digest(function: Callable[..., Any]) -> str:
    """SHA-256 over the source that decides what a function of this package computes.

    A function of this package is followed through the imports of its module, those inside functions included
    and those for type checkers only left out; files that are not Python (templates, tables) count with the
    package that holds them. The version number alone is not counted: a release that does not touch a stage's
    code keeps its results. A function from elsewhere counts by its own source. Reference: ours.
    """
    module = function.__module__
    if module.split(".")[0] == "specularia":
        return hashlib.sha256((_closure_digest(module) + function.__qualname__).encode()).hexdigest()
    return hashlib.sha256(inspect.getsource(function).encode()).hexdigest()


@cache
def _closure_digest(module: str) -> str:
    h = hashlib.sha256()
    files: set[Path] = set()
    for name in closure(module):
        file = _file(name)
        assert file is not None
        files.add(file)
        if file.parent != _ROOT:
            files.update(p for p in file.parent.rglob("*") if p.suffix in _DATA)
    for file in sorted(files):
        h.update(file.relative_to(_ROOT).as_posix().encode())
        h.update(file.read_bytes())
    return h.hexdigest()


@cache
def closure(module: str) -> frozenset[str]:
    """Modules of this package that importing and running `module` can reach, itself included."""
    found: set[str] = set()
    todo = [module]
    while todo:
        name = todo.pop()
        file = _file(name)
        if name in found or file is None:
            continue
        found.add(name)
        parts = name.split(".")
        todo += [".".join(parts[:k]) for k in range(2, len(parts))]
        todo += _imports(file)
    return frozenset(found)


def _file(module: str) -> Path | None:
    """Source file of a module of this package; None for the package's root and for everything else."""
    first, *rest = module.split(".")
    if first != "specularia" or not rest:
        return None
    path = _ROOT.joinpath(*rest)
    for file in (path / "__init__.py", path.with_suffix(".py")):
        if file.is_file():
            return file
    return None


def _imports(file: Path) -> list[str]:
    """Absolute names that a file imports; `from a import b` counts as a and as a.b, which may be a module."""
    names: list[str] = []
    todo: list[ast.AST] = [ast.parse(file.read_text(encoding="utf-8"))]
    while todo:
        node = todo.pop()
        if isinstance(node, ast.If) and isinstance(node.test, ast.Name) and node.test.id == "TYPE_CHECKING":
            todo += node.orelse
            continue
        if isinstance(node, ast.Import):
            names += [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom) and node.module and node.level == 0:
            names.append(node.module)
            names += [f"{node.module}.{alias.name}" for alias in node.names]
        todo += ast.iter_child_nodes(node)
    return names
