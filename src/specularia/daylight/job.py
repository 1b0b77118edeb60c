"""ROOM.toml: a box room with windows, the sun and the sky outside, sensors and views inside.

The room's own compass: x runs east, y north, z up, in metres; the origin is the south-west corner of the
floor, inside. A room for the south window of a house, complete::

    name = "a room with one window"

    [room]
    width_m = 5.0                  # along the south wall (x)
    depth_m = 6.0                  # from the south wall to the north wall (y)
    height_m = 3.0

    [reflectance]                  # all surfaces scatter evenly (Lambert)
    ceiling = 0.70
    walls = 0.70
    floor = 0.15
    frames = 0.15

    [[window]]
    name = "window"
    wall = "south"                 # south | north | west | east
    width_m = 0.80                 # of the opening, frame included
    height_m = 1.10
    sill_m = 1.0
    frame_m = 0.05                 # visible width of the frame on each side

    [sun]                          # leave the table out for no sun
    elevation_deg = 75.0
    azimuth_deg = 0.0              # from the outward normal of `wall`, clockwise seen from above
    wall = "south"

    [sky]
    kind = "clear"                 # clear | overcast | uniform | none

    [ground]
    reflectance = 0.20

    [[sensor]]
    name = "floor in the light"
    position_m = [2.5, 0.5, 0.0]
    normal = [0, 0, 1]

    [[grid]]
    name = "working plane"
    height_m = 0.8
    spacing_m = 0.5

    [[view]]
    name = "towards the window"
    position_m = [2.5, 5.5, 1.6]
    direction = [0, -1, 0]
    horizontal_deg = 60.0
    size_px = [240, 180]

    [[model]]                      # or --model M=model_m.nc on the command line
    name = "M"
    file = "model_m.nc"

The pane's front is outdoors: sample y is up, sample z points out of the room, sample x to the right of
somebody who looks at the window from outside.
"""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field, field_validator, model_validator

from specularia.daylight._fields import Metres, Name, Share, Vector, Wall, unit
from specularia.daylight.views import Grid, View
from specularia.jobs import FilePath, Job

__all__ = [
    "WALLS",
    "Grid",
    "Ground",
    "ModelFile",
    "Quality",
    "Reflectance",
    "RoomJob",
    "RoomSize",
    "Sensor",
    "Sky",
    "Sun",
    "View",
    "Wall",
    "Window",
]

WALLS: tuple[Wall, ...] = ("south", "north", "west", "east")


class RoomSize(Job):
    """[room]: inner size of the box."""

    width_m: Metres
    """Along the south and north walls (x)."""
    depth_m: Metres
    """Along the west and east walls (y)."""
    height_m: Metres
    """From the floor to the ceiling (z)."""


class Reflectance(Job):
    """[reflectance]: Lambertian reflectances, 0 to below 1, of what is inside."""

    ceiling: Share = 0.70
    walls: Share = 0.70
    floor: Share = 0.15
    frames: Share = 0.15


class Window(Job):
    """[[window]]: an opening in a wall; the pane fills what the frame leaves."""

    name: Name = "window"
    wall: Wall = "south"
    width_m: Metres
    """Width of the opening, frame included."""
    height_m: Metres
    """Height of the opening, frame included."""
    sill_m: Annotated[float, Field(ge=0.0)]
    """Height of the opening's lower edge above the floor."""
    centre_m: Annotated[float, Field(gt=0.0)] | None = None
    """Where the opening's middle lies along the wall, from its west or south end. Left out: the middle."""
    frame_m: Annotated[float, Field(ge=0.0)] = 0.0
    """Width of the frame on each of the four sides, flat in the wall's plane."""
    pane_reflectance: Share | None = None
    """Reflectance of the pane for light from the room, taken as even scattering. Left out: the model's own
    diffuse-diffuse reflectance of the back, or 0.15 (clear glass, about) if the model has no reflection."""

    @model_validator(mode="after")
    def _pane_is_left(self) -> Window:
        if 2.0 * self.frame_m >= min(self.width_m, self.height_m):
            raise ValueError(
                "a frame that leaves some pane: frame_m below half the opening's width and height"
            )
        return self


