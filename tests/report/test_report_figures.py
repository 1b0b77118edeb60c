"""Figures: their numbers are the data, their pictures say what the numbers say."""

from __future__ import annotations

import csv
from pathlib import Path
from types import SimpleNamespace

import matplotlib as mpl
import numpy as np
import pytest
from PIL import Image

from specularia.analysis import TauPoints
from specularia.errors import OutputError
from specularia.gonio import Table
from specularia.report import figures, style
from specularia.report.figures import _hemisphere


def rows_of(path: Path) -> list[dict[str, str]]:
    with path.open(newline="", encoding="utf-8") as f:
        return list(csv.DictReader(f))


def pixels_of(path: Path) -> np.ndarray:
    return np.asarray(Image.open(path).convert("RGB")).astype(int)


def test_dsf_numbers_integrate_to_tau_of_each_model_and_angle(lobe, tmp_path):
    models = {"wide": lobe(width=0.1), "narrow": lobe(width=0.006)}  # full widths of 13 and 0.8 degrees
    path = figures.dsf(models, [0.0, 20.0, 45.0], tmp_path / "dsf.png")
    numbers = np.load(path.with_suffix(".npz"))
    tau = np.nansum(numbers["dsf"] * numbers["solid_angle_sr"], axis=(2, 3))
    assert numbers["solid_angle_sr"].sum() == pytest.approx(2 * np.pi, rel=1e-3)
    np.testing.assert_allclose(tau, 0.7, rtol=0.005)
    assert list(numbers["models"]) == ["wide", "narrow"]
    np.testing.assert_array_equal(numbers["theta_i_deg"], [0.0, 20.0, 45.0])


def test_dsf_of_a_lambertian_model_falls_with_the_cosine(lobe, tmp_path):
    path = figures.dsf({"L": lobe(direct=0.0, even=0.5)}, 0.0, tmp_path / "dsf.png")
    numbers = np.load(path.with_suffix(".npz"))
    centre = 0.5 * (numbers["edge_deg"][1:] + numbers["edge_deg"][:-1])
    middle = centre.size // 2
    polar = np.hypot(centre, centre[middle])
    inside = polar < 89.0
    expected = 0.5 / np.pi * np.cos(np.radians(polar))
    np.testing.assert_allclose(numbers["dsf"][0, 0, middle, inside], expected[inside], rtol=2e-2, atol=2e-5)


def test_dsf_puts_undeflected_light_left_of_the_middle_and_up_above_it(lobe, tmp_path):
    model = lobe(width=0.02, up=0.3)
    path = figures.dsf({"M": model}, 30.0, tmp_path / "dsf.png")
    numbers = np.load(path.with_suffix(".npz"))
    centre = 0.5 * (numbers["edge_deg"][1:] + numbers["edge_deg"][:-1])
    row, column = np.unravel_index(np.nanargmax(numbers["dsf"][0, 0]), numbers["dsf"].shape[2:])
    theta, phi = np.degrees(np.arcsin(np.hypot(0.5, 0.3))), np.arctan2(0.3, -0.5)
    assert centre[column] == pytest.approx(theta * np.cos(phi), abs=1.0)
    assert centre[row] == pytest.approx(theta * np.sin(phi), abs=1.0)
    # The same place in the picture, whose rows run down: bright yellow lies left of and above the middle.
    picture = pixels_of(path)
    height, width, _ = picture.shape
    bright = np.argwhere((picture[..., 0] > 225) & (picture[..., 1] > 180) & (picture[..., 2] < 190))
    bright = bright[bright[:, 1] < 0.75 * width]  # the colour bar stands to the right
    assert bright.size
    assert bright[:, 0].mean() < 0.5 * height
    assert bright[:, 1].mean() < 0.45 * width


def test_angles_without_data_are_hatched_and_not_black(lobe, tmp_path):
    path = figures.dsf({"M": lobe(last_deg=50.0)}, [70.0], tmp_path / "dsf.png")
    assert np.isnan(np.load(path.with_suffix(".npz"))["dsf"]).all()
    picture = pixels_of(path)
    height, width, _ = picture.shape
    panel = picture[int(0.35 * height) : int(0.65 * height), int(0.2 * width) : int(0.5 * width)]
    grey = (np.ptp(panel, axis=2) <= 4) & (panel.mean(axis=2) > 120)
    assert grey.mean() > 0.9


