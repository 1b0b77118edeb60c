"""Paths of light through a pane, and the energy balance they add up to."""

from __future__ import annotations

import time
import warnings
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from specularia.errors import CoverageError, PhysicsError, SpeculariaWarning
from specularia.glass import kernel
from specularia.glass.colour import BandTallies
from specularia.glass.effort import REPLICATES, Effort, round_seed, whole_replicates
from specularia.glass.slab import Slab
from specularia.glass.tally import Tally

__all__ = ["REPLICATES", "EnergyBalance", "LightSide", "Paths", "fill", "trace", "trace_paths"]

Array = NDArray[np.float64]
LightSide = Literal["front", "back"]

CHUNK = 1 << 18
"""Paths held in memory at once."""

WAVELENGTH_NM = 520.0


@dataclass(frozen=True)
class Paths:
    """What became of each path; all arrays are indexed by path and do not depend on the number of threads.

    Attributes
    ----------
    ux, uy : direction cosines on leaving, along the sample's x and y.
    exit_side : kernel.FRONT (0), BACK (1), ABSORBED (2) or LOST (3).
    weight : share of the path's light that leaves. 0 for absorbed paths; of lost ones, what was left.
    absorbed : share that the glass took; weight + absorbed = 1.
    glass_length_mm : way in glass, so that another absorption a can be applied as exp(-a L).
    bubbles_drawn, bubbles_expected : of bodies placed in free flight, how many were drawn on the way, and how
        many are expected on such a way, so that another density can be applied (`reweight`).
    side : "front" or "back", the face the light arrived on.
    replicate : number of the randomised replicate of each path.
    """

    ux: Array
    uy: Array
    exit_side: NDArray[np.int8]
    weight: Array
    absorbed: Array
    glass_length_mm: Array
    bubbles_drawn: NDArray[np.int32]
    bubbles_expected: Array
    side: LightSide
    replicate: NDArray[np.int64]

    def __len__(self) -> int:
        return len(self.ux)

    @property
    def transmitted(self) -> NDArray[np.bool_]:
        """Paths that left on the side away from the light."""
        return self.exit_side == (kernel.BACK if self.side == "front" else kernel.FRONT)

    @property
    def reflected(self) -> NDArray[np.bool_]:
        """Paths that left on the side of the light."""
        return self.exit_side == (kernel.FRONT if self.side == "front" else kernel.BACK)

    @property
    def lost(self) -> int:
        """Number of paths that were given up."""
        return int(np.sum(self.exit_side == kernel.LOST))


@dataclass(frozen=True)
class EnergyBalance:
    """Shares of the light for each incident angle; tau + rho + absorbed + sides = 1 where no path was lost.

    Attributes
    ----------
    theta_deg : [N] incident angles from the normal of the face the light arrives on.
    tau, rho, absorbed : [N] direct-hemispherical transmission and reflection, and absorption as it was
        accumulated along the paths.
    sides : [N] share that left through the clear sides of a finite patch; 0 for an endless pane.
    tau_se, rho_se, absorbed_se : [N] standard errors, from the spread of `REPLICATES` replicates.
    lost : [N] paths given up.
    paths : [N] traced for each angle.
    seconds : [N] time of tracing alone, without compilation.
    """

    theta_deg: Array
    tau: Array
    tau_se: Array
    rho: Array
    rho_se: Array
    absorbed: Array
    absorbed_se: Array
    sides: Array
    lost: NDArray[np.int64]
    paths: NDArray[np.int64]
    seconds: Array


def trace_paths(
    slab: Slab,
    *,
    side: LightSide = "front",
    theta_deg: float,
    phi_deg: float | None = 0.0,
    paths: int,
    seed: int = 0,
    polarised: bool | None = None,
    wavelength_nm: float = WAVELENGTH_NM,
    first: int = 0,
    count: int | None = None,
    clear: bool = False,
) -> Paths:
    """Trace paths of one incident direction.

    Parameters
    ----------
    slab : the pane.
    side : "front" or "back", the face the light arrives on.
    theta_deg : polar angle of the incident direction from the normal of that face, 0 <= theta < 90.
    phi_deg : its azimuth, seen from the front; None turns the sample under the beam, each path with its own
        azimuth, and gives the exit directions as if the light came from phi = 0.
    paths : number of the whole run, rounded up to a multiple of `REPLICATES`. Light arrives evenly over the
        pane, on a lattice of points shifted by chance for each replicate.
    seed : of all random streams. The same seed gives the same paths on any number of threads.
    polarised : None as the slab says; False averages s and p at every interface.
    wavelength_nm : of the light, for index and absorption.
    first, count : the part of the run to trace (all of it); parts put together equal the whole.
    clear : True leaves out the absorption of the glass, to be applied to the paths afterwards.

    Returns
    -------
    Paths : arrays of length `count`.
    """
    if side not in ("front", "back"):
        raise PhysicsError(f"light arrives on the front or on the back, not on {side!r}.")
    if not 0.0 <= theta_deg < 90.0:
        raise CoverageError(f"the incident angle lies in 0 <= theta < 90 degrees, not at {theta_deg}.")
    total, each = whole_replicates(paths)
    count = total - first if count is None else count
    if not 0 <= first <= first + count <= total:
        raise PhysicsError(f"paths {first} to {first + count} are no part of {total}.")
    face = kernel.FRONT if side == "front" else kernel.BACK
    ux, uy, weight, absorbed, way, expected = np.empty((6, count))
    exit_side = np.empty(count, np.int8)
    drawn = np.empty(count, np.int32)
    kernel.trace_kernel(
        *slab.geometry,
        slab.medium.index_at(wavelength_nm),
        0.0 if clear else slab.medium.absorption_at(wavelength_nm) / 1e3,
        slab.polarised if polarised is None else polarised,
        face,
        float(np.radians(theta_deg)),
        0.0 if phi_deg is None else float(np.radians(phi_deg)),
        phi_deg is None,
        *slab.repeats(face),
        seed,
        first,
        each,
        ux,
        uy,
        exit_side,
        weight,
        absorbed,
        way,
        drawn,
        expected,
        slab.films_at(wavelength_nm),
    )
    return Paths(
        ux=ux,
        uy=uy,
        exit_side=exit_side,
        weight=weight,
        absorbed=absorbed,
        glass_length_mm=way / 1e3,
        bubbles_drawn=drawn,
        bubbles_expected=expected,
        side=side,
        replicate=_replicates(first, count, each),
    )


