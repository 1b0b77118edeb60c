"""Laws of the slab tracer with more light than a test may use: reciprocity, closed forms, free flight.

    python validation/slab_laws.py

writes `slab_laws.md` beside this file, in about five minutes. All panes are synthetic.
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from dataclasses import replace
from datetime import date
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from specularia.bsdf.tabulated import base_index
from specularia.conventions import square_to_disk
from specularia.glass import (
    BubbleKind,
    Face,
    Inside,
    Medium,
    Slab,
    closed_form,
    trace,
    trace_paths,
)
from specularia.glass.trace import LightSide

HERE = Path(__file__).resolve().parent
CELLS, DRAWS, EACH = 8, 32, 512


def rough_pane() -> Slab:
    """Two random reliefs of different periods and pixels, with rms slopes of 0.4 and 0.6."""
    sys.path.insert(0, str(HERE.parent / "tests" / "glass"))
    from glass_reference import smooth_map

    return Slab(
        thickness_mm=1.0,
        front=Face(smooth_map((48, 60), seed=1, rms_slope=0.4), 1.5, 1.5),
        back=Face(smooth_map((40, 40), seed=2, rms_slope=0.6), 1.5, 1.7),
    )


def exchange(slab: Slab, side: LightSide) -> dict[str, NDArray[np.float64]]:
    """Light from each incident cell into each exit cell, [draw, incident, exit]; cells of equal projected
    solid angle, each draw with a direction of its own."""
    rng = np.random.default_rng(5 + (side == "back"))
    n = CELLS**2
    found = {name: np.zeros((DRAWS, n, n)) for name in ("transmission", "reflection")}
    for a in range(n):
        at = (np.array(divmod(a, CELLS))[:, None] + rng.random((2, DRAWS))) / CELLS
        ux, uy = square_to_disk(*at)
        for k in range(DRAWS):
            p = trace_paths(
                slab,
                side=side,
                theta_deg=float(np.degrees(np.arcsin(min(np.hypot(ux[k], uy[k]), 1 - 1e-9)))),
                phi_deg=float(np.degrees(np.arctan2(uy[k], ux[k]))),
                paths=EACH,
                seed=int(rng.integers(1 << 30)),
            )
            i, j = base_index(p.ux, p.uy, CELLS)
            for name, out in (("transmission", p.transmitted), ("reflection", p.reflected)):
                found[name][k, a] = np.bincount((i * CELLS + j)[out], p.weight[out], n) / len(p)
    return found


def rms_z(a: NDArray[np.float64], b: NDArray[np.float64]) -> tuple[float, int]:
    """Root mean square of the difference over its standard error, for cells with about ten paths or more."""
    variance = (a.var(0, ddof=1) + b.var(0, ddof=1)) / DRAWS
    good = (a.mean(0) + b.mean(0)) / 2 > 10.0 / (DRAWS * EACH)
    z = (a.mean(0) - b.mean(0))[good] / np.sqrt(variance[good])
    return float(np.sqrt(np.mean(z**2))), z.size


def reciprocity() -> list[str]:
    lines = [
        "## Reciprocity",
        "",
        f"{CELLS} x {CELLS} incident by {CELLS} x {CELLS} exit cells, {DRAWS} directions in each incident "
        f"cell, {EACH} paths each. Rms of the difference over its standard error; noise alone gives 1.02.",
        "",
        "| pane | quantity | rms z | pairs |",
        "|---|---|---|---|",
    ]
    clear = rough_pane()
    kind = BubbleKind(per_cm3=800.0, median_mm=0.15, sigma=0.3, elongation=3.0)
    panes = {
        "clear": clear,
        "bubbles": replace(clear, bubble_kinds=(kind,)),
        "bubbles, absorbing": replace(clear, bubble_kinds=(kind,), medium=Medium(absorption_per_mm=0.07)),
        "bubbles in free flight": replace(clear, bubble_kinds=(replace(kind, placing="free flight"),)),
        "liquid on the back": replace(clear, back=replace(clear.back, sealant_index=1.4)),
    }
    upper = np.triu_indices(CELLS**2, 1)
    for name, slab in panes.items():
        front, back = exchange(slab, "front"), exchange(slab, "back")
        pairs = {
            "transmission, front against back": (
                front["transmission"],
                back["transmission"].transpose(0, 2, 1),
            ),
        }
        for side, found in (("front", front), ("back", back)):
            r = found["reflection"]
            pairs[f"reflection, {side}"] = (r[:, *upper], r.transpose(0, 2, 1)[:, *upper])
        for quantity, (a, b) in pairs.items():
            z, number = rms_z(a, b)
            lines.append(f"| {name} | {quantity} | {z:.3f} | {number} |")
            print(lines[-1], flush=True)
    return [*lines, ""]


def closed_forms() -> list[str]:
    lines = [
        "## Flat pane, 3 mm, n = 1.52",
        "",
        "| light | theta | quantity | exact | traced | se | (traced - exact) / se |",
        "|---|---|---|---|---|---|---|",
    ]

    def add(light: str, theta: float, quantity: str, exact: float, traced: float, se: float) -> None:
        z = (traced - exact) / se if se > 0 else 0.0
        lines.append(
            f"| {light} | {theta:g} | {quantity} | {exact:.5f} | {traced:.5f} | {se:.5f} | {z:+.1f} |"
        )

    flat = Slab(thickness_mm=3.0)
    theta = (0.0, 40.0, 60.0, 82.5)
    cases = (("scalar", False, 0.0), ("unpolarised", True, 0.0), ("unpolarised, 0.07 / mm", True, 0.07))
    for name, polarised, a in cases:
        slab = replace(flat, polarised=polarised, medium=Medium(absorption_per_mm=a))
        found = trace(slab, theta_deg=theta, paths=1_600_000, seed=3)
        exact = closed_form.flat_slab(
            theta, index=1.52, absorption_per_mm=a, thickness_mm=3.0, polarised=polarised
        )
        for k, t in enumerate(theta):
            add(name, t, "tau", exact.transmitted[k], found.tau[k], found.tau_se[k])
            if a:
                add(name, t, "absorbed", exact.absorbed[k], found.absorbed[k], found.absorbed_se[k])
    for name, q, single in zip("sp", (1.0, -1.0), closed_form.fresnel(60.0, index=1.52)):
        found = trace(
            replace(flat, incident=(q, 0.0, 0.0)), theta_deg=[60.0], phi_deg=25.0, paths=1_600_000, seed=4
        )
        exact_tau = float((1 - single) / (1 + single))
        add(f"laser, {name}", 60.0, "tau", exact_tau, float(found.tau[0]), float(found.tau_se[0]))
    return [*lines, ""]


def free_flight() -> list[str]:
    lines = [
        "## Bubbles from a list and in free flight",
        "",
        "1 mm of glass, flat faces, 300 bodies per cm3, median 0.2 mm, sigma 0.3, elongation 3; the list is "
        "the mean over 16 lists. Free flight forgets: light that returns on its own way meets other bodies, "
        "where a list has it miss the same ones again. That is why rho differs at normal incidence.",
        "",
        "| bodies | theta | quantity | list | se | free flight | se |",
        "|---|---|---|---|---|---|---|",
    ]
    for name, inside in (("air", Inside()), ("opaque", Inside(None, float("inf")))):
        kind = BubbleKind(300.0, 0.2, sigma=0.3, elongation=3.0, inside=inside)
        for theta in (0.0, 50.0):
            flight = trace(
                Slab(thickness_mm=1.0, bubble_kinds=(replace(kind, placing="free flight"),)),
                theta_deg=[theta],
                paths=640_000,
                seed=1,
            )
            lists = [
                trace(
                    Slab(thickness_mm=1.0, bubble_kinds=(kind,), bubble_seed=s),
                    theta_deg=[theta],
                    paths=128_000,
                    seed=s,
                )
                for s in range(16)
            ]
            for quantity in ("tau", "rho", "absorbed"):
                values = np.array([getattr(x, quantity)[0] for x in lists])
                one, se = getattr(flight, quantity)[0], getattr(flight, f"{quantity}_se")[0]
                lines.append(
                    f"| {name} | {theta:g} | {quantity} | {values.mean():.5f} | "
                    f"{values.std(ddof=1) / 4:.5f} | {one:.5f} | {se:.5f} |"
                )
                print(lines[-1], flush=True)
    return [*lines, ""]


def main() -> None:
    lines = [
        "# Laws of the slab tracer",
        "",
        f"Made by `validation/slab_laws.py` on {date.today().isoformat()}. All panes are synthetic.",
        "",
    ]
    sections: tuple[Callable[[], list[str]], ...] = (closed_forms, free_flight, reciprocity)
    for section in sections:
        lines += section()
    (HERE / "slab_laws.md").write_text("\n".join(lines).rstrip() + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
