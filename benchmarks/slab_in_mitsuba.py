"""The slab in Mitsuba 3 (variant llvm): one period of both faces as meshes, lanes refilled as paths end.

    python benchmarks/slab_in_mitsuba.py FOLDER ENGINE SIZE PATHS

traces the pane of `tracer.py` with maps of SIZE x SIZE pixels in ENGINE, "mitsuba" or "specularia". It prints
JSON: CPU seconds and tau at each angle, and the largest memory in MB. Mitsuba needs a libLLVM (version 19
is known to work), which DRJIT_LIBLLVM_PATH may name.
"""

from __future__ import annotations

import json
import resource
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np

ANGLES = (0.0, 40.0, 60.0, 82.5)
LANES = 8192
INDEX = 1.52
GAP_UM = 0.5
"""Beyond the relief, where paths start and end."""

EPSILON_UM = 2e-3
"""Rays start so far off the surface they come from."""


def reason_missing() -> str | None:
    """Why Mitsuba cannot be used here, or None."""
    try:
        import drjit
        import mitsuba
    except ImportError:
        return "Mitsuba is not installed here"
    variant = next((v for v in mitsuba.variants() if v == "llvm_ad_rgb"), None)
    if variant is None:
        return "Mitsuba has no variant llvm_ad_rgb here"
    try:
        mitsuba.set_variant(variant)
        drjit.eval(drjit.arange(mitsuba.Float, 4))
    except Exception as error:  # whatever the loader of libLLVM raises
        return f"Mitsuba finds no libLLVM that it can use ({type(error).__name__})"
    return None


def _mesh(mi: Any, name: str, z: np.ndarray, pitch: float) -> Any:
    """One period of a relief; cells are cut along 00-11."""
    n = z.shape[0]
    closed = np.pad(z, ((0, 1), (0, 1)), mode="wrap")
    y, x = np.mgrid[: n + 1, : n + 1].astype(np.float32) * np.float32(pitch)
    vertices = np.stack([x, y, closed.astype(np.float32)], axis=-1).reshape(-1, 3)
    at = (np.arange(n)[:, None] * (n + 1) + np.arange(n)).astype(np.uint32)
    a, b, c, d = at, at + 1, at + n + 2, at + n + 1
    faces = np.concatenate([np.stack(t, axis=-1).reshape(-1, 3) for t in ((a, b, c), (a, c, d))])
    mesh = mi.Mesh(name, len(vertices), len(faces))
    values = mi.traverse(mesh)
    values["vertex_positions"] = vertices.ravel()
    values["faces"] = faces.ravel()
    values.update()
    return mesh


