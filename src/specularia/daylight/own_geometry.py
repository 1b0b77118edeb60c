"""A room of the user's own: polygons of a Radiance scene or an OBJ file, panes named by their material.

Panes are rectangles whose normals point into the room, as Radiance wants it; two triangles that make up one,
as modelling programs write them, are joined. All other polygons stay what they are, inside and outside: what
stands before a pane shades it. Surfaces that are not polygons (spheres, cylinders, cones, rings, meshes,
instances) are seen by Radiance and shade no pane; a warning counts them.
"""

from __future__ import annotations

import warnings
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from specularia.daylight._triangle_kernel import first_hits
from specularia.daylight.colour import LUMINANCE
from specularia.daylight.geometry import Face, Pane, Rectangle
from specularia.daylight.job import RoomJob
from specularia.errors import FormatError, RadianceError, SpeculariaWarning
from specularia.radiance import run

__all__ = ["OwnRoom"]

Array = NDArray[np.float64]

_SURFACES = ("sphere", "bubble", "ring", "cylinder", "tube", "cone", "cup", "mesh", "instance")
_MATERIALS = ("plastic", "metal", "trans", "plastic2", "metal2", "trans2")
_OTHER = 0.3
"""Reflectance that an outer surface is taken to have whose material states none."""


@dataclass(frozen=True)
class _Primitive:
    modifier: str
    kind: str
    name: str
    words: list[str]
    numbers: Array

    @property
    def text(self) -> str:
        values = " ".join(f"{v:.9g}" for v in self.numbers)
        strings = " ".join([str(len(self.words)), *self.words])
        return f"{self.modifier} {self.kind} {self.name}\n{strings}\n0\n{len(self.numbers)} {values}\n\n"


class OwnRoom:
    """The parts of a `Box` that light and pictures need, for a room from files.

    Parameters
    ----------
    job : with [geometry].
    file : ROOM.toml, for messages.

    Attributes
    ----------
    text : the Radiance scene without the panes.
    polygons : ([K, 3] corners, reflectance) of everything opaque.
    panes : in the order of the files; their `face` is a rectangle of its own, turned into the room.
    faces : those faces, by the pane's name.
    size : [3] largest coordinates of all corners, m.
    """

    has_niches = True

    def __init__(self, job: RoomJob, file: Path) -> None:
        assert job.geometry is not None
        self.job, self.file = job, file
        source = job.geometry.file
        found = [p for name in (job.geometry.materials, source) if name for p in _primitives(name)]
        glass = set(job.geometry.pane_materials)
        panes = [p for p in found if p.kind == "polygon" and p.modifier in glass]
        missing = sorted(glass - {p.modifier for p in panes})
        if missing:
            raise FormatError(
                file=source,
                expected=f"polygons of material {', '.join(missing)} for the panes",
                found=f"materials {', '.join(sorted({p.modifier for p in found if p.kind == 'polygon'}))}",
                advice="Name the panes' materials in pane_materials of [geometry].",
            )
        rest = [p for p in found if not (p.kind == "polygon" and p.modifier in glass)]
        self._primitives = rest
        self.text = "".join(p.text for p in rest)
        shades = {p.name: float(LUMINANCE @ p.numbers[:3]) for p in rest if p.kind in _MATERIALS}
        self.polygons: list[tuple[Array, float]] = [
            (p.numbers.reshape(-1, 3), shades.get(p.modifier, _OTHER)) for p in rest if p.kind == "polygon"
        ]
        curved = sum(p.kind in _SURFACES for p in rest)
        if curved:
            warnings.warn(
                f"{source.name}: {curved} surfaces that are not polygons are seen inside, but shade no pane.",
                SpeculariaWarning,
                stacklevel=2,
            )
        self.panes: list[Pane] = []
        self.faces: dict[str, Face] = {}
        for corners, name in _rectangles(panes, source):
            self._add(corners, name)
        ends = np.concatenate([p for p, _ in self.polygons]) if self.polygons else np.zeros((1, 3))
        self.size: Array = ends.max(axis=0)
        self._check()

    def _add(self, corners: Array, name: str) -> None:
        normal = _normal(corners)
        up = np.array([0.0, 0.0, 1.0]) if abs(normal[2]) < 0.999 else np.array([0.0, 1.0, 0.0])
        y = up - (up @ normal) * normal
        y /= np.linalg.norm(y)
        size = (
            float(np.linalg.norm(corners[1] - corners[0])),
            float(np.linalg.norm(corners[3] - corners[0])),
        )
        self.faces[name] = Face(name, corners, normal, 0.0)
        self.panes.append(
            Pane(
                name=name,
                window=0,
                face=name,
                glass=Rectangle(0.0, 0.0, *size),
                model=None,
                axes=np.stack([np.cross(y, -normal), y, -normal]),
                centre=corners.mean(axis=0),
            )
        )

    def _check(self) -> None:
        """Refuse panes that look the wrong way: in front of a pane there is a room, behind it the open."""
        fans = [np.stack([p[0], p[k], p[k + 1]]) for p, _ in self.polygons for k in range(1, len(p) - 1)]
        triangles = np.array(fans).reshape(-1, 3, 3)
        rng = np.random.default_rng(0)
        d = rng.normal(size=(400, 3))
        d /= np.linalg.norm(d, axis=1, keepdims=True)
        for pane in self.panes:
            inwards = -pane.axes[2]
            away = np.where((d @ inwards)[:, None] < 0.0, -d, d)
            open_ahead, open_behind = (
                float(
                    np.mean(first_hits((pane.centre + s * 1e-4 * inwards)[None], s * away, triangles)[0] < 0)
                )
                for s in (1.0, -1.0)
            )
            if open_ahead > 0.5 and open_behind < open_ahead:
                raise FormatError(
                    file=self.file,
                    expected=f"pane {pane.name!r} with its normal into the room",
                    found=f"{100 * open_ahead:.0f} % of what lies before it is open, and "
                    f"{100 * open_behind:.0f} % of what lies behind it: it faces outwards",
                    advice="Reverse the order of its corners.",
                )

    @property
    def coloured(self) -> bool:
        """Whether any material has a colour."""
        return any(
            p.kind.startswith(("color", "spec")) or (p.kind in _MATERIALS and np.ptp(p.numbers[:3]) > 0.0)
            for p in self._primitives
        )

    def lifted(self, points: Array) -> Array:
        """Points as they are: sensors of a room of one's own are placed where light is wanted."""
        return points


