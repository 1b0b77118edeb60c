"""Panes as light sources: which map of emitted light belongs to which part of which pane."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from specularia.bsdf import ScatteringModel, TabulatedModel, XmlModel
from specularia.daylight.colour import Coloured, UvBand, to_rgb
from specularia.daylight.emission import EmissionMap, back_reflectance, sun_map
from specularia.daylight.geometry import Box, Pane, Rectangle
from specularia.daylight.job import ModelFile
from specularia.daylight.outdoors import Outdoors
from specularia.daylight.own_geometry import OwnRoom
from specularia.daylight.shading import Outside, Shaded
from specularia.daylight.transfer import SkyTransfer
from specularia.errors import CoverageError

__all__ = ["Glazing", "Light", "Lights", "lights", "named_glazing"]

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
    chroma : models of CIE-X and CIE-Z, where it is known in colour; `model` is then that of Y.
    """

    @classmethod
    def of(
        cls,
        given: ScatteringModel | Coloured | Glazing | str | Path,
        *,
        cie_x: Path | None = None,
        cie_z: Path | None = None,
    ) -> Glazing:
        """A model, or the one that a file holds; in colour where it has the bands CIE-X and CIE-Z.

        `cie_x` and `cie_z` are the files of these bands, where each band has a file of its own.
        """
        from specularia import bsdf

        if isinstance(given, Glazing):
            return given
        if isinstance(given, Coloured):
            return cls(given.y, chroma=(given.x, given.z))
        source = Path(given) if isinstance(given, (str, Path)) else None
        model = bsdf.read(given) if isinstance(given, (str, Path)) else given
        if cie_x is not None and cie_z is not None:
            chroma = bsdf.read(cie_x, band="CIE-X"), bsdf.read(cie_z, band="CIE-Z")
            return cls(model, source, chroma=chroma)
        return cls(model, source, chroma=_other_bands(model))

    def __init__(
        self,
        model: ScatteringModel,
        source: Path | None = None,
        *,
        chroma: tuple[ScatteringModel, ScatteringModel] | None = None,
    ) -> None:
        self.model = model
        self.source = source
        self.chroma = chroma
        self._channels: tuple[Glazing, Glazing] | None = None
        self._transfer: dict[float, SkyTransfer] = {}
        self._reflectance: float | None = None
        self.assumed_reflectance = _CLEAR_GLASS

    def transfer(self, sampling: float) -> SkyTransfer:
        """Its `SkyTransfer` at this density."""
        if sampling not in self._transfer:
            self._transfer[sampling] = SkyTransfer(self.model, sampling=sampling)
        return self._transfer[sampling]

    @property
    def bands(self) -> str:
        """Names of the bands it is known in."""
        return ", ".join(m.band for m in (self.model, *(self.chroma or ())))

    @property
    def channels(self) -> tuple[Glazing, Glazing, Glazing]:
        """Those of X, Y and Z; of a model of one band, which counts as neutral, itself three times."""
        if self.chroma is None:
            return self, self, self
        if self._channels is None:
            x, z = (Glazing(m) for m in self.chroma)
            # Bands without reflection reflect what Y does: grey.
            x.assumed_reflectance = z.assumed_reflectance = self.reflectance
            self._channels = x, z
        return self._channels[0], self, self._channels[1]

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


def named_glazing(
    files: Sequence[ModelFile], models: Mapping[str, ScatteringModel | Coloured | Glazing | str | Path]
) -> dict[str, Glazing]:
    """The models under comparison: those of files, then the given ones, which take the place of namesakes."""
    own = {
        m.name: Glazing.of(models[m.name])
        if m.name in models
        else Glazing.of(m.file, cie_x=m.cie_x, cie_z=m.cie_z)
        for m in files
    }
    return own | {name: Glazing.of(m) for name, m in models.items() if name not in own}


def _other_bands(model: ScatteringModel) -> tuple[ScatteringModel, ScatteringModel] | None:
    """The models of CIE-X and CIE-Z in the file of a model of Y, or None where it has no colour."""
    if isinstance(model, TabulatedModel) and {"CIE-X", "CIE-Z"} <= set(model.bands):
        return model.in_band("CIE-X"), model.in_band("CIE-Z")
    if not isinstance(model, XmlModel) or model.band not in ("Visible", "CIE-Y"):
        return None
    for names in (("CIE-X", "CIE-Z"), ("CIE-u", "CIE-v")):
        held = [replace(model, parts=model.all_bands[b], band=b) for b in names if b in model.all_bands]
        if len(held) == 1:
            raise CoverageError(
                f"the model holds {held[0].band} beside {model.band}, but not the third band; colour needs "
                f"{names[0]}, CIE-Y (or Visible) and {names[1]}. Leave out the odd band, or add the missing "
                "one."
            )
        if held and names[0] == "CIE-X":
            return held[0], held[1]
        if held:
            return UvBand(model, *held, band="CIE-X"), UvBand(model, *held, band="CIE-Z")
    return None


