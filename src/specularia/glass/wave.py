"""Scalar diffraction through a pane, as a referee of the rays: what rays leave out.

Each face is a screen that retards the wave by k h (n cos(theta_t) - cos(theta)), h its relief and theta the
angle of incidence. To second order in the slopes theta_t belongs to the direction into which the place
refracts, t + q with q = (n cos(theta_t) - cos(theta)) grad h, so that the light of a steep place is not bent
too far (ours, from the eikonal in the plane of the screen). Between the screens the wave's angular spectrum
crosses the glass,

    E(K) -> E(K) exp(i d sqrt(n^2 k^2 - K^2)),

and its spectrum behind the second screen is the far field, K = k (ux, uy) (Goodman 2017, Introduction to
Fourier Optics, 4th ed., sections 3.10 and 4). There are no reflections, no polarisation and no shadows, and
slopes must be small: a model for shallow relief of any lateral size, where rays are one for wide
relief of any slope. It shares nothing with the tracer but the maps.
"""

from __future__ import annotations

import warnings
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from specularia.errors import PhysicsError, SpeculariaWarning
from specularia.glass.kernel import BACK, FRONT
from specularia.glass.slab import MANY_PERIODS, Slab

__all__ = ["FarField", "Orders", "far_fields", "orders", "wave"]

Array = NDArray[np.float64]

MOST_SAMPLES = 6000
"""Largest grid along a side: half a gigabyte of single-precision amplitudes in each of a few copies."""


@dataclass(frozen=True)
class Orders:
    """The far field of one window and one wavelength, before it is smoothed.

    Attributes
    ----------
    ux, uy : [N, N] exit direction cosines; beyond the unit disk waves do not leave.
    power : [N, N] share of the power that passed the pane; adds up to 1 with what does not leave.
    specular : share in the undeflected order (with a taper: in its diffraction-limited spot).
    """

    ux: Array
    uy: Array
    power: Array
    specular: float

    @property
    def evanescent(self) -> float:
        """Share that would leave beyond 90 degrees, and does not."""
        return float(self.power[self.ux**2 + self.uy**2 > 1.0].sum())


@dataclass(frozen=True)
class FarField:
    """Transmitted light over direction cosines, smoothed over cells and over members.

    Attributes
    ----------
    edges : [n + 1] of the cells along ux and uy.
    dsf : [n, n] share of the transmitted power per solid angle times cosine, that is per dux duy; axis 0 is
        ux. Its sum times the cell's area is 1, less what leaves outside the cells.
    dsf_se : [n, n] standard error from the spread of the members; NaN with one.
    specular : mean share of the undeflected order.
    evanescent : mean share that does not leave.
    wavelength_nm : [W] wavelengths; each has `members` windows.
    members : windows at different places, or 1 where one window is the whole period of the pane.
    pitch_um, window_um : of the grid of the wave.
    tapered : whether light falls on a window with soft edges, since the pane has no short period.
    """

    edges: Array
    dsf: Array
    dsf_se: Array
    specular: float
    evanescent: float
    wavelength_nm: Array
    members: int
    pitch_um: tuple[float, float]
    window_um: tuple[float, float]
    tapered: bool


@dataclass(frozen=True)
class _Grid:
    """Where the wave is sampled."""

    shape: tuple[int, int]
    window_um: tuple[float, float]
    tapered: bool

    @property
    def pitch_um(self) -> tuple[float, float]:
        return self.window_um[0] / self.shape[1], self.window_um[1] / self.shape[0]


def orders(
    slab: Slab,
    *,
    wavelength_nm: float = 520.0,
    theta_deg: float = 0.0,
    phi_deg: float = 0.0,
    pitch_um: float | None = None,
    window_um: float = 1000.0,
    offset_um: tuple[tuple[float, float], tuple[float, float]] = ((0.0, 0.0), (0.0, 0.0)),
    order: int = 2,
) -> Orders:
    """The far field of one window of a pane, at one wavelength, for light on the front.

    Parameters
    ----------
    slab : the pane; its absorption weighs all light alike and does not count, nor do bubbles and films.
    wavelength_nm : in vacuum.
    theta_deg, phi_deg : incident direction, as in `trace_paths`.
    pitch_um : of the wave's samples, at most; None takes half a wavelength, so that all directions exist.
    window_um : where the faces have no common period up to 4 times as long, the light falls on a window of
        this size with soft edges (Hann); otherwise on a whole number of periods, and is exact for the
        periodic pane.
    offset_um : by how much (x, y) the front and the back are moved under the window.
    order : of the screens in the slopes, 1 or 2; 1 is the plain screen (n - 1) k h.
    """
    grid = _grid(slab, wavelength_nm, pitch_um, window_um)
    return _orders(slab, grid, wavelength_nm, theta_deg, phi_deg, offset_um, order)


