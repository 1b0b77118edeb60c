"""The look of all figures: one font, one set of colours, perceptual maps, no-data drawn apart."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Final

import numpy as np
from matplotlib import rc_context
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure as Canvas
from matplotlib.patches import Patch, Rectangle

from specularia.files import atomic, write_csv

__all__ = [
    "COLOURS",
    "DPI",
    "NO_DATA",
    "SYNTHETIC",
    "canvas",
    "colour_of",
    "hatch",
    "letter",
    "model_name",
    "no_data_patch",
    "number",
    "numbers_beside",
    "save",
    "write_csv",
    "write_npz",
]

DPI: Final = 200
"""Pixels per inch of every figure."""

NO_DATA: Final = "#d4d4d4"
"""Face of no-data areas; grey hatching on it tells them from the lowest colour of a scale."""

SYNTHETIC: Final = "synthetic data"
"""Label on every figure of synthetic data."""

COLOURS: Final = {
    "measured": "#1a1a1a",
    "M": "#0b6fa4",
    "C": "#d1611e",
    "H": "#2a8f6d",
    "clear slab": "#7a7a7a",
}
"""Colours of the series that recur through the figures; Okabe and Ito's blue and vermilion, darkened."""

_MORE = ("#2a8f6d", "#a8447f", "#8a6d00", "#5b57a6")

_SETTINGS: Any = {
    "font.family": "sans-serif",
    "font.sans-serif": ["DejaVu Sans"],
    "font.size": 8.0,
    "axes.titlesize": 8.5,
    "axes.labelsize": 8.0,
    "xtick.labelsize": 7.0,
    "ytick.labelsize": 7.0,
    "legend.fontsize": 7.5,
    "legend.frameon": False,
    "axes.linewidth": 0.7,
    "xtick.major.width": 0.7,
    "ytick.major.width": 0.7,
    "xtick.direction": "out",
    "ytick.direction": "out",
    "axes.spines.top": False,
    "axes.spines.right": False,
    "lines.linewidth": 1.4,
    "hatch.linewidth": 0.5,
    "hatch.color": "#a0a0a0",
    "image.interpolation": "nearest",
    "axes.grid": False,
}


@contextmanager
def canvas(width: float, height: float) -> Iterator[Canvas]:
    """An empty figure in this style, size in inches; it uses no display and leaves global settings alone."""
    with rc_context(_SETTINGS):
        figure = Canvas(figsize=(width, height), dpi=DPI, layout="constrained")
        FigureCanvasAgg(figure)
        yield figure


def save(figure: Canvas, path: str | Path, *, synthetic: bool = False) -> Path:
    """Write the figure as PNG, labelled where its data are synthetic; its bytes repeat from run to run."""
    if synthetic:
        figure.supxlabel(SYNTHETIC, x=0.995, ha="right", fontsize=6.5, color="#8c2d04", style="italic")
    path = Path(path)
    with atomic(path) as temporary:
        figure.savefig(temporary, format="png", dpi=DPI, facecolor="white", metadata={"Software": None})
    return path


def colour_of(name: str, index: int) -> str:
    """Colour of a series: by name for those that recur, else by its place among the series."""
    key = name.removeprefix("Model ").strip()
    return COLOURS.get(key, _MORE[index % len(_MORE)])


def model_name(name: str) -> str:
    """Name of a model as readers know it: one letter alone becomes "Model M"."""
    return f"Model {name}" if len(name) == 1 and name.isalpha() else name


def hatch(axes: Axes, shape: Any = None) -> None:
    """Fill the axes (or one patch) with the no-data pattern, under all else."""
    patch = shape if shape is not None else Rectangle((0, 0), 1, 1, transform=axes.transAxes)
    patch.set(facecolor=NO_DATA, edgecolor="#a0a0a0", linewidth=0.0, hatch="//////", zorder=0)
    axes.add_patch(patch)


def no_data_patch(label: str) -> Patch:
    """The no-data pattern as an entry of a legend."""
    return Patch(facecolor=NO_DATA, edgecolor="#a0a0a0", hatch="//////", linewidth=0.0, label=label)


def letter(index: int) -> str:
    """The label of a panel: (a), (b), ... (z), (aa), ..."""
    text = ""
    index += 1
    while index:
        index, rest = divmod(index - 1, 26)
        text = chr(ord("a") + rest) + text
    return f"({text})"


def number(value: float, digits: int = 4) -> str:
    """A number to so many significant digits, with commas and without an exponent.

    >>> number(12345.0, 3), number(0.25)
    ('12,300', '0.25')
    """
    return f"{float(f'{value:.{digits}g}'):,.12g}"


def numbers_beside(path: str | Path) -> Path | None:
    """The CSV or NPZ that stands beside a picture under the same name, if there is one."""
    for suffix in (".csv", ".npz"):
        candidate = Path(path).with_suffix(suffix)
        if candidate.exists():
            return candidate
    return None


def write_npz(path: str | Path, arrays: Mapping[str, Any]) -> Path:
    """Write named arrays as a compressed NPZ."""
    path = Path(path)
    with atomic(path) as temporary, temporary.open("wb") as f:
        values: dict[str, Any] = {k: np.asarray(v) for k, v in arrays.items()}
        np.savez_compressed(f, **values)
    return path
