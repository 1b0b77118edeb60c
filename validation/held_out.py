"""Model M at incident angles that were not measured, on traced panes.

    python validation/held_out.py [PANE...]

Synthetic panes of many kinds are traced; a virtual gonio-photometer reads tables off at 0, 20, 40, 60 and
82.5 degrees (1 % noise, shadow of the mount), the model is fitted to them, and its distribution and its
transmission at 10, 30, 50, 70, 75 and 80 degrees are held against paths of their own. The truth of the
distribution is the density estimate that the photometer uses, without noise and shadow, on cells of 0.005
in direction cosines: plain counts of paths carry noise of 10 % in such cells. The two faces have different
periods; with one period each place of one face would see few places of the other, and the truth would be a
sum of some million single directions.

Writes held_out.md beside this file; about two minutes a pane on one core.
"""

from __future__ import annotations

import sys
import warnings
from collections.abc import Callable
from datetime import date
from pathlib import Path

import numpy as np

from specularia import gonio
from specularia.bsdf import TabulatedModel
from specularia.errors import SpeculariaWarning
from specularia.glass import photometer
from specularia.glass.bubbles import BubbleKind
from specularia.glass.faces import Face
from specularia.glass.medium import Medium
from specularia.glass.slab import Slab
from specularia.glass.trace import Paths, trace_paths
from specularia.twin.faces import make_face
from specularia.twin.settings import BackSettings, FaceSettings, MapSettings

SIDE = "transmission_front"
MEASURED = (0.0, 20.0, 40.0, 60.0, 82.5)
HELD_OUT = (10.0, 30.0, 50.0, 70.0, 75.0, 80.0)
LIMITS_L1 = (4.0, 4.0, 8.0, 15.0, 15.0, 15.0)
LIMITS_TAU = (1.0, 1.0, 1.0, 8.0, 8.0, 8.0)
CELLS = 400
PITCH_UM = (1.5, 1.5926)
TABLE_PATHS, TRUTH_PATHS = 1_000_000, 1_500_000


def smooth(slope: float, scale_um: float, seed: int) -> np.ndarray:
    """Gaussian relief [512, 512] in um with the given rms slope and correlation length; periodic."""
    k = 2.0 * np.pi * np.fft.fftfreq(512, 1.5)
    white = np.fft.fft2(np.random.default_rng(seed).standard_normal((512, 512)))
    h = np.fft.ifft2(white * np.exp(-(k[:, None] ** 2 + k[None, :] ** 2) * scale_um**2 / 4.0)).real
    y, x = np.gradient(h, 1.5)
    return h * slope / np.sqrt(np.mean(x * x + y * y))


def pitted(front: FaceSettings, back: BackSettings, seed: int) -> tuple[np.ndarray, np.ndarray]:
    """Heights of both faces of a decayed specimen, as the twin makes them."""
    maps = MapSettings()
    faces = [make_face(s, maps, np.random.default_rng([seed, k])) for k, s in enumerate((front, back))]
    return faces[0].decayed_um, faces[1].decayed_um


def pane(
    front: np.ndarray | None,
    back: np.ndarray | None,
    absorption: float,
    bubbles_per_cm3: float = 0.0,
    index: float = 1.52,
) -> Slab:
    """A synthetic pane of 3 mm; a face that is None is flat."""
    made = [
        Face.flat(name) if h is None else Face(h, p, p, name=name)
        for h, p, name in zip((front, back), PITCH_UM, ("front", "back"))
    ]
    kinds = (BubbleKind(per_cm3=bubbles_per_cm3, median_mm=0.2, sigma=0.4, elongation=3.0),)
    return Slab(
        thickness_mm=3.0,
        medium=Medium(index=index, absorption_per_mm=absorption),
        front=made[0],
        back=made[1],
        bubble_kinds=kinds if bubbles_per_cm3 else (),
        synthetic=True,
    )


PANES: dict[str, tuple[str, Callable[[], Slab]]] = {
    "decayed": (
        "faces of the default twin, 0.07/mm, bubbles",
        lambda: pane(*pitted(FaceSettings(), BackSettings(), 1), 0.07, 30.0),
    ),
    "half": (
        "pits half as deep, 0.03/mm",
        lambda: pane(
            *pitted(FaceSettings(relief_um=15, pitted_share=0.5), BackSettings(relief_um=30), 7), 0.03
        ),
    ),
    "shallow": (
        "pits of 4 and 8 um with flat glass between, 0.07/mm, bubbles",
        lambda: pane(
            *pitted(
                FaceSettings(relief_um=4, pitted_share=0.4, streak_slope=0.006),
                BackSettings(relief_um=8, pitted_share=0.7, streak_slope=0.006, secondary_depth=0.04),
                3,
            ),
            0.07,
            30.0,
        ),
    ),
    "slopes .03 .04": ("narrow lobe", lambda: pane(smooth(0.03, 25, 1), smooth(0.04, 20, 2), 0.0)),
    "slopes .08 .10": (
        "index 1.50",
        lambda: pane(smooth(0.08, 20, 9), smooth(0.10, 25, 10), 0.0, index=1.50),
    ),
    "slopes .15 .15": (
        "0.07/mm, bubbles",
        lambda: pane(smooth(0.15, 20, 7), smooth(0.15, 25, 8), 0.07, 60.0),
    ),
    "slopes .50 .40": ("0.02/mm", lambda: pane(smooth(0.5, 20, 11), smooth(0.4, 20, 12), 0.02)),
    "back only .25": ("front flat", lambda: pane(None, smooth(0.25, 20, 5), 0.0)),
    "front only .25": ("back flat, 0.07/mm", lambda: pane(smooth(0.25, 20, 6), None, 0.07)),
}


