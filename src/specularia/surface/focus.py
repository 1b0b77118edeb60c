"""Height from focus: where along z each pixel of a confocal stack is brightest, and how well that is known.

Kernels on plain arrays; z is counted in slices. The axial response of a confocal microscope to a mirror is
sinc^2 in theory and something like it in practice. Its shape is learnt from the stack itself, as an even
polynomial times a Gaussian, and fitted to each pixel with free height, place and width by weighted least
squares under a taper that stays centred on the peak.

Why: the parabola through three samples, or its logarithm, is biased with a sign that follows the place of the
peak between slices, and leaves most of the light unused; any fit of a wrong shape over a fixed set of samples
has such an error (Chen et al. 2019, doi:10.1364/OE.27.003682). Here the shape is right, what remains of
misfit is even about the peak, as the taper is, so that it moves height and width of the fitted peak but not
its place; and the weights bring the fit close to the Cramer-Rao bound. The estimator is ours.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

__all__ = [
    "Noise",
    "Peaks",
    "Response",
    "background",
    "coarse",
    "cramer_rao",
    "displacements",
    "fit",
    "learnt",
    "noise_of",
    "significance",
    "width_of",
]

Array = NDArray[np.float64]

Matrix = list[list[Array]]
"""A 3 x 3 matrix for each pixel."""

FWHM_PER_SIGMA = 2.0 * float(np.sqrt(2.0 * np.log(2.0)))
REACH = 1.5
"""Half-width of the taper in units of the response's full width at half maximum (FWHM)."""

_ITERATIONS = 4
_CLASSES = 6


@dataclass(frozen=True)
class Noise:
    """Variance of the brightness: floor + gain * brightness (read-out and shot noise)."""

    floor: float
    gain: float

    def variance(self, brightness: Array) -> Array:
        return self.floor + self.gain * np.maximum(brightness, 0.0)


@dataclass(frozen=True)
class Response:
    """Axial response g(u) = exp(-u^2 / 2) (1 + c4 u^4 + c6 u^6 + c8 u^8), u = (z - place) / width.

    Parameters
    ----------
    width : in slices.
    even : (c4, c6, c8); all 0 for a Gaussian.
    """

    width: float
    even: tuple[float, float, float] = (0.0, 0.0, 0.0)

    def at(self, u: Array) -> tuple[Array, Array]:
        """(g, dg/du)."""
        c4, c6, c8 = self.even
        v = u * u
        gauss = np.exp(-0.5 * v)
        if not any(self.even):
            return gauss, -u * gauss
        polynomial = 1.0 + v * v * (c4 + v * (c6 + v * c8))
        derivative = u * v * (4.0 * c4 + v * (6.0 * c6 + v * (8.0 * c8)))
        return gauss * polynomial, gauss * (derivative - u * polynomial)

    @property
    def fwhm(self) -> float:
        """Full width at half maximum in slices."""
        u = np.linspace(0.0, 3.0, 601)
        g, _ = self.at(u)
        return 2.0 * self.width * float(u[np.argmax(g < 0.5)])


@dataclass(frozen=True)
class Peaks:
    """Fitted peaks of N pixels; arrays of samples are [W, N].

    Parameters
    ----------
    index : [W, N] slice of each sample; below 0 or beyond the last where there is none.
    place, sigma : [N] peak position and its standard uncertainty, in slices.
    height : [N] brightness of the peak above the background.
    width : [N] width of the response, in slices.
    misfit : [N] weighted squared residuals over their expectation; 1 where the model and the noise are right.
    u : [W, N] place of each sample about the peak, in widths.
    taper : [W, N] 0..1.
    model, residual : [W, N] fitted brightness, and what was recorded minus it.
    weight, jacobian : [W, N] weights, and derivatives of the model by height, place and width.
    inverse, covariance : 3 x 3 of [N]: inverse normal matrix, and covariance of height, place and width.
    """

    index: NDArray[np.int64]
    place: Array
    sigma: Array
    height: Array
    width: Array
    misfit: Array
    u: Array
    taper: Array
    model: Array
    residual: Array
    weight: Array
    jacobian: tuple[Array, Array, Array]
    inverse: Matrix
    covariance: Matrix

    def freedom(self) -> Array:
        """What the fit leaves of the variance of each residual, [W, N], 0..1.

        With hat matrix H = J N^-1 J' W: var(r_i) / v_i = 1 - 2 H_ii + (J C J')_ii / v_i, C the covariance.
        """
        j, taper = self.jacobian, self.taper
        pairs = [(i, k) for i in range(3) for k in range(3)]
        hat = sum(self.inverse[i][k] * j[i] * j[k] for i, k in pairs) * self.weight
        spread = sum(self.covariance[i][k] * j[i] * j[k] for i, k in pairs) * self.weight
        return np.clip(1.0 - 2.0 * hat + spread / np.where(taper > 0, taper, 1.0), 0.0, 1.0)


