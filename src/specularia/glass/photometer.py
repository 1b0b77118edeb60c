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
class _Blur:
    """A Gaussian on a grid, and what it does there.

    Attributes
    ----------
    sigma : in cells of the grid.
    spread_cosine : [cells, cells] the cosine blurred.
    flat : [cells, cells] what it makes of a BSDF of 1.
    """

    sigma: float
    spread_cosine: NDArray[np.float32]
    flat: NDArray[np.float32]


@dataclass(frozen=True)
class _Grid:
    """The hemisphere on an equal-area plane (Lambert's azimuthal projection): v = sqrt(2) sin(theta / 2).

    The horizon is the unit circle, a cell has the same solid angle everywhere (2 dv^2), and a Gaussian in
    the plane stands for an aperture of constant solid angle.

    Attributes
    ----------
    cells : along each side.
    cosine : [cells, cells] cos theta_s at the centres, 0 beyond the horizon.
    blurs : those that are worked out on this grid; wider ones have a coarser one.
    """

    cells: int
    cosine: Array
    blurs: tuple[_Blur, ...]

    @classmethod
    def of(cls, cells: int, sigmas: Sequence[float]) -> _Grid:
        v = (np.arange(cells) - 0.5 * cells + 0.5) * (2.0 * _PADDED / cells)
        # cos theta = 1 - v^2
        cosine = np.clip(1.0 - v[:, None] ** 2 - v[None, :] ** 2, 0.0, None)
        spectrum = _spectrum(cosine)
        blurs = []
        for s in sigmas:
            c = np.clip(_blurred(spectrum, s, cells), 1e-6, None)
            flat = np.clip(_blurred(_spectrum(cosine / c), s, cells), 1e-3, None)
            blurs.append(_Blur(s, c.astype(np.float32), flat.astype(np.float32)))
        return cls(cells, cosine, tuple(blurs))

    @property
    def step(self) -> float:
        return 2.0 * _PADDED / self.cells

    @property
    def solid_angle(self) -> float:
        """Of a cell, sr."""
        return 2.0 * self.step**2

    def place(self, v: Array) -> Array:
        """[2, N] row and column, counted in cells, of places (y, x); whole numbers are centres."""
        return np.asarray(v / self.step + (0.5 * self.cells - 0.5), float)

    def cell(self, v: Array) -> NDArray[np.intp]:
        """[N] number of the cell that holds a place."""
        row, column = np.rint(self.place(v)).astype(np.intp)
        return np.asarray(row * self.cells + column)

    def centres(self) -> Array:
        """[2, N] places of all cells within the horizon."""
        row, column = np.nonzero(self.cosine > 0.0)
        return np.asarray((np.stack([row, column]) - (0.5 * self.cells - 0.5)) * self.step, float)

    def summed(self, cell: NDArray[np.intp], values: Array) -> Array:
        """[cells, cells] values added up in their cells."""
        n = self.cells
        return np.bincount(cell, weights=values, minlength=n * n).astype(float).reshape(n, n)

    def read(self, field: NDArray[np.floating], v: Array, order: int = 1) -> Array:
        """[N] a field at places."""
        return np.asarray(ndimage.map_coordinates(field, self.place(v), order=order, mode="nearest"), float)


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
def _grids(aperture_deg: float) -> tuple[_Grid, ...]:
    """Grids, each with half the cells of the one before, and on them the levels of blur for an aperture.

    The first level is that of the aperture (full width at half maximum), each further one wider by sqrt(2).
    """
    sigma = math.radians(aperture_deg) / math.sqrt(8.0 * math.log(2.0)) / _RATIO
    widest = max(math.radians(_WIDEST_DEG) / _RATIO, sigma)
    levels = 1 + math.ceil(math.log(widest / sigma) / math.log(_RATIO))
    # Halved where a level is at least twice as wide as the first one would be on the coarser grid.
    halved = [max(math.floor(0.5 * k - 1.0), 0) for k in range(levels)]
    block = 2 ** halved[-1]
    least = 2.0 * _PADDED * _CELLS_PER_SIGMA / sigma
    cells = block * fft.next_fast_len(math.ceil(least / block), real=True)
    cells += cells % 2
    first = sigma / (2.0 * _PADDED / cells)
    return tuple(
        _Grid.of(cells // 2**j, [first * _RATIO**k / 2**j for k in range(levels) if halved[k] == j])
        for j in range(halved[-1] + 1)
    )


def _in_plane(ux: Array, uy: Array, cosine: Array) -> Array:
    """[2, N] places (y, x) of directions."""
    return np.stack([uy, ux]) / np.sqrt(1.0 + cosine)


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
    grids = _grids(float(aperture_deg))
    left = _in_plane(ux, uy, np.sqrt(np.clip(1.0 - ux * ux - uy * uy, 0.0, None)))
    # Paths that left into one cell of the finest grid are spread as one.
    cell, which = np.unique(grids[0].cell(left), return_inverse=True)
    light, number = np.bincount(which, weights=weight), np.bincount(which).astype(float)
    n = grids[0].cells
    origin = (np.stack(np.divmod(cell, n)) - (0.5 * n - 0.5)) * grids[0].step
    theta_s, phi_s = directions
    sx, sy, sz = direction_cosines(theta_s, phi_s)
    wanted = _in_plane(sx, sy, np.abs(sz))
    # The integral is taken over a grid that is coarse, and fine enough for what is divided out.
    whole = grids[min(2, len(grids) - 1)]
    everywhere = whole.centres()
    held = _held(grids, origin, number)
    shares = [_shares(held, at, least_paths) for at in (origin, wanted, everywhere)]
    bsdf = [np.zeros((g.cells, g.cells)) for g in grids]
    flat: Array = np.zeros(wanted.shape[1])
    flat_everywhere: Array = np.zeros(everywhere.shape[1])
    k = 0
    for grid, total in zip(grids, bsdf):
        at = grid.cell(origin)
        for blur in grid.blurs:
            spread = blur.spread_cosine.ravel()[at]
            total += _blurred(
                _spectrum(grid.summed(at, shares[0][k] * light / spread)), blur.sigma, grid.cells
            )
            flat = flat + shares[1][k] * grid.read(blur.flat, wanted)
            flat_everywhere = flat_everywhere + shares[2][k] * grid.read(blur.flat, everywhere)
            k += 1
        total /= grid.solid_angle / grids[0].solid_angle
    found = sum(g.read(b, wanted, order=3) for g, b in zip(grids, bsdf)) / flat
    summed = sum(_averaged(g, b, whole, everywhere) for g, b in zip(grids, bsdf)) / flat_everywhere
    cosine = 1.0 - np.sum(everywhere**2, axis=0)
    integral = float(np.sum(np.clip(summed, 0.0, None) * cosine)) * whole.solid_angle
    if integral > 0.0:
        found = found * (float(np.sum(weight)) / paths / integral)
    return np.asarray(np.clip(found, 0.0, None))


def _averaged(grid: _Grid, field: Array, onto: _Grid, at: Array) -> Array:
    """[N] a field's means over the cells of a grid that is no finer, or its values there."""
    if grid.cells <= onto.cells:
        return grid.read(field, at)
    k = grid.cells // onto.cells
    means = field.reshape(onto.cells, k, onto.cells, k).mean(axis=(1, 3))
    return np.asarray(means[onto.cosine > 0.0])


def _held(grids: Sequence[_Grid], origin: Array, number: Array) -> list[tuple[_Grid, Array]]:
    """At each level of blur, logarithm of the number of paths under its kernel over the cosine.

    A Gaussian counts as 4 pi sigma^2 cells. Over the cosine: widths follow the BSDF, as the square root law
    wants, and do not grow towards the horizon by themselves.
    """
    out = []
    for grid in grids:
        spectrum = _spectrum(grid.summed(grid.cell(origin), number))
        for blur in grid.blurs:
            under = 4.0 * math.pi * blur.sigma**2 * _blurred(spectrum, blur.sigma, grid.cells)
            out.append((grid, np.log(np.clip(under / blur.spread_cosine, 1e-3, None))))
    return out


def _shares(held: Sequence[tuple[_Grid, Array]], at: Array, least_paths: int) -> list[Array]:
    """Share of each level of blur at places: of two neighbouring levels each takes its part.

    So widths change gradually from place to place; together they gather `least_paths`.
    """
    wanted = math.log(least_paths)
    there = [grid.read(field, at) for grid, field in held]
    last = len(there) - 1
    level = np.full(at.shape[1], float(last))
    for k in range(last, 0, -1):
        between = (there[k] >= wanted) & (there[k - 1] < wanted)
        part = (wanted - there[k - 1]) / np.where(between, there[k] - there[k - 1], 1.0)
        level[between] = (k - 1 + part)[between]
    level[there[0] >= wanted] = 0.0
    return [np.clip(1.0 - np.abs(level - k), 0.0, None) for k in range(last + 1)]
