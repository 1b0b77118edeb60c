"""Illuminance in rooms for which the answer is known without this program."""

from __future__ import annotations

import numpy as np
import pytest
from daylight_models import Diffuser, Lobe, room, sensors

from specularia import daylight
from specularia.radiance import run

UP = (0.0, 0.0, 1.0)


def perpendicular_factor(x: float, y: float, z: float) -> float:
    """Configuration factor of a rectangle for a small plane square to it, at the foot of one of its corners.

    The rectangle is x wide and z tall, stands on the plane's level at the distance y, and has a lower corner
    straight ahead (Howell, A Catalog of Radiation Heat Transfer Configuration Factors, B-4).
    """
    r = np.hypot(z, y)
    return float((np.arctan2(x, y) - y / r * np.arctan2(x, r)) / (2 * np.pi))


def window_factor(px: float, py: float, x0: float, x1: float, z0: float, z1: float) -> float:
    """Factor of the rectangle [x0, x1] x [z0, z1] in the plane y = 0 for a floor point (px, py)."""

    def corner(x: float, z: float) -> float:
        return float(np.sign(x - px)) * perpendicular_factor(abs(x - px), py, z)

    return corner(x1, z1) - corner(x0, z1) - corner(x1, z0) + corner(x0, z0)


def test_behind_an_opaque_pane_a_room_reads_exactly_nothing() -> None:
    job = room(
        reflectance={"ceiling": 0.7, "walls": 0.7, "floor": 0.15},
        sun={"elevation_deg": 40.0, "normal_illuminance_lx": 1e5},
        sky={"kind": "uniform", "horizontal_illuminance_lx": 2e4},
        ground={"reflectance": 0.2},
        sensor=sensors([(2.5, 1.0, 0.0), (0.1, 5.9, 0.0), (2.5, 0.0, 1.5)], [UP, UP, (0, 1, 0)]),
    )
    lit = daylight.run(job, models={"opaque": Diffuser(0.0)}, quality=daylight.Quality(sampling=0.3))
    assert len(lit.points) == 3
    assert all(p.illuminance_lx == 0.0 and p.se == 0.0 for p in lit.points)


def test_a_diffusing_pane_lights_a_black_room_by_its_configuration_factor() -> None:
    points = np.array([(2.5, 0.3, 0.0), (2.5, 1.5, 0.0), (0.4, 0.5, 0.0), (4.9, 5.5, 0.0), (2.2, 0.8, 0.0)])
    job = room(
        sky={"kind": "uniform", "horizontal_illuminance_lx": 1e4},
        sun={"elevation_deg": 40.0, "normal_illuminance_lx": 0.0},
        sensor=sensors(points, UP),
    )
    lit = daylight.run(job, models={"d": Diffuser(0.5)})
    # Half of a uniform sky is seen from a wall, a quarter of a sphere: E_v = E_h / 2.
    exitance = 0.5 * 1e4 / 2
    truth = [exitance * window_factor(x, y, 2.1, 2.9, 1.0, 2.1) for x, y, _ in points]
    assert [p.illuminance_lx for p in lit.points] == pytest.approx(truth, rel=0.005)


def sun_patch(job: daylight.RoomJob, model: Lobe, points: np.ndarray) -> np.ndarray:
    """Floor illuminance in a black room by quadrature over window and sun disc, in room coordinates.

    South window: seen from outside, east is to the right, so the sample's x is the room's x and its y the
    room's z. The sun stands at (-cos e sin a, -cos e cos a, sin e).
    """
    e, a = np.radians(job.sun.elevation_deg), np.radians(job.sun.azimuth_deg)
    sun = np.array([-np.cos(e) * np.sin(a), -np.cos(e) * np.cos(a), np.sin(e)])
    east = np.cross(sun, [0, 0, 1.0])
    east /= np.linalg.norm(east)
    other = np.cross(sun, east)
    radius = np.sqrt((np.arange(3) + 0.5) / 3) * np.radians(0.533 / 2)
    n = 240
    x = 2.1 + 0.8 * (np.arange(n) + 0.5) / n
    z = 1.0 + 1.1 * (np.arange(n) + 0.5) / n
    xx, zz = (v.ravel() for v in np.meshgrid(x, z))
    total = np.zeros(len(points))
    for k, p in enumerate(points):
        d = np.stack([p[0] - xx, np.full(xx.size, p[1]), p[2] - zz])
        r = np.linalg.norm(d, axis=0)
        for rho in radius:
            for psi in (np.arange(8) + 0.5) * np.pi / 4:
                s = sun + rho * (np.cos(psi) * east + np.sin(psi) * other)
                s /= np.linalg.norm(s)
                f = model.value("transmission_front", s[0], s[2], d[0] / r, d[2] / r)
                luminance = job.sun.normal_illuminance_lx * -s[1] * f / 24
                total[k] += np.sum(luminance * (d[1] / r) * (-d[2] / r) / r**2) * 0.88 / n**2
    return total


