"""For which lateral sizes rays and waves agree: both models of one pane, compared cell by cell."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from specularia.errors import PhysicsError
from specularia.glass.effort import REPLICATES
from specularia.glass.faces import Face
from specularia.glass.medium import Medium
from specularia.glass.slab import Slab
from specularia.glass.trace import trace_paths
from specularia.glass.wave import FarField, wave

__all__ = ["Agreement", "SizeAgreement", "agreement", "caps", "size_agreement"]

Array = NDArray[np.float64]

CELL = 1.0 / 32.0
"""Width of the cells in direction cosine: those of 64 x 64 over the hemisphere, 1.8 degrees."""

INSIDE = 2.0
"""Ways in glass over the thickness above which a path was reflected inside."""


@dataclass(frozen=True)
class Agreement:
    """Rays against waves.

    Attributes
    ----------
    l1 : integral of |waves - rays| over direction cosines, both normalised to 1 over all that leaves behind.
    noise : what l1 would be from noise alone, if the models agreed: speckle and paths. NaN where there is one
        window at one wavelength.
    cell : width of the cells in direction cosine.
    half_width : of the cells' square around the undeflected direction.
    beyond : (share of the waves, share of the rays) outside it.
    reflected_inside : share of the rays' transmitted light that was reflected inside the glass, and is left
        out since the wave model has no reflections.
    far_field : the waves.
    rays : [n, n] of the rays, as `far_field.dsf`.
    rays_se : [n, n] its standard error.
    """

    l1: float
    noise: float
    cell: float
    half_width: float
    beyond: tuple[float, float]
    reflected_inside: float
    far_field: FarField
    rays: Array
    rays_se: Array


def agreement(
    slab: Slab,
    *,
    wavelengths_nm: Sequence[float] = (520.0,),
    theta_deg: float = 0.0,
    phi_deg: float = 0.0,
    members: int = 4,
    paths: int = 400_000,
    cell: float = CELL,
    seed: int = 0,
    pitch_um: float | None = None,
    window_um: float = 1000.0,
) -> Agreement:
    """Compare `wave` with traced paths of the same pane, for light on the front.

    Parameters
    ----------
    cell : width of the cells in direction cosine. Speckle of the waves has the width wavelength / window, so
        cells must be many times wider.
    paths : of the rays.
    slab, wavelengths_nm, theta_deg, phi_deg, members, pitch_um, window_um, seed : see `wave`; rays take the
        index at the mean wavelength.
    """
    traced = trace_paths(
        slab,
        theta_deg=theta_deg,
        phi_deg=phi_deg,
        paths=paths,
        seed=seed,
        wavelength_nm=float(np.mean(wavelengths_nm)),
        clear=True,
    )
    through = traced.transmitted
    straight = through & (traced.glass_length_mm <= INSIDE * slab.thickness_mm)
    if not straight.any():
        raise PhysicsError("no ray crosses the pane straight; there is nothing to compare.")
    sine, turn = np.sin(np.radians(theta_deg)), np.radians(phi_deg)
    centre = -float(sine * np.cos(turn)), -float(sine * np.sin(turn))
    x, y = traced.ux[straight] - centre[0], traced.uy[straight] - centre[1]
    reach = float(np.quantile(np.hypot(x, y), 0.99))
    count = 2 * int(np.ceil(1.25 * reach / cell)) + 2
    half = 0.5 * count * cell
    edges = np.linspace(-half, half, count + 1)
    part, weight = traced.replicate[straight], traced.weight[straight]
    total = np.bincount(part, weight, minlength=REPLICATES)
    rays = np.empty((REPLICATES, count, count))
    for r in range(REPLICATES):
        mine = part == r
        light, _, _ = np.histogram2d(x[mine], y[mine], bins=(edges, edges), weights=weight[mine])
        rays[r] = light / total[r] / cell**2
    far = wave(
        slab,
        wavelengths_nm=wavelengths_nm,
        theta_deg=theta_deg,
        phi_deg=phi_deg,
        cells=count,
        half_width=half,
        centre=centre,
        members=members,
        pitch_um=pitch_um,
        window_um=window_um,
        seed=seed,
    )
    return _compared(
        far,
        rays.mean(axis=0),
        rays.std(axis=0, ddof=1) / np.sqrt(REPLICATES),
        float(weight.sum() / traced.weight[through].sum()),
    )


def _compared(far: FarField, rays: Array, rays_se: Array, straight: float) -> Agreement:
    area = float(far.edges[1] - far.edges[0]) ** 2
    beyond = 1.0 - float(far.dsf.sum()) * area, 1.0 - float(rays.sum()) * area
    both = np.hypot(far.dsf_se, rays_se)
    return Agreement(
        l1=float(np.abs(far.dsf - rays).sum()) * area + abs(beyond[0] - beyond[1]),
        noise=float(np.sqrt(2.0 / np.pi) * both.sum()) * area,
        cell=float(far.edges[1] - far.edges[0]),
        half_width=float(far.edges[-1]),
        beyond=beyond,
        reflected_inside=1.0 - straight,
        far_field=far,
        rays=rays,
        rays_se=rays_se,
    )


def caps(
    size_um: float, *, edge_slope: float = 0.6, across: int = 12, samples: int = 40, seed: int = 0
) -> Face:
    """A synthetic face covered with pits that are caps of spheres, periodic.

    Parameters
    ----------
    size_um : mean diameter of a cap; they overlap, and the deepest counts. Diameters lie evenly within 30 %
        of it: bottoms of one depth would add up to a bright undeflected order that no ray knows of.
    edge_slope : slope at a cap's rim.
    across : period in sizes.
    samples : pixels across a cap.
    seed : of the places, six caps to a size squared.
    """
    pitch, n = size_um / samples, across * samples
    rng = np.random.default_rng(seed)
    heights = np.zeros((n, n))
    at = np.arange(n) * pitch
    for fx, fy, size in rng.random((6 * across**2, 3)):
        cx, cy, radius = fx * n * pitch, fy * n * pitch, 0.5 * size_um * (0.7 + 0.6 * size)
        # Distance to the nearest periodic image.
        dx = np.abs(at - cx)
        dy = np.abs(at - cy)
        dx, dy = np.minimum(dx, n * pitch - dx), np.minimum(dy, n * pitch - dy)
        near_x, near_y = np.flatnonzero(dx < radius), np.flatnonzero(dy < radius)
        r2 = (dx[near_x][None, :] ** 2 + dy[near_y][:, None] ** 2) / radius**2
        depth = -0.5 * edge_slope * radius * (1.0 - r2)
        box = np.ix_(near_y, near_x)
        heights[box] = np.minimum(heights[box], depth)
    return Face(heights, pitch, pitch, name=f"caps of {size_um:g} um (synthetic)")


@dataclass(frozen=True)
class SizeAgreement:
    """How far rays and waves are apart over the lateral size of relief of one slope.

    Attributes
    ----------
    size_um : [S] diameters of the caps.
    l1, noise : [S] see `Agreement`.
    cell : width of the cells, the same for all sizes.
    edge_slope : of the caps.
    wavelength_nm : of the waves.
    """

    size_um: Array
    l1: Array
    noise: Array
    cell: float
    edge_slope: float
    wavelength_nm: float

    def agree_above_um(self, limit: float = 0.05) -> float:
        """Smallest size from which on l1 stays within the limit; infinite where it never does."""
        good = np.flatnonzero(self.l1 > limit)
        after = 0 if good.size == 0 else int(good[-1]) + 1
        return float(self.size_um[after]) if after < self.size_um.size else float("inf")


def size_agreement(
    sizes_um: Sequence[float],
    *,
    edge_slope: float = 0.6,
    index: float = 1.52,
    wavelength_nm: float = 520.0,
    cell: float = CELL,
    members: int = 4,
    paths: int = 200_000,
    seed: int = 0,
) -> SizeAgreement:
    """Compare rays and waves on one face of caps (`caps`) of several sizes and one slope; the other is flat.

    By rays the distribution depends on slopes alone, and is the same for all sizes; waves spread each cap's
    light by wavelength over size.

    Parameters
    ----------
    sizes_um : ascending.
    cell : of direction cosine, for all sizes.
    members : faces for each size, with caps at other places; waves and rays are averaged over them.
    """
    sizes = np.asarray(sizes_um, float)
    if sizes.ndim != 1 or sizes.size == 0 or np.any(np.diff(sizes) <= 0) or sizes[0] <= 0:
        raise PhysicsError("sizes of caps must be positive and ascend.")
    l1, noise = [], []
    for size in sizes:
        # Wide enough for many caps, and for many speckles to a cell.
        across = int(np.ceil(float(np.clip(16.0 * size, 200.0, 800.0)) / size))
        samples = int(np.clip(2400 // across, 8, 40))
        each = [
            agreement(
                Slab(
                    thickness_mm=1.0,
                    medium=Medium(index=index),
                    front=caps(size, edge_slope=edge_slope, across=across, samples=samples, seed=seed + m),
                    synthetic=True,
                ),
                wavelengths_nm=[wavelength_nm],
                members=1,
                paths=paths,
                cell=cell,
                seed=seed,
                window_um=across * size,
            )
            for m in range(members)
        ]
        count = min(a.rays.shape[0] for a in each)
        waves, rays = (
            np.array([_middle(v, count) for v in part])
            for part in zip(*((a.far_field.dsf, a.rays) for a in each))
        )
        far = replace(
            each[0].far_field,
            edges=np.linspace(-0.5 * count * cell, 0.5 * count * cell, count + 1),
            dsf=waves.mean(axis=0),
            dsf_se=(waves - rays).std(axis=0, ddof=1) / np.sqrt(members),
        )
        # Both models see the same faces: what differs between faces is in both.
        found = _compared(far, rays.mean(axis=0), np.zeros((count, count)), 1.0)
        l1.append(found.l1)
        noise.append(found.noise)
    return SizeAgreement(sizes, np.array(l1), np.array(noise), cell, edge_slope, wavelength_nm)


def _middle(values: Array, count: int) -> Array:
    skip = (values.shape[0] - count) // 2
    return values[skip : skip + count, skip : skip + count]
