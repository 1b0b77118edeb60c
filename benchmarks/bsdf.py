"""Speed of BSDF look-up and of tree building against Radiance, both in one run.

    python benchmarks/bsdf.py

Prints values per second of `evaluate` for a million random pairs of directions against a loop over
`pyradiance.bsdf.query` (on fewer pairs, scaled), for trees at 2^6 and 2^7 and a Klems matrix; and the seconds
that two sides of an analytic model take as trees at 2^6 and 2^7 against `bsdf2ttree` with the same function,
both culled by 90 %. The best of several runs that take turns.
"""

from __future__ import annotations

import os
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from specularia import bsdf, radiance
from specularia.bsdf import build_tree, klems, xml_write
from specularia.bsdf.cells import grid
from specularia.bsdf.xml_model import KlemsPart
from specularia.conventions import direction_angles, direction_cosines, to_radiance

PAIRS, PEER_PAIRS, RUNS, BUILDS = 1_000_000, 10_000, 15, 2
WIDTH, TAU = 0.1, 0.6
CAL = f"""
lobe(ix,iy,iz,ox,oy,oz) : {TAU / (2 * np.pi * WIDTH**2)}
    * exp(-((ox+ix)*(ox+ix) + (oy+iy)*(oy+iy)) / {2 * WIDTH**2});
"""


@dataclass
class Gauss:
    """The function above as a model: a lobe around the undeflected direction, the same on both sides."""

    band: str = "Visible"
    sides: tuple[str, ...] = ("transmission_front", "transmission_back")

    def __post_init__(self) -> None:
        x, y = grid(128)
        self.points = bsdf.Quadrature(x.ravel(), y.ravel(), np.full(x.size, np.pi / x.size))

    def evaluate(self, side: str, theta_i_deg: Any, phi_i_deg: Any, ux: Any, uy: Any) -> Any:
        s, phi = np.sin(np.radians(theta_i_deg)), np.radians(phi_i_deg)
        x, y = ux + s * np.cos(phi), uy + s * np.sin(phi)
        return TAU / (2 * np.pi * WIDTH**2) * np.exp(-(x * x + y * y) / (2 * WIDTH**2))

    def direct_hemispherical(self, side: str, theta_i_deg: Any, phi_i_deg: Any = 0.0) -> Any:
        theta, q = np.asarray(theta_i_deg, float), self.points
        return self.evaluate(side, theta[..., None], 0.0, q.ux, q.uy) @ q.weight

    def quadrature(self, side: str, theta_i_deg: float, phi_i_deg: float = 0.0) -> bsdf.Quadrature:
        return self.points


# Radiance's library still points to what Python frees.
_KEPT: list[Any] = []


def look_up(path: Path, side: str) -> None:
    """Print values per second of both, on one file."""
    from pyradiance import bsdf as library

    rng = np.random.default_rng(0)
    theta = np.degrees(np.arcsin(np.sqrt(rng.uniform(0, 0.99, PAIRS))))
    phi, turn = rng.uniform(0, 360, PAIRS), rng.uniform(0, 2 * np.pi, PAIRS)
    r = np.sqrt(rng.uniform(0, 0.99, PAIRS))
    ux, uy = r * np.cos(turn), r * np.sin(turn)
    model, peer = bsdf.read(path), library.load_file(str(path))
    _KEPT.append(peer)
    few = slice(0, PEER_PAIRS)
    into = direction_angles(*to_radiance(*direction_cosines(theta[few], phi[few])))
    out = direction_angles(*to_radiance(ux[few], uy[few], -np.sqrt(1 - ux[few] ** 2 - uy[few] ** 2)))
    pairs = list(zip(*(v.tolist() for v in (*into, *out))))
    model.evaluate(side, theta, phi, ux, uy)
    seconds = np.empty((RUNS, 2))
    for run in range(RUNS):
        start = time.perf_counter()
        found = model.evaluate(side, theta, phi, ux, uy)
        middle = time.perf_counter()
        theirs = [library.query(peer, *p)[1] for p in pairs]
        seconds[run] = (middle - start) / PAIRS, (time.perf_counter() - middle) / PEER_PAIRS
    mine, other = 1.0 / seconds.min(axis=0)
    # Radiance's query multiplies what is stored by up to 1 +- 3e-4.
    alike = np.mean(np.isclose(found[few], theirs, rtol=4e-4, atol=1e-6))
    print(
        f"{path.stem:8s} ours {mine / 1e6:7.1f} million/s   query {other / 1e6:6.3f} million/s   "
        f"ratio {mine / other:6.0f}   equal within the query's ripple: {100 * alike:.2f} %"
    )


def build(folder: Path, resolution: int) -> None:
    """Print seconds of both for two sides of the same function, and what the tree keeps."""
    model = Gauss()
    (folder / "lobe.cal").write_text(CAL)
    command = ["bsdf2ttree", "-t3", "-g", str(resolution), "-t", "90", "+forward", "-b", "-f", "lobe.cal"]
    seconds = np.empty((BUILDS, 2))
    for run in range(BUILDS):
        start = time.perf_counter()
        sides = build_tree.build_sides(model, model.sides, resolution=resolution, cull=90.0)
        built = [tree for _, tree in sides]
        middle = time.perf_counter()
        radiance.run([*command, "lobe"], cwd=folder)
        seconds[run] = middle - start, time.perf_counter() - middle
    mine, other = seconds.min(axis=0)
    worst = max(float(np.max(np.abs(b.tau_tree / b.tau_model - 1))) for b in built)
    print(
        f"2^{resolution}      ours {mine:6.2f} s   bsdf2ttree {other:6.2f} s   ratio {other / mine:5.2f}   "
        f"largest change of a bin's tau {100 * worst:.3f} %"
    )


def main() -> int:
    """Measure and print."""
    print(f"{os.cpu_count()} cores, load {os.getloadavg()[0]:.1f}")
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        for resolution in (6, 7):
            bsdf.write(Gauss(), folder / f"tree{resolution}.xml", resolution=resolution)
            look_up(folder / f"tree{resolution}.xml", "transmission_front")
        basis = klems.BASES[0]
        matrix = np.random.default_rng(1).uniform(0.0, 0.3, (basis.patches, basis.patches))
        part = KlemsPart(matrix=matrix, incident=basis, outgoing=basis)
        text = xml_write.document({"transmission_front": part, "transmission_back": part}, band="Visible")
        (folder / "klems.xml").write_text(text)
        look_up(folder / "klems.xml", "transmission_front")
        for resolution in (6, 7):
            build(folder, resolution)
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
