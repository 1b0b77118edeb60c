"""Measured tables: readers, cleaning, integration, the measured model (Model M)."""

from specularia.gonio.fitting import fit
from specularia.gonio.integration import Summary, check_set, integrate, summarise, summarise_all
from specularia.gonio.interpolant import Distribution, distribution
from specularia.gonio.pab import write
from specularia.gonio.reading import READERS, Reader, read
from specularia.gonio.table import Table

__all__ = [
    "READERS",
    "Distribution",
    "Reader",
    "Summary",
    "Table",
    "check_set",
    "distribution",
    "fit",
    "integrate",
    "read",
    "summarise",
    "summarise_all",
    "write",
]
