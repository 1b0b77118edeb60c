"""Healing of synthetic pitted surfaces whose pits and original heights are known."""

from __future__ import annotations

import numpy as np
import pytest

from specularia import surface
from specularia.errors import FormatError, PhysicsError
from specularia.surface import random_field
from specularia.twin.faces import make_face
from specularia.twin.microscope import returned
from specularia.twin.settings import FaceSettings, MapSettings

PITCH, NOISE = 1.5, 0.03


def pitted(*, share, pixels=256, streaks=0.3, turn=0.0, wave=128.0, tilt=0.0, seed=0):
    """(map, original, pits): bowls dug into a tilted plane with streaks until they cover `share`."""
    rng = np.random.default_rng(seed)
    y, x = np.mgrid[0:pixels, 0:pixels] * PITCH
    across = x * np.cos(turn) + y * np.sin(turn)
    original = streaks * np.sin(2 * np.pi * across / wave) + tilt * x - 0.5 * tilt * y
    depth, pits = np.zeros((pixels, pixels)), np.zeros((pixels, pixels), bool)
    while pits.mean() < share:
        radius = rng.uniform(8.0, 30.0)
        cx, cy = rng.uniform(0, pixels * PITCH, 2)
        q = ((x - cx) ** 2 + (y - cy) ** 2) / radius**2
        depth = np.maximum(depth, rng.uniform(0.3, 0.7) * radius * np.clip(1 - q, 0, None))
        pits |= q < 1
    decayed = original - depth + NOISE * rng.standard_normal(depth.shape)
    return surface.HeightMap(decayed, PITCH, PITCH), original, pits


def rms(a):
    return float(np.sqrt(np.mean(np.asarray(a) ** 2)))


@pytest.mark.parametrize(
    ("share", "f1", "turn", "tilt"),
    [(0.3, 0.97, 0.0, 0.01), (0.6, 0.95, 0.6, 0.0), (0.9, 0.7, np.pi / 2, 0.02)],
)
def test_plateaux_are_found_and_the_original_surface_with_its_streaks(share, f1, turn, tilt):
    given, original, pits = pitted(share=share, turn=turn, tilt=tilt)
    healed = surface.heal(given, ensemble=6)
    kept, plateau = ~healed.pits, ~pits
    assert 2 * np.sum(kept & plateau) / (kept.sum() + plateau.sum()) >= f1
    error = healed.surface.heights_um - original
    assert rms(error) < (0.02, 0.05, 0.16)[(0.3, 0.6, 0.9).index(share)]  # streaks: 0.21 um rms
    if share < 0.9:
        true = surface.roughness(surface.HeightMap(original, PITCH, PITCH)).Sdq
        assert healed.Sdq_after == pytest.approx(true, rel=0.1)
        low, high = healed.Sdq_interval
        assert low < 1.03 * true and high > 0.97 * true
    assert len(healed.members) == 6
    # Members agree where something is left and differ where it is not; sigma says by how much.
    spread = healed.members.std(axis=0)
    assert spread[kept].mean() < spread[healed.pits].mean()
    assert rms(error) < 2.5 * rms(healed.surface.sigma_um)


def test_healing_beats_a_plane_a_robust_filter_and_a_closing():
    given, original, _ = pitted(share=0.6)
    errors = {
        method: rms(surface.heal(given, method=method, ensemble=0).surface.heights_um - original)
        for method in surface.METHODS
    }
    assert 2 * errors["field"] < min(v for k, v in errors.items() if k != "field")


def test_the_robust_filter_follows_a_tilted_plane_and_the_plane_lies_on_the_plateaux():
    given, _, _ = pitted(share=0.5, streaks=0.0, tilt=0.01)
    y, x = np.mgrid[0:256, 0:256] * PITCH
    flat = surface.heal(given, method="flat")
    assert np.abs(flat.surface.heights_um - (0.01 * x - 0.005 * y)).max() < 2 * NOISE
    smooth = surface.HeightMap(0.01 * x - 0.005 * y, PITCH, PITCH)
    again = surface.heal(smooth, method="gaussian", reach_um=100.0)
    assert np.abs(again.surface.heights_um - smooth.heights_um)[20:-20, 20:-20].max() < 1e-6


def test_a_surface_without_pits_keeps_its_shape():
    given, original, _ = pitted(share=0.0)
    healed = surface.heal(given, ensemble=0)
    assert healed.pit_coverage < 0.01 and healed.no_evidence_share == 0.0
    assert rms(healed.surface.heights_um - original) < 0.3 * NOISE
    assert len(healed.members) == 0 and healed.Sdq_interval is None


def test_the_same_seed_gives_the_same_members_and_missing_pixels_are_bridged():
    given, original, _ = pitted(share=0.4, pixels=112)
    z = given.heights_um.copy()
    z[80:86, 50:70] = np.nan
    holed = surface.HeightMap(z, PITCH, PITCH)
    one, two, other = (surface.heal(holed, ensemble=2, seed=s) for s in (5, 5, 6))
    assert one.surface.missing == 0
    assert np.array_equal(one.members, two.members) and not np.array_equal(one.members, other.members)
    assert np.array_equal(one.surface.heights_um, two.surface.heights_um)
    assert one.pits[82:84, 55:65].all()
    assert np.abs(one.surface.heights_um - original)[80:86, 50:70].max() < 0.2


