"""Synthetic specimens with known truth, and what instruments would say of them."""

from specularia.twin.faces import FaceTruth, make_face
from specularia.twin.make import TwinFiles, make, make_slab
from specularia.twin.microscope import FocusStack, focus_stack, white_light, write_image, write_stack
from specularia.twin.settings import TwinSettings

__all__ = [
    "FaceTruth",
    "FocusStack",
    "TwinFiles",
    "TwinSettings",
    "focus_stack",
    "make",
    "make_face",
    "make_slab",
    "white_light",
    "write_image",
    "write_stack",
]
