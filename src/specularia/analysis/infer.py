"""What the glass is like, from measured tables and height maps: absorption, bubbles, finest relief.

The light in cells of deflection, at all measured angles at once, is set against what the tracer sends there
for possible panes (`infer_design`). Model and measurement differ by noise, by a common error of scale, and by
what the maps do not tell (the beam sees another place of the pane than the microscope); the size of that last
discrepancy is inferred along, and neighbouring cells share it.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Final

import numpy as np
from numpy.typing import NDArray

from specularia.analysis.emulator import COARSE, FINE, Emulator, emulate
from specularia.analysis.infer_design import (
    PARAMETERS,
    PER_LENGTH,
    SECTORS,
    THICKNESS,
    measured_light,
    with_values,
)
from specularia.errors import CoverageError, PhysicsError
from specularia.glass import Slab
from specularia.gonio import Summary, Table, summarise_all
from specularia.progress import task

__all__ = ["PRIORS", "HeldOutTau", "Inferred", "Prior", "infer"]

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Prior:
    """A lognormal prior.

    Attributes
    ----------
    median : of the parameter, > 0.
    sigma : standard deviation of its natural logarithm, > 0.
    """

    median: float
    sigma: float

    def __post_init__(self) -> None:
        if not (0.0 < self.median < float("inf") and 0.0 < self.sigma <= 3.0):
            raise PhysicsError(
                f"a prior has a median above 0 and a sigma of up to 3, not {self.median:g}, {self.sigma:g}."
            )


PRIORS: Final = {
    "absorption_per_mm": Prior(0.03, 1.0),
    "bubbles_per_cm3": Prior(20.0, 1.0),
    "bubble_diameter_mm": Prior(0.25, 0.35),
    "bubble_elongation": Prior(2.0, 0.35),
    "micro_slope_front": Prior(0.05, 0.7),
    "micro_slope_back": Prior(0.05, 0.7),
}
"""Priors where none are given; chosen here to be wide, not measured on any collection of glass. That of the
thickness has the pane's own as its median, and `_CALLIPER` as its sigma."""

_CALLIPER: Final = 0.03

_HIGHEST: Final = {
    "absorption_per_mm": 0.4,
    "bubbles_per_cm3": 400.0,
    "bubble_diameter_mm": 3.0,
    "bubble_elongation": 10.0,
    "micro_slope_front": 0.3,
    "micro_slope_back": 0.3,
}

_REACH: Final = 1.7
"""Standard deviations of the prior that the traced designs reach on either side; beyond, the polynomial is
not trusted and the posterior is cut off."""

_STAGES: Final = 5
"""Designs one after the other, at most: over all of the prior, then over what the last left possible."""

_FEWER, _LEAST_PATHS = 4, 3200
"""The first design takes so many times fewer paths, and no fewer than that."""

_SETTLED: Final = 0.75
"""Where no range shrinks to less than this share of itself, or moves by more than a twentieth of it, no
further design is traced."""

_MARGIN, _LEAST_MARGIN = 0.5, 0.2
"""What a range reaches beyond the 99 % interval: this share of the interval's length in the logarithm, and
so much at least."""

_ALIKE: Final = 0.5
"""Discrepancies of two cells are alike by exp(-|difference of ln(deflection)| / this); between angles of
incidence they are alike by `_ALIKE_ANGLES` of that. Chosen here."""

_ALIKE_ANGLES: Final = 0.5

_ALIKE_SECTORS: Final = 0.7
"""The same between neighbouring sectors of a ring; between those that lie opposite the square of it."""

_BRIGHT: Final = 0.01
"""Share of the light in a cell below which the discrepancy is larger, by one over the square root of it."""

_DISCREPANCY: Final = 0.05
"""Scale of the half-normal prior of the discrepancy's standard deviation, relative."""

_LEAST_DISCREPANCY: Final = 0.02
"""The least that is believed of it: maps of one field are not known to tell more. Chosen here."""

_MOST_DISCREPANCY: Final = 0.5

