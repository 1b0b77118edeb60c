"""Height maps: readers, focus stacks, levelling, roughness, healing."""

from specularia.surface.denoise import Denoised, denoise
from specularia.surface.describe import Description, describe
from specularia.surface.export import MESHES, export, slab_mesh
from specularia.surface.form import flattened, levelled
from specularia.surface.healed_file import read_members, write_healed
from specularia.surface.healing import METHODS, Healed, heal
from specularia.surface.heightmap import FLAGS, HeightMap, filled, level, plane, rms_sigma
from specularia.surface.measure import all_in_focus, heights
from specularia.surface.netcdf import write
from specularia.surface.readers import check, read
from specularia.surface.roughness import Roughness, roughness, slopes
from specularia.surface.spectra import Spacing, Spectrum, power_spectrum
from specularia.surface.stack import Stack, read_stack
from specularia.surface.texture import MaterialRatio, SlopeDistribution, Texture, texture
from specularia.surface.white_light import read_picture

__all__ = [
    "FLAGS",
    "MESHES",
    "METHODS",
    "Denoised",
    "Description",
    "Healed",
    "HeightMap",
    "MaterialRatio",
    "Roughness",
    "SlopeDistribution",
    "Spacing",
    "Spectrum",
    "Stack",
    "Texture",
    "all_in_focus",
    "check",
    "denoise",
    "describe",
    "export",
    "filled",
    "flattened",
    "heal",
    "heights",
    "level",
    "levelled",
    "plane",
    "power_spectrum",
    "read",
    "read_members",
    "read_picture",
    "read_stack",
    "rms_sigma",
    "roughness",
    "slab_mesh",
    "slopes",
    "texture",
    "write",
    "write_healed",
]
