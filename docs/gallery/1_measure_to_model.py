"""
Measure to model
================

From the tables of a gonio-photometer to a scattering model (Model M) and a file for Radiance. The tables
are **synthetic**: a virtual instrument reads them off a ray-traced pane, so the true transmissions are
known.
"""

from pathlib import Path

import numpy as np

from specularia import bsdf, gonio, twin
from specularia.analysis import TauPoints
from specularia.glass import photometer
from specularia.report import figures

folder = Path("measure_to_model")
angles = np.array([0, 20, 40, 60, 75])

# %%
# A synthetic pane
# ----------------
# Two pitted faces, 3 mm of yellowish glass between them, no bubbles.

settings = twin.TwinSettings(maps={"pixels": 256}, bubbles={"per_cm3": 0})
chance = np.random.default_rng(1)
faces = {
    name: twin.make_face(getattr(settings, name), settings.maps.of(name), chance)
    for name in ("front", "back")
}
pane = twin.make_slab(faces, settings, seed=1)

# %%
# What an instrument would record of it
# -------------------------------------
# 20,000 directions for each of five incident angles, 1 % noise, and the shadow of the sample mount.

recorded = photometer.write_tables(
    pane,
    folder / "tables",
    theta_deg=angles,
    points=20_000,
    aperture_deg=1.5,
    relative_noise=0.01,
    shadow=True,
    paths=100_000,
    seed=1,
)
tables = [table for one in recorded for table in gonio.read(one.path)]
figures.measured_dsf(tables[:3], folder / "measured.png", synthetic=True)

# %%
# The integral of each table, beside the transmission that was traced. The shadow is found and filled;
# ``sys`` bounds what gaps may hide.

summaries = gonio.summarise_all(tables)
print("angle   truth   table     se    sys")
for one, found in zip(recorded, summaries):
    print(
        f"{one.theta_deg:5.1f}  {one.tau:.4f}  {found.tau:.4f}  {found.tau_se:.4f} {found.tau_systematic:.4f}"
    )

# %%
# The model
# ---------
# Dots are the table, the line is the model in the plane of incidence.

model = gonio.fit(tables, summaries=summaries)
figures.sections({"Model M": model}, [0, 40, 60], folder / "sections.png", measured=tables, synthetic=True)

# %%
# Transmission at every angle, dashed where the model goes beyond its last table.

points = TauPoints(angles, *np.transpose([(found.tau, found.tau_se) for found in summaries]))
figures.tau_curves({"Model M": model}, folder / "tau.png", measured=points, synthetic=True)

# %%
# How good is it between the tables? Leave each inner one out and predict it from the others.

for one in gonio.cross_validate(summaries, model):
    print(
        f"{one.theta_deg:4.0f} deg: predicted {one.predicted:.3f}, table {one.measured:.3f}, L1 {one.l1:.2f}"
    )

# %%
# For Radiance
# ------------
# All sides are written, the missing one by reciprocity, and the file is read back and checked. The tree is
# coarse here, to save time, and the checks say what that costs.

bsdf.write(model, folder / "model_m.nc")
bsdf.write(model, folder / "model_m.xml", resolution=5)
checks = bsdf.check(bsdf.read(folder / "model_m.xml"))
print(f"{sum(check.ok for check in checks)} of {len(checks)} checks passed")
for check in checks:
    if not check.ok:
        print(f"{check.name}: {check.value:.3g}, limit {check.limit:.3g}. {check.advice}")
