"""Noise told from the data, the two errors of an integral, and shadows that are given, bridged or cut off."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from specularia import gonio
from specularia.errors import PhysicsError
from specularia.gonio.noise import estimate

pytestmark = pytest.mark.filterwarnings("ignore::specularia.errors.SpeculariaWarning")


def sigma_of(oracle: Any, table: gonio.Table, *, rel: float, floor: float) -> np.ndarray:
    """Standard deviation of the values of a table of the oracle's default sample, without shadow."""
    truth = oracle.Truth()
    clean = truth.dsf(table.theta_i_deg, table.phi_i_deg, table.theta_s_deg, table.phi_s_deg)
    peak = truth.dsf(0, 0, np.array([180.0]), np.array([0.0]))[0]
    return np.hypot(rel * clean, floor * peak)


@pytest.mark.parametrize("rel,floor", [(0.01, 1e-6), (0.03, 1e-6), (0.01, 2e-5), (0.002, 1e-7)])
def test_the_noise_is_told_from_the_table(oracle: Any, measure: Any, rel: float, floor: float) -> None:
    table = measure(40.0, scale=0.25, rel=rel, floor=floor, shadow=False)
    noise = gonio.distribution(table).noise
    sigma = sigma_of(oracle, table, rel=rel, floor=floor)
    found = np.sqrt(noise.variance(table.values))
    for low, high in ((0.0, 0.2), (0.4, 0.6), (0.8, 1.0)):
        a, b = np.quantile(table.values, (low, high))
        chosen = (table.values >= a) & (table.values <= b)
        ratio = np.sqrt(np.mean(found[chosen] ** 2) / np.mean(sigma[chosen] ** 2))
        assert ratio == pytest.approx(1.0, abs=0.1), (low, high)


def test_counting_noise_is_told_from_relative_noise() -> None:
    rng = np.random.default_rng(2)
    x, y = rng.uniform(-1, 1, (2, 20000))
    signal = np.exp(3 * x)
    counted = rng.poisson(400 * signal) / 400
    noise = estimate(x, y, counted, np.ones_like(x), np.ones_like(x))
    assert noise.counting == pytest.approx(1 / 400, rel=0.1)
    assert noise.relative < 0.02 and noise.floor < 0.02


def test_no_noise_is_found_where_there_is_none() -> None:
    x, y = np.random.default_rng(2).uniform(-1, 1, (2, 3000))
    noise = estimate(x, y, 1 + x + y * y, np.ones_like(x), np.ones_like(x))
    assert max(noise.floor, noise.counting, noise.relative) < 1e-9


@pytest.mark.parametrize("theta", [0.0, 60.0])
def test_the_standard_error_is_the_spread_of_200_draws(oracle: Any, measure: Any, theta: float) -> None:
    """The noise of the same directions drawn anew; the spread of 200 values is known to 5 %."""
    table = measure(theta, scale=0.2, shadow=False)
    found = gonio.distribution(table)
    assert found.integral == pytest.approx(np.sum(found.row_weight * np.nan_to_num(table.bsdf)), rel=1e-9)
    sigma = sigma_of(oracle, table, rel=0.01, floor=1e-6)
    rng = np.random.default_rng(7)
    draws = [
        np.sum(found.row_weight / table.cos_s * sigma * rng.standard_normal(sigma.size)) for _ in range(200)
    ]
    assert found.standard_error / np.std(draws, ddof=1) == pytest.approx(1.0, abs=0.15)


@pytest.mark.parametrize(
    "theta,options",
    [
        (0.0, {}),
        (20.0, {"scale": 0.02}),
        (40.0, {"rel": 0.03, "floor": 1e-5}),
        (60.0, {"scale": 0.2}),
        (82.5, {}),
    ],
)
def test_truth_lies_within_both_errors(
    oracle: Any, measure: Any, theta: float, options: dict[str, Any]
) -> None:
    tau = oracle.Truth().tau(theta)
    s = gonio.summarise(measure(theta, **options))
    assert abs(s.tau - tau) < s.tau_systematic + 2 * s.tau_se
    assert s.tau_systematic < 0.02 * tau
    assert s.tau_systematic == pytest.approx(sum(s.systematic.values()))


@pytest.mark.parametrize("theta_max", [70.0, 80.0])
def test_the_bound_covers_what_was_not_measured(oracle: Any, measure: Any, theta_max: float) -> None:
    for theta in (20.0, 60.0):
        table = measure(theta, shadow=False)
        kept = table.theta_s_deg > 180.0 - theta_max
        cut = replace(
            table,
            theta_s_deg=table.theta_s_deg[kept],
            phi_s_deg=table.phi_s_deg[kept],
            values=table.values[kept],
        )
        s = gonio.summarise(cut)
        assert abs(s.tau - oracle.Truth().tau(theta)) < s.tau_systematic + 2 * s.tau_se
        assert s.systematic["horizon"] > gonio.summarise(table).systematic["horizon"]


def test_a_lobe_outside_the_data_is_warned_of_and_leaves_tau_open(measure: Any) -> None:
    table = measure(82.5, shadow=False)
    kept = table.theta_s_deg > 110.0
    cut = replace(
        table,
        theta_s_deg=table.theta_s_deg[kept],
        phi_s_deg=table.phi_s_deg[kept],
        values=table.values[kept],
    )
    s = gonio.summarise(cut)
    assert any("undeflected direction" in w for w in s.warnings)
    assert s.tau + s.tau_systematic >= 1.0


