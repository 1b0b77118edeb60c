"""Transmission and lobe width over the cut-off of a relief."""

from __future__ import annotations

import numpy as np
import pytest

from specularia import analysis, glass, surface
from specularia.analysis.cutoff import low_pass, short_wave_share

PITCH = 1.5


def waves(*, long_slope, short_slope, pixels=128):
    """A map with two sines along x, of 96 and 6 um, of given rms slopes."""
    x = np.arange(pixels) * PITCH
    z = sum(
        s * np.sqrt(2.0) * L / (2 * np.pi) * np.cos(2 * np.pi * x / L)
        for s, L in ((long_slope, 96), (short_slope, 6))
    )
    return surface.HeightMap(np.broadcast_to(z, (pixels, pixels)), PITCH, PITCH)


def test_the_share_of_slope_variance_beyond_a_wave_is_that_of_the_shorter_sine():
    share = short_wave_share(waves(long_slope=0.03, short_slope=0.04), np.array([0.0, 3.0, 30.0, 1e4]))
    assert share == pytest.approx([0.0, 0.0, 0.64, 1.0], abs=0.03)


def test_the_low_pass_halves_waves_as_long_as_its_cut_off():
    m = waves(long_slope=0.03, short_slope=0.0, pixels=512)
    inner = np.s_[200:300, 200:300]  # away from the border, where the mirror image makes another wave
    halved = low_pass(m, 96.0).heights_um[inner]
    assert np.ptp(halved) == pytest.approx(0.5 * np.ptp(m.heights_um[inner]), rel=0.01)


def test_the_lobe_of_a_normal_slope_distribution_has_the_width_of_a_thin_prism():
    rng = np.random.default_rng(1)
    k = np.fft.fftfreq(256)
    white = np.fft.fft2(rng.standard_normal((256, 256)))
    h = np.fft.ifft2(white * np.exp(-((k[:, None] ** 2 + k[None, :] ** 2) * 2 * (np.pi * 5) ** 2))).real
    gx = (np.roll(h, -1, 1) - np.roll(h, 1, 1)) / (2 * PITCH)
    h *= 0.02 / gx.std()
    slab = glass.Slab(
        thickness_mm=3.0,
        medium=glass.Medium(index=1.52, absorption_per_mm=0.0),
        front=glass.Face(h, PITCH, PITCH),
        back=glass.Face.flat("back"),
    )
    lobe = analysis.lobe_width(glass.trace_paths(slab, theta_deg=0.0, paths=100_000, seed=1), 0.0)
    expected = 2.3548 * np.degrees(0.52 * 0.02)
    assert np.mean([lobe.fwhm_deg, lobe.across_deg]) == pytest.approx(expected, rel=0.1)


def test_the_command_says_where_rays_end_and_saves_figure_and_numbers(tmp_path, command):
    path = surface.write(waves(long_slope=0.02, short_slope=0.05), tmp_path / "m.nc")
    code, out, _ = command(
        "surface",
        "cutoff",
        path,
        "-o",
        tmp_path / "c",
        "--cutoffs",
        "2,30",
        "--theta",
        "0",
        "--paths",
        "4000",
        "--json",
    )
    assert code == 0
    assert (
        out["cutoff_um"] == [0.0, 2.0, 30.0]
        and out["limit_um"] == 3.0
        and out["valid"] == [False, False, True]
    )
    assert out["Sdq"][2][0] < 0.5 * out["Sdq"][0][0] and out["fwhm_deg"][2][0] < out["fwhm_deg"][0][0]
    assert (tmp_path / "c" / "cutoff.png").exists()
    assert (tmp_path / "c" / "cutoff.csv").read_text().count("\n") == 4
