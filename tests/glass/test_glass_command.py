"""GLASS.toml and `specularia glass trace`."""

import json

import numpy as np
import pytest
from glass_reference import smooth_map

from specularia import surface
from specularia.bsdf import read_model
from specularia.errors import CoverageError, FormatError
from specularia.glass import Medium, Spectrum, read_slab, sample_bubbles, write_bubbles
from specularia.glass.bubbles import BubbleKind

FLAT = """thickness_mm = 3.0
[medium]
index = 1.52
[front]
flat = true
[back]
flat = true
"""


@pytest.fixture
def folder(tmp_path):
    front = smooth_map((24, 30), seed=1, rms_slope=0.3)
    np.save(tmp_path / "front.npy", front)
    back = surface.HeightMap(
        smooth_map((20, 20), seed=2, rms_slope=0.3),
        pitch_x_um=1.5,
        pitch_y_um=1.5,
        attributes={"synthetic": "synthetic"},
    )
    surface.write(back, tmp_path / "back.nc")
    (tmp_path / "colour.csv").write_text(
        "# yellowish\nwavelength_nm, per_mm\n400, 0.2\n500, 0.1\n600, 0.04\n"
    )
    bubbles = sample_bubbles(
        [BubbleKind(per_cm3=20.0, median_mm=0.2)], thickness_mm=2.0, low_mm=-0.8, high_mm=0.8, seed=1
    )
    write_bubbles(bubbles, tmp_path / "bubbles.csv")
    (tmp_path / "glass.toml").write_text(
        """thickness_mm = 2.0
[medium]
index = { sellmeier = [1.03961212, 0.231792344, 1.01046945, 0.00600069867, 0.0200179144, 103.560653] }
absorption_per_mm = { spectrum = "colour.csv" }
[front]
heights = "front.npy"
pitch_um = 1.5
tiling = "periodic"
[back]
heights = "back.nc"
tiling = "mirror"
[[bubbles]]
list = "bubbles.csv"
[[bubbles]]
per_cm3 = 10.0
diameter_mm = { median = 0.1, sigma = 0.2 }
elongation = 2.0
axis = [0, 1, 0]
[trace]
polarised = false
"""
    )
    return tmp_path


def test_every_key_of_a_glass_file_arrives_in_the_slab(folder):
    slab = read_slab(folder / "glass.toml", seed=4)
    assert slab.thickness_mm == 2.0
    assert slab.medium.index_at(587.6) == pytest.approx(1.5168, abs=1e-4)
    assert slab.medium.absorption_at(550.0) == pytest.approx(0.07)
    assert slab.front.heights_um.shape == (24, 30)
    assert (slab.front.pitch_x_um, slab.back.tiling, slab.polarised) == (1.5, "mirror", False)
    assert slab.synthetic
    assert [p.name for p in slab.sources] == [
        "glass.toml",
        "front.npy",
        "back.nc",
        "colour.csv",
        "bubbles.csv",
    ]
    listed, kind = slab.bubbles, slab.bubble_kinds[0]
    drawn = round(10.0 * listed.cell_mm[0] * listed.cell_mm[1] * 2.0 / 1000)
    assert len(slab.all_bubbles) == len(listed) + drawn
    assert (kind.median_mm, kind.elongation, kind.axis) == (0.1, 2.0, (0.0, 1.0, 0.0))


@pytest.mark.parametrize(
    "spelling", ['absorption_per_mm = { spectrum = "colour.csv" }', 'spectrum = "colour.csv"']
)
def test_the_spectrum_may_be_named_in_either_place(folder, spelling):
    path = folder / "flat.toml"
    path.write_text(FLAT.replace("index = 1.52", spelling))
    slab = read_slab(path)
    assert slab.medium.absorption_at(550.0) == pytest.approx(0.07)
    assert [p.name for p in slab.sources] == ["flat.toml", "colour.csv"]


