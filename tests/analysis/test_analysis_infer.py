"""What is inferred of a glass holds the truth, says what the data leave open, and comes from light alone."""

from __future__ import annotations

import importlib
import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from specularia import analysis, gonio
from specularia.analysis.emulator import FINE, emulate
from specularia.analysis.infer_design import SECTORS, light_in_cells, measured_light, with_values
from specularia.cli import main
from specularia.errors import CoverageError, PhysicsError
from specularia.glass import BubbleKind, Face, Medium, Slab, photometer, read_slab, trace_paths
from specularia.gonio import Table, summarise_all

infer_module = importlib.import_module("specularia.analysis.infer")  # the name is the function's too

THETA = (0.0, 30.0, 60.0)
APERTURE = 0.6
TRUTH = {"absorption_per_mm": 0.06, "micro_slope_back": 0.09}


def relief() -> np.ndarray:
    """Gaussian relief, periodic, slopes of 0.25 rms."""
    noise = np.random.default_rng(2).standard_normal((256, 256))
    k = 2.0 * np.pi * np.fft.fftfreq(256, 1.5)
    low = np.exp(-(k[:, None] ** 2 + k**2) * 8.0**2 / 4.0)
    heights = np.fft.ifft2(np.fft.fft2(noise) * low).real
    return heights * 0.25 / np.sqrt(np.mean((np.diff(heights, axis=1) / 1.5) ** 2))


def pane() -> Slab:
    """A rough front, 3 mm, nothing else known."""
    return Slab(3.0, Medium(), Face(relief(), 1.5, 1.5), synthetic=True)


def tables(slab: Slab, paths: int = 1_000_000) -> list[Table]:
    found = []
    for k, theta in enumerate(THETA):
        rng = np.random.default_rng(k)
        directions = photometer.scan(theta, base=6_000, middle=6_000, peak=4_000, rng=rng)
        clean = photometer.measure(
            slab,
            theta_deg=theta,
            directions=directions,
            paths=paths,
            seed=50 + k,
            aperture_deg=APERTURE,
            least_paths=300,
            synthetic=True,
        )
        found.append(photometer.recorded(clean, relative_noise=0.01, floor=1e-5, shadow=False, rng=rng))
    return found


@pytest.fixture(scope="module")
def measured() -> list[Table]:
    return tables(with_values(pane(), TRUTH))


@pytest.fixture(scope="module")
def found(measured: list[Table]) -> analysis.Inferred:
    return analysis.infer(pane(), measured, seek=tuple(TRUTH), paths=30_000, seed=4, aperture_deg=APERTURE)


@pytest.mark.parametrize("name", list(TRUTH))
def test_the_interval_holds_the_truth_and_is_narrower_than_the_prior(
    found: analysis.Inferred, name: str
) -> None:
    mid, low, high = found.interval(name)
    assert low < TRUTH[name] < high
    assert high / low < 1.7
    assert abs(mid / found.priors[name].median - 1.0) > 0.3
    assert name not in found.open and name not in found.at_edge


def test_an_angle_left_out_is_predicted(found: analysis.Inferred) -> None:
    (held,) = found.held_out
    assert held.theta_deg == 30.0
    assert held.low < held.measured < held.high
    assert held.high / held.low < 1.1


def test_the_pane_that_comes_back_holds_the_medians(found: analysis.Inferred) -> None:
    assert found.slab.medium.absorption_at(520.0) == pytest.approx(found.interval("absorption_per_mm")[0])
    assert found.slab.back.micro_slope == pytest.approx(found.interval("micro_slope_back")[0])
    assert found.slab.front.micro_slope == 0.0


def test_the_same_seed_gives_the_same_samples(measured: list[Table]) -> None:
    a, b = (
        analysis.infer(
            pane(), measured[:2], seek=["absorption_per_mm"], paths=3200, seed=7, hold_out=False
        ).samples
        for _ in range(2)
    )
    np.testing.assert_array_equal(a, b)


