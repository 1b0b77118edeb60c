"""A hybrid of measurement and traced pane: the measurement where it is, the pane beyond, no step between."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from specularia import analysis, bsdf, gonio
from specularia.cli import main
from specularia.errors import CoverageError, PhysicsError, SpeculariaWarning
from specularia.glass import Face, Medium, Slab, model, photometer, trace

MEASURED = (0.0, 30.0, 60.0)
NODES = (0, 30, 50, 60, 65, 70, 75, 80, 85, 88)


def pane(absorption_per_mm: float) -> Slab:
    x = 2.0 * np.pi * np.arange(64) / 64
    relief = 3.0 * (np.sin(x)[None, :] + np.cos(x)[:, None])
    return Slab(3.0, Medium(absorption_per_mm=absorption_per_mm), Face(relief, 1.5, 1.5), synthetic=True)


@pytest.fixture(scope="module")
def parts():  # type: ignore[no-untyped-def]
    """A model measured to 60 degrees, and one traced through a pane that absorbs 6 % too much."""
    tables = []
    for k, theta in enumerate(MEASURED):
        rng = np.random.default_rng(k)
        directions = photometer.scan(theta, base=6_000, middle=6_000, peak=6_000, rng=rng)
        clean = photometer.measure(
            pane(0.07), theta_deg=theta, directions=directions, paths=150_000, seed=k, synthetic=True
        )
        tables.append(photometer.recorded(clean, relative_noise=0.01, floor=1e-5, shadow=False, rng=rng))
    traced = model(pane(0.074), paths=15_000, theta_deg=NODES, seed=5)
    return gonio.fit(tables), traced


@pytest.fixture(scope="module")
def joined(parts):  # type: ignore[no-untyped-def]
    return analysis.hybrid(*parts)


def test_grazing_transmission_is_right_though_measured_to_60_degrees_only(parts, joined) -> None:  # type: ignore[no-untyped-def]
    theta = [75.0, 85.0]
    truth = trace(pane(0.07), theta_deg=theta, phi_deg=None, paths=200_000, seed=9).tau
    off = joined.direct_hemispherical("transmission_front", theta) / truth - 1.0
    assert abs(off[0]) < 0.04 and abs(off[1]) < 0.10
    # The pane as traced is further off: the join takes up what its absorption is wrong by.
    alone = parts[1].direct_hemispherical("transmission_front", theta) / truth - 1.0
    assert np.all(np.abs(alone) > np.abs(off))


def test_measured_angles_stay_as_measured_and_the_join_has_no_step(parts, joined) -> None:  # type: ignore[no-untyped-def]
    measured, _ = parts
    side = "transmission_front"
    table, own = joined.tables[side], measured.tables[side]
    np.testing.assert_array_equal(table.base[: len(MEASURED)], own.base)
    np.testing.assert_array_equal(table.tau[: len(MEASURED)], own.tau)
    between = [60.0, 61.0, 63.0, 65.0, 67.0]
    truth = trace(pane(0.07), theta_deg=between, phi_deg=None, paths=100_000, seed=9).tau
    tau = joined.direct_hemispherical(side, between)
    np.testing.assert_allclose(tau, truth, rtol=0.03)
    assert np.all(np.diff(tau) < 0.0)


def test_every_angle_says_where_it_comes_from(joined) -> None:  # type: ignore[no-untyped-def]
    marks = json.loads(joined.attributes["origin_transmission_front"])
    assert marks[:3] == [[t, "measured"] for t in MEASURED]
    assert [m for _, m in marks[3:]] == ["traced"] * (len(NODES) - 4)
    assert "measured to 60 degrees" in joined.origin("transmission_front")
    assert joined.extrapolated_beyond_deg["transmission_front"] == 88.0
    assert {o for _, o in json.loads(joined.attributes["origin_transmission_back"])} == {"traced"}
    assert "synthetic" in joined.attributes


def test_the_standard_error_grows_by_that_of_the_join(parts, joined) -> None:  # type: ignore[no-untyped-def]
    table, traced = joined.tables["transmission_front"], parts[1].tables["transmission_front"]
    ratio = json.loads(joined.attributes["joined_transmission_front"])["ratio"]
    assert 1.005 < ratio < 1.05
    assert np.all(table.tau_se[3:] > ratio * traced.tau_se[4:])
    assert table.base_se is not None and table.base_se.shape == table.base.shape


def test_back_and_reflection_are_answered_too(joined) -> None:  # type: ignore[no-untyped-def]
    assert set(joined.sides) == {
        "transmission_front",
        "transmission_back",
        "reflection_front",
        "reflection_back",
    }


def test_models_that_do_not_belong_together_are_refused(parts) -> None:  # type: ignore[no-untyped-def]
    measured, traced = parts
    with pytest.raises(PhysicsError, match="one band"):
        analysis.hybrid(measured, bsdf.TabulatedModel(traced.tables, "600 nm"))
    with pytest.raises(CoverageError, match="ends at 60"):
        short = {
            s: bsdf.SideTable(
                theta_i_deg=t.theta_i_deg[:4],
                base=t.base[:4],
                patch=t.patch[:4],
                half_width=t.half_width,
                tau=t.tau[:4],
                tau_se=t.tau_se[:4],
                origin="traced",
            )
            for s, t in traced.tables.items()
        }
        analysis.hybrid(measured, bsdf.TabulatedModel(short, traced.band))
    other = model(pane(0.25), paths=2_000, theta_deg=NODES[3:], seed=5)
    with pytest.warns(SpeculariaWarning, match="scaled by"):
        analysis.hybrid(measured, other)


def test_the_command_writes_a_file_that_reads_back(parts, tmp_path: Path, capsys) -> None:  # type: ignore[no-untyped-def]
    for name, one in zip("mc", parts):
        bsdf.write(one, tmp_path / f"{name}.nc")
    words = ["hybrid", str(tmp_path / "m.nc"), str(tmp_path / "c.nc"), "-o", str(tmp_path / "h.nc")]
    assert main([*words, "--json", "-q"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert found["sides"]["transmission_front"]["joined"]["theta_deg"] == 60.0
    again = bsdf.read_model(tmp_path / "h.nc")
    assert "traced beyond" in again.origin("transmission_front")
    assert json.loads(again.attributes["origin_transmission_back"])[0][1] == "traced"
    assert main([*words[:3], "-o", str(tmp_path / "h.txt")]) == 2
