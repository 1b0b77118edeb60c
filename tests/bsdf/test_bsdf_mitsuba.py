"""The export for Mitsuba 3: its table, and what Mitsuba renders with it where it is installed."""

from __future__ import annotations

import subprocess
import sys
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from specularia import bsdf
from specularia.errors import PhysicsError

FRONT = "transmission_front"
ANGLES = (0.0, 2.0, 30.0, 60.0, 75.0)

RENDER = """
import json, sys
sys.path.insert(0, sys.argv[1])
import numpy as np
import mitsuba as mi
mi.set_variant("scalar_rgb")
mi.set_log_level(mi.LogLevel.Error)
import specularia_bsdf

pane = {"type": "specularia", "filename": sys.argv[1] + "/table.npz"}
wide = {"type": "rectangle", "to_world": mi.ScalarTransform4f().scale([1e4, 1e4, 1]), "bsdf": pane}
film = {"type": "hdrfilm", "width": 1, "height": 1, "rfilter": {"type": "box"}, "pixel_format": "luminance"}

def seen(light, sensor, integrator):
    scene = {"type": "scene", "light": light, "pane": wide, "sensor": sensor, "integrator": integrator}
    return float(np.array(mi.render(mi.load_dict(scene))).ravel()[0])

def eye(d, count):
    sampler = {"type": "independent", "sample_count": count}
    away = [-v for v in d]
    return {"type": "radiancemeter", "origin": d, "direction": away, "film": film, "sampler": sampler}

def sun(d):
    return {"type": "directional", "direction": [-v for v in d], "irradiance": {"type": "rgb", "value": 1.0}}

direct = {"type": "direct", "bsdf_samples": 0, "emitter_samples": 1}
out = {"dome": [], "sun": [], "pairs": []}
for theta in json.loads(sys.argv[2]):
    t, p = np.radians(theta), 0.5
    d = [float(np.sin(t) * np.cos(p)), float(np.sin(t) * np.sin(p)), float(np.cos(t))]
    path = {"type": "path", "max_depth": 2}
    out["dome"].append(seen({"type": "constant"}, eye(d, 3000), path))
    sampler = {"type": "stratified", "sample_count": 10000}
    plate = {"type": "irradiancemeter", "film": film, "sampler": sampler}
    place = mi.ScalarTransform4f().translate([0, 0, -1]).scale(0.1)
    out["sun"].append(seen(sun(d), {"type": "rectangle", "to_world": place, "m": plate}, direct) / d[2])
for d, o in json.loads(sys.argv[3]):
    out["pairs"].append(seen(sun(d), eye(o, 1), direct) / abs(d[2]))
print(json.dumps(out))
"""


def test_the_table_holds_the_model_s_tau(chiral: Any, tmp_path: Path) -> None:
    made = bsdf.export_mitsuba(chiral, tmp_path / "m", resolution=5)
    assert [f.name for f in made.files] == ["table.npz", "specularia_bsdf.py", "scene.xml", "about.json"]
    known = made.theta_deg < 90
    for side in chiral.sides:
        true = chiral.direct_hemispherical(side, made.theta_deg[known])
        np.testing.assert_allclose(made.tau[side][known], true, rtol=1e-5)
    compile((tmp_path / "m/specularia_bsdf.py").read_text(), "specularia_bsdf.py", "exec")
    with pytest.raises(PhysicsError, match="4 to 8"):
        bsdf.export_mitsuba(chiral, tmp_path / "n", resolution=9)


def test_the_command_writes_a_folder(command: Any, pane: Any, tmp_path: Path) -> None:
    source = bsdf.write(pane, tmp_path / "pane.nc").path
    words = ("bsdf", "mitsuba", source, "-o", tmp_path / "m", "--resolution", "4", "--json")
    code, found, _ = command(*words)
    assert code == 0 and {Path(f).name for f in found["files"]} >= {"table.npz", "scene.xml"}
    assert found["tau"][FRONT][8] == pytest.approx(float(pane.direct_hemispherical(FRONT, 20.0)), rel=1e-4)


@pytest.mark.skipif(find_spec("mitsuba") is None, reason="Mitsuba 3 is not installed")
def test_mitsuba_renders_the_model_under_a_dome_and_a_sun(chiral: Any, tmp_path: Path) -> None:
    """tau within 1 % both ways, and a lopsided lobe where the model has it, not mirrored or turned."""
    import json

    folder = bsdf.export_mitsuba(chiral, tmp_path / "m").folder
    rng = np.random.default_rng(6)
    pairs: list[Any] = []
    true = []
    while len(pairs) < 12:
        theta, phi = float(rng.uniform(5, 65)), float(rng.uniform(0, 360))
        s, a = np.sin(np.radians(theta)), np.radians(phi)
        # Within one standard deviation of the middle of the lobe.
        x, y = (-0.7 * s + 0.1 + rng.uniform(-0.07, 0.07), 0.25 * s + rng.uniform(-0.07, 0.07))
        ux, uy = x * np.cos(a) - y * np.sin(a), x * np.sin(a) + y * np.cos(a)
        light = [float(s * np.cos(a)), float(s * np.sin(a)), float(np.cos(np.radians(theta)))]
        pairs.append([light, [float(ux), float(uy), -float(np.sqrt(1 - ux * ux - uy * uy))]])
        true.append(float(chiral.evaluate(FRONT, theta, phi, ux, uy)))
    script = [sys.executable, "-c", RENDER, str(folder), json.dumps(ANGLES), json.dumps(pairs)]
    done = subprocess.run(script, capture_output=True, text=True, check=True)
    found = json.loads(done.stdout.splitlines()[-1])
    tau = chiral.direct_hemispherical(FRONT, np.array(ANGLES))
    np.testing.assert_allclose(found["dome"], tau, rtol=0.01)
    np.testing.assert_allclose(found["sun"], tau, rtol=0.01)
    np.testing.assert_allclose(found["pairs"], true, rtol=0.05)
