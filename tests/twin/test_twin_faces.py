"""Faces of the twin: what was set is what comes out."""

from __future__ import annotations

import numpy as np
import pytest

from specularia.errors import PhysicsError
from specularia.twin.faces import FaceTruth, make_face, pristine
from specularia.twin.settings import BackSettings, FaceSettings, MapSettings

KINDS = {"front": FaceSettings(), "back": BackSettings()}


@pytest.fixture(scope="module")
def faces() -> dict[str, FaceTruth]:
    return {name: make_face(s, MapSettings(), np.random.default_rng(3)) for name, s in KINDS.items()}


@pytest.mark.parametrize("name", KINDS)
def test_share_and_relief_are_the_set_ones(faces: dict[str, FaceTruth], name: str) -> None:
    face, wanted = faces[name], KINDS[name]
    assert abs(face.pitted.mean() - wanted.pitted_share) <= 0.01
    assert np.ptp(face.decayed_um) == pytest.approx(wanted.relief_um, abs=1e-6)


@pytest.mark.parametrize("share", [0.05, 0.35, 0.8, 0.95])
def test_any_share_is_met_within_a_point(share: float) -> None:
    settings = FaceSettings(pitted_share=share, clusters_per_mm2=20.0)
    face = make_face(settings, MapSettings(pixels=256), np.random.default_rng(8))
    assert abs(face.pitted.mean() - share) <= 0.01


@pytest.mark.parametrize("name", KINDS)
def test_pits_go_into_the_glass_and_nowhere_else(faces: dict[str, FaceTruth], name: str) -> None:
    face = faces[name]
    depth = face.pristine_um - face.decayed_um
    assert np.all(depth[~face.pitted] == 0.0)
    assert np.all(depth[face.pitted] > 0.0)


@pytest.mark.parametrize("name", KINDS)
def test_both_surfaces_repeat_without_a_seam(faces: dict[str, FaceTruth], name: str) -> None:
    for heights in (faces[name].pristine_um, faces[name].decayed_um):
        for axis in (0, 1):
            inside = np.abs(np.diff(heights, axis=axis))
            seam = np.abs(np.take(heights, 0, axis) - np.take(heights, -1, axis))
            assert seam.max() <= inside.max()
            assert np.sqrt(np.mean(seam**2)) < 1.5 * np.sqrt(np.mean(inside**2))


def test_streaks_have_the_set_slope_across_and_little_along() -> None:
    heights = pristine(pixels=256, pitch_um=1.5, slope=0.02, rng=np.random.default_rng(1))
    across = (np.roll(heights, -1, 1) - heights) / 1.5
    along = (np.roll(heights, -1, 0) - heights) / 1.5
    assert across.std() == pytest.approx(0.02, rel=0.02)
    assert along.std() < 0.4 * across.std()


def test_secondary_pits_roughen_the_craters_and_leave_the_share() -> None:
    maps, rough, smooth = MapSettings(pixels=256), BackSettings(), BackSettings(secondary_depth=0.0)
    with_them = make_face(rough, maps, np.random.default_rng(4))
    without = make_face(smooth, maps, np.random.default_rng(4))
    assert np.array_equal(with_them.pitted, without.pitted)

    def curvature(face: FaceTruth) -> float:
        h = face.decayed_um
        bend = np.roll(h, 1, 0) + np.roll(h, -1, 0) + np.roll(h, 1, 1) + np.roll(h, -1, 1) - 4.0 * h
        return float(np.median(np.abs(bend[face.pitted])))

    assert curvature(with_them) > 2.0 * curvature(without)


def test_no_decay_leaves_the_pristine_surface() -> None:
    face = make_face(FaceSettings(pitted_share=0.0), MapSettings(pixels=64), np.random.default_rng(1))
    assert not face.pitted.any()
    assert np.array_equal(face.decayed_um, face.pristine_um)


@pytest.mark.parametrize(
    ("settings", "said"),
    [
        (BackSettings(relief_um=1.0), "leaves no depth for the pits"),
        (FaceSettings(pitted_share=0.001), "cannot be met on 32 x 32 pixels"),
    ],
)
def test_what_cannot_be_met_is_refused(settings: FaceSettings, said: str) -> None:
    with pytest.raises(PhysicsError, match=said):
        make_face(settings, MapSettings(pixels=32), np.random.default_rng(1))
