"""STUDY.toml: what is read, what is refused and why, and what `study new` and `study check` say."""

from __future__ import annotations

import tomllib
from collections.abc import Callable
from pathlib import Path
from typing import Any, get_args

import numpy as np
import pytest

from specularia import analysis, study
from specularia.errors import FormatError, OutputError
from specularia.study.engine import Stage
from specularia.study.job import ParameterName, StepName
from specularia.study.new import kind_of
from specularia.study.sources import Sources

pytestmark = pytest.mark.filterwarnings("ignore::specularia.errors.SpeculariaWarning")

Command = Callable[..., tuple[int, Any, str]]


def pab_table(path: Path, theta_i: float = 0.0) -> Path:
    """A Lambertian transmission of 0.5 in the pab-opto format."""
    rng = np.random.default_rng(1)
    u, phi = rng.random(400), rng.random(400) * 360.0
    theta = 180.0 - np.degrees(np.arcsin(np.sqrt(u)))
    dsf = 0.5 / np.pi * np.abs(np.cos(np.radians(theta)))
    rows = "\n".join(f"{t:.4f}\t{p:.4f}\t{v:.6g}" for t, p, v in zip(theta, phi, dsf))
    header = f"#format: theta phi DSF\n#intheta {theta_i:g}\n#inphi 0\n#upphi 90\n"
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(header + rows + "\n")
    return path


def names(stages: list[Stage]) -> list[str]:
    return [s.name for s in stages]


def stages(file: Path) -> list[Stage]:
    return study.stages_of(study.read_job(file), file)


def test_tables_alone_make_model_m_and_nothing_of_model_c(tmp_path: Path) -> None:
    pab_table(tmp_path / "gonio" / "a.dat")
    pab_table(tmp_path / "gonio" / "b.dat", 40.0)
    file = tmp_path / "study.toml"
    file.write_text('[gonio]\ntables = ["gonio/*.dat"]\n')
    made = stages(file)
    assert names(made) == ["measured", "model_m", "table_1", "dsf", "view", "report"]
    assert [p.name for p in made[0].inputs["tables"]] == ["a.dat", "b.dat"]
    assert made[-1].needs == ("measured", "model_m", "table_1", "dsf", "view")


def test_a_catalogue_alone_is_a_study(tmp_path: Path) -> None:
    (tmp_path / "finds.csv").write_text("find_number\n")
    file = tmp_path / "study.toml"
    file.write_text('[finds]\ntable = "finds.csv"\n')
    assert names(stages(file)) == ["finds", "report"]


def test_the_bundled_studies_have_their_stages_and_differ_in_their_settings(tmp_path: Path) -> None:
    quick = study.write_demo(tmp_path)
    full = study.write_demo(tmp_path, full=True)
    # The error budget takes minutes.
    assert names(stages(quick)) == [name for name in names(stages(full)) if name != "explain"]
    assert "explain" in names(stages(full))
    assert names(stages(quick)) == [
        "twin",
        "measured",
        "model_m",
        "heights_front",
        "heights_back",
        "surfaces",
        "model_c",
        "healed_front",
        "healed_back",
        "model_h",
        "table_1",
        "dsf",
        "view",
        "fragment",
        "room",
        "finds",
        "report",
    ]
    assert study.read_job(quick).trace.paths < study.read_job(full).trace.paths
    assert "Quick settings" in study.read_job(quick).report.note
    assert study.check(quick) == []
    assert study.check(full) == []


def test_changed_settings_of_a_demo_are_kept(tmp_path: Path) -> None:
    study.write_demo(tmp_path)
    (tmp_path / "glass.toml").write_text("thickness_mm = 4.0\n")
    study.write_demo(tmp_path)
    assert (tmp_path / "glass.toml").read_text() == "thickness_mm = 4.0\n"


