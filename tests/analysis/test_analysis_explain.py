"""The error budget: steps add up, each does what its closed form says, a known pane leaves no remainder."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from specularia import analysis, gonio
from specularia.analysis.lobe_shape import ASIDE_DEG, deflection, shape_of_light
from specularia.cli import main
from specularia.errors import CoverageError, PhysicsError
from specularia.glass import BubbleKind, Face, Medium, Patch, Slab, closed_form, photometer
from specularia.gonio import Table
from specularia.surface import HeightMap

THETA = (0.0, 60.0)
APERTURE = 1.5


def relief() -> np.ndarray:
    """Two crossed waves, slopes up to 0.13."""
    x = 2.0 * np.pi * np.arange(64) / 64
    return 2.0 * (np.sin(x)[None, :] + np.cos(x)[:, None])


def pane() -> Slab:
    kind = BubbleKind(per_cm3=40.0, median_mm=0.25, sigma=0.3, elongation=2.0, placing="free flight")
    face = Face(relief(), 1.5, 1.5, micro_slope=0.04)
    return Slab(
        3.0,
        Medium(absorption_per_mm=0.07),
        face,
        Face.flat(micro_slope=0.05),
        bubble_kinds=(kind,),
        synthetic=True,
    )


def tables(slab: Slab, paths: int = 200_000) -> list[Table]:
    """What a virtual instrument records of a pane, with other random numbers than the budget's."""
    found = []
    for k, theta in enumerate(THETA):
        rng = np.random.default_rng(k)
        directions = photometer.scan(theta, base=8_000, middle=8_000, peak=8_000, rng=rng)
        clean = photometer.measure(
            slab,
            theta_deg=theta,
            directions=directions,
            paths=paths,
            seed=77 + k,
            synthetic=True,
            aperture_deg=APERTURE,
        )
        found.append(photometer.recorded(clean, relative_noise=0.01, floor=1e-5, shadow=False, rng=rng))
    return found


@pytest.fixture(scope="module")
def measured() -> list[Table]:
    return tables(pane())


@pytest.fixture(scope="module")
def budget(measured: list[Table]) -> analysis.Budget:
    return analysis.explain(
        pane(),
        measured,
        paths=64_000,
        seed=3,
        unsure={"absorption": 0.1, "micro-relief": 0.2},
        aperture_deg=APERTURE,
    )


def test_the_steps_lead_from_the_published_model_to_the_last_state(budget: analysis.Budget) -> None:
    # Synthetic tables know no diffraction.
    assert [s.name for s in budget.steps] == [s for s in analysis.STEPS if s != "diffraction"]
    np.testing.assert_array_equal(budget.start, budget.steps[0].before)
    for one, two in zip(budget.steps, budget.steps[1:]):
        np.testing.assert_array_equal(one.after, two.before)
    total = sum(s.effect for s in budget.steps)
    np.testing.assert_allclose(budget.start + total + budget.remainder, budget.measured, atol=1e-12)


def test_a_pane_that_is_known_leaves_no_remainder(budget: analysis.Budget) -> None:
    """Tau within 1 %, width and background within 3 %, L1 below 8 % with few paths."""
    assert np.all(np.abs(budget.remainder[:, 0]) < 0.01 * budget.measured[:, 0])
    assert np.all(np.abs(budget.remainder[:, 1:]) < 0.03 * budget.measured[:, 1:] + 2e-3)
    assert np.all(np.abs(budget.start[:, 0] - budget.measured[:, 0]) > 0.1 * budget.measured[:, 0])
    assert np.all(budget.l1 < 0.08)


def test_absorption_and_polarisation_change_a_flat_pane_as_in_closed_form() -> None:
    flat = Slab(3.0, Medium(absorption_per_mm=0.07))
    lit = tables(replace(flat, front=Face.flat(micro_slope=0.02)), paths=20_000)
    order = ("endless", "polarisation", "absorption")
    # The tree would take the mean over a bin of incidence; without it the angles are exact.
    found = analysis.explain(flat, lit, order=("tree", *order), paths=256_000, aperture_deg=APERTURE)
    for name, kwargs in (
        ("endless", {"polarised": False}),
        ("polarisation", {}),
        ("absorption", {"absorption_per_mm": 0.07, "thickness_mm": 3.0}),
    ):
        step = next(s for s in found.steps if s.name == name)
        exact = [closed_form.flat_slab(t, index=1.52, **kwargs)[0] for t in THETA]
        np.testing.assert_allclose(step.after[:, 0], np.ravel(exact), atol=4e-4)
        # A flat pane deflects nothing; what bends light, and traps it, is relief.
        np.testing.assert_allclose(step.after[:, 2], 0.0, atol=1e-12)


