"""The pane as a slab between two reliefs: faces, medium, bubbles, and the tracer (Model C)."""

from specularia.glass import closed_form
from specularia.glass.bubbles import BubbleKind, Bubbles, read_bubbles, sample_bubbles, write_bubbles
from specularia.glass.faces import Face
from specularia.glass.medium import Medium, Spectrum
from specularia.glass.model import model
from specularia.glass.settings import read_slab
from specularia.glass.slab import Slab
from specularia.glass.trace import EnergyBalance, Paths, trace, trace_paths

__all__ = [
    "BubbleKind",
    "Bubbles",
    "EnergyBalance",
    "Face",
    "Medium",
    "Paths",
    "Slab",
    "Spectrum",
    "closed_form",
    "model",
    "read_bubbles",
    "read_slab",
    "sample_bubbles",
    "trace",
    "trace_paths",
    "write_bubbles",
]
