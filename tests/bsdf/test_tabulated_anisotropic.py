"""Tabulated models with several azimuths of incidence: rings of nodes, mirrors, errors, intervals."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from specularia import bsdf
from specularia.bsdf import SideTable, TabulatedModel
from specularia.bsdf.azimuth import azimuth_loss, turned_mean
from specularia.bsdf.tabulated import cell_centres
from specularia.errors import FormatError, PhysicsError, SpeculariaWarning
from specularia.files import read_netcdf, write_netcdf

FRONT = "transmission_front"
HALF = 0.15


def lobe(theta: float, phi: float, ux: Any, uy: Any, lean: float = 0.0) -> Any:
    """An elongated lobe along 25 degrees of the sample, in its own frame; `lean` makes its ends differ."""
    s, p, a = np.sin(np.radians(theta)), np.radians(phi), np.radians(25.0)
    dx, dy = ux + s * np.cos(p), uy + s * np.sin(p)
    along, across = (dx * np.cos(a) + dy * np.sin(a)) / 0.07, (dy * np.cos(a) - dx * np.sin(a)) / 0.035
    return np.exp(-0.5 * (along**2 + across**2)) * (1.0 + lean * np.tanh(along)) + 0.02


def side_table(thetas: Any, phis: Any, *, lean: float = 0.0, n: int = 96, **options: Any) -> SideTable:
    bx, by = cell_centres(n)
    offset = (np.arange(n) + 0.5) * 2 * HALF / n - HALF
    theta, phi, base, patch = [], [], [], []
    for t in thetas:
        for p in phis if t > 0 else phis[:1]:
            c, s = np.cos(np.radians(p)), np.sin(np.radians(p))
            px, py = np.meshgrid(offset - np.sin(np.radians(t)), offset, indexing="ij")
            base.append(lobe(t, p, bx * c - by * s, bx * s + by * c, lean))
            patch.append(lobe(t, p, px * c - py * s, px * s + py * c, lean))
            theta.append(t)
            phi.append(p)
    options = {"symmetry": "none", "tau": 0.8 - 0.004 * np.array(theta)} | options
    return SideTable(
        theta_i_deg=np.array(theta, float),
        phi_i_deg=np.array(phi, float),
        base=np.array(base, np.float32),
        patch=np.array(patch, np.float32),
        half_width=HALF,
        tau_se=np.full(len(theta), 1e-3),
        origin="analytic",
        base_se=0.01 * np.array(base, np.float32),
        patch_se=0.01 * np.array(patch, np.float32),
        **options,
    )


def points(theta: float, phi: float) -> tuple[Any, Any]:
    """Directions around the undeflected one."""
    k = np.linspace(-0.12, 0.12, 25)
    dx, dy = np.meshgrid(k, k)
    s, p = np.sin(np.radians(theta)), np.radians(phi)
    return dx - s * np.cos(p), dy - s * np.sin(p)


def far(model: TabulatedModel, theta: float, phi: float, lean: float, mirror: bool = False) -> float:
    """Largest difference from the lobe around its peak, both scaled to the same sum, over the peak."""
    x, y = points(theta, phi)
    found, exact = model.evaluate(FRONT, theta, phi, x, y), lobe(theta, phi, x, y, lean)
    exact = exact[::-1, ::-1] if mirror else exact
    return float(np.max(np.abs(found / found.sum() - exact / exact.sum())) / np.max(exact / exact.sum()))


AZIMUTHS = (10.0, 70.0, 130.0, 190.0, 250.0, 310.0)


@pytest.fixture(scope="module")
def model() -> TabulatedModel:
    return TabulatedModel({FRONT: side_table((0.0, 25.0, 50.0), AZIMUTHS, lean=0.5)}, band="520 nm")


def test_an_elongated_lobe_keeps_its_direction_on_the_sample(model: TabulatedModel) -> None:
    for theta, phi in ((25.0, 70.0), (25.0, 100.0), (50.0, 340.0), (0.0, 200.0), (37.0, 163.0), (12.0, 5.0)):
        assert far(model, theta, phi, 0.5) < 0.04, (theta, phi)
        assert far(model, theta, phi, 0.5, mirror=True) > 0.15


def test_light_along_the_normal_has_no_azimuth(model: TabulatedModel) -> None:
    x, y = points(0.0, 0.0)
    first = model.evaluate(FRONT, 0.0, 0.0, x, y)
    for phi in (90.0, 213.0):
        np.testing.assert_allclose(model.evaluate(FRONT, 0.0, phi, x, y), first, rtol=1e-4)
    near = model.evaluate(FRONT, 1e-3, 213.0, x, y)
    np.testing.assert_allclose(near, first, rtol=2e-3)


def test_it_is_continuous_over_azimuth_and_over_a_full_turn(model: TabulatedModel) -> None:
    phi = np.arange(-30.0, 391.0, 0.02)
    for x, y in ((0.1, -0.2), (-0.3, 0.35), (0.0, 0.0)):
        value = model.evaluate(FRONT, 30.0, phi, x, y)
        # Where the lobe passes, a step is 0.00017 of direction cosine in a width of 0.035.
        assert np.max(np.abs(np.diff(value))) < 0.005 * value.max()
    np.testing.assert_allclose(
        model.evaluate(FRONT, 30.0, 17.0, 0.1, 0.1), model.evaluate(FRONT, 30.0, 377.0, 0.1, 0.1), rtol=1e-9
    )


@pytest.mark.parametrize(("theta", "phi"), [(25.0, 70.0), (40.0, 95.0), (10.0, 355.0), (60.0, 20.0)])
def test_the_distribution_integrates_to_tau(model: TabulatedModel, theta: float, phi: float) -> None:
    q = model.quadrature(FRONT, theta, phi)
    total = np.sum(q.weight * model.evaluate(FRONT, theta, phi, q.ux, q.uy))
    assert total == pytest.approx(float(model.direct_hemispherical(FRONT, theta, phi)), rel=3e-3)


def test_tau_follows_the_azimuth() -> None:
    table = side_table((0.0, 40.0), (0.0, 90.0, 180.0, 270.0), n=24)
    model = TabulatedModel(
        {FRONT: replace(table, tau=np.array([0.8, 0.66, 0.54, 0.66, 0.54]))}, band="520 nm"
    )
    tau = model.direct_hemispherical(FRONT, 40.0, [0.0, 90.0, 180.0, 360.0, 45.0])
    np.testing.assert_allclose(tau, [0.66, 0.54, 0.66, 0.66, 0.60], rtol=1e-9)
    assert model.direct_hemispherical(FRONT, 0.0, 77.0) == pytest.approx(0.8)
    # What turns twice in a round could hide from four azimuths: half-way between them the interval says so.
    low, high = model.tau_interval(FRONT, 40.0, [0.0, 45.0])
    assert high[0] - low[0] == pytest.approx(2 * 1.96e-3, rel=0.2)
    assert high[1] - low[1] == pytest.approx(2 * 1.96 * 0.06, rel=0.05)


def test_a_mirror_plane_saves_half_of_the_azimuths() -> None:
    """A lobe along 25 degrees is its own image in that plane."""
    whole = TabulatedModel({FRONT: side_table((0.0, 40.0), 25.0 + np.arange(0, 360, 45))}, band="x")
    half = side_table((0.0, 40.0), 25.0 + np.arange(0, 181, 45), symmetry="bilateral", mirror_deg=25.0)
    mirrored = TabulatedModel({FRONT: half}, band="x")
    rng = np.random.default_rng(0)
    r, a = 0.98 * np.sqrt(rng.random(500)), 2 * np.pi * rng.random(500)
    for theta, phi in ((40.0, 70.0), (40.0, 300.0), (20.0, 280.0), (40.0, 185.0)):
        one, two = (m.evaluate(FRONT, theta, phi, r * np.cos(a), r * np.sin(a)) for m in (whole, mirrored))
        np.testing.assert_allclose(two, one, rtol=0.01, atol=2e-3 * one.max())


def test_the_missing_side_is_answered_by_reciprocity(model: TabulatedModel) -> None:
    a, b = (35.0, 20.0), (40.0, 240.0)
    ax, ay, bx, by = (np.sin(np.radians(t)) * f(np.radians(p)) for t, p in (a, b) for f in (np.cos, np.sin))
    assert model.evaluate("transmission_back", *b, ax, ay) == pytest.approx(
        model.evaluate(FRONT, *a, bx, by), rel=1e-6
    )


def test_errors_are_those_of_the_tables_and_grow_between_them(model: TabulatedModel) -> None:
    def relative(theta: float, phi: float) -> float:
        x, y = points(theta, phi)
        return float(
            np.nanmedian(
                model.standard_error(FRONT, theta, phi, x, y) / model.evaluate(FRONT, theta, phi, x, y)
            )
        )

    assert relative(25.0, 70.0) == pytest.approx(0.01, rel=0.05)
    assert relative(60.0, 70.0) > 0.01 and relative(75.0, 70.0) > relative(60.0, 70.0)
    isotropic = replace(model.tables[FRONT], base_se=None)
    unknown = TabulatedModel({FRONT: isotropic}, band="x")
    assert np.isnan(unknown.standard_error(FRONT, 25.0, 70.0, 0.0, 0.0))
    assert np.isnan(model.standard_error(FRONT, 25.0, 70.0, 0.9, 0.9))


def test_the_interval_of_tau_is_that_of_noise_at_the_angles_and_widens(model: TabulatedModel) -> None:
    low, high = model.tau_interval(FRONT, [25.0, 37.0, 50.0, 70.0], 70.0)
    tau = model.direct_hemispherical(FRONT, [25.0, 37.0, 50.0, 70.0], 70.0)
    assert np.all((low < tau) & (tau < high))
    width = high - low
    assert width[0] == pytest.approx(2 * 1.96e-3, rel=0.1) and width[2] == pytest.approx(2 * 1.96e-3, rel=0.1)
    assert width[3] > 3 * width[2]
    narrow = np.subtract(*model.tau_interval(FRONT, 25.0, 70.0, level=0.5)[::-1])
    assert narrow < 0.5 * width[0]
    low, high = model.tau_interval("transmission_back", 30.0, 70.0)
    assert low < model.direct_hemispherical("transmission_back", 30.0, 70.0) < high
    assert np.isnan(model.tau_interval(FRONT, 95.0)[0])


def test_info_tells_a_model_with_azimuths_from_an_isotropic_one(
    model: TabulatedModel, tmp_path: Path, command: Any
) -> None:
    path = bsdf.write_model(model, tmp_path / "m.nc")
    code, out, _ = command("bsdf", "info", str(path), "--json")
    assert code == 0
    assert out["rank"] == 4


def test_files_hold_all_of_it_and_earlier_ones_are_still_read(model: TabulatedModel, tmp_path: Path) -> None:
    half = side_table((0.0, 40.0), (100.0, 190.0, 280.0), symmetry="bilateral", mirror_deg=100.0, n=24)
    both = TabulatedModel({FRONT: model.tables[FRONT], "reflection_front": half}, band="520 nm")
    again = bsdf.read_model(bsdf.write_model(both, tmp_path / "m.nc"))
    for side, table in both.tables.items():
        found = again.tables[side]
        for name in ("theta_i_deg", "phi_i_deg", "base", "patch", "base_se", "patch_se", "tau", "tau_se"):
            np.testing.assert_array_equal(getattr(found, name), getattr(table, name))
        assert (found.symmetry, found.mirror_deg) == (table.symmetry, table.mirror_deg)

    table = model.tables[FRONT]
    first = np.unique(table.theta_i_deg, return_index=True)[1]
    cut = {n: getattr(table, n)[first] for n in ("theta_i_deg", "base", "patch", "base_se", "tau", "tau_se")}
    one_azimuth = replace(table, patch_se=None, symmetry="isotropic", phi_i_deg=None, **cut)
    isotropic = TabulatedModel({FRONT: one_azimuth}, band="520 nm")
    groups = read_netcdf(bsdf.write_model(isotropic, tmp_path / "new.nc"))
    root = dict(groups.pop("/").attrs)
    del groups[FRONT].attrs["symmetry"]
    old = write_netcdf(tmp_path / "old.nc", groups, {**root, "format": "specularia scattering model 1"})
    x, y = points(30.0, 0.0)
    np.testing.assert_array_equal(
        bsdf.read_model(old).evaluate(FRONT, 30.0, 0.0, x, y), isotropic.evaluate(FRONT, 30.0, 0.0, x, y)
    )
    later = write_netcdf(tmp_path / "later.nc", groups, {**root, "format": "specularia scattering model 9"})
    with pytest.raises(FormatError, match="version 9"):
        bsdf.read_model(later)


def test_a_tree_of_rank_3_says_what_averaging_over_azimuth_loses(tmp_path: Path) -> None:
    wide = TabulatedModel(
        {"reflection_front": side_table((0.0, 45.0), (0.0, 90.0, 180.0, 270.0), n=24)}, band="Visible"
    )
    assert 0.05 < azimuth_loss(wide, "reflection_front") < 0.6
    with pytest.warns(SpeculariaWarning, match=r"not isotropic.*mean over azimuth.*tensor4"):
        written = bsdf.write(wide, tmp_path / "m.xml", resolution=3, basis="tensor3")
    assert azimuth_loss(written.model, "reflection_front") == 0.0


def test_a_turning_sample_shows_the_mean_over_its_azimuths(model: TabulatedModel) -> None:
    mean = turned_mean(model)
    assert mean.isotropic and turned_mean(mean) is mean
    for theta in (0.0, 25.0, 50.0):
        x, y = points(theta, 0.0)
        exact = np.zeros(x.shape)
        for phi in np.arange(0.5, 360.0, 1.0):
            c, s = np.cos(np.radians(phi)), np.sin(np.radians(phi))
            exact += lobe(theta, phi, x * c - y * s, x * s + y * c, 0.5)
        found = mean.evaluate(FRONT, theta, 0.0, x, y)
        difference = np.abs(found / found.sum() - exact / exact.sum())
        assert np.max(difference) < 0.04 * np.max(exact / exact.sum())
        assert float(mean.direct_hemispherical(FRONT, theta)) == pytest.approx(0.8 - 0.004 * theta, rel=1e-6)


def test_a_file_of_an_anisotropic_model_keeps_its_azimuths(model: TabulatedModel, tmp_path: Path) -> None:
    written = bsdf.write(model, tmp_path / "m.xml", resolution=4).model
    assert isinstance(written, bsdf.XmlModel) and written.rank == 4
    assert isinstance(bsdf.convert(model, resolution=3), bsdf.XmlModel)
    assert bsdf.convert(model, resolution=3).rank == 4


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"symmetry": "isotropic"}, "azimuths of incidence"),
        ({"symmetry": "round"}, "symmetry must be"),
        ({"phi_i_deg": np.array([0.0, 90.0, 400.0])}, "within 0 to 360"),
        ({"phi_i_deg": np.array([0.0, 90.0, 90.0])}, "ascend in each ring"),
        ({"patch_se": np.zeros((3, 8, 9), np.float32)}, "patch_se must have"),
        ({"symmetry": "bilateral", "mirror_deg": 30.0}, "within 30 to 210"),
    ],
)
def test_tables_that_cannot_be_are_refused(change: dict[str, Any], message: str) -> None:
    good = side_table((0.0, 40.0), (0.0, 90.0), n=8)
    with pytest.raises(PhysicsError, match=message):
        replace(good, **change)


def test_a_tree_of_rank_4_has_the_moments_of_both_sides(tmp_path: Path) -> None:
    """Means over all pairs of directions, weighted so that any flip, turn or exchange of sides shows."""
    theta, phi, base = [], [], []
    bx, by = cell_centres(32)
    for t, p in [(0.0, 0.0), *((t, p) for t in (30.0, 60.0) for p in np.arange(8) * 45.0)]:
        # A wedge, which shifts the lobe towards (0.3, 0.2) wherever the light comes from.
        c, d = np.cos(np.radians(p)), np.sin(np.radians(p))
        dx, dy = bx + np.sin(np.radians(t)) - 0.3 * c - 0.2 * d, by - 0.2 * c + 0.3 * d
        base.append(np.exp(-0.5 * (dx * dx + dy * dy) / 0.2**2) + 0.02)
        theta.append(t)
        phi.append(float(p))
    tables = SideTable(
        theta_i_deg=np.array(theta),
        phi_i_deg=np.array(phi),
        base=np.array(base, np.float32),
        patch=np.array(base, np.float32)[:, :2, :2],
        half_width=1e-6,
        tau=np.full(len(theta), 0.7),
        tau_se=np.full(len(theta), 1e-3),
        origin="analytic",
        symmetry="none",
    )
    own = TabulatedModel({FRONT: tables}, band="Visible")
    tree = bsdf.read(bsdf.write(own, tmp_path / "t.xml", resolution=3, basis="tensor4").path)
    rng = np.random.default_rng(5)
    r, turn = np.sqrt(rng.random((2, 50_000))) * 0.98, rng.random((2, 50_000)) * 2 * np.pi
    (ix, x), (iy, y) = r * np.cos(turn), r * np.sin(turn)
    at = np.degrees(np.arcsin(r[0])), np.degrees(turn[0])
    weights = np.stack([np.ones_like(x), x, y, ix, iy, x * ix, y * iy, x * iy, y * ix, x * y, ix * iy])
    found = []
    for side in (FRONT, "transmission_back"):
        expected, got = (
            (weights * np.nan_to_num(m.evaluate(side, *at, x, y))).mean(axis=1) for m in (own, tree)
        )
        np.testing.assert_allclose(got, expected, atol=0.02 * expected[0])
        found.append(expected / expected[0])
    # An exchange of the sides, or a flip of either coordinate, would show.
    assert np.abs(found[0] - found[1]).max() > 0.1
    assert min(np.abs(found[0][[1, 2]]).min(), np.abs(found[1][[3, 4]]).min()) > 0.05
