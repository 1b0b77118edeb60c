"""Raw signals made absolute by a scan of the bare beam: synthetic beams of known power."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from specularia import gonio
from specularia.errors import FormatError

pytestmark = pytest.mark.filterwarnings("ignore::specularia.errors.SpeculariaWarning")

WIDTH = np.radians(0.12)
"""Standard deviation of the beam's profile, radians: 0.28 degrees at half maximum."""


def scan(
    path: Path,
    *,
    power: float,
    noise: float = 0.0,
    offset: float = 0.0,
    step_deg: float = 0.03,
    reach_deg: float = 0.75,
    theta_i: float = 0.0,
    label: str = "[uA]",
    seed: int = 1,
) -> Path:
    """A round Gaussian beam of known power, scanned on a square grid around where it goes straight on."""
    k = np.arange(-reach_deg, reach_deg + 1e-9, step_deg)
    a, b = (v.ravel() for v in np.radians(np.meshgrid(k, k)))
    angle = np.hypot(a, b)
    # Around -z, then turned by theta_i about y, so that light from phi_i = 0 goes straight on.
    sine, turn = np.sin(angle), np.arctan2(b, a)
    x, y, z = sine * np.cos(turn), sine * np.sin(turn), -np.cos(angle)
    c, s = np.cos(np.radians(theta_i)), np.sin(np.radians(theta_i))
    x, z = x * c + z * s, z * c - x * s
    signal = power * np.exp(-(angle**2) / (2 * WIDTH**2)) / (2 * np.pi * WIDTH**2)
    rng = np.random.default_rng(seed)
    signal = signal * (1 + noise * rng.standard_normal(signal.size)) + offset
    theta, phi = np.degrees(np.arccos(z)), np.degrees(np.arctan2(y, x)) % 360
    rows = [f"{t:.5f}\t{p:.5f}\t{v:.7e}" for t, p, v in zip(theta, phi, signal)]
    lines = [f"#format: theta\tphi\t{label}", "#upphi 90", f"#incident_angle {theta_i:g} 0", *rows]
    path.write_text("\n".join(lines) + "\n")
    return path


@pytest.mark.parametrize("theta_i", [0.0, 30.0])
def test_the_power_of_a_known_beam(tmp_path: Path, theta_i: float) -> None:
    beam = gonio.read_beam(scan(tmp_path / "beam.txt", power=2.7e-4, theta_i=theta_i))
    assert beam.power == pytest.approx(2.7e-4, rel=2e-3)
    assert abs(beam.power / 2.7e-4 - 1) < beam.relative_bound + 1e-4
    assert beam.fwhm_deg == pytest.approx(np.degrees(WIDTH) * 2.3548, rel=0.05)
    assert beam.unit == "[uA]" and beam.warnings == ()


def test_its_standard_error_is_the_spread_of_repeated_scans(tmp_path: Path) -> None:
    beams = [
        gonio.read_beam(scan(tmp_path / "beam.txt", power=1.0, noise=0.03, step_deg=0.05, seed=k))
        for k in range(60)
    ]
    # The spread of 60 values is known to 9 %.
    spread = np.std([b.power for b in beams], ddof=1)
    assert np.mean([b.relative_se for b in beams]) == pytest.approx(spread, rel=0.3)


def raw_table(measure: Any, path: Path, *, power: float, label: str = "[uA]") -> Path:
    """The signal that the analytic sample would give in this beam."""
    table = measure(40.0, shadow=False)
    text = gonio.write(replace(table, values=power * table.values), path).read_text()
    path.write_text(text.replace("theta phi DSF", f"theta phi {label}"))
    return path


@pytest.mark.parametrize("label", ["[uA]", "DSF"])
def test_a_table_in_arbitrary_units_becomes_absolute(measure: Any, tmp_path: Path, label: str) -> None:
    power = 3.1e-3
    beam = gonio.read_beam(scan(tmp_path / "beam.txt", power=power, noise=0.02))
    (table,) = gonio.read(raw_table(measure, tmp_path / "raw.txt", power=power, label=label), beam=beam)
    assert table.quantity == "DSF"
    assert any("bare beam" in w for w in table.warnings)
    s = gonio.summarise(table)
    assert abs(s.tau - 0.579) < 3 * s.tau_se + s.tau_systematic
    # The error of the scan is common to all values and stands in both.
    assert s.tau_se == pytest.approx(np.hypot(s.distribution.standard_error, beam.relative_se * s.tau))
    assert s.systematic["scale"] == pytest.approx(beam.relative_bound * s.tau)
    assert s.tau_se > 2 * s.distribution.standard_error


def test_the_command_takes_the_scan(command: Any, measure: Any, tmp_path: Path) -> None:
    beam = scan(tmp_path / "beam.txt", power=7.0)
    raw = raw_table(measure, tmp_path / "raw.txt", power=7.0)
    code, out, err = command("gonio", "info", raw, "--beam", beam, "--json")
    assert code == 0, err
    assert out["files"][0]["tau"] == pytest.approx(0.579, rel=5e-3)
    assert out["files"][0]["quantity"] == "DSF"
    assert command("gonio", "info", raw)[0] == 3


def test_what_is_normalised_already_is_refused(measure: Any, tmp_path: Path) -> None:
    beam = gonio.read_beam(scan(tmp_path / "beam.txt", power=1.0))
    with pytest.raises(FormatError, match=r"expected a raw signal.*--beam"):
        gonio.read(raw_table(measure, tmp_path / "raw.txt", power=1.0, label="BSDF"), beam=beam)


@pytest.mark.parametrize(
    "spoil,said",
    [
        ({"step_deg": 0.25}, "6 directions or more above half"),
        ({"reach_deg": 0.12}, "contains the whole beam"),
        ({"power": -1.0}, "above half of the beam's peak"),
    ],
)
def test_a_scan_that_cannot_give_the_power_is_refused(
    tmp_path: Path, spoil: dict[str, Any], said: str
) -> None:
    with pytest.raises(FormatError, match=said):
        gonio.read_beam(scan(tmp_path / "beam.txt", **{"power": 1.0, **spoil}))


def test_an_offset_of_the_detector_is_in_the_bound_and_warned_of(tmp_path: Path) -> None:
    peak = 1.0 / (2 * np.pi * WIDTH**2)
    beam = gonio.read_beam(scan(tmp_path / "beam.txt", power=1.0, offset=0.005 * peak))
    assert abs(beam.power - 1.0) > 0.03
    assert abs(beam.power - 1.0) < beam.relative_bound * beam.power * 1.05
    assert any("by the signal at its rim" in w for w in beam.warnings)
