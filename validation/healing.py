"""Healing of synthetic faces against their known original surface.

Run:  python validation/healing.py curve | twins | speed | figure | table   (results are kept in --folder)

`curve`: heights with the noise of a microscope, coverage from 10 to 95 %. `twins`: 20 panes of two faces,
both healed and the pane traced with the members (with `--stacks` through focus stacks). `table` prints both.
Half an hour on one core.
"""

from __future__ import annotations

import argparse
import json
import resource
import time
import warnings
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from specularia import analysis, glass, surface
from specularia.twin import microscope
from specularia.twin.faces import make_face
from specularia.twin.settings import BackSettings, FaceSettings, MapSettings, MicroscopeSettings

PITCH = 1.5
NOISE_UM = 0.02
COVERAGE = (0.1, 0.3, 0.45, 0.6, 0.75, 0.85, 0.9, 0.95)
SEEDS = (11, 12)
KINDS: dict[str, dict[str, Any]] = {
    "even": {"of": FaceSettings},
    "clustered": {"of": BackSettings},
    "small pits": {"of": FaceSettings, "radius_um": (6.0, 25.0)},
    "steep streaks": {"of": FaceSettings, "streak_slope": 0.03},
}
PATHS = 100_000


def face(kind: str, share: float, seed: int, pixels: int = 512) -> Any:
    settings = dict(KINDS[kind])
    of = settings.pop("of")
    rng = np.random.default_rng([seed, 101])
    return make_face(of(pitted_share=share, **settings), MapSettings(pixels=pixels, pitch_um=PITCH), rng)


def seen(decayed: np.ndarray, seed: int) -> surface.HeightMap:
    """The map with noise that grows on slopes and gaps where they are steepest."""
    rng = np.random.default_rng([seed, 102])
    gy, gx = np.gradient(decayed, PITCH)
    slope = np.hypot(gx, gy)
    sigma = NOISE_UM * np.sqrt(1.0 + (slope / 0.35) ** 2)
    z = decayed + sigma * rng.standard_normal(decayed.shape)
    z[(slope > 1.5) | (rng.random(z.shape) < 0.002)] = np.nan
    return surface.HeightMap(
        z, PITCH, PITCH, sigma_um=np.where(np.isfinite(z), sigma, np.nan), name="synthetic"
    )


def from_stack(decayed: np.ndarray, seed: int) -> surface.HeightMap:
    """The map as reconstructed from a synthetic focus stack."""
    stack = microscope.focus_stack(
        decayed, MicroscopeSettings(), pitch_um=PITCH, rng=np.random.default_rng([seed, 103])
    )
    taken = surface.Stack(stack.slices, (PITCH, PITCH), stack.step_um, stack.z0_um)
    return surface.heights(taken)


def streak(m: surface.HeightMap) -> tuple[float, float]:
    """Amplitude (sqrt 2 rms) and mean wavelength (2 pi rms / rms slope) of the profile across streaks, um."""
    profile = surface.level(m).heights_um.mean(axis=0)
    profile = profile - profile.mean()
    slope = np.gradient(profile, m.pitch_x_um)
    rms = np.sqrt(np.mean(profile**2))
    return float(np.sqrt(2.0) * rms), float(2.0 * np.pi * rms / np.sqrt(np.mean(slope**2)))


def lobe(m: surface.HeightMap) -> float:
    slab = glass.Slab(
        thickness_mm=3.0,
        medium=glass.Medium(index=1.52, absorption_per_mm=0.0),
        front=glass.Face.from_map(m, tiling="mirror", name="front"),
        back=glass.Face.flat("back"),
    )
    return analysis.lobe_width(glass.trace_paths(slab, theta_deg=0.0, paths=PATHS, seed=1), 0.0).fwhm_deg


def rms(a: np.ndarray) -> float:
    return float(np.sqrt(np.mean(np.asarray(a, float) ** 2)))


