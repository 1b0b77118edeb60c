"""The light of many guesses at a pane's glass: some traces, and a smooth form between them.

The logarithm of the light in each cell is a polynomial in features of the guess. A lobe that fine relief
widens depends on one sum above all, the variance of all slopes, and the light in a ring is smooth in that
sum's logarithm over any range: it is one feature, and how much of it the front has is the other.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import product
from typing import Final

import numpy as np
from numpy.typing import NDArray

from specularia.analysis.infer_design import (
    LEAST_SHARE,
    RINGS_DEG,
    SECTORS,
    Cells,
    blurred,
    light_in_cells,
    places,
    reweighted,
    traced,
)
from specularia.glass import Face, Slab
from specularia.glass.effort import REPLICATES
from specularia.gonio import Summary
from specularia.progress import task

__all__ = ["COARSE", "FINE", "Design", "Emulator", "Features", "emulate"]

Array = NDArray[np.float64]

_QUICK: Final = ("absorption_per_mm", "bubbles_per_cm3")
_LEVELS: Final = (-1.0, -0.33, 0.33, 1.0)
"""Of a quick parameter, over its range, at every traced guess."""


@dataclass(frozen=True)
class Design:
    """How densely guesses lie, and of what degree the polynomial is.

    Attributes
    ----------
    powers : highest power of a feature; 2 of those not named. Products are of two features.
    degree : highest of a product.
    guesses : traces at each angle, by the number of slow parameters; the last is for any more.
    """

    powers: Mapping[str, int]
    degree: int
    guesses: tuple[int, ...]


COARSE: Final = Design(
    {"w": 4, "front": 3, "absorption_per_mm": 3, "bubbles_per_cm3": 3}, 4, (1, 12, 40, 64, 96)
)
"""Over all that a prior allows."""

FINE: Final = Design(
    {"w": 2, "front": 2, "absorption_per_mm": 3, "bubbles_per_cm3": 3}, 3, (1, 8, 20, 32, 56)
)
"""Over a small part of it."""

_FOLDS: Final = 5

_RANK: Final = 1e-7
"""Singular values below this share of the largest count as none."""

_NOISIEST: Final = 0.5
"""Relative error by tracing above which, at any guess, a cell is left out."""

_CORNERS: Final = 16
"""Corners of the box of guesses that are traced, at most."""

_ENCOUNTERS: Final = 0.04
"""Bubbles that a path meets on the mean in a trace, at least; in most panes it is far fewer, and a trace with
as many as the pane has would hold little of their light. The paths are weighed back."""

_STEP: Final = 1e-3
"""Of the logarithm of a parameter, for derivatives."""

_PILOT: Final = 1600
"""Paths from which the mean number of bubbles met is read."""

_FINEST: Final = 5e-3
"""Slope below which a lobe is no narrower for the instrument."""


@dataclass(frozen=True)
class Features:
    """What the polynomial is a polynomial of.

    Attributes
    ----------
    names : of the parameters, [P].
    core : variance of the gentler half of the slopes of both maps along one direction.
    fixed : micro-slopes of the front and the back where they are not sought.
    centre, scale : [F] so that features run over about -1 to 1.
    design : that of the polynomial.
    """

    names: tuple[str, ...]
    core: float
    fixed: tuple[float, float]
    centre: Array
    scale: Array
    design: Design

    @classmethod
    def of(cls, slab: Slab, ranges: Mapping[str, tuple[float, float]], design: Design) -> Features:
        names = tuple(ranges)
        core = _FINEST**2 + sum(_gentle_variance(f) for f in (slab.front, slab.back))
        fixed = (slab.front.micro_slope, slab.back.micro_slope)
        raw = cls(names, core, fixed, np.zeros(1), np.ones(1), design)
        corners = np.array(list(product(*(ranges[n] for n in names))))
        found = raw.raw(corners)
        low, high = found.min(axis=0), found.max(axis=0)
        return replace(raw, centre=0.5 * (low + high), scale=np.maximum(0.5 * (high - low), 1e-12))

    @property
    def columns(self) -> tuple[str, ...]:
        """Names of the features, [F]."""
        slopes = [n for n in self.names if n.startswith("micro_slope")]
        rest = [n for n in self.names if n not in slopes]
        return tuple(rest + (["w"] if slopes else []) + (["front"] if len(slopes) == 2 else []))

    def raw(self, values: Array) -> Array:
        """[..., F] of values [..., P], before they are scaled."""
        slope = [np.asarray(v) for v in self.fixed]
        parts = []
        for k, name in enumerate(self.names):
            v = values[..., k]
            if name.startswith("micro_slope"):
                slope[name.endswith("back")] = v
            elif name == "bubbles_per_cm3":
                parts.append(np.sqrt(v))
            else:
                parts.append(v if name == "absorption_per_mm" else np.log(v))
        front, back = slope[0] ** 2, slope[1] ** 2
        whole = self.core + front + back
        more = {"w": np.log(whole), "front": (front - back) / whole}
        parts += [more[n] for n in self.columns if n in more]
        return np.stack([np.broadcast_to(p, values.shape[:-1]) for p in parts], axis=-1)

    def __call__(self, values: Array) -> Array:
        """[..., F] of values [..., P]."""
        return np.asarray((self.raw(values) - self.centre) / self.scale)

    @property
    def terms(self) -> tuple[tuple[int, ...], ...]:
        """Powers of the features in each term of the polynomial, [T, F]."""
        most = [self.design.powers.get(n, 2) for n in self.columns]
        every = product(*(range(m + 1) for m in most))
        return tuple(
            t
            for t in every
            if sum(p > 0 for p in t) <= 2
            and sum(t) <= (self.design.degree if sum(p > 0 for p in t) == 2 else max(most))
        )


def _gentle_variance(face: Face) -> float:
    """Variance of a map's slopes along one direction if all were distributed as the gentler half is."""
    if face.heights_um is None:
        return 0.0
    along = np.diff(face.heights_um, axis=1)[:-1] / face.pitch_x_um
    across = np.diff(face.heights_um, axis=0)[:, :-1] / face.pitch_y_um
    return float(np.nanmedian(along**2 + across**2)) / (2.0 * np.log(2.0))