def test_maps_without_plateaux_and_small_ones_are_refused():
    rng = np.random.default_rng(0)
    for shape in ((1, 100), (20, 200)):
        with pytest.raises(PhysicsError, match="32 x 32"):
            surface.heal(surface.HeightMap(rng.normal(size=shape), 1.0, 1.0))
    from scipy.ndimage import gaussian_filter

    hills = 50.0 * gaussian_filter(rng.normal(size=(128, 128)), 2.0)
    with pytest.raises(PhysicsError, match="nothing of"):
        surface.heal(surface.HeightMap(hills, 1.0, 1.0), ensemble=0)


def test_normal_equations_of_waves_are_the_sums_over_pixels():
    shape, pitch = (20, 24), (1.0, 1.5)
    modes = random_field.modes_of(shape, pitch, count=40)
    rng = np.random.default_rng(3)
    heights, weights = rng.normal(size=shape), rng.uniform(size=shape)
    rows, columns = (a.ravel().astype(float) for a in np.indices(shape))
    terms = random_field.terms(modes, rows, columns)
    found = random_field.normal(modes, heights, weights)
    w = weights.ravel()
    assert np.allclose(found.matrix, terms.T @ (w[:, None] * terms), atol=1e-9)
    assert np.allclose(found.right, terms.T @ (w * heights.ravel()), atol=1e-9)
    c = rng.normal(size=terms.shape[1])
    assert np.allclose(random_field.Field(modes, c).heights().ravel(), terms @ c, atol=1e-9)


def test_leaving_out_equals_fitting_without():
    modes = random_field.modes_of((40, 40), (1.0, 1.0), count=30)
    rng = np.random.default_rng(4)
    rows, columns = rng.uniform(0, 39, (2, 60))
    terms = random_field.terms(modes, rows, columns)
    levels, weights = rng.normal(size=60), rng.uniform(0.5, 2.0, 60)
    s = random_field.first_spectrum(modes, height_um=1.0)
    out = random_field.left_out(terms, levels, weights, s, broad=2.0)
    without = weights.copy()
    without[7] = 0.0
    assert out[7] == pytest.approx(random_field.left_out(terms, levels, without, s, broad=2.0)[7], rel=1e-6)


def test_the_command_writes_the_healed_map_with_its_members(tmp_path, command):
    given, _, pits = pitted(share=0.5, pixels=112)
    path = surface.write(given, tmp_path / "m.nc", {"synthetic": "made by a test"})
    out_path = tmp_path / "h.nc"
    code, out, _ = command(
        "surface", "heal", path, "-o", out_path, "--ensemble", "3", "--seed", "2", "--json"
    )
    assert code == 0
    assert out["pit_coverage"] == pytest.approx(pits.mean(), abs=0.05)
    assert out["Sdq_after"] < out["Sdq_before"] and out["members"] == 3
    written = surface.read(out_path)
    assert written.shape == given.shape and "synthetic" in written.attributes
    assert surface.roughness(written).Sdq == pytest.approx(out["Sdq_after"])
    assert surface.read_members(out_path).shape == (3, 112, 112)
    with pytest.raises(FormatError, match="ensemble"):
        surface.read_members(path)
    code, out, _ = command("surface", "heal", path, "-o", out_path, "--method", "flat", "--json")
    assert code == 0 and out["method"] == "flat" and out["members"] == 0
    assert command("surface", "heal", path, "-o", out_path, "--method", "nothing")[0] == 2


@pytest.mark.parametrize("seed", [1, 2])
def test_a_white_light_picture_tells_shallow_pits_that_noisy_heights_hide(seed):
    """Pits of 6 to 25 um, noise of 0.3 um; the picture has a grid of its own and is lit unevenly."""
    settings = FaceSettings(pitted_share=0.6, radius_um=(6, 25), relief_um=10)
    rng = np.random.default_rng(seed)
    face = make_face(settings, MapSettings(pixels=256), rng)
    shade = returned(face.decayed_um, pitch_um=PITCH, half_bright_slope=0.35)
    shade = shade * (1.0 + 0.2 * np.linspace(-1, 1, 256)) * (1.0 + 0.01 * rng.standard_normal((256, 256)))
    noisy = face.decayed_um + 0.3 * rng.standard_normal((256, 256))
    given = surface.HeightMap(noisy, PITCH, PITCH)
    alone, seen = (
        surface.heal(given, ensemble=0, picture=p) for p in (None, np.kron(shade, np.ones((2, 2))))
    )
    error = [rms(h.surface.heights_um - face.pristine_um) for h in (seen, alone)]
    assert error[0] < 0.1 and error[0] < 0.5 * error[1]


def test_a_picture_of_another_field_is_refused():
    given, _, _ = pitted(share=0.3)
    with pytest.raises(PhysicsError, match="Crop it"):
        surface.heal(given, picture=np.ones((256, 128)))


def test_a_picture_is_read_with_its_lowest_row_first(tmp_path):
    import imageio.v3 as iio

    shown = np.zeros((20, 30), np.uint8)
    shown[0, :] = 200
    iio.imwrite(tmp_path / "face.png", shown)
    assert surface.read_picture(tmp_path / "face.png")[-1].min() == 200.0
    (tmp_path / "no.png").write_bytes(b"not a picture")
    with pytest.raises(FormatError, match="picture"):
        surface.read_picture(tmp_path / "no.png")
