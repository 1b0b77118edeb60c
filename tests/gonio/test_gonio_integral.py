"""Integrals of scattered points against closed forms, and the honesty of their standard errors."""

from __future__ import annotations

import warnings
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from specularia import gonio
from specularia.errors import FormatError, SpeculariaWarning
from specularia.gonio.interpolant import distribution

pytestmark = pytest.mark.filterwarnings("ignore::specularia.errors.SpeculariaWarning")

Bsdf = Callable[[np.ndarray, np.ndarray], np.ndarray]


def make(
    theta: np.ndarray,
    phi: np.ndarray,
    bsdf: Bsdf,
    *,
    theta_i: float = 20.0,
    quantity: str = "DSF",
    noise: np.ndarray | float = 0.0,
) -> gonio.Table:
    """A table at polar angles theta from the back normal, of a BSDF given by direction cosines."""
    t, p = np.radians(theta), np.radians(phi)
    values = bsdf(np.sin(t) * np.cos(p), np.sin(t) * np.sin(p)) * (np.cos(t) if quantity == "DSF" else 1.0)
    return gonio.Table(
        file="",
        quantity=quantity,
        side="transmission_front",
        theta_i_deg=theta_i,
        phi_i_deg=0.0,
        theta_s_deg=180.0 - theta,
        phi_s_deg=phi,
        values=values * (1.0 + noise),
    )


def even(n: int, theta_max: float = 88.0) -> tuple[np.ndarray, np.ndarray]:
    """n directions spread evenly over the hemisphere up to theta_max."""
    k = np.arange(n) + 0.5
    z = 1.0 - k / n * (1.0 - np.cos(np.radians(theta_max)))
    return np.degrees(np.arccos(z)), np.degrees(k * np.pi * (3 - 5**0.5)) % 360


def polar(step: float, theta_max: float) -> tuple[np.ndarray, np.ndarray]:
    """A polar grid with its full row at the pole."""
    theta, phi = np.meshgrid(np.arange(0, theta_max + 1e-9, step), np.arange(0, 360, step), indexing="ij")
    return theta.ravel(), phi.ravel()


@pytest.mark.parametrize("theta_max", [70.0, 80.0, 88.0])
@pytest.mark.parametrize("quantity", ["DSF", "BSDF"])
def test_a_lambertian_is_integrated_exactly_out_to_the_horizon(theta_max: float, quantity: str) -> None:
    table = make(*even(3000, theta_max), lambda x, y: np.full_like(x, 0.6 / np.pi), quantity=quantity)
    tau, se = gonio.integrate(table)
    # The disk loses 1.3e-5 of its area to the polygon of the horizon.
    assert tau == pytest.approx(0.6, rel=2e-5)
    assert se < 1e-9


def test_a_quadratic_is_integrated_to_the_order_of_the_rule() -> None:
    def bsdf(x: np.ndarray, y: np.ndarray) -> np.ndarray:
        return (0.5 + 0.3 * x - 0.2 * y + 0.4 * x * y - 0.3 * (x * x + y * y)) / np.pi

    exact = 0.5 - 0.3 / 2
    tau, _ = gonio.integrate(make(*even(3000, 89.5), bsdf))
    assert tau == pytest.approx(exact, rel=3e-4)


@pytest.mark.parametrize("sigma,tolerance", [(0.05, 1e-3), (0.1, 2e-4)])
@pytest.mark.parametrize("centre", [(0.0, 0.0), (-0.3, 0.1)])
def test_a_lobe_on_a_polar_grid_of_one_degree(
    sigma: float, tolerance: float, centre: tuple[float, float]
) -> None:
    """A linear interpolant alone is off by (step / sigma)^2 / 12 at the pole, 1 % for the narrower lobe."""

    def bsdf(x: np.ndarray, y: np.ndarray) -> np.ndarray:
        r2 = (x - centre[0]) ** 2 + (y - centre[1]) ** 2
        return 0.7 * np.exp(-r2 / (2 * sigma**2)) / (2 * np.pi * sigma**2)

    found = gonio.summarise(make(*polar(1.0, 85.0), bsdf))
    assert found.tau == pytest.approx(0.7, rel=tolerance)
    # No noise: what the rule misses between the points is a systematic error.
    assert found.tau_se < 1e-4
    assert abs(found.tau - 0.7) < found.tau_systematic


