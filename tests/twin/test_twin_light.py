"""The twin's colour: yellowish, clear in the red, weighed as the eye does."""

from __future__ import annotations

import numpy as np
import pytest

from specularia.twin.light import WAVELENGTHS_NM, absorption, photopic_d65
from specularia.twin.settings import GlassSettings


def test_absorption_rises_to_the_blue_and_is_small_in_the_red() -> None:
    a = absorption(WAVELENGTHS_NM, GlassSettings())
    assert np.all(np.diff(a) < 0)
    assert absorption(520.0, GlassSettings()) == pytest.approx(0.07)
    assert np.all(absorption(np.array([600.0, 650.0]), GlassSettings()) < 0.025)


def test_weights_add_up_to_one_and_peak_where_the_eye_does() -> None:
    weight = photopic_d65()
    assert weight.sum() == pytest.approx(1.0)
    assert abs(WAVELENGTHS_NM[weight.argmax()] - 550.0) <= 10.0
    # Mean wavelength of daylight as the eye weighs it (D65 with V: between 555 and 560 nm).
    assert 555.0 < np.sum(weight * WAVELENGTHS_NM) < 560.0


def test_yellow_glass_lets_more_daylight_through_than_green_light() -> None:
    at_520 = np.exp(-3.0 * 0.07)
    daylight = photopic_d65() @ np.exp(-3.0 * absorption(WAVELENGTHS_NM, GlassSettings()))
    assert at_520 < daylight < 0.92
