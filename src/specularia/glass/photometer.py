"""A virtual gonio-photometer: what an instrument would record of a traced pane.

Traced paths leave in single directions; an instrument reads a density, 1/sr, in the directions of its scan.
The density estimate here spreads each path over the instrument's angular response, and further where paths
are few, so that scattering below the noise of tracing comes out smooth rather than grainy. It keeps the
light: the distribution's integral over the hemisphere is the transmission that was traced.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray
from scipy import fft, ndimage, special

from specularia.conventions import direction_angles, direction_cosines, undeflected
from specularia.errors import PhysicsError
from specularia.glass.kernel import BACK
from specularia.gonio.table import Table

if TYPE_CHECKING:
    from specularia.glass.slab import Slab
    from specularia.glass.trace import Paths

__all__ = [
    "HORIZON_DEG",
    "LEAST_PATHS",
    "SHADOW_DEPTH",
    "SHADOW_HALF_WIDTH_DEG",
    "SHADOW_HEIGHT_DEG",
    "Directions",
    "Recorded",
    "density",
    "measure",
    "read_off",
    "recorded",
    "scan",
    "write_tables",
]

Array = NDArray[np.float64]
Directions = tuple[Array, Array]
"""Scattered directions (theta_s, phi_s) in degrees, in the frame of `conventions`."""

HORIZON_DEG = 89.0
"""Polar angle from the exit normal beyond which an instrument does not look."""

SHADOW_HALF_WIDTH_DEG, SHADOW_HEIGHT_DEG, SHADOW_DEPTH = 12.0, 25.0, 0.98
"""The sample mount's column: half its width in phi_s, height above the horizon, and what it takes away."""

_MIDDLE_DEG, _PEAK_DEG = 15.0, 5.0
_CELLS_PER_SIGMA = 1.6
_PADDED = 1.25
_RATIO = math.sqrt(2.0)
_WIDEST_DEG = 6.0
LEAST_PATHS = 4000
"""Paths that a reading gathers at least, where its angular response may be widened for it."""


def scan(
    theta_deg: float, phi_deg: float = 0.0, *, base: int, middle: int, peak: int, rng: np.random.Generator
) -> Directions:
    """Scan path over the transmitted hemisphere: a spiral over all of it and two finer ones around the peak.

    Parameters
    ----------
    theta_deg, phi_deg : incident direction, 0 <= theta < 90.
    base : directions of the golden-angle spiral down to `HORIZON_DEG`.
    middle, peak : directions within 15 and within 5 degrees of the undeflected direction; those beyond
        `HORIZON_DEG` are left out.
    rng : random stream for the phase of each spiral and the pointing error (0.01 degrees).

    Returns
    -------
    theta_s, phi_s : arrays [P], degrees; theta_s lies in (90, 180].
    """
    lowest = math.cos(math.radians(HORIZON_DEG))
    theta, phi = (math.radians(float(a)) for a in undeflected(theta_deg, phi_deg))
    # Turn the pole, straight out of the back, onto the undeflected direction.
    turn = theta - math.pi
    about_y = np.array([[math.cos(turn), 0, math.sin(turn)], [0, 1, 0], [-math.sin(turn), 0, math.cos(turn)]])
    about_z = np.array([[math.cos(phi), -math.sin(phi), 0], [math.sin(phi), math.cos(phi), 0], [0, 0, 1]])
    onto_peak = (about_z @ about_y).T
    parts = [_spiral(base, lowest, rng)]
    for number, radius in ((middle, _MIDDLE_DEG), (peak, _PEAK_DEG)):
        parts.append(_spiral(number, math.cos(math.radians(radius)), rng) @ onto_peak)
    v = np.vstack(parts)
    v += rng.normal(0.0, math.radians(0.01), v.shape)
    v /= np.linalg.norm(v, axis=1, keepdims=True)
    v = v[v[:, 2] < -lowest]
    theta_s, phi_s = direction_angles(v[:, 0], v[:, 1], v[:, 2])
    return theta_s, phi_s


