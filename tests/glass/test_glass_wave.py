"""Scalar diffraction: gratings, rough screens, wedges and lenses in closed form; rays where rays are
right."""

import numpy as np
import pytest
from glass_reference import smooth_map
from scipy.special import jv

from specularia.errors import PhysicsError
from specularia.glass import BubbleKind, Face, Slab, agreement, caps, orders, size_agreement, wave

K = 2e3 * np.pi / 520.0
LAMBDA_UM = 0.52


def grating(amplitude_um: float, period_um: float = 40.0) -> Face:
    x = np.arange(64) / 64
    return Face(np.tile(amplitude_um * np.cos(2 * np.pi * x), (8, 1)), period_um / 64, period_um / 64)


@pytest.mark.parametrize("side", ["front", "back"])
@pytest.mark.parametrize("amplitude", [0.05, 0.35, 0.8])
def test_orders_of_a_sinusoidal_phase_grating_are_bessel_functions(side, amplitude):
    found = orders(Slab(thickness_mm=3.0, **{side: grating(amplitude)}), order=1)
    m = np.arange(-8, 9)
    exact = jv(m, 0.52 * K * amplitude) ** 2
    assert np.abs(found.power[0, m] - exact).max() < 1e-5
    assert found.ux[0, m] == pytest.approx(m * LAMBDA_UM / 40.0)
    assert found.specular == pytest.approx(jv(0, 0.52 * K * amplitude) ** 2, abs=1e-5)


def test_the_second_order_in_the_slopes_changes_a_shallow_grating_by_less_than_a_thousandth():
    slab = Slab(thickness_mm=3.0, front=grating(0.2))
    first, second = (orders(slab, order=k).power for k in (1, 2))
    assert np.abs(first - second).max() < 1e-3


def test_two_gratings_interfere_as_the_way_between_them_says():
    """Talbot: after 2 n period^2 / wavelength the first grating is back on itself, and phases add or
    cancel."""
    period, a = 40.0, 0.1
    talbot_mm = 1e-3 * 2.0 * 1.52 * period**2 / LAMBDA_UM
    front, back = grating(a, period), grating(a, period)
    twice = orders(Slab(thickness_mm=talbot_mm, front=front, back=back), order=1)
    assert twice.power[0, 1] == pytest.approx(jv(1, 2 * 0.52 * K * a) ** 2, rel=0.02)
    none = orders(Slab(thickness_mm=0.5 * talbot_mm, front=front, back=back), order=1)
    # Half of it moves the image by half a period: the pane is as good as flat.
    assert none.specular == pytest.approx(1.0, abs=0.01)


def test_specular_share_of_a_gaussian_relief_is_the_exponential_of_its_variance():
    for sigma in (0.05, 0.12):
        shares = []
        for seed in range(4):
            h = smooth_map((768, 768), seed=seed, rms_slope=0.1, width_px=3.0)
            h = (h - h.mean()) * (sigma / h.std())
            slab = Slab(thickness_mm=1.0, front=Face(h, 1.0, 1.0))
            shares.append(orders(slab, pitch_um=1.0, order=1).specular)
        exact = np.exp(-((2 * np.pi * 0.52 * sigma / LAMBDA_UM) ** 2))
        assert np.mean(shares) == pytest.approx(exact, rel=0.01)


def test_nothing_is_lost_but_what_cannot_leave():
    slab = Slab(thickness_mm=1.0, front=Face(smooth_map((64, 64), seed=1, rms_slope=0.3), 1.0, 1.0))
    found = orders(slab)
    assert found.power.sum() == pytest.approx(1.0, abs=1e-5)
    far = wave(slab, cells=32)
    assert far.dsf.sum() * (2 / 32) ** 2 == pytest.approx(1.0, abs=1e-5)


def test_a_flat_pane_leaves_light_in_its_direction_at_any_angle():
    for theta, phi in ((0.0, 0.0), (40.0, 0.0), (60.0, 130.0)):
        found = orders(Slab(thickness_mm=2.0), theta_deg=theta, phi_deg=phi, window_um=50.0)
        where = np.unravel_index(np.argmax(found.power), found.power.shape)
        sine = np.sin(np.radians(theta))
        assert found.power[where] == pytest.approx(1.0, abs=1e-5)
        assert found.ux[where] == pytest.approx(-sine * np.cos(np.radians(phi)), abs=1e-9)
        assert found.uy[where] == pytest.approx(-sine * np.sin(np.radians(phi)), abs=1e-9)