_MOST_FEIGNED: Final = 0.9
"""Share of what light tells that may be taken for noise of the traces."""

_WALKERS, _STEPS, _BURN = 48, 1500, 500

_DRAWS, _CLIMBS = 2000, 4
"""Places tried for the start of the walkers, and how many of them are climbed from."""


@dataclass(frozen=True)
class HeldOutTau:
    """Transmission at a measured angle, predicted by panes inferred without it."""

    theta_deg: float
    measured: float
    measured_se: float
    predicted: float
    low: float
    high: float


@dataclass(frozen=True)
class Inferred:
    """Posterior of what was sought.

    Attributes
    ----------
    names : [P] of the parameters.
    samples : [N, P] from the posterior.
    discrepancy : [N] relative, of what the maps do not tell.
    priors : those used.
    at_edge : names whose interval touches the end of what was traced: the data leave them open that way.
    open : names of parameters that the data hardly narrow: the interval is over 0.7 of the prior's.
    held_out : predictive checks.
    slab : the pane with the medians.
    thickness_mm : of the pane as it was given. Absorption and bubbles per volume are known only times
        thickness: its own error is in theirs only if it was sought too.
    emulator_error : [3] median, and 90th percentile, and largest relative error of a cell by the emulator.
    """

    names: tuple[str, ...]
    samples: Array
    discrepancy: Array
    priors: Mapping[str, Prior]
    at_edge: tuple[str, ...]
    open: tuple[str, ...]
    held_out: tuple[HeldOutTau, ...]
    slab: Slab
    thickness_mm: float
    emulator_error: Array
    synthetic: bool = field(default=False)

    def interval(self, name: str, level: float = 0.95) -> tuple[float, float, float]:
        """Median, and the ends of the equal-tailed interval."""
        values = self.samples[:, self.names.index(name)]
        low, mid, high = np.quantile(values, [0.5 - level / 2, 0.5, 0.5 + level / 2])
        return float(mid), float(low), float(high)

    @property
    def correlation(self) -> Array:
        """[P, P] of the logarithms."""
        return np.atleast_2d(np.corrcoef(np.log(self.samples), rowvar=False))

    @property
    def bubble_column_per_cm2(self) -> Array | None:
        """[N] bubbles per area of the pane; None if they were not sought."""
        if "bubbles_per_cm3" not in self.names:
            return None
        thick = self.samples[:, self.names.index(THICKNESS)] if THICKNESS in self.names else self.thickness_mm
        return np.asarray(self.samples[:, self.names.index("bubbles_per_cm3")] * 0.1 * thick)

    @property
    def twins(self) -> list[tuple[str, str, float]]:
        """Pairs that the data cannot tell apart well: |correlation| above 0.8."""
        c = self.correlation
        return [
            (self.names[i], self.names[j], float(c[i, j]))
            for i in range(len(c))
            for j in range(i)
            if abs(c[i, j]) > 0.8
        ]


