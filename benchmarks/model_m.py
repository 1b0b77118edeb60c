"""Model M against Radiance's pabopto2bsdf and bsdf2ttree, on data of known truth, all in one run.

    python benchmarks/model_m.py [PART ...] [--oracles FOLDER] [--data FOLDER] [-o TABLE.md]

Parts: wide, narrow (an analytic BTDF with a lobe of 3.4 or of 1.1 degrees, 160,000 directions at each of
five angles, 1 % of noise, the shadow of a mount), pane, narrow_pane, twin (the same measured on ray-traced
panes and on the default synthetic specimen, whose truth is traced with other random numbers), azimuths (an
elongated lobe at 8 azimuths of incidence, every other one left out), noise (200 draws), bound (40 variants),
eds10 (real files), time. Without a part, all of them.

Each row is a claim with a bar, what Model M reaches and, where it can be asked, what the peer reaches.
Distances of distributions (L1) are integrals of |model - truth| over projected solid angle, over tau, on
cells of 0.005 in direction cosines (0.002 around the lobe of the analytic truth); the noise of a traced
truth is taken off in quadrature. Beside the L1 of traced panes at the measured angles stands that of the
virtual instrument itself, read in the middle of every cell with no model between: its aperture keeps it from
the truth. The peer is its tree at 2^7, and at 2^6 where that says so: Radiance's own look-up of the
interpolant (bsdfquery) is not in the wheel.
"""

from __future__ import annotations

import argparse
import importlib.util
import os
import subprocess
import sys
import tempfile
import time
import warnings
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from datetime import date
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

from specularia import bsdf, gonio, radiance
from specularia.bsdf.build_tree import bin_edges, bin_mean_tau
from specularia.bsdf.tabulated_cells import quadrature_cells
from specularia.errors import RadianceError, SpeculariaWarning
from specularia.gonio.cross_validation import cross_validate
from specularia.provenance import versions

FRONT = "transmission_front"
MEASURED = (0.0, 20.0, 40.0, 60.0, 82.5)
INNER, STEEP = (10.0, 30.0, 50.0), (70.0, 75.0, 80.0)
SHARED = Path(__file__).resolve().parents[2] / "shared"
PARTS = ("wide", "narrow", "pane", "narrow_pane", "twin", "azimuths", "noise", "bound", "eds10", "time")
CELL, FINE, BOX = 0.005, 0.002, 0.15
PATHS = 1_000_000
TRUE_PATHS = 2_000_000
TWIN_TRUE_PATHS = 8_000_000  # subtracting noise in quadrature leaves some of it where cells differ
APERTURE_DEG = 0.3
_KEPT: list[Any] = []  # the library reads freed memory where its objects are let go

Truth = Callable[[float, Any, Any], Any]


@dataclass
class Row:
    """One line of the result: a claim, its bar, both results in words, and whether the bar is met."""

    claim: str
    data: str
    bar: str
    ours: str
    peer: str
    met: bool | None

    def text(self) -> str:
        verdict = {True: "yes", False: "**no**", None: ""}[self.met]
        return f"| {self.claim} | {self.data} | {self.bar} | {self.ours} | {self.peer} | {verdict} |"


@dataclass
class Known:
    """Truth at some incident angles.

    Attributes
    ----------
    tau : by angle.
    cells : by angle: direction cosines and areas of cells, and the mean BSDF in each.
    noise : by angle: L1 of the truth's own noise.
    instrument : by angle: L1 of what the virtual instrument reads in the middle of each cell.
    model : the truth as a model, where it is a formula.
    """

    tau: dict[float, float]
    cells: dict[float, tuple[Any, Any, Any, Any]]
    noise: dict[float, float] = field(default_factory=dict)
    instrument: dict[float, float] = field(default_factory=dict)
    model: Any = None


