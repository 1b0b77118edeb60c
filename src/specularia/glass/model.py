"""Model C: the scattering of a pane, tabulated from traced paths."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from specularia.bsdf.tabulated import SideTable, TabulatedModel
from specularia.errors import PhysicsError
from specularia.glass.checkpoint import Store, code_digest, content_digest
from specularia.glass.colour import CIE_BANDS, OBSERVER, Colouring, colouring
from specularia.glass.colour import WAVELENGTHS_NM as COLOUR_NM
from specularia.glass.directions import ColouredOutcome, Direction, Outcome, Pool, Task, trace_directions
from specularia.glass.effort import DEFAULT_PATHS, Effort
from specularia.glass.slab import Slab, refuse_films
from specularia.glass.tally import HALF_WIDTH, Distribution
from specularia.glass.trace import (
    WAVELENGTH_NM,
    EnergyBalance,
    LightSide,
    warn_of_lost,
    warn_of_noise,
)
from specularia.glass.variation import Variation, variation
from specularia.provenance import record, to_json

__all__ = ["NODES_DEG", "Traced", "model", "traced_model"]

Array = NDArray[np.float64]

NODES_DEG = (0, 10, 20, 30, 40, 50, 55, 60, 65, 70, 75, 77.5, 80, 82.5, 85, 87, 88.5, 89.5)
"""Incident angles, dense where transmission falls: interpolated between them, tau of a clear flat pane is
right to 0.1 % up to the last."""

_FACES: tuple[LightSide, ...] = ("front", "back")


@dataclass(frozen=True)
class Traced:
    """A traced model with the energy balance of the paths it was made of.

    Attributes
    ----------
    model : the tables.
    balances : for light on the "front" and on the "back", one value for each incident angle. In anisotropic
        models these are means over the azimuths, and the standard errors are upper bounds of theirs.
    noise : of each side of the model, one value for each incident direction; see `tally.Bins.noise`.
    store : where finished directions were kept; to be removed once the model is written. None without one.
    variation : spread between patches of the maps, where it was asked for.
    """

    model: TabulatedModel
    balances: Mapping[str, EnergyBalance]
    noise: Mapping[str, Array]
    store: Store | None = None
    variation: Variation | None = None


def model(slab: Slab, **settings: Any) -> TabulatedModel:
    """Trace a pane from both sides and tabulate all four: transmission and reflection, front and back.

    Settings and result as those of `traced_model`, without the energy balance.
    """
    return traced_model(slab, **settings).model


def traced_model(
    slab: Slab,
    *,
    paths: int = DEFAULT_PATHS,
    target_error: float | None = None,
    seed: int = 0,
    wavelength_nm: float = WAVELENGTH_NM,
    theta_deg: Sequence[float] = NODES_DEG,
    azimuths: int | None = None,
    output: str | Path | None = None,
    pool: Pool | None = None,
    patches: int | None = None,
    colour: str | None = None,
) -> Traced:
    """Trace a pane from both sides and tabulate all four: transmission and reflection, front and back.

    Parameters
    ----------
    slab : the pane.
    paths : for each incident direction; with a target error the most that a direction gets.
    target_error : relative error at which a direction is done, or None; see `effort.Effort`.
    seed : of all random streams.
    wavelength_nm : for index and absorption; it becomes the model's band.
    theta_deg : incident angles, ascending, 0 <= theta < 90.
    azimuths : None turns the sample under the beam (each path has an azimuth of its own): the model is
        isotropic. A number >= 3 lights it from so many azimuths, evenly from 0: the model is anisotropic.
    output : the file that the model will end in. Finished directions are kept beside it, and taken from there
        where an earlier run of the same pane and settings was interrupted.
    pool : where to trace; None traces in this process. The numbers are the same.
    patches : trace so many patches along each side of the maps too, for the spread between them.
    colour : illuminant of the CIE under which the model holds the bands CIE-X, Visible and CIE-Z, all from
        the same paths (see `colour`); None takes the pane's, and where that has none, one wavelength. The
        index is that at `wavelength_nm` throughout.

    Returns
    -------
    Traced : BSDF as means over cells, merged where few paths arrived (see `merging`). Standard errors come
        from the spread of replicates; where no path arrived, that of a single one in the largest block.
    """
    theta = np.asarray(theta_deg, float)
    if theta.ndim != 1 or theta.size == 0 or np.any(np.diff(theta) <= 0):
        raise PhysicsError("the incident angles of a model must ascend.")
    if azimuths is not None and azimuths < 3:
        raise PhysicsError(f"an anisotropic model needs at least 3 azimuths, not {azimuths}.")
    illuminant = colour or slab.colour
    if illuminant is not None:
        refuse_films(slab)
    if illuminant is not None and patches is not None:
        raise PhysicsError("the spread between patches is computed for one wavelength; leave out the colour.")
    how = None if illuminant is None else colouring(slab.medium, illuminant=illuminant)
    work = Task(Effort(paths, target_error), seed, wavelength_nm, how)
    nodes = [(float(t), phi) for t in theta for phi in _ring(float(t), azimuths)]
    directions = [Direction(side, t, phi) for side in _FACES for t, phi in nodes]
    store = None
    if output is not None:
        store = Store(output, key=content_digest(code_digest(), slab, work))
    outcomes = trace_directions(slab, directions, work, store=store, pool=pool)
    warn_of_lost(sum(o.lost for o in outcomes), sum(o.paths for o in outcomes))
    warn_of_noise([o.error for o in outcomes], work.effort)

    tables, noise = _tables(nodes, outcomes)
    coloured = [o for o in outcomes if isinstance(o, ColouredOutcome)]
    more = {
        band: _tables(nodes, [getattr(o, name) for o in coloured])[0]
        for band, name in ((CIE_BANDS[0], "x"), (CIE_BANDS[2], "z"))
        if coloured
    }
    balances: dict[str, EnergyBalance] = {
        face: _balance(theta, nodes, outcomes[k * len(nodes) : (k + 1) * len(nodes)])
        for k, face in enumerate(_FACES)
    }
    light = f"at {wavelength_nm:g} nm" if how is None else f"in the CIE bands under CIE {how.illuminant}"
    attributes = record(
        what=f"Scattering model traced through a pane's geometry (Model C) {light}.",
        inputs=slab.sources,
        parameters={
            **_described(slab, wavelength_nm, how),
            "paths_per_direction": paths if target_error is None else [o.paths for o in outcomes],
            "target_error": target_error,
            "azimuths": azimuths,
        },
        seed=seed,
        synthetic=slab.synthetic,
    )
    attributes["energy_balance"] = to_json(
        {face: {f: getattr(b, f) for f in _BALANCE} for face, b in balances.items()}
    )
    attributes["noise"] = to_json(noise)
    spread = None
    if patches is not None:
        spread = variation(
            slab,
            patches,
            theta_deg=theta.tolist(),
            paths=round(np.mean([o.paths for o in outcomes])),
            seed=seed,
            wavelength_nm=wavelength_nm,
            store=store,
            pool=pool,
        )
        attributes["patches"] = to_json(asdict(spread))
    return Traced(
        model=TabulatedModel(
            tables=tables,
            band=f"{wavelength_nm:g} nm" if how is None else CIE_BANDS[1],
            attributes=attributes,
            more=more,
        ),
        balances=balances,
        noise=noise,
        store=store,
        variation=spread,
    )


_BALANCE = (
    "theta_deg",
    "tau",
    "tau_se",
    "rho",
    "rho_se",
    "absorbed",
    "absorbed_se",
    "sides",
    "lost",
    "paths",
)


def _ring(theta_deg: float, azimuths: int | None) -> Sequence[float | None]:
    """Azimuths of incidence at an incident angle; on the normal one says all."""
    if azimuths is None:
        return (None,)
    return (0.0,) if theta_deg == 0.0 else tuple(360.0 * k / azimuths for k in range(azimuths))


def _described(slab: Slab, wavelength_nm: float, how: Colouring | None) -> dict[str, Any]:
    light: dict[str, Any] = {
        "index": slab.medium.index_at(wavelength_nm),
        "absorption_per_mm": slab.medium.absorption_at(wavelength_nm),
        "wavelength_nm": wavelength_nm,
    }
    if how is not None:
        light |= {
            "absorption_per_mm": dict(zip(COLOUR_NM.tolist(), how.absorption_per_mm.tolist())),
            "illuminant": f"CIE {how.illuminant}",
            "observer": OBSERVER,
        }
    return {
        "thickness_mm": slab.thickness_mm,
        **light,
        "polarised": slab.polarised,
        "films": {
            name: None if face.film is None else [face.film.thickness_nm, list(map(str, face.film.index))]
            for name, face in (("front", slab.front), ("back", slab.back))
        },
        "bubbles": 0 if slab.all_bubbles is None else len(slab.all_bubbles),
        "front": slab.front.name,
        "front_tiling": "flat" if slab.front.is_flat else slab.front.tiling,
        "back": slab.back.name,
        "back_tiling": "flat" if slab.back.is_flat else slab.back.tiling,
        "slopes": {face: asdict(report) for face, report in slab.tilings.items()},
    }


def _tables(
    nodes: Sequence[tuple[float, float | None]], outcomes: Sequence[Outcome]
) -> tuple[dict[str, SideTable], dict[str, Array]]:
    """All sides of a model, and the noise of each; outcomes of the front come first, then those of the
    back."""
    tables: dict[str, SideTable] = {}
    noise: dict[str, Array] = {}
    for k, face in enumerate(_FACES):
        here = outcomes[k * len(nodes) : (k + 1) * len(nodes)]
        for name, found in (
            (f"transmission_{face}", [o.transmitted for o in here]),
            (f"reflection_{face}", [o.reflected for o in here]),
        ):
            tables[name] = _table(nodes, found)
            noise[name] = np.array([d.noise for d in found])
    return tables, noise


def _table(nodes: Sequence[tuple[float, float | None]], found: Sequence[Distribution]) -> SideTable:
    azimuths = [p for _, p in nodes if p is not None]
    return SideTable(
        theta_i_deg=np.array([t for t, _ in nodes]),
        base=np.stack([d.base for d in found]),
        patch=np.stack([d.patch for d in found]),
        half_width=HALF_WIDTH,
        tau=np.array([d.share for d in found]),
        tau_se=np.array([d.share_se for d in found]),
        origin="traced",
        base_se=np.stack([d.base_se for d in found]),
        patch_se=np.stack([d.patch_se for d in found]),
        blend="linear",
        phi_i_deg=np.array(azimuths) if azimuths else None,
        symmetry="none" if azimuths else "isotropic",
    )


def _balance(
    theta: Array, nodes: Sequence[tuple[float, float | None]], outcomes: Sequence[Outcome]
) -> EnergyBalance:
    """Means over the azimuths of each incident angle; counts and times are sums."""
    ring = np.searchsorted(theta, [t for t, _ in nodes])
    size = np.bincount(ring)

    def mean(values: Sequence[float]) -> Array:
        return np.bincount(ring, values) / size

    def total(values: Sequence[int]) -> NDArray[np.int64]:
        return np.bincount(ring, values).astype(np.int64)

    return EnergyBalance(
        theta_deg=theta,
        tau=mean([o.transmitted.share for o in outcomes]),
        # Directions share their random streams, so their errors may be the same ones.
        tau_se=mean([o.transmitted.share_se for o in outcomes]),
        rho=mean([o.reflected.share for o in outcomes]),
        rho_se=mean([o.reflected.share_se for o in outcomes]),
        absorbed=mean([o.absorbed for o in outcomes]),
        absorbed_se=mean([o.absorbed_se for o in outcomes]),
        sides=mean([o.sides for o in outcomes]),
        lost=total([o.lost for o in outcomes]),
        paths=total([o.paths for o in outcomes]),
        seconds=np.bincount(ring, [o.seconds for o in outcomes]).astype(float),
    )
