"""Every public name of the package stands in the reference."""

from __future__ import annotations

import importlib
import json
import pkgutil
import shutil
import subprocess
import sys
from pathlib import Path
from types import ModuleType

import pytest

import specularia

DOCS = Path(__file__).resolve().parents[2] / "docs"
NO_INTERFACE = ("specularia.cli", "specularia.__main__")
"""Commands have a page of their own, made from the program."""

pytestmark = pytest.mark.slow


def public_modules() -> list[ModuleType]:
    """Every package and ground-floor module with public names, and the modules that these name."""
    found = [
        importlib.import_module(f"specularia.{info.name}")
        for info in pkgutil.iter_modules(specularia.__path__)
        if f"specularia.{info.name}" not in NO_INTERFACE
    ]
    named = [
        value
        for module in found
        for value in (getattr(module, name) for name in module.__all__)
        if isinstance(value, ModuleType)
    ]
    return [*found, *named]


READ = """
import io, json, sys
from pathlib import Path
from sphinx.application import Sphinx

source = Path(sys.argv[1])
app = Sphinx(
    srcdir=source,
    confdir=source,
    outdir=source / "out",
    doctreedir=source / "trees",
    buildername="dummy",
    confoverrides={
        "extensions": ["myst_parser", "sphinx.ext.autodoc", "sphinx.ext.mathjax", "sphinx.ext.napoleon"],
        "root_doc": "reference/python",
        "include_patterns": ["reference/python.md"],
    },
    status=io.StringIO(),
    warning=io.StringIO(),
)
app.builder.read()
objects = app.env.domaindata["py"]["objects"]
(source / "objects.json").write_text(json.dumps({name: entry.objtype for name, entry in objects.items()}))
"""


@pytest.fixture(scope="module")
def documented(tmp_path_factory: pytest.TempPathFactory) -> dict[str, str]:
    """What Sphinx makes of the page alone: full name -> kind.

    In a process of its own: autodoc rewrites the annotations of the classes it reads, pydantic's among them.
    """
    pytest.importorskip("myst_parser")
    source = tmp_path_factory.mktemp("docs")
    (source / "reference").mkdir()
    shutil.copy(DOCS / "conf.py", source)
    shutil.copy(DOCS / "reference" / "python.md", source / "reference")
    subprocess.run([sys.executable, "-c", READ, str(source)], check=True, capture_output=True, text=True)
    objects: dict[str, str] = json.loads((source / "objects.json").read_text())
    return objects


def test_every_public_name_stands_in_the_reference(documented: dict[str, str]) -> None:
    modules = public_modules()
    wanted = {f"{m.__name__}.{name}" for m in modules for name in m.__all__}
    assert len(wanted) > 300
    # A module among the public names has its own section.
    nested = {f"{m.__name__}.{n}": getattr(m, n) for m in modules for n in m.__all__}
    wanted = {v.__name__ if isinstance(v, ModuleType) else k for k, v in nested.items()}
    missing = sorted(wanted - documented.keys())
    assert not missing, f"{len(missing)} of {len(wanted)} are missing: {missing}"


def test_every_public_function_and_class_says_what_it_is(documented: dict[str, str]) -> None:
    silent = [
        f"{module.__name__}.{name}"
        for module in public_modules()
        for name in module.__all__
        if documented.get(f"{module.__name__}.{name}") in ("class", "function", "exception")
        and not (getattr(module, name).__doc__ or "").strip()
    ]
    assert not silent
