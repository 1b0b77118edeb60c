"""Trees of rank 4: means over pairs of cells, both sums kept, and direct sun through the renderer."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from specularia import bsdf
from specularia.bsdf.build_rank4 import build_tensor4, incident_tau
from specularia.bsdf.check_render import rendered_domes, rendered_sun_tau
from specularia.bsdf.check_sun import sun_response
from specularia.bsdf.xml_model import TreePart
from specularia.conventions import disk_to_square, square_to_disk
from specularia.errors import PhysicsError, SpeculariaWarning

SIDES = ("transmission_front", "transmission_back")
ANGLES = (0.0, 2.0, 30.0, 60.0, 75.0)


@pytest.fixture(scope="module")
def written(pane: Any, tmp_path_factory: pytest.TempPathFactory) -> bsdf.Written:
    """A tabulated pane, its back by reciprocity, its lobe half as wide as a cell: the hard case."""
    path = tmp_path_factory.mktemp("rank4") / "pane.xml"
    return bsdf.write(pane, path, resolution=5, basis="tensor4")


def _cells(part: TreePart, g: int) -> Any:
    n = 1 << g
    k = (np.arange(n) + 0.5) / n
    at = np.stack([v.ravel() for v in np.meshgrid(k, k, k, k, indexing="ij")], axis=-1)
    return part.tree.lookup(at).reshape((n,) * 4).astype(float)


@pytest.mark.parametrize(("isotropic", "g", "limit"), [(True, 4, 0.02), (False, 3, 0.06)])
def test_cells_are_means_over_pairs_of_cells_of_an_asymmetric_model(
    chiral: Any, isotropic: bool, g: int, limit: float
) -> None:
    """Against the mean of the model at 4^4 points in each pair of cells.

    A model that is not isotropic is averaged over 2 x 2 directions of each incident cell, which leaves more.
    """
    n, k = 1 << g, 4
    model = type(chiral)(width=0.15)
    model.isotropic = isotropic
    built = build_tensor4(model, resolution=g, tolerance=1e-7, sides=SIDES if isotropic else SIDES[:1])
    step = (np.arange(n * k) + 0.5) / (n * k)
    x, y = (v.ravel() for v in square_to_disk(*np.meshgrid(step, step, indexing="ij")))
    for side, tree in built.items():
        cells = _cells(TreePart(tree.tree), g)
        for i, j in ((n // 2 - 1, n // 2), (3, n - 4), (1, 5), (n - 2, n - 2), (0, n // 2 + 1)):
            a, b = ((v + (np.arange(k) + 0.5) / k) / n for v in (i, j))
            ix, iy = (v.ravel() for v in square_to_disk(*np.meshgrid(a, b, indexing="ij")))
            theta, phi = np.degrees(np.arcsin(np.hypot(ix, iy))), np.degrees(np.arctan2(-iy, ix))
            mean = np.mean([model.evaluate(side, t, p, -x, y) for t, p in zip(theta, phi)], axis=0)
            mean = mean.reshape(n, k, n, k).mean(axis=(1, 3))
            assert np.abs(cells[i, j] - mean).sum() <= limit * mean.sum(), (side, i, j)


def test_reduction_keeps_what_every_cell_sends_and_receives(pane: Any, written: bsdf.Written) -> None:
    area = np.pi / 32**2
    tau = {s: incident_tau(pane, s, resolution=5) for s in SIDES}
    for side, other in zip(SIDES, SIDES[::-1]):
        built = written.trees[side]
        assert built.removed > 0.5 and built.l1.mean() <= 0.0201
        part = written.model.parts[side]  # type: ignore[attr-defined]
        cells = _cells(part, 5)
        np.testing.assert_allclose(cells.sum(axis=(2, 3)) * area, tau[side], rtol=2e-3)
        np.testing.assert_allclose(built.tau_tree, tau[side], rtol=2e-3)
        # Light comes back along its path: into a cell, from all others, as much as it sends the other way.
        np.testing.assert_allclose(cells.sum(axis=(0, 1)) * area, tau[other][::-1, ::-1], rtol=6e-3)


def test_a_turned_isotropic_tree_is_the_same_tree(written: bsdf.Written) -> None:
    cells = _cells(written.model.parts["transmission_front"], 5)  # type: ignore[attr-defined]
    turned = np.rot90(np.rot90(cells, 1, (0, 1)), 1, (2, 3))
    np.testing.assert_array_equal(turned, cells)


def test_radiance_reads_the_values_that_were_written(
    written: bsdf.Written, referee: Any, directions: Any
) -> None:
    model = bsdf.read(written.path)
    assert isinstance(model, bsdf.XmlModel) and model.structure == "TensorTree4"
    assert set(model.parts) == set(written.trees)
    for side in model.parts:
        for theta, phi in ((0.0, 0.0), (37.0, 200.0), (71.0, 77.0)):
            assert referee.direct_hemispherical(written.path, side, theta, phi) == pytest.approx(
                float(model.direct_hemispherical(side, theta, phi)), rel=1e-3
            )
        where = directions(200, 3)
        np.testing.assert_allclose(
            referee.query(written.path, side, *where), model.evaluate(side, *where), rtol=4e-4, atol=1e-6
        )


def test_a_column_of_the_tree_is_found_leaf_by_leaf(written: bsdf.Written) -> None:
    model: Any = written.model
    cells = _cells(model.parts["transmission_back"], 5)
    for theta in (0.0, 20.0, 64.0):
        s = np.sin(np.radians(theta))
        a, b = disk_to_square(-s * np.cos(0.3), s * np.sin(0.3))
        column = cells[:, :, min(int(a * 32), 31), min(int(b * 32), 31)].sum() * np.pi / 32**2
        found = sun_response(model, "transmission_front", np.array([theta]), float(np.degrees(0.3)))
        assert float(found[0]) == pytest.approx(column, rel=1e-6)


@pytest.fixture(scope="module")
def straight_xml(chiral: Any, tmp_path_factory: pytest.TempPathFactory) -> tuple[Any, Path]:
    """A lobe of 0.1 in direction cosines about the undeflected direction, at 2^5."""

    class Straight(type(chiral)):  # type: ignore[misc]
        def _front(self, ix: Any, iy: Any, ux: Any, uy: Any) -> Any:
            r2 = (ux + ix) ** 2 + (uy + iy) ** 2
            return self.tau * np.exp(-r2 / (2 * self.width**2)) / (2 * np.pi * self.width**2)

    model = Straight(width=0.1)
    path = tmp_path_factory.mktemp("straight4") / "pane.xml"
    return model, bsdf.write(model, path, resolution=5, basis="tensor4").path


@pytest.mark.parametrize("side", SIDES)
def test_sky_and_sun_are_rendered_with_the_mean_over_the_cell_within_one_percent(
    straight_xml: tuple[Any, Path], side: str
) -> None:
    """At 0 degrees exactly as well; 30 degrees is the edge of two cells, either of which may be read.

    2^6 and 2^7, and other lobes, stand in validation/trees_through_rtrace.md.
    """
    model, path = straight_xml
    tau = incident_tau(model, side, resolution=5)
    at = [t if side == SIDES[0] else 180.0 - t for t in ANGLES]
    domes = rendered_domes(path, theta_deg=at, phi_deg=17.0, rays=100)
    read: Any = bsdf.read(path)
    for theta, place, dome in zip(ANGLES, at, domes):
        s = np.sin(np.radians(theta)) * (1 + np.array([-1e-5, 1e-5]))
        a, b = disk_to_square(s * np.cos(np.radians(17.0)), -s * np.sin(np.radians(17.0)))
        cell = tau[np.minimum((a * 32).astype(int), 31), np.minimum((b * 32).astype(int), 31)]
        sun, _ = rendered_sun_tau(
            path, theta_deg=place, phi_deg=17.0, rays=120_000, rng=np.random.default_rng(1), model=read
        )
        for seen in (float(dome), sun):
            assert 0.99 * cell.min() <= seen <= 1.01 * cell.max(), theta


def test_the_check_finds_direct_sun_right_in_rank_4(straight_xml: tuple[Any, Path]) -> None:
    found = {c.name: c for c in bsdf.check(bsdf.read(straight_xml[1]))}
    for name in ("theta 0 sun", "direct sun near the normal", "direct sun"):
        assert found[name].ok, found[name]


def test_a_tree_made_coarser_is_the_mean_of_its_cells(written: bsdf.Written) -> None:
    model: Any = written.model
    coarse = build_tensor4(model, resolution=4, tolerance=1e-7, sides=["transmission_front"])
    cells = _cells(model.parts["transmission_front"], 5).reshape((16, 2) * 4).mean(axis=(1, 3, 5, 7))
    np.testing.assert_allclose(
        _cells(TreePart(coarse["transmission_front"].tree), 4), cells, rtol=6e-4, atol=1e-8
    )


def test_a_matrix_becomes_a_tree_with_its_light_kept(shared_data: Path, tmp_path: Path) -> None:
    model = bsdf.read(shared_data / "bsdf_xml" / "pyradiance_DiffuseGlass.xml")
    with pytest.warns(SpeculariaWarning, match="only the band Visible"):
        written = bsdf.write(model, tmp_path / "t4.xml", resolution=3, basis="tensor4")
    for side, built in written.trees.items():
        np.testing.assert_allclose(built.tau_tree, incident_tau(model, side, resolution=3), rtol=2e-3)


@pytest.mark.parametrize("options", [{"resolution": 8}, {"resolution": 1}, {"cull": 100.0}])
def test_impossible_trees_of_rank_4_are_refused(pane: Any, options: dict[str, Any]) -> None:
    with pytest.raises(PhysicsError):
        build_tensor4(pane, **options)
