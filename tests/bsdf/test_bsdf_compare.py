"""Figures of a comparison against closed forms."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.integrate import quad

from specularia import bsdf
from specularia.bsdf.cells import grid

FRONT = "transmission_front"


@dataclass
class Gauss:
    """A lobe of Gaussian shape in direction cosines around the undeflected direction, moved by `shift`."""

    width: float
    tau: float = 0.7
    shift: float = 0.0
    band: str = "Visible"
    sides: tuple[str, ...] = (FRONT,)

    def evaluate(self, side: str, theta_i_deg: Any, phi_i_deg: Any, ux: Any, uy: Any) -> Any:
        s, p = np.sin(np.radians(theta_i_deg)), np.radians(phi_i_deg)
        x, y = np.asarray(ux) + s * np.cos(p) - self.shift, np.asarray(uy) + s * np.sin(p)
        f = self.tau * np.exp(-(x**2 + y**2) / (2 * self.width**2)) / (2 * np.pi * self.width**2)
        return np.where(np.asarray(ux) ** 2 + np.asarray(uy) ** 2 <= 1, f, np.nan)

    def direct_hemispherical(self, side: str, theta_i_deg: Any, phi_i_deg: Any = 0.0) -> Any:
        theta = np.asarray(theta_i_deg, float)
        return np.where((theta >= 0) & (theta < 90), self.tau, np.nan)

    def quadrature(self, side: str, theta_i_deg: float, phi_i_deg: float = 0.0) -> bsdf.Quadrature:
        x, y = (v.ravel() for v in grid(400))
        return bsdf.Quadrature(x, y, np.full(x.size, np.pi / x.size))


def test_the_jensen_shannon_distance_of_two_gaussians_is_that_of_its_radial_integral() -> None:
    widths = (0.08, 0.14)

    def p(r: float, w: float) -> float:
        return float(np.exp(-(r**2) / (2 * w**2)) / (2 * np.pi * w**2))

    def integrand(r: float) -> float:
        a, b = (p(r, w) for w in widths)
        m = 0.5 * (a + b)
        return float(2 * np.pi * r * 0.5 * (a * np.log2(a / m) + b * np.log2(b / m)))

    true = np.sqrt(quad(integrand, 0.0, 1.0)[0])
    (row,) = bsdf.compare(Gauss(widths[0]), Gauss(widths[1], tau=0.2), theta_deg=[0.0])
    assert row.js_distance == pytest.approx(true, rel=0.01)


def test_the_distance_is_0_for_one_shape_and_1_for_disjoint_ones_and_symmetric() -> None:
    a, b = Gauss(0.05, shift=-0.5), Gauss(0.05, shift=0.5)
    assert bsdf.compare(a, Gauss(0.05, tau=0.1, shift=-0.5), theta_deg=[0.0])[0].js_distance < 1e-7
    assert bsdf.compare(a, b, theta_deg=[0.0])[0].js_distance == pytest.approx(1.0, abs=1e-6)
    c = Gauss(0.1)
    assert bsdf.compare(a, c, theta_deg=[0.0])[0].js_distance == pytest.approx(
        bsdf.compare(c, a, theta_deg=[0.0])[0].js_distance
    )


@pytest.mark.parametrize("cone", [2.5, 8.0, 30.0])
@pytest.mark.parametrize("width", [0.01, 0.05, 0.2])
def test_the_haze_of_a_gaussian_is_its_share_outside_the_cone(cone: float, width: float) -> None:
    true = np.exp(-(np.sin(np.radians(cone)) ** 2) / (2 * width**2))
    found = bsdf.haze(Gauss(width), FRONT, theta_i_deg=0.0, cone_deg=cone)
    assert found == pytest.approx(true, abs=5e-4)


def test_the_haze_of_a_lambertian_pane_is_the_share_of_its_cone_at_any_angle() -> None:
    """Within a cone of c around a direction at theta lies the share sin(c)^2 cos(theta) of diffuse light."""
    flat = Gauss(1e3, tau=0.7 * 2 * np.pi * 1e6 / np.pi)
    flat.direct_hemispherical = lambda side, theta, phi=0.0: np.asarray(0.7)  # type: ignore[method-assign]
    for theta, phi in ((0.0, 0.0), (50.0, 70.0)):
        share = np.sin(np.radians(8.0)) ** 2 * np.cos(np.radians(theta))
        found = bsdf.haze(flat, FRONT, theta_i_deg=theta, phi_i_deg=phi, cone_deg=8.0)
        assert 1.0 - found == pytest.approx(share, rel=1e-3)


@pytest.mark.parametrize(("theta", "phi"), [(0.0, 0.0), (35.0, 0.0), (35.0, 120.0)])
def test_peak_width_and_centroid_are_those_of_the_gaussian(theta: float, phi: float) -> None:
    (row,) = bsdf.compare(Gauss(0.05), Gauss(0.1, tau=0.35), theta_deg=[theta], phi_deg=phi)
    assert row.peak_a == pytest.approx(0.7 / (2 * np.pi * 0.05**2), rel=0.01)
    assert row.peak_ratio == pytest.approx(0.125, rel=0.01)
    s, half = np.sin(np.radians(theta)), np.sqrt(2 * np.log(2))
    for width, found in ((0.05, row.fwhm_a_deg), (0.1, row.fwhm_b_deg)):
        true = np.degrees(np.arcsin(s + half * width) - np.arcsin(s - half * width))
        assert found == pytest.approx(true, rel=0.02)
    assert row.fwhm_ratio == pytest.approx(row.fwhm_b_deg / row.fwhm_a_deg)
    ux, uy = -s * np.cos(np.radians(phi)), -s * np.sin(np.radians(phi))
    assert (row.centroid_ux_a, row.centroid_uy_a) == pytest.approx((ux, uy), abs=2e-3)
    assert (row.centroid_ux_b, row.centroid_uy_b) == pytest.approx((ux, uy), abs=5e-3)


@pytest.mark.parametrize("theta", [0.0, 23.0, 60.0])
@pytest.mark.parametrize("width", [0.004, 0.008, 0.02])
def test_the_width_of_a_narrow_lobe_is_right_between_the_model_s_points(width: float, theta: float) -> None:
    """Points lie 0.25 degrees apart; the narrowest lobe is 0.54 degrees wide."""
    s, half = np.sin(np.radians(theta)), np.sqrt(2 * np.log(2)) * width
    true = np.degrees(np.arcsin(s + half) - np.arcsin(s - half))
    found = bsdf.lobe(Gauss(width), FRONT, theta_i_deg=theta)
    assert found.fwhm_deg == pytest.approx(true, rel=0.01)
    assert found.peak == pytest.approx(0.7 / (2 * np.pi * width**2), rel=2e-3)


def test_outside_the_data_every_figure_is_empty() -> None:
    (row,) = bsdf.compare(Gauss(0.1), Gauss(0.1), theta_deg=[95.0])
    assert np.isnan([row.js_distance, row.haze_2_5_a, row.peak_a, row.fwhm_b_deg, row.centroid_ux_a]).all()


def test_the_table_holds_every_figure(tmp_path: Path) -> None:
    rows = bsdf.compare(Gauss(0.05), Gauss(0.1), theta_deg=[0.0, 30.0])
    text = bsdf.write_csv(rows, tmp_path / "c.csv").read_text().splitlines()
    head = text[0].split(",")
    assert head[:6] == ["theta_deg", "tau_a", "tau_b", "l1", "peak_ratio", "fwhm_ratio"]
    assert {"js_distance", "haze_2_5_a", "haze_8_b", "peak_b", "fwhm_a_deg", "centroid_uy_b"} <= set(head)
    assert float(text[1].split(",")[head.index("haze_8_a")]) == pytest.approx(rows[0].haze_8_a, rel=1e-5)


def test_the_command_takes_a_measured_table_and_draws_its_points(
    command: Any, shared_data: Path, tmp_path: Path
) -> None:
    table = next((shared_data / "gonio/eds10").glob("EDS10_20*"))
    model = tmp_path / "pane.nc"
    from specularia import gonio

    bsdf.write(gonio.fit(gonio.read(table)), model)
    (found,) = gonio.read(table)
    words = ("bsdf", "compare", table, model, "--side", found.side, "-o", tmp_path / "out", "--json")
    code, told, _ = command(*words)
    assert code == 0 and told["l1"] == pytest.approx([0.0], abs=1e-6)
    assert told["js_distance"] == pytest.approx([0.0], abs=1e-3)
    names = {Path(f).name for f in told["files"]}
    assert names == {"compare.csv", "dsf.png", "sections.png", "ratio.png"}
    rows = (tmp_path / "out/sections.csv").read_text().splitlines()
    assert sum(r.startswith("measured,") for r in rows) > 20
