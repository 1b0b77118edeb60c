"""Conversions keep the light, and a move undone is no move."""

from __future__ import annotations

import warnings
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from specularia import bsdf
from specularia.bsdf.build_tree import bin_edges, bin_mean_tau
from specularia.bsdf.klems import BASES
from specularia.bsdf.to_klems import klems_part
from specularia.bsdf.xml_model import KlemsPart, TreePart, XmlModel
from specularia.conventions import square_to_disk
from specularia.errors import PhysicsError, SpeculariaWarning

FRONT = "transmission_front"


@pytest.fixture(scope="module")
def klems(shared_data: Path) -> XmlModel:
    model = bsdf.read(shared_data / "bsdf_xml/2011-SA1.xml")
    assert isinstance(model, XmlModel)
    return model


@pytest.fixture(scope="module")
def lopsided() -> XmlModel:
    """A matrix in which every pair of patches has a value of its own; sides have different ones."""
    rng = np.random.default_rng(8)
    parts: Any = {
        s: KlemsPart(rng.uniform(0.0, 0.3, (41, 41)), BASES[2], BASES[2])
        for s in ("transmission_front", "transmission_back", "reflection_front", "reflection_back")
    }
    return XmlModel(parts=parts, band="Visible", structure="Columns", bands=("Visible",))


@pytest.fixture(scope="module")
def turned_lobe() -> XmlModel:
    """The same at rank 4: random cells."""
    rng = np.random.default_rng(9)
    from specularia.bsdf.tensor_tree import TensorTree

    tree = TensorTree(
        rank=4,
        log2=np.array([2], np.int8),
        start=np.zeros(1, np.int64),
        child=np.zeros(0, np.int32),
        values=rng.uniform(0.0, 0.5, 256).astype(np.float32),
    )
    parts: Any = {FRONT: TreePart(tree), "transmission_back": TreePart(tree)}
    return XmlModel(parts=parts, band="Visible", structure="TensorTree4", bands=("Visible",))


def _light(part: Any) -> float:
    """All that leaves under light from everywhere."""
    return float(part.incident.solid_angle @ (part.outgoing.solid_angle @ np.maximum(part.matrix, 0)))


def _direct(model: Any, side: str, basis: Any, patch: int) -> np.ndarray:
    """One column of a matrix from random points: 64 incident directions, 96 x 96 outgoing ones each."""
    rng = np.random.default_rng(patch)
    ring = int(np.searchsorted(basis.first, patch, side="right")) - 1
    s2 = np.sin(np.radians(basis.bounds_deg[ring : ring + 2])) ** 2
    step = (np.arange(8) + 0.5) / 8
    theta = np.degrees(np.arcsin(np.sqrt(s2[0] + step * (s2[1] - s2[0]))))
    phi = -(patch - basis.first[ring] - 0.5 + step) * 360.0 / basis.phi_count[ring]
    out = np.zeros(basis.patches)
    for t in theta:
        for p in phi:
            k = np.arange(96)
            a, b = (k[:, None] + rng.uniform(size=(96, 96))) / 96, (k + rng.uniform(size=(96, 96))) / 96
            ux, uy = (v.ravel() for v in square_to_disk(a, b))
            light = model.evaluate(side, t, p, ux, uy) * np.pi / 96**2 / 64
            out += np.bincount(basis.index(-ux, uy), light, basis.patches)
    return out / basis.solid_angle


@pytest.mark.parametrize("source", ["pane", "chiral"])
def test_a_model_becomes_a_matrix_of_means_over_patches(source: str, request: Any) -> None:
    model, basis = request.getfixturevalue(source), BASES[2]
    part = klems_part(model, FRONT, basis)
    for patch in (0, 14):
        true = _direct(model, FRONT, basis, patch)
        assert np.abs(part.matrix[:, patch] - true) @ basis.solid_angle <= 0.04 * (basis.solid_angle @ true)
    sums = basis.solid_angle @ part.matrix
    for ring, first in enumerate(basis.first[:-1]):
        low, high = np.sin(np.radians(basis.bounds_deg[ring : ring + 2]))
        mean = bin_mean_tau(model, FRONT, low=float(low), high=float(high), count=24)
        np.testing.assert_allclose(sums[first : first + basis.phi_count[ring]], mean, rtol=2e-3)


