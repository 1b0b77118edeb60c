"""A smooth Gaussian random field of unknown spectrum, known on a part of its area: what it may be elsewhere.

The field is a sum of cosines and sines on a rectangle a fifth larger than the map (so that opposite edges of
the map stay apart) and a polynomial of second order. The variances of the amplitudes, its two-dimensional
power spectrum, are not given: they are drawn together with the field, in turn (Gibbs sampling), as
cosmologists do for masked maps of the sky. So an anisotropy, such as streaks, is learnt from what is seen of
the field, and the draws differ by what the data leave open, of the field and of its spectrum.

References
----------
Wandelt, B. D., Larson, D. L. and Lakshminarayanan, A. (2004), Global, exact cosmic microwave background data
analysis using Gibbs sampling, Phys. Rev. D 70, 083511, doi:10.1103/PhysRevD.70.083511. The smoothing of the
spectrum and its choice of modes are ours.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

__all__ = [
    "Field",
    "Modes",
    "Normal",
    "draw",
    "first_spectrum",
    "learn",
    "left_out",
    "modes_of",
    "normal",
    "solve",
    "spectrum_of",
    "spread",
    "terms",
]

Array = NDArray[np.float64]

EXTENSION = 1.2
"""Side of the field's period over the side of the map."""
POLYNOMIALS = 6
_STEEPNESS = 3.0
"""Spectra are smoothed after division by |q|^-3: between the slopes of most real surfaces' spectra."""
_KERNEL, _BROAD = 0.6, 3.0
"""Standard deviations of the smoothing of spectra, in steps of the lattice; the broad one leans in."""
_LEANING = 0.1
_FAINTEST = 1e-10
_ROUNDING = 1e-12


@dataclass(frozen=True)
class Modes:
    """Which waves make up the field.

    Parameters
    ----------
    kx, ky : [M] whole numbers of waves over the period along x and y, one of each pair +-k.
    period : (rows, columns) of the period, in pixels; sides of the map times `EXTENSION`.
    shape : (rows, columns) of the map.
    pitch : (y, x) um per pixel.
    """

    kx: NDArray[np.int64]
    ky: NDArray[np.int64]
    period: tuple[int, int]
    shape: tuple[int, int]
    pitch: tuple[float, float]

    @property
    def wavenumber(self) -> Array:
        """[M] waves per um."""
        return np.hypot(
            self.kx / (self.period[1] * self.pitch[1]), self.ky / (self.period[0] * self.pitch[0])
        )


@dataclass(frozen=True)
class Normal:
    """Normal equations of a weighted fit: matrix [K, K] and right side [K], K = 2 M + `POLYNOMIALS`."""

    matrix: Array
    right: Array


