"""Statistics of a catalogue of finds: counts and weights by group, and density on a plan."""

from __future__ import annotations

from specularia.finds.catalogue import COLUMNS, Finds, read
from specularia.finds.plan import Area, Plan, read_plan
from specularia.finds.statistics import Density, Group, Summary, summary, write_summary

__all__ = [
    "COLUMNS",
    "Area",
    "Density",
    "Finds",
    "Group",
    "Plan",
    "Summary",
    "read",
    "read_plan",
    "summary",
    "write_summary",
]