def _spiral(number: int, lowest: float, rng: np.random.Generator) -> Array:
    """Unit vectors [number, 3] spread evenly over the cap z < -lowest (a golden-angle spiral)."""
    k = np.arange(number) + rng.random()
    z = 1.0 - k / max(number, 1) * (1.0 - lowest)
    angle = k * math.pi * (3.0 - math.sqrt(5.0)) + rng.uniform(0.0, 2.0 * math.pi)
    s = np.sqrt(np.clip(1.0 - z * z, 0.0, None))
    return np.column_stack([s * np.cos(angle), s * np.sin(angle), -z])


def measure(
    slab: Slab,
    *,
    theta_deg: float,
    phi_deg: float = 0.0,
    directions: Directions,
    paths: int,
    seed: int,
    aperture_deg: float = 0.6,
    wavelength_nm: float = 520.0,
    name: str = "",
    synthetic: bool = False,
    least_paths: int = LEAST_PATHS,
) -> Table:
    """Trace a pane lit from the front and read the transmitted light off in the directions of a scan.

    Parameters
    ----------
    slab : the pane, with its bubbles and its absorption.
    theta_deg, phi_deg : incident direction, 0 <= theta < 90.
    directions : theta_s, phi_s in degrees, arrays [P], theta_s in (90, 180]; see `scan`.
    paths, seed : number of traced paths and seed of their random streams.
    aperture_deg : full width at half maximum of the angular response, 0.3 to 10 degrees; see `density`.
    wavelength_nm : of the light.
    name, synthetic : label of the table; synthetic is True where the slab itself was invented.
    least_paths : that a reading gathers; see `density`.

    Returns
    -------
    Table of the DSF, without noise and shadow (see `recorded`): light that left the back, over the light that
    arrived. It carries no standard error: neighbouring values share paths.
    """
    from specularia.glass.trace import trace_paths

    traced = trace_paths(
        slab, theta_deg=theta_deg, phi_deg=phi_deg, paths=paths, seed=seed, wavelength_nm=wavelength_nm
    )
    return read_off(
        traced,
        theta_deg=theta_deg,
        phi_deg=phi_deg,
        directions=directions,
        aperture_deg=aperture_deg,
        wavelength_nm=wavelength_nm,
        name=name,
        synthetic=synthetic,
        least_paths=least_paths,
    )


def read_off(
    traced: Paths,
    *,
    theta_deg: float,
    phi_deg: float = 0.0,
    directions: Directions,
    aperture_deg: float = 0.6,
    wavelength_nm: float = 520.0,
    name: str = "",
    synthetic: bool = False,
    least_paths: int = LEAST_PATHS,
) -> Table:
    """The table of `measure` from paths that were traced already, lit from the front at (theta, phi)."""
    theta_s, phi_s = (np.asarray(a, float) for a in directions)
    if np.any(theta_s <= 90.0):
        raise PhysicsError("the virtual gonio-photometer scans transmitted light: theta_s above 90 degrees.")
    out = traced.exit_side == BACK
    bsdf = density(
        traced.ux[out],
        traced.uy[out],
        traced.weight[out],
        (theta_s, phi_s),
        paths=len(traced.weight),
        aperture_deg=aperture_deg,
        least_paths=least_paths,
    )
    return Table(
        file="",
        quantity="DSF",
        side="transmission_front",
        theta_i_deg=theta_deg,
        phi_i_deg=phi_deg,
        theta_s_deg=theta_s,
        phi_s_deg=phi_s,
        values=bsdf * np.abs(np.cos(np.radians(theta_s))),
        up_phi_deg=90.0,
        band=f"{wavelength_nm:g} nm",
        name=name,
        synthetic=synthetic,
    )


