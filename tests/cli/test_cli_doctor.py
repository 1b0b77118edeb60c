"""`specularia doctor` finds what is wrong and says what to do; completion offers commands."""

from __future__ import annotations

import math
import os
import subprocess
import sys
from importlib import metadata

import pytest

from specularia import radiance, study
from specularia.cli import main
from specularia.errors import RadianceError


def test_a_machine_that_runs_these_tests_is_well(command):
    code, out, _ = command("doctor", "--json")
    assert code == 0 and out["ok"] is True
    checks = {c["name"]: c for c in out["checks"]}
    assert all(c["ok"] for c in out["checks"])
    assert {"python", "specularia", "numpy", "pyradiance", "radiance", "threads", "memory", "GPU"} <= set(
        checks
    )
    assert checks["numpy"]["value"] == metadata.version("numpy")
    # The value that rtrace gave stands there; for a uniform sky it is pi.
    assert float(checks["radiance"]["value"].split()[2]) == pytest.approx(math.pi, rel=1e-3)


def broken(monkeypatch: pytest.MonkeyPatch, answer: bytes | Exception) -> None:
    real = radiance.run

    def run(command, **given):
        if command[0] != "rtrace":
            return real(command, **given)
        if isinstance(answer, Exception):
            raise answer
        return answer

    monkeypatch.setattr(radiance, "run", run)


@pytest.mark.parametrize(
    "answer", [b"2.5 2.5 2.5\n", b"", RadianceError(command=["rtrace"], code=127, stderr="no such library")]
)
def test_radiance_that_answers_wrongly_or_not_is_found_and_ends_with_code_1(monkeypatch, capsys, answer):
    broken(monkeypatch, answer)
    assert main(["doctor"]) == 1
    out = capsys.readouterr().out
    assert "NOT  radiance " in out and "pyradiance" in out and "1 thing to mend" in out
    # The other checks were made all the same.
    assert "ok   GPU" in out


def test_packages_that_are_missing_or_too_old_are_named_with_what_to_do(monkeypatch):
    real, asked = metadata.version, metadata.requires
    monkeypatch.setattr(metadata, "version", lambda name: "0.1" if name == "scipy" else real(name))
    monkeypatch.setattr(metadata, "requires", lambda name: [*asked(name), "no-such-package>=2"])
    checks = {c.name: c for c in study.diagnose()}
    assert not checks["scipy"].ok and checks["scipy"].advice.startswith("pip install 'scipy>=")
    assert not checks["no-such-package"].ok and checks["no-such-package"].value == "not installed"
    assert checks["numpy"].ok


def test_completion_offers_commands_and_options():
    def offered(words: str) -> set[str]:
        done = subprocess.run(
            [sys.executable, "-c", "from specularia.cli import entry; entry()"],
            env={
                **os.environ,
                "_SPECULARIA_COMPLETE": "complete_bash",
                "COMP_WORDS": words,
                "COMP_CWORD": str(len(words.split(" ")) - 1),
            },
            capture_output=True,
            text=True,
            check=False,
        )
        return set(done.stdout.split())

    assert offered("specularia fi") == {"finds"}
    assert {"demo", "doctor", "bsdf", "gonio"} <= offered("specularia ")
    assert "--mapping" in offered("specularia finds summary --m")
