"""What the README promises: its commands exist and its five lines of Python run."""

from __future__ import annotations

import re
import runpy
import shlex
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from specularia import bsdf, gonio
from specularia.gonio import Table

README = Path(__file__).resolve().parents[2] / "README.md"


def blocks(language: str) -> list[str]:
    return re.findall(rf"```{language}\n(.*?)```", README.read_text(encoding="utf-8"), re.S)


def write_table(path: Path, theta_i: float, tau: float) -> None:
    rng = np.random.default_rng(5)
    theta_s = 180.0 - np.degrees(np.arcsin(np.sqrt(rng.random(6000))))
    values = tau / np.pi * np.abs(np.cos(np.radians(theta_s)))
    phi_s = 360.0 * rng.random(6000)
    gonio.write(
        Table("", "DSF", "transmission_front", theta_i, 0.0, theta_s, phi_s, values, band="520 nm"), path
    )


def test_the_lines_of_python_run(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    (code,) = blocks("python")
    assert len(code.strip().splitlines()) <= 6
    write_table(tmp_path / "t00.dat", 0.0, 0.6)
    write_table(tmp_path / "t40.dat", 40.0, 0.5)
    assert "resolution=6" in code
    (tmp_path / "example.py").write_text(code.replace("resolution=6", "resolution=5"))  # to save time
    monkeypatch.chdir(tmp_path)
    runpy.run_path("example.py")
    printed = [float(x) for x in re.findall(r"\d\.\d+", capsys.readouterr().out)]
    assert printed[0] == pytest.approx(0.6, rel=0.01)
    assert printed[2] == pytest.approx(0.5, rel=0.01)
    read = bsdf.read(tmp_path / "pane.xml")
    assert float(read.direct_hemispherical("transmission_front", 40.0)) == pytest.approx(0.5, rel=0.05)


def test_every_command_it_names_exists(command: Callable[..., tuple[int, Any, str]]) -> None:
    named = [
        shlex.split(line)
        for block in blocks("sh")
        for line in block.splitlines()
        if line.startswith("specularia ")
    ]
    assert len(named) >= 4
    for words in named:
        code, out, _ = command(*words[1 : 3 if words[1] == "study" else 2], "--help")
        assert code == 0
        for option in (w for w in words if w.startswith("-")):
            assert option in out
