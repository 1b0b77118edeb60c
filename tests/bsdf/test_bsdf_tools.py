"""Sampling, slices, comparison and checks."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from scipy import stats

from specularia import bsdf
from specularia.bsdf.cells import cell_means
from specularia.bsdf.xml_model import TreePart
from specularia.conventions import disk_to_square, square_to_disk
from specularia.errors import CoverageError


@pytest.fixture(scope="module")
def rank_4() -> bsdf.XmlModel:
    """A tree of rank 4 with a value of its own in every cell, for transmission and reflection."""
    values = np.random.default_rng(3).uniform(0.0, 0.6, 8**4).astype(np.float32)
    one = {"start": np.zeros(1, np.int64), "child": np.zeros(0, np.int32), "values": values}
    tree = bsdf.TensorTree(rank=4, log2=np.array([3], np.int8), **one)
    parts: Any = {s: TreePart(tree) for s in ("transmission_front", "reflection_front")}
    return bsdf.XmlModel(parts=parts, band="Visible", structure="TensorTree4", bands=("Visible",))


@pytest.mark.parametrize("source", ["pane", "pane_xml", "klems", "rank_4"])
def test_sampled_directions_follow_the_distribution(source: str, request: Any, shared_data: Any) -> None:
    if source == "klems":
        model: Any = bsdf.read(shared_data / "bsdf_xml" / "pyradiance_DiffuseGlass.xml")
    else:
        found = request.getfixturevalue(source)
        model = found.model if source == "pane_xml" else found
    for seed, (side, theta, phi) in enumerate(
        [
            ("transmission_front", 0.0, 0.0),
            ("transmission_front", 50.0, 130.0),
            ("transmission_back", 35.0, 300.0),
            ("reflection_front", 0.0, 0.0),
            ("reflection_front", 62.0, 77.0),
        ]
    ):
        drawn = bsdf.sample(
            model, side, theta_i_deg=theta, phi_i_deg=phi, count=40_000, rng=np.random.default_rng(seed)
        )
        tau = float(model.direct_hemispherical(side, theta, phi))
        error = drawn.weight.std() / np.sqrt(drawn.weight.size)
        assert drawn.weight.mean() == pytest.approx(tau, abs=4 * error + 1e-3 * tau)
        # Independent of the sampler: the model on a fine grid of the square, summed over 16 x 16 bins.
        n, m = 512, 16
        k = (np.arange(n) + 0.5) / n
        a, b = (v.ravel() for v in np.meshgrid(k, k, indexing="ij"))
        fine = model.evaluate(side, theta, phi, *square_to_disk(a, b)).reshape(m, n // m, m, n // m)
        density = fine.sum(axis=(1, 3)).ravel()
        i, j = (np.minimum((v * m).astype(int), m - 1) for v in disk_to_square(drawn.ux, drawn.uy))
        observed = np.bincount(i * m + j, minlength=m * m)
        expected = density / density.sum() * observed.sum()
        many = expected >= 10
        seen = np.append(observed[many], observed[~many].sum())
        hoped = np.append(expected[many], expected[~many].sum())
        if hoped[-1] < 5:
            seen, hoped = seen[:-1], hoped[:-1]
        assert stats.chisquare(seen, hoped * seen.sum() / hoped.sum()).pvalue > 1e-4


def test_the_same_generator_draws_the_same_directions(pane: Any) -> None:
    a, b = (
        bsdf.sample(pane, "transmission_front", theta_i_deg=20.0, count=100, rng=np.random.default_rng(9))
        for _ in range(2)
    )
    np.testing.assert_array_equal(a.ux, b.ux)


def test_nothing_is_drawn_where_there_is_no_light(pane: Any) -> None:
    with pytest.raises(CoverageError):
        bsdf.sample(pane, "transmission_front", theta_i_deg=95.0, count=10, rng=np.random.default_rng(0))
    with pytest.raises(CoverageError):
        bsdf.sample(pane, "reflection_back", theta_i_deg=5.0, count=10, rng=np.random.default_rng(0))


@pytest.mark.parametrize("theta", [0.0, 35.0, 62.0, 140.0])
@pytest.mark.parametrize("size", [64, 301])
def test_a_slice_adds_up_to_tau_and_lies_where_the_light_goes(pane: Any, theta: float, size: int) -> None:
    found = bsdf.transmitted_slice(pane, theta_deg=theta, phi_deg=30.0, size=size)
    side, theta_i = ("transmission_front", theta) if theta < 90 else ("transmission_back", 180.0 - theta)
    tau = float(pane.direct_hemispherical(side, theta_i))
    assert found.side == side and found.bsdf.shape == (size, size)
    assert np.nansum(found.bsdf) * (2.0 / size) ** 2 == pytest.approx(tau, rel=0.005)
    outside = np.hypot(found.ux[:, None], found.uy[None, :]) > 1
    assert np.isnan(found.bsdf[outside]).all() and np.isfinite(found.bsdf[~outside]).all()
    i, j = np.unravel_index(np.nanargmax(found.bsdf), found.bsdf.shape)
    s = np.sin(np.radians(theta_i))
    assert found.ux[i] == pytest.approx(-s * np.cos(np.radians(30.0)), abs=0.04)
    assert found.uy[j] == pytest.approx(-s * np.sin(np.radians(30.0)), abs=0.04)


@pytest.mark.parametrize("name", ["pyradiance_t3.xml", "pyradiance_DiffuseGlass.xml"])
@pytest.mark.parametrize("size", [101, 201])
def test_cells_of_a_slice_that_the_edge_of_a_leaf_or_patch_cuts_keep_its_light(
    name: str, size: int, shared_data: Any
) -> None:
    """Points in such cells were so few that a tree's slice lost or won up to 12 % of the light."""
    model = bsdf.read(shared_data / "bsdf_xml" / name)
    for theta in (0.0, 30.0, 60.0):
        found = bsdf.transmitted_slice(model, theta_deg=theta, size=size)
        total = np.nansum(found.bsdf) * (2.0 / size) ** 2
        tau = float(model.direct_hemispherical("transmission_front", theta, 0.0))
        assert total == pytest.approx(tau, rel=0.01)


