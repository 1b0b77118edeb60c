"""GLASS.toml: a pane described in a file.

```toml
thickness_mm = 3.0            # between the mean planes of the faces

[medium]
index = 1.52                  # or { sellmeier = [B1, B2, B3, C1, C2, C3] }, C in um^2
absorption_per_mm = 0.07      # Napierian; or { spectrum = "file.csv" }: wavelength in nm, 1/mm;
                              # or in its place the key spectrum = "file.csv"

[front]
heights = "front.nc"          # any supported surface file; or flat = true
pitch_um = 1.5                # one number or [x, y]; for files that hold none
tiling = "periodic"           # periodic | mirror | blend

[back]
flat = true

[[bubbles]]                   # optional, several kinds
per_cm3 = 30.0
diameter_mm = { median = 0.2, sigma = 0.4 }    # of the sphere of equal volume; sigma of ln(diameter)
elongation = 3.0              # long axis over short axis
axis = [0, 1, 0]              # or, in place of these keys, list = "bubbles.csv"

[trace]
polarised = true
```
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Annotated, Any, Self, TypeVar

from pydantic import Discriminator, Field, Tag, model_validator

from specularia import surface
from specularia.errors import FormatError, PhysicsError
from specularia.glass.bubbles import BubbleKind, Bubbles, read_bubbles
from specularia.glass.faces import Face, Tiling
from specularia.glass.medium import Medium, Spectrum
from specularia.glass.slab import Slab
from specularia.jobs import FilePath, Job, load_toml

__all__ = ["GlassJob", "read_slab"]

T = TypeVar("T")

Positive = Annotated[float, Field(gt=0.0, allow_inf_nan=False)]


def _shape_of(value: object) -> str:
    return "table" if isinstance(value, (dict, Job)) else "number"


class Sellmeier(Job):
    """{ sellmeier = [...] }."""

    sellmeier: Annotated[list[float], Field(min_length=6, max_length=6)]
    """B1, B2, B3, C1, C2, C3 of n^2 = 1 + sum B w^2 / (w^2 - C), w in um."""


class AbsorptionSpectrum(Job):
    """{ spectrum = "file.csv" }."""

    spectrum: FilePath
    """Rows "wavelength in nm, absorption in 1/mm", ascending; lines with # and one line of names are
    skipped."""


Index = Annotated[
    Annotated[float, Field(gt=1.0, lt=5.0), Tag("number")] | Annotated[Sellmeier, Tag("table")],
    Discriminator(_shape_of),
]
Absorption = Annotated[
    Annotated[float, Field(ge=0.0, allow_inf_nan=False), Tag("number")]
    | Annotated[AbsorptionSpectrum, Tag("table")],
    Discriminator(_shape_of),
]


class MediumJob(Job):
    """[medium]: the glass."""

    index: Index = 1.52
    """Refractive index against air, between 1 and 5, or Sellmeier coefficients."""
    absorption_per_mm: Absorption = 0.0
    """Napierian absorption, transmittance exp(-a * path), or a spectrum of it."""
    spectrum: FilePath | None = None
    """The spectrum of the absorption, in place of absorption_per_mm."""

    @model_validator(mode="after")
    def _one_absorption(self) -> Self:
        if self.spectrum is not None and "absorption_per_mm" in self.model_fields_set:
            raise ValueError("absorption_per_mm or spectrum, not both")
        return self

    @property
    def spectrum_file(self) -> Path | None:
        """The file of the absorption spectrum, however it is named; None for a number."""
        if isinstance(self.absorption_per_mm, AbsorptionSpectrum):
            return self.absorption_per_mm.spectrum
        return self.spectrum


class FaceJob(Job):
    """[front], [back]: a height map, or flat = true."""

    flat: bool = False
    """A plane face without relief."""
    heights: FilePath | None = None
    """Heights out of the glass, as the microscope saw the face: any file that `specularia surface` reads."""
    pitch_um: Positive | tuple[Positive, Positive] | None = None
    """Pixel size, one number or [x, y], for a file that holds none; must agree with one that does."""
    tiling: Tiling = "periodic"
    """How the map goes on: periodic as it is, mirror with its mirror image, blend with joined edges."""

    @model_validator(mode="after")
    def _one_of_two(self) -> Self:
        if self.flat == (self.heights is not None):
            raise ValueError("either heights or flat = true")
        return self


class Diameter(Job):
    """Diameter of the sphere of equal volume."""

    median: Positive
    """Median in mm."""
    sigma: Annotated[float, Field(ge=0.0, le=3.0)] = 0.0
    """Standard deviation of ln(diameter)."""


class BubbleJob(Job):
    """[[bubbles]]: one kind by its statistics, or an explicit list."""

    per_cm3: Positive | None = None
    """Number per cubic centimetre of glass."""
    diameter_mm: Diameter | None = None
    """Of the sphere of equal volume, lognormal."""
    elongation: Annotated[float, Field(ge=1.0, le=100.0)] = 1.0
    """Long axis over short axis."""
    axis: tuple[float, float, float] = (0.0, 1.0, 0.0)
    """Direction of the long axis in the slab's frame (z out of the front, y up)."""
    list: FilePath | None = None
    """A list of bubbles (.csv or .npz) in place of the other keys."""

    @model_validator(mode="after")
    def _one_of_two(self) -> Self:
        drawn = self.per_cm3 is not None and self.diameter_mm is not None
        named = self.per_cm3 is not None or self.diameter_mm is not None
        if (self.list is not None and named) or (self.list is None and not drawn):
            raise ValueError("either per_cm3 and diameter_mm, or list")
        if not any(self.axis):
            raise ValueError("an axis that is not zero")
        return self