@dataclass(frozen=True)
class Emulator:
    """Logarithm of the light in each cell as a polynomial.

    Attributes
    ----------
    features : of the parameters.
    cells : of each angle.
    coefficients : [T, cells of all angles].
    noise : [cells of all angles] standard error of the polynomial by the noise of the traces it goes through,
        on the mean over the guesses.
    misfit : [cells of all angles] rms distance from the polynomial of guesses that it was made without, less
        the noise of both.
    single : [cells of all angles] standard error of the logarithm by one trace.
    weights : [guesses, T] of the traces of each guess in the coefficients.
    """

    features: Features
    cells: tuple[Cells, ...]
    coefficients: Array
    noise: Array
    misfit: Array
    single: Array
    weights: Array

    @property
    def names(self) -> tuple[str, ...]:
        """Of the parameters, [P]."""
        return self.features.names

    @property
    def error(self) -> Array:
        """[cells of all angles] standard error of the logarithm by both."""
        return np.hypot(self.noise, self.misfit)

    def log_light(self, values: Array) -> Array:
        """[..., cells] for values [..., P]."""
        return np.asarray(_matrix(self.features, values) @ self.coefficients)

    def slopes(self, values: Array) -> tuple[Array, Array]:
        """Derivatives of the logarithm by the logarithms of values [P], and what noise makes of them.

        Returns
        -------
        [P, cells], and [P, P]: covariance of their errors in a cell over `single` squared.
        """
        up = values * np.exp(_STEP * np.eye(len(values)))
        down = values * np.exp(-_STEP * np.eye(len(values)))
        terms = (_matrix(self.features, up) - _matrix(self.features, down)) / (2.0 * _STEP)
        by_guess = terms @ self.weights.T
        return terms @ self.coefficients, by_guess @ by_guess.T


def _matrix(features: Features, values: Array) -> Array:
    """[..., T] terms of the polynomial."""
    z = features(values)
    columns = []
    for term in features.terms:
        product_ = np.ones(z.shape[:-1])
        for k, power in enumerate(term):
            if power:
                product_ = product_ * z[..., k] ** power
        columns.append(product_)
    return np.stack(columns, axis=-1)


