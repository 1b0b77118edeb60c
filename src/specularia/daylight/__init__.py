"""The lit room: ROOM.toml, sun and sky, panes as sources, illuminance and luminance."""

from specularia.daylight.colour import Coloured
from specularia.daylight.emission import EmissionMap, emission_map
from specularia.daylight.fragment import Contrast, FragmentPicture, FragmentResult, look_through
from specularia.daylight.fragment_job import FragmentJob
from specularia.daylight.hours import DayHour, DayImage, DayResult, day
from specularia.daylight.job import FULL, Quality, RoomJob
from specularia.daylight.lit import file_name, run
from specularia.daylight.moment import at
from specularia.daylight.outside import outside_at
from specularia.daylight.results import DaylightResult, Glare, GridResult, Image, PaneLuminance, Point
from specularia.daylight.sun import SunPosition, sun_position
from specularia.daylight.weather import Weather, read_weather, write_wea
from specularia.daylight.when import Day, Place, Time

__all__ = [
    "FULL",
    "Coloured",
    "Contrast",
    "Day",
    "DayHour",
    "DayImage",
    "DayResult",
    "DaylightResult",
    "EmissionMap",
    "FragmentJob",
    "FragmentPicture",
    "FragmentResult",
    "Glare",
    "GridResult",
    "Image",
    "PaneLuminance",
    "Place",
    "Point",
    "Quality",
    "RoomJob",
    "SunPosition",
    "Time",
    "Weather",
    "at",
    "day",
    "emission_map",
    "file_name",
    "look_through",
    "outside_at",
    "read_weather",
    "run",
    "sun_position",
    "write_wea",
]
