"""The published route: a closed mesh of finite size through Radiance."""

from dataclasses import replace

import numpy as np
import pytest
from glass_reference import smooth_map

from specularia import bsdf
from specularia.conventions import SIDES
from specularia.errors import CoverageError, PhysicsError
from specularia.glass import BubbleKind, Face, Medium, Slab, closed_form, peer, trace
from specularia.glass.patch import Patch

THETA = [0.0, 60.0]


@pytest.fixture(scope="module")
def rough() -> Slab:
    front, back = (Face(smooth_map((64, 80), seed=s, rms_slope=0.25), 3.0, 3.0) for s in (1, 2))
    return Slab(thickness_mm=0.2, front=front, back=back, polarised=False)


def test_a_wide_flat_array_transmits_as_the_closed_form_with_s_and_p_averaged():
    slab = Slab(thickness_mm=1.0, medium=Medium(1.52, 0.05))
    found = peer.balance(slab, theta_deg=THETA, array_mm=40.0, rays=1600)
    exact = closed_form.flat_slab(
        THETA, index=1.52, absorption_per_mm=0.05, thickness_mm=1.0, polarised=False
    )
    # A little light comes to the sides.
    np.testing.assert_allclose(found.tau, exact.transmitted, atol=2e-3)
    np.testing.assert_allclose(found.rho, exact.reflected, atol=2e-3)


@pytest.mark.parametrize("sides", ["absorbing", "clear"])
def test_a_rough_array_transmits_and_loses_as_our_patch_of_the_same_size(rough, sides):
    width = 0.96  # 4 x 5 tiles
    patch = Patch(width_mm=width, sides=sides, centre_mm=(width / 2, width / 2))
    ours = trace(replace(rough, patch=patch), theta_deg=THETA, paths=200_000)
    found = peer.balance(rough, theta_deg=THETA, array_mm=width, sides=sides, rays=6400)
    close = 4 * np.hypot(found.tau_se, ours.tau_se) + 1e-3
    endless = trace(rough, theta_deg=THETA, paths=64_000)
    lost = 1.0 - found.tau - found.rho
    if sides == "absorbing":
        assert np.all(np.abs(found.tau - ours.tau) < close)
        assert np.all(np.abs(found.rho - ours.rho) < 0.01)
        assert lost[1] > 0.15 and found.tau[1] < endless.tau[1] - 0.1
    else:
        # What clear sides let out we count by itself, and Radiance by the hemisphere that it runs into.
        through, back = found.tau - ours.tau, found.rho - ours.rho
        assert np.all(through > -close) and np.all(back > -0.01)
        assert np.all(np.abs(through + back - ours.sides) < 0.015)
        assert ours.sides[1] > 0.05
        assert np.all(lost < 0.015)


def test_its_tree_is_read_with_the_sides_in_place(tmp_path):
    """A pane that is rough on the front and flat on the back, yellow enough to tell transmission apart."""
    face = Face(smooth_map((48, 48), seed=4, rms_slope=0.3), 3.0, 3.0)
    slab = Slab(thickness_mm=0.05, medium=Medium(1.52, 2.0), front=face, polarised=False)
    sums = peer.write_xml(slab, tmp_path / "c.xml", resolution=4, array_mm=2.0, samples=400)
    model = bsdf.read(tmp_path / "c.xml")
    assert set(model.sides) == set(SIDES)
    # The bin at the horizon averages over 29 degrees, in which transmission falls to nothing.
    theta = sums["theta_deg"][1:]
    for side in ("front", "back"):
        exact = trace(slab, theta_deg=theta[::3], phi_deg=None, side=side, paths=32_000)
        for name, value in (("transmission", exact.tau), ("reflection", exact.rho)):
            np.testing.assert_allclose(sums[f"{name}_{side}"][1::3], value, atol=0.03)
            np.testing.assert_allclose(
                model.direct_hemispherical(f"{name}_{side}", theta[::3]), value, atol=0.08
            )


def test_what_the_route_cannot_do_is_refused_with_advice(rough):
    other = Slab(
        thickness_mm=0.2, front=rough.front, back=Face(smooth_map((50, 80), seed=2, rms_slope=0.2), 3, 3)
    )
    with pytest.raises(PhysicsError, match="one period"):
        peer.balance(other, theta_deg=[0.0])
    bubbly = Slab(thickness_mm=1.0, bubble_kinds=(BubbleKind(per_cm3=50.0, median_mm=0.2),))
    with pytest.raises(PhysicsError, match="no bubbles"):
        peer.balance(bubbly, theta_deg=[0.0])
    huge = Slab(thickness_mm=1.0, front=Face(np.zeros((1025, 1024)), 1.0, 1.0))
    with pytest.raises(PhysicsError, match="512 x 512 is advised"):
        peer.balance(huge, theta_deg=[0.0])
    with pytest.raises(CoverageError):
        peer.balance(rough, theta_deg=[95.0])