FLOOR = np.array([(x, y, 0.0) for x in (2.5, 2.75, 2.95, 3.6) for y in (0.2, 0.5, 0.9)])


@pytest.mark.parametrize("fwhm", [3.0, 10.0])
def test_the_sun_through_a_lobe_falls_on_the_floor_as_quadrature_says(fwhm: float) -> None:
    job = room(sun={"elevation_deg": 75.0, "normal_illuminance_lx": 8e4}, sensor=sensors(FLOOR, UP))
    model = Lobe(fwhm)
    truth = sun_patch(job, model, FLOOR)
    lit = daylight.run(job, models={"lobe": model})
    got = np.array([p.illuminance_lx for p in lit.points])
    # Far out in the Gaussian's tail there is nothing to compare but exponents.
    shown = truth > 1e-3 * truth.max()
    assert shown.sum() >= 8
    assert got[shown] == pytest.approx(truth[shown], rel=0.02)
    assert np.all(got[~shown] < 2e-3 * truth.max())


MUTANTS = {
    "mirrored azimuth": lambda m: Lobe(12.0, shift=(-m[0], m[1])),
    "flipped up": lambda m: Lobe(12.0, shift=(m[0], -m[1])),
    "swapped front and back": lambda m: Lobe(12.0, shift=(-m[0], -m[1])),
}


class TwoFaced(Lobe):
    """A lobe that the back sends the other way, so that mistaking it for the front shows."""

    def value(self, side, sx, sy, ux, uy):  # type: ignore[no-untyped-def]
        sign = 1.0 if side == "transmission_front" else -1.0
        return super().value(side, sign * sx, sign * sy, sign * ux, sign * uy)


def test_an_asymmetric_lobe_lands_where_the_conventions_say_and_no_mutant_does() -> None:
    shift = (0.25, 0.15)
    points = np.array([(x, y, 0.0) for x in (1.0, 1.8, 2.5, 3.2, 4.0) for y in (0.8, 1.6, 2.4)])
    job = room(
        sun={"elevation_deg": 45.0, "azimuth_deg": 20.0, "normal_illuminance_lx": 8e4},
        sensor=sensors(points, UP),
    )
    lit = daylight.run(job, models={"lobe": TwoFaced(12.0, shift=shift)})
    got = np.array([p.illuminance_lx for p in lit.points])
    truth = sun_patch(job, Lobe(12.0, shift=shift), points)
    bright = truth > 0.05 * truth.max()
    assert bright.sum() >= 4
    # Points on a flank: a sensor a millimetre above the floor would already be 0.5 % off.
    assert got[bright] == pytest.approx(truth[bright], rel=0.002)
    for name, mutant in MUTANTS.items():
        wrong = sun_patch(job, mutant(shift), points)
        assert np.max(np.abs(wrong - truth)) > 0.5 * truth.max(), f"this test would not notice: {name}"


@pytest.mark.parametrize(
    ("wall", "east_of", "turned"),
    [
        ("north", np.array([-1.0, 0, 0]), lambda u, d: (5.0 - u, 6.0 - d, 0.0)),
        ("east", np.array([0, 1.0, 0]), lambda u, d: (5.0 - d, u, 0.0)),
        ("west", np.array([0, -1.0, 0]), lambda u, d: (d, 6.0 - u, 0.0)),
    ],
)
def test_a_window_in_any_wall_lights_alike(wall: str, east_of: np.ndarray, turned) -> None:  # type: ignore[no-untyped-def]
    """A point u along the wall (to the right, seen from outside) and d into the room gets the same light."""
    model = Lobe(12.0, shift=(0.2, 0.1))
    quick = daylight.Quality(sampling=0.4, repeats=2)
    sun = {"elevation_deg": 40.0, "azimuth_deg": 15.0, "normal_illuminance_lx": 8e4}
    places = [(3.0, 1.0), (2.0, 1.0), (2.5, 2.0), (3.4, 1.6)]
    south = room(window={"centre_m": 2.5}, sun=sun, sensor=sensors([(u, d, 0.0) for u, d in places], UP))
    # Windows are placed from the wall's west or south end, which lies to the left or to the right.
    length = 5.0 if wall == "north" else 6.0
    centre = 2.5 if east_of.sum() > 0 else length - 2.5
    other = room(
        window={"wall": wall, "centre_m": centre},
        sun=sun | {"wall": wall},
        sensor=sensors([turned(u, d) for u, d in places], UP),
    )
    one, two = (
        [p.illuminance_lx for p in daylight.run(job, models={"m": model}, quality=quick).points]
        for job in (south, other)
    )
    assert two == pytest.approx(one, rel=0.015, abs=0.1)
    assert np.ptp(one) > 100.0


