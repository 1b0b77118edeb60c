"""Exports: X3P and netCDF come back as they were, meshes are closed slabs of the right volume."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh

from specularia import surface
from specularia.errors import OutputError, PhysicsError

pytestmark = pytest.mark.filterwarnings("ignore::specularia.errors.SpeculariaWarning")


def rough(shape, seed, pitch=2.0):
    return surface.HeightMap(np.random.default_rng(seed).standard_normal(shape), pitch, pitch)


@pytest.mark.parametrize("suffix", [".x3p", ".nc"])
def test_a_real_map_comes_back_with_its_heights_pitch_and_missing_pixels(shared_data, tmp_path, suffix):
    given = surface.read(shared_data / "surface" / "st_sur-2.sur")
    back = surface.read(surface.export(given, tmp_path / f"a{suffix}"))
    assert np.array_equal(back.valid, given.valid) and back.missing == 117
    assert np.allclose(back.heights_um, given.heights_um, atol=1e-9, equal_nan=True)
    assert (back.pitch_x_um, back.pitch_y_um) == pytest.approx(
        (given.pitch_x_um, given.pitch_y_um), rel=1e-12
    )


@pytest.mark.parametrize("suffix", [".obj", ".ply", ".stl"])
def test_a_slab_is_a_closed_mesh_whose_volume_is_its_thickness_over_the_field(tmp_path, suffix):
    front, back = rough((20, 30), 0), rough((20, 30), 1)
    path = surface.export(front, tmp_path / f"a{suffix}", back=back, thickness_um=50.0)
    body = trimesh.load(path)
    assert body.is_watertight and body.is_winding_consistent
    assert body.volume == pytest.approx(58.0 * 38.0 * 50.0, rel=5e-3) and body.volume > 0
    assert np.ptp(body.vertices[:, 0]) == pytest.approx(58.0)


def test_the_back_lies_under_the_front_with_its_x_axis_turned_round():
    front = surface.HeightMap(np.zeros((4, 5)), 1.0, 1.0)
    heights = np.zeros((4, 5))
    heights[1, 0] = 2.0  # a hill at the left edge of what the microscope saw of the back
    mesh = surface.slab_mesh(front, surface.HeightMap(heights, 1.0, 1.0), thickness_um=10.0)
    lowest = mesh.vertices_um[np.argmin(mesh.vertices_um[:, 2])]
    assert lowest == pytest.approx([4.0, 1.0, -5.0 - 2.0 + 0.1])
    upper = mesh.vertices_um[mesh.vertices_um[:, 2] > 0]
    assert np.allclose(upper[:, 2], 5.0)


def test_faces_of_other_pixels_are_cut_to_what_both_cover():
    _, x = np.mgrid[0:40, 0:50]
    back = surface.HeightMap(0.01 * x * 0.5, 0.5, 0.5)  # 24.5 x 19.5 um, rising along its x
    mesh = surface.slab_mesh(rough((30, 40), 2, pitch=1.0), back, thickness_um=20.0)
    assert mesh.vertices_um[:, 0].max() == pytest.approx(24.0) and mesh.vertices_um[
        :, 1
    ].max() == pytest.approx(19.0)
    under = mesh.vertices_um[mesh.vertices_um[:, 2] < 0]
    slope = np.polyfit(under[:, 0], -under[:, 2], 1)[0]
    assert slope == pytest.approx(-0.01, rel=1e-6)  # turned round
    thin = surface.slab_mesh(rough((30, 40), 2, pitch=1.0), thickness_um=20.0, every=3)
    assert thin.vertices_um.shape[0] == 2 * 10 * 14


def test_what_is_no_slab_is_refused(tmp_path):
    front = rough((10, 10), 3)
    with pytest.raises(PhysicsError, match="cross by"):
        surface.slab_mesh(front, front, thickness_um=1.0)
    with pytest.raises(OutputError, match=r"cannot write \.xyz"):
        surface.export(front, tmp_path / "a.xyz")
    with pytest.raises(OutputError, match="profile"):
        surface.export(surface.HeightMap(np.zeros((1, 9)), 1.0, float("nan")), tmp_path / "a.x3p")
    assert not list(tmp_path.iterdir())


def test_the_command_exports_and_asks_for_the_thickness_of_a_mesh(tmp_path, command):
    np.save(tmp_path / "m.npy", rough((12, 12), 4).heights_um)
    words = ("surface", "export", tmp_path / "m.npy", "--pitch", "2")
    code, out, _ = command(*words, "-o", tmp_path / "a.obj", "--thickness", "0.05", "--json")
    assert code == 0 and trimesh.load(out["path"]).is_watertight
    code, _, err = command(*words, "-o", tmp_path / "b.obj")
    assert code == 2 and "thickness" in err and not (tmp_path / "b.obj").exists()
    code, _, err = command(*words, "-o", tmp_path / "b.x3p", "--thickness", "1")
    assert code == 2
    code, _, err = command(*words, "-o", tmp_path / "b.gwy")
    assert code == 3 and ".gwy" in err
