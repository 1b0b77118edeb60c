"""An interactive picture of scattering models in one HTML file that opens offline."""

from __future__ import annotations

import base64
from collections.abc import Mapping, Sequence
from importlib import resources
from pathlib import Path
from typing import TYPE_CHECKING, Final

import matplotlib as mpl
import numpy as np
from numpy.typing import ArrayLike, NDArray

from specularia import __version__
from specularia.conventions import SIDES
from specularia.files import write_text
from specularia.report import _view_data
from specularia.report._view_data import GRID, Directions
from specularia.report.figures import _hemisphere
from specularia.report.style import COLOURS, colour_of, model_name

if TYPE_CHECKING:
    from specularia.bsdf import ScatteringModel
    from specularia.gonio import Table

__all__ = ["write_view"]

Array = NDArray[np.float64]

_STEPS: Final = (2.0, 3.0, 4.0, 5.0, 7.5, 10.0, 15.0)
"""Steps between the polar angles of incidence; the first that the size allows is taken."""

_AZIMUTHS: Final = (24, 16, 12, 8)
"""Numbers of azimuths of incidence where a model is not isotropic, likewise."""


def write_view(
    models: Mapping[str, ScatteringModel | Sequence[ScatteringModel]],
    path: str | Path,
    *,
    theta_deg: ArrayLike | None = None,
    measured: Sequence[Table] = (),
    sides: Sequence[str] | None = None,
    largest_mb: float = 12.0,
    title: str = "Scattering of window glass",
    synthetic: bool = False,
) -> Path:
    """Write a view: models side by side, over the incident direction, the side and the band.

    The page needs no network and no other file. It shows, for each model, the polar map of the DSF
    (logarithmic, five decades, no-data hatched; seen from the front, x to the right, y up) and the same as a
    lobe in space; the BSDF, its standard error and the DSF under the pointer; the section through the plane
    of incidence with measured points; and the direct-hemispherical value over the angle with its interval.
    The incident direction is dragged on a small hemisphere or set by sliders. The page opens in a state with
    `view.html#side=transmission_front&theta=40&phi=30&x=-40&y=0&band=Visible`, with x and y in degrees of
    polar angle.

    Parameters
    ----------
    models : by name; a sequence where a model has several bands, which the page then switches between.
    path : HTML file to write; 0.5 MB, and about 1 MB (2 with standard errors) per model and side.
    theta_deg : array [N], polar angles of incidence, degrees, 0 <= theta < 90. None takes steps of 2 degrees,
        or larger ones where the tables would grow beyond `largest_mb`; those of `measured` are added.
    measured : tables whose points near the plane of incidence are drawn into the section.
    sides : those of `conventions.SIDES` that are shown; None shows all that the models hold.
    largest_mb : megabytes that the tables may have, unless `theta_deg` is given.
    title : heading of the page.
    synthetic : True labels the page.

    Returns
    -------
    path of the page.

    Notes
    -----
    Values are those of `evaluate` at fixed directions: every 2 degrees over the hemisphere and every 0.5
    within 12 degrees of the undeflected (or mirrored) direction. They are stored with a relative precision of
    0.02 % over ten decades, standard errors to 3 %. Nothing is interpolated: the page shows the nearest
    direction that it holds, and says which.

    Examples
    --------
    >>> from specularia.bsdf import read  # doctest: +SKIP
    >>> write_view({"M": read("m.nc"), "C": read("c.nc")}, "view.html")  # doctest: +SKIP
    """
    import jinja2
    from markupsafe import Markup

    bands: dict[str, dict[str, ScatteringModel]] = {}
    for name, given in models.items():
        several = given if isinstance(given, Sequence) else [given]
        bands[name] = {m.band: m for m in several}
    shown = [
        s
        for s in (SIDES if sides is None else sides)
        if any(s in m.sides for held in bands.values() for m in held.values())
    ]
    directions = _directions(bands, shown, measured, theta_deg, 1e6 * largest_mb)
    turned = Directions(directions.theta_deg)
    data = {
        "theta": directions.theta_deg,
        "phi": directions.phi_deg,
        "grid": {
            "step": GRID.step_deg,
            "fine": GRID.fine_deg,
            "half": GRID.fine_half,
            "section": GRID.section_deg,
        },
        "error": [_view_data.ERROR_LOW, _view_data.ERROR_HIGH, _view_data.ERROR_STEPS],
        "decades": _hemisphere.DECADES,
        "sides": shown,
        # What the switch offers: a model of one band is shown in it, whatever the others show.
        "bands": list(dict.fromkeys(b for held in bands.values() if len(held) > 1 for b in held)),
        "models": [
            {
                "name": model_name(name),
                "colour": colour_of(name, k),
                "isotropic": all(map(_isotropic, held.values())),
                "bands": {
                    band: {
                        side: _view_data.side_data(m, side, turned if _isotropic(m) else directions)
                        for side in m.sides
                        if side in shown
                    }
                    for band, m in held.items()
                },
            }
            for k, (name, held) in enumerate(bands.items())
        ],
        "measured": _view_data.measured_data(measured),
        "measuredColour": COLOURS["measured"],
        "colours": base64.b64encode(_lookup_table().tobytes()).decode(),
    }
    parts = resources.files("specularia.report") / "view_page"
    environment = jinja2.Environment(
        loader=jinja2.PackageLoader("specularia.report"), autoescape=True, undefined=jinja2.StrictUndefined
    )
    html = environment.get_template("view.html.j2").render(
        title=title,
        data=data,
        synthetic=synthetic,
        version=__version__,
        scripts=[Markup((parts / f).read_text(encoding="utf-8")) for f in ("view_lobe.js", "view.js")],
        three=Markup((parts / "three.min.js").read_text(encoding="utf-8")),
        licence=Markup((parts / "three.LICENSE.txt").read_text(encoding="utf-8")),
    )
    return write_text(path, html)


def _isotropic(model: ScatteringModel) -> bool:
    return bool(getattr(model, "isotropic", True))


def _directions(
    bands: Mapping[str, Mapping[str, ScatteringModel]],
    sides: Sequence[str],
    measured: Sequence[Table],
    theta_deg: ArrayLike | None,
    budget: float,
) -> Directions:
    """The incident directions: as many as the page has room for, with those of the measurements."""
    every = [m for held in bands.values() for m in held.values()]
    turning = not all(map(_isotropic, every))
    added = {float(f"{t.polar_deg:.6g}") for t in measured if t.polar_deg < 90.0}
    made = Directions(())
    for k, step in enumerate(_STEPS):
        count = _AZIMUTHS[min(k, len(_AZIMUTHS) - 1)]
        phi = tuple(360.0 * i / count for i in range(count)) if turning else (0.0,)
        theta = (
            np.arange(0.0, 89.0, step) if theta_deg is None else np.atleast_1d(np.asarray(theta_deg, float))
        )
        made = Directions(tuple(sorted({*map(float, theta), *added})), phi)
        size = sum(
            sum(s in sides for s in m.sides)
            * (len(made.theta_deg) if _isotropic(m) else made.count)
            * GRID.stride
            * (3 if hasattr(m, "standard_error") else 2)
            * 4
            / 3
            for m in every
        )
        if size <= budget:
            break
    return made


def _lookup_table() -> NDArray[np.uint8]:
    """Red, green and blue of the 256 steps of the colour map of the figures."""
    rgba = mpl.colormaps[_hemisphere.COLOURS](np.arange(256), bytes=True)
    return np.ascontiguousarray(np.asarray(rgba, np.uint8)[:, :3])
