"""Height maps: readers, focus stacks, levelling, roughness, healing."""

from specularia.surface.describe import Description, describe
from specularia.surface.form import flattened, levelled
from specularia.surface.healing import Healed, heal
from specularia.surface.heightmap import FLAGS, HeightMap, filled, level, rms_sigma
from specularia.surface.measure import all_in_focus, heights
from specularia.surface.netcdf import write
from specularia.surface.readers import check, read
from specularia.surface.roughness import Roughness, roughness, slopes
from specularia.surface.stack import Stack, read_stack

__all__ = [
    "FLAGS",
    "Description",
    "Healed",
    "HeightMap",
    "Roughness",
    "Stack",
    "all_in_focus",
    "check",
    "describe",
    "filled",
    "flattened",
    "heal",
    "heights",
    "level",
    "levelled",
    "read",
    "read_stack",
    "rms_sigma",
    "roughness",
    "slopes",
    "write",
]