class Sun(Job):
    """[sun]: leave the table out for no sun."""

    elevation_deg: Annotated[float, Field(ge=-90.0, le=90.0)]
    """Above the horizon."""
    azimuth_deg: Annotated[float, Field(ge=-360.0, le=360.0)] = 0.0
    """From the outward normal of `wall`, clockwise from above: for a south wall, afternoon is positive."""
    wall: Wall = "south"
    """The wall that the azimuth is counted from."""
    normal_illuminance_lx: Annotated[float, Field(ge=0.0)] | None = None
    """Of the direct sun on a plane square to it. Left out: what gensky gives for this elevation if the sky is
    clear or none, and nothing behind an overcast or uniform sky."""


class Sky(Job):
    """[sky]: luminance of the sky, without the sun's disc."""

    kind: Literal["clear", "overcast", "uniform", "none"] = "clear"
    """CIE clear, CIE overcast, uniform, or a black sky."""
    horizontal_illuminance_lx: Annotated[float, Field(ge=0.0)] | None = None
    """Of the sky alone on the ground. Left out: what gensky gives for this elevation of the sun."""

    @model_validator(mode="after")
    def _black_is_black(self) -> Sky:
        if self.kind == "none" and self.horizontal_illuminance_lx:
            raise ValueError("no horizontal_illuminance_lx for a sky of kind none")
        return self


class Ground(Job):
    """[ground]: the ground outside, flat and even, lit by sun and sky."""

    reflectance: Share = 0.20


class Sensor(Job):
    """[[sensor]]: a point at which illuminance is wanted."""

    name: Name
    position_m: Vector
    """x, y, z; a point on a wall, the floor or a pane is fine if its normal points into the room."""
    normal: Vector = (0.0, 0.0, 1.0)
    """Of the lit side; any length."""

    _unit = field_validator("normal")(unit)


class ModelFile(Job):
    """[[model]]: a scattering model for the panes, one result for each."""

    name: Name
    file: FilePath
    """A .nc of ours, or a BSDF in .xml."""


class Quality(Job):
    """[quality]: the defaults are the quick settings; `FULL` in this module holds the slower ones."""

    sampling: Annotated[float, Field(gt=0.05, le=8.0)] = 1.0
    """Density of points on panes, of the emission map and of the mesh of the walls, times the quick one."""
    repeats: Annotated[int, Field(ge=2, le=64)] = 4
    """Runs with differently cut panes, from whose spread the standard error comes."""


FULL = Quality(sampling=2.0, repeats=8)
"""Settings for publication."""


class RoomJob(Job):
    """The whole ROOM.toml."""

    name: Name = "room"
    room: RoomSize
    reflectance: Reflectance = Reflectance()
    window: Annotated[tuple[Window, ...], Field(min_length=1)]
    sun: Sun | None = None
    sky: Sky = Sky()
    ground: Ground = Ground()
    sensor: tuple[Sensor, ...] = ()
    grid: tuple[Grid, ...] = ()
    view: tuple[View, ...] = ()
    model: tuple[ModelFile, ...] = ()
    quality: Quality = Quality()

    @property
    def sun_shines(self) -> bool:
        """Whether there is direct sun outside."""
        if self.sun is None:
            return False
        given = self.sun.normal_illuminance_lx
        return self.sky.kind in ("clear", "none") if given is None else given > 0.0

    @model_validator(mode="after")
    def _names_differ(self) -> RoomJob:
        for kind in ("window", "sensor", "grid", "view", "model"):
            names = [item.name for item in getattr(self, kind)]
            twice = sorted({n for n in names if names.count(n) > 1})
            if twice:
                raise ValueError(f"{kind} names that differ; {', '.join(twice)} stands there twice")
        return self

    @model_validator(mode="after")
    def _sky_has_its_sun(self) -> RoomJob:
        needs = self.sky.kind == "clear" or (
            self.sky.kind in ("overcast", "uniform") and self.sky.horizontal_illuminance_lx is None
        )
        if needs and self.sun is None:
            raise ValueError(
                f"a [sun] table for a sky of kind {self.sky.kind} (its elevation sets the sky's luminance); "
                "for a sky without sun give normal_illuminance_lx = 0 in [sun]"
            )
        return self
