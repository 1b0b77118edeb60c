"""
Compare
=======

A measured and a computed model of one pane, side by side. The pane is **synthetic**, and the computed model
is told too little of it: it knows both faces, but neither the absorption nor the bubbles. This is how Model
C can come out too bright.
"""

from dataclasses import replace
from pathlib import Path

import numpy as np

from specularia import bsdf, glass, gonio, twin
from specularia.analysis import measured_tau
from specularia.glass import photometer
from specularia.report import figures

folder = Path("compare")
angles = [0, 20, 40, 60, 75]

# %%
# The pane as it is, and the pane as the tracer is told.

settings = twin.TwinSettings(maps={"pixels": 256})
chance = np.random.default_rng(1)
faces = {
    name: twin.make_face(getattr(settings, name), settings.maps.of(name), chance)
    for name in ("front", "back")
}
pane = twin.make_slab(faces, settings, seed=1)
clear = replace(pane, medium=glass.Medium(index=1.52), bubbles=None)

# %%
# Model M from the tables of a virtual gonio-photometer, Model C from tracing.

recorded = photometer.write_tables(
    pane, folder / "tables", theta_deg=angles, points=20_000, aperture_deg=1.5, paths=100_000, seed=1
)
tables = [table for one in recorded for table in gonio.read(one.path)]
models = {
    "Model M": gonio.fit(tables),
    "Model C": glass.model(clear, theta_deg=angles, paths=50_000, seed=2),
}
figures.dsf(models, [0, 40, 60], folder / "dsf.png", synthetic=True)

# %%
# Where Model C sends more (red) or less (blue).

figures.ratio_map(models, [0, 40, 60], folder / "ratio.png", synthetic=True)

# %%
# In numbers. ``l1`` is the light that goes elsewhere, over tau of Model M: 0 for equal models.

print("angle  tau M  tau C    C/M    l1   haze M  haze C  (light beyond 2.5 degrees)")
for row in bsdf.compare(models["Model M"], models["Model C"], theta_deg=angles):
    print(
        f"{row.theta_deg:5.1f}  {row.tau_a:.3f}  {row.tau_b:.3f}  {row.tau_b / row.tau_a:.3f}  {row.l1:.2f}"
        f"   {row.haze_2_5_a:.3f}   {row.haze_2_5_b:.3f}"
    )

# %%
# Both over the angle of incidence, with a clear flat pane in closed form. Model C exceeds Model M more and
# more as the light gets oblique, for its way in the glass gets longer: that is absorption, which Model C
# was not told of.

theta = np.linspace(0, 89, 90)
flat = glass.closed_form.flat_slab(theta, index=1.52).transmitted
figures.tau_curves(
    models, folder / "tau.png", measured=measured_tau(tables), slab=(theta, flat), synthetic=True
)