def test_the_polynomial_foretells_the_light_of_a_pane_that_was_not_traced(measured: list[Table]) -> None:
    summaries = summarise_all(measured[:1], isotropic=True)
    slab = replace(
        pane(), bubble_kinds=(BubbleKind(per_cm3=30.0, median_mm=0.3, sigma=0.3, placing="free flight"),)
    )
    ranges = {"absorption_per_mm": (0.01, 0.2), "bubbles_per_cm3": (10.0, 90.0)}
    fitted = emulate(slab, summaries, ranges, paths=100_000, seed=1, wavelength_nm=520.0, aperture_deg=0.3)
    values = {"absorption_per_mm": 0.13, "bubbles_per_cm3": 25.0}
    paths = trace_paths(with_values(slab, values), theta_deg=0.0, paths=400_000, seed=9)
    light = light_in_cells(paths, 0.0)
    mean, se = light.mean(axis=0), light.std(axis=0, ddof=1) / np.sqrt(len(light))
    used = fitted.cells[0].used
    foretold = np.exp(fitted.log_light(np.array([values["absorption_per_mm"], values["bubbles_per_cm3"]])))
    error = np.hypot(se[used], fitted.error * mean[used])
    off = (foretold - mean[used]) / error
    assert np.sqrt(np.mean(off**2)) < 1.6
    assert foretold.sum() == pytest.approx(mean[used].sum(), rel=0.005)


def test_two_polynomials_through_other_traces_differ_by_the_noise_that_each_states(
    measured: list[Table],
) -> None:
    summaries = summarise_all(measured[:1], isotropic=True)
    ranges = {"absorption_per_mm": (0.03, 0.09), "micro_slope_back": (0.07, 0.11)}
    one, two = (
        emulate(
            pane(),
            summaries,
            ranges,
            paths=16_000,
            seed=s,
            wavelength_nm=520.0,
            aperture_deg=APERTURE,
            design=FINE,
        )
        for s in (1, 2)
    )
    both = np.intersect1d(one.cells[0].used, two.cells[0].used)
    a, b = (np.searchsorted(e.cells[0].used, both) for e in (one, two))
    share = np.random.default_rng(3).random((40, 2))
    low, high = np.array(list(ranges.values())).T
    values = low + share * (high - low)
    off = one.log_light(values)[:, a] - two.log_light(values)[:, b]
    stated = np.hypot(one.noise[a], two.noise[b])
    assert len(both) > 20
    assert 0.7 < np.sqrt(np.mean((off / stated) ** 2)) < 1.4
    # Several traces go into it: it is known better than one.
    assert np.all(one.noise < one.single)


def test_information_that_noise_feigns_widens_its_own_direction_alone() -> None:
    rng = np.random.default_rng(5)
    information = np.array([[4.0, 1.0], [1.0, 2.0]])
    ln = rng.multivariate_normal([0.3, -1.0], np.linalg.inv(information), 200_000)
    feigned = np.array([[1.0, 0.5], [0.5, 0.25]])  # one direction only
    wide = infer_module._widened(ln, feigned)
    np.testing.assert_allclose(np.linalg.inv(np.cov(wide.T)), information - feigned, atol=0.05)
    np.testing.assert_allclose(wide.mean(axis=0), ln.mean(axis=0), atol=1e-9)
    np.testing.assert_allclose(infer_module._widened(ln, np.zeros((2, 2))), ln, atol=1e-9)
    # Never all of it.
    widest = infer_module._widened(ln, 100.0 * information)
    np.testing.assert_allclose(np.cov(widest.T), 10.0 * np.cov(ln.T), rtol=1e-6)


def test_light_in_the_cells_of_a_table_is_that_of_the_paths_it_was_read_off(measured: list[Table]) -> None:
    (summary,) = summarise_all(measured[1:2], isotropic=True)
    light, noise = measured_light(summary.distribution, 30.0)
    paths = trace_paths(with_values(pane(), TRUTH), theta_deg=30.0, paths=400_000, seed=8)
    traced = light_in_cells(paths, 30.0).mean(axis=0)
    assert light.sum() == pytest.approx(summary.tau, rel=0.01)
    bright = traced > 0.01
    assert bright.sum() > 10
    np.testing.assert_allclose(light[bright], traced[bright], rtol=0.06)
    assert np.all(noise[bright] < 0.02 * light[bright])


