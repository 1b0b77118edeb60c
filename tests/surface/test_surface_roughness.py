"""Levelling, roughness and the filling of missing pixels against closed forms."""

from __future__ import annotations

import numpy as np
import pytest

from specularia import surface
from specularia.errors import PhysicsError, SpeculariaError
from specularia.surface.inpaint import soap_film


def sinusoid(*, amplitude, waves, pixels=512, pitch_x=0.7, pitch_y=0.7):
    x = (np.arange(pixels) + 0.5) / pixels
    z = amplitude * np.cos(2 * np.pi * waves * x)
    return surface.HeightMap(np.tile(z, (pixels // 4, 1)), pitch_x, pitch_y)


@pytest.mark.parametrize(("amplitude", "waves"), [(0.5, 8), (3.0, 20), (0.02, 30)])
def test_a_sinusoid_has_its_closed_form_sa_sq_and_sdq(amplitude, waves):
    given = sinusoid(amplitude=amplitude, waves=waves)
    wavelength = given.field_um[0] / waves
    found = surface.roughness(given)
    assert found.Sa_um == pytest.approx(2 * amplitude / np.pi, rel=1e-3)
    assert found.Sq_um == pytest.approx(amplitude / np.sqrt(2), rel=1e-3)
    assert found.Sdq == pytest.approx(np.sqrt(2) * np.pi * amplitude / wavelength, rel=1e-3)


def test_crossed_waves_add_their_squared_slopes_on_pixels_that_are_not_square():
    y, x = np.mgrid[0:256, 0:256] + 0.5
    z = 0.3 * np.cos(2 * np.pi * 8 * x / 256) + 0.8 * np.cos(2 * np.pi * 6 * y / 256)
    found = surface.roughness(surface.HeightMap(z, 0.5, 1.25))
    kx, ky = 2 * np.pi * 8 / (256 * 0.5), 2 * np.pi * 6 / (256 * 1.25)
    assert found.Sdq == pytest.approx(np.sqrt((0.3 * kx) ** 2 / 2 + (0.8 * ky) ** 2 / 2), rel=1e-3)


def test_roughness_does_not_feel_a_tilt_and_scales_with_the_heights():
    rng = np.random.default_rng(5)
    z = rng.normal(size=(40, 60))
    tilt = 7.0 + 0.3 * np.arange(60)[None, :] - 0.1 * np.arange(40)[:, None]
    flat, tilted = (surface.roughness(surface.HeightMap(a, 1.0, 2.0)) for a in (z, z + tilt))
    triple = surface.roughness(surface.HeightMap(3 * z + tilt, 1.0, 2.0))
    for key in ("Sa_um", "Sq_um", "Sdq"):
        assert getattr(tilted, key) == pytest.approx(getattr(flat, key), rel=1e-9)
        assert getattr(triple, key) == pytest.approx(3 * getattr(flat, key), rel=1e-9)


def test_a_plane_levels_to_zero_with_pixels_missing():
    z = 3.0 - 0.2 * np.arange(30)[None, :] + 0.4 * np.arange(20)[:, None]
    z[4:9, 3:20] = np.nan
    flat = surface.level(surface.HeightMap(z, 2.0, 0.5))
    assert np.array_equal(np.isnan(flat.heights_um), np.isnan(z))
    assert np.nanmax(np.abs(flat.heights_um)) < 1e-12
    assert "slope x -0.1" in flat.attributes["levelled"] and "slope y 0.8" in flat.attributes["levelled"]


def test_a_map_without_a_plane_says_so():
    z = np.full((5, 5), np.nan)
    z[2, :] = 1.0
    with pytest.raises(PhysicsError, match="one line"):
        surface.level(surface.HeightMap(z, 1.0, 1.0))


def test_slopes_next_to_a_missing_pixel_are_missing_and_others_exact_for_a_plane():
    z = 0.25 * np.arange(12.0)[None, :] + np.zeros((9, 1))
    z[4, 6] = np.nan
    dx, dy = surface.slopes(surface.HeightMap(z, 0.5, 0.5))
    assert np.array_equal(np.argwhere(np.isnan(dx)), [[4, 5], [4, 7]])
    assert np.allclose(dx[np.isfinite(dx)], 0.5) and np.allclose(dy[np.isfinite(dy)], 0.0)


def test_a_soap_film_keeps_the_measured_pixels_and_a_plane_across_the_hole():
    y, x = np.mgrid[0:40, 0:50]
    plane = 1.0 + 0.3 * x * 2.0 - 0.7 * y * 0.5
    z = plane.copy()
    z[10:25, 12:40] = np.nan
    film = soap_film(z, pitch_x=2.0, pitch_y=0.5)
    assert np.array_equal(film[np.isfinite(z)], z[np.isfinite(z)])
    assert np.allclose(film, plane, atol=1e-9)


def test_filled_heights_lie_between_those_around_the_hole_and_are_counted():
    rng = np.random.default_rng(6)
    z = rng.normal(size=(30, 30))
    hole = np.zeros(z.shape, bool)
    hole[5:9, 20:] = True
    z[hole] = np.nan
    given = surface.HeightMap(z, 1.0, 1.0, sigma_um=np.where(hole, np.nan, 0.1))
    done, count = surface.filled(given)
    ring = z[4:10, 19:][~hole[4:10, 19:]]
    assert count == 40 and done.missing == 0
    assert ring.min() <= done.heights_um[hole].min() and done.heights_um[hole].max() <= ring.max()
    assert np.isnan(done.sigma_um[hole]).all() and done.attributes["interpolated_pixels"] == "40"
    assert given.missing == 40  # the map given is left alone


def test_too_many_missing_pixels_are_refused_rather_than_invented():
    z = np.ones((20, 20))
    z[:, :5] = np.nan
    with pytest.raises(PhysicsError, match=r"100 of 400 pixels \(25%\).*at most 20%"):
        surface.filled(surface.HeightMap(z, 1.0, 1.0))
    _, count = surface.filled(surface.HeightMap(z, 1.0, 1.0), largest_share=0.3)
    assert count == 100


def test_a_height_map_refuses_what_it_cannot_be():
    with pytest.raises(SpeculariaError, match="row, column"):
        surface.HeightMap(np.ones(5), 1.0, 1.0)
    with pytest.raises(SpeculariaError, match="pitch"):
        surface.HeightMap(np.ones((5, 5)), 0.0, 1.0)
    with pytest.raises(SpeculariaError, match="sigma_um"):
        surface.HeightMap(np.ones((5, 5)), 1.0, 1.0, sigma_um=np.ones((4, 5)))
