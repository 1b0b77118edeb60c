"""The room as Radiance sees it: opaque walls, and panes cut into tabulated light sources.

There is no sun and no sky in these scenes; all light comes from the panes, so nothing can leak in. Radiance
seeds its random numbers by the clock. Rays are therefore sent without jitter and without ambient bounces, and
every run gives the same answer; chance enters only by where the panes are cut (`cuts`).
"""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from specularia.conventions import LUMINOUS_EFFICACY
from specularia.daylight.geometry import Box, Pane
from specularia.daylight.obstacles import obstacle_faces
from specularia.daylight.own_geometry import OwnRoom
from specularia.daylight.panes import Light, Lights
from specularia.errors import PhysicsError
from specularia.radiance import run

__all__ = ["Scene", "cuts", "polygon", "walls"]

Array = NDArray[np.float64]

_CAL = """{ Stereographic coordinates of the direction a pane emits towards the ray's origin.
  A1..A3, A4..A6: the sample's x and y; A7..A9: normal into the room. }
towards = max(-(Dx*A7 + Dy*A8 + Dz*A9), 0);
pane_s = -(Dx*A1 + Dy*A2 + Dz*A3) / (1 + towards);
pane_t = -(Dx*A4 + Dy*A5 + Dz*A6) / (1 + towards);
"""


def cuts(length: float, cell: float, shift: float) -> Array:
    """Borders of strips across `length`: `cell` wide at most, the first narrowed to the share `shift` of one.

    >>> cuts(1.0, 0.5, 0.5).tolist()
    [0.0, 0.25, 0.75, 1.0]
    """
    n = max(int(np.ceil(length / cell - 1e-9)), 1)
    inner = (np.arange(n) + shift) * (length / n)
    inside = inner[(inner > 1e-6 * length) & (inner < (1 - 1e-6) * length)]
    return np.concatenate([[0.0], inside, [length]])


