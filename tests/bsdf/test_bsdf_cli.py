"""The commands of `specularia bsdf`."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from specularia import bsdf

Command = Callable[..., tuple[int, Any, str]]


@pytest.fixture
def nc(pane: Any, tmp_path: Path) -> Path:
    return bsdf.write(pane, tmp_path / "pane.nc").path


def test_info_tells_what_files_hold(command: Command, shared_data: Path, pane_xml: Any, nc: Path) -> None:
    code, tree, _ = command("bsdf", "info", pane_xml.path, "--json")
    assert code == 0 and tree["rank"] == 3 and tree["resolution"] == 6 and tree["bands"] == ["Visible"]
    assert tree["basis"] == "LBNL/Shirley-Chiu"
    assert tree["sides"] == ["transmission_front", "transmission_back", "reflection_front"]
    _, klems, _ = command("bsdf", "info", shared_data / "bsdf_xml" / "2011-SA1.xml", "--json")
    assert klems["basis"] == "LBNL/Klems Full" and klems["rank"] is None and klems["resolution"] is None
    assert klems["bands"] == ["Visible", "Solar"] and len(klems["sides"]) == 4
    _, tables, _ = command("bsdf", "info", nc, "--json")
    assert tables["bands"] == ["520 nm"] and tables["extrapolated_beyond_deg"]["transmission_front"] == 82.5
    code, text, _ = command("bsdf", "info", nc)
    assert code == 0 and "reciprocity of transmission_front" in text


def test_tau_is_null_outside_the_data(command: Command, nc: Path) -> None:
    code, found, _ = command("bsdf", "tau", nc, "--theta", "0,20,40,90,120", "--json")
    assert code == 0 and found["theta_deg"] == [0, 20, 40, 90, 120]
    assert found["transmission_front"][:3] == pytest.approx([0.72, 0.71, 0.68])
    assert found["transmission_front"][3:] == [None, None]
    assert found["reflection_front"][0] == pytest.approx(0.08)
    assert found["transmission_back"][0] == pytest.approx(0.72, rel=0.01)
    assert "reflection_back" not in found


def test_tau_of_another_band(command: Command, shared_data: Path) -> None:
    path = shared_data / "bsdf_xml" / "2011-SA1.xml"
    _, solar, _ = command("bsdf", "tau", path, "--theta", "0", "--band", "Solar", "--json")
    _, visible, _ = command("bsdf", "tau", path, "--theta", "0", "--json")
    assert solar["band"] == "Solar" and solar["transmission_front"] != visible["transmission_front"]


def test_check_lists_findings_and_programs(command: Command, pane_xml: Any) -> None:
    code, found, _ = command("bsdf", "check", pane_xml.path, "--json")
    assert code == 0
    assert {"name", "ok", "value", "limit", "advice"} == set(found["checks"][0])
    names = {c["name"] for c in found["checks"]}
    assert {"energy", "negative values", "transmission sides", "reciprocity", "resolution"} <= names
    assert [p["takes"] for p in found["programs"]] == [True, True, False]


def test_slice_writes_cells_that_add_up(command: Command, nc: Path, tmp_path: Path) -> None:
    out = tmp_path / "s.npz"
    code, found, _ = command("bsdf", "slice", nc, "--theta", "40", "--size", "120", "-o", out, "--json")
    assert code == 0 and found["side"] == "transmission_front"
    with np.load(out) as data:
        assert data["bsdf"].shape == (120, 120) and data["ux"].shape == (120,) and data["uy"].shape == (120,)
        assert np.nansum(data["bsdf"]) * (2 / 120) ** 2 == pytest.approx(0.68, rel=0.01)
    code, found, _ = command("bsdf", "slice", nc, "--theta", "140", "--size", "64", "-o", out, "--json")
    assert found["side"] == "transmission_back"
    assert command("bsdf", "slice", nc, "--theta", "90", "-o", out)[0] == 2
    assert command("bsdf", "slice", nc, "--theta", "0", "-o", tmp_path / "s.png")[0] == 2
    assert command("bsdf", "slice", nc, "--theta", "0", "-o", tmp_path / "no" / "s.npz")[0] == 3


def test_compare_writes_table_and_figure(command: Command, nc: Path, pane_xml: Any, tmp_path: Path) -> None:
    folder = tmp_path / "out"
    code, found, _ = command("bsdf", "compare", nc, pane_xml.path, "--theta", "0,40", "-o", folder, "--json")
    assert code == 0
    for key in ("theta_deg", "tau_a", "tau_b", "l1", "peak_ratio", "fwhm_ratio"):
        assert len(found[key]) == 2 and set(found["angles"][0]) >= {key}
    assert found["tau_b"] == pytest.approx(found["tau_a"], rel=0.01)
    rows = (folder / "compare.csv").read_text().splitlines()
    assert rows[0].startswith("theta_deg,tau_a") and len(rows) == 3
    assert (folder / "dsf.png").stat().st_size > 10_000 and (folder / "dsf.npz").exists()


def test_view_writes_one_file(command: Command, nc: Path, tmp_path: Path) -> None:
    code, found, _ = command("bsdf", "view", nc, "-o", tmp_path / "v.html", "--json")
    assert code == 0 and Path(found["path"]).read_text().lstrip().lower().startswith("<!doctype html")


def test_bad_files_end_with_code_3(command: Command, tmp_path: Path) -> None:
    bad = tmp_path / "bad.xml"
    bad.write_text("<WindowElement>")
    for words in (["info", bad], ["check", tmp_path / "none.nc"], ["tau", bad, "--json"]):
        code, out, err = command("bsdf", *words)
        assert code == 3 and out == "" and "expected" in err
    assert command("bsdf", "tau", bad, "--theta", "0,x")[0] in (2, 3)


def test_a_side_without_transmission_is_missed_by_the_file_s_name(
    command: Command, shared_data: Path, tmp_path: Path
) -> None:
    mirror = shared_data / "bsdf_xml/testBSDF.xml"
    code, out, err = command("bsdf", "slice", mirror, "--theta", "20", "-o", tmp_path / "s.npz")
    assert code == 3 and not out and "testBSDF.xml" in err and "reflection_back" in err
    code, _, err = command("bsdf", "compare", mirror, mirror, "-o", tmp_path / "c")
    assert code == 3 and "testBSDF.xml" in err and not list(tmp_path.iterdir())


def test_a_view_never_replaces_a_file_of_another_kind(command: Command, nc: Path) -> None:
    before = nc.read_bytes()
    assert command("bsdf", "view", nc, "-o", nc)[0] == 2
    assert nc.read_bytes() == before
