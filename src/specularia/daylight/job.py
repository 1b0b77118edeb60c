"""ROOM.toml: a box room with windows, the sun and the sky outside, sensors and views inside.

The room's own compass: x runs east, y north, z up, in metres; the origin is the south-west corner of the
floor, inside. A room for the south window of a house, complete::

    name = "a room with one window"
    references = ["no glass", "clear slab", "diffuser"]    # computed beside the models, if wanted

    [room]
    width_m = 5.0                  # along the south wall (x)
    depth_m = 6.0                  # from the south wall to the north wall (y)
    height_m = 3.0

    [reflectance]                  # all surfaces scatter evenly (Lambert); grey, or [R, G, B]
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
    rows = 1                       # a lattice of small panes, rows x columns, with bars between them
    columns = 1
    bar_m = 0.0
    inner_reveal_m = 0.0           # depth of the pane behind the wall's room side, and its splay
    inner_splay_deg = 0.0
    outer_reveal_m = 0.0           # the same on the outside: it shades the pane
    outer_splay_deg = 0.0

    [sun]                          # leave the table out for no sun
    elevation_deg = 75.0
    azimuth_deg = 0.0              # from the outward normal of `wall`, clockwise seen from above
    wall = "south"

    [sky]
    kind = "clear"                 # clear | intermediate | overcast | uniform | perez | none

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

    [[obstacle]]                   # anything outside that shades the panes, as often as needed
    name = "portico roof"
    corners_m = [[0, -2, 3.2], [5, -2, 3.2], [5, 0, 3.2], [0, 0, 3.2]]
    reflectance = 0.3

    [[model]]                      # or --model M=model_m.nc on the command line
    name = "M"
    file = "model_m.nc"

The pane's front is outdoors: sample y is up, sample z points out of the room, sample x to the right of
somebody who looks at the window from outside.

Where single panes of a lattice have models of their own, `panes` names them as seen from inside, top row
first; "*" stands for the model under comparison::

    [[window]]
    width_m = 0.7
    height_m = 0.5
    sill_m = 1.0
    rows = 2
    columns = 3
    bar_m = 0.012
    panes = [["*", "*", "old"], ["*", "old, turned", "*"]]

    [[glass]]
    name = "old"
    file = "model_old.nc"

    [[glass]]
    name = "old, turned"
    file = "model_old.nc"
    turn_deg = 90.0

Place and time may stand instead of the sun's angles (see `specularia.daylight.when`)::

    [place]
    latitude_deg = 37.94
    longitude_deg = 27.34
    time_zone = "solar"            # or hours ahead of UT
    orientation_deg = 15.0         # bearing of the room's north (+y), clockwise from true north

    [time]
    date = "0620-06-21"
    calendar = "julian"
    hour = 10.5
"""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import BeforeValidator, Field, field_validator, model_validator

from specularia.daylight._fields import Metres, Name, Shade, Share, Vector, Wall, unit
from specularia.daylight.views import Grid, View
from specularia.daylight.when import Day, Place, Time, WeatherFile
from specularia.jobs import FilePath, Job