def recorded(
    table: Table, *, relative_noise: float, floor: float, shadow: bool, rng: np.random.Generator
) -> Table:
    """A table as a real instrument would have it: shaded by the sample mount, and with noise.

    Parameters
    ----------
    table : noise-free values of the transmitted hemisphere.
    relative_noise : standard deviation of a reading over the reading.
    floor : standard deviation of the additive noise, 1/sr; where there is less light than that, about half of
        the readings come out negative.
    shadow : whether the column that holds the mount takes `SHADOW_DEPTH` of the light within
        `SHADOW_HALF_WIDTH_DEG` of phi_s = -90 and `SHADOW_HEIGHT_DEG` of the horizon, with edges half a
        degree soft.
    rng : random stream.
    """
    values = table.values
    if shadow:
        aside = np.abs((table.phi_s_deg - 270.0 + 180.0) % 360.0 - 180.0)
        above = np.abs(90.0 - table.theta_s_deg)
        shaded = _edge(aside - SHADOW_HALF_WIDTH_DEG) * _edge(above - SHADOW_HEIGHT_DEG)
        values = values * (1.0 - SHADOW_DEPTH * shaded)
    relative, additive = rng.standard_normal((2, values.size))
    return replace(table, values=values * (1.0 + relative_noise * relative) + floor * additive)


def _edge(beyond_deg: Array) -> Array:
    """1 well inside an edge, 0 well outside, with a soft step half a degree wide."""
    out: Array = special.expit(-beyond_deg / 0.5)
    return out


@dataclass(frozen=True)
class Recorded:
    """A table that was written, and the transmission of the paths it was read off from."""

    path: Path
    theta_deg: float
    phi_deg: float
    tau: float
    tau_se: float


def write_tables(
    slab: Slab,
    folder: str | Path,
    *,
    theta_deg: Sequence[float],
    phi_deg: Sequence[float] = (0.0,),
    points: int = 60_000,
    aperture_deg: float = 0.6,
    relative_noise: float = 0.0,
    floor: float = 0.0,
    shadow: bool = False,
    paths: int = 1_000_000,
    wavelength_nm: float = 520.0,
    seed: int = 0,
) -> list[Recorded]:
    """Record a pane in several incident directions and write pab-opto tables.

    Parameters
    ----------
    folder : made where it is missing; tables are named t<theta>_p<phi>.dat.
    theta_deg, phi_deg : each angle at each azimuth; on the normal one azimuth is enough.
    points : directions of each scan, 4 of 10 over the hemisphere and 3 each in the finer ones; see `scan`.
    aperture_deg, paths, wavelength_nm : see `measure`.
    relative_noise, floor, shadow : see `recorded`.
    seed : of paths, scans and noise.
    """
    from specularia.files import make_folder
    from specularia.glass.tally import Tally
    from specularia.glass.trace import trace_paths
    from specularia.gonio.pab import write
    from specularia.progress import task

    folder = make_folder(folder)
    wanted = [(t, p) for t in theta_deg for p in (phi_deg[:1] if t == 0.0 else phi_deg)]
    out = []
    with task("Recording", len(wanted)) as bar:
        for k, (theta, phi) in enumerate(wanted):
            streams = np.random.SeedSequence([seed, k]).spawn(2)
            traced = trace_paths(
                slab,
                theta_deg=theta,
                phi_deg=phi,
                paths=paths,
                seed=int(streams[0].generate_state(1, np.uint32)[0]),
                wavelength_nm=wavelength_nm,
            )
            rng = np.random.default_rng(streams[1])
            fine = round(0.3 * points)
            clean = read_off(
                traced,
                theta_deg=theta,
                phi_deg=phi,
                directions=scan(theta, phi, base=points - 2 * fine, middle=fine, peak=fine, rng=rng),
                aperture_deg=aperture_deg,
                wavelength_nm=wavelength_nm,
                synthetic=True,
            )
            table = recorded(clean, relative_noise=relative_noise, floor=floor, shadow=shadow, rng=rng)
            tally = Tally()
            tally.add(traced)
            share, error = tally.shares
            path = write(table, folder / f"t{theta:05.2f}_p{phi:g}.dat")
            out.append(Recorded(path, theta, phi, float(share[0]), float(error[0])))
            bar.advance()
    return out


