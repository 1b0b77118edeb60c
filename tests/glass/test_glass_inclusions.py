"""Inclusions, and bubbles met in free flight."""

import numpy as np
import pytest

from specularia.errors import FormatError, PhysicsError
from specularia.glass import (
    BubbleKind,
    Bubbles,
    Inside,
    Medium,
    Slab,
    read_slab,
    trace,
    trace_paths,
    write_bubbles,
)
from specularia.glass.kernel import ABSORBED

OPAQUE = Inside(None, float("inf"))
MATCHED = Inside(None, 0.0)


def first_pass(slab, theta_deg, **named):
    """Depth below the front, in mm, at which paths end at opaque bodies before they meet the back, and the
    number of paths that entered the glass."""
    paths = trace_paths(slab, theta_deg=theta_deg, **named)
    cos_t = np.sqrt(1 - (np.sin(np.radians(theta_deg)) / 1.52) ** 2)
    depth = paths.glass_length_mm * cos_t
    taken = (paths.exit_side == ABSORBED) & (depth < slab.thickness_mm)
    return depth[taken], int(np.sum(paths.glass_length_mm > 0))


@pytest.mark.parametrize("theta", [0.0, 60.0])
def test_free_flight_meets_large_spheres_where_they_can_be(theta):
    # Spheres of radius r in 1 mm of glass: their centres lie in r..1-r, evenly. Poisson's law: light reaches
    # the depth z with the probability exp(-n V), V the volume of centres from which it would have been met.
    radius, per_cm3, n = 0.25, 600.0, 1.52
    slab = Slab(
        thickness_mm=1.0,
        bubble_kinds=(BubbleKind(per_cm3, 2 * radius, inside=OPAQUE, placing="free flight"),),
    )
    depth, entered = first_pass(slab, theta, paths=320_000, seed=1)
    cos_t = np.sqrt(1 - (np.sin(np.radians(theta)) / n) ** 2)
    # By quadrature: a body with its centre at depth c, at the distance b from the way, is entered at the way
    # c / cos - h, spread over the disk of its cross section.
    rng = np.random.default_rng(1)
    c = radius + rng.random(400_000) * (1 - 2 * radius)
    q = radius * np.sqrt(rng.random(c.size))
    turn = 2 * np.pi * rng.random(c.size)
    entry = c - cos_t * np.sqrt(radius**2 - q**2) + np.sqrt(1 - cos_t**2) * q * np.cos(turn)
    at = np.linspace(0.05, 0.95, 10)
    met = np.array([np.mean(entry < z) for z in at])
    optical = per_cm3 / 1000 * np.pi * radius**2 / cos_t * met
    found = np.array([np.sum(depth < z) for z in at]) / entered
    assert np.all(np.abs(found - (1 - np.exp(-optical))) < 4 * np.sqrt(0.25 / entered) + 1e-3)


def test_list_and_free_flight_meet_bodies_alike_also_near_the_faces():
    kind = {"per_cm3": 200.0, "median_mm": 0.25, "sigma": 0.3, "elongation": 2.0, "axis": (0.3, 1, 0.6)}
    flight = Slab(thickness_mm=1.0, bubble_kinds=(BubbleKind(**kind, inside=OPAQUE, placing="free flight"),))
    depth, entered = first_pass(flight, 45.0, paths=320_000, seed=1)
    listed, number = [], 0
    for seed in range(6):
        slab = Slab(thickness_mm=1.0, bubble_kinds=(BubbleKind(**kind, inside=OPAQUE),), bubble_seed=seed)
        found, n = first_pass(slab, 45.0, paths=64_000, seed=seed)
        listed.append(found)
        number += n
    # Six lists of a thousand bodies know the share to 1.3 % (sizes spread, too), the flights to 0.7 %.
    assert depth.size / entered == pytest.approx(sum(map(len, listed)) / number, rel=0.05)
    # Where along the depth, near either face and between: shares of thousands of bodies.
    edges = np.linspace(0, 1, 9)
    a = np.histogram(depth, edges)[0] / depth.size
    b = np.mean([np.histogram(x, edges)[0] / len(x) for x in listed], axis=0)
    spread = np.std([np.histogram(x, edges)[0] / len(x) for x in listed], axis=0, ddof=1) / np.sqrt(6)
    assert a[0] < 0.75 * a[3]
    assert np.all(np.abs(a - b) < 4 * np.hypot(spread, np.sqrt(a / depth.size)))