def test_all_dsf_panels_share_a_scale_of_five_decades():
    norm = _hemisphere.scale(np.array([1e-9, 3.0, np.nan]), np.array([40.0, -1.0]))
    assert norm.vmax == pytest.approx(100.0)
    assert np.log10(norm.vmax / norm.vmin) == pytest.approx(5.0)


def cap_table(quantity: str, rng: np.random.Generator) -> Table:
    """Points within 60 degrees of straight through, with a few negative values."""
    theta, phi = np.meshgrid(np.arange(1.0, 60.0, 1.0), np.arange(0.0, 360.0, 1.0))
    values = rng.normal(0.1, 0.05, theta.size)
    return Table(
        file="cap.txt",
        quantity=quantity,
        side="transmission_front",
        theta_i_deg=0.0,
        phi_i_deg=0.0,
        theta_s_deg=180.0 - theta.ravel(),
        phi_s_deg=phi.ravel(),
        values=values,
    )


def test_measured_dsf_keeps_every_point_and_turns_bsdf_into_dsf(tmp_path):
    rng = np.random.default_rng(1)
    plain, divided = cap_table("DSF", rng), cap_table("BSDF", rng)
    path = figures.measured_dsf([plain, divided], tmp_path / "measured.png")
    numbers = np.load(path.with_suffix(".npz"))
    np.testing.assert_array_equal(numbers["dsf_0"], plain.values)
    np.testing.assert_allclose(
        numbers["dsf_1"], divided.values * np.abs(np.cos(np.radians(divided.theta_s_deg)))
    )
    np.testing.assert_array_equal(numbers["theta_s_deg_0"], plain.theta_s_deg)
    assert (numbers["dsf_0"] < 0).any()


def test_measured_directions_beyond_the_points_are_no_data(tmp_path):
    path = figures.measured_dsf([cap_table("DSF", np.random.default_rng(2))], tmp_path / "measured.png")
    picture = pixels_of(path)
    # The hatched ring between 60 and 90 degrees is 5/9 of the disk.
    dark = picture.mean(axis=2) < 235
    grey = dark & (np.ptp(picture, axis=2) <= 4) & (picture.mean(axis=2) > 120)
    coloured = np.ptp(picture, axis=2) > 30
    assert 0.8 < grey.sum() / coloured.sum() < 1.6


def test_tau_curves_write_what_they_draw(lobe, tmp_path):
    measured = TauPoints(np.array([0.0, 40.0]), np.array([0.7, 0.58]), np.array([0.002, 0.003]))
    path = figures.tau_curves(
        {"Model M": lobe()}, tmp_path / "tau.png", measured=measured, slab=([0.0, 80.0], [0.92, 0.4])
    )
    rows = rows_of(path.with_suffix(".csv"))
    points = [
        (float(r["theta_i_deg"]), float(r["tau"]), float(r["se"])) for r in rows if r["series"] == "measured"
    ]
    assert points == [(0.0, 0.7, 0.002), (40.0, 0.58, 0.003)]
    assert [float(r["tau"]) for r in rows if r["series"] == "clear slab"] == [0.92, 0.4]
    model = [r for r in rows if r["series"] == "Model M"]
    assert {r["extrapolated"] for r in model if float(r["theta_i_deg"]) <= 60.0} == {"0"}
    assert {r["extrapolated"] for r in model if float(r["theta_i_deg"]) > 60.0} == {"1"}
    assert all(float(r["tau"]) == pytest.approx(0.7) for r in model)


def test_sections_hold_the_dsf_in_the_plane_of_incidence(lobe, tmp_path):
    model = lobe(width=0.05)
    path = figures.sections({"M": model}, [30.0], tmp_path / "sections.png")
    rows = rows_of(path.with_suffix(".csv"))
    peak = max(rows, key=lambda r: float(r["dsf"]))
    assert float(peak["theta_s_signed_deg"]) == pytest.approx(-30.0, abs=0.6)
    u = np.sin(np.radians(float(peak["theta_s_signed_deg"])))
    expected = model.evaluate("transmission_front", 30.0, 0.0, u, 0.0) * np.sqrt(1 - u * u)
    assert float(peak["dsf"]) == pytest.approx(float(expected))


