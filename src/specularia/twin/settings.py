"""TWIN.toml: every key of a synthetic specimen, with defaults that make one like the paper's sample."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field, model_validator

from specularia.jobs import Job

__all__ = [
    "BackSettings",
    "BubbleSettings",
    "FaceSettings",
    "FindsSettings",
    "GlassSettings",
    "GonioSettings",
    "MapSettings",
    "MicroscopeSettings",
    "RoomSettings",
    "TruthSettings",
    "TwinSettings",
]

Positive = Annotated[float, Field(gt=0)]
Share = Annotated[float, Field(ge=0, le=1)]
Span = tuple[Positive, Positive]


def _coprime(pixels: int) -> int:
    """The next odd product of 3, 5 and 7 above 1.02 pixels: no factor of a power of two, fast to transform.

    >>> _coprime(512)
    525
    """
    products = (3**a * 5**b * 7**c for a in range(8) for b in range(6) for c in range(5))
    return min(p for p in products if p > 1.02 * pixels)


class MapSettings(Job):
    """`[maps]`: the grid of both height maps, one period each way."""

    pixels: Annotated[int, Field(ge=32, le=4096)] = 1024
    """Pixels of the front along x and along y; a power of two."""
    back_pixels: Annotated[int, Field(ge=32, le=5120)] | None = None
    """The same of the back; left out, the next odd product of 3, 5 and 7 above 1.02 `pixels`. Periods that
    share no factor let every place of one face meet every place of the other, as in a pane that does not
    repeat; with the same period a place meets its few partners only, and the distribution is grainy."""
    pitch_um: Positive = 1.5
    """Distance between pixels."""

    def of(self, face: str) -> MapSettings:
        """The grid of one face, "front" or "back", as its `pixels`."""
        if face == "front":
            return self
        return self.model_copy(update={"pixels": self.back_pixels or _coprime(self.pixels)})

    @model_validator(mode="after")
    def _power_of_two(self) -> MapSettings:
        if self.pixels & (self.pixels - 1):
            raise ValueError("a power of two (32 to 4096)")
        return self


class FaceSettings(Job):
    """`[front]`, and the keys of `[back]`: a blown surface and the decay on top of it."""

    streak_slope: Annotated[float, Field(ge=0, le=0.2)] = 0.01
    """Rms slope of the pristine surface across the streaks (x); along them (y) it is about a fifth."""
    pitted_share: Annotated[float, Field(ge=0, le=0.97)] = 0.6
    """Share of the area that lies inside pits."""
    relief_um: Annotated[float, Field(ge=0)] = 30.0
    """Highest minus lowest point of the decayed surface; 0 leaves the pristine surface."""
    radius_um: Span = (15.0, 85.0)
    """Smallest and largest radius of the pits (calderas)."""
    clusters_per_mm2: Annotated[float, Field(ge=0)] = 0.0
    """Centres around which pits gather; 0 spreads them evenly."""
    cluster_radius_um: Positive = 90.0
    """Standard deviation of a pit's distance from its centre, along x and along y."""
    secondary_radius_um: Span = (4.5, 10.0)
    """Smallest and largest radius of the secondary pits on the floors of the primary ones."""
    secondary_depth: Annotated[float, Field(ge=0, le=1)] = 0.0
    """Depth of a secondary pit over its radius; 0 for none."""

    @model_validator(mode="after")
    def _ordered(self) -> FaceSettings:
        for name in ("radius_um", "secondary_radius_um"):
            low, high = getattr(self, name)
            if low > high:
                raise ValueError(f"{name} = [smallest, largest]")
        return self


class BackSettings(FaceSettings):
    """`[back]`: as `[front]`, with other defaults."""

    pitted_share: Annotated[float, Field(ge=0, le=0.97)] = 0.9
    relief_um: Annotated[float, Field(ge=0)] = 60.0
    radius_um: Span = (20.0, 125.0)
    clusters_per_mm2: Annotated[float, Field(ge=0)] = 18.0
    secondary_depth: Annotated[float, Field(ge=0, le=1)] = 0.22


class GlassSettings(Job):
    """`[glass]`: the pane and its substance."""

    thickness_mm: Positive = 3.0
    """Between the mean planes of the decayed faces."""
    index: Annotated[float, Field(gt=1, le=3)] = 1.52
    """Refractive index, the same at every wavelength."""
    absorption_520_per_mm: Annotated[float, Field(ge=0)] = 0.07
    """Napierian absorption at 520 nm."""
    absorption_red_per_mm: Annotated[float, Field(ge=0)] = 0.004
    """What is left of it far in the red."""
    absorption_decay_nm: Positive = 60.0
    """Step in wavelength over which the rest falls by e, towards the red."""

    @model_validator(mode="after")
    def _falls(self) -> GlassSettings:
        if self.absorption_red_per_mm > self.absorption_520_per_mm:
            raise ValueError("absorption_red_per_mm not above absorption_520_per_mm")
        return self