@dataclass(frozen=True)
class Formula:
    """A BTDF given as a formula, as a scattering model."""

    value: Callable[[float, float, Any, Any], Any]
    tau: Callable[[float, float], float]
    band: str = "Visible"
    sides: tuple[str, ...] = (FRONT,)

    def evaluate(self, side: str, theta_i_deg: Any, phi_i_deg: Any, ux: Any, uy: Any) -> Any:
        found = self.value(float(theta_i_deg), float(phi_i_deg), ux, uy)
        return np.where(ux * ux + uy * uy <= 1.0, found, np.nan)

    def direct_hemispherical(self, side: str, theta_i_deg: Any, phi_i_deg: Any = 0.0) -> Any:
        theta, phi = np.broadcast_arrays(theta_i_deg, phi_i_deg)
        return np.reshape(
            [self.tau(float(t), float(p)) for t, p in zip(theta.ravel(), phi.ravel())], theta.shape
        )

    def quadrature(self, side: str, theta_i_deg: float, phi_i_deg: float = 0.0) -> bsdf.Quadrature:
        x, y, w = quadrature_cells(float(np.sin(np.radians(theta_i_deg))), 256, 256, BOX)
        c, d = np.cos(np.radians(phi_i_deg)), np.sin(np.radians(phi_i_deg))
        return bsdf.Quadrature(x * c - y * d, x * d + y * c, w)


def disk_cells(theta: float) -> tuple[Any, Any, Any]:
    """Cells of 0.005 over the disk, of 0.002 in a box around the undeflected direction."""
    middle = -round(np.sin(np.radians(theta)) / CELL) * CELL

    def square(x0: float, y0: float, half: float, step: float) -> tuple[Any, Any]:
        k = (np.arange(round(2 * half / step)) + 0.5) * step - half
        x, y = np.meshgrid(x0 + k, y0 + k, indexing="ij")
        return x.ravel(), y.ravel()

    x, y = square(0.0, 0.0, 1.0, CELL)
    out = np.maximum(np.abs(x - middle), np.abs(y)) > BOX
    fx, fy = square(middle, 0.0, BOX, FINE)
    area = np.concatenate([np.full(int(out.sum()), CELL**2), np.full(fx.size, FINE**2)])
    x, y = np.concatenate([x[out], fx]), np.concatenate([y[out], fy])
    inside = x * x + y * y <= 1.0
    return x[inside], y[inside], area[inside]


def l1(model: Any, known: Known, theta: float, phi: float = 0.0) -> float:
    """Distance of a model from the truth, without the truth's noise."""
    x, y = known.cells[theta][:2]
    step = CELL / 4
    values = np.zeros_like(x)
    for dx in (-step, step) if known.noise else (0.0,):
        for dy in (-step, step) if known.noise else (0.0,):
            values += np.nan_to_num(model.evaluate(FRONT, theta, phi, x + dx, y + dy))
    values /= 4 if known.noise else 1
    return distance(values, known, theta)


def distance(values: Any, known: Known, theta: float) -> float:
    """Distance of values in the cells from the truth, without the truth's noise."""
    _, _, area, truth = known.cells[theta]
    raw = float(np.sum(area * np.abs(values - truth))) / known.tau[theta]
    return float(np.sqrt(max(raw**2 - known.noise.get(theta, 0.0) ** 2, 0.0)))


def of_formula(model: Formula, angles: Sequence[float], phi: float = 0.0) -> Known:
    """The truth of a formula."""
    cells = {}
    for t in angles:
        x, y, area = disk_cells(t)
        cells[t] = (x, y, area, model.evaluate(FRONT, t, phi, x, y))
    return Known({t: model.tau(t, phi) for t in angles}, cells, model=model)


