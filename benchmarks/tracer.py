"""Speed and agreement of the slab tracer against its peers, on one pane and in one run.

    python benchmarks/tracer.py [FOLDER] [--parts threads,model,speed,...] [-o OUT.md]

FOLDER holds the prototype: `slab_tracer.py` and `height_maps.py` (default: ../shared/prototype beside
the repository). Every part prints a table in Markdown. Times are CPU seconds of one thread unless a table
says otherwise, ratios are of one run, and means over incident angles geometric.

threads   two threads against two processes of one thread (wall time; wants a calm machine)
model     Model C from both sides to a noise of 3 % per direction (wall time, all threads; a calm machine)
speed     thousand paths per second, s and p averaged, against the prototype
spectra   another absorption spectrum on stored paths: colour of each direction (bar 1 s)
options   what polarisation, bubbles and absorption cost
radiance  noise times time in 64 x 64 bins against rfluxmtx on an array of tiles, with Radiance's R + T
mitsuba   the same paths in Mitsuba, where that is installed with a libLLVM
embree    tau and 64 x 64 bins against Embree on the same mesh
"""

from __future__ import annotations

import argparse
import os
import platform
import resource
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from itertools import chain
from pathlib import Path

import numba
import numpy as np

from specularia.glass import BubbleKind, Face, Medium, Slab, trace
from specularia.glass.effort import REPLICATES, Effort
from specularia.glass.tally import Bins, Tally
from specularia.glass.trace import fill
from specularia.provenance import versions

ROOT = Path(__file__).resolve().parents[1]
ANGLES = (0.0, 40.0, 60.0, 82.5)
PATHS = 320_000
RUNS = 5
Lines = Iterator[str]


def pane(n: int = 512, thickness_mm: float | None = None) -> Slab:
    """The pane that the prototype was measured on."""
    import height_maps

    top, bottom = height_maps.make_pair(n)
    pitch = height_maps.PITCH
    # The prototype gives z of the lower face; a map of it is seen from below, with x the other way.
    between = (height_maps.THICK + float(top.mean()) - float(bottom.mean())) / 1e3
    return Slab(
        thickness_mm=thickness_mm or between,
        front=Face(top, pitch, pitch),
        back=Face(-np.roll(bottom[:, ::-1], 1, axis=1), pitch, pitch),
    )


def with_(slab: Slab, **changed: object) -> Slab:
    """The pane with some of it changed, and its geometry made."""
    from dataclasses import replace

    out = replace(slab, **changed)  # type: ignore[arg-type]
    trace(out, theta_deg=[0.0], paths=32)
    return out


def mean(values: object) -> float:
    """Geometric mean."""
    return float(np.exp(np.mean(np.log(np.asarray(values, float)))))


def cpu(work: Callable[[], object]) -> float:
    """CPU seconds of this process."""
    start = time.process_time()
    work()
    return time.process_time() - start


def speed() -> Lines:
    """Against the prototype."""
    import height_maps
    import slab_tracer

    slab = with_(pane())
    peer = slab_tracer.build(*height_maps.make_pair(512))
    slab_tracer.trace(peer, [slab_tracer.inc(0.0)], 32, ns=1)
    yield "| theta | prototype, kpaths/s | ours, kpaths/s | ratio | prototype tau | our tau |"
    yield "|---|---|---|---|---|---|"
    ratios = []
    for theta in ANGLES:
        seconds = np.empty((RUNS, 2))
        for run in range(RUNS):
            start = time.process_time()
            _, peer_tau = slab_tracer.trace(peer, [slab_tracer.inc(theta)], PATHS, ns=1, seed=run + 1)
            seconds[run, 0] = time.process_time() - start
            start = time.process_time()
            found = trace(slab, theta_deg=[theta], paths=PATHS, seed=run, polarised=False)
            seconds[run, 1] = time.process_time() - start
        t = np.median(seconds, axis=0)
        ratios.append(t[0] / t[1])
        rates = PATHS / t / 1e3
        yield (
            f"| {theta:g} | {rates[0]:.0f} | {rates[1]:.0f} | {ratios[-1]:.2f} | {peer_tau[0, 1]:.4f} "
            f"| {found.tau[0]:.4f} |"
        )
    yield f"| mean | | | **{mean(ratios):.2f}** (bar 1.0, aim 1.5) | | |"


