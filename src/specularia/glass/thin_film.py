"""Thin films on a face, such as the layers of weathered glass that shimmer: coherent, by transfer matrices.

A film is a stack of plane layers, thin against the relief, that follows the surface. Light that meets it at
one point is reflected with amplitudes r and transmitted with amplitudes t of the whole stack,

    (B, C) = product over layers of [[cos d, -i sin d / h], [-i h sin d, cos d]] (1, h_last),
    r = (h_0 B - C) / (h_0 B + C),   t = 2 h_0 / (h_0 B + C),   d = 2 pi n w cos(theta) / wavelength,

with h = n cos(theta) for s and n / cos(theta) for p, fields as exp(-i omega t) and complex n = n + i k
(Abeles 1950; Born and Wolf 1999, section 1.6, doi:10.1017/CBO9781139644181). Between the faces of a pane
light adds up without interference: a pane is thicker than light is coherent.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from specularia.errors import PhysicsError

__all__ = [
    "Amplitudes",
    "Film",
    "FilmSpread",
    "amplitudes",
    "face_tables",
    "film_spread",
    "flat_slab_with_films",
    "tables",
]

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]


@dataclass(frozen=True)
class Film:
    """Layers on a face, from the air to the glass.

    Attributes
    ----------
    thickness_nm : [L] > 0, up to 1e5.
    index : [L] refractive indices against air, complex n + i k with n > 0 and k >= 0.
    """

    thickness_nm: tuple[float, ...]
    index: tuple[complex, ...]

    def __post_init__(self) -> None:
        if not self.thickness_nm or len(self.thickness_nm) != len(self.index):
            raise PhysicsError("a film needs as many thicknesses as indices, and at least one.")
        if not all(0.0 < d <= 1e5 for d in self.thickness_nm):
            raise PhysicsError(f"layers of a film are 0 to 1e5 nm thick, not {self.thickness_nm}.")
        for n in self.index:
            if not (0.0 < n.real < 10.0 and 0.0 <= n.imag < 20.0):
                raise PhysicsError(
                    f"the index of a layer is n + i k with 0 < n < 10 and 0 <= k < 20, not {n}."
                )

    @property
    def reversed(self) -> Film:
        """The film seen from the glass."""
        return Film(self.thickness_nm[::-1], self.index[::-1])


class Amplitudes(NamedTuple):
    """Of one stack, for s and p; in the sign convention of Fresnel's equations in docs/theory/slab.md.

    Attributes
    ----------
    rs, rp, ts, tp : amplitudes, complex.
    Rs, Rp, Ts, Tp : shares of the power; in absorbing stacks they do not add up to 1.
    """

    rs: Complex
    rp: Complex
    ts: Complex
    tp: Complex
    Rs: Array
    Rp: Array
    Ts: Array
    Tp: Array


def amplitudes(
    film: Film, cos_theta: ArrayLike, *, wavelength_nm: ArrayLike, index_from: ArrayLike, index_to: ArrayLike
) -> Amplitudes:
    """Reflection and transmission of a film between two media; arguments broadcast.

    Parameters
    ----------
    film : layers in the order in which the light meets them.
    cos_theta : of the angle of incidence in the first medium, 0 < cos <= 1.
    wavelength_nm : in vacuum, > 0.
    index_from, index_to : of the media before and behind, real. Beyond the critical angle all power that is
        not absorbed is reflected.

    >>> quarter = Film((500.0 / (4 * 1.38),), (1.38 + 0j,))
    >>> a = amplitudes(quarter, 1.0, wavelength_nm=500.0, index_from=1.0, index_to=1.52)
    >>> bool(abs(a.Rs - ((1.38**2 - 1.52) / (1.38**2 + 1.52)) ** 2) < 1e-12)
    True
    """
    c = np.asarray(cos_theta, complex)
    before, behind = np.asarray(index_from, complex), np.asarray(index_to, complex)
    wavelength = np.asarray(wavelength_nm, float)
    across = before**2 * (1.0 - c * c)
    ns = [before, *(np.asarray(n, complex) for n in film.index), behind]
    # The root with a positive imaginary part falls off away from where the light comes from.
    cosines = [c, *(_root(1.0 - across / (n * n)) for n in ns[1:])]
    out: list[Complex] = []
    powers: list[Array] = []
    for p in (False, True):
        h = [n / x if p else n * x for n, x in zip(ns, cosines)]
        b, d = np.ones_like(h[-1] * wavelength), h[-1] * np.ones_like(wavelength)
        for thickness, n, x, own in reversed(list(zip(film.thickness_nm, ns[1:-1], cosines[1:-1], h[1:-1]))):
            phase = 2.0 * np.pi * n * thickness * x / wavelength
            if np.max(phase.imag, initial=0.0) > 300.0:
                raise PhysicsError(f"a layer of {thickness:g} nm with the index {n:g} lets no light through.")
            co, si = np.cos(phase), np.sin(phase)
            b, d = co * b - 1j * si / own * d, -1j * own * si * b + co * d
        r = (h[0] * b - d) / (h[0] * b + d)
        t = 2.0 * h[0] / (h[0] * b + d)
        powers += [np.abs(r) ** 2, np.real(h[-1]) / np.real(h[0]) * np.abs(t) ** 2]
        # Tangential amplitudes of p have the other sign on reflection, and another scale on transmission.
        out += [-r if p else r, t * (cosines[0] / cosines[-1]) if p else t]
    return Amplitudes(out[0], out[2], out[1], out[3], powers[0], powers[2], powers[1], powers[3])


def _root(square: Complex) -> Complex:
    root = np.sqrt(square)
    return np.where(root.imag < 0, -root, root)


def tables(film: Film, *, wavelength_nm: float, index: float, entries: int | None = None) -> Array:
    """What the tracer needs of a film on glass of an index: [3, N, 8].

    The three kinds are light from the air and light from the glass, both over the cosine in the air, and
    light that is totally reflected in the glass, over sqrt(n^2 sin^2 - 1) / sqrt(n^2 - 1). In these variables
    all is smooth, and straight lines between the N entries are right to some 1e-6. The eight values are Rs,
    Rp, real and imaginary part of rs conj(rp); Ts, Tp, and those of ts conj(tp) scaled to sqrt(Ts Tp).
    """
    x = np.linspace(0.0, 1.0, entries or _entries(film, wavelength_nm))
    # At exactly 0 formulas divide by it.
    x[0] = 1e-9
    cos_in = np.sqrt(1.0 - (1.0 - x * x) / index**2)
    beyond = np.sqrt(np.maximum(1.0 - (1.0 + (x * x) * (index**2 - 1.0)) / index**2, 1e-24))
    inner = film.reversed
    found = (
        amplitudes(film, x, wavelength_nm=wavelength_nm, index_from=1.0, index_to=index),
        amplitudes(inner, cos_in, wavelength_nm=wavelength_nm, index_from=index, index_to=1.0),
        amplitudes(inner, beyond, wavelength_nm=wavelength_nm, index_from=index, index_to=1.0),
    )
    out = np.zeros((3, x.size, 8))
    for k, a in enumerate(found):
        both = a.rs * np.conj(a.rp)
        out[k, :, :4] = np.stack([a.Rs, a.Rp, both.real, both.imag], axis=-1)
        if k < 2:
            turn = a.ts * np.conj(a.tp)
            both = np.sqrt(a.Ts * a.Tp) * turn / np.maximum(np.abs(turn), 1e-300)
            out[k, :, 4:] = np.stack([a.Ts, a.Tp, both.real, both.imag], axis=-1)
    return out


def _entries(film: Film, wavelength_nm: float) -> int:
    """Entries of a table: the more the thicker the film, and the faster its fringes."""
    phase = sum(2.0 * np.pi * abs(n) * d / wavelength_nm for d, n in zip(film.thickness_nm, film.index))
    return int(min(2048 + 128 * phase, 65536))


@lru_cache(maxsize=16)
def face_tables(films: tuple[Film | None, Film | None], *, wavelength_nm: float, index: float) -> Array:
    """[2, 3, N, 8] `tables` of the front's and of the back's film, 0 for a face without."""
    entries = max(_entries(f, wavelength_nm) for f in films if f is not None)
    out = np.zeros((2, 3, entries, 8))
    for face, film in enumerate(films):
        if film is not None:
            out[face] = tables(film, wavelength_nm=wavelength_nm, index=index, entries=entries)
    return out


def flat_slab_with_films(
    theta_deg: ArrayLike,
    *,
    wavelength_nm: ArrayLike,
    index: ArrayLike,
    front: Film | None = None,
    back: Film | None = None,
    absorption_per_mm: ArrayLike = 0.0,
    thickness_mm: float = 0.0,
) -> tuple[Array, Array, Array]:
    """(transmitted, reflected, absorbed) of a flat pane with films, in unpolarised light; arguments
    broadcast.

    Films are coherent, the pane between them is not: with the powers R, T of the front from outside (no
    dash) and inside (dash), those of the back from inside, and a = exp(-absorption * way),

        T = T_f a T_b / (1 - R_f' R_b a^2),   R = R_f + T_f T_f' R_b a^2 / (1 - R_f' R_b a^2),

    for s and p by themselves. What is absorbed is what is left, in glass and films.
    """
    wavelength, n = np.asarray(wavelength_nm, float), np.asarray(index, float)
    cos_out = np.maximum(np.cos(np.radians(np.asarray(theta_deg, float))), 1e-9)
    cos_in = np.sqrt(1.0 - (1.0 - cos_out**2) / n**2)
    air, left = 1.0, np.exp(-np.asarray(absorption_per_mm, float) * thickness_mm / cos_in)
    bare = Film((1e-6,), (1.0 + 0j,))
    front, back = front or bare, back or bare
    from_air = amplitudes(front, cos_out, wavelength_nm=wavelength, index_from=air, index_to=n)
    to_front = amplitudes(front.reversed, cos_in, wavelength_nm=wavelength, index_from=n, index_to=air)
    to_back = amplitudes(back.reversed, cos_in, wavelength_nm=wavelength, index_from=n, index_to=air)
    through, returned = [], []
    for s in "sp":
        r_f, t_f = getattr(from_air, f"R{s}"), getattr(from_air, f"T{s}")
        r_i, t_i = getattr(to_front, f"R{s}"), getattr(to_front, f"T{s}")
        r_b, t_b = getattr(to_back, f"R{s}"), getattr(to_back, f"T{s}")
        below = 1.0 - r_i * r_b * left**2
        through.append(t_f * left * t_b / below)
        returned.append(r_f + t_f * t_i * r_b * left**2 / below)
    tau, rho = 0.5 * (through[0] + through[1]), 0.5 * (returned[0] + returned[1])
    return tau, rho, 1.0 - tau - rho


@dataclass(frozen=True)
class FilmSpread:
    """What films do to a flat pane over the spectrum, and how far one wavelength may stand for it.

    Attributes
    ----------
    theta_deg : [N] incident angles.
    wavelength_nm : [W].
    tau, rho : [N, W] with films.
    tau_bare, rho_bare : [N, W] without.
    laser_nm : the wavelength that is compared.
    tau_laser, rho_laser : [N] at it.
    tau_visible, rho_visible : [N] means over the spectrum, weighted as Y under the illuminant.
    tau_range, rho_range : [N, 2] least and greatest over the spectrum.
    tau_xyz, rho_xyz : [N, 3] X, Y, Z relative to the illuminant.
    """

    theta_deg: Array
    wavelength_nm: Array
    tau: Array
    rho: Array
    tau_bare: Array
    rho_bare: Array
    laser_nm: float
    tau_laser: Array
    rho_laser: Array
    tau_visible: Array
    rho_visible: Array
    tau_range: Array
    rho_range: Array
    tau_xyz: Array
    rho_xyz: Array


def film_spread(
    *,
    theta_deg: Sequence[float],
    index: Array,
    absorption_per_mm: Array,
    thickness_mm: float,
    front: Film | None,
    back: Film | None,
    laser: tuple[float, float, float],
    illuminant: str = "D65",
) -> FilmSpread:
    """Transmission and reflection of a flat pane with films over the visible spectrum.

    Parameters
    ----------
    index, absorption_per_mm : [W] of the glass at `colour.WAVELENGTHS_NM`.
    laser : (wavelength in nm, index of the glass at it, absorption in 1/mm at it).
    """
    from specularia.glass.colour import WAVELENGTHS_NM, viewing

    theta = np.asarray(theta_deg, float)
    weights = viewing(illuminant).weights

    def pane(
        films: tuple[Film | None, Film | None], wavelength: ArrayLike, n: ArrayLike, a: ArrayLike
    ) -> Array:
        tau, rho, _ = flat_slab_with_films(
            theta[:, None],
            wavelength_nm=wavelength,
            index=n,
            front=films[0],
            back=films[1],
            absorption_per_mm=a,
            thickness_mm=thickness_mm,
        )
        return np.stack([tau, rho])

    tau, rho = pane((front, back), WAVELENGTHS_NM, index, absorption_per_mm)
    bare = pane((None, None), WAVELENGTHS_NM, index, absorption_per_mm)
    at_laser = pane((front, back), laser[0], laser[1], laser[2])[..., 0]
    return FilmSpread(
        theta_deg=theta,
        wavelength_nm=WAVELENGTHS_NM,
        tau=tau,
        rho=rho,
        tau_bare=bare[0],
        rho_bare=bare[1],
        laser_nm=laser[0],
        tau_laser=at_laser[0],
        rho_laser=at_laser[1],
        tau_visible=tau @ weights[1],
        rho_visible=rho @ weights[1],
        tau_range=np.stack([tau.min(axis=1), tau.max(axis=1)], axis=-1),
        rho_range=np.stack([rho.min(axis=1), rho.max(axis=1)], axis=-1),
        tau_xyz=tau @ weights.T,
        rho_xyz=rho @ weights.T,
    )
