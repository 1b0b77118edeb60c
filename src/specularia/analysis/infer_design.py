"""What a pane would send where, for many guesses at its glass: a few traces, and a smooth form between.

Absorption and the number of bubbles re-weight the paths of one trace; relief below the map's cut-off and the
shape of bubbles need traces of their own. Between all of them the logarithm of the light in each cell is a
polynomial of second degree in what is sought.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import combinations_with_replacement, product
from typing import Final

import numpy as np
from numpy.typing import NDArray

from specularia.analysis.lobe_shape import deflection
from specularia.glass import BubbleKind, Medium, Paths, Slab, reweight, trace_paths
from specularia.glass.effort import REPLICATES
from specularia.gonio import Summary
from specularia.gonio.interpolant import Distribution
from specularia.progress import task

__all__ = ["PARAMETERS", "PER_LENGTH", "SECTORS", "THICKNESS", "Cells", "Emulator", "emulate", "light_in_cells", "measured_light"]

Array = NDArray[np.float64]

PARAMETERS: Final = (
    "absorption_per_mm",
    "bubbles_per_cm3",
    "bubble_diameter_mm",
    "bubble_elongation",
    "micro_slope_front",
    "micro_slope_back",
)
"""What can be inferred besides thickness, which is known from them only times absorption or bubbles."""

THICKNESS: Final = "thickness_mm"
"""Can be sought too; needs no traces of its own, since light knows it only times absorption and bubbles."""

PER_LENGTH: Final = ("absorption_per_mm", "bubbles_per_cm3")
"""Parameters whose product with the thickness is what light knows."""

_RINGS_DEG: Final = np.array(
    [0.0, 0.7, 1.4, 2.2, 3.2, 4.5, 6.0, 8.0, 10.5, 13.5, 17.0, 21.0, 26.0, 32.0, 40.0, 50.0, 63.0, 90.0]
)
SECTORS: Final = 3
"""Of a ring: towards the normal, across, and towards the horizon; the two sides across count as one."""

_WHOLE_RINGS: Final = 3
"""The innermost rings are not divided: light that nothing deflects has no azimuth there."""

_LEAST_SHARE: Final = 5e-4
"""Cells with less of the transmitted light are left out."""

_SUB: Final = 8

_FARTHEST_DEG: Final = 80.0
"""Polar angle of exit up to which light is compared. Closer to the horizon instruments see little, and what a
table has there is carried over from its outermost readings."""

_LEAST_COSINE: Final = float(np.cos(np.radians(_FARTHEST_DEG)))


@dataclass(frozen=True)
class Cells:
    """Cells of deflection that hold light at one angle of incidence.

    Attributes
    ----------
    theta_deg : incident angle.
    used : [C] numbers of the cells.
    deflection_deg : [C] the middle of each, for how alike neighbouring cells are.
    """

    theta_deg: float
    used: NDArray[np.intp]
    deflection_deg: Array


def _cell(ux: Array, uy: Array, theta_deg: float) -> NDArray[np.intp]:
    """Number of the cell of directions; light comes from phi = 0."""
    t = np.radians(theta_deg)
    d = deflection(ux, uy, theta_deg)
    uz = np.sqrt(np.maximum(1.0 - ux * ux - uy * uy, 0.0))
    # Azimuth around the undeflected direction, 0 towards the normal.
    psi = np.abs(np.arctan2(uy, ux * np.cos(t) + uz * np.sin(t)))
    ring = np.clip(np.searchsorted(_RINGS_DEG, d, side="right") - 1, 0, _RINGS_DEG.size - 2)
    sector = np.minimum((psi * (SECTORS / np.pi)).astype(np.intp), SECTORS - 1)
    return ring * SECTORS + np.where(ring < _WHOLE_RINGS, 0, sector)


_ALL: Final = (_RINGS_DEG.size - 1) * SECTORS


def light_in_cells(paths: Paths, theta_deg: float) -> Array:
    """[R, cells] share of the light that arrived, which left into each cell, by replicate.

    What leaves beyond `_FARTHEST_DEG`, or is deflected by more than the outermost ring, is in none.
    """
    through = paths.transmitted & (paths.ux**2 + paths.uy**2 < 1.0 - _LEAST_COSINE**2)
    through &= deflection(paths.ux, paths.uy, theta_deg) < _RINGS_DEG[-1]
    cell = _cell(paths.ux[through], paths.uy[through], theta_deg)
    n = REPLICATES
    sums = np.bincount(paths.replicate[through] * _ALL + cell, paths.weight[through], n * _ALL)
    return np.asarray(sums.reshape(n, _ALL) / np.bincount(paths.replicate, minlength=n)[:, None])


def measured_light(found: Distribution, theta_deg: float, seed: int = 0) -> tuple[Array, Array]:
    """[cells] share of the light that a measured distribution sends into each cell, and its standard error.

    Values are taken on a grid of deflection and azimuth, 8 x 8 in each cell; the noise is that of the same
    sums over draws of the table's noise.
    """
    k = (np.arange(_SUB) + 0.5) / _SUB
    low, high = _RINGS_DEG[:-1, None], _RINGS_DEG[1:, None]
    edges = np.cos(np.radians(low + (high - low) * np.arange(_SUB + 1) / _SUB))
    d = np.radians(low + (high - low) * k)[:, None, :, None]
    psi = ((np.arange(SECTORS)[:, None] + k) * (np.pi / SECTORS))[None, :, None, :]
    area = (edges[:, :-1] - edges[:, 1:])[:, None, :, None] * (np.pi / SECTORS / _SUB)
    t = np.radians(theta_deg)
    toward, along = np.sin(d) * np.cos(psi), np.cos(d) + 0.0 * psi
    ux = toward * np.cos(t) - along * np.sin(t)
    uz = toward * np.sin(t) + along * np.cos(t)
    uy = np.sin(d) * np.sin(psi) + 0.0 * ux
    seen = uz > _LEAST_COSINE
    weight = np.broadcast_to(area, ux.shape)[seen] * uz[seen]
    number = np.arange(_ALL).reshape(-1, SECTORS)
    number[:_WHOLE_RINGS] = number[:_WHOLE_RINGS, :1]
    place = np.broadcast_to(number[:, :, None, None], ux.shape)[seen]

    def total(one: Distribution) -> Array:
        both = one.at(ux[seen], uy[seen]) + one.at(ux[seen], -uy[seen])
        return np.asarray(np.bincount(place, both * weight, _ALL), float)

    rng = np.random.default_rng(seed)
    noise = [
        total(replace(found, values=rng.standard_normal(found.values.size) * np.sqrt(found.variance)))
        for _ in range(4)
    ]
    return total(found), np.sqrt(np.mean(np.square(noise), axis=0))


@dataclass(frozen=True)
class Emulator:
    """Logarithm of the light in each cell as a polynomial.

    Attributes
    ----------
    names : of the parameters, [P] of `PARAMETERS`.
    cells : of each angle.
    centre, scale : [P] so that (g(value) - centre) / scale runs over -1 to 1, see `_inner`.
    terms : [T] powers, tuples of parameter numbers; () is the constant.
    coefficients : [T, cells of all angles].
    noise : [cells of all angles] standard error of the logarithm by tracing.
    misfit : [cells of all angles] rms distance of the traced logarithms from the polynomial.
    """

    names: tuple[str, ...]
    cells: tuple[Cells, ...]
    centre: Array
    scale: Array
    terms: tuple[tuple[int, ...], ...]
    coefficients: Array
    noise: Array
    misfit: Array

    @property
    def error(self) -> Array:
        """[cells of all angles] standard error of the logarithm by both."""
        return np.hypot(self.noise, self.misfit)

    def log_light(self, values: Array) -> Array:
        """[..., cells] for values [..., P]."""
        z = (_inner(self.names, values) - self.centre) / self.scale
        columns = [np.prod(z[..., list(t)], axis=-1) if t else np.ones(z.shape[:-1]) for t in self.terms]
        return np.asarray(np.stack(columns, axis=-1) @ self.coefficients)


def _inner(names: Sequence[str], values: Array) -> Array:
    """Parameters as the polynomial takes them: absorption itself, slopes squared, logarithms of the rest."""
    parts = []
    for k, name in enumerate(names):
        v = values[..., k]
        if name == "absorption_per_mm":
            parts.append(v)
        elif name.startswith("micro_slope"):
            parts.append(v * v)
        elif name == "bubbles_per_cm3":
            parts.append(np.sqrt(v))
        else:
            parts.append(np.log(v))
    return np.stack(parts, axis=-1)


def emulate(
    slab: Slab,
    summaries: Sequence[Summary],
    ranges: Mapping[str, tuple[float, float]],
    *,
    paths: int,
    seed: int,
    wavelength_nm: float,
    aperture_deg: float,
) -> Emulator:
    """Trace a pane at a design of guesses, and lay a polynomial through the light in each cell.

    Parameters
    ----------
    slab : the pane; what is not sought stays as it is.
    summaries : the tables, for angles and azimuths.
    ranges : lowest and highest value of each parameter that is sought.
    paths, seed, wavelength_nm : of every trace.
    aperture_deg : full width at half maximum of the instrument's response, which blurs all directions.
    """
    names = tuple(n for n in PARAMETERS if n in ranges)
    ends = np.array([ranges[n] for n in names])
    inner = _inner(names, ends.T)
    centre, scale = inner.mean(axis=0), 0.5 * (inner[1] - inner[0])
    quick = [k for k, n in enumerate(names) if n in ("absorption_per_mm", "bubbles_per_cm3")]
    slow = [k for k in range(len(names)) if k not in quick]
    designs = _composite(len(slow))
    grid = list(product((-1.0, -0.33, 0.33, 1.0), repeat=len(quick)))
    rows: list[Array] = []
    light: list[list[Array]] = [[] for _ in summaries]
    with task("traces of possible panes", len(designs) * len(summaries)) as progress:
        for design in designs:
            z = np.zeros(len(names))
            z[slow] = design
            for k, summary in enumerate(summaries):
                base = _outer(names, z * scale + centre)
                traced = _traced(slab, dict(zip(names, base)), summary, paths, seed, wavelength_nm)
                traced = _blurred(traced, aperture_deg, np.random.default_rng([seed, k]))
                for other in grid:
                    point = z.copy()
                    point[quick] = other
                    wanted = dict(zip(names, _outer(names, point * scale + centre)))
                    weighed = _reweighted(traced, dict(zip(names, base)), wanted)
                    light[k].append(light_in_cells(weighed, summary.table.polar_deg))
                    if k == 0:
                        rows.append(point)
                progress.advance()
    z = np.array(rows)
    terms = tuple(
        t for degree in range(4) for t in combinations_with_replacement(range(len(names)), degree)
        if degree < 3 or (len(set(t)) == 1 and t[0] in quick)
    )  # fmt: skip
    matrix = np.stack([np.prod(z[:, list(t)], axis=1) if t else np.ones(len(z)) for t in terms], axis=1)
    cells, coefficients, noises, misfits = [], [], [], []
    for k, summary in enumerate(summaries):
        stack = np.array(light[k])
        mean = stack.mean(axis=1)
        share = mean / mean.sum(axis=1, keepdims=True)
        used = np.flatnonzero((share > _LEAST_SHARE).all(axis=0))
        logs = np.log(mean[:, used])
        fit, *_ = np.linalg.lstsq(matrix, logs, rcond=None)
        off = np.sqrt(np.mean((logs - matrix @ fit) ** 2, axis=0))
        noise = stack[:, :, used].std(axis=1, ddof=1) / np.sqrt(REPLICATES) / mean[:, used]
        middle = 0.5 * (_RINGS_DEG[:-1] + _RINGS_DEG[1:])
        cells.append(Cells(summary.table.polar_deg, used, middle[used // SECTORS]))
        coefficients.append(fit)
        noises.append(np.median(noise, axis=0))
        misfits.append(off)
    return Emulator(
        names,
        tuple(cells),
        centre,
        scale,
        terms,
        np.hstack(coefficients),
        np.concatenate(noises),
        np.concatenate(misfits),
    )


def _composite(n: int) -> list[Array]:
    """A central composite design: the middle, the corners, and the middle of every side."""
    if n == 0:
        return [np.zeros(0)]
    corners = [np.array(c) for c in product((-1.0, 1.0), repeat=n)] if n <= 3 else _half_corners(n)
    axial = [s * np.eye(n)[k] for k in range(n) for s in (-1.0, 1.0)]
    return [np.zeros(n), *corners, *axial] if n > 1 else [np.zeros(1), *axial]


def _half_corners(n: int) -> list[Array]:
    """Half of the corners: those with an even number of low values; all products of two stay apart."""
    return [np.array(c) for c in product((-1.0, 1.0), repeat=n) if np.prod(c) > 0]


def _outer(names: Sequence[str], inner: Array) -> Array:
    """The inverse of `_inner`."""
    parts = []
    for k, name in enumerate(names):
        v = inner[..., k]
        if name == "absorption_per_mm":
            parts.append(v)
        elif name.startswith("micro_slope"):
            parts.append(np.sqrt(np.maximum(v, 0.0)))
        elif name == "bubbles_per_cm3":
            parts.append(v * v)
        else:
            parts.append(np.exp(v))
    return np.stack(parts, axis=-1)


def with_values(slab: Slab, values: Mapping[str, float], *, density_as_traced: float | None = None) -> Slab:
    """The pane with other values of what is sought; its bubbles become one kind in free flight."""
    changed: dict[str, object] = {}
    if any(n.startswith("bubble") for n in values):
        first = slab.bubble_kinds[0] if slab.bubble_kinds else BubbleKind(per_cm3=1.0, median_mm=0.2)
        changed["bubble_kinds"] = (
            replace(
                first,
                per_cm3=values.get("bubbles_per_cm3", first.per_cm3),
                median_mm=values.get("bubble_diameter_mm", first.median_mm),
                elongation=values.get("bubble_elongation", first.elongation),
                placing="free flight",
            ),
        )
        changed["bubbles"] = None
    if "absorption_per_mm" in values:
        changed["medium"] = Medium(slab.medium.index, values["absorption_per_mm"])
    for side in ("front", "back"):
        if f"micro_slope_{side}" in values:
            changed[side] = replace(getattr(slab, side), micro_slope=float(values[f"micro_slope_{side}"]))
    if THICKNESS in values:
        changed[THICKNESS] = float(values[THICKNESS])
    return replace(slab, **changed)  # type: ignore[arg-type]


def _traced(
    slab: Slab, values: Mapping[str, float], summary: Summary, paths: int, seed: int, wavelength_nm: float
) -> Paths:
    """Paths for one guess, without absorption if that is sought, light coming from phi = 0."""
    table = summary.table
    clear = {**values, "absorption_per_mm": 0.0} if "absorption_per_mm" in values else values
    turn = table.azimuth_deg
    found = trace_paths(
        with_values(slab, clear),
        theta_deg=table.polar_deg,
        phi_deg=turn,
        paths=paths,
        seed=seed,
        wavelength_nm=wavelength_nm,
    )
    c, s = np.cos(np.radians(turn)), np.sin(np.radians(turn))
    return replace(found, ux=found.ux * c + found.uy * s, uy=found.uy * c - found.ux * s)


def _blurred(paths: Paths, aperture_deg: float, rng: np.random.Generator) -> Paths:
    """Directions moved by the instrument's response, a Gaussian; over the horizon none goes."""
    sigma = np.radians(aperture_deg) / np.sqrt(8.0 * np.log(2.0))
    uz = np.sqrt(np.maximum(1.0 - paths.ux**2 - paths.uy**2, 0.0))
    moved = np.stack([paths.ux, paths.uy, uz]) + sigma * rng.standard_normal((3, len(paths)))
    moved /= np.linalg.norm(moved, axis=0)
    return replace(paths, ux=moved[0], uy=moved[1])


def _reweighted(traced: Paths, base: Mapping[str, float], wanted: Mapping[str, float]) -> Paths:
    """The same paths for another absorption and another number of bubbles."""
    more = wanted.get("absorption_per_mm", 0.0)
    ratio = wanted["bubbles_per_cm3"] / base["bubbles_per_cm3"] if "bubbles_per_cm3" in wanted else 1.0
    return reweight(traced, absorption_per_mm=more, density_ratio=ratio)