def coarse(brightness: NDArray[np.float32], width: float) -> NDArray[np.int64]:
    """Brightest slice of each pixel, [N], after smoothing along z by the width of the response.

    Parameters
    ----------
    brightness : [slices, N].
    width : standard deviation of the response in slices.
    """
    from scipy.ndimage import gaussian_filter1d

    return np.argmax(gaussian_filter1d(brightness, width, axis=0, mode="nearest", truncate=2.5), axis=0)


def background(brightness: NDArray[np.float32]) -> Array:
    """Brightness out of focus, [N]: the lower quartile along z. An error in it moves no symmetric peak."""
    k = brightness.shape[0] // 4
    return np.partition(brightness, k, axis=0)[k].astype(np.float64)


def width_of(brightness: NDArray[np.float32], base: Array) -> float:
    """Standard deviation of the axial response in slices, as a start for the fits.

    The Gaussian of unit energy that answers most to the brighter half of the pixels: a matched filter keeps
    the noise the same at every width, so that it finds a peak that no single sample shows.

    Parameters
    ----------
    brightness : [slices, N].
    base : [N] background.
    """
    from scipy.ndimage import gaussian_filter1d

    signal = brightness - base.astype(np.float32)
    widest = max(brightness.shape[0] / 4.0, 1.0)
    answers = {}
    for width in np.geomspace(0.4, widest, max(3, int(np.ceil(np.log(widest / 0.4) / np.log(1.2))))):
        smooth = gaussian_filter1d(signal, width, axis=0, mode="constant", truncate=3.0)
        answers[float(width)] = float(np.quantile(smooth.max(axis=0), 0.75)) * np.sqrt(width)
    return max(answers, key=lambda w: answers[w])


def significance(brightness: NDArray[np.float32], base: Array, width: float, noise: Noise) -> Array:
    """Answer of each pixel to the matched filter of this width, over its noise out of focus, [N].

    Noise alone reaches some 3 to 4 in a stack of some hundred slices.
    """
    from scipy.ndimage import gaussian_filter1d

    signal = brightness - base.astype(np.float32)
    smooth = gaussian_filter1d(signal, width, axis=0, mode="constant", truncate=3.0).max(axis=0)
    gain = np.sqrt(2.0 * np.sqrt(np.pi) * max(width, 0.4))
    return smooth * gain / np.sqrt(noise.variance(base))