def test_spectrum_is_not_carried_on_beyond_its_data(folder):
    slab = read_slab(folder / "glass.toml")
    with pytest.raises(CoverageError, match="400 to 600 nm"):
        slab.medium.absorption_at(700.0)
    assert Medium(absorption_per_mm=Spectrum(np.array([1.0, 2.0]), np.array([0.0, 1.0]))).absorption_at(
        1.5
    ) == pytest.approx(0.5)


@pytest.mark.parametrize(
    ("old", "new", "line", "expected", "found"),
    [
        ("thickness_mm = 3.0", "thickness = 3.0", 1, "known key", "thickness"),
        ("thickness_mm = 3.0", "thickness_mm = -3.0", 1, "greater than 0", "-3.0"),
        ("index = 1.52", "indx = 1.52", 3, "known key", "medium.indx"),
        ("index = 1.52", "index = 0.9", 3, "greater than 1", "0.9"),
        ("index = 1.52", "index = { sellmeier = [1, 2] }", 3, "at least 6", "[1, 2]"),
        ("index = 1.52", "absorption_per_mm = -1", 3, "greater than or equal to 0", "-1"),
        ("[back]\nflat = true", "[back]", 6, "either heights or flat", ""),
        ("[back]\nflat = true", '[back]\nheights = "none.nc"', None, "height map", "nothing"),
        ("[back]\nflat = true", "", None, "the key back", "none"),
        ("index = 1.52", 'absorption_per_mm = { spectrum = "none.csv" }', None, "spectrum", "nothing"),
        ("index = 1.52", 'absorption_per_mm = 0.1\nspectrum = "s.csv"', 2, "not both", "s.csv"),
        ("index = 1.52", 'absorption_per_mm = "s.csv"', 3, "medium.absorption_per_mm: input", "s.csv"),
        ("[back]", "[[bubbles]]\nper_cm3 = 3\n[back]", None, "either per_cm3 and diameter_mm", ""),
        ("[back]", '[[bubbles]]\nlist = "none.csv"\n[back]', None, "list of bubbles", "nothing"),
    ],
)
def test_faults_of_a_glass_file_are_named(tmp_path, command, old, new, line, expected, found):
    assert old in FLAT
    path = tmp_path / "glass.toml"
    path.write_text(FLAT.replace(old, new))
    with pytest.raises(FormatError) as error:
        read_slab(path)
    assert expected in str(error.value)
    assert found in error.value.found
    if line is not None:
        assert error.value.line == line
    code, out, _ = command("glass", "trace", path, "--tau-only", "--paths", 32, "--json")
    assert (code, out) == (3, "")


def test_a_pane_that_cannot_be_is_refused_with_the_files_name(tmp_path):
    np.save(tmp_path / "deep.npy", np.where(np.eye(8) > 0, -50.0, 0.0))
    path = tmp_path / "glass.toml"
    path.write_text(
        FLAT.replace("3.0", "0.02").replace(
            "[front]\nflat = true", '[front]\nheights = "deep.npy"\npitch_um = 9'
        )
    )
    with pytest.raises(FormatError, match=r"glass\.toml.*reliefs meet"):
        read_slab(path)


def test_wrong_spectrum_is_refused_with_its_line(folder, command):
    (folder / "colour.csv").write_text("400, 0.2\n500, 0.1\n450, 0.3\n")
    code, _, err = command("glass", "trace", folder / "glass.toml", "--tau-only", "--paths", 32)
    assert code == 3
    assert "colour.csv, line 3" in err


