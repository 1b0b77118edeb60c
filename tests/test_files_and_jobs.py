"""Files are written whole or not at all; job files are refused with file, line and reason."""

from __future__ import annotations

from pathlib import Path

import pytest

from specularia import progress
from specularia.errors import FormatError, OutputError
from specularia.files import atomic, atomic_folder, read_netcdf, write_text
from specularia.jobs import FilePath, Job, load_toml
from specularia.provenance import digest, file_digest, record, to_json


class Face(Job):
    heights: FilePath
    pitch_um: float = 1.0


class Pane(Job):
    thickness_mm: float
    front: Face


def test_a_failed_write_leaves_what_stood_there(tmp_path: Path) -> None:
    target = write_text(tmp_path / "a.txt", "old")
    with pytest.raises(RuntimeError), atomic(target) as temporary:
        temporary.write_text("half")
        raise RuntimeError
    assert target.read_text() == "old"
    assert [p.name for p in tmp_path.iterdir()] == ["a.txt"]


def test_a_failed_folder_leaves_nothing(tmp_path: Path) -> None:
    with pytest.raises(RuntimeError), atomic_folder(tmp_path / "out") as temporary:
        (temporary / "x").write_text("half")
        raise RuntimeError
    assert list(tmp_path.iterdir()) == []


def test_a_missing_folder_is_named(tmp_path: Path) -> None:
    with pytest.raises(OutputError, match="nowhere"):
        write_text(tmp_path / "nowhere" / "a.txt", "x")


def test_a_truncated_netcdf_is_refused(tmp_path: Path) -> None:
    (tmp_path / "x.nc").write_bytes(b"\x89HDF\r\n\x1a\n" + bytes(50))
    with pytest.raises(FormatError, match="netCDF"):
        read_netcdf(tmp_path / "x.nc")


def test_paths_count_from_the_job_file(tmp_path: Path) -> None:
    file = tmp_path / "pane.toml"
    file.write_text('thickness_mm = 3\n[front]\nheights = "f.nc"\n')
    assert load_toml(file, Pane).front.heights == tmp_path / "f.nc"


@pytest.mark.parametrize(
    ("text", "line", "words"),
    [
        ('thickness_mm = 3\n[front]\nheigths = "f.nc"\n', 3, ["heigths", "Did you mean heights"]),
        ('thickness_mm = "a"\n[front]\nheights = "f.nc"\n', 1, ["thickness_mm", "'a'"]),
        ("thickness_mm = 3\n[front]\npitch_um = 2\n", 2, ["front.heights"]),
        ("thickness_mm = = 3\n", 1, ["TOML"]),
    ],
)
def test_a_faulty_job_names_line_and_key(tmp_path: Path, text: str, line: int, words: list[str]) -> None:
    file = tmp_path / "pane.toml"
    file.write_text(text)
    with pytest.raises(FormatError) as caught:
        load_toml(file, Pane)
    assert caught.value.line == line
    assert all(w in str(caught.value) for w in [*words, "pane.toml"])


def test_digest_does_not_depend_on_the_order_of_keys() -> None:
    assert digest({"a": 1, "b": [1, 2]}) == digest({"b": [1, 2], "a": 1})
    assert digest({"a": 1}) != digest({"a": 2})


def test_a_folder_digest_changes_with_names_and_bytes(tmp_path: Path) -> None:
    (tmp_path / "a").write_text("1")
    first = file_digest(tmp_path)
    (tmp_path / "a").rename(tmp_path / "b")
    assert file_digest(tmp_path) != first


def test_a_record_names_its_inputs_and_is_marked_synthetic(tmp_path: Path) -> None:
    file = write_text(tmp_path / "in.txt", "x")
    kept = record(what="a test", inputs=[file], parameters={"n": 1.52}, seed=3, synthetic=True)
    assert file_digest(file) in kept["source"]
    assert "1.52" in kept["parameters"]
    assert kept["seed"] == "3"
    assert "synthetic" in kept["synthetic"]


def test_json_has_null_for_nan() -> None:
    assert to_json({"tau": [0.5, float("nan")]}) == '{"tau": [0.5, null]}'


def test_progress_goes_to_stderr_only(capsys: pytest.CaptureFixture[str]) -> None:
    progress.show(True)
    try:
        with progress.task("tracing", 2) as t:
            t.advance()
    finally:
        progress.show(False)
    out, err = capsys.readouterr()
    assert out == "" and "tracing" in err


class Either(Job):
    size: float | tuple[float, float]


@pytest.mark.parametrize("value", ['"wide"', "[1.0]", '[1.0, "x"]'])
def test_a_faulty_value_is_named_by_its_key_alone(tmp_path: Path, value: str) -> None:
    (tmp_path / "pane.toml").write_text(f"size = {value}\n")
    with pytest.raises(FormatError, match="line 1: expected") as caught:
        load_toml(tmp_path / "pane.toml", Either)
    assert "size" in str(caught.value)
    assert not any(name in str(caught.value) for name in ("size.float", "size.tuple"))
