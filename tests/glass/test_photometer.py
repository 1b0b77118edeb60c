"""The virtual gonio-photometer: it neither loses light nor makes up structure."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.spatial import Delaunay, cKDTree

from specularia.conventions import direction_cosines
from specularia.errors import PhysicsError
from specularia.glass import Face, Medium, Slab, trace_paths
from specularia.glass.photometer import HORIZON_DEG, Directions, density, measure, recorded, scan
from specularia.gonio import Table

Array = NDArray[np.float64]


def fine_scan(theta: float, phi: float = 0.0) -> Directions:
    return scan(theta, phi, base=20000, middle=9000, peak=6000, rng=np.random.default_rng(0))


def areas(directions: Directions) -> Array:
    """Projected solid angle of each direction: linear on triangles, carried on to the horizon."""
    x, y, _ = direction_cosines(*directions)
    around = 2.0 * np.pi * (np.arange(1440) + 0.5) / 1440
    ring = np.column_stack([np.cos(around), np.sin(around)])
    inner = np.column_stack([x, y])
    owner = np.concatenate([np.arange(len(inner)), cKDTree(inner).query(ring)[1]])
    points = np.vstack([inner, ring])
    corners = Delaunay(points).simplices
    a, b, c = (points[corners[:, k]] for k in range(3))
    area = 0.5 * np.abs((b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0])
    return np.bincount(owner[corners].ravel(), np.repeat(area / 3.0, 3), minlength=len(inner))


def bsdf_of(table: Table) -> Array:
    return table.values / np.abs(np.cos(np.radians(table.theta_s_deg)))


@pytest.fixture(scope="module")
def rough() -> Slab:
    """A pane with pits on both faces, yellowish, and a smooth share that lets a narrow peak through."""
    rng = np.random.default_rng(12)
    y, x = np.mgrid[0:128, 0:128]
    faces = []
    for _ in range(2):
        h = 0.3 * np.sin(2 * np.pi * x / 128)
        for cx, cy, r in zip(*rng.uniform(0, 128, (2, 60)), rng.uniform(4, 14, 60)):
            dx, dy = (x - cx + 64) % 128 - 64, (y - cy + 64) % 128 - 64
            h = np.minimum(h, -0.6 * r * np.clip(1 - (dx**2 + dy**2) / r**2, 0, None))
        faces.append(Face(h, 1.5, 1.5))
    return Slab(thickness_mm=1.0, medium=Medium(1.52, 0.07), front=faces[0], back=faces[1])


@pytest.mark.parametrize("theta", [0.0, 40.0, 82.5])
def test_integral_of_the_table_is_the_traced_transmission(rough: Slab, theta: float) -> None:
    directions = fine_scan(theta)
    table = measure(rough, theta_deg=theta, directions=directions, paths=200_000, seed=3)
    traced = trace_paths(rough, theta_deg=theta, paths=200_000, seed=3)
    tau = float(np.where(traced.transmitted, traced.weight, 0.0).mean())
    assert areas(directions) @ bsdf_of(table) == pytest.approx(tau, rel=3e-3)


def test_centroid_of_the_table_is_that_of_the_paths(rough: Slab) -> None:
    """At an azimuth that would show any exchange of x and y or of signs."""
    directions = fine_scan(50.0, 30.0)
    table = measure(rough, theta_deg=50.0, phi_deg=30.0, directions=directions, paths=200_000, seed=5)
    traced = trace_paths(rough, theta_deg=50.0, phi_deg=30.0, paths=200_000, seed=5)
    weight = np.where(traced.transmitted, traced.weight, 0.0)
    light = areas(directions) * bsdf_of(table)
    for along, of_paths in ((table.ux, traced.ux), (table.uy, traced.uy)):
        centroid = np.sum(weight * of_paths) / weight.sum()
        assert np.sum(light * along) / light.sum() == pytest.approx(centroid, abs=3e-3)
    assert table.ux[table.values.argmax()] < -0.5 and table.uy[table.values.argmax()] < -0.3


def test_constant_bsdf_stays_constant_up_to_the_horizon() -> None:
    rng = np.random.default_rng(2)
    r, phi = np.sqrt(rng.random(1_000_000)), rng.uniform(0.0, 2.0 * np.pi, 1_000_000)
    directions = fine_scan(0.0)
    found = density(
        r * np.cos(phi), r * np.sin(phi), np.full(r.size, 0.6), directions, paths=r.size, aperture_deg=1.0
    )
    expected = 0.6 / np.pi
    from_normal = 180.0 - directions[0]
    # Only 4600 of the paths leave within the last ring, so its mean has a standard error of 1.5 %.
    for low, high, close in ((0, 30, 0.01), (30, 60, 0.01), (60, 80, 0.01), (80, 86, 0.02), (86, 89, 0.05)):
        ring = found[(from_normal >= low) & (from_normal < high)]
        assert ring.mean() == pytest.approx(expected, rel=close), (low, high)
        assert ring.std() < 0.15 * expected, (low, high)


def test_known_lobes_come_back() -> None:
    """Two Gaussian lobes in direction cosines, away from the horizon, against their sum in closed form."""
    rng = np.random.default_rng(7)
    lobes = [(0.3, 0.03, 0.02), (0.6, 0.15, 0.12)]
    x0 = -np.sin(np.radians(20.0))
    total = 1_000_000
    drawn = [rng.normal([x0, 0.0], [sx, sy], (round(share * total), 2)) for share, sx, sy in lobes]
    points = np.vstack(drawn)
    points = points[np.sum(points**2, axis=1) < 1.0]
    directions = fine_scan(20.0)
    found = density(*points.T, np.ones(len(points)), directions, paths=total, aperture_deg=0.6)
    x, y, _ = direction_cosines(*directions)
    # The aperture widens the lobes: 0.6 degrees are 0.0044 rad of standard deviation.
    seen = np.radians(0.6) / np.sqrt(8.0 * np.log(2.0))
    expected = sum(
        share
        / (2 * np.pi * np.hypot(sx, seen * abs(np.cos(np.radians(20.0)))) * np.hypot(sy, seen))
        * np.exp(
            -0.5 * (x - x0) ** 2 / (sx**2 + (seen * np.cos(np.radians(20.0))) ** 2)
            - 0.5 * y**2 / (sy**2 + seen**2)
        )
        for share, sx, sy in lobes
    )
    bright = expected > 0.5
    assert np.abs(found[bright] / expected[bright] - 1.0).max() < 0.12
    assert np.mean(found[bright] / expected[bright]) == pytest.approx(1.0, abs=0.01)
    area = areas(directions)
    assert area @ np.abs(found - expected) < 0.02 * (area @ expected)


def test_faint_scattering_is_smooth_where_paths_are_few(rough: Slab) -> None:
    """Each reading of the dim part against the mean of its six neighbours, a degree away.

    Counted in cones of a degree there would be about 2 paths each, and the deviations above one half.
    """
    directions = fine_scan(0.0)
    table = measure(rough, theta_deg=0.0, directions=directions, paths=30_000, seed=8)
    points = np.column_stack(direction_cosines(*directions))
    from_normal = 180.0 - directions[0]
    dim = np.flatnonzero((from_normal > 50.0) & (from_normal < 85.0))
    around = cKDTree(points).query(points[dim], k=7)[1][:, 1:]
    deviation = np.abs(table.values[dim] / table.values[around].mean(axis=1) - 1.0)
    assert np.median(deviation) < 0.02
    assert np.quantile(deviation, 0.99) < 0.15


def test_scan_is_dense_at_the_peak_and_stays_off_the_horizon() -> None:
    theta_s, phi_s = scan(40.0, 120.0, base=5000, middle=3000, peak=2000, rng=np.random.default_rng(0))
    assert np.all(theta_s > 180.0 - HORIZON_DEG) and len(theta_s) > 9900
    v = np.column_stack(direction_cosines(theta_s, phi_s))
    peak = np.array(direction_cosines(140.0, 300.0))
    off = np.degrees(np.arccos(np.clip(v @ peak, -1.0, 1.0)))
    base = 5000 * (1.0 - np.cos(np.radians(5.0)))
    middle = 3000 * (1.0 - np.cos(np.radians(5.0))) / (1.0 - np.cos(np.radians(15.0)))
    assert np.sum(off < 5.0) == pytest.approx(2000 + middle + base, rel=0.05)


def flat_table(value: float) -> Table:
    theta_s, phi_s = scan(0.0, base=60000, middle=0, peak=0, rng=np.random.default_rng(1))
    return Table("", "DSF", "transmission_front", 0.0, 0.0, theta_s, phi_s, np.full(theta_s.size, value))


def test_noise_is_as_set() -> None:
    bright = recorded(
        flat_table(2.0), relative_noise=0.01, floor=0.0, shadow=False, rng=np.random.default_rng(2)
    )
    assert bright.values.std() == pytest.approx(0.02, rel=0.02)
    assert bright.values.mean() == pytest.approx(2.0, abs=5e-4)
    dark = recorded(
        flat_table(0.0), relative_noise=0.01, floor=1e-4, shadow=False, rng=np.random.default_rng(2)
    )
    assert dark.values.std() == pytest.approx(1e-4, rel=0.02)
    assert np.mean(dark.values < 0.0) == pytest.approx(0.5, abs=0.01)
    one_sigma = recorded(
        flat_table(1e-4), relative_noise=0.0, floor=1e-4, shadow=False, rng=np.random.default_rng(3)
    )
    # A standard normal number lies below -1 in 15.87 % of cases.
    assert np.mean(one_sigma.values < 0.0) == pytest.approx(0.1587, abs=0.006)


def test_shadow_falls_around_phi_minus_90_near_the_horizon() -> None:
    table = recorded(
        flat_table(1.0), relative_noise=0.0, floor=0.0, shadow=True, rng=np.random.default_rng(2)
    )
    aside = np.abs(table.phi_s_deg - 270.0)
    above = table.theta_s_deg - 90.0
    assert table.values[(aside < 9.0) & (above < 22.0)].max() < 0.05
    assert table.values[(aside > 15.0) | (above > 28.0)].min() > 0.99


def test_directions_on_the_side_of_the_light_are_refused(rough: Slab) -> None:
    with pytest.raises(PhysicsError, match="theta_s above 90"):
        measure(rough, theta_deg=0.0, directions=(np.array([80.0]), np.array([0.0])), paths=1000, seed=1)
