"""The triangulation against Qhull's, and against what every triangulation must be."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from scipy.spatial import Delaunay

from specularia.gonio.triangulation import doubled_area, triangulate


def _disk(rng: Any, n: int) -> tuple[Any, Any]:
    r, a = np.sqrt(rng.random(n)), 2 * np.pi * rng.random(n)
    return r * np.cos(a), r * np.sin(a)


def _polar(rings: int, spokes: int) -> tuple[Any, Any]:
    r, a = np.meshgrid(np.sin(np.linspace(0.02, 1.5, rings)), np.arange(spokes) * 2 * np.pi / spokes)
    return np.append(0.0, r * np.cos(a)), np.append(0.0, r * np.sin(a))


@pytest.mark.parametrize("n", [4, 5, 30, 3000])
def test_random_points_give_the_triangles_of_qhull(n: int) -> None:
    x, y = _disk(np.random.default_rng(n), n)
    triangles, _ = triangulate(x, y)
    other = Delaunay(np.stack([x, y], axis=1)).simplices
    assert set(map(tuple, np.sort(triangles, 1).tolist())) == set(map(tuple, np.sort(other, 1).tolist()))


CASES = {
    "polar grid": _polar(40, 72),
    "square grid": tuple(v.ravel() for v in np.meshgrid(np.arange(20.0), np.arange(20.0))),
    "points on a line and one beside it": (np.append(np.arange(30.0), 3.3), np.append(np.zeros(30), 1.0)),
    "a dense spot far from the middle": tuple(
        np.concatenate(v)
        for v in zip(
            _disk(np.random.default_rng(1), 900),
            (
                np.random.default_rng(2).normal(0.9, 1e-4, 900),
                np.random.default_rng(3).normal(0.0, 1e-4, 900),
            ),
            strict=True,
        )
    ),
}


@pytest.mark.parametrize("name", CASES)
def test_every_triangulation_covers_the_hull_once_and_knows_its_neighbours(name: str) -> None:
    x, y = CASES[name]
    triangles, neighbours = triangulate(x, y)
    area = doubled_area(x, y, *triangles.T)
    assert np.all(area >= 0)
    hull = Delaunay(np.stack([x, y], axis=1))
    assert area.sum() == pytest.approx(np.abs(doubled_area(x, y, *hull.simplices.T)).sum(), rel=1e-9)
    assert set(triangles.ravel().tolist()) == set(range(x.size))
    for k in range(3):
        inner = neighbours[:, k] >= 0
        edge = np.stack([triangles[:, (k + 1) % 3], triangles[:, (k + 2) % 3]], axis=1)[inner]
        there = triangles[neighbours[inner, k]]
        assert all((there == edge[:, [j]]).any(axis=1).all() for j in (0, 1))
        # The neighbour of the neighbour is the triangle itself.
        back = neighbours[neighbours[inner, k]]
        assert (back == np.flatnonzero(inner)[:, None]).any(axis=1).all()
