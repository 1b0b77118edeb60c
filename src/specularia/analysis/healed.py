"""What light a pane may have let through before its faces decayed, with an interval from the ensemble."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from specularia.analysis.cutoff import lobe_width, tau_of_paths
from specularia.errors import PhysicsError
from specularia.glass import Face, Slab, trace_paths
from specularia.glass.tiling import Tiling
from specularia.progress import task
from specularia.surface import HeightMap, roughness
from specularia.surface.healing import interval_90

__all__ = ["HealedPane", "healed_pane", "member_slab"]

Array = NDArray[np.float64]


@dataclass(frozen=True)
class HealedPane:
    """A pane traced with each member of the ensembles of its healed faces.

    Parameters
    ----------
    theta_deg : [T].
    tau, tau_se : [N, T] direct-hemispherical transmission of each member and its standard error of tracing.
    fwhm_deg, across_deg : [N, T] of the transmitted lobe, along its wide axis and across.
    Sdq : [N] rms slope, root mean square of the faces.
    """

    theta_deg: Array
    tau: Array
    tau_se: Array
    fwhm_deg: Array
    across_deg: Array
    Sdq: Array

    @property
    def typical(self) -> int:
        """The member of median rms slope."""
        return int(np.argsort(self.Sdq, kind="stable")[len(self.Sdq) // 2])

    def interval(self, quantity: str) -> Array:
        """[T, 2] 90 % interval of "tau", "fwhm_deg" or "across_deg": where one more member would lie.

        It holds the chance of tracing as well, since each member has random numbers of its own.
        """
        values: Array = getattr(self, quantity)
        return np.array([interval_90(values[:, k]) for k in range(values.shape[1])])


def member_slab(slab: Slab, faces: Mapping[str, HeightMap], tiling: Tiling | None) -> Slab:
    """The slab with these faces in place of its own."""
    changed: dict[str, Any] = {
        name: Face.from_map(m, tiling=tiling, name=f"healed {name}") for name, m in faces.items()
    }
    return replace(slab, **changed)


def healed_pane(
    slab: Slab,
    faces: Mapping[str, Sequence[HeightMap]],
    *,
    theta_deg: Sequence[float],
    paths: int,
    seed: int = 0,
    wavelength_nm: float = 520.0,
    tiling: Tiling | None = None,
) -> HealedPane:
    """Trace the pane with member k of every face's ensemble, for all k.

    Parameters
    ----------
    slab : the pane; faces that are not in `faces` stay as they are.
    faces : "front", "back" or both: possible original surfaces, at least 2 and equally many.
    theta_deg : incident angles, 0 <= theta < 90, light on the front at phi = 0.
    paths : per member and angle.
    """
    counts = {len(members) for members in faces.values()}
    if len(counts) != 1 or min(counts) < 2:
        raise PhysicsError(
            f"an interval needs as many members of each face, 2 at least, not {sorted(counts)}."
        )
    count = counts.pop()
    shape = (count, len(theta_deg))
    tau, se, wide, across = (np.empty(shape) for _ in range(4))
    sdq = np.empty(count)
    with task("tracing the ensemble", count * len(theta_deg)) as progress:
        for k in range(count):
            maps = {name: members[k] for name, members in faces.items()}
            sdq[k] = np.sqrt(np.mean([roughness(m).Sdq ** 2 for m in maps.values()]))
            pane = member_slab(slab, maps, tiling)
            for j, theta in enumerate(theta_deg):
                stream = int(np.random.SeedSequence([seed, k, j]).generate_state(1, np.uint32)[0])
                traced = trace_paths(
                    pane, theta_deg=float(theta), paths=paths, seed=stream, wavelength_nm=wavelength_nm
                )
                tau[k, j], se[k, j] = tau_of_paths(traced)
                lobe = lobe_width(traced, float(theta))
                wide[k, j], across[k, j] = lobe.fwhm_deg, lobe.across_deg
                progress.advance()
    return HealedPane(np.asarray(theta_deg, float), tau, se, wide, across, sdq)