def fit(
    brightness: NDArray[np.float32],
    *,
    peak: NDArray[np.int64],
    base: Array,
    response: Response,
    noise: Noise,
    displaced: Array | None = None,
) -> Peaks:
    """Fit base + height * g((z - place) / width) to each pixel by Gauss-Newton steps.

    Parameters
    ----------
    brightness : [slices, N].
    peak : [N] starting place.
    base : [N] background, held fixed.
    response : shape, and the typical width: the start, and the scale of the taper
        cos^2(pi (z - place) / (2 L)), L = `REACH` * FWHM.
    noise : variances for the weights.
    displaced : [slices] how far each slice lies above its even place, in slices; none unless given.
    """
    slices = brightness.shape[0]
    width = response.width
    reach = REACH * FWHM_PER_SIGMA * width
    m = int(np.ceil(reach)) + 1
    index = peak + np.arange(-m, m + 1)[:, None]
    exists = (index >= 0) & (index < slices)
    data = np.take_along_axis(brightness, np.clip(index, 0, slices - 1), axis=0).astype(np.float64) - base
    z = index.astype(np.float64)
    if displaced is not None:
        z += np.where(exists, displaced[np.clip(index, 0, slices - 1)], 0.0)

    # Start from the first moment of what stands above half maximum.
    # A pixel without a peak starts from one standard deviation of its noise.
    top = np.maximum(data[m], np.sqrt(noise.variance(base)))
    close = exists & (np.abs(index - peak) <= FWHM_PER_SIGMA * width)
    lump = np.where(close, np.maximum(data - 0.5 * top, 0.0), 0.0)
    total = lump.sum(axis=0)
    place = np.where(total > 0, (lump * z).sum(axis=0) / np.where(total > 0, total, 1.0), peak)
    height, spread = top.copy(), np.full(peak.size, width)

    for step in range(_ITERATIONS + 1):
        u = (z - place) / spread
        shape, slope = response.at(u)
        model = height * shape
        far = np.abs(z - place) / reach
        taper = np.where(exists & (far < 1.0), np.cos(0.5 * np.pi * np.minimum(far, 1.0)) ** 2, 0.0)
        weight = taper / noise.variance(model + base)
        residual = data - model
        # Derivatives by height, place and width.
        by_place = slope * (-height / spread)
        jacobian = (shape, by_place, by_place * u)
        weighted = tuple(weight * j for j in jacobian)
        inverse = _inverse(_products(weighted, jacobian))
        if step == _ITERATIONS:
            break
        right = [np.einsum("wn,wn->n", j, residual) for j in weighted]
        change = [sum(inverse[i][k] * right[k] for k in range(3)) for i in range(3)]
        height = np.maximum(height + change[0], 1e-3 * top)
        # A place that runs out of the stack stays within reach of its samples; such pixels are rejected.
        place = np.clip(place + np.clip(change[1], -width, width), -0.5 * reach, slices - 1 + 0.5 * reach)
        spread = np.clip(spread + change[2], 0.5 * width, 3.0 * width)

    # The taper is no inverse variance, so the covariance is the sandwich N^-1 (J' t^2/v J) N^-1.
    meat = _products(weighted, tuple(taper * j for j in jacobian))
    half = _times(inverse, meat)
    covariance = _times(half, inverse)
    expected = taper.sum(axis=0) - (half[0][0] + half[1][1] + half[2][2])
    return Peaks(
        index=index,
        place=place,
        sigma=np.sqrt(np.maximum(covariance[1][1], 0.0)),
        height=height,
        width=spread,
        misfit=np.einsum("wn,wn->n", weight, residual**2) / np.maximum(expected, 1e-9),
        u=u,
        taper=taper,
        model=model + base,
        residual=residual,
        weight=weight,
        jacobian=jacobian,
        inverse=inverse,
        covariance=covariance,
    )


def _products(left: tuple[Array, ...], right: tuple[Array, ...]) -> Matrix:
    """Sums over the samples of left_i right_k, which is symmetric in i and k here."""
    upper = {(i, k): np.einsum("wn,wn->n", left[i], right[k]) for i in range(3) for k in range(i, 3)}
    return [[upper[min(i, k), max(i, k)] for k in range(3)] for i in range(3)]


def _times(a: Matrix, b: Matrix) -> Matrix:
    """Matrix product, pixel by pixel."""
    return [[a[i][0] * b[0][k] + a[i][1] * b[1][k] + a[i][2] * b[2][k] for k in range(3)] for i in range(3)]


def _inverse(m: Matrix) -> Matrix:
    """Inverse by cofactors, the columns first brought to one scale.

    A ridge of 1e-9 keeps pixels without a peak solvable; they are rejected afterwards.
    """
    scale = [1.0 / np.sqrt(np.maximum(m[i][i], 1e-60)) for i in range(3)]
    a = [[m[i][k] * scale[i] * scale[k] + (1e-9 if i == k else 0.0) for k in range(3)] for i in range(3)]
    c = [
        [
            a[(i + 1) % 3][(k + 1) % 3] * a[(i + 2) % 3][(k + 2) % 3]
            - a[(i + 1) % 3][(k + 2) % 3] * a[(i + 2) % 3][(k + 1) % 3]
            for k in range(3)
        ]
        for i in range(3)
    ]
    determinant = a[0][0] * c[0][0] + a[0][1] * c[0][1] + a[0][2] * c[0][2]
    determinant = np.where(np.abs(determinant) > 1e-30, determinant, 1e-30)
    return [[c[k][i] / determinant * scale[i] * scale[k] for k in range(3)] for i in range(3)]


