"""Laws that every pane keeps: energy, reciprocity, honest errors, independence of threads."""

import numba
import numpy as np
import pytest
from glass_reference import smooth_map

from specularia import surface
from specularia.bsdf.tabulated import base_index
from specularia.conventions import square_to_disk
from specularia.glass import BubbleKind, Face, Medium, Slab, trace, trace_paths

ROUGH = {
    "front": Face(smooth_map((48, 60), seed=1, rms_slope=0.4), 1.5, 1.5),
    "back": Face(smooth_map((40, 40), seed=2, rms_slope=0.6), 1.5, 1.7),
}


@pytest.fixture(scope="module")
def clear() -> Slab:
    return Slab(thickness_mm=1.0, **ROUGH)


@pytest.fixture(scope="module")
def tinted() -> Slab:
    kind = BubbleKind(per_cm3=800.0, median_mm=0.15, sigma=0.3, elongation=3.0)
    return Slab(
        thickness_mm=1.0, medium=Medium(absorption_per_mm=0.07), bubble_kinds=(kind,), bubble_seed=3, **ROUGH
    )


@pytest.mark.parametrize("side", ["front", "back"])
def test_clear_rough_slab_keeps_all_light_and_loses_no_path(clear, side):
    found = trace(clear, side=side, theta_deg=[0, 40, 82.5, 89.9], phi_deg=None, paths=64_000, seed=1)
    assert np.all(np.abs(found.tau + found.rho - 1) < 1e-9)
    assert found.lost.sum() == 0
    assert np.all(found.absorbed == 0)


def test_absorption_and_bubbles_share_the_light_exactly(tinted):
    found = trace(tinted, theta_deg=[0, 60, 82.5], paths=64_000, seed=2)
    assert np.all(np.abs(found.tau + found.rho + found.absorbed - 1) < 1e-9)
    assert found.lost.sum() == 0
    assert np.all(found.absorbed > 0.1)


def test_every_path_keeps_its_own_balance_and_direction(tinted):
    paths = trace_paths(tinted, theta_deg=50.0, paths=32_000, seed=5)
    assert np.allclose(paths.weight + paths.absorbed, 1.0, atol=1e-12)
    assert np.all(paths.ux**2 + paths.uy**2 <= 1 + 1e-9)
    assert np.allclose(paths.weight, np.exp(-0.07 * paths.glass_length_mm), atol=1e-9)


def test_same_seed_gives_the_same_paths_on_any_number_of_threads(tinted):
    before = numba.get_num_threads()
    results = []
    try:
        for threads in (1, min(2, numba.config.NUMBA_NUM_THREADS)):
            numba.set_num_threads(threads)
            results.append(trace_paths(tinted, theta_deg=30.0, phi_deg=None, paths=9600, seed=7))
    finally:
        numba.set_num_threads(before)
    for name in ("ux", "uy", "exit_side", "weight", "absorbed", "glass_length_mm"):
        assert np.array_equal(getattr(results[0], name), getattr(results[1], name))
    other = trace_paths(tinted, theta_deg=30.0, phi_deg=None, paths=9600, seed=8)
    assert not np.array_equal(results[0].ux, other.ux)


def test_parts_of_a_run_put_together_equal_the_whole(clear):
    whole = trace_paths(clear, theta_deg=20.0, paths=3200, seed=1)
    parts = [
        trace_paths(clear, theta_deg=20.0, paths=3200, seed=1, first=a, count=n)
        for a, n in ((0, 1500), (1500, 1700))
    ]
    assert np.array_equal(whole.ux, np.concatenate([p.ux for p in parts]))
    assert np.array_equal(whole.replicate, np.concatenate([p.replicate for p in parts]))


@pytest.mark.parametrize(("rough", "theta"), [(True, 0.0), (True, 70.0), (False, 60.0)])
def test_stated_errors_agree_with_the_spread_over_seeds(clear, rough, theta):
    slab = clear if rough else Slab(thickness_mm=1.0)
    runs = [trace(slab, theta_deg=[theta], paths=6400, seed=s) for s in range(100, 160)]
    tau = np.array([r.tau[0] for r in runs])
    stated = np.sqrt(np.mean([r.tau_se[0] ** 2 for r in runs]))
    # The spread of 60 values is itself known to 9 %.
    assert tau.std(ddof=1) / stated == pytest.approx(1.0, abs=0.3)


