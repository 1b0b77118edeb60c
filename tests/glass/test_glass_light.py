"""What the tracer is asked to do with light: lasers, small slopes, liquids on a face, and finite patches."""

from dataclasses import replace

import numpy as np
import pytest
from glass_reference import smooth_map

from specularia.errors import PhysicsError
from specularia.glass import Face, Medium, Patch, Slab, closed_form, reweight, trace, trace_paths
from specularia.glass.kernel import SIDES

LASER = 1_600_000


@pytest.fixture(scope="module")
def rough() -> Slab:
    return Slab(
        thickness_mm=0.5,
        front=Face(smooth_map((40, 50), seed=1, rms_slope=0.4), 1.5, 1.5),
        back=Face(smooth_map((36, 30), seed=2, rms_slope=0.5), 1.5, 1.5),
    )


@pytest.mark.parametrize(("side", "phi"), [("front", 37.0), ("back", 0.0)])
@pytest.mark.parametrize(("name", "q"), [("s", 1.0), ("p", -1.0)])
def test_laser_at_60_degrees_is_transmitted_as_the_closed_form_says(name, q, side, phi):
    slab = Slab(thickness_mm=3.0, incident=(q, 0.0, 0.0))
    found = trace(slab, theta_deg=[60.0], phi_deg=phi, side=side, paths=LASER, seed=1)
    single = closed_form.fresnel(60.0, index=1.52)[0 if name == "s" else 1]
    exact = (1 - single) / (1 + single)
    assert found.tau_se[0] <= 2e-4
    assert abs(found.tau[0] - exact) < 3 * found.tau_se[0]
    assert abs(found.tau[0] + found.rho[0] - 1) < 1e-9


def test_light_polarised_in_between_and_circularly_is_the_mean_of_s_and_p():
    exact = closed_form.flat_slab(60.0, index=1.52).transmitted
    for incident in ((0.0, 1.0, 0.0), (0.0, 0.0, -1.0), (0.0, 0.6, 0.8)):
        found = trace(Slab(thickness_mm=1.0, incident=incident), theta_deg=[60.0], paths=320_000, seed=2)
        assert abs(found.tau[0] - exact) < 3 * found.tau_se[0]


def test_impossible_light_is_refused():
    with pytest.raises(PhysicsError, match="degree of 0 to 1"):
        Slab(thickness_mm=1.0, incident=(1.0, 0.5, 0.0))
    with pytest.raises(PhysicsError, match="traced with polarisation"):
        Slab(thickness_mm=1.0, incident=(1.0, 0.0, 0.0), polarised=False)


@pytest.mark.parametrize("theta", [0.0, 60.0])
@pytest.mark.parametrize("phi", [0.0, 90.0])
def test_small_slopes_deflect_to_first_order(theta, phi):
    # A relief h changes the wave's tangential part by (n cos theta_t - cos theta) grad h.
    slope, n = 0.01, 1.52
    x = np.arange(512)
    heights = np.tile(slope * 512 / (2 * np.pi) * np.sin(2 * np.pi * x / 512), (2, 1))
    slab = Slab(thickness_mm=3.0, front=Face(heights))
    paths = trace_paths(slab, theta_deg=theta, phi_deg=phi, paths=64_000, seed=1)
    s = np.sin(np.radians(theta))
    cos_t = np.sqrt(1 - (s / n) ** 2)
    once = paths.transmitted & (np.abs(paths.glass_length_mm * cos_t / 3.0 - 1) < 0.05)
    kick = n * cos_t - np.cos(np.radians(theta))
    over = (paths.ux + s * np.cos(np.radians(phi)))[once] / slope
    # Even over a period, the slope is a cosine: mean 0, mean square 1/2, and never above its amplitude.
    assert np.mean(over) == pytest.approx(0.0, abs=0.01)
    assert np.mean(over**2) == pytest.approx(kick**2 / 2, rel=0.02)
    assert np.abs(over).max() == pytest.approx(kick, rel=0.02)
    assert np.abs(paths.uy[once] + s * np.sin(np.radians(phi))).max() < 2e-4


def test_matched_liquid_on_both_faces_makes_a_rough_pane_flat(rough):
    sealed = replace(
        rough,
        front=replace(rough.front, sealant_index=1.52),
        back=replace(rough.back, sealant_index=1.52),
    )
    theta = [0.0, 60.0]
    found = trace(sealed, theta_deg=theta, paths=LASER, seed=3)
    exact = closed_form.flat_slab(theta, index=1.52).transmitted
    assert np.all(found.tau_se <= 2e-4)
    assert np.all(np.abs(found.tau - exact) < 3 * found.tau_se)
    paths = trace_paths(sealed, theta_deg=50.0, paths=3200)
    assert np.allclose(paths.ux, -np.sin(np.radians(50.0)), atol=1e-9)
    assert np.allclose(paths.uy, 0.0, atol=1e-9)