__all__ = [
    "WALLS",
    "Geometry",
    "Glass",
    "Grid",
    "Ground",
    "ModelFile",
    "Obstacle",
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


def _three(value: Any) -> Any:
    return (value,) * 3 if isinstance(value, (int, float)) else value


def _both_bands(self: Any) -> Any:
    if (self.cie_x is None) != (self.cie_z is None):
        raise ValueError("cie_x and cie_z together, or neither")
    return self


Angle = Annotated[float, Field(ge=0.0, le=80.0)]
Splay = Annotated[tuple[Angle, Angle, Angle], BeforeValidator(_three)]
"""Of jambs, sill and head, in degrees."""


class RoomSize(Job):
    """[room]: inner size of the box."""

    width_m: Metres
    """Along the south and north walls (x)."""
    depth_m: Metres
    """Along the west and east walls (y)."""
    height_m: Metres
    """From the floor to the ceiling (z)."""


class Reflectance(Job):
    """[reflectance]: Lambertian reflectances, 0 to below 1, of what is inside: one number for grey, or three
    for a colour, linear R, G and B in Radiance's primaries."""

    ceiling: Shade = 0.70
    walls: Shade = 0.70
    floor: Shade = 0.15
    frames: Shade = 0.15
    """Frames and the bars of lattices."""
    reveals: Shade | None = None
    """Inner reveals of windows. Left out: as the walls."""
    outside: Share = 0.3
    """Outer reveals of windows."""


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
    """Width of the frame on each of the four sides, flat in the pane's plane."""
    rows: Annotated[int, Field(ge=1, le=100)] = 1
    """Panes above each other."""
    columns: Annotated[int, Field(ge=1, le=100)] = 1
    """Panes beside each other."""
    bar_m: Annotated[float, Field(ge=0.0)] = 0.0
    """Width of the bars between panes."""
    panes: tuple[tuple[Name, ...], ...] = ()
    """Name of the glass of every pane as seen from inside, top row first; "*" is the model under comparison.
    Left out: that model everywhere."""
    inner_reveal_m: Annotated[float, Field(ge=0.0, le=5.0)] = 0.0
    """Depth of the pane behind the room side of its wall."""
    inner_splay_deg: Splay = (0.0, 0.0, 0.0)
    """By how much jambs, sill and head open towards the room; one number for all, or three."""
    outer_reveal_m: Annotated[float, Field(ge=0.0, le=5.0)] = 0.0
    """Depth of the pane behind the outer side of its wall; the reveal shades it."""
    outer_splay_deg: Splay = (0.0, 0.0, 0.0)
    """By how much jambs, sill and head open towards the outside."""
    pane_reflectance: Share | None = None
    """Reflectance of the pane for light from the room, taken as even scattering. Left out: the model's own
    diffuse-diffuse reflectance of the back, or 0.15 (clear glass, about) if the model has no reflection."""

    @model_validator(mode="after")
    def _pane_is_left(self) -> Window:
        if min(self.pane_size) <= 1e-6:
            raise ValueError(
                "a frame and bars that leave some pane: frame_m below half the opening's width and height, "
                "less the bars"
            )
        return self

    @model_validator(mode="after")
    def _panes_fit(self) -> Window:
        if self.panes and (
            len(self.panes) != self.rows or any(len(row) != self.columns for row in self.panes)
        ):
            raise ValueError(
                f"panes with {self.rows} rows of {self.columns} names each, as rows and columns say"
            )
        return self

    @property
    def pane_size(self) -> tuple[float, float]:
        """Width and height of each pane in m."""
        width = self.width_m - 2.0 * self.frame_m - (self.columns - 1) * self.bar_m
        height = self.height_m - 2.0 * self.frame_m - (self.rows - 1) * self.bar_m
        return width / self.columns, height / self.rows


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
    clear, intermediate or none, what a sky of kind perez says, nothing behind an overcast or uniform sky."""


class Sky(Job):
    """[sky]: luminance of the sky, without the sun's disc."""

    kind: Literal["clear", "intermediate", "overcast", "uniform", "perez", "none"] = "clear"
    """CIE clear, intermediate or overcast, uniform, Perez's all-weather sky, or a black sky."""
    horizontal_illuminance_lx: Annotated[float, Field(ge=0.0)] | None = None
    """Of the sky alone on the ground. Left out: what gensky gives for this elevation of the sun."""
    direct_normal_irradiance_w_m2: Annotated[float, Field(ge=0.0, le=1420.0)] | None = None
    """For perez: of the sun on a plane square to it."""
    diffuse_horizontal_irradiance_w_m2: Annotated[float, Field(gt=0.0, le=1420.0)] | None = None
    """For perez: of the sky alone on the ground."""

    @model_validator(mode="after")
    def _amounts_fit(self) -> Sky:
        if self.kind in ("none", "perez") and self.horizontal_illuminance_lx:
            raise ValueError(f"no horizontal_illuminance_lx for a sky of kind {self.kind}")
        given = {self.direct_normal_irradiance_w_m2 is None, self.diffuse_horizontal_irradiance_w_m2 is None}
        if given != {self.kind != "perez"}:
            raise ValueError(
                "direct_normal_irradiance_w_m2 and diffuse_horizontal_irradiance_w_m2 with a sky of kind "
                "perez, and with no other"
            )
        return self


class Ground(Job):
    """[ground]: the ground outside, flat and even, lit by sun and sky."""

    reflectance: Share = 0.20


class Glass(Job):
    """[[glass]]: a model of its own for single panes of a lattice."""

    name: Name
    file: FilePath
    """A .nc of ours, or a BSDF in .xml."""
    cie_x: FilePath | None = None
    cie_z: FilePath | None = None
    """As of [[model]]."""
    turn_deg: Annotated[float, Field(ge=-360.0, le=360.0)] = 0.0
    """By how much the sample is turned in its plane, counter-clockwise seen from outside."""

    @field_validator("name")
    @classmethod
    def _not_the_star(cls, name: str) -> str:
        if name == "*":
            raise ValueError('a name other than "*", which stands for the model under comparison')
        return name

    _both = model_validator(mode="after")(_both_bands)


class Obstacle(Job):
    """[[obstacle]]: something opaque outside, in the room's coordinates: a flat polygon, or a box."""

    name: Name
    corners_m: Annotated[tuple[Vector, ...], Field(min_length=3)] | None = None
    """Of a flat convex polygon, in order."""
    box_m: tuple[Vector, Vector] | None = None
    """Two opposite corners of a box with level and upright faces."""
    reflectance: Share = 0.3

    @model_validator(mode="after")
    def _one_shape(self) -> Obstacle:
        if (self.corners_m is None) == (self.box_m is None):
            raise ValueError("either corners_m or box_m")
        if self.box_m is not None and not np.all(np.abs(np.subtract(*self.box_m)) > 0.0):
            raise ValueError("a box_m with some width, depth and height")
        if self.corners_m is not None:
            c = np.array(self.corners_m)
            turns = np.cross(np.roll(c, -1, axis=0) - c, np.roll(c, -2, axis=0) - np.roll(c, -1, axis=0))
            normal = turns.sum(axis=0)
            size = float(np.linalg.norm(normal))
            flat = size > 0 and np.abs((c - c[0]) @ normal).max() <= 1e-6 * size * np.ptp(c, axis=0).max()
            if not flat or np.any(turns @ normal < -1e-9 * size * size):
                raise ValueError("the corners of a flat convex polygon in order")
        return self


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
    """A .nc of ours, or a BSDF in .xml. An .xml with the bands CIE-X, Visible (or CIE-Y) and CIE-Z lights the
    room in colour."""
    cie_x: FilePath | None = None
    cie_z: FilePath | None = None
    """Files of the bands CIE-X and CIE-Z, where each band has a file of its own; `file` is then that of Y."""
    members: tuple[FilePath, ...] = ()
    """Models of the same pane as it may be, at least two: a healed ensemble, or patches. Each lights the room
    by itself; their spread gives the interval of the points."""

    @field_validator("members")
    @classmethod
    def _some_members(cls, members: tuple[Path, ...]) -> tuple[Path, ...]:
        if len(members) == 1:
            raise ValueError("two members or more, or none")
        return members

    _both = model_validator(mode="after")(_both_bands)


class Geometry(Job):
    """[geometry]: a room of the user's own, in place of [room], [reflectance] and [[window]]."""

    file: FilePath
    """A Radiance scene (.rad) or an OBJ file, in metres, z up; commands in a .rad are carried out."""
    materials: FilePath | None = None
    """A Radiance file with the materials that an OBJ file names."""
    pane_materials: Annotated[tuple[Name, ...], Field(min_length=1)]
    """Materials of the panes: rectangles whose normals point into the room. They need no definition."""
    pane_reflectance: Share | None = None
    """As of [[window]]."""


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
    references: tuple[Literal["no glass", "clear slab", "diffuser"], ...] = ()
    """Panes to compare with, beside the models: nothing at all, a clear slab of index 1.52 that absorbs
    nothing, and a diffuser that passes all light."""
    room: RoomSize | None = None
    geometry: Geometry | None = None
    reflectance: Reflectance = Reflectance()
    window: tuple[Window, ...] = ()
    place: Place | None = None
    time: Time | None = None
    weather: WeatherFile | None = None
    day: Day | None = None
    sun: Sun | None = None
    sky: Sky = Sky()
    ground: Ground = Ground()
    sensor: tuple[Sensor, ...] = ()
    grid: tuple[Grid, ...] = ()
    view: tuple[View, ...] = ()
    obstacle: tuple[Obstacle, ...] = ()
    glass: tuple[Glass, ...] = ()
    model: tuple[ModelFile, ...] = ()
    quality: Quality = Quality()

    @property
    def sun_shines(self) -> bool:
        """Whether there is direct sun outside."""
        if self.sun is None:
            return False
        given = self.sun.normal_illuminance_lx
        if given is None and self.sky.kind == "perez":
            given = self.sky.direct_normal_irradiance_w_m2
        return self.sky.kind in ("clear", "intermediate", "none") if given is None else given > 0.0

    @property
    def needs_sun(self) -> bool:
        """Whether the sky cannot be known without the elevation of the sun."""
        given = self.sky.horizontal_illuminance_lx is not None
        return self.sky.kind != "none" and not (self.sky.kind in ("overcast", "uniform") and given)

    @model_validator(mode="after")
    def _one_room(self) -> RoomJob:
        if (self.room is None) == (self.geometry is None):
            raise ValueError("either [room] with [[window]], or [geometry]")
        if self.room is not None and not self.window:
            raise ValueError("at least one [[window]]")
        if self.geometry is not None and self.window:
            raise ValueError("no [[window]] beside [geometry]: its panes are named by pane_materials")
        return self

    @property
    def other_bands(self) -> list[Path]:
        """Files of the bands CIE-X and CIE-Z."""
        both: list[ModelFile | Glass] = [*self.model, *self.glass]
        return [f for m in both for f in (m.cie_x, m.cie_z) if f is not None]

    @property
    def box(self) -> RoomSize:
        """Size of the box."""
        assert self.room is not None
        return self.room

    @model_validator(mode="after")
    def _names_differ(self) -> RoomJob:
        for kind in ("window", "sensor", "grid", "view", "obstacle", "glass", "model"):
            names = [item.name for item in getattr(self, kind)]
            twice = sorted({n for n in names if names.count(n) > 1})
            if twice:
                raise ValueError(f"{kind} names that differ; {', '.join(twice)} stands there twice")
        return self

    @model_validator(mode="after")
    def _glass_is_there(self) -> RoomJob:
        known = {g.name for g in self.glass} | {"*"}
        for window in self.window:
            missing = sorted({n for row in window.panes for n in row} - known)
            if missing:
                raise ValueError(
                    f"a [[glass]] for every name in panes; window {window.name!r} names {', '.join(missing)}"
                )
        return self

    @model_validator(mode="after")
    def _sky_has_its_sun(self) -> RoomJob:
        if self.needs_sun and not (self.sun or self.place or self.weather):
            raise ValueError(
                f"a [sun] table for a sky of kind {self.sky.kind} (its elevation sets the sky's luminance) "
                "or [place] and [time]; for a sky without sun give normal_illuminance_lx = 0 in [sun]"
            )
        return self

    @model_validator(mode="after")
    def _one_sun(self) -> RoomJob:
        if self.sun and (self.time or self.weather):
            raise ValueError("the sun's angles in [sun], or a [time] (and [weather]), not both")
        if (self.time or self.day) and not (self.place or self.weather):
            raise ValueError("a table [place] for the dates (or [weather], whose file says where it is)")
        if self.weather and "sky" in self.model_fields_set:
            raise ValueError("no [sky] beside [weather]: its hours set the sky (kind perez)")
        return self
