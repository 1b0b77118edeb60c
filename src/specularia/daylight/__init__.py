"""The lit room: ROOM.toml, sun and sky, panes as sources, illuminance and luminance."""

from specularia.daylight.emission import EmissionMap, emission_map
from specularia.daylight.fragment import Contrast, FragmentPicture, FragmentResult, look_through
from specularia.daylight.fragment_job import FragmentJob
from specularia.daylight.job import FULL, Quality, RoomJob
from specularia.daylight.lit import file_name, run
from specularia.daylight.results import DaylightResult, Glare, GridResult, Image, PaneLuminance, Point

__all__ = [
    "FULL",
    "Contrast",
    "DaylightResult",
    "EmissionMap",
    "FragmentJob",
    "FragmentPicture",
    "FragmentResult",
    "Glare",
    "GridResult",
    "Image",
    "PaneLuminance",
    "Point",
    "Quality",
    "RoomJob",
    "emission_map",
    "file_name",
    "look_through",
    "run",
]