@dataclass(frozen=True)
class Light:
    """Part of a pane that emits evenly.

    Pane and map by their indices, where it lies on the glazing's face, and the share of the sun that nothing
    outside keeps from it.
    """

    pane: int
    map: int
    rectangle: Rectangle
    sun: float = 1.0


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
    chroma : the same in X and in Z, for rooms in colour; all else here is Y.
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
    chroma: tuple[Lights, Lights] | None = None

    @property
    def bands(self) -> tuple[Lights, ...]:
        """In X, Y and Z, or in Y alone."""
        return (self,) if self.chroma is None else (self.chroma[0], self, self.chroma[1])

    def channels(self, values: Sequence[Array]) -> Array:
        """[..., C] of one array [...] for each of `bands`: as it is, or as R, G and B."""
        joined = np.stack(values, axis=-1)
        return joined if self.chroma is None else to_rgb(joined)

    @property
    def pane_reflectance(self) -> Array:
        """[panes, C] of their room sides."""
        return self.channels([b.reflectance for b in self.bands])

    @property
    def flux(self) -> float:
        """All light that enters, lm."""
        return float(self.sunlit.sum() + self.skylit.sum())

    def of(self, pane: int) -> list[Light]:
        """The lights of a pane."""
        return [light for light in self.lights if light.pane == pane]

    def blurred(self, box: Box | OwnRoom) -> Lights:
        """With beams as lobes of some degrees in the maps, for light that is reflected further on."""
        if self.sun_direction is None or not np.any(self.beam > 0.0):
            return self
        maps = list(self.maps)
        for light in {light.map: light for light in self.lights if self.beam[light.pane] > 0.0}.values():
            towards = box.panes[light.pane].axes @ self.sun_direction
            lit = light.sun * float(self.beam[light.pane]) * float(towards[2])
            if lit > 0.0:
                maps[light.map] = maps[light.map].with_lobe(towards, lit)
        chroma = self.chroma and (self.chroma[0].blurred(box), self.chroma[1].blurred(box))
        return replace(self, maps=maps, chroma=chroma)

    def coarsened(self) -> Lights:
        """The same light on every second node of the maps."""
        maps = [m.coarsened() for m in self.maps]
        chroma = self.chroma and (self.chroma[0].coarsened(), self.chroma[1].coarsened())
        return replace(self, maps=maps, chroma=chroma)


def _given(box: Box | OwnRoom, pane: Pane) -> float | None:
    """The reflectance that the job gives a pane."""
    if box.job.geometry is not None:
        return box.job.geometry.pane_reflectance
    return box.job.window[pane.window].pane_reflectance


def lights(
    box: Box | OwnRoom,
    glazing: Sequence[Glazing],
    outdoors: Outdoors,
    *,
    sampling: float,
    colour: bool = False,
) -> Lights:
    """What every pane emits under this sun and sky, `glazing` being that of each pane in turn.

    With `colour` in X and Z as well: light is linear, so each band is the same sum with its own model.
    """
    outside = Outside(box, outdoors)
    shade = [outside.shade(p, sampling) if len(outside.triangles) else None for p in box.panes]
    bands = [
        _band(box, [g.channels[k] for g in glazing], outdoors, outside, shade, sampling)
        for k in ((0, 1, 2) if colour else (1,))
    ]
    return replace(bands[1], chroma=(bands[0], bands[2])) if colour else bands[0]


def _band(
    box: Box | OwnRoom,
    glazing: Sequence[Glazing],
    outdoors: Outdoors,
    outside: Outside,
    shade: Sequence[Shaded | None],
    sampling: float,
) -> Lights:
    """`lights` in one band; `shade` says how each pane sees the outdoors."""
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
        shaded = shade[index]
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
            found += [
                Light(index, first + k, place, float(s))
                for k, (place, s) in enumerate(zip(shaded.places, shaded.sun))
            ]
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
