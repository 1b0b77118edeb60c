"""Synthetic specimens with known truth, and what instruments would say of them."""

from specularia.twin.faces import FaceTruth, make_face
from specularia.twin.make import TwinFiles, make, make_slab
from specularia.twin.settings import TwinSettings

__all__ = ["FaceTruth", "TwinFiles", "TwinSettings", "make", "make_face", "make_slab"]
