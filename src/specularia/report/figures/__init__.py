"""One function per figure. Each draws a PNG, saves its numbers beside it and returns the path of the PNG."""

from __future__ import annotations

from specularia.report.figures.budget import budget
from specularia.report.figures.colour import colour_pictures
from specularia.report.figures.curves import sections, tau_curves
from specularia.report.figures.cutoff import cutoff
from specularia.report.figures.day import day_curves
from specularia.report.figures.distribution import dsf, measured_dsf, ratio_map
from specularia.report.figures.finds import finds_by_colour, finds_on_plan
from specularia.report.figures.finds_places import finds_density, finds_thickness
from specularia.report.figures.fragment import contrast_over_gap, fragment_pictures
from specularia.report.figures.healing import healed
from specularia.report.figures.illuminance import illuminance_plans
from specularia.report.figures.light_ratio import illuminance_ratios, luminance_ratios
from specularia.report.figures.luminance import luminance_maps
from specularia.report.figures.perspective import relief
from specularia.report.figures.posterior import posterior
from specularia.report.figures.surfaces import height_maps, micrographs
from specularia.report.figures.texture import abbott_curve, directions, power_spectra, slope_angles

__all__ = [
    "abbott_curve",
    "budget",
    "colour_pictures",
    "contrast_over_gap",
    "cutoff",
    "day_curves",
    "directions",
    "dsf",
    "finds_by_colour",
    "finds_density",
    "finds_on_plan",
    "finds_thickness",
    "fragment_pictures",
    "healed",
    "height_maps",
    "illuminance_plans",
    "illuminance_ratios",
    "luminance_maps",
    "luminance_ratios",
    "measured_dsf",
    "micrographs",
    "posterior",
    "power_spectra",
    "ratio_map",
    "relief",
    "sections",
    "slope_angles",
    "tau_curves",
]
