"""The pane as a whole: two faces, the glass between them, and what the tracer needs to know of them."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from fractions import Fraction
from functools import cached_property
from math import lcm
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from specularia.errors import PhysicsError
from specularia.glass import bubbles as bubble_lists
from specularia.glass import flight
from specularia.glass.bubbles import BubbleKind, Bubbles, sample_bubbles
from specularia.glass.faces import Face
from specularia.glass.hierarchy import pack, steepest
from specularia.glass.kernel import BACK, FRONT
from specularia.glass.medium import Medium
from specularia.glass.patch import Patch
from specularia.glass.thin_film import face_tables
from specularia.glass.tiling import TilingReport

__all__ = ["UNPOLARISED", "Geometry", "Slab", "patches", "refuse_films"]

Array = NDArray[np.float64]

UNPOLARISED = (0.0, 0.0, 0.0)

MANY_PERIODS = 65536
"""Light spreads over so many periods where faces and bubbles have no short common period."""


class Geometry(NamedTuple):
    """The pane as flat arrays, the first arguments of `kernel.trace_kernel`; lengths in um.

    Attributes
    ----------
    relief, bounds, layout, quanta : see `hierarchy.pack`; row FRONT and row BACK.
    scale : [2, 7] pixels per um along x and y, mean plane, highest point of the relief above it and lowest
        below it (both >= 0), the sine of the elevation of its steepest slope, and `Face.micro_slope`.
    outside : [2, 2] index of what lies on each face, 1 for air, and one over it.
    bubbles, first, member, grid : see `bubbles.pack`.
    kinds, sizes : see `flight.pack`.
    patch : [8] see `patch.Patch.row`.
    light : [3] Stokes parameters Q, U, V of the incident light over I.
    """

    relief: NDArray[np.float32]
    bounds: NDArray[np.uint8]
    layout: NDArray[np.int64]
    quanta: Array
    scale: Array
    outside: Array
    bubbles: Array
    first: NDArray[np.int64]
    member: NDArray[np.int64]
    grid: Array
    kinds: Array
    sizes: Array
    patch: Array
    light: Array


@dataclass(frozen=True)
class Slab:
    """A pane, with light that falls on it. It goes on for ever, unless it is cut to a patch.

    Attributes
    ----------
    thickness_mm : between the mean planes of the faces, > 0; the reliefs must not meet.
    medium : the glass.
    front, back : each as its microscope saw it. The front stands at z = +thickness/2 + h(x, y), the back at
        z = -thickness/2 - h(-x, y), heights relative to their means: the back map's x runs the other way.
    bubbles : list of bubbles, or None. The periods of faces and bubbles need not agree.
    bubble_kinds, bubble_seed : further bubbles by their statistics, in the glass between the reliefs; those
        that are placed in a cell in that of `bubbles`, where there is such a list.
    polarised : whether paths keep their polarisation from one interface to the next.
    incident : Stokes parameters (Q, U, V) / I of the light that arrives; the default is unpolarised. Q = 1 is
        light swinging at right angles to the plane of incidence (s), -1 in it (p). At normal incidence that
        plane is the one that holds phi_deg.
    patch : a finite pane in place of one that goes on for ever.
    colour : illuminant of the CIE, such as "D65", under which models of the pane hold the bands CIE-X,
        Visible and CIE-Z; None for models at one wavelength.
    sources : files the pane was read from, for provenance.
    synthetic : True where any part of it is synthetic; the label goes with what is computed from it.
    """

    thickness_mm: float
    medium: Medium = field(default_factory=Medium)
    front: Face = field(default_factory=lambda: Face.flat("front"))
    back: Face = field(default_factory=lambda: Face.flat("back"))
    bubbles: Bubbles | None = None
    bubble_kinds: tuple[BubbleKind, ...] = ()
    bubble_seed: int = 0
    polarised: bool = True
    sources: tuple[Path, ...] = ()
    synthetic: bool = False
    incident: tuple[float, float, float] = UNPOLARISED
    patch: Patch | None = None
    colour: str | None = None

    def __post_init__(self) -> None:
        if not 0.0 < self.thickness_mm < float("inf"):
            raise PhysicsError(f"thickness_mm must be positive, not {self.thickness_mm}.")
        if not np.hypot(np.hypot(*self.incident[:2]), self.incident[2]) <= 1.0 + 1e-9:
            raise PhysicsError(f"light is polarised by a degree of 0 to 1; Q, U, V = {self.incident}.")
        if self.incident != UNPOLARISED and not self.polarised:
            raise PhysicsError("polarised light needs a pane that is traced with polarisation.")
        if self.patch is not None and (self.bubbles is not None or self.bubble_kinds):
            raise PhysicsError("a finite patch holds no bubbles: its sides would cut them.")

    @cached_property
    def reliefs(self) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
        """One period of the front's and of the back's z about their mean planes, in um, in the slab's frame.

        Sample [row, column] stands at x = column * pitch, y = row * pitch. Kept in single precision: relative
        to a relief of 60 um its steps are 4e-6 um.
        """
        back = self.back.tile()
        return (
            self.front.tile().astype(np.float32),
            # x runs the other way: column j of the slab is column -j of the map.
            (-np.roll(back[:, ::-1], 1, axis=1)).astype(np.float32),
        )

    @cached_property
    def tilings(self) -> dict[str, TilingReport]:
        """What tiling does to the slopes of the "front" and the "back", where they have maps."""
        faces = {"front": self.front, "back": self.back}
        return {name: face.report() for name, face in faces.items() if not face.is_flat}

    @cached_property
    def bulk_mm(self) -> tuple[float, float]:
        """(low, high) z of the glass between the shells of relief; a PhysicsError where they meet."""
        front, back = self.reliefs
        low = -0.5 * self.thickness_mm + 1e-3 * float(back.max())
        high = 0.5 * self.thickness_mm + 1e-3 * float(front.min())
        if not low < high:
            raise PhysicsError(
                f"the reliefs meet: {self.thickness_mm:g} mm between the mean planes leave "
                f"{high - low:.4g} mm between the deepest points of {self.front.name} and {self.back.name}."
            )
        return low, high

    @cached_property
    def all_bubbles(self) -> Bubbles | None:
        """Listed bubbles and those drawn into a cell; a PhysicsError where one reaches into a relief."""
        low, high = self.bulk_mm
        lists = [self.bubbles] if self.bubbles is not None else []
        kinds = [k for k in self.bubble_kinds if k.placing == "cell"]
        if kinds:
            drawn = sample_bubbles(
                kinds,
                thickness_mm=self.thickness_mm,
                low_mm=low,
                high_mm=high,
                seed=self.bubble_seed,
                cell_mm=self.bubbles.cell_mm if self.bubbles is not None else None,
            )
            lists.append(drawn)
        if not lists:
            return None
        bubbles = Bubbles.join(lists)
        bubbles.check_within(low, high)
        return bubbles

    @cached_property
    def pitch_um(self) -> Array:
        """[2, 2] pixel sizes (x, y) of front and back. A flat face takes over the period of the other."""
        pitch = np.array(
            [[self.front.pitch_x_um, self.front.pitch_y_um], [self.back.pitch_x_um, self.back.pitch_y_um]]
        )
        flat = [self.front.is_flat, self.back.is_flat]
        if all(flat):
            pitch[:] = 1000.0
        elif any(flat):
            this, other = (FRONT, BACK) if flat[FRONT] else (BACK, FRONT)
            pitch[this] = pitch[other] * self.reliefs[other].shape[::-1]
        return pitch

    @cached_property
    def geometry(self) -> Geometry:
        """Arrays for the tracer, made once."""
        scale = np.empty((2, 7))
        scale[:, :2] = 1.0 / self.pitch_um
        scale[:, 2] = 500.0 * self.thickness_mm, -500.0 * self.thickness_mm
        for face, relief in enumerate(self.reliefs):
            slope = steepest(relief, pitch_x_um=self.pitch_um[face, 0], pitch_y_um=self.pitch_um[face, 1])
            # A little more than the truth, since light and slope are compared in rounded numbers.
            slope *= 1.0 + 1e-5
            scale[face, 3:6] = relief.max(), -relief.min(), slope / np.hypot(1.0, slope)
        scale[:, 6] = self.front.micro_slope, self.back.micro_slope
        relief, bounds, layout, quanta = pack(self.reliefs)
        low, high = self.bulk_mm
        outside = np.array([face.sealant_index or 1.0 for face in (self.front, self.back)])
        return Geometry(
            relief,
            bounds,
            layout,
            quanta,
            scale,
            np.column_stack([outside, 1.0 / outside]),
            *bubble_lists.pack(self.all_bubbles),
            *flight.pack(
                [k for k in self.bubble_kinds if k.placing == "free flight"],
                thickness_mm=self.thickness_mm,
                low_mm=low,
                high_mm=high,
            ),
            self.patch.row if self.patch else np.zeros(8),
            np.array(self.incident),
        )

    def films_at(self, wavelength_nm: float) -> Array | None:
        """[2, 3, N, 8] tables of the films on both faces, see `thin_film.tables`; None without a film."""
        films = (self.front.film, self.back.film)
        if not any(films):
            return None
        return face_tables(films, wavelength_nm=wavelength_nm, index=self.medium.index_at(wavelength_nm))

    def repeats(self, face: int) -> tuple[int, int]:
        """Periods of a face, along x and y, over which all faces and bubbles repeat together.

        `MANY_PERIODS` where there is no common period shorter than that: then every place of one face lies
        under practically every place of the other.
        """
        periods = [self.pitch_um[f] * self.reliefs[f].shape[::-1] for f in (FRONT, BACK)]
        own = periods[face]
        others = [periods[BACK if face == FRONT else FRONT]]
        if self.all_bubbles is not None and len(self.all_bubbles):
            others.append(1e3 * np.asarray(self.all_bubbles.cell_mm))
        x, y = (lcm(*(_repeat(own[axis], other[axis]) for other in others)) for axis in (0, 1))
        return min(x, MANY_PERIODS), min(y, MANY_PERIODS)


def patches(slab: Slab, n: int) -> list[Slab]:
    """n x n panes, each with one piece of either map, tiled by mirror.

    Their spread shows how much the light depends on the place of the pane that was mapped: the beam of a
    gonio-photometer sees more than a microscope's field. A piece of the front map meets the piece of the back
    map that lies behind it; bubbles, medium and light stay the same.

    Parameters
    ----------
    slab : a pane with at least one map.
    n : pieces along each side, >= 1.
    """
    if n < 1 or (slab.front.is_flat and slab.back.is_flat):
        raise PhysicsError("patches need at least one map, and at least one piece along each side.")
    front, back = slab.front.cut(n), slab.back.cut(n)
    return [replace(slab, front=front[i][j], back=back[i][n - 1 - j]) for i in range(n) for j in range(n)]


def refuse_films(slab: Slab) -> None:
    """A PhysicsError for a pane with films: what they reflect is another at every wavelength."""
    if slab.front.film is not None or slab.back.film is not None:
        raise PhysicsError(
            "thin films send other light at every wavelength: one trace does not hold the colour of a pane "
            "with films: trace single wavelengths, or see `glass film` for the colour of a flat pane."
        )


def _repeat(own: float, other: float) -> int:
    """Smallest whole number of own periods that is a whole number of the other's; `MANY_PERIODS` if none."""
    ratio = Fraction(own / other).limit_denominator(MANY_PERIODS)
    exact = abs(float(ratio) * other / own - 1.0) < 1e-12
    return ratio.denominator if exact else MANY_PERIODS
