"""The graph of stages: what runs, what is kept, and what a killed run leaves."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import textwrap
import time
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import pytest

from specularia.errors import FormatError, OutputError
from specularia.study.code import closure, code_digest
from specularia.study.engine import Run, Stage, Work, execute, plan


def copy(work: Work) -> Mapping[str, Any]:
    text = work.inputs["source"][0].read_text()
    (work.folder / "text").write_text(text + str(work.parameters.get("suffix", "")))
    return {"length": len(text)}


def join(work: Work) -> Mapping[str, Any]:
    text = "".join((folder / "text").read_text() for _, folder in sorted(work.results.items()))
    (work.folder / "text").write_text(text)
    return {"lengths": [work.summary(name)["length"] for name in sorted(work.results)]}


def fail(work: Work) -> Mapping[str, Any]:
    (work.folder / "half").write_text("half")
    raise FormatError(file="x", expected="a", found="b")


def graph(folder: Path, suffix: str = "") -> list[Stage]:
    """Sources a and b; ab joins both, only_a follows a alone. Declared in an order that must be undone."""
    return [
        Stage("ab", join, needs=("a", "b")),
        Stage("a", copy, inputs={"source": (folder / "a.txt",)}),
        Stage("b", copy, inputs={"source": (folder / "b.txt",)}, parameters={"suffix": suffix}),
        Stage("only_a", join, needs=("a",)),
    ]


@pytest.fixture
def sources(tmp_path: Path) -> Path:
    (tmp_path / "a.txt").write_text("A")
    (tmp_path / "b.txt").write_text("B")
    return tmp_path


def run(folder: Path, **choice: Any) -> Run:
    suffix = choice.pop("suffix", "")
    return execute(plan(graph(folder, suffix), folder / "out", **choice), folder / "out")


def test_stages_run_after_what_they_need_and_their_products_are_found_by_name(sources: Path) -> None:
    done = run(sources)
    assert done.computed.index("ab") > max(done.computed.index("a"), done.computed.index("b"))
    assert set(done.computed) == set(done.seconds) == {"a", "b", "ab", "only_a"}
    assert (sources / "out" / "ab" / "text").read_text() == "AB"
    manifest = json.loads((done.folders["ab"] / "stage.json").read_text())
    assert manifest["summary"] == {"lengths": [1, 1]}
    assert manifest["files"] == {"text": 2}


def test_a_second_run_does_nothing(sources: Path) -> None:
    first = run(sources)
    again = run(sources)
    assert again.computed == ()
    assert again.folders == first.folders
    assert set(again.seconds.values()) == {0.0}


def test_changing_one_input_reruns_only_what_depends_on_it(sources: Path) -> None:
    run(sources)
    (sources / "b.txt").write_text("b")
    done = run(sources)
    assert set(done.computed) == {"b", "ab"}
    assert (sources / "out" / "ab" / "text").read_text() == "Ab"


def test_a_touched_but_equal_input_reruns_nothing_and_an_old_state_is_found_again(sources: Path) -> None:
    run(sources)
    (sources / "b.txt").write_text("b")
    run(sources)
    (sources / "b.txt").write_text("B")
    assert run(sources).computed == ()
    assert (sources / "out" / "ab" / "text").read_text() == "AB"


def test_changing_a_parameter_reruns_only_what_depends_on_it(sources: Path) -> None:
    run(sources)
    assert set(run(sources, suffix="!").computed) == {"b", "ab"}


@pytest.mark.parametrize("damage", ["remove", "cut", "manifest"])
def test_a_damaged_result_is_made_again(sources: Path, damage: str) -> None:
    folder = run(sources).folders["b"]
    if damage == "remove":
        (folder / "text").unlink()
    elif damage == "cut":
        (folder / "text").write_text("")
    else:
        (folder / "stage.json").write_text("{")
    assert run(sources).computed == ("b",)
    assert (folder / "text").read_text() == "B"


def test_only_brings_a_stage_and_its_needs_up_to_date_and_leaves_the_rest(sources: Path) -> None:
    done = run(sources, only=["only_a"])
    assert done.computed == ("a", "only_a")
    assert set(done.seconds) == {"a", "only_a"}
    assert run(sources, only=["only_a"]).computed == ()


def test_from_runs_a_stage_and_all_that_follow_from_it_again(sources: Path) -> None:
    run(sources)
    assert set(run(sources, start="b").computed) == {"b", "ab"}
    assert set(run(sources, start="a").computed) == {"a", "ab", "only_a"}


def test_planning_says_why_and_touches_nothing(sources: Path) -> None:
    def why() -> dict[str, str]:
        return {s.stage.name: s.why for s in plan(graph(sources), sources / "out")}

    assert why()["a"] == "no result yet"
    assert not (sources / "out").exists()
    run(sources)
    assert set(why().values()) == {"up to date"}
    (sources / "b.txt").write_text("b")
    assert why() == {
        "a": "up to date",
        "b": "input files changed: source",
        "ab": "needs b, which runs",
        "only_a": "up to date",
    }
    changed = {s.stage.name: s.why for s in plan(graph(sources, suffix="?"), sources / "out")}
    assert changed["b"] == "settings changed: suffix"


def test_a_failing_stage_leaves_no_result_and_keeps_what_is_finished(sources: Path) -> None:
    stages = [*graph(sources), Stage("bad", fail, needs=("ab",))]
    with pytest.raises(FormatError):
        execute(plan(stages, sources / "out"), sources / "out")
    assert not list((sources / "out" / "stages").glob("*bad*"))
    assert [s.stage.name for s in plan(stages, sources / "out") if s.action == "run"] == ["bad"]


def test_a_killed_run_leaves_finished_results_only_and_goes_on(tmp_path: Path) -> None:
    program = textwrap.dedent(
        """
        import sys, time
        from pathlib import Path
        from specularia.study.engine import Stage, execute, plan

        out = Path(sys.argv[1])

        def quick(work):
            (work.folder / "text").write_text("quick")
            return {}

        def slow(work):
            (work.folder / "text").write_text("half")
            out.with_name("started").touch()
            time.sleep(float(sys.argv[2]))
            (work.folder / "text").write_text("whole")
            return {}

        stages = [Stage("quick", quick), Stage("slow", slow, needs=("quick",))]
        print(*execute(plan(stages, out), out).computed)
        """
    )
    script = tmp_path / "script.py"
    script.write_text(program)
    out = tmp_path / "out"
    process = subprocess.Popen([sys.executable, str(script), str(out), "60"])
    while not (tmp_path / "started").exists():
        assert process.poll() is None
        time.sleep(0.05)
    os.kill(process.pid, signal.SIGKILL)
    process.wait()
    finished = [p.name for p in (out / "stages").iterdir() if not p.name.startswith(".")]
    assert [name.split("-")[0] for name in finished] == ["quick"]
    again = subprocess.run(
        [sys.executable, str(script), str(out), "0"], capture_output=True, text=True, check=True
    )
    assert again.stdout.split() == ["slow"]
    assert (out / "slow" / "text").read_text() == "whole"
    assert not list((out / "stages").glob(".*"))


def test_two_runs_cannot_share_an_output_folder(sources: Path) -> None:
    fcntl = pytest.importorskip("fcntl")
    out = sources / "out"
    out.mkdir()
    with (out / ".lock").open("w") as handle:
        fcntl.flock(handle, fcntl.LOCK_EX)
        with pytest.raises(OutputError, match="another run"):
            run(sources)
    assert len(run(sources).computed) == 4


def test_what_is_wrong_with_a_graph_is_said_by_name(sources: Path) -> None:
    with pytest.raises(ValueError, match=r"no stage 'c' in this study; it has ab, a, b, only_a"):
        plan(graph(sources), sources / "out", only=["c"])
    with pytest.raises(ValueError, match="x needs y"):
        plan([Stage("x", join, needs=("y",))], sources / "out")
    with pytest.raises(ValueError, match="circle"):
        plan([Stage("x", join, needs=("y",)), Stage("y", join, needs=("x",))], sources / "out")
    (sources / "a.txt").unlink()
    with pytest.raises(FormatError, match=r"a\.txt"):
        plan(graph(sources), sources / "out")


def test_an_output_folder_that_cannot_be_made_is_an_output_error(sources: Path) -> None:
    (sources / "out").write_text("a file")
    with pytest.raises(OutputError):
        run(sources)


def test_the_code_of_a_stage_is_what_its_module_reaches_and_no_more() -> None:
    reached = closure("specularia.provenance")
    assert reached == {"specularia.provenance"}
    assert "specularia.errors" in closure("specularia.jobs")  # through files and errors
    assert not any(name.startswith("specularia.cli") for name in closure("specularia.study.engine"))
    assert code_digest(copy) != code_digest(join)
    assert code_digest(plan) != code_digest(execute)