def test_what_is_unsure_of_the_pane_widens_its_own_step(budget: analysis.Budget) -> None:
    absorption = budget.steps[2]
    np.testing.assert_allclose(absorption.unsure, 0.1 * np.abs(absorption.effect))
    relief_ = next(s for s in budget.steps if s.name == "micro-relief")
    np.testing.assert_allclose(relief_.unsure, 0.4 * np.abs(relief_.effect))
    assert not budget.steps[0].unsure.any()
    assert np.all(budget.remainder_half_width[:, 0] >= 1.96 * absorption.unsure[:, 0])


def test_the_noise_of_heights_is_a_step_where_it_was_taken_off(
    measured: list[Table], budget: analysis.Budget
) -> None:
    assert not next(s for s in budget.steps if s.name == "height noise").present
    rough = 0.05 * np.random.default_rng(8).standard_normal((64, 64))  # slopes of 0.05
    noisy = HeightMap(np.tile(relief(), (2, 2)) + np.tile(rough, (2, 2)), 1.5, 1.5)
    face = Face.from_map(noisy, tiling="periodic", denoise=0.05)
    clean = analysis.explain(replace(pane(), front=face), measured[:1], paths=32_000, aperture_deg=APERTURE)
    order = ("endless", "polarisation", "absorption", "bubbles")
    raw = analysis.explain(
        replace(pane(), front=face.as_measured()),
        measured[:1],
        order=order,
        paths=32_000,
        aperture_deg=APERTURE,
    )
    step = next(s for s in clean.steps if s.name == "height noise")
    np.testing.assert_array_equal(step.before, raw.steps[-1].after)
    # Slopes of noise are gone, and the lobe with them is narrower.
    assert step.effect[0, 1] < -5.0 * step.half_width[0, 1] / 1.96 < 0.0


def test_the_two_largest_steps_are_taken_in_the_other_order_too(budget: analysis.Budget) -> None:
    size = [np.abs(s.effect[:, 0]).mean() for s in budget.steps]
    largest = {budget.steps[k].name for k in np.argsort(size)[-2:]}
    assert {s.name for s in budget.swapped} == largest
    # Absorption takes less where trapped light escapes through the sides: the order matters.
    for s in budget.swapped:
        stated = next(t for t in budget.steps if t.name == s.name)
        assert np.all(np.sign(s.effect[:, 0]) == np.sign(stated.effect[:, 0]))
        assert np.any(np.abs(s.effect - stated.effect) > 0.0)


def test_a_step_for_which_the_pane_holds_nothing_changes_nothing(measured: list[Table]) -> None:
    bare = Slab(3.0, front=Face(relief(), 1.5, 1.5))
    found = analysis.explain(
        bare,
        measured[:1],
        paths=6400,
        order=("endless", "absorption", "bubbles", "micro-relief"),
        aperture_deg=APERTURE,
    )
    assert [s.present for s in found.steps] == [True, False, False, False]
    for s in found.steps[1:]:
        assert not s.effect.any() and not s.se.any()


