"""Colour from one trace against a trace at every 5 nm, with dispersion.

Three built-in glasses on a rough synthetic pane (rms slopes .33 and .51) of 1.5, 3 and 5 mm; the one trace is
at 3 mm. The brute force traces the pane of each thickness at 81 wavelengths with the index of BK7 at
each, and with the same random numbers. A few minutes; writes one_trace_colour.md beside itself.

    python validation/one_trace_colour.py
"""

from __future__ import annotations

from dataclasses import replace
from datetime import date
from pathlib import Path

import numpy as np

from specularia.files import write_text
from specularia.glass import GLASSES, Face, Medium, Slab, swatches, trace_paths
from specularia.glass.colour import WAVELENGTHS_NM, delta_e, lab, viewing

BK7 = (1.03961212, 0.231792344, 1.01046945, 0.00600069867, 0.0200179144, 103.560653)
PATHS = 32_000
THICKNESS = (1.5, 3.0, 5.0)


def relief(seed: int, rms_slope: float, n: int = 96, pitch_um: float = 1.5, width_px: float = 4.0) -> Face:
    """A periodic random relief with a Gaussian correlation."""
    rng = np.random.default_rng(seed)
    k = 2 * np.pi * np.fft.fftfreq(n)
    f = np.fft.fft2(rng.standard_normal((n, n))) * np.exp(-(k[:, None] ** 2 + k**2) * width_px**2 / 4)
    h = np.real(np.fft.ifft2(f))
    slope = np.sqrt(np.mean((np.roll(h, -1, 0) - h) ** 2 + (np.roll(h, -1, 1) - h) ** 2)) / pitch_um
    return Face(h * rms_slope / slope, pitch_um, pitch_um)


def main() -> None:
    """Trace and write the table."""
    media = {name: Medium(index=BK7, absorption_per_mm=g.spectrum()) for name, g in GLASSES.items()}
    pane = Slab(
        thickness_mm=3.0, medium=media["aqua"], front=relief(1, 0.33), back=relief(2, 0.51), synthetic=True
    )
    lines = [
        "# Colour from one trace",
        "",
        f"Made by `validation/one_trace_colour.py` on {date.today()}.",
        f"The pane is synthetic; {PATHS} paths a trace.",
        "",
        "| theta | mm | glass | Lab of 81 traces | Lab of one trace at 3 mm | Delta E 2000 |",
        "|---|---|---|---|---|---|",
    ]
    worst = 0.0
    for theta in (0.0, 60.0):
        found = swatches(pane, media, thickness_mm=THICKNESS, theta_deg=theta, paths=PATHS)
        for t, thickness in enumerate(THICKNESS):
            other = replace(pane, thickness_mm=thickness)
            light: dict[str, list[float]] = {name: [] for name in media}
            for w in WAVELENGTHS_NM:
                p = trace_paths(
                    other, theta_deg=theta, phi_deg=None, paths=PATHS, wavelength_nm=float(w), clear=True
                )
                for name, medium in media.items():
                    left = p.weight * np.exp(-medium.absorption_at(float(w)) * p.glass_length_mm)
                    light[name].append(float(left[p.transmitted].sum() / len(p)))
            for m, name in enumerate(media):
                exact = lab(viewing().weights @ np.array(light[name]))
                off = float(delta_e(exact, found.lab[m, t]))
                worst = max(worst, off)
                a, b = (", ".join(f"{v:.2f}" for v in one) for one in (exact, found.lab[m, t]))
                lines.append(f"| {theta:g} | {thickness:g} | {name} | {a} | {b} | {off:.2f} |")
    lines += ["", f"Worst: **{worst:.2f}** (bar 1)."]
    write_text(Path(__file__).with_suffix(".md"), "\n".join(lines) + "\n")
    print("\n".join(lines))


if __name__ == "__main__":
    main()
