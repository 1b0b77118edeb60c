"""`glass tau-curve`, `glass photometer` and the options of `glass trace` for effort and routes."""

import csv

import numpy as np
import pytest
from glass_reference import smooth_map

from specularia import gonio
from specularia.bsdf import read_model
from specularia.glass import closed_form

FLAT = """thickness_mm = 3.0
[medium]
absorption_per_mm = 0.05
[front]
flat = true
[back]
flat = true
"""


@pytest.fixture
def flat(tmp_path):
    (tmp_path / "glass.toml").write_text(FLAT)
    return tmp_path / "glass.toml"


@pytest.fixture
def rough(tmp_path):
    np.save(tmp_path / "front.npy", smooth_map((48, 60), seed=1, rms_slope=0.1))
    (tmp_path / "rough.toml").write_text(
        FLAT.replace("[front]\nflat = true", '[front]\nheights = "front.npy"\npitch_um = 1.5')
    )
    return tmp_path / "rough.toml"


def test_tau_curve_is_the_closed_form_of_a_flat_pane_with_its_numbers_beside_the_figure(
    flat, tmp_path, command
):
    words = ("--theta", "0:80:20", "--paths", 32_000, "-o", tmp_path / "curve.png", "--json")
    code, out, err = command("glass", "tau-curve", flat, *words)
    assert code == 0, err
    assert out["theta_deg"] == [0.0, 20.0, 40.0, 60.0, 80.0]
    exact = closed_form.flat_slab(out["theta_deg"], index=1.52, absorption_per_mm=0.05, thickness_mm=3.0)
    for name, value in (("tau", exact.transmitted), ("rho", exact.reflected), ("absorbed", exact.absorbed)):
        assert np.all(np.abs(np.array(out[name]) - value) < 4 * np.array(out[f"{name}_se"]) + 1e-6)
    assert (tmp_path / "curve.png").read_bytes().startswith(b"\x89PNG")
    with (tmp_path / "curve.csv").open() as f:
        rows = list(csv.DictReader(f))
    assert [float(r["tau"]) for r in rows] == out["tau"]
    assert len(out["written"]) == 2


def test_tau_curve_for_light_on_the_back_at_one_azimuth(rough, tmp_path, command):
    words = ("--theta", "30", "--paths", 3200, "--side", "back", "--phi", 40, "-o", tmp_path / "c.csv")
    code, out, _ = command("glass", "tau-curve", rough, *words, "--json")
    assert code == 0
    assert (out["side"], out["phi_deg"], len(out["tau"])) == ("back", 40.0, 1)
    assert (tmp_path / "c.csv").is_file()


def test_photometer_writes_tables_that_gonio_reads_back_with_the_traced_transmission(
    rough, tmp_path, command
):
    words = ("-o", tmp_path / "tables", "--theta", "0,50", "--phi", "0,90", "--paths", 64_000)
    code, out, err = command(
        "glass", "photometer", rough, *words, "--points", 10_000, "--aperture", 2, "--json"
    )
    assert code == 0, err
    # On the normal one azimuth is enough.
    assert (out["theta_deg"], out["phi_deg"]) == ([0.0, 50.0, 50.0], [0.0, 0.0, 90.0])
    for file, theta, phi, tau in zip(out["files"], out["theta_deg"], out["phi_deg"], out["tau"]):
        (table,) = gonio.read(file)
        assert (table.polar_deg, table.azimuth_deg, table.synthetic) == (theta, phi, True)
        centre = np.array([table.ux[table.values.argmax()], table.uy[table.values.argmax()]])
        expected = -np.sin(np.radians(theta)) * np.array([np.cos(np.radians(phi)), np.sin(np.radians(phi))])
        assert np.linalg.norm(centre - expected) < 0.15
        assert 0.5 < tau < 1.0
    again = command("glass", "photometer", rough, *words, "--points", 10_000, "--aperture", 2, "--json")[1]
    assert again["tau"] == out["tau"]


def test_trace_to_a_target_error_says_how_many_paths_and_how_much_noise(rough, tmp_path, command):
    words = ("-o", tmp_path / "c.nc", "--target-error", 0.2, "--patches", 2, "--json")
    code, out, err = command("glass", "trace", rough, *words)
    assert code == 0, err
    paths = out["paths"] if isinstance(out["paths"], list) else [out["paths"]]
    assert min(paths) > 0
    assert max(out["noise"]["transmission_front"]) <= 0.2
    assert len(out["back"]["tau"]) == len(out["patches"]["tau_sd"]) == len(out["theta_deg"])
    attributes = read_model(tmp_path / "c.nc").attributes
    assert "energy_balance" in attributes and "patches" in attributes
    assert not list(tmp_path.glob("*.partial"))


def test_trace_keeps_the_azimuth_where_asked_to(rough, tmp_path, command):
    words = ("-o", tmp_path / "c.nc", "--anisotropic", "--azimuths", 3, "--paths", 1000, "--json")
    code, out, _ = command("glass", "trace", rough, *words)
    assert code == 0
    table = read_model(tmp_path / "c.nc").tables["reflection_back"]
    assert len(table.theta_i_deg) == 1 + 3 * (len(out["theta_deg"]) - 1)


def test_the_published_route_prints_its_sum(flat, tmp_path, command):
    words = ("--method", "radiance", "--tau-only", "--theta", "0,50", "--paths", 800, "--array", 20)
    code, out, err = command("glass", "trace", flat, *words, "--json")
    assert code == 0, err
    assert np.allclose(out["sum"], np.add(out["tau"], out["rho"]))
    assert (out["sides"], out["array_mm"]) == ("clear", 20.0)
    code, text, _ = command("glass", "trace", flat, *words)
    assert "R+T" in text


@pytest.mark.parametrize(
    "words",
    [
        ("tau-curve", "--theta", "0:90:10"),
        ("tau-curve", "--theta", "10:0:1"),
        ("tau-curve", "--theta", "0:10:0"),
        ("tau-curve", "-o", "c.txt"),
        ("trace", "-o", "c.nc", "--target-error", "0"),
        ("trace", "-o", "c.nc", "--workers", "2", "--scheduler", "tcp://127.0.0.1:1"),
        ("trace", "-o", "c.nc", "--anisotropic", "--azimuths", "2"),
        ("trace", "-o", "c.nc", "--method", "radiance"),
        ("trace", "-o", "c.nc", "--patches", "1"),
        ("photometer", "-o", "tables", "--theta", "95"),
        ("photometer",),
    ],
)
def test_wrong_usage_is_code_two(flat, command, words):
    assert command("glass", words[0], flat, *words[1:])[0] == 2