class TraceJob(Job):
    """[trace]: how light is traced."""

    polarised: bool = True
    """Keep the polarisation of each path; false averages s and p at every interface."""


class GlassJob(Job):
    """GLASS.toml."""

    thickness_mm: Positive
    """Between the mean planes of the faces."""
    medium: MediumJob = MediumJob()
    """The glass."""
    front: FaceJob
    """The face the light comes from in a measurement."""
    back: FaceJob
    """The other face; its map's x axis runs the other way."""
    bubbles: tuple[BubbleJob, ...] = ()
    """Air bubbles, several kinds."""
    trace: TraceJob = TraceJob()
    """How light is traced."""


def read_slab(path: str | Path, *, seed: int = 0) -> Slab:
    """Read a pane from a GLASS.toml.

    Parameters
    ----------
    path : of the file; paths in it are counted from its folder.
    seed : of the places and sizes of bubbles that are given by their statistics.

    Raises
    ------
    FormatError : an unknown key, a value out of range, a missing or wrong file, or a pane that cannot be.
    """
    path = Path(path)
    job = load_toml(path, GlassJob)
    sources = [path]
    synthetic = False
    faces: dict[str, Face] = {}
    for name, face in (("front", job.front), ("back", job.back)):
        if face.heights is None:
            faces[name] = Face.flat(name)
            continue
        height_map = surface.read(face.heights, pitch_um=face.pitch_um)
        sources.append(face.heights)
        synthetic = synthetic or "synthetic" in height_map.attributes
        faces[name] = _checked(path, Face.from_map, height_map, tiling=face.tiling, name=face.heights.name)
    absorption: float | Spectrum
    spectrum_file = job.medium.spectrum_file
    if spectrum_file is not None:
        sources.append(spectrum_file)
        absorption = Spectrum.read_csv(spectrum_file)
    elif not isinstance(job.medium.absorption_per_mm, AbsorptionSpectrum):
        absorption = job.medium.absorption_per_mm
    index = job.medium.index
    lists = [read_bubbles(b.list) for b in job.bubbles if b.list is not None]
    sources += [b.list for b in job.bubbles if b.list is not None]
    kinds = tuple(
        BubbleKind(
            per_cm3=b.per_cm3,
            median_mm=b.diameter_mm.median,
            sigma=b.diameter_mm.sigma,
            elongation=b.elongation,
            axis=b.axis,
        )
        for b in job.bubbles
        if b.per_cm3 is not None and b.diameter_mm is not None
    )
    slab = _checked(
        path,
        Slab,
        thickness_mm=job.thickness_mm,
        medium=Medium(
            index=tuple(index.sellmeier) if isinstance(index, Sellmeier) else index,
            absorption_per_mm=absorption,
        ),
        front=faces["front"],
        back=faces["back"],
        bubbles=_checked(path, Bubbles.join, lists) if lists else None,
        bubble_kinds=kinds,
        bubble_seed=seed,
        polarised=job.trace.polarised,
        sources=tuple(sources),
        synthetic=synthetic,
    )
    _checked(path, lambda: slab.all_bubbles)
    return slab


def _checked(path: Path, make: Callable[..., T], *arguments: Any, **named: Any) -> T:
    """What `make` returns; where physics forbids it, a FormatError that names the file."""
    try:
        return make(*arguments, **named)
    except PhysicsError as error:
        raise FormatError(file=path, expected="a pane that can be", found=str(error).rstrip(".")) from error
