"""Models set beside the measurement, and what explains the difference."""

from __future__ import annotations

from specularia.analysis.cutoff import Cutoff, LobeWidth, cutoff, lobe_width, ray_limit_um, tau_of_paths
from specularia.analysis.explain import STEPS, Budget, Published, Step, explain
from specularia.analysis.healed import HealedPane, healed_pane, member_slab
from specularia.analysis.hybrid import hybrid
from specularia.analysis.infer import PRIORS, HeldOutTau, Inferred, Prior, infer
from specularia.analysis.infer_design import PARAMETERS
from specularia.analysis.lobe_shape import LobeShape
from specularia.analysis.transmission import (
    CLEAR_SLAB,
    MEASURED,
    Table1,
    TauPoints,
    measured_tau,
    table_1,
    write_table_1,
)

__all__ = [
    "CLEAR_SLAB",
    "MEASURED",
    "PARAMETERS",
    "PRIORS",
    "STEPS",
    "Budget",
    "Cutoff",
    "HealedPane",
    "HeldOutTau",
    "Inferred",
    "LobeShape",
    "LobeWidth",
    "Prior",
    "Published",
    "Step",
    "Table1",
    "TauPoints",
    "cutoff",
    "explain",
    "healed_pane",
    "hybrid",
    "infer",
    "lobe_width",
    "measured_tau",
    "member_slab",
    "ray_limit_um",
    "table_1",
    "tau_of_paths",
    "write_table_1",
]
