"""Models set beside the measurement: direct-hemispherical transmission (the paper's Table 1)."""

from __future__ import annotations

from specularia.analysis.transmission import (
    CLEAR_SLAB,
    MEASURED,
    Table1,
    TauPoints,
    measured_tau,
    table_1,
    write_table_1,
)

__all__ = ["CLEAR_SLAB", "MEASURED", "Table1", "TauPoints", "measured_tau", "table_1", "write_table_1"]
