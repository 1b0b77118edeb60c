"""The spread between patches of a map is that of the pane, not of the noise."""

import numpy as np
import pytest
from glass_reference import smooth_map

from specularia.errors import PhysicsError
from specularia.glass import Face, Slab, directions, trace
from specularia.glass.checkpoint import Store
from specularia.glass.slab import patches
from specularia.glass.variation import variation


def test_a_pane_with_a_rough_and_a_smooth_half_differs_between_its_patches():
    h = smooth_map((64, 64), seed=3, rms_slope=0.5)
    h[:, 32:] *= 0.05
    slab = Slab(thickness_mm=1.0, front=Face(h, 1.5, 1.5, tiling="mirror"))
    found = variation(slab, 2, theta_deg=[0.0, 60.0], paths=80_000, seed=1)
    each = np.array(
        [trace(p, theta_deg=[0.0, 60.0], phi_deg=None, paths=64_000, seed=9).tau for p in patches(slab, 2)]
    )
    np.testing.assert_allclose(found.tau_sd, each.std(axis=0, ddof=1), atol=0.006)
    assert found.tau_sd[1] > 0.05
    np.testing.assert_allclose(found.tau_error, found.tau_sd / 2)
    assert np.all(found.l1 > 4 * found.noise)


def test_equal_patches_do_not_differ_beyond_noise():
    tile = np.sin(2 * np.pi * np.arange(32) / 16)
    slab = Slab(thickness_mm=1.0, front=Face(np.add.outer(tile, tile), 1.5, 1.5))
    found = variation(slab, 2, theta_deg=[0.0, 60.0], paths=80_000, seed=1)
    assert np.all(found.tau_sd < 0.004)
    assert np.all(found.l1 < 1.2 * found.noise + 0.02)
    with pytest.raises(PhysicsError, match="at least 2 patches"):
        variation(slab, 1, theta_deg=[0.0], paths=100)


def test_finished_patches_are_kept_and_not_traced_again(tmp_path, monkeypatch):
    h = smooth_map((32, 32), seed=3, rms_slope=0.3)
    slab = Slab(thickness_mm=1.0, front=Face(h, 1.5, 1.5, tiling="mirror"))
    store = Store(tmp_path / "c.nc", key="0" * 12)
    settings = {"theta_deg": [0.0, 60.0], "paths": 4000, "seed": 1}
    whole = variation(slab, 2, **settings, store=store)
    kept = sorted(store.path.iterdir())
    assert len(kept) == 4 * 2
    kept[5].unlink()
    traced = []
    real = directions.trace_direction
    monkeypatch.setattr(directions, "trace_direction", lambda *given: traced.append(given[1]) or real(*given))
    again = variation(slab, 2, **settings, store=store)
    assert len(traced) == 1
    np.testing.assert_array_equal(again.tau_sd, whole.tau_sd)
    np.testing.assert_array_equal(again.l1, whole.l1)