@pytest.mark.parametrize("resolution", [4, 5])
def test_a_tree_at_another_resolution_keeps_the_light_of_every_bin(resolution: int, pane_xml: Any) -> None:
    made = bsdf.convert(pane_xml.model, resolution=resolution)
    assert made.resolution == resolution and made.rank == 3
    edges = bin_edges(resolution)
    for low, high in zip(edges[1:], edges[:-1]):
        s2 = low**2 + (np.arange(64) + 0.5) / 64 * (high**2 - low**2)
        mean = pane_xml.model.direct_hemispherical(FRONT, np.degrees(np.arcsin(np.sqrt(s2)))).mean()
        centre = np.degrees(np.arcsin(0.5 * (low + high)))
        assert float(made.direct_hemispherical(FRONT, centre)) == pytest.approx(mean, rel=4e-3)


def test_a_matrix_in_its_own_basis_is_the_same_and_in_another_keeps_its_mean(klems: XmlModel) -> None:
    same = bsdf.convert(klems, basis="klems-full")
    for side, part in klems.parts.items():
        np.testing.assert_array_equal(same.parts[side].matrix, part.matrix)  # type: ignore[attr-defined]
    assert same.bands == klems.bands and set(same.all_bands) == {"Visible", "Solar"}
    coarse = bsdf.convert(klems, basis="klems-quarter")
    for side in klems.parts:
        for band in klems.bands:
            before: Any = klems.all_bands[band][side]
            after: Any = coarse.all_bands[band][side]
            assert _light(after) == pytest.approx(_light(before), rel=2e-3)


def test_resampling_a_matrix_onto_its_own_patches_changes_nothing(lopsided: XmlModel) -> None:
    """Turned four times by 90 degrees, which every ring of the quarter basis maps onto itself."""
    model: XmlModel = lopsided
    once = bsdf.convert(model, rotate_deg=90.0)
    assert np.abs(once.parts[FRONT].matrix - model.parts[FRONT].matrix).max() > 0.1  # type: ignore[attr-defined]
    for _ in range(4):
        model = bsdf.convert(model, rotate_deg=90.0)
    for side, part in lopsided.parts.items():
        np.testing.assert_allclose(model.parts[side].matrix, part.matrix, rtol=1e-12)  # type: ignore[attr-defined]


def test_a_rotation_turns_both_directions(lopsided: XmlModel) -> None:
    turned = bsdf.convert(lopsided, rotate_deg=90.0)
    theta, phi = 37.0, np.array([3.0, 81.0, 200.0])
    ux, uy = np.array([0.3, -0.5, 0.1]), np.array([0.2, 0.4, -0.7])
    for side in lopsided.sides:
        # A quarter turn takes (ux, uy) to (-uy, ux).
        np.testing.assert_allclose(
            turned.evaluate(side, theta, phi + 90.0, -uy, ux), lopsided.evaluate(side, theta, phi, ux, uy)
        )


@pytest.mark.parametrize("source", ["klems", "lopsided", "pane_xml", "turned_lobe"])
def test_a_flip_swaps_the_faces_and_two_are_none(source: str, request: Any, directions: Any) -> None:
    found = request.getfixturevalue(source)
    model = found.model if source == "pane_xml" else found
    once = bsdf.convert(model, flip=True)
    twice = bsdf.convert(once, flip=True)
    theta, phi, ux, uy = directions(300, 5)
    assert set(twice.parts) == set(model.parts) and once.bands == model.bands
    for side in model.parts:
        other = side.replace("front", "x").replace("back", "front").replace("x", "back")
        np.testing.assert_array_equal(
            twice.evaluate(side, theta, phi, ux, uy), model.evaluate(side, theta, phi, ux, uy)
        )
        np.testing.assert_array_equal(
            once.evaluate(other, theta, 180.0 - phi, -ux, uy), model.evaluate(side, theta, phi, ux, uy)
        )
        assert twice.origin(side) == model.origin(side)
        if model.origin(side) == f"reciprocity of {other}":
            assert once.origin(other) == f"reciprocity of {side}"


def test_the_rotation_and_the_azimuth_mean_of_an_isotropic_model_change_nothing(pane_xml: Any) -> None:
    for made in (bsdf.convert(pane_xml.model, rotate_deg=33.0), bsdf.convert(pane_xml.model, isotropic=True)):
        for side, part in pane_xml.model.parts.items():
            np.testing.assert_array_equal(made.parts[side].tree.values, part.tree.values)


def test_an_azimuth_mean_is_isotropic_and_keeps_the_light(lopsided: XmlModel) -> None:
    made = bsdf.convert(lopsided, isotropic=True)
    part: Any = made.parts[FRONT]
    before: Any = lopsided.parts[FRONT]
    basis = BASES[2]
    sums, light = basis.solid_angle @ part.matrix, basis.solid_angle @ before.matrix
    for ring in range(5):
        patches = slice(basis.first[ring], basis.first[ring + 1])
        np.testing.assert_allclose(sums[patches], light[patches].mean(), rtol=5e-3)


