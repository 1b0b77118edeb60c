"""Bubbles: how they are drawn, kept in files, and how much light they meet."""

import numpy as np
import pytest

from specularia.errors import FormatError, PhysicsError, SpeculariaWarning
from specularia.glass import (
    BubbleKind,
    Bubbles,
    Slab,
    read_bubbles,
    sample_bubbles,
    trace_paths,
    write_bubbles,
)

ROOM = {"thickness_mm": 3.0, "low_mm": -1.4, "high_mm": 1.45}


def test_drawn_bubbles_have_the_stated_statistics():
    kind = BubbleKind(per_cm3=30.0, median_mm=0.2, sigma=0.4, elongation=3.0, axis=(0, 1, 0))
    found = sample_bubbles([kind], seed=1, **ROOM)
    volume = found.cell_mm[0] * found.cell_mm[1] * 3.0 / 1000
    assert len(found) == round(30 * volume)
    diameter = (6 * found.volume_mm3 / np.pi) ** (1 / 3)
    assert np.median(diameter) == pytest.approx(0.2, rel=0.06)
    assert np.log(diameter).std() == pytest.approx(0.4, rel=0.08)
    assert np.allclose(found.long_mm / found.short_mm, 3.0)
    assert np.allclose(found.axis, [0, 1, 0])
    again = sample_bubbles([kind], seed=1, **ROOM)
    assert np.array_equal(found.centre_mm, again.centre_mm)


def test_drawn_bubbles_lie_in_the_glass_and_do_not_overlap():
    kinds = [
        BubbleKind(per_cm3=20000.0, median_mm=0.1, sigma=0.3, elongation=2.0, axis=(1, 1, 0.3)),
        BubbleKind(per_cm3=9000.0, median_mm=0.15),
    ]
    found = sample_bubbles(kinds, seed=2, cell_mm=(2.5, 3.0), **ROOM)
    found.check_within(-1.4, 1.45)
    # Points on the wall of each bubble are in no other, periodic images included.
    rng = np.random.default_rng(0)
    n = rng.normal(size=(200, 3))
    n /= np.linalg.norm(n, axis=1)[:, None]
    axis = found.axis
    for k in range(0, len(found), 7):
        along = (n @ axis[k])[:, None] * axis[k]
        wall = found.centre_mm[k] + found.long_mm[k] * along + found.short_mm[k] * (n - along)
        way = wall[:, None] - found.centre_mm
        way[..., :2] -= np.round(way[..., :2] / found.cell_mm) * found.cell_mm
        a = np.einsum("pkc,kc->pk", way, axis)
        depth = (a / found.long_mm) ** 2 + (np.sum(way**2, -1) - a**2) / found.short_mm**2
        depth[:, k] = np.inf
        assert depth.min() > 1


def test_bubbles_too_large_for_the_glass_are_drawn_again_and_counted():
    with pytest.warns(SpeculariaWarning, match=r"\d+ bubble diameters did not fit"):
        found = sample_bubbles([BubbleKind(per_cm3=5.0, median_mm=2.0, sigma=0.5)], seed=1, **ROOM)
    found.check_within(-1.4, 1.45)
    with pytest.raises(PhysicsError, match="Use a smaller cell"):
        sample_bubbles([BubbleKind(per_cm3=1e6, median_mm=0.01)], seed=1, cell_mm=(50.0, 50.0), **ROOM)
    with pytest.raises(PhysicsError, match="do not fit"):
        sample_bubbles([BubbleKind(per_cm3=1.0, median_mm=9.0)], seed=1, **ROOM)


@pytest.mark.parametrize("suffix", [".csv", ".npz"])
def test_lists_of_bubbles_survive_a_file(tmp_path, suffix):
    bubbles = sample_bubbles([BubbleKind(per_cm3=30.0, median_mm=0.2, elongation=2.0)], seed=3, **ROOM)
    found = read_bubbles(write_bubbles(bubbles, tmp_path / f"list{suffix}"))
    assert found.cell_mm == bubbles.cell_mm
    for name in ("centre_mm", "long_mm", "short_mm", "axis"):
        assert np.array_equal(getattr(found, name), getattr(bubbles, name))


