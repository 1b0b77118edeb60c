"""
Scan to model
=============

From confocal focus stacks of both faces to height maps, and from these to a geometry-based model (Model C).
The stacks are **synthetic**, so the true heights are known.
"""

from pathlib import Path

import numpy as np

from specularia import glass, surface, twin
from specularia.report import figures

folder = Path("scan_to_model")

# %%
# What a microscope would record
# ------------------------------
# Faces of 0.4 mm, one slice every 1.25 um, with shot noise and the light that steep flanks lose.

settings = twin.TwinSettings(maps={"pixels": 256})
pitch = settings.maps.pitch_um
chance = np.random.default_rng(2)
truth, stacks = {}, {}
for name in ("front", "back"):
    truth[name] = twin.make_face(getattr(settings, name), settings.maps.of(name), chance).decayed_um
    seen = twin.focus_stack(truth[name], settings.microscope, pitch_um=pitch, rng=chance)
    folder.mkdir(exist_ok=True)
    stacks[name] = twin.write_stack(
        seen, folder / f"{name}.tif", pitch_um=pitch, label=f"synthetic {name} of a pane"
    )

# %%
# Height maps
# -----------
# Every pixel gets a height and a standard uncertainty. Pixels that cannot be trusted stay empty and say
# why.

maps = {name: surface.heights(stack) for name, stack in stacks.items()}
figures.height_maps(maps, folder / "heights.png", synthetic=True)

# %%
# Against the truth: the errors over their own uncertainty should have a spread of about 1.

for name, map_ in maps.items():
    error = map_.heights_um - truth[name]
    error -= np.nanmedian(error)
    ratio = error / map_.sigma_um
    low, high = np.nanpercentile(ratio, [15.87, 84.13])
    print(
        f"{name}: rms error {np.sqrt(np.nanmean(error**2)):.3f} um, over sigma {(high - low) / 2:.2f}, "
        f"missing {np.isnan(map_.heights_um).mean():.1%}, Sdq {surface.roughness(map_).Sdq:.2f}"
    )

# %%
# The back as a relief, and what its slopes are.

figures.relief(surface.filled(maps["back"])[0], folder / "relief.png", synthetic=True)

# %%
# Light through the glass
# -----------------------
# Thickness, index and absorption are not in the maps; they must be known.

pane = glass.Slab(
    thickness_mm=3.0,
    medium=glass.Medium(index=1.52, absorption_per_mm=0.07),
    front=glass.Face(maps["front"].heights_um, pitch, pitch, name="front"),
    back=glass.Face(maps["back"].heights_um, pitch, pitch, name="back"),
    synthetic=True,
)
balance = glass.trace(pane, theta_deg=[0, 40, 75], paths=50_000, seed=1)
for theta, tau, rho, absorbed in zip(balance.theta_deg, balance.tau, balance.rho, balance.absorbed):
    print(f"{theta:4.0f} deg: transmitted {tau:.3f}, reflected {rho:.3f}, absorbed {absorbed:.3f}")

# %%
# The whole model, from both sides: where the light goes.

model = glass.model(pane, theta_deg=[0, 20, 40, 60, 75], paths=30_000, seed=1)
figures.dsf({"Model C": model}, [0, 40, 60], folder / "dsf.png", synthetic=True)