def options() -> Lines:
    """Costs of polarisation, bubbles and absorption."""
    slab = with_(pane())
    # 10 bubbles over each cm2 of a pane of 3 mm.
    bubbly = with_(slab, bubble_kinds=(BubbleKind(per_cm3=10.0 / 0.3, median_mm=0.2, sigma=0.4),))
    yellow = with_(slab, medium=Medium(absorption_per_mm=0.07))
    cases = (
        ("plain", slab, False),
        ("polarised", slab, True),
        ("bubbles", bubbly, False),
        ("absorption", yellow, False),
    )
    seconds = np.empty((len(cases), len(ANGLES), RUNS))
    for run in range(RUNS):
        for k, theta in enumerate(ANGLES):
            for c, (_, case, polarised) in enumerate(cases):
                seconds[c, k, run] = cpu(
                    lambda s=case, t=theta, p=polarised, r=run: trace(  # type: ignore[misc]
                        s, theta_deg=[t], paths=PATHS // 2, seed=r, polarised=p
                    )
                )
    t = np.median(seconds, axis=2)
    yield "| | time over plain | bar |"
    yield "|---|---|---|"
    for c, bar in ((1, 1.5), (2, 1.3), (3, 1.1)):
        yield f"| {cases[c][0]} | **{mean(t[c] / t[0]):.2f}** | {bar} |"


def spectra() -> Lines:
    """Another absorption spectrum on stored paths."""
    from specularia.glass import GLASSES, colouring, trace_paths
    from specularia.glass.colour import lab
    from specularia.glass.model import NODES_DEG

    slab, each = with_(pane()), 100_000
    stored = [trace_paths(slab, theta_deg=t, phi_deg=None, paths=each, clear=True) for t in NODES_DEG]
    yield f"{len(stored)} incident angles of {each} paths each, stored; X, Y, Z and L*, a*, b* at every angle"
    yield ""
    yield "| glass | CPU seconds | L*, a*, b* at 0 |"
    yield "|---|---|---|"
    colouring(Medium())
    for name, kind in GLASSES.items():
        seconds = []
        for _ in range(RUNS):
            start = time.process_time()
            how = colouring(Medium(absorption_per_mm=kind.spectrum()))
            xyz = []
            for paths in stored:
                through = paths.transmitted
                way, weight = paths.glass_length_mm[through], paths.weight[through]
                xyz.append(how.quick_share(way) @ weight / len(paths))
            colour = lab(xyz)
            seconds.append(time.process_time() - start)
        shown = ", ".join(f"{v:.1f}" for v in colour[0])
        yield f"| {name} | **{np.median(seconds):.2f}** | {shown} |"


def radiance() -> Lines:
    """Noise times time in bins against rfluxmtx."""
    from specularia.glass import peer

    slab, batches = with_(pane()), 16
    yield "| theta | T: ratio | R: ratio | our T | Radiance T | Radiance R + T |"
    yield "|---|---|---|---|---|---|"
    ratios = []
    with peer.scene(slab, array_mm=62.0) as built:
        peer._receivers(built.folder, "-sc64", "+sc64")
        for theta in ANGLES:
            sine, rng = np.sin(np.radians(theta)), np.random.default_rng(1)
            d = np.array([sine, 0.0, np.sqrt(1.0 - sine * sine)])
            spent = []
            for each in (10, 600):
                # Loading the meshes takes seconds: the time of tracing is the difference of two runs.
                place = np.empty((each * batches, 3))
                place[:, :2] = rng.random((len(place), 2)) * built.width_um
                place[:, 2] = built.low_um
                rays = np.hstack([place - d, np.broadcast_to(d, place.shape)])
                before = resource.getrusage(resource.RUSAGE_CHILDREN)
                peer._flux(built.folder, rays, each, batches)
                after = resource.getrusage(resource.RUSAGE_CHILDREN)
                spent.append(after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime)
            bins = [peer._matrix(built.folder / name) for name in peer._OUTPUTS]
            theirs = [b.var(axis=0, ddof=1).sum() / batches * (spent[1] - spent[0]) for b in bins]
            tally, start = Tally(Bins(theta)), time.process_time()
            fill(tally, slab, effort=Effort(PATHS), seed=1, theta_deg=theta, phi_deg=0.0, polarised=False)
            seconds = time.process_time() - start
            assert tally.bins is not None
            cells = tally.bins.base.reshape(2, REPLICATES, 64, 2, 64, 2).sum(axis=(3, 5)) / tally.paths
            ours = REPLICATES * cells.var(axis=1, ddof=1).sum(axis=(1, 2)) * seconds
            ratios.append([theirs[k] / ours[k] for k in (0, 1)])
            t, r = (b.sum(axis=1).mean() for b in bins)
            yield (
                f"| {theta:g} | {ratios[-1][0]:.0f} | {ratios[-1][1]:.0f} | {tally.shares[0][0]:.4f} "
                f"| {t:.4f} | {t + r:.4f} |"
            )
    through, back = (mean(v) for v in zip(*ratios))
    yield f"| mean | **{through:.0f}** (bar 75, aim 150) | **{back:.0f}** (bar 60, aim 120) | | | |"


