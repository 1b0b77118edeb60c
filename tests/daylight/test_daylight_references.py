"""Panes to compare with, and intervals from what is known of a model, against closed forms."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import pytest
from daylight_models import Diffuser, room, sensors

from specularia import bsdf, daylight
from specularia.daylight.uncertainty import spread_interval
from specularia.glass.closed_form import flat_slab

UP = (0.0, 0.0, 1.0)
QUICK = daylight.Quality(sampling=0.5, repeats=2)


def lux(job: daylight.RoomJob, **options: Any) -> dict[str, list[float]]:
    lit = daylight.run(job, quality=QUICK, **options)
    return {
        m: [p.illuminance_lx for p in lit.points if p.model == m]
        for m in dict.fromkeys(p.model for p in lit.points)
    }


def test_the_sun_through_nothing_and_through_a_clear_slab_makes_a_patch_of_known_light_and_place() -> None:
    """At 45 degrees the patch on the floor runs from the sill's to the head's height in front of the wall."""
    depths = (0.9, 1.1, 1.5, 2.0, 2.2)
    job = room(
        references=["no glass", "clear slab"],
        sun={"elevation_deg": 45.0, "normal_illuminance_lx": 8e4},
        sensor=sensors([(2.5, y, 0.0) for y in depths], UP),
    )
    found = lux(job)
    lit = np.array([0, 1, 1, 1, 0]) * 8e4 * np.sin(np.radians(45.0))
    assert found["no glass"] == pytest.approx(lit, rel=1e-4, abs=1e-6)
    tau = float(flat_slab(np.array(45.0), index=1.52).transmitted)
    assert found["clear slab"] == pytest.approx(lit * tau, rel=1e-3, abs=1e-6)


def test_through_no_glass_the_sky_lights_a_point_by_the_window_s_configuration_factor() -> None:
    """A level sensor sees the window under the sky only, from below its sill: E = pi L F."""
    at = np.array([2.5, 2.0, 0.0])
    job = room(
        references=["no glass", "diffuser"],
        sky={"kind": "uniform", "horizontal_illuminance_lx": 1e4},
        sun={"elevation_deg": 40.0, "normal_illuminance_lx": 0.0},
        sensor=sensors([at], UP),
    )
    k = (np.arange(400) + 0.5) / 400
    x, z = (v.ravel() for v in np.meshgrid(2.1 + 0.8 * k, 1.0 + 1.1 * k))
    d = np.stack([x - at[0], np.full(x.size, -at[1]), z])
    r = np.linalg.norm(d, axis=0)
    factor = np.sum((-d[1] / r) * (d[2] / r) / r**2) * 0.88 / k.size**2 / np.pi
    found = lux(job)
    assert found["no glass"] == pytest.approx([1e4 * factor], rel=0.01)
    # A diffuser passes what falls on the wall, half of that, and spreads it evenly.
    assert found["diffuser"] == pytest.approx([0.5 * 1e4 * factor], rel=0.01)


def test_a_reveal_outside_and_a_niche_inside_cut_the_beam() -> None:
    """Outer reveal of 0.3 m: the head's shadow falls by 0.3 m at 45 degrees. Sill of a niche: likewise."""
    sun = {"elevation_deg": 45.0, "normal_illuminance_lx": 8e4}
    points = sensors([(2.5, y, 0.0) for y in (1.05, 1.4, 1.75, 1.85, 2.05)], UP)
    full = 8e4 * np.sin(np.radians(45.0))
    outer = room(references=["no glass"], sun=sun, sensor=points, window={"outer_reveal_m": 0.3})
    # What passes the pane between z = 1.0 and 1.8 lands between y = 1.0 and 1.8.
    assert lux(outer)["no glass"] == pytest.approx([full, full, full, 0, 0], rel=1e-4, abs=1e-6)
    inner = room(references=["no glass"], sun=sun, sensor=points, window={"inner_reveal_m": 0.3})
    # The pane lies 0.3 m deeper, so light falls from y = 0.7 to 1.8, but only above the sill's edge: y >= 1.
    assert lux(inner)["no glass"] == pytest.approx([full, full, full, 0, 0], rel=1e-4, abs=1e-6)


