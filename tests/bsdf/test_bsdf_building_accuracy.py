"""A tree at 2^7 holds a smooth model to within stated errors, before and after reduction."""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np
import pytest

from specularia.bsdf.build_tree import bin_edges, fill_cells, reduce_cells
from specularia.bsdf.cells import grid
from specularia.bsdf.model import Quadrature
from specularia.conventions import square_to_disk

G = 7
SIDE = "transmission_front"


@pytest.fixture(scope="module")
def smooth(chiral: Any) -> Any:
    """A lobe of 0.07 in direction cosines (9 degrees across), off the undeflected direction."""
    model = dataclasses.replace(chiral, width=0.07)
    x, y = grid(256)
    model.points = Quadrature(x.ravel(), y.ravel(), np.full(x.size, np.pi / x.size))
    return model


@pytest.fixture(scope="module")
def filled(smooth: Any) -> tuple[Any, Any]:
    return fill_cells(smooth, SIDE, resolution=G)


def _bin_mean(model: Any, low: float, high: float, points: int = 3) -> Any:
    """Model averaged over an incidence bin and over the cells: 8 angles even in sin^2, 9 points a cell."""
    n = 1 << G
    k = (np.arange(n * points) + 0.5) / (n * points)
    x, y = square_to_disk(*np.meshgrid(k, k, indexing="ij"))
    s = np.sqrt(low**2 + (np.arange(8) + 0.5) / 8 * (high**2 - low**2))
    total = sum(model.evaluate(SIDE, t, 0.0, x, y) for t in np.degrees(np.arcsin(s))) / 8
    # Radiance's x runs the other way.
    return total.reshape(n, points, n, points).mean(axis=(1, 3))[::-1]


def test_cells_are_the_means_of_the_model(smooth: Any, filled: tuple[Any, Any]) -> None:
    cells, tau = filled
    area = np.pi / cells.shape[1] ** 2
    edges = bin_edges(G)
    for k in range(tau.size):
        mean = _bin_mean(smooth, float(edges[k + 1]), float(edges[k]))
        assert tau[k] == pytest.approx(mean.sum() * area, rel=2e-3), k
        assert np.abs(cells[k] - mean).sum() * area <= 5e-3 * tau[k], k


@pytest.mark.parametrize(("cull", "limit"), [(95.0, 0.02), (99.0, 0.15)])
def test_reduction_keeps_tau_of_every_bin_and_moves_little_light(
    filled: tuple[Any, Any], cull: float, limit: float
) -> None:
    cells, tau = filled
    area = np.pi / cells.shape[1] ** 2
    flat, merged = reduce_cells(cells, tau, cull=cull)
    left = merged[0].size - 7 * sum(int(m.sum()) for m in merged[1:])
    assert left <= (1 - cull / 100) * cells.size * 1.1
    np.testing.assert_allclose(flat.sum(axis=(1, 2), dtype=float) * area, tau, rtol=2e-3)
    moved = np.abs(flat - cells).sum(axis=(1, 2), dtype=float) * area / tau
    print(f"cull {cull:g} %: L1 {100 * moved.max():.2f} % in the worst bin, mean {100 * moved.mean():.2f} %")
    assert moved.max() <= limit
