"""What a check of a BSDF has found."""

from __future__ import annotations

from dataclasses import dataclass

__all__ = ["Check", "Program"]


@dataclass(frozen=True)
class Check:
    """One finding.

    Attributes
    ----------
    name : of the check.
    ok : whether the value keeps to the limit.
    value, limit : the figure and what it is held against.
    advice : one sentence: what it means and what to do.
    """

    name: str
    ok: bool
    value: float
    limit: float
    advice: str


@dataclass(frozen=True)
class Program:
    """Whether a program, in one use, takes a file."""

    name: str
    takes: bool
    why: str
