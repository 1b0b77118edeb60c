"""Which rooms and sensor places go with the illuminances published for the room with one window.

    python validation/published_room.py [--models FOLDER]

writes `published_room.md` beside this file. The paper gives the window (0.80 x 1.10 m), the reflectances and
the sun; it gives neither the size of the room nor the sill, the sky or where the values were read. Here some
plausible rooms are lit through Models M and C of the default synthetic specimen (m.nc and c.nc in FOLDER, or
made there; some minutes). The synthetic pane is not the Ephesus pane: absolute values differ with it, and
agreement shows that a room is possible, not that it was the one.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
import warnings
from datetime import date
from pathlib import Path
from typing import Any

import numpy as np

from specularia import daylight
from specularia.daylight.panes import Glazing
from specularia.errors import SpeculariaWarning

HERE = Path(__file__).resolve().parent
ROOMS = [(5, 6, 3, 1.0), (5, 6, 3.5, 1.5), (4, 5, 3, 1.0), (4, 5, 3, 1.5), (3, 4, 2.7, 1.0), (7, 8, 4, 1.5)]
PUBLISHED = {
    "window inside": {"M": 84.0, "C": 109.0},
    "floor in the light": {"M": 1930.0, "C": 3524.0},
    "floor at the sides": {"M": 132.0, "C": 165.0},
    "ceiling, centre": {"M": 401.0, "C": 471.0},
}
PANES = 5500.0
WITHIN = 0.25
"""A place goes with a published value if ours lies within this share of it."""


def places(width: float, depth: float, height: float, sill: float) -> dict[str, list[tuple[Any, Any]]]:
    """Places that each name could mean: (position, normal)."""
    x = width / 2
    up, down = (0, 0, 1), (0, 0, -1)
    middle = sill + 0.55
    return {
        "window inside": [((x, 0.0, middle), (0, 1, 0))],
        "floor in the light": [
            ((x, y, 0.0), up) for y in (0.2, middle / np.tan(np.radians(75.0)), 0.7, 1.0, 1.5)
        ],
        "floor at the sides": [((a * width, y, 0.0), up) for a in (0.1, 0.2, 0.3) for y in (0.45, 1.0, 2.0)],
        "ceiling, centre": [((x, y, height), down) for y in (0.75, 1.0, 1.5, depth / 2)],
    }


def light(
    size: tuple[float, float, float, float], models: dict[str, Glazing]
) -> tuple[Any, dict[str, float]]:
    """Illuminance by model and place, and luminance of the pane straight in."""
    width, depth, height, sill = size
    wanted = places(*size)
    job = daylight.RoomJob.model_validate(
        {
            "room": {"width_m": width, "depth_m": depth, "height_m": height},
            "window": [{"width_m": 0.8, "height_m": 1.1, "sill_m": sill, "frame_m": 0.05}],
            "sun": {"elevation_deg": 75.0},
            "sensor": [
                {"name": f"{name} {k}", "position_m": at, "normal": normal}
                for name, group in wanted.items()
                for k, (at, normal) in enumerate(group)
            ],
            "quality": {"sampling": 0.5, "repeats": 2},
        }
    )
    lit = daylight.run(job, models=models)
    value = {(p.model, p.name): p.illuminance_lx for p in lit.points}
    found = {
        (m, name): np.array([value[m, f"{name} {k}"] for k in range(len(group))])
        for m in models
        for name, group in wanted.items()
    }
    return found, {p.model: p.luminance_cd_m2 for p in lit.panes if p.view == "normal"}


def cell(values: Any, target: float) -> tuple[str, bool]:
    """Range over the places, the value nearest to the published one, and whether it is near enough."""
    best = float(values[np.argmin(np.abs(np.log(values / target)))])
    good = abs(best / target - 1.0) <= WITHIN
    text = f"{values.min():,.0f} to {values.max():,.0f}" if len(values) > 1 else f"{values[0]:,.0f}"
    return (f"**{text}**" if good else text), good


def main() -> int:
    """Light the rooms and write the table."""
    parser = argparse.ArgumentParser(description=str(__doc__).split("\n")[0])
    parser.add_argument("--models", type=Path, help="folder of m.nc and c.nc")
    parser.add_argument("-o", "--output", type=Path, default=HERE / "published_room.md")
    given = parser.parse_args()
    sys.path.insert(0, str(HERE.parent / "benchmarks"))
    import room as benchmark

    with tempfile.TemporaryDirectory() as name, warnings.catch_warnings():
        warnings.simplefilter("ignore", SpeculariaWarning)
        read = benchmark.synthetic_models(given.models or Path(name))
    models = {k: Glazing(m) for k, m in read.items()}
    rows, counts, ceilings = [], [], []
    panes: dict[str, float] = {}
    for size in ROOMS:
        found, panes = light(size, models)
        label = f"{size[0]:g} x {size[1]:g} x {size[2]:g} m, sill {size[3]:g} m"
        cells, goods = [], []
        for place, targets in PUBLISHED.items():
            for m in models:
                text, good = cell(found[m, place], targets[m])
                cells.append(text)
                goods.append(good)
        rows.append(f"| {label} | " + " | ".join(cells) + f" | {sum(goods)} of 8 |")
        counts.append((label, sum(goods)))
        for m in models:
            near, centre = found[m, "ceiling, centre"][1], found[m, "ceiling, centre"][3]
            ceilings.append((label, m, near, centre))
        print(rows[-1], flush=True)
    head = " | ".join(f"{place}, {m}" for place in PUBLISHED for m in models)
    published = " | ".join(f"{PUBLISHED[p][m]:,.0f}" for p in PUBLISHED for m in models)
    most = max(n for _, n in counts)
    best = [label for label, n in counts if n == most]
    far = "; ".join(f"Model {m} {n:,.0f} and {c:,.0f}" for label, m, n, c in ceilings if label == best[0])
    target = PUBLISHED["ceiling, centre"]
    middle = [f"{label} (Model {m})" for label, m, _, c in ceilings if abs(c / target[m] - 1.0) <= WITHIN]
    bright = ", ".join(f"Model {m} {v:,.0f}" for m, v in panes.items())
    text = f"""# The published room