def test_air_bubbles_scatter_alike_from_a_list_and_in_free_flight():
    kind = {"per_cm3": 300.0, "median_mm": 0.2, "sigma": 0.3, "elongation": 3.0}
    flight = trace_paths(
        Slab(thickness_mm=1.0, bubble_kinds=(BubbleKind(**kind, placing="free flight"),)),
        theta_deg=50.0, paths=128_000, seed=1,
    )  # fmt: skip

    def wide(p):
        off = np.hypot(p.ux + np.sin(np.radians(50.0)), p.uy)
        return np.array([np.mean(p.transmitted & (off > a)) for a in (1e-6, 0.1, 0.3, 0.6)])

    listed = [
        wide(
            trace_paths(
                Slab(thickness_mm=1.0, bubble_kinds=(BubbleKind(**kind),), bubble_seed=s),
                theta_deg=50.0, paths=64_000, seed=s,
            )
        )
        for s in range(6)
    ]  # fmt: skip
    mean, error = np.mean(listed, axis=0), np.std(listed, axis=0, ddof=1) / np.sqrt(6)
    found = wide(flight)
    assert np.all(np.abs(found - mean) < 4 * np.hypot(error, np.sqrt(found / 128_000)))
    assert found[0] > 0.01
    assert np.allclose(flight.weight, 1.0)


def test_same_seed_gives_the_same_flights():
    kind = BubbleKind(300.0, 0.2, sigma=0.3, placing="free flight")
    slab = Slab(thickness_mm=1.0, bubble_kinds=(kind,))
    a, b = (trace_paths(slab, theta_deg=30.0, paths=3200, seed=4) for _ in range(2))
    assert np.array_equal(a.ux, b.ux)
    assert not np.array_equal(a.ux, trace_paths(slab, theta_deg=30.0, paths=3200, seed=5).ux)


@pytest.mark.parametrize("placing", ["cell", "free flight"])
def test_inclusions_of_the_glass_itself_are_not_seen(placing):
    kind = BubbleKind(300.0, 0.3, elongation=2.0, inside=MATCHED, placing=placing)
    clear = Slab(thickness_mm=1.0, medium=Medium(absorption_per_mm=0.1))
    with_them = Slab(thickness_mm=1.0, medium=clear.medium, bubble_kinds=(kind,))
    a = trace_paths(clear, theta_deg=50.0, paths=6400, seed=1)
    b = trace_paths(with_them, theta_deg=50.0, paths=6400, seed=1)
    assert np.allclose(b.ux, -np.sin(np.radians(50.0)), atol=1e-9)
    # They only take their share of the volume out of the way in glass.
    share = 0.3 * np.pi / 6 * 0.3**3
    assert np.mean(b.glass_length_mm) / np.mean(a.glass_length_mm) == pytest.approx(1 - share, abs=4e-4)
    assert np.allclose(b.weight + b.absorbed, 1.0, atol=1e-12)


def test_an_absorbing_body_weakens_light_by_its_chord():
    # One sphere, light straight down: chords 2 sqrt(r^2 - b^2), even over the cell.
    radius, a = 0.3, 2.0
    body = Bubbles([[0, 0, 0]], [radius], [radius], [[0, 0, 1]], (1.5, 1.5), (Inside(None, a),))
    paths = trace_paths(Slab(thickness_mm=1.0, bubbles=body), theta_deg=0.0, paths=320_000, seed=1)
    once = paths.transmitted & (paths.glass_length_mm < 1.0 + 1e-9)
    crossed = once & (paths.glass_length_mm < 1.0 - 1e-9)
    assert np.allclose(paths.weight[crossed], np.exp(-a * (1.0 - paths.glass_length_mm[crossed])), rtol=1e-9)
    b2 = (np.arange(200_000) + 0.5) / 200_000 * radius**2
    mean = np.mean(np.exp(-a * 2 * np.sqrt(radius**2 - b2)))
    assert paths.weight[crossed].mean() == pytest.approx(mean, abs=2e-3)
    assert crossed.sum() / once.sum() == pytest.approx(np.pi * radius**2 / 1.5**2, abs=2e-3)


