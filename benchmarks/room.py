"""The lit room against quadrature, a radiosity of its own and the published route, all in one run.

    python benchmarks/room.py [--parts PART,...] [--models FOLDER] [-o TABLE.md]

Parts: dark, furnace, patch (analytic panes, closed forms and quadrature), points, seeds, plain, picture,
lattice, panes (Models M and C of the default synthetic specimen). Without --parts, all of them.

Models M and C are made here, from the synthetic specimen at 40,000 paths a direction, or read from m.nc and
c.nc in FOLDER. All panes are synthetic.

The room is the bundled one: 5 x 6 x 3 m, one window of 0.80 x 1.10 m with its sill at 1.0 m, the sun square
to its wall at 75 degrees, a clear sky. Errors are relative to the reference at the same points. The reference
takes the light straight from the pane by quadrature over window, sun's disc and sky with the model's own
values, and the rest from a radiosity on patches of 0.15 m; it shares no code with what is measured but the
room's description, the model and the three amounts of light outside.

CPU seconds count this process and the programs that it starts.
"""

from __future__ import annotations

import argparse
import resource
import tempfile
import warnings
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from datetime import date
from functools import cache
from itertools import pairwise
from pathlib import Path
from typing import Any

import numba as nb
import numpy as np

from specularia import bsdf, daylight
from specularia.conventions import square_to_disk
from specularia.daylight.outdoors import outdoors
from specularia.daylight.plain import Plain
from specularia.errors import SpeculariaWarning
from specularia.provenance import versions

PARTS = ("dark", "furnace", "patch", "points", "seeds", "plain", "picture", "lattice", "panes")
FRONT, BACK = "transmission_front", "transmission_back"
UP = (0.0, 0.0, 1.0)
SIZE = np.array([5.0, 6.0, 3.0])
X0, X1, Z0, Z1, FRAME = 2.1, 2.9, 1.0, 2.1, 0.05
RHO = {"ceiling": 0.7, "walls": 0.7, "floor": 0.15, "frames": 0.15}
BLACK = dict.fromkeys(RHO, 0.0)
PANE_RHO = 0.15
PATHS = 40_000
SUN_DEG = 75.0
SUN_WIDTH_DEG = 0.533
VIEW = {"name": "in", "position_m": (2.5, 5.5, 1.6), "direction": (0, -1, 0), "horizontal_deg": 60.0}


def cpu() -> float:
    """CPU seconds of this process and its children so far."""
    used = [resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)]
    return sum(u.ru_utime + u.ru_stime for u in used)


# Panes whose formula is known


@dataclass(frozen=True)
class Formula:
    """An even diffuser (fwhm_deg = 0) or a Gaussian lobe in direction cosines, reciprocal."""

    tau: float
    fwhm_deg: float = 0.0
    band: str = "Visible"
    sides: tuple[str, ...] = (FRONT, BACK)

    def evaluate(self, side: str, theta_i_deg: Any, phi_i_deg: Any, ux: Any, uy: Any) -> Any:
        s, phi = np.sin(np.radians(theta_i_deg)), np.radians(phi_i_deg)
        dx, dy = s * np.cos(phi) + ux, s * np.sin(phi) + uy
        if self.fwhm_deg == 0.0:
            value = np.full(np.shape(dx), self.tau / np.pi)
        else:
            w = np.radians(self.fwhm_deg) / np.sqrt(8 * np.log(2))
            value = self.tau * np.exp(-(dx * dx + dy * dy) / (2 * w * w)) / (2 * np.pi * w * w)
        return np.where(np.asarray(ux) ** 2 + np.asarray(uy) ** 2 <= 1.0, value, np.nan)

    def quadrature(self, side: str, theta_i_deg: float, phi_i_deg: float = 0.0) -> bsdf.Quadrature:
        n = 160
        k = (np.arange(n) + 0.5) / n
        x, y = square_to_disk(*(v.ravel() for v in np.meshgrid(k, k, indexing="ij")))
        return bsdf.Quadrature(ux=x, uy=y, weight=np.full(x.size, np.pi / x.size))

    def direct_hemispherical(self, side: str, theta_i_deg: Any, phi_i_deg: Any = 0.0) -> Any:
        theta, phi = np.broadcast_arrays(np.asarray(theta_i_deg, float), np.asarray(phi_i_deg, float))
        q = self.quadrature(side, 0.0)
        return np.reshape(
            [
                np.sum(q.weight * self.evaluate(side, t, p, q.ux, q.uy))
                for t, p in zip(theta.ravel(), phi.ravel())
            ],
            theta.shape,
        )