def far_fields(
    slab: Slab,
    *,
    wavelength_nm: float = 520.0,
    theta_deg: float = 0.0,
    phi_deg: float = 0.0,
    members: int = 4,
    pitch_um: float | None = None,
    window_um: float = 1000.0,
    seed: int = 0,
    order: int = 2,
) -> Iterator[Orders]:
    """The far fields of windows at random places: `members` of them, or one where it is the whole period.

    Parameters
    ----------
    see `orders` and `wave`.
    """
    grid = _grid(slab, wavelength_nm, pitch_um, window_um)
    for offset in _offsets(slab, members if grid.tapered else 1, np.random.default_rng(seed)):
        yield _orders(slab, grid, wavelength_nm, theta_deg, phi_deg, offset, order)


def _grid(slab: Slab, wavelength_nm: float, pitch_um: float | None, window_um: float) -> _Grid:
    if slab.front.film is not None or slab.back.film is not None:
        raise PhysicsError("the wave model knows no thin films; leave them out.")
    if slab.all_bubbles is not None or slab.bubble_kinds:
        warnings.warn("the wave model leaves out bubbles and inclusions.", SpeculariaWarning, stacklevel=4)
    if slab.patch is not None:
        raise PhysicsError("the wave model knows no finite patch; leave it out.")
    pitch = pitch_um or wavelength_nm / 2e3
    if not 0.0 < pitch < 1e3 or not 0.0 < window_um < 1e6:
        raise PhysicsError("pitch and window of the wave model must be positive.")
    repeats = slab.repeats(FRONT)
    windows, tapered = [], False
    for axis in (0, 1):
        period = slab.pitch_um[FRONT, axis] * slab.reliefs[FRONT].shape[1 - axis] * repeats[axis]
        if slab.front.is_flat and slab.back.is_flat:
            period = window_um
        if period > 4.0 * window_um:
            tapered = True
        windows.append(period)
    if tapered:
        windows = [window_um, window_um]
    from scipy.fft import next_fast_len

    counts = [int(next_fast_len(int(np.ceil(w / pitch)))) for w in windows]
    if max(counts) > MOST_SAMPLES:
        raise PhysicsError(
            f"a window of {windows[0]:.0f} x {windows[1]:.0f} um at a pitch of {pitch:.3g} um takes "
            f"{max(counts)} samples along a side, and {MOST_SAMPLES} are the limit: ask for a smaller window "
            "or a larger pitch."
        )
    return _Grid((counts[1], counts[0]), (windows[0], windows[1]), tapered)