def of_pane(slab: Any, angles: Sequence[float], seed: int, paths: int = TRUE_PATHS) -> Known:
    """The truth of a pane: paths counted on cells, with the noise that two halves of them tell.

    Where a cell holds few paths the difference of the halves is less than what their mean is off by: counts
    N0, N1 of the mean m / 2 have E|N0 - N1| = m exp(-m) (I0(m) + I1(m)), their sum N has
    E|N - m| = 2 exp(-m) m^(k + 1) / k!, k = floor(m). The ratio, 1 for many and 2 for few, is applied.
    """
    from scipy.ndimage import uniform_filter
    from scipy.special import gammaln, i0e, i1e

    from specularia.glass.trace import trace_paths

    n = round(2 / CELL)
    k = (np.arange(n) + 0.5) * CELL - 1.0
    x, y = (v.ravel() for v in np.meshgrid(k, k, indexing="ij"))
    inside = (np.abs(x) + CELL / 2) ** 2 + (np.abs(y) + CELL / 2) ** 2 <= 1.0
    known = Known({}, {})
    for number, theta in enumerate(angles):
        halves, count = np.zeros((2, n * n)), np.zeros(n * n)
        for h in (0, 1):
            p = trace_paths(slab, theta_deg=theta, paths=paths, seed=seed + 2 * number + h)
            out = p.transmitted
            place = np.floor((p.ux[out] + 1) / CELL) * n + np.floor((p.uy[out] + 1) / CELL)
            halves[h] = np.bincount(place.astype(int), p.weight[out], n * n) / paths
            count += np.bincount(place.astype(int), minlength=n * n)
        m = np.maximum(uniform_filter(count.reshape(n, n), 5).ravel(), 1e-6)
        whole = np.floor(m)
        mean_off = 2.0 * np.exp(-m + (whole + 1.0) * np.log(m) - gammaln(whole + 1.0))
        few = mean_off / (m * (i0e(m) + i1e(m)))
        known.tau[theta] = float(halves.sum() / 2)
        known.noise[theta] = float((few * np.abs(halves[0] - halves[1]))[inside].sum() / 2 / known.tau[theta])
        mean = halves.mean(axis=0)[inside] / CELL**2
        known.cells[theta] = (x[inside], y[inside], np.full(mean.size, CELL**2), mean)
    return known


def instrument_alone(
    slab: Any, known: Known, angles: Sequence[float], aperture_deg: float, paths: int = PATHS
) -> None:
    """What a virtual instrument without noise reads in the middle of each cell, against the truth."""
    from specularia.conventions import direction_angles
    from specularia.glass import photometer

    for number, theta in enumerate(angles):
        x, y, _, _ = known.cells[theta]
        z = -np.sqrt(1.0 - x * x - y * y)
        read = photometer.measure(
            slab,
            theta_deg=theta,
            directions=direction_angles(x, y, z),
            paths=paths,
            seed=950 + number,
            aperture_deg=aperture_deg,
        )
        known.instrument[theta] = distance(read.values / -z, known, theta)


def pane(slopes: tuple[float, float], seed: int = 1) -> Any:
    """A slab between two random reliefs whose periods do not go into each other (else facets pair up)."""
    from specularia.glass import Face, Slab

    def relief(slope: float, pitch: float, seed: int) -> Face:
        n, length = 512, 20.0
        k = 2 * np.pi * np.fft.fftfreq(n, pitch)
        noise = np.fft.fft2(np.random.default_rng(seed).standard_normal((n, n)))
        h = np.fft.ifft2(noise * np.exp(-(k[:, None] ** 2 + k**2) * length**2 / 4)).real
        gy, gx = np.gradient(h, pitch)
        return Face(h * slope / np.sqrt(np.mean(gx**2 + gy**2)), pitch, pitch)

    return Slab(thickness_mm=3.0, front=relief(slopes[0], 1.5, seed), back=relief(slopes[1], 1.593, seed + 1))


def pane_tables(slab: Any, angles: Sequence[float], folder: Path) -> list[Path]:
    """What an instrument would write of a pane."""
    from specularia.glass import photometer

    rng, files, floor = np.random.default_rng(3), [], 0.0
    for number, theta in enumerate(angles):
        directions = photometer.scan(theta, base=100_000, middle=35_000, peak=25_000, rng=rng)
        clean = photometer.measure(
            slab,
            theta_deg=theta,
            directions=directions,
            paths=PATHS,
            seed=900 + number,
            aperture_deg=APERTURE_DEG,
            synthetic=True,
        )
        floor = floor or 1e-6 * float(clean.values.max())
        table = photometer.recorded(clean, relative_noise=0.01, floor=floor, shadow=True, rng=rng)
        files.append(gonio.write(table, folder / f"t{theta:g}.dat"))
    return files


