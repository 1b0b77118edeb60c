"""The fragment over a printed sheet, seen through each model (the paper's Fig. 10), and how print fades.

The sheet scatters evenly with the reflectance R(x) of its print. Under the glass it gets

    E0 = E_sky [1 - A * M + B * M] + E_lamp cos(theta) [1 - M(x - s(d)) + F_lamp * M],

with the outline M, * a convolution over displacements, A those of an even sky, B the same with what the glass
passes, and F_lamp those of the lamp's light through the glass. Light goes back and forth between the sheet
and the underside, which reflects the even share rho: E = E0 + rho C * (M R E), C being what an even scatterer
sheds on a plane at twice the gap (its mirror image). The eye, far away, sees

    L = M (F_eye * (R E / pi) + L_reflected) + (1 - M) R E / pi,

where F_eye are the directions below that light from the eye would leave in (reciprocity). L_reflected is what
the top reflects of sky and lamp, for models that know it.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from specularia.bsdf import ScatteringModel
from specularia.daylight.checks import check_models
from specularia.daylight.colour import Coloured
from specularia.daylight.fragment_job import FragmentJob
from specularia.daylight.fragment_optics import Fan, Placed, even_sky, lambert_transfer
from specularia.daylight.fragment_sheet import glass, outline_box, printed
from specularia.daylight.panes import Glazing, named_glazing
from specularia.errors import FormatError
from specularia.jobs import load_toml
from specularia.progress import task
from specularia.provenance import record

__all__ = ["Contrast", "FragmentPicture", "FragmentResult", "look_through"]

Array = NDArray[np.float64]

_PIXELS = 12_000_000
"""Largest table, in pixels."""

_SAMPLES = 48
"""Points of a bar and the space beside it. All their harmonics are kept, so that nothing rings at them."""


@dataclass(frozen=True)
class FragmentPicture:
    """The fragment at one gap through one model.

    Attributes
    ----------
    model : name.
    gap_mm : between sheet and underside.
    luminance : [rows, columns] cd/m2, row 0 at the top.
    covered : [rows, columns] share of each pixel that glass covers.
    extent_mm : left, right, bottom, top of the picture on the table.
    xyz : [rows, columns, 3] tristimulus values under white light for a model of three bands, else None.
    """

    model: str
    gap_mm: float
    luminance: Array
    covered: Array
    extent_mm: tuple[float, float, float, float]
    xyz: Array | None = None


@dataclass(frozen=True)
class Contrast:
    """Michelson contrast of upright bars under the middle of the glass.

    Attributes
    ----------
    model : name.
    gap_mm : [G].
    contrast : [G] (max - min) / (max + min) of the luminance as seen, reflection included.
    transmitted : [G] the same without what the top reflects.
    bare : of the bars without glass.
    reflects : whether the model knows what its top reflects.
    """

    model: str
    gap_mm: Array
    contrast: Array
    transmitted: Array
    bare: float
    reflects: bool

    def at(self, gap_mm: float) -> float:
        """Contrast at a gap, linear between those worked out; NaN beyond the largest."""
        return float(np.interp(gap_mm, self.gap_mm, self.contrast, left=np.nan, right=np.nan))


@dataclass(frozen=True)
class FragmentResult:
    """Everything that one run gives.

    Attributes
    ----------
    job : what was asked for.
    pictures : each model at each gap, models in turn.
    contrast : of each model.
    synthetic_outline : whether the outline is the invented one.
    provenance : inputs, parameters and versions.
    """

    job: FragmentJob
    pictures: list[FragmentPicture]
    contrast: list[Contrast]
    synthetic_outline: bool
    provenance: dict[str, str]


def look_through(
    job: str | Path | FragmentJob,
    *,
    models: Mapping[str, ScatteringModel | Coloured | Glazing | str | Path] | None = None,
) -> FragmentResult:
    """Lay the sample over the sheet and look at it through each of the given models.

    Parameters
    ----------
    job : a FRAGMENT.toml (see `specularia.daylight.fragment_job`) or its content.
    models : scattering models, or files that hold them, by name; they come after those that the file names
        itself, and one of the same name takes its place.

    Raises
    ------
    FormatError : a file that cannot be.
    CoverageError : a model that lacks a transmission, or the direction of the eye or the lamp.
    """
    file = Path("fragment") if isinstance(job, FragmentJob) else Path(job)
    todo = job if isinstance(job, FragmentJob) else load_toml(job, FragmentJob)
    held = named_glazing(todo.model, models or {})
    if not held:
        raise FormatError(
            file=file,
            expected="at least one scattering model for the glass",
            found="none",
            advice="Add [[model]] to the file or give --model NAME=FILE.",
        )
    check_models({name: g.model for name, g in held.items()})
    check_models({f"{n}, {m.band}": m for n, g in held.items() for m in g.chroma or ()})
    table = _Table(todo, file)
    pictures: list[FragmentPicture] = []
    curves: list[Contrast] = []
    with task("fragment", len(held) * (len(todo.gap_mm) + 1)) as progress:
        for name, glazing in held.items():
            bands = glazing.channels if glazing.chroma else (glazing,)
            lights = [_Lit(Placed(g.model, todo.sample, name=name), todo) for g in bands]
            y = lights[len(lights) // 2]
            for gap in todo.gap_mm:
                seen = [table.picture(name, band, gap) for band in lights]
                xyz = np.stack([p.luminance for p in seen], axis=-1) if glazing.chroma else None
                pictures.append(replace(seen[len(seen) // 2], xyz=xyz))
                progress.advance()
            curves.append(_contrast(name, y, todo))
            progress.advance()
    inputs = [g.source for g in held.values() if g.source is not None]
    inputs += [f for m in todo.model for f in (m.cie_x, m.cie_z) if f is not None]
    pictured = [p for p in (todo.sample.mask, todo.sheet.image) if p is not None]
    example = todo.sample.mask is None and todo.sample.outline_mm is None
    return FragmentResult(
        job=todo,
        pictures=pictures,
        contrast=curves,
        synthetic_outline=example,
        provenance=record(
            what=f"{todo.name} over a printed sheet",
            inputs=[*([] if isinstance(job, FragmentJob) else [file]), *inputs, *pictured],
            parameters={"fragment": todo, "bands": {name: g.bands for name, g in held.items()}},
            synthetic=any("synthetic" in getattr(g.model, "attributes", {}) for g in held.values()),
        ),
    )


class _Lit:
    """A model on the table with its eye and lamp: all that does not change with the gap."""

    def __init__(self, placed: Placed, job: FragmentJob) -> None:
        light, eye = job.light, (job.eye.theta_deg, job.eye.phi_deg)
        lamp = (90.0 - light.lamp_elevation_deg, light.lamp_azimuth_deg)
        self.lamp_horizontal = light.lamp_lx * float(np.cos(np.radians(lamp[0])))
        self.sky_horizontal = light.diffuse_lx
        self.reflects = placed.reflects
        self.eye = placed.fan(*eye)
        self.lamp = placed.fan(*lamp) if light.lamp_lx > 0.0 else None
        self.sky = placed.transmission_from_below()
        self.rho = placed.underside()
        self.reflected = placed.reflected(eye, lamp, diffuse_lx=light.diffuse_lx, lamp_lx=light.lamp_lx)
        self.depth = job.sample.scatters_at * job.sample.thickness_mm
        self.index = job.sample.index

    def under_wide_glass(self) -> float:
        """lx on the sheet far from the edges, before light goes back and forth."""
        lamp = 0.0 if self.lamp is None else self.lamp_horizontal * float(self.lamp.share.sum())
        return self.sky_horizontal * float(self.sky.share.sum()) + lamp


class _Table:
    """Sheet and outline on a grid of pixels that closes on itself, large enough that this does not show."""

    def __init__(self, job: FragmentJob, file: Path) -> None:
        from scipy.fft import next_fast_len

        left, bottom, right, top = outline_box(job.sample)
        pixel, border = job.picture.pixel_mm, job.picture.border_mm
        # Light comes from well beyond the picture where the gap is large.
        self.margin = int(np.ceil(min(max(2.0 * max(job.gap_mm), 5.0), 40.0) / pixel))
        columns, rows = (
            int(np.ceil((b - a + 2 * border) / pixel)) for a, b in ((left, right), (bottom, top))
        )
        # A few more pixels beyond the margin make the transforms fast.
        wide, tall = (next_fast_len(n + 2 * self.margin, real=True) for n in (columns, rows))
        if wide * tall > _PIXELS:
            raise FormatError(
                file=file,
                expected=f"a table of at most {_PIXELS / 1e6:g} million pixels",
                found=f"{wide * tall / 1e6:.1f} million",
                advice="Raise pixel_mm in [picture].",
            )
        self.pixel = pixel
        x, y = (
            0.5 * (a + b) + (np.arange(count) - 0.5 * n - self.margin + 0.5) * pixel
            for a, b, n, count in ((left, right, columns, wide), (bottom, top, rows, tall))
        )
        self.mask = glass(job.sample, x, y)
        self.paper = printed(job.sheet, x, y)
        self.inner = np.s_[self.margin : self.margin + rows, self.margin : self.margin + columns]
        first, half = self.margin, pixel / 2
        self.extent = (
            float(x[first] - half),
            float(x[first + columns - 1] + half),
            float(y[first] - half),
            float(y[first + rows - 1] + half),
        )
        fy, fx = np.fft.fftfreq(y.size, pixel), np.fft.rfftfreq(x.size, pixel)
        self.frequency = np.hypot(fy[:, None], fx[None, :])

    def _convolved(self, kernel: Array, field: Array) -> Array:
        return np.fft.irfft2(np.fft.rfft2(kernel) * np.fft.rfft2(field), s=field.shape)

    def _kernel(self, fan: Fan, light: _Lit, gap: float, depth: float) -> Array:
        return fan.kernel(self.mask.shape, self.pixel, gap=gap, depth=depth, index=light.index)

    def picture(self, name: str, light: _Lit, gap: float) -> FragmentPicture:
        """What the eye sees; see the module."""
        received = light.sky_horizontal * (
            1.0
            - self._convolved(self._kernel(even_sky(), light, gap, 0.0), self.mask)
            + self._convolved(self._kernel(light.sky, light, gap, light.depth), self.mask)
        )
        if light.lamp is not None:
            past = self._kernel(_past(light.lamp), light, gap, 0.0)
            through = self._kernel(light.lamp, light, gap, light.depth)
            received += light.lamp_horizontal * (1.0 + self._convolved(through - past, self.mask))
        received = np.maximum(received, 0.0)
        total = received
        back = light.rho * lambert_transfer(self.frequency, 2.0 * gap)
        for _ in range(60):
            sent = np.fft.rfft2(self.mask * self.paper * total) * back
            new = received + np.fft.irfft2(sent, s=total.shape)
            done = float(np.max(np.abs(new - total))) < 1e-6 * float(new.max())
            total = new
            if done:
                break
        sheet = self.paper * total / np.pi
        # A kernel says where light from a place lands; the eye asks where the light of a place comes from.
        through = self._kernel(light.eye, light, gap, light.depth)
        seen = self._convolved(_turned(through), sheet)
        beside = self._convolved(_turned(self._kernel(_past(light.eye), light, gap, 0.0)), sheet)
        luminance = self.mask * (seen + light.reflected) + (1.0 - self.mask) * beside
        return FragmentPicture(
            model=name,
            gap_mm=gap,
            luminance=np.maximum(luminance[self.inner][::-1], 0.0),
            covered=self.mask[self.inner][::-1].copy(),
            extent_mm=self.extent,
        )


def _past(fan: Fan) -> Fan:
    """The same light where it goes past the glass: all of it in one direction."""
    one = np.ones(1)
    return Fan(
        ux=one * fan.straight[0], uy=one * fan.straight[1], share=one, size=0.0 * one, straight=fan.straight
    )


def _turned(kernel: Array) -> Array:
    """The kernel for the opposite displacement."""
    return np.roll(kernel[::-1, ::-1], (1, 1), axis=(0, 1))


def _contrast(name: str, light: _Lit, job: FragmentJob) -> Contrast:
    """Contrast of bars over gap, exact in one dimension: a square wave, its harmonics and their transfer."""
    gaps = np.array(
        job.contrast_gap_mm if job.contrast_gap_mm is not None else [0.0, *np.geomspace(0.1, 50.0, 40)]
    )
    n = _SAMPLES
    sheet = job.sheet
    bars = np.where(np.arange(n) < n // 2, sheet.paper, sheet.ink)
    frequency = np.asarray(np.fft.rfftfreq(n, 2.0 * sheet.stroke_mm / n), float)
    seen, without = np.empty(gaps.size), np.empty(gaps.size)
    for k, gap in enumerate(gaps):
        received = np.full(n, light.under_wide_glass())
        total, back = received, light.rho * lambert_transfer(frequency, 2.0 * float(gap))
        for _ in range(40):
            total = received + np.fft.irfft(np.fft.rfft(bars * total) * back, n)
        transfer = light.eye.transfer(frequency, gap=float(gap), depth=light.depth, index=light.index)
        through = np.fft.irfft(np.fft.rfft(bars * total / np.pi) * transfer, n)
        low, high = float(through.min()), float(through.max())
        without[k] = (high - low) / (high + low) if high + low > 0.0 else 0.0
        veil = 2.0 * light.reflected
        seen[k] = (high - low) / (high + low + veil) if high + low + veil > 0.0 else 0.0
    return Contrast(
        model=name,
        gap_mm=gaps,
        contrast=seen,
        transmitted=without,
        bare=(sheet.paper - sheet.ink) / (sheet.paper + sheet.ink),
        reflects=light.reflects,
    )