def mitsuba() -> Lines:
    """The same pane in Mitsuba, variant llvm, lanes refilled; each run in a process of its own."""
    import json

    import slab_in_mitsuba

    here = Path(slab_in_mitsuba.__file__)
    yield "| maps | theta | Mitsuba, kpaths/s | ours, kpaths/s | ratio | Mitsuba's tau | our tau |"
    yield "|---|---|---|---|---|---|---|"
    sums = []
    for size, paths in ((512, 320_000), (2048, 160_000)):
        found = []
        for engine in ("mitsuba", "specularia"):
            words = [sys.executable, str(here), sys.path[0], engine, str(size), str(paths)]
            ran = subprocess.run(
                words, capture_output=True, text=True, env={**os.environ, "NUMBA_NUM_THREADS": "1"}
            )
            if ran.returncode:
                yield f"Not measured at {size}: {engine} ended with {ran.returncode}."
                return
            found.append(json.loads(ran.stdout.splitlines()[-1]))
            if "reason" in found[-1]:
                yield f"Not measured: {found[-1]['reason']}."
                return
        theirs, ours = found
        rates = [f["paths"] / np.array(f["seconds"]) / 1e3 for f in found]
        for k, theta in enumerate(ANGLES):
            yield (
                f"| {size} x {size} | {theta:g} | {rates[0][k]:.0f} | {rates[1][k]:.0f} "
                f"| {rates[1][k] / rates[0][k]:.2f} | {theirs['tau'][k]:.4f} | {ours['tau'][k]:.4f} |"
            )
        sums.append(
            f"{size} x {size}: **{mean(rates[1] / rates[0]):.2f}** times its speed (bar 2), "
            f"{ours['memory_mb']:.0f} MB against {theirs['memory_mb']:.0f} MB"
            + (f" (**{ours['memory_mb'] / theirs['memory_mb']:.2f}**, bar 0.25)." if size > 512 else ".")
        )
    yield ""
    yield from sums


_RATE = """
import sys, time; sys.path[:0] = [{folder!r}, {here!r}]
import tracer
slab = tracer.with_(tracer.pane())
for line in sys.stdin:
    wall, used = time.perf_counter(), time.process_time()
    for theta in tracer.ANGLES: tracer.trace(slab, theta_deg=[theta], paths=int(line))
    print(time.perf_counter() - wall, time.process_time() - used, flush=True)
"""


def threads() -> Lines:
    """Two threads against two processes."""
    paths, rounds = 150_000, 9
    text = _RATE.format(folder=sys.path[0], here=str(Path(__file__).parent))

    def start(count: int) -> subprocess.Popen[str]:
        return subprocess.Popen(
            [sys.executable, "-c", text],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
            env={**os.environ, "NUMBA_NUM_THREADS": str(count)},
        )

    def together(running: list[subprocess.Popen[str]], each: int) -> np.ndarray:
        """Wall time until all are done, and the CPU time of all."""
        for r in running:
            assert r.stdin is not None
            r.stdin.write(f"{each}\n")
            r.stdin.flush()
        answers = np.array([[float(v) for v in r.stdout.readline().split()] for r in running if r.stdout])
        return np.array([answers[:, 0].max(), answers[:, 1].sum()])

    single, double = [start(1), start(1)], [start(2)]
    together([*single, *double], 1000)
    shares = []
    for _ in range(rounds):
        apart = together(single, paths)
        shares.append(apart / together(double, 2 * paths))
    for r in (*single, *double):
        r.communicate()
    yield "| two threads over two processes, paths per second | bar |"
    yield "|---|---|"
    wall, used = (100 * np.array(shares)).T
    yield f"| of wall time: **{np.median(wall):.0f} %** (of {', '.join(f'{s:.0f}' for s in wall)}) | 95 % |"
    yield f"| of CPU time: {np.median(used):.0f} % (of {', '.join(f'{s:.0f}' for s in used)}) | |"


