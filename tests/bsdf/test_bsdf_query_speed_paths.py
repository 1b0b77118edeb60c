"""Many values at once are the values one by one."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from specularia import bsdf
from specularia.bsdf.klems import BASES
from specularia.bsdf.tensor_tree import TensorTree
from specularia.bsdf.xml_model import KlemsPart, TreePart


def _uneven_tree(rank: int) -> TensorTree:
    rng = np.random.default_rng(rank)

    def node(depth: int) -> str:
        if depth == 0 or rng.random() < 0.3:
            count = 1 if rng.random() < 0.5 else 1 << rank
            return "{ " + " ".join(f"{v:.6f}" for v in rng.uniform(-0.1, 1.0, count)) + " }"
        return "{" + "".join(node(depth - 1) for _ in range(1 << rank)) + "}"

    return TensorTree.from_text("{" + "".join(node(2) for _ in range(1 << rank)) + "}", rank)


def _model(kind: str) -> bsdf.XmlModel:
    basis = BASES[0]
    matrix = np.random.default_rng(3).uniform(-0.1, 1.0, (basis.patches, basis.patches))
    part: Any = (
        KlemsPart(matrix=matrix, incident=basis, outgoing=basis)
        if kind == "klems"
        else TreePart(_uneven_tree(int(kind[-1])))
    )
    return bsdf.XmlModel(parts={"transmission_front": part}, band="Visible", structure="", bands=("Visible",))


@pytest.mark.parametrize("side", ["transmission_front", "transmission_back"])
@pytest.mark.parametrize("kind", ["tree of rank 3", "tree of rank 4", "klems"])
def test_a_million_values_are_those_of_small_calls(kind: str, side: str, directions: Any) -> None:
    model = _model(kind)
    where = directions(50_000, 5)
    together = model.evaluate(side, *where)
    apart = [model.evaluate(side, *(v[k : k + 1000] for v in where)) for k in range(0, 50_000, 1000)]
    np.testing.assert_array_equal(together, np.concatenate(apart))
    assert np.all(together >= 0) and together.max() > 0.5


@pytest.mark.parametrize("kind", ["tree of rank 3", "tree of rank 4"])
def test_values_are_those_of_the_leaf_that_holds_the_position(kind: str, directions: Any) -> None:
    model = _model(kind)
    part = model.parts["transmission_front"]
    assert isinstance(part, TreePart)
    theta, phi, ux, uy = directions(30_000, 6)
    s, p = np.sin(np.radians(theta)), np.radians(phi)
    stored, _, _ = part.tree.locate(part.position(s * np.cos(p), s * np.sin(p), ux, uy))
    np.testing.assert_array_equal(
        model.evaluate("transmission_front", theta, phi, ux, uy), np.maximum(stored, 0.0)
    )


@pytest.mark.parametrize("count", [3, 40_000])
@pytest.mark.parametrize("kind", ["tree of rank 3", "tree of rank 4", "klems"])
def test_directions_that_are_none_give_nan(kind: str, count: int) -> None:
    model = _model(kind)
    one = np.ones(count)
    for side in ("transmission_front", "transmission_back"):
        for theta, ux in ((90.0, 0.0), (-1.0, 0.0), (np.nan, 0.0), (30.0, 1.01), (30.0, np.nan)):
            assert np.all(np.isnan(model.evaluate(side, theta * one, 20.0, ux * one, 0.1 * one)))
        assert np.all(np.isfinite(model.evaluate(side, 0.0 * one, 123.0, 0.0 * one, 0.0 * one)))
