"""An interactive picture of scattering models in one HTML file that opens offline."""

from __future__ import annotations

import base64
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import matplotlib as mpl
import numpy as np
from numpy.typing import ArrayLike, NDArray

from specularia import __version__
from specularia.files import write_text
from specularia.report.figures import _hemisphere
from specularia.report.style import colour_of, model_name

if TYPE_CHECKING:
    from specularia.bsdf import ScatteringModel

__all__ = ["ANGLES", "write_view"]

Array = NDArray[np.float64]

ANGLES: Final = (*range(0, 84, 4), 82.5, 84, 88)
"""Angles of incidence that a view holds, degrees, unless others are given."""

_PIXELS: Final = 120
"""Pixels across a hemisphere: 1.5 degrees each."""

_NO_DATA, _FLOOR, _FIRST, _LAST = 0, 1, 2, 65535
"""Codes of a pixel: no data; at or below zero; lowest and highest value of the logarithmic scale."""


def write_view(
    models: Mapping[str, ScatteringModel],
    path: str | Path,
    *,
    theta_deg: ArrayLike | None = None,
    title: str = "Scattering of window glass",
    synthetic: bool = False,
) -> Path:
    """Write a view: hemispheres of the DSF side by side on one scale, over angle of incidence and side.

    The page needs no network and no other file. It shows, for each model, the polar map of the DSF
    (logarithmic, five decades, no-data hatched; seen from the front, x to the right, y up), the value under
    the pointer, and the curve of the direct-hemispherical value over the angle. Its state can be set in the
    address: `view.html#side=transmission_front&theta=40&x=-40&y=0`, with x and y in degrees of polar angle.

    Parameters
    ----------
    models : by name.
    path : HTML file to write; about 1 MB per model and side.
    theta_deg : array [N], angles of incidence that the slider steps through; None takes `ANGLES`.
    title : heading of the page.
    synthetic : True labels the page.

    Returns
    -------
    path of the page.

    Notes
    -----
    Values are means over pixels of 1.5 degrees, stored with a relative precision of 0.02 % over ten decades:
    a peak narrower than a pixel appears lower than it is.
    """
    import jinja2

    angles = np.atleast_1d(np.asarray(ANGLES if theta_deg is None else theta_deg, float))
    grid = _hemisphere.pixels(_PIXELS)
    held = {name: _model_data(model, name, k, angles, grid) for k, (name, model) in enumerate(models.items())}
    sides = list(dict.fromkeys(s for m in held.values() for s in m["sides"]))
    data = {
        "angles": angles.tolist(),
        "pixels": _PIXELS,
        "decades": _hemisphere.DECADES,
        "sides": sides,
        "models": list(held.values()),
        "colours": base64.b64encode(_lookup_table().tobytes()).decode(),
    }
    environment = jinja2.Environment(
        loader=jinja2.PackageLoader("specularia.report"), autoescape=True, undefined=jinja2.StrictUndefined
    )
    html = environment.get_template("view.html.j2").render(
        title=title, data=data, synthetic=synthetic, version=__version__
    )
    return write_text(path, html)


def _model_data(
    model: ScatteringModel, name: str, index: int, angles: Array, grid: _hemisphere.Pixels
) -> dict[str, Any]:
    """What the page holds of a model: coded maps and curves of each side."""
    sides = {}
    for side in model.sides:
        maps = np.stack([_hemisphere.mean_dsf(model, side, float(t), 0.0, grid) for t in angles])
        codes, low, step = _coded(maps)
        fine = np.append(np.arange(0.0, 90.0, 1.5), 89.9)
        tau = np.asarray(model.direct_hemispherical(side, fine), float)
        table = getattr(model, "tables", {}).get(side)
        knots = (
            []
            if table is None
            else [list(map(float, k)) for k in zip(table.theta_i_deg, table.tau, table.tau_se)]
        )
        sides[side] = {
            "map": base64.b64encode(codes.astype("<u2").tobytes()).decode(),
            "low": low,
            "step": step,
            "top": float(np.nanmax(maps, initial=0.0)),
            "curve": [[float(a), float(b)] for a, b in zip(fine, tau) if np.isfinite(b)],
            "tau": [float(t) if np.isfinite(t) else None for t in model.direct_hemispherical(side, angles)],
            "knots": knots,
            "last": getattr(model, "extrapolated_beyond_deg", {}).get(side),
        }
    return {"name": model_name(name), "band": model.band, "colour": colour_of(name, index), "sides": sides}


def _coded(maps: Array) -> tuple[NDArray[np.uint16], float, float]:
    """Logarithms as 16-bit codes, with log10 of the first code and the step between two."""
    positive = maps[np.isfinite(maps) & (maps > 0)]
    high = float(np.log10(positive.max())) if positive.size else 0.0
    low = max(high - 10.0, float(np.log10(positive.min()))) if positive.size else -1.0
    step = max(high - low, 1e-9) / (_LAST - _FIRST)
    with np.errstate(divide="ignore", invalid="ignore"):
        code = _FIRST + np.rint((np.log10(maps) - low) / step)
    code = np.where(maps > 0, np.clip(code, _FIRST, _LAST), _FLOOR)
    return np.where(np.isfinite(maps), code, _NO_DATA).astype(np.uint16), low, step


def _lookup_table() -> NDArray[np.uint8]:
    """Red, green and blue of the 256 steps of the colour map of the figures."""
    rgba = mpl.colormaps[_hemisphere.COLOURS](np.arange(256), bytes=True)
    return np.ascontiguousarray(np.asarray(rgba, np.uint8)[:, :3])