def test_a_lobe_of_known_width_has_that_width_and_background() -> None:
    """A Gaussian lobe in the angle of deflection: half of it within 0.5 FWHM."""
    rng = np.random.default_rng(5)
    n, fwhm, theta = 400_000, 6.0, 35.0
    d = np.radians(fwhm / 2.0) * np.sqrt(-np.log2(rng.random(n)))
    # A tenth of the light goes aside by 60 degrees.
    d[: n // 10] = np.radians(60.0)
    psi = rng.uniform(0.0, 2.0 * np.pi, n)
    t = np.radians(theta)
    side, out, along = np.sin(d) * np.cos(psi), np.sin(d) * np.sin(psi), np.cos(d)
    ux, uz = side * np.cos(t) - along * np.sin(t), side * np.sin(t) + along * np.cos(t)
    keep = uz > 0.0
    np.testing.assert_allclose(deflection(ux[keep], out[keep], theta), np.degrees(d[keep]), atol=1e-5)
    shape = shape_of_light(
        ux[keep],
        out[keep],
        np.ones(keep.sum()),
        np.zeros(keep.sum(), np.int64),
        theta_deg=theta,
        per_replicate=np.array([float(n)]),
    )
    tau, width, background = shape.mean
    lost = 1.0 - keep.mean()
    assert tau == pytest.approx(1.0 - lost)
    assert background == pytest.approx((0.1 - lost) / (1.0 - lost))
    # Half of all the light, of which nine tenths lie in the lobe.
    share = 0.5 * (1.0 - lost) / 0.9
    assert width == pytest.approx(2.0 * (fwhm / 2.0) * np.sqrt(-np.log2(1.0 - share)), rel=0.01)
    assert ASIDE_DEG < 60.0


def test_relief_finer_than_waves_see_bends_rays_only() -> None:
    """A shallow sinusoid: rays leave in its slopes, of waves J0(k (n - 1) h)^2 goes straight on."""
    height, period, n, wavelength = 0.02, 4.8, 1.52, 0.52
    x = np.arange(64) * (period / 64)
    relief_um = np.tile(height * np.sin(2.0 * np.pi * x / period), (4, 1))
    pane = Slab(1.0, Medium(n), Face(relief_um, period / 64, period / 64))
    lit = tables(Slab(3.0, front=Face.flat(micro_slope=0.02)), paths=20_000)[:1]
    found = analysis.explain(
        pane, lit, order=("tree", "endless", "diffraction"), paths=64_000, aperture_deg=APERTURE
    )
    step = found.steps[-1]
    # Half of the places of a sinusoid are steeper than sin 45 degrees of its steepest; what is reflected
    # inside widens the lobe by two parts in a hundred.
    steepest = np.degrees((n - 1.0) * 2.0 * np.pi * height / period)
    assert step.before[0, 1] == pytest.approx(2.0 * np.sin(np.radians(45.0)) * steepest, rel=0.03)
    assert (np.pi * (n - 1.0) * height / wavelength) ** 2 < 0.02  # nearly all goes straight on
    assert step.after[0, 1] < 0.05
    assert step.effect[0, 0] == 0.0
    assert step.half_width[0, 1] < 0.1


def test_where_the_wave_model_does_not_hold_its_step_is_left_open(budget: analysis.Budget) -> None:
    lit = tables(pane(), 20_000)
    graze = analysis.explain(
        pane(),
        [*lit, replace(lit[1], theta_i_deg=75.0)],
        order=("endless", "diffraction"),
        paths=6400,
        aperture_deg=APERTURE,
    )
    step = graze.steps[1]
    assert graze.theta_deg[-1] == 75.0 and not step.effect[-1].any()
    assert np.all(step.half_width[-1, 1:] >= 1.96 * np.abs(step.effect[:-1, 1:]).max(axis=0))
    with pytest.raises(CoverageError, match="up to 40 degrees"):
        analysis.explain(
            pane(),
            [replace(lit[1], theta_i_deg=75.0)],
            order=("diffraction",),
            paths=6400,
            aperture_deg=APERTURE,
        )


def test_wrong_steps_and_panes_are_refused(measured: list[Table]) -> None:
    with pytest.raises(PhysicsError, match="steps are"):
        analysis.explain(pane(), measured, order=("endless", "endless"))
    with pytest.raises(PhysicsError, match="after the step endless"):
        analysis.explain(pane(), measured, order=("bubbles", "endless"))
    with pytest.raises(PhysicsError, match="relative error"):
        analysis.explain(pane(), measured, unsure={"endless": 0.1})
    with pytest.raises(PhysicsError, match="goes on for ever"):
        analysis.explain(Slab(3.0, patch=Patch(8.0, "clear")), measured)
    with pytest.raises(CoverageError, match="no table"):
        analysis.explain(pane(), [])


def test_the_command_writes_a_figure_and_its_numbers(
    tmp_path: Path, measured: list[Table], capsys: pytest.CaptureFixture[str]
) -> None:
    np.save(tmp_path / "front.npy", relief())
    (tmp_path / "glass.toml").write_text(
        'thickness_mm = 3.0\n[medium]\nabsorption_per_mm = 0.07\n[front]\nheights = "front.npy"\n'
        'pitch_um = 1.5\ntiling = "periodic"\n[back]\nflat = true\n'
    )
    files = [gonio.write(t, tmp_path / f"{k}.dat") for k, t in enumerate(measured)]
    words = ["explain", str(tmp_path / "glass.toml"), *map(str, files), "-o", str(tmp_path / "out")]
    few = ["--order", "endless,absorption", "--paths", "3200", "--aperture-deg", "1.5", "--json", "-q"]
    assert main([*words, *few]) == 0
    found = json.loads(capsys.readouterr().out)
    assert [s["name"] for s in found["steps"]] == ["endless", "absorption"]
    assert found["theta_deg"] == list(THETA)
    rows = Path(found["numbers"]).read_text().splitlines()
    assert len(rows) == 1 + len(THETA) * (2 + 2 + 1)
    assert Path(found["figure"]).read_bytes()[:4] == b"\x89PNG"
    assert main([*words, "--order", "wishes"]) == 2
    assert "wishes" in capsys.readouterr().err
