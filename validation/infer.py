"""Twenty synthetic panes whose glass is inferred from what instruments would have recorded of them.

    python validation/infer.py [PANES [FIRST]]

writes `infer.md` beside this file; about three minutes of one processor for each pane. The panes have another
pixel pitch than the default's, bubbles of many sizes listed one by one, and heights that went through the
simulated microscope; the priors are those of the program, not centred on the truth. All panes are synthetic.
"""

from __future__ import annotations

import sys
import tempfile
import warnings
from dataclasses import replace
from datetime import date
from pathlib import Path
from typing import Any

import numpy as np

from specularia import analysis, surface
from specularia.errors import SpeculariaWarning
from specularia.glass import BubbleKind, Face, Medium, Slab, photometer
from specularia.twin import TwinSettings, make_face, microscope

SOUGHT = ("absorption_per_mm", "bubbles_per_cm3", "micro_slope_front", "micro_slope_back")
THETA = (0.0, 20.0, 40.0, 60.0)
PATHS, TRUTH_PATHS, LEAST_PATHS = 80_000, 8_000_000, 300
APERTURE_DEG = 0.6


def specimen(number: int, folder: Path) -> tuple[Slab, Slab, dict[str, float]]:
    """The true pane, the pane as the microscope saw it, and what is to be found."""
    rng = np.random.default_rng([2026, number])
    settings = TwinSettings.model_validate(
        {
            "maps": {"pixels": 256, "pitch_um": 1.9},
            "front": {"pitted_share": float(rng.uniform(0.2, 0.7)), "relief_um": float(rng.uniform(8, 25))},
            "back": {"pitted_share": float(rng.uniform(0.3, 0.9)), "relief_um": float(rng.uniform(10, 40))},
        }
    )
    truth = {
        "absorption_per_mm": float(np.exp(rng.normal(np.log(0.055), 0.5))),
        "bubbles_per_cm3": float(np.exp(rng.normal(np.log(35.0), 0.5))),
        "micro_slope_front": float(rng.uniform(0.03, 0.11)),
        "micro_slope_back": float(rng.uniform(0.03, 0.11)),
    }
    faces: dict[str, dict[str, Face]] = {"true": {}, "seen": {}}
    for side in ("front", "back"):
        grid = settings.maps.of(side)
        true = make_face(getattr(settings, side), grid, rng).decayed_um
        stack = microscope.focus_stack(true, settings.microscope, pitch_um=grid.pitch_um, rng=rng)
        path = folder / f"{side}.tif"
        microscope.write_stack(stack, path, pitch_um=grid.pitch_um, label="synthetic")
        seen, _ = surface.filled(surface.heights(path))
        faces["true"][side] = Face(
            true, grid.pitch_um, grid.pitch_um, micro_slope=truth[f"micro_slope_{side}"]
        )
        faces["seen"][side] = Face.from_map(seen, tiling="periodic", denoise=True)
    kind = BubbleKind(
        per_cm3=truth["bubbles_per_cm3"], median_mm=0.2, sigma=0.4, elongation=3.0, placing="cell"
    )
    guessed = BubbleKind(per_cm3=20.0, median_mm=0.2, sigma=0.4, elongation=3.0, placing="free flight")
    bare = Slab(3.0, Medium(1.52, truth["absorption_per_mm"]), **faces["true"], synthetic=True)
    seen_pane = Slab(3.0, Medium(1.52), **faces["seen"], bubble_kinds=(guessed,), synthetic=True)
    return replace(bare, bubble_kinds=(kind,), bubble_seed=number), seen_pane, truth


def tables(slab: Slab, number: int) -> list[Any]:
    """What the virtual gonio-photometer records of it, with noise and the shadow of the mount."""
    found, floor = [], None
    for k, theta in enumerate(THETA):
        rng = np.random.default_rng([number, k])
        directions = photometer.scan(theta, base=20_000, middle=12_000, peak=8_000, rng=rng)
        clean = photometer.measure(
            slab,
            theta_deg=theta,
            directions=directions,
            paths=TRUTH_PATHS,
            least_paths=LEAST_PATHS,
            aperture_deg=APERTURE_DEG,
            seed=1000 * number + k,
            synthetic=True,
        )
        floor = 3e-6 * float(clean.values.max()) if floor is None else floor
        found.append(photometer.recorded(clean, relative_noise=0.01, floor=floor, shadow=True, rng=rng))
    return found


def main() -> None:
    """Infer all panes and write the table."""
    panes = int(sys.argv[1]) if len(sys.argv) > 1 else 20
    begin = int(sys.argv[2]) if len(sys.argv) > 2 else 0
    rows, inside, width = [], {n: 0 for n in SOUGHT}, {n: [] for n in SOUGHT}
    held = [0, 0]
    for number in range(begin, begin + panes):
        with tempfile.TemporaryDirectory() as folder, warnings.catch_warnings():
            warnings.simplefilter("ignore", SpeculariaWarning)
            true, seen, truth = specimen(number, Path(folder))
            found = analysis.infer(
                seen,
                tables(true, number),
                seek=SOUGHT,
                hold_out=True,
                aperture_deg=APERTURE_DEG,
                paths=PATHS,
                seed=number,
            )
        cells = [str(number)]
        for name in SOUGHT:
            mid, low, high = found.interval(name)
            good = low <= truth[name] <= high
            inside[name] += good
            width[name].append(high / low)
            cells.append(
                f"{truth[name]:.3g}: {mid:.3g} ({low:.3g} to {high:.3g}){'' if good else ' **out**'}"
            )
        for h in found.held_out:
            held[0] += h.low <= h.measured <= h.high
            held[1] += 1
        cells.append(f"{100 * float(np.median(found.discrepancy)):.1f} %")
        rows.append("| " + " | ".join(cells) + " |")
        print(rows[-1], flush=True)
    lines = [
        "# Glass inferred from tables and maps",
        "",
        f"Made by `validation/infer.py` on {date.today()}: {panes} synthetic panes, "
        f"tables at {', '.join(f'{t:g}' for t in THETA)} degrees, {PATHS} paths a trace. In each cell the "
        "truth, then the median and the 95 % interval.",
        "",
        "| | truth in the interval | median of highest over lowest |",
        "|---|---|---|",
        *(f"| {n} | {inside[n]} of {panes} | {np.median(width[n]):.2f} |" for n in SOUGHT),
        f"| transmission at angles left out | {held[0]} of {held[1]} | |",
        "",
        "| pane | " + " | ".join(SOUGHT) + " | discrepancy |",
        "|---|" + "---|" * (len(SOUGHT) + 1),
        *rows,
        "",
    ]
    Path(__file__).with_suffix(".md").write_text("\n".join(lines), encoding="utf-8")


if __name__ == "__main__":
    main()
