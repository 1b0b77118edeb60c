"""The unit of work of a model: one incident direction, traced and binned by itself.

What comes of a direction depends on the pane, the direction, the effort, the seed and the wavelength, and on
nothing else: not on threads, on other directions, on the place of tracing or on interruptions of a run.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, fields
from typing import Protocol

from specularia.glass.checkpoint import Store
from specularia.glass.colour import BandTallies, Colouring
from specularia.glass.effort import Effort
from specularia.glass.slab import Slab
from specularia.glass.tally import Bins, Distribution, Tally
from specularia.glass.trace import WAVELENGTH_NM, LightSide, compile_kernel, fill
from specularia.progress import note, task

__all__ = ["ColouredOutcome", "Direction", "Outcome", "Pool", "Task", "trace_direction", "trace_directions"]


@dataclass(frozen=True)
class Direction:
    """Where the light comes from.

    Attributes
    ----------
    side : face it arrives on.
    theta_deg : from the normal of that face, 0 <= theta < 90.
    phi_deg : azimuth, or None to turn the sample under the beam.
    """

    side: LightSide
    theta_deg: float
    phi_deg: float | None = None

    @property
    def name(self) -> str:
        """A word that tells it from all others."""
        phi = "turned" if self.phi_deg is None else f"phi{self.phi_deg!r}"
        return f"{self.side}-theta{self.theta_deg!r}-{phi}"


@dataclass(frozen=True)
class Outcome:
    """What became of the light of one direction.

    Attributes
    ----------
    transmitted, reflected : distributions, in the frame turned so that the light comes from phi = 0.
    absorbed, absorbed_se : share of the light that the glass took, as it was accumulated.
    sides : share that left through the sides of a finite patch.
    lost, paths : numbers of paths given up, and of all paths.
    seconds : time of tracing alone.
    """

    transmitted: Distribution
    reflected: Distribution
    absorbed: float
    absorbed_se: float
    sides: float
    lost: int
    paths: int
    seconds: float

    @property
    def error(self) -> float:
        """What a target error is compared with: see `effort.Effort`."""
        if self.transmitted.share <= 0.0:
            return float("inf")
        return max(self.transmitted.share_se / self.transmitted.share, self.transmitted.noise)


@dataclass(frozen=True)
class ColouredOutcome(Outcome):
    """An outcome in the visible band, with those of CIE-X and CIE-Z from the same paths."""

    x: Outcome
    z: Outcome


@dataclass(frozen=True)
class Task:
    """All that the outcome of a direction depends on beside the pane and the direction itself.

    Attributes
    ----------
    colour : weights of the CIE bands; outcomes are then `ColouredOutcome`, made of paths in clear glass.
    """

    effort: Effort
    seed: int = 0
    wavelength_nm: float = WAVELENGTH_NM
    colour: Colouring | None = None


class Pool(Protocol):
    """Somewhere to trace directions other than this process; see `cluster`."""

    def outcomes(
        self, slab: Slab, directions: Sequence[Direction], work: Task
    ) -> Iterator[tuple[Direction, Outcome]]:
        """Directions with their outcomes, in the order in which they are finished."""
        ...


def trace_direction(slab: Slab, direction: Direction, work: Task) -> Outcome:
    """Trace and bin one direction."""

    def make() -> Tally:
        return Tally(Bins(direction.theta_deg, direction.phi_deg or 0.0))

    tally = make() if work.colour is None else BandTallies(make, work.colour)
    seconds = fill(
        tally,
        slab,
        effort=work.effort,
        # Independent streams for the two sides; the directions of one side share theirs, which keeps the
        # differences between neighbouring directions quiet.
        seed=2 * work.seed + (direction.side == "back"),
        side=direction.side,
        theta_deg=direction.theta_deg,
        phi_deg=direction.phi_deg,
        wavelength_nm=work.wavelength_nm,
    )
    if isinstance(tally, Tally):
        return _outcome(tally, seconds)
    x, visible, z = (_outcome(band, seconds) for band in tally.bands)
    return ColouredOutcome(**{f.name: getattr(visible, f.name) for f in fields(visible)}, x=x, z=z)


def _outcome(tally: Tally, seconds: float) -> Outcome:
    share, error = (v.tolist() for v in tally.shares)
    bins = tally.bins
    assert bins is not None
    transmitted, reflected = (bins.distribution(k, tally.paths, share[k], error[k]) for k in (0, 1))
    return Outcome(transmitted, reflected, share[2], error[2], share[3], tally.lost, tally.paths, seconds)


def trace_directions(
    slab: Slab,
    directions: Sequence[Direction],
    work: Task,
    *,
    store: Store | None = None,
    pool: Pool | None = None,
    part: str = "",
    title: str = "Tracing Model C",
) -> list[Outcome]:
    """Outcomes of several directions, in their order.

    Parameters
    ----------
    part : a word that tells these directions in the store from those of another pane or effort.
    title : of the progress bar.
    store : where finished directions are kept, and taken from where an earlier run left them.
    pool : where to trace; None traces here, one direction after the other.
    """
    found: dict[Direction, Outcome] = {}
    if store is not None:
        kind = Outcome if work.colour is None else ColouredOutcome
        found = {d: kept for d in directions if (kept := store.load(part + d.name, kind)) is not None}
        if found:
            note(f"{len(found)} of {len(directions)} directions were finished before: {store.path}")
    missing = [d for d in directions if d not in found]
    done = _here(slab, missing, work) if pool is None else pool.outcomes(slab, missing, work)
    try:
        with task(title, len(missing)) as bar:
            for direction, outcome in done:
                found[direction] = outcome
                if store is not None:
                    store.save(part + direction.name, outcome)
                bar.advance()
    except KeyboardInterrupt:
        if store is not None and found:
            note(
                f"interrupted: {len(found)} of {len(directions)} directions are kept in {store.path}; the "
                "same command goes on from there."
            )
        raise
    return [found[d] for d in directions]


def _here(slab: Slab, directions: Iterable[Direction], work: Task) -> Iterator[tuple[Direction, Outcome]]:
    compile_kernel()
    for direction in directions:
        yield direction, trace_direction(slab, direction, work)
