"""Records that the lit room comes back as."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from specularia.daylight.job import View

__all__ = ["DaylightResult", "Image", "PaneLuminance", "Point"]


@dataclass(frozen=True)
class Point:
    """Illuminance at a named sensor.

    Attributes
    ----------
    name, model : of the sensor and of the scattering model.
    illuminance_lx : direct and interreflected.
    se : its numerical standard error in lx (cutting of the panes, mesh of the walls); the uncertainty of the
        model, of the sky and of the room is not in it.
    direct_lx, indirect_lx : the two shares.
    interval_lx : where the illuminance lies with a probability of 95 % by the model's own uncertainty and
        `se`, see `uncertainty`; None where the model states none (`DaylightResult.intervals` says so).
    """

    name: str
    model: str
    illuminance_lx: float
    se: float
    direct_lx: float
    indirect_lx: float
    interval_lx: tuple[float, float] | None = None


@dataclass(frozen=True)
class Image:
    """A luminance picture.

    Attributes
    ----------
    model, name : of the scattering model and of the view.
    hdr : Radiance picture; luminance is 179 times its green channel.
    npz : the same as arrays: `luminance` [rows, columns] in cd/m2, row 0 at the top.
    luminance : that array.
    view : what it was taken with.
    pixels : of every sensor that is in view: columns, rows counted from the upper left corner of the picture,
        pixel centres at halves; for labels.
    """

    model: str
    name: str
    hdr: Path
    npz: Path
    luminance: NDArray[np.float64]
    view: View
    pixels: dict[str, tuple[float, float]]


@dataclass(frozen=True)
class PaneLuminance:
    """How bright a pane is and what it passes on.

    Attributes
    ----------
    window, model : names; a window of several panes has row and column added, as seen from inside.
    view : name of the view, or "normal" for the direction straight into the room.
    luminance_cd_m2 : from the pane's centre towards the eye (the emission map; without reflected room light).
    exitance_lm_m2 : light emitted into the room per area of pane.
    sun_lx, sky_lx : illuminance on an unshaded plane in the pane's place by the sun, and by sky and ground.
    sun_share : share of the sun's light that nothing outside keeps from the pane.
    """

    window: str
    model: str
    view: str
    luminance_cd_m2: float
    exitance_lm_m2: float
    sun_lx: float
    sky_lx: float
    sun_share: float = 1.0


@dataclass(frozen=True)
class DaylightResult:
    """Everything that one run of a room gives.

    Attributes
    ----------
    points : sensors, for each model in turn.
    images : views, for each model in turn.
    panes : windows and views, for each model in turn.
    provenance : inputs, parameters, seed and versions.
    intervals : by model, what the intervals of its points rest on, or why there are none.
    """

    points: list[Point]
    images: list[Image]
    panes: list[PaneLuminance]
    provenance: dict[str, str]
    intervals: dict[str, str] = field(default_factory=dict)