Made by `validation/published_room.py` on {date.today().isoformat()}. All panes are synthetic: Models M and
C of the default synthetic specimen, not of the Ephesus pane.

The paper states the window (0.80 x 1.10 m), reflectances of 0.70 (ceiling, walls) and 0.15 (floor, frames)
and the sun (75 degrees high, square to the window wall). Chosen here: the size of the room, the sill, a
frame of 0.05 m, the window in the middle of its wall, a CIE clear sky with gensky's amounts, a ground of
0.20, and where each value is read.

Places tried: the middle of the pane; the floor on the window's axis, 0.2 to 1.5 m from the wall; the floor
at 0.1, 0.2 and 0.3 of the width, 0.45, 1 and 2 m from the wall; the ceiling on the axis, 0.75, 1 and 1.5 m
from the wall and in its middle. Each cell gives the range over these places in lx; it is **bold** where
some place comes within {100 * WITHIN:.0f} % of the published value.

| room | {head} | near |
|---|{"---|" * 9}
| published | {published} | |
{chr(10).join(rows)}

Most values are met by: {"; ".join(best)} ({most} of 8). There the ceiling reads, 1 m from the window and in
its middle: {far} lx. The middle of the ceiling itself comes near the published value in:
{"; ".join(middle) or "none"}. Panes, straight in:
{bright} cd/m2; the paper says about {PANES:,.0f}, and not in which direction.

What this shows: where the places may be chosen, several rooms go with most of the published values, so the
values do not tell which room it was. What it does not show: that the paper's room was one of these, or that
our models agree with the paper's. The amounts of sun and sky scale all values together and were not
published; the two synthetic models agree with each other, the paper's two do not, so no room can meet both
columns of a pair closely.
"""
    given.output.write_text(text)
    print(text)
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
