"""ROOM.toml, what is refused before any rendering, and the command."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from daylight_models import Diffuser, Lobe

from specularia import daylight
from specularia.bsdf import SideTable, TabulatedModel, write_model
from specularia.bsdf.tabulated import cell_centres
from specularia.errors import CoverageError, FormatError, SpeculariaWarning

ROOM = """
name = "test"
[room]
width_m = 4.0
depth_m = 5.0
height_m = 2.8
[[window]]
name = "one"
width_m = 0.8
height_m = 1.1
sill_m = 1.0
[sun]
elevation_deg = 50.0
[[sensor]]
name = "floor"
position_m = [2.0, 1.0, 0.0]
[[view]]
position_m = [2.0, 4.5, 1.5]
direction = [0, -1, 0]
size_px = [48, 36]
[quality]
sampling = 0.4
repeats = 2
"""


def written(folder: Path, text: str = ROOM, *changes: tuple[str, str]) -> Path:
    for old, new in changes:
        assert old in text
        text = text.replace(old, new)
    path = folder / "ROOM.toml"
    path.write_text(text)
    return path


@pytest.mark.parametrize(
    ("change", "says"),
    [
        (("elevation_deg = 50.0", "elevation_deg = -3.0"), "sun above the horizon"),
        (("position_m = [2.0, 4.5, 1.5]", "position_m = [2.0, 5.2, 1.5]"), "view 'view'"),
        (("position_m = [2.0, 4.5, 1.5]", "position_m = [0.0, 4.5, 1.5]"), "in a wall or outside"),
        (("position_m = [2.0, 1.0, 0.0]", "position_m = [2.0, 1.0, -0.2]"), "sensor 'floor'"),
        (("position_m = [2.0, 1.0, 0.0]", "position_m = [2.0, 1.0, 2.8]"), "into the ceiling"),
        (("sill_m = 1.0", "sill_m = 2.0"), "within its wall"),
        (("[sun]", '[[window]]\nname = "two"\nwidth_m = 1\nheight_m = 1\nsill_m = 1.5\n[sun]'), "overlap"),
        (("[sun]", '[[window]]\nname = "one"\nwidth_m = 1\nheight_m = 1\nsill_m = 1.5\n[sun]'), "differ"),
        (("sill_m = 1.0", "sill_m = 1.0\nframe_m = 0.4"), "frame_m below half"),
        (("elevation_deg = 50.0", "elevation = 50.0"), "elevation_deg"),
        (("direction = [0, -1, 0]", "direction = [0, 0, 0]"), "direction"),
        (("[sun]\nelevation_deg = 50.0", ""), "[sun] table"),
    ],
)
def test_a_room_that_cannot_be_is_refused_before_any_rendering(
    tmp_path: Path, change: tuple[str, str], says: str
) -> None:
    path = written(tmp_path, ROOM, change)
    with pytest.raises(FormatError) as caught:
        daylight.run(path, models={"d": Diffuser(0.5)}, folder=tmp_path / "out")
    assert says in str(caught.value)
    assert "ROOM.toml" in str(caught.value)
    assert not (tmp_path / "out").exists()


def test_a_room_without_models_and_a_model_without_transmission_are_refused(tmp_path: Path) -> None:
    class Mirror(Diffuser):
        sides = ("reflection_front", "reflection_back")

    with pytest.raises(FormatError, match="at least one scattering model"):
        daylight.run(written(tmp_path))
    with pytest.raises(CoverageError, match="lacks transmission back and transmission front"):
        daylight.run(written(tmp_path), models={"mirror": Mirror(0.5)})


def test_a_model_that_does_not_reach_the_sun_is_refused(tmp_path: Path) -> None:
    class Short(Diffuser):
        def direct_hemispherical(self, side, theta_i_deg, phi_i_deg=0.0):  # type: ignore[no-untyped-def]
            return np.where(np.asarray(theta_i_deg) < 40.0, self.tau, np.nan)

    with pytest.raises(CoverageError, match=r"at 50\.0 degrees"):
        daylight.run(written(tmp_path), models={"short": Short(0.5)})


def test_a_sun_behind_the_window_is_a_warning_and_the_sky_still_lights(tmp_path: Path) -> None:
    path = written(tmp_path, ROOM, ("elevation_deg = 50.0", "elevation_deg = 50.0\nazimuth_deg = 170.0"))
    with pytest.warns(SpeculariaWarning, match="behind the wall of 1 of 1 windows"):
        lit = daylight.run(path, models={"d": Diffuser(0.5)})
    assert lit.panes[0].sun_lx == 0.0
    assert lit.points[0].illuminance_lx > 10.0


def tabulated(path: Path) -> Path:
    """A small tabulated pane, written to a file."""
    lobe, n, m, h = Lobe(20.0), 32, 32, 0.5
    theta = np.array([0.0, 30.0, 60.0, 80.0])
    x, y = cell_centres(n)
    offset = (np.arange(m) + 0.5) / m * 2 * h - h
    patches = []
    for t in theta:
        px, py = np.meshgrid(offset - np.sin(np.radians(t)), offset, indexing="ij")
        patches.append(np.nan_to_num(lobe.evaluate("transmission_front", t, 0.0, px, py)))
    base = np.stack([lobe.evaluate("transmission_front", t, 0.0, x, y) for t in theta])
    table = SideTable(
        theta_i_deg=theta,
        base=base.astype(np.float32),
        patch=np.array(patches, np.float32),
        half_width=h,
        tau=np.array([0.6, 0.58, 0.5, 0.25]),
        tau_se=np.zeros(4),
        origin="synthetic",
    )
    model = TabulatedModel({"transmission_front": table}, "Visible", {"synthetic": "analytic"})
    write_model(model, path)
    return path


def test_the_command_gives_points_images_and_panes_for_each_model(tmp_path: Path, command) -> None:  # type: ignore[no-untyped-def]
    model = tabulated(tmp_path / "m.nc")
    room = written(tmp_path, ROOM + '\n[[model]]\nname = "A"\nfile = "m.nc"\n')
    out = tmp_path / "out"
    code, result, err = command("daylight", "run", room, "-o", out, "--model", f"B={model}", "--json", "-q")
    assert code == 0, err
    assert [(p["name"], p["model"]) for p in result["points"]] == [("floor", "A"), ("floor", "B")]
    a, b = result["points"]
    assert a["illuminance_lx"] == b["illuminance_lx"] > 0 and 0 < a["se"] < 0.02 * a["illuminance_lx"]
    assert a["direct_lx"] + a["indirect_lx"] == pytest.approx(a["illuminance_lx"])
    for image in result["images"]:
        assert all(Path(image[kind]).is_file() for kind in ("hdr", "npz", "figure"))
    assert {p["view"] for p in result["panes"]} == {"normal", "view"}
    assert all(p["luminance_cd_m2"] > 0 for p in result["panes"])
    assert (out / "daylight.json").is_file()
    assert "synthetic" in np.load(result["images"][0]["npz"]).files


@pytest.mark.parametrize(
    ("words", "code", "says"),
    [
        (["--model", "m.nc"], 2, "NAME=FILE"),
        (["--model", "A=missing.nc"], 3, "missing.nc"),
        (["--model", "A=a.nc", "--model", "A=b.nc"], 2, "twice"),
    ],
)
def test_the_command_refuses_models_it_cannot_use(tmp_path: Path, command, words, code, says) -> None:  # type: ignore[no-untyped-def]
    room = written(tmp_path)
    got, _, err = command("daylight", "run", room, "-o", tmp_path / "out", *words)
    assert got == code
    assert says in err


def test_the_example_in_the_documentation_of_the_job_is_a_room() -> None:
    import textwrap
    import tomllib

    from specularia.daylight import job

    assert job.__doc__ is not None
    example = textwrap.dedent(job.__doc__.split("::\n", 1)[1].split("\n\nThe pane's front")[0])
    room = daylight.RoomJob.model_validate(tomllib.loads(example))
    assert room.sun is not None and room.sun.elevation_deg == 75.0
