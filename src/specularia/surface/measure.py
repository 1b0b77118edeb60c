"""From a focus stack to a height map with its uncertainty, and to a picture in focus everywhere."""

from __future__ import annotations

import json
import warnings
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from specularia import progress, provenance
from specularia.errors import PhysicsError, SpeculariaError, SpeculariaWarning
from specularia.surface import confocal, contrast, netcdf
from specularia.surface.form import flattened
from specularia.surface.heightmap import FLAGS, HeightMap
from specularia.surface.partial import Rows
from specularia.surface.stack import Stack, read_stack

__all__ = ["KINDS", "all_in_focus", "heights"]

KINDS: Final = ("auto", "confocal", "contrast")

_TILE_BYTES = 16 << 20
"""Brightness held at a time, as 32-bit floats; the work arrays take some ten times as much."""

_BRIGHTER = 0.9
"""Share of the lively pixels that are brightest in focus, above which a stack is confocal."""

_LAYERS = {"place": "f8", "sigma": "f4", "image": "f4", "reliability": "f4", "flags": "u1"}


def heights(
    stack: Stack | str | Path,
    *,
    pitch_um: float | tuple[float, float] | None = None,
    step_um: float | None = None,
    first_row: str | None = None,
    kind: str = "auto",
    remove: Sequence[str] = (),
    max_slope_deg: float | None = None,
    window_px: float = 3.0,
    output: str | Path | None = None,
) -> HeightMap:
    """Height map of a focus stack, with sigma, picture in focus, reliability and flags of each pixel.

    Confocal stacks: the fit is that of `specularia.surface.focus.fit`; its standard uncertainty follows from
    the noise of the stack itself (a line of variance against brightness) and is widened where a pixel does
    not fit the model. Photographs: see `specularia.surface.contrast`; their uncertainty is the scatter of the
    heights.

    Parameters
    ----------
    stack : a stack, or the path of one (see `read_stack`).
    pitch_um, step_um, first_row : override or complete what the file says; only with a path.
    kind : "confocal", "contrast" (photographs), or "auto": contrast where pixels are darkest in focus
        about as often as brightest.
    remove : of "tilt", "bow" and "vibration"; see `specularia.surface.flattened`. Vibration is
        also looked for between the slices of a confocal stack: each is moved to where the fits of all
        pixels see it.
    max_slope_deg : slope from which a pixel is flagged as steep, such as the half aperture of the objective.
        Without it: where height changes by more than half the width of the response from pixel to pixel.
    window_px : photographs: standard deviation of the window of sharpness in pixels, > 0.
    output : netCDF file to write. Unfinished work is then kept beside it, and taken up again by the next call
        with the same stack and settings.

    Returns
    -------
    HeightMap : z0 + step * place of the peak, NaN (never filled) where the pixel is

        * saturated: a sample at full scale (photographs: in its sharpest frame);
        * dark: the peak is lost in the noise, or (photographs) there is no detail to judge by;
        * edge: nearer than half a FWHM to the first or last slice (photographs: sharpest there);
        * double: a second peak of at least 0.25 (photographs: 0.7) of its height, or one so broad that it
          must hold two, or the fit left the place where it started.

        Pixels that are flagged as steep keep their height. Counts stand in the attribute `missing_because` as
        JSON, each pixel under the first of its faults, and all flags in `flagged`.
    """
    _wanted(kind, remove, max_slope_deg, window_px)
    if not isinstance(stack, Stack):
        stack = read_stack(stack, pitch_um=pitch_um, step_um=step_um, first_row=first_row)
    if kind == "auto":
        kind = "contrast" if _photographs(stack) else "confocal"
    rows, columns = stack.shape
    said: dict[str, Any] = {
        "pitch_um": stack.pitch_um,
        "step_um": stack.step_um,
        "z0_um": stack.z0_um,
        "kind": kind,
        "remove": list(remove),
    }
    if kind == "confocal":
        pilot = confocal.learn(stack, vibration="vibration" in remove)
        said |= pilot.parameters(stack.step_um)
        limit = 0.5 * pilot.fwhm
    else:
        said |= {"estimator": "Gaussian through the sharpness (modified Laplacian)", "window_px": window_px}
        limit = np.inf
    unfinished = Rows(
        (rows, columns),
        _LAYERS,
        output=None if output is None else Path(output),
        what={**said, "source": _print_of(stack), "versions": provenance.versions()},
    )
    done: Callable[[int, int], Mapping[str, NDArray[Any]]]
    if kind == "confocal":

        def done(first: int, last: int) -> Mapping[str, NDArray[Any]]:
            found = confocal.rows_of(stack.rows(first, last).reshape(stack.slices, -1), pilot)
            stack.release()
            return {name: layer.reshape(last - first, columns) for name, layer in found.items()}

    elif unfinished.missing(0, rows):
        focused = contrast.measure(stack, window=window_px)
        said["magnification"] = [1.0 + p.a for p in focused.places]
        said["shift_px"] = [[p.dx, p.dy] for p in focused.places]

        def done(first: int, last: int) -> Mapping[str, NDArray[Any]]:
            return contrast.rows_of(focused, first, last)

    _fill(unfinished, done, stack) if unfinished.missing(0, rows) else None
    place, flags = unfinished.take("place"), unfinished.take("flags")
    sigma = unfinished.take("sigma") if kind == "confocal" else contrast.scatter(place, window_px)
    flags |= np.where(_steep(place, stack, limit, max_slope_deg), np.uint8(FLAGS["steep"]), np.uint8(0))
    counts = _counts(flags, ~np.isfinite(place))
    missing = sum(counts.values())
    # Noise alone passes for detail in a few places of photographs.
    if missing == rows * columns or (kind == "contrast" and missing > 0.95 * rows * columns):
        raise PhysicsError(
            f"{stack.name}: hardly a pixel has a height ({_sentence(counts)}). Is this a focus stack?"
        )
    if missing:
        warnings.warn(
            f"{stack.name}: {missing} of {rows * columns} pixels have no height ({_sentence(counts)}).",
            SpeculariaWarning,
            stacklevel=2,
        )
    attributes = provenance.record(
        what=f"height map from the focus stack {stack.name}",
        inputs=[stack.source] if stack.source is not None else [],
        parameters=said,
        synthetic="synthetic" in stack.attributes,
    )
    attributes.update(stack.attributes)
    attributes["step_um"] = repr(stack.step_um)
    attributes["missing_because"] = json.dumps(counts)
    attributes["flagged"] = json.dumps({n: int(np.count_nonzero(flags & bit)) for n, bit in FLAGS.items()})
    made = HeightMap(
        stack.z0_um + stack.step_um * place,
        *stack.pitch_um,
        sigma_um=abs(stack.step_um) * sigma,
        image=unfinished.take("image"),
        reliability=unfinished.take("reliability"),
        flags=flags,
        name=stack.name,
        attributes=attributes,
    )
    if remove:
        made = replace(flattened(made, remove=remove), name=stack.name)
    if output is not None:
        netcdf.write(made, output)
        unfinished.remove()
    return made


