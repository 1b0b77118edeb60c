"""
Explain
=======

Why do a traced model and the measurement differ? One cause at a time is brought in, and each step says what
it does to the transmission, the width of the lobe and the background. The pane is **synthetic**: absorption
and bubbles are known.
"""

from pathlib import Path

import numpy as np

from specularia import analysis, gonio, twin
from specularia.glass import photometer
from specularia.report import figures

folder = Path("explain")

# %%
# A pane with absorption and bubbles, and its tables.

settings = twin.TwinSettings(maps={"pixels": 256})
chance = np.random.default_rng(1)
faces = {
    name: twin.make_face(getattr(settings, name), settings.maps.of(name), chance)
    for name in ("front", "back")
}
pane = twin.make_slab(faces, settings, seed=1)
recorded = photometer.write_tables(
    pane, folder / "tables", theta_deg=[0, 40, 60], points=20_000, aperture_deg=1.5, paths=100_000, seed=1
)
tables = [table for one in recorded for table in gonio.read(one.path)]

# %%
# The way from the pane as the paper computed it (clear, a patch of 8.4 mm, polarisation averaged at every
# interface, a tensor tree) to the measurement. Absorption is taken as known to 10 %.

found = analysis.explain(pane, tables, unsure={"absorption": 0.1}, aperture_deg=1.5, paths=50_000, seed=2)
figures.budget(found, folder / "budget.png")

# %%
# The same in numbers, for the transmission.

print("step                 " + "".join(f"{theta:>16.0f} deg" for theta in found.theta_deg))
print("start                " + "".join(f"{value:20.3f}" for value in found.start[:, 0]))
for step in found.steps:
    if step.present:
        row = zip(step.effect[:, 0], step.half_width[:, 0])
        print(f"{step.name:21}" + "".join(f"{effect:+12.3f} +- {half:.3f}" for effect, half in row))
print("measured             " + "".join(f"{value:20.3f}" for value in found.measured[:, 0]))
print("remainder            " + "".join(f"{value:+20.3f}" for value in found.remainder[:, 0]))