def test_the_steps_of_the_cleaning_are_counted(measure: Any) -> None:
    table = measure(40.0)
    doubled = replace(
        table,
        theta_s_deg=np.concatenate([table.theta_s_deg, table.theta_s_deg[:50], [90.0] * 7]),
        phi_s_deg=np.concatenate([table.phi_s_deg, table.phi_s_deg[:50], np.arange(7.0)]),
        values=np.concatenate([table.values, table.values[:50], -np.ones(7)]),
    )
    steps = {step.name: step for step in gonio.summarise(doubled).steps}
    assert steps["horizon"].count == 7
    # Some of the fifty may lie in the shadow, whose points go before repeated ones are averaged.
    assert 40 <= steps["repeated directions"].count <= 55
    assert steps["negative values"].count >= 7
    assert "points replaced by" in steps["shadow"].text
    assert "% of the signal" in steps["noise"].text


class TestShadows:
    """Given by a mask, bridged for samples that are not isotropic, and in the plane of incidence."""

    def strip(self, oracle: Any, found: gonio.Distribution, theta_i: float, middle: float) -> np.ndarray:
        """Ratio to the truth in a strip of 20 degrees, from 68 to 86 degrees off the normal."""
        theta, phi = np.meshgrid(
            np.radians(np.arange(68, 87, 1.0)), np.radians(np.arange(middle - 10, middle + 10.5, 1.0))
        )
        x, y = np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi)
        return found.at(x, y) / oracle.Truth().bsdf(theta_i, 0.0, x, y)

    def test_a_mask_stands_for_a_shadow_that_is_not_found(self, oracle: Any, measure: Any) -> None:
        sparse = measure(40.0, scale=0.02)
        assert gonio.distribution(sparse).notes == ()
        mask = gonio.Mask.parse("256,284,63")
        found = gonio.distribution(sparse, masks=[mask])
        assert "shadow as given" in found.notes[0] and "from the other side" in found.notes[0]
        assert np.median(self.strip(oracle, found, 40.0, 270.0)) == pytest.approx(1.0, abs=0.05)
        assert found.integral == pytest.approx(oracle.Truth().tau(40.0), rel=5e-3)

    def test_a_mask_counts_azimuths_as_the_table_does(self, measure: Any) -> None:
        """The light comes from phi_i = 130, the shadow stays at phi_s = 270; a mask may wrap around 0."""
        table = measure(40.0, 130.0, scale=0.02)
        masked = gonio.distribution(table, masks=[gonio.Mask(-104.0, -76.0, 63.0)])
        assert masked.integral > gonio.distribution(table).integral
        turned = replace(table, phi_i_deg=(130.0 + 95) % 360, phi_s_deg=(table.phi_s_deg + 95) % 360)
        again = gonio.distribution(turned, masks=[gonio.Mask.parse("351,19,63")])
        assert again.integral == pytest.approx(masked.integral, rel=2e-3)

    @pytest.mark.parametrize("text", ["1,2", "a,b,c", "0,20,95", "0,200,60", "10,10,60"])
    def test_a_mask_that_makes_no_sense_is_refused(self, text: str) -> None:
        with pytest.raises(PhysicsError, match="mask"):
            gonio.Mask.parse(text)

    def test_without_isotropy_a_shadow_is_bridged_and_the_bound_grows(
        self, oracle: Any, measure: Any
    ) -> None:
        table = measure(40.0)
        mirrored, bridged = gonio.summarise(table), gonio.summarise(table, isotropic=False)
        assert "bridged along the azimuth" in bridged.distribution.notes[0]
        assert np.median(self.strip(oracle, bridged.distribution, 40.0, 270.0)) == pytest.approx(1.0, abs=0.1)
        assert bridged.systematic["shadow"] > 2 * mirrored.systematic["shadow"]
        tau = oracle.Truth().tau(40.0)
        assert abs(bridged.tau - tau) < bridged.tau_systematic + 2 * bridged.tau_se

    def test_a_shadow_in_the_plane_of_incidence_is_bridged(self, oracle: Any, measure: Any) -> None:
        found = gonio.distribution(measure(40.0, 90.0))
        assert "bridged along the azimuth" in found.notes[0]
        assert found.integral == pytest.approx(oracle.Truth().tau(40.0), rel=2e-3)

    def test_an_elongated_lobe_is_not_taken_for_shadowed(self) -> None:
        k = np.arange(12000) + 0.5
        z = 1.0 - k / 12000
        theta, phi = np.arccos(z), k * np.pi * (3 - 5**0.5) % (2 * np.pi)
        x, y = np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi)
        for turn in (0.0, 0.5, 0.8):
            u, v = x * np.cos(turn) + y * np.sin(turn), y * np.cos(turn) - x * np.sin(turn)
            lobe = (1 + (u / 0.3) ** 2 + (v / 0.08) ** 2) ** -2
            table = gonio.Table(
                file="",
                quantity="BSDF",
                side="transmission_front",
                theta_i_deg=10.0,
                phi_i_deg=0.0,
                theta_s_deg=180.0 - np.degrees(theta),
                phi_s_deg=np.degrees(phi),
                values=lobe,
            )
            assert gonio.distribution(table, isotropic=False).notes == ()
