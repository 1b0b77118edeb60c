"""The surface without its decay: pits found, and what may have been there drawn from what is left.

1. Plateaux, what is left of the original surface, are found by their slopes (`plateaux`).
2. A smooth field of waves is fitted to them (`random_field`). What lies below it by more than the noise is
   pit; what continues it smoothly joins the plateaux. Decay only takes away, so a patch that lies below the
   others is the floor of a pit, however flat.
3. The field's amplitudes and their spectrum are drawn together from what the plateaux say: an ensemble of
   original surfaces. They agree on the plateaux and differ where nothing is left. Their mean is the healed
   map.

The mean is smoother than the surface was, where little is left of it: slopes, and light, are to be taken from
the members. Method: ours.
"""

from __future__ import annotations

import warnings
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Literal, get_args

import numpy as np
from numpy.typing import NDArray

from specularia.errors import PhysicsError, SpeculariaWarning
from specularia.surface import baselines, plateaux, random_field, white_light
from specularia.surface.heightmap import HeightMap, filled, plane
from specularia.surface.plateaux import Slopes, without_specks
from specularia.surface.roughness import roughness

__all__ = ["METHODS", "Healed", "Method", "heal", "interval_90"]

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]
Method = Literal["field", "flat", "gaussian", "closing"]
METHODS = get_args(Method)
"""Names of the methods of `heal`; the first is the one to use."""

_STAGES = (8, 40, 150, 500)
"""Cosines and sines of the first fits, which throw out the floors of pits."""
_TURNS = 6
_MOST_PATCHES = 3000
_TILE = 16
_MANY = 1500
"""Cosines and sines of the field."""
_STEPS = 6
_TOLERANCE = 3.0
"""Standard deviations below the field from which a pixel is a pit."""
_FLOOR_UM = 1e-4
"""Least scatter that is believed of any heights."""
_LEAST_PLATEAU = 0.005
_BLOCK = 8
_MOST_ABOVE = 0.1
"""Share of the map above the healed surface from which a warning is given: decay only takes away."""
_KNOWN = 0.5
"""A height is known where the plateaux take away this share of the variance that it had without them."""
_COARSE = 48
"""Places each way at which the field's uncertainty is evaluated; it is smooth."""


@dataclass(frozen=True)
class Healed:
    """A healed map and what was done to it.

    Parameters
    ----------
    surface : the most probable original surface: no missing pixels, without the microscope's noise;
        `sigma_um` is what plateaux leave open of it (None for the simple methods).
    pits : [rows, columns], True where nothing of the original surface is left.
    pit_coverage : share of pits among all pixels.
    Sdq_before, Sdq_after : rms slope of the map given and of the healed one.
    tolerance_um : depth below the original surface from which a pixel counts as pit.
    parameters : settings, for provenance.
    method : how it was done.
    members : [N, rows, columns] float32, possible original surfaces, um; N = 0 for the simple methods.
    no_evidence : True where the plateaux say less than half of what could be said of the height (variance).
    Sdq_interval : 90 % interval of the rms slope from the members; None with fewer than 2.
    """

    surface: HeightMap
    pits: Mask
    pit_coverage: float
    Sdq_before: float
    Sdq_after: float
    tolerance_um: float
    parameters: Mapping[str, float | str]
    method: Method = "field"
    members: NDArray[np.float32] = field(default_factory=lambda: np.zeros((0, 0, 0), np.float32))
    no_evidence: Mask = field(default_factory=lambda: np.zeros((0, 0), bool))
    Sdq_interval: tuple[float, float] | None = None

    @property
    def no_evidence_share(self) -> float:
        """Share of the map of which the plateaux say too little."""
        return float(self.no_evidence.mean()) if self.no_evidence.size else 0.0

    def member(self, k: int) -> HeightMap:
        """One possible original surface as a map."""
        return replace(self.surface, heights_um=self.members[k].astype(np.float64), sigma_um=None, image=None)