def oracle(folder: Path) -> Any:
    """The generator of tables from an analytic BTDF, as a module."""
    spec = importlib.util.spec_from_file_location("gonio_synthetic", folder / "gonio_synthetic.py")
    if spec is None or spec.loader is None or not (folder / "gonio_synthetic.py").is_file():
        raise SystemExit(f"no gonio_synthetic.py in {folder}; name its folder with --oracles")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def oracle_tables(module: Any, truth: Any, folder: Path, seed: int = 1) -> list[Path]:
    """Tables of the analytic BTDF, as the generator writes them."""
    rng, files = np.random.default_rng(seed), []
    for theta in MEASURED:
        measured = module.measure(truth, theta, 0.0, rng)
        files.append(folder / f"t{theta:g}.dat")
        module.write(str(files[-1]), theta, 0.0, *measured, up_phi=90.0)
    return files


def read(files: Sequence[Path]) -> list[Any]:
    """All tables of some files."""
    return [t for f in files for t in gonio.read(f)]


def peer_trees(files: Sequence[Path], folder: Path) -> dict[int, Any]:
    """What Radiance's programs make of the files, at 2^6 and 2^7; empty where they fail."""
    try:
        (folder / "peer.sir").write_bytes(radiance.run(["pabopto2bsdf", "-t", *map(str, files)]))
        for g in (6, 7):
            tree = radiance.run(["bsdf2ttree", "-p0", "-g", str(g), "peer.sir"], cwd=folder)
            (folder / f"peer{g}.xml").write_bytes(tree)
    except RadianceError as error:
        print(f"the peer fails: {error}", file=sys.stderr)
        return {}
    return {g: bsdf.read(folder / f"peer{g}.xml") for g in (6, 7)}


def percent(values: Any) -> str:
    """Values in percent."""
    return ", ".join(f"{100 * v:.2f}" if abs(v) < 0.095 else f"{100 * v:.1f}" for v in values)


def bins_read_by_radiance(model: Any, path: Path, resolution: int, last: float) -> list[float]:
    """Relative error of tau of each incidence bin that begins inside the data, read by Radiance's library."""
    from pyradiance import bsdf as library

    data, flags = library.load_file(str(path)), library.SAMPLE_ALL & ~library.SAMPLE_R
    _KEPT.append(data)
    edges = bin_edges(resolution)
    out = []
    for high, low in pairwise(edges):
        if low < np.sin(np.radians(last)):
            centre = float(np.degrees(np.arcsin(0.5 * (low + high))))
            found = library.direct_hemi(data, 180.0 - centre, 0.0, flags)
            out.append(found / bin_mean_tau(model, FRONT, low=float(low), high=float(high), count=16) - 1.0)
    return out


