"""Faces, their tiling, and the walk through the hierarchy of bounds."""

import numpy as np
import pytest
from glass_reference import smooth_map

from specularia import surface
from specularia.errors import PhysicsError, SpeculariaWarning
from specularia.glass import Face, Slab, patches, trace, trace_paths
from specularia.glass.hierarchy import bounds, pack, steepest
from specularia.glass.kernel import BACK, meet_relief
from specularia.surface import HeightMap


def test_bounds_are_the_greatest_corners_of_their_blocks():
    h = np.random.default_rng(1).normal(size=(7, 11)).astype(np.float32)
    e = np.pad(h, ((0, 1), (0, 1)), mode="wrap")
    for level, found in enumerate(bounds(h)):
        size = 2**level
        for i in range(found.shape[0]):
            for j in range(found.shape[1]):
                y1, x1 = min((i + 1) * size, 7), min((j + 1) * size, 11)
                assert found[i, j] == e[i * size : y1 + 1, j * size : x1 + 1].max()


def brute_force(h, o, d, below):
    """Nearest crossing of rays o + t d (in pixels and um) with all triangles around, by Moller and
    Trumbore's test."""
    ny, nx = h.shape
    ry, rx = (-(-16 // n) for n in h.shape)
    e = np.pad(np.tile(h, (2 * ry + 1, 2 * rx + 1)), ((0, 1), (0, 1)), mode="wrap").astype(float)
    y, x = np.mgrid[: e.shape[0], : e.shape[1]]
    v = np.stack([x - rx * nx, y - ry * ny, e], -1)
    a, b, c, f = v[:-1, :-1], v[:-1, 1:], v[1:, 1:], v[1:, :-1]
    corners = np.concatenate(
        [np.stack([a, b, c], -2).reshape(-1, 3, 3), np.stack([a, c, f], -2).reshape(-1, 3, 3)]
    )
    p, e1, e2 = corners[:, 0], corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    out = np.full(len(o), np.inf)
    for k in range(len(o)):
        h1 = np.cross(d[k], e2)
        det = np.sum(e1 * h1, 1)
        with np.errstate(divide="ignore", invalid="ignore"):
            s = o[k] - p
            u = np.sum(s * h1, 1) / det
            q = np.cross(s, e1)
            w = np.sum(q * d[k], 1) / det
            t = np.sum(e2 * q, 1) / det
        tol = 1e-9
        # Rays above the surface can only meet it from above (det < 0 for these triangles), and the other way.
        facing = det * (1 - 2 * below) > 0
        good = facing & (u > -tol) & (w > -tol) & (u + w < 1 + tol) & (t > 0)
        out[k] = t[good].min(initial=np.inf)
    return out


@pytest.mark.parametrize("below", [0, 1])
@pytest.mark.parametrize("shape", [(8, 8), (7, 13), (1, 5)])
def test_walk_meets_the_same_triangle_as_trying_all(shape, below):
    rng = np.random.default_rng(4)
    h = rng.uniform(-2, 2, shape).astype(np.float32)
    packed = pack([h])
    mirror = 1 - 2 * below
    top = float((mirror * h).max())
    count = 150
    o = np.column_stack([rng.random((count, 2)) * shape[::-1], np.full(count, mirror * top)])
    d = rng.normal(size=(count, 3))
    # Towards the surface, and so steep that the crossing lies within the 16 pixels around that brute force
    # tries.
    d[:, 2] = -mirror * (np.abs(d[:, 2]) + 0.3 * np.hypot(d[:, 0], d[:, 1]))
    d /= np.linalg.norm(d, axis=1)[:, None]
    expected = brute_force(h, o, d, below)
    found = [meet_relief(*packed, 0, below, top, 1.0, *o[k], *d[k], 0, 0, -1) for k in range(count)]
    t = np.array([f[0] for f in found])
    assert np.all(np.isfinite(expected))
    assert np.allclose(t, expected, atol=1e-6)
    # The place that is named holds the crossing, and its plane passes through it.
    for k, (way, ix, iy, plane, gx, gy, x, y) in enumerate(found):
        u, v = x + way * d[k, 0] - ix, y + way * d[k, 1] - iy
        assert -1e-6 < u < 1 + 1e-6 and -1e-6 < v < 1 + 1e-6
        assert (u - v) * (1 - 2 * plane) > -1e-6
        z = h[iy, ix] + gx * u + gy * v if plane in (0, 1) else np.nan
        assert z == pytest.approx(o[k, 2] + way * d[k, 2], abs=1e-5)


def test_rising_rays_meet_the_relief_or_leave_it_as_trying_all_says():
    rng = np.random.default_rng(6)
    h = rng.uniform(-1, 1, (9, 10)).astype(np.float32)
    packed = pack([h])
    top = float(h.max())
    slope = steepest(h, pitch_x_um=1.0, pitch_y_um=1.0)
    clear = slope / np.hypot(1, slope)
    starts, directions, found = [], [], []
    while len(found) < 150:
        # From a point of the surface, as after a reflection: first down onto it, then up.
        o = np.array([*rng.random(2) * [10, 9], top])
        t, ix, iy, plane, gx, gy, x, y = meet_relief(*packed, 0, 0, top, clear, *o, 0.0, 0.0, -1.0, 0, 0, -1)
        d = rng.normal(size=3) * [1, 1, 0.5]
        d /= np.linalg.norm(d)
        if d[2] - gx * d[0] - gy * d[1] <= 0.02 or d[2] < 0.15:
            continue
        starts.append([x, y, o[2] - t])
        directions.append(d)
        found.append(meet_relief(*packed, 0, 0, top, clear, *starts[-1], *d, ix, iy, plane)[0])
    o, d = np.array(starts), np.array(directions)
    expected = brute_force(h, o + 1e-7 * d, d, 0)
    assert 20 < np.isinf(expected).sum() < 130
    assert np.allclose(np.where(np.isinf(expected), -1.0, expected), found, atol=1e-5)


def test_tiled_map_scatters_as_its_one_period():
    one = smooth_map((12, 20), seed=3, rms_slope=0.5, width_px=3)
    other = smooth_map((15, 9), seed=4, rms_slope=0.5, width_px=3)
    a = Slab(thickness_mm=0.2, front=Face(one, 2.0, 1.5), back=Face(other, 1.0, 1.3))
    b = Slab(
        thickness_mm=0.2,
        front=Face(np.tile(one, (2, 3)), 2.0, 1.5),
        back=Face(np.tile(other, (3, 1)), 1.0, 1.3),
    )
    for theta in (0.0, 55.0):
        x = trace(a, theta_deg=[theta], phi_deg=40.0, paths=160_000, seed=1)
        y = trace(b, theta_deg=[theta], phi_deg=40.0, paths=160_000, seed=2)
        assert abs(x.tau[0] - y.tau[0]) < 3 * np.hypot(x.tau_se[0], y.tau_se[0])


def test_light_spreads_over_the_common_period_of_unequal_faces():
    flat = np.zeros((4, 4))
    faces = {"front": Face(flat, 1.5, 1.0), "back": Face(flat[:3], 1.0, 2.0)}
    slab = Slab(thickness_mm=1.0, **faces)
    assert slab.repeats(0) == (2, 3)
    assert slab.repeats(BACK) == (3, 2)
    assert Slab(thickness_mm=1.0, front=faces["front"]).repeats(0) == (1, 1)
    odd = Slab(thickness_mm=1.0, front=faces["front"], back=Face(flat, np.sqrt(2), 1.0))
    assert odd.repeats(0)[0] > 10_000


@pytest.mark.filterwarnings("ignore:face. repeated as it is")
@pytest.mark.parametrize("axis", ["x", "y"])
@pytest.mark.parametrize("face", ["front", "back"])
@pytest.mark.parametrize("light", ["front", "back"])
def test_a_wedge_deflects_towards_its_thick_end(axis, face, light):
    # A sawtooth that rises slowly along the map's own axis and falls over one pixel in 64.
    tilt, n = 0.1, 64
    ramp = tilt * np.arange(n, dtype=float)
    heights = np.tile(ramp, (4, 1)) if axis == "x" else np.tile(ramp[:, None], (1, 4))
    slab = Slab(thickness_mm=1.0, **{face: Face(heights, 1.0, 1.0)})
    paths = trace_paths(slab, side=light, theta_deg=0.0, paths=32_000, seed=1)
    u = paths.ux if axis == "x" else paths.uy
    # Front: thicker towards +x and +y. The back's map runs the other way in x: thicker towards -x.
    sign = -1.0 if (face == "back" and axis == "x") else 1.0
    alpha = np.arctan(tilt)
    if light == face:
        inside = alpha - np.arcsin(np.sin(alpha) / 1.52)
        out = np.arcsin(1.52 * np.sin(inside))
    else:
        out = np.arcsin(1.52 * np.sin(alpha)) - alpha
    assert np.median(u[paths.transmitted]) == pytest.approx(sign * np.sin(out), abs=1e-4)


def test_front_and_back_maps_meet_as_the_convention_says():
    front = np.arange(12.0).reshape(3, 4)
    slab = Slab(thickness_mm=1.0, front=Face(front), back=Face(front))
    f, b = slab.reliefs
    assert np.allclose(f, front - front.mean())
    for j in range(4):
        assert np.allclose(b[:, j], -(front[:, -j] - front.mean()))


@pytest.mark.filterwarnings("ignore:face. tiling")
def test_mirror_and_blend_tile_without_a_cliff():
    rng = np.random.default_rng(2)
    h = np.cumsum(rng.normal(size=(40, 48)), axis=1)
    assert Face(h, tiling="mirror").tile().shape == (78, 94)
    blended = Face(h, tiling="blend").tile()
    assert blended.shape == (35, 42)
    inside = np.sqrt(np.mean(np.diff(h, axis=1) ** 2))
    seam = np.sqrt(np.mean((blended[:, 0] - blended[:, -1]) ** 2))
    assert seam < 2 * inside
    with pytest.warns(SpeculariaWarning, match="left and right edges do not meet"):
        Face(h, name="cliff").tile()


@pytest.mark.filterwarnings("ignore:face. tiling")
def test_blending_keeps_the_variance_of_a_rough_map():
    h = np.random.default_rng(3).normal(size=(160, 160))
    assert Face(h, tiling="blend").tile().var() == pytest.approx(h.var(), rel=0.05)


def test_few_missing_pixels_are_filled_with_their_count_and_many_refused():
    h = np.add.outer(np.arange(20.0), np.arange(30.0))
    h[5:7, 8:10] = np.nan
    with pytest.warns(SpeculariaWarning) as seen:
        filled = Face(h, tiling="mirror", name="map.nc").tile()
    assert [str(w.message) for w in seen] == [
        "map.nc: 4 missing pixels (0.67 %) were filled from their surroundings."
    ]
    # A plane goes on as a plane.
    assert filled[5, 8] - filled[4, 8] == pytest.approx(1.0)
    h[:, :10] = np.nan
    with pytest.raises(PhysicsError, match=r"200 of 600|map"):
        Face(h, name="map.nc").tile()


def test_map_that_does_not_close_is_mirrored_where_nothing_is_said():
    closed = smooth_map((40, 50), seed=5, rms_slope=0.4)
    for h, expected in ((closed, "periodic"), (closed[:33, :41], "mirror"), (np.zeros((4, 4)), "periodic")):
        assert Face.from_map(HeightMap(h, 1.5, 1.5)).tiling == expected
        assert Face.from_map(HeightMap(h, 1.5, 1.5), tiling="periodic").tiling == "periodic"
    with_gap = closed.copy()
    with_gap[0, :3] = np.nan
    assert Face.from_map(HeightMap(with_gap, 1.5, 1.5)).tiling == "periodic"


def test_change_of_slopes_by_tiling_is_reported():
    h = smooth_map((130, 150), seed=6, rms_slope=0.5)[:100, :120]
    mirror, blend = (Face(h, 1.5, 1.2, tiling=t).report() for t in ("mirror", "blend"))
    dx, dy = np.diff(h, axis=1) / 1.5, np.diff(h, axis=0) / 1.2
    planes = np.concatenate(
        [(dx[:-1] ** 2 + dy[:, 1:] ** 2).ravel(), (dx[1:] ** 2 + dy[:, :-1] ** 2).ravel()]
    )
    assert mirror.rms_slope[0] == pytest.approx(np.sqrt(planes.mean()))
    # Mirrored, the planes of a cell change their diagonal, and nothing else changes.
    assert mirror.rms_slope[1] == pytest.approx(mirror.rms_slope[0], rel=1e-2)
    assert (mirror.blended, mirror.shape, mirror.filled) == (0.0, (198, 238), 0)
    assert mirror.distance < 0.01
    # 12 of 88 rows, 15 of 105 columns.
    assert blend.blended == pytest.approx(1 - (1 - 12 / 88) * (1 - 15 / 105))
    assert blend.shape == (88, 105)
    assert 0.8 < blend.rms_slope[1] / blend.rms_slope[0] < 1.2
    assert mirror.distance < blend.distance < 0.1
    assert blend.Sdq[0] == pytest.approx(surface.roughness(HeightMap(h, 1.5, 1.2)).Sdq)
    with pytest.raises(PhysicsError, match="no map"):
        Face.flat().report()


def test_tiling_that_changes_the_slopes_says_so():
    h = np.cumsum(np.random.default_rng(2).normal(size=(40, 48)), axis=1)
    with pytest.warns(
        SpeculariaWarning, match=r"changes the rms slope from .* \(blended: 27 % of the area\)"
    ):
        Face(h, tiling="blend").tile()


def test_stated_share_of_missing_pixels_is_the_limit():
    h = np.add.outer(np.arange(20.0), np.arange(30.0))
    h[:, :10] = np.nan
    assert Face(h, tiling="mirror", max_missing=0.4).report().filled == 200
    with pytest.raises(PhysicsError, match="at most 30%"):
        Face(h, max_missing=0.3).tile()
    with pytest.raises(PhysicsError, match="share of 0 to 1"):
        Face(h, max_missing=1.5)


def test_patches_are_the_pieces_of_both_maps():
    front, back = smooth_map((40, 50), seed=7, rms_slope=0.4), smooth_map((30, 20), seed=8, rms_slope=0.4)
    slab = Slab(thickness_mm=1.0, front=Face(front, 1.5, 1.5), back=Face(back, 2.0, 1.0), polarised=False)
    found = patches(slab, 2)
    assert len(found) == 4
    assert [p.front.heights_um.shape for p in found] == [(20, 25)] * 4
    assert np.array_equal(found[1].front.heights_um, front[:20, 25:])
    # The back map's x runs the other way: its left half lies behind the right half of the front.
    assert np.array_equal(found[1].back.heights_um, back[:15, :10])
    assert all(p.front.tiling == p.back.tiling == "mirror" and not p.polarised for p in found)
    half_flat = patches(Slab(thickness_mm=1.0, front=Face(front)), 2)
    assert all(p.back.is_flat for p in half_flat)
    tau = [trace(p, theta_deg=[60.0], paths=16_000).tau[0] for p in found]
    whole = trace(slab, theta_deg=[60.0], paths=64_000).tau[0]
    assert abs(np.mean(tau) - whole) < 4 * np.std(tau, ddof=1) / 2 + 0.01
    with pytest.raises(PhysicsError, match="at least one map"):
        patches(Slab(thickness_mm=1.0), 2)
    with pytest.raises(PhysicsError, match="cannot be cut"):
        patches(slab, 25)


def test_impossible_panes_are_refused():
    with pytest.raises(PhysicsError, match="reliefs meet"):
        Slab(thickness_mm=0.01, front=Face(np.array([[0.0, -30.0], [0.0, 0.0]]))).geometry  # noqa: B018
    with pytest.raises(PhysicsError, match="two dimensions"):
        Face(np.zeros(5))
    with pytest.raises(PhysicsError, match="pixel size"):
        Face(np.zeros((4, 4)), 0.0, 1.0)
    with pytest.raises(PhysicsError, match="thickness"):
        Slab(thickness_mm=-1.0)