@dataclass(frozen=True)
class _Plane:
    """The hemisphere on an equal-area plane (Lambert's azimuthal projection): v = sqrt(2) sin(theta / 2).

    The horizon is the unit circle, a cell has the same solid angle everywhere (2 dv^2), and a Gaussian in
    the plane stands for an aperture of constant solid angle.
    """

    cells: int
    sigmas: tuple[float, ...]  # of the levels, in cells
    cosine: Array  # cos theta_s at the centres of cells, 0 beyond the horizon
    spread_cosine: list[NDArray[np.float32]]  # the cosine blurred at each level
    flat: list[NDArray[np.float32]]  # what each level makes of a BSDF of 1

    @property
    def step(self) -> float:
        return 2.0 * _PADDED / self.cells

    def position(self, ux: Array, uy: Array, cosine: Array) -> tuple[Array, Array]:
        """Place of a direction in cells; whole numbers are centres."""
        scale = 1.0 / (np.sqrt(1.0 + cosine) * self.step)
        middle = 0.5 * self.cells - 0.5
        return ux * scale + middle, uy * scale + middle


def _blurred(spectrum: NDArray[np.complex128], sigma: float, cells: int) -> Array:
    """A field, given by its Fourier transform, blurred with a Gaussian of sigma cells."""
    along = np.exp(-2.0 * (math.pi * sigma * np.fft.fftfreq(cells)) ** 2)
    across = np.exp(-2.0 * (math.pi * sigma * np.fft.rfftfreq(cells)) ** 2)
    out: Array = fft.irfft2(spectrum * along[:, None] * across[None, :], s=(cells, cells), workers=-1)
    return out


def _spectrum(values: Array) -> NDArray[np.complex128]:
    out: NDArray[np.complex128] = fft.rfft2(values, workers=-1)
    return out


@lru_cache(maxsize=1)
def _plane(aperture_deg: float) -> _Plane:
    """The plane and its levels of blur for an aperture (full width at half maximum)."""
    sigma = math.radians(aperture_deg) / math.sqrt(8.0 * math.log(2.0)) / _RATIO
    widest = max(math.radians(_WIDEST_DEG) / _RATIO, sigma)
    cells = fft.next_fast_len(math.ceil(2.0 * _PADDED * _CELLS_PER_SIGMA / sigma), real=True)
    cells += cells % 2
    step = 2.0 * _PADDED / cells
    levels = 1 + math.ceil(math.log(widest / sigma) / math.log(_RATIO))
    sigmas = tuple(sigma / step * _RATIO**k for k in range(levels))
    v = (np.arange(cells) - 0.5 * cells + 0.5) * step
    # cos theta = 1 - v^2
    cosine = np.clip(1.0 - v[:, None] ** 2 - v[None, :] ** 2, 0.0, None)
    spectrum = _spectrum(cosine)
    spread, flat = [], []
    for s in sigmas:
        c = np.clip(_blurred(spectrum, s, cells), 1e-6, None)
        spread.append(c.astype(np.float32))
        flat.append(np.clip(_blurred(_spectrum(cosine / c), s, cells), 1e-3, None).astype(np.float32))
    return _Plane(cells, sigmas, cosine, spread, flat)


