"""Trees: text in and out, look-up, leaves of uneven size."""

from __future__ import annotations

import json

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from specularia import bsdf
from specularia.bsdf.tensor_tree import TensorTree, TreeSyntaxError


def _text(draw: st.DrawFn, rank: int, depth: int) -> str:
    kind = draw(st.integers(0, 2)) if depth else draw(st.integers(0, 1))
    if kind == 2:
        return "{" + " ".join(_text(draw, rank, depth - 1) for _ in range(1 << rank)) + "}"
    values = [draw(st.floats(0, 100, width=32)) for _ in range(1 if kind == 0 else 1 << rank)]
    return "{ " + draw(st.sampled_from([" ", ", ", ",\n", "\t"])).join(f"{v:.9g}" for v in values) + " }"


@st.composite
def _trees(draw: st.DrawFn) -> tuple[str, int]:
    rank = draw(st.sampled_from([3, 4]))
    return _text(draw, rank, 2), rank


def _naive(text: str, position: np.ndarray, rank: int) -> float:
    """Look-up straight from nested lists."""
    words = text.replace("{", " [ ").replace("}", " ] ").replace(",", " ").split()
    tree = json.loads(",".join(words).replace("[,", "[").replace(",]", "]"))
    p = np.array(position, float)
    while isinstance(tree[0], list):
        upper = p >= 0.5
        tree = tree[int(upper @ (1 << np.arange(rank)))]
        p = 2 * p - upper
    grid = np.array(tree).reshape((round(len(tree) ** (1 / rank)),) * rank)
    return float(grid[tuple((p * grid.shape[0]).astype(int))])


@settings(max_examples=40, deadline=None)
@given(_trees(), st.integers(0, 2**32 - 1))
def test_lookup_finds_what_nested_lists_hold(case: tuple[str, int], seed: int) -> None:
    text, rank = case
    tree = TensorTree.from_text(text, rank)
    position = np.random.default_rng(seed).random((20, rank))
    found, corner, size = tree.locate(position)
    np.testing.assert_allclose(found, [_naive(text, p, rank) for p in position], rtol=1e-6)
    assert np.all((corner <= position) & (position < corner + size[:, None]))


@settings(max_examples=40, deadline=None)
@given(_trees(), st.integers(0, 2**32 - 1))
def test_text_written_and_read_again_is_the_same_tree(case: tuple[str, int], seed: int) -> None:
    text, rank = case
    tree = TensorTree.from_text(text, rank)
    again = TensorTree.from_text(tree.to_text(), rank)
    position = np.random.default_rng(seed).random((50, rank))
    np.testing.assert_allclose(again.lookup(position), tree.lookup(position), rtol=1e-6)
    assert again.resolution == tree.resolution


@settings(max_examples=40, deadline=None)
@given(_trees(), st.integers(0, 2**32 - 1))
def test_leaves_of_an_incident_direction_tile_the_square(case: tuple[str, int], seed: int) -> None:
    text, rank = case
    tree = TensorTree.from_text(text, rank)
    incident = np.random.default_rng(seed).random(rank - 2)
    a, b, size, value = tree.outgoing(incident)
    assert np.sum(size**2) == pytest.approx(1.0)
    at = np.column_stack([np.tile(incident, (a.size, 1)), a + size / 2, b + size / 2])
    np.testing.assert_array_equal(tree.lookup(at), value.astype(np.float32))


@pytest.mark.parametrize(
    "text",
    [
        "",
        "1 2 3",
        "{ }",
        "{ 1",
        "{ 1 } }",
        "{ 1 } { 2 }",
        "{ 1 2 3 }",
        "{ {1} {2} }",
        "{ {1} {1} {1} {1} {1} {1} {1} 1 }",
        "{ nan }",
        "{ 1 1 1 1 1 1 1 one }",
        "{" * 5000,
    ],
)
def test_text_that_is_no_tree_is_refused(text: str) -> None:
    with pytest.raises(TreeSyntaxError):
        TensorTree.from_text(text, 3)


def test_uneven_leaves_of_the_test_file_read_as_by_hand(shared_data) -> None:  # type: ignore[no-untyped-def]
    model = bsdf.read(shared_data / "bsdf_xml" / "testBSDF.xml")
    assert isinstance(model, bsdf.XmlModel)
    assert model.sides == ("reflection_back",) and model.resolution == 3
    tree = model.parts["reflection_back"].tree  # type: ignore[attr-defined]
    by_hand = {
        (0.05, 0.05, 0.05): 0.0,
        (0.05, 0.20, 0.05): 4.0,
        (0.20, 0.05, 0.05): 28.0,
        (0.20, 0.20, 0.45): 32.0,
        (0.30, 0.05, 0.05): 32.25,
        (0.05, 0.30, 0.05): 22.0,
        (0.30, 0.30, 0.05): 28.75,
        (0.05, 0.55, 0.05): 27.375,
        (0.30, 0.55, 0.05): 23.75,
        (0.05, 0.80, 0.05): 31.5,
        (0.05, 0.55, 0.30): 27.875,
        (0.10, 0.10, 0.90): 25.07812,
        (0.30, 0.80, 0.55): 31.0,
    }
    np.testing.assert_allclose(tree.lookup(np.array(list(by_hand))), list(by_hand.values()), rtol=1e-6)
    # theta_i = 22 degrees lies at 0.5 - 0.5 sin(22) = 0.313; the means of the four quarters there:
    quarters = [
        (32.25 + 28.75 + 32.0 + 28.0) / 4,
        (23.75 + 17.75 + 23.125 + 17.0) / 4,
        25.07812,
        (22.375 + (31 + 31 + 29 + 28) / 4 + 21.75 + (31 + 30 + 28 + 28) / 4) / 4,
    ]
    found = model.direct_hemispherical("reflection_back", 22.0)
    assert float(found) == pytest.approx(np.pi * np.mean(quarters), rel=1e-6)
