"""Models set beside the measurement: direct-hemispherical transmission (the paper's Table 1)."""

from __future__ import annotations

from specularia.analysis.cutoff import Cutoff, LobeWidth, cutoff, lobe_width, ray_limit_um, tau_of_paths
from specularia.analysis.healed import HealedPane, healed_pane, member_slab
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
    "Cutoff",
    "HealedPane",
    "LobeWidth",
    "Table1",
    "TauPoints",
    "cutoff",
    "healed_pane",
    "lobe_width",
    "measured_tau",
    "member_slab",
    "ray_limit_um",
    "table_1",
    "tau_of_paths",
    "write_table_1",
]
