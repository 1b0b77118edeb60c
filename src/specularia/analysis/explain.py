"""Why Model C and the measurement differ: from one to the other, one cause at a time.

The budget begins with Model C as it was published: a finite patch with clear sides, s and p averaged, glass
that absorbs nothing and has no bubbles, heights with their noise, and a tensor tree. Each step brings in one
thing that the pane or the instrument has. All states are traced with the same random numbers, so that the
difference of two is known better than either.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from specularia.analysis.diffraction import FARTHEST_DEG, Diffraction, diffraction
from specularia.analysis.lobe_shape import (
    LobeShape,
    shape_of_distribution,
    shape_of_light,
    standard_error,
)
from specularia.conventions import disk_to_square, square_to_disk
from specularia.errors import CoverageError, PhysicsError
from specularia.glass import Medium, Patch, Paths, Slab, photometer, trace_paths
from specularia.glass.effort import REPLICATES
from specularia.gonio import Summary, Table, summarise_all
from specularia.gonio.cross_validation import distance
from specularia.gonio.interpolant import Distribution, distribution
from specularia.progress import task

__all__ = ["POWER", "STEPS", "Budget", "Published", "Step", "explain"]

Array = NDArray[np.float64]

STEPS: Final = {
    "endless": "endless pane: no light leaves through the sides of a patch",
    "polarisation": "polarisation kept along each path",
    "absorption": "absorption of the glass",
    "bubbles": "bubbles and inclusions",
    "height noise": "heights without the noise of the microscope, which rays take for relief",
    "micro-relief": "relief too fine for the microscope",
    "diffraction": "waves in place of rays, by the scalar model of the same maps",
    "tree": "no tensor tree: single directions in place of its cells, and of the mean over azimuth",
    "instrument": "the instrument: aperture, scan, horizon, and how a table is integrated",
}
"""Steps in the order in which they are taken, and what each brings in."""

POWER: Final = {"absorption": 1.0, "bubbles": 1.0, "micro-relief": 2.0}
"""Steps that grow with a number which is not known exactly, and with which power of it."""

_INCIDENT: Final = 4
"""Incident angles over a bin of the tree."""


@dataclass(frozen=True)
class Published:
    """Where the budget begins.

    Attributes
    ----------
    patch : the finite pane.
    resolution : g of the tree, 2^g x 2^g exit cells and 2^(g - 1) incidence bins in sin theta.
    """

    patch: Patch = field(default_factory=lambda: Patch(8.4, "clear"))
    resolution: int = 6


@dataclass(frozen=True)
class Step:
    """What one step does.

    Attributes
    ----------
    name : of `STEPS`.
    present : False where the description of the pane holds nothing of the kind; then nothing changes.
    before, after : [A, 3] quantities (`lobe_shape.QUANTITIES`) at the angles.
    se : [A, 3] standard error of after - before by tracing, from paired replicates.
    unsure : [A, 3] standard error of the step by what is not known exactly of the pane (`explain`).
    """

    name: str
    present: bool
    before: Array
    after: Array
    se: Array
    unsure: Array

    @property
    def effect(self) -> Array:
        """[A, 3] after - before."""
        return self.after - self.before

    @property
    def half_width(self) -> Array:
        """[A, 3] half-width of the 95 % interval of the effect."""
        return 1.96 * np.hypot(np.nan_to_num(self.se), self.unsure)


@dataclass(frozen=True)
class Budget:
    """All steps from the published Model C to the measurement.

    Attributes
    ----------
    theta_deg : [A] incident angles, those of the tables.
    steps : in their order; the first begins at `start`, each next where the last one ended.
    start, start_se : [A, 3] of Model C as published.
    measured, measured_se : [A, 3]; the error of tau only, from noise and bounds of the instrument.
    swapped : the two steps with the largest effect on tau, taken in the other order: the later one in the
        place of the earlier, and the earlier one in the place of the later.
    l1, l1_noise : [A] distance of the last state, without diffraction, from the table, integral of
        |difference of cell means| over tau on cells of direction cosines (`gonio.cross_validation.distance`),
        and the same of noise alone: that of the table, and that of tracing from two halves of the paths.
    synthetic : whether pane or tables are.
    """

    theta_deg: Array
    steps: tuple[Step, ...]
    start: Array
    start_se: Array
    measured: Array
    measured_se: Array
    swapped: tuple[Step, ...]
    l1: Array
    l1_noise: Array
    synthetic: bool

    @property
    def l1_remainder(self) -> Array:
        """[A] what the L1 distance is beyond noise, taken off in squares."""
        return np.sqrt(np.maximum(self.l1**2 - self.l1_noise**2, 0.0))

    @property
    def remainder(self) -> Array:
        """[A, 3] measured less the last state."""
        return self.measured - self.steps[-1].after

    @property
    def remainder_half_width(self) -> Array:
        """[A, 3] half-width of its 95 % interval: tracing, what is unsure of the pane, the measurement."""
        unsure = sum(s.unsure**2 for s in self.steps)
        last = np.nan_to_num(self.steps[-1].se)
        return 1.96 * np.sqrt(unsure + last**2 + self.start_se**2 + np.nan_to_num(self.measured_se) ** 2)


def explain(
    slab: Slab,
    tables: Sequence[Table],
    *,
    published: Published | None = None,
    order: Sequence[str] | None = None,
    unsure: Mapping[str, float] | None = None,
    aperture_deg: float = 0.3,
    paths: int = 1_000_000,
    seed: int = 0,
    wavelength_nm: float = 520.0,
) -> Budget:
    """Go from the published Model C to the measurement, one step at a time.

    Parameters
    ----------
    slab : the pane with everything that is known of it: maps, absorption, bubbles, fine relief.
    tables : measured transmission of light on the front, one for each incident angle.
    published : where the budget begins.
    order : names of `STEPS`, each once at most; those left out are not taken. None takes them all, but for
        "diffraction" where all tables are synthetic: they were traced by rays.
    unsure : relative standard errors of what the steps "absorption" (per mm), "bubbles" (number per volume)
        and "micro-relief" (slope) bring in; the effect's error follows from its growth with that number. That
        of "diffraction" is the wave model's own; beyond 40 degrees of incidence, where that model does not
        hold, its effect is set to 0 with an error as large as the largest effect below.
    aperture_deg : full width at half maximum of the instrument's angular response, 0.3 to 10 degrees.
    paths : for each state and angle.
    seed : of the random streams, the same for all states.
    wavelength_nm : of the light.

    Raises
    ------
    PhysicsError : an unknown or doubled step; a pane that is a patch already.
    CoverageError : no table of transmitted light on the front.
    """
    published = published or Published()
    chosen = [t for t in tables if t.side == "transmission_front"]
    if order is None:
        rays = bool(chosen) and all(t.synthetic for t in chosen)
        order = [s for s in STEPS if s != "diffraction" or not rays]
    order = tuple(order)
    unsure = dict(unsure or {})
    _check(slab, order, unsure)
    if not chosen:
        raise CoverageError(f"no table of light transmitted from the front among {len(tables)}.")
    summaries = sorted(summarise_all(chosen, isotropic=True), key=lambda s: s.table.polar_deg)
    with task("error budget", (len(order) + 3) * len(summaries)) as progress:
        states = _States(
            slab, summaries, published, aperture_deg, paths, seed, wavelength_nm, progress.advance
        )
        taken: tuple[str, ...] = ()
        steps = []
        for name in order:
            steps.append(states.step(name, taken, unsure.get(name, 0.0)))
            taken = (*taken, name)
        swapped = _swapped(states, steps, unsure)
        start = states.of(())
        l1 = np.array([states.distance(taken, k) for k in range(len(summaries))])
    measured = np.array([shape_of_distribution(s.distribution, s.table.polar_deg).mean for s in summaries])
    error = np.full(measured.shape, np.nan)
    # A bound of half-width b counts as an even distribution over it.
    error[:, 0] = [np.hypot(s.tau_se, s.tau_systematic / np.sqrt(3.0)) for s in summaries]
    return Budget(
        theta_deg=np.array([s.table.polar_deg for s in summaries]),
        steps=tuple(steps),
        start=np.array([s.mean for s in start]),
        start_se=np.array([s.se for s in start]),
        measured=measured,
        measured_se=error,
        swapped=swapped,
        l1=l1[:, 0],
        l1_noise=l1[:, 1],
        synthetic=slab.synthetic or any(t.synthetic for t in chosen),
    )


def _check(slab: Slab, order: Sequence[str], unsure: Mapping[str, float]) -> None:
    unknown = [s for s in order if s not in STEPS]
    if unknown or len(set(order)) < len(order) or not order:
        raise PhysicsError(
            f"steps are {', '.join(STEPS)}, each once at most and one at least, not {', '.join(order)}."
        )
    odd = [s for s in unsure if s not in POWER or not 0.0 <= unsure[s] < 10.0]
    if odd:
        raise PhysicsError(
            f"a relative error of {', '.join(POWER)} is a number from 0 to 10, not of {', '.join(odd)}."
        )
    cut = "bubbles" in order and "endless" not in order[: order.index("bubbles")]
    if cut and (slab.bubble_kinds or slab.bubbles is not None):
        raise PhysicsError(
            "bubbles come after the step endless: the sides of the published patch would cut them."
        )
    if slab.patch is not None:
        raise PhysicsError("the pane goes on for ever in the end; leave [patch] out of its description.")


def _swapped(states: _States, steps: Sequence[Step], unsure: Mapping[str, float]) -> tuple[Step, ...]:
    """The two steps that change tau most, each in the other's place."""
    if len(steps) < 2:
        return ()
    size = [float(np.abs(s.effect[:, 0]).mean()) for s in steps]
    names = [s.name for s in steps]
    # Bubbles cannot come before the pane is endless: a patch's sides would cut them.
    possible = [
        (i, j)
        for j in range(len(steps))
        for i in range(j)
        if not (names[j] == "bubbles" and steps[j].present and "endless" in names[i:j])
    ]
    if not possible:
        return ()
    i, j = max(possible, key=lambda pair: size[pair[0]] + size[pair[1]])
    early = states.step(names[j], tuple(names[:i]), unsure.get(names[j], 0.0))
    without = tuple(n for n in names[: j + 1] if n != names[i])
    late = states.step(names[i], without, unsure.get(names[i], 0.0))
    return early, late