def synthetic_models(folder: Path) -> dict[str, Any]:
    """Models M and C of the default synthetic specimen, made where they are not there."""
    from specularia import glass, gonio, twin
    from specularia.glass.settings import read_slab

    if not ((folder / "m.nc").exists() and (folder / "c.nc").exists()):
        made = twin.make(None, folder / "twin", seed=1)
        bsdf.write(gonio.fit([t for f in made.tables for t in gonio.read(f)]), folder / "m.nc")
        bsdf.write(glass.model(read_slab(made.glass), paths=PATHS, seed=1), folder / "c.nc")
    return {"M": bsdf.read(folder / "m.nc"), "C": bsdf.read(folder / "c.nc")}


# Rooms


def room(**changes: Any) -> daylight.RoomJob:
    """The bundled room, with changes."""
    window = {"wall": "south", "width_m": X1 - X0, "height_m": Z1 - Z0, "sill_m": Z0, "frame_m": FRAME}
    content: dict[str, Any] = {
        "room": dict(zip(("width_m", "depth_m", "height_m"), SIZE)),
        "reflectance": RHO,
        "window": [window | {"pane_reflectance": PANE_RHO} | changes.pop("window", {})],
        "sun": {"elevation_deg": SUN_DEG},
    }
    return daylight.RoomJob.model_validate(content | changes)


def sensors(points: Any, normals: Any) -> list[dict[str, Any]]:
    """Sensors by number."""
    normals = np.broadcast_to(np.asarray(normals, float), np.shape(points))
    return [
        {"name": f"p{k}", "position_m": tuple(map(float, p)), "normal": tuple(map(float, n))}
        for k, (p, n) in enumerate(zip(points, normals))
    ]


def published_points() -> tuple[Any, Any]:
    """25 points on the surfaces of the room: 12 floor, 5 ceiling, 3 west, 2 east, 2 north, 1 window."""
    at = [(x, y, 0.0) for x in (2.5, 1.6, 0.6) for y in (0.42, 1.0, 2.4, 4.8)]
    normals: list[Any] = [(0, 0, 1)] * 12
    at += [(2.5, 0.5, 3.0), (2.5, 1.0, 3.0), (2.5, 3.0, 3.0), (1.0, 1.5, 3.0), (4.0, 4.5, 3.0)]
    normals += [(0, 0, -1)] * 5
    at += [(0.0, 1.0, 0.5), (0.0, 1.5, 1.5), (0.0, 4.0, 1.0), (5.0, 1.5, 1.5), (5.0, 3.0, 2.5)]
    normals += [(1, 0, 0)] * 3 + [(-1, 0, 0)] * 2
    at += [(2.5, 6.0, 0.8), (1.0, 6.0, 2.0), (2.5, 0.0, 1.55)]
    normals += [(0, -1, 0)] * 2 + [(0, 1, 0)]
    return np.array(at, float), np.array(normals, float)


# The reference


def sun_vector() -> Any:
    """Towards the sun, in the room's frame; for the south window x and z are the sample's x and y."""
    e = np.radians(SUN_DEG)
    return np.array([0.0, -np.cos(e), np.sin(e)])


def disc(rings: int = 2, spokes: int = 8) -> Any:
    """[K, 3] directions of equal weight over the sun's disc."""
    sun = sun_vector()
    a, b = np.array([1.0, 0, 0]), np.cross(sun, [1.0, 0, 0])
    out = []
    for rho in np.sqrt((np.arange(rings) + 0.5) / rings) * np.radians(SUN_WIDTH_DEG / 2):
        for psi in (np.arange(spokes) + 0.5) * 2 * np.pi / spokes:
            d = sun + rho * (np.cos(psi) * a + np.sin(psi) * b)
            out.append(d / np.linalg.norm(d))
    return np.array(out)