def all_in_focus(
    stack: Stack | str | Path, *, window_px: float = 3.0, register: bool = True
) -> tuple[NDArray[np.float32], str]:
    """One picture in focus everywhere from photographs through focus, with the colours of the frames.

    Parameters
    ----------
    stack : a stack, or the path of one; neither pixel size nor step is needed.
    window_px : standard deviation of the window of sharpness in pixels, > 0.
    register : False for frames that lie over each other as they are.

    Returns
    -------
    picture : [row, column] or [row, column, colour], brightness as in the frames, laid over the middle one.
        Row 0 is that of the frames.
    kind : type of number of the frames, such as "uint8".
    """
    _wanted("contrast", (), None, window_px)
    if not isinstance(stack, Stack):
        stack = read_stack(stack, pitch_um=1.0, step_um=1.0, first_row="bottom")
    made = contrast.picture(contrast.measure(stack, window=window_px, register=register))
    return made, str(stack.frames.dtype)


def _wanted(kind: str, remove: Sequence[str], max_slope_deg: float | None, window_px: float) -> None:
    if kind not in KINDS:
        raise SpeculariaError(f"kind {kind!r} is not known; use one of {', '.join(KINDS)}.")
    if unknown := set(remove) - {"tilt", "bow", "vibration"}:
        raise SpeculariaError(f"cannot remove {', '.join(sorted(unknown))}; use tilt, bow or vibration.")
    if max_slope_deg is not None and not 0.0 < max_slope_deg < 90.0:
        raise SpeculariaError(f"the steepest slope lies between 0 and 90 degrees, not at {max_slope_deg}.")
    if not 0.5 <= window_px <= 100.0:
        raise SpeculariaError(f"the window of sharpness has 0.5 to 100 pixels, not {window_px}.")


