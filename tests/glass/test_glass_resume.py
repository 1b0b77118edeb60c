"""An interrupted model goes on where it was, and ends with the same bits; wherever it is traced."""

import os
import signal
import subprocess
import sys
import time

import numpy as np
import pytest
from glass_reference import smooth_map

from specularia.bsdf import read_model
from specularia.errors import SpeculariaError
from specularia.glass import Face, Medium, Slab, directions
from specularia.glass.checkpoint import Store, content_digest
from specularia.glass.cluster import Cluster
from specularia.glass.model import traced_model

THETA = (0.0, 50.0, 75.0)
SETTINGS = {"theta_deg": THETA, "paths": 200_000, "target_error": 0.12, "seed": 5}


@pytest.fixture(scope="module")
def slab() -> Slab:
    return Slab(
        thickness_mm=1.0,
        medium=Medium(absorption_per_mm=0.05),
        front=Face(smooth_map((48, 60), seed=1, rms_slope=0.2), 1.5, 1.5),
    )


@pytest.fixture(scope="module")
def whole(slab):
    return traced_model(slab, **SETTINGS).model


def assert_same(a, b):
    assert set(a.tables) == set(b.tables)
    for side in a.tables:
        for name in ("base", "base_se", "patch", "patch_se", "tau", "tau_se"):
            np.testing.assert_array_equal(getattr(a.tables[side], name), getattr(b.tables[side], name))


def test_a_model_interrupted_after_any_direction_ends_as_if_it_had_not_been(
    slab, whole, tmp_path, monkeypatch
):
    real, traced = directions.trace_direction, []

    def counted(*arguments):
        if len(traced) in (1, 3):
            traced.append("interrupted")
            raise KeyboardInterrupt
        traced.append(arguments[1])
        return real(*arguments)

    monkeypatch.setattr(directions, "trace_direction", counted)
    for _ in range(2):
        with pytest.raises(KeyboardInterrupt):
            traced_model(slab, **SETTINGS, output=tmp_path / "c.nc")
        assert len(list(tmp_path.glob("c.nc.*.partial"))) == 1
    found = traced_model(slab, **SETTINGS, output=tmp_path / "c.nc")
    done = [d for d in traced if d != "interrupted"]
    assert len(done) == len(set(done)) == 2 * len(THETA), "no direction was traced twice"
    assert_same(found.model, whole)
    found.store.remove()
    assert not list(tmp_path.iterdir())


def test_another_pane_seed_or_effort_does_not_take_over_what_is_there(slab):
    from dataclasses import replace

    from specularia.glass.directions import Task
    from specularia.glass.effort import Effort

    task = Task(Effort(100), 1)
    key = content_digest(slab, task)
    rougher = replace(slab, front=Face(slab.front.heights_um * 1.001, 1.5, 1.5))
    others = [
        (rougher, task),
        (replace(slab, thickness_mm=1.1), task),
        (replace(slab, polarised=False), task),
        (slab, replace(task, seed=2)),
        (slab, replace(task, wavelength_nm=521.0)),
        (slab, Task(Effort(101), 1)),
    ]
    assert content_digest(slab, task) == key
    assert len({content_digest(*o) for o in others} | {key}) == len(others) + 1


def test_a_part_that_was_cut_short_is_done_again(slab, tmp_path):
    store = Store(tmp_path / "c.nc", key="0" * 64)
    outcome = directions.trace_direction(
        slab, directions.Direction("front", 10.0), directions.Task(directions.Effort(1000))
    )
    store.save("one", outcome)
    kept = store.load("one", directions.Outcome)
    assert kept.transmitted.share == outcome.transmitted.share
    np.testing.assert_array_equal(kept.reflected.patch_se, outcome.reflected.patch_se)
    file = next(store.path.iterdir())
    file.write_bytes(file.read_bytes()[:200])
    assert store.load("one", directions.Outcome) is None
    assert store.load("two", directions.Outcome) is None


GLASS = """thickness_mm = 1.0
[medium]
absorption_per_mm = 0.05
[front]
heights = "front.npy"
pitch_um = 1.5
[back]
flat = true
"""


@pytest.mark.skipif(os.name != "posix", reason="kill -9")
def test_a_killed_command_goes_on_from_its_finished_directions(tmp_path, command):
    np.save(tmp_path / "front.npy", smooth_map((48, 60), seed=1, rms_slope=0.2))
    (tmp_path / "glass.toml").write_text(GLASS)
    words = ["glass", "trace", str(tmp_path / "glass.toml"), "--paths", "20000", "--seed", "3", "-o"]
    running = subprocess.Popen(
        [sys.executable, "-m", "specularia", *words, str(tmp_path / "c.nc")],
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
    )
    deadline = time.monotonic() + 120
    while len(list(tmp_path.glob("c.nc.*.partial/[!.]*.npz"))) < 4 and time.monotonic() < deadline:
        time.sleep(0.01)
    running.send_signal(signal.SIGKILL)
    running.wait()
    kept = len(list(tmp_path.glob("c.nc.*.partial/[!.]*.npz")))
    assert 4 <= kept < 36
    assert not (tmp_path / "c.nc").exists()
    code, _, err = command(*words, tmp_path / "c.nc")
    assert code == 0
    assert f"{kept} of 36 directions were finished before" in err
    assert not list(tmp_path.glob("*.partial"))
    assert command(*words, tmp_path / "d.nc")[0] == 0
    assert_same(read_model(tmp_path / "c.nc"), read_model(tmp_path / "d.nc"))


def test_a_cluster_is_asked_for_in_one_way():
    with pytest.raises(SpeculariaError, match="either"):
        Cluster()
    with pytest.raises(SpeculariaError, match="either"):
        Cluster(workers=2, scheduler="tcp://127.0.0.1:1")


def test_without_dask_the_message_says_what_to_install(monkeypatch):
    monkeypatch.setitem(sys.modules, "distributed", None)
    with pytest.raises(SpeculariaError, match="pip install dask distributed"), Cluster(workers=1):
        pass


def test_two_workers_give_the_bits_of_one_process(slab, whole):
    pytest.importorskip("distributed", reason="dask.distributed is not installed")
    with Cluster(workers=2) as pool:
        assert_same(traced_model(slab, **SETTINGS, pool=pool).model, whole)


def test_a_killed_worker_costs_only_its_own_directions(slab, tmp_path):
    """Of two workers one is killed in the midst of its work; the model has the bits of one process."""
    pytest.importorskip("distributed", reason="dask.distributed is not installed")
    many = {"theta_deg": tuple(range(0, 80, 10)), "paths": 400_000, "seed": 2}
    with Cluster(workers=2) as pool:
        outcomes = pool.outcomes

        def killing(*arguments):
            for k, found in enumerate(outcomes(*arguments)):
                if k == 1:
                    victim = next(iter(pool.client.run(os.getpid).values()))
                    os.kill(victim, signal.SIGKILL)
                yield found

        pool.outcomes = killing
        found = traced_model(slab, **many, pool=pool, output=tmp_path / "c.nc")
    assert_same(found.model, traced_model(slab, **many).model)
    assert len(list(found.store.path.glob("*.npz"))) == 2 * len(many["theta_deg"])


def test_a_scheduler_that_does_not_answer_is_named(monkeypatch):
    pytest.importorskip("distributed", reason="dask.distributed is not installed")
    monkeypatch.setattr("specularia.glass.cluster._WAIT_S", 1)
    with pytest.raises(SpeculariaError, match=r"127\.0\.0\.1:9"), Cluster(scheduler="tcp://127.0.0.1:9"):
        pass
