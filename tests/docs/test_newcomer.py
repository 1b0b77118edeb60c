"""What the README tells a newcomer to do is what `.ci/run` does from nothing."""

from __future__ import annotations

import os
import re
import runpy
import subprocess
from fnmatch import fnmatch
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
CI = ROOT / ".ci"
GALLERY = "docs/gallery/*.py"

pytestmark = pytest.mark.skipif(not (CI / "run").exists(), reason="the checks (.ci/run) are not here")


@pytest.fixture(scope="module")
def commands() -> list[str]:
    found: list[str] = runpy.run_path(str(CI / "readme.py"))["commands"](
        (ROOT / "README.md").read_text(encoding="utf-8")
    )
    return found


def patterns() -> list[str]:
    """What `.ci/run` asks the README for."""
    return re.findall(r"(?:readme|newcomer) '([^']+)'", (CI / "run").read_text(encoding="utf-8"))


def test_all_commands_of_the_readme_are_found(commands: list[str]) -> None:
    text = (ROOT / "README.md").read_text(encoding="utf-8")
    assert len(commands) >= 9
    assert text.count("```sh") == 5
    for command in commands:
        assert command in text
    for start in ("pip install", "specularia demo", "specularia study", "python docs/gallery", "pytest"):
        assert any(command.startswith(start) for command in commands), start


def test_each_command_of_the_readme_is_run_once_by_the_checks(commands: list[str]) -> None:
    assert f"for script in {GALLERY}" in (CI / "run").read_text(encoding="utf-8")
    for command in commands:
        if command.startswith("python "):
            script = command.removeprefix("python ")
            assert fnmatch(script, GALLERY)
            assert (ROOT / script).is_file()
            continue
        asked = [pattern for pattern in patterns() if re.search(pattern, command)]
        assert len(asked) == 1, f"{command}: {asked}"
    for pattern in patterns():
        assert any(re.search(pattern, command) for command in commands), pattern


@pytest.mark.skipif(
    not os.environ.get("SPECULARIA_NEWCOMER"),
    reason="minutes long, and .ci/run does it anyway; SPECULARIA_NEWCOMER=1 runs it",
)
@pytest.mark.timeout(3600)
def test_a_newcomer_gets_from_nothing_to_report_gallery_and_documentation() -> None:
    done = subprocess.run(
        [CI / "run", "install", "demo", "study", "gallery", "docs"], capture_output=True, text=True
    )
    assert done.returncode == 0, done.stdout[-4000:] + done.stderr[-4000:]
    for name in ("install", "demo", "study", "gallery", "docs"):
        assert re.search(rf"^== {name}: \d+ s$", done.stdout, re.M)
