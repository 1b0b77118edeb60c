"""The structure: data flows one way through the packages, one module starts programs, help is fast."""

from __future__ import annotations

import ast
import os
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

import specularia

ROOT = Path(specularia.__file__).parent
GROUND = ("conventions", "errors", "files", "jobs", "progress", "provenance", "radiance")
ORDER = (
    "bsdf",
    "surface",
    "gonio",
    "glass",
    "twin",
    "analysis",
    "daylight",
    "finds",
    "report",
    "study",
    "cli",
)
HEAVY = ("numba", "scipy", "matplotlib", "xarray", "skimage", "SurfaceTopography", "pyradiance", "numpy")


def modules() -> list[Path]:
    return sorted(ROOT.rglob("*.py"))


def imports(tree: ast.AST) -> Iterator[str]:
    """Every absolute name imported below a node; `from a import b` gives a and a.b."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, "relative imports hide the graph"
            yield str(node.module)
            yield from (f"{node.module}.{alias.name}" for alias in node.names)


def row(module: str) -> int | None:
    """Place of one of our modules in the order: 0 for the ground floor, None for the root."""
    parts = module.split(".")
    if parts[0] != "specularia" or len(parts) == 1:
        return None
    if parts[1] in GROUND:
        return 0
    return ORDER.index(parts[1]) + 1 if parts[1] in ORDER else None


def name_of(file: Path) -> str:
    relative = file.relative_to(ROOT).with_suffix("")
    return ".".join(("specularia", *relative.parts)).removesuffix(".__init__")


def test_every_package_has_its_place_in_the_order() -> None:
    found = {p.relative_to(ROOT).parts[0].removesuffix(".py") for p in modules()}
    assert found == {*GROUND, *ORDER, "__init__", "__main__"}


def test_a_package_imports_only_from_rows_above_its_own() -> None:
    wrong, seen = [], 0
    for file in modules():
        own = row(name_of(file))
        if own is None:
            continue
        for name in imports(ast.parse(file.read_text(encoding="utf-8"))):
            other = row(name)
            if other is None:
                continue
            seen += 1
            package = name.split(".")[1]
            same = own == 0 or package == ORDER[own - 1]
            if other > own or (other == own and not same):
                wrong.append(f"{name_of(file)} imports {name}")
    assert not wrong
    assert seen > 50


def test_only_the_radiance_module_starts_programs() -> None:
    starters = {"subprocess", "os.system", "os.popen", "multiprocessing", "pty"}
    found = {
        name_of(file)
        for file in modules()
        if starters & set(imports(ast.parse(file.read_text(encoding="utf-8"))))
    }
    assert found == {"specularia.radiance"}
    calls = {
        name_of(file)
        for file in modules()
        for node in ast.walk(ast.parse(file.read_text(encoding="utf-8")))
        if isinstance(node, ast.Attribute)
        and isinstance(node.value, ast.Name)
        and node.value.id == "os"
        and node.attr in {"system", "popen", "fork", "execv", "execvp", "spawnv", "posix_spawn"}
    }
    assert not calls


def test_commands_import_no_science_at_module_level() -> None:
    wrong = []
    for file in (ROOT / "cli").glob("*.py"):
        top = ast.parse(file.read_text(encoding="utf-8")).body
        for node in top:
            for name in imports(node) if isinstance(node, (ast.Import, ast.ImportFrom)) else ():
                first = name.split(".")
                ours = first[0] == "specularia" and len(first) > 1 and first[1] in ORDER[:-1]
                if first[0] in HEAVY or ours:
                    wrong.append(f"{file.name} imports {name}")
    assert not wrong


def test_help_answers_within_six_tenths_of_a_second_of_processor_time() -> None:
    resource = pytest.importorskip("resource")
    times = []
    for _ in range(4):
        before = resource.getrusage(resource.RUSAGE_CHILDREN)
        done = subprocess.run(
            [sys.executable, "-m", "specularia", "--help"],
            capture_output=True,
            text=True,
            check=True,
            env={**os.environ, "COLUMNS": "80"},
        )
        after = resource.getrusage(resource.RUSAGE_CHILDREN)
        times.append(after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime)
    assert "Window glass" in done.stdout
    assert min(times) < 0.6
