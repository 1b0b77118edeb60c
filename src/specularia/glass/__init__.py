"""The pane as a slab between two reliefs: faces, medium, bubbles, and the tracer (Model C)."""

from specularia.glass import closed_form
from specularia.glass.agreement import Agreement, SizeAgreement, agreement, caps, size_agreement
from specularia.glass.bubble_files import read_bubbles, write_bubbles
from specularia.glass.bubbles import BubbleKind, Bubbles, Inside, sample_bubbles
from specularia.glass.colour import Colouring, colouring
from specularia.glass.faces import Face
from specularia.glass.medium import Medium, Spectrum
from specularia.glass.model import model
from specularia.glass.patch import Patch
from specularia.glass.pigments import GLASSES, IronManganese
from specularia.glass.reweight import reweight
from specularia.glass.settings import read_slab
from specularia.glass.slab import Slab, patches
from specularia.glass.swatches import Swatches, swatches
from specularia.glass.thin_film import (
    Amplitudes,
    Film,
    FilmSpread,
    amplitudes,
    film_spread,
    flat_slab_with_films,
)
from specularia.glass.trace import EnergyBalance, Paths, trace, trace_paths
from specularia.glass.wave import FarField, Orders, orders, wave

__all__ = [
    "GLASSES",
    "Agreement",
    "Amplitudes",
    "BubbleKind",
    "Bubbles",
    "Colouring",
    "EnergyBalance",
    "Face",
    "FarField",
    "Film",
    "FilmSpread",
    "Inside",
    "IronManganese",
    "Medium",
    "Orders",
    "Patch",
    "Paths",
    "SizeAgreement",
    "Slab",
    "Spectrum",
    "Swatches",
    "agreement",
    "amplitudes",
    "caps",
    "closed_form",
    "colouring",
    "film_spread",
    "flat_slab_with_films",
    "model",
    "orders",
    "patches",
    "read_bubbles",
    "read_slab",
    "reweight",
    "sample_bubbles",
    "size_agreement",
    "swatches",
    "trace",
    "trace_paths",
    "wave",
    "write_bubbles",
]
