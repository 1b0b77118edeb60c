"""Leave-one-angle-out: it sees what is wrong with a prediction, and only that."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from specularia import gonio
from specularia.errors import CoverageError
from specularia.gonio.cross_validation import distance

FRONT = "transmission_front"
pytestmark = pytest.mark.filterwarnings("ignore::specularia.errors.SpeculariaWarning")


@pytest.fixture(scope="module")
def summaries(measure: Any) -> list[gonio.Summary]:
    return gonio.summarise_all([measure(t, scale=0.1, shadow=False) for t in (0.0, 10.0, 20.0)])


def test_only_inner_angles_are_left_out(summaries: list[gonio.Summary]) -> None:
    (found,) = gonio.cross_validate(summaries)
    assert (found.side, found.theta_deg, found.left_out) == (FRONT, 10.0, "angle")
    assert found.measured == pytest.approx(summaries[1].tau)
    assert found.low <= found.predicted <= found.high
    assert found.holds == (found.low <= found.measured <= found.high)
    assert abs(found.off) < 0.01
    assert 0.0 < found.l1 < 0.08
    assert found.l1_raw**2 == pytest.approx(found.l1**2 + found.l1_noise**2)


def test_a_table_that_does_not_fit_its_neighbours_stands_out(summaries: list[gonio.Summary]) -> None:
    low = replace(summaries[1].table, values=0.8 * summaries[1].table.values)
    changed = gonio.summarise_all([summaries[0].table, low, summaries[2].table])
    (found,) = gonio.cross_validate(changed)
    assert found.off == pytest.approx(0.25, abs=0.02)
    assert not found.holds


def test_a_model_lies_as_far_from_its_own_table_as_the_noise_says(summaries: list[gonio.Summary]) -> None:
    model = gonio.fit([s.table for s in summaries], summaries=summaries)
    for s in summaries:
        raw, noise = distance(model, FRONT, s.distribution, theta_deg=s.table.polar_deg, phi_deg=0.0) / s.tau
        assert raw < 1.5 * noise + 0.01


def test_noise_is_that_of_the_values(measure: Any) -> None:
    """Ten times the noise of a measurement is ten times the noise that is taken off."""
    found = []
    for rel in (0.01, 0.1):
        s = gonio.summarise(measure(20.0, scale=0.1, shadow=False, rel=rel))
        model = gonio.fit([s.table], summaries=[s])
        found.append(distance(model, FRONT, s.distribution, theta_deg=20.0, phi_deg=0.0)[1])
    assert found[1] / found[0] == pytest.approx(10.0, rel=0.15)
    # |noise| of 10 % is 8 % of the light on average, somewhat less after interpolation between points.
    assert 0.03 < found[1] / 0.676 < 0.08


def test_two_angles_are_too_few(summaries: list[gonio.Summary]) -> None:
    with pytest.raises(CoverageError, match="three incident angles"):
        gonio.cross_validate(summaries[:2])


def test_every_other_azimuth_of_an_anisotropic_set_is_left_out(oracle: Any) -> None:
    rng, tables = np.random.default_rng(3), []
    for theta, phi in [(0.0, 0.0), *((40.0, 90.0 * k) for k in range(4))]:
        v = oracle.directions(theta, phi, rng, n_base=3000, n_mid=500, n_peak=500)
        s, p = np.sin(np.radians(theta)), np.radians(phi)
        x, y = v[:, 0] + s * np.cos(p), v[:, 1] + s * np.sin(p)
        value = 0.3 * np.exp(-0.5 * ((x / 0.3) ** 2 + (y / 0.1) ** 2)) / (2 * np.pi * 0.03) + 0.1
        tables.append(
            gonio.Table(
                file="",
                quantity="BSDF",
                side=FRONT,
                theta_i_deg=theta,
                phi_i_deg=phi,
                theta_s_deg=np.degrees(np.arccos(v[:, 2])),
                phi_s_deg=np.degrees(np.arctan2(v[:, 1], v[:, 0])) % 360,
                values=value,
                synthetic=True,
            )
        )
    summaries = gonio.summarise_all(tables, isotropic=False)
    model = gonio.fit(tables, summaries=summaries, symmetry="none")
    found = gonio.cross_validate(summaries, model)
    by_azimuth = [h for h in found if h.left_out == "azimuth"]
    assert [h.phi_deg for h in by_azimuth] == [0.0, 180.0, 90.0, 270.0]
    assert len(found) == 4
    assert all(h.l1 < 0.35 for h in by_azimuth)
