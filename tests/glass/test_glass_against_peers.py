"""The tracer against an independent reference: other geometry (Embree), other polarisation (Jones in
space)."""

import numpy as np
import pytest
from glass_reference import smooth_map, transmission_of_bubbles, transmission_of_relief

from specularia.glass import Bubbles, Face, Slab, trace


@pytest.fixture(scope="module")
def rough_slab() -> Slab:
    """Two faces of different periods, neither square nor a power of two."""
    return Slab(
        thickness_mm=0.4,
        front=Face(smooth_map((44, 60), seed=1, rms_slope=0.45), 1.5, 1.5),
        back=Face(smooth_map((52, 38), seed=2, rms_slope=0.6), 1.5, 1.5),
    )


@pytest.mark.parametrize(("theta", "phi", "polarised"), [(0.0, 0.0, False), (60.0, 25.0, True)])
def test_rough_slab_transmits_as_the_same_mesh_in_embree(rough_slab, theta, phi, polarised):
    pytest.importorskip("embreex")
    paths = 60_000
    reference, se, lost = transmission_of_relief(
        rough_slab, theta_deg=theta, phi_deg=phi, paths=paths, seed=5, polarised=polarised
    )
    assert lost < 1e-4
    ours = trace(rough_slab, theta_deg=[theta], phi_deg=phi, paths=400_000, seed=3, polarised=polarised)
    error = np.hypot(ours.tau_se[0], se)
    assert error < 0.002
    assert abs(ours.tau[0] - reference) < 3 * error


@pytest.mark.parametrize(("theta", "polarised"), [(0.0, False), (50.0, True)])
def test_bubbles_scatter_as_ellipsoids_in_a_flat_pane(theta, polarised):
    # Large, elongated, oblique, and one of them across the border of the cell.
    bubbles = Bubbles(
        centre_mm=[[0.5, 0.5, 0.1], [1.4, 1.3, -0.1], [1.98, 0.6, 0.0]],
        long_mm=[0.28, 0.30, 0.2],
        short_mm=[0.28, 0.12, 0.15],
        axis=[[0, 0, 1], [1, 2, 0.5], [0, 1, 1]],
        cell_mm=(2.0, 1.9),
    )
    slab = Slab(thickness_mm=1.0, bubbles=bubbles)
    paths = 30_000
    reference = transmission_of_bubbles(
        slab, bubbles, theta_deg=theta, paths=paths, seed=7, polarised=polarised
    )
    ours = trace(slab, theta_deg=[theta], paths=400_000, seed=3, polarised=polarised)
    error = np.hypot(ours.tau_se[0], np.sqrt(reference * (1 - reference) / paths))
    assert abs(ours.tau[0] - reference) < 3 * error
    without = trace(Slab(thickness_mm=1.0), theta_deg=[theta], paths=64_000, polarised=polarised)
    assert abs(ours.tau[0] - without.tau[0]) > 8 * error