def clear_sky(out: Any, d: Any) -> Any:
    """CIE clear sky and even ground, cd/m2, towards [K, 3]."""
    sun = sun_vector()
    zs = np.arccos(sun[2])

    def f(g: Any) -> Any:
        return 0.91 + 10 * np.exp(-3 * g) + 0.45 * np.cos(g) ** 2

    gamma = np.arccos(np.clip(d @ sun, -1, 1))
    up = np.maximum(d[:, 2], 1e-3)
    sky = out.zenith * f(gamma) * (1 - np.exp(-0.32 / up)) / (f(zs) * (1 - np.exp(-0.32)))
    return np.where(d[:, 2] > 0, sky, out.ground)


def emitted(model: Any, out: Any, ux: Any, uy: Any) -> Any:
    """Luminance by the sun alone towards direction cosines (x of the room, z of the room) into the room."""
    total = np.zeros(np.shape(ux))
    directions = disc()
    for x, y, z in directions:
        theta, phi = np.degrees(np.arccos(-y)), np.degrees(np.arctan2(z, x))
        total += out.sun_illuminance * -y * np.nan_to_num(model.evaluate(FRONT, theta, phi, ux, uy))
    return total / len(directions)


def sky_share(model: Any, out: Any, ux: float, uy: float) -> float:
    """Luminance by sky and ground towards one direction, by the model's points for light from there."""
    theta, phi = (
        float(np.degrees(np.arcsin(min(np.hypot(ux, uy), 1.0)))),
        float(np.degrees(np.arctan2(uy, ux))),
    )
    q = model.quadrature(BACK, theta, phi)
    f = np.nan_to_num(model.evaluate(BACK, theta, phi, q.ux, q.uy))
    d = np.stack([q.ux, -np.sqrt(np.maximum(1 - q.ux**2 - q.uy**2, 0)), q.uy], axis=1)
    return float(np.sum(q.weight * f * clear_sky(out, d)))


@dataclass(frozen=True)
class SkyTable:
    """Sky's share over the exit direction, on a polar grid about the pane's normal; symmetric in x."""

    theta: Any
    phi: Any
    value: Any

    @classmethod
    def of(cls, model: Any, out: Any) -> SkyTable:
        theta = np.append(np.arange(0.0, 87.5, 3.0), [87.0, 89.0])
        phi = np.arange(-90.0, 90.1, 7.5)
        value = np.array(
            [
                [
                    sky_share(
                        model,
                        out,
                        np.sin(np.radians(t)) * np.cos(np.radians(p)),
                        np.sin(np.radians(t)) * np.sin(np.radians(p)),
                    )
                    for p in phi
                ]
                for t in np.unique(theta)
            ]
        )
        return cls(np.unique(theta), phi, value)

    def at(self, ux: Any, uy: Any) -> Any:
        from scipy.interpolate import RegularGridInterpolator

        t = np.degrees(np.arcsin(np.minimum(np.hypot(ux, uy), 1.0)))
        # The sun stands in the plane x = 0, and the panes are isotropic.
        p = np.degrees(np.arctan2(uy, np.abs(ux)))
        found = RegularGridInterpolator((self.theta, self.phi), self.value, method="cubic")
        return found(np.stack([np.clip(t, 0, self.theta[-1]), np.clip(p, -90, 90)], axis=-1))


def window_points(nx: int, nz: int) -> Any:
    x = X0 + FRAME + (X1 - X0 - 2 * FRAME) * (np.arange(nx) + 0.5) / nx
    z = Z0 + FRAME + (Z1 - Z0 - 2 * FRAME) * (np.arange(nz) + 0.5) / nz
    xx, zz = (v.ravel() for v in np.meshgrid(x, z))
    area = (X1 - X0 - 2 * FRAME) * (Z1 - Z0 - 2 * FRAME) / xx.size
    return np.stack([xx, np.zeros(xx.size), zz], axis=1), area