def infer(
    slab: Slab,
    tables: Sequence[Table],
    *,
    seek: Sequence[str] = PARAMETERS,
    priors: Mapping[str, Prior] | None = None,
    scale_error: float = 0.005,
    hold_out: bool = True,
    aperture_deg: float = 0.3,
    paths: int = 160_000,
    seed: int = 0,
    wavelength_nm: float = 520.0,
) -> Inferred:
    """Infer absorption, bubbles and finest relief of a pane from its maps and its measured tables.

    Parameters
    ----------
    slab : the pane with its maps, index and thickness. Where bubbles are sought, its first kind says how
        their sizes spread and along which axis they are drawn out; of a pane without any, one size along y.
    tables : measured transmission of light on the front; two angles at least.
    seek : names of `PARAMETERS`, and "thickness_mm" where it is not known well: what light tells is its
        product with absorption and bubbles, so its prior (a calliper's 3 % around the pane's unless given)
        stays, and widens theirs.
    priors : in place of those of `PRIORS`, by name.
    scale_error : relative standard error of the scale that all tables share (calibration).
    hold_out : whether each table but the first and the last is predicted from the others.
    aperture_deg : full width at half maximum of the instrument's angular response.
    paths : of each trace and angle; a first design, over all of the priors, takes a quarter.
    seed : of tracing and sampling.
    wavelength_nm : of the light.

    Returns
    -------
    Inferred : samples of the posterior (emcee, Foreman-Mackey et al. 2013, doi:10.1086/670067).
    """
    known = (*PARAMETERS, THICKNESS)
    seek = tuple(n for n in known if n in seek) if set(seek) <= set(known) else ()
    given = {**PRIORS, THICKNESS: Prior(slab.thickness_mm, _CALLIPER), **(priors or {})}
    if not seek or set(given) - set(known):
        raise PhysicsError(f"what can be sought, and have a prior, is {', '.join(known)}.")
    if THICKNESS in seek and not set(seek) & set(PER_LENGTH):
        raise PhysicsError("thickness_mm is sought along with absorption_per_mm or bubbles_per_cm3 only.")
    if slab.patch is not None:
        raise PhysicsError("the pane goes on for ever; leave [patch] out of its description.")
    chosen = [t for t in tables if t.side == "transmission_front"]
    if len(chosen) < 2:
        raise CoverageError(
            f"two tables of light transmitted from the front at least are needed, not {len(chosen)}."
        )
    summaries = sorted(summarise_all(chosen, isotropic=True), key=lambda s: s.table.polar_deg)
    kept = {n: given[n] for n in seek}
    ranges = {
        n: (p.median * np.exp(-_REACH * p.sigma), min(p.median * np.exp(_REACH * p.sigma), _HIGHEST[n]))
        for n, p in kept.items()
        if n != THICKNESS
    }
    whole = ranges
    everything = np.ones(len(summaries), bool)
    for stage in range(_STAGES):
        emulator = emulate(
            slab,
            summaries,
            ranges,
            paths=paths if stage else max(paths // _FEWER, _LEAST_PATHS),
            seed=seed,
            wavelength_nm=wavelength_nm,
            aperture_deg=aperture_deg,
            design=FINE if stage else COARSE,
        )
        data = _Data(emulator, summaries, scale_error)
        samples, discrepancy = _sample(emulator, data, kept, ranges, everything, seed, slab.thickness_mm)
        if stage < _STAGES - 1:
            closer = _closer(emulator.names, _at(slab.thickness_mm, seek, samples), whole)
            if stage and all(_settled(np.log(ranges[n]), np.log(closer[n])) for n in ranges):
                break
            ranges = closer
    held = []
    if hold_out:
        for k in range(1, len(summaries) - 1):
            others = everything.copy()
            others[k] = False
            held.append(
                _predicted(emulator, data, kept, ranges, others, k, summaries[k], seed, slab.thickness_mm)
            )
    medians = {n: float(np.median(samples[:, i])) for i, n in enumerate(seek)}
    at_edge, wide = _verdict(seek, samples, kept, whole)
    return Inferred(
        names=seek,
        samples=samples,
        discrepancy=discrepancy,
        priors=kept,
        at_edge=at_edge,
        open=wide,
        held_out=tuple(held),
        slab=with_values(slab, medians),
        thickness_mm=slab.thickness_mm,
        emulator_error=np.quantile(emulator.error, [0.5, 0.9, 1.0]),
        synthetic=slab.synthetic or any(t.synthetic for t in chosen),
    )


def _at(thickness_mm: float, names: Sequence[str], values: Array) -> Array:
    """[..., P] what the emulator is asked for: values per length of a pane of the emulator's thickness."""
    if THICKNESS not in names:
        return values
    share = values[..., names.index(THICKNESS)] / thickness_mm
    kept = [n for n in names if n != THICKNESS]
    out = np.stack([values[..., names.index(n)] for n in kept], axis=-1)
    for k, name in enumerate(kept):
        if name in PER_LENGTH:
            out[..., k] *= share
    return out


def _closer(
    names: Sequence[str], samples: Array, whole: Mapping[str, tuple[float, float]]
) -> dict[str, tuple[float, float]]:
    """Ranges around what a coarser polynomial left possible, within those of the prior.

    They may reach beyond the last ones: a coarse polynomial may have been wrong.
    """
    found = {}
    for i, name in enumerate(names):
        low, high = np.quantile(np.log(samples[:, i]), [0.005, 0.995])
        more = max(_MARGIN * (high - low), _LEAST_MARGIN)
        a, b = np.log(whole[name])
        found[name] = (float(np.exp(max(low - more, a))), float(np.exp(min(high + more, b))))
    return found


def _settled(last: Array, now: Array) -> bool:
    """Whether a range is about the last one: hardly shorter, and not beyond it."""
    length = last[1] - last[0]
    beyond = max(last[0] - now[0], now[1] - last[1])
    return bool(now[1] - now[0] > _SETTLED * length and beyond < 0.05 * length)


class _Data:
    """Measured logarithms in the emulator's cells, and how their errors hang together."""

    def __init__(self, emulator: Emulator, summaries: Sequence[Summary], scale_error: float) -> None:
        logs, errors, middle, angle, sector = [], [], [], [], []
        for k, (cells, summary) in enumerate(zip(emulator.cells, summaries)):
            light, noise = measured_light(summary.distribution, summary.table.polar_deg)
            light, noise = light[cells.used], noise[cells.used]
            if np.any(light <= 0.0):
                raise CoverageError(
                    f"{summary.table.file}: no light where the pane sends some; is it a table of this pane?"
                )
            logs.append(np.log(light))
            errors.append(noise / light)
            middle.append(cells.deflection_deg)
            sector.append(cells.used % SECTORS)
            angle.append(np.full(light.size, k))
        self.log_light = np.concatenate(logs)
        self.angle = np.concatenate(angle)
        self.own = np.concatenate(errors) ** 2 + emulator.noise**2
        ln = np.log(np.concatenate(middle))
        alike = np.exp(-np.abs(ln[:, None] - ln) / _ALIKE)
        alike *= np.where(self.angle[:, None] == self.angle, 1.0, _ALIKE_ANGLES)
        turn = np.concatenate(sector)
        alike *= _ALIKE_SECTORS ** np.abs(turn[:, None] - turn)
        # What the polynomial misses, it misses alike in neighbouring cells.
        self.misfit = alike * emulator.misfit[:, None] * emulator.misfit
        # Few places of a map send light where there is little: a map knows dim cells less well.
        share = np.exp(self.log_light)
        share /= np.bincount(self.angle, share)[self.angle]
        dim = np.sqrt(np.maximum(_BRIGHT / share, 1.0))
        self.alike = alike * dim[:, None] * dim
        self.scale = scale_error**2

    def log_likelihood(self, emulator: Emulator, of: NDArray[np.bool_]) -> Callable[[Array, Array], Array]:
        """Function of values [N, P] and discrepancies [N], from the angles chosen.

        In one basis all parts of the covariance are diagonal. K = s^2 A + D, D = own errors, the polynomial's
        misfit and the common scale: with D = L L^T and L^-1 A L^-T = Q w Q^T, K^-1 is
        T^T diag(1 / (1 + s^2 w)) T with T = Q^T L^-1, and ln |K| = ln |D| + sum ln(1 + s^2 w).
        """
        mine = of[self.angle]
        observed = self.log_light[mine]
        d = np.diag(self.own[mine]) + self.scale + self.misfit[np.ix_(mine, mine)]
        lower = np.linalg.cholesky(d)
        half = np.linalg.solve(lower, self.alike[np.ix_(mine, mine)])
        w, q = np.linalg.eigh(np.linalg.solve(lower, half.T))
        w, basis = np.maximum(w, 0.0), np.linalg.solve(lower.T, q).T

        def log_likelihood(values: Array, s: Array) -> Array:
            t = (observed - emulator.log_light(values)[:, mine]) @ basis.T
            spread = 1.0 + s[:, None] ** 2 * w
            return np.asarray(-0.5 * np.sum(t * t / spread + np.log(spread), axis=1))

        return log_likelihood


def _feigned(
    emulator: Emulator, data: _Data, of: NDArray[np.bool_], values: Array, discrepancy: float
) -> Array:
    """[P, P] information on the logarithms of the emulator's parameters that is noise of the traces alone.

    Noise makes slopes of the polynomial, and slopes are what tells parameters from light: of F = J K^-1 J^T,
    noise alone gives a part on the mean, which tells nothing.
    """
    mine = of[data.angle]
    _, noise = emulator.slopes(values)
    k = np.diag(data.own[mine]) + data.scale + data.misfit[np.ix_(mine, mine)]
    inverse = np.linalg.inv(k + discrepancy**2 * data.alike[np.ix_(mine, mine)])
    return noise * float(np.sum(emulator.single[mine] ** 2 * np.diag(inverse)))


def _widened(ln: Array, feigned: Array) -> Array:
    """Samples [N, P] drawn apart around their mean, as if that information were not among theirs.

    At most `_MOST_FEIGNED` of what they hold in any direction is taken off.
    """
    mean = ln.mean(axis=0)
    half = np.linalg.cholesky(np.atleast_2d(np.cov(ln, rowvar=False)))
    share, turn = np.linalg.eigh(half.T @ feigned @ half)
    stretch = 1.0 / np.sqrt(1.0 - np.clip(share, 0.0, _MOST_FEIGNED))
    steps = np.linalg.solve(half, (ln - mean).T)
    return np.asarray(mean + (half @ (turn * stretch) @ (turn.T @ steps)).T)


def _sample(
    emulator: Emulator,
    data: _Data,
    priors: Mapping[str, Prior],
    ranges: Mapping[str, tuple[float, float]],
    of: NDArray[np.bool_],
    seed: int,
    thickness_mm: float,
) -> tuple[Array, Array]:
    """Samples [N, P] of the parameters, in the order of `priors`, and [N] of the discrepancy."""
    import emcee

    likelihood = data.log_likelihood(emulator, of)
    names = tuple(priors)
    mean = np.log([priors[n].median for n in names])
    sigma = np.array([priors[n].sigma for n in names])
    low, high = (np.log([ranges[n][k] for n in emulator.names]) for k in (0, 1))

    def log_posterior(points: Array) -> Array:
        ln, s = points[:, :-1], np.exp(points[:, -1])
        asked = _at(thickness_mm, names, np.exp(ln))
        inside = np.all((np.log(asked) >= low) & (np.log(asked) <= high), axis=1)
        inside &= (s > _LEAST_DISCREPANCY) & (s < _MOST_DISCREPANCY)
        out = np.full(len(points), -np.inf)
        if inside.any():
            fit = likelihood(asked[inside], s[inside])
            prior = -0.5 * np.sum(((ln[inside] - mean) / sigma) ** 2, axis=1)
            # Half-normal in s; sampled in ln s.
            prior += -0.5 * (s[inside] / _DISCREPANCY) ** 2 + points[inside, -1]
            out[inside] = fit + prior
        return out

    rng = np.random.default_rng([seed, 5])
    best = _peak(log_posterior, mean, sigma, low, high, rng)
    start = best + rng.normal(0.0, 0.02, (_WALKERS, best.size))
    some = slice(0, low.size)
    start[:, some] = np.clip(start[:, some], low + 1e-3, high - 1e-3)
    # The thickness comes last, if at all: what it moves must stay within what was traced.
    start[:, low.size : -1] = best[low.size : -1] + rng.normal(
        0.0, 1e-4, (_WALKERS, best.size - 1 - low.size)
    )
    start[:, -1] = np.clip(start[:, -1], np.log(1.02 * _LEAST_DISCREPANCY), np.log(0.98 * _MOST_DISCREPANCY))
    if not np.all(np.isfinite(log_posterior(start))):
        raise PhysicsError("no pane within the priors explains the tables; are they of this pane?")
    sampler = emcee.EnsembleSampler(_WALKERS, best.size, log_posterior, vectorize=True)
    sampler._random = np.random.RandomState(np.random.MT19937(np.random.SeedSequence([seed, 6])))
    with task("posterior", _STEPS) as progress:
        for _ in sampler.sample(start, iterations=_STEPS):
            progress.advance()
    flat = sampler.get_chain(discard=_BURN, thin=10, flat=True)
    ln, discrepancy = flat[:, :-1], np.exp(flat[:, -1])
    middle = _at(thickness_mm, names, np.exp(np.median(ln, axis=0)))
    feigned = np.zeros((ln.shape[1], ln.shape[1]))
    some = slice(0, low.size)
    feigned[some, some] = _feigned(emulator, data, of, middle, float(np.median(discrepancy)))
    return np.exp(_widened(ln, feigned)), discrepancy


def _peak(
    log_posterior: Callable[[Array], Array],
    mean: Array,
    sigma: Array,
    low: Array,
    high: Array,
    rng: np.random.Generator,
) -> Array:
    """The highest place of a posterior: the best of draws over all that was traced, each climbed from.

    From far away a large discrepancy explains everything, and walkers would stay with it.
    """
    from scipy.optimize import minimize

    traced = low.size
    draws = np.empty((_DRAWS, mean.size + 1))
    draws[:, :traced] = low + (high - low) * rng.random((_DRAWS, traced))
    draws[:, traced:-1] = mean[traced:]
    draws[:, -1] = np.log(_LEAST_DISCREPANCY * rng.uniform(1.05, 3.0, _DRAWS))
    order = np.argsort(log_posterior(draws))[::-1]
    found = [
        minimize(
            lambda p: float(min(-log_posterior(p[None, :])[0], 1e9)),
            draws[k],
            method="Nelder-Mead",
            options={"maxfev": 400 * mean.size, "xatol": 1e-3, "fatol": 1e-2, "adaptive": True},
        )
        for k in order[:_CLIMBS]
    ]
    return np.asarray(min(found, key=lambda f: float(f.fun)).x)


def _predicted(
    emulator: Emulator,
    data: _Data,
    priors: Mapping[str, Prior],
    ranges: Mapping[str, tuple[float, float]],
    others: NDArray[np.bool_],
    k: int,
    summary: Summary,
    seed: int,
    thickness_mm: float,
) -> HeldOutTau:
    """Transmission at angle k from what the other angles say; in the cells that are compared."""
    samples, discrepancy = _sample(emulator, data, priors, ranges, others, seed, thickness_mm)
    mine = data.angle == k
    light = np.exp(emulator.log_light(_at(thickness_mm, tuple(priors), samples))[:, mine])
    tau = light.sum(axis=1)
    # What the discrepancy and the scale may do to the sum, given how alike neighbouring cells are.
    share = light.mean(axis=0) / light.mean(axis=0).sum()
    spread = np.sqrt(discrepancy**2 * (share @ data.alike[np.ix_(mine, mine)] @ share) + data.scale)
    tau = tau * np.exp(spread * np.random.default_rng([seed, 7, k]).standard_normal(tau.size))
    low, mid, high = np.quantile(tau, [0.025, 0.5, 0.975])
    measured = float(np.exp(data.log_light[mine]).sum())
    return HeldOutTau(summary.table.polar_deg, measured, summary.tau_se, float(mid), float(low), float(high))


def _verdict(
    names: Sequence[str],
    samples: Array,
    priors: Mapping[str, Prior],
    ranges: Mapping[str, tuple[float, float]],
) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Names whose interval touches an end of the range, and names that the data hardly narrow."""
    edge, wide = [], []
    for i, name in enumerate(names):
        ln = np.log(samples[:, i])
        low, high = np.quantile(ln, [0.025, 0.975])
        whole = priors[name].sigma
        a, b = np.log(ranges.get(name, priors[name].median * np.exp([-4.0 * whole, 4.0 * whole])))
        if low < a + 0.03 * (b - a) or high > b - 0.03 * (b - a):
            edge.append(name)
        if high - low > 0.7 * min(2 * 1.96 * priors[name].sigma, b - a):
            wide.append(name)
    return tuple(edge), tuple(wide)