def test_the_spread_of_a_healed_ensemble_joins_the_interval_of_the_transmission() -> None:
    from specularia.daylight.uncertainty import _error

    model: Any = Doubtful()
    model.attributes = {"ensemble": '{"theta_deg": [0, 60], "tau_sd": [0.01, 0.03]}'}
    found = _error(model, np.array([0.0, 30.0, 60.0]))
    expected = np.hypot(0.04, np.array([0.01, 0.02, 0.03]) / 0.5)
    assert found == pytest.approx(expected, rel=1e-6)


@dataclass
class Doubtful(Diffuser):
    """A diffuser that states how well its transmission is known."""

    tau: float = 0.5
    error: float = 0.04

    def __post_init__(self) -> None:
        super().__init__(self.tau)

    def tau_interval(self, side: str, theta_i_deg: Any, phi_i_deg: Any = 0.0, *, level: float = 0.95) -> Any:
        from scipy.special import ndtri

        half = ndtri(0.5 + 0.5 * level) * self.error * self.tau * np.ones(np.shape(theta_i_deg))
        return self.tau - half, self.tau + half


def test_a_transmission_known_to_4_percent_gives_illuminances_known_to_4_percent() -> None:
    job = room(
        sky={"kind": "overcast", "horizontal_illuminance_lx": 1e4},
        sun={"elevation_deg": 40.0},
        sensor=sensors([(2.5, 1.0, 0.0), (2.5, 3.0, 0.0)], UP),
    )
    lit = daylight.run(job, models={"d": Doubtful(), "silent": Diffuser(0.5)}, quality=QUICK)
    for p in lit.points:
        if p.model == "silent":
            assert p.interval_lx is None
            continue
        assert p.interval_lx is not None
        half = 1.95996 * np.hypot(0.04 * p.illuminance_lx, p.se)
        assert p.interval_lx == pytest.approx((p.illuminance_lx - half, p.illuminance_lx + half), rel=1e-3)
    assert "4 %" in lit.intervals["d"]
    assert "no uncertainty" in lit.intervals["silent"]


def test_members_light_the_room_each_by_itself_and_their_spread_is_the_interval(tmp_path: Any) -> None:
    taus = (0.44, 0.5, 0.53)
    files = []
    for tau in taus:
        files.append(str(tmp_path / f"{tau}.xml"))
        bsdf.write(Diffuser(tau), files[-1], resolution=3)
    job = room(
        sky={"kind": "overcast", "horizontal_illuminance_lx": 1e4},
        sun={"elevation_deg": 40.0},
        sensor=sensors([(2.5, 1.5, 0.0)], UP),
        model=[{"name": "healed", "file": files[1], "members": files}],
    )
    (point,) = (lit := daylight.run(job, quality=QUICK)).points
    middle = point.illuminance_lx
    low, high = spread_interval(
        np.array(taus)[:, None] * middle / 0.5, np.array([middle]), np.array([point.se])
    )
    assert point.interval_lx == pytest.approx((low[0], high[0]), rel=0.01)
    assert "3 members" in lit.intervals["healed"]


def test_95_of_100_further_members_lie_in_the_interval() -> None:
    rng = np.random.default_rng(5)
    inside = 0
    for _ in range(2000):
        members = rng.normal(100.0, 5.0, (6, 1))
        low, high = spread_interval(members, members.mean(axis=0), np.zeros(1))
        inside += bool(low[0] <= rng.normal(100.0, 5.0) <= high[0])
    assert inside / 2000 == pytest.approx(0.95, abs=0.015)


def test_a_single_member_is_refused() -> None:
    with pytest.raises(ValueError, match="two members or more"):
        room(model=[{"name": "h", "file": "a.nc", "members": ["a.nc"]}])
