"""A tabulated model gives back what it was made of, and carries lobes between angles, not blends them."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from specularia.bsdf.tabulated import SideTable, TabulatedModel, cell_centres
from specularia.bsdf.tabulated_io import read_model, write_model
from specularia.errors import CoverageError, FormatError, PhysicsError

FRONT = "transmission_front"
HALF = 0.15


def lobe(theta_deg: float, x, y, width: float = 0.05, lean: float = 0.0):  # type: ignore[no-untyped-def]
    """An analytic lobe around the undeflected direction; `lean` makes left and right differ."""
    s = np.sin(np.radians(theta_deg))
    return np.exp(-((x + s) ** 2 + y**2) / (2 * width**2)) * (1 + lean * np.tanh(y / width)) + 0.02


def tabulate(angles, tau, *, lean: float = 0.0, n: int = 128, m: int = 128) -> SideTable:  # type: ignore[no-untyped-def]
    bx, by = cell_centres(n)
    offset = (np.arange(m) + 0.5) * 2 * HALF / m - HALF
    base, patch = [], []
    for t in angles:
        px, py = np.meshgrid(offset - np.sin(np.radians(t)), offset, indexing="ij")
        base.append(lobe(t, bx, by, lean=lean))
        patch.append(lobe(t, px, py, lean=lean))
    return SideTable(
        theta_i_deg=np.array(angles, float),
        base=np.array(base, np.float32),
        patch=np.array(patch, np.float32),
        half_width=HALF,
        tau=np.array(tau, float),
        tau_se=np.zeros(len(angles)),
        origin="analytic",
    )


@pytest.fixture(scope="module")
def model() -> TabulatedModel:
    table = tabulate([0, 20, 40, 60, 80], [0.8, 0.79, 0.75, 0.6, 0.3], lean=0.3)
    return TabulatedModel(tables={FRONT: table}, band="520 nm")


def integral(model: TabulatedModel, side: str, theta: float) -> float:
    q = model.quadrature(side, theta)
    return float(np.sum(q.weight * model.evaluate(side, theta, 0.0, q.ux, q.uy)))


@pytest.mark.parametrize("theta", [0.0, 20.0, 33.0, 60.0, 71.0, 80.0, 86.0])
def test_the_distribution_integrates_to_tau(model: TabulatedModel, theta: float) -> None:
    expected = float(model.direct_hemispherical(FRONT, theta))
    assert integral(model, FRONT, theta) == pytest.approx(expected, rel=2e-3)


def test_measured_angles_are_exact(model: TabulatedModel) -> None:
    np.testing.assert_allclose(
        model.direct_hemispherical(FRONT, [0, 20, 40, 60, 80]), [0.8, 0.79, 0.75, 0.6, 0.3], rtol=1e-12
    )
    x, y = np.array([-0.6, -0.62, 0.3]), np.array([0.02, -0.05, 0.4])
    theta = 40.0
    truth = lobe(theta, x, y, lean=0.3)
    found = model.evaluate(FRONT, theta, 0.0, x, y)
    np.testing.assert_allclose(found / found[0], truth / truth[0], rtol=5e-3)


def test_quadrature_weights_make_the_hemisphere(model: TabulatedModel) -> None:
    for theta in (0.0, 50.0, 88.0):
        q = model.quadrature(FRONT, theta)
        assert q.weight.sum() == pytest.approx(np.pi, rel=1e-12)
        assert np.all(q.ux**2 + q.uy**2 <= 1 + 1e-12)
        # First moments of a uniform hemisphere vanish, the second is 1/4.
        assert np.sum(q.weight * q.ux) == pytest.approx(0, abs=2e-3)
        assert np.sum(q.weight * q.uy**2) == pytest.approx(np.pi / 4, rel=2e-3)


def test_one_lobe_stays_one_lobe_between_angles(model: TabulatedModel) -> None:
    # Halfway (in the sine) between 20 and 40 degrees the peak stands at the undeflected direction.
    theta = float(np.degrees(np.arcsin(0.5 * (np.sin(np.radians(20)) + np.sin(np.radians(40))))))
    x = np.linspace(-0.75, -0.2, 401)
    section = model.evaluate(FRONT, theta, 0.0, x, 0.0)
    assert x[np.argmax(section)] == pytest.approx(-np.sin(np.radians(theta)), abs=3e-3)
    rising = np.diff(section) > 0
    assert np.count_nonzero(np.diff(rising.astype(int))) == 1


def test_turning_the_light_turns_the_distribution(model: TabulatedModel) -> None:
    x, y = -0.5, 0.07
    for phi in (35.0, 180.0, 290.0):
        c, s = np.cos(np.radians(phi)), np.sin(np.radians(phi))
        turned = model.evaluate(FRONT, 33.0, phi, x * c - y * s, x * s + y * c)
        assert turned == pytest.approx(model.evaluate(FRONT, 33.0, 0.0, x, y), rel=1e-9)


def test_left_and_right_are_not_mirrored(model: TabulatedModel) -> None:
    s = np.sin(np.radians(40.0))
    left, right = (float(model.evaluate(FRONT, 40.0, 0.0, -s, y)) for y in (0.05, -0.05))
    assert left / right == pytest.approx(
        lobe(40, -s, 0.05, lean=0.3) / lobe(40, -s, -0.05, lean=0.3), rel=0.01
    )


def test_the_missing_side_is_answered_by_reciprocity(model: TabulatedModel) -> None:
    assert model.sides == (FRONT, "transmission_back")
    a, b = (35.0, 20.0), (50.0, 140.0)
    ax, ay = (np.sin(np.radians(a[0])) * f(np.radians(a[1])) for f in (np.cos, np.sin))
    bx, by = (np.sin(np.radians(b[0])) * f(np.radians(b[1])) for f in (np.cos, np.sin))
    forth = model.evaluate(FRONT, *a, bx, by)
    back = model.evaluate("transmission_back", *b, ax, ay)
    assert back == pytest.approx(forth, rel=1e-6)
    assert "reciprocity" in model.origin("transmission_back")


def test_directions_outside_are_not_answered_with_zero(model: TabulatedModel) -> None:
    assert np.isnan(model.evaluate(FRONT, 20.0, 0.0, 0.9, 0.9))
    assert np.isnan(model.evaluate(FRONT, 95.0, 0.0, 0.0, 0.0))
    assert np.isnan(model.direct_hemispherical(FRONT, 90.0))
    with pytest.raises(CoverageError, match="reflection front"):
        model.evaluate("reflection_front", 0.0, 0.0, 0.0, 0.0)


def test_beyond_the_last_angle_tau_falls_to_zero_at_the_horizon(model: TabulatedModel) -> None:
    tau = model.direct_hemispherical(FRONT, [80.0, 83.0, 86.0, 89.0, 89.9999])
    assert np.all(np.diff(tau) < 0)
    assert tau[-1] < 2e-3
    assert model.extrapolated_beyond_deg == {FRONT: 80.0}


def test_a_written_model_is_read_back_the_same(model: TabulatedModel, tmp_path: Path) -> None:
    path = write_model(model, tmp_path / "m.nc")
    again = read_model(path)
    x = np.linspace(-0.9, 0.3, 50)
    np.testing.assert_array_equal(again.evaluate(FRONT, 33, 0, x, 0.1), model.evaluate(FRONT, 33, 0, x, 0.1))
    assert again.band == "520 nm"


def test_a_file_of_another_kind_is_refused(tmp_path: Path) -> None:
    import xarray as xr

    xr.Dataset({"a": ("x", np.zeros(3))}).to_netcdf(tmp_path / "x.nc", engine="h5netcdf")
    with pytest.raises(FormatError, match="scattering model"):
        read_model(tmp_path / "x.nc")


def test_tables_that_cannot_be_are_refused() -> None:
    with pytest.raises(PhysicsError, match="ascend"):
        tabulate([20, 0], [0.8, 0.8], n=16, m=16)
    with pytest.raises(PhysicsError, match="tau"):
        tabulate([0, 20], [0.8], n=16, m=16)
