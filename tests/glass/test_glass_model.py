"""Model C: the tables hold the light that was traced, in the right directions."""

import json

import numpy as np
import pytest
from glass_reference import smooth_map

from specularia.bsdf import read_model, write_model
from specularia.errors import PhysicsError
from specularia.glass import Face, Medium, Slab, closed_form, model, trace, trace_paths
from specularia.glass.model import NODES_DEG, traced_model

THETA = [0.0, 40.0, 80.0]


@pytest.fixture(scope="module")
def slab() -> Slab:
    return Slab(
        thickness_mm=1.0,
        medium=Medium(absorption_per_mm=0.05),
        front=Face(smooth_map((48, 60), seed=1, rms_slope=0.2), 1.5, 1.5, name="front.nc"),
        back=Face(smooth_map((40, 40), seed=2, rms_slope=0.3), 1.5, 1.5, name="back.nc"),
        synthetic=True,
    )


@pytest.fixture(scope="module")
def traced(slab):
    return traced_model(slab, theta_deg=THETA, paths=64_000, seed=1)


def test_model_of_a_clear_flat_pane_transmits_as_the_closed_form_between_its_nodes():
    found = model(Slab(thickness_mm=3.0), paths=64_000, seed=1)
    theta = np.linspace(0, 89, 179)
    exact = closed_form.flat_slab(theta, index=1.52).transmitted
    assert np.abs(found.direct_hemispherical("transmission_front", theta) - exact).max() < 4e-3
    assert np.abs(found.direct_hemispherical("reflection_back", theta) - 1 + exact).max() < 4e-3
    assert found.extrapolated_beyond_deg["transmission_front"] == NODES_DEG[-1]


@pytest.mark.parametrize("side", ["front", "back"])
def test_model_agrees_with_the_energy_balance_averaged_over_azimuth(slab, traced, side):
    other = trace(slab, side=side, theta_deg=THETA, phi_deg=None, paths=128_000, seed=99)
    for name, share, error in (
        ("transmission", other.tau, other.tau_se),
        ("reflection", other.rho, other.rho_se),
    ):
        table = traced.model.tables[f"{name}_{side}"]
        assert np.all(np.abs(table.tau - share) < 4 * np.hypot(error, table.tau_se) + 1e-5)


def test_azimuth_average_is_the_mean_over_fixed_azimuths(slab):
    fixed = [
        trace(slab, theta_deg=[70.0], phi_deg=p, paths=32_000, seed=k)
        for k, p in enumerate(range(0, 360, 30))
    ]
    mean = np.mean([f.tau[0] for f in fixed])
    error = np.sqrt(np.sum([f.tau_se[0] ** 2 for f in fixed])) / len(fixed)
    averaged = trace(slab, theta_deg=[70.0], phi_deg=None, paths=128_000, seed=77)
    assert abs(averaged.tau[0] - mean) < 4 * np.hypot(error, averaged.tau_se[0])


@pytest.mark.parametrize("theta", THETA)
def test_light_leaves_where_the_paths_left(slab, traced, theta):
    paths = trace_paths(slab, theta_deg=theta, phi_deg=None, paths=256_000, seed=50)
    sine = np.sin(np.radians(theta))
    for side, leaves in (("transmission_front", paths.transmitted), ("reflection_front", paths.reflected)):
        table = traced.model.tables[side]
        k = THETA.index(theta)
        whole = table.base[k].astype(float).sum() * np.pi / table.base.shape[1] ** 2
        assert whole == pytest.approx(table.tau[k], rel=1e-5)
        x, y, w = paths.ux[leaves], paths.uy[leaves], paths.weight[leaves]
        q = traced.model.quadrature(side, theta)
        f = q.weight * traced.model.evaluate(side, theta, 0.0, q.ux, q.uy)
        noise = 1e-3 + 4 * max(x.std(), y.std()) / np.sqrt(len(x) / 4)
        assert np.sum(f * q.ux) / f.sum() == pytest.approx(np.sum(w * x) / w.sum(), abs=noise)
        assert np.sum(f * q.uy) / f.sum() == pytest.approx(np.sum(w * y) / w.sum(), abs=noise)
        # Within the finer table, and within half its width.
        for part in (1.0, 0.5):
            h = part * table.half_width
            near = (np.abs(q.ux + sine) < h) & (np.abs(q.uy) < h)
            share = w[(np.abs(x + sine) < h) & (np.abs(y) < h)].sum() / len(paths)
            assert f[near].sum() == pytest.approx(share, abs=0.004)


def test_errors_of_the_cells_agree_with_their_spread_over_seeds(slab, traced):
    others = [model(slab, theta_deg=[40.0], paths=64_000, seed=s) for s in range(2, 6)]
    cells = np.stack([o.tables["transmission_front"].base[0] for o in others])
    stated = traced.model.tables["transmission_front"].base_se[1]
    bright = cells.mean(axis=0) > 4 * stated
    ratio = cells.std(axis=0, ddof=1)[bright] / stated[bright]
    assert bright.sum() > 100
    assert np.sqrt(np.mean(ratio**2)) == pytest.approx(1.0, abs=0.2)


def test_model_says_where_it_comes_from_and_survives_its_file(traced, tmp_path):
    found = read_model(write_model(traced.model, tmp_path / "c.nc"))
    assert found.band == "520 nm"
    assert found.attributes["seed"] == "1"
    assert "synthetic" in found.attributes
    parameters = json.loads(found.attributes["parameters"])
    assert parameters["front"] == "front.nc"
    assert parameters["absorption_per_mm"] == 0.05
    assert parameters["paths_per_direction"] == 64_000
    assert all(t.origin == "traced" for t in found.tables.values())


def test_angles_that_do_not_ascend_are_refused(slab):
    with pytest.raises(PhysicsError, match="ascend"):
        model(slab, theta_deg=[10.0, 10.0], paths=32)