def straight(light: Callable[[Any, Any], Any], at: Any, normals: Any, nx: int, nz: int) -> Any:
    """lx straight from the pane at points, `light` giving its luminance over direction cosines."""
    w, area = window_points(nx, nz)
    out = np.zeros(len(at))
    for k, (p, n) in enumerate(zip(at, normals)):
        d = p - w
        r = np.linalg.norm(d, axis=1)
        if p[1] <= 0:
            continue
        d = d / r[:, None]
        cosine = np.maximum(-(d @ n), 0.0)
        out[k] = np.sum(light(d[:, 0], d[:, 2]) * d[:, 1] * cosine / r**2) * area
    return out


@nb.njit(cache=False)
def seen_from(points, normals, quads):  # type: ignore[no-untyped-def]
    """Configuration factors of rectangles at points of a convex hull, by Lambert's sum of edges."""
    out = np.zeros((points.shape[0], quads.shape[0]))
    v = np.empty((4, 3))
    for i in range(points.shape[0]):
        for j in range(quads.shape[0]):
            height = 0.0
            for k in range(4):
                for c in range(3):
                    v[k, c] = quads[j, k, c] - points[i, c]
                    height += v[k, c] * normals[i, c]
            if height < 1e-9:
                continue
            total = 0.0
            for k in range(4):
                a, b = v[k], v[(k + 1) % 4]
                cross = np.cross(a, b)
                size = np.sqrt((cross**2).sum())
                if size > 1e-14:
                    total += np.arctan2(size, (a * b).sum()) * (cross * normals[i]).sum() / size
            out[i, j] = abs(total) / (2 * np.pi)
    return out


def lines(length: float, step: float, *more: float) -> Any:
    edges = sorted({0.0, length, *more})
    parts = [np.linspace(a, b, int(np.ceil((b - a) / step - 1e-9)) + 1)[1:] for a, b in pairwise(edges)]
    return np.concatenate([[0.0], *parts])


def patches(step: float, rho: dict[str, float]) -> tuple[Any, Any, Any]:
    """Quads, normals, reflectances of the room's hull."""
    quads, normals, shades = [], [], []
    xw = (X0, X0 + FRAME, X1 - FRAME, X1)
    zw = (Z0, Z0 + FRAME, Z1 - FRAME, Z1)
    for axis in range(3):
        a, b = (k for k in range(3) if k != axis)
        for end in (0, 1):
            south = axis == 1 and end == 0
            ua, ub = (
                lines(SIZE[a], step, *(xw if south else ())),
                lines(SIZE[b], step, *(zw if south else ())),
            )
            for p, q in pairwise(ua):
                for s, t in pairwise(ub):
                    c = np.zeros((4, 3))
                    c[:, axis] = end * SIZE[axis]
                    c[:, a], c[:, b] = (p, q, q, p), (s, s, t, t)
                    quads.append(c)
                    normals.append(np.eye(3)[axis] * (1 - 2 * end))
                    x, z = (p + q) / 2, (s + t) / 2
                    shade = rho[("walls", "walls", "floor" if end == 0 else "ceiling")[axis]]
                    if south and X0 < x < X1 and Z0 < z < Z1:
                        glass = xw[1] < x < xw[2] and zw[1] < z < zw[2]
                        shade = PANE_RHO if glass else rho["frames"]
                    shades.append(shade)
    return np.array(quads), np.array(normals), np.array(shades)


@dataclass
class Reference:
    """Light straight from the pane and reflected, lx, at given points."""

    direct: Any
    reflected: Any

    @property
    def total(self) -> Any:
        return self.direct + self.reflected


