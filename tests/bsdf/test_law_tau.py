"""Transmission between and beyond measured angles: closed forms lie on the curve, or in its interval."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.interpolate import PchipInterpolator

from specularia.bsdf.tau_law import TauLaw, flat_pane

MEASURED = np.array([0.0, 20.0, 40.0, 60.0, 82.5])


def tinted(theta_deg, depth: float = 0.21):  # type: ignore[no-untyped-def]
    """A flat pane that takes exp(-depth) of the light that goes straight through it."""
    inside = np.sqrt(1.0 - (np.sin(np.radians(theta_deg)) / 1.52) ** 2)
    return flat_pane(theta_deg) * np.exp(-depth / inside)


def paper(theta_deg):  # type: ignore[no-untyped-def]
    """The five published transmissions, joined by a monotone cubic and 0 at 90 degrees."""
    curve = PchipInterpolator([-20.0, *MEASURED, 90.0], [0.676, 0.697, 0.676, 0.579, 0.410, 0.158, 0.0])
    return curve(theta_deg)


def lambertian(theta_deg):  # type: ignore[no-untyped-def]
    return np.full(np.shape(theta_deg), 0.5)


def test_the_curve_meets_the_values_and_ends_at_zero() -> None:
    law = TauLaw(MEASURED, paper(MEASURED))
    np.testing.assert_allclose(law.value(MEASURED), paper(MEASURED), rtol=1e-12)
    assert np.all(law.error(MEASURED) == 0.0)
    assert law.value(90.0) == pytest.approx(0.0, abs=1e-6)


@pytest.mark.parametrize("truth", [flat_pane, tinted, paper])
def test_known_curves_are_met_between_five_angles(truth) -> None:  # type: ignore[no-untyped-def]
    law = TauLaw(MEASURED, truth(MEASURED))
    for theta, limit in ((10, 0.01), (30, 0.01), (50, 0.01), (70, 0.08), (75, 0.08), (80, 0.08)):
        assert law.value(theta) == pytest.approx(truth(theta), rel=limit)
        assert abs(law.value(theta) - truth(theta)) < 1.96 * law.error(theta)


@pytest.mark.parametrize("truth", [flat_pane, tinted])
def test_what_lies_beyond_the_last_angle_is_within_the_interval(truth) -> None:  # type: ignore[no-untyped-def]
    for last in (20.0, 40.0, 60.0, 82.5):
        angles = np.array([0.0, 10.0, 20.0, 40.0, 60.0, 82.5])
        angles = angles[angles <= last]
        law = TauLaw(angles, truth(angles))
        theta = np.linspace(last + 1.0, 89.0, 20)
        assert np.all(np.abs(law.value(theta) - truth(theta)) < 1.96 * law.error(theta))


def test_dense_angles_leave_next_to_no_error() -> None:
    angles = np.array([0, 10, 20, 30, 40, 50, 55, 60, 65, 70, 75, 77.5, 80, 82.5, 85, 87, 88.5, 89.5])
    theta = np.linspace(0.0, 87.0, 500)
    np.testing.assert_allclose(TauLaw(angles, flat_pane(angles)).value(theta), flat_pane(theta), rtol=5e-4)


def test_the_error_grows_where_an_angle_is_left_out() -> None:
    whole = TauLaw(MEASURED, paper(MEASURED))
    fewer = TauLaw(np.delete(MEASURED, 3), paper(np.delete(MEASURED, 3)))
    theta = np.array([50.0, 55.0, 60.0, 65.0, 75.0])
    assert np.all(fewer.error(theta) > 1.5 * whole.error(theta))
    assert np.all(np.diff(TauLaw(MEASURED[:3], paper(MEASURED[:3])).error(np.arange(41.0, 85.0))) > 0)


def test_scatter_of_close_angles_is_not_carried_on() -> None:
    angles = np.array([0.0, 2.0, 20.0, 40.0, 60.0])
    tau = tinted(angles)
    shifted = tau * np.array([1.0, 1.002, 1.0, 1.0, 1.0])
    theta = np.array([10.0, 30.0, 50.0, 75.0])
    a, b = TauLaw(angles, tau).value(theta), TauLaw(angles, shifted).value(theta)
    np.testing.assert_allclose(b, a, rtol=3e-3)
    # A small step in the angle must not make a large one in the curve either.
    close = np.array([0.0, 0.02, 20.0, 40.0, 60.0])
    np.testing.assert_allclose(TauLaw(close, shifted).value(theta), a, rtol=3e-3)


def test_one_value_of_a_flat_pane_gives_the_whole_pane() -> None:
    theta = np.linspace(0.0, 89.0, 90)
    np.testing.assert_allclose(
        TauLaw(np.array([20.0]), 0.7 * flat_pane(np.array([20.0]))).value(theta),
        0.7 * flat_pane(theta),
        rtol=1e-3,
    )


def test_a_diffuser_stays_flat_between_its_angles() -> None:
    law = TauLaw(MEASURED, lambertian(MEASURED))
    theta = np.linspace(0.0, 60.0, 61)
    np.testing.assert_allclose(law.value(theta), 0.5, rtol=0.03)


@settings(max_examples=60, deadline=None)
@given(
    st.lists(st.floats(0.0, 89.9), min_size=1, max_size=8, unique=True),
    st.lists(st.floats(0.0, 1.0), min_size=8, max_size=8),
    st.floats(0.1, 10.0),
)
def test_the_curve_is_never_negative_and_goes_with_the_scale(
    angles: list[float], values: list[float], scale: float
) -> None:
    theta = np.array(sorted(angles))
    tau = np.array(values[: theta.size])
    ask = np.linspace(0.0, 90.0, 181)
    law, scaled = TauLaw(theta, tau), TauLaw(theta, scale * tau)
    assert np.all(law.value(ask) >= 0.0)
    assert np.all(np.isfinite(law.error(ask))) and np.all(law.error(ask) >= 0.0)
    np.testing.assert_allclose(scaled.value(ask), scale * law.value(ask), rtol=1e-6, atol=1e-9 * scale)
