"""STUDY.toml: which files a study has and what is made of them.

Every table is optional but one of `[gonio]`, `[surface]`, `[glass]` and `[finds]` must be there; what is not
given is not done. Paths count from the file's own folder; `*`, `?` and `[...]` in the paths of measured data
stand for several files. A complete example::

    [twin]                             # leave out for real specimens
    settings = "twin.toml"             # of the synthetic specimen to make first
    folder = "specimen"                # paths below that begin with this name lie in what it makes

    [gonio]                            # measured tables -> Model M
    tables = ["gonio/*.dat"]

    [surface]                          # focus stacks or height maps -> the faces of Model C
    front = "front_stack.tif"
    back = "back_stack.tif"

    [glass]                            # the slab -> Model C
    settings = "glass.toml"            # faces given in [surface] take the place of its own

    [trace]
    wavelength_nm = 520.0
    paths = 200000
    seed = 1

    [healing]                          # the pane as it may have been -> Model H
    ensemble = 8                       # possible original surfaces of each face

    [xml]                              # Radiance files of the models
    resolution = 6

    [fragment]                         # the specimen over a printed sheet
    settings = "fragment.toml"

    [room]
    settings = "room.toml"

    [explain]                          # why Model C and the measurement differ
    settings = "pane.toml"             # the slab with all that is known of it
    unsure = { absorption = 0.1, bubbles = 0.3 }

    [infer]                            # what the glass is like, from maps and tables
    seek = ["absorption_per_mm", "micro_slope_front", "micro_slope_back"]

    [finds]
    table = "finds.csv"
    plan = "plan.geojson"

    [report]
    title = "A pane from house 1"
    dsf_theta_deg = [20, 30, 40]
"""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

from pydantic import Field, model_validator

from specularia.jobs import FilePath, Job, load_toml

__all__ = [
    "ExplainOptions",
    "FindsFiles",
    "FragmentFile",
    "GlassFile",
    "GonioFiles",
    "HealingOptions",
    "InferOptions",
    "ReportOptions",
    "RoomFile",
    "StudyJob",
    "SurfaceFiles",
    "TraceOptions",
    "TwinFile",
    "XmlOptions",
    "read_job",
]

Pattern = Annotated[str, Field(min_length=1)]
"""A path or a pattern of paths, counted from the study's folder or within what the twin makes."""

Polar = Annotated[float, Field(ge=0.0, lt=90.0)]


RelativeError = Annotated[float, Field(ge=0.0, lt=10.0)]

StepName = Literal[
    "endless",
    "polarisation",
    "absorption",
    "bubbles",
    "height noise",
    "micro-relief",
    "diffraction",
    "tree",
    "instrument",
]
"""Steps of the error budget (`analysis.STEPS`)."""

ParameterName = Literal[
    "absorption_per_mm",
    "bubbles_per_cm3",
    "bubble_diameter_mm",
    "bubble_elongation",
    "micro_slope_front",
    "micro_slope_back",
    "thickness_mm",
]
"""What can be inferred (`analysis.PARAMETERS`, and the thickness along with absorption or bubbles)."""


class TwinFile(Job):
    """[twin]: a synthetic specimen is made first."""

    settings: FilePath
    """TWIN.toml of `specularia twin`."""
    folder: Annotated[str, Field(pattern=r"^[A-Za-z0-9_][A-Za-z0-9_.-]*$")] = "specimen"
    """Paths that begin with this name lie in what the twin makes; the output folder leads there under it."""
    seed: Annotated[int, Field(ge=0)] = 1
    """Of the specimen, its measurement noise and its traced light."""


class GonioFiles(Job):
    """[gonio]: tables of a gonio-photometer."""

    tables: Annotated[list[Pattern], Field(min_length=1)]
    """Files or patterns, all of one specimen."""
    quantity: Literal["DSF", "BSDF"] | None = None
    """What the values are, for files that do not say, or against what they say."""
    side: Literal["transmission", "reflection"] | None = None
    """Which side was measured, against the rule that theta_s < 90 is the side that the light came from."""
    wavelength_nm: Annotated[float, Field(ge=200.0, le=20000.0)] | None = None
    """Of the light used, for files that do not say; else their band is Visible."""


