"""FRAGMENT.toml: a piece of glass over a printed sheet, under a bright ceiling and a lamp, seen from above.

Lengths on the table in millimetres: x to the right, y up the page, z towards the eye. Complete::

    name = "a fragment over print"
    gap_mm = [0, 5, 20]            # between sheet and underside

    [sample]
    thickness_mm = 3.0
    front = "up"                   # which face is on top: up | down

    [sheet]
    pattern = "text"               # text | bars | image
    x_height_mm = 2.0
    paper = 0.80                   # reflectances
    ink = 0.05

    [light]
    diffuse_lx = 500               # even hemisphere above, on the horizontal
    lamp_lx = 1500                 # square to the lamp
    lamp_elevation_deg = 45
    lamp_azimuth_deg = 135         # counter-clockwise from x

    [[model]]                      # or --model M=model_m.nc on the command line
    name = "M"
    file = "model_m.nc"
"""

from __future__ import annotations

from itertools import pairwise
from typing import Annotated, Literal

import numpy as np
from pydantic import Field, field_validator, model_validator

from specularia.daylight._fields import Name, Share
from specularia.daylight.job import ModelFile
from specularia.jobs import FilePath, Job

__all__ = ["Eye", "FragmentJob", "Light", "Picture", "Sample", "Sheet"]

Millimetres = Annotated[float, Field(gt=0.0, le=1e4)]
Gap = Annotated[float, Field(ge=0.0, le=500.0)]
Point2 = tuple[float, float]


class Sample(Job):
    """[sample]: the piece of glass, flat and level."""

    outline_mm: Annotated[tuple[Point2, ...], Field(min_length=3)] | None = None
    """Corners of its outline, seen from above. Left out (with no mask): an invented one, 70 x 50 mm."""
    mask: FilePath | None = None
    """A picture instead of the corners: glass where it is brighter than half, seen from above."""
    mask_width_mm: Millimetres | None = None
    """Width of the mask."""
    thickness_mm: Annotated[float, Field(ge=0.0, le=100.0)] = 3.0
    index: Annotated[float, Field(ge=1.0, le=4.0)] = 1.52
    """Of refraction, for the way of light within the glass."""
    scatters_at: Annotated[float, Field(ge=0.0, le=1.0)] = 0.5
    """At which height of the glass its scattering is taken to happen: 0 the lower face, 1 the upper one. A
    model does not say; where both faces scatter alike the middle is right on average."""
    front: Literal["up", "down"] = "up"
    """Where the model's front lies. With the front down the piece is turned over about its y axis."""
    turn_deg: float = 0.0
    """Turn of the model's x axis against the table's, counter-clockwise from above."""
    reflectance: Share | None = None
    """Of the underside for light from the sheet, even. Left out: the model's own diffuse-diffuse reflectance,
    or 0.15 (clear glass, about) if it has none."""

    @model_validator(mode="after")
    def _outline_or_mask(self) -> Sample:
        if self.mask is not None and self.outline_mm is not None:
            raise ValueError("outline_mm or mask, not both")
        if (self.mask is None) != (self.mask_width_mm is None):
            raise ValueError("mask and mask_width_mm together")
        if self.outline_mm is not None:
            x, y = np.array(self.outline_mm).T
            if abs(float(x @ np.roll(y, -1) - y @ np.roll(x, -1))) < 1e-6:
                raise ValueError("an outline_mm that encloses an area")
        return self


class Sheet(Job):
    """[sheet]: even scattering, with something printed on it."""

    pattern: Literal["text", "bars", "image"] = "text"
    text: Annotated[str, Field(min_length=1)] | None = None
    """What is printed, repeated over the sheet. Left out: a line of capitals and small letters."""
    x_height_mm: Millimetres = 2.0
    """Height of a small x."""
    stroke_mm: Millimetres = 0.5
    """Width of a bar and of the space beside it; contrast over gap is worked out for such bars with any
    pattern."""
    image: FilePath | None = None
    """Picture for the pattern image, in sRGB; white is paper, black is ink."""
    image_width_mm: Millimetres | None = None
    paper: Share = 0.80
    ink: Share = 0.05
    """Reflectances."""

    @model_validator(mode="after")
    def _has_its_pattern(self) -> Sheet:
        if (self.pattern == "image") != (self.image is not None):
            raise ValueError('an image for pattern = "image", and only there')
        if (self.image is None) != (self.image_width_mm is None):
            raise ValueError("image and image_width_mm together")
        if self.text is not None and self.pattern != "text":
            raise ValueError('text only where pattern = "text"')
        if self.ink >= self.paper:
            raise ValueError("an ink darker than the paper")
        return self


class Light(Job):
    """[light]: what shines from above."""

    diffuse_lx: Annotated[float, Field(ge=0.0)] = 500.0
    """Horizontal illuminance of a hemisphere of even luminance."""
    lamp_lx: Annotated[float, Field(ge=0.0)] = 0.0
    """Illuminance by a small distant lamp on a plane square to it."""
    lamp_elevation_deg: Annotated[float, Field(gt=5.0, le=90.0)] = 45.0
    lamp_azimuth_deg: Annotated[float, Field(ge=-360.0, le=360.0)] = 135.0
    """Where it stands, counter-clockwise from x."""

    @model_validator(mode="after")
    def _is_lit(self) -> Light:
        if self.diffuse_lx + self.lamp_lx <= 0.0:
            raise ValueError("some light: diffuse_lx or lamp_lx above 0")
        return self


class Eye(Job):
    """[eye]: far away, so that all lines of sight are parallel."""

    theta_deg: Annotated[float, Field(ge=0.0, le=75.0)] = 0.0
    """From the vertical."""
    phi_deg: Annotated[float, Field(ge=-360.0, le=360.0)] = 0.0
    """Counter-clockwise from x."""


class Picture(Job):
    """[picture]: what is shown."""

    pixel_mm: Annotated[float, Field(gt=0.01, le=5.0)] = 0.15
    border_mm: Millimetres = 10.0
    """Of the sheet around the sample."""


class FragmentJob(Job):
    """The whole FRAGMENT.toml."""

    name: Name = "fragment"
    sample: Sample = Sample()
    sheet: Sheet = Sheet()
    light: Light = Light()
    eye: Eye = Eye()
    picture: Picture = Picture()
    gap_mm: Annotated[tuple[Gap, ...], Field(min_length=1, max_length=12)] = (0.0, 5.0, 20.0)
    """Between sheet and underside, one picture each."""
    contrast_gap_mm: Annotated[tuple[Gap, ...], Field(min_length=2)] | None = None
    """For the curve of contrast; left out: 0 and 40 gaps from 0.1 to 50 mm."""
    model: tuple[ModelFile, ...] = ()

    @field_validator("gap_mm", "contrast_gap_mm")
    @classmethod
    def _rise(cls, value: tuple[float, ...] | None) -> tuple[float, ...] | None:
        if value is not None and any(b <= a for a, b in pairwise(value)):
            raise ValueError("gaps that rise")
        return value

    @model_validator(mode="after")
    def _names_differ(self) -> FragmentJob:
        names = [m.name for m in self.model]
        if len(set(names)) < len(names):
            raise ValueError("model names that differ")
        return self