def test_energy_is_shared_exactly_with_bodies_of_all_kinds():
    kinds = tuple(
        BubbleKind(60.0, 0.2, elongation=1.5, inside=inside, placing=placing)
        for inside in (Inside(), OPAQUE, Inside(1.7, 3.0))
        for placing in ("cell", "free flight")
    )
    slab = Slab(thickness_mm=1.0, medium=Medium(absorption_per_mm=0.05), bubble_kinds=kinds)
    found = trace(slab, theta_deg=[0.0, 60.0, 82.5], paths=32_000, seed=3)
    assert np.all(np.abs(found.tau + found.rho + found.absorbed - 1) < 1e-9)
    assert found.lost.sum() == 0


def test_fillings_that_cannot_be_are_refused(tmp_path):
    with pytest.raises(PhysicsError, match="between 1 and 5"):
        Inside(0.5)
    with pytest.raises(PhysicsError, match="absorption_per_mm"):
        Inside(1.0, -1.0)
    with pytest.raises(PhysicsError, match="do not fit"):
        Slab(thickness_mm=1.0, bubble_kinds=(BubbleKind(1.0, 3.0, placing="free flight"),)).geometry  # noqa: B018
    body = Bubbles([[0, 0, 0]], [0.1], [0.1], [[0, 0, 1]], (1.0, 1.0), (OPAQUE,))
    with pytest.raises(PhysicsError, match="air bubbles"):
        write_bubbles(body, tmp_path / "list.csv")


BASE = "thickness_mm = 1.0\n[front]\nflat = true\n[back]\nflat = true\n"


def test_inclusions_patch_liquid_and_laser_are_read_from_the_file(tmp_path):
    write_bubbles(Bubbles([[0, 0, 0]], [0.1], [0.1], [[0, 0, 1]], (2.0, 2.0)), tmp_path / "list.csv")
    path = tmp_path / "glass.toml"
    path.write_text(
        BASE.replace("[back]", "sealant_index = 1.4\n[back]")
        + """[[bubbles]]
per_cm3 = 5.0
diameter_mm = { median = 0.2 }
placing = "free flight"
[[inclusions]]
kind = "opaque"
list = "list.csv"
[[inclusions]]
kind = "absorbing"
absorption_per_mm = 2.0
index = 1.6
per_cm3 = 4.0
diameter_mm = { median = 0.1 }
[trace]
incident = { stokes = [2.0, 1.0, 0.0, -1.0] }
"""
    )
    slab = read_slab(path)
    assert slab.front.sealant_index == 1.4 and slab.back.sealant_index is None
    assert slab.incident == (0.5, 0.0, -0.5)
    assert slab.bubbles.inside == (OPAQUE,)
    assert [(k.inside, k.placing) for k in slab.bubble_kinds] == [
        (Inside(), "free flight"),
        (Inside(1.6, 2.0), "cell"),
    ]
    path.write_text(
        BASE + '[trace]\nincident = "p"\n[patch]\nwidth_mm = 8.4\nsides = "absorbing"\nlit_mm = 1\n'
    )
    slab = read_slab(path)
    assert slab.incident == (-1.0, 0.0, 0.0)
    assert (slab.patch.width_mm, slab.patch.sides, slab.patch.lit_mm) == (8.4, "absorbing", 1.0)


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        (
            '[[inclusions]]\nkind = "opaque"\nindex = 1.5\nper_cm3 = 1\ndiameter_mm = { median = 0.1 }',
            "opaque",
        ),
        ('[[inclusions]]\nkind = "absorbing"\nper_cm3 = 1\ndiameter_mm = { median = 0.1 }', "absorbing"),
        ("[trace]\nincident = { stokes = [1, 1, 1, 0] }", "Q^2"),
        ('[trace]\npolarised = false\nincident = "s"', "can be"),
        ("[patch]\nwidth_mm = 1\nlit_mm = 2", "can be"),
        ("[patch]\nwidth_mm = 1\n[[bubbles]]\nper_cm3 = 1\ndiameter_mm = { median = 0.1 }", "can be"),
    ],
)
def test_faults_in_the_new_tables_are_named(tmp_path, text, expected):
    path = tmp_path / "glass.toml"
    path.write_text(BASE + text + "\n")
    with pytest.raises(FormatError, match=r"glass\.toml") as error:
        read_slab(path)
    assert expected in str(error.value)
