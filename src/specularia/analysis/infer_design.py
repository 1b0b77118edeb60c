"""What a guess at a pane's glass would send into cells of deflection, and what a table says of them.

Absorption and the number of bubbles re-weight the paths of one trace; relief below the map's cut-off and the
shape of bubbles need traces of their own.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

from specularia.analysis.lobe_shape import deflection
from specularia.glass import BubbleKind, Medium, Paths, Slab, reweight, trace_paths
from specularia.glass.effort import REPLICATES
from specularia.gonio import Summary
from specularia.gonio.interpolant import Distribution

__all__ = [
    "LEAST_SHARE",
    "PARAMETERS",
    "PER_LENGTH",
    "RINGS_DEG",
    "SECTORS",
    "THICKNESS",
    "Cells",
    "blurred",
    "light_in_cells",
    "measured_light",
    "places",
    "reweighted",
    "traced",
    "with_values",
]

Array = NDArray[np.float64]

PARAMETERS: Final = (
    "absorption_per_mm",
    "bubbles_per_cm3",
    "bubble_diameter_mm",
    "bubble_elongation",
    "micro_slope_front",
    "micro_slope_back",
)
"""What can be inferred besides thickness, which is known from them only times absorption or bubbles."""

THICKNESS: Final = "thickness_mm"
"""Can be sought too; needs no traces of its own, since light knows it only times absorption and bubbles."""

PER_LENGTH: Final = ("absorption_per_mm", "bubbles_per_cm3")
"""Parameters whose product with the thickness is what light knows."""

RINGS_DEG: Final = np.array(
    [0.0, 0.7, 1.4, 2.2, 3.2, 4.5, 6.0, 8.0, 10.5, 13.5, 17.0, 21.0, 26.0, 32.0, 40.0, 50.0, 63.0, 90.0]
)
SECTORS: Final = 3
"""Of a ring: towards the normal, across, and towards the horizon; the two sides across count as one."""

_WHOLE_RINGS: Final = 3
"""The innermost rings are not divided: light that nothing deflects has no azimuth there."""

LEAST_SHARE: Final = 1.5e-4
"""Cells with less of the transmitted light, at the middle one of the guesses, are left out."""

_SUB: Final = 8

_FARTHEST_DEG: Final = 80.0
"""Polar angle of exit up to which light is compared. Closer to the horizon instruments see little, and what a
table has there is carried over from its outermost readings."""

_LEAST_COSINE: Final = float(np.cos(np.radians(_FARTHEST_DEG)))


@dataclass(frozen=True)
class Cells:
    """Cells of deflection that hold light at one angle of incidence.

    Attributes
    ----------
    theta_deg : incident angle.
    used : [C] numbers of the cells.
    deflection_deg : [C] the middle of each, for how alike neighbouring cells are.
    """

    theta_deg: float
    used: NDArray[np.intp]
    deflection_deg: Array


def _cell(ux: Array, uy: Array, theta_deg: float) -> NDArray[np.intp]:
    """Number of the cell of directions; light comes from phi = 0."""
    t = np.radians(theta_deg)
    d = deflection(ux, uy, theta_deg)
    uz = np.sqrt(np.maximum(1.0 - ux * ux - uy * uy, 0.0))
    # Azimuth around the undeflected direction, 0 towards the normal.
    psi = np.abs(np.arctan2(uy, ux * np.cos(t) + uz * np.sin(t)))
    ring = np.clip(np.searchsorted(RINGS_DEG, d, side="right") - 1, 0, RINGS_DEG.size - 2)
    sector = np.minimum((psi * (SECTORS / np.pi)).astype(np.intp), SECTORS - 1)
    return ring * SECTORS + np.where(ring < _WHOLE_RINGS, 0, sector)


_ALL: Final = (RINGS_DEG.size - 1) * SECTORS


def light_in_cells(paths: Paths, theta_deg: float, place: NDArray[np.intp] | None = None) -> Array:
    """[R, cells] share of the light that arrived, which left into each cell, by replicate.

    What leaves beyond `_FARTHEST_DEG`, or is deflected by more than the outermost ring, is in none. `place`
    is that of the same paths with other weights, see `places`.
    """
    place = places(paths, theta_deg) if place is None else place
    inside = place >= 0
    n = REPLICATES
    sums = np.bincount(paths.replicate[inside] * _ALL + place[inside], paths.weight[inside], n * _ALL)
    return np.asarray(sums.reshape(n, _ALL) / np.bincount(paths.replicate, minlength=n)[:, None])


def places(paths: Paths, theta_deg: float) -> NDArray[np.intp]:
    """[paths] number of the cell that each left into, -1 for none."""
    within = paths.transmitted & (paths.ux**2 + paths.uy**2 < 1.0 - _LEAST_COSINE**2)
    within &= deflection(paths.ux, paths.uy, theta_deg) < RINGS_DEG[-1]
    out = np.full(len(paths), -1, np.intp)
    out[within] = _cell(paths.ux[within], paths.uy[within], theta_deg)
    return out


def measured_light(found: Distribution, theta_deg: float, seed: int = 0) -> tuple[Array, Array]:
    """[cells] share of the light that a measured distribution sends into each cell, and its standard error.

    Values are taken on a grid of deflection and azimuth, 8 x 8 in each cell; the noise is that of the same
    sums over draws of the table's noise.
    """
    k = (np.arange(_SUB) + 0.5) / _SUB
    low, high = RINGS_DEG[:-1, None], RINGS_DEG[1:, None]
    edges = np.cos(np.radians(low + (high - low) * np.arange(_SUB + 1) / _SUB))
    d = np.radians(low + (high - low) * k)[:, None, :, None]
    psi = ((np.arange(SECTORS)[:, None] + k) * (np.pi / SECTORS))[None, :, None, :]
    area = (edges[:, :-1] - edges[:, 1:])[:, None, :, None] * (np.pi / SECTORS / _SUB)
    t = np.radians(theta_deg)
    toward, along = np.sin(d) * np.cos(psi), np.cos(d) + 0.0 * psi
    ux = toward * np.cos(t) - along * np.sin(t)
    uz = toward * np.sin(t) + along * np.cos(t)
    uy = np.sin(d) * np.sin(psi) + 0.0 * ux
    seen = uz > _LEAST_COSINE
    weight = np.broadcast_to(area, ux.shape)[seen] * uz[seen]
    number = np.arange(_ALL).reshape(-1, SECTORS)
    number[:_WHOLE_RINGS] = number[:_WHOLE_RINGS, :1]
    place = np.broadcast_to(number[:, :, None, None], ux.shape)[seen]

    def total(one: Distribution) -> Array:
        both = one.at(ux[seen], uy[seen]) + one.at(ux[seen], -uy[seen])
        return np.asarray(np.bincount(place, both * weight, _ALL), float)

    rng = np.random.default_rng(seed)
    noise = [
        total(replace(found, values=rng.standard_normal(found.values.size) * np.sqrt(found.variance)))
        for _ in range(4)
    ]
    return total(found), np.sqrt(np.mean(np.square(noise), axis=0))


def with_values(slab: Slab, values: Mapping[str, float], *, density_as_traced: float | None = None) -> Slab:
    """The pane with other values of what is sought; its bubbles become one kind in free flight."""
    changed: dict[str, object] = {}
    if any(n.startswith("bubble") for n in values):
        first = slab.bubble_kinds[0] if slab.bubble_kinds else BubbleKind(per_cm3=1.0, median_mm=0.2)
        changed["bubble_kinds"] = (
            replace(
                first,
                per_cm3=values.get("bubbles_per_cm3", first.per_cm3),
                median_mm=values.get("bubble_diameter_mm", first.median_mm),
                elongation=values.get("bubble_elongation", first.elongation),
                placing="free flight",
            ),
        )
        changed["bubbles"] = None
    if "absorption_per_mm" in values:
        changed["medium"] = Medium(slab.medium.index, values["absorption_per_mm"])
    for side in ("front", "back"):
        if f"micro_slope_{side}" in values:
            changed[side] = replace(getattr(slab, side), micro_slope=float(values[f"micro_slope_{side}"]))
    if THICKNESS in values:
        changed[THICKNESS] = float(values[THICKNESS])
    return replace(slab, **changed)  # type: ignore[arg-type]


def traced(
    slab: Slab, values: Mapping[str, float], summary: Summary, paths: int, seed: int, wavelength_nm: float
) -> Paths:
    """Paths for one guess, without absorption if that is sought, light coming from phi = 0."""
    table = summary.table
    clear = {**values, "absorption_per_mm": 0.0} if "absorption_per_mm" in values else values
    turn = table.azimuth_deg
    found = trace_paths(
        with_values(slab, clear),
        theta_deg=table.polar_deg,
        phi_deg=turn,
        paths=paths,
        seed=seed,
        wavelength_nm=wavelength_nm,
    )
    c, s = np.cos(np.radians(turn)), np.sin(np.radians(turn))
    return replace(found, ux=found.ux * c + found.uy * s, uy=found.uy * c - found.ux * s)


def blurred(paths: Paths, aperture_deg: float, rng: np.random.Generator) -> Paths:
    """Directions moved by the instrument's response, a Gaussian; over the horizon none goes."""
    sigma = np.radians(aperture_deg) / np.sqrt(8.0 * np.log(2.0))
    uz = np.sqrt(np.maximum(1.0 - paths.ux**2 - paths.uy**2, 0.0))
    moved = np.stack([paths.ux, paths.uy, uz]) + sigma * rng.standard_normal((3, len(paths)))
    moved /= np.linalg.norm(moved, axis=0)
    return replace(paths, ux=moved[0], uy=moved[1])


def reweighted(traced: Paths, base: Mapping[str, float], wanted: Mapping[str, float]) -> Paths:
    """The same paths for another absorption and another number of bubbles."""
    more = wanted.get("absorption_per_mm", 0.0)
    ratio = wanted["bubbles_per_cm3"] / base["bubbles_per_cm3"] if "bubbles_per_cm3" in wanted else 1.0
    return reweight(traced, absorption_per_mm=more, density_ratio=ratio)