def learnt(response: Response, peaks: Peaks) -> Response:
    """The response that fitted pixels show: their median width, and even terms from their residuals."""
    c4, c6, c8 = response.even
    v = peaks.u**2
    gauss = np.exp(-0.5 * v)
    # Terms of order 0 and 2 are height and width, which each pixel has of its own.
    terms = np.stack([(gauss * v**k)[peaks.taper > 0] for k in (0, 1, 2, 3, 4)])
    weight = peaks.taper[peaks.taper > 0]
    wanted = (peaks.residual / peaks.height)[peaks.taper > 0]
    coefficients = np.linalg.solve((terms * weight) @ terms.T, (terms * weight) @ wanted)
    even = (c4 + float(coefficients[2]), c6 + float(coefficients[3]), c8 + float(coefficients[4]))
    return Response(float(np.median(peaks.width)), even)


def displacements(peaks: Peaks, slices: int) -> tuple[Array, Array]:
    """How far slices lie above where the fits took them to be, and the standard error of that, [slices] each.

    A slice that lies d higher than thought shows every pixel as the fit would show it at z + d: residual = -d
    times the derivative by place. Weighted least squares over all pixels that see the slice; where none does
    the displacement is 0 and the error infinite. Method: ours.
    """
    use = (peaks.taper > 0.05) & (peaks.index >= 0) & (peaks.index < slices)
    place = peaks.index[use]
    derivative, weight = peaks.jacobian[1][use], peaks.weight[use]
    moment = np.bincount(place, weight * derivative**2, minlength=slices)
    wanted = np.bincount(place, -weight * derivative * peaks.residual[use], minlength=slices)
    found = np.where(moment > 0, wanted / np.where(moment > 0, moment, 1.0), 0.0)
    error = np.where(moment > 0, 1.0 / np.sqrt(np.where(moment > 0, moment, 1.0)), np.inf)
    return found, error


def noise_of(peaks: Peaks, far: Array, far_brightness: float, *, floor: float) -> Noise:
    """Noise against brightness, from the residuals of fits and from samples far from any peak.

    Parameters
    ----------
    peaks : fits with any noise model of about the right shape.
    far : deviations of samples out of focus from their pixel's background.
    far_brightness : mean brightness of those samples.
    floor : least variance, 1/12 for whole numbers (rounding).

    Robust (median absolute deviation) in six classes of brightness, then a straight line with no negative
    coefficient.
    """
    from scipy.optimize import nnls

    freedom = peaks.freedom()
    use = (peaks.taper > 0.1) & (freedom > 0.2)
    residual = peaks.residual[use] / np.sqrt(freedom[use])
    level = peaks.model[use]
    # Classes of equal width: narrower ones near the peak would sort the samples by their own noise.
    low, high = np.quantile(level, (0.01, 0.99))
    edges = np.linspace(float(low), float(high), _CLASSES + 1)
    group = np.clip(np.searchsorted(edges, level, side="right") - 1, 0, _CLASSES - 1)
    classes = [(level[group == k], residual[group == k]) for k in range(_CLASSES)]
    classes = [(x, r) for x, r in classes if x.size >= 32]
    points = [(float(x.mean()), _variance(r)) for x, r in classes]
    if far.size:
        points.append((far_brightness, _variance(far)))
    x, y = np.array(points).T
    # Relative errors of the class variances are alike, so each equation is divided by its variance.
    scale = 1.0 / np.maximum(y, floor)
    (a, g), _ = nnls(np.stack((scale, scale * np.maximum(x, 0.0)), axis=1), scale * y)
    return Noise(max(float(a), floor), float(g))


def _variance(values: Array) -> float:
    return float((1.4826 * np.median(np.abs(values - np.median(values)))) ** 2)


def cramer_rao(*, snr: float, fwhm: float) -> float:
    """Least standard deviation of the place of a Gaussian peak in even noise, in slices.

    sigma^2 = 2 w / (sqrt(pi) snr^2) with w the peak's standard deviation in slices and snr its height over
    the noise of one sample: the reciprocal of the Fisher information sum (dI/dz)^2 / noise^2, with the sum
    replaced by its integral, sqrt(pi) A^2 / (2 w). Height, width and background, even or unknown, change
    nothing, since their derivatives are even in z.

    >>> round(cramer_rao(snr=30.0, fwhm=4.0), 4)
    0.0461
    """
    w = fwhm / FWHM_PER_SIGMA
    return float(np.sqrt(2.0 * w / np.sqrt(np.pi)) / snr)
