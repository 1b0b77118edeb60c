"""Whole studies on small input: tables only, and a small synthetic specimen from stacks to the page."""

from __future__ import annotations

import json
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from specularia import gonio, study
from specularia.gonio import Table

pytestmark = pytest.mark.filterwarnings("ignore::specularia.errors.SpeculariaWarning")

Command = Callable[..., tuple[int, Any, str]]

TAU = {0.0: 0.6, 40.0: 0.5, 70.0: 0.3}


def write_tables(folder: Path) -> None:
    """Transmission with an exactly known integral at three angles: TAU / pi in all directions."""
    folder.mkdir()
    rng = np.random.default_rng(3)
    for theta, tau in TAU.items():
        theta_s = 180.0 - np.degrees(np.arcsin(np.sqrt(rng.random(6000))))
        phi_s = 360.0 * rng.random(6000)
        values = np.full(6000, tau / np.pi) * np.abs(np.cos(np.radians(theta_s)))
        table = Table(
            file="",
            quantity="DSF",
            side="transmission_front",
            theta_i_deg=theta,
            phi_i_deg=0.0,
            theta_s_deg=theta_s,
            phi_s_deg=phi_s,
            values=values,
            band="520 nm",
            name="even scatterer",
        )
        gonio.write(table, folder / f"t{theta:g}.dat")


def test_a_study_of_tables_alone_ends_with_a_page_and_reruns_only_what_changed(
    tmp_path: Path, command: Command
) -> None:
    write_tables(tmp_path / "gonio")
    file = tmp_path / "study.toml"
    file.write_text("[gonio]\ntables = ['gonio/*.dat']\n[xml]\nresolution = 5\n")
    out = tmp_path / "out"
    code, first, err = command("study", "run", file, "-o", out, "--json")
    assert code == 0
    assert "model_m" in err
    page = Path(first["report"])
    assert page.is_absolute()
    assert page.read_text(encoding="utf-8").startswith("<!DOCTYPE html>")
    assert set(first["seconds"]) == {"measured", "model_m", "table_1", "dsf", "view", "report"}
    manifest = json.loads((out / "table_1" / "stage.json").read_text())
    for row in ("measured", "M"):
        assert manifest["summary"]["rows"][row] == pytest.approx(list(TAU.values()), rel=0.01)
    assert manifest["summary"]["synthetic"] is False
    assert (out / "model_m" / "model.xml").is_file()
    assert str(tmp_path) not in page.read_text(encoding="utf-8")

    code, again, _ = command("study", "run", file, "-o", out, "--json")
    assert code == 0
    assert again["computed"] == []
    assert again["report"] == first["report"]

    file.write_text(file.read_text() + "[report]\ntitle = 'Another title'\n")
    code, titled, _ = command("study", "run", file, "-o", out, "--json")
    assert code == 0
    assert titled["computed"] == ["report"]
    assert "Another title" in Path(titled["report"]).read_text(encoding="utf-8")


SMALL_TWIN = """
[maps]
pixels = 64
[gonio]
theta_deg = [0.0, 40.0]
paths = 20000
base = 6000
middle = 2000
peak = 1500
[truth]
paths = 5000
[bubbles]
cell_mm = 4.0
[finds]
fragments = 300
"""


@pytest.mark.slow
def test_a_small_specimen_goes_from_the_instruments_to_the_lit_room(tmp_path: Path) -> None:
    file = study.write_demo(tmp_path)
    (tmp_path / "twin.toml").write_text(SMALL_TWIN)
    smaller = {
        r"paths = \d+": "paths = 2000",
        r"resolution = \d": "resolution = 5",
        r"\[20, 30, 40\]": "[20]",
    }
    text = file.read_text()
    for pattern, setting in smaller.items():
        text, found = re.subn(pattern, setting, text)
        assert found, pattern
    file.write_text(text)
    room = tmp_path / "room.toml"
    room.write_text(
        room.read_text().replace("[240, 180]", "[48, 36]")
        + '\n[[view]]\nname = "eye"\nkind = "fisheye"\nposition_m = [2, 2, 1.2]\ndirection = [0, -1, 0]\n'
        + 'size_px = [36, 36]\n[[grid]]\nname = "plane"\nheight_m = 0.8\nspacing_m = 2.5\n'
        + "[quality]\nsampling = 0.3\nrepeats = 2\n"
    )
    done = study.run(file, tmp_path)
    assert done.report is not None
    assert set(done.computed) == {s.stage.name for s in study.steps(file, tmp_path)}
    text = done.report.read_text(encoding="utf-8")
    for title in ("The faces of the glass", "Model C, from the geometry", "The lit room", "The finds"):
        assert title in text
    assert "synthetic" in text and "isolux lines" in text and "Daylight glare probability" in text
    assert (tmp_path / "specimen" / "truth" / "truth.json").is_file()

    truth = json.loads((tmp_path / "specimen" / "truth" / "truth.json").read_text())["tau"]["520 nm"]
    table = json.loads((done.folders["table_1"] / "stage.json").read_text())["summary"]
    measured, m, c = (np.array(table["rows"][name]) for name in ("measured", "M", "C"))
    assert np.abs(measured / truth["phi_0"] - 1.0).max() < 0.05
    assert np.abs(m / measured - 1.0).max() < 0.02
    assert (c > measured).all()  # the model has neither the absorption nor the bubbles of the specimen

    finds = json.loads((done.folders["finds"] / "stage.json").read_text())["summary"]
    assert finds["total_count"] == 300

    (tmp_path / "room.toml").write_text(room.read_text().replace("reflectance = 0.20", "reflectance = 0.10"))
    assert {s.stage.name for s in study.steps(file, tmp_path) if s.action == "run"} == {"room", "report"}