def test_a_lobe_narrower_than_a_cell_is_averaged_not_missed(pane_of: Any) -> None:
    """A lobe 0.5 degrees wide on cells 3.6 degrees wide keeps its light, and lies within one cell."""
    narrow = pane_of(0.004)
    mean = cell_means(narrow, "transmission_front", theta_i_deg=20.0, n=32)
    assert mean.sum() * np.pi / 32**2 == pytest.approx(0.71, rel=1e-6)
    assert np.sort(mean.ravel())[-4:].sum() / mean.sum() > 0.8


def test_a_model_compared_with_itself_does_not_differ(pane: Any) -> None:
    rows = bsdf.compare(pane, pane)
    assert [r.theta_deg for r in rows] == [0.0, 20.0, 40.0, 60.0, 75.0, 82.5]
    for r in rows:
        assert r.tau_a == r.tau_b and r.l1 == 0.0 and r.peak_ratio == 1.0 and r.fwhm_ratio == 1.0


def test_a_comparison_tells_dimmer_from_wider(pane_of: Any) -> None:
    rows = bsdf.compare(pane_of(0.03), pane_of(0.06), theta_deg=[20.0])
    assert rows[0].tau_a == pytest.approx(rows[0].tau_b)
    assert rows[0].peak_ratio == pytest.approx(0.25, abs=0.03)
    assert rows[0].fwhm_ratio == pytest.approx(2.0, rel=0.06)
    # Two Gaussians of widths 1 and 2 share all but this much of their light: 2 (4^(-1/3) - 4^(-4/3)).
    assert rows[0].l1 == pytest.approx(0.9 * 2 * (4 ** (-1 / 3) - 4 ** (-4 / 3)), rel=0.03)


def test_the_width_of_a_gaussian_lobe_is_right(pane: Any) -> None:
    found = bsdf.lobe(pane, "transmission_front", theta_i_deg=0.0)
    assert found.fwhm_deg == pytest.approx(np.degrees(2 * np.sqrt(2 * np.log(2)) * 0.03), rel=0.05)


def test_outside_the_data_a_comparison_is_empty(pane: Any) -> None:
    (row,) = bsdf.compare(pane, pane, theta_deg=[95.0])
    assert np.isnan([row.tau_a, row.l1, row.peak_ratio]).all()


def _failed(model: Any) -> set[str]:
    return {c.name for c in bsdf.check(model) if not c.ok}


def test_a_good_file_passes_the_checks_that_matter(pane_xml: bsdf.Written) -> None:
    failed = _failed(bsdf.read(pane_xml.path))
    assert not failed - {"theta 0 sun", "direct sun", "direct sun near the normal", "resolution"}


def test_checks_find_the_fault_that_was_put_in(pane_xml: bsdf.Written) -> None:
    model = bsdf.read(pane_xml.path)
    assert isinstance(model, bsdf.XmlModel)
    parts: dict[str, Any] = dict(model.parts)

    def changed(side: str, factor: float) -> bsdf.XmlModel:
        tree = parts[side].tree
        louder = replace(parts[side], tree=replace(tree, values=tree.values * np.float32(factor)))
        return replace(model, parts={**parts, side: louder})

    assert "energy" in _failed(changed("transmission_front", 1.5))
    assert "reciprocity" in _failed(changed("transmission_back", 0.7))
    assert "negative values" in _failed(changed("reflection_front", -1.0))
    turned = Turned(model)
    assert "orientation transmission front" in _failed(turned)


class Turned:
    """A model whose outgoing azimuth is half a turn off."""

    band = "Visible"
    sides = ("transmission_front",)

    def __init__(self, model: Any) -> None:
        self.model = model

    def evaluate(self, side: str, theta: Any, phi: Any, ux: Any, uy: Any) -> Any:
        return self.model.evaluate(side, theta, phi, -np.asarray(ux), -np.asarray(uy))

    def direct_hemispherical(self, side: str, theta: Any, phi: Any = 0.0) -> Any:
        return self.model.direct_hemispherical(side, theta, phi)

    def quadrature(self, side: str, theta: float, phi: float = 0.0) -> bsdf.Quadrature:
        q = self.model.quadrature(side, theta, phi)
        return bsdf.Quadrature(-q.ux, -q.uy, q.weight)


def test_data_that_end_early_are_found(pane: Any) -> None:
    front = pane.tables["transmission_front"]
    short = replace(
        front,
        theta_i_deg=front.theta_i_deg[:4],
        base=front.base[:4],
        patch=front.patch[:4],
        tau=front.tau[:4],
        tau_se=front.tau_se[:4],
    )
    assert "grazing transmission front" in _failed(replace(pane, tables={"transmission_front": short}))


def test_programs_are_told_apart(shared_data: Any, pane_xml: bsdf.Written, pane: Any) -> None:
    klems = bsdf.programs(bsdf.read(shared_data / "bsdf_xml" / "2011-SA1.xml"))
    tree = bsdf.programs(bsdf.read(pane_xml.path))
    assert [p.takes for p in klems] == [True, True, True]
    assert [p.takes for p in tree] == [True, True, False]
    assert [p.takes for p in bsdf.programs(pane)] == [False, False, False]
