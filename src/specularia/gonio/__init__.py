"""Measured tables: readers, cleaning, integration, the measured model (Model M)."""

from specularia.gonio.beam import Beam
from specularia.gonio.cleaning import Step
from specularia.gonio.cross_validation import HeldOut, cross_validate
from specularia.gonio.fitting import fit
from specularia.gonio.integration import Summary, check_set, integrate, summarise, summarise_all
from specularia.gonio.interpolant import Distribution, distribution
from specularia.gonio.noise import Noise
from specularia.gonio.pab import write
from specularia.gonio.reading import READERS, Reader, read, read_beam
from specularia.gonio.shadow import Mask
from specularia.gonio.table import Table

__all__ = [
    "READERS",
    "Beam",
    "Distribution",
    "HeldOut",
    "Mask",
    "Noise",
    "Reader",
    "Step",
    "Summary",
    "Table",
    "check_set",
    "cross_validate",
    "distribution",
    "fit",
    "integrate",
    "read",
    "read_beam",
    "summarise",
    "summarise_all",
    "write",
]
