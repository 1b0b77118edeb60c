"""A day in a lit room as one HTML file that opens offline: pictures over the hours, models side by side."""

from __future__ import annotations

import base64
import zlib
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import matplotlib as mpl
import numpy as np
from numpy.typing import NDArray

from specularia import __version__
from specularia.files import write_text
from specularia.report.style import colour_of, model_name

if TYPE_CHECKING:
    from specularia.daylight import DayHour, DayResult

__all__ = ["write_day"]

Array = NDArray[np.float64]

_STEP: Final = 0.001
"""Decades between two codes of luminance: values are kept to 0.12 %."""

_NO_DATA, _FLOOR, _FIRST = 0, 1, 2
"""Codes of a pixel: no data; at or below the lowest luminance; that luminance."""

_DEPTH: Final = 8.0
"""Decades below the brightest pixel that are kept."""

_SHOWN: Final = (3.0, 5.0)
"""Fewest and most decades of the false-colour scale."""


def write_day(
    result: DayResult, path: str | Path, *, title: str | None = None, synthetic: bool = False
) -> Path:
    """Write the page: a slider over the hours, models side by side on one fixed scale.

    It needs no network and no other file. It shows luminance in false colour, or as a picture whose exposure
    can be chosen; the luminance under the pointer (or a mark moved by the arrow keys) for all models; and the
    illuminances at the room's points, as a table and as curves over the hours. Its state can be set in the
    address: `day.html#date=0620-06-21&hour=10.5&mode=picture&ev=1&column=40&row=20`, the last two in pixels.

    Parameters
    ----------
    result : of `specularia.daylight.day`.
    path : HTML file to write; some 20 kB per hour, model and picture of 240 x 180 pixels.
    title : heading of the page; None takes one from the room's name.
    synthetic : True labels the page.

    Returns
    -------
    path of the page.

    Notes
    -----
    Luminances are stored as logarithms in steps of a thousandth of a decade, eight decades deep.
    """
    import jinja2

    scale, white = _levels([i.luminance() for h in result.hours for i in h.images])
    low = scale[1] - _DEPTH
    views = list(dict.fromkeys(i.name for h in result.hours for i in h.images))
    data: dict[str, Any] = {
        "models": [
            {"name": model_name(m), "key": m, "colour": colour_of(m, k)} for k, m in enumerate(result.models)
        ],
        "views": views,
        "points": list(dict.fromkeys(p.name for h in result.hours for p in h.points)),
        "low": low,
        "step": _STEP,
        "scale": scale,
        "white": white,
        "clock": result.clock,
        "days": [
            {
                "date": date,
                "calendar": next(h.time.calendar for h in result.hours if h.time.date == date),
                "out": [t.hour for t, _ in result.left_out if t.date == date],
                "hours": [_hour(h, low) for h in result.hours if h.time.date == date],
            }
            for date in result.dates
        ],
        "without": [t.date for t, _ in result.left_out if t.date not in result.dates],
        "colours": base64.b64encode(_lookup_table().tobytes()).decode(),
    }
    data["without"] = list(dict.fromkeys(data["without"]))
    environment = jinja2.Environment(
        loader=jinja2.PackageLoader("specularia.report"), autoescape=True, undefined=jinja2.StrictUndefined
    )
    html = environment.get_template("day.html.j2").render(
        title=title or f"{result.name} through the day",
        data=data,
        synthetic=synthetic,
        version=__version__,
        provenance=result.provenance,
    )
    return write_text(path, html)


def _levels(images: list[Array]) -> tuple[tuple[float, float], float]:
    """Ends of the false-colour scale (log10 of cd/m2), and a luminance that suits as white of a picture."""
    positive = np.concatenate([m[np.isfinite(m) & (m > 0)] for m in images]) if images else np.empty(0)
    if positive.size == 0:
        return (-2.0, 1.0), 1.0
    # Panes are far brighter than walls: white is set for the room, and panes burn out as they do for the eye.
    bottom, bright, top = np.quantile(positive, [0.01, 0.95, 0.999])
    high = _rounded(float(top), up=True)
    low = float(np.clip(_rounded(float(bottom), up=False), high - _SHOWN[1], high - _SHOWN[0]))
    return (low, high), float(10 ** _rounded(float(bright), up=True))


def _rounded(value: float, *, up: bool) -> float:
    """log10 of the next 1, 2 or 5 above or below."""
    exponent = np.floor(np.log10(value))
    steps = np.array([1.0, 2.0, 5.0, 10.0]) * 10**exponent
    return float(
        np.log10(steps[steps >= value * (1 - 1e-9)][0] if up else steps[steps <= value * (1 + 1e-9)][-1])
    )


def _hour(hour: DayHour, low: float) -> dict[str, Any]:
    """What the page holds of an hour."""
    return {
        "hour": hour.time.hour,
        "elevation": hour.position.apparent_elevation_deg,
        "azimuth": hour.position.azimuth_deg,
        "sky": hour.sky,
        "sun": hour.sun_normal_lx,
        "diffuse": hour.sky_horizontal_lx,
        "points": [[p.name, p.model, p.illuminance_lx, p.se] for p in hour.points],
        "images": [
            {"view": i.name, "model": i.model, "pixels": i.pixels, **_packed(i.luminance(), low)}
            for i in hour.images
        ],
    }


def _packed(luminance: Array, low: float) -> dict[str, Any]:
    """A picture as differences of 16-bit codes along its rows, low bytes after high bytes, deflated."""
    with np.errstate(divide="ignore", invalid="ignore"):
        code = _FIRST + np.rint((np.log10(luminance) - low) / _STEP)
    code = np.where(luminance > 0, np.clip(code, _FLOOR, 65535), _FLOOR)
    codes = np.where(np.isfinite(luminance), code, _NO_DATA).astype(np.uint16)
    change = np.diff(codes, axis=1, prepend=np.uint16(0)).astype(np.uint16)
    planes = np.concatenate([(change >> 8).astype(np.uint8).ravel(), (change & 255).astype(np.uint8).ravel()])
    rows, columns = luminance.shape
    return {
        "rows": rows,
        "columns": columns,
        "codes": base64.b64encode(zlib.compress(planes.tobytes(), 9)).decode(),
    }


def _lookup_table() -> NDArray[np.uint8]:
    """Red, green and blue of the 256 steps of the colour map of the luminance figures."""
    rgba = mpl.colormaps["inferno"](np.arange(256), bytes=True)
    return np.ascontiguousarray(np.asarray(rgba, np.uint8)[:, :3])
