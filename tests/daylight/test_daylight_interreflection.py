"""Configuration factors and the radiosity built on them, against closed forms."""

from __future__ import annotations

import numpy as np
import pytest
from daylight_models import room

from specularia.daylight._polygon_kernel import configuration_factors
from specularia.daylight.geometry import FACES, Box
from specularia.daylight.interreflection import Interreflection, mesh


def cube() -> Box:
    return Box(
        room(
            room={"width_m": 2.0, "depth_m": 2.0, "height_m": 2.0},
            window={"width_m": 0.5, "height_m": 0.5, "sill_m": 0.6},
        )
    )


def test_the_walls_of_a_room_fill_the_view_of_every_point_in_it() -> None:
    box = cube()
    m = mesh(box, 0.5, points=0.25)
    assert m.factors.sum(axis=1) == pytest.approx(np.ones(len(m.area)), abs=1e-12)
    rng = np.random.default_rng(1)
    points = rng.uniform(0.05, 1.95, (40, 3))
    normals = rng.normal(size=(40, 3))
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    # Points in mid air with any normal see half the room; what lies behind is cut off.
    assert configuration_factors(points, normals, m.quads).sum(axis=1) == pytest.approx(
        np.ones(40), abs=1e-12
    )


def test_opposite_faces_of_a_cube_exchange_a_fifth_of_their_light() -> None:
    """F = 0.199825 for opposite and (1 - F) / 4 for adjoining faces of a cube."""
    m = mesh(cube(), 0.25, points=0.25)
    face = {name: m.face == k for k, name in enumerate(FACES)}
    face["south"] |= m.face == len(FACES)  # frame and pane of its window

    def exchange(one: str, other: str) -> float:
        part = m.factors[np.ix_(face[one], face[other])].sum(axis=1)
        return float(np.sum(part * m.area[face[one]]) / m.area[face[one]].sum())

    assert exchange("floor", "ceiling") == pytest.approx(0.199825, rel=2e-3)
    assert exchange("south", "north") == pytest.approx(0.199825, rel=2e-3)
    assert exchange("east", "south") == pytest.approx((1 - 0.199825) / 4, rel=2e-3)


def test_a_horizon_through_a_rectangle_leaves_what_is_above_it() -> None:
    """A level small plane halfway up a square wall in front of it sees the upper half of that wall only."""
    point, normal = np.zeros((1, 3)), np.array([[0.0, 0.0, 1.0]])
    quad = np.array([[[-1.0, 1, -1], [1, 1, -1], [1, 1, 1], [-1, 1, 1]]])
    upper = np.array([[[-1.0, 1, 0], [1, 1, 0], [1, 1, 1], [-1, 1, 1]]])
    whole, half = (configuration_factors(point, normal, q)[0, 0] for q in (quad, upper))
    assert whole == pytest.approx(half, rel=1e-12)
    r = np.sqrt(2.0)
    assert half == pytest.approx(2 * (np.arctan(1.0) - np.arctan(1 / r) / r) / (2 * np.pi), rel=1e-12)
    below = quad * np.array([1, 1, 0]) + np.array([0, 0, 1.0]) * np.array([-2.0, -2, -1, -1])[None, :, None]
    assert configuration_factors(point, normal, below)[0, 0] == 0.0


def test_light_swallowed_equals_light_let_in() -> None:
    box = cube()
    m = mesh(box, 0.4, points=0.2)
    rng = np.random.default_rng(2)
    direct = rng.uniform(0.0, 100.0, m.points.shape[:2])
    rho = np.where(m.part >= 0, 0.1, np.where(m.face == 4, 0.15, 0.7))
    flux = 500.0
    light = Interreflection(m, direct[..., None], rho[:, None], flux)
    swallowed = np.sum((1 - rho) * light.received[:, 0] * m.area)
    # Factors are taken at four points of each rectangle, so reciprocity holds to some tenths of a percent.
    assert swallowed == pytest.approx(flux, rel=5e-3)
    assert light.balance == pytest.approx(np.sum(direct.mean(axis=1) * m.area) / flux)