def test_a_tree_of_rank_4_holds_the_means_of_the_model(chiral: Any) -> None:
    made = bsdf.convert(chiral, basis="tensor4", resolution=3)
    assert made.rank == 4 and made.resolution == 3 and not made.isotropic
    n = 8
    for i, j in ((4, 4), (1, 6), (3, 0)):
        step = (np.arange(8) + 0.5) / 8
        a, b = (v.ravel() for v in np.meshgrid((i + step) / n, (j + step) / n, indexing="ij"))
        x, y = square_to_disk(a, b)
        theta, phi = np.degrees(np.arcsin(np.hypot(x, y))), np.degrees(np.arctan2(-y, x))
        tau = chiral.direct_hemispherical(FRONT, theta, phi).mean()
        middle = (float(np.median(theta)), float(np.degrees(np.arctan2(-y.mean(), x.mean()))))
        assert float(made.direct_hemispherical(FRONT, *middle)) == pytest.approx(tau, rel=3e-3)
        q = made.quadrature(FRONT, *middle)
        f = q.weight * made.evaluate(FRONT, *middle, q.ux, q.uy)
        p = chiral.points
        g = p.weight * chiral.evaluate(FRONT, theta[:, None], phi[:, None], p.ux, p.uy).mean(axis=0)
        for mine, true in ((q.ux, p.ux), (q.uy, p.uy)):
            assert np.sum(f * mine) / f.sum() == pytest.approx(np.sum(g * true) / g.sum(), abs=0.03)


def test_converted_files_are_loaded_by_radiance(
    chiral: Any, lopsided: XmlModel, tmp_path: Path, referee: Any
) -> None:
    made = {
        "klems": bsdf.convert(chiral, basis="klems-quarter"),
        "rank4": bsdf.convert(chiral, basis="tensor4", resolution=2),
        "flip": bsdf.convert(lopsided, flip=True),
    }
    for name, model in made.items():
        path = bsdf.write(model, tmp_path / f"{name}.xml").path
        for side in model.parts:
            for theta, phi in ((5.0, 30.0), (44.0, 130.0), (70.0, 290.0)):
                assert referee.direct_hemispherical(path, side, theta, phi) == pytest.approx(
                    float(model.direct_hemispherical(side, theta, phi)), rel=1e-5
                )


def test_what_cannot_be_is_refused_and_what_is_lost_is_said(lopsided: XmlModel, pane: Any) -> None:
    with pytest.raises(PhysicsError, match="klems-full"):
        bsdf.convert(pane, basis="klems")
    with pytest.raises(PhysicsError, match="for trees"):
        bsdf.convert(pane, basis="klems-half", resolution=5)
    with pytest.raises(PhysicsError, match="2 to 7"):
        bsdf.convert(pane, basis="tensor4", resolution=8)
    one = replace(lopsided, parts={FRONT: lopsided.parts[FRONT]})
    with pytest.warns(SpeculariaWarning, match="averaged over all azimuths"):
        bsdf.convert(one, basis="tensor3", resolution=3)


def test_a_geometry_block_is_kept_unless_the_sample_moves(shared_data: Path) -> None:
    model = bsdf.read(shared_data / "geometry/sawtooth.xml")
    assert isinstance(model, XmlModel)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert bsdf.convert(model).geometry == model.geometry
    if model.geometry:
        with pytest.warns(SpeculariaWarning, match="geometry"):
            assert bsdf.convert(model, flip=True).geometry == ""


def test_the_command_converts_and_says_what_it_wrote(
    command: Any, lopsided: XmlModel, tmp_path: Path
) -> None:
    source = bsdf.write(lopsided, tmp_path / "source.xml").path
    out = tmp_path / "out.xml"
    words = ("bsdf", "convert", source, "-o", out)
    code, found, _ = command(*words, "--basis", "klems-half", "--rotate", "30", "--json")
    assert code == 0 and found["basis"] == "LBNL/Klems Half" and found["rank"] is None
    assert len(found["tau"]["transmission_front"]) == len(found["theta_deg"])
    assert set(bsdf.read(out).sides) == set(lopsided.sides)
    assert command("bsdf", "convert", source, "-o", tmp_path / "x.nc")[0] == 2
    assert command(*words, "--basis", "klems")[0] == 2
    code, _, error = command(*words, "--basis", "klems-half", "--resolution", "5")
    assert code == 2 and "patches" in error
    assert command(*words, "--basis", "tensor4", "--resolution", "8")[0] == 2
    assert command(*words, "--rotate", "nan")[0] == 2
    code, _, error = command(*words, "--cull", "50")
    assert code == 3 and "for trees" in error