def test_light_far_aside_is_counted_alike_in_tables_and_traces() -> None:
    """Bubbles send light aside by more than 90 degrees too, which no cell takes."""
    kind = BubbleKind(per_cm3=300.0, median_mm=0.3, sigma=0.2, placing="free flight")
    slab = replace(with_values(pane(), TRUTH), bubble_kinds=(kind,))
    directions = photometer.scan(60.0, base=12_000, middle=100, peak=100, rng=np.random.default_rng(1))
    table = photometer.measure(
        slab, theta_deg=60.0, directions=directions, paths=2_000_000, seed=6, least_paths=200, synthetic=True
    )
    (summary,) = summarise_all([table], isotropic=True)
    light, _ = measured_light(summary.distribution, 60.0)
    paths = trace_paths(slab, theta_deg=60.0, paths=2_000_000, seed=8)
    traced = light_in_cells(paths, 60.0).mean(axis=0)
    # The outermost rings, 32 to 90 degrees, sectors towards the normal and across.
    outer = np.arange(light.size).reshape(-1, SECTORS)[-4:, :2].ravel()
    assert np.all(traced[outer] > 1e-4)
    np.testing.assert_allclose(light[outer], traced[outer], rtol=0.1)


def test_a_thickness_that_is_not_known_stays_so_and_widens_the_rest(
    measured: list[Table], found: analysis.Inferred
) -> None:
    unsure = analysis.infer(
        pane(),
        measured,
        seek=(*TRUTH, "thickness_mm"),
        priors={"thickness_mm": analysis.Prior(3.0, 0.1)},
        paths=30_000,
        seed=4,
        hold_out=False,
        aperture_deg=APERTURE,
    )
    known, now, thick = (
        np.std(np.log(f.samples[:, f.names.index(n)]))
        for f, n in ((found, "absorption_per_mm"), (unsure, "absorption_per_mm"), (unsure, "thickness_mm"))
    )
    assert thick == pytest.approx(0.1, rel=0.15)
    assert now == pytest.approx(np.hypot(known, 0.1), rel=0.15)
    assert "thickness_mm" in unsure.open
    product = np.log(unsure.samples[:, unsure.names.index("absorption_per_mm")] * unsure.samples[:, -1] / 3.0)
    assert np.std(product) == pytest.approx(known, rel=0.2)
    assert unsure.slab.thickness_mm == pytest.approx(unsure.interval("thickness_mm")[0])


def test_what_cannot_be_inferred_is_refused(measured: list[Table]) -> None:
    with pytest.raises(PhysicsError, match="can be sought"):
        analysis.infer(pane(), measured, seek=["colour"])
    with pytest.raises(PhysicsError, match="along with absorption_per_mm"):
        analysis.infer(pane(), measured, seek=["thickness_mm", "micro_slope_back"])
    with pytest.raises(CoverageError, match="two tables"):
        analysis.infer(pane(), measured[:1], seek=["absorption_per_mm"])
    with pytest.raises(PhysicsError, match="prior"):
        analysis.Prior(0.0, 1.0)


def test_the_command_writes_samples_a_figure_and_a_pane_to_trace(
    measured: list[Table], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    np.save(tmp_path / "front.npy", relief())
    (tmp_path / "glass.toml").write_text(
        'thickness_mm = 3.0\n[front]\nheights = "front.npy"\npitch_um = 1.5\ntiling = "periodic"\n'
        "[back]\nflat = true\n"
    )
    files = [gonio.write(t, tmp_path / f"{k}.dat") for k, t in enumerate(measured[:2])]
    words = ["infer", str(tmp_path / "glass.toml"), *map(str, files), "-o", str(tmp_path / "out")]
    more = ["--seek", "absorption_per_mm", "--prior", "absorption_per_mm=0.02,0.8", "--no-hold-out"]
    assert main([*words, *more, "--paths", "3200", "--json", "-q"]) == 0
    said = json.loads(capsys.readouterr().out)
    (one,) = said["parameters"]
    assert one["prior_median"] == 0.02 and one["low_95"] < one["median"] < one["high_95"]
    assert Path(said["figure"]).read_bytes()[:4] == b"\x89PNG"
    slab = read_slab(said["glass"])
    assert slab.medium.absorption_at(520.0) == pytest.approx(one["median"], rel=1e-4)
    assert slab.front.heights_um is not None
    rows = Path(said["samples"]).read_text().splitlines()
    assert rows[0] == "absorption_per_mm,discrepancy" and len(rows) > 1000
    assert main([*words, "--seek", "wishes"]) == 2
    assert main([*words, "--prior", "absorption_per_mm=much"]) == 2
