"""Matrices between the patches of a Klems basis: from any model, and from other matrices."""

from __future__ import annotations

import warnings
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from specularia.bsdf.build_tree import angles_between
from specularia.bsdf.cells import cell_means, is_isotropic
from specularia.bsdf.klems import KlemsBasis
from specularia.bsdf.model import Array, ScatteringModel
from specularia.bsdf.xml_model import KlemsPart
from specularia.conventions import square_to_disk
from specularia.errors import PhysicsError

__all__ = ["klems_part", "matrix_between"]

_APART_DEG, _POINTS = 3.5, (3, 8)
"""Distance between the incident directions that stand for a patch, and fewest and most of them either way."""
_FINE = 8
"""Incident angles over which a ring is averaged for an isotropic model; its azimuths follow exactly."""
_CELLS = 128
"""Cells along an edge of the square from which a distribution is summed unless the model has finer ones."""
_AZIMUTHS, _TOO_MANY = 2000, 100_000
"""At least so many steps of azimuth stand for the circle; a basis that would need too many takes points."""
_LEAST, _MOST = 6, 24
"""Fewest and most points along an edge of an outgoing patch."""
_AGREE, _NARROW = 5e-4, 64
"""How far two rules for the mean over a ring may differ; so many narrow rings decide where they do."""


