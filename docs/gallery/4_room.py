"""
Room
====

A room with one window, lit by the sun and a clear sky, through a pitted pane and, to compare with, through
a perfect diffuser. Room and pane are **synthetic**.
"""

from pathlib import Path

import numpy as np

from specularia import daylight, glass, twin
from specularia.report import figures

folder = Path("room")

# %%
# The pane
# --------
# Two faces that are pitted nearly all over. What the pane does with light is traced at 18 angles, from both
# sides.

settings = twin.TwinSettings(
    maps={"pixels": 256}, front={"pitted_share": 0.95}, back={"pitted_share": 0.95}, bubbles={"per_cm3": 0}
)
chance = np.random.default_rng(1)
faces = {
    name: twin.make_face(getattr(settings, name), settings.maps.of(name), chance)
    for name in ("front", "back")
}
pitted = glass.model(twin.make_slab(faces, settings, seed=1), paths=40_000, seed=1)

# %%
# The room
# --------
# The keys are those of a ROOM.toml.

room = {
    "name": "a synthetic room",
    "room": {"width_m": 5, "depth_m": 6, "height_m": 3},
    "window": [{"name": "window", "wall": "south", "width_m": 0.8, "height_m": 1.1, "sill_m": 1.0}],
    "sun": {"elevation_deg": 40, "azimuth_deg": 0, "wall": "south"},
    "sky": {"kind": "clear"},
    "ground": {"reflectance": 0.2},
    "sensor": [
        {"name": "floor near window", "position_m": [2.5, 2.0, 0], "normal": [0, 0, 1]},
        {"name": "floor at the side", "position_m": [1.3, 2.0, 0], "normal": [0, 0, 1]},
        {"name": "ceiling", "position_m": [2.5, 3, 3], "normal": [0, 0, -1]},
    ],
    "quality": {"sampling": 0.4, "repeats": 2},
}
view = {
    "name": "towards the window",
    "position_m": [2.5, 5.7, 1.6],
    "direction": [0, -1, -0.1],
    "horizontal_deg": 60,
    "size_px": [120, 90],
}

# %%
# Light
# -----
# Each pane becomes a light source that is computed from its model; no ray has to find the sun by chance.
# The same room without glass, behind a clear slab and behind an even diffuser gives bounds to compare with.

lit = daylight.run(
    daylight.RoomJob.model_validate({**room, "view": [view]}), models={"pitted": pitted}, folder=folder
)
bounds = daylight.run(
    daylight.RoomJob.model_validate({**room, "references": ["no glass", "clear slab", "diffuser"]})
)
for point in [*lit.points, *bounds.points]:
    print(f"{point.model:10} {point.name:18} {point.illuminance_lx:7.0f} lx  +- {point.se:.0f}")

# %%
# The sun's patch is spread over the floor, and the pane itself is the brightest thing in sight.

figures.luminance_maps(lit.images, folder / "luminance.png", points=lit.points, synthetic=True)
