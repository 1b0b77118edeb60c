"""What others rely on: every command is there, answers --help and keeps its exit codes and its stdout."""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

Command = Callable[..., tuple[int, Any, str]]

COMMANDS = (
    ("demo",),
    ("study", "run"),
    ("study", "new"),
    ("study", "check"),
    ("twin",),
    ("gonio", "info"),
    ("gonio", "fit"),
    ("surface", "heights"),
    ("surface", "info"),
    ("surface", "heal"),
    ("glass", "trace"),
    ("bsdf", "info"),
    ("bsdf", "check"),
    ("bsdf", "tau"),
    ("bsdf", "slice"),
    ("bsdf", "compare"),
    ("bsdf", "view"),
    ("daylight", "run"),
    ("finds", "summary"),
)

RANDOM = (("demo",), ("study", "run"), ("twin",), ("glass", "trace"), ("daylight", "run"))


def leaves() -> Iterator[tuple[tuple[str, ...], Any]]:
    from typer.main import get_command

    from specularia.cli import _build

    def walk(words: tuple[str, ...], command: Any) -> Iterator[tuple[tuple[str, ...], Any]]:
        children = getattr(command, "commands", None)
        if children is None:
            yield words, command
        for name, child in (children or {}).items():
            yield from walk((*words, name), child)

    yield from walk((), get_command(_build()))


def test_the_program_has_every_command_of_its_public_face() -> None:
    assert set(COMMANDS) <= {words for words, _ in leaves()}


@pytest.mark.parametrize("words", COMMANDS, ids=" ".join)
def test_every_command_answers_help_on_stdout(command: Command, words: tuple[str, ...]) -> None:
    code, out, err = command(*words, "--help")
    assert code == 0
    assert "Usage:" in out
    assert not err


def test_every_command_knows_json_and_quiet_and_those_with_chance_a_seed() -> None:
    options = {words: {o for p in c.params for o in p.opts} for words, c in leaves()}
    assert all({"--json", "-q"} <= found for found in options.values()), options
    assert all("--seed" in options[words] for words in RANDOM)


def test_every_option_of_every_command_is_explained() -> None:
    silent = [(words, p.name) for words, c in leaves() for p in c.params if not getattr(p, "help", "")]
    assert not silent


WRONG = (
    ("nonsense",),
    ("gonio", "nonsense"),
    ("bsdf", "tau"),
    ("bsdf", "tau", "any.nc", "--theta", ""),
    ("bsdf", "tau", "any.nc", "--theta", "0,nan"),
    ("bsdf", "tau", "any.nc", "--phi", "nan"),
    ("surface", "heights", "any.tif", "-o", "map.txt"),
    ("surface", "heal", "any.nc", "-o", "map.txt"),
    ("demo", "--x"),
)


@pytest.mark.parametrize("words", WRONG, ids=" ".join)
def test_wrong_usage_is_exit_code_2(command: Command, words: tuple[str, ...]) -> None:
    code, out, err = command(*words)
    assert code == 2
    assert not out
    assert "Usage:" in err


MISSING = (
    ("gonio", "info", "MISSING"),
    ("gonio", "fit", "MISSING", "-o", "OUT.nc"),
    ("surface", "info", "MISSING"),
    ("surface", "heights", "MISSING", "-o", "OUT.nc"),
    ("surface", "heal", "MISSING", "-o", "OUT.nc"),
    ("glass", "trace", "MISSING", "-o", "OUT.nc"),
    ("bsdf", "info", "MISSING"),
    ("bsdf", "check", "MISSING"),
    ("bsdf", "tau", "MISSING", "--theta", "0"),
    ("bsdf", "slice", "MISSING", "--theta", "0", "--size", "8", "-o", "OUT.npz"),
    ("bsdf", "compare", "MISSING", "MISSING", "-o", "OUT"),
    ("bsdf", "view", "MISSING", "-o", "OUT.html"),
    ("daylight", "run", "MISSING", "-o", "OUT"),
    ("finds", "summary", "MISSING", "-o", "OUT"),
    ("study", "run", "MISSING", "-o", "OUT"),
)


@pytest.mark.parametrize("words", MISSING, ids=lambda words: " ".join(words[:2]))
def test_a_missing_file_is_exit_code_3_by_name_and_leaves_nothing(
    command: Command, tmp_path: Path, words: tuple[str, ...]
) -> None:
    suffix = {"bsdf": ".xml", "gonio": ".txt", "surface": ".nc", "finds": ".csv"}.get(words[0], ".toml")
    names = {"MISSING": str(tmp_path / f"not_here{suffix}")}
    code, out, err = command(*[names.get(w, str(tmp_path / w) if w.startswith("OUT") else w) for w in words])
    assert code == 3
    assert not out
    assert "not_here" in err
    assert not list(tmp_path.rglob("*.*"))


def test_json_on_stdout_is_one_object_and_all_else_goes_to_stderr(tmp_path: Path) -> None:
    study = tmp_path / "study.toml"
    study.write_text('[gonio]\ntables = ["nothing/*.txt"]\n')
    done = subprocess.run(
        [sys.executable, "-m", "specularia", "study", "check", str(study), "--json"],
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 3
    assert list(json.loads(done.stdout)) == ["problems"]
    assert "nothing/*.txt" in json.loads(done.stdout)["problems"][0]


def test_the_version_is_the_package_s(command: Command) -> None:
    from specularia import __version__

    assert command("--version")[:2] == (0, f"{__version__}\n")