def heal(
    surface: HeightMap,
    *,
    method: Method = "field",
    ensemble: int = 12,
    seed: int = 0,
    reach_um: float | None = None,
    picture: Array | None = None,
) -> Healed:
    """Find the pits of a map and draw what was there before them.

    Parameters
    ----------
    surface : a map (no profile), at least 32 pixels each way, at most 20 % missing.
    method : "field", or for comparison one of the simple ones: "flat", the plane on which the plateaux lie;
        "gaussian", the robust Gaussian regression of ISO 16610-71; "closing", a morphological closing that
        bridges pits (ISO 16610-85).
    ensemble : members to draw (method "field"), >= 0.
    seed : of the draws.
    reach_um : cut-off of "gaussian", radius of "closing"; from the map if left out.
    picture : [rows, columns], the field of the map under white light, in focus everywhere, row 0 at the
        lowest y; any number of pixels. What is darker there than the plateaux is no plateau
        (`white_light.dark`; method "field").

    Raises
    ------
    PhysicsError : a profile, a map too small, too many missing pixels, or nothing left of the original
        surface.
    """
    if min(surface.shape) < 32:
        raise PhysicsError(
            f"{surface.name}: healing needs a map of at least 32 x 32 pixels, this one has {surface.shape}."
        )
    if method not in METHODS:
        raise PhysicsError(f"healing by one of {', '.join(METHODS)}, not by {method!r}.")
    from threadpoolctl import threadpool_limits

    whole, _ = filled(surface)
    c, a, b = plane(whole)
    trend = c + a * whole.x_um[None, :] + b * whole.y_um[:, None]
    h = whole.heights_um - trend
    pitch = (whole.pitch_y_um, whole.pitch_x_um)
    before = roughness(surface).Sdq
    if method != "field":
        base, used = baselines.base(method, h, pitch=pitch, reach_um=reach_um)
        noise = max(plateaux.noise_of(h), _FLOOR_UM)
        pits = h - base < -_TOLERANCE * noise
        made = replace(whole, heights_um=base + trend, sigma_um=None)
        return Healed(
            surface=made,
            pits=pits,
            pit_coverage=float(pits.mean()),
            Sdq_before=before,
            Sdq_after=roughness(made).Sdq,
            tolerance_um=_TOLERANCE * noise,
            parameters={"method": method, **used},
            method=method,
        )
    # One thread of linear algebra: sums then have one order, so the same seed gives the same surface on any
    # number of cores, and on a busy machine threads that wait for each other would cost many times the work.
    with threadpool_limits(limits=1, user_api="blas"):
        shown = None if picture is None else white_light.on_grid(picture, surface.shape)
        found = _find(surface, h, pitch, shown)
        return _drawn(surface, whole, trend, h, found, before, ensemble, np.random.default_rng(seed), seed)


@dataclass(frozen=True)
class _Found:
    """Plateaux, the waves fitted to them, the scatter around them, and the equations of the last fit."""

    plateau: Mask
    noise: float
    modes: random_field.Modes
    equations: random_field.Normal
    spectrum: Array
    broad: float
    scatter: float