def test_paths_in_the_twin_are_told_from_paths_on_disk(tmp_path: Path) -> None:
    (tmp_path / "b.dat").write_text("")
    sources = Sources(tmp_path / "study.toml", "specimen")
    assert sources.within(["specimen/gonio/*.dat", "b.dat", None]) == (("twin", "gonio/*.dat"),)
    assert sources.outside(["specimen/gonio/*.dat", "b.dat", None]) == (tmp_path / "b.dat",)
    assert sources.outside([str(tmp_path / "*.dat")]) == (tmp_path / "b.dat",)
    assert Sources(tmp_path / "study.toml", None).within(["specimen/x"]) == ()


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("[gonio]\ntable = []\n", ["line 2", "gonio.table", "tables"]),
        ("[goniometer]\n", ["goniometer", "gonio"]),
        ("[trace]\npaths = 5000\n", ["something to do"]),
        ("[gonio]\ntables = ['a']\n[trace]\npaths = 1\n", ["line 4", "1000"]),
        ("[surface]\n[glass]\nsettings = 'g.toml'\n", ["front or back"]),
        ("[finds]\ntable = 'f.csv'\n[room]\nsettings = 'r.toml'\n", ["a model to put into the room"]),
        ("[finds]\ntable = 'f.csv'\n[fragment]\n", ["a model for [fragment]"]),
        ("[gonio]\ntables = ['a']\n[explain]\n", ["[gonio] and [glass] for [explain]"]),
        ("[gonio]\ntables = ['a']\n[infer]\n", ["[gonio] and [glass] for [infer]"]),
        ("[explain]\npath = 5000\n", ["line 2", "explain.path", "paths"]),
        ("[explain]\norder = ['bubble']\n", ["line 2", "explain.order", "bubbles"]),
        ("[infer]\nprior = {}\n", ["line 2", "infer.prior", "priors"]),
        ("[infer]\npriors = { absorption = [0.1, 1.0] }\n", ["line 2", "infer.priors"]),
        ("[fragment]\nsetting = 'f.toml'\n", ["line 2", "fragment.setting", "settings"]),
        ("[gonio\n", ["line 1", "TOML"]),
    ],
)
def test_a_wrong_study_is_refused_with_line_and_reason(tmp_path: Path, text: str, words: list[str]) -> None:
    file = tmp_path / "study.toml"
    file.write_text(text)
    with pytest.raises(FormatError) as error:
        study.read_job(file)
    for word in words:
        assert word in str(error.value)
    assert study.check(file) == [str(error.value)]


def test_check_lists_every_problem_before_any_work(tmp_path: Path, command: Command) -> None:
    (tmp_path / "bad.dat").write_text("neither one nor the other\n")
    (tmp_path / "two.png").write_bytes(b"")
    (tmp_path / "room.toml").write_text("[room]\nwidth = 5\n")
    file = tmp_path / "study.toml"
    file.write_text(
        "[gonio]\ntables = ['bad.dat', 'none/*.dat']\n"
        "[surface]\nfront = 'map.nc'\n"
        "[glass]\nsettings = 'glass.toml'\n"
        "[room]\nsettings = 'room.toml'\n"
    )
    before = sorted(tmp_path.iterdir())
    code, out, _ = command("study", "check", file)
    assert code == 3
    problems = study.check(file)
    assert len(problems) == 5
    for word, problem in zip(["bad.dat", "none/*.dat", "map.nc", "glass.toml", "room.width"], problems):
        assert word in problem
        assert problem in out
    assert sorted(tmp_path.iterdir()) == before


def test_check_finds_tables_of_two_bands(tmp_path: Path) -> None:
    pab_table(tmp_path / "a.dat")
    pab_table(tmp_path / "b.dat", 20.0)
    text = (tmp_path / "b.dat").read_text()
    file = tmp_path / "study.toml"
    file.write_text("[gonio]\ntables = ['*.dat']\n")
    assert study.check(file) == []
    (tmp_path / "b.dat").write_text(text.replace("#intheta", "#wavelength 633 nm\n#intheta"))
    (problem,) = study.check(file)
    assert "633 nm" in problem


def test_a_wrong_study_ends_a_run_before_it_begins(tmp_path: Path, command: Command) -> None:
    file = tmp_path / "study.toml"
    file.write_text("[gonio]\ntables = ['none/*.dat']\n")
    code, out, err = command("study", "run", file, "-o", tmp_path / "out", "--json")
    assert code == 3
    assert "none/*.dat" in err
    assert not out
    assert not (tmp_path / "out").exists()


def test_check_reads_the_settings_of_sheet_budget_and_inference(tmp_path: Path) -> None:
    pab_table(tmp_path / "a.dat")
    (tmp_path / "glass.toml").write_text("thickness_mm = 3.0\n[front]\nflat = true\n[back]\nflat = true\n")
    (tmp_path / "fragment.toml").write_text("[sheet]\nink = 0.9\n")
    (tmp_path / "pane.toml").write_text("thickness = 3.0\n")
    file = tmp_path / "study.toml"
    file.write_text(
        "[gonio]\ntables = ['a.dat']\n[glass]\nsettings = 'glass.toml'\n"
        "[fragment]\nsettings = 'fragment.toml'\n"
        "[explain]\nsettings = 'pane.toml'\n"
        "[infer]\nsettings = 'none.toml'\n"
    )
    problems = study.check(file)
    assert len(problems) == 3
    for word, problem in zip(["ink darker", "pane.toml", "none.toml"], problems):
        assert word in problem


def test_a_study_may_name_every_step_of_the_budget_and_all_that_can_be_inferred() -> None:
    assert get_args(StepName) == tuple(analysis.STEPS)
    assert get_args(ParameterName) == (*analysis.PARAMETERS, "thickness_mm")