def _orders(
    slab: Slab,
    grid: _Grid,
    wavelength_nm: float,
    theta_deg: float,
    phi_deg: float,
    offset_um: tuple[tuple[float, float], tuple[float, float]],
    order: int,
) -> Orders:
    from scipy import fft

    if not 0.0 <= theta_deg < 90.0:
        raise PhysicsError(f"the incident angle lies in 0 <= theta < 90 degrees, not at {theta_deg}.")
    n = slab.medium.index_at(wavelength_nm)
    k = 2e3 * np.pi / wavelength_nm
    ny, nx = grid.shape
    sine = np.sin(np.radians(theta_deg))
    # The wave without its tilt lies on the grid; the tilt comes back as a shift of all directions.
    tilt = -sine * np.cos(np.radians(phi_deg)), -sine * np.sin(np.radians(phi_deg))
    kx = 2.0 * np.pi * fft.fftfreq(nx, grid.pitch_um[0]) + k * tilt[0]
    ky = 2.0 * np.pi * fft.fftfreq(ny, grid.pitch_um[1]) + k * tilt[1]
    across = (kx[None, :] ** 2 + ky[:, None] ** 2) / (k * k)
    screens = []
    for face, sign in ((FRONT, 1.0), (BACK, -1.0)):
        outside = (slab.front, slab.back)[face].sealant_index or 1.0
        relief = sign * _relief(slab, face, grid, offset_um[face])
        before, behind = (outside, n) if face == FRONT else (n, outside)
        path = _path(relief, grid, tilt, before, behind, 1.0 if face == FRONT else -1.0, order)
        screens.append(np.exp(1j * k * path).astype(np.complex64))
    taper = np.ones((1, 1))
    if grid.tapered:
        taper = np.outer(*(0.5 - 0.5 * np.cos(2.0 * np.pi * (np.arange(m) + 0.5) / m) for m in (ny, nx)))
    field = np.array(np.broadcast_to(screens[0] * taper, grid.shape), np.complex64)
    incident = float(np.mean(taper**2)) * nx * ny
    spectrum = fft.fft2(field, overwrite_x=True)
    # The root is real for all that can leave into air.
    spectrum *= np.exp(1j * 1e3 * slab.thickness_mm * k * np.sqrt(np.maximum(n * n - across, 0.0))).astype(
        np.complex64
    )
    spectrum[across > n * n] = 0.0
    field = fft.ifft2(spectrum, overwrite_x=True)
    field *= screens[1]
    power = np.abs(fft.fft2(field, overwrite_x=True)).astype(float) ** 2 / (incident * nx * ny)
    power /= max(power.sum(), 1e-300)
    rim = float(power[np.abs(fft.fftfreq(ny)) > 0.45].sum() + power[:, np.abs(fft.fftfreq(nx)) > 0.45].sum())
    if rim > 2e-3 and min(nx, ny) > 32 and max(grid.pitch_um) > wavelength_nm / 1.9e3:
        warnings.warn(
            f"the pitch of {max(grid.pitch_um):.3g} um is too coarse for the slopes: {100 * rim:.2g} % of "
            "the power lies at the rim of the spectrum and may go the wrong way; ask for a smaller pitch.",
            SpeculariaWarning,
            stacklevel=4,
        )
    # A Hann window spreads an order over its neighbours.
    near = range(-2, 3) if grid.tapered else range(1)
    specular = float(sum(power[i, j] for i in near for j in near))
    ux, uy = np.broadcast_arrays(kx[None, :] / k, ky[:, None] / k)
    return Orders(ux, uy, power, specular)


def _path(
    relief: Array,
    grid: _Grid,
    tilt: tuple[float, float],
    before: float,
    behind: float,
    sign: float,
    order: int,
) -> Array:
    """Optical path in um that a screen adds: relief times the step of index times cosine across it.

    `before` and `behind` are the indices in the order in which light meets them; relief counts out of the
    glass, which lies behind where `sign` is 1 and before where it is -1.
    """
    if order not in (1, 2):
        raise PhysicsError(f"screens of the wave model are of order 1 or 2, not {order}.")
    across = tilt[0] ** 2 + tilt[1] ** 2
    there, here = np.sqrt(before**2 - across), np.sqrt(behind**2 - across)
    step = sign * (here - there)
    if order == 1 or relief.size == 1:
        return np.asarray(relief * step)
    # Central differences; both edges of the window meet, or are dark.
    gx = (np.roll(relief, -1, 1) - np.roll(relief, 1, 1)) / (2.0 * grid.pitch_um[0])
    gy = (np.roll(relief, -1, 0) - np.roll(relief, 1, 0)) / (2.0 * grid.pitch_um[1])
    bent = (tilt[0] + step * gx) ** 2 + (tilt[1] + step * gy) ** 2
    return np.asarray(relief * sign * (np.sqrt(np.maximum(behind**2 - bent, 0.0)) - there))


