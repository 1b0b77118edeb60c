"""Merging sparse cells keeps the light, keeps lobes sharp and calms the background."""

from __future__ import annotations

import numpy as np

from specularia.glass.merging import LARGEST_BLOCK, merge_sparse


def counted(expected, seed):  # type: ignore[no-untyped-def]
    return np.random.default_rng(seed).poisson(expected).astype(float)


def test_the_light_is_kept_in_every_largest_block() -> None:
    rng = np.random.default_rng(1)
    area = rng.uniform(0.5, 1.5, (96, 96))
    weight = counted(rng.gamma(0.3, 20.0, (96, 96)), 2)
    density, _ = merge_sparse(weight, weight, area)
    k = 96 // LARGEST_BLOCK
    kept, given = (
        v.reshape(k, LARGEST_BLOCK, k, LARGEST_BLOCK).sum(axis=(1, 3)) for v in (density * area, weight)
    )
    np.testing.assert_allclose(kept, given, rtol=1e-12)


def test_cells_with_enough_paths_stay_as_they_are() -> None:
    weight = counted(np.full((64, 64), 500.0), 3)
    density, error = merge_sparse(weight, weight, np.ones((64, 64)))
    np.testing.assert_array_equal(density, weight)
    np.testing.assert_allclose(error, np.sqrt(weight))


def test_a_lobe_on_a_weak_background_keeps_its_peak_and_the_background_loses_its_speckle() -> None:
    k = np.arange(128) - 63.5
    x, y = np.meshgrid(k, k)
    truth = 4000.0 * np.exp(-(x**2 + y**2) / (2 * 3.0**2)) + 1.5
    weight = counted(truth, 4)
    density, error = merge_sparse(weight, weight, np.ones_like(truth))
    assert density.max() == weight.max()
    far = np.hypot(x, y) > 45
    assert np.std(weight[far]) > 1.0
    assert np.std(density[far]) < 0.35
    # The stated error is the real one.
    z = (density - truth)[far] / error[far]
    assert 0.7 < np.sqrt(np.mean(z**2)) < 1.3
