"""Errors of integrated tables against an analytic truth: noise against spread, the systematic bound, the
model.

    python validation/gonio_errors.py            # all of it, about ten minutes
    python validation/gonio_errors.py --quick    # fewer variants, a minute

writes `gonio_errors.md` beside this file. The truth is an analytic BTDF with exactly known transmission
(`../shared/oracles/gonio_synthetic.py`); every table is synthetic.
"""

from __future__ import annotations

import argparse
import importlib.util
import warnings
from datetime import date
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from specularia import gonio

HERE = Path(__file__).resolve().parent
SHARED = HERE.parents[1] / "shared"
THETA = (0.0, 20.0, 40.0, 60.0, 82.5)


def load_oracle() -> Any:
    spec = importlib.util.spec_from_file_location("oracle", SHARED / "oracles" / "gonio_synthetic.py")
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def measure(
    oracle: Any,
    truth: Any,
    theta_i: float,
    rng: np.random.Generator,
    *,
    points: int = 160000,
    rel: float = 0.01,
    floor: float = 1e-6,
    half_width: float = 12.0,
    reach: float = 25.0,
    theta_max: float = 89.0,
) -> tuple[gonio.Table, np.ndarray]:
    """A table and the standard deviation of its values; the shadow as wide and deep as wanted (0: none)."""
    share = np.array([100000, 35000, 25000]) * points // 160000
    counts = {"n_base": int(share[0]), "n_mid": int(share[1]), "n_peak": int(share[2]), "th_max": theta_max}
    v = oracle.directions(theta_i, 0.0, rng, **counts)
    theta = np.degrees(np.arccos(np.clip(v[:, 2], -1, 1)))
    phi = np.degrees(np.arctan2(v[:, 1], v[:, 0])) % 360
    clean = truth.dsf(theta_i, 0.0, theta, phi)
    if half_width > 0:
        away = np.abs((phi - 270 + 180) % 360 - 180)

        def edge(t: np.ndarray) -> np.ndarray:
            return 1 / (1 + np.exp(np.clip(t / 0.5, -50, 50)))

        clean = clean * (1 - 0.98 * edge(away - half_width) * edge(theta - 90 - reach))
    peak = truth.dsf(0, 0, np.array([180.0]), np.array([0.0]))[0]
    sigma = np.hypot(rel * clean, floor * peak)
    table = gonio.Table(
        file="",
        quantity="DSF",
        side="transmission_front",
        theta_i_deg=theta_i,
        phi_i_deg=0.0,
        theta_s_deg=np.round(theta, 4),
        phi_s_deg=np.round(phi, 4),
        values=clean + sigma * rng.standard_normal(clean.size),
        synthetic=True,
    )
    return table, sigma


def noise_section(oracle: Any, quick: bool) -> list[str]:
    """The stated standard error against the spread of 200 draws of the noise, geometry fixed."""
    lines = [
        "## Standard error against the spread of 200 draws",
        "",
        "Values drawn anew 200 times on fixed directions. The integral is a fixed weighted sum of values, so "
        "the spread is taken with the weights of the first table. The last column is the exact ratio, from "
        "the known noise of each value.",
        "",
        "| lobe sigma | theta_i | points | relative | floor | stated se | spread of 200 | ratio | exact "
        "ratio |",
        "|---|---|---|---|---|---|---|---|---|",
    ]
    cases = [(0.025, t, 160000, 0.01, 1e-6) for t in (THETA[:2] if quick else THETA)]
    if not quick:
        cases += [(0.008, 0.0, 160000, 0.01, 1e-6), (0.008, 60.0, 160000, 0.01, 1e-6)]
        cases += [(0.1, 20.0, 160000, 0.01, 1e-6), (0.025, 40.0, 160000, 0.03, 1e-6)]
        cases += [(0.025, 40.0, 160000, 0.01, 2e-5), (0.025, 20.0, 16000, 0.01, 1e-6)]
    ratios = []
    for k, (width, theta, points, rel, floor) in enumerate(cases):
        truth = oracle.Truth(sigma=width)
        rng = np.random.default_rng(100 + k)
        table, sigma = measure(oracle, truth, theta, rng, points=points, rel=rel, floor=floor)
        found = gonio.distribution(table)
        scale = found.row_weight / table.cos_s
        draws = [float(np.sum(scale * sigma * rng.standard_normal(sigma.size))) for _ in range(200)]
        spread = float(np.std(draws, ddof=1))
        exact = float(np.sqrt(np.sum((scale * sigma) ** 2)))
        ratios.append(found.standard_error / spread)
        lines.append(
            f"| {width:g} | {theta:g} | {points} | {rel:g} | {floor:g} | {found.standard_error:.2e} | "
            f"{spread:.2e} | "
            f"{ratios[-1]:.3f} | {found.standard_error / exact:.3f} |"
        )
    worst = max(abs(r - 1) for r in ratios)
    return [
        *lines,
        "",
        f"Largest deviation from 1: {100 * worst:.0f} % (200 draws know their spread to 5 %).",
        "",
    ]