@dataclass(frozen=True)
class Field:
    """Coefficients of one field, K = 2 M + `POLYNOMIALS`: cosines, sines, polynomial."""

    modes: Modes
    coefficients: Array

    def heights(self) -> Array:
        """The field at every pixel of the map, um."""
        from scipy.fft import irfft2

        m, c = self.modes, self.coefficients
        count = m.kx.size
        rows, columns = m.period
        half = np.zeros((rows, columns // 2 + 1), complex)
        # One of each pair +-k has kx >= 0; rows of negative ky count from the end.
        amplitude = 0.5 * (c[:count] - 1j * c[count : 2 * count])
        np.add.at(half, (m.ky % rows, m.kx), amplitude)
        own = m.kx == 0
        np.add.at(half, (-m.ky[own] % rows, m.kx[own]), np.conj(amplitude[own]))
        waves = irfft2(half, s=(rows, columns), norm="forward")[: m.shape[0], : m.shape[1]]
        y, x = _axes(m.shape)
        p = c[2 * count :]
        return np.asarray(
            waves + p[0] + p[1] * x + p[2] * y + p[3] * x * x + p[4] * x * y + p[5] * y * y, dtype=np.float64
        )


def terms(modes: Modes, rows: Array, columns: Array) -> Array:
    """[n, K] values of all terms of a field at places counted in pixels."""
    phase = (
        2.0
        * np.pi
        * (np.outer(columns / modes.period[1], modes.kx) + np.outer(rows / modes.period[0], modes.ky))
    )
    x = 2.0 * columns / max(modes.shape[1] - 1, 1) - 1.0
    y = 2.0 * rows / max(modes.shape[0] - 1, 1) - 1.0
    polynomial = np.stack([np.ones_like(x), x, y, x * x, x * y, y * y], axis=1)
    return np.concatenate([np.cos(phase), np.sin(phase), polynomial], axis=1)


def left_out(terms: Array, levels: Array, weights: Array, spectrum: Array, *, broad: float) -> Array:
    """[n] each level minus the field that all the others make at its place.

    Parameters
    ----------
    terms : [n, K] of `terms`.
    levels : [n] heights, um.
    weights : [n] 1 / variance; 0 takes no part.
    """
    from scipy.linalg import cholesky, solve_triangular

    scale = _scale(spectrum, broad)
    used = weights > 0.0
    w = weights[used]
    scaled = terms[used] * scale
    precision = scaled.T @ (w[:, None] * scaled)
    _add_prior(precision)
    lower = cholesky(precision, lower=True, overwrite_a=True, check_finite=False)
    columns = solve_triangular(lower, scaled.T, lower=True, check_finite=False)
    part = columns @ (w * levels[used])
    fitted = terms @ (scale * solve_triangular(lower, part, lower=True, trans=1, check_finite=False))
    leverage = np.zeros(levels.size)
    leverage[used] = np.minimum(w * np.sum(columns * columns, axis=0), 1.0 - 1e-6)
    return np.asarray((levels - fitted) / (1.0 - leverage))


def _axes(shape: tuple[int, int]) -> tuple[Array, Array]:
    """Coordinates (y [rows, 1], x [1, columns]) from -1 to 1."""
    return np.linspace(-1.0, 1.0, shape[0])[:, None], np.linspace(-1.0, 1.0, shape[1])[None, :]


def modes_of(
    shape: tuple[int, int],
    pitch: tuple[float, float],
    *,
    count: int,
    stretch: float = 1.0,
    angle: float = 0.0,
) -> Modes:
    """The waves of smallest wavenumber, about `count` cosines and sines.

    Parameters
    ----------
    shape, pitch : (rows, columns) and (y, x) um per pixel of the map.
    stretch : >= 1; the waves lie in an ellipse of wavenumbers, so many times longer than wide.
    angle : of its long axis from x, radians.
    """
    from scipy.fft import next_fast_len

    rows, columns = (int(next_fast_len(round(EXTENSION * n), real=True)) for n in shape)
    height, width = rows * pitch[0], columns * pitch[1]
    radius = np.sqrt(count / (np.pi * width * height))  # waves per um
    reach = radius * np.sqrt(stretch)
    most_x = min(int(reach * width) + 1, columns // 4)
    most_y = min(int(reach * height) + 1, rows // 4)
    kx, ky = np.meshgrid(np.arange(0, most_x + 1), np.arange(-most_y, most_y + 1))
    u, v = kx / width, ky / height
    along = (np.cos(angle) * u + np.sin(angle) * v) / np.sqrt(stretch)
    across = (np.cos(angle) * v - np.sin(angle) * u) * np.sqrt(stretch)
    inside = (np.hypot(along, across) <= radius) & ((kx > 0) | (ky > 0))
    return Modes(kx[inside], ky[inside], (rows, columns), shape, pitch)


def normal(modes: Modes, heights: Array, weights: Array) -> Normal:
    """Sums over pixels of weight x term x term, and of weight x term x height.

    The products of two waves are waves of their sum and difference, so all sums over the map are values of
    the Fourier transform of the weights.
    """
    from scipy.fft import fft2

    rows, columns = modes.period
    kx, ky = modes.kx, modes.ky

    def transform(a: Array) -> NDArray[np.complex128]:
        return np.asarray(fft2(a, s=(rows, columns)))

    w = transform(weights)

    def pick(t: NDArray[np.complex128], k: NDArray[np.int64], m: NDArray[np.int64]) -> NDArray[np.complex128]:
        return np.asarray(t[m % rows, k % columns])

    difference = pick(w, kx[:, None] - kx[None, :], ky[:, None] - ky[None, :])
    total = pick(w, kx[:, None] + kx[None, :], ky[:, None] + ky[None, :])
    count = kx.size
    size = 2 * count + POLYNOMIALS
    matrix = np.empty((size, size))
    matrix[:count, :count] = 0.5 * (difference.real + total.real)
    matrix[count : 2 * count, count : 2 * count] = 0.5 * (difference.real - total.real)
    # cos a sin b = (sin(a + b) - sin(a - b)) / 2, and the transform holds minus the sines.
    matrix[:count, count : 2 * count] = 0.5 * (difference.imag - total.imag)
    matrix[count : 2 * count, :count] = matrix[:count, count : 2 * count].T
    y, x = _axes(modes.shape)
    one = np.ones(modes.shape)
    terms = [one, one * x, one * y, one * x * x, x * y, one * y * y]
    right = np.empty(size)
    for column, values in [*enumerate(terms), (-1, heights)]:
        t = pick(transform(weights * values), kx, ky)
        sums = np.concatenate([t.real, -t.imag])
        if column < 0:
            right[: 2 * count] = sums
        else:
            matrix[: 2 * count, 2 * count + column] = sums
            matrix[2 * count + column, : 2 * count] = sums
    for i, a in enumerate(terms):
        weighted = weights * a
        right[2 * count + i] = np.sum(weighted * heights)
        for j, b in enumerate(terms):
            matrix[2 * count + i, 2 * count + j] = np.sum(weighted * b)
    return Normal(matrix, right)


def first_spectrum(modes: Modes, *, height_um: float) -> Array:
    """[M] variances of amplitudes of an isotropic field of this rms height whose spectrum falls as |q|^-3."""
    shape = modes.wavenumber**-_STEEPNESS
    return shape * (height_um**2 / np.sum(shape))


def solve(
    equations: Normal, spectrum: Array, *, broad: float, rng: np.random.Generator | None
) -> tuple[Array, Array]:
    """The most probable coefficients given data and spectrum, and one draw of them (the same without rng).

    Parameters
    ----------
    equations : of weights 1 / variance.
    spectrum : [M] prior variance of the amplitudes.
    broad : prior standard deviation of the polynomial's coefficients, um.
    """
    from scipy.linalg import cholesky, solve_triangular

    scale, lower = _factor(equations, spectrum, broad, cholesky)
    part = solve_triangular(lower, scale * equations.right, lower=True, check_finite=False)
    if rng is None:
        mean = scale * solve_triangular(lower, part, lower=True, trans=1, check_finite=False)
        return mean, mean
    both = np.stack([part, part + rng.standard_normal(part.size)], axis=1)
    out = scale[:, None] * solve_triangular(lower, both, lower=True, trans=1, check_finite=False)
    return out[:, 0], out[:, 1]


def learn(
    equations: Normal, modes: Modes, spectrum: Array, *, broad: float, rounds: int
) -> tuple[Array, Array]:
    """The spectrum that the data favour, from this one on, by expectation and maximisation.

    The expected square of an amplitude is that of its mean plus its variance, so amplitudes that the data say
    nothing of keep the variance that they had.

    Returns
    -------
    coefficients : [K] most probable ones under the last spectrum.
    spectrum : [M].
    """
    from scipy.linalg import cholesky, lapack, solve_triangular

    count = modes.kx.size
    for turn in range(rounds + 1):
        scale, lower = _factor(equations, spectrum, broad, cholesky)
        part = solve_triangular(lower, scale * equations.right, lower=True, check_finite=False)
        mean = scale * solve_triangular(lower, part, lower=True, trans=1, check_finite=False)
        if turn < rounds:
            variance = scale**2 * np.diag(lapack.dpotri(lower, lower=1)[0])
            square = mean * mean + variance
            spectrum = _smoothed(modes, 0.5 * (square[:count] + square[count : 2 * count]), None)
    return mean, spectrum


def _scale(spectrum: Array, broad: float) -> Array:
    """[K] prior standard deviations of all coefficients."""
    return np.sqrt(np.concatenate([spectrum, spectrum, np.full(POLYNOMIALS, broad**2)]))


def _add_prior(precision: Array) -> None:
    """The prior's precision, 1 in units of itself, and a trace that keeps the matrix regular when rounded."""
    diagonal = np.diag_indices_from(precision)
    precision[diagonal] += 1.0 + _ROUNDING * precision[diagonal].max()


def _factor(equations: Normal, spectrum: Array, broad: float, cholesky: object) -> tuple[Array, Array]:
    """Prior standard deviations and the lower Cholesky factor of the precision in units of them."""
    scale = _scale(spectrum, broad)
    precision = scale[:, None] * equations.matrix * scale[None, :]
    _add_prior(precision)
    return scale, cholesky(precision, lower=True, overwrite_a=True, check_finite=False)  # type: ignore[operator]


def spread(equations: Normal, spectrum: Array, *, broad: float, terms: Array) -> Array:
    """[n] posterior standard deviation of the field where `terms` [n, K] are, given the spectrum."""
    from scipy.linalg import cholesky, solve_triangular

    scale, lower = _factor(equations, spectrum, broad, cholesky)
    columns = solve_triangular(lower, (terms * scale).T, lower=True, check_finite=False)
    return np.sqrt(np.sum(columns * columns, axis=0))


def spectrum_of(modes: Modes, coefficients: Array, rng: np.random.Generator | None) -> Array:
    """A spectrum that may have made these amplitudes: their squares smoothed over neighbouring waves.

    With rng it is a draw: the smoothed squares over equally smoothed squares of standard normal numbers,
    which is the law of a variance known from so few amplitudes (scaled inverse chi-squared).
    """
    count = modes.kx.size
    a, b = coefficients[:count], coefficients[count : 2 * count]
    return _smoothed(modes, 0.5 * (a * a + b * b), rng)


def _smoothed(modes: Modes, square: Array, rng: np.random.Generator | None) -> Array:
    """Squares of amplitudes smoothed over neighbouring waves; with rng over equally smoothed chance."""
    count = modes.kx.size
    steep = modes.wavenumber**_STEEPNESS
    steep = steep / steep.mean()
    square = square * steep
    lean = _smooth(modes, square, _BROAD)
    held = (1.0 - _LEANING) * _smooth(modes, square, _KERNEL) + _LEANING * lean
    if rng is not None:
        chance = 0.5 * np.sum(rng.standard_normal((2, count)) ** 2, axis=0)
        held = held / ((1.0 - _LEANING) * _smooth(modes, chance, _KERNEL) + _LEANING)
    out = held / steep
    return np.maximum(out, _FAINTEST * out.max())


def _smooth(modes: Modes, values: Array, width: float) -> Array:
    """Gaussian means over neighbours on the lattice of waves, +-k counted both."""
    from scipy.ndimage import gaussian_filter

    mx, my = int(modes.kx.max()), int(np.abs(modes.ky).max())
    grid, weight = (np.zeros((2 * my + 1, 2 * mx + 1)) for _ in range(2))
    for sign in (1, -1):
        place = (my + sign * modes.ky, mx + sign * modes.kx)
        grid[place], weight[place] = values, 1.0
    top = gaussian_filter(grid, width, mode="constant")
    below = gaussian_filter(weight, width, mode="constant")
    place = (my + modes.ky, mx + modes.kx)
    return np.asarray(top[place] / below[place])


def draw(
    equations: Normal,
    modes: Modes,
    *,
    height_um: float,
    broad: float,
    members: int,
    rng: np.random.Generator,
    burn_in: int = 16,
    thin: int = 3,
    spectrum: Array | None = None,
) -> tuple[list[Array], list[Array], Array]:
    """Fields and spectra that agree with the data, drawn in turn.

    Returns
    -------
    means, draws : of each kept round, the most probable coefficients under its spectrum and a draw of them.
    spectrum : geometric mean of the kept spectra.
    """
    s = first_spectrum(modes, height_um=height_um) if spectrum is None else spectrum
    means, draws, logs = [], [], np.zeros(modes.kx.size)
    for turn in range(burn_in + thin * members):
        mean, one = solve(equations, s, broad=broad, rng=rng)
        if turn >= burn_in and (turn - burn_in) % thin == thin - 1:
            means.append(mean)
            draws.append(one)
            logs += np.log(s)
        s = spectrum_of(modes, one, rng)
    return means, draws, np.exp(logs / max(members, 1)) if members else s