@dataclass(frozen=True)
class Scene:
    """Octrees of one room with one model's panes.

    Attributes
    ----------
    folder : where the files lie.
    box : the room.
    lights : what the panes emit.
    width_deg : the least `EmissionMap.width_deg` of the maps, whatever their band; it sets how finely a pane
        is sampled.
    sampling : density of points on the panes, times the quick one.
    """

    folder: Path
    box: Box | OwnRoom
    lights: Lights
    width_deg: float
    sampling: float

    @classmethod
    def make(
        cls, folder: Path, box: Box | OwnRoom, lights: Lights, *, sampling: float, plates: bool = False
    ) -> Scene:
        """Write the emission maps and the walls.

        With `plates` the panes reflect light from the room, which Radiance's light sources do not: a thin
        sheet of trans before each scatters back its reflectance, and its map makes up for what the sheet
        takes.
        """
        (folder / "pane.cal").write_text(_CAL)
        for k, bands in enumerate(zip(*(b.maps for b in lights.bands), strict=True)):
            values = lights.channels([m.luminance for m in bands])
            if plates:
                pane = next(light.pane for light in lights.lights if light.map == k)
                values = values / _plate(lights.pane_reflectance[pane])[1]
            for c, name in enumerate(_files(k, lights)):
                (folder / name).write_text(_data(bands[0].s, bands[0].t, values[..., c]))
        (folder / "walls.rad").write_text(
            box.text + _obstacles(box) if isinstance(box, OwnRoom) else walls(box)
        )
        if plates:
            with (folder / "walls.rad").open("a") as f:
                f.writelines(_sheet(k, pane, box, lights) for k, pane in enumerate(box.panes))
        lit = [m.width_deg() for b in lights.bands for m in b.maps if m.luminance.max() > 0]
        return cls(folder, box, lights, min(lit, default=90.0), sampling)

    def octree(self, name: str, *, cell: float, shift: tuple[float, float] = (0.0, 0.0)) -> str:
        """Make an octree with the panes cut into cells of about `cell` metres; returns its file name."""
        text = "".join(
            _light(k, one, _files(one.map, self.lights), self.box, cell, shift)
            for k, one in enumerate(self.lights.lights)
        )
        (self.folder / f"{name}.rad").write_text(text)
        octree = run(["oconv", "-f", "walls.rad", f"{name}.rad"], cwd=self.folder)
        (self.folder / f"{name}.oct").write_bytes(octree)
        return f"{name}.oct"

    def illuminance(self, octree: str, points: Array, normals: Array, *, fineness: float = 1.0) -> Array:
        """[K, C] lx straight from the panes at points [K, 3] with normals [K, 3]; C as in `colour`.

        Points on a pane lie so densely that neighbours are seen under `width_deg` / (2 `fineness`) at most.
        """
        if len(points) == 0:
            return np.zeros((0, self.channels))
        data = np.hstack([points, normals]).astype("<f4").tobytes()
        out = run(["rtrace", "-h", "-I", "-ff", *self._options(fineness), octree], data=data, cwd=self.folder)
        return self.read(np.frombuffer(out, "<f4").reshape(-1, 3))

    @property
    def channels(self) -> int:
        """1, or 3 in colour."""
        return 1 if self.lights.chroma is None else 3

    def read(self, values: Array) -> Array:
        """[K, C] lx or cd/m2 of what Radiance says, [K, 3] in watts; of grey light one channel is kept."""
        kept = values[:, 1:2] if self.channels == 1 else values
        return kept.astype(float) * LUMINOUS_EFFICACY

    def look(
        self, octree: str, origins: Array, directions: Array, *, fineness: float = 1.0
    ) -> tuple[Array, Array]:
        """[K, C] cd/m2 by light straight from the panes, and the points hit [K, 3]."""
        data = np.hstack([origins, directions]).astype("<f4").tobytes()
        command = ["rtrace", "-h", "-ff", "-ovp", *self._options(fineness), octree]
        out = np.frombuffer(run(command, data=data, cwd=self.folder), "<f4").reshape(-1, 6).astype(float)
        points = out[:, 3:]
        self._check_closed(points)
        return self.read(out[:, :3]), points

    def hits(self, octree: str, origins: Array, directions: Array) -> Array:
        """[K, 3] points that rays meet, without any light: rtrace casts them only."""
        data = np.hstack([origins, directions]).astype("<f4").tobytes()
        out = run(["rtrace", "-h", "-ff", "-op", octree], data=data, cwd=self.folder)
        points = np.frombuffer(out, "<f4").reshape(-1, 3).astype(float)
        self._check_closed(points)
        return points

    def diffuse(self, origins: Array, directions: Array) -> tuple[Array, Array, Array]:
        """What rays meet if the panes are holes: diffuse reflectance [K, C], points and unit normals [K, 3].

        The reflectance is the radiance in even light of radiance 1. Normals face the ray; nothing met is NaN.
        """
        octree = run(["oconv", "-f", "walls.rad"], cwd=self.folder)
        (self.folder / "bare.oct").write_bytes(octree)
        data = np.hstack([origins, directions]).astype("<f4").tobytes()
        even = ["-ab", "0", "-av", "1", "1", "1", "-aw", "0", "-lr", "0", "-st", "1"]
        command = ["rtrace", "-h", "-ff", "-w", "-ovpN", *even, "bare.oct"]
        out = np.frombuffer(run(command, data=data, cwd=self.folder), "<f4").reshape(-1, 9).astype(float)
        rho, points, normals = self.read(out[:, :3]) / LUMINOUS_EFFICACY, out[:, 3:6], out[:, 6:]
        away = np.sum(normals * directions, axis=1, keepdims=True) > 0.0
        normals = np.where(away, -normals, normals)
        met = (np.linalg.norm(normals, axis=1, keepdims=True) > 0.5) & (np.abs(points) < 1e9).all(
            axis=1, keepdims=True
        )
        return np.where(met, rho, 0.0), np.where(met, points, np.nan), np.where(met, normals, np.nan)

    def _check_closed(self, points: Array) -> None:
        """Refuse view rays that left the box. A room from files may have openings."""
        if isinstance(self.box, OwnRoom):
            return
        off = self.box.distance(points) > 1e-3
        if off.any():
            raise PhysicsError(
                f"{off.sum()} of {off.size} view rays ended in no face of the room; it is not closed."
            )

    def _options(self, fineness: float) -> list[str]:
        # The lower limit bounds the time for panes that are nearly clear.
        spacing = min(max(np.radians(self.width_deg), 0.024) / (2.0 * fineness * self.sampling), 0.2)
        workers = min(os.cpu_count() or 1, 8)
        # No ambient light, no jitter, no source left out by a threshold, every shadow tested.
        return (
            f"-n {workers} -ab 0 -av 0 0 0 -dj 0 -dt 0 -dc 1 -dr 0 -ds {spacing:.5f} -st 1 -ss 0 -lr 4 -lw 0"
        ).split()


_PLATE_M = 1e-4
"""Metres from a pane to the sheet that reflects in its place."""


def _plate(rho: Array) -> tuple[Array, Array, float]:
    """Colour [C] and transmission [C] of a sheet of trans that scatters back rho [C], and its share T.

    Such a sheet scatters back C (1 - T) and lets C T pass straight.
    """
    most = float(np.clip(rho.max(), 1e-3, 0.95))
    colour = np.clip(rho, 0.02 * most, None) / most
    return colour, colour * (1.0 - most), 1.0 - most


