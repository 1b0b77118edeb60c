"""As many paths as a wanted error takes, with standard errors and noise that are what they say."""

import numpy as np
import pytest
from glass_reference import smooth_map

from specularia.errors import PhysicsError, SpeculariaWarning
from specularia.glass import Face, Slab, trace
from specularia.glass.directions import Direction, Task, trace_direction
from specularia.glass.effort import Effort
from specularia.glass.model import traced_model
from specularia.glass.tally import BASE_CELLS


@pytest.fixture(scope="module")
def slab() -> Slab:
    return Slab(
        thickness_mm=1.0,
        front=Face(smooth_map((48, 60), seed=1, rms_slope=0.2), 1.5, 1.5),
        back=Face(smooth_map((40, 40), seed=2, rms_slope=0.3), 1.5, 1.5),
    )


def light(distribution):
    """Light in 64 x 64 cells of equal projected solid angle."""
    cells = distribution.base.astype(float) * np.pi / BASE_CELLS**2
    return cells.reshape(64, 2, 64, 2).sum(axis=(1, 3))


def test_rounds_grow_with_the_error_and_end_at_the_target():
    effort = Effort(10_000_000, 0.03)
    first = effort.next_round(0, np.inf)
    assert 0 < first < 200_000
    assert effort.next_round(first, 0.0299) == 0
    assert effort.next_round(first, 0.031) < effort.next_round(first, 0.05) <= 3 * first
    assert effort.next_round(9_999_990, 0.05) == 10
    assert effort.next_round(10_000_000, 0.05) == 0
    fixed = Effort(500)
    assert (fixed.next_round(0, np.inf), fixed.next_round(500, 1.0)) == (500, 0)
    with pytest.raises(PhysicsError, match="target error"):
        Effort(100, 2.0)


def test_an_energy_balance_stops_each_angle_at_its_error(slab):
    found = trace(slab, theta_deg=[0.0, 80.0], paths=10_000_000, target_error=0.002, seed=3)
    relative = found.tau_se / found.tau
    assert np.all(relative <= 0.002)
    # Transmission at 80 degrees is the noisier one.
    assert found.paths[1] > found.paths[0]
    exact = trace(slab, theta_deg=[0.0, 80.0], paths=1_000_000, seed=4)
    assert np.all(np.abs(found.tau - exact.tau) < 4 * np.hypot(found.tau_se, exact.tau_se))


def test_directions_that_cannot_reach_the_target_are_counted(slab):
    with pytest.warns(SpeculariaWarning, match="1 of 1 directions did not reach the target error"):
        found = trace(slab, theta_deg=[80.0], paths=10_000, target_error=1e-4)
    assert found.paths[0] == 10_016


def test_stated_noise_is_the_distance_from_the_truth(slab):
    """Against a run of twenty times the paths, whose own noise is less than a quarter."""
    direction = Direction("front", 40.0)
    rough = trace_direction(slab, direction, Task(Effort(50_000_000, 0.1), seed=1))
    fine = trace_direction(slab, direction, Task(Effort(20 * rough.paths), seed=2))
    assert rough.transmitted.noise <= 0.1
    truth = light(fine.transmitted)
    # The base is merged where paths are few, which lowers its noise below the stated one of single cells.
    found = np.abs(light(rough.transmitted) - truth).sum() / truth.sum()
    assert 0.4 * rough.transmitted.noise < found < 1.15 * rough.transmitted.noise


@pytest.mark.parametrize("table", ["base", "patch"])
def test_errors_of_cells_from_replicates_agree_with_their_spread_over_seeds(slab, table):
    runs = [
        trace_direction(slab, Direction("front", 20.0), Task(Effort(64_000), seed=s)).transmitted
        for s in range(8)
    ]
    cells = np.stack([getattr(r, table) for r in runs])
    stated = np.sqrt(np.mean([getattr(r, f"{table}_se") ** 2 for r in runs], axis=0))
    bright = cells.mean(axis=0) > 5 * stated
    assert bright.sum() > 100
    spread = cells.var(axis=0, ddof=1)[bright].mean()
    assert np.sqrt(spread / np.mean(stated[bright] ** 2)) == pytest.approx(1.0, abs=0.07)


def test_every_cell_of_a_model_has_a_standard_error(slab):
    model = traced_model(slab, theta_deg=[0.0, 70.0], paths=20_000).model
    for table in model.tables.values():
        assert np.all(table.base_se > 0) and np.all(table.patch_se > 0)
        assert np.all(table.tau_se > 0)


def test_an_anisotropic_model_keeps_the_azimuth_that_an_isotropic_one_averages_over():
    x = np.arange(40)
    ribbed = np.tile(1.2 * np.sin(2 * np.pi * x / 20), (30, 1))
    slab = Slab(thickness_mm=1.0, front=Face(ribbed, 1.5, 1.5))
    found = traced_model(slab, theta_deg=[0.0, 60.0], paths=48_000, azimuths=4, seed=2)
    table = found.model.tables["transmission_front"]
    assert table.symmetry == "none"
    assert list(table.phi_i_deg) == [0.0, 0.0, 90.0, 180.0, 270.0]
    for phi in (0.0, 90.0):
        exact = trace(slab, theta_deg=[60.0], phi_deg=phi, paths=48_000, seed=9)
        tau = found.model.direct_hemispherical("transmission_front", 60.0, phi)
        assert abs(tau - exact.tau[0]) < 4 * np.hypot(exact.tau_se[0], table.tau_se[1])
    # Ribs along y deflect light along x only.
    q = found.model.quadrature("transmission_front", 60.0, 90.0)
    f = q.weight * found.model.evaluate("transmission_front", 60.0, 90.0, q.ux, q.uy)
    wide, narrow = (np.sqrt(np.sum(f * (v - np.sum(f * v) / f.sum()) ** 2) / f.sum()) for v in (q.ux, q.uy))
    assert wide > 3 * narrow
    across, along = (found.model.direct_hemispherical("transmission_front", 60.0, p) for p in (0.0, 90.0))
    assert along - across > 0.05
    assert found.balances["front"].tau[1] == pytest.approx(table.tau[1:].mean(), abs=1e-9)
    with pytest.raises(PhysicsError, match="at least 3 azimuths"):
        traced_model(slab, azimuths=2)
