"""Model C of a synthetic specimen: right on its true faces, and the microscope takes little from it."""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from specularia import surface
from specularia.glass import Face, Medium, Slab, trace
from specularia.twin import TwinSettings, make_face, make_slab, microscope

THETA = [0.0, 40.0, 82.5]


@pytest.fixture(scope="module")
def specimen():  # type: ignore[no-untyped-def]
    """Faces of 384 um (the default's pits, a smaller field), clear and without bubbles."""
    settings = TwinSettings.model_validate({"maps": {"pixels": 256}})
    rng = np.random.default_rng(11)
    faces = {name: make_face(getattr(settings, name), settings.maps, rng) for name in ("front", "back")}
    slab = make_slab(faces, settings, seed=1)
    return settings, faces, replace(slab, medium=Medium(index=slab.medium.index_at(520.0)), bubbles=None)


def test_true_faces_transmit_as_the_same_mesh_in_embree(specimen) -> None:  # type: ignore[no-untyped-def]
    pytest.importorskip("embreex")
    sys.path.insert(0, str(Path(__file__).parents[1] / "glass"))
    try:
        from glass_reference import reliefs, transmission_of_relief
    finally:
        sys.path.pop(0)
    slab, paths = specimen[2], 40_000
    meshes = reliefs(slab)
    for theta in THETA:
        reference, se, lost = transmission_of_relief(
            slab, theta_deg=theta, phi_deg=0.0, paths=paths, seed=2, polarised=True, faces=meshes
        )
        assert lost < 1e-4
        ours = trace(slab, theta_deg=[theta], phi_deg=0.0, paths=400_000, seed=3)
        error = np.hypot(ours.tau_se[0], se)
        assert error < 0.003
        assert abs(ours.tau[0] - reference) < 3 * error


def test_faces_seen_by_the_microscope_transmit_as_the_true_ones(specimen, tmp_path: Path) -> None:  # type: ignore[no-untyped-def]
    settings, faces, slab = specimen
    seen = {}
    for name, face in faces.items():
        stack = microscope.focus_stack(
            face.decayed_um,
            settings.microscope,
            pitch_um=settings.maps.pitch_um,
            rng=np.random.default_rng(5),
        )
        path = microscope.write_stack(
            stack, tmp_path / f"{name}.tif", pitch_um=settings.maps.pitch_um, label="synthetic"
        )
        filled, missing = surface.filled(surface.heights(path))
        assert missing < 0.01 * filled.heights_um.size
        seen[name] = Face.from_map(filled, tiling="periodic")
    through = {}
    for key, pane in {"true": slab, "seen": Slab(3.0, slab.medium, seen["front"], seen["back"])}.items():
        through[key] = trace(pane, theta_deg=THETA, phi_deg=0.0, paths=400_000, seed=7)
    np.testing.assert_allclose(through["seen"].tau, through["true"].tau, rtol=0.02)