def reference(model: Any, job: Any, at: Any, normals: Any, *, step: float = 0.15) -> Reference:
    """The truth for the bundled room under sun and sky."""
    from scipy.interpolate import RegularGridInterpolator

    out = outdoors(job)
    sky = SkyTable.of(model, out)

    def exact(ux: Any, uy: Any) -> Any:
        return emitted(model, out, ux, uy) + sky.at(ux, uy)

    direct = straight(exact, at, normals, 126, 180)
    # For the patches the sun's share comes from a fine table.
    theta, phi = np.arange(0.0, 90.1, 0.5), np.arange(-180.0, 180.1, 1.0)
    tt, pp = np.radians(np.meshgrid(np.minimum(theta, 89.9), phi, indexing="ij"))
    table = emitted(model, out, (np.sin(tt) * np.cos(pp)).ravel(), (np.sin(tt) * np.sin(pp)).ravel())
    sun = RegularGridInterpolator((theta, phi), table.reshape(tt.shape))

    def quick(ux: Any, uy: Any) -> Any:
        t = np.degrees(np.arcsin(np.minimum(np.hypot(ux, uy), 1.0)))
        return sun(np.stack([np.clip(t, 0, 90), np.degrees(np.arctan2(uy, ux))], axis=-1)) + sky.at(ux, uy)

    quads, n, rho = patches(step, RHO)
    first = np.zeros(len(quads))
    for s in (0.25, 0.75):
        for t in (0.25, 0.75):
            place = quads[:, 0] + s * (quads[:, 1] - quads[:, 0]) + t * (quads[:, 3] - quads[:, 0])
            first += straight(quick, place, n, 7, 10) / 4
    factors = seen_from(quads.mean(axis=1), n, quads)
    received = first.copy()
    for _ in range(60):
        received = first + factors @ (rho * received)
    reflected = seen_from(at, normals, quads) @ (rho * received)
    return Reference(direct, reflected)


# Rows


@dataclass(frozen=True)
class Row:
    """A claim, its bar, what came out, and whether the bar is met."""

    claim: str
    bar: str
    found: str
    met: bool | None

    def text(self) -> str:
        verdict = {True: "yes", False: "**no**", None: ""}[self.met]
        return f"| {self.claim} | {self.bar} | {self.found} | {verdict} |"


def errors(got: Any, truth: Any) -> tuple[float, float]:
    """Root mean square and maximum of relative errors, in percent."""
    off = 100 * (np.asarray(got) / np.asarray(truth) - 1)
    return float(np.sqrt(np.mean(off**2))), float(np.max(np.abs(off)))


def lux(points: Any, model: str | None = None) -> Any:
    return np.array([p.illuminance_lx for p in points if model in (None, p.model)])


def dark() -> Iterator[Row]:
    at, normals = published_points()
    for method in ("sources", "plain"):
        job = room(sensor=sensors(at, normals))
        few = Plain(options=("-ab", "2", "-ad", "512", "-as", "0", "-ss", "4"), resolution=4, repeats=2)
        lit = daylight.run(job, models={"opaque": Formula(0.0)}, method=method, plain=few)
        worst = float(np.max(lux(lit.points)))
        name = "closed room, sun and sky outside, 25 points" + (", plain route" if method == "plain" else "")
        yield Row(name, "0 lx", f"{worst:g} lx at most", worst == 0.0)


def furnace() -> Iterator[Row]:
    """One reflectance everywhere and a diffuser in the window: mean E = flux / (area (1 - rho))."""
    rho, size, n = 0.8, np.array([3.0, 4.0, 2.5]), 0.2
    rng = np.random.default_rng(3)
    at, normals, weights = [], [], []
    for axis in range(3):
        a, b = (k for k in range(3) if k != axis)
        na, nb_ = round(size[a] / n), round(size[b] / n)
        for end in (0, 1):
            for i, j in np.ndindex(na, nb_):
                p = np.zeros(3)
                p[a], p[b] = (i + rng.random()) / na * size[a], (j + rng.random()) / nb_ * size[b]
                p[axis] = end * size[axis]
                at.append(p)
                normals.append(np.eye(3)[axis] * (1 - 2 * end))
                weights.append(size[a] * size[b] / (na * nb_))
    job = room(
        room=dict(zip(("width_m", "depth_m", "height_m"), size)),
        reflectance=dict.fromkeys(RHO, rho),
        window={"pane_reflectance": rho},
        sky={"kind": "uniform", "horizontal_illuminance_lx": 1e4},
        ground={"reflectance": 0.0},
        sun={"elevation_deg": 40.0, "normal_illuminance_lx": 0.0},
        sensor=sensors(at, normals),
    )
    got = lux(daylight.run(job, models={"d": Formula(0.5)}).points)
    area = 2 * (size[0] * size[1] + size[1] * size[2] + size[0] * size[2])
    pane = (X1 - X0 - 2 * FRAME) * (Z1 - Z0 - 2 * FRAME)
    truth = 0.5 * 5e3 * pane / (area * (1 - rho))
    off = 100 * (np.average(got, weights=weights) / truth - 1)
    yield Row(
        f"white furnace: mean of {len(at)} points, reflectance 0.8", "1 %", f"{off:+.2f} %", abs(off) <= 1
    )