def standard(name: str, files: Sequence[Path], known: Known, folder: Path) -> Iterator[Row]:
    """The rows that hold for every set of five angles."""
    narrow, traced = name.startswith("narrow"), bool(known.noise)
    model, peers = gonio.fit(read(files)), peer_trees(files, folder)

    def ask(measure: Callable[[Any], list[float]]) -> tuple[list[float], str, list[float]]:
        theirs = {g: measure(m) for g, m in peers.items()}
        said = "; ".join(f"2^{g}: {percent(v)}" for g, v in theirs.items())
        return measure(model), said, theirs.get(7, [])

    def tau_errors(angles: Sequence[float]) -> Callable[[Any], list[float]]:
        return lambda m: [float(m.direct_hemispherical(FRONT, t)) / known.tau[t] - 1 for t in angles]

    def distances(angles: Sequence[float]) -> Callable[[Any], list[float]]:
        return lambda m: [l1(m, known, t) for t in angles]

    def worst(values: Sequence[float]) -> float:
        return float(np.max(np.abs(values)))

    ours, said, _ = ask(tau_errors(MEASURED))
    good = worst(ours[:-1]) <= 3e-3 and abs(ours[-1]) <= 5e-3
    yield Row("tau at 0, 20, 40, 60, 82.5, off by %", name, "0.3, last 0.5", percent(ours), said, good)
    for g in (6, 7):
        # The library keeps files by their names: each has its own.
        bsdf.write(model, folder / f"ours{g}.xml", resolution=g)
        ours = bins_read_by_radiance(model, folder / f"ours{g}.xml", g, MEASURED[-1])
        theirs = bins_read_by_radiance(model, folder / f"peer{g}.xml", g, MEASURED[-1]) if peers else [np.nan]
        yield Row(
            f"tau of {len(ours)} incidence bins of the XML, 2^{g}, read by Radiance, against the model's "
            "mean over the bin, worst, %",
            name,
            "0.5",
            percent([worst(ours)]),
            percent([worst(theirs)]),
            worst(ours) <= 5e-3,
        )
    bar = 0.04 if traced or narrow else 0.02
    ours, said, _ = ask(distances(MEASURED))
    alone = percent([known.instrument[t] for t in MEASURED]) if known.instrument else ""
    claim = f"L1 at the measured angles, %{f' (the instrument itself: {alone})' if alone else ''}"
    yield Row(claim, name, f"{100 * bar:g}", percent(ours), said, max(ours) <= bar)
    if known.model is not None:
        truth = [bsdf.lobe(known.model, FRONT, theta_i_deg=t) for t in MEASURED]
        for what in ("peak", "fwhm_deg"):

            def ratios(m: Any, what: str = what) -> list[float]:
                found = [bsdf.lobe(m, FRONT, theta_i_deg=t) for t in MEASURED]
                return [getattr(f, what) / getattr(t, what) - 1 for f, t in zip(found, truth)]

            ours, said, _ = ask(ratios)
            label = {"peak": "peak height", "fwhm_deg": "width at half of it"}[what]
            yield Row(f"{label}, off by %", name, "3", percent(ours), said, worst(ours) <= 0.03)
    ours, said, _ = ask(tau_errors(INNER))
    yield Row("tau held out at 10, 30, 50, off by %", name, "1", percent(ours), said, worst(ours) <= 0.01)
    steep = STEEP if traced else STEEP[:1]
    ours, said, _ = ask(tau_errors(steep))
    low, high = model.tau_interval(FRONT, steep, level=0.95)
    inside = [bool(a <= known.tau[t] <= b) for a, b, t in zip(low, high, steep)]
    yield Row(
        f"tau held out at {', '.join(f'{t:g}' for t in steep)}, off by %; truth in the 95 % interval",
        name,
        "8; all" if traced else "(none)",
        f"{percent(ours)}; {sum(inside)} of {len(inside)} "
        f"(half-width {percent((high - low) / 2 / [known.tau[t] for t in steep])})",
        said,
        (worst(ours) <= 0.08 and all(inside)) if traced else None,
    )
    ours, said, _ = ask(distances((*INNER, *steep)))
    limits = np.array([0.04, 0.04, 0.08, *[0.15] * len(steep)]) * (2 if narrow else 1)
    yield Row(
        f"L1 held out at 10, 30, 50, {', '.join(f'{t:g}' for t in steep)}, %",
        name,
        ", ".join(f"{100 * v:g}" for v in limits) if traced else "(none)",
        percent(ours),
        said,
        bool(np.all(ours <= limits)) if traced else None,
    )


