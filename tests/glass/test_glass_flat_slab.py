"""A flat pane has a closed form: Fresnel's equations and the sum over all reflections."""

import numpy as np
import pytest

from specularia.errors import CoverageError, PhysicsError
from specularia.glass import Medium, Slab, closed_form, trace, trace_paths
from specularia.glass.kernel import LOST

THETA = [0.0, 20.0, 40.0, 60.0, 82.5]
SCALAR = [0.9183, 0.9178, 0.9076, 0.8307, 0.3438]


def test_closed_form_gives_the_known_values():
    scalar = closed_form.flat_slab(THETA, index=1.52, polarised=False)
    exact = closed_form.flat_slab([60.0, 82.5], index=1.52)
    assert np.allclose(scalar.transmitted, SCALAR, atol=5e-5)
    assert np.allclose(exact.transmitted, [0.8435, 0.3568], atol=5e-5)


def test_closed_form_sums_to_one_and_ends_at_grazing():
    found = closed_form.flat_slab(np.linspace(0, 90, 91), index=1.52, absorption_per_mm=0.2, thickness_mm=3.0)
    assert np.allclose(found.transmitted + found.reflected + found.absorbed, 1.0, atol=1e-12)
    assert found.transmitted[-1] == pytest.approx(0.0, abs=1e-12)
    assert closed_form.flat_slab(90.0, index=1.52).transmitted == pytest.approx(0.0, abs=1e-12)
    with pytest.raises(PhysicsError, match="between 0 and 90"):
        closed_form.flat_slab(95.0, index=1.52)


def test_fresnel_reflects_no_p_light_at_brewsters_angle():
    rs, rp = closed_form.fresnel(np.degrees(np.arctan(1.52)), index=1.52)
    assert rp == pytest.approx(0.0, abs=1e-15)
    assert rs == pytest.approx(((1.52**2 - 1) / (1.52**2 + 1)) ** 2)


@pytest.mark.parametrize("polarised", [False, True])
def test_flat_slab_traced_within_three_standard_errors_of_the_closed_form(polarised):
    exact = closed_form.flat_slab(THETA, index=1.52, polarised=polarised)
    if not polarised:
        assert np.allclose(exact.transmitted, SCALAR, atol=5e-5)
    found = trace(Slab(thickness_mm=3.0), theta_deg=THETA, paths=1_600_000, seed=1, polarised=polarised)
    assert np.all(found.tau_se <= 2e-4)
    assert np.all(np.abs(found.tau - exact.transmitted) < 3 * found.tau_se)
    assert np.all(np.abs(found.tau + found.rho - 1) < 1e-9)
    assert found.lost.sum() == 0


@pytest.mark.parametrize("side", ["front", "back"])
def test_absorbing_flat_slab_agrees_with_the_closed_form(side):
    slab = Slab(thickness_mm=3.0, medium=Medium(absorption_per_mm=0.07))
    found = trace(slab, theta_deg=[0.0, 60.0], side=side, paths=320_000, seed=2)
    exact = closed_form.flat_slab([0.0, 60.0], index=1.52, absorption_per_mm=0.07, thickness_mm=3.0)
    assert np.all(np.abs(found.tau - exact.transmitted) < 3 * found.tau_se)
    assert np.all(np.abs(found.rho - exact.reflected) < 3 * found.rho_se)
    assert np.all(np.abs(found.absorbed - exact.absorbed) < 3 * found.absorbed_se)
    assert np.all(np.abs(found.tau + found.rho + found.absorbed - 1) < 1e-9)


@pytest.mark.parametrize(("side", "sign"), [("front", 1), ("back", 1)])
def test_flat_slab_deflects_nothing_and_mirrors_in_the_normal(side, sign):
    paths = trace_paths(Slab(thickness_mm=1.0), side=side, theta_deg=35.0, phi_deg=110.0, paths=3200)
    s, p = np.sin(np.radians(35.0)), np.radians(110.0)
    # Undeflected and mirrored light leave with the same direction cosines along the pane.
    assert np.allclose(paths.ux, -s * np.cos(p), atol=1e-12)
    assert np.allclose(paths.uy, -s * np.sin(p), atol=1e-12)
    assert np.all(paths.transmitted ^ paths.reflected)
    assert sign * paths.transmitted.sum() > 0


def test_a_sample_turned_under_the_beam_gives_directions_as_from_azimuth_zero():
    paths = trace_paths(Slab(thickness_mm=1.0), theta_deg=50.0, phi_deg=None, paths=3200)
    assert np.allclose(paths.ux, -np.sin(np.radians(50.0)), atol=1e-12)
    assert np.allclose(paths.uy, 0.0, atol=1e-12)


def test_way_in_glass_lets_another_absorption_be_applied():
    clear = trace_paths(Slab(thickness_mm=2.0), theta_deg=40.0, paths=3200, seed=3)
    tinted = trace_paths(
        Slab(thickness_mm=2.0, medium=Medium(absorption_per_mm=0.3)), theta_deg=40.0, paths=3200, seed=3
    )
    assert np.allclose(tinted.weight, np.exp(-0.3 * clear.glass_length_mm), rtol=1e-12)
    single = 2.0 / np.sqrt(1 - (np.sin(np.radians(40.0)) / 1.52) ** 2)
    passes = clear.glass_length_mm / single
    assert np.allclose(passes, np.round(passes), atol=1e-9)


def test_black_glass_swallows_what_enters_and_loses_no_path():
    slab = Slab(thickness_mm=3.0, medium=Medium(absorption_per_mm=100.0))
    found = trace(slab, theta_deg=[30.0], paths=32_000)
    rs, rp = closed_form.fresnel(30.0, index=1.52)
    assert found.tau[0] < 1e-12
    assert found.rho[0] == pytest.approx(0.5 * (rs + rp), abs=4 * found.rho_se[0])
    assert abs(found.rho[0] + found.absorbed[0] - 1) < 1e-9
    paths = trace_paths(slab, theta_deg=30.0, paths=3200)
    assert not np.any(paths.exit_side == LOST)


def test_directions_outside_the_hemisphere_are_refused():
    for theta in (-1.0, 90.0, 120.0):
        with pytest.raises(CoverageError, match="0 <= theta < 90"):
            trace_paths(Slab(thickness_mm=1.0), theta_deg=theta, paths=32)
    with pytest.raises(PhysicsError, match="front or on the back"):
        trace_paths(Slab(thickness_mm=1.0), side="top", theta_deg=0.0, paths=32)  # type: ignore[arg-type]