def patch() -> Iterator[Row]:
    at = np.array([(x, y, 0.0) for x in (2.5, 2.75, 2.95, 3.6) for y in (0.2, 0.5, 0.9)])
    for fwhm in (3.0, 10.0):
        model = Formula(0.6, fwhm)
        job = room(
            reflectance=BLACK,
            window={"pane_reflectance": 0.0},
            sun={"elevation_deg": SUN_DEG, "normal_illuminance_lx": 8e4},
            sky={"kind": "none"},
            ground={"reflectance": 0.0},
            sensor=sensors(at, UP),
        )
        out = outdoors(job)
        truth = straight(
            lambda x, y, m=model, o=out: emitted(m, o, x, y), at, np.broadcast_to(UP, at.shape), 210, 300
        )
        begin = cpu()
        got = lux(daylight.run(job, models={"lobe": model}).points)
        used = cpu() - begin
        shown = truth > 1e-3 * truth.max()
        rms, worst = errors(got[shown], truth[shown])
        yield Row(
            f"sun patch, lobe of {fwhm:g} degrees, 12 floor points ({int(shown.sum())} above 0.1 % of the "
            "brightest)",
            "2 % each",
            f"rms {rms:.2f} %, largest {worst:.2f} %; {used:.1f} CPU s",
            worst <= 2.0,
        )


def cut(points: Any, at: Any, truth: Any) -> tuple[str, float]:
    """Errors in words, and the largest one away from the window's wall."""
    far, got = at[:, 1] > 0.1, lux(points)
    rms, worst = errors(got[far], truth[far])
    near = errors(got[~far], truth[~far])[1]
    return f"rms {rms:.2f} %, largest {worst:.2f} %; on the window's wall {near:.2f} %", worst