def variants(quick: bool) -> list[dict[str, Any]]:
    """Forty variants: lobe, shadow, coverage, noise and number of points drawn from stated lists."""
    rng = np.random.default_rng(2024)
    out = []
    for k in range(8 if quick else 40):
        out.append(
            {
                "sigma": float(np.geomspace(0.008, 0.1, 10)[k % 10]),
                "theta": float(rng.choice(THETA)),
                "half_width": float(rng.choice([0.0, 3.0, 6.0, 12.0, 20.0, 30.0])),
                "reach": float(rng.choice([15.0, 25.0, 35.0])),
                "theta_max": float(rng.choice([75.0, 80.0, 85.0, 87.0, 89.0])),
                "rel": float(rng.choice([0.003, 0.01, 0.03])),
                "floor": float(rng.choice([1e-7, 1e-6, 1e-5])),
                "points": int(rng.choice([16000, 40000, 160000])),
            }
        )
    return out


def bound_section(oracle: Any, quick: bool) -> list[str]:
    """Whether truth lies within the bound, over variants."""
    lines = [
        "## Systematic bound over variants of the truth",
        "",
        "Errors and bounds in per cent of tau. `alone`: |error| within the systematic bound; `both`: within "
        "the bound and two standard errors.",
        "",
        "| sigma | theta_i | shadow | from horizon | theta_max | noise | floor | points | error | se | bound "
        "| alone | both |",
        "|---|---|---|---|---|---|---|---|---|---|---|---|---|",
    ]
    alone, both, widths, shares = 0, 0, [], []
    chosen = variants(quick)
    for k, c in enumerate(chosen):
        truth = oracle.Truth(sigma=c["sigma"])
        options = {n: c[n] for n in ("points", "rel", "floor", "half_width", "reach", "theta_max")}
        table, _ = measure(oracle, truth, c["theta"], np.random.default_rng(500 + k), **options)
        s = gonio.summarise(table)
        tau = truth.tau(c["theta"])
        error = s.tau - tau
        inside = abs(error) <= s.tau_systematic
        with_noise = abs(error) <= s.tau_systematic + 2 * s.tau_se
        alone, both = alone + inside, both + with_noise
        widths.append(s.tau_systematic / max(abs(error), 1e-12))
        shares.append(s.tau_systematic / tau)
        lines.append(
            f"| {c['sigma']:.3f} | {c['theta']:g} | {2 * c['half_width']:g} | {c['reach']:g} | "
            f"{c['theta_max']:g} | "
            f"{c['rel']:g} | {c['floor']:g} | {c['points']} | {100 * error / tau:.3f} | "
            f"{100 * s.tau_se / tau:.3f} | "
            f"{100 * s.tau_systematic / tau:.3f} | {'yes' if inside else 'no'} | "
            f"{'yes' if with_noise else 'no'} |"
        )
        print(lines[-1], {n: round(100 * v / tau, 3) for n, v in s.systematic.items() if v}, flush=True)
    return [
        *lines,
        "",
        f"Covered: {alone} of {len(chosen)} by the bound alone, {both} with two standard errors. Median of "
        f"bound over |error|: {np.median(widths):.1f}; of bound over tau: {100 * np.median(shares):.2f} %, "
        f"largest {100 * np.max(shares):.1f} %.",
        "",
    ]


def binned(evaluate: Any, theta: float, step: float, half: float | None) -> tuple[np.ndarray, float]:
    """Means over square bins of direction cosines, 3 x 3 places each; the whole disk or a square at the
    lobe."""
    n = round(2 / step)
    c = (np.arange(n) + 0.5) * step - 1
    s = -np.sin(np.radians(theta))
    cx, cy = (c, c) if half is None else (c[np.abs(c - s) < half], c[np.abs(c) < half])
    x, y = np.meshgrid(cx, cy, indexing="ij")
    inside = x * x + y * y < 1
    total = np.zeros(x.shape)
    for dx in (-step / 3, 0, step / 3):
        for dy in (-step / 3, 0, step / 3):
            r = np.hypot(x + dx, y + dy)
            pull = np.minimum(1.0, 0.99999 / np.maximum(r, 1e-9))
            total += evaluate((x + dx) * pull, (y + dy) * pull) / 9
    return np.where(inside, total, 0.0), step * step