def embree() -> Lines:
    """Against Embree's triangles and Jones vectors in space."""
    sys.path.insert(0, str(ROOT / "tests" / "glass"))
    from glass_reference import reliefs, transmission_of_relief

    from specularia.bsdf.tabulated import base_index

    slab = with_(pane())
    meshes = reliefs(slab)
    batch, wanted = 400_000, 1.95e-4
    yield "| theta | our tau | se | Embree's tau | se | difference / se | L1 of bins | noise | CPU, s |"
    yield "|---|---|---|---|---|---|---|---|---|"
    for theta in (0.0, 20.0, 40.0, 60.0, 82.5):
        start = time.process_time()
        taus, cells, square = [], np.zeros(64 * 64), np.zeros(64 * 64)
        while True:
            leaving: list[tuple[np.ndarray, np.ndarray]] = []
            tau, se, _ = transmission_of_relief(
                slab, theta_deg=theta, paths=batch, seed=3 + len(taus), polarised=True, faces=meshes,
                leaving=leaving,
            )  # fmt: skip
            taus.append(tau)
            d, w = (np.concatenate(v) for v in zip(*leaving))
            a, b = base_index(d[:, 0], d[:, 1], 64)
            cells += np.bincount(a * 64 + b, w, minlength=64 * 64)
            square += np.bincount(a * 64 + b, w * w, minlength=64 * 64)
            if se / np.sqrt(len(taus)) <= wanted:
                break
        paths = batch * len(taus)
        tau, se = float(np.mean(taus)), float(se / np.sqrt(len(taus)))
        tally = Tally(Bins(theta))
        fill(tally, slab, effort=Effort(6_400_000), seed=1, theta_deg=theta, phi_deg=0.0)
        share, error = (v[0] for v in tally.shares)
        assert tally.bins is not None
        each = tally.bins.base[0].reshape(REPLICATES, 64, 2, 64, 2).sum(axis=(2, 4)).reshape(REPLICATES, -1)
        ours = each.sum(axis=0) / tally.paths
        # The mean modulus of the error: that of a normal number, or twice the light of a cell, if less. Light
        # in a cell that got no path yet may be that of our own paths.
        spread = np.sqrt(square / paths**2 + REPLICATES * each.var(axis=0, ddof=1) / tally.paths**2)
        noise = np.minimum(np.sqrt(2 / np.pi) * spread, 2 * np.maximum(ours, cells / paths)).sum() / tau
        distance = np.abs(ours - cells / paths).sum() / tau
        yield (
            f"| {theta:g} | {share:.5f} | {error:.5f} | {tau:.5f} | {se:.5f} "
            f"| {(share - tau) / np.hypot(error, se):+.1f} | {distance:.4f} | {noise:.4f} "
            f"| {time.process_time() - start:.0f} |"
        )


def model() -> Lines:
    """Model C to a wanted noise."""
    from specularia.glass.model import traced_model

    slab = with_(pane(1024))
    start, used = time.perf_counter(), time.process_time()
    found = traced_model(slab, paths=50_000_000, target_error=0.03, seed=1)
    wall, used = time.perf_counter() - start, time.process_time() - used
    front, back = found.balances["front"], found.balances["back"]
    yield "| paths, both sides | largest noise | wall time, s | CPU, s | aim |"
    yield "|---|---|---|---|---|"
    noise = max(found.noise["transmission_front"].max(), found.noise["transmission_back"].max())
    total = (front.paths.sum() + back.paths.sum()) / 1e6
    yield f"| {total:.0f} million | {noise:.4f} | **{wall:.0f}** | {used:.0f} | 300 s on two cores |"


PARTS = {f.__name__: f for f in (threads, model, speed, spectra, options, radiance, mitsuba, embree)}


def main() -> int:
    """Measure and print; 0 also where there is no prototype."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("folder", nargs="?", type=Path, default=ROOT.parent / "shared" / "prototype")
    parser.add_argument("--parts", default=",".join(PARTS))
    parser.add_argument("-o", "--output", type=Path)
    given = parser.parse_args()
    if unknown := sorted(set(given.parts.split(",")) - set(PARTS)):
        parser.error(f"no part {', '.join(unknown)}; there are {', '.join(PARTS)}")
    if not (given.folder / "slab_tracer.py").is_file():
        print(f"no prototype in {given.folder}; nothing to compare with")
        return 0
    sys.path.insert(0, str(given.folder))
    lines = [
        "# The slab tracer and its peers",
        "",
        f"Measured {time.strftime('%Y-%m-%d')} by `benchmarks/tracer.py` on {os.cpu_count()} cores "
        f"({platform.machine()}), load {os.getloadavg()[0]:.1f}; "
        + ", ".join(f"{k} {v}" for k, v in versions().items())
        + ". The pane is synthetic.",
    ]
    print("\n".join(lines))
    for name in given.parts.split(","):
        numba.set_num_threads(numba.config.NUMBA_NUM_THREADS if name == "model" else 1)
        head = ("", f"## {name}: {(PARTS[name].__doc__ or '').strip()}", "")
        for line in chain(head, PARTS[name]()):
            lines.append(line)
            print(line, flush=True)
    if given.output is not None:
        given.output.write_text("\n".join(lines) + "\n")
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
