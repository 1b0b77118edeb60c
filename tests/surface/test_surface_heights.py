"""Focus stacks of known heights: bias, error against the Cramer-Rao bound, honest sigma, flagged pixels."""

from __future__ import annotations

import json

import numpy as np
import pytest
import tifffile

from specularia import surface
from specularia.errors import FormatError, PhysicsError, SpeculariaWarning
from specularia.surface import focus

SLICES, PIXELS = 48, 96


def relief(pixels=PIXELS, slices=SLICES, steepest=0.36):
    """Heights in slices, with slopes up to `steepest` slices per pixel, well inside the stack."""
    y, x = np.mgrid[0:pixels, 0:pixels] / pixels
    h = np.sin(2 * np.pi * 2 * x) * np.cos(2 * np.pi * y) + 0.3 * np.sin(2 * np.pi * 5 * y)
    gy, gx = np.gradient(h)
    return slices / 2 + h * steepest / np.hypot(gx, gy).max()


def stack_of(h, *, fwhm=4.0, snr=30.0, response="gauss", shot=0.0, level=1000.0, offset=100.0, seed=0):
    """Noisy brightness [slice, row, column] of a surface, as floats."""
    rng = np.random.default_rng(seed)
    z = np.arange(SLICES)[:, None, None] - h
    if response == "gauss":
        g = np.exp(-4 * np.log(2) * (z / fwhm) ** 2)
    else:
        g = np.sinc(2 * 0.442946 * z / fwhm) ** 2
    bright = offset + level * g
    noise = np.sqrt((level / snr) ** 2 + shot * bright)
    return bright + noise * rng.standard_normal(bright.shape)


@pytest.mark.parametrize("response", ["gauss", "sinc2"])
def test_error_is_near_the_cramer_rao_bound_without_bias_and_far_below_argmax(response):
    h = relief()
    frames = stack_of(h, response=response)
    made = surface.heights(surface.Stack(frames, (1.0, 1.0), 1.0))
    error = made.heights_um - h
    bound = focus.cramer_rao(snr=30.0, fwhm=4.0)
    argmax = np.argmax(frames, axis=0) - h
    assert made.missing == 0
    assert error.std() <= 1.1 * bound
    assert abs(error.mean()) <= 0.002
    assert error.std() < argmax.std() / 5
    # No bias that follows the place of the peak between slices: eight classes, each within 4 standard errors.
    phase = np.floor(8 * (h % 1.0)).astype(int)
    for k in range(8):
        e = error[phase == k]
        assert abs(e.mean()) < max(4 * e.std() / np.sqrt(e.size), 1e-9) and abs(e.mean()) < 0.01


def test_the_bound_is_the_inverse_fisher_information_of_sampled_peaks():
    z = np.arange(-40, 41)
    w = 6.0 / focus.FWHM_PER_SIGMA
    derivative = z / w**2 * np.exp(-0.5 * (z / w) ** 2)
    assert focus.cramer_rao(snr=25.0, fwhm=6.0) == pytest.approx(
        1 / (25.0 * np.sqrt(np.sum(derivative**2))), rel=1e-6
    )


@pytest.mark.parametrize(
    ("response", "snr", "shot"),
    [("gauss", 30.0, 0.0), ("sinc2", 30.0, 0.0), ("sinc2", 200.0, 1.5), ("gauss", 12.0, 3.0)],
)
def test_95_percent_intervals_cover_93_to_97_percent(response, snr, shot):
    h = relief()
    made = surface.heights(surface.Stack(stack_of(h, response=response, snr=snr, shot=shot), (1.0, 1.0), 1.0))
    inside = np.abs(made.heights_um - h) < 1.96 * made.sigma_um
    assert 0.93 <= inside[made.valid].mean() <= 0.97


def test_noise_of_the_stack_is_found_again():
    frames = stack_of(relief(), snr=100.0, shot=2.0)
    made = surface.heights(surface.Stack(frames, (1.0, 1.0), 1.0))
    said = json.loads(made.attributes["parameters"])
    assert said["noise_gain"] == pytest.approx(2.0, rel=0.1)
    assert said["noise_floor"] == pytest.approx(100.0, rel=0.5)
    assert said["response_fwhm_um"] == pytest.approx(4.0, rel=0.03)


def test_step_origin_and_direction_of_the_stack_are_respected():
    h = relief()
    frames = stack_of(h)
    up = surface.heights(surface.Stack(frames, (1.5, 1.5), 0.5, z0_um=-3.0))
    down = surface.heights(surface.Stack(frames[::-1], (1.5, 1.5), -0.5, z0_um=-3.0 + 0.5 * (SLICES - 1)))
    assert np.allclose(up.heights_um, -3.0 + 0.5 * h, atol=0.2)
    assert np.allclose(up.heights_um, down.heights_um, atol=1e-6)
    assert np.allclose(up.sigma_um, down.sigma_um, rtol=1e-4)


