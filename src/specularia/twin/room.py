"""ROOM.toml and GLASS.toml files of the twin, as text."""

from __future__ import annotations

import math

from specularia.twin.settings import TwinSettings

__all__ = ["glass_toml", "room_toml"]

_SUN_DEG = 75.0
_WIDTH, _HEIGHT, _FRAME = 0.80, 1.10, 0.05


def room_toml(settings: TwinSettings) -> str:
    """The room of the paper: one window in the south wall, the sun square to that wall at 75 degrees.

    The window, the reflectances and the sun are the published ones; the size of the room, the frame's width
    and the places of the points are not published and are set here.
    """
    room = settings.room
    x = 0.5 * room.width_m
    # Where the middle of the pane throws the sun on the floor.
    lit = (room.sill_m + 0.5 * _HEIGHT) / math.tan(math.radians(_SUN_DEG))
    aside = 0.15 * room.width_m
    points = (
        ("window inside", (x, 0.0, room.sill_m + 0.5 * _HEIGHT), (0, 1, 0)),
        ("floor in the light", (x, lit, 0.0), (0, 0, 1)),
        ("floor at the side", (aside, lit, 0.0), (0, 0, 1)),
        ("ceiling near the window", (x, 1.0, room.height_m), (0, 0, -1)),
        ("ceiling centre", (x, 0.5 * room.depth_m, room.height_m), (0, 0, -1)),
        ("side wall", (0.0, 1.5, 1.5), (1, 0, 0)),
    )
    sensors = "\n".join(
        f'[[sensor]]\nname = "{name}"\nposition_m = [{p[0]:.4g}, {p[1]:.4g}, {p[2]:.4g}]\n'
        f"normal = [{n[0]}, {n[1]}, {n[2]}]\n"
        for name, p, n in points
    )
    return f"""# synthetic: a simplified room for a synthetic pane, after the published one
name = "room with one window (synthetic)"

[room]                             # not published
width_m = {room.width_m:g}
depth_m = {room.depth_m:g}
height_m = {room.height_m:g}

[reflectance]
ceiling = 0.70
walls = 0.70
floor = 0.15
frames = 0.15

[[window]]
name = "window"
wall = "south"
width_m = {_WIDTH:.2f}
height_m = {_HEIGHT:.2f}
sill_m = {room.sill_m:g}                     # not published
frame_m = {_FRAME:g}                     # not published

[sun]                              # square to the window wall
elevation_deg = {_SUN_DEG:g}
azimuth_deg = 0.0
wall = "south"

[sky]
kind = "clear"

[ground]
reflectance = 0.20

{sensors}
[[view]]
name = "towards the window"
position_m = [{x:.4g}, {room.depth_m - 0.5:.4g}, 1.6]
direction = [0, -1, 0]
horizontal_deg = 60.0
size_px = [240, 180]
"""


def glass_toml(
    settings: TwinSettings, *, front: str, back: str, spectrum: str | None, bubbles: str | None
) -> str:
    """A GLASS.toml of the twin.

    Parameters
    ----------
    front, back : height maps, as named from the file's folder.
    spectrum : absorption as a CSV; None for a clear medium.
    bubbles : the list of bubbles; None for none.
    """
    absorption = f'{{ spectrum = "{spectrum}" }}' if spectrum else "0.0"
    text = f"""# synthetic: {settings.label}
thickness_mm = {settings.glass.thickness_mm:g}

[medium]
index = {settings.glass.index:g}
absorption_per_mm = {absorption}

[front]
heights = "{front}"
tiling = "periodic"

[back]
heights = "{back}"
tiling = "periodic"
"""
    if bubbles:
        text += f'\n[[bubbles]]\nlist = "{bubbles}"\n'
    return text + "\n[trace]\npolarised = true\n"
