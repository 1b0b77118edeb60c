"""The published route to Model C: the slab as a closed mesh of triangles, through Radiance's BSDF generation.

A finite array of tiles stands in for the pane, and light that total reflection traps comes to its sides.
Absorbing ones take it; clear ones let some of it out, where it counts as transmitted or reflected as if the
faces had sent it there. This module makes a model as it was made then, and says what it lost.
"""

from __future__ import annotations

import math
import tempfile
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from specularia import radiance
from specularia.errors import CoverageError, PhysicsError
from specularia.files import atomic
from specularia.glass.kernel import BACK, FRONT
from specularia.glass.slab import Slab
from specularia.progress import note, task

__all__ = ["ARRAY_MM", "LARGEST_CELLS", "PeerBalance", "Scene", "balance", "scene", "write_xml"]

Array = NDArray[np.float64]
Mesh = tuple[Array, NDArray[np.int64]]
"""Vertices [N, 3] and triangles [M, 3]."""

Sides = Literal["clear", "absorbing"]
"""The sides of the array: of the same clear glass, as published, or absorbing."""

ARRAY_MM = 10.0
"""Default width of the array of tiles, rounded to whole tiles."""

LARGEST_CELLS = 1024 * 1024
"""Cells of one face up to which Radiance's mesh builder is let loose; at 2048 x 2048 it did not end."""

_ABOVE_UM = 1.0
"""Light starts so far outside the relief."""

_OPTIONS = ("-w-", "-ab", "5", "-ad", "700", "-lw", "3e-6", "-cs", "3")
"""What genBSDF gives to rfluxmtx."""


@dataclass(frozen=True)
class Scene:
    """The array as Radiance sees it, in its frame and in um: x_R = -x, y_R = y, z_R = -z.

    Attributes
    ----------
    folder : holds device.oct.
    tiles : along x and y.
    width_um : of the array along x and y; it spans 0 to width along both in Radiance's frame.
    low_um, high_um : z_R of the planes just outside of the front (where -z_R is outdoors) and of the back.
    """

    folder: Path
    tiles: tuple[int, int]
    width_um: tuple[float, float]
    low_um: float
    high_um: float


@dataclass(frozen=True)
class PeerBalance:
    """Transmission and reflection by Radiance, for light on the front.

    Attributes
    ----------
    theta_deg, tau, rho : [N]; what they lack from 1 was absorbed by glass or sides, or given up.
        Light that left through clear sides counts as transmitted or reflected, whichever way it went.
    tau_se : [N] standard error, from the spread of `_BATCHES` batches of rays.
    rays : for each angle.
    """

    theta_deg: Array
    tau: Array
    tau_se: Array
    rho: Array
    rays: int


_BATCHES = 16


