"""The colour of a pane in several glasses and thicknesses, all from one trace."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from specularia.errors import PhysicsError
from specularia.glass.colour import OBSERVER, colouring, lab
from specularia.glass.effort import REPLICATES
from specularia.glass.medium import Medium
from specularia.glass.slab import Slab, refuse_films
from specularia.glass.trace import WAVELENGTH_NM, LightSide, trace_paths

__all__ = ["Swatches", "swatches"]

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Swatches:
    """Transmitted colours.

    Attributes
    ----------
    illuminant, observer : of the CIE.
    theta_deg : incident angle.
    glasses : [M] names.
    thickness_mm : [T].
    xyz : [M, T, 3] direct-hemispherical transmission in X, Y and Z, 1 for a pane that takes nothing away.
    xyz_se : [M, T, 3] standard errors, from the spread of replicates; those of the three bands go together.
    lab : [M, T, 3] CIE 1976 L*, a*, b* of xyz.
    traced_mm : the thickness that was traced.
    """

    illuminant: str
    observer: str
    theta_deg: float
    glasses: tuple[str, ...]
    thickness_mm: Array
    xyz: Array
    xyz_se: Array
    lab: Array
    traced_mm: float


def swatches(
    slab: Slab,
    media: Mapping[str, Medium],
    *,
    thickness_mm: Sequence[float],
    theta_deg: float = 0.0,
    phi_deg: float | None = None,
    side: LightSide = "front",
    paths: int = 100_000,
    seed: int = 0,
    wavelength_nm: float = WAVELENGTH_NM,
    illuminant: str = "D65",
) -> Swatches:
    """Transmitted colours of a pane, if it were of other glasses and of other thicknesses.

    The pane is traced once, clear, at its own thickness; every glass weighs the same paths. For another
    thickness all ways in glass grow alike: exact for flat faces, and for rough ones good while the relief is
    thin against the pane (see the theory for how good).

    Parameters
    ----------
    slab : the pane; its index counts at `wavelength_nm`, its absorption does not.
    media : glasses by name; their index does not count.
    thickness_mm : > 0.
    theta_deg, phi_deg, side, paths, seed : as in `trace_paths`.
    illuminant : see `colour.viewing`.

    >>> pale = {"pale": Medium(absorption_per_mm=0.1)}
    >>> found = swatches(Slab(thickness_mm=2.0), pale, thickness_mm=[2.0, 4.0], paths=3200)
    >>> bool(found.xyz[0, 0, 1] > found.xyz[0, 1, 1])
    True
    """
    thickness = np.asarray(thickness_mm, float)
    if thickness.ndim != 1 or thickness.size == 0 or not np.all((thickness > 0) & np.isfinite(thickness)):
        raise PhysicsError("thicknesses in mm must be positive.")
    refuse_films(slab)
    if not media:
        raise PhysicsError("name at least one glass.")
    traced = trace_paths(
        slab,
        side=side,
        theta_deg=theta_deg,
        phi_deg=phi_deg,
        paths=paths,
        seed=seed,
        wavelength_nm=wavelength_nm,
        clear=True,
    )
    through = traced.transmitted
    weight, way = traced.weight[through], traced.glass_length_mm[through]
    replicate = traced.replicate[through]
    each = len(traced) / REPLICATES
    per_replicate = np.empty((len(media), thickness.size, 3, REPLICATES))
    for m, medium in enumerate(media.values()):
        how = colouring(medium, illuminant=illuminant)
        for t, d in enumerate(thickness):
            for band, share in enumerate(how.quick_share(d / slab.thickness_mm * way)):
                light = np.bincount(replicate, weight * share, minlength=REPLICATES)
                per_replicate[m, t, band] = light / each
    xyz = per_replicate.mean(axis=-1)
    return Swatches(
        illuminant=f"CIE {illuminant}",
        observer=OBSERVER,
        theta_deg=theta_deg,
        glasses=tuple(media),
        thickness_mm=thickness,
        xyz=xyz,
        xyz_se=per_replicate.std(axis=-1, ddof=1) / np.sqrt(REPLICATES),
        lab=lab(xyz),
        traced_mm=slab.thickness_mm,
    )