def test_the_picture_in_focus_shows_the_reflectance():
    h = relief()
    y, x = np.mgrid[0:PIXELS, 0:PIXELS]
    reflectance = 1000.0 * (1.0 + 0.5 * ((x // 12 + y // 12) % 2))
    made = surface.heights(surface.Stack(stack_of(h, level=reflectance, snr=60.0), (1.0, 1.0), 1.0))
    assert np.corrcoef(made.image.ravel(), reflectance.ravel())[0, 1] > 0.99
    assert np.median(made.image / (100.0 + reflectance)) == pytest.approx(1.0, abs=0.02)


def test_dark_saturated_and_out_of_range_pixels_are_missing_with_their_reason():
    h = relief()
    h[:8, :8] = -4.0  # below the first slice
    frames = stack_of(h, snr=100.0, seed=3)
    rng = np.random.default_rng(4)
    frames[:, 40:50, 40:50] = 100.0 + 10.0 * rng.standard_normal((SLICES, 10, 10))  # no reflection
    frames[:, 60:70, 20:30] = 100.0 + 4.5 * (frames[:, 60:70, 20:30] - 100.0)  # above full scale at the peak
    frames = np.clip(np.rint(frames), 0, 4095).astype(np.uint16)
    with pytest.warns(SpeculariaWarning, match="264 of 9216 pixels have no height"):
        made = surface.heights(surface.Stack(frames, (1.0, 1.0), 1.0))
    wanted = np.zeros(h.shape, bool)
    wanted[:8, :8] = wanted[40:50, 40:50] = wanted[60:70, 20:30] = True
    assert np.array_equal(~made.valid, wanted)
    because = json.loads(made.attributes["missing_because"])
    assert because["saturated"] == 100
    assert because["dark"] + because["edge"] == 164 and because["dark"] >= 100
    assert np.isnan(made.sigma_um[wanted]).all() and np.isfinite(made.image).all()


def test_two_like_peaks_leave_the_height_open_and_a_weak_second_lowers_the_reliability():
    h = np.full((PIXELS, PIXELS), 14.3)
    frames = stack_of(h, snr=100.0)
    second = np.exp(-4 * np.log(2) * ((np.arange(SLICES) - 34.6) / 4.0) ** 2)[:, None, None]
    frames[:, :10, :10] += 950.0 * second
    frames[:, 20:30, 20:30] += 200.0 * second
    with pytest.warns(SpeculariaWarning, match="100 double"):
        made = surface.heights(surface.Stack(frames, (1.0, 1.0), 1.0))
    assert not made.valid[:10, :10].any() and made.valid[20:30, 20:30].all()
    assert np.median(made.reliability[20:30, 20:30]) == pytest.approx(0.8, abs=0.03)
    assert np.median(made.reliability[50:, 50:]) > 0.9


def test_tiles_change_nothing(monkeypatch):
    from specularia.surface import measure

    frames = stack_of(relief())
    whole = surface.heights(surface.Stack(frames, (1.0, 1.0), 1.0))
    monkeypatch.setattr(measure, "_TILE_BYTES", 4 * SLICES * PIXELS)  # one row at a time
    rows = surface.heights(surface.Stack(frames, (1.0, 1.0), 1.0))
    assert np.array_equal(whole.heights_um, rows.heights_um) and np.array_equal(whole.sigma_um, rows.sigma_um)


@pytest.fixture(scope="module")
def small():
    h = relief(48)
    frames = stack_of(h)
    return h, np.rint(10 * frames).clip(0, 60000).astype(np.uint16)


def test_the_same_stack_in_every_container_gives_the_same_map(small, tmp_path):
    _, frames = small
    said = {"pitch_um": 1.5, "step_um": 0.5, "z0_um": -2.0, "synthetic": "made by a test"}
    tifffile.imwrite(tmp_path / "own.tif", frames, description=json.dumps(said), metadata=None)
    tifffile.imwrite(
        tmp_path / "packed.tif", frames, description=json.dumps(said), metadata=None, compression="zlib"
    )
    tifffile.imwrite(
        tmp_path / "s.ome.tif",
        frames,
        metadata={
            "axes": "ZYX",
            "PhysicalSizeX": 1500.0,
            "PhysicalSizeXUnit": "nm",
            "PhysicalSizeY": 1.5,
            "PhysicalSizeZ": 0.5,
        },
    )
    tifffile.imwrite(
        tmp_path / "ij.tif",
        frames,
        imagej=True,
        resolution=(1 / 1.5, 1 / 1.5),
        metadata={"axes": "ZYX", "spacing": 0.5, "unit": "um"},
    )
    np.save(tmp_path / "s.npy", frames)
    (tmp_path / "pictures").mkdir()
    for k, frame in enumerate(frames):
        tifffile.imwrite(tmp_path / "pictures" / f"z{k}.tif", frame)  # z10 sorts before z2 as text
    own = surface.heights(tmp_path / "own.tif")
    assert "synthetic" in own.attributes and own.pitch_x_um == 1.5
    for name, extra in (
        ("packed.tif", {}),
        ("s.ome.tif", {"first_row": "bottom"}),
        ("ij.tif", {"first_row": "bottom"}),
        ("s.npy", {"pitch_um": 1.5, "step_um": 0.5}),
        ("pictures", {"pitch_um": 1.5, "step_um": 0.5, "first_row": "bottom"}),
    ):
        made = surface.heights(tmp_path / name, **extra)
        shift = 0.0 if name == "packed.tif" else 2.0  # only our own file says where the first slice was
        assert np.allclose(made.heights_um, own.heights_um + shift, atol=1e-9), name
        assert made.pitch_x_um == pytest.approx(1.5) and made.pitch_y_um == pytest.approx(1.5)


def test_the_way_up_is_asked_for_and_turns_the_map(small, tmp_path):
    _, frames = small
    tifffile.imwrite(tmp_path / "s.tif", frames)
    with pytest.warns(SpeculariaWarning, match="which way up"):
        bottom = surface.heights(tmp_path / "s.tif", pitch_um=1.0, step_um=1.0)
    top = surface.heights(tmp_path / "s.tif", pitch_um=1.0, step_um=1.0, first_row="top")
    assert np.allclose(top.heights_um, bottom.heights_um[::-1], atol=1e-6)


def test_a_stack_without_pitch_step_or_slices_is_refused(small, tmp_path):
    _, frames = small
    np.save(tmp_path / "s.npy", frames)
    np.save(tmp_path / "few.npy", frames[:3])
    np.save(tmp_path / "flat.npy", frames[0])
    for name, given, words in (
        ("s.npy", {"step_um": 1.0}, "--pitch"),
        ("s.npy", {"pitch_um": 1.0}, "--step"),
        ("few.npy", {"pitch_um": 1.0, "step_um": 1.0}, "at least 5 slices"),
        ("flat.npy", {"pitch_um": 1.0, "step_um": 1.0}, "slice, row, column"),
    ):
        with pytest.raises(FormatError, match=words):
            surface.read_stack(tmp_path / name, **given)


def test_noise_alone_is_no_stack(tmp_path):
    noise = 100 + np.random.default_rng(0).standard_normal((20, 64, 64))
    with pytest.raises(PhysicsError, match="focus stack"):
        surface.heights(surface.Stack(noise, (1.0, 1.0), 1.0))


def test_the_command_writes_the_map_and_says_what_it_holds(small, tmp_path, command):
    h, frames = small
    said = {"pitch_um": 1.5, "step_um": 0.5, "z0_um": 0.0, "synthetic": "made by a test"}
    tifffile.imwrite(tmp_path / "s.tif", frames, description=json.dumps(said), metadata=None)
    code, out, _ = command("surface", "heights", tmp_path / "s.tif", "-o", tmp_path / "m.nc", "--json")
    assert code == 0
    made = surface.read(tmp_path / "m.nc")
    assert (out["pitch_um"], out["step_um"], out["shape"], out["missing"]) == (1.5, 0.5, [48, 48], 0)
    assert out["range_um"] == pytest.approx(made.range_um) and out["range_um"] == pytest.approx(
        0.5 * np.ptp(h), abs=0.3
    )
    assert out["rms_sigma_um"] == pytest.approx(np.std(made.heights_um - 0.5 * h), rel=0.1)
    assert made.image is not None and made.reliability is not None and "synthetic" in made.attributes
    code, out, _ = command(
        "surface", "heights", tmp_path / "s.tif", "-o", tmp_path / "n.nc", "--step", "1", "--json"
    )
    assert code == 0 and out["step_um"] == 1.0


def test_a_cut_stack_or_an_unwritable_place_ends_with_code_3_and_no_file(small, tmp_path, command):
    _, frames = small
    said = json.dumps({"pitch_um": 1.5, "step_um": 0.5, "z0_um": 0.0})
    tifffile.imwrite(tmp_path / "s.tif", frames, description=said, metadata=None)
    data = (tmp_path / "s.tif").read_bytes()
    (tmp_path / "cut.tif").write_bytes(data[: len(data) // 2])
    before = sorted(p.name for p in tmp_path.iterdir())
    code, _, err = command("surface", "heights", tmp_path / "cut.tif", "-o", tmp_path / "m.nc")
    assert code == 3 and "truncated" in err
    code, _, err = command("surface", "heights", tmp_path / "s.tif", "-o", tmp_path / "no" / "m.nc")
    assert code == 3 and "does not exist" in err
    code, _, err = command("surface", "heights", tmp_path / "none.tif", "-o", tmp_path / "m.nc")
    assert code == 3 and "none.tif" in err
    assert sorted(p.name for p in tmp_path.iterdir()) == before


def test_a_wrong_option_is_wrong_usage(small, tmp_path, command):
    np.save(tmp_path / "s.npy", small[1])
    words = ("--pitch", "1", "--step", "1", "--first-row", "left")
    code, _, err = command("surface", "heights", tmp_path / "s.npy", "-o", tmp_path / "m.nc", *words)
    assert code == 2 and "first-row" in err
