"""How much the light depends on the place of the pane that was mapped.

The beam of a gonio-photometer sees square centimetres, a microscope a few square millimetres at best.
The spread between patches of one map says how far a model made from that map may be off for want of area.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from specularia.errors import PhysicsError
from specularia.glass.checkpoint import Store
from specularia.glass.directions import Direction, Pool, Task, trace_directions
from specularia.glass.effort import Effort
from specularia.glass.slab import Slab, patches
from specularia.glass.trace import WAVELENGTH_NM

__all__ = ["Variation", "variation"]

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Variation:
    """Spread between patches, for light on the front, the sample turned under the beam.

    Attributes
    ----------
    along_side : patches along each side of the maps; there are as many squared.
    theta_deg : [N] incident angles.
    tau_sd, rho_sd : [N] standard deviations between patches, the noise of tracing taken out.
    tau_error, rho_error : [N] the same over the square root of the number of patches: standard errors of the
        whole map's values, if patches are independent of each other.
    l1 : [N] mean over patches of the integral of |BSDF of the patch - their mean| over projected solid angle,
        over tau, on 64 x 64 cells. Noise is part of it.
    noise : [N] the most that noise alone would give, see `tally.Bins.noise`.
    """

    along_side: int
    theta_deg: Array
    tau_sd: Array
    rho_sd: Array
    tau_error: Array
    rho_error: Array
    l1: Array
    noise: Array


def variation(
    slab: Slab,
    along_side: int,
    *,
    theta_deg: Sequence[float],
    paths: int,
    seed: int = 0,
    wavelength_nm: float = WAVELENGTH_NM,
    store: Store | None = None,
    pool: Pool | None = None,
) -> Variation:
    """Trace patches of a pane (see `slab.patches`) and compare them.

    Parameters
    ----------
    along_side : patches along each side of the maps, >= 2.
    paths : for each incident angle, of all patches together.
    store, pool : see `directions.trace_directions`.
    """
    if along_side < 2:
        raise PhysicsError(f"a spread needs at least 2 patches along each side, not {along_side}.")
    count = along_side**2
    work = Task(Effort(max(1, paths // count)), seed, wavelength_nm)
    directions = [Direction("front", float(t)) for t in theta_deg]
    shares, errors = np.empty((2, 2, count, len(theta_deg)))
    light, noise = [], np.empty((count, len(theta_deg)))
    for k, patch in enumerate(patches(slab, along_side)):
        found = trace_directions(
            patch,
            directions,
            work,
            store=store,
            pool=pool,
            part=f"patch{k}of{count}-paths{work.effort.paths}-",
            title=f"Tracing patch {k + 1} of {count}",
        )
        for row, part in enumerate(("transmitted", "reflected")):
            shares[row, k] = [getattr(o, part).share for o in found]
            errors[row, k] = [getattr(o, part).share_se for o in found]
        light.append([_coarse(o.transmitted.base) for o in found])
        noise[k] = [o.transmitted.noise for o in found]
    spread = np.sqrt(np.clip(shares.var(axis=1, ddof=1) - np.mean(errors**2, axis=1), 0.0, None))
    cells = np.array(light)
    distance = np.abs(cells - cells.mean(axis=0)).sum(axis=-1).mean(axis=0) / cells.sum(axis=-1).mean(axis=0)
    return Variation(
        along_side,
        np.asarray(theta_deg, float),
        spread[0],
        spread[1],
        spread[0] / along_side,
        spread[1] / along_side,
        distance,
        noise.mean(axis=0),
    )


def _coarse(base: NDArray[np.float32]) -> Array:
    """Light in 64 x 64 cells, flat."""
    n = base.shape[0]
    each = base.astype(float).reshape(64, n // 64, 64, n // 64).sum(axis=(1, 3)) * np.pi / n**2
    return each.ravel()