def _replicates(first: int, count: int, each: int) -> NDArray[np.int64]:
    """Replicate of path first, first + 1, ...; `each` of them form one."""
    if count == 0:
        return np.zeros(0, np.int64)
    number = np.arange(first // each, (first + count - 1) // each + 1)
    ends = np.minimum((number + 1) * each, first + count)
    return np.repeat(number, np.diff(ends, prepend=first))


def compile_kernel() -> None:
    """Have the kernel compiled (or loaded), so that the time of tracing can be taken by itself."""
    Tally().add(trace_paths(Slab(thickness_mm=1.0), theta_deg=0.0, paths=1))


def fill(
    tally: Tally | BandTallies,
    slab: Slab,
    *,
    effort: Effort,
    seed: int,
    side: LightSide = "front",
    theta_deg: float,
    phi_deg: float | None,
    polarised: bool | None = None,
    wavelength_nm: float = WAVELENGTH_NM,
) -> float:
    """Trace one incident direction into a tally, round after round until the effort is spent.

    Returns the time of tracing alone in seconds. Parameters as in `trace_paths`.
    """
    slab.geometry  # noqa: B018 (made once, outside the time of tracing)
    seconds, number = 0.0, 0
    while paths := effort.next_round(tally.paths, tally.error if tally.paths else np.inf):
        total, _ = whole_replicates(paths)
        for first in range(0, total, CHUNK):
            start = time.perf_counter()
            part = trace_paths(
                slab,
                side=side,
                theta_deg=theta_deg,
                phi_deg=phi_deg,
                paths=paths,
                seed=round_seed(seed, number),
                polarised=polarised,
                wavelength_nm=wavelength_nm,
                first=first,
                count=min(CHUNK, total - first),
                clear=isinstance(tally, BandTallies),
            )
            seconds += time.perf_counter() - start
            tally.add(part)
        number += 1
    return seconds


def trace(
    slab: Slab,
    *,
    theta_deg: Sequence[float],
    side: LightSide = "front",
    phi_deg: float | None = 0.0,
    paths: int = 100_000,
    target_error: float | None = None,
    seed: int = 0,
    polarised: bool | None = None,
    wavelength_nm: float = WAVELENGTH_NM,
) -> EnergyBalance:
    """Energy balance of a pane for several incident angles; parameters as in `trace_paths`.

    With a `target_error` each angle is traced until tau's relative standard error is no larger, and `paths`
    is the most that an angle gets.

    >>> balance = trace(Slab(thickness_mm=3.0), theta_deg=[0.0], paths=32000)
    >>> bool(abs(balance.tau[0] - 0.918) < 0.01 and balance.lost[0] == 0)
    True
    """
    effort = Effort(paths, target_error)
    compile_kernel()
    tallies, seconds = [], []
    for theta in theta_deg:
        tally = Tally()
        seconds.append(
            fill(
                tally,
                slab,
                effort=effort,
                seed=seed,
                side=side,
                theta_deg=theta,
                phi_deg=phi_deg,
                polarised=polarised,
                wavelength_nm=wavelength_nm,
            )
        )
        tallies.append(tally)
    counts = np.array([t.paths for t in tallies])
    lost = np.array([t.lost for t in tallies])
    warn_of_lost(int(lost.sum()), int(counts.sum()))
    warn_of_noise([t.error for t in tallies], effort)
    mean, error = (np.array(v) for v in zip(*(t.shares for t in tallies)))
    return EnergyBalance(
        theta_deg=np.asarray(theta_deg, float),
        tau=mean[:, 0],
        tau_se=error[:, 0],
        rho=mean[:, 1],
        rho_se=error[:, 1],
        absorbed=mean[:, 2],
        absorbed_se=error[:, 2],
        sides=mean[:, 3],
        lost=lost,
        paths=counts,
        seconds=np.array(seconds),
    )


def warn_of_lost(lost: int, paths: int) -> None:
    """Say so where paths were given up: their light is missing from the balance."""
    if lost:
        warnings.warn(
            f"{lost} of {paths} paths were given up inside the glass; their light is missing.",
            SpeculariaWarning,
            stacklevel=3,
        )


def warn_of_noise(errors: Sequence[float], effort: Effort) -> None:
    """Say so where directions did not reach the wanted error with the paths they may have."""
    if effort.target_error is None:
        return
    missed = [e for e in errors if e > effort.target_error]
    if missed:
        warnings.warn(
            f"{len(missed)} of {len(errors)} directions did not reach the target error "
            f"{effort.target_error:g} within {effort.paths} paths (worst: {max(missed):.3g}); allow more "
            "with --paths.",
            SpeculariaWarning,
            stacklevel=3,
        )