@contextmanager
def scene(
    slab: Slab, *, array_mm: float = ARRAY_MM, sides: Sides = "clear", wavelength_nm: float = 520.0
) -> Iterator[Scene]:
    """Build the array; the folder lasts as long as the block.

    Parameters
    ----------
    slab : a pane without bubbles, whose faces have one common period (or are flat).
    array_mm : width wanted; the array has whole tiles, at least one.
    sides : what the sides of the array are made of.

    Raises
    ------
    PhysicsError : faces of different periods, bubbles, or maps too large for Radiance's mesh builder.
    """
    if slab.front.film is not None or slab.back.film is not None:
        raise PhysicsError("the published route knows no thin films; leave them out, or trace paths.")
    if slab.all_bubbles is not None and len(slab.all_bubbles):
        raise PhysicsError(
            "the Radiance route knows no bubbles, as the published model knew none; remove [[bubbles]]."
        )
    (front, front_pitch), (back, back_pitch) = _tile(slab, FRONT), _tile(slab, BACK)
    periods = [p * r.shape[::-1] for p, r in ((front_pitch, front), (back_pitch, back))]
    if not np.allclose(periods[0], periods[1], rtol=1e-6):
        raise PhysicsError(
            f"the Radiance route needs faces of one period, not {_size(periods[0])} and "
            f"{_size(periods[1])} um; crop the maps to one size (where they do not repeat, with "
            "tiling = 'mirror' on both)."
        )
    if max(front.size, back.size) > LARGEST_CELLS:
        raise PhysicsError(
            f"maps of {front.shape[1]} x {front.shape[0]} and {back.shape[1]} x {back.shape[0]} pixels are "
            f"too much for Radiance's mesh builder; {LARGEST_CELLS} cells a face are the limit, 512 x 512 is "
            "advised."
        )
    width, height = (float(v) for v in periods[0])
    tiles = max(1, round(1e3 * array_mm / width)), max(1, round(1e3 * array_mm / height))
    half = 500.0 * slab.thickness_mm
    with tempfile.TemporaryDirectory(prefix="specularia-radiance-") as name:
        folder = Path(name)
        _build(folder, "front", *_surface(front + half, front_pitch))
        vertices, triangles = _surface(back - half, back_pitch)
        _build(folder, "back", vertices, triangles[:, ::-1])
        walls = _walls(front + half, back - half, np.stack([front_pitch, back_pitch]), periods[0])
        for side, mesh in walls.items():
            _build(folder, side, *mesh)
        medium = slab.medium
        through = math.exp(-medium.absorption_at(wavelength_nm) / 1e3)
        index = medium.index_at(wavelength_nm)
        text = [
            f"void dielectric clear\n0\n0\n5 {through} {through} {through} {index} 0\n",
            "void plastic absorbing\n0\n0\n5 0 0 0 0 0\n",
        ]
        nx, ny = tiles
        # In Radiance's frame x runs the other way: tile 0 ends where the array does.
        for mesh_name, columns, rows, x, y in (
            ("front", nx, ny, width, 0.0),
            ("back", nx, ny, width, 0.0),
            ("west", 1, ny, nx * width, 0.0),
            ("east", 1, ny, width, 0.0),
            ("south", nx, 1, width, 0.0),
            ("north", nx, 1, width, (ny - 1) * height),
        ):
            material = sides if mesh_name in _OUTWARDS else "clear"
            for i in range(columns):
                for j in range(rows):
                    at = f"-t {x + i * width:.9g} {y + j * height:.9g} 0"
                    name = f"{mesh_name}.{i}.{j}"
                    text.append(f"{material} mesh {name}\n5 {mesh_name}.rtm {at}\n0\n0\n")
        (folder / "device.rad").write_text("\n".join(text))
        # Radiance sees the cube around each mesh; those of thin panes overlap, and with few objects in a leaf
        # the octree would be divided to its finest along all their borders.
        words = ["oconv", "-w", "-n", "40", "device.rad"]
        (folder / "device.oct").write_bytes(radiance.run(words, cwd=folder))
        yield Scene(
            folder,
            tiles,
            (nx * width, ny * height),
            -(half + float(front.max()) + _ABOVE_UM),
            half - float(back.min()) + _ABOVE_UM,
        )