def klems_part(model: ScatteringModel, side: str, basis: KlemsBasis) -> KlemsPart:
    """One side of a model as a matrix: the mean of the BSDF over each pair of patches.

    The light of an isotropic model is summed over rings and steps of azimuth, from which all patches follow
    by turning. Any other one is averaged over points in each outgoing patch, more where its own quadrature is
    dense. Each column adds up to the model's direct-hemispherical value averaged over the incident patch.

    Raises
    ------
    PhysicsError : the model has no data in some incident patches.
    """
    steps = int(np.lcm.reduce([2 * c for c in basis.phi_count]))
    if is_isotropic(model) and steps <= _TOO_MANY:
        matrix = _turned(model, side, basis, steps * -(-_AZIMUTHS // steps))
    else:
        matrix = np.zeros((basis.patches, basis.patches))
        for j in range(basis.patches):
            for theta, phi, weight in zip(*_incident(basis, j)):
                matrix[:, j] += weight * _patch_means(model, side, basis, float(theta), float(phi))
    tau = _patch_tau(model, side, basis, matrix)
    if not np.isfinite(tau).all():
        raise PhysicsError(f"the model has no data for {side.replace('_', ' ')} in some incident patches.")
    total = basis.solid_angle @ matrix
    scale = np.where(total > 0, tau / np.where(total > 0, total, 1.0), 1.0)
    return KlemsPart(matrix=matrix * scale, incident=basis, outgoing=basis)


def _dense(model: ScatteringModel, side: str, theta: float) -> bool:
    """Whether the model's own points are at least as dense as the cells that are taken otherwise."""
    return float(model.quadrature(side, theta).weight.max()) <= np.pi / _CELLS**2


def _light(model: ScatteringModel, side: str, theta: float, rng: np.random.Generator) -> tuple[Array, ...]:
    """Points (x, y) and the light that leaves at each, for light from phi_i = 0."""
    if _dense(model, side, theta):
        q = model.quadrature(side, theta)
        light = q.weight * np.nan_to_num(model.evaluate(side, theta, 0.0, q.ux, q.uy))
        # Points of a model lie in rings; anywhere in its cell keeps a whole ring from one side of an edge.
        dx, dy = (rng.uniform(size=(2, light.size)) - 0.5) * np.sqrt(q.weight)
        return q.ux + dx, q.uy + dy, light
    k = np.arange(_CELLS)
    jitter = rng.uniform(size=(2, _CELLS, _CELLS))
    a, b = (k[:, None] + jitter[0]) / _CELLS, (k[None, :] + jitter[1]) / _CELLS
    x, y = (v.ravel() for v in square_to_disk(a, b))
    return x, y, cell_means(model, side, theta_i_deg=theta, n=_CELLS).ravel() * (np.pi / _CELLS**2)


def _turned(model: ScatteringModel, side: str, basis: KlemsBasis, steps: int) -> Array:
    """The matrix of an isotropic model.

    In patches azimuth is counted by psi_out = 180 - phi_s and psi_in = -phi_i, so that light which leaves at
    psi for phi_i = 0 leaves at psi + psi_in for any other azimuth.
    """
    edges = basis.arrays[0]
    rings = len(basis.phi_count)
    out = np.zeros((basis.patches, basis.patches))
    for ring, count in enumerate(basis.phi_count):
        rng = np.random.default_rng(ring)
        light = np.zeros(rings * steps)
        low, high = np.sqrt(edges[ring : ring + 2])
        for theta, weight in zip(*angles_between(float(low), float(high), _FINE)):
            x, y, part = _light(model, side, float(theta), rng)
            row = np.clip(np.searchsorted(edges, x * x + y * y, side="right") - 1, 0, rings - 1)
            step = np.floor(np.arctan2(y, -x) * (steps / (2 * np.pi))).astype(np.int64) % steps
            light += weight * np.bincount(row * steps + step, part, rings * steps)
        # The incident azimuths of the patch around 0, from the middle of one step to that of another.
        width = steps // count
        window = np.zeros(steps)
        np.add.at(window, np.arange(-width // 2, width // 2) % steps, 0.5 / width)
        np.add.at(window, np.arange(1 - width // 2, width // 2 + 1) % steps, 0.5 / width)
        spread = np.fft.irfft(np.fft.rfft(light.reshape(rings, steps)) * np.fft.rfft(window), steps)
        total = np.concatenate([np.zeros((rings, 1)), np.tile(spread, 2).cumsum(axis=1)], axis=1)
        for other, into in enumerate(basis.phi_count):
            # From half a patch before its centre on, seen from each incident patch.
            first = (2 * np.arange(into)[:, None] - 1) * (steps // into) // 2
            first = (first - np.arange(count)[None, :] * width) % steps
            block = total[other, first + steps // into] - total[other, first]
            out[basis.first[other] : basis.first[other + 1], basis.first[ring] : basis.first[ring + 1]] = (
                block
            )
    return np.asarray(np.maximum(out, 0.0) / basis.solid_angle[:, None])


def _patch_tau(model: ScatteringModel, side: str, basis: KlemsBasis, matrix: Array) -> Array:
    """Direct-hemispherical value of the model averaged over each incident patch."""
    sums = basis.solid_angle @ matrix
    sines = np.sin(np.radians(basis.bounds_deg))
    out = np.empty(basis.patches)
    for ring, count in enumerate(basis.phi_count):
        first, low, high = int(basis.first[ring]), float(sines[ring]), float(sines[ring + 1])
        if is_isotropic(model):
            # Where the matrix was summed from the model's own points, its mean stands there already.
            middle = 0.5 * (basis.bounds_deg[ring] + basis.bounds_deg[ring + 1])
            own = _dense(model, side, middle)
            mean = float(sums[first]) if own else _mean_tau(model, side, low, high, np.zeros(1))
            out[first : first + count] = mean
            continue
        across = max(8, 48 // count)
        for k in range(count):
            phi = -(k - 0.5 + (np.arange(across) + 0.5) / across) * 360.0 / count
            out[first + k] = _mean_tau(model, side, low, high, phi)
    return out


def _mean_tau(model: ScatteringModel, side: str, low: float, high: float, phi_deg: Array) -> float:
    """Mean of the direct-hemispherical value over low <= sin(theta) <= high and some azimuths.

    Gauss's rule with 4 and with 8 points; where they do not agree, as in files whose values come in steps,
    the mean over 64 narrow rings. NaN where there are no data.
    """

    def tau(theta: Array) -> Array:
        found = model.direct_hemispherical(side, theta[:, None], phi_deg[None, :])
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", RuntimeWarning)
            return np.asarray(np.nanmean(np.asarray(found, float), axis=1))

    coarse, fine = (float(w @ tau(t)) for t, w in (angles_between(low, high, k) for k in (4, 8)))
    if abs(fine - coarse) <= _AGREE * abs(fine):
        return fine
    s2 = low**2 + (np.arange(_NARROW) + 0.5) / _NARROW * (high**2 - low**2)
    rings = tau(np.degrees(np.arcsin(np.sqrt(s2))))
    return float(np.nanmean(rings)) if np.isfinite(rings).any() else float("nan")


def _incident(basis: KlemsBasis, patch: int) -> tuple[Array, Array, Array]:
    """theta_i, phi_i [K] in degrees over an incident patch, and weights of Gauss's rule along cos(theta)."""
    ring = int(np.searchsorted(basis.first, patch, side="right")) - 1
    count = basis.phi_count[ring]
    low, high = np.asarray(basis.bounds_deg[ring : ring + 2])
    arc = 360.0 / count * np.sin(np.radians(0.5 * (low + high)))
    radial, across = (int(np.clip(np.ceil(w / _APART_DEG), *_POINTS)) for w in (high - low, arc))
    across = max(across, -(-16 // count))
    sines = np.sin(np.radians([low, high]))
    theta, w = angles_between(float(sines[0]), float(sines[1]), radial)
    phi = (patch - basis.first[ring] - 0.5 + (np.arange(across) + 0.5) / across) * 360.0 / count
    # A patch of the incident direction is found from (ix, -iy).
    return np.repeat(theta, across), -np.tile(phi, radial), np.repeat(w, across) / across


def _patch_means(model: ScatteringModel, side: str, basis: KlemsBasis, theta: float, phi: float) -> Array:
    q = model.quadrature(side, theta, phi)
    number = np.bincount(basis.index(-q.ux, q.uy), minlength=basis.patches)
    points = np.clip(np.ceil(2 * np.sqrt(number) / _LEAST) * _LEAST, _LEAST, _MOST).astype(int)
    out = np.empty(basis.patches)
    for k in np.unique(points):
        patches = np.flatnonzero(points == k)
        x, y = _patch_points(basis, patches, int(k))
        out[patches] = np.nan_to_num(model.evaluate(side, theta, phi, -x, y)).mean(axis=1)
    return out


def _patch_points(basis: KlemsBasis, patches: NDArray[np.int64], k: int) -> tuple[Array, Array]:
    """Direction cosines [P, k * k] of k x k parts of equal projected solid angle of some patches."""
    ring = np.searchsorted(basis.first, patches, side="right") - 1
    s2 = np.sin(np.radians(basis.bounds_deg)) ** 2
    step = (np.arange(k) + 0.5) / k
    r = np.sqrt(s2[ring, None] + step * (s2[ring + 1] - s2[ring])[:, None])
    wide = 2 * np.pi / np.asarray(basis.phi_count)[ring]
    phi = ((patches - basis.first[ring])[:, None] - 0.5 + step) * wide[:, None]
    x, y = r[:, :, None] * np.cos(phi)[:, None, :], r[:, :, None] * np.sin(phi)[:, None, :]
    return x.reshape(len(patches), -1), y.reshape(len(patches), -1)


def matrix_between(part: KlemsPart, basis: KlemsBasis, angles_deg: Sequence[float] = (0.0,)) -> KlemsPart:
    """A matrix on other patches, turned about the normal and averaged over some angles.

    Every new value is the mean of the old ones over the pair of new patches, F' = S_out F S_in^T with the
    shares S of the new patches in the old ones, so that the light of the old incident patches is kept.
    """
    old = np.maximum(part.matrix, 0.0)
    matrix = np.zeros((basis.patches, basis.patches))
    for angle in angles_deg:
        # Both patches are found with x or y reversed, so that the turn runs the other way in them.
        into = _overlap(basis, part.incident, -angle)
        out = into if part.outgoing == part.incident else _overlap(basis, part.outgoing, -angle)
        matrix += out @ old @ into.T / len(angles_deg)
    return KlemsPart(matrix=matrix, incident=basis, outgoing=basis)


def _overlap(new: KlemsBasis, old: KlemsBasis, angle_deg: float) -> Array:
    """[new, old] share of each new patch that lies in each old one, turned by an angle before."""
    out = np.zeros((new.patches, old.patches))
    s_new, s_old = (np.sin(np.radians(b.bounds_deg)) ** 2 for b in (new, old))
    for i, n in enumerate(new.phi_count):
        for j, m in enumerate(old.phi_count):
            common = min(s_new[i + 1], s_old[j + 1]) - max(s_new[i], s_old[j])
            if common <= 0:
                continue
            # Lower ends of the sectors in turns; the share of one in the other may be in two pieces.
            a = (np.arange(n)[:, None] - 0.5) / n - angle_deg / 360.0
            b = (np.arange(m)[None, :] - 0.5) / m
            apart = (b - a) % 1.0
            shared = np.clip(np.minimum(1 / n - apart, 1 / m), 0.0, None)
            shared += np.clip(np.minimum(1 / m - (1.0 - apart), 1 / n), 0.0, None)
            shared[shared < 1e-12] = 0.0
            block = slice(new.first[i], new.first[i + 1]), slice(old.first[j], old.first[j + 1])
            out[block] = shared * n * common / (s_new[i + 1] - s_new[i])
    return out