def _relief(slab: Slab, face: int, grid: _Grid, offset_um: tuple[float, float]) -> Array:
    """z of a face about its mean plane on the grid, in um, by cubic splines through its samples."""
    from scipy import ndimage

    relief = slab.reliefs[face]
    if relief.min() == relief.max():
        return np.zeros((1, 1))
    ny, nx = grid.shape
    x = (np.arange(nx) * grid.pitch_um[0] + offset_um[0]) / slab.pitch_um[face, 0]
    y = (np.arange(ny) * grid.pitch_um[1] + offset_um[1]) / slab.pitch_um[face, 1]
    smooth = ndimage.spline_filter(relief.astype(float), order=3, mode="grid-wrap")
    out = np.empty(grid.shape)
    for first in range(0, ny, 256):
        rows = np.meshgrid(y[first : first + 256], x, indexing="ij")
        out[first : first + 256] = ndimage.map_coordinates(
            smooth, rows, order=3, mode="grid-wrap", prefilter=False
        )
    return out


def wave(
    slab: Slab,
    *,
    wavelengths_nm: Sequence[float] = (520.0,),
    theta_deg: float = 0.0,
    phi_deg: float = 0.0,
    cells: int = 128,
    half_width: float = 1.0,
    centre: tuple[float, float] = (0.0, 0.0),
    members: int = 4,
    pitch_um: float | None = None,
    window_um: float = 1000.0,
    seed: int = 0,
    order: int = 2,
) -> FarField:
    """The transmitted distribution of a pane by scalar diffraction; light on the front.

    The far field of one window at one wavelength is speckled. It is smoothed over cells of direction, over
    wavelengths, and over windows at other places (`members`), which tell its standard error.

    Parameters
    ----------
    wavelengths_nm : one, or several of equal weight.
    cells, half_width, centre : n x n cells over centre +- half_width in ux and uy.
    members : windows at random places; where one window is the whole period of the pane there is one.
    slab, theta_deg, phi_deg, pitch_um, window_um, order : see `orders`.
    seed : of the places.

    >>> found = wave(Slab(thickness_mm=1.0), window_um=100.0)
    >>> round(found.specular, 6)
    1.0
    """
    if not wavelengths_nm or cells < 1 or not half_width > 0.0 or members < 1:
        raise PhysicsError("the wave model needs wavelengths, members, and cells of some width.")
    edges = np.linspace(-half_width, half_width, cells + 1)
    grid = _grid(slab, min(wavelengths_nm), pitch_um, window_um)
    rng = np.random.default_rng(seed)
    found: list[Array] = []
    specular, lost = [], []
    count = members if grid.tapered else 1
    for offset in _offsets(slab, count, rng):
        for wavelength in wavelengths_nm:
            one = _orders(slab, grid, wavelength, theta_deg, phi_deg, offset, order)
            leaves = one.ux**2 + one.uy**2 <= 1.0
            light, _, _ = np.histogram2d(
                one.ux[leaves] - centre[0],
                one.uy[leaves] - centre[1],
                bins=(edges, edges),
                weights=one.power[leaves],
            )
            evanescent = one.evanescent
            found.append(light / (1.0 - evanescent) / (edges[1] - edges[0]) ** 2)
            specular.append(one.specular)
            lost.append(evanescent)
    each = np.array(found)
    error = np.full(each.shape[1:], np.nan)
    if len(each) > 1:
        error = each.std(axis=0, ddof=1) / np.sqrt(len(each))
    return FarField(
        edges=edges,
        dsf=each.mean(axis=0),
        dsf_se=error,
        specular=float(np.mean(specular)),
        evanescent=float(np.mean(lost)),
        wavelength_nm=np.asarray(wavelengths_nm, float),
        members=count,
        pitch_um=grid.pitch_um,
        window_um=grid.window_um,
        tapered=grid.tapered,
    )


def _offsets(
    slab: Slab, count: int, rng: np.random.Generator
) -> Iterator[tuple[tuple[float, float], tuple[float, float]]]:
    """Places of the window under the front and the back: one place, if there is one period for both."""
    yield (0.0, 0.0), (0.0, 0.0)
    periods = [slab.pitch_um[f] * slab.reliefs[f].shape[::-1] for f in (FRONT, BACK)]
    repeats = slab.repeats(FRONT)
    for _ in range(count - 1):
        front = rng.random(2) * periods[FRONT] * repeats
        apart = [r >= MANY_PERIODS for r in repeats]
        back = np.where(apart, rng.random(2) * periods[BACK], front)
        yield (float(front[0]), float(front[1])), (float(back[0]), float(back[1]))
