"""Directions and frames do what the conventions say."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from specularia import conventions as c

angle = st.floats(0, 360, exclude_max=True)


@given(st.floats(0.1, 179.9), angle)
def test_angles_and_cosines_are_inverse(theta: float, phi: float) -> None:
    back_theta, back_phi = c.direction_angles(*c.direction_cosines(theta, phi))
    assert abs(back_theta - theta) < 1e-8
    assert abs((back_phi - phi + 180) % 360 - 180) < 1e-6


@given(st.floats(0, 89), angle)
def test_undeflected_light_keeps_its_line(theta: float, phi: float) -> None:
    arriving = np.array(c.direction_cosines(theta, phi))
    leaving = np.array(c.direction_cosines(*c.undeflected(theta, phi)))
    np.testing.assert_allclose(leaving, -arriving, atol=1e-9)


@given(st.floats(-1, 1), st.floats(-1, 1))
def test_square_and_disk_are_inverse(a: float, b: float) -> None:
    p, q = (a + 1) / 2, (b + 1) / 2
    np.testing.assert_allclose(c.disk_to_square(*c.square_to_disk(p, q)), (p, q), atol=1e-9)


def test_square_to_disk_keeps_area() -> None:
    # Equal cells of the square fall into rings of equal area: the share within radius r must be r^2.
    k = (np.arange(1000) + 0.5) / 1000
    x, y = c.square_to_disk(*np.meshgrid(k, k))
    for r in (0.2, 0.5, 0.9):
        assert abs(np.mean(np.hypot(x, y) <= r) - r * r) < 2e-3


def test_up_of_a_pab_table_becomes_our_y_axis() -> None:
    # upphi is the file's azimuth of "up"; ours is 90 degrees.
    for up in (0.0, 90.0, -30.0, 200.0):
        assert c.pab_azimuth(up, up) == 90.0
    assert c.pab_azimuth(0.0) == 90.0


def test_radiance_frame_is_half_a_turn_about_y() -> None:
    # phi_R = 180 - phi, and light leaving the back (z < 0) enters the room (z_R > 0).
    x, y, z = c.direction_cosines(150.0, 30.0)
    theta, phi = c.direction_angles(*c.to_radiance(x, y, z))
    assert abs(theta - 30.0) < 1e-9
    assert abs(phi - 150.0) < 1e-9
    np.testing.assert_allclose(c.from_radiance(*c.to_radiance(x, y, z)), (x, y, z))