class _States:
    """States of the budget by the steps taken so far; each is computed once."""

    def __init__(
        self,
        slab: Slab,
        summaries: Sequence[Summary],
        published: Published,
        aperture_deg: float,
        paths: int,
        seed: int,
        wavelength_nm: float,
        advance: Callable[[], None],
    ) -> None:
        self.advance = advance
        self.slab, self.summaries, self.published = slab, summaries, published
        self.aperture_deg, self.paths, self.seed = aperture_deg, paths, seed
        self.wavelength_nm = wavelength_nm
        self.known: dict[frozenset[str], list[LobeShape]] = {}
        self.read: dict[frozenset[str], list[Distribution]] = {}
        self.panes: dict[frozenset[str], Slab] = {}
        self.waves: list[Diffraction] | None = None

    def present(self, name: str) -> bool:
        """Whether the pane holds what a step brings in."""
        slab = self.slab
        return {
            "absorption": slab.medium.absorption_at(self.wavelength_nm) > 0.0,
            "bubbles": bool(slab.bubble_kinds) or slab.bubbles is not None,
            "micro-relief": slab.front.micro_slope > 0.0 or slab.back.micro_slope > 0.0,
            "height noise": slab.front.measured_um is not None or slab.back.measured_um is not None,
            "diffraction": not (slab.front.is_flat and slab.back.is_flat),
        }.get(name, True)

    def step(self, name: str, taken: tuple[str, ...], relative: float) -> Step:
        """One step after some others."""
        before, after = self.of(taken), self.of((*taken, name))
        a, b = (np.array([s.mean for s in state]) for state in (before, after))
        se = np.empty(a.shape)
        for k, (one, two) in enumerate(zip(before, after)):
            se[k] = standard_error(two.values - one.values)
        unsure = np.abs(b - a) * relative * POWER.get(name, 0.0)
        if name == "diffraction" and self.present(name):
            unsure = np.array([d.se for d in self._diffraction()])
        return Step(name, self.present(name), a, b, se, unsure)

    def of(self, taken: Sequence[str]) -> list[LobeShape]:
        """Shapes of one state at all angles."""
        key = self._key(taken)
        if key not in self.known:
            self.known[key] = [self._shape(key, k) for k in range(len(self.summaries))]
        return self.known[key]

    def distance(self, taken: Sequence[str], k: int) -> Array:
        """[2] L1 distance of a state from table k over tau, and that of the noise of table and tracing."""
        key = self._key(taken)
        summary = self.summaries[k]
        paths, _ = self._light(key, k)
        found = self.read[key][k] if key in self.read else self._read_off(paths, k)
        halves = []
        for half in (0, 1):
            mine = paths.replicate % 2 == half
            chosen: dict[str, Any] = {n: getattr(paths, n)[mine] for n in _PER_PATH}
            part = replace(paths, **chosen)
            halves.append(self._read_off(part, k))
        table = summary.table
        both = distance(
            _Held(found), table.side, summary.distribution, theta_deg=table.polar_deg, phi_deg=0.0
        )
        # Each half has twice the variance of the whole, and their difference four times.
        apart, _ = distance(_Held(halves[0]), table.side, halves[1], theta_deg=table.polar_deg, phi_deg=0.0)
        return np.array([both[0], np.hypot(both[1], 0.5 * apart)]) / summary.tau

    def _key(self, taken: Sequence[str]) -> frozenset[str]:
        """States that differ only by steps which bring in nothing are one."""
        return frozenset(n for n in taken if self.present(n))

    def _shape(self, key: frozenset[str], k: int) -> LobeShape:
        theta = self.summaries[k].table.polar_deg
        paths, arrived = self._light(key, k)
        self.advance()
        through = paths.transmitted
        ux, uy = paths.ux[through], paths.uy[through]
        if "tree" not in key:
            ux, uy = _in_cells(ux, uy, self.published.resolution, np.random.default_rng([self.seed, k]))
        shape = shape_of_light(
            ux,
            uy,
            paths.weight[through],
            paths.replicate[through],
            theta_deg=theta,
            per_replicate=arrived,
        )
        if "instrument" in key:
            # The same paths, read off: what that changes has no noise of its own to speak of.
            found = self._read_off(paths, k)
            self.read.setdefault(key, []).append(found)
            shape = LobeShape(shape.values + (shape_of_distribution(found, theta).mean - shape.mean))
        if "diffraction" in key:
            shape = LobeShape(shape.values + self._diffraction()[k].effect)
        return shape

    def _diffraction(self) -> list[Diffraction]:
        """Waves less rays at each angle; the same for all states, since only the maps make it."""
        if self.waves is None:
            polar = [s.table.polar_deg for s in self.summaries]
            near = {
                k: diffraction(
                    self.slab,
                    theta_deg=theta,
                    phi_deg=self.summaries[k].table.azimuth_deg,
                    paths=self.paths,
                    seed=self.seed,
                    wavelength_nm=self.wavelength_nm,
                )
                for k, theta in enumerate(polar)
                if theta <= FARTHEST_DEG
            }
            if not near:
                raise CoverageError(
                    f"diffraction is computed up to {FARTHEST_DEG:g} degrees, and no table lies there; "
                    "name the other steps in the order."
                )
            # Where it is not computed it may be as large as it is elsewhere.
            most = np.max([np.abs(d.effect) + d.se for d in near.values()], axis=0)
            self.waves = [near.get(k, Diffraction(np.zeros(3), most)) for k in range(len(polar))]
        return self.waves

    def _light(self, key: frozenset[str], k: int) -> tuple[Paths, Array]:
        """Paths of one state at one angle, light coming from phi = 0, and how many arrived per replicate."""
        table = self.summaries[k].table
        pane = self._pane(key)
        if "tree" in key:
            turn = table.azimuth_deg
            paths = self._trace(pane, table.polar_deg, turn, self.paths)
            c, s = np.cos(np.radians(turn)), np.sin(np.radians(turn))
            paths = replace(paths, ux=paths.ux * c + paths.uy * s, uy=paths.uy * c - paths.ux * s)
            parts = [paths]
        else:
            # A tree knows the mean over a bin of incidence, and over azimuth.
            bins = 2 ** (self.published.resolution - 1)
            first = np.floor(np.sin(np.radians(table.polar_deg)) * bins)
            sines = (first + (np.arange(_INCIDENT) + 0.5) / _INCIDENT) / bins
            parts = [
                self._trace(pane, float(np.degrees(np.arcsin(s))), None, self.paths // _INCIDENT)
                for s in sines
            ]
        joined: dict[str, Any] = {n: np.concatenate([getattr(p, n) for p in parts]) for n in _PER_PATH}
        whole = replace(parts[0], **joined)
        return whole, np.bincount(whole.replicate, minlength=REPLICATES).astype(float)

    def _trace(self, pane: Slab, theta_deg: float, phi_deg: float | None, paths: int) -> Paths:
        return trace_paths(
            pane,
            theta_deg=theta_deg,
            phi_deg=phi_deg,
            paths=paths,
            seed=self.seed,
            wavelength_nm=self.wavelength_nm,
        )

    def _pane(self, key: frozenset[str]) -> Slab:
        """The pane of a state."""
        kept = key - {"tree", "instrument", "diffraction"}
        if kept not in self.panes:
            slab = self.slab
            clear = Medium(index=slab.medium.index)
            faces = (slab.front, slab.back)
            if "height noise" not in kept:
                faces = (faces[0].as_measured(), faces[1].as_measured())
            if "micro-relief" not in kept:
                faces = (replace(faces[0], micro_slope=0.0), replace(faces[1], micro_slope=0.0))
            self.panes[kept] = replace(
                slab,
                medium=slab.medium if "absorption" in kept else clear,
                bubbles=slab.bubbles if "bubbles" in kept else None,
                bubble_kinds=slab.bubble_kinds if "bubbles" in kept else (),
                front=faces[0],
                back=faces[1],
                polarised=slab.polarised and "polarisation" in kept,
                incident=slab.incident if "polarisation" in kept else (0.0, 0.0, 0.0),
                patch=None if "endless" in kept else self.published.patch,
            )
        return self.panes[kept]

    def _read_off(self, paths: Paths, k: int) -> Distribution:
        """What the instrument would have recorded of paths, in the directions of table k, and integrated."""
        table = self.summaries[k].table
        turned = (table.phi_s_deg - table.azimuth_deg) % 360.0
        read = photometer.read_off(
            paths,
            theta_deg=table.polar_deg,
            directions=(table.theta_s_deg, turned),
            aperture_deg=self.aperture_deg,
            wavelength_nm=self.wavelength_nm,
        )
        # Nothing shades a computed table, and none of it is to be taken for a shadow.
        return distribution(read, isotropic=False)


_PER_PATH: Final = (
    "ux", "uy", "exit_side", "weight", "absorbed", "glass_length_mm", "bubbles_drawn", "bubbles_expected",
    "replicate",
)  # fmt: skip


@dataclass(frozen=True)
class _Held:
    """A distribution as a model, for `gonio.distance`."""

    found: Distribution

    def evaluate(self, side: str, theta_deg: float, phi_deg: float, ux: Array, uy: Array) -> Array:
        return self.found.at(ux, uy)


def _in_cells(ux: Array, uy: Array, resolution: int, rng: np.random.Generator) -> tuple[Array, Array]:
    """Directions moved anywhere within their cells of a tensor tree, as which they come back from it."""
    n = 2**resolution
    a, b = disk_to_square(ux, uy)
    draw = rng.random((2, ux.size))
    a, b = ((np.floor(np.clip(v, 0.0, 1.0 - 1e-12) * n) + d) / n for v, d in zip((a, b), draw))
    return square_to_disk(a, b)