def azimuths(module: Any, folder: Path) -> Iterator[Row]:
    """An elongated lobe whose axes stay with the sample, seen from 8 azimuths; every other one held out."""
    base = module.Truth()
    along, across, turned = 0.05, 0.025, np.radians(20.0)

    def lobe(theta: float, phi: float, x: Any, y: Any) -> Any:
        s = np.sin(np.radians(theta))
        dx, dy = x + s * np.cos(np.radians(phi)), y + s * np.sin(np.radians(phi))
        p = dx * np.cos(turned) + dy * np.sin(turned)
        q = dy * np.cos(turned) - dx * np.sin(turned)
        _, w, wn, wb, wd = base.params(theta)
        narrow = np.exp(-0.5 * ((p / along) ** 2 + (q / across) ** 2)) / (2 * np.pi * along * across)
        broad = (1 + (dx * dx + dy * dy) / w**2) ** -base.p / (np.pi * w**2)
        return base.tau(theta) * (wn * narrow + wb * broad + wd / np.pi)

    def tau(theta: float, phi: float) -> float:
        x, y, area = disk_cells(theta)
        c, d = np.cos(np.radians(phi)), np.sin(np.radians(phi))
        return float(np.sum(area * lobe(theta, phi, x * c - y * d, x * d + y * c)))

    rng, tables = np.random.default_rng(4), []
    angles, seen, held = (0.0, 20.0, 40.0, 60.0), (0.0, 90.0, 180.0, 270.0), (45.0, 135.0, 225.0, 315.0)
    for theta in angles:
        for phi in seen if theta else (0.0,):
            v = module.directions(theta, phi, rng, n_base=40_000, n_mid=15_000, n_peak=15_000)
            theta_s = np.degrees(np.arccos(np.clip(v[:, 2], -1, 1)))
            dsf = lobe(theta, phi, v[:, 0], v[:, 1]) * np.abs(v[:, 2])
            tables.append(
                gonio.Table(
                    file="",
                    quantity="DSF",
                    side=FRONT,
                    theta_i_deg=theta,
                    phi_i_deg=phi,
                    theta_s_deg=theta_s,
                    phi_s_deg=np.degrees(np.arctan2(v[:, 1], v[:, 0])) % 360,
                    values=dsf * (1 + 0.01 * rng.standard_normal(dsf.size)),
                    name="analytic BTDF with an elongated lobe",
                    synthetic=True,
                )
            )
    model = gonio.fit(tables, symmetry="none")
    off, apart = [], []
    for theta in angles[1:]:
        for phi in held:
            x, y, area = disk_cells(theta)
            c, d = np.cos(np.radians(phi)), np.sin(np.radians(phi))
            ux, uy = x * c - y * d, x * d + y * c
            truth, exact = lobe(theta, phi, ux, uy), tau(theta, phi)
            off.append(float(model.direct_hemispherical(FRONT, theta, phi)) / exact - 1)
            apart.append(
                float(np.sum(area * np.abs(model.evaluate(FRONT, theta, phi, ux, uy) - truth))) / exact
            )
    yield Row(
        "8 azimuths, those of 45 degrees held out, at 20, 40, 60: tau, worst off by %; L1, worst, %",
        "azimuths",
        "1; 8",
        f"{percent([np.abs(off).max()])}; {percent([max(apart)])}",
        "",
        bool(np.abs(off).max() <= 0.01 and max(apart) <= 0.08),
    )


def as_table(theta: float, measured: tuple[Any, Any, Any]) -> Any:
    """A table of the generator without a file."""
    theta_s, phi_s, dsf = measured
    return gonio.Table(
        file="",
        quantity="DSF",
        side=FRONT,
        theta_i_deg=theta,
        phi_i_deg=0.0,
        theta_s_deg=theta_s,
        phi_s_deg=phi_s,
        values=dsf,
        synthetic=True,
    )


COUNTS = {"n_base": 25_000, "n_mid": 9_000, "n_peak": 6_000}
FEWER = {"n_base": 10_000, "n_mid": 3_500, "n_peak": 2_500}


def noise(module: Any, draws: int = 200) -> Iterator[Row]:
    """The stated noise error of tau against the spread of as many measurements of the same directions."""
    truth, ratios = module.Truth(), []
    for theta in (0.0, 60.0):
        theta_s, phi_s, clean = module.measure(
            truth, theta, 0.0, np.random.default_rng(1), rel=0.0, floor=0.0, dirs=FEWER
        )
        peak = float(truth.dsf(0, 0, np.array([180.0]), np.array([0.0]))[0])
        rng = np.random.default_rng(2)
        found = []
        for _ in range(draws):
            dsf = clean * (1 + 0.01 * rng.standard_normal(clean.size))
            dsf = dsf + 1e-6 * peak * rng.standard_normal(clean.size)
            found.append(gonio.integrate(as_table(theta, (theta_s, phi_s, dsf))))
        tau, stated = np.array(found).T
        ratios.append(float(np.mean(stated) / np.std(tau, ddof=1)) - 1)
    yield Row(
        f"noise error of tau at 0, 60 against the spread of {draws} draws, off by %",
        "wide, 16,000 directions",
        "15",
        percent(ratios),
        "",
        bool(np.max(np.abs(ratios)) <= 0.15),
    )


