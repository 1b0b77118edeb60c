"""`specularia gonio fit` with its options, on small synthetic tables."""

from __future__ import annotations

import csv
from pathlib import Path
from typing import Any

import pytest

from specularia import bsdf, gonio

pytestmark = pytest.mark.filterwarnings("ignore::specularia.errors.SpeculariaWarning")


@pytest.fixture(scope="module")
def files(measure: Any, tmp_path_factory: pytest.TempPathFactory) -> list[Path]:
    folder = tmp_path_factory.mktemp("tables")
    return [
        gonio.write(measure(t, scale=0.05, shadow=False), folder / f"t{t:g}.dat") for t in (0.0, 20.0, 40.0)
    ]


def test_everything_at_once(command: Any, files: list[Path], tmp_path: Path) -> None:
    out_nc, out_xml = tmp_path / "m.nc", tmp_path / "m.xml"
    words = ["gonio", "fit", *files, "-o", out_nc, "-o", out_xml, "--resolution", "5", "--cross-validate"]
    words += ["--figures", tmp_path / "figures", "--reflection", "fresnel", "--index", "1.5", "--json"]
    code, out, _ = command(*words)
    assert code == 0
    assert out["theta_deg"] == [0.0, 20.0, 40.0]
    for name in (
        "measured",
        "model",
        "measured_se",
        "tau_systematic",
        "interval_low",
        "interval_high",
        "xml",
    ):
        assert len(out[name]) == 3, name
    assert all(a <= m <= b for a, m, b in zip(out["interval_low"], out["model"], out["interval_high"]))
    assert out["extrapolated_beyond_deg"] == 40.0
    curve = out["curve"]
    assert [t > 40.0 for t in curve["theta_deg"]] == curve["extrapolated"]
    (held,) = out["cross_validation"]
    assert held["theta_deg"] == 20.0
    assert held["holds"] == (held["low"] <= held["measured"] <= held["high"])
    assert "index 1.5; computed, not measured" in out["origins"]["reflection_front"]
    assert list(out["sides"]) == ["transmission_front"]
    for path in (out_nc, out_xml):
        model = bsdf.read(path)
        assert set(model.sides) == set(bsdf.read(out_nc).sides)
        assert float(model.direct_hemispherical("reflection_front", 0.0)) == pytest.approx(0.0769, rel=0.03)
    for picture in out["figures"]:
        assert Path(picture).stat().st_size > 10_000
        assert Path(picture).with_suffix(".csv").is_file()
    with Path(out["figures"][0]).with_suffix(".csv").open() as f:
        rows = list(csv.DictReader(f))
    assert {int(r["extrapolated"]) for r in rows if float(r["theta_i_deg"]) > 40} == {1}


def test_both_models_side_by_side(command: Any, files: list[Path], tmp_path: Path) -> None:
    words = ["gonio", "fit", *files, "-o", tmp_path / "m.nc", "-o", tmp_path / "peer.xml"]
    words += ["--resolution", "5", "--method", "radiance", "--json"]
    code, out, _ = command(*words)
    assert code == 0
    assert out["radiance"] == out["xml"]
    assert out["model"] == pytest.approx(out["measured"], rel=1e-3)
    assert out["radiance"][:2] == pytest.approx(out["measured"][:2], rel=0.1)
    # 40 degrees lies in an incidence bin that is centred at 41: Radiance loses it, and the user is told.
    assert out["radiance"][2] < 0.2 * out["measured"][2]
    assert any("holds 40 degrees is centred at 41.01" in note for note in out["radiance_notes"])
    assert any("0.5791 measured" in note for note in out["radiance_notes"])
    assert all(len(out[f"radiance_{name}"]) == 3 for name in ("l1", "peak_ratio", "fwhm_ratio"))
    assert isinstance(bsdf.read(tmp_path / "m.nc"), bsdf.TabulatedModel)
    assert "pabopto2bsdf" in (tmp_path / "peer.xml").read_text()[:3000]


WRONG = {
    "Radiance writes no netCDF": (["-o", "m.nc", "--method", "radiance"], "write .xml"),
    "Radiance chooses the rank": (["-o", "m.xml", "--method", "radiance", "--basis", "tensor4"], "choose"),
    "rank 4 is bounded": (["-o", "m.xml", "--basis", "tensor4", "--resolution", "8"], "up to 7"),
    "a mask has three numbers": (["-o", "m.nc", "--mask", "258,282"], "PHI_MIN"),
    "a beam says what the values are": (["-o", "m.nc", "--beam", "b.dat", "--quantity", "DSF"], "leave"),
    "an ending": (["-o", "m.txt"], "must end in"),
}


@pytest.mark.parametrize("name", WRONG)
def test_options_that_contradict_each_other_are_wrong_usage(
    command: Any, files: list[Path], tmp_path: Path, monkeypatch: pytest.MonkeyPatch, name: str
) -> None:
    monkeypatch.chdir(tmp_path)
    words, said = WRONG[name]
    code, out, err = command("gonio", "fit", *files, *words)
    assert code == 2
    assert not out and said in " ".join(err.replace("│", " ").split())
    assert not list(tmp_path.iterdir())


def test_reflection_none_leaves_the_measured_reflection_out(
    command: Any, measure: Any, tmp_path: Path
) -> None:
    from dataclasses import replace

    table = measure(20.0, scale=0.03, shadow=False)
    mirrored = replace(table, side="reflection_front", theta_s_deg=180 - table.theta_s_deg)
    files = [gonio.write(t, tmp_path / f"{k}.dat") for k, t in enumerate((table, mirrored))]
    code, out, _ = command("gonio", "fit", *files, "-o", tmp_path / "m.nc", "--reflection", "none", "--json")
    assert code == 0
    assert list(out["sides"]) == ["transmission_front"]
    code, _, err = command("gonio", "fit", files[1], "-o", tmp_path / "n.nc", "--reflection", "none")
    assert code == 3 and "reflection only" in err
    assert not (tmp_path / "n.nc").exists()