def fitted(slab: Slab) -> TabulatedModel:
    """Model M from tables of the virtual gonio-photometer."""
    rng = np.random.default_rng(3)
    tables, floor = [], 0.0
    for k, theta in enumerate(MEASURED):
        paths = trace_paths(slab, theta_deg=theta, paths=TABLE_PATHS, seed=5000 + k)
        scan = photometer.scan(theta, base=112_000, middle=40_000, peak=25_000, rng=rng)
        clean = photometer.read_off(paths, theta_deg=theta, directions=scan, synthetic=True)
        floor = floor or 3e-6 * float(clean.values.max())
        tables.append(photometer.recorded(clean, relative_noise=0.01, floor=floor, shadow=True, rng=rng))
    return gonio.fit(tables)


def cells() -> tuple[np.ndarray, np.ndarray]:
    """(ux, uy) of the centres of the cells within the hemisphere."""
    k = (np.arange(CELLS) + 0.5) / CELLS * 2.0 - 1.0
    x, y = np.meshgrid(k, k, indexing="ij")
    inside = x * x + y * y < 1.0
    return x[inside], y[inside]


def truth(paths: Paths, x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Density of the transmitted paths in the cells, 1/sr."""
    out = paths.transmitted
    directions = 180.0 - np.degrees(np.arcsin(np.hypot(x, y))), np.degrees(np.arctan2(y, x))
    return photometer.density(
        paths.ux[out],
        paths.uy[out],
        paths.weight[out],
        directions,
        paths=len(paths),
        aperture_deg=0.6,
    )


def predicted(model: TabulatedModel, theta: float, x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """The model's mean over the cells, from 2 x 2 points."""
    step = 0.5 / CELLS
    total = np.zeros(x.size)
    for a in (-step, step):
        for b in (-step, step):
            total += np.nan_to_num(model.evaluate(SIDE, theta, 0.0, x + a, y + b)) / 4.0
    return total


def row(name: str, slab: Slab) -> list[str]:
    """Lines of the table for one pane."""
    model = fitted(slab)
    x, y = cells()
    l1, tau = [], []
    for k, theta in enumerate(HELD_OUT):
        paths = trace_paths(slab, theta_deg=theta, paths=TRUTH_PATHS, seed=9000 + k)
        transmitted = float(np.mean(np.where(paths.transmitted, paths.weight, 0.0)))
        there = truth(paths, x, y)
        there *= transmitted / (there.sum() * (2.0 / CELLS) ** 2)
        apart = np.abs(predicted(model, theta, x, y) - there).sum() * (2.0 / CELLS) ** 2 / transmitted
        value = float(model.direct_hemispherical(SIDE, theta))
        low, high = (float(v) for v in model.tau_interval(SIDE, theta))
        narrow = 2.0 if name in ("shallow", "slopes .03 .04") else 1.0
        l1.append(f"{100 * apart:.1f}" + ("" if 100 * apart <= narrow * LIMITS_L1[k] else " !"))
        off = 100.0 * (value / transmitted - 1.0)
        mark = "" if abs(off) <= LIMITS_TAU[k] else " !"
        mark += "" if low <= transmitted <= high else " (outside)"
        tau.append(f"{off:+.2f} ± {50 * (high - low) / value:.1f}{mark}")
    return [f"| {name} | L1 % | " + " | ".join(l1) + " |", "| | tau % | " + " | ".join(tau) + " |"]


def main() -> None:
    """Trace, fit, compare, write."""
    warnings.simplefilter("ignore", SpeculariaWarning)
    names = sys.argv[1:] or list(PANES)
    measured, cells_wide = ", ".join(f"{t:g}" for t in MEASURED), 2.0 / CELLS
    lines = [
        f"# Model M between its angles, on traced panes ({date.today().isoformat()})",
        "",
        f"Measured by the virtual gonio-photometer at {measured} degrees. L1: integral of |model - truth|",
        f"over projected solid angle, over tau, on cells of {cells_wide:g} in direction cosines. tau:",
        "model over truth - 1, ± half the stated 95 % interval. Limits: L1 4, 4, 8, 15, 15, 15 % (twice",
        "that for the narrow lobes of *shallow* and *slopes .03 .04*), tau 1, 1, 1, 8, 8, 8 % and the",
        "truth within the interval; ! and (outside) mark what misses them. Slopes are rms, front and",
        "back. All panes are synthetic. Made by `held_out.py`.",
        "",
        "| pane | | " + " | ".join(f"{t:g}" for t in HELD_OUT) + " |",
        "|---|---|" + "---|" * len(HELD_OUT),
    ]
    for name in names:
        lines += row(name, PANES[name][1]())
        print("\n".join(lines[-2:]), flush=True)
    lines += ["", *(f"* {n}: {PANES[n][0]}" for n in names if PANES[n][0]), ""]
    Path(__file__).with_suffix(".md").write_text("\n".join(lines), encoding="utf-8")


if __name__ == "__main__":
    main()