def balance(
    slab: Slab,
    *,
    theta_deg: Sequence[float],
    phi_deg: float = 0.0,
    array_mm: float = ARRAY_MM,
    sides: Sides = "clear",
    rays: int = 10_000,
    seed: int = 0,
    wavelength_nm: float = 520.0,
) -> PeerBalance:
    """Direct-hemispherical transmission and reflection of the array, its front evenly lit.

    Radiance splits a ray at each interface instead of choosing, so few rays go a long way.
    """
    if not all(0.0 <= t < 90.0 for t in theta_deg):
        raise CoverageError("incident angles lie in 0 <= theta < 90 degrees.")
    rng = np.random.default_rng(seed)
    each = max(1, rays // _BATCHES)
    with scene(slab, array_mm=array_mm, sides=sides, wavelength_nm=wavelength_nm) as built:
        starts = []
        for theta in theta_deg:
            t, p = math.radians(theta), math.radians(phi_deg)
            # Towards the pane, in Radiance's frame.
            d = np.array([math.sin(t) * math.cos(p), -math.sin(t) * math.sin(p), math.cos(t)])
            place = np.empty((each * _BATCHES, 3))
            place[:, :2] = rng.random((len(place), 2)) * built.width_um
            place[:, 2] = built.low_um
            starts.append(np.hstack([place - d, np.broadcast_to(d, place.shape)]))
        _receivers(built.folder, "u", "u")
        with task("Radiance", 1):
            _flux(built.folder, np.vstack(starts), each, len(theta_deg) * _BATCHES)
        shape = (len(theta_deg), _BATCHES)
        through, back = (_matrix(built.folder / f).sum(axis=1).reshape(shape) for f in _OUTPUTS)
    return PeerBalance(
        np.asarray(theta_deg, float),
        through.mean(axis=1),
        through.std(axis=1, ddof=1) / math.sqrt(_BATCHES),
        back.mean(axis=1),
        each * _BATCHES,
    )


def write_xml(
    slab: Slab,
    path: str | Path,
    *,
    resolution: int = 5,
    array_mm: float = ARRAY_MM,
    sides: Sides = "clear",
    samples: int = 1000,
    cull: float = 90.0,
    wavelength_nm: float = 520.0,
) -> dict[str, Array]:
    """Make an isotropic tensor tree as genBSDF does (`-t3 RESOLUTION`), from both sides.

    The steps and their options are those of genBSDF: rays spread over the array and over each incidence bin
    to rfluxmtx, reciprocity and culling by rttree_reduce, wrapBSDF.

    Parameters
    ----------
    path : XML to write.
    resolution : n of 2^n x 2^n outgoing cells.
    samples : rays for each of the 2^(n-1) incidence bins.
    cull : percentage of the tree's cells that are removed.

    Returns
    -------
    dict : for light on our front and back, "transmission_front", "reflection_front" and so on, and
        "theta_deg": the direct-hemispherical value of each incidence bin before the tree is reduced.
    """
    n = 1 << resolution
    bins = n // 2
    # Bin k of an isotropic tree is centred at sin(theta) = 1 - (k + 1/2) / bins, whatever the file says.
    sine = 1.0 - (np.arange(bins) + 0.5) / bins
    out: dict[str, Array] = {"theta_deg": np.degrees(np.arcsin(sine))}
    rng = np.random.default_rng(0)
    with (
        scene(slab, array_mm=array_mm, sides=sides, wavelength_nm=wavelength_nm) as built,
        task("Radiance", 4) as bar,
    ):
        files = {}
        for face, low in (("front", True), ("back", False)):
            rays = _incidence_rays(built, bins, n, samples, rng, low=low)
            # What lies ahead of the light is transmission; receivers are named by where they lie.
            _receivers(built.folder, f"-sc{n}", f"+sc{n}", swap=not low)
            _flux(built.folder, rays, samples, bins)
            bar.advance()
            for kind, output in zip(("transmission", "reflection"), _OUTPUTS):
                matrix = _matrix(built.folder / output)
                out[f"{kind}_{face}"] = matrix.sum(axis=1)
                files[f"{kind}_{face}"] = _tree(built.folder, f"{kind}_{face}", matrix, resolution, cull)
            bar.advance()
        words: list[str | Path] = ["wrapBSDF", "-a", "t3", "-s", "Visible"]
        for key, option in _WRAPPED:
            words += [option, files[key]]
        text = radiance.run(words, cwd=built.folder)
    with atomic(path) as temporary:
        temporary.write_bytes(text)
    note(f"{path}: {built.tiles[0]} x {built.tiles[1]} tiles, {built.width_um[0] / 1e3:.3g} mm wide")
    return out


_OUTPUTS = ("ahead.dat", "behind.dat")

_WRAPPED = (
    ("transmission_front", "-tf"),
    ("transmission_back", "-tb"),
    ("reflection_front", "-rf"),
    ("reflection_back", "-rb"),
)


def _tile(slab: Slab, face: int) -> tuple[Array, Array]:
    """One period of a face: z about its mean plane in the slab's frame, and pitch (x, y); flat ones 2 x 2."""
    relief, pitch = slab.reliefs[face].astype(float), np.asarray(slab.pitch_um[face], float)
    if min(relief.shape) > 1:
        return relief, pitch
    return np.full((2, 2), relief[0, 0]), pitch * relief.shape[::-1] / 2.0


def _size(period: Array) -> str:
    return f"{period[0]:.6g} x {period[1]:.6g}"


def _surface(z: Array, pitch_um: Array) -> Mesh:
    """One tile of a relief in Radiance's frame, normals along -z_R (out of the front).

    Cells are cut along their diagonal 00-11 in the slab's frame, as the tracer cuts them.
    """
    ny, nx = z.shape
    closed = np.pad(z, ((0, 1), (0, 1)), mode="wrap")
    y, x = np.mgrid[: ny + 1, : nx + 1].astype(float)
    vertices = np.stack([-x * pitch_um[0], y * pitch_um[1], -closed], axis=-1).reshape(-1, 3)
    at = np.arange(ny)[:, None] * (nx + 1) + np.arange(nx)
    a, b, c, d = at, at + 1, at + nx + 2, at + nx + 1
    cells = [np.stack(t, axis=-1).reshape(-1, 3) for t in ((a, b, c), (a, c, d))]
    return vertices, np.concatenate(cells)


def _walls(front: Array, back: Array, pitch_um: Array, period: Array) -> dict[str, Mesh]:
    """The sides of one tile between the edges of its faces, in Radiance's frame, normals outwards.

    Faces repeat, so an edge is the same line on either side of the tile. The two edges of a wall may have
    samples at different places; the wall has vertices at all of them.
    """
    out: dict[str, Mesh] = {}
    for axis, names in ((1, ("west", "east")), (0, ("south", "north"))):
        # Along y at x = 0, or along x at y = 0.
        along = 0 if axis == 0 else 1
        edges = [z[:, 0] if axis == 1 else z[0] for z in (front, back)]
        places = [np.arange(len(e) + 1) * pitch_um[k, along] for k, e in enumerate(edges)]
        s = np.unique(np.concatenate(places))
        s = s[np.append(True, np.diff(s) > 1e-9 * period[along])]
        high, low = (np.interp(s, p, np.append(e, e[0])) for p, e in zip(places, edges))
        n = len(s)
        for name, far in zip(names, (0.0, float(period[1 - along]))):
            across = np.full(n, far)
            x, y = (across, s) if axis == 1 else (s, across)
            vertices = np.concatenate([np.stack([-x, y, -z], axis=-1) for z in (high, low)])
            k = np.arange(n - 1)
            triangles = np.concatenate(
                [np.stack([k, k + 1, k + n + 1], axis=-1), np.stack([k, k + n + 1, k + n], axis=-1)]
            )
            a, b, c = vertices[triangles[0]]
            outwards = np.array(_OUTWARDS[name])
            if float(np.cross(b - a, c - a) @ outwards) < 0.0:
                triangles = triangles[:, ::-1]
            out[name] = vertices, triangles
    return out


_OUTWARDS = {"west": (1, 0, 0), "east": (-1, 0, 0), "south": (0, -1, 0), "north": (0, 1, 0)}
"""Normals in Radiance's frame, whose x runs from east to west."""


def _build(folder: Path, name: str, vertices: Array, triangles: NDArray[np.int64]) -> None:
    """Have Radiance build one of its meshes."""
    with (folder / f"{name}.obj").open("w") as f:
        np.savetxt(f, vertices, fmt="v %.9g %.9g %.9g")
        np.savetxt(f, triangles + 1, fmt="f %d %d %d")
    radiance.run(["obj2mesh", f"{name}.obj", f"{name}.rtm"], cwd=folder)
    (folder / f"{name}.obj").unlink()


def _receivers(folder: Path, ahead: str, behind: str, *, swap: bool = False) -> None:
    """Two hemispheres that catch the light, +z_R first; `ahead.dat` is that along which the light travels."""
    names = _OUTPUTS[::-1] if swap else _OUTPUTS
    text = []
    for basis, name, z in ((ahead, names[0], 1), (behind, names[1], -1)):
        up = "" if basis == "u" else " u=-Y"
        text.append(
            f"#@rfluxmtx h={basis}{up} o={name}\n\nvoid glow glow{name[:-4]}\n0\n0\n4 1 1 1 0\n\n"
            f"glow{name[:-4]} source {name[:-4]}\n0\n0\n4 0 0 {z} 180\n"
        )
    (folder / "receivers.rad").write_text("\n".join(text))


def _flux(folder: Path, rays: Array, each: int, records: int) -> None:
    """Rays [records * each, 6] through the device; one row of both outputs for each record."""
    words = ["rfluxmtx", *_OPTIONS, "-ff", "-c", str(each), "-y", str(records), "-", "receivers.rad"]
    for name in _OUTPUTS:
        (folder / name).unlink(missing_ok=True)
    radiance.run([*words, "-i", "device.oct"], data=rays.astype("<f4").tobytes(), cwd=folder)


def _matrix(path: Path) -> Array:
    """A matrix that rfluxmtx wrote, [rows, columns]; grey, so one of its channels says all."""
    head, body = path.read_bytes().split(b"\n\n", 1)
    size = {k: int(v) for k, v in (w.split(b"=") for w in head.split() if w.count(b"=") == 1) if k in _SIZES}
    shape = tuple(size[k] for k in _SIZES)
    return np.frombuffer(body, "<f4").reshape(shape)[..., 1].astype(float)


_SIZES = (b"NROWS", b"NCOLS", b"NCOMP")


def _incidence_rays(
    built: Scene, bins: int, n: int, samples: int, rng: np.random.Generator, *, low: bool
) -> Array:
    """Rays of an isotropic tree, spread over the array and over each incidence bin as by genBSDF."""
    k = np.repeat(np.arange(bins), samples)
    jitter = rng.random((k.size, 4))
    x = 1.0 - (k + jitter[:, 0]) / bins
    y = np.minimum(1.0 / n, np.sqrt(1.0 - x * x)) * np.where(k % 2 == 1, -1.0, 1.0) * jitter[:, 1]
    z = np.sqrt(np.maximum(1.0 - x * x - y * y, 0.0)) * (1.0 if low else -1.0)
    d = np.stack([x, y, z], axis=-1)
    place = np.empty((k.size, 3))
    place[:, :2] = jitter[:, 2:] * built.width_um
    place[:, 2] = built.low_um if low else built.high_um
    return np.hstack([place - d, d])


def _tree(folder: Path, name: str, matrix: Array, resolution: int, cull: float) -> str:
    """Reduce the BSDF of a side to a tree; the name of the file."""
    bsdf = matrix * (4.0**resolution / math.pi)
    words = ["rttree_reduce", "-h", "-a", "-ff", "-r", "3", "-g", str(resolution), "-t", f"{cull:g}"]
    text = radiance.run(words, data=bsdf.astype("<f4").tobytes(), cwd=folder)
    (folder / f"{name}.tree").write_bytes(text)
    return f"{name}.tree"
