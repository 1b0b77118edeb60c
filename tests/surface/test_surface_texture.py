"""Texture parameters, spectra and levelling against closed forms and against other programs on real maps."""

from __future__ import annotations

import json

import numpy as np
import pytest
from scipy import stats

from specularia import surface
from specularia.errors import PhysicsError, SpeculariaError
from specularia.surface.texture import material_ratio

pytestmark = pytest.mark.filterwarnings("ignore::specularia.errors.SpeculariaWarning")

REAL = ("st_al3d-1.al3d", "st_nms-1.nms", "st_opd-1.opd", "st_plu-1.plu", "st_sur-2.sur", "st_x3p-2.x3p")


def sinusoid(amplitude=0.8, waves=8, pixels=512, pitch=0.7, turn=False):
    z = np.tile(amplitude * np.cos(2 * np.pi * waves * (np.arange(pixels) + 0.5) / pixels), (pixels // 4, 1))
    return surface.HeightMap(z.T if turn else z, pitch, pitch)


def test_a_sinusoid_has_its_closed_forms():
    given = sinusoid()
    wavelength, a = given.field_um[0] / 8, 0.8
    t = surface.texture(given)
    assert t.Sa_um == pytest.approx(2 * a / np.pi, rel=1e-3)
    assert t.Sq_um == pytest.approx(a / np.sqrt(2), rel=1e-3)
    assert t.Sdq == pytest.approx(np.sqrt(2) * np.pi * a / wavelength, rel=1e-3)
    assert (t.Ssk, t.Sku) == (pytest.approx(0.0, abs=1e-3), pytest.approx(1.5, rel=1e-3))
    assert t.Sz_um == pytest.approx(2 * a, rel=5e-3) and t.Sp_um == pytest.approx(t.Sv_um, rel=1e-6)
    x = np.linspace(0, 2 * np.pi, 20001)
    area = np.mean(np.sqrt(1 + (2 * np.pi * a / wavelength * np.sin(x[:-1])) ** 2)) - 1
    assert t.Sdr == pytest.approx(area, rel=1e-3)
    # Its autocorrelation is a cosine (over eight waves within 2 %); along the lay it never falls.
    assert t.spacing.Sal_um == pytest.approx(np.arccos(0.2) / (2 * np.pi) * wavelength, rel=0.02)
    assert t.spacing.bounded and t.spacing.Str < 0.25
    assert t.spacing.Std_deg == pytest.approx(90.0, abs=1.0)
    assert surface.texture(sinusoid(turn=True)).spacing.Std_deg in (0.0, 1.0, 179.0)


def test_the_lay_is_found_at_any_angle_on_pixels_that_are_not_square():
    y, x = np.mgrid[0:300, 0:200]
    dx, dy = 0.5, 0.8
    for lay in (30.0, 110.0):
        across = np.radians(lay + 90.0)
        z = np.sin(2 * np.pi * (x * dx * np.cos(across) + y * dy * np.sin(across)) / 9.0)
        z += 0.05 * np.random.default_rng(0).standard_normal(z.shape)
        found = surface.texture(surface.HeightMap(z, dx, dy)).spacing
        assert found.Std_deg == pytest.approx(lay, abs=2.0)


def test_the_ratio_curve_of_known_distributions_has_its_closed_forms():
    even = np.random.default_rng(1).permutation(np.linspace(-1.0, 1.0, 200_001))
    r = material_ratio(even)
    # The curve is a straight line from 1 to -1: no peaks, no valleys; volumes are its triangles.
    assert r.Sk_um == pytest.approx(2.0, rel=1e-3)
    assert max(r.Spk_um, r.Svk_um) < 2e-3 and r.Smr1 < 2e-3 and r.Smr2 > 0.998
    assert r.Vmp_um == pytest.approx(0.1**2, rel=2e-3) and r.Vvv_um == pytest.approx(0.2**2, rel=2e-3)
    assert r.Vmc_um == pytest.approx(0.8**2 - 0.1**2, rel=2e-3)
    assert r.Vvc_um == pytest.approx(0.9**2 - 0.2**2, rel=2e-3)
    # Normal heights: the steepest secant over 40 % lies in the middle, between the quantiles 0.3 and 0.7.
    normal = stats.norm.ppf((np.arange(400_000) + 0.5) / 400_000)
    r = material_ratio(normal)
    core = (stats.norm.ppf(0.7) - stats.norm.ppf(0.3)) / 0.4
    assert r.Sk_um == pytest.approx(core, rel=2e-3)
    upper = stats.norm.sf(core / 2)
    assert r.Smr1 == pytest.approx(upper, abs=2e-3) and r.Smr2 == pytest.approx(1 - upper, abs=2e-3)
    peaks = stats.norm.pdf(core / 2) - core / 2 * upper
    assert r.Spk_um == pytest.approx(2 * peaks / upper, rel=0.01)
    assert r.Svk_um == pytest.approx(r.Spk_um, rel=0.01)


def test_spectra_hold_the_mean_square_height_and_a_wave_stands_at_its_frequency():
    given = sinusoid(pixels=512)
    for window in ("hann", "none"):
        s = surface.power_spectrum(given, window=window)
        step = s.x_per_um[1] - s.x_per_um[0]
        assert np.sum(s.x_um3) * step == pytest.approx(0.8**2 / 2, rel=2e-3)
        assert s.x_per_um[np.argmax(s.x_um3)] == pytest.approx(8 / given.field_um[0], rel=1e-6)
    noise = surface.HeightMap(np.random.default_rng(2).standard_normal((256, 256)), 0.5, 0.5)
    s = surface.power_spectrum(noise)
    # White noise of variance 1 has the density dx dy at all frequencies, 2 dx (one-sided) along a line.
    assert np.mean(s.radial_um4[5:]) == pytest.approx(0.25, rel=0.03)
    assert np.mean(s.x_um3) == pytest.approx(1.0, rel=0.03) and np.mean(s.y_um3) == pytest.approx(
        1.0, rel=0.03
    )


def test_levelling_takes_off_its_form_and_pits_do_not_draw_a_robust_one():
    y, x = np.mgrid[0:90, 0:120]
    u, v = x / 60.0 - 1, y / 45.0 - 1
    form = 3 + 2 * u - v + 0.7 * u * u - 0.4 * u * v + 0.2 * v**3
    z = form.copy()
    z[10:20, 30:50] = np.nan
    flat = surface.levelled(surface.HeightMap(z, 1.0, 2.0), method="polynomial", order=3)
    assert np.nanmax(np.abs(flat.heights_um)) < 1e-10 and np.array_equal(flat.valid, np.isfinite(z))
    rng = np.random.default_rng(3)
    pits = (rng.random(z.shape) < 0.3) & (x > 60)
    pitted = form + 0.01 * rng.standard_normal(z.shape) - 5.0 * pits
    plain = surface.levelled(surface.HeightMap(pitted, 1.0, 2.0), method="polynomial", order=3)
    robust = surface.levelled(surface.HeightMap(pitted, 1.0, 2.0), method="robust", order=3)
    assert np.abs(robust.heights_um[~pits]).max() < 0.1 < 0.5 < np.abs(plain.heights_um[~pits]).max()
    assert "robust polynomial of degree 3" in robust.attributes["levelled"]
    with pytest.raises(SpeculariaError, match="levelling 'spline'"):
        surface.levelled(flat, method="spline")
    with pytest.raises(PhysicsError, match="too few"):
        surface.levelled(surface.HeightMap(np.eye(3), 1.0, 1.0), method="polynomial", order=4)


def test_slopes_of_a_cone_are_one_angle_to_all_sides():
    y, x = np.mgrid[-60:61, -60:61]
    r = np.hypot(x, y)
    cone = surface.HeightMap(np.where(r < 60, -0.5 * r, np.nan), 1.0, 1.0)
    s = surface.texture(cone, method="none").slope
    assert s.median_deg == pytest.approx(np.degrees(np.arctan(0.5)), abs=0.3)
    assert s.azimuth_share.sum() == pytest.approx(1.0)
    assert s.azimuth_share == pytest.approx(np.full(36, 1 / 36), rel=0.2)


@pytest.mark.parametrize("name", REAL)
def test_parameters_of_a_real_map_are_those_of_another_library(shared_data, name):
    from SurfaceTopography import Topography

    flat = surface.level(surface.read(shared_data / "surface" / name))
    t = surface.texture(flat, method="none")
    z = flat.heights_um[flat.valid]
    assert (t.Ssk, t.Sku) == pytest.approx((stats.skew(z), stats.kurtosis(z, fisher=False)), rel=1e-6)
    peer = Topography(np.ma.masked_invalid(flat.heights_um.T), flat.field_um, unit="um")
    if flat.missing == 0:
        assert peer.rms_height_from_area() == pytest.approx(t.Sq_um, rel=1e-9)
        assert np.mean(np.abs(peer.heights())) == pytest.approx(t.Sa_um, rel=1e-9)
        # Its slopes are differences between neighbours; ours a smooth formula. Both agree on differences.
        whole = peer.rms_gradient()
        dx, dy = (
            np.diff(flat.heights_um, axis=k) / p for k, p in ((1, flat.pitch_x_um), (0, flat.pitch_y_um))
        )
        assert whole == pytest.approx(np.sqrt(np.mean(dx**2) + np.mean(dy**2)), rel=2e-2)
        # Its spectrum of profiles runs over 2 pi / wavelength and is two-sided, so half as high as ours.
        q, power = peer.power_spectrum_from_profile(window="hann", resampling_method=None)[:2]
        ours = surface.power_spectrum(flat)
        use = slice(2, ours.x_per_um.size - 2)
        theirs = np.interp(2 * np.pi * ours.x_per_um, q[1:], power[1:])
        assert np.median(2.0 * theirs[use] / ours.x_um3[use]) == pytest.approx(1.0, rel=0.05)
    bearing = np.array([float(peer.bearing_area(t.ratio.height_um[k])) for k in (1000, 5000, 8000)])
    if flat.missing == 0:
        assert bearing == pytest.approx([0.1, 0.5, 0.8], abs=0.01)


def test_the_command_writes_parameters_and_figures_each_with_its_numbers(tmp_path, command):
    rng = np.random.default_rng(4)
    np.save(tmp_path / "m.npy", rng.standard_normal((64, 80)))
    words = ("surface", "texture", tmp_path / "m.npy", "--pitch", "2")
    code, out, _ = command(*words, "-o", tmp_path / "out", "--level", "robust:2", "--json")
    assert code == 0 and out["levelling"] == "robust:2"
    names = (
        "Sa_um Sq_um Ssk Sku Sp_um Sv_um Sz_um Sdq Sdr Sal_um Str Std_deg Sk_um Spk_um Vvv_um slope_p90_deg"
    )
    for key in names.split(" "):
        assert isinstance(out[key], float), key
    stored = json.loads((tmp_path / "out" / "parameters.json").read_text())
    assert stored["Sq_um"] == out["Sq_um"] == pytest.approx(1.0, abs=0.05)
    pictures = sorted(p.stem for p in (tmp_path / "out").glob("*.png"))
    assert pictures == ["abbott_curve", "directions", "heights", "power_spectrum", "relief", "slopes"]
    for name in pictures:
        assert any((tmp_path / "out" / f"{name}{suffix}").exists() for suffix in (".csv", ".npz")), name
    code, _, err = command(*words, "--level", "spline")
    assert code == 2 and "spline" in err


def test_a_profile_and_a_flat_map_have_the_parameters_that_they_can_have(tmp_path):
    line = surface.HeightMap(np.sin(np.arange(200.0) / 7.0)[None, :], 1.0, float("nan"))
    t = surface.texture(line)
    assert t.spacing is None and t.Sq_um == pytest.approx(np.sqrt(0.5), rel=0.05) and np.isfinite(t.Sdr)
    assert t.payload()["Sal_um"] is None
    flat = surface.texture(surface.HeightMap(np.zeros((20, 20)), 1.0, 1.0))
    assert flat.Sq_um == 0.0 and np.isnan(flat.Ssk) and flat.spacing is None