@pytest.mark.parametrize("side", ["front", "back"])
def test_liquid_on_a_flat_face_is_a_stack_of_three_interfaces(side):
    slab = Slab(thickness_mm=1.0, front=Face.flat(sealant_index=1.33))
    found = trace(slab, theta_deg=[0.0], side=side, paths=LASER, seed=4)

    def both(a, b):
        return a + (1 - a) ** 2 * b / (1 - a * b)

    film, seam, glass = (0.33 / 2.33) ** 2, (0.19 / 2.85) ** 2, (0.52 / 2.52) ** 2
    exact = both(both(film, seam), glass)
    assert abs(found.rho[0] - exact) < 3 * found.rho_se[0] < 6e-4
    assert found.lost[0] == 0


def test_liquid_narrows_the_light_and_keeps_all_of_it(rough):
    def width(slab):
        p = trace_paths(slab, theta_deg=0.0, paths=32_000, seed=5)
        assert np.all((p.weight == 1.0) & (p.transmitted | p.reflected))
        return np.sqrt(np.mean(p.ux[p.transmitted] ** 2))

    one = replace(rough, front=replace(rough.front, sealant_index=1.45))
    two = replace(one, back=replace(rough.back, sealant_index=1.45))
    assert width(two) < 0.35 * width(one) < 0.35 * width(rough)


def test_reflecting_sides_of_a_patch_lose_nothing_and_absorbing_ones_a_share(rough):
    theta = [0.0, 60.0]
    endless = trace(rough, theta_deg=theta, paths=64_000, seed=6)
    lost = []
    for width in (0.6, 2.4, 9.6):
        cut = {
            sides: trace(
                replace(rough, patch=Patch(width_mm=width, sides=sides)),
                theta_deg=theta,
                paths=32_000,
                seed=6,
            )
            for sides in ("absorbing", "clear", "reflecting")
        }
        assert np.allclose(cut["reflecting"].tau + cut["reflecting"].rho, 1.0, atol=1e-9)
        assert np.allclose(cut["absorbing"].tau + cut["absorbing"].rho + cut["absorbing"].absorbed, 1.0)
        left = {k: 1 - b.tau - b.rho for k, b in cut.items()}
        # Polished sides reflect what meets them at a slant.
        assert np.all(left["clear"] < left["absorbing"])
        lost.append(left["absorbing"])
    # A patch four times as wide has a quarter of the edge for its area; light that total reflection traps
    # finds the edge from further away.
    assert np.all((lost[1] < 0.75 * lost[0]) & (lost[2] < 0.75 * lost[1]) & (lost[2] > 0.25 * lost[1]))
    wide = trace(
        replace(rough, patch=Patch(width_mm=400.0, sides="absorbing", lit_mm=0.9)),
        theta_deg=theta,
        paths=64_000,
        seed=7,
    )
    assert np.all(np.abs(wide.tau - endless.tau) < 4 * np.hypot(wide.tau_se, endless.tau_se) + 1e-4)


def test_mirror_sides_of_a_flat_patch_change_nothing():
    patch = Patch(width_mm=1.0, sides="reflecting")
    for incident in ((1.0, 0.0, 0.0), (0.0, 0.0, 0.0)):
        slab = Slab(thickness_mm=3.0, incident=incident)
        a = trace(slab, theta_deg=[60.0], phi_deg=20.0, paths=320_000, seed=1)
        b = trace(replace(slab, patch=patch), theta_deg=[60.0], phi_deg=20.0, paths=320_000, seed=1)
        assert abs(a.tau[0] - b.tau[0]) < 3 * np.hypot(a.tau_se[0], b.tau_se[0])


def test_light_that_leaves_through_clear_sides_is_told_apart(rough):
    slab = replace(rough, patch=Patch(width_mm=0.6, sides="clear"))
    paths = trace_paths(slab, theta_deg=40.0, paths=6400)
    out = paths.exit_side == SIDES
    assert 0.02 < out.mean() < 0.9
    assert np.all(paths.weight[out] == 1.0)
    assert not np.any(out & (paths.transmitted | paths.reflected))


def test_patches_that_cannot_be_are_refused(rough):
    with pytest.raises(PhysicsError, match="width of a patch"):
        Patch(width_mm=0.0)
    with pytest.raises(PhysicsError, match="lies within"):
        Patch(width_mm=1.0, lit_mm=2.0)
    with pytest.raises(PhysicsError, match="absorbing, clear, reflecting"):
        Patch(width_mm=1.0, sides="open")  # type: ignore[arg-type]


@pytest.mark.parametrize("traced_with", [0.0, 0.05])
def test_another_absorption_needs_no_second_trace(rough, traced_with):
    slab = replace(rough, medium=Medium(absorption_per_mm=traced_with))
    first = trace_paths(slab, theta_deg=30.0, paths=6400, seed=2)
    tinted = replace(rough, medium=Medium(absorption_per_mm=0.4))
    second = trace_paths(tinted, theta_deg=30.0, paths=6400, seed=2)
    found = reweight(first, absorption_per_mm=0.4, traced_with_per_mm=traced_with)
    assert np.allclose(found.weight, second.weight, rtol=1e-9)
    assert np.allclose(found.weight + found.absorbed, 1.0, atol=1e-12)
    # Where all light was absorbed on the way, the second trace stops there.
    alive = second.weight > 0
    assert alive.mean() > 0.9
    assert np.array_equal(found.ux[alive], second.ux[alive])
    with pytest.raises(PhysicsError, match="that or more"):
        reweight(first, absorption_per_mm=0.1, traced_with_per_mm=0.2)