class BubbleSettings(Job):
    """`[bubbles]`: elongated bubbles, listed one by one in a cell that repeats along x and y."""

    per_cm3: Annotated[float, Field(ge=0)] = 30.0
    """Number density; 0 for none."""
    diameter_median_mm: Positive = 0.2
    """Median diameter of the sphere of equal volume."""
    diameter_sigma: Annotated[float, Field(ge=0, le=1)] = 0.4
    """Standard deviation of the logarithm of that diameter."""
    elongation: Annotated[float, Field(ge=1, le=10)] = 3.0
    """Long axis over short axis; the long axis lies along y, the direction of blowing."""
    cell_mm: Positive = 20.0
    """Side of the square cell."""


class MicroscopeSettings(Job):
    """`[microscope]`: the confocal focus stacks and the all-in-focus images."""

    step_um: Positive = 1.25
    """Distance between slices."""
    fwhm_slices: Annotated[float, Field(ge=2, le=20)] = 4.0
    """Full width at half maximum of the axial response."""
    margin_um: Annotated[float, Field(ge=0)] = 6.0
    """Range of the stack above the highest and below the lowest point."""
    electrons: Positive = 20000.0
    """Mean signal of a level pixel in focus; its square root is the shot noise."""
    read_noise_electrons: Annotated[float, Field(ge=0)] = 30.0
    """Standard deviation of the camera's own noise."""
    half_bright_slope: Positive = 0.35
    """Slope at which half of the light no longer returns through the objective."""


class GonioSettings(Job):
    """`[gonio]`: the tables of the virtual gonio-photometer, at phi_i = 0 and 520 nm."""

    theta_deg: tuple[Annotated[float, Field(ge=0, lt=90)], ...] = (0.0, 20.0, 40.0, 60.0, 82.5)
    """Incident directions, ascending."""
    paths: Annotated[int, Field(ge=1000)] = 4_000_000
    """Traced paths per incident direction."""
    base: Annotated[int, Field(ge=100)] = 112_000
    """Scan directions of the spiral over the hemisphere."""
    middle: Annotated[int, Field(ge=0)] = 40_000
    """Scan directions within 15 degrees of the undeflected one (fewer where the horizon cuts the cap)."""
    peak: Annotated[int, Field(ge=0)] = 25_000
    """Scan directions within 5 degrees of the undeflected one."""
    aperture_deg: Annotated[float, Field(ge=0.3, le=10)] = 0.3
    """Full width at half maximum of the instrument's angular response."""
    relative_noise: Annotated[float, Field(ge=0, le=0.2)] = 0.01
    """Standard deviation of a reading over the reading."""
    floor: Annotated[float, Field(ge=0)] = 3e-6
    """Standard deviation of the additive noise over the highest reading at normal incidence."""
    shadow: bool = True
    """Whether the column of the sample mount shades directions near phi_s = -90 close to the horizon."""

    @model_validator(mode="after")
    def _ascending(self) -> GonioSettings:
        if not self.theta_deg or list(self.theta_deg) != sorted(set(self.theta_deg)):
            raise ValueError("theta_deg ascending, without repeats, not empty")
        return self


class TruthSettings(Job):
    """`[truth]`: the trace that is averaged over azimuth (the one at phi_i = 0 is that of the tables)."""

    paths: Annotated[int, Field(ge=1000)] = 250_000
    """Traced paths per incident direction."""


class FindsSettings(Job):
    """`[finds]`: the table of window glass fragments from an invented house."""

    fragments: Annotated[int, Field(ge=200)] = 5000
    """Number of fragments (a find may hold several)."""
    weight_kg: Positive = 28.0
    """Their total weight."""


class RoomSettings(Job):
    """`[room]`: the room around the window; the paper does not give it."""

    width_m: Positive = 5.0
    """Inner width, along the window wall."""
    depth_m: Positive = 6.0
    """Inner depth, away from the window."""
    height_m: Positive = 3.0
    """Inner height."""
    sill_m: Positive = 1.0
    """Height of the window's lower edge."""


class TwinSettings(Job):
    """TWIN.toml, the description of a synthetic specimen."""

    name: str = "synthetic specimen"
    """Name of the specimen in every file; the word synthetic is put in front where it is missing."""
    maps: MapSettings = MapSettings()
    front: FaceSettings = FaceSettings()
    back: BackSettings = BackSettings()
    glass: GlassSettings = GlassSettings()
    bubbles: BubbleSettings = BubbleSettings()
    microscope: MicroscopeSettings = MicroscopeSettings()
    gonio: GonioSettings = GonioSettings()
    truth: TruthSettings = TruthSettings()
    finds: FindsSettings = FindsSettings()
    room: RoomSettings = RoomSettings()

    @property
    def label(self) -> str:
        """The name, with the word synthetic in it."""
        return self.name if "synthetic" in self.name.lower() else f"synthetic {self.name}"