def _primitives(path: Path) -> list[_Primitive]:
    """The primitives of a scene file, commands and transformations carried out."""
    said: list[str] = []
    program = ["obj2rad"] if path.suffix.lower() == ".obj" else ["xform", "-e"]
    try:
        text = run([*program, path.name], cwd=path.parent, said=said).decode()
    except RadianceError as error:
        text, said = "", [str(error)]
    trouble = [line for line in said if "warning" in line or "error" in line or "code" in line]
    if trouble:
        raise FormatError(
            file=path, expected="a scene that Radiance reads without a warning", found=trouble[0].strip()
        )
    words = [w for line in text.splitlines() if not line.lstrip().startswith("#") for w in line.split()]
    found, at = [], 0
    while at < len(words):
        try:
            modifier, kind, name = words[at : at + 3]
            at += 3
            if kind == "alias":
                found.append(_Primitive(modifier, kind, name, [words[at]], np.zeros(0)))
                at += 1
                continue
            count = int(words[at])
            strings = words[at + 1 : at + 1 + count]
            at += 1 + count
            at += 1 + int(words[at])
            count = int(words[at])
            numbers = np.array([float(w) for w in words[at + 1 : at + 1 + count]])
            at += 1 + count
        except (ValueError, IndexError) as error:
            raise FormatError(
                file=path, expected="Radiance primitives", found=f"{' '.join(words[at : at + 6])} ({error})"
            ) from error
        found.append(_Primitive(modifier, kind, name, strings, numbers))
    return found


def _normal(corners: Array) -> Array:
    total = np.cross(corners, np.roll(corners, -1, axis=0)).sum(axis=0)
    return np.asarray(total / np.linalg.norm(total))


def _rectangles(panes: list[_Primitive], source: Path) -> list[tuple[Array, str]]:
    """([4, 3] corners, name) of the panes; pairs of triangles that share their longest edge become one."""
    found: list[tuple[Array, str]] = []
    waiting: list[tuple[Array, str]] = []
    for pane in panes:
        corners = pane.numbers.reshape(-1, 3)
        if len(corners) == 3:
            for k, (other, _) in enumerate(waiting):
                joined = _joined(corners, other)
                if joined is not None:
                    found.append((joined, pane.name))
                    waiting.pop(k)
                    break
            else:
                waiting.append((corners, pane.name))
        else:
            found.append((corners, pane.name))
    for corners, name in found + waiting:
        if len(corners) != 4 or not _square(corners):
            raise FormatError(
                file=source,
                expected=f"pane {name!r} as a rectangle (or two triangles that make one up)",
                found=f"{len(corners)} corners at {np.round(corners, 4).tolist()}",
                advice="Cut panes of other shapes into rectangles.",
            )
    names = [name for _, name in found]
    return [(c, n if names.count(n) == 1 else f"{n} {k + 1}") for k, (c, n) in enumerate(found)]


def _joined(one: Array, other: Array) -> Array | None:
    """The quadrilateral of two triangles with the same sense that share an edge and lie in one plane."""
    same = [(i, j) for i in range(3) for j in range(3) if np.allclose(one[i], other[j], atol=1e-6)]
    if len(same) != 2 or _normal(one) @ _normal(other) < 1 - 1e-6:
        return None
    own = ({0, 1, 2} - {i for i, _ in same}).pop()
    theirs = ({0, 1, 2} - {j for _, j in same}).pop()
    a, b, c = one[own], one[(own + 1) % 3], one[(own + 2) % 3]
    corners = np.stack([a, b, other[theirs], c])
    return corners if _square(corners) else None


def _square(corners: Array) -> bool:
    """Whether four corners are those of a rectangle, in order."""
    edge = np.roll(corners, -1, axis=0) - corners
    size = float(np.abs(edge).max())
    return bool(
        np.allclose(edge[0], -edge[2], atol=1e-5 * size)
        and np.allclose(edge[1], -edge[3], atol=1e-5 * size)
        and abs(edge[0] @ edge[1]) < 1e-5 * size * size
    )
