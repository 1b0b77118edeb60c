"""The lit room: ROOM.toml, sun and sky, panes as sources, illuminance and luminance."""

from specularia.daylight.emission import EmissionMap, emission_map
from specularia.daylight.job import FULL, Quality, RoomJob
from specularia.daylight.lit import file_name, run
from specularia.daylight.results import DaylightResult, Image, PaneLuminance, Point

__all__ = [
    "FULL",
    "DaylightResult",
    "EmissionMap",
    "Image",
    "PaneLuminance",
    "Point",
    "Quality",
    "RoomJob",
    "emission_map",
    "file_name",
    "run",
]
