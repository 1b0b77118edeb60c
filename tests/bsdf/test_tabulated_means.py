"""Cells of trees looked up in the tables directly, against those asked for through the public face."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from specularia.bsdf import SideTable, TabulatedModel, cell_means
from specularia.bsdf.build_tree import angles_between, bin_edges, fill_cells
from specularia.bsdf.side_table import cell_centres
from specularia.bsdf.tabulated_cells import quadrature_cells
from specularia.bsdf.tabulated_means import TabulatedMeans


@pytest.fixture(scope="module")
def model() -> TabulatedModel:
    """A lobe of 2.3 degrees on a broad background, lopsided, so that a flip would show."""
    theta, n, m, half = np.array([0.0, 40.0, 75.0]), 128, 128, 0.15

    def value(s: float, x: Any, y: Any) -> Any:
        r2 = (x + s) ** 2 + (y - 0.01) ** 2
        return 0.5 * np.exp(-r2 / (2 * 0.04**2)) / (2 * np.pi * 0.04**2) + 0.1 * (1 + 0.5 * y)

    k = ((np.arange(m) + 0.5) / m * 2 - 1) * half
    sines = np.sin(np.radians(theta))
    return TabulatedModel(
        tables={
            "transmission_front": SideTable(
                theta_i_deg=theta,
                base=np.stack([value(s, *cell_centres(n)) for s in sines]).astype(np.float32),
                patch=np.stack([value(s, *np.meshgrid(k - s, k, indexing="ij")) for s in sines]).astype(
                    np.float32
                ),
                half_width=half,
                tau=np.array([0.7, 0.6, 0.35]),
                tau_se=np.full(3, 1e-4),
                origin="formula",
            )
        },
        band="Visible",
    )


@pytest.mark.parametrize("side", ["transmission_front", "transmission_back"])
@pytest.mark.parametrize("n", [32, 64, 128])
def test_cells_and_their_light_are_those_of_the_model(model: TabulatedModel, side: str, n: int) -> None:
    means = TabulatedMeans(model, side, n=n)
    for theta in (0.0, 25.0, 60.0, 85.0):
        found = means.at(theta)
        expected = cell_means(model, side, theta_i_deg=theta, n=n)
        tau = float(model.direct_hemispherical(side, theta))
        assert found.sum() * np.pi / n**2 == pytest.approx(tau, rel=2e-3 if means.reciprocal else 1e-9)
        assert np.abs(found - expected).sum() * np.pi / n**2 < 6e-3 * tau


@pytest.mark.parametrize("resolution", [5, 6])
def test_the_bins_of_a_reciprocal_side_hold_the_mean_of_its_light(
    model: TabulatedModel, resolution: int
) -> None:
    def light(theta: float) -> float:
        x, y, weight = quadrature_cells(float(np.sin(np.radians(theta))), 512, 512, 0.15)
        return float(np.sum(weight * model.evaluate("transmission_back", theta, 0.0, x, y)))

    _, tau = fill_cells(model, "transmission_back", resolution=resolution)
    edges = bin_edges(resolution)
    for k in (0, 1, len(tau) // 2, len(tau) - 1):
        theta, weight = angles_between(float(edges[k + 1]), float(edges[k]), 10 if k == 0 else 3)
        assert tau[k] == pytest.approx(weight @ [light(float(t)) for t in theta], rel=1e-3)


@pytest.mark.parametrize(
    ("theta", "off"), [(10.0, 1e-3), (50.0, 1e-3), (70.0, 1e-3), (78.0, 2e-3), (86.0, 2e-3)]
)
def test_the_distribution_between_the_angles_adds_up_to_tau(
    model: TabulatedModel, theta: float, off: float
) -> None:
    x, y, weight = quadrature_cells(float(np.sin(np.radians(theta))), 512, 512, 0.15)
    total = float(np.sum(weight * model.evaluate("transmission_front", theta, 0.0, x, y)))
    assert total == pytest.approx(float(model.direct_hemispherical("transmission_front", theta)), rel=off)
