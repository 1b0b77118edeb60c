"""
Heal
====

What was the pane before it decayed? Pits are found, and possible original surfaces are drawn that agree
with the plateaux that are left. The face is **synthetic**, so the original is known.
"""

from dataclasses import replace
from pathlib import Path

import numpy as np

from specularia import glass, surface, twin
from specularia.analysis import healed_pane
from specularia.report import figures

folder = Path("heal")
folder.mkdir(exist_ok=True)

# %%
# A face that decay has pitted over six tenths of its area.

settings = twin.TwinSettings(maps={"pixels": 512})
pitch = settings.maps.pitch_um
face = twin.make_face(settings.front, settings.maps, np.random.default_rng(3))
pitted = surface.HeightMap(face.decayed_um, pitch, pitch, name="synthetic face")

# %%
# Healing
# -------

healed = surface.heal(pitted, ensemble=6, seed=1)
figures.healed(pitted, healed, folder / "healed.png", truth_um=face.pristine_um, synthetic=True)

# %%
# The share of pits and the rms slope, beside the truth. The most probable surface is smoother than the
# original; the members of the ensemble have its slopes.

original = surface.HeightMap(face.pristine_um, pitch, pitch)
low, high = healed.Sdq_interval
print(f"pitted: found {healed.pit_coverage:.3f}, true {face.pitted.mean():.3f}")
print(f"rms slope: decayed {healed.Sdq_before:.3f}, healed {healed.Sdq_after:.4f},")
print(f"  members {low:.4f} to {high:.4f}, true {surface.roughness(original).Sdq:.4f}")

# %%
# Light through the healed pane
# -----------------------------
# One trace for each member: the spread between them is what healing (and the noise of tracing) leaves open.

decayed = glass.Slab(
    thickness_mm=3.0,
    medium=glass.Medium(index=1.52, absorption_per_mm=0.07),
    front=glass.Face(face.decayed_um, pitch, pitch),
    synthetic=True,
)
pristine = replace(decayed, front=glass.Face(face.pristine_um, pitch, pitch))
members = [healed.member(k) for k in range(len(healed.members))]
angles = [0, 40, 60]
traced = healed_pane(decayed, {"front": members}, theta_deg=angles, paths=100_000, seed=1)
before = healed_pane(
    decayed, {"front": [replace(pitted), replace(pitted)]}, theta_deg=angles, paths=100_000, seed=1
)
after = healed_pane(pristine, {"front": [original, original]}, theta_deg=angles, paths=100_000, seed=1)
print("angle   lobe of the pane, degrees (full width at half maximum)")
print("        decayed   healed members   original")
for k, theta in enumerate(angles):
    widths = traced.fwhm_deg[:, k]
    print(
        f"{theta:5.0f}   {before.fwhm_deg[0, k]:7.2f}   {widths.min():6.2f} to {widths.max():.2f}"
        f"   {after.fwhm_deg[0, k]:8.2f}"
    )