def width_at_half(x: np.ndarray, values: np.ndarray, peak: float) -> float:
    """Where values first fall below half of the peak on either side of the middle, by linear
    interpolation."""
    middle = x.size // 2
    ends = []
    for side in (values[middle:], values[middle::-1]):
        k = int(np.argmax(side < peak / 2))
        ends.append(k - (peak / 2 - side[k]) / (side[k - 1] - side[k]))
    return (ends[0] + ends[1]) * (x[1] - x[0])


def model_section(oracle: Any, quick: bool) -> list[str]:
    """The fitted model at the measured angles."""
    lines = [
        "## The fitted model at the measured angles",
        "",
        "Tables of 160,000 directions, 1 % noise, shadow of 24 degrees. L1 is the integral of "
        "|model - truth| over projected solid angle over tau, on bins of 0.005 in direction cosine and, "
        "within 0.1 of the undeflected direction, of 0.002. The peak is the highest bin of 0.002; FWHM along "
        "y through the undeflected direction.",
        "",
        "| lobe sigma | theta_i | tau error % | L1 % (0.005) | L1 % (0.002, near the peak) | peak ratio | "
        "FWHM ratio |",
        "|---|---|---|---|---|---|---|",
    ]
    for width in (0.025, 0.008):
        truth = oracle.Truth(sigma=width)
        rng = np.random.default_rng(1)
        angles = THETA[:3] if quick else THETA
        model = gonio.fit([measure(oracle, truth, t, rng)[0] for t in angles])
        for theta in angles:
            tau = truth.tau(theta)

            ours = partial(model.evaluate, "transmission_front", theta, 0.0)
            exact = partial(truth.bsdf, theta, 0.0)
            l1 = []
            for step, half in ((0.005, None), (0.002, 0.1)):
                (a, area), (b, _) = binned(ours, theta, step, half), binned(exact, theta, step, half)
                l1.append(100 * float(np.sum(np.abs(a - b))) * area / tau)
            s = -np.sin(np.radians(theta))
            line = np.linspace(-0.2, 0.2, 4001)
            at = np.full(line.shape, s)
            v, w = ours(at, line), exact(at, line)
            near = np.abs(line) < 0.15 * width
            fwhm = width_at_half(line, v, v[near].mean()) / width_at_half(line, w, w[near].mean())
            off = float(model.direct_hemispherical("transmission_front", theta)) / tau - 1
            lines.append(
                f"| {width:g} | {theta:g} | {100 * off:.3f} | {l1[0]:.2f} | {l1[1]:.2f} | "
                f"{a.max() / b.max():.3f} | "
                f"{fwhm:.3f} |"
            )
    return [*lines, ""]


def eds10_section() -> list[str]:
    """Real tables, with both errors."""
    lines = [
        "## EDS10, measured (real files)",
        "",
        "| theta_i | tau | se (noise) | systematic bound | its parts |",
        "|---|---|---|---|---|",
    ]
    for theta in (0, 10, 20):
        (table,) = gonio.read(SHARED / "data" / "gonio" / "eds10" / f"EDS10_{theta}-0.txt")
        s = gonio.summarise(table)
        parts = ", ".join(f"{k} {v:.4f}" for k, v in s.systematic.items() if v >= 5e-5)
        lines.append(f"| {theta} | {s.tau:.4f} | {s.tau_se:.4f} | {s.tau_systematic:.4f} | {parts} |")
    return [*lines, ""]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--quick", action="store_true")
    parser.add_argument("-o", "--output", type=Path, default=HERE / "gonio_errors.md")
    args = parser.parse_args()
    warnings.simplefilter("ignore")
    oracle = load_oracle()
    lines = [
        "# Errors of integrated tables",
        "",
        f"Made by `validation/gonio_errors.py` on {date.today().isoformat()}. Everything but EDS10 is "
        f"synthetic.",
        "",
    ]
    for section in (noise_section, bound_section, model_section):
        part = section(oracle, args.quick)
        print("\n".join(part), flush=True)
        lines += part
    lines += eds10_section()
    print("\n".join(lines[-6:]))
    args.output.write_text("\n".join(lines).rstrip() + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