@pytest.mark.parametrize("side", ["front", "back"])
def test_a_steep_face_bends_light_as_a_wedge_does_and_to_its_thick_end(side):
    """Triangular ridges of slope 0.3: Snell at both faces, sin(out) = n sin(a - asin(sin a / n)) by the
    front."""
    n, slope, period, samples = 1.52, 0.3, 400.0, 800
    x = np.arange(samples) / samples
    ridge = slope * period * np.abs(x - 0.5)
    slab = Slab(thickness_mm=1.0, **{side: Face(np.tile(ridge, (8, 1)), period / samples, period / samples)})
    a = np.arctan(slope)
    exact = n * np.sin(a - np.arcsin(np.sin(a) / n))
    if side == "back":
        exact = np.sin(np.arcsin(n * np.sin(a)) - a)
    found = orders(slab)
    ux, power = found.ux[0], found.power.sum(axis=0)
    right = (ux > 0.05) & (ux < 0.3)
    bent = np.sum(power[right] * ux[right]) / power[right].sum()
    assert power[right].sum() == pytest.approx(0.5, abs=0.03)
    assert bent == pytest.approx(exact, rel=0.015)


def test_a_prism_sends_light_to_its_thick_end():
    """A sawtooth that rises along x, seen from the front: light goes to +x, as the tracer sends it too."""
    samples, period, slope = 400, 200.0, 0.1
    rise = slope * period * np.arange(samples) / samples
    slab = Slab(thickness_mm=1.0, front=Face(np.tile(rise, (8, 1)), 0.5, 0.5))
    found = orders(slab)
    assert np.sum(found.power * found.ux) == pytest.approx(0.052, rel=0.15)


# Half a minute: wide windows, since narrower ones would drown 5 % in speckle.
@pytest.mark.slow
def test_rays_and_waves_agree_on_caps_of_50_um_within_5_percent_and_not_on_small_ones():
    large = size_agreement([50.0])
    assert large.l1[0] <= 0.05 and large.noise[0] < 0.02
    assert large.agree_above_um() == 50.0
    small = size_agreement([5.0], members=2, paths=64_000)
    assert small.l1[0] > 0.3 and small.agree_above_um() == float("inf")


def test_waves_of_faces_with_periods_of_their_own_agree_with_rays_and_state_their_noise():
    front = caps(50.0, across=8, seed=3)
    back = Face(smooth_map((97, 97), seed=2, rms_slope=0.08, width_px=12.0), 4.1, 4.1)
    slab = Slab(thickness_mm=1.0, front=front, back=back)
    found = agreement(slab, members=6, window_um=400.0, paths=100_000)
    assert found.far_field.tapered and found.far_field.members == 6
    assert found.l1 < 0.08 + 2 * found.noise
    assert 0.0 < found.noise < 0.1
    assert found.reflected_inside < 0.05


def test_oblique_light_is_spread_by_waves_where_rays_send_it():
    slab = Slab(thickness_mm=1.0, front=caps(60.0, across=8, edge_slope=0.3, seed=4))
    found = agreement(slab, theta_deg=40.0, phi_deg=30.0, paths=100_000, window_um=480.0)
    c = 0.5 * (found.far_field.edges[1:] + found.far_field.edges[:-1])
    for values in (found.far_field.dsf, found.rays):
        total = values.sum()
        assert abs((values.sum(axis=1) @ c) / total) < 0.02 and abs((values.sum(axis=0) @ c) / total) < 0.02
    assert found.l1 < 0.25


def test_what_the_model_cannot_do_is_refused():
    with pytest.raises(PhysicsError, match="smaller window"):
        orders(Slab(thickness_mm=1.0), window_um=1e5)
    with pytest.raises(PhysicsError, match="order 1 or 2"):
        orders(Slab(thickness_mm=1.0), window_um=50.0, order=3)
    bubbly = Slab(thickness_mm=3.0, bubble_kinds=(BubbleKind(per_cm3=5.0, median_mm=0.1),))
    with pytest.warns(UserWarning, match="bubbles"):
        orders(bubbly, window_um=50.0)


TOML = """thickness_mm = 1.0
[front]
heights = "front.npy"
pitch_um = 1.0
[back]
flat = true
"""


def test_the_command_writes_cells_and_says_how_far_rays_are(tmp_path, command):
    np.save(tmp_path / "front.npy", caps(50.0, across=4, samples=50, seed=2).heights_um)
    (tmp_path / "glass.toml").write_text(TOML)
    words = ("glass", "wave", tmp_path / "glass.toml", "--compare", "--paths", 32_000, "--cells", 64)
    code, found, err = command(*words, "-o", tmp_path / "far.npz", "--json")
    assert code == 0, err
    assert 0 < found["rays"]["l1"] < 0.3 and found["rays"]["cell"] == pytest.approx(1 / 32)
    with np.load(tmp_path / "far.npz") as held:
        assert held["dsf"].shape == (64, 64)
        assert held["dsf"].sum() * (1 / 32) ** 2 == pytest.approx(1.0, abs=1e-4)
        assert held["rays"].shape == held["compared_dsf"].shape
    code, _, _ = command("glass", "wave", "--json")
    assert code == 2