class Shared:
    """Models and references, made once."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.at, self.normals = published_points()
        self.job = room(sensor=sensors(self.at, self.normals))

    @cache  # noqa: B019
    def models(self) -> dict[str, Any]:
        return synthetic_models(self.folder)

    @cache  # noqa: B019
    def truth(self, name: str) -> Any:
        return reference(self.models()[name], self.job, self.at, self.normals).total


def points(shared: Shared) -> Iterator[Row]:
    m = shared.models()
    for name, model in m.items():
        truth = shared.truth(name)
        coarse = reference(model, shared.job, shared.at, shared.normals, step=0.25).total
        begin = cpu()
        lit = daylight.run(shared.job, models={name: model})
        used = cpu() - begin
        said, worst = cut(lit.points, shared.at, truth)
        se = max(p.se / p.illuminance_lx for p in lit.points)
        shift = errors(coarse, truth)[1]
        yield Row(
            f"25 points, sun and sky, all bounces, Model {name}",
            "2 % each beyond 0.1 m from the window's wall",
            f"{said}; stated standard error {100 * se:.2f} % at most; {used:.1f} CPU s "
            f"(the reference with patches of 0.25 m: {shift:.2f} % off)",
            worst <= 2.0,
        )


def seeds(shared: Shared) -> Iterator[Row]:
    model = shared.models()["C"]
    values = np.array([lux(daylight.run(shared.job, models={"C": model}, seed=s).points) for s in range(5)])
    spread = 100 * values.std(axis=0, ddof=1) / values.mean(axis=0)
    yield Row(
        "the same, spread over 5 seeds, Model C",
        "median 1 %, largest 2.5 %",
        f"median {np.median(spread):.3f} %, largest {spread.max():.3f} %",
        bool(np.median(spread) <= 1.0 and spread.max() <= 2.5),
    )


def plain(shared: Shared) -> Iterator[Row]:
    """Both routes: the points of each model, then a picture with each, which takes the longest."""
    picture = shared.job.model_copy(
        update={"view": room(view=[VIEW | {"size_px": (240, 180)}]).view, "sensor": ()}
    )
    far = shared.at[:, 1] > 0.1
    used: dict[str, list[float]] = {}
    better: dict[str, bool] = {}
    for name, model in shared.models().items():
        # What is compiled on first use is not counted.
        daylight.run(shared.job.model_copy(update={"sensor": shared.job.sensor[:1]}), models={name: model})
        truth = shared.truth(name)
        found = []
        used[name] = []
        for options in _ROUTES:
            begin = cpu()
            found.append(daylight.run(shared.job, models={name: model}, **options))
            used[name].append(cpu() - begin)
        ours, theirs = (errors(lux(one.points, name)[far], truth[far]) for one in found)
        better[name] = bool(ours[0] < theirs[0])
        yield Row(
            f"25 points, Model {name}, against the plain route at the paper's options",
            "less rms error",
            f"rms {ours[0]:.2f} % (largest {ours[1]:.1f}) against {theirs[0]:.1f} % ({theirs[1]:.1f}); "
            f"{used[name][0]:.1f} against {used[name][1]:.0f} CPU s",
            better[name],
        )
    for name, model in shared.models().items():
        lit = []
        for k, options in enumerate(_ROUTES):
            with tempfile.TemporaryDirectory() as folder:
                begin = cpu()
                lit.append(daylight.run(picture, models={name: model}, folder=folder, **options))
                used[name][k] += cpu() - begin
        mean = float(lit[1].images[0].luminance.mean() / lit[0].images[0].luminance.mean())
        ours_s, theirs_s = used[name]
        yield Row(
            f"the same points and a picture of 240 x 180, Model {name}",
            "20 times less CPU time, less rms error",
            f"{ours_s:.1f} against {theirs_s:.0f} CPU s, {theirs_s / ours_s:.1f} times less; mean of the "
            f"plain picture over ours {mean:.3f}",
            bool(theirs_s >= 20 * ours_s and better[name]),
        )


_ROUTES: tuple[dict[str, Any], ...] = ({}, {"method": "plain", "plain": Plain(repeats=1)})


def picture(shared: Shared) -> Iterator[Row]:
    job = room(view=[VIEW | {"size_px": (640, 480)}])
    with tempfile.TemporaryDirectory() as folder:
        begin = cpu()
        daylight.run(job, models={"C": shared.models()["C"]}, folder=folder)
        used = cpu() - begin
    yield Row("a picture of 640 x 480, Model C", "aim: 60 CPU s", f"{used:.1f} CPU s", used < 60.0)


def lattice(shared: Shared) -> Iterator[Row]:
    """Panes with models of their own, some turned, in windows of two walls."""
    shared.models()
    used = {}
    for rows, columns in ((1, 5), (2, 5), (4, 5)):
        names = ["M", "C", "C, turned", "M, turned", "*"]
        plan = [[names[(r + 2 * c) % 5] for c in range(columns)] for r in range(rows)]
        half = {
            "width_m": 0.8,
            "height_m": 1.1,
            "sill_m": 1.0,
            "frame_m": 0.05,
            "rows": rows,
            "columns": columns,
            "bar_m": 0.012,
            "panes": plan,
        }
        files = {"M": shared.folder / "m.nc", "C": shared.folder / "c.nc"}
        job = room(
            sensor=sensors(shared.at[:5], shared.normals[:5]),
            glass=[
                {"name": n, "file": files[n[0]], "turn_deg": 90.0 if "turned" in n else 0.0}
                for n in names[:4]
            ],
        )
        job = job.model_copy(
            update={
                "window": tuple(
                    daylight.job.Window.model_validate(
                        half | {"name": w, "wall": w, "pane_reflectance": 0.15}
                    )
                    for w in ("south", "east")
                )
            }
        )
        begin = cpu()
        lit = daylight.run(job, models={"C": shared.models()["C"]})
        used[2 * rows * columns] = cpu() - begin
        assert len(lit.panes) == 2 * rows * columns and min(lux(lit.points)) > 0.0
    ten, twenty, forty = used.values()
    yield Row(
        "lattices of 5, 10 and 20 panes in each of two walls, 4 glasses and the model, some turned, 5 points",
        "runs; time grows no faster than panes",
        f"{ten:.1f}, {twenty:.1f}, {forty:.1f} CPU s for 10, 20, 40 panes",
        bool(twenty <= 2 * ten and forty <= 2 * twenty),
    )


def panes(shared: Shared) -> Iterator[Row]:
    """The middle of the pane in narrow pictures from five places, against the model."""
    eyes = [(2.5, 5.5, 1.6), (2.5, 1.2, 0.2), (0.4, 2.0, 1.2), (4.6, 0.8, 2.6), (2.2, 3.0, 0.4)]
    middle = np.array([2.5, 0.0, 1.55])
    views = [
        {
            "name": f"v{k}",
            "position_m": e,
            "direction": tuple(middle - np.array(e)),
            "horizontal_deg": 1.5,
            "size_px": (9, 9),
        }
        for k, e in enumerate(eyes)
    ]
    for name, model in [
        ("lobe of 10 degrees", Formula(0.6, 10.0)),
        *((f"Model {n}", m) for n, m in shared.models().items()),
    ]:
        job = room(reflectance=BLACK, window={"pane_reflectance": 0.0}, view=views)
        out = outdoors(job)
        with tempfile.TemporaryDirectory() as folder:
            lit = daylight.run(job, models={"m": model}, folder=folder)
        got, truth = [], []
        for e, image in zip(eyes, lit.images):
            d = (np.array(e) - middle) / np.linalg.norm(np.array(e) - middle)
            sun = emitted(model, out, np.array([d[0]]), np.array([d[2]]))[0]
            truth.append(float(sun) + sky_share(model, out, d[0], d[2]))
            got.append(float(image.luminance[4, 4]))
        off = 100 * (np.array(got) / np.array(truth) - 1)
        yield Row(
            f"luminance of the pane in pictures from five places, {name}",
            "0.5 %",
            f"{', '.join(f'{v:+.2f}' for v in off)} % ({', '.join(f'{v:,.0f}' for v in truth)} cd/m2)",
            bool(np.max(np.abs(off)) <= 0.5),
        )


def main() -> int:
    """Measure, print, store."""
    parser = argparse.ArgumentParser(description=str(__doc__).split("\n")[0])
    parser.add_argument("--parts", default=",".join(PARTS), help=f"out of {', '.join(PARTS)}")
    parser.add_argument("--models", type=Path, help="folder of m.nc and c.nc, made there if they are missing")
    parser.add_argument("-o", "--output", type=Path, help="store the table in this file too")
    given = parser.parse_args()
    chosen = given.parts.split(",")
    if not set(chosen) <= set(PARTS):
        parser.error(f"parts are {', '.join(PARTS)}")
    used = {
        k: v for k, v in versions().items() if k in ("specularia", "numpy", "scipy", "numba", "pyradiance")
    }
    head = [
        f"{date.today().isoformat()}; " + ", ".join(f"{k} {v}" for k, v in used.items()),
        "",
        "| claim | bar | found | met |",
        "|---|---|---|---|",
    ]
    print("\n".join(head), flush=True)
    rows = []
    with tempfile.TemporaryDirectory() as name, warnings.catch_warnings():
        warnings.simplefilter("ignore", SpeculariaWarning)
        shared = Shared(given.models or Path(name))
        for part in chosen:
            alone = globals()[part]
            for row in alone() if part in ("dark", "furnace", "patch") else alone(shared):
                rows.append(row.text())
                print(rows[-1], flush=True)
    if given.output:
        given.output.write_text("\n".join([*head, *rows]) + "\n")
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
