"""The shaded relief of a surface in perspective view (the paper's Fig. 5c)."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import matplotlib as mpl
import numpy as np
from numpy.typing import NDArray

from specularia.report import style

if TYPE_CHECKING:
    from specularia.surface import HeightMap

__all__ = ["relief"]

Array = NDArray[np.float64]

_TURN, _ELEVATION = np.radians(-32.0), np.radians(38.0)
_SIDE = 700
"""Pixels of the longer side of the map that are drawn at most."""

_POINTS = 4_000_000

_WIDE = 1500
"""Width of the picture in pixels."""

_CLAY = np.array([0.80, 0.77, 0.72])
_SHARE = 0.16
"""Height of the relief over the side of the field that a drawing without a stated exaggeration has."""


def relief(
    surface: HeightMap,
    path: str | Path,
    *,
    exaggeration: float | None = None,
    coloured: bool = False,
    synthetic: bool = False,
) -> Path:
    """Draw a height map as an opaque, lit relief: parallel projection from the front and above.

    Parameters
    ----------
    surface : a map, no profile; levelled ones show their texture. Missing pixels are cut out.
    path : PNG to write; an NPZ of the same name gets `heights_um` (row 0 at the lowest y, missing NaN, as
        drawn, which may be means of blocks), `pitch_x_um`, `pitch_y_um` and `exaggeration`.
    exaggeration : of the heights against the field, > 0; without one, such that the relief (from its 0.1 % to
        its 99.9 % quantile) is as high as 16 % of the field's shorter side.
    coloured : True colours by height; False draws clay.
    synthetic : True labels the figure.

    Returns
    -------
    path of the PNG.
    """
    step = -(-max(surface.shape) // _SIDE)
    heights, dx, dy = _means(surface.heights_um, step), step * surface.pitch_x_um, step * surface.pitch_y_um
    low, high = np.nanquantile(heights, [0.001, 0.999])
    width, depth = heights.shape[1] * dx, heights.shape[0] * dy
    if exaggeration is None:
        exaggeration = _round(_SHARE * min(width, depth) / max(float(high - low), 1e-12))
    picture, corners, size = _drawn(heights, dx, dy, exaggeration, coloured, (float(low), float(high)))
    with style.canvas(6.0, 6.0 * picture.shape[0] / picture.shape[1] + 0.45) as figure:
        axes = figure.subplots()
        axes.imshow(picture, interpolation="antialiased")
        axes.set_axis_off()
        for (a, b), length in zip(corners, (width, depth)):
            middle, along = (a + b) / 2, b - a
            normal = np.array([-along[1], along[0]]) / np.hypot(*along)
            normal *= np.sign(normal[1]) * 0.028 * size
            turn = np.degrees(np.arctan2(-along[1], along[0]))
            turn = (turn + 90.0) % 180.0 - 90.0
            axes.text(
                float(middle[0] + normal[0]),
                float(middle[1] + normal[1]),
                f"{length:.4g} µm",
                ha="center",
                va="center",
                rotation=turn,
                fontsize=7.5,
            )
        words = f"heights × {exaggeration:.3g}, range {float(high - low):.3g} µm"
        axes.text(0.0, 1.0, words, transform=axes.transAxes, ha="left", va="top", fontsize=7.5)
        if coloured:
            norm = mpl.colors.Normalize(0.0, float(high - low))
            bar = figure.colorbar(mpl.cm.ScalarMappable(norm, "cividis"), ax=axes, shrink=0.55, pad=0.01)
            bar.set_label("height above lowest point (µm)")
        numbers = {"heights_um": heights.astype(np.float32), "pitch_x_um": dx, "pitch_y_um": dy}
        style.write_npz(Path(path).with_suffix(".npz"), {**numbers, "exaggeration": exaggeration})
        return style.save(figure, path, synthetic=synthetic)


def _round(value: float) -> float:
    """The nearest of 1, 2, 5, 10 ... below, at least 1: heights are never flattened."""
    power = 10.0 ** np.floor(np.log10(max(value, 1e-9)))
    return float(max(1.0, max(m * power for m in (1.0, 2.0, 5.0) if m * power <= value * (1 + 1e-9))))


def _means(image: Array, step: int) -> Array:
    if step == 1:
        return image
    rows, columns = (n // step * step for n in image.shape)
    blocks = image[:rows, :columns].reshape(rows // step, step, columns // step, step)
    count = np.isfinite(blocks).sum(axis=(1, 3))
    return np.where(2 * count > step * step, np.nansum(blocks, axis=(1, 3)) / np.maximum(count, 1), np.nan)


def _lit(
    z: NDArray[np.float32], dx: float, dy: float, coloured: bool, span: float
) -> tuple[NDArray[np.float32], float]:
    """Colour of each pixel under a lamp from the left, [row, column, 3], and how far steep ones stretch."""
    from scipy.ndimage import gaussian_filter

    gy, gx = np.gradient(z, dy, axis=0), np.gradient(z, dx, axis=1)
    norm = np.sqrt(gx * gx + gy * gy + 1.0)
    lamp = np.array([-0.75, 0.25, 0.62])
    lamp /= np.sqrt(np.sum(lamp * lamp))
    lit = np.clip((lamp[2] - lamp[0] * gx - lamp[1] * gy) / norm, 0.0, None)
    # Hollows see less of the sky.
    above = z - gaussian_filter(z, 0.012 * max(z.shape))
    hollow = np.clip(above / (3.0 * float(np.std(above)) + 1e-12), -1.0, 1.0)
    shade = np.clip(0.22 + 0.85 * lit + 0.14 * hollow, 0.03, 1.15)
    base = mpl.colormaps["cividis"](np.clip(z / span, 0, 1))[..., :3] if coloured else _CLAY
    stretched = float(np.clip(np.quantile(norm, 0.98) / 1.3, 1.0, 2.2))
    return np.clip(base * shade[..., None], 0, 1).astype(np.float32), stretched


def _drawn(
    heights: Array, dx: float, dy: float, exaggeration: float, coloured: bool, span: tuple[float, float]
) -> tuple[NDArray[np.uint8], list[tuple[Array, Array]], float]:
    """The picture, the two lower front edges in its pixels, and its size.

    Points denser than the picture's pixels are laid down from the farthest to the nearest.
    """
    from scipy.ndimage import binary_closing, distance_transform_edt, zoom

    low, high = span
    z = (heights - low) * exaggeration
    floor = -0.06 * min(dx * heights.shape[1], dy * heights.shape[0])
    cos, sin = np.cos(_TURN), np.sin(_TURN)
    up, back = np.cos(_ELEVATION), np.sin(_ELEVATION)
    rows, columns = heights.shape
    width, depth = (columns - 1) * dx, (rows - 1) * dy
    extent = abs(width * cos) + abs(depth * sin)
    scale = 0.96 * _WIDE / extent

    known = np.isfinite(z)
    solid = np.where(known, z, np.nanmedian(z)).astype(np.float32)
    tints, steep = _lit(solid, dx, dy, coloured, exaggeration * max(high - low, 1e-30))
    # Denser than the picture's pixels, and more where steep flanks stretch.
    fine = np.clip(1.5 * scale * steep * np.array([dy, dx]), 1.0, 10.0)
    fine *= min(1.0, np.sqrt(_POINTS / (solid.size * fine[0] * fine[1])))
    surface_z = zoom(solid, fine, order=1, mode="nearest")
    colour = np.stack([zoom(tints[..., c], fine, order=1, mode="nearest") for c in range(3)], axis=-1)
    there = zoom(known.astype(np.float32), fine, order=0, mode="nearest") > 0.5
    y, x = np.meshgrid(
        np.linspace(0, depth, surface_z.shape[0]), np.linspace(0, width, surface_z.shape[1]), indexing="ij"
    )
    points = [(x[there], y[there], surface_z[there], colour[there])]
    # The two walls that face the viewer, down to a floor.
    for side, grey in ((0, 0.42), (1, 0.62)):
        edge = surface_z[0] if side == 0 else surface_z[:, -1]
        along = x[0] if side == 0 else y[:, 0]
        levels = np.linspace(0.0, 1.0, int(np.ceil(1.6 * scale * up * (float(edge.max()) - floor))) + 2)
        h = floor + levels[:, None] * (edge - floor)
        a = np.broadcast_to(along, h.shape)
        other = np.full_like(h, 0.0 if side == 0 else width)
        tint = np.broadcast_to(grey * _CLAY, (*h.shape, 3)).reshape(-1, 3)
        points.append(
            ((a if side == 0 else other).ravel(), (other if side == 0 else a).ravel(), h.ravel(), tint)
        )
    xs, ys, zs = (np.concatenate([p[k] for p in points]) for k in range(3))
    colours = np.concatenate([p[3] for p in points])

    def seen(x: Array, y: Array, z: Array) -> tuple[Array, Array, Array]:
        across, away = x * cos - y * sin, x * sin + y * cos
        return scale * across, -scale * (away * back + z * up), away * up - z * back

    u, v, far = seen(xs, ys, zs)
    u0, v0 = float(u.min()) - 0.02 * _WIDE, float(v.min()) - 0.035 * _WIDE
    shape = (int(v.max() - v0 + 0.05 * _WIDE), int(u.max() - u0 + 0.02 * _WIDE))
    order = np.argsort(-far, kind="stable")
    picture = np.full((*shape, 3), 255, np.uint8)
    drawn = np.zeros(shape, bool)
    drawn[(v - v0).astype(int), (u - u0).astype(int)] = True
    picture[(v[order] - v0).astype(int), (u[order] - u0).astype(int)] = (255 * colours[order]).astype(
        np.uint8
    )
    # Single pixels that no point has met, on steep flanks, take the colour of the nearest.
    holes = binary_closing(np.pad(drawn, 4), iterations=3)[4:-4, 4:-4] & ~drawn
    nearest = distance_transform_edt(~drawn, return_distances=False, return_indices=True)
    picture[holes] = picture[nearest[0][holes], nearest[1][holes]]

    def corner(x: float, y: float) -> Array:
        a, b, _ = seen(np.array(x), np.array(y), np.array(floor))
        return np.array([float(a) - u0, float(b) - v0])

    edges = [(corner(0, 0), corner(width, 0)), (corner(width, 0), corner(width, depth))]
    return picture, edges, float(_WIDE)
