"""What is taken off a map before its texture is judged: planes, bows, polynomials, jumps between lines."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np
from numpy.typing import NDArray

from specularia.errors import PhysicsError, SpeculariaError
from specularia.surface.heightmap import HeightMap, level

__all__ = ["METHODS", "flattened", "levelled", "polynomial"]

Array = NDArray[np.float64]

METHODS: Final = ("none", "plane", "polynomial", "robust")

_ROUNDS = 30
_TUKEY = 4.685
"""Tukey's constant: 95 % of the efficiency of least squares for normal noise."""

_BLOCK = 1 << 20
"""Pixels taken at a time, so that large maps need no matrix of their size times the terms."""


def levelled(surface: HeightMap, *, method: str = "plane", order: int | None = None) -> HeightMap:
    """The map minus a form fitted to it; missing pixels stay missing and count for nothing.

    Parameters
    ----------
    surface : any height map.
    method : "none"; "plane", by least squares; "polynomial" of degree `order` in x and y together, by least
        squares; "robust": a polynomial of degree `order` under Tukey's biweight, which pits and dust do not
        draw.
    order : 1 to 12; 2 for a polynomial and 1 for a robust fit unless said.

    References
    ----------
    F-operation of ISO 25178-2:2021 (vertical distances). Biweight: Beaton and Tukey 1974,
    doi:10.1080/00401706.1974.10489171
    """
    if method not in METHODS:
        raise SpeculariaError(f"levelling {method!r} is not known; use one of {', '.join(METHODS)}.")
    if method == "none":
        return surface
    if method == "plane":
        return level(surface)
    order = order if order is not None else (2 if method == "polynomial" else 1)
    fitted = polynomial(surface, order=order, robust=method == "robust")
    words = f"{'robust ' if method == 'robust' else ''}polynomial of degree {order} removed"
    return surface.with_heights(surface.heights_um - fitted, levelled=words)


def polynomial(
    surface: HeightMap, *, order: int, robust: bool = False, terms: Sequence[tuple[int, int]] = ()
) -> Array:
    """Heights of the fitted polynomial at every pixel, [rows, columns].

    Parameters
    ----------
    surface : any height map.
    order : degree in x and y together, 1 to 12.
    robust : Tukey's biweight instead of least squares.
    terms : of the fit, those (degree in x, degree in y) that are returned; all unless named.
    """
    if not 1 <= order <= 12:
        raise SpeculariaError(f"the degree of a polynomial lies between 1 and 12, not at {order}.")
    rows, columns = surface.shape
    pairs = [(i, k) for i in range(order + 1) for k in range(order + 1 - i) if rows > 1 or k == 0]
    if np.count_nonzero(surface.valid) < 3 * len(pairs):
        raise PhysicsError(
            f"{surface.name or 'height map'}: too few measured pixels for a polynomial of degree {order}."
        )
    # Legendre polynomials over the field are nearly independent, which powers are not.
    px = np.polynomial.legendre.legvander(np.linspace(-1, 1, columns), order)
    py = np.polynomial.legendre.legvander(np.linspace(-1, 1, rows) if rows > 1 else np.zeros(1), order)
    z = surface.heights_um
    middle = float(np.nanmedian(z))
    step = max(1, _BLOCK // columns)

    def fit(scale: float, last: Array | None) -> Array:
        normal, right = np.zeros((len(pairs), len(pairs))), np.zeros(len(pairs))
        for first in range(0, rows, step):
            here = z[first : first + step] - middle
            known = np.isfinite(here)
            basis = np.stack([(py[first : first + step, k, None] * px[None, :, i])[known] for i, k in pairs])
            wanted = here[known]
            weighted = basis
            if last is not None:
                r = (wanted - last @ basis) / (_TUKEY * scale)
                weighted = basis * np.where(np.abs(r) < 1, (1 - r * r) ** 2, 0.0)
            normal += weighted @ basis.T
            right += weighted @ wanted
        size = np.sqrt(np.maximum(np.diag(normal), 1e-300))
        scaled = normal / np.outer(size, size)
        if np.linalg.cond(scaled) > 1e12:
            raise PhysicsError(f"{surface.name or 'height map'}: no polynomial of degree {order} fits alone.")
        return np.asarray(np.linalg.solve(scaled, right / size) / size)

    def at(coefficients: Array, wanted: Sequence[tuple[int, int]]) -> Array:
        table = np.zeros((order + 1, order + 1))
        for (i, k), c in zip(pairs, coefficients):
            if (i, k) in wanted:
                table[k, i] = c
        return np.asarray(py @ table @ px.T)

    found = fit(1.0, None)
    if robust:
        for _ in range(_ROUNDS):
            residual = z - middle - at(found, pairs)
            scale = 1.4826 * float(np.nanmedian(np.abs(residual - np.nanmedian(residual))))
            if not scale > 0:
                break
            better = fit(scale, found)
            moved = float(np.abs(better - found).max())
            found = better
            if moved < 1e-4 * scale:
                break
    chosen = list(terms) or pairs
    return at(found, chosen) + (middle if (0, 0) in chosen else 0.0)


def flattened(surface: HeightMap, *, remove: Sequence[str]) -> HeightMap:
    """The map without what the instrument added, each on request; its mean height is kept.

    Parameters
    ----------
    surface : a map.
    remove : any of

        * "tilt": the slopes of the least-squares plane;
        * "bow": the terms of second degree of a least-squares polynomial (a curved reference, a bent pane);
        * "vibration": jumps between lines of the scan. The offset of each row is the sum of the medians of
          the differences between neighbouring rows, minus what of it is smooth over 16 rows, which is taken
          for relief. Streaks along the rows, narrower than that, go with it: the raw map cannot tell the two
          apart.
    """
    if unknown := set(remove) - {"tilt", "bow", "vibration"}:
        raise SpeculariaError(f"cannot remove {', '.join(sorted(unknown))}; use tilt, bow or vibration.")
    out, words = surface, []
    if "vibration" in remove:
        offsets = _row_offsets(out)
        out = out.with_heights(out.heights_um - offsets[:, None])
        words.append(f"vibration (rms {float(np.std(offsets)):.3g} um between rows)")
    if "bow" in remove:
        bow = polynomial(out, order=2, terms=((2, 0), (1, 1), (0, 2)))
        bow -= bow.mean()
        out = out.with_heights(out.heights_um - bow)
        words.append(f"bow ({float(np.ptp(bow)):.3g} um)")
    if "tilt" in remove:
        tilt = polynomial(out, order=1, terms=((1, 0), (0, 1)))
        out = out.with_heights(out.heights_um - tilt)
        words.append(f"tilt ({float(np.ptp(tilt)):.3g} um)")
    return out.with_heights(out.heights_um, removed=", ".join(words)) if words else out


def _row_offsets(surface: HeightMap) -> Array:
    from scipy.ndimage import gaussian_filter1d

    if surface.shape[0] < 8:
        raise PhysicsError(f"{surface.name or 'height map'}: vibration needs at least 8 rows.")
    with np.errstate(invalid="ignore"):
        steps = np.diff(surface.heights_um, axis=0)
    jumps = np.zeros(surface.shape[0] - 1)
    some = np.isfinite(steps).any(axis=1)
    jumps[some] = np.nanmedian(steps[some], axis=1)
    path = np.concatenate(([0.0], np.cumsum(jumps)))
    # A cubic first: a smoother bends it at the borders.
    row = np.arange(path.size)
    rest = path - np.polynomial.Polynomial.fit(row, path, 3)(row)
    return np.asarray(rest - gaussian_filter1d(rest, 4.0, mode="reflect"))
