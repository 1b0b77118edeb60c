"""One interface at a time: Fresnel, total reflection and the Stokes vector that is carried along."""

import math

import numba as nb
import numpy as np
import pytest

from specularia.glass.kernel import meet_interface, uniform


def once(theta_deg, ratio, *, q=0.0, u=0.0, v=0.0, xi=0.5, axis=(0.0, 1.0, 0.0)):
    """Light in the x-z plane on a level interface; axis y is the s direction."""
    t = math.radians(theta_deg)
    return meet_interface(0.0, 0.0, 1.0, math.sin(t), 0.0, -math.cos(t), ratio, True, *axis, q, u, v, xi)


def test_two_total_reflections_in_fresnels_rhomb_make_circular_light():
    # A glass rhomb of 1.51 at 54 deg 37 min: each reflection shifts s and p by 45 degrees (Born and Wolf
    # 1.5.4).
    *_, u, v = once(54 + 37 / 60, 1.51, u=1.0)
    assert math.hypot(u, v) == pytest.approx(1.0)
    assert abs(math.degrees(math.atan2(v, u))) == pytest.approx(45.0, abs=0.1)
    *_, u, v = once(54 + 37 / 60, 1.51, u=u, v=v)
    assert abs(v) == pytest.approx(1.0, abs=1e-4)


def test_total_reflection_happens_beyond_the_critical_angle_only():
    critical = math.degrees(math.asin(1 / 1.52))
    assert not once(critical + 0.01, 1.52, xi=1.0 - 1e-12)[0]
    assert once(critical - 0.01, 1.52, xi=1.0 - 1e-12)[0]


def test_share_reflected_and_polarisation_follow_fresnel():
    theta, n = 60.0, 1.52
    c, ct = math.cos(math.radians(theta)), math.sqrt(1 - (math.sin(math.radians(theta)) / n) ** 2)
    rs, rp = ((c - n * ct) / (c + n * ct)) ** 2, ((n * c - ct) / (n * c + ct)) ** 2
    share = 0.5 * (rs + rp)
    back, through = once(theta, 1 / n, xi=share - 1e-12), once(theta, 1 / n, xi=share + 1e-12)
    assert through[0] and not back[0]
    assert through[7] == pytest.approx((rp - rs) / (2 - rs - rp))
    assert back[7] == pytest.approx((rs - rp) / (rs + rp))
    # Snell, and the mirror.
    assert through[1] == pytest.approx(math.sin(math.radians(theta)) / n)
    assert (back[1], back[3]) == pytest.approx((math.sin(math.radians(theta)), c))


def test_brewsters_angle_polarises_reflected_light_fully():
    theta = math.degrees(math.atan(1.52))
    back = once(theta, 1 / 1.52, xi=0.0)
    assert not back[0]
    assert back[7] == pytest.approx(1.0, abs=1e-12)


def test_turning_the_reference_axis_describes_the_same_light():
    # Light swinging along s, described from an axis turned by 30 degrees about the ray.
    t, a = math.radians(40.0), math.radians(30.0)
    d = np.array([math.sin(t), 0.0, -math.cos(t)])
    s = np.array([0.0, 1.0, 0.0])
    axis = math.cos(a) * s + math.sin(a) * np.cross(d, s)
    straight = once(40.0, 1 / 1.52, q=1.0)
    turned = once(40.0, 1 / 1.52, q=math.cos(2 * a), u=-math.sin(2 * a), axis=tuple(axis))
    assert turned[0] == straight[0]
    assert np.allclose(turned[1:4], straight[1:4])
    # The new axis may point either way along s; q, u and v do not notice.
    assert np.allclose(turned[7:10], straight[7:10], atol=1e-12)


@nb.njit
def _scatter_cosine(count, key, polarised, index):
    """Mean cosine of light that a spherical bubble in glass scatters, geometric optics without
    diffraction."""
    total = 0.0
    for i in range(count):
        # Even over the bubble's cross section.
        b = math.sqrt((i + 0.5) / count)
        x, z = b, math.sqrt(1 - b * b)
        dx, dy, dz = 0.0, 0.0, -1.0
        sx, sy, sz, q, u, v = 1.0, 0.0, 0.0, 0.0, 0.0, 0.0
        inside = False
        for met in range(1000):
            sign = -1.0 if inside else 1.0
            crossed, dx, dy, dz, sx, sy, sz, q, u, v = meet_interface(
                sign * x, 0.0, sign * z, dx, dy, dz, 1 / index if inside else index,
                polarised, sx, sy, sz, q, u, v, uniform(key + np.uint64(i) * np.uint64(7919), met),
            )  # fmt: skip
            if crossed:
                inside = not inside
            if not inside:
                break
            t = -2 * (x * dx + z * dz)
            x += t * dx
            z += t * dz
        total -= dz
    return total / count


@pytest.mark.parametrize(("polarised", "asymmetry"), [(False, 0.5303), (True, 0.5286)])
def test_a_bubble_scatters_with_the_known_asymmetry(polarised, asymmetry):
    # The bubble's standard deviation of cos is 0.45, and Snell fixes most of it by the place of entry.
    found = _scatter_cosine(1_000_000, np.uint64(123), polarised, 1.52)
    assert found == pytest.approx(asymmetry, abs=6e-4)


def test_random_numbers_are_even_and_uncorrelated_between_neighbouring_draws():
    a = np.array([[uniform(np.uint64(key), draw) for draw in range(40)] for key in range(500)])
    assert abs(a.mean() - 0.5) < 4 / math.sqrt(12 * a.size)
    assert a.min() >= 0 and a.max() < 1
    assert abs(np.corrcoef(a[:, :-1].ravel(), a[:, 1:].ravel())[0, 1]) < 4 / math.sqrt(a.size)
    counts = np.histogram(a, bins=64, range=(0, 1))[0]
    expected = a.size / 64
    assert np.sum((counts - expected) ** 2 / expected) < 63 + 4 * math.sqrt(126)
