"""Speed of the slab tracer against an independent one, both on the same pane and in the same run.

    python benchmarks/tracer.py [FOLDER]

FOLDER holds the peer: `slab_tracer.py` and `height_maps.py` (default: ../shared/prototype beside the
repository). Prints, for each incident angle, thousand paths per CPU second of both, the ratio with s and p
averaged at each interface (as the peer does) and with polarisation kept, and the ratio of noise times time:
how much longer the peer would have to run for the same standard error of tau.
"""

from __future__ import annotations

import sys
import time
from pathlib import Path

import numpy as np

from specularia.glass import Face, Slab, trace

ANGLES = (0.0, 40.0, 60.0, 82.5)
PATHS = 320_000
RUNS = 7


def main(folder: Path) -> int:
    """Measure and print; 0 also where there is no peer."""
    if not (folder / "slab_tracer.py").is_file():
        print(f"no peer in {folder}; nothing to compare with")
        return 0
    sys.path.insert(0, str(folder))
    import height_maps
    import slab_tracer

    top, bottom = height_maps.make_pair(512)
    peer = slab_tracer.build(top, bottom)
    pitch = height_maps.PITCH
    # The peer gives z of the lower face; a map of it is seen from below, with x the other way.
    slab = Slab(
        thickness_mm=(height_maps.THICK + float(top.mean()) - float(bottom.mean())) / 1e3,
        front=Face(top, pitch, pitch),
        back=Face(-np.roll(bottom[:, ::-1], 1, axis=1), pitch, pitch),
    )
    slab_tracer.trace(peer, [slab_tracer.inc(0.0)], 32, ns=1)
    trace(slab, theta_deg=[0.0], paths=32)
    print(
        "theta   peer kpaths/s   ours kpaths/s   ratio   ratio polarised   noise x time   tau peer   tau ours"
    )
    for theta in ANGLES:
        seconds, variance = np.empty((RUNS, 3)), np.empty(RUNS)
        for run in range(RUNS):
            start = time.process_time()
            _, peer_tau = slab_tracer.trace(peer, [slab_tracer.inc(theta)], PATHS, ns=1, seed=run + 1)
            seconds[run, 0] = time.process_time() - start
            for k, polarised in enumerate((False, True)):
                start = time.process_time()
                found = trace(slab, theta_deg=[theta], paths=PATHS, seed=run, polarised=polarised)
                seconds[run, k + 1] = time.process_time() - start
            variance[run] = found.tau_se[0] ** 2
        t = np.median(seconds, axis=0)
        tau = peer_tau[0, 1]
        noise = tau * (1.0 - tau) / PATHS / variance.mean()
        print(
            f"{theta:5g}   {PATHS / t[0] / 1e3:13.0f}   {PATHS / t[1] / 1e3:13.0f}   {t[0] / t[1]:5.2f}   "
            f"{t[0] / t[2]:15.2f}   {noise * t[0] / t[2]:12.2f}   {tau:8.4f}   {found.tau[0]:8.4f}"
        )
    return 0


if __name__ == "__main__":
    default = Path(__file__).resolve().parents[2] / "shared" / "prototype"
    raise SystemExit(main(Path(sys.argv[1]) if len(sys.argv) > 1 else default))
