"""The printed sheet and the outline of the glass, as arrays on the table."""

from __future__ import annotations

from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from specularia.daylight.fragment_job import Sample, Sheet
from specularia.errors import FormatError
from specularia.files import existing

__all__ = ["EXAMPLE", "glass", "outline_box", "printed"]

Array = NDArray[np.float64]

EXAMPLE = (
    (-34.0, -17.5), (-22.0, -23.0), (-4.0, -25.5), (14.0, -24.0), (27.0, -20.0), (35.0, -14.0),
    (33.0, -1.0), (31.5, 11.0), (22.0, 19.0), (9.0, 23.5), (-6.0, 25.0), (-20.0, 22.5), (-30.5, 16.0),
)  # fmt: skip
"""Outline of an invented piece, about 70 x 50 mm, with one straight short edge."""

_TEXT = "Vitrum in fenestra lucem admittit, ventum arcet. Quae scripta sunt, per vitrum leguntur. "
"""A line of print; ours."""

_FINER = 4
"""Parts of a pixel each way in which print and outline are drawn before they are averaged."""


def outline_box(sample: Sample) -> tuple[float, float, float, float]:
    """(left, bottom, right, top) of the glass in mm; a mask is centred."""
    if sample.mask is not None:
        mask = _grey(str(sample.mask))
        width = float(sample.mask_width_mm or 0.0)
        height = width * mask.shape[0] / mask.shape[1]
        return -width / 2, -height / 2, width / 2, height / 2
    x, y = np.array(sample.outline_mm or EXAMPLE).T
    return float(x.min()), float(y.min()), float(x.max()), float(y.max())


def glass(sample: Sample, x: Array, y: Array) -> Array:
    """[len(y), len(x)] share of each pixel that glass covers; x and y are the middles of pixels in mm."""
    fx, fy = _finer(x), _finer(y)
    if sample.mask is not None:
        left, bottom, right, top = outline_box(sample)
        mask = _grey(str(sample.mask)) > 0.5
        column = np.floor((fx - left) / (right - left) * mask.shape[1]).astype(int)
        row = np.floor((top - fy) / (top - bottom) * mask.shape[0]).astype(int)
        inside = ((column >= 0) & (column < mask.shape[1]))[None, :] & ((row >= 0) & (row < mask.shape[0]))[
            :, None
        ]
        value = mask[
            np.clip(row, 0, mask.shape[0] - 1)[:, None], np.clip(column, 0, mask.shape[1] - 1)[None, :]
        ]
        cover = _coarser(np.where(inside, value, False).astype(float))
    else:
        from PIL import Image, ImageDraw

        px, py = np.array(sample.outline_mm or EXAMPLE).T
        corners = zip((px - fx[0]) / (fx[1] - fx[0]), (py - fy[0]) / (fy[1] - fy[0]))
        drawn = Image.new("L", (fx.size, fy.size), 0)
        ImageDraw.Draw(drawn).polygon([(float(a), float(b)) for a, b in corners], fill=1)
        cover = _coarser(np.asarray(drawn, float))
    if not cover.any():
        raise ValueError("the outline covers no pixel")
    return cover


def printed(sheet: Sheet, x: Array, y: Array) -> Array:
    """[len(y), len(x)] reflectance of the sheet, means over pixels; it covers the whole table."""
    if sheet.pattern == "bars":
        phase = np.mod(_finer(x) / (2.0 * sheet.stroke_mm), 1.0)
        row = (phase < 0.5).astype(float).reshape(x.size, _FINER).mean(axis=1)
        bright = np.broadcast_to(row, (y.size, x.size))
    elif sheet.pattern == "image":
        picture = _linear(_grey(str(sheet.image)))
        width = float(sheet.image_width_mm or 0.0)
        height = width * picture.shape[0] / picture.shape[1]
        column = np.floor(np.mod(_finer(x) / width + 0.5, 1.0) * picture.shape[1]).astype(int)
        row_of = np.floor(np.mod(0.5 - _finer(y) / height, 1.0) * picture.shape[0]).astype(int)
        bright = _coarser(
            picture[
                np.minimum(row_of, picture.shape[0] - 1)[:, None],
                np.minimum(column, picture.shape[1] - 1)[None, :],
            ]
        )
    else:
        bright = _text(sheet, x, y)
    return sheet.ink + (sheet.paper - sheet.ink) * bright


def _finer(a: Array) -> Array:
    step = a[1] - a[0]
    return (a[:, None] + (((np.arange(_FINER) + 0.5) / _FINER) - 0.5)[None, :] * step).ravel()


def _coarser(fine: Array) -> Array:
    rows, columns = fine.shape
    return fine.reshape(rows // _FINER, _FINER, columns // _FINER, _FINER).mean(axis=(1, 3))


def _text(sheet: Sheet, x: Array, y: Array) -> Array:
    """Lines of print in DejaVu Serif, set solid from the left, as brightness 0 to 1."""
    from matplotlib import font_manager
    from PIL import Image, ImageDraw, ImageFont

    step = (x[1] - x[0]) / _FINER
    columns, rows = x.size * _FINER, y.size * _FINER
    file = font_manager.findfont("DejaVu Serif", fallback_to_default=False)
    trial = ImageFont.truetype(file, 1000)
    box = trial.getbbox("x")
    size = max(round(1000 * sheet.x_height_mm / step / (box[3] - box[1])), 4)
    font = ImageFont.truetype(file, size)
    text = sheet.text.rstrip("\n") if sheet.text is not None else _TEXT
    lines = text.split("\n")
    picture = Image.new("L", (columns, rows), 255)
    draw = ImageDraw.Draw(picture)
    pitch = 1.35 * size
    if len(lines) == 1:
        # One line fills the sheet, each row going on where the last one ended.
        words, at = text.split(), 0
        lines = []
        for _ in range(int(rows / pitch) + 1):
            row = ""
            while draw.textlength(row, font=font) < columns:
                row += words[at % len(words)] + " "
                at += 1
            lines.append(row)
    for k in range(int(rows / pitch) + 1):
        draw.text((0.0, k * pitch), lines[k % len(lines)], font=font, fill=0)
    # Pictures start at the top, tables at the bottom.
    return _coarser(np.asarray(picture, float)[::-1] / 255.0)


@cache
def _grey(path: str) -> Array:
    """[rows, columns] grey values 0 to 1 of a picture, row 0 at the top."""
    import imageio.v3 as iio

    file = existing(Path(path), what="a picture")
    try:
        raw: Any = np.asarray(iio.imread(file))
    except Exception as error:
        raise FormatError(file=file, expected="a picture (PNG, JPEG, TIFF)", found=str(error)) from error
    if raw.dtype.kind == "u":
        top = float(np.iinfo(raw.dtype).max)
    elif raw.dtype.kind == "b":
        top = 1.0
    else:
        raise FormatError(file=file, expected="a picture with whole numbers", found=str(raw.dtype))
    values = raw.astype(float) / top
    if values.ndim == 3:
        values = values[..., :3].mean(axis=2) if values.shape[2] >= 3 else values[..., 0]
    if values.ndim != 2 or min(values.shape) < 2:
        raise FormatError(file=file, expected="a picture of rows and columns", found=f"shape {raw.shape}")
    return np.asarray(values, float)


def _linear(v: Array) -> Array:
    """sRGB to linear (IEC 61966-2-1)."""
    return np.where(v <= 0.04045, v / 12.92, ((v + 0.055) / 1.055) ** 2.4)
