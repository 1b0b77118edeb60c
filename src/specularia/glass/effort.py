"""How many paths an incident direction gets: a fixed number, or as many as a wanted error takes."""

from __future__ import annotations

from dataclasses import dataclass

from specularia.errors import PhysicsError

__all__ = ["DEFAULT_PATHS", "MOST_PATHS", "REPLICATES", "Effort", "round_seed", "whole_replicates"]

REPLICATES = 32
"""Independent randomised replicates of every run; their spread gives the standard errors."""

DEFAULT_PATHS = 200_000
"""Paths of each incident direction where nobody asks for a number or an error."""

MOST_PATHS = 50_000_000
"""Paths at which a direction is left as it is where an error was asked for without a limit."""

FIRST_ROUND = 1 << 16
"""Paths after which a wanted error is looked at for the first time."""

_GROWTH = (1.3, 4.0)
"""Between two looks the number of paths grows by a factor within these bounds."""


@dataclass(frozen=True)
class Effort:
    """Paths of one incident direction.

    Attributes
    ----------
    paths : exactly so many (rounded up to whole replicates), or with a target at most so many.
    target_error : relative error wanted, 0 < target < 1, or None for a fixed number of paths. A direction is
        traced in rounds until both the relative standard error of tau and the noise of its distribution (see
        `tally.Tally.noise`; where there is one) are no larger.
    """

    paths: int = DEFAULT_PATHS
    target_error: float | None = None

    def __post_init__(self) -> None:
        if self.paths < 1:
            raise PhysicsError(f"at least one path is needed, not {self.paths}.")
        if self.target_error is not None and not 0.0 < self.target_error < 1.0:
            raise PhysicsError(f"a target error lies between 0 and 1, not at {self.target_error}.")

    def next_round(self, done: int, error: float) -> int:
        """Paths of the next round after `done` of them left this error; 0 where that is enough.

        Errors fall as one over the square root of the paths, so the next round is as long as the error says,
        within bounds. The answer depends on nothing else, and so an interrupted run ends as any other.
        """
        if self.target_error is None:
            return 0 if done else self.paths
        if done == 0:
            return min(FIRST_ROUND, self.paths)
        if error <= self.target_error or done >= self.paths:
            return 0
        wanted = 1.05 * (error / self.target_error) ** 2
        total = min(int(done * min(max(wanted, _GROWTH[0]), _GROWTH[1])), self.paths)
        return max(total - done, 0)


def whole_replicates(paths: int) -> tuple[int, int]:
    """(paths, paths per replicate): the wanted number rounded up to whole replicates."""
    if paths < 1:
        raise PhysicsError(f"at least one path is needed, not {paths}.")
    each = -(-paths // REPLICATES)
    return each * REPLICATES, each


def round_seed(seed: int, number: int) -> int:
    """Seed of a round; round 0 has the seed itself, and no two rounds of any two seeds below 2^40 agree."""
    return seed + (number << 40)
