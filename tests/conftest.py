"""Fixtures shared by all tests."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from specularia.cli import main

SHARED = Path(__file__).resolve().parents[2] / "shared"


@pytest.fixture(scope="session")
def shared_data() -> Path:
    """Real files from others; the folder lies beside the repository and is not part of it."""
    folder = SHARED / "data"
    if not folder.is_dir():
        pytest.skip("the folder with real files (../shared/data) is not here")
    return folder


@pytest.fixture(scope="session")
def oracles() -> Path:
    """Generators of data with exactly known truth, beside the repository."""
    folder = SHARED / "oracles"
    if not folder.is_dir():
        pytest.skip("the folder with oracles (../shared/oracles) is not here")
    return folder


@pytest.fixture
def command(capsys: pytest.CaptureFixture[str]) -> Callable[..., tuple[int, Any, str]]:
    """Run a command in this process: (exit code, parsed JSON or text of stdout, text of stderr)."""

    def run(*words: str | Path) -> tuple[int, Any, str]:
        capsys.readouterr()
        code = main([str(w) for w in words])
        out, err = capsys.readouterr()
        if "--json" in words and code == 0:
            return code, json.loads(out), err
        return code, out, err

    return run