def bound(module: Any, variants: int = 40) -> Iterator[Row]:
    """How often tau with its noise and its systematic bound holds the truth."""
    rng, widths = np.random.default_rng(5), []
    held = 0
    for k in range(variants):
        truth = module.Truth(sigma=float(10 ** rng.uniform(-2.1, -1.2)), wn=float(rng.uniform(0.2, 0.6)))
        theta = float(rng.choice(MEASURED))
        counts = {n: int(c * rng.uniform(0.3, 1.0)) for n, c in COUNTS.items()}
        counts["th_max"] = float(rng.uniform(80.0, 89.5))
        theta_s, phi_s, dsf = module.measure(
            truth, theta, 0.0, rng, rel=float(10 ** rng.uniform(-3, -1.3)), shadow=False, dirs=counts
        )
        if k % 4:
            width = float(rng.uniform(5.0, 25.0))
            turned = np.abs((phi_s - 270 + 180) % 360 - 180)
            dsf = np.where((turned < width) & (theta_s < 115), 0.02 * dsf, dsf)
        s = gonio.summarise(as_table(theta, (theta_s, phi_s, dsf)))
        half = 1.96 * s.tau_se + s.tau_systematic
        held += int(abs(s.tau - truth.tau(theta)) <= half)
        widths.append(half / truth.tau(theta))
    yield Row(
        f"tau within 1.96 noise errors and the systematic bound of the truth, of {variants} variants "
        f"(bound, median {percent([float(np.median(widths))])} %)",
        "bound",
        f"{round(0.9 * variants)}",
        str(held),
        "",
        held >= round(0.9 * variants),
    )


def eds10(folder: Path) -> Iterator[Row]:
    """Real files: a diffuser measured at 0, 10 and 20 degrees, 10 left out."""
    files = [folder / "gonio" / "eds10" / f"EDS10_{t}-0.txt" for t in (0, 10, 20)]
    if not all(f.is_file() for f in files):
        print(f"no EDS10 files in {folder}", file=sys.stderr)
        return
    (found,) = cross_validate(gonio.summarise_all(read(files)))
    yield Row(
        "tau of 10 left out, off by %; L1, %",
        "EDS10, real",
        "1",
        f"{percent([found.off])}; {percent([found.l1])} "
        f"({'inside' if found.holds else 'outside'} the interval)",
        "",
        abs(found.off) <= 0.01,
    )


def timed(command: Sequence[str], environment: dict[str, str] | None = None, out: Path | None = None) -> Any:
    """Wall and CPU seconds of a program, and its peak memory in GB."""
    start = time.perf_counter()
    with (out or Path(os.devnull)).open("wb") as sink:
        process = subprocess.Popen(list(command), stdout=sink, stderr=subprocess.DEVNULL, env=environment)
        _, status, usage = os.wait4(process.pid, 0)
        process.returncode = status
    if status:
        raise SystemExit(f"{' '.join(command)} failed")
    return np.array([time.perf_counter() - start, usage.ru_utime + usage.ru_stime, usage.ru_maxrss / 1e6])


def speed(files: Sequence[Path], folder: Path, runs: int = 2) -> Iterator[Row]:
    """Five tables to an XML file at 2^7, both ways, taking turns."""
    tools = radiance.folder()
    environment = {
        **os.environ,
        "RAYPATH": f".{os.pathsep}{tools / 'lib'}",
        "PATH": f"{tools / 'bin'}{os.pathsep}{os.environ.get('PATH', '')}",
    }
    ours, theirs = [], []
    command = [sys.executable, "-m", "specularia", "gonio", "fit", *map(str, files), "-q"]
    command += ["-o", str(folder / "speed.xml"), "--resolution", "7"]
    timed(command)
    for _ in range(runs):
        ours.append(timed(command))
        first = timed(
            [str(tools / "bin" / "pabopto2bsdf"), "-t", *map(str, files)], environment, folder / "speed.sir"
        )
        second = timed(
            [str(tools / "bin" / "bsdf2ttree"), "-p0", "-g", "7", str(folder / "speed.sir")],
            environment,
            folder / "speed_peer.xml",
        )
        theirs.append([*(first + second)[:2], max(first[2], second[2])])
    mine, other = np.min(ours, axis=0), np.min(theirs, axis=0)
    yield Row(
        "5 x 160,000 points to XML at 2^7: seconds, wall and CPU (ratio to the peer)",
        "wide",
        "1",
        f"{mine[0]:.1f}, {mine[1]:.1f} ({mine[0] / other[0]:.2f}, {mine[1] / other[1]:.2f}); both sides",
        f"{other[0]:.1f}, {other[1]:.1f}; one side",
        bool(mine[0] <= other[0]),
    )
    yield Row("peak memory, GB", "wide", "1.5", f"{mine[2]:.2f}", f"{other[2]:.2f}", bool(mine[2] <= 1.5))