def test_diffuse_transmission_is_the_same_both_ways(tinted):
    # Reciprocity: integrals over all directions agree, though tau(0) of the two sides differs by far.
    x, w = np.polynomial.legendre.leggauss(8)
    theta = np.degrees(np.arcsin(np.sqrt(0.5 * (x + 1))))
    runs = {
        side: trace(tinted, side=side, theta_deg=theta, phi_deg=None, paths=64_000, seed=k)
        for k, side in enumerate(("front", "back"))
    }
    mean = {s: np.sum(0.5 * w * r.tau) for s, r in runs.items()}
    error = np.sqrt(sum(np.sum((0.5 * w * r.tau_se) ** 2) for r in runs.values()))
    assert abs(runs["front"].tau[0] - runs["back"].tau[0]) > 10 * error
    assert abs(mean["front"] - mean["back"]) < 4 * error + 2e-4


def exchange(slab: Slab, side: str, *, cells: int, draws: int, paths: int) -> dict[str, np.ndarray]:
    """Light from each of cells x cells incident directions into each exit cell, [draw, incident, exit].

    Cells have equal projected solid angle. Every draw has its own direction within the incident cell, so that
    the spread over draws is the whole noise.
    """
    rng = np.random.default_rng(11 + (side == "back"))
    n = cells**2
    found = {"transmission": np.zeros((draws, n, n)), "reflection": np.zeros((draws, n, n))}
    for a in range(n):
        at = (np.array(divmod(a, cells))[:, None] + rng.random((2, draws))) / cells
        ux, uy = square_to_disk(*at)
        for k in range(draws):
            p = trace_paths(
                slab,
                side=side,
                theta_deg=float(np.degrees(np.arcsin(min(np.hypot(ux[k], uy[k]), 1 - 1e-9)))),
                phi_deg=float(np.degrees(np.arctan2(uy[k], ux[k]))),
                paths=paths,
                seed=int(rng.integers(1 << 30)),
            )
            i, j = base_index(p.ux, p.uy, cells)
            for name, out in (("transmission", p.transmitted), ("reflection", p.reflected)):
                light = np.bincount((i * cells + j)[out], p.weight[out], n)
                found[name][k, a] = light / len(p)
    return found


def rms_z(a: np.ndarray, b: np.ndarray, *, least: float) -> tuple[float, int]:
    """Root mean square of (a - b) over its standard error, for cells with enough light; [draw, ., .] each."""
    mean_a, mean_b = a.mean(0), b.mean(0)
    variance = (a.var(0, ddof=1) + b.var(0, ddof=1)) / len(a)
    good = (mean_a + mean_b) / 2 > least
    z = ((mean_a - mean_b) / np.sqrt(np.where(good, variance, 1.0)))[good]
    return float(np.sqrt(np.mean(z**2))), z.size


@pytest.mark.parametrize("kind", ["clear", "tinted"])
def test_light_goes_both_ways_alike_in_every_pair_of_directions(kind, request):
    # Reciprocity, f_back(a -> b) = f_front(b -> a), of transmission and of reflection from either side, over
    # 4 x 4 by 4 x 4 cells; validation/slab_laws.py does the same with 8 x 8 and more light.
    slab = request.getfixturevalue(kind)
    front, back = (exchange(slab, s, cells=4, draws=24, paths=320) for s in ("front", "back"))
    pairs = {
        "transmission": (front["transmission"], back["transmission"].transpose(0, 2, 1)),
        "reflection front": (front["reflection"], front["reflection"].transpose(0, 2, 1)),
        "reflection back": (back["reflection"], back["reflection"].transpose(0, 2, 1)),
    }
    for name, (a, b) in pairs.items():
        if name != "transmission":
            upper = np.triu_indices(a.shape[1], 1)
            a, b = a[:, *upper], b[:, *upper]
        found, number = rms_z(a, b, least=2e-3)
        assert number > 80
        # Students's t with about 46 degrees of freedom; the number of cells sets how well its width is known.
        assert found == pytest.approx(1.02, abs=4 / np.sqrt(2 * number)), name


def test_real_map_mirrored_on_both_faces_keeps_all_light(shared_data):
    height_map = surface.level(surface.read(shared_data / "surface" / "st_plu-1.plu"))
    face = Face.from_map(height_map, tiling="mirror")
    found = trace(Slab(thickness_mm=3.0, front=face, back=face), theta_deg=[0, 60], paths=64_000, seed=1)
    assert np.all(np.abs(found.tau + found.rho - 1) < 1e-9)
    assert found.lost.sum() == 0
    assert np.all((found.tau > 0.1) & (found.tau < 0.95))
