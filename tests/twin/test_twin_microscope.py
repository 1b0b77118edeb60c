"""The simulated microscope: its stacks lead back to the heights they were made from."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
import tifffile
from numpy.typing import NDArray

from specularia.twin.faces import FaceTruth, make_face
from specularia.twin.microscope import FocusStack, axial_response, focus_stack, white_light, write_stack
from specularia.twin.settings import BackSettings, MapSettings, MicroscopeSettings

PITCH = 1.5


@pytest.fixture(scope="module")
def face() -> FaceTruth:
    return make_face(BackSettings(), MapSettings(pixels=256), np.random.default_rng(2))


@pytest.fixture(scope="module")
def stack(face: FaceTruth) -> FocusStack:
    return focus_stack(face.decayed_um, MicroscopeSettings(), pitch_um=PITCH, rng=np.random.default_rng(5))


def slope(heights: NDArray[np.float64]) -> NDArray[np.float64]:
    gy, gx = np.gradient(heights, PITCH)
    return np.hypot(gx, gy)


def test_brightest_slice_lies_within_a_step_of_the_true_height(face: FaceTruth, stack: FocusStack) -> None:
    z = stack.z0_um + stack.step_um * stack.slices.argmax(axis=0)
    error = z - face.decayed_um
    # Half a step of rounding, and noise on the steepest flanks, which return a few per cent of the light.
    assert np.mean(np.abs(error) <= 0.55 * stack.step_um) > 0.97
    assert np.abs(error).max() < 1.5 * stack.step_um
    assert abs(error.mean()) < 0.02


def test_range_covers_the_relief_with_the_margin(face: FaceTruth, stack: FocusStack) -> None:
    top = stack.z0_um + stack.step_um * (len(stack.slices) - 1)
    assert stack.z0_um <= face.decayed_um.min() - 6.0 < stack.z0_um + stack.step_um
    assert top - stack.step_um < face.decayed_um.max() + 6.0 <= top


def test_axial_response_has_the_set_width() -> None:
    assert axial_response(np.array([0.0, 2.5, -2.5]), fwhm_um=5.0) == pytest.approx([1.0, 0.5, 0.5], abs=1e-5)


def test_steep_flanks_are_dark_and_level_floors_bright(face: FaceTruth, stack: FocusStack) -> None:
    image = white_light(
        face.decayed_um, MicroscopeSettings(), pitch_um=PITCH, rng=np.random.default_rng(6)
    ).astype(float)
    steep = slope(face.decayed_um)
    level = image[steep < 0.05].mean()
    assert image[steep > 1.0].mean() < 0.25 * level
    # The brightest slice shows the same shading as the image that is in focus everywhere.
    assert np.corrcoef(stack.slices.max(axis=0).ravel(), image.ravel())[0, 1] > 0.98


def test_noise_is_shot_and_read_noise() -> None:
    flat = np.zeros((256, 256))
    settings = MicroscopeSettings(electrons=10000.0, read_noise_electrons=50.0)
    image = white_light(flat, settings, pitch_um=PITCH, rng=np.random.default_rng(1)).astype(float)
    counts_per_electron = 40000.0 / 10000.0
    assert image.std() == pytest.approx(counts_per_electron * np.hypot(100.0, 50.0), rel=0.02)


def test_file_carries_pitch_step_z_and_label(stack: FocusStack, tmp_path: Path) -> None:
    path = write_stack(stack, tmp_path / "s.tif", pitch_um=PITCH, label="synthetic: a test")
    with tifffile.TiffFile(path) as tiff:
        words = json.loads(tiff.pages[0].description)
        pages = tiff.asarray()
    assert (words["pitch_um"], words["step_um"], words["z0_um"]) == (PITCH, stack.step_um, stack.z0_um)
    assert "synthetic" in words["synthetic"]
    assert pages.dtype == np.uint16 and np.array_equal(pages, stack.slices)
