"""What happens to a distribution between two incident angles."""

from __future__ import annotations

import numpy as np
import pytest

from specularia.bsdf import SideTable, TabulatedModel
from specularia.bsdf.tabulated import cell_centres

FRONT = "transmission_front"
HALF, CELLS = 0.15, 160
ANGLES = np.array([0.0, 20.0, 40.0, 60.0, 82.5])


def model_of(density, angles=ANGLES) -> TabulatedModel:  # type: ignore[no-untyped-def]
    """A model with tau = 1/2 whose tables hold density(theta, ux, uy)."""
    bx, by = cell_centres(CELLS)
    offset = (np.arange(CELLS) + 0.5) * 2 * HALF / CELLS - HALF
    base, patch = [], []
    for t in angles:
        px, py = np.meshgrid(offset - np.sin(np.radians(t)), offset, indexing="ij")
        base.append(density(t, bx, by))
        patch.append(density(t, px, py))
    table = SideTable(
        theta_i_deg=np.asarray(angles, float),
        base=np.array(base, np.float32),
        patch=np.array(patch, np.float32),
        half_width=HALF,
        tau=np.full(len(angles), 0.5),
        tau_se=np.zeros(len(angles)),
        origin="analytic",
    )
    return TabulatedModel(tables={FRONT: table}, band="520 nm")


def deflection(theta_deg: float, index: float = 1.52) -> float:
    """Shift of direction cosines per slope, to first order: n cos(theta_t) - cos(theta_i)."""
    s = np.sin(np.radians(theta_deg))
    return float(np.sqrt(index**2 - s * s) - np.sqrt(1.0 - s * s))


def prisms(slope: float):  # type: ignore[no-untyped-def]
    """Small prisms with Gaussian slopes: a lobe whose width goes with `deflection`, of unit integral."""

    def density(theta, x, y):  # type: ignore[no-untyped-def]
        w = slope * deflection(theta)
        r2 = (x + np.sin(np.radians(theta))) ** 2 + y**2
        return np.exp(-0.5 * r2 / w**2) / (2 * np.pi * w**2)

    return density


def width(model: TabulatedModel, theta: float) -> float:
    """Standard deviation across the plane of incidence, through the undeflected direction."""
    y = np.linspace(-0.1, 0.1, 401)
    f = model.evaluate(FRONT, theta, 0.0, -np.sin(np.radians(theta)), y)
    return float(np.sqrt(np.sum(f * y * y) / np.sum(f)))


@pytest.mark.parametrize("theta", [10.0, 30.0, 50.0])
def test_a_population_of_small_prisms_keeps_its_lobe(theta: float) -> None:
    truth, model = prisms(0.03), model_of(prisms(0.03))
    assert width(model, theta) == pytest.approx(0.03 * deflection(theta), rel=0.02)
    q = model.quadrature(FRONT, theta)
    found = model.evaluate(FRONT, theta, 0.0, q.ux, q.uy) / model.direct_hemispherical(FRONT, theta)
    assert np.sum(q.weight * np.abs(found - truth(theta, q.ux, q.uy))) < 0.03


def test_neighbours_at_equal_distance_count_alike() -> None:
    # Two tables whose uniform parts differ: half-way in the angle their geometric mean remains.
    def density(theta, x, y):  # type: ignore[no-untyped-def]
        r2 = (x + np.sin(np.radians(theta))) ** 2 + y**2
        return np.exp(-0.5 * r2 / 0.04**2) + (0.01 if theta < 60 else 0.0004)

    model = model_of(density, np.array([40.0, 60.0]))
    far, peak = model.evaluate(FRONT, 50.0, 0.0, np.array([0.5, -np.sin(np.radians(50.0))]), 0.0)
    assert far / peak == pytest.approx(0.002, rel=0.03)


@pytest.mark.parametrize("theta", [10.0, 50.0, 65.0, 75.0, 81.0])
def test_one_lobe_stays_one_lobe(theta: float) -> None:
    model = model_of(prisms(0.05))
    x = np.linspace(-0.9999, 0.2, 1500)
    section = model.evaluate(FRONT, theta, 0.0, x, 0.0)
    turns = np.diff((np.diff(section) > 1e-9 * section.max()).astype(int))
    assert np.count_nonzero(turns == -1) <= 1
    assert np.count_nonzero(turns == 1) <= 1


def test_the_horizon_stays_where_it_is() -> None:
    # Light that fills the hemisphere to its rim fills it to its rim between the angles, and nothing beyond.
    model = model_of(lambda theta, x, y: np.ones_like(x))
    phi = np.linspace(0.0, 2.0 * np.pi, 60)
    for theta in (10.0, 50.0, 70.0, 80.0, 88.0):
        rim = model.evaluate(FRONT, theta, 0.0, 0.9999 * np.cos(phi), 0.9999 * np.sin(phi))
        tau = float(model.direct_hemispherical(FRONT, theta))
        np.testing.assert_allclose(rim, tau / np.pi, rtol=2e-3)
        assert np.all(np.isnan(model.evaluate(FRONT, theta, 0.0, 1.0001 * np.cos(phi), 1.0001 * np.sin(phi))))


@pytest.mark.parametrize("theta", [20.0, 40.0, 60.0, 82.5])
def test_the_model_goes_smoothly_through_its_angles(theta: float) -> None:
    model = model_of(prisms(0.08))
    q = model.quadrature(FRONT, theta)
    at, below, above = (
        model.evaluate(
            FRONT, theta + d, 0.0, q.ux - np.sin(np.radians(theta + d)) + np.sin(np.radians(theta)), q.uy
        )
        for d in (0.0, -1e-3, 1e-3)
    )
    good = np.isfinite(at) & np.isfinite(below) & np.isfinite(above)
    for other in (below, above):
        assert np.sum((q.weight * np.abs(other - at))[good]) < 2e-3