def one(kind: str, share: float, seed: int) -> dict[str, Any]:
    """All figures of one face."""
    truth = face(kind, share, seed)
    given = seen(truth.decayed_um, seed)
    start = time.process_time()
    healed = surface.heal(given, ensemble=8, seed=seed)
    seconds = time.process_time() - start
    original = surface.HeightMap(truth.pristine_um, PITCH, PITCH)
    found, plateau = ~healed.pits, ~truth.pitted
    error = healed.surface.heights_um - truth.pristine_um
    baselines = {
        m: rms(surface.heal(given, method=m).surface.heights_um - truth.pristine_um)  # type: ignore[arg-type]
        for m in ("flat", "gaussian", "closing")
    }
    members = [healed.member(k) for k in range(len(healed.members))]
    true_streak, true_sdq, true_lobe = streak(original), surface.roughness(original).Sdq, lobe(original)
    sdq = [surface.roughness(m).Sdq for m in members]
    return {
        "kind": kind,
        "share": share,
        "seed": seed,
        "found": healed.pit_coverage,
        "f1": 2.0 * float(np.sum(found & plateau)) / float(found.sum() + plateau.sum()),
        "rms_um": rms(error),
        "said_um": rms(healed.surface.sigma_um),
        "rms_known_um": rms(error[~healed.no_evidence]) if (~healed.no_evidence).any() else None,
        "no_evidence": healed.no_evidence_share,
        "pristine_um": float(truth.pristine_um.std()),
        "baselines_um": baselines,
        "Sdq": surface.roughness(healed.surface).Sdq / true_sdq,
        "Sdq_members": float(np.median(sdq)) / true_sdq,
        "fwhm": lobe(healed.surface) / true_lobe,
        "fwhm_members": float(np.median([lobe(m) for m in members[:3]])) / true_lobe,
        "amplitude": streak(healed.surface)[0] / true_streak[0],
        "wavelength": streak(healed.surface)[1] / true_streak[1],
        "seconds": seconds,
    }


def twin(seed: int, shares: tuple[float, float], stacks: bool) -> dict[str, Any]:
    """A pane of two faces: interval of the healed pane's transmission and lobe, and the truth."""
    faces, truth = {}, {}
    coverage = {}
    for name, kind, share in (("front", "even", shares[0]), ("back", "clustered", shares[1])):
        made = face(kind, share, 1000 * seed + (name == "back"))
        given = (from_stack if stacks else seen)(made.decayed_um, seed)
        healed = surface.heal(given, ensemble=10, seed=seed)
        faces[name] = [healed.member(k) for k in range(len(healed.members))]
        truth[name] = surface.HeightMap(made.pristine_um, PITCH, PITCH)
        coverage[name] = healed.pit_coverage
    slab = glass.Slab(
        thickness_mm=3.0,
        medium=glass.Medium(index=1.52, absorption_per_mm=0.0),
        front=glass.Face.flat("front"),
        back=glass.Face.flat("back"),
    )
    theta = (0.0, 60.0)
    pane = analysis.healed_pane(slab, faces, theta_deg=theta, paths=60_000, seed=seed, tiling="mirror")
    whole = replace(
        slab,
        **{n: glass.Face.from_map(m, tiling="mirror", name=n) for n, m in truth.items()},  # type: ignore[arg-type]
    )
    out: dict[str, Any] = {"seed": seed, "shares": shares, "found": coverage, "theta_deg": theta}
    traced = [glass.trace_paths(whole, theta_deg=t, paths=400_000, seed=7_000 + seed) for t in theta]
    true = {
        "tau": [analysis.tau_of_paths(p)[0] for p in traced],
        "fwhm_deg": [analysis.lobe_width(p, t).fwhm_deg for p, t in zip(traced, theta)],
    }
    for key, values in true.items():
        out[key] = {
            "truth": values,
            "interval": pane.interval(key).tolist(),
            "members": getattr(pane, key).tolist(),
        }
    return out


def kept(folder: Path, name: str, make: Callable[[], Any]) -> Any:
    """The result of a part, made if it is not there."""
    path = folder / f"{name}.json"
    if not path.exists():
        result = make()
        path.write_text(json.dumps(result))
    return json.loads(path.read_text())


def curve(folder: Path) -> list[dict[str, Any]]:
    rows = []
    for kind in KINDS:
        shares = COVERAGE if kind in ("even", "clustered") else (0.3, 0.6, 0.9)
        for share in shares:
            for seed in SEEDS if share in (0.3, 0.6, 0.9) else SEEDS[:1]:
                name = f"curve_{kind}_{share}_{seed}".replace(" ", "_")
                rows.append(kept(folder, name, lambda k=kind, s=share, n=seed: one(k, s, n)))  # type: ignore[misc]
                print(json.dumps({k: v for k, v in rows[-1].items() if k != "baselines_um"}), flush=True)
    return rows