@pytest.mark.parametrize(
    ("text", "line"),
    [
        ("x_mm, y_mm\n", 1),
        ("# cell_mm: 4, 4\nx, y\n", 2),
        ("# cell_mm: 4, 4\nx_mm,y_mm,z_mm,long_mm,short_mm,axis_x,axis_y,axis_z\n0,0,0,.1,.1,0,nan,1\n", 3),
        ("# cell_mm: 4, 4\nx_mm,y_mm,z_mm,long_mm,short_mm,axis_x,axis_y,axis_z\n0,0,0,.1,.1,0,1\n", 3),
    ],
)
def test_wrong_lists_are_refused_with_the_line(tmp_path, text, line):
    (tmp_path / "list.csv").write_text(text)
    with pytest.raises(FormatError) as error:
        read_bubbles(tmp_path / "list.csv")
    assert error.value.line == line


def test_bubbles_in_the_relief_are_refused():
    high = Bubbles([[0, 0, 0.45]], [0.1], [0.1], [[0, 0, 1]], (2, 2))
    with pytest.raises(PhysicsError, match="reach beyond the glass"):
        Slab(thickness_mm=1.0, bubbles=high).geometry  # noqa: B018
    with pytest.raises(PhysicsError, match="half the cell"):
        Bubbles([[0, 0, 0]], [0.6], [0.6], [[0, 0, 1]], (2, 2))


@pytest.mark.parametrize("theta", [0.0, 60.0])
def test_a_pane_lets_through_unscattered_what_the_bubbles_do_not_cover(theta):
    # Sparse spheres: what is left undeflected misses all of them on every pass.
    radius, n = 0.15, 12
    rng = np.random.default_rng(5)
    kind = BubbleKind(per_cm3=n / (0.04**2 * 1000 * 0.1), median_mm=2 * radius)
    bubbles = sample_bubbles(
        [kind], thickness_mm=1.0, low_mm=-0.49, high_mm=0.49, seed=int(rng.integers(99)), cell_mm=(4.0, 4.0)
    )
    slab = Slab(thickness_mm=1.0, bubbles=bubbles)
    paths = trace_paths(slab, theta_deg=theta, paths=320_000, seed=1)
    single = 1.0 / np.sqrt(1 - (np.sin(np.radians(theta)) / 1.52) ** 2)
    straight = (np.abs(paths.ux + np.sin(np.radians(theta))) < 1e-9) & (np.abs(paths.uy) < 1e-9)
    first = straight & paths.transmitted & (np.abs(paths.glass_length_mm - single) < 1e-9)
    clear = trace_paths(Slab(thickness_mm=1.0), theta_deg=theta, paths=320_000, seed=1)
    once = clear.transmitted & (np.abs(clear.glass_length_mm - single) < 1e-9)
    # Shadow of a sphere on the pane, along the refracted ray; overlaps counted by points on a grid.
    cos_t = 1 / single
    tan_t = np.sqrt(1 / cos_t**2 - 1)
    x, y = np.meshgrid(np.arange(0, 4, 0.004), np.arange(0, 4, 0.004))
    hit = np.zeros(x.shape, bool)
    for cx, cy, cz in bubbles.centre_mm:
        # Light from phi = 0 runs towards -x as it goes down.
        dx = x - tan_t * (0.5 - cz) - cx
        dx -= 4 * np.round(dx / 4)
        dy = y - cy - 4 * np.round((y - cy) / 4)
        hit |= (dx * cos_t) ** 2 + dy**2 < radius**2
    expected = once.mean() * (1 - hit.mean())
    assert first.mean() == pytest.approx(expected, abs=4 * np.sqrt(0.05 * 0.9 / 320_000) + 4e-4)