def test_height_maps_and_micrographs_keep_the_data_and_their_missing_points(tmp_path):
    rng = np.random.default_rng(3)
    heights = rng.normal(size=(40, 60))
    heights[5:8, 10:20] = np.nan
    surface = SimpleNamespace(heights_um=heights, pitch_x_um=1.5, pitch_y_um=2.0)
    path = figures.height_maps({"front": surface}, tmp_path / "heights.png")
    numbers = np.load(path.with_suffix(".npz"))
    np.testing.assert_array_equal(numbers["heights_um_0"], heights.astype(np.float32))
    assert (numbers["pitch_x_um_0"], numbers["pitch_y_um_0"]) == (1.5, 2.0)
    image = rng.integers(0, 255, (30, 30)).astype(np.uint8)
    path = figures.micrographs({"front": image}, 1.5, tmp_path / "micro.png")
    np.testing.assert_array_equal(np.load(path.with_suffix(".npz"))["image_0"], image)


def test_micrographs_of_faces_seen_at_different_magnification_keep_their_own_scale(tmp_path):
    images = {"front": np.eye(30), "back": np.eye(30)}
    path = figures.micrographs(images, {"front": 1.5, "back": 0.75}, tmp_path / "micro.png")
    numbers = np.load(path.with_suffix(".npz"))
    assert (numbers["pitch_um_0"], numbers["pitch_um_1"]) == (1.5, 0.75)


def luminance_image(model: str, values: np.ndarray) -> SimpleNamespace:
    return SimpleNamespace(model=model, name="view", luminance=values, pixels={"floor": (30.5, 40.5)})


def test_luminance_maps_write_the_data_and_label_the_points(tmp_path):
    values = np.random.default_rng(4).lognormal(4.0, 1.0, (60, 80))
    points = [
        SimpleNamespace(name="floor", model="M", illuminance_lx=1930.0, se=6.0),
        SimpleNamespace(name="behind", model="M", illuminance_lx=84.0, se=1.0),
    ]
    images = [luminance_image("M", values), luminance_image("C", 2 * values)]
    path = figures.luminance_maps(images, tmp_path / "lum.png", points=points)
    numbers = np.load(path.with_suffix(".npz"))
    np.testing.assert_allclose(numbers["luminance_0"], values, rtol=1e-6)
    np.testing.assert_allclose(numbers["luminance_1"], 2 * values, rtol=1e-6)
    np.testing.assert_array_equal(numbers["point_illuminance_lx"], [1930.0, 84.0])
    assert list(numbers["point_name"]) == ["floor", "behind"]


def test_one_luminance_has_one_colour_in_all_panels(tmp_path):
    same, brighter = np.full((60, 80), 50.0), np.full((60, 80), 50.0)
    brighter[:10] = 5000.0
    path = figures.luminance_maps(
        [luminance_image("M", same), luminance_image("C", brighter)], tmp_path / "lum.png"
    )
    picture = pixels_of(path)
    width = picture.shape[1]

    def commonest(half: np.ndarray) -> tuple[int, ...]:
        flat = half.reshape(-1, 3)
        flat = flat[flat.min(axis=1) < 200]
        colours, counts = np.unique(flat, axis=0, return_counts=True)
        return tuple(colours[np.argmax(counts)])

    assert commonest(picture[:, : int(0.4 * width)]) == commonest(
        picture[:, int(0.5 * width) : int(0.85 * width)]
    )


def test_a_figure_is_the_same_from_run_to_run_and_leaves_global_settings_alone(lobe, tmp_path):
    before = dict(mpl.rcParams)
    first = figures.tau_curves({"M": lobe()}, tmp_path / "a.png").read_bytes()
    assert figures.tau_curves({"M": lobe()}, tmp_path / "b.png").read_bytes() == first
    assert dict(mpl.rcParams) == before


