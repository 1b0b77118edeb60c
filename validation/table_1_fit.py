"""The published transmissions by a traced pane: how far two numbers, absorption and steepness, bring Model C.

    python validation/table_1_fit.py

writes `table_1_fit.md` beside this file, in some minutes. The maps are those of the synthetic specimen, not
those of the published sample, which are not public; their heights are scaled as a whole.
"""

from __future__ import annotations

from dataclasses import replace
from datetime import date
from pathlib import Path

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.optimize import minimize

from specularia.glass import Medium, reweight, trace_paths
from specularia.twin import TwinSettings, make_face, make_slab

THETA = (0.0, 20.0, 40.0, 60.0, 82.5)
MEASURED = np.array([0.697, 0.676, 0.579, 0.410, 0.158])
PUBLISHED_M = np.array([0.715, 0.704, 0.590, 0.417, 0.137])
PUBLISHED_C = np.array([0.860, 0.835, 0.713, 0.497, 0.266])
"""Transmission at 520 nm: measured, Model M, Model C (the paper's Table 1)."""

SCALES = (0.5, 0.75, 1.0, 1.25, 1.5)
ABSORPTIONS = np.linspace(0.0, 0.2, 21)
PATHS = 60_000


def main() -> None:
    """Trace, fit and write."""
    settings = TwinSettings.model_validate({"maps": {"pixels": 512}})
    rng = np.random.default_rng(1)
    faces = {
        name: make_face(getattr(settings, name), settings.maps.of(name), rng) for name in ("front", "back")
    }
    pane = replace(make_slab(faces, settings, seed=1), medium=Medium(1.52), bubbles=None)
    tau = np.empty((len(SCALES), ABSORPTIONS.size, len(THETA)))
    for i, scale in enumerate(SCALES):
        sides = {
            s: replace(getattr(pane, s), heights_um=scale * getattr(pane, s).heights_um)
            for s in ("front", "back")
        }
        one = replace(pane, **sides)
        for k, theta in enumerate(THETA):
            paths = trace_paths(one, theta_deg=theta, phi_deg=None, paths=PATHS, seed=2)
            for j, a in enumerate(ABSORPTIONS):
                weighed = reweight(paths, absorption_per_mm=float(a))
                tau[i, j, k] = np.mean(weighed.weight * weighed.transmitted)
    # Smooth in both: splines of ln tau.
    along = CubicSpline(SCALES, np.log(tau), axis=0)

    def fitted(scale: float, absorption: float) -> np.ndarray:
        return np.exp(CubicSpline(ABSORPTIONS, along(scale), axis=0)(absorption))

    def off(values: np.ndarray) -> np.ndarray:
        return values / MEASURED - 1.0

    rows = []
    for name, used in (("all five", slice(None)), ("0 to 60 degrees", slice(0, 4))):

        def cost(x: np.ndarray, used: slice = used) -> float:
            return float(np.sum(off(fitted(*x))[used] ** 2))

        best = minimize(
            cost, (1.0, 0.07), bounds=[(SCALES[0], SCALES[-1]), (0.0, ABSORPTIONS[-1])], method="Nelder-Mead"
        )
        rows.append((f"traced, fitted to {name}", fitted(*best.x), f"{best.x[0]:.2f}", f"{best.x[1]:.3f}"))
    rows = [
        ("Model M, published", PUBLISHED_M, "", ""),
        ("Model C, published", PUBLISHED_C, "", ""),
        ("traced, as it is, clear", fitted(1.0, 0.0), "1", "0"),
        *rows,
    ]
    lines = [
        "# The published transmissions by a traced pane",
        "",
        f"Made by `validation/table_1_fit.py` on {date.today()}. Maps of the synthetic specimen, 512 pixels; "
        f"endless pane of 3 mm, n = 1.52, polarised, no bubbles; {PATHS:,} paths. Deviations from the five "
        f"published measurements {', '.join(f'{v:.3f}' for v in MEASURED)}.",
        "",
        "| | "
        + " | ".join(f"{t:g}" for t in THETA)
        + " | rms, 0 to 60 | rms, all | heights times | per mm |",
        "|---|" + "---|" * (len(THETA) + 4),
    ]
    for name, values, scale, absorption in rows:
        d = 100.0 * off(values)
        cells = [f"{v:.3f} ({e:+.1f} %)" for v, e in zip(values, d)]
        rms = [f"{np.sqrt(np.mean(d[:n] ** 2)):.1f} %" for n in (4, 5)]
        lines.append("| " + " | ".join([name, *cells, *rms, scale, absorption]) + " |")
    Path(__file__).with_suffix(".md").write_text("\n".join([*lines, ""]), encoding="utf-8")
    print("\n".join(lines[4:]))


if __name__ == "__main__":
    main()