def density(
    ux: Array,
    uy: Array,
    weight: Array,
    directions: Directions,
    *,
    paths: int,
    aperture_deg: float,
    least_paths: int = LEAST_PATHS,
) -> Array:
    """BSDF in the directions of a scan, from single exit directions.

    Each path is spread over a Gaussian on the equal-area plane: of the aperture's width where paths are
    dense, wider where it would hold fewer than about `least_paths` of them, and at most 6 degrees (standard
    deviation); so wide a response raises what it reads where the light falls off steeply (30 % where it falls
    to a third within 9 degrees). A path that leaves at v adds w K(v' - v) / C(v) to the BSDF at v', where C,
    the integral of K cos over the hemisphere, makes it carry the light w, at the horizon too. What the
    kernels make of a constant BSDF is known and divided out, and a last factor, within a few parts in a
    thousand of 1, makes the integral exactly sum(w) / paths.

    Parameters
    ----------
    ux, uy, weight : arrays [M] of the paths that left on the wanted side: direction cosines and weight.
    directions : theta_s, phi_s in degrees, arrays [P]; only the angle to the normal and phi_s matter.
    paths : all paths that were traced, also those that ended elsewhere.
    aperture_deg : full width at half maximum of the instrument's response, 0.3 to 10 degrees.
    least_paths : that a reading gathers: more of them make it less noisy, fewer less blurred.

    Returns
    -------
    array [P], 1/sr.

    References
    ----------
    Abramson, I. S. (1982), On bandwidth variation in kernel estimates - a square root law, Annals of
    Statistics 10(4), doi:10.1214/aos/1176345986 (widths that belong to the samples); the rest is ours.
    """
    if not 0.3 <= aperture_deg <= 10.0:
        raise PhysicsError(f"an aperture of {aperture_deg:g} degrees: give 0.3 to 10.")
    ux, uy = np.asarray(ux, float), np.asarray(uy, float)
    plane = _plane(float(aperture_deg))
    n = plane.cells
    x, y = plane.position(ux, uy, np.sqrt(np.clip(1.0 - ux * ux - uy * uy, 0.0, None)))
    cell = np.rint(y).astype(np.intp) * n + np.rint(x).astype(np.intp)
    counts = np.bincount(cell, minlength=n * n).astype(float).reshape(n, n)
    light = np.bincount(cell, weights=weight, minlength=n * n).reshape(n, n)
    level = _levels(counts, plane, least_paths)
    # Of two neighbouring levels each takes its share, so widths change gradually from place to place.
    shares = [np.clip(1.0 - np.abs(level - k), 0.0, None) for k in range(len(plane.sigmas))]
    bsdf, flat = np.zeros((n, n)), np.zeros((n, n))
    for share, sigma, spread, response in zip(shares, plane.sigmas, plane.spread_cosine, plane.flat):
        bsdf += _blurred(_spectrum(share * light / spread), sigma, n)
        flat += share * response
    bsdf = np.where(plane.cosine > 0.0, np.clip(bsdf, 0.0, None) / flat, 0.0)
    solid_angle = 2.0 * plane.step**2
    total = float(np.sum(bsdf * plane.cosine)) * solid_angle
    if total > 0.0:
        bsdf *= float(np.sum(weight)) / paths / total
    theta_s, phi_s = directions
    sx, sy, sz = direction_cosines(theta_s, phi_s)
    at = plane.position(sx, sy, np.abs(sz))
    out: Array = ndimage.map_coordinates(bsdf, [at[1], at[0]], order=3, mode="constant")
    return np.clip(out, 0.0, None)


def _levels(counts: Array, plane: _Plane, least_paths: int) -> Array:
    """Level of blur (a real number) that collects enough paths around each cell."""
    spectrum = _spectrum(counts)
    last = len(plane.sigmas) - 1
    level = np.full(counts.shape, float(last))
    # Paths under a kernel (a Gaussian counts as 4 pi sigma^2 cells), over the cosine: widths follow the BSDF,
    # as the square root law wants, and do not grow towards the horizon by themselves.
    held = [
        np.log(np.clip(4.0 * math.pi * s * s * _blurred(spectrum, s, plane.cells) / cosine, 1e-3, None))
        for s, cosine in zip(plane.sigmas, plane.spread_cosine)
    ]
    wanted = math.log(least_paths)
    for k in range(last, 0, -1):
        between = (held[k] >= wanted) & (held[k - 1] < wanted)
        part = (wanted - held[k - 1]) / np.where(between, held[k] - held[k - 1], 1.0)
        level[between] = (k - 1 + part)[between]
    level[held[0] >= wanted] = 0.0
    return level
