"""The shadow of the mount is found, filled from the mirror side, and nothing else is taken for one."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from specularia import gonio
from specularia.gonio.interpolant import distribution

pytestmark = pytest.mark.filterwarnings("ignore::specularia.errors.SpeculariaWarning")


@pytest.mark.parametrize("theta", [0.0, 20.0, 40.0, 60.0, 82.5])
def test_a_shadowed_table_integrates_like_one_without_shadow(oracle: Any, measure: Any, theta: float) -> None:
    tau = oracle.Truth().tau(theta)
    clear, shadowed = distribution(measure(theta, shadow=False)), distribution(measure(theta))
    assert clear.notes == ()
    (note,) = shadowed.notes
    assert "shadow of the mount" in note and "points replaced by" in note
    assert shadowed.integral == pytest.approx(clear.integral, rel=5e-4)
    assert shadowed.integral == pytest.approx(tau, rel=5e-3)


def test_the_filled_strip_holds_the_values_of_the_truth(oracle: Any, measure: Any) -> None:
    truth = oracle.Truth()
    found = distribution(measure(40.0))
    theta, phi = np.meshgrid(np.radians(np.arange(67, 87, 1.0)), np.radians(np.arange(259, 282, 1.0)))
    x, y = np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi)
    ratio = found.at(x, y) / truth.bsdf(40.0, 0.0, x, y)
    assert np.median(ratio) == pytest.approx(1.0, abs=0.02)
    # Before, a fiftieth of it was there.
    assert ratio.min() > 0.8


@pytest.mark.parametrize("theta", [20.0, 40.0])
def test_a_shadow_is_found_where_noise_hides_its_end_at_the_horizon(
    oracle: Any, measure: Any, theta: float
) -> None:
    found = distribution(measure(theta, scale=0.3, floor=2e-5))
    assert len(found.notes) == 1
    assert found.integral == pytest.approx(oracle.Truth().tau(theta), rel=5e-3)


@pytest.mark.parametrize("phi", [0.0, 180.0, 30.0, 140.0])
def test_the_shadow_is_named_at_its_azimuth(measure: Any, phi: float) -> None:
    (note,) = distribution(measure(40.0, phi)).notes
    where = float(note.split("phi_s = ")[1].split(",")[0])
    assert where == pytest.approx(-90.0, abs=4.0)


def test_at_normal_incidence_a_shadow_at_any_azimuth_is_filled(oracle: Any, measure: Any) -> None:
    table = measure(0.0)
    for turn in (0.0, 33.0, 90.0):
        found = distribution(replace(table, phi_s_deg=(table.phi_s_deg + turn) % 360))
        assert len(found.notes) == 1
        assert found.integral == pytest.approx(oracle.Truth().tau(0.0), rel=3e-3)


def test_a_sample_that_scatters_to_one_side_is_not_taken_for_shadowed() -> None:
    """A wide dark side, a narrow dark spot inside the hemisphere, and a mild dip at the horizon."""
    k = np.arange(12000) + 0.5
    z = 1.0 - k / 12000
    theta, phi = np.arccos(z), k * np.pi * (3 - 5**0.5) % (2 * np.pi)
    x, y = np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi)
    outer = theta > np.radians(60)
    south = np.abs(phi - 1.5 * np.pi)
    spot = (np.hypot(x - 0.1, y + 0.8) < 0.1) & (theta < np.radians(75))
    for dark in (
        np.where((south < np.radians(70)) & outer, 0.02, 1.0),
        np.where(spot, 0.02, 1.0),
        np.where((south < np.radians(12)) & outer, 0.7, 1.0),
        1.0 + 0.5 * y,
    ):
        table = gonio.Table(
            file="",
            quantity="BSDF",
            side="transmission_front",
            theta_i_deg=30.0,
            phi_i_deg=0.0,
            theta_s_deg=180.0 - np.degrees(theta),
            phi_s_deg=np.degrees(phi),
            values=0.2 * dark * np.ones_like(theta),
        )
        assert distribution(table).notes == ()


def test_real_tables_have_no_shadow(shared_data: Any) -> None:
    for theta in (0, 10, 20):
        (table,) = gonio.read(shared_data / "gonio" / "eds10" / f"EDS10_{theta}-0.txt")
        assert distribution(table).notes == ()
