"""Noise goes off a map where it stands out from the relief; relief, edges and gaps stay."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from specularia import surface
from specularia.cli import main
from specularia.errors import PhysicsError
from specularia.glass import Face, Medium, Slab, trace_paths
from specularia.surface import HeightMap, denoise
from specularia.twin import TwinSettings, make_face, microscope

PITCH = 1.5
NOISE = 0.012


def noisy(heights: np.ndarray, seed: int = 1, noise: float = NOISE) -> HeightMap:
    """Heights with independent noise, and its standard deviation for every pixel."""
    drawn = noise * np.random.default_rng(seed).standard_normal(heights.shape)
    return HeightMap(heights + drawn, PITCH, PITCH, sigma_um=np.full(heights.shape, noise))


def slopes(heights: np.ndarray) -> np.ndarray:
    return np.concatenate([np.diff(heights, axis=k).ravel() for k in (0, 1)]) / PITCH


def bowl() -> np.ndarray:
    y, x = np.mgrid[:96, :80] * PITCH
    return 2e-3 * (x - 40.0) ** 2 - 1e-3 * (y - 70.0) ** 2 + 0.1 * x


@pytest.fixture(scope="module")
def seen(tmp_path_factory: pytest.TempPathFactory) -> tuple[np.ndarray, HeightMap]:
    """A pitted face, synthetic, and what the simulated microscope makes of it."""
    settings = TwinSettings.model_validate({"maps": {"pixels": 256, "pitch_um": PITCH}})
    rng = np.random.default_rng(5)
    true = make_face(settings.front, settings.maps.of("front"), rng).decayed_um
    stack = microscope.focus_stack(true, settings.microscope, pitch_um=PITCH, rng=rng)
    path = tmp_path_factory.mktemp("stack") / "front.tif"
    microscope.write_stack(stack, path, pitch_um=PITCH, label="synthetic")
    found, _ = surface.filled(surface.heights(path))
    return true, found


def test_on_a_quadratic_surface_the_noise_falls_as_the_largest_window_allows() -> None:
    true = bowl()
    made = denoise(noisy(true))
    off = made.surface.heights_um - true
    # One window of 15 x 15 alone leaves sqrt(6 / 225) of the noise, at its middle sqrt(14.1 / 225).
    inside = off[10:-10, 10:-10]
    assert np.sqrt(np.mean(inside**2)) < NOISE * np.sqrt(6.0 / 225.0) * 1.15
    assert made.smoothed_share == 1.0
    assert made.noise_um == pytest.approx(NOISE)
    left = np.sqrt(np.mean(off**2))
    assert np.hypot(made.removed_um, left) == pytest.approx(NOISE, rel=0.03)


def test_the_uncertainty_that_is_left_holds_the_truth() -> None:
    true = bowl()
    made = denoise(noisy(true, seed=4)).surface
    assert made.sigma_um is not None
    z = (made.heights_um - true) / made.sigma_um
    assert 0.5 < np.sqrt(np.mean(z**2)) < 1.05  # an upper bound, and not an empty one


def test_steps_and_ridges_stay() -> None:
    true = np.zeros((64, 64))
    true[:, 32:] = 3.0
    true[20, :] += 1.0
    made = denoise(noisy(true, seed=2)).surface
    off = made.heights_um - true
    assert np.abs(off[:, 30:34]).max() < 5.0 * NOISE
    assert np.abs(off[19:22]).max() < 5.0 * NOISE
    assert np.sqrt(np.mean(off[30:60, 2:28] ** 2)) < 0.3 * NOISE


def test_a_map_without_noise_is_left_alone() -> None:
    rng = np.random.default_rng(3)
    true = np.cumsum(np.cumsum(rng.standard_normal((64, 64)), axis=0), axis=1)
    made = denoise(HeightMap(true, PITCH, PITCH), noise_um=1e-6)
    assert made.smoothed_share == 0.0 and made.removed_um == 0.0
    np.testing.assert_array_equal(made.surface.heights_um, true)


def test_gaps_stay_gaps_and_do_not_spoil_what_is_around() -> None:
    true = bowl()
    given = noisy(true)
    holes = given.heights_um.copy()
    holes[40:44, 30:35] = np.nan
    made = denoise(replace(given, heights_um=holes)).surface
    assert made.missing == 20
    np.testing.assert_array_equal(np.isnan(made.heights_um), np.isnan(holes))
    off = np.abs(made.heights_um - true)
    assert np.nanmax(off[36:48, 26:39]) < 4.0 * NOISE


def test_noise_that_differs_from_place_to_place_is_told_from_relief_by_its_own_size() -> None:
    y, x = np.mgrid[:64, :64] * PITCH
    true = 0.05 * np.sin(2.0 * np.pi * x / 12.0)
    sigma = np.where(y < 48.0, 0.005, 0.2)
    heights = true + sigma * np.random.default_rng(9).standard_normal(true.shape)
    made = denoise(HeightMap(heights, PITCH, PITCH, sigma_um=sigma)).surface
    fine, coarse = made.heights_um[4:26] - true[4:26], made.heights_um[38:60] - true[38:60]
    assert np.sqrt(np.mean(fine**2)) < 0.006  # the wave stays where the noise is small
    assert np.sqrt(np.mean(coarse**2)) < 0.07


def test_slopes_of_a_pitted_face_come_close_to_the_true_ones(seen: tuple[np.ndarray, HeightMap]) -> None:
    true, found = seen
    made = denoise(found).surface
    before, after = (np.abs(slopes(m.heights_um) - slopes(true)) for m in (found, made))
    assert np.median(after) < 0.2 * np.median(before)
    assert np.sqrt(np.mean(after**2)) < 0.6 * np.sqrt(np.mean(before**2))
    edges = np.linspace(-1.0, 1.0, 401)
    shares = [
        np.histogram(slopes(h), edges)[0] / true.size for h in (true, found.heights_um, made.heights_um)
    ]
    distance = [np.abs(s - shares[0]).sum() for s in shares[1:]]
    assert distance[1] < 0.35 * distance[0]


def test_light_through_the_map_is_that_through_the_true_face(seen: tuple[np.ndarray, HeightMap]) -> None:
    true, found = seen

    def undeflected(face: Face) -> float:
        """Share of the transmitted light that is deflected by less than 0.3 degrees."""
        paths = trace_paths(
            Slab(3.0, Medium(1.52), face, synthetic=True), theta_deg=0.0, paths=200_000, seed=2
        )
        through = paths.transmitted
        near = np.hypot(paths.ux[through], paths.uy[through]) < np.sin(np.radians(0.3))
        return float(paths.weight[through][near].sum() / paths.weight[through].sum())

    right = undeflected(Face(true, PITCH, PITCH))
    raw = undeflected(Face.from_map(found, tiling="periodic"))
    made = Face.from_map(found, tiling="periodic", denoise=True)
    assert abs(raw / right - 1.0) > 0.1
    assert undeflected(made) == pytest.approx(right, rel=0.04)
    assert undeflected(made.as_measured()) == raw


def test_what_cannot_be_denoised_is_refused() -> None:
    bare = HeightMap(bowl(), PITCH, PITCH)
    with pytest.raises(PhysicsError, match="state the noise"):
        denoise(bare)
    with pytest.raises(PhysicsError, match="above 0"):
        denoise(bare, noise_um=0.0)
    with pytest.raises(PhysicsError, match="nowhere"):
        denoise(replace(bare, sigma_um=np.zeros(bare.shape)))
    with pytest.raises(PhysicsError, match="at least"):
        denoise(HeightMap(np.zeros((1, 50)), PITCH, float("nan")), noise_um=0.01)


def test_the_command_writes_the_map_and_says_what_it_took_off(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    source, target = surface.write(noisy(bowl()), tmp_path / "map.nc"), tmp_path / "out.nc"
    assert main(["surface", "denoise", str(source), "-o", str(target), "--json", "-q"]) == 0
    said = json.loads(capsys.readouterr().out)
    assert said["noise_um"] == pytest.approx(NOISE) and said["smoothed_share"] == 1.0
    assert said["Sdq_after"] < said["Sdq_before"]
    back = surface.read(target)
    np.testing.assert_allclose(back.heights_um, denoise(noisy(bowl())).surface.heights_um, atol=1e-5)
    assert "noise_removed" in back.attributes
    np.save(tmp_path / "bare.npy", bowl())
    words = [
        "surface",
        "denoise",
        str(tmp_path / "bare.npy"),
        "--pitch",
        "1.5",
        "-o",
        str(tmp_path / "no.nc"),
    ]
    assert main([*words, "-q"]) != 0
    assert "state the noise" in capsys.readouterr().err
    assert not (tmp_path / "no.nc").exists()
    assert main([*words, "--noise-um", "0.01", "-q"]) == 0
