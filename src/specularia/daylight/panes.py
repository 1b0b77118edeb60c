"""Panes as light sources: which map of emitted light belongs to which part of which pane."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from specularia.bsdf import ScatteringModel
from specularia.daylight.emission import EmissionMap, back_reflectance, sun_map
from specularia.daylight.geometry import Box, Pane, Rectangle
from specularia.daylight.outdoors import Outdoors
from specularia.daylight.own_geometry import OwnRoom
from specularia.daylight.shading import Outside
from specularia.daylight.transfer import SkyTransfer

__all__ = ["Glazing", "Light", "Lights", "lights"]

Array = NDArray[np.float64]

_CLEAR_GLASS = 0.15
"""Diffuse-diffuse reflectance of a clear pane, n = 1.5, both faces."""

_SHADED = 0.45
"""Density of the nodes of maps of shaded places, times that of other maps."""


class Glazing:
    """A scattering model in a window; what follows from it alone is kept for the next sky, hour or wall.

    Parameters
    ----------
    model : needs transmission_front and transmission_back.
    source : file it came from, for the provenance.
    """

    @classmethod
    def of(cls, given: ScatteringModel | Glazing | str | Path) -> Glazing:
        """A model, or the one that a file holds."""
        if isinstance(given, Glazing):
            return given
        if isinstance(given, (str, Path)):
            from specularia import bsdf

            return cls(bsdf.read(given), Path(given))
        return cls(given)

    def __init__(self, model: ScatteringModel, source: Path | None = None) -> None:
        self.model = model
        self.source = source
        self._transfer: dict[float, SkyTransfer] = {}
        self._reflectance: float | None = None
        self.assumed_reflectance = _CLEAR_GLASS

    def transfer(self, sampling: float) -> SkyTransfer:
        """Its `SkyTransfer` at this density."""
        if sampling not in self._transfer:
            self._transfer[sampling] = SkyTransfer(self.model, sampling=sampling)
        return self._transfer[sampling]

    def undeflected(self, theta_deg: float) -> float:
        """Share of the sun's light that passes as a beam; see `references`."""
        return 0.0

    @property
    def reflectance(self) -> float:
        """Diffuse-diffuse reflectance of its room side; the assumed one if the model has none."""
        if self._reflectance is None:
            known = back_reflectance(self.model)
            self._reflectance = self.assumed_reflectance if known is None else known
        return self._reflectance


@dataclass(frozen=True)
class Light:
    """Part of a pane that emits evenly: pane and map by their indices, and where on the glazing's face."""

    pane: int
    map: int
    rectangle: Rectangle


@dataclass(frozen=True)
class Lights:
    """All that the panes of a room emit.

    Attributes
    ----------
    maps : emitted light over exit direction.
    lights : which part of which pane emits it.
    reflectance : [panes] of their room sides.
    sun : [panes] share of the sun's light on each pane that nothing outside takes away.
    sunlit, skylit : [panes] lm by the sun and by sky and ground that each pane sheds into the room.
    beam : [panes] lx square to the sun of what passes undeflected, see `beam`.
    sun_direction : [3] towards the sun, or None.
    triangles : [T, 3, 3] of all that stands outside.
    """

    maps: list[EmissionMap]
    lights: list[Light]
    reflectance: Array
    sun: Array
    sunlit: Array
    skylit: Array
    beam: Array
    sun_direction: Array | None
    triangles: Array

    @property
    def flux(self) -> float:
        """All light that enters, lm."""
        return float(self.sunlit.sum() + self.skylit.sum())

    def of(self, pane: int) -> list[Light]:
        """The lights of a pane."""
        return [light for light in self.lights if light.pane == pane]

    def coarsened(self) -> Lights:
        """The same light on every second node of the maps."""
        maps = [m.coarsened() for m in self.maps]
        return replace(self, maps=maps)


def _given(box: Box | OwnRoom, pane: Pane) -> float | None:
    """The reflectance that the job gives a pane."""
    return box.job.window[pane.window].pane_reflectance if box.job.window else None


def lights(box: Box | OwnRoom, glazing: Sequence[Glazing], outdoors: Outdoors, *, sampling: float) -> Lights:
    """What every pane emits under this sun and sky, `glazing` being that of each pane in turn."""
    outside = Outside(box, outdoors)
    dark = outdoors.zenith <= 0.0 and outdoors.ground <= 0.0
    suns: dict[tuple[int, bool, bytes], EmissionMap] = {}
    whole: dict[tuple[int, bool, bytes], int] = {}
    maps: list[EmissionMap] = []
    found: list[Light] = []
    beam = np.zeros(len(box.panes))
    towards = outdoors.sun if outdoors.sun_illuminance > 0.0 else None
    share, sunlit, skylit = np.ones(len(box.panes)), np.zeros(len(box.panes)), np.zeros(len(box.panes))
    for index, (pane, glass) in enumerate(zip(box.panes, glazing)):
        cosine = 0.0 if towards is None else max(float(towards @ pane.axes[2]), 0.0)
        straight = glass.undeflected(float(np.degrees(np.arccos(min(cosine, 1.0))))) if cosine > 0.0 else 0.0
        beam[index] = straight * outdoors.sun_illuminance
        shaded = outside.shade(pane, sampling) if len(outside.triangles) else None
        alone = shaded is None or not shaded.matters
        key = (id(glass), alone, pane.axes.tobytes())
        if key not in suns:
            seen = outdoors if straight == 0.0 else replace(outdoors, sun_illuminance=0.0)
            # Places of a shaded pane have a map each; they can do with fewer nodes.
            nodes = sampling if alone else _SHADED * sampling
            suns[key] = sun_map(glass.model, axes=pane.axes, outdoors=seen, sampling=nodes)
        sun, first = suns[key], len(maps)
        if shaded is None or alone:
            if key not in whole:
                if dark:
                    maps.append(sun)
                else:
                    transfer = glass.transfer(sampling)
                    maps.append(sun.plus(transfer.tables(axes=pane.axes, outdoors=outdoors)[0], transfer))
                whole[key] = first
            found.append(Light(index, whole[key], pane.glass))
        else:
            area = np.array([place.area for place in shaded.places])
            share[index] = float(area @ shaded.sun / area.sum())
            found += [Light(index, first + k, place) for k, place in enumerate(shaded.places)]
            if dark and not shaded.instead.any():
                maps += [replace(sun, luminance=s * sun.luminance) for s in shaded.sun]
            else:
                transfer = glass.transfer(sampling)
                tables = transfer.tables(
                    axes=pane.axes, outdoors=outdoors, hidden=shaded.hidden, instead=shaded.instead
                )
                maps += [sun.plus(table, transfer, float(s)) for s, table in zip(shaded.sun, tables)]
        mine = [light for light in found if light.pane == index]
        all_of_it = sum(maps[light.map].exitance() * light.rectangle.area for light in mine)
        sunlit[index] = share[index] * sun.exitance() * pane.glass.area
        skylit[index] = all_of_it - sunlit[index]
        sunlit[index] += share[index] * beam[index] * cosine * pane.glass.area
    reflectance = np.array(
        [
            glass.reflectance if (given := _given(box, pane)) is None else given
            for pane, glass in zip(box.panes, glazing)
        ]
    )
    return Lights(
        maps=maps,
        lights=found,
        reflectance=reflectance,
        sun=share,
        sunlit=sunlit,
        skylit=skylit,
        beam=beam,
        sun_direction=towards,
        triangles=outside.triangles,
    )
