"""Height maps for other programs: X3P, netCDF, and closed meshes of a slab as OBJ, PLY or STL."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from specularia.errors import OutputError, PhysicsError, SpeculariaError
from specularia.files import atomic, writable
from specularia.surface import netcdf
from specularia.surface.heightmap import HeightMap, filled

__all__ = ["FORMATS", "Mesh", "export", "slab_mesh"]

Array = NDArray[np.float64]

FORMATS: Final = (".x3p", ".nc", ".obj", ".ply", ".stl")
MESHES: Final = (".obj", ".ply", ".stl")
"""Endings of the mesh formats that can be written."""

_LARGEST_FACES = 30_000_000


@dataclass(frozen=True)
class Mesh:
    """A closed surface of triangles, seen counter-clockwise from outside.

    Parameters
    ----------
    vertices_um : [V, 3] x, y, z with z out of the front and 0 half-way between the mean planes of the faces.
    triangles : [T, 3] indices.
    interpolated : pixels of the two maps that were missing and are bridged.
    """

    vertices_um: Array
    triangles: NDArray[np.int64]
    interpolated: int


def export(
    surface: HeightMap,
    path: str | Path,
    *,
    back: HeightMap | None = None,
    thickness_um: float | None = None,
    every: int = 1,
) -> Path:
    """Write a height map in the format that the path's suffix names.

    Parameters
    ----------
    surface : the map; for a mesh the front of the slab.
    path : .x3p (ISO 25178-72, through SurfaceTopography), .nc (our own), .obj, .ply or .stl (closed slab,
        lengths in um, through trimesh).
    back, thickness_um, every : of a mesh, see `slab_mesh`; the thickness is needed there.
    """
    path = writable(path)
    suffix = path.suffix.lower()
    if suffix not in FORMATS:
        raise OutputError(
            f"{path}: cannot write {suffix or 'a file without suffix'}; use {', '.join(FORMATS)}."
        )
    if suffix == ".nc":
        return netcdf.write(surface, path)
    if suffix == ".x3p":
        return _x3p(surface, path)
    if thickness_um is None:
        raise SpeculariaError(f"{path}: a closed mesh needs the thickness of the slab. State it.")
    mesh = slab_mesh(surface, back, thickness_um=thickness_um, every=every)
    return _mesh(mesh, path, surface)


def slab_mesh(
    front: HeightMap, back: HeightMap | None = None, *, thickness_um: float, every: int = 1
) -> Mesh:
    """A slab between two faces as one closed mesh: both reliefs, and four walls between their borders.

    The vertices of a face are its pixels (every `every`-th one); the back lies under the front with its x
    axis turned round, since each map is as its microscope saw it, both from one corner of the slab. Where the
    back has other pixels or another extent, the slab is what both cover, and the back's heights are
    interpolated (bilinear) at the front's pixels.

    Parameters
    ----------
    front, back : maps of at least 2 x 2 pixels, at most 20 % missing (bridged by a soap film); without a back
        that face is flat.
    thickness_um : between the mean planes of the faces, > 0.
    every : thinning, from 1 up.

    Raises
    ------
    PhysicsError : the faces would touch or cross, or the mesh would have more than 30 million triangles.
    """
    if every < 1:
        raise SpeculariaError(f"every {every} pixels is no thinning; state 1 or more.")
    if not thickness_um > 0:
        raise SpeculariaError(f"the thickness must be above 0 um, found {thickness_um}.")
    if min(front.shape) < 2 or (back is not None and min(back.shape) < 2):
        raise PhysicsError(f"{front.name}: a slab needs maps of at least 2 x 2 pixels.")
    whole, gaps = filled(front)
    top = whole.heights_um - whole.heights_um.mean()
    x, y = front.x_um, front.y_um
    bottom = np.zeros_like(top)
    if back is not None:
        under, more = filled(back)
        gaps += more
        x = x[x <= under.x_um[-1] * (1 + 1e-9)]
        y = y[y <= under.y_um[-1] * (1 + 1e-9)]
        top = top[: y.size, : x.size]
        # Seen from the back, its x runs from the slab's far edge; both maps lie in the common rectangle.
        bottom = _at(under, x[-1] - x, y) - under.heights_um.mean()
    x, y, top, bottom = x[::every], y[::every], top[::every, ::every], bottom[::every, ::every]
    rows, columns = top.shape
    if rows < 2 or columns < 2:
        raise PhysicsError(
            f"{front.name}: hardly a pixel is left of what both faces cover, thinned by {every}."
        )
    if 4 * rows * columns > _LARGEST_FACES:
        thinner = int(np.ceil(every * np.sqrt(4 * rows * columns / _LARGEST_FACES)))
        raise PhysicsError(
            f"{front.name}: {4 * rows * columns} triangles are too many; take every {thinner}th pixel."
        )
    gap = float((thickness_um + top + bottom).min())
    if not gap > 0:
        raise PhysicsError(
            f"{front.name}: the faces cross by {-gap:.4g} um at a thickness of {thickness_um:g} um."
        )
    xx, yy = np.meshgrid(x, y)
    n = rows * columns
    vertices = np.concatenate(
        [
            np.stack([xx, yy, thickness_um / 2 + top], axis=-1).reshape(n, 3),
            np.stack([xx, yy, -thickness_um / 2 - bottom], axis=-1).reshape(n, 3),
        ]
    )
    index = np.arange(n).reshape(rows, columns)
    a, b = index[:-1, :-1].ravel(), index[:-1, 1:].ravel()
    c, d = index[1:, 1:].ravel(), index[1:, :-1].ravel()
    upper = np.concatenate([np.stack([a, b, c], 1), np.stack([a, c, d], 1)])
    lower = upper[:, ::-1] + n
    # The border once round, counter-clockwise seen from the front: the walls stand on it.
    ring = np.concatenate([index[0, :-1], index[:-1, -1], index[-1, :0:-1], index[:0:-1, 0]])
    after = np.roll(ring, -1)
    walls = np.concatenate([np.stack([ring, ring + n, after + n], 1), np.stack([ring, after + n, after], 1)])
    return Mesh(vertices, np.concatenate([upper, lower, walls]), gaps)


def _at(surface: HeightMap, x_um: Array, y_um: Array) -> Array:
    """Heights at the crossings of x and y, bilinear."""
    from scipy.ndimage import map_coordinates

    rows, columns = np.meshgrid(y_um / surface.pitch_y_um, x_um / surface.pitch_x_um, indexing="ij")
    return np.asarray(map_coordinates(surface.heights_um, [rows, columns], order=1, mode="nearest"))


def _x3p(surface: HeightMap, path: Path) -> Path:
    from SurfaceTopography import Topography

    if surface.is_profile:
        raise OutputError(f"{path}: a profile cannot be written as .x3p; write it as .nc.")
    rows, columns = surface.shape
    heights: Any = np.ma.masked_invalid(surface.heights_um.T)
    topography = Topography(
        heights if surface.missing else surface.heights_um.T,
        (columns * surface.pitch_x_um, rows * surface.pitch_y_um),
        unit="µm",
    )
    with atomic(path) as temporary:
        topography.to_x3p(str(temporary), manufacturer="specularia", model=surface.name or "height map")
    return path


def _mesh(mesh: Mesh, path: Path, surface: HeightMap) -> Path:
    import trimesh

    body = trimesh.Trimesh(mesh.vertices_um, mesh.triangles, process=False, validate=False)
    note = f"{surface.name or 'slab'}, lengths in um, z out of the front"
    if "synthetic" in surface.attributes:
        note += ", synthetic"
    with atomic(path) as temporary:
        if path.suffix.lower() == ".obj":
            text: str = trimesh.exchange.obj.export_obj(  # type: ignore[no-untyped-call]
                body, include_normals=False, header=note, digits=6
            )
            temporary.write_text(text, encoding="utf-8")
        else:
            body.export(str(temporary))
    return path
