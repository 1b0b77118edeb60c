"""Trees of rank 4 through the renderer: transmission under a uniform dome and under a sun.

    python validation/trees_through_rtrace.py [MODEL.nc ...]

For analytic lobes about the undeflected direction (standard deviation 0.05, 0.10 and 0.20 in direction
cosines) and for any models named, trees of rank 4 at 2^6 and 2^7 are written and loaded by rtrace. What
leaves the pane is summed and compared with the model's direct-hemispherical transmission averaged over the
incident cell. The result goes to trees_through_rtrace.md beside this file. It takes
an hour on two cores.
"""

from __future__ import annotations

import datetime
import sys
import tempfile
import time
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from specularia import bsdf, radiance
from specularia.bsdf.build_rank4 import incident_tau
from specularia.bsdf.cells import grid
from specularia.bsdf.check_render import ANGLES, rendered_domes, rendered_sun_tau
from specularia.conventions import disk_to_square

PHI = 17.0
SIDES = ("transmission_front", "transmission_back")
HERE = Path(__file__).resolve()


@dataclass
class Lobe:
    """A Gaussian lobe in direction cosines about the undeflected direction, the same on both sides."""

    width: float
    tau: float = 0.6
    band: str = "Visible"
    sides: tuple[str, ...] = SIDES
    points: bsdf.Quadrature = field(init=False)

    def __post_init__(self) -> None:
        x, y = grid(128)
        self.points = bsdf.Quadrature(x.ravel(), y.ravel(), np.full(x.size, np.pi / x.size))

    def evaluate(self, side: str, theta_i_deg: Any, phi_i_deg: Any, ux: Any, uy: Any) -> Any:
        s, phi = np.sin(np.radians(theta_i_deg)), np.radians(phi_i_deg)
        x, y = ux + s * np.cos(phi), uy + s * np.sin(phi)
        return self.tau / (2 * np.pi * self.width**2) * np.exp(-(x * x + y * y) / (2 * self.width**2))

    def direct_hemispherical(self, side: str, theta_i_deg: Any, phi_i_deg: Any = 0.0) -> Any:
        theta = np.asarray(theta_i_deg, float)
        return self.evaluate(side, theta[..., None], 0.0, self.points.ux, self.points.uy) @ self.points.weight

    def quadrature(self, side: str, theta_i_deg: float, phi_i_deg: float = 0.0) -> bsdf.Quadrature:
        return self.points


def cell_tau(tau: Any, theta: float) -> Any:
    """The value of the cell that holds the direction, and of the next one where it lies on an edge."""
    n = tau.shape[0]
    s = np.sin(np.radians(theta)) * (1 + np.array([-1e-5, 1e-5]))
    a, b = disk_to_square(s * np.cos(np.radians(PHI)), -s * np.sin(np.radians(PHI)))
    i, j = (np.minimum((v * n).astype(int), n - 1) for v in (a, b))
    return np.unique(tau[i, j])


def off(seen: float, expected: Any) -> float:
    """Percent by which a value lies outside what was expected."""
    low, high = float(expected.min()), float(expected.max())
    return 100 * (seen / low - 1 if seen < low else seen / high - 1 if seen > high else 0.0)


def rows(name: str, model: Any, resolution: int, folder: Path) -> tuple[list[str], float]:
    """Lines of the table for one tree, and the largest deviation in percent."""
    path = folder / "tree.xml"
    start = time.process_time()
    written = bsdf.write(model, path, resolution=resolution, basis="tensor4")
    seconds = time.process_time() - start
    scene = "void BSDF p\n6 0 tree.xml 0 1 0 .\n0\n0\np ring r\n0\n0\n8 0 0 0 0 0 1 0 1\n"
    (folder / "load.rad").write_text(scene)
    (folder / "load.oct").write_bytes(radiance.run(["oconv", "load.rad"], cwd=folder))
    start = time.perf_counter()
    radiance.run(["rtrace", "-h", "load.oct"], data=b"0.5 0 1 0 0 -1\n", cwd=folder)
    loading = time.perf_counter() - start
    read = bsdf.read(path)
    lines, worst = [], 0.0
    for side in SIDES:
        built = written.trees[side]
        tau = incident_tau(model, side, resolution=resolution)
        at = [t if side == SIDES[0] else 180.0 - t for t in ANGLES]
        domes = rendered_domes(path, theta_deg=at, phi_deg=PHI)
        for theta, place, dome in zip(ANGLES, at, domes):
            sun, se = rendered_sun_tau(
                path, theta_deg=place, phi_deg=PHI, rays=40_000, rng=np.random.default_rng(1), model=read
            )
            expected = cell_tau(tau, theta)
            both = off(float(dome), expected), off(sun, expected)
            worst = max(worst, *map(abs, both))
            lines.append(
                f"| {name} | 2^{resolution} | {side[13:]} | {theta:g} | {expected.mean():.4f} "
                f"| {both[0]:+.2f} | {both[1]:+.2f} | {100 * se / sun:.2f} |"
            )
    size = path.stat().st_size / 1e6
    built = written.trees[SIDES[0]]
    print(f"{name} 2^{resolution}: worst {worst:.2f} %", flush=True)
    summary = (
        f"{name}, 2^{resolution}: {size:.1f} MB in all, {built.tree.values.size:,} values a side, "
        f"{100 * built.removed:.1f} % of the cells removed, L1 {100 * built.l1.mean():.1f} % (worst cell "
        f"{100 * built.l1.max():.1f} %), tau of a cell changed by {100 * change(built):.2f} % at most; "
        f"written in {seconds:.0f} CPU s, loaded by rtrace in {loading:.1f} s; worst deviation {worst:.2f} %."
    )
    return [*lines, summary], worst


def change(built: Any) -> float:
    """Largest relative change of a cell's tau by the reduction."""
    return float(
        np.max(np.abs(built.tau_tree / np.maximum(built.tau_model, 1e-3 * built.tau_model.max()) - 1))
    )


def main() -> int:
    """Measure and write the table."""
    models = [(f"lobe {w:g}", Lobe(w)) for w in (0.05, 0.10, 0.20)]
    models += [(Path(p).stem, bsdf.read(p)) for p in sys.argv[1:]]
    table, notes, worst = [], [], 0.0
    for resolution in (6, 7):
        for name, model in models:
            with tempfile.TemporaryDirectory() as folder:
                lines, this = rows(name, model, resolution, Path(folder))
            table += lines[:-1]
            notes.append(f"* {lines[-1]}")
            worst = max(worst, this)
            text = [
                "# Trees of rank 4 through rtrace",
                "",
                f"{datetime.date.today()}, `{HERE.name}`. Deviation in percent from the direct-hemispherical "
                "transmission of the model averaged over the incident cell that holds the direction "
                f"(azimuth {PHI:g} degrees); where it lies on the edge of two cells, as at 30 degrees, from "
                "the nearer of both. The last column is the standard error of the sun's value in percent.",
                "",
                "| model | tree | light on | theta | tau of the cell | dome | sun | se |",
                "|---|---|---|---|---|---|---|---|",
                *table,
                "",
                *notes,
                "",
                f"Worst of all: {worst:.2f} %.",
                "",
            ]
            HERE.with_suffix(".md").write_text("\n".join(text), encoding="utf-8")
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