def rows(part: str, oracles: Path, data: Path, folder: Path) -> Iterator[Row]:
    """All rows of one part."""
    if part in ("wide", "narrow"):
        module = oracle(oracles)
        truth = module.Truth(sigma=0.008) if part == "narrow" else module.Truth()
        model = Formula(truth.bsdf, lambda t, p: truth.tau(t))
        files = oracle_tables(module, truth, folder)
        yield from standard(part, files, of_formula(model, (*MEASURED, *INNER, STEEP[0])), folder)
    elif part in ("pane", "narrow_pane"):
        slab = pane((0.25, 0.2) if part == "pane" else (0.03, 0.04))
        files = pane_tables(slab, MEASURED, folder)
        known = of_pane(slab, (*MEASURED, *INNER, *STEEP), seed=100)
        instrument_alone(slab, known, MEASURED, APERTURE_DEG)
        yield from standard(part, files, known, folder)
    elif part == "twin":
        from specularia import twin
        from specularia.glass.settings import read_slab

        made = twin.make(None, folder / "twin", seed=1)
        slab = read_slab(made.glass)
        known = of_pane(slab, (*MEASURED, *INNER, *STEEP), 100, TWIN_TRUE_PATHS)
        settings = twin.TwinSettings().gonio
        instrument_alone(slab, known, MEASURED, settings.aperture_deg, settings.paths)
        yield from standard(part, list(made.tables), known, folder)
    elif part == "azimuths":
        yield from azimuths(oracle(oracles), folder)
    elif part == "noise":
        yield from noise(oracle(oracles))
    elif part == "bound":
        yield from bound(oracle(oracles))
    elif part == "eds10":
        yield from eds10(data)
    else:
        yield from speed(oracle_tables(oracle(oracles), oracle(oracles).Truth(), folder), folder)


def main() -> int:
    """Measure, print, store."""
    parser = argparse.ArgumentParser(description=str(__doc__).split("\n")[0])
    parser.add_argument("parts", nargs="*", metavar="PART", help=f"out of {', '.join(PARTS)}")
    parser.add_argument(
        "--oracles", type=Path, default=SHARED / "oracles", help="folder of gonio_synthetic.py"
    )
    parser.add_argument("--data", type=Path, default=SHARED / "data", help="folder with gonio/eds10")
    parser.add_argument("-o", "--output", type=Path, help="store the table in this file too")
    given = parser.parse_args()
    if not set(given.parts) <= set(PARTS):
        parser.error(f"parts are {', '.join(PARTS)}")
    used = {
        k: v for k, v in versions().items() if k in ("specularia", "numpy", "scipy", "numba", "pyradiance")
    }
    head = [
        f"{date.today().isoformat()}; " + ", ".join(f"{k} {v}" for k, v in used.items()),
        "",
        "| claim | data | bar | Model M | pabopto2bsdf, bsdf2ttree | met |",
        "|---|---|---|---|---|---|",
    ]
    print("\n".join(head), flush=True)
    lines = []
    for part in given.parts or PARTS:
        with tempfile.TemporaryDirectory() as name, warnings.catch_warnings():
            warnings.simplefilter("ignore", SpeculariaWarning)
            for row in rows(part, given.oracles, given.data, Path(name)):
                lines.append(row.text())
                print(lines[-1], flush=True)
    if given.output:
        given.output.write_text("\n".join([*head, *lines]) + "\n")
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