class SurfaceFiles(Job):
    """[surface]: what the microscope saw of the two faces, each a focus stack or a height map."""

    front: Pattern | None = None
    """The face that the light of the gonio-photometer arrives on."""
    back: Pattern | None = None
    """The other face, as its microscope saw it."""
    front_image: Pattern | None = None
    """All-in-focus picture of the front, for the report; what the stack gives if left out."""
    back_image: Pattern | None = None
    """The same of the back."""
    pitch_um: Annotated[float, Field(gt=0.0)] | None = None
    """Pixel size of files that do not hold one."""
    step_um: Annotated[float, Field(gt=0.0)] | None = None
    """Step between the slices of stacks that do not hold one."""
    first_row: Literal["bottom", "top"] | None = None
    """Whether row 0 of the slices is their lowest y, for stacks that do not say."""
    unit: str | None = None
    """Unit of the heights of maps that do not name one: m, mm, um or nm."""
    tiling: Literal["periodic", "mirror", "blend"] = "mirror"
    """How the faces go on beyond their fields in the slab; see GLASS.toml. Measured maps do not repeat by
    themselves: mirror fits always, blend keeps the period short."""
    denoise: bool | Annotated[float, Field(gt=0.0)] = False
    """Whether Model C, [explain] and [infer] take the noise of the microscope off the heights first: true by
    the uncertainty that a stack gives or a map holds, or so many um of it. The error budget begins with the
    heights as they were measured, and has their noise as a step."""

    @model_validator(mode="after")
    def _one_at_least(self) -> SurfaceFiles:
        if self.front is None and self.back is None:
            raise ValueError("front or back, or both")
        return self


class GlassFile(Job):
    """[glass]: the slab."""

    settings: FilePath
    """GLASS.toml of `specularia glass`; a face given in [surface] takes the place of the heights it names."""


class TraceOptions(Job):
    """[trace]: how Model C is traced, and the light of all comparisons."""

    wavelength_nm: Annotated[float, Field(ge=300.0, le=2500.0)] = 520.0
    """Where the medium is a spectrum, this wavelength is traced."""
    paths: Annotated[int, Field(ge=1000)] = 200_000
    """Per incident direction and side."""
    seed: Annotated[int, Field(ge=0)] = 1
    """Of the traced paths."""


class HealingOptions(Job):
    """[healing]: the faces without their decay, and Model H traced through them."""

    ensemble: Annotated[int, Field(ge=3, le=200)] = 8
    """Possible original surfaces of each face; the interval comes from them."""
    theta_deg: Annotated[tuple[Polar, ...], Field(min_length=1)] = (0.0, 20.0, 40.0, 60.0)
    """Angles of incidence of the interval."""
    paths: Annotated[int, Field(ge=1000)] = 50_000
    """Traced per member and angle of the interval."""
    model_paths: Annotated[int, Field(ge=1000)] | None = None
    """Per incident direction and side of Model H; those of [trace] if left out."""


class XmlOptions(Job):
    """[xml]: the Radiance files of the models."""

    resolution: Annotated[int, Field(ge=5, le=8)] = 6
    """Directions are split into 4^resolution cells before those that differ little are merged."""
    cull: Annotated[float, Field(ge=0.0, lt=100.0)] | None = None
    """Percentage of the cells to merge away; as many as move 1 % of the light if left out."""


class FragmentFile(Job):
    """[fragment]: the specimen over a printed sheet, seen through each model."""

    settings: FilePath | None = None
    """FRAGMENT.toml of `specularia daylight fragment`. Left out: its defaults, with an invented outline."""


class ExplainOptions(Job):
    """[explain]: the error budget from Model C as published to the measured tables."""

    settings: Pattern | None = None
    """GLASS.toml with all that is known of the pane (absorption, bubbles, fine relief); faces given in
    [surface] take the place of its own. That of [glass] if left out."""
    order: Annotated[tuple[StepName, ...], Field(min_length=1)] | None = None
    """Steps in their order; those not named are left out. All of them if left out, but for "diffraction"
    where the tables are synthetic."""
    patch_mm: Annotated[float, Field(gt=0.0, le=1000.0)] = 8.4
    """Width of the finite patch that the budget begins with."""
    resolution: Annotated[int, Field(ge=5, le=8)] = 6
    """Of the tensor tree that it begins with."""
    aperture_deg: Annotated[float, Field(ge=0.3, le=10.0)] = 0.3
    """Full width at half maximum of the instrument's angular response."""
    unsure: dict[Literal["absorption", "bubbles", "micro-relief"], RelativeError] = Field({})
    """Relative standard errors of what these steps bring in, as { absorption = 0.1 }."""
    paths: Annotated[int, Field(ge=1000)] = 1_000_000
    """For each state and angle."""