def _find(surface: HeightMap, h: Array, pitch: tuple[float, float], picture: Array | None) -> _Found:
    """Plateaux of h, by turns of fitting a field and judging pixels by it."""
    valid = surface.valid
    rough_noise = max(plateaux.noise_of(h), _FLOOR_UM)
    seeds = plateaux.seeds(h, valid, pitch=pitch, noise=rough_noise)
    if seeds.mean() < _LEAST_PLATEAU:
        raise PhysicsError(
            f"{surface.name}: patches smooth enough for an original surface cover {seeds.mean():.2%} of the "
            "map; nothing of it is left to go by."
        )
    if picture is not None:
        lit = ~white_light.dark(picture, seeds)
        valid, seeds = valid & lit, without_specks(seeds & lit, 9)
    noise = max(plateaux.noise_of(h, seeds), _FLOOR_UM)
    broad = float(np.ptp(h))
    kept = _on_top(h, seeds, pitch, noise, broad)
    slope = Slopes.of(h, pitch=pitch, noise=noise)
    stretch, angle = slope.anisotropy(_inner(kept))
    many = random_field.modes_of(
        surface.shape, pitch, count=min(_MANY, h.size // 25), stretch=stretch, angle=angle
    )
    spectrum = random_field.first_spectrum(many, height_um=max(_spread_of(h[kept]), noise))
    scatter, base = noise, h
    for _ in range(_STEPS):
        data = _inner(kept)
        equations = random_field.normal(many, h, data / max(noise, scatter) ** 2)
        mean, spectrum = random_field.learn(equations, many, spectrum, broad=broad, rounds=3)
        fitted = random_field.Field(many, mean)
        base = fitted.heights()
        sd = _spread(fitted, equations, spectrum, broad)
        residual = (h - base)[data]
        scatter = max(noise, 1.4826 * float(np.median(np.abs(residual)))) if residual.size else noise
        new = _judged(h, base, valid, scatter, np.minimum(sd, 2.0 * scatter), slope)
        if new.mean() < _LEAST_PLATEAU:
            kept = new
            break
        new &= _on_top(h, new, pitch, noise, broad)
        settled = np.mean(new != kept) < 0.0005
        kept = new
        if settled:
            break
    if kept.mean() < _LEAST_PLATEAU:
        raise PhysicsError(
            f"{surface.name}: plateaux cover {kept.mean():.2%}; "
            "nothing of the original surface is left to go by."
        )
    data = _inner(kept)
    sigma = scatter * _correlation((h - base) / scatter, data)
    equations = random_field.normal(many, h, data / sigma**2)
    return _Found(kept, noise, many, equations, spectrum, broad, scatter)


def _correlation(residual: Array, data: Mask) -> float:
    """How much larger the noise must be taken because what the field leaves is not white, at least 1.

    Means over blocks of n white residuals scatter by 1 / sqrt(n) of a single one.
    """
    rows, columns = (n // _BLOCK for n in data.shape)

    def blocks(a: Array) -> Array:
        cut = a[: rows * _BLOCK, : columns * _BLOCK].reshape(rows, _BLOCK, columns, _BLOCK)
        return np.asarray(cut.sum(axis=(1, 3)))

    count, total = blocks(data.astype(float)), blocks(np.where(data, residual, 0.0))
    full = count > 0.5 * _BLOCK**2
    if np.count_nonzero(full) < 20:
        return 1.0
    means = total[full] / count[full]
    wide = _spread_of(means) * np.sqrt(np.median(count[full])) / max(_spread_of(residual[data]), 1e-12)
    return float(max(wide, 1.0))


def _inner(plateau: Mask) -> Mask:
    """Plateaux without their rim, where walls begin; all of them where nothing else would be left."""
    from scipy.ndimage import binary_erosion

    inner = binary_erosion(plateau, border_value=1)
    return inner if inner.sum() > 0.2 * plateau.sum() else plateau


def _on_top(h: Array, seeds: Mask, pitch: tuple[float, float], noise: float, broad: float) -> Mask:
    """Seeds without the flat floors of pits.

    Decay only takes away, so the plateaux are on top. Fields of more and more waves are fitted to the mean
    heights of patches of seeds; in turns, patches go that lie too far below the field that all others make
    (leave one out). What so few waves cannot follow counts as scatter of the patches, so it does not bend
    them.
    """
    if not seeds.any():
        return seeds
    shape = (h.shape[0], h.shape[1])
    parts, count = _patches(seeds)
    sizes = np.bincount(parts.ravel(), minlength=count).astype(float)[1:]
    y, x = np.indices(shape)

    def mean_of(values: Array) -> Array:
        return np.bincount(parts.ravel(), weights=values.ravel(), minlength=count)[1:] / sizes

    rows, columns, levels = mean_of(y.astype(float)), mean_of(x.astype(float)), mean_of(h)
    weights = np.minimum(sizes / (0.5 * _tile(shape) ** 2), 1.0)
    centre, scatter = _crowd(levels, weights, noise)
    kept = (levels > centre - 5.0 * scatter) & (levels < centre + 8.0 * scatter)
    # Thousands of patches are enough to fit some hundred waves to; smaller ones are judged by that fit.
    if sizes.size > _MOST_PATCHES:
        least = np.partition(sizes, -_MOST_PATCHES)[-_MOST_PATCHES]
        weights = np.where(sizes >= max(least, 2.0), weights, 0.0)
    for waves in _STAGES:
        modes = random_field.modes_of(shape, pitch, count=waves)
        terms = random_field.terms(modes, rows, columns)
        for _ in range(_TURNS):
            height = max(_spread_of(levels[kept]), scatter)
            spectrum = random_field.first_spectrum(modes, height_um=height)
            out = random_field.left_out(
                terms, levels, np.where(kept, weights, 0.0) / scatter**2, spectrum, broad=broad
            )
            _, wide = _crowd(out[kept], weights[kept], noise)
            _, scatter = _crowd(
                out[kept & (np.abs(out) < 3.0 * wide)], weights[kept & (np.abs(out) < 3.0 * wide)], noise
            )
            new = (out > -3.5 * scatter) & (out < 6.0 * scatter)
            if np.array_equal(new, kept) or weights[new].sum() < 0.2 * weights[kept].sum():
                break
            kept = new
    return np.asarray(np.concatenate([[False], kept])[parts])


def _tile(shape: tuple[int, int]) -> int:
    """Side of the squares that patches are cut into, pixels."""
    return max(_TILE, max(shape) // 64)


def _patches(mask: Mask) -> tuple[NDArray[np.intp], int]:
    """Connected parts of a mask, cut by a grid of squares; numbers from 1, and one more than the last."""
    from scipy.ndimage import label

    parts, _ = label(mask)
    rows, columns = (np.arange(n) // _tile((mask.shape[0], mask.shape[1])) for n in mask.shape)
    tile = rows[:, None] * (columns[-1] + 1) + columns[None, :]
    both = parts.astype(np.int64) * (int(tile.max()) + 1) + tile
    both[~mask] = -1
    _, numbers = np.unique(both, return_inverse=True)
    numbers = numbers.reshape(mask.shape)
    if mask.all():
        numbers = numbers + 1
    return numbers, int(numbers.max()) + 1


def _crowd(levels: Array, sizes: Array, noise: float) -> tuple[float, float]:
    """Weighted median of levels, and 1.4826 times the median distance from it, at least the noise."""

    def median(values: Array) -> float:
        order = np.argsort(values)
        total = np.cumsum(sizes[order])
        return float(values[order][np.searchsorted(total, 0.5 * total[-1])])

    centre = median(levels)
    return centre, max(1.4826 * median(np.abs(levels - centre)), noise)


def _spread_of(values: Array) -> float:
    """Standard deviation as normal values have it at their median distance from the median."""
    return 1.4826 * float(np.median(np.abs(values - np.median(values))))


def _judged(h: Array, base: Array, valid: Mask, scatter: float, sd: Array, slope: Slopes) -> Mask:
    """Plateaux: what lies within the tolerance of the field and goes its way.

    The slope tells plateaux from the lines where walls cross the field, but it is blurred near a rim; so what
    lies within the tolerance near a patch of right slope joins it.
    """
    from scipy.ndimage import binary_dilation, binary_opening

    near = (np.abs(h - base) < _TOLERANCE * np.sqrt(scatter**2 + sd**2)) & valid
    near = _closed_specks(near, 3)
    core = near & slope.agrees(base)
    core = binary_opening(np.pad(core, 1, mode="edge"), np.ones((3, 3), bool))[1:-1, 1:-1]
    core = without_specks(core, 9)
    reach = round(2.0 * slope.smoothing) + 1
    near = binary_opening(np.pad(near, 1, mode="edge"), np.ones((2, 2), bool))[1:-1, 1:-1]
    return np.asarray(binary_dilation(core, iterations=reach) & near)


def _closed_specks(mask: Mask, most: int) -> Mask:
    """The mask with holes of a few pixels filled: single heights beyond three sigma are no pits."""
    return ~without_specks(~mask, most + 1)


def interval_90(values: Array) -> tuple[float, float]:
    """Where one more draw of a normal law lies with 90 % after these: mean -+ t s sqrt(1 + 1 / n)."""
    from scipy.stats import t

    n = values.size
    half = float(t.ppf(0.95, n - 1) * np.std(values, ddof=1) * np.sqrt(1.0 + 1.0 / n))
    return float(np.mean(values)) - half, float(np.mean(values)) + half


def _spread(
    fitted: random_field.Field,
    equations: random_field.Normal,
    spectrum: Array,
    broad: float,
    means: Array | None = None,
) -> Array:
    """Standard deviation of the field at every pixel, linear between coarse places."""
    from scipy.ndimage import zoom

    rows, columns = fitted.modes.shape
    ny, nx = min(_COARSE, rows), min(_COARSE, columns)
    y, x = np.meshgrid(np.linspace(0, rows - 1, ny), np.linspace(0, columns - 1, nx), indexing="ij")
    terms = random_field.terms(fitted.modes, y.ravel().astype(float), x.ravel().astype(float))
    sd = random_field.spread(equations, spectrum, broad=broad, terms=terms)
    if means is not None:
        sd = np.sqrt(sd**2 + np.var(terms @ means.T, axis=1, ddof=1))
    return np.asarray(zoom(sd.reshape(ny, nx), (rows / ny, columns / nx), order=1, grid_mode=False))


def _drawn(
    surface: HeightMap,
    whole: HeightMap,
    trend: Array,
    h: Array,
    found: _Found,
    before: float,
    ensemble: int,
    rng: np.random.Generator,
    seed: int,
) -> Healed:
    """The ensemble, its mean, and where they rest on nothing."""
    modes = found.modes
    means, draws, spectrum = random_field.draw(
        found.equations,
        modes,
        height_um=1.0,
        broad=found.broad,
        members=max(ensemble, 4),
        rng=rng,
        spectrum=found.spectrum,
    )
    best = random_field.Field(modes, np.mean(means, axis=0))
    # Variance given the spectrum, and of what different spectra make most probable.
    sd = _spread(best, found.equations, spectrum, found.broad, np.array(means))
    healed = replace(whole, heights_um=best.heights() + trend, sigma_um=sd)
    members = np.empty((ensemble, *surface.shape), np.float32)
    slopes = []
    for k in range(ensemble):
        members[k] = random_field.Field(modes, draws[k]).heights() + trend
        slopes.append(roughness(replace(healed, heights_um=members[k].astype(np.float64), sigma_um=None)).Sdq)
    # The mean square of a wave is half of its squared amplitude, and it has a cosine and a sine.
    prior = np.sqrt(np.sum(spectrum))
    low_high = interval_90(np.array(slopes)) if len(slopes) > 1 else None
    pits = ~found.plateau
    after = roughness(healed).Sdq
    above = float(np.mean(h + trend - healed.heights_um > 2.0 * _TOLERANCE * found.scatter))
    if after > before or above > _MOST_ABOVE:
        warnings.warn(
            f"{surface.name}: the healed surface has rms slope {after:.3g}, the map {before:.3g}, and "
            f"{above:.1%} of the map lies above it. This does not look like a smooth surface with pits: "
            "do not rely on it.",
            SpeculariaWarning,
            stacklevel=3,
        )
    return Healed(
        surface=healed,
        pits=pits,
        pit_coverage=float(pits.mean()),
        Sdq_before=before,
        Sdq_after=after,
        tolerance_um=_TOLERANCE * found.scatter,
        parameters={
            "method": "field",
            "tolerance_um": _TOLERANCE * found.scatter,
            "noise_um": found.noise,
            "shortest_wave_um": float(1.0 / modes.wavenumber.max()),
            "ensemble": ensemble,
            "seed": seed,
        },
        members=members,
        no_evidence=sd > np.sqrt(1.0 - _KNOWN) * prior,
        Sdq_interval=low_high,
    )
