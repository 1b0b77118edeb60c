"""Relief too fine for a map, and numbers of bubbles that were not traced."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from specularia.errors import PhysicsError
from specularia.glass import BubbleKind, Face, Medium, Paths, Slab, reweight, trace_paths

Array = NDArray[np.float64]


def gaussian_relief(slope: float, *, pixels: int, seed: int) -> Array:
    """Heights in um at 1.5 um, periodic, with Gaussian slopes of `slope` rms along x."""
    noise = np.random.default_rng(seed).standard_normal((pixels, pixels))
    k = 2.0 * np.pi * np.fft.fftfreq(pixels, 1.5)
    low = np.exp(-(k[:, None] ** 2 + k**2) * 12.0**2 / 4.0)
    heights = np.fft.ifft2(np.fft.fft2(noise) * low).real
    across = (np.roll(heights, -1, axis=1) - heights) / 1.5
    return heights * slope / np.sqrt(np.mean(across**2))


def shares(paths: Paths, theta_deg: float) -> tuple[float, float, float]:
    """Transmitted light, its standard error, and the rms width of the lobe in direction cosines."""
    weight = paths.weight * paths.transmitted
    per = np.array([weight[paths.replicate == r].mean() for r in range(paths.replicate.max() + 1)])
    off = (paths.ux + np.sin(np.radians(theta_deg))) ** 2 + paths.uy**2
    width = np.sqrt(np.sum(weight * off) / np.sum(weight))
    return float(per.mean()), float(per.std(ddof=1) / np.sqrt(per.size)), float(width)


@pytest.mark.parametrize("theta_deg", [0.0, 40.0])
@pytest.mark.parametrize("lit_face", ["front", "back"])
def test_micro_facets_scatter_as_gaussian_relief_that_is_traced_in_full(
    lit_face: str, theta_deg: float
) -> None:
    slope = 0.1
    relief = Face(gaussian_relief(slope, pixels=500, seed=3), 1.5, 1.5)
    drawn = Slab(3.0, **{lit_face: Face.flat(micro_slope=slope)})
    traced = Slab(3.0, **{lit_face: relief})
    found = [
        shares(trace_paths(s, theta_deg=theta_deg, phi_deg=None, paths=200_000), theta_deg)
        for s in (drawn, traced)
    ]
    (a, a_se, width), (b, b_se, wanted) = found
    assert a == pytest.approx(b, abs=4 * np.hypot(a_se, b_se) + 3e-4)
    assert width == pytest.approx(wanted, rel=0.02)
    assert width > 0.05


def test_micro_facets_add_to_the_slopes_of_the_map() -> None:
    """Two independent Gaussian slopes: their variances add."""
    relief = gaussian_relief(0.06, pixels=500, seed=3)
    both = Slab(3.0, front=Face(relief, 1.5, 1.5, micro_slope=0.08))
    whole = Slab(3.0, front=Face(relief * 0.1 / 0.06, 1.5, 1.5))
    a, b = (shares(trace_paths(s, theta_deg=0.0, phi_deg=None, paths=200_000), 0.0) for s in (both, whole))
    assert a[2] == pytest.approx(b[2], rel=0.01)


def test_no_light_is_lost_or_made_by_steep_micro_facets_at_grazing_incidence() -> None:
    slab = Slab(3.0, Medium(absorption_per_mm=0.1), Face.flat(micro_slope=0.4), Face.flat(micro_slope=0.4))
    paths = trace_paths(slab, theta_deg=85.0, paths=50_000)
    assert paths.lost == 0
    np.testing.assert_allclose(paths.weight + paths.absorbed, 1.0, atol=1e-12)
    # Reflected light leaves on the front, whatever facet it met.
    assert paths.transmitted.any() and paths.reflected.any()


@pytest.mark.parametrize("slope", [-0.1, 0.6])
def test_slopes_out_of_range_are_refused(slope: float) -> None:
    with pytest.raises(PhysicsError, match="micro_slope"):
        Face.flat(micro_slope=slope)


def bubbly(per_cm3: float) -> Slab:
    kind = BubbleKind(per_cm3=per_cm3, median_mm=0.3, sigma=0.3, elongation=2.0, placing="free flight")
    return Slab(3.0, Medium(absorption_per_mm=0.05), bubble_kinds=(kind,))


@pytest.mark.parametrize("ratio", [0.4, 2.5])
def test_paths_reweighted_to_another_density_equal_paths_traced_with_it(ratio: float) -> None:
    def found(paths: Paths) -> Array:
        """Shares transmitted straight on, transmitted aside, reflected and absorbed, per replicate."""
        aside = np.hypot(paths.ux + np.sin(np.radians(30.0)), paths.uy) > 1e-6
        kinds = (
            paths.weight * (paths.transmitted & ~aside),
            paths.weight * (paths.transmitted & aside),
            paths.weight * paths.reflected,
            paths.absorbed,
        )
        r = paths.replicate
        return np.array([[k[r == n].mean() for n in range(r.max() + 1)] for k in kinds])

    first = trace_paths(bubbly(40.0), theta_deg=30.0, paths=400_000, seed=1)
    a = found(reweight(first, absorption_per_mm=0.05, traced_with_per_mm=0.05, density_ratio=ratio))
    b = found(trace_paths(bubbly(40.0 * ratio), theta_deg=30.0, paths=400_000, seed=2))
    se = np.sqrt((a.var(axis=1, ddof=1) + b.var(axis=1, ddof=1)) / a.shape[1])
    unchanged = found(first)
    assert np.all(np.abs(a.mean(axis=1) - b.mean(axis=1)) < 4 * se + 1e-5)
    assert abs(unchanged[1].mean() / b[1].mean() - 1.0) > 0.4


def test_a_density_is_not_changed_where_no_bubbles_were_drawn() -> None:
    paths = trace_paths(Slab(3.0), theta_deg=0.0, paths=1000)
    with pytest.raises(PhysicsError, match="free flight"):
        reweight(paths, density_ratio=2.0)