class InferOptions(Job):
    """[infer]: absorption, bubbles and finest relief, from the maps and the measured tables."""

    settings: Pattern | None = None
    """GLASS.toml to begin with: index and thickness; faces given in [surface] take the place of its own. That
    of [glass] if left out."""
    seek: Annotated[tuple[ParameterName, ...], Field(min_length=1)] | None = None
    """What to infer; everything but the thickness if left out."""
    priors: dict[ParameterName, tuple[float, float]] = Field({})
    """Lognormal priors in place of the built-in ones: median, and standard deviation of the natural
    logarithm, as { absorption_per_mm = [0.05, 0.7] }."""
    scale_error: Annotated[float, Field(ge=0.0, lt=1.0)] = 0.005
    """Relative standard error of the scale that all tables share."""
    aperture_deg: Annotated[float, Field(ge=0.3, le=10.0)] = 0.3
    """Full width at half maximum of the instrument's angular response."""
    hold_out: bool = True
    """Whether each angle but the first and the last is also predicted from the others."""
    paths: Annotated[int, Field(ge=1000)] = 160_000
    """For each trace and angle; a first design takes a quarter."""


class RoomFile(Job):
    """[room]: the room that each model is put into."""

    settings: FilePath
    """ROOM.toml of `specularia daylight`."""


class FindsFiles(Job):
    """[finds]: the catalogue of finds."""

    table: Pattern
    """CSV, XLSX or ODS of `specularia finds`."""
    plan: Pattern | None = None
    """GeoJSON with the rooms and squares that the table names."""
    mapping: Pattern | None = None
    """Mapping file, for tables with other names, words or units."""


class ReportOptions(Job):
    """[report]: the page at the end."""

    title: Annotated[str, Field(min_length=1)] = "Study"
    note: str = ""
    """Running text under the title; blank lines part paragraphs."""
    dsf_theta_deg: Annotated[tuple[Polar, ...], Field(min_length=1, max_length=6)] = (20.0, 30.0, 40.0)
    """Angles of incidence of the figure that sets the models side by side."""
    view: bool = True
    """Whether the page holds an interactive view of the models; false makes it smaller by some megabytes."""


class StudyJob(Job):
    """The whole STUDY.toml."""

    twin: TwinFile | None = None
    gonio: GonioFiles | None = None
    surface: SurfaceFiles | None = None
    glass: GlassFile | None = None
    trace: TraceOptions = TraceOptions()
    healing: HealingOptions | None = None
    xml: XmlOptions = XmlOptions()
    fragment: FragmentFile | None = None
    room: RoomFile | None = None
    explain: ExplainOptions | None = None
    infer: InferOptions | None = None
    finds: FindsFiles | None = None
    report: ReportOptions = ReportOptions()

    @model_validator(mode="after")
    def _something_to_do(self) -> StudyJob:
        if not (self.gonio or self.surface or self.glass or self.finds):
            raise ValueError("something to do: one of the tables [gonio], [surface], [glass], [finds]")
        if self.healing and not (self.surface and self.glass):
            raise ValueError("[surface] and [glass] for [healing]: faces to heal and the glass between them")
        if self.room and not (self.gonio or self.glass):
            raise ValueError("a model to put into the room: [gonio] for Model M or [glass] for Model C")
        if self.fragment and not (self.gonio or self.glass):
            raise ValueError("a model for [fragment]: [gonio] for Model M or [glass] for Model C")
        for name in ("explain", "infer"):
            if getattr(self, name) and not (self.gonio and self.glass):
                raise ValueError(f"[gonio] and [glass] for [{name}]: tables and the pane they are of")
        return self


def read_job(path: str | Path) -> StudyJob:
    """Read STUDY.toml; a FormatError names file, line, what was expected and what was found."""
    return load_toml(path, StudyJob)
