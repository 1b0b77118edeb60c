"""GLASS.toml: a pane described in a file.

```toml
thickness_mm = 3.0            # between the mean planes of the faces

[medium]
index = 1.52                  # or { sellmeier = [B1, B2, B3, C1, C2, C3] }, C in um^2
absorption_per_mm = 0.07      # Napierian; or { spectrum = "file.csv" }: wavelength in nm, 1/mm;
                              # or in its place the key spectrum = "file.csv"
                              # or glass = "aqua" | "green" | "yellow-brown"
                              # or iron_manganese = { fe2o3_percent = 0.5, ferrous = 0.75,
                              #     mno_percent = 0.4, mn3 = 0.0, amber_per_mm = 0.0 }

[front]
heights = "front.nc"          # any supported surface file; or flat = true
pitch_um = 1.5                # one number or [x, y]; for files that hold none
tiling = "periodic"           # periodic | mirror | blend; without it periodic for a map whose edges meet,
                              # mirror for any other
max_missing = 0.05            # a map of which a larger share is missing is refused
sealant_index = 1.5           # optional: a liquid that fills the relief up to a plane surface
micro_slope = 0.03            # optional: rms slope, along one direction, of relief too fine for the map
denoise = true                # optional: the heights without the noise that their file states, or a number:
                              # without so many um of it

[front.film]                  # optional, on either face: thin layers that follow the surface
thickness_nm = 300.0          # one number, or a list from the air to the glass
index = 1.45                  # as many numbers n, or pairs [n, k]

[back]
flat = true

[[bubbles]]                   # optional, several kinds
per_cm3 = 30.0
diameter_mm = { median = 0.2, sigma = 0.4 }    # of the sphere of equal volume; sigma of ln(diameter)
elongation = 3.0              # long axis over short axis
axis = [0, 1, 0]              # or, in place of these keys, list = "bubbles.csv"
placing = "cell"              # or "free flight": drawn afresh along every path

[[inclusions]]                # optional: the keys of [[bubbles]], and what they are
kind = "absorbing"            # or "opaque"
absorption_per_mm = 2.0       # of what absorbs
index = 1.6                   # without it that of the glass
per_cm3 = 5.0
diameter_mm = { median = 0.3 }

[trace]
polarised = true
incident = "unpolarised"      # or "s", "p", { stokes = [1, Q, U, V] }
colour = false                # true: models hold CIE-X, Visible, CIE-Z under D65; or an illuminant, "E"

[patch]                       # optional: a finite pane in place of one that goes on for ever
width_mm = 8.4
sides = "clear"               # absorbing | clear | reflecting
lit_mm = 1.0                  # light falls on a square in the middle; without it on all of the patch
```
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Annotated, Any, Literal, Self, TypeVar

from pydantic import Discriminator, Field, Tag, model_validator

from specularia import surface
from specularia.errors import FormatError, PhysicsError
from specularia.glass.bubble_files import read_bubbles
from specularia.glass.bubbles import AIR, BubbleKind, Bubbles, Inside
from specularia.glass.colour import viewing
from specularia.glass.faces import MISSING_LIMIT, Face, Tiling
from specularia.glass.medium import Medium, Spectrum
from specularia.glass.patch import Patch, Sides
from specularia.glass.pigments import GLASSES, IronManganese
from specularia.glass.slab import UNPOLARISED, Slab
from specularia.glass.thin_film import Film
from specularia.jobs import FilePath, Job, load_toml

__all__ = ["GlassJob", "read_slab"]

T = TypeVar("T")

GlassName = Literal["aqua", "green", "yellow-brown"]
Positive = Annotated[float, Field(gt=0.0, allow_inf_nan=False)]


def _shape_of(value: object) -> str:
    return "table" if isinstance(value, (dict, Job)) else "plain"


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
    Annotated[float, Field(gt=1.0, lt=5.0), Tag("plain")] | Annotated[Sellmeier, Tag("table")],
    Discriminator(_shape_of),
]
Absorption = Annotated[
    Annotated[float, Field(ge=0.0, allow_inf_nan=False), Tag("plain")]
    | Annotated[AbsorptionSpectrum, Tag("table")],
    Discriminator(_shape_of),
]


class IronManganeseJob(Job):
    """{ fe2o3_percent = ..., ... }: glass by what colours it, see `glass.IronManganese`."""

    fe2o3_percent: Annotated[float, Field(ge=0.0, le=10.0)] = 0.0
    """All iron, as Fe2O3 in percent by weight."""
    ferrous: Annotated[float, Field(ge=0.0, le=1.0)] = 0.5
    """Share of the iron that is Fe2+."""
    mno_percent: Annotated[float, Field(ge=0.0, le=10.0)] = 0.0
    """All manganese, as MnO in percent by weight."""
    mn3: Annotated[float, Field(ge=0.0, le=1.0)] = 0.0
    """Share of the manganese that is Mn3+."""
    amber_per_mm: Annotated[float, Field(ge=0.0, le=1e3)] = 0.0
    """Napierian absorption of the amber band at 410 nm."""


class MediumJob(Job):
    """[medium]: the glass."""

    index: Index = 1.52
    """Refractive index against air, between 1 and 5, or Sellmeier coefficients."""
    absorption_per_mm: Absorption = 0.0
    """Napierian absorption, transmittance exp(-a * path), or a spectrum of it."""
    spectrum: FilePath | None = None
    """The spectrum of the absorption, in place of absorption_per_mm."""
    glass: GlassName | None = None
    """A built-in glass, a model after the colours of finds, in place of absorption_per_mm."""
    iron_manganese: IronManganeseJob | None = None
    """What colours the glass, by a model of iron and manganese, in place of absorption_per_mm."""

    @model_validator(mode="after")
    def _one_absorption(self) -> Self:
        ways = {"absorption_per_mm", "spectrum", "glass", "iron_manganese"} & self.model_fields_set
        if len(ways) > 1:
            raise ValueError(f"{' or '.join(sorted(ways))}, not both")
        return self

    @property
    def pigments(self) -> IronManganese | None:
        """The model of the colour, where the glass is given by it."""
        if self.glass is not None:
            return GLASSES[self.glass]
        if self.iron_manganese is not None:
            return IronManganese(**self.iron_manganese.model_dump())
        return None

    @property
    def spectrum_file(self) -> Path | None:
        """The file of the absorption spectrum, however it is named; None for a number."""
        if isinstance(self.absorption_per_mm, AbsorptionSpectrum):
            return self.absorption_per_mm.spectrum
        return self.spectrum


Refraction = Annotated[float, Field(gt=0.0, lt=10.0)]
Extinction = Annotated[float, Field(ge=0.0, lt=20.0)]


class FilmJob(Job):
    """[front.film], [back.film]: thin layers on a face."""

    thickness_nm: Positive | list[Positive]
    """One layer, or several from the air to the glass."""
    index: Refraction | list[Refraction | tuple[Refraction, Extinction]]
    """Index against air of each layer, a number or a pair [n, k]; the same at all wavelengths."""

    @model_validator(mode="after")
    def _as_many(self) -> Self:
        thickness, index = self.layers
        if not thickness or len(thickness) != len(index):
            raise ValueError("as many thicknesses as indices; of one layer that absorbs, index = [[n, k]]")
        return self

    @property
    def layers(self) -> tuple[list[float], list[complex]]:
        """Thicknesses in nm and complex indices."""
        thickness = self.thickness_nm if isinstance(self.thickness_nm, list) else [self.thickness_nm]
        index = self.index if isinstance(self.index, list) else [self.index]
        return thickness, [complex(*n) if isinstance(n, tuple) else complex(n) for n in index]


class FaceJob(Job):
    """[front], [back]: a height map, or flat = true."""

    flat: bool = False
    """A plane face without relief."""
    heights: FilePath | None = None
    """Heights out of the glass, as the microscope saw the face: any file that `specularia surface` reads."""
    pitch_um: Positive | tuple[Positive, Positive] | None = None
    """Pixel size, one number or [x, y], for a file that holds none; must agree with one that does."""
    tiling: Tiling | None = None
    """How the map goes on: periodic as it is, mirror with its mirror image, blend with joined edges. Without
    it periodic for a map whose edges meet, mirror for any other."""
    max_missing: Annotated[float, Field(ge=0.0, le=1.0)] = MISSING_LIMIT
    """Share of missing pixels above which the map is refused; fewer are filled from their surroundings."""
    sealant_index: Annotated[float, Field(gt=1.0, lt=5.0)] | None = None
    """Index of a liquid that fills the relief up to a plane surface."""
    micro_slope: Annotated[float, Field(ge=0.0, le=0.5)] = 0.0
    """Rms slope along any one direction of relief that is too fine for the map; Gaussian."""
    denoise: bool | Positive = False
    """Whether the noise of the microscope is taken off the heights first, which rays would take for relief:
    true by the uncertainty that the file holds, or that many um of noise."""
    film: FilmJob | None = None
    """Thin layers that follow the surface."""

    @model_validator(mode="after")
    def _one_of_two(self) -> Self:
        if self.flat == (self.heights is not None):
            raise ValueError("either heights or flat = true")
        if self.film is not None and self.sealant_index is not None:
            raise ValueError("film or sealant_index, not both")
        return self

    @property
    def layers(self) -> Film | None:
        """The film of the face."""
        if self.film is None:
            return None
        thickness, index = self.film.layers
        return Film(tuple(thickness), tuple(index))


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
    placing: Literal["cell", "free flight"] = "cell"
    """Drawn into a cell that repeats, or afresh along every path."""
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

    @property
    def inside(self) -> Inside:
        """What fills them."""
        return AIR


class InclusionJob(BubbleJob):
    """[[inclusions]]: bodies in the glass that hold no air."""

    kind: Literal["opaque", "absorbing"]
    """Opaque bodies take all light that meets them; absorbing ones weaken what crosses them."""
    absorption_per_mm: Positive | None = None
    """Napierian, of what absorbs."""
    index: Annotated[float, Field(ge=1.0, lt=5.0)] | None = None
    """Refractive index of what absorbs; without it that of the glass, which bends no light."""

    @model_validator(mode="after")
    def _absorption(self) -> Self:
        opaque = self.kind == "opaque"
        if opaque and (self.absorption_per_mm is not None or self.index is not None):
            raise ValueError("no absorption_per_mm and no index for what is opaque")
        if not opaque and self.absorption_per_mm is None:
            raise ValueError("absorption_per_mm for what is absorbing")
        return self

    @property
    def inside(self) -> Inside:
        """What the tracer meets."""
        if self.absorption_per_mm is None:
            return Inside(None, float("inf"))
        return Inside(self.index, self.absorption_per_mm)


class Stokes(Job):
    """{ stokes = [I, Q, U, V] }."""

    stokes: Annotated[list[float], Field(min_length=4, max_length=4)]
    """Q > 0: light swings at right angles to the plane of incidence; I > 0."""

    @model_validator(mode="after")
    def _possible(self) -> Self:
        i, *rest = self.stokes
        if not (i > 0 and sum(x * x for x in rest) <= i * i * (1 + 1e-9)):
            raise ValueError("I > 0 and Q^2 + U^2 + V^2 <= I^2")
        return self


Incident = Annotated[
    Annotated[Literal["unpolarised", "s", "p"], Tag("plain")] | Annotated[Stokes, Tag("table")],
    Discriminator(_shape_of),
]


class TraceJob(Job):
    """[trace]: how light is traced."""

    polarised: bool = True
    """Keep the polarisation of each path; false averages s and p at every interface."""
    incident: Incident = "unpolarised"
    """Polarisation of the light that arrives, as of a laser; needs polarised = true."""
    colour: bool | str = False
    """Trace models in the CIE bands, under D65 or under the illuminant that is named."""

    @model_validator(mode="after")
    def _known_illuminant(self) -> Self:
        if self.illuminant is not None:
            try:
                viewing(self.illuminant)
            except PhysicsError as error:
                raise ValueError(str(error).rstrip(".")) from error
        return self

    @property
    def illuminant(self) -> str | None:
        """Of the CIE bands; None without them."""
        if isinstance(self.colour, str):
            return self.colour
        return "D65" if self.colour else None

    @property
    def light(self) -> tuple[float, float, float]:
        """(Q, U, V) / I."""
        if isinstance(self.incident, Stokes):
            i, q, u, v = self.incident.stokes
            return q / i, u / i, v / i
        return {"unpolarised": UNPOLARISED, "s": (1.0, 0.0, 0.0), "p": (-1.0, 0.0, 0.0)}[self.incident]


class PatchJob(Job):
    """[patch]: a finite pane."""

    width_mm: Positive
    """Of its sides along x and y."""
    sides: Sides = "clear"
    """What becomes of light that meets a side from within."""
    lit_mm: Positive | None = None
    """Side of the square in the middle on which light falls; without it the whole patch."""


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
    inclusions: tuple[InclusionJob, ...] = ()
    """Opaque or absorbing bodies, several kinds."""
    trace: TraceJob = TraceJob()
    """How light is traced."""
    patch: PatchJob | None = None
    """A finite pane in place of one that goes on for ever."""


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
        film = _checked(path, lambda: face.layers)  # noqa: B023 (called at once)
        if face.heights is None:
            faces[name] = Face.flat(
                name, sealant_index=face.sealant_index, micro_slope=face.micro_slope, film=film
            )
            continue
        height_map = surface.read(face.heights, pitch_um=face.pitch_um)
        sources.append(face.heights)
        synthetic = synthetic or "synthetic" in height_map.attributes
        faces[name] = _checked(
            path,
            Face.from_map,
            height_map,
            tiling=face.tiling,
            name=face.heights.name,
            max_missing=face.max_missing,
            sealant_index=face.sealant_index,
            micro_slope=face.micro_slope,
            film=film,
            denoise=face.denoise,
        )
    absorption: float | Spectrum
    spectrum_file = job.medium.spectrum_file
    if spectrum_file is not None:
        sources.append(spectrum_file)
        absorption = Spectrum.read_csv(spectrum_file)
    elif job.medium.pigments is not None:
        absorption = job.medium.pigments.spectrum()
    elif not isinstance(job.medium.absorption_per_mm, AbsorptionSpectrum):
        absorption = job.medium.absorption_per_mm
    index = job.medium.index
    bodies = (*job.bubbles, *job.inclusions)
    lists = [read_bubbles(b.list).filled_with(b.inside) for b in bodies if b.list is not None]
    sources += [b.list for b in bodies if b.list is not None]
    kinds = tuple(
        BubbleKind(
            per_cm3=b.per_cm3,
            median_mm=b.diameter_mm.median,
            sigma=b.diameter_mm.sigma,
            elongation=b.elongation,
            axis=b.axis,
            inside=b.inside,
            placing=b.placing,
        )
        for b in bodies
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
        incident=job.trace.light,
        colour=job.trace.illuminant,
        patch=_checked(path, Patch, **job.patch.model_dump()) if job.patch else None,
    )
    _checked(path, lambda: slab.all_bubbles)
    return slab


def _checked(path: Path, make: Callable[..., T], *arguments: Any, **named: Any) -> T:
    """What `make` returns; where physics forbids it, a FormatError that names the file."""
    try:
        return make(*arguments, **named)
    except PhysicsError as error:
        raise FormatError(file=path, expected="a pane that can be", found=str(error).rstrip(".")) from error
