"""Healing of synthetic pitted surfaces whose pits and original heights are known."""

from __future__ import annotations

import numpy as np
import pytest

from specularia import surface
from specularia.errors import PhysicsError

PITCH, NOISE = 1.5, 0.03


def pitted(*, share, pixels=256, streaks=0.0, tilt=0.0, seed=0):
    """(map, original, pits): bowls dug into a plane with streaks until they cover `share`."""
    rng = np.random.default_rng(seed)
    y, x = np.mgrid[0:pixels, 0:pixels] * PITCH
    original = streaks * np.sin(2 * np.pi * x / (pixels * PITCH / 2)) + tilt * x - 0.5 * tilt * y
    depth, pits = np.zeros((pixels, pixels)), np.zeros((pixels, pixels), bool)
    while pits.mean() < share:
        radius = rng.uniform(8.0, 30.0)
        cx, cy = rng.uniform(0, pixels * PITCH, 2)
        q = ((x - cx) ** 2 + (y - cy) ** 2) / radius**2
        depth = np.maximum(depth, rng.uniform(0.3, 0.7) * radius * np.clip(1 - q, 0, None))
        pits |= q < 1
    decayed = original - depth + NOISE * rng.standard_normal(depth.shape)
    return surface.HeightMap(decayed, PITCH, PITCH), original, pits


@pytest.mark.parametrize(("share", "least"), [(0.3, 0.95), (0.6, 0.9), (0.85, 0.85)])
def test_pits_are_found_and_plateaux_left_as_measured(share, least):
    given, _, pits = pitted(share=share, streaks=0.3, tilt=0.01)
    healed = surface.heal(given)
    kept, plateau = ~healed.pits, ~pits
    f1 = 2 * np.sum(kept & plateau) / (kept.sum() + plateau.sum())
    assert f1 >= least
    assert healed.pit_coverage == pytest.approx(pits.mean(), abs=0.05)
    assert np.allclose(healed.surface.heights_um[kept], given.heights_um[kept], atol=1e-9)


@pytest.mark.parametrize("share", [0.3, 0.6])
def test_the_healed_surface_lies_in_the_original_one(share):
    given, original, pits = pitted(share=share, streaks=0.3, tilt=0.01)
    healed = surface.heal(given)
    error = healed.surface.heights_um - original
    assert np.sqrt(np.mean(error**2)) < 0.1  # the pits are up to 20 um deep
    assert np.abs(error).max() < 1.0
    assert np.abs(error[pits].mean()) < 0.05
    assert healed.Sdq_after < 0.15 * healed.Sdq_before
    assert healed.Sdq_before == surface.roughness(given).Sdq
    assert healed.Sdq_after == surface.roughness(healed.surface).Sdq


def test_a_surface_without_pits_is_left_alone():
    given, _, _ = pitted(share=0.0, streaks=0.3)
    healed = surface.heal(given)
    assert healed.pit_coverage < 0.005
    assert np.abs(healed.surface.heights_um - given.heights_um).max() < 6 * NOISE


def test_missing_pixels_are_filled_and_sigma_is_kept_only_where_it_was_measured():
    given, _, _ = pitted(share=0.3)
    z = given.heights_um.copy()
    z[100:104, 50:60] = np.nan
    healed = surface.heal(surface.HeightMap(z, PITCH, PITCH, sigma_um=np.full(z.shape, NOISE)))
    assert healed.surface.missing == 0
    assert np.isnan(healed.surface.sigma_um[healed.pits]).all()
    kept = ~healed.pits & np.isfinite(z)
    assert (healed.surface.sigma_um[kept] == NOISE).all()


def test_a_map_too_small_or_a_profile_is_refused():
    for shape in ((1, 100), (20, 200)):
        with pytest.raises(PhysicsError, match="32 x 32"):
            surface.heal(surface.HeightMap(np.random.default_rng(0).normal(size=shape), 1.0, 1.0))


def test_the_command_writes_the_healed_map(tmp_path, command):
    given, _, pits = pitted(share=0.5)
    path = surface.write(given, tmp_path / "m.nc", {"synthetic": "made by a test"})
    code, out, _ = command("surface", "heal", path, "-o", tmp_path / "h.nc", "--json")
    assert code == 0
    assert (
        out["pit_coverage"] == pytest.approx(pits.mean(), abs=0.05) and out["Sdq_after"] < out["Sdq_before"]
    )
    written = surface.read(tmp_path / "h.nc")
    assert written.shape == given.shape and "synthetic" in written.attributes
    assert surface.roughness(written).Sdq == pytest.approx(out["Sdq_after"])
