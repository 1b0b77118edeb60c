"""Records that the lit room comes back as."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from specularia.daylight.views import View

__all__ = ["DaylightResult", "Glare", "GridResult", "Image", "PaneLuminance", "Point"]


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
    daylight_factor_percent : 100 times the illuminance over that of the overcast sky on the ground outside;
        None under any other sky (see `DaylightResult.no_daylight_factor`).
    chromaticity_xy : CIE 1931 x and y, for sun and sky of equal-energy white; None in rooms of one band.
    colour_temperature_k : correlated colour temperature, None where there is none.
    """

    name: str
    model: str
    illuminance_lx: float
    se: float
    direct_lx: float
    indirect_lx: float
    interval_lx: tuple[float, float] | None = None
    daylight_factor_percent: float | None = None
    chromaticity_xy: tuple[float, float] | None = None
    colour_temperature_k: float | None = None


@dataclass(frozen=True)
class GridResult:
    """Illuminance at the points of a grid.

    Attributes
    ----------
    name, model : of the grid and of the scattering model.
    along_m, across_m : [columns], [rows] places of the points along the two edges, from the grid's corner
        (from south and west for a horizontal plane).
    points_m : [rows, columns, 3] in the room.
    normal : [3] of the lit side.
    illuminance_lx, se, direct_lx, indirect_lx : [rows, columns], as in `Point`.
    daylight_factor_percent : [rows, columns], or None as in `Point`.
    chromaticity_xy : [rows, columns, 2], or None as in `Point`.
    """

    name: str
    model: str
    along_m: NDArray[np.float64]
    across_m: NDArray[np.float64]
    points_m: NDArray[np.float64]
    normal: NDArray[np.float64]
    illuminance_lx: NDArray[np.float64]
    se: NDArray[np.float64]
    direct_lx: NDArray[np.float64]
    indirect_lx: NDArray[np.float64]
    daylight_factor_percent: NDArray[np.float64] | None
    chromaticity_xy: NDArray[np.float64] | None = None

    @property
    def mean_lx(self) -> float:
        """Mean over the points; the cells are equal."""
        return float(self.illuminance_lx.mean())

    @property
    def min_lx(self) -> float:
        """Least of the points."""
        return float(self.illuminance_lx.min())

    @property
    def uniformity(self) -> float | None:
        """Least over mean (EN 12464-1); None where it is dark."""
        return self.min_lx / self.mean_lx if self.mean_lx > 0.0 else None


@dataclass(frozen=True)
class Glare:
    """Discomfort glare by daylight at the eye of a fisheye view.

    Attributes
    ----------
    view, model : names.
    dgp : daylight glare probability by evalglare, 0 to 1.
    vertical_illuminance_lx : at the eye, from the picture, by evalglare.
    sensor_illuminance_lx : at the same place as at any sensor, not from the picture.
    sources : glare sources that evalglare found.
    source_luminance_cd_m2 : their mean, weighted by solid angle; None without sources.
    source_sr : their solid angles together.
    """

    view: str
    model: str
    dgp: float
    vertical_illuminance_lx: float
    sensor_illuminance_lx: float
    sources: int
    source_luminance_cd_m2: float | None
    source_sr: float


@dataclass(frozen=True)
class Image:
    """A luminance picture.

    Attributes
    ----------
    model, name : of the scattering model and of the view.
    hdr : Radiance picture in its own primaries; luminance is 179 (0.265 R + 0.670 G + 0.065 B).
    npz : the same as arrays: `luminance` [rows, columns] in cd/m2, row 0 at the top, and in colour `xyz`.
    luminance : that array; 0 outside the circle of a fisheye.
    view : what it was taken with.
    pixels : of every sensor that is in view: columns, rows counted from the upper left corner of the picture,
        pixel centres at halves; for labels.
    xyz : [rows, columns, 3] tristimulus values, Y in cd/m2; None in rooms of one band.
    """

    model: str
    name: str
    hdr: Path
    npz: Path
    luminance: NDArray[np.float64]
    view: View
    pixels: dict[str, tuple[float, float]]
    xyz: NDArray[np.float64] | None = None


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
    chromaticity_xy : of that luminance, as in `Point`.
    """

    window: str
    model: str
    view: str
    luminance_cd_m2: float
    exitance_lm_m2: float
    sun_lx: float
    sky_lx: float
    sun_share: float = 1.0
    chromaticity_xy: tuple[float, float] | None = None


@dataclass(frozen=True)
class DaylightResult:
    """Everything that one run of a room gives.

    Attributes
    ----------
    points : sensors, for each model in turn.
    images : views, for each model in turn.
    panes : windows and views, for each model in turn.
    grids : grids, for each model in turn.
    glare : fisheye views, for each model in turn.
    no_daylight_factor : why points and grids have no daylight factor; empty where they have one.
    provenance : inputs, parameters, seed and versions.
    intervals : by model, what the intervals of its points rest on, or why there are none.
    colour : by model, whether the room is lit in colour, and from what.
    """

    points: list[Point]
    images: list[Image]
    panes: list[PaneLuminance]
    grids: list[GridResult]
    glare: list[Glare]
    no_daylight_factor: str
    provenance: dict[str, str]
    intervals: dict[str, str] = field(default_factory=dict)
    colour: dict[str, str] = field(default_factory=dict)