def test_in_a_room_of_one_reflectance_the_mean_illuminance_is_that_of_an_integrating_sphere() -> None:
    """Light in = light swallowed: mean E = flux / (area (1 - rho)), whatever the shape."""
    rho = 0.6
    rng = np.random.default_rng(3)
    size = np.array([3.0, 4.0, 2.5])
    points, normals = [], []
    # Points in proportion to area, stratified over each face.
    for axis in range(3):
        a, b = (k for k in range(3) if k != axis)
        na, nb = int(size[a] / 0.4), int(size[b] / 0.4)
        for end in (0, 1):
            for i, j in np.ndindex(na, nb):
                p = np.zeros(3)
                p[a], p[b] = (i + rng.random()) / na * size[a], (j + rng.random()) / nb * size[b]
                p[axis] = end * size[axis]
                points.append(p)
                normals.append(np.eye(3)[axis] * (1 - 2 * end))
    job = room(
        room={"width_m": size[0], "depth_m": size[1], "height_m": size[2]},
        reflectance={"ceiling": rho, "walls": rho, "floor": rho, "frames": rho},
        window={"pane_reflectance": rho, "frame_m": 0.05},
        sky={"kind": "uniform", "horizontal_illuminance_lx": 1e4},
        sun={"elevation_deg": 40.0, "normal_illuminance_lx": 0.0},
        sensor=sensors(points, normals),
    )
    lit = daylight.run(job, models={"d": Diffuser(0.5)})
    area = 2 * (size[0] * size[1] + size[1] * size[2] + size[0] * size[2])
    truth = 0.5 * 5e3 * (0.7 * 1.0) / (area * (1 - rho))
    assert np.mean([p.illuminance_lx for p in lit.points]) == pytest.approx(truth, rel=0.03)


def test_reflected_light_agrees_with_the_ambient_calculation_of_radiance(tmp_path) -> None:  # type: ignore[no-untyped-def]
    from specularia.daylight.geometry import Box
    from specularia.daylight.outdoors import outdoors
    from specularia.daylight.panes import Glazing, lights
    from specularia.daylight.scene import Scene

    points = np.array([(2.5, 0.002, 1.55), (2.5, 2.5, 0.002), (0.5, 4.0, 0.002), (2.5, 1.0, 2.998)])
    normals = np.array([(0, 1.0, 0), UP, UP, (0, 0, -1.0)])
    job = room(
        reflectance={"ceiling": 0.7, "walls": 0.7, "floor": 0.3, "frames": 0.15},
        sky={"kind": "overcast", "horizontal_illuminance_lx": 1e4},
        ground={"reflectance": 0.2},
        sensor=sensors(points, normals),
    )
    model = Diffuser(0.7)
    lit = daylight.run(job, models={"d": model})
    box, out = Box(job), outdoors(job)
    scene = Scene.make(tmp_path, box, lights(box, [Glazing(model)], out, sampling=1.0), sampling=1.0)
    octree = scene.octree("peer", cell=0.3)
    options = "-h -I -n 2 -ab 12 -aa 0 -ad 1500 -as 0 -lw 2e-5 -ds .1 -dj .7 -dt 0 -dc 1"
    rays = "\n".join(" ".join(map(str, [*p, *n])) for p, n in zip(points, normals)).encode()
    peer = (
        np.array(run(["rtrace", *options.split(), octree], data=rays, cwd=tmp_path).split(), float).reshape(
            -1, 3
        )[:, 1]
        * 179
    )
    assert [p.illuminance_lx for p in lit.points] == pytest.approx(peer.tolist(), rel=0.04)


def test_the_standard_error_covers_what_finer_sampling_changes() -> None:
    job = room(
        reflectance={"ceiling": 0.7, "walls": 0.7, "floor": 0.15, "frames": 0.15},
        sun={"elevation_deg": 60.0, "normal_illuminance_lx": 8e4},
        sensor=sensors([(2.5, 0.5, 0.0), (2.5, 1.2, 0.0), (3.2, 1.0, 0.0), (0.5, 3.0, 0.0)], UP),
    )
    model = Lobe(8.0)
    coarse, fine = (
        daylight.run(job, models={"m": model}, quality=daylight.Quality(sampling=s)).points
        for s in (0.3, 1.0)
    )
    for a, b in zip(coarse, fine):
        assert abs(a.illuminance_lx - b.illuminance_lx) <= 4 * np.hypot(a.se, b.se) + 1e-3 * b.illuminance_lx
        assert b.se < 0.02 * b.illuminance_lx


def test_one_seed_gives_one_answer_and_no_file_stays_behind(tmp_path, monkeypatch) -> None:  # type: ignore[no-untyped-def]
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    job = room(
        sun={"elevation_deg": 60.0, "normal_illuminance_lx": 8e4},
        sensor=sensors([(2.5, 0.5, 0.0), (2.95, 1.0, 0.0)], UP),
    )
    quick = daylight.Quality(sampling=0.3)
    one, same, other = (
        daylight.run(job, models={"m": Lobe(6.0)}, seed=s, quality=quick).points for s in (1, 1, 2)
    )
    assert one == same
    assert one != other
    assert [p.illuminance_lx for p in one] == pytest.approx([p.illuminance_lx for p in other], rel=0.01)
    assert list(tmp_path.iterdir()) == []
