"""Focus stacks with planted faults, photographs through focus, work that was cut off, and large stacks."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
import warnings

import imageio.v3 as iio
import numpy as np
import pytest
import tifffile
from scipy.ndimage import gaussian_filter, map_coordinates

from specularia import surface
from specularia.errors import FormatError, PhysicsError, SpeculariaError, SpeculariaWarning
from specularia.surface import confocal, focus, measure
from specularia.surface.heightmap import FLAGS
from specularia.surface.registration import Similarity, between, chained, warped
from specularia.surface.stack import Stack

pytestmark = pytest.mark.filterwarnings("ignore::specularia.errors.SpeculariaWarning")

FWHM, SNR = 4.0, 30.0


def gauss(z, fwhm=FWHM):
    return np.exp(-4 * np.log(2) * (z / fwhm) ** 2)


def relief(pixels, amplitude=3.0):
    y, x = np.mgrid[0:pixels, 0:pixels] / pixels
    return amplitude * np.sin(2 * np.pi * 2 * x) * np.cos(2 * np.pi * y)


def confocal_stack(h, slices, *, fwhm=FWHM, snr=SNR, level=1000.0, offset=100.0, seed=0):
    rng = np.random.default_rng(seed)
    z = np.arange(slices)[:, None, None] - h
    noise = level / snr * rng.standard_normal((slices, *h.shape))
    return offset + level * gauss(z, fwhm) + noise


@pytest.mark.parametrize(
    "top", [65535, 40000]
)  # the camera's full scale, and one that no power of two gives away
def test_planted_double_peaks_dead_and_saturated_pixels_are_flagged_and_hardly_any_other(top):
    rng = np.random.default_rng(7)
    h = 12.0 + relief(128)
    frames = confocal_stack(h, 40)
    lot = rng.random(h.shape)
    double, dead, bright = lot < 0.05, (lot >= 0.05) & (lot < 0.1), (lot >= 0.1) & (lot < 0.15)
    # At a step the pixel's light is shared between two levels, 1 to 3 widths apart.
    share, apart = rng.uniform(0.35, 0.65, double.sum()), rng.uniform(1.0, 3.0, double.sum()) * FWHM
    z = np.arange(40)[:, None] - h[double]
    shared = share * gauss(z) + (1 - share) * gauss(z - apart)
    frames[:, double] = 100.0 + 1000.0 * shared + 1000.0 / SNR * rng.standard_normal(z.shape)
    stuck = rng.random(dead.sum()) < 0.5
    frames[:, dead] = np.where(stuck, 0.0, 100.0 + 33.0 * rng.standard_normal((40, dead.sum())))
    frames[:, bright] = 100.0 + (frames[:, bright] - 100.0) * rng.uniform(2.2, 6.0, bright.sum())
    frames = np.clip(np.rint(frames * top / 2000.0), 0, top).astype(np.uint16)
    made = surface.heights(Stack(frames, (1.0, 1.0), 1.0))
    for name, planted, bit in (
        ("double", double, FLAGS["double"]),
        ("dead", dead, FLAGS["dark"]),
        ("saturated", bright, FLAGS["saturated"]),
    ):
        assert np.mean(made.flags[planted] & bit > 0) >= 0.95, name
        assert not np.isfinite(made.heights_um[planted & (made.flags > 0)]).any(), name
    good = ~(double | dead | bright)
    assert np.mean(made.flags[good] > 0) <= 0.02


@pytest.mark.parametrize(("fwhm", "snr"), [(2.0, 30.0), (4.0, 6.0), (12.0, 30.0), (20.0, 100.0)])
def test_the_width_of_the_response_and_the_noise_are_found_from_narrow_to_wide_and_in_much_noise(fwhm, snr):
    h = 1.5 * fwhm + 3.0 + relief(64)
    made = surface.heights(
        Stack(confocal_stack(h, int(3 * fwhm + 8), fwhm=fwhm, snr=snr, seed=2), (1.0, 1.0), 1.0)
    )
    said = json.loads(made.attributes["parameters"])
    assert said["response_fwhm_um"] == pytest.approx(fwhm, rel=0.05)
    assert np.sqrt(said["noise_floor"]) == pytest.approx(1000.0 / snr, rel=0.1)
    known = made.valid
    error = (made.heights_um - h)[known]
    assert known.mean() > 0.7
    assert np.sqrt(np.mean(error**2)) <= 1.2 * focus.cramer_rao(snr=snr, fwhm=fwhm)
    assert abs(error.mean()) <= 0.01 + 4 * error.std() / np.sqrt(error.size)


def test_a_pixel_that_spans_the_response_is_steep_and_the_flat_ones_beside_a_step_are_not():
    x = np.arange(60)[None, :] + np.zeros((40, 1))
    h = 8.0 + np.where(x < 20, 0.0, np.where(x < 30, 2.6 * (x - 19), 26.0))
    h[:, 45:] = 10.0  # a step of 24 slices in one go
    made = surface.heights(Stack(confocal_stack(h, 50), (1.0, 1.0), 1.0))
    steep = (made.flags & FLAGS["steep"]) > 0
    assert steep[:, 20:29].all() and not steep[:, 31:].any() and not steep[:, :19].any()
    assert np.isfinite(made.heights_um[steep]).all()
    wide = surface.heights(Stack(confocal_stack(h, 50), (1.0, 1.0), 1.0), max_slope_deg=75.0)
    assert not (wide.flags & FLAGS["steep"]).any()


def test_flags_come_back_from_a_file_with_their_meaning(tmp_path):
    import xarray as xr

    flags = np.array([[0, 1], [8, 16]], np.uint8)
    given = surface.HeightMap(np.array([[0.0, np.nan], [np.nan, 2.0]]), 1.0, 1.0, flags=flags)
    assert np.array_equal(surface.read(surface.write(given, tmp_path / "a.nc")).flags, flags)
    with xr.open_dataset(tmp_path / "a.nc", engine="h5netcdf") as stored:
        assert stored["flags"].attrs["flag_meanings"].split() == list(FLAGS)


def test_tilt_bow_and_vibration_are_taken_off_each_on_request():
    rng = np.random.default_rng(3)
    y, x = np.mgrid[0:80, 0:120] * 1.0
    rough = 0.2 * np.sin(0.9 * x) * np.sin(0.7 * y)
    tilt, bow = 0.05 * x - 0.03 * y, 2e-4 * (x - 59.5) ** 2 + 3e-4 * (y - 39.5) ** 2
    shake = 0.5 * rng.standard_normal(80)[:, None] + 0 * x
    for wanted, added in (("tilt", tilt), ("bow", bow)):
        made = surface.flattened(surface.HeightMap(rough + added, 1.0, 1.0), remove=[wanted])
        plain = surface.flattened(surface.HeightMap(rough, 1.0, 1.0), remove=[wanted])
        left = made.heights_um - plain.heights_um
        assert np.ptp(left) < 1e-9 and wanted in made.attributes["removed"]
    made = surface.flattened(surface.HeightMap(rough + shake, 1.0, 1.0), remove=["vibration"])
    left = made.heights_um - rough
    assert np.std(left) < 0.25 * np.std(shake)
    # What is smooth from row to row is relief and stays.
    smooth = surface.HeightMap(tilt + bow, 1.0, 1.0)
    assert np.abs(surface.flattened(smooth, remove=["vibration"]).heights_um - (tilt + bow)).max() < 0.02
    with pytest.raises(SpeculariaError, match="cannot remove sparkle"):
        surface.flattened(smooth, remove=["sparkle"])


def test_slices_that_vibrated_are_put_in_their_places_and_steady_ones_stay():
    h = 12.0 + relief(96, amplitude=4.0)
    shake = 0.4 * np.sin(2 * np.pi * np.arange(26) / 5.3)
    bound = focus.cramer_rao(snr=SNR, fwhm=FWHM)
    for shaken, remove, least, most in (
        (shake, (), 2.0, 9.0),
        (shake, ("vibration",), 0.9, 1.25),
        (0 * shake, ("vibration",), 0.9, 1.15),
    ):
        rng = np.random.default_rng(11)
        z = (np.arange(26) + shaken)[:, None, None] - h
        frames = 100.0 + 1000.0 * gauss(z) + 1000.0 / SNR * rng.standard_normal(z.shape)
        pilot = confocal.learn(Stack(frames, (1.0, 1.0), 1.0), vibration=bool(remove))
        place = confocal.rows_of(frames.reshape(26, -1).astype(np.float32), pilot)["place"]
        # The stack leaves offset and step of the heights open.
        known = np.isfinite(place)
        assert known.mean() > 0.9
        place, true = place[known], h.ravel()[known]
        error = place - np.polyval(np.polyfit(true, place, 1), true)
        assert least * bound < error.std() < most * bound


def test_a_stack_is_flattened_on_the_way(tmp_path, command):
    h = 12.0 + relief(64) + 0.05 * np.arange(64)
    np.save(tmp_path / "s.npy", np.rint(20 * confocal_stack(h, 28)).clip(0, 60000).astype(np.uint16))
    words = ("surface", "heights", tmp_path / "s.npy", "--pitch", "1", "--step", "1", "--json")
    picture = tmp_path / "p.png"
    code, out, _ = command(*words, "-o", tmp_path / "m.nc", "--remove", "tilt,bow", "--picture", picture)
    shown = np.asarray(iio.imread(picture))
    assert shown.dtype == np.uint16
    assert np.allclose(shown[::-1], surface.read(tmp_path / "m.nc").image, atol=0.51)
    assert (
        code == 0 and "tilt" in out["removed"] and "bow" in out["removed"] and out["flagged"]["double"] == 0
    )
    along = surface.read(tmp_path / "m.nc").heights_um.mean(axis=0)
    assert abs(np.polyfit(np.arange(64), along, 1)[0]) < 1e-3
    code, _, err = command(*words, "-o", tmp_path / "n.nc", "--remove", "sparkle")
    assert code == 2 and "sparkle" in err


# -- work that was cut off ---------------------------------------------------------------------------------


def test_a_killed_reconstruction_goes_on_where_it_was_and_ends_with_the_same_bits(tmp_path, monkeypatch):
    h = 12.0 + relief(100)
    np.save(tmp_path / "s.npy", np.rint(20 * confocal_stack(h, 40)).clip(0, 60000).astype(np.uint16))
    script = (
        "import sys, time\n"
        "from specularia import surface\n"
        "from specularia.surface import confocal, measure\n"
        "measure._TILE_BYTES = 4 * 40 * 100\n"
        "real = confocal.rows_of\n"
        "def slow(part, pilot):\n    time.sleep(0.05)\n    return real(part, pilot)\n"
        "confocal.rows_of = slow\n"
        "surface.heights(sys.argv[1], pitch_um=1.0, step_um=1.0, output=sys.argv[2])\n"
    )
    out = tmp_path / "m.nc"
    running = subprocess.Popen([sys.executable, "-c", script, str(tmp_path / "s.npy"), str(out)])
    try:
        done = 0
        for _ in range(600):
            time.sleep(0.05)
            for folder in tmp_path.glob("m.nc.*.partial"):
                if (folder / "ready.json").is_file():
                    done = int(np.load(folder / "done.npy").sum())
            if done >= 5 or running.poll() is not None:
                break
        assert running.poll() is None and 5 <= done < 100
    finally:
        os.kill(running.pid, signal.SIGKILL)
        running.wait()
    assert not out.exists()
    seen = []
    real = confocal.rows_of
    monkeypatch.setattr(measure, "_TILE_BYTES", 4 * 40 * 100)
    monkeypatch.setattr(confocal, "rows_of", lambda part, pilot: seen.append(1) or real(part, pilot))
    resumed = surface.heights(tmp_path / "s.npy", pitch_um=1.0, step_um=1.0, output=out)
    assert 0 < len(seen) <= 100 - done
    whole = surface.heights(tmp_path / "s.npy", pitch_um=1.0, step_um=1.0)
    for name in ("heights_um", "sigma_um", "image", "reliability", "flags"):
        assert np.array_equal(getattr(resumed, name), getattr(whole, name), equal_nan=True), name
    assert sorted(p.name for p in tmp_path.iterdir()) == ["m.nc", "s.npy"]


def test_other_settings_do_not_take_over_what_is_there(tmp_path, monkeypatch):
    h = 12.0 + relief(64)
    np.save(tmp_path / "s.npy", confocal_stack(h, 28))
    monkeypatch.setattr(measure, "_TILE_BYTES", 4 * 28 * 64 * 8)
    real, calls = confocal.rows_of, []

    def cut(part, pilot):
        calls.append(1)
        if len(calls) == 3:
            raise KeyboardInterrupt
        return real(part, pilot)

    monkeypatch.setattr(confocal, "rows_of", cut)
    with pytest.raises(KeyboardInterrupt):
        surface.heights(tmp_path / "s.npy", pitch_um=1.0, step_um=1.0, output=tmp_path / "m.nc")
    assert len(list(tmp_path.glob("m.nc.*.partial"))) == 1
    doubled = surface.heights(tmp_path / "s.npy", pitch_um=1.0, step_um=2.0, output=tmp_path / "m.nc")
    assert len(calls) == 3 + 8 and np.nanmax(doubled.heights_um) > 24.0


def test_no_more_is_read_at_a_time_than_a_tile_a_slice_or_the_sample(monkeypatch):
    frames = confocal_stack(60.0 + relief(96), 120).astype(np.float32)
    monkeypatch.setattr(measure, "_TILE_BYTES", 4 * 120 * 96 * 3)
    monkeypatch.setattr(confocal, "_PILOT_BYTES", 4 * 120 * 96 * 5)
    largest, released = [0, 0], []
    rows, frame, release = Stack.rows, Stack.frame, Stack.release

    def watched(k, real):
        def read(self, *where):
            part = real(self, *where)
            largest[k] = max(largest[k], part.nbytes)
            return part

        return read

    monkeypatch.setattr(Stack, "rows", watched(0, rows))
    monkeypatch.setattr(Stack, "frame", watched(1, frame))
    monkeypatch.setattr(Stack, "release", lambda self: released.append(1) or release(self))
    surface.heights(Stack(frames, (1.0, 1.0), 1.0), kind="confocal")
    assert largest[0] <= 4 * 120 * 96 * 3 and largest[1] <= 4 * 96 * 96
    assert len(released) >= 96 // 3 + 120


def test_memory_of_mapped_frames_is_given_back_and_their_numbers_stay(tmp_path):
    np.save(tmp_path / "s.npy", np.arange(24.0).reshape(6, 2, 2))
    taken = surface.read_stack(tmp_path / "s.npy", pitch_um=1.0, step_um=1.0, first_row="top")
    before = np.array(taken.frames)
    taken.release()
    assert np.array_equal(taken.frames, before)
    private = Stack(np.load(tmp_path / "s.npy", mmap_mode="c"), (1.0, 1.0), 1.0)
    private.frames[0, 0, 0] = 99.0
    private.release()
    assert private.frames[0, 0, 0] == 99.0


# -- photographs -------------------------------------------------------------------------------------------


def photographs(pixels=192, slices=11, breathing=0.004, shake=1.7, seed=0):
    """(heights in slices, texture, frames): the middle frame is neither shifted nor magnified."""
    rng = np.random.default_rng(seed)
    y, x = np.mgrid[0:pixels, 0:pixels] / pixels
    h = slices / 2 - 0.5 + (slices / 2 - 3) * np.sin(2 * np.pi * x) * np.cos(np.pi * y)
    fine = gaussian_filter(rng.standard_normal((pixels, pixels)), 0.8)
    texture = 128.0 + 25.0 * (
        fine / fine.std() + 7.0 * gaussian_filter(rng.standard_normal((pixels, pixels)), 4)
    )
    blurs = np.linspace(0.0, 6.0, 31)
    bank = np.stack([gaussian_filter(texture, b) for b in blurs])
    row, column = np.mgrid[0:pixels, 0:pixels]
    middle, frames = (pixels - 1) / 2, []
    for k in range(slices):
        blurred = map_coordinates(bank, [np.clip(np.abs(k - h) * 5.0, 0, 30), row, column], order=1)
        m = 1 + breathing * (k - slices // 2)
        dx, dy = shake * np.sin(k - slices // 2), shake * (np.cos(k - slices // 2) - 1)
        seen = [(row - middle - dy) / m + middle, (column - middle - dx) / m + middle]
        frame = map_coordinates(blurred, seen, order=3, mode="nearest")
        frames.append(np.clip(np.rint(frame + rng.standard_normal(frame.shape)), 0, 255))
    return h, texture, np.array(frames, np.uint8)


@pytest.fixture(scope="module")
def shaken():
    return photographs()


def test_photographs_are_told_from_confocal_slices_and_give_heights_and_a_picture(shaken):
    h, texture, frames = shaken
    made = surface.heights(Stack(frames, (1.0, 1.0), 0.5))
    said = json.loads(made.attributes["parameters"])
    assert said["kind"] == "contrast"
    inner = np.zeros(h.shape, bool)
    inner[10:-10, 10:-10] = True
    known = inner & made.valid
    error = (made.heights_um - 0.5 * h)[known]
    assert known.sum() > 0.97 * inner.sum()
    assert error.std() < 0.06 and abs(error.mean()) < 0.02  # um; argmax would have 0.5 / sqrt(12) = 0.144
    assert np.mean(np.abs(error) < 1.96 * made.sigma_um[known]) > 0.93
    assert np.corrcoef(made.image[inner], texture[inner])[0, 1] > 0.98
    assert said["magnification"] == pytest.approx([1 + 0.004 * (k - 5) for k in range(11)], abs=4e-4)


def test_frames_that_lie_over_each_other_as_they_are_stay_there(shaken):
    _, texture, frames = shaken
    still, kind = surface.all_in_focus(Stack(frames, (1.0, 1.0), 1.0), register=False)
    moved, _ = surface.all_in_focus(Stack(frames, (1.0, 1.0), 1.0))
    inner = (slice(10, -10), slice(10, -10))
    quality = [np.corrcoef(p[inner].ravel(), texture[inner].ravel())[0, 1] for p in (still, moved)]
    assert kind == "uint8" and quality[0] < 0.9 < 0.98 < quality[1]


def test_a_similarity_is_found_and_chained_to_a_hundredth_of_a_pixel():
    image = gaussian_filter(np.random.default_rng(1).standard_normal((200, 240)), 2.0).astype(np.float32)
    true = Similarity(a=0.013, b=-0.004, dx=3.3, dy=-2.1)
    # The frame in which what the reference shows at x lies at true(x).
    frame = warped(image, true.inverse())
    found = between(image, (0.8 * frame + 3.0).astype(np.float32))
    assert (found.a, found.b) == pytest.approx((true.a, true.b), abs=2e-4)
    assert (found.dx, found.dy) == pytest.approx((true.dx, true.dy), abs=0.02)
    assert found.gain == pytest.approx(1 / 0.8, rel=0.02) or found.gain == pytest.approx(0.8, rel=0.02)
    places = chained([true, true], 1)
    assert places[1] == Similarity()
    back = places[0].after(true)
    assert abs(complex(back.a, back.b)) < 1e-12 and abs(complex(back.dx, back.dy)) < 1e-12


def thirds(file):
    """A picture of a third of the size, to save time."""
    return np.asarray(iio.imread(file), float)[:1536, :2046].reshape(512, 3, 682, 3, 3).mean(axis=(1, 3))


def test_the_picture_in_focus_is_that_of_another_program(shared_data, tmp_path, command):
    frames = sorted((shared_data / "focus_stack").glob("pcb_*.jpg"))
    (tmp_path / "pcb").mkdir()
    for file in frames:
        iio.imwrite(tmp_path / "pcb" / file.with_suffix(".png").name, thirds(file).astype(np.uint8))
    expected = thirds(shared_data / "focus_stack" / "expected.jpg")
    code, out, _ = command("surface", "picture", tmp_path / "pcb", "-o", tmp_path / "p.png", "--json")
    assert code == 0 and out["shape"] == [512, 682, 3] and out["type"] == "uint8"
    found = np.asarray(iio.imread(tmp_path / "p.png"), float)
    assert np.corrcoef(found.ravel(), expected.ravel())[0, 1] >= 0.95


# -- files -------------------------------------------------------------------------------------------------


def test_pictures_that_are_not_of_the_series_are_left_out_and_named(tmp_path):
    for k in range(6):
        iio.imwrite(tmp_path / f"z_{k}.png", np.full((8, 8), 10 * k, np.uint8))
    iio.imwrite(tmp_path / "overview.png", np.zeros((50, 50), np.uint8))
    with pytest.warns(SpeculariaWarning, match=r"overview\.png left out"):
        taken = surface.read_stack(tmp_path, pitch_um=1.0, step_um=1.0, first_row="bottom")
    assert taken.frames[:, 0, 0].tolist() == [0, 10, 20, 30, 40, 50]
    for k in range(6):
        iio.imwrite(tmp_path / f"other{k}.png", np.full((8, 8), k, np.uint8))
    with pytest.raises(FormatError, match="several series"):
        surface.read_stack(tmp_path, pitch_um=1.0, step_um=1.0)


def test_an_ome_tiff_with_channels_or_times_is_refused_with_what_to_do(tmp_path):
    frames = np.zeros((2, 6, 16, 16), np.uint16)
    tifffile.imwrite(tmp_path / "c.ome.tif", frames, metadata={"axes": "CZYX", "PhysicalSizeX": 1.0})
    with pytest.raises(FormatError, match="one channel"):
        surface.read_stack(tmp_path / "c.ome.tif", pitch_um=1.0, step_um=1.0)


def test_brightness_that_is_no_number_and_wrong_settings_are_refused():
    frames = confocal_stack(12.0 + relief(32), 28)
    for kwargs, words in (
        ({"kind": "acoustic"}, "kind 'acoustic'"),
        ({"remove": ["dust"]}, "cannot remove dust"),
        ({"max_slope_deg": 95.0}, "between 0 and 90"),
        ({"window_px": 0.0}, "window"),
    ):
        with pytest.raises(SpeculariaError, match=words):
            surface.heights(Stack(frames, (1.0, 1.0), 1.0), **kwargs)
    frames[3, 5, 5] = np.nan
    with pytest.raises(PhysicsError, match="not a number in slice 4"), warnings.catch_warnings():
        surface.heights(Stack(frames, (1.0, 1.0), 1.0), kind="confocal")