def _fill(unfinished: Rows, done: Callable[[int, int], Mapping[str, NDArray[Any]]], stack: Stack) -> None:
    rows, columns = stack.shape
    tile = max(1, _TILE_BYTES // (4 * stack.slices * columns))
    with progress.task(f"heights of {stack.name}", rows) as bar:
        if unfinished.done.any():
            progress.note(f"{stack.name}: {int(unfinished.done.sum())} of {rows} rows were done before.")
        for first in range(0, rows, tile):
            last = min(first + tile, rows)
            if unfinished.missing(first, last):
                unfinished.put(first, last, done(first, last))
            bar.advance(last - first)


def _photographs(stack: Stack) -> bool:
    """Whether focus brings detail, not brightness.

    A confocal pixel stands out above its lower quartile at its one peak. In photographs as many pixels are
    darker in focus as are brighter.
    """
    rows, columns = stack.shape
    chosen = np.unique(np.linspace(0, rows - 1, min(rows, 64)).round().astype(int))
    step = max(1, columns // 1024)
    part = stack.sample(chosen, step=step)
    low = np.quantile(part, 0.25, axis=0, method="nearest")
    up, down = part.max(axis=0) - low, low - part.min(axis=0)
    lively = up + down >= np.quantile(up + down, 0.75)
    return float(np.mean(up[lively] > down[lively])) < _BRIGHTER


def _print_of(stack: Stack) -> object:
    """What tells one stack from another without reading it whole."""
    if stack.source is None:
        # In memory: a stack that another program hands in anew each time.
        probe = np.ascontiguousarray(
            stack.frames[:, :: max(1, stack.shape[0] // 64), :: max(1, stack.shape[1] // 64)]
        )
        return provenance.digest([list(probe.shape), probe.astype(float).sum(axis=(1, 2)).tolist()])
    path = stack.source
    files = sorted(path.iterdir()) if path.is_dir() else [path]
    return [[f.name, f.stat().st_size, f.stat().st_mtime_ns] for f in files]


def _steep(
    place: NDArray[np.float64], stack: Stack, limit: float, max_slope_deg: float | None
) -> NDArray[np.bool_]:
    """Pixels whose own extent spans much of the response: those beside a step, flat on one side, do not."""
    found = np.zeros(place.shape, bool)
    for axis, pitch in ((1, stack.pitch_um[0]), (0, stack.pitch_um[1])):
        if place.shape[axis] < 3:
            continue
        most = limit
        if max_slope_deg is not None:
            most = np.tan(np.radians(max_slope_deg)) * pitch / abs(stack.step_um)
        change = np.abs(np.diff(place, axis=axis))
        both = np.minimum(
            np.take(change, range(1, change.shape[axis]), axis),
            np.take(change, range(change.shape[axis] - 1), axis),
        )
        inner = (slice(None), slice(1, -1)) if axis == 1 else (slice(1, -1), slice(None))
        with np.errstate(invalid="ignore"):
            found[inner] |= both > most
    return found


def _counts(flags: NDArray[np.uint8], missing: NDArray[np.bool_]) -> dict[str, int]:
    """Missing pixels by the first of their faults."""
    counts, left = {}, missing.copy()
    for name, bit in FLAGS.items():
        if name == "steep":
            continue
        here = left & (flags & bit > 0)
        counts[name] = int(np.count_nonzero(here))
        left &= ~here
    return counts


def _sentence(counts: dict[str, int]) -> str:
    return ", ".join(f"{n} {reason}" for reason, n in counts.items() if n)