def test_energy_balance_alone_as_json(folder, command):
    words = (
        "glass",
        "trace",
        folder / "glass.toml",
        "--tau-only",
        "--theta",
        "0,60",
        "--phi",
        30,
        "--paths",
        3200,
    )
    code, out, _ = command(*words, "--seed", 5, "--wavelength", 450, "--json")
    assert code == 0
    assert out["theta_deg"] == [0.0, 60.0]
    for name in ("tau", "tau_se", "rho", "absorbed", "lost", "seconds"):
        assert len(out[name]) == 2
    assert out["paths"] == 3200
    assert out["lost"] == [0, 0]
    total = np.add(np.add(out["tau"], out["rho"]), out["absorbed"])
    assert np.all(np.abs(total - 1) < 1e-9)
    back = out["tiling"]["back"]
    assert back["tiling"] == "mirror"
    assert back["shape"] == [38, 38]
    assert back["rms_slope"][0] == pytest.approx(back["rms_slope"][1], rel=0.05)
    assert 0 < back["distance"] < 0.05
    again = command(*words, "--seed", 5, "--wavelength", 450, "--json")[1]
    other = command(*words, "--seed", 6, "--wavelength", 450, "--json")[1]
    assert again["tau"] == out["tau"] != other["tau"]


def test_model_is_written_in_both_forms(tmp_path, command):
    (tmp_path / "glass.toml").write_text(FLAT)
    nc, xml = tmp_path / "c.nc", tmp_path / "c.xml"
    code, out, err = command(
        "glass",
        "trace",
        tmp_path / "glass.toml",
        "-o",
        nc,
        "-o",
        xml,
        "--resolution",
        5,
        "--paths",
        3200,
        "--json",
    )
    assert code == 0, err
    assert xml.is_file()
    found = read_model(nc)
    assert set(found.tables) == {
        f"{a}_{b}" for a in ("transmission", "reflection") for b in ("front", "back")
    }
    assert json.loads(found.attributes["source"]).keys() == {"glass.toml"}
    assert np.allclose(out["tau"], found.tables["transmission_front"].tau)
    assert out["theta_deg"] == list(found.tables["transmission_front"].theta_i_deg)


@pytest.mark.parametrize(
    "words",
    [
        (),
        ("-o", "c.txt"),
        ("--tau-only", "--theta", "0,90"),
        ("--tau-only", "--theta", "a,b"),
        ("--tau-only", "--theta", "nan"),
        ("--tau-only", "--phi", "nan"),
        ("-o", "c.nc", "--paths", "0"),
        ("-o", "c.xml", "--resolution", "12"),
    ],
)
def test_wrong_usage_ends_with_code_two(tmp_path, command, words):
    (tmp_path / "glass.toml").write_text(FLAT)
    assert command("glass", "trace", tmp_path / "glass.toml", *words)[0] == 2


def test_output_that_cannot_be_written_is_refused_before_tracing(tmp_path, command):
    (tmp_path / "glass.toml").write_text(FLAT)
    code, _, err = command("glass", "trace", tmp_path / "glass.toml", "-o", tmp_path / "no" / "c.nc")
    assert code == 3
    assert "does not exist" in err
    assert command("glass", "trace", tmp_path / "none.toml", "--tau-only")[0] == 3


def test_tau_only_says_that_it_writes_no_model(tmp_path, command):
    (tmp_path / "glass.toml").write_text(FLAT)
    words = ("--tau-only", "--theta", "0", "--paths", "1000", "-o", tmp_path / "c.nc", "--json")
    code, out, err = command("glass", "trace", tmp_path / "glass.toml", *words)
    assert code == 0 and out["theta_deg"] == [0.0]
    assert "not written" in err and not (tmp_path / "c.nc").exists()


def test_a_description_may_take_the_noise_off_its_maps(tmp_path):
    noise = 0.01 * np.random.default_rng(1).standard_normal((32, 32))
    np.save(tmp_path / "front.npy", noise)
    text = 'thickness_mm = 3.0\n[front]\nheights = "front.npy"\npitch_um = 1.5\n{}\n[back]\nflat = true\n'
    (tmp_path / "glass.toml").write_text(text.format("denoise = 0.01"))
    front = read_slab(tmp_path / "glass.toml").front
    np.testing.assert_array_equal(front.measured_um, noise)
    assert front.heights_um.std() < 0.4 * noise.std()
    # The file does not say how uncertain its heights are.
    (tmp_path / "glass.toml").write_text(text.format("denoise = true"))
    with pytest.raises(FormatError, match="state the noise"):
        read_slab(tmp_path / "glass.toml")