def test_the_standard_error_is_the_scatter_of_repeated_measurements() -> None:
    def bsdf(x: np.ndarray, y: np.ndarray) -> np.ndarray:
        return (0.3 + 2.0 * np.exp(-((x + 0.34) ** 2 + y**2) / 0.08)) / np.pi

    directions = even(3000)
    rng = np.random.default_rng(8)
    found = []
    for _ in range(40):
        d = distribution(make(*directions, bsdf, noise=0.1 * rng.standard_normal(3000)))
        found.append((d.integral, d.standard_error))
    tau, se = np.array(found).T
    # The scatter of 40 values is known to 11 %.
    assert 0.7 < se.mean() / tau.std(ddof=1) < 1.4
    assert np.ptp(se) < 0.3 * se.mean()


def test_directions_at_the_horizon_carry_no_weight() -> None:
    theta, phi = even(3000)
    level = np.concatenate([theta, [90.0, 90.0, 89.999, 90.0]])
    around = np.concatenate([phi, [0.0, 90.0, 200.0, 300.0]])

    def bsdf(x: np.ndarray, y: np.ndarray) -> np.ndarray:
        return np.where(np.hypot(x, y) > 0.9999, 1e6, 0.5 / np.pi)

    for quantity in ("DSF", "BSDF"):
        tau, _ = gonio.integrate(make(level, around, bsdf, quantity=quantity))
        assert tau == pytest.approx(0.5, rel=1e-4)


def test_turning_sample_and_light_together_changes_nothing(measure: Any) -> None:
    from dataclasses import replace

    table = measure(60.0)
    first = gonio.summarise(table)
    for turn in (37.0, 180.0, 270.0):
        turned = replace(table, phi_i_deg=turn, phi_s_deg=(table.phi_s_deg + turn) % 360)
        again = gonio.summarise(turned)
        assert again.tau == pytest.approx(first.tau, rel=1e-4)
        assert again.coverage == pytest.approx(first.coverage, abs=1e-3)


def test_light_on_the_back_gives_the_same_as_light_on_the_front(measure: Any) -> None:
    from dataclasses import replace

    table = measure(40.0)
    back = replace(
        table,
        side="transmission_back",
        theta_i_deg=140.0,
        theta_s_deg=180.0 - table.theta_s_deg,
    )
    assert gonio.integrate(back)[0] == pytest.approx(gonio.integrate(table)[0], rel=1e-12)


def test_coverage_is_the_share_of_the_projected_hemisphere_between_points() -> None:
    def flat(x: np.ndarray, y: np.ndarray) -> np.ndarray:
        return np.full_like(x, 0.2)

    theta, phi = even(8000, 89.0)
    assert distribution(make(theta, phi, flat)).coverage == pytest.approx(1.0, abs=0.01)
    inner = theta < 60
    assert distribution(make(theta[inner], phi[inner], flat)).coverage == pytest.approx(0.75, abs=0.01)
    half = phi < 180
    with pytest.warns(SpeculariaWarning, match="(49|50) % of the projected hemisphere"):
        summary = gonio.summarise(make(theta[half], phi[half], flat))
    assert summary.coverage == pytest.approx(0.5, abs=0.01)
    # What is missing is carried on from the edges.
    assert summary.tau == pytest.approx(0.2 * np.pi, rel=1e-4)


def test_reflection_above_one_is_refused_as_rho() -> None:
    from dataclasses import replace

    table = make(*even(3000), lambda x, y: np.full_like(x, 1.2 / np.pi))
    mirror = replace(table, side="reflection_front", theta_s_deg=180.0 - table.theta_s_deg)
    with pytest.raises(FormatError, match=r"rho of 1 at most, found rho = 1\.2"):
        gonio.integrate(mirror)


def test_calibration_may_push_a_white_sample_just_above_one() -> None:
    table = make(*even(3000), lambda x, y: np.full_like(x, 1.004 / np.pi))
    with pytest.warns(SpeculariaWarning, match="above 1 by less than calibration may be off"):
        assert gonio.integrate(table)[0] == pytest.approx(1.004, rel=1e-4)


def test_several_tables_are_summarised_in_order_and_as_if_alone(measure: Any) -> None:
    tables = [measure(theta, scale=0.02) for theta in (60.0, 0.0, 40.0)]
    together = gonio.summarise_all(tables)
    assert [s.table for s in together] == tables
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        assert [s.tau for s in together] == [gonio.summarise(t).tau for t in tables]