def _sheet(number: int, pane: Pane, box: Box | OwnRoom, lights: Lights) -> str:
    colour, _, through = _plate(lights.pane_reflectance[number])
    shade = " ".join(f"{c:.9g}" for c in np.broadcast_to(colour, (3,)))
    face, g = box.faces[pane.face], pane.glass
    corners = face.point(np.array([g.u0, g.u1, g.u1, g.u0]), np.array([g.v0, g.v0, g.v1, g.v1]))
    material = f"void trans plate{number}\n0\n0\n7 {shade} 0 0 {through:.9g} 1\n\n"
    return material + polygon(f"plate{number}", f"plate{number}.0", corners + _PLATE_M * face.normal)


def _files(number: int, lights: Lights) -> list[str]:
    """Names of the data files of a map: one, or one for each of R, G and B."""
    return [f"map{number}{c}.dat" for c in ([""] if lights.chroma is None else "rgb")]


def _data(s: Array, t: Array, luminance: Array) -> str:
    """An emission map, or a channel of one, as a Radiance data file of radiances."""
    head = [f"0 0 {a.size}\n" + "\n".join(f"{v:.7g}" for v in a) for a in (s, t)]
    rows = (" ".join(f"{v:.6g}" for v in row) for row in luminance / LUMINOUS_EFFICACY)
    return "2\n" + "\n".join(head) + "\n" + "\n".join(rows) + "\n"


def polygon(modifier: str, name: str, corners: Array) -> str:
    """A polygon in Radiance's words; corners [K, 3] in m."""
    numbers = "\n".join(" ".join(f"{c:.9g}" for c in corner) for corner in corners)
    return f"{modifier} polygon {name}\n0\n0\n{3 * len(corners)}\n{numbers}\n\n"


def walls(box: Box) -> str:
    """Everything opaque, as even scatterers; where a pane belongs there is a hole."""
    text = []
    for number, face in enumerate(box.faces.values()):
        shade = " ".join(f"{r:.9g}" for r in face.rgb)
        text.append(f"void plastic face{number}\n0\n0\n5 {shade} 0 0\n\n")
        for k, cell in enumerate(box.cells(face.name, 1e9, follow=True)):
            if cell.part < 0:
                q = cell.rectangle
                corners = face.point(np.array([q.u0, q.u1, q.u1, q.u0]), np.array([q.v0, q.v0, q.v1, q.v1]))
                text.append(polygon(f"face{number}", f"face{number}.{k}", corners))
    return "".join(text)


def _obstacles(box: OwnRoom) -> str:
    """What stands outside a room from files, as it may be seen through its openings."""
    text = []
    for number, obstacle in enumerate(box.job.obstacle):
        r = obstacle.reflectance
        text.append(f"void plastic obstacle{number}\n0\n0\n5 {r:.9g} {r:.9g} {r:.9g} 0 0\n\n")
        faces = obstacle_faces(obstacle)
        text += [polygon(f"obstacle{number}", f"obstacle{number}.{k}", c) for k, c in enumerate(faces)]
    return "".join(text)


def _light(
    index: int, light: Light, files: list[str], box: Box | OwnRoom, cell: float, shift: tuple[float, float]
) -> str:
    """Part of a pane as light polygons whose normals point into the room; `files` hold its map."""
    pane = box.panes[light.pane]
    x, y, out = pane.axes
    numbers = " ".join(f"{c:.9g}" for c in np.concatenate([x, y, -out]))
    pattern = "brightdata" if len(files) == 1 else "colordata"
    words = ["noop"] * len(files) + [*files, "pane.cal", "pane_s", "pane_t"]
    text = [
        f"void {pattern} map{index}\n{len(words)} {' '.join(words)}\n0\n9 {numbers}\n\n",
        f"map{index} light glow{index}\n0\n0\n3 1 1 1\n\n",
    ]
    face, g = box.faces[pane.face], light.rectangle
    us = g.u0 + cuts(g.u1 - g.u0, cell, shift[0])
    vs = g.v0 + cuts(g.v1 - g.v0, cell, shift[1])
    turned = float(np.cross(face.along, face.across) @ face.normal) < 0.0
    for i in range(us.size - 1):
        for j in range(vs.size - 1):
            u, v = us[[i, i + 1, i + 1, i]], vs[[j, j, j + 1, j + 1]]
            corners = face.point(u, v)
            text.append(
                polygon(f"glow{index}", f"light{index}.{i}.{j}", corners[::-1] if turned else corners)
            )
    return "".join(text)
