"""Statistics of a catalogue of finds: counts and weights by group, and density on a plan."""

from __future__ import annotations

from specularia.finds.area import SODA_LIME_DENSITY, GlazedArea, glazed_area
from specularia.finds.catalogue import COLUMNS, Finds, Note, read
from specularia.finds.choice import Chosen, choose, write_choice
from specularia.finds.intervals import Resampled, wilson
from specularia.finds.kernel_density import KernelDensity, kernel_density, places
from specularia.finds.mapping import Mapping, read_mapping
from specularia.finds.plan import Area, Picture, Plan, PlanFile, read_plan
from specularia.finds.statistics import Density, Group, Summary, labels, summary, write_summary
from specularia.finds.thickness import Thickness, thickness

__all__ = [
    "COLUMNS",
    "SODA_LIME_DENSITY",
    "Area",
    "Chosen",
    "Density",
    "Finds",
    "GlazedArea",
    "Group",
    "KernelDensity",
    "Mapping",
    "Note",
    "Picture",
    "Plan",
    "PlanFile",
    "Resampled",
    "Summary",
    "Thickness",
    "choose",
    "glazed_area",
    "kernel_density",
    "labels",
    "places",
    "read",
    "read_mapping",
    "read_plan",
    "summary",
    "thickness",
    "wilson",
    "write_choice",
    "write_summary",
]