def twins(folder: Path, shares: tuple[float, float], stacks: bool) -> list[dict[str, Any]]:
    rows = []
    for seed in range(1, 21):
        name = f"twin_{shares[0]}_{shares[1]}_{seed}"
        rows.append(kept(folder, name, lambda n=seed: twin(n, shares, stacks)))  # type: ignore[misc]
        print(json.dumps(rows[-1]["tau"] | {"found": rows[-1]["found"]})[:200], flush=True)
    return rows


def speed() -> dict[str, float]:
    """Processor seconds and memory of healing 2048 x 2048 pixels, ensemble of 12."""
    truth = face("even", 0.6, 5, pixels=2048)
    given = seen(truth.decayed_um, 5)
    before = time.process_time()
    healed = surface.heal(given)
    return {
        "cpu_seconds": time.process_time() - before,
        "peak_GB": resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e6,
        "rms_um": rms(healed.surface.heights_um - truth.pristine_um),
    }


def figure(folder: Path) -> Path:
    from specularia.report import figures

    truth = face("clustered", 0.6, 12)
    given = seen(truth.decayed_um, 12)
    healed = surface.heal(given, ensemble=4, seed=1)
    return figures.healed(given, healed, folder / "healed.png", truth_um=truth.pristine_um, synthetic=True)


def middle(values: list[float]) -> str:
    v = np.array([x for x in values if x is not None and np.isfinite(x)])
    return "–" if not v.size else f"{np.median(v):.3g} ({v.min():.3g} to {v.max():.3g})"


def print_table(folder: Path) -> None:
    columns = [
        "f1",
        "rms_um",
        "said_um",
        "no_evidence",
        "Sdq",
        "Sdq_members",
        "fwhm",
        "fwhm_members",
        "amplitude",
        "wavelength",
    ]
    print("| faces | coverage | " + " | ".join(columns) + " | best baseline (um) | rms over it |")
    print("|" + "---|" * (len(columns) + 4))
    rows = [json.loads(p.read_text()) for p in sorted(folder.glob("curve_*.json"))]
    for kind in KINDS:
        for share in sorted({r["share"] for r in rows if r["kind"] == kind}):
            some = [r for r in rows if r["kind"] == kind and r["share"] == share]
            best = [min(r["baselines_um"].values()) for r in some]
            ratio = [r["rms_um"] / b for r, b in zip(some, best)]
            cells = [middle([r[c] for r in some]) for c in columns]
            print(f"| {kind} | {share:.0%} | " + " | ".join(cells) + f" | {middle(best)} | {middle(ratio)} |")
    for stem in sorted({p.stem.rsplit("_", 1)[0] for p in folder.glob("twin_*.json")}):
        found = [json.loads(p.read_text()) for p in sorted(folder.glob(f"{stem}_*.json"))]
        for key in ("tau", "fwhm_deg"):
            for k, theta in enumerate(found[0]["theta_deg"]):
                inside = [
                    r[key]["interval"][k][0] <= r[key]["truth"][k] <= r[key]["interval"][k][1] for r in found
                ]
                width = np.median([np.diff(r[key]["interval"][k])[0] / r[key]["truth"][k] for r in found])
                print(
                    f"{stem} {key} at {theta:g}: {sum(inside)} of {len(inside)} inside, "
                    f"relative width {width:.3g}"
                )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("part", choices=("curve", "twins", "speed", "figure", "table"))
    parser.add_argument("--folder", type=Path, default=Path("healing_results"))
    parser.add_argument("--shares", type=float, nargs=2, default=(0.6, 0.9))
    parser.add_argument("--stacks", action="store_true", help="twins: heights through focus stacks")
    given = parser.parse_args()
    given.folder.mkdir(parents=True, exist_ok=True)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        if given.part == "curve":
            curve(given.folder)
        elif given.part == "twins":
            twins(given.folder, tuple(given.shares), given.stacks)
        elif given.part == "speed":
            print(json.dumps(kept(given.folder, "speed", speed)))
        elif given.part == "figure":
            print(figure(given.folder))
        else:
            print_table(given.folder)


if __name__ == "__main__":
    main()
