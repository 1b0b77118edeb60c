"""Heights from focus stacks, pictures in focus, surface files and texture parameters, against what is known.

    python validation/focus_stacks.py [FOLDER] [--memory]

writes `focus_stacks.md` beside this file. FOLDER holds the real files (default: ../shared/data beside the
repository); without it their sections are left out. About four minutes; with --memory (needs 1 GB of
disk) some two more.

Synthetic stacks have a known surface, whose steepest slope is 20 degrees where the step between slices is one
pixel wide, and normal noise. "bound" is the Cramer-Rao bound.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
import tempfile
import warnings
from datetime import date
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy import stats

from specularia import surface
from specularia.surface.heightmap import FLAGS
from specularia.surface.stack import Stack

HERE = Path(__file__).resolve().parent
Array = NDArray[np.float64]
LEVEL, OFFSET = 1000.0, 100.0

MEMORY = """
import json, re, sys, time
from pathlib import Path
from specularia import surface
start = time.process_time()
surface.heights(sys.argv[1], pitch_um=1.0, step_um=1.0, kind="confocal", output=sys.argv[2])
# Not getrusage, which remembers what the parent held when it started this process.
peak = int(re.search(r"VmHWM:\\s+(\\d+)", Path("/proc/self/status").read_text())[1]) / 2**20
print(json.dumps([peak, time.process_time() - start]))
"""


def relief(pixels: int, steepest: float = np.tan(np.radians(20.0))) -> Array:
    """Heights in slices whose steepest slope, in slices for each pixel, is given."""
    y, x = np.mgrid[0:pixels, 0:pixels] / pixels
    h = np.sin(2 * np.pi * 2 * x) * np.cos(2 * np.pi * y) + 0.3 * np.sin(2 * np.pi * 5 * y)
    gy, gx = np.gradient(h)
    return np.asarray(h * steepest / np.hypot(gx, gy).max())


def answer(z: Array, fwhm: float, response: str) -> Array:
    if response == "Gaussian":
        return np.asarray(np.exp(-4 * np.log(2) * (z / fwhm) ** 2))
    return np.asarray(np.sinc(2 * 0.442946 * z / fwhm) ** 2)


def bound_of(response: str, *, fwhm: float, snr: float) -> float:
    """The Cramer-Rao bound for this response: 1 / sqrt(integral of the squared slope) / snr."""
    z = np.linspace(-20.0 * fwhm, 20.0 * fwhm, 400_001)
    slope = np.gradient(answer(z, fwhm, response), z)
    return float(1.0 / np.sqrt(np.trapezoid(slope * slope, z)) / snr)


def parabola(frames: Array) -> Array:
    """Place of the parabola through the brightest slice and its neighbours."""
    k = np.clip(np.argmax(frames, axis=0), 1, frames.shape[0] - 2)
    a, b, c = (np.take_along_axis(frames, (k + d)[None], 0)[0] for d in (-1, 0, 1))
    return np.asarray(k + 0.5 * (a - c) / np.where(a - 2 * b + c == 0, -1.0, a - 2 * b + c))


def worst_phase(error: Array, h: Array) -> float:
    """Largest mean error in eight classes of the place of the peak between two slices."""
    phase = np.floor(8 * (h % 1.0)).astype(int)
    return max(abs(float(error[phase == k].mean())) for k in range(8))


def estimator() -> list[str]:
    lines = [
        "## Height from a confocal stack",
        "",
        "192 x 192 pixels, slopes to 20 degrees. Errors in slices; `rms` over the Cramer-Rao bound of the",
        "response; `phase` is the largest mean error in eight classes of the place between slices (chance",
        "alone gives about 3 rms / 68).",
        "",
        "| response | FWHM | SNR | bound | rms / bound | bias | phase | in 95 % intervals | no height "
        "| argmax / bound | parabola / bound | phase of the parabola |",
        "|---|---|---|---|---|---|---|---|---|---|---|---|",
    ]
    cases = [(r, 4.0, 30.0) for r in ("Gaussian", "sinc2")]
    cases += [("sinc2", f, 30.0) for f in (2.0, 3.0, 7.0, 12.0, 20.0)]
    cases += [("Gaussian", f, 30.0) for f in (2.0, 20.0)]
    cases += [("Gaussian", 4.0, s) for s in (6.0, 10.0, 100.0, 1000.0)]
    for seed, (response, fwhm, snr) in enumerate(cases):
        rng = np.random.default_rng(seed)
        h = relief(192)
        h = h - h.min() + 2.0 * fwhm + 0.37
        slices = int(np.ceil(h.max() + 2.0 * fwhm))
        frames = OFFSET + LEVEL * answer(np.arange(slices)[:, None, None] - h, fwhm, response)
        frames += LEVEL / snr * rng.standard_normal(frames.shape)
        made = surface.heights(Stack(frames, (1.0, 1.0), 1.0), kind="confocal")
        ok = made.valid
        error, bound = (made.heights_um - h)[ok], bound_of(response, fwhm=fwhm, snr=snr)
        rms = float(np.sqrt(np.mean(error**2)))
        inside = float(np.mean(np.abs(error) < 1.96 * made.sigma_um[ok]))
        brightest = float(np.sqrt(np.mean((np.argmax(frames, axis=0) - h) ** 2)))
        three = parabola(frames) - h
        lines.append(
            f"| {response} | {fwhm:g} | {snr:g} | {bound:.4f} | {rms / bound:.3f} | {error.mean():+.4f} "
            f"| {worst_phase(error, h[ok]):.4f} | {100 * inside:.1f} % | {made.missing} "
            f"| {brightest / bound:.1f} | {float(np.sqrt(np.mean(three**2))) / bound:.2f} "
            f"| {worst_phase(three, h):.3f} |"
        )
    return [*lines, ""]


def faults() -> list[str]:
    lines = [
        "## Planted faults",
        "",
        "160 x 160 pixels, 5 % of each fault: two levels in one pixel (the weaker peak at least 0.5 of the",
        "other, and 0.3 to 0.5 in the row so marked), dead (half of them stuck, half noise alone),",
        "saturated. Counted is what is flagged of each, and what is flagged of all other pixels.",
        "",
        "| response | FWHM | SNR | apart (FWHM) | full scale | double | dead | saturated | false |",
        "|---|---|---|---|---|---|---|---|---|",
    ]
    cases: list[tuple[str, float, float, tuple[float, float], tuple[float, float], int]] = [
        ("Gaussian", 4.0, 30.0, (1.0, 3.0), (0.5, 1.0), 65535),
        ("Gaussian", 4.0, 30.0, (0.7, 1.3), (0.5, 1.0), 65535),
        ("Gaussian", 4.0, 30.0, (1.0, 3.0), (0.3, 0.5), 65535),
        ("sinc2", 4.0, 30.0, (1.0, 3.0), (0.5, 1.0), 4095),
        ("sinc2", 4.0, 30.0, (1.0, 3.0), (0.5, 1.0), 50000),
        ("Gaussian", 2.5, 30.0, (1.0, 3.0), (0.5, 1.0), 65535),
        ("sinc2", 12.0, 30.0, (1.0, 3.0), (0.5, 1.0), 65535),
        ("sinc2", 20.0, 30.0, (1.0, 3.0), (0.5, 1.0), 65535),
        ("Gaussian", 4.0, 12.0, (1.0, 3.0), (0.5, 1.0), 65535),
        ("sinc2", 8.0, 100.0, (1.0, 3.0), (0.5, 1.0), 65535),
    ]
    for seed, (response, fwhm, snr, apart, weaker, top) in enumerate(cases):
        rng = np.random.default_rng(100 + seed)
        h = relief(160)
        h = h - h.min() + 2.5 * fwhm
        slices = int(np.ceil(h.max() + (2.5 + apart[1]) * fwhm))
        z = np.arange(slices)[:, None, None] - h
        frames = OFFSET + LEVEL * answer(z, fwhm, response)
        lot = rng.random(h.shape)
        double, dead, bright = lot < 0.05, (lot >= 0.05) & (lot < 0.1), (lot >= 0.1) & (lot < 0.15)
        ratio, distance = rng.uniform(*weaker, double.sum()), rng.uniform(*apart, double.sum()) * fwhm
        own = z[:, double]
        both = (answer(own, fwhm, response) + ratio * answer(own - distance, fwhm, response)) / (1 + ratio)
        frames[:, double] = OFFSET + LEVEL * both
        frames[:, dead] = OFFSET
        frames += LEVEL / snr * rng.standard_normal(frames.shape)
        stuck = np.flatnonzero(dead.ravel())[::2]
        frames.reshape(slices, -1)[:, stuck] = 0.0
        frames[:, bright] = OFFSET + (frames[:, bright] - OFFSET) * rng.uniform(2.3, 6.0, bright.sum())
        counts = np.clip(np.rint(frames * top / 2000.0), 0, top).astype(np.uint16)
        made = surface.heights(Stack(counts, (1.0, 1.0), 1.0), kind="confocal")
        found = made.flags > 0
        shares = [100.0 * float(found[m].mean()) for m in (double, dead, bright, ~(double | dead | bright))]
        name = f"{apart[0]:g}-{apart[1]:g}" + (" (0.3-0.5)" if weaker[0] < 0.5 else "")
        lines.append(
            f"| {response} | {fwhm:g} | {snr:g} | {name} | {top} | "
            + " | ".join(f"{s:.1f} %" for s in shares)
            + " |"
        )
    return [*lines, ""]


def photographs(data: Path) -> list[str]:
    import imageio.v3 as iio

    frames = np.stack([iio.imread(f) for f in sorted((data / "focus_stack").glob("pcb_*.jpg"))])
    expected = np.asarray(iio.imread(data / "focus_stack" / "expected.jpg"), float)
    taken = Stack(frames, (1.0, 1.0), 1.0, name="photographs")
    lines = [
        "## Photographs through focus",
        "",
        f"{frames.shape[0]} photographs of {frames.shape[2]} x {frames.shape[1]} pixels and a picture",
        "in focus that another program made of them: correlation over all pixels and colours.",
        "",
        "| frames laid over each other | window (pixels) | correlation |",
        "|---|---|---|",
    ]
    for register, window in ((False, 3.0), (True, 1.0), (True, 3.0), (True, 5.0)):
        made, _ = surface.all_in_focus(taken, window_px=window, register=register)
        r = float(np.corrcoef(made.ravel(), expected.ravel())[0, 1])
        lines.append(f"| {'yes' if register else 'no'} | {window:g} | {r:.4f} |")
    return [*lines, ""]


def files(data: Path) -> list[str]:
    lines = [
        "## Real surface files",
        "",
        "As read. tests/surface/test_surface_files.py compares the arrays with bytes decoded by hand.",
        "",
        "| file | format | columns x rows | pitch x, y (um) | field x, y (um) | span (um) | missing |",
        "|---|---|---|---|---|---|---|",
    ]
    for path in sorted((data / "surface").iterdir()):
        m = surface.read(path)
        lines.append(
            f"| {path.name} | {m.attributes['format']} | {m.shape[1]} x {m.shape[0]} "
            f"| {m.pitch_x_um:.6g}, {m.pitch_y_um:.6g} | {m.field_um[0]:.6g}, {m.field_um[1]:.6g} "
            f"| {m.range_um:.6g} | {m.missing} |"
        )
    return [*lines, ""]


def sinusoids() -> list[str]:
    lines = [
        "## A sinusoid in closed form",
        "",
        "512 x 128 pixels of 0.7 um; deviation from 2 a / pi, a / sqrt 2 and sqrt 2 pi a / wavelength.",
        "",
        "| amplitude (um) | waves | Sa | Sq | Sdq |",
        "|---|---|---|---|---|",
    ]
    for amplitude, waves in ((0.5, 3), (0.5, 8), (3.0, 20), (0.02, 30)):
        x = (np.arange(512) + 0.5) / 512
        z = np.tile(amplitude * np.cos(2 * np.pi * waves * x), (128, 1))
        t = surface.texture(surface.HeightMap(z, 0.7, 0.7))
        wanted = (
            2 * amplitude / np.pi,
            amplitude / np.sqrt(2),
            np.sqrt(2) * np.pi * amplitude * waves / (512 * 0.7),
        )
        off = [100 * (a / b - 1) for a, b in zip((t.Sa_um, t.Sq_um, t.Sdq), wanted)]
        lines.append(f"| {amplitude:g} | {waves} | " + " | ".join(f"{o:+.3f} %" for o in off) + " |")
    return [*lines, ""]


def against_others(data: Path) -> list[str]:
    import trimesh
    from SurfaceTopography import Topography

    lines = [
        "## Parameters of real maps beside other libraries",
        "",
        "After removal of the plane. Ours over theirs, minus 1. Sa, Sq, Sdq, spectrum: SurfaceTopography;",
        "Ssk, Sku: SciPy; Sdr: the area of trimesh's triangles; Smr: SurfaceTopography's bearing area at",
        "our heights of 10, 50 and 80 %. Maps with missing pixels only where the other library takes them.",
        "",
        "| file | Sa | Sq | Ssk | Sku | Sdq | Sdr ours / triangles | PSD along x (median) | bearing area |",
        "|---|---|---|---|---|---|---|---|---|",
    ]
    for path in sorted((data / "surface").iterdir()):
        m = surface.read(path)
        if min(m.shape) < 100:
            continue
        flat = surface.level(m)
        t = surface.texture(flat, method="none")
        z = flat.heights_um[flat.valid]
        peer = Topography(np.ma.masked_invalid(flat.heights_um.T), flat.field_um, unit="um")

        def share(ours: float, theirs: float) -> str:
            return f"{100 * (ours / theirs - 1):+.3f} %"

        cells = [share(t.Sa_um, float(np.mean(np.abs(z)))), share(t.Sq_um, float(np.std(z)))]
        if flat.missing == 0:
            cells = [
                share(t.Sa_um, float(np.mean(np.abs(peer.heights())))),
                share(t.Sq_um, peer.rms_height_from_area()),
            ]
        cells += [share(t.Ssk, stats.skew(z)), share(t.Sku, stats.kurtosis(z, fisher=False))]
        if flat.missing == 0:
            rows, columns = flat.shape
            body = surface.slab_mesh(flat, thickness_um=1e4 * flat.range_um)
            top = 2 * (rows - 1) * (columns - 1)
            mesh = trimesh.Trimesh(body.vertices_um, body.triangles[:top], process=False)
            projected = (rows - 1) * flat.pitch_y_um * (columns - 1) * flat.pitch_x_um
            q, power = peer.power_spectrum_from_profile(window="hann", resampling_method=None)[:2]
            ours = surface.power_spectrum(flat)
            theirs = np.interp(2 * np.pi * ours.x_per_um, q[1:], power[1:])
            ratio = float(np.median(2.0 * theirs[2:-2] / ours.x_um3[2:-2]))
            curve = [float(peer.bearing_area(t.ratio.height_um[k])) for k in (1000, 5000, 8000)]
            cells += [
                share(t.Sdq, peer.rms_gradient()),
                f"{t.Sdr:.3g} / {mesh.area / projected - 1:.3g}",
                f"{100 * (ratio - 1):+.2f} %",
                ", ".join(f"{100 * c:.2f}" for c in curve),
            ]
        else:
            cells += ["", "", "", ""]
        lines.append(f"| {path.name} | " + " | ".join(cells) + " |")
    return [
        *lines,
        "",
        "Sdq and Sdr differ where maps hold detail of two or three pixels: SurfaceTopography and triangles",
        "take the difference of neighbours, whose slope belongs half a pixel aside; ours is the seven-point",
        "formula of ISO 4287. On the smooth maps they agree. The bearing area of the other library counts a",
        "surface bent between pixels, ours the pixels themselves.",
        "",
    ]


def memory() -> list[str]:
    lines = [
        "## Memory",
        "",
        "Peak resident memory of one process from the file to the written map (16-bit .npy).",
        "",
        "| pixels | slices | stack on disk (GB) | peak (GB) | CPU seconds |",
        "|---|---|---|---|---|",
    ]
    peaks = []
    for side, slices in ((500, 100), (1000, 100), (1000, 400)):
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "s.npy"
            frames = np.lib.format.open_memmap(path, "w+", "u2", (slices, side, side))
            y, x = np.mgrid[0:side, 0:side].astype(np.float32)
            h = slices / 2 + (slices / 2 - 12) * np.sin(x / 397) * np.cos(y / 443)
            rng = np.random.default_rng(0)
            for k in range(slices):
                noise = 650 * rng.standard_normal(h.shape, dtype=np.float32)
                frames[k] = np.clip(400 + 20000 * answer(k - h, 4.0, "Gaussian") + noise, 0, 65535)
            del frames
            words = [sys.executable, "-W", "ignore", "-c", MEMORY, str(path), str(Path(folder) / "m.nc")]
            ran = subprocess.run(words, capture_output=True, text=True, check=True)
            peak, seconds = json.loads(ran.stdout)
            peaks.append((side, slices, peak))
            size = 2 * slices * side * side / 1e9
            lines.append(f"| {side} x {side} | {slices} | {size:.1f} | {peak:.2f} | {seconds:.0f} |")
    # What grows with the map, from the first two rows; the third holds what grows with the slices.
    by_pixel = (peaks[1][2] - peaks[0][2]) / (1000**2 - 500**2)
    whole = peaks[2][2] + by_pixel * (4000**2 - 1000**2)
    return [
        *lines,
        "",
        f"The map takes some {1e9 * by_pixel:.0f} bytes a pixel (between the first two rows). A stack of",
        f"4000 x 4000 x 400 (12.8 GB on disk) extrapolates to {whole:.1f} GB.",
        "",
    ]


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("folder", nargs="?", type=Path, default=HERE.parents[1] / "shared" / "data")
    parser.add_argument("--memory", action="store_true")
    given = parser.parse_args()
    warnings.simplefilter("ignore")
    assert set(FLAGS) == {"saturated", "dark", "edge", "double", "steep"}
    lines = ["# Surfaces", "", f"Made by `validation/focus_stacks.py` on {date.today()}.", ""]
    lines += estimator() + faults() + sinusoids()
    if given.folder.is_dir():
        lines += photographs(given.folder) + files(given.folder) + against_others(given.folder)
    if given.memory:
        lines += memory()
    (HERE / "focus_stacks.md").write_text("\n".join(lines).rstrip() + "\n", encoding="utf-8")
    print("\n".join(lines))


if __name__ == "__main__":
    main()