def test_an_unknown_stage_is_wrong_usage(tmp_path: Path, command: Command) -> None:
    pab_table(tmp_path / "a.dat")
    file = tmp_path / "study.toml"
    file.write_text("[gonio]\ntables = ['a.dat']\n")
    for option in ("--only", "--from"):
        code, _, err = command("study", "run", file, "-o", tmp_path / "out", option, "model_c")
        assert code == 2
        assert "model_m" in err


def test_dry_run_lists_stages_and_touches_nothing(tmp_path: Path, command: Command) -> None:
    pab_table(tmp_path / "a.dat")
    file = tmp_path / "study.toml"
    file.write_text("[gonio]\ntables = ['a.dat']\n")
    code, out, _ = command("study", "run", file, "-o", tmp_path / "out", "--dry-run", "--json")
    assert code == 0
    assert [s["stage"] for s in out["stages"]] == ["measured", "model_m", "table_1", "dsf", "view", "report"]
    assert {s["action"] for s in out["stages"]} == {"run"}
    assert not (tmp_path / "out").exists()


def test_new_sorts_files_by_what_they_are_and_the_study_it_writes_is_right(
    tmp_path: Path, command: Command
) -> None:
    import tifffile

    from specularia import surface

    table = pab_table(tmp_path / "data" / "t00.dat")
    stack = tmp_path / "data" / "seen_from_the_back.tif"
    tifffile.imwrite(stack, np.zeros((7, 8, 8), np.uint16), photometric="minisblack")
    other = tmp_path / "data" / "seen.tif"
    tifffile.imwrite(other, np.zeros((7, 8, 8), np.uint16), photometric="minisblack")
    heights = surface.write(
        surface.HeightMap(np.random.default_rng(1).random((8, 8)), 1.0, 1.0), tmp_path / "data" / "map.nc"
    )
    finds = tmp_path / "data" / "it's finds.csv"
    finds.write_text("find_number,room,square,colour,weight_g,thickness_mm,type,count\n")
    noise = tmp_path / "data" / "notes.txt"
    noise.write_text("nothing\n")
    assert [kind_of(p) for p in (table, stack, heights, finds, noise)] == [
        "table",
        "stack",
        "map",
        "finds",
        None,
    ]
    code, out, _ = command("study", "new", tmp_path / "mine", table, other, stack, finds, noise, "--json")
    assert code == 0
    assert Path(out["study"]) == tmp_path / "mine" / "STUDY.toml"
    assert out["unknown"] == [str(noise)]
    text = Path(out["study"]).read_text()
    data = tomllib.loads(text)
    assert data["gonio"]["tables"] == ["../data/t00.dat"]
    assert data["surface"]["front"] == "../data/seen.tif"
    assert data["surface"]["back"] == "../data/seen_from_the_back.tif"
    assert data["finds"]["table"] == "../data/it's finds.csv"
    assert data["glass"]["settings"] == "glass.toml"
    assert data["room"]["settings"] == "room.toml"
    assert "EDIT" in text
    assert "notes.txt" in text
    assert study.read_job(out["study"]).gonio is not None


def test_files_of_others_are_sorted_by_what_they_are(shared_data: Path) -> None:
    kinds = {"gonio/eds10": "table", "surface": "map", "weather": None, "bsdf_xml": None, "spectral": None}
    for folder, kind in kinds.items():
        files = sorted((shared_data / folder).iterdir())
        assert files
        assert {p.name: kind_of(p) for p in files} == {p.name: kind for p in files}
    assert kind_of(shared_data / "focus_stack") == "stack"
    assert kind_of(shared_data / "focus_stack" / "expected.jpg") == "image"


def test_new_without_files_leaves_a_template_and_never_overwrites(tmp_path: Path) -> None:
    made = study.new(tmp_path / "empty")
    text = made.study.read_text()
    data = tomllib.loads(text)
    assert set(data) == {"trace", "xml", "report"}
    for table in ("gonio", "surface", "glass", "fragment", "room", "explain", "infer", "finds"):
        assert f"# [{table}]" in text
    with pytest.raises(OutputError, match="there is a study already"):
        study.new(tmp_path / "empty")
    assert made.study.read_text() == text


def test_every_key_of_a_study_is_in_the_template_or_is_a_twins(tmp_path: Path) -> None:
    from specularia.study.job import StudyJob

    text = study.new(tmp_path / "empty").study.read_text()
    for name, part in StudyJob.model_fields.items():
        model = next(
            a
            for a in (part.annotation, *getattr(part.annotation, "__args__", ()))
            if hasattr(a, "model_fields")
        )
        if name != "twin":
            for key in model.model_fields:
                assert f"{key} =" in text, f"{name}.{key}"