def emulate(
    slab: Slab,
    summaries: Sequence[Summary],
    ranges: Mapping[str, tuple[float, float]],
    *,
    paths: int,
    seed: int,
    wavelength_nm: float,
    aperture_deg: float,
    design: Design = COARSE,
) -> Emulator:
    """Trace a pane at a design of guesses, and lay a polynomial through the light in each cell.

    Parameters
    ----------
    slab : the pane; what is not sought stays as it is.
    summaries : the tables, for angles and azimuths.
    ranges : lowest and highest value of each parameter that is sought.
    paths, seed, wavelength_nm : of every trace.
    aperture_deg : full width at half maximum of the instrument's response, which blurs all directions.
    design : of the guesses and the polynomial.
    """
    names = tuple(ranges)
    features = Features.of(slab, ranges, design)
    quick = [n for n in names if n in _QUICK]
    guesses = _guesses({n: r for n, r in ranges.items() if n not in _QUICK}, design, seed)
    grid = list(product(_LEVELS, repeat=len(quick)))
    rows: list[Array] = []
    light: list[list[Array]] = [[] for _ in summaries]
    with task("traces of possible panes", len(guesses) * len(summaries)) as progress:
        for g, slow in enumerate(guesses):
            # Each guess has its own random numbers: where relief is rough, common ones would not keep paths
            # together, and what is independent averages out.
            own = int(np.random.SeedSequence([seed, g]).generate_state(1)[0])
            base = {**slow, **{n: _level(n, ranges[n], 0.0) for n in quick}}
            if "bubbles_per_cm3" in quick:
                met = traced(slab, base, summaries[0], _PILOT, own, wavelength_nm).bubbles_expected.mean()
                base["bubbles_per_cm3"] *= max(_ENCOUNTERS / max(float(met), 1e-9), 1.0)
            for k, summary in enumerate(summaries):
                found = traced(slab, base, summary, paths, own, wavelength_nm)
                found = blurred(found, aperture_deg, np.random.default_rng([seed, k, g]))
                place = places(found, summary.table.polar_deg)
                for other in grid:
                    wanted = base | {n: _level(n, ranges[n], z) for n, z in zip(quick, other)}
                    weighed = reweighted(found, base, wanted)
                    light[k].append(light_in_cells(weighed, summary.table.polar_deg, place))
                    if k == 0:
                        rows.append(np.array([wanted[n] for n in names]))
                progress.advance()
    matrix = _matrix(features, np.array(rows))
    # Corners are in every fold: without one of them a polynomial would have to reach beyond its guesses.
    number = np.arange(len(guesses))
    corners = min(2 ** (len(names) - len(quick)), _CORNERS)
    fold = np.repeat(np.where(number < corners, -1, number % _FOLDS), len(grid))
    # Rows of one guess share its paths, and err together.
    weights = np.linalg.pinv(matrix, rcond=_RANK).T.reshape(len(guesses), len(grid), -1).sum(axis=1)
    inner = fold >= 0 if len(guesses) > 1 else np.ones(len(fold), bool)
    leverage = float(np.mean(np.sum((matrix[inner] @ weights.T) ** 2, axis=1)))
    cells, coefficients, noises, misfits, singles = [], [], [], [], []
    for k, summary in enumerate(summaries):
        stack = np.array(light[k])
        mean = stack.mean(axis=1)
        share = mean / mean.sum(axis=1, keepdims=True)
        error = stack.std(axis=1, ddof=1) / np.sqrt(REPLICATES)
        known = (error < _NOISIEST * mean).all(axis=0)
        used = np.flatnonzero(known & (np.median(share, axis=0) > LEAST_SHARE))
        logs, single = np.log(mean[:, used]), error[:, used] / mean[:, used]
        off = _left_out(matrix, logs, fold) if len(guesses) > 1 else logs - matrix @ _fitted(matrix, logs)
        middle = 0.5 * (RINGS_DEG[:-1] + RINGS_DEG[1:])
        cells.append(Cells(summary.table.polar_deg, used, middle[used // SECTORS]))
        coefficients.append(_fitted(matrix, logs))
        variance = np.mean(single[inner] ** 2, axis=0)
        noises.append(np.sqrt(leverage * variance))
        singles.append(np.sqrt(variance))
        beyond = np.mean(off[inner] ** 2, axis=0)
        if len(guesses) > 1:
            beyond -= (1.0 + leverage) * variance
        misfits.append(np.sqrt(np.maximum(beyond, 1e-8)))
    return Emulator(
        features,
        tuple(cells),
        np.hstack(coefficients),
        np.concatenate(noises),
        np.concatenate(misfits),
        np.concatenate(singles),
        weights,
    )


def _fitted(matrix: Array, logs: Array) -> Array:
    found, *_ = np.linalg.lstsq(matrix, logs, rcond=_RANK)
    return np.asarray(found)


def _left_out(matrix: Array, logs: Array, fold: NDArray[np.intp]) -> Array:
    """[rows, cells] distances of guesses from the polynomial through all but a fifth of them."""
    off = np.zeros_like(logs)
    for f in range(_FOLDS):
        mine = fold == f
        off[mine] = logs[mine] - matrix[mine] @ _fitted(matrix[~mine], logs[~mine])
    return off


def _guesses(ranges: Mapping[str, tuple[float, float]], design: Design, seed: int) -> list[dict[str, float]]:
    """Values of the slow parameters: the corners of their box, then a Sobol sequence inside."""
    from scipy.stats import qmc

    names = tuple(ranges)
    if not names:
        return [{}]
    count = design.guesses[min(len(names), len(design.guesses) - 1)]
    corners = np.array(list(product((0.0, 1.0), repeat=len(names))))
    if len(corners) > _CORNERS:
        corners = corners[np.random.default_rng([seed, 3]).permutation(len(corners))[:_CORNERS]]
    engine = qmc.Sobol(len(names), rng=np.random.default_rng([seed, 4]))
    inside = engine.random_base2(7)[: count - len(corners)]
    places = np.concatenate([corners, inside])
    return [{n: _level(n, ranges[n], 2.0 * p - 1.0) for n, p in zip(names, place)} for place in places]


def _level(name: str, ends: tuple[float, float], z: float) -> float:
    """The value at z, -1 to 1 over a range: evenly in the value, its root, or its logarithm."""
    low, high = ends
    if name == "absorption_per_mm" or name.startswith("micro_slope"):
        return float(low + 0.5 * (z + 1.0) * (high - low))
    if name == "bubbles_per_cm3":
        return float((np.sqrt(low) + 0.5 * (z + 1.0) * (np.sqrt(high) - np.sqrt(low))) ** 2)
    return float(low * (high / low) ** (0.5 * (z + 1.0)))