def traced(mi: Any, dr: Any, scene: Any, box: dict[str, float], theta: float, paths: int, seed: int) -> Any:
    """Counts of paths (reflected, transmitted, lost), one entry for each lane."""
    side = box["side"]
    sine = float(np.sin(np.radians(theta)))
    down = mi.Vector3f(-sine, 0.0, -float(np.cos(np.radians(theta))))
    each = paths // LANES

    rng = mi.PCG32(size=LANES, initstate=seed)
    number = dr.zeros(mi.UInt32, LANES)
    reflected = dr.zeros(mi.UInt32, LANES)
    transmitted = dr.zeros(mi.UInt32, LANES)
    lost = dr.zeros(mi.UInt32, LANES)
    o = mi.Point3f(rng.next_float32() * side, rng.next_float32() * side, box["high_top"])
    d = dr.zeros(mi.Vector3f, LANES) + down
    top = dr.full(mi.Mask, True, LANES)
    glass = dr.full(mi.Mask, False, LANES)

    def going(rng, number, reflected, transmitted, lost, o, d, top, glass):  # type: ignore[no-untyped-def]
        return number < each

    def step(rng, number, reflected, transmitted, lost, o, d, top, glass):  # type: ignore[no-untyped-def]
        low = dr.select(top, box["low_top"], box["low_bottom"])
        high = dr.select(top, box["high_top"], box["high_bottom"])
        t_x = dr.select(d.x > 0, side - o.x, o.x) / dr.maximum(dr.abs(d.x), 1e-20)
        t_y = dr.select(d.y > 0, side - o.y, o.y) / dr.maximum(dr.abs(d.y), 1e-20)
        t_z = dr.select(d.z > 0, high - o.z, o.z - low) / dr.maximum(dr.abs(d.z), 1e-20)
        across = dr.maximum(dr.minimum(t_x, t_y), 0.0)
        t_z = dr.maximum(t_z, 0.0)
        ray = mi.Ray3f(o, d)
        ray.maxt = dr.minimum(across, t_z)
        met = scene.ray_intersect(ray, mi.RayFlags.Minimal, False)
        hit = met.is_valid()
        # An interface, by chance, s and p averaged.
        n = mi.Normal3f(dr.select(dr.dot(met.n, d) > 0, -met.n, met.n))
        c = -dr.dot(n, d)
        ratio = dr.select(glass, INDEX, 1.0 / INDEX)
        k = 1.0 - ratio * ratio * (1.0 - c * c)
        cos_t = dr.sqrt(dr.maximum(k, 0.0))
        rs = (ratio * c - cos_t) / (ratio * c + cos_t)
        rp = (c - ratio * cos_t) / (c + ratio * cos_t)
        share = dr.select(k > 0, 0.5 * (rs * rs + rp * rp), 1.0)
        crossed = hit & (rng.next_float32() >= share)
        bent = dr.normalize(ratio * d + (ratio * c - cos_t) * n)
        mirrored = dr.normalize(d + 2.0 * c * n)
        off = dr.select(crossed, -EPSILON_UM, EPSILON_UM) * mi.Vector3f(n)
        # Out of the shell, or over the border of the period.
        ends = ~hit & (t_z <= across)
        border = ~hit & ~ends
        moved = o + d * ray.maxt
        moved.x = dr.select(border & (t_x <= t_y), dr.select(d.x > 0, 0.0, side), moved.x)
        moved.y = dr.select(border & (t_y < t_x), dr.select(d.y > 0, 0.0, side), moved.y)
        leaves = ends & ~glass & (top == (d.z > 0))
        fails = ends & (glass == (top == (d.z > 0)))
        jumps = ends & glass & ~fails
        level = dr.select(top, box["high_bottom"], box["low_top"])
        way = (level - moved.z) / dr.select(d.z == 0, 1e-20, d.z)
        far = moved + d * way
        far.x -= dr.floor(far.x / side) * side
        far.y -= dr.floor(far.y / side) * side
        far.z = level
        o = mi.Point3f(dr.select(hit, met.p + off, dr.select(jumps, far, moved)))
        d = dr.select(crossed, bent, dr.select(hit, mirrored, d))
        glass = glass ^ crossed
        top = top ^ jumps
        # A new path on this lane.
        done = leaves | fails
        reflected += dr.select(leaves & top, mi.UInt32(1), 0)
        transmitted += dr.select(leaves & ~top, mi.UInt32(1), 0)
        lost += dr.select(fails, mi.UInt32(1), 0)
        number += dr.select(done, mi.UInt32(1), 0)
        start = mi.Point3f(rng.next_float32() * side, rng.next_float32() * side, box["high_top"])
        o = mi.Point3f(dr.select(done, start, o))
        d = mi.Vector3f(dr.select(done, down, d))
        top = top | done
        glass = glass & ~done
        return rng, number, reflected, transmitted, lost, o, d, top, glass

    state = dr.while_loop(
        (rng, number, reflected, transmitted, lost, o, d, top, glass), going, step, label="slab"
    )
    dr.eval(state)
    return [int(np.sum(np.array(v, dtype=np.int64))) for v in state[2:5]]


def in_mitsuba(folder: Path, size: int, paths: int) -> dict[str, Any]:
    """CPU seconds and tau at each angle; the first run of each, which compiles, does not count."""
    sys.path.insert(0, str(folder))
    import height_maps

    reason = reason_missing()
    if reason:
        return {"reason": reason}
    import drjit as dr
    import mitsuba as mi

    dr.set_thread_count(1)
    top, bottom = height_maps.make_pair(size)
    top, pitch = top + height_maps.THICK, height_maps.PITCH
    scene = mi.load_dict(
        {
            "type": "scene",
            "top": _mesh(mi, "top", top, pitch),
            "bottom": _mesh(mi, "bottom", bottom, pitch),
        }
    )
    box = {
        "side": size * pitch,
        "low_top": float(top.min()) - GAP_UM,
        "high_top": float(top.max()) + GAP_UM,
        "low_bottom": float(bottom.min()) - GAP_UM,
        "high_bottom": float(bottom.max()) + GAP_UM,
    }
    paths = paths // LANES * LANES
    seconds, tau, lost = [], [], []
    for theta in ANGLES:
        traced(mi, dr, scene, box, theta, LANES, 1)
        start = time.process_time()
        counts = traced(mi, dr, scene, box, theta, paths, 2)
        seconds.append(time.process_time() - start)
        tau.append(counts[1] / paths)
        lost.append(counts[2])
    return {"paths": paths, "seconds": seconds, "tau": tau, "lost": lost}


def in_specularia(folder: Path, size: int, paths: int) -> dict[str, Any]:
    """The same in our tracer."""
    sys.path[:0] = [str(folder), str(Path(__file__).parent)]
    import tracer

    slab = tracer.with_(tracer.pane(size))
    seconds, tau = [], []
    for theta in ANGLES:
        start = time.process_time()
        found = tracer.trace(slab, theta_deg=[theta], paths=paths, polarised=False)
        seconds.append(time.process_time() - start)
        tau.append(float(found.tau[0]))
    return {"paths": int(found.paths[0]), "seconds": seconds, "tau": tau}


if __name__ == "__main__":
    engine = {"mitsuba": in_mitsuba, "specularia": in_specularia}[sys.argv[2]]
    answer = engine(Path(sys.argv[1]), int(sys.argv[3]), int(sys.argv[4]))
    answer["memory_mb"] = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    print(json.dumps(answer))
