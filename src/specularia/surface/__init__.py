"""Height maps: readers, focus stacks, levelling, roughness, healing."""

from specularia.surface.describe import Description, describe
from specularia.surface.healed_file import read_members, write_healed
from specularia.surface.healing import METHODS, Healed, heal
from specularia.surface.heightmap import HeightMap, filled, level, plane, rms_sigma
from specularia.surface.measure import heights
from specularia.surface.netcdf import write
from specularia.surface.readers import check, read
from specularia.surface.roughness import Roughness, roughness, slopes
from specularia.surface.stack import Stack, read_stack

__all__ = [
    "METHODS",
    "Description",
    "Healed",
    "HeightMap",
    "Roughness",
    "Stack",
    "check",
    "describe",
    "filled",
    "heal",
    "heights",
    "level",
    "plane",
    "read",
    "read_members",
    "read_stack",
    "rms_sigma",
    "roughness",
    "slopes",
    "write",
    "write_healed",
]