def test_a_synthetic_figure_says_so(lobe, tmp_path):
    plain = pixels_of(figures.tau_curves({"M": lobe()}, tmp_path / "a.png"))
    labelled = pixels_of(figures.tau_curves({"M": lobe()}, tmp_path / "b.png", synthetic=True))
    rust = (labelled[..., 0] > 120) & (labelled[..., 1] < 90) & (labelled[..., 2] < 60)
    lower_right = rust[int(0.9 * rust.shape[0]) :, int(0.7 * rust.shape[1]) :]
    assert lower_right.sum() > 50
    assert plain.shape == labelled.shape


def test_a_figure_that_cannot_be_written_leaves_nothing(lobe, tmp_path):
    with pytest.raises(OutputError):
        figures.tau_curves({"M": lobe()}, tmp_path / "missing" / "tau.png")
    assert list(tmp_path.iterdir()) == []


def test_panels_are_lettered_on_past_the_alphabet():
    assert [style.letter(k) for k in (0, 25, 26, 27)] == ["(a)", "(z)", "(aa)", "(ab)"]


def test_ratios_of_luminances_are_written_and_left_out_where_both_are_dark(tmp_path):
    first = np.full((40, 60), 100.0)
    first[:5], first[5:10] = 1e-4, 0.0
    second = 1.8 * first
    images = [luminance_image("M", first), luminance_image("C", second)]
    path = figures.luminance_ratios(images, tmp_path / "ratio.png")
    numbers = np.load(path.with_suffix(".npz"))
    ratio = numbers["ratio_0"]
    assert np.isnan(ratio[:10]).all()
    np.testing.assert_allclose(ratio[10:], 1.8, rtol=1e-6)
    assert list(numbers["models_0"]) == ["M", "C"]
    # Red, and as much so as 1.8 is on a scale that ends at 2.
    picture = pixels_of(path)
    red = (picture[..., 0] > 1.5 * picture[..., 1]) & (picture[..., 0] > 1.5 * picture[..., 2])
    assert red.mean() > 0.2


def test_outside_its_circle_a_fisheye_is_white(tmp_path):
    y, x = np.mgrid[-1:1:80j, -1:1:80j]
    values = np.where(x**2 + y**2 < 1, 50.0, 0.0)
    image = luminance_image("M", values)
    image.view = SimpleNamespace(kind="fisheye")
    picture = pixels_of(figures.luminance_maps([image], tmp_path / "eye.png"))
    rows, columns = picture.shape[:2]
    assert (picture[int(0.13 * rows), int(0.03 * columns)] == 255).all()
    assert (picture[rows // 2, int(0.35 * columns)] < 250).any()


def grid_result(model: str, factor: float) -> SimpleNamespace:
    along, across = np.array([0.5, 1.5, 2.5]), np.array([0.5, 1.5])
    x, y = np.meshgrid(1.0 + along, 2.0 + across)
    values = factor * np.array([[100.0, 300.0, 100.0], [50.0, 80.0, 50.0]])
    return SimpleNamespace(
        model=model,
        name="g",
        along_m=along,
        across_m=across,
        points_m=np.stack([x, y, 0.8 + 0 * x], axis=-1),
        normal=np.array([0, 0, 1.0]),
        illuminance_lx=values,
        se=0.01 * values,
        mean_lx=values.mean(),
        min_lx=values.min(),
        daylight_factor_percent=values / 100.0,
    )


def test_plans_and_ratios_of_illuminance_write_the_data(tmp_path):
    grids = [grid_result("M", 1.0), grid_result("C", 1.25)]
    plan = np.load(figures.illuminance_plans(grids, tmp_path / "plan.png").with_suffix(".npz"))
    np.testing.assert_array_equal(plan["illuminance_lx_1"], grids[1].illuminance_lx)
    np.testing.assert_array_equal(plan["daylight_factor_percent_0"], grids[0].daylight_factor_percent)
    ratio = np.load(figures.illuminance_ratios(grids, tmp_path / "ratio.png").with_suffix(".npz"))
    np.testing.assert_allclose(ratio["ratio_0"], 1.25)
