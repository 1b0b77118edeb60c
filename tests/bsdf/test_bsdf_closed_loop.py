"""A model written as XML and read by Radiance gives the model's numbers again."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from specularia import bsdf
from specularia.bsdf.build_tree import bin_edges, bin_mean_tau, fill_cells, reduce_cells
from specularia.conventions import SIDES
from specularia.errors import FormatError, OutputError, PhysicsError


def _middle(low: float, high: float) -> float:
    """The angle in the middle of a bin of sin(theta)."""
    return float(np.degrees(np.arcsin(0.5 * (low + high))))


def test_every_incidence_bin_holds_the_bin_mean_of_the_model_as_radiance_reads_it(  # type: ignore[no-untyped-def]
    pane, pane_xml, referee
) -> None:
    edges = bin_edges(6)
    for side in ("transmission_front", "transmission_back", "reflection_front"):
        for k in range(edges.size - 1):
            low, high = float(edges[k + 1]), float(edges[k])
            mean = bin_mean_tau(pane, side, low=low, high=high, count=24)
            read = referee.direct_hemispherical(pane_xml.path, side, _middle(low, high), 40.0)
            assert read == pytest.approx(mean, rel=2e-3), (side, low)


def test_reduction_moves_little_light_and_keeps_tau(pane_xml: bsdf.Written) -> None:
    for side, built in pane_xml.trees.items():
        # Where tau changes fast with the angle, cubes of cells cannot be merged across incidence bins.
        assert built.removed > (0.8 if side.startswith("transmission") else 0.3), side
        assert built.l1.max() <= 0.0101, side
        np.testing.assert_allclose(built.tau_tree, built.tau_model, rtol=2e-3, err_msg=side)
    assert pane_xml.path.stat().st_size < 1_500_000


def test_the_written_file_read_again_is_the_tree_that_was_built(pane_xml, directions) -> None:  # type: ignore[no-untyped-def]
    model = bsdf.read(pane_xml.path)
    assert isinstance(model, bsdf.XmlModel)
    assert model.sides == SIDES[:3] and model.rank == 3 and model.resolution == 6
    for side in model.sides:
        where = directions(500, 1)
        np.testing.assert_allclose(
            model.evaluate(side, *where), pane_xml.model.evaluate(side, *where), rtol=1e-6
        )


def test_the_file_says_what_it_was_made_from(pane_xml: bsdf.Written) -> None:
    model = bsdf.read(pane_xml.path)
    assert model.band == "Visible"
    assert model.attributes["measured_band"] == "520 nm"
    assert model.attributes["thickness_mm"] == "3"
    assert "synthetic" in model.attributes
    assert model.origin("transmission_front") == "synthetic"
    assert model.origin("transmission_back") == "reciprocity of transmission_front"
    assert "520 nm (written as Visible)" in pane_xml.path.read_text()


def test_a_file_written_again_keeps_its_values_and_labels(  # type: ignore[no-untyped-def]
    pane_xml, shared_data, tmp_path, directions
) -> None:
    files = shared_data / "bsdf_xml"
    for path in (pane_xml.path, files / "2011-SA1.xml", files / "pyradiance_t3.xml"):
        first = bsdf.read(path)
        second = bsdf.read(bsdf.write(first, tmp_path / path.name).path)
        assert isinstance(first, bsdf.XmlModel) and isinstance(second, bsdf.XmlModel)
        assert set(second.parts) == set(first.parts) and second.structure == first.structure
        assert second.attributes.get("measured_band") == first.attributes.get("measured_band", "Visible")
        for side in first.parts:
            where = directions(300, 2)
            np.testing.assert_allclose(
                second.evaluate(side, *where), first.evaluate(side, *where), rtol=1e-6, atol=1e-12
            )


def test_geometry_and_thickness_are_kept_on_rewriting(shared_data, tmp_path, referee) -> None:  # type: ignore[no-untyped-def]
    text = (shared_data / "bsdf_xml" / "testBSDF.xml").read_text()
    block = '<Geometry format="MGF"><MGFblock unit="meter">v a =\n p 0 0 0 &lt;\n</MGFblock></Geometry>'
    path = tmp_path / "first.xml"
    path.write_text(text.replace("<Geometry></Geometry>", block))
    again = bsdf.write(bsdf.read(path), tmp_path / "second.xml").path
    first, second = referee.load(path), referee.load(again)
    assert "p 0 0 0 <" in first.mgf and second.mgf == first.mgf
    assert second.dim == pytest.approx(first.dim) and first.dim == pytest.approx((0.45, 0.2, 0.0254))
    assert second.matn == first.matn and second.makr == first.makr


def test_a_tree_keeps_the_azimuth_of_an_asymmetric_model(chiral, chiral_xml) -> None:  # type: ignore[no-untyped-def]
    model = bsdf.read(chiral_xml)
    for side in chiral.sides:
        for theta, phi in ((20.0, 0.0), (40.0, 25.0), (40.0, 205.0), (60.0, 290.0)):
            q = model.quadrature(side, theta, phi)
            f = q.weight * model.evaluate(side, theta, phi, q.ux, q.uy)
            g = chiral.points.weight * chiral.evaluate(side, theta, phi, chiral.points.ux, chiral.points.uy)
            for mine, true in ((q.ux, chiral.points.ux), (q.uy, chiral.points.uy)):
                assert np.sum(f * mine) / f.sum() == pytest.approx(np.sum(g * true) / g.sum(), abs=0.025)


def test_an_anisotropic_file_is_averaged_over_azimuth_with_its_light_kept(shared_data, tmp_path) -> None:  # type: ignore[no-untyped-def]
    first = bsdf.read(shared_data / "geometry" / "sawtooth.xml")
    tree = bsdf.read(bsdf.write(first, tmp_path / "tree.xml", resolution=3).path)
    assert isinstance(tree, bsdf.XmlModel) and tree.isotropic
    edges = bin_edges(3)
    for low, high in zip(edges[1:], edges[:-1]):
        mean = bin_mean_tau(first, "reflection_back", low=low, high=high)
        read = float(tree.direct_hemispherical("reflection_back", _middle(low, high)))
        assert read == pytest.approx(mean, rel=2e-3)


def test_culling_removes_the_share_asked_for_and_the_rest_least_of_all(pane: Any) -> None:
    cells, tau = fill_cells(pane, "transmission_front", resolution=5)
    moved = []
    for cull in (0.0, 50.0, 90.0):
        flat, merged = reduce_cells(cells, tau, cull=cull)
        left = merged[0].size - 7 * sum(int(m.sum()) for m in merged[1:])
        # Cells that are equal already are merged in any case.
        assert left >= (1 - cull / 100) * cells.size * 0.99
        assert left <= (1 - cull / 100) * cells.size * 1.05 + 100
        moved.append(float(np.abs(flat - cells).sum()))
    assert moved[0] < 1e-6 * cells.sum() and moved[0] < moved[1] < moved[2]


@pytest.mark.parametrize("options", [{"resolution": 2}, {"resolution": 12}, {"cull": 100.0}, {"cull": -1.0}])
def test_impossible_resolution_or_cull_is_refused(pane: Any, tmp_path: Path, options: dict[str, Any]) -> None:
    with pytest.raises(PhysicsError):
        bsdf.write(pane, tmp_path / "x.xml", **options)
    assert not list(tmp_path.iterdir())


def test_a_model_cannot_be_written_where_or_as_makes_no_sense(chiral: Any, pane: Any, tmp_path: Path) -> None:
    with pytest.raises(OutputError):
        bsdf.write(pane, tmp_path / "missing" / "x.nc")
    with pytest.raises(OutputError):
        bsdf.write(pane, tmp_path / "x.txt")
    with pytest.raises(OutputError):
        bsdf.write(chiral, tmp_path / "x.nc")
    assert not list(tmp_path.iterdir())


def test_content_not_the_name_decides_how_a_file_is_read(pane: Any, pane_xml: Any, tmp_path: Path) -> None:
    disguised = tmp_path / "model.xml"
    disguised.write_bytes(bsdf.write(pane, tmp_path / "model.nc").path.read_bytes())
    assert isinstance(bsdf.read(disguised), bsdf.TabulatedModel)
    disguised.write_bytes(pane_xml.path.read_bytes())
    assert isinstance(bsdf.read(disguised), bsdf.XmlModel)
    disguised.write_bytes(b"neither")
    with pytest.raises(FormatError):
        bsdf.read(disguised)
