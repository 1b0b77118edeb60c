"""Focus stacks: brightness [slice, row, column] with the pixel size and the step between slices."""

from __future__ import annotations

import json
import logging
import mmap
import re
import tempfile
import warnings
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from specularia.errors import FormatError, SpeculariaWarning
from specularia.files import existing
from specularia.surface.origin import UNITS, unit_in

__all__ = ["Stack", "read_stack", "release"]

_PICTURES = (".tif", ".tiff", ".png", ".jpg", ".jpeg", ".bmp")


@dataclass(frozen=True)
class Stack:
    """A focus stack; the frames may lie on disk.

    Parameters
    ----------
    frames : [slices, rows, columns] or [slices, rows, columns, colours], row 0 at the lowest y.
    pitch_um : pixel size (x, y).
    step_um : height of each slice above the one before, out of the glass; negative for a stack taken
        downwards.
    z0_um : height of the first slice.
    name : for messages.
    attributes : what the file says about itself; "synthetic" is passed on.
    source : the file or folder it was read from.
    """

    frames: NDArray[Any]
    pitch_um: tuple[float, float]
    step_um: float
    z0_um: float = 0.0
    name: str = "stack"
    attributes: Mapping[str, str] = field(default_factory=dict)
    source: Path | None = None

    @property
    def slices(self) -> int:
        """Number of slices."""
        return int(self.frames.shape[0])

    @property
    def shape(self) -> tuple[int, int]:
        """(rows, columns)."""
        return int(self.frames.shape[1]), int(self.frames.shape[2])

    def rows(self, first: int, last: int) -> NDArray[np.float32]:
        """Brightness of rows first..last-1, [slice, row, column]; colours are averaged."""
        part = np.asarray(self.frames[:, first:last])
        if part.ndim == 4:
            return part.mean(axis=3, dtype=np.float32)
        return part.astype(np.float32)

    def sample(self, rows: NDArray[np.int64], *, step: int = 1) -> NDArray[np.float32]:
        """Brightness [slice, pixel] of single rows, every `step`-th column, read one after the other."""
        parts = []
        for row in rows:
            parts.append(self.rows(int(row), int(row) + 1)[:, 0, ::step])
            # A row touches pages in every slice, and the system maps their neighbours with them.
            self.release()
        return np.concatenate(parts, axis=1)

    def frame(self, k: int) -> NDArray[np.float32]:
        """Brightness of slice k, [row, column]; colours are averaged."""
        frame = np.asarray(self.frames[k])
        return frame.mean(axis=2, dtype=np.float32) if frame.ndim == 3 else frame.astype(np.float32)

    def release(self) -> None:
        """Give back the memory of frames that lie on disk; they are read again when they are asked for."""
        release(self.frames)


def release(frames: NDArray[Any]) -> None:
    """Give back the memory of an array that is mapped from a file; its numbers stay in the file."""
    mapped = getattr(frames, "_mmap", None)
    # Changes to a private copy would be lost.
    if isinstance(mapped, mmap.mmap) and getattr(frames, "mode", "c") != "c" and hasattr(mapped, "madvise"):
        mapped.madvise(mmap.MADV_DONTNEED)


def read_stack(
    path: str | Path,
    *,
    pitch_um: float | tuple[float, float] | None = None,
    step_um: float | None = None,
    first_row: str | None = None,
) -> Stack:
    """Read a focus stack: a multi-page TIFF, an OME-TIFF, an .npy [slice, row, column], a folder of pictures.

    Parameters
    ----------
    path : the file, or a folder whose pictures are taken in the order of the numbers in their names.
    pitch_um, step_um : override what the file says, or stand in where it says nothing.
    first_row : "bottom" where row 0 of a picture is the lowest y, "top" where it is the highest. Stacks of
        this program and .npy are "bottom"; for others "bottom" is assumed, with a warning, since a stack
        read upside down gives the mirror image of the surface.

    Raises
    ------
    FormatError : no stack, fewer than 5 slices, a damaged file, no pixel size or no step.
    """
    path = existing(path, what="a focus stack")
    if first_row not in (None, "bottom", "top"):
        raise ValueError(f"first_row is 'bottom' or 'top', not {first_row!r}")
    ours = False
    said: dict[str, Any] = {}
    if path.is_dir():
        frames = _folder(path)
    elif path.suffix.lower() == ".npy":
        frames, ours = _npy(path), True
    elif path.suffix.lower() in (".tif", ".tiff", ".btf"):
        frames, said = _tiff(path)
        ours = "pitch_um" in said and "z0_um" in said
    else:
        raise FormatError(
            file=path,
            expected="a focus stack: .tif, .ome.tif, .npy or a folder of pictures",
            found=path.suffix or "no suffix",
        )
    colours = frames.ndim == 4 and frames.shape[3] in (3, 4)
    if frames.ndim != 3 and not colours:
        raise FormatError(
            file=path,
            expected="frames [slice, row, column] of one channel and one time",
            found=f"an array of shape {frames.shape}",
            advice="Export each channel or time as a stack of its own." if frames.ndim > 3 else "",
        )
    if colours:
        frames = frames[..., :3]
    if frames.shape[0] < 5:
        raise FormatError(file=path, expected="at least 5 slices", found=f"{frames.shape[0]}")
    if frames.dtype.kind not in "uif":
        raise FormatError(file=path, expected="real brightness", found=f"values of type {frames.dtype}")
    pitch = pitch_um if pitch_um is not None else said.get("pitch_um")
    step = step_um if step_um is not None else said.get("step_um")
    if pitch is None or not np.all(np.asarray(pitch, float) > 0):
        raise FormatError(
            file=path,
            expected="a pixel size",
            found=str(pitch or "none"),
            advice="State it with --pitch, in um.",
        )
    if step is None or float(step) == 0 or not np.isfinite(float(step)):
        raise FormatError(
            file=path,
            expected="a step between slices",
            found=str(step or "none"),
            advice="State it with --step, in um; negative where the stack was taken downwards.",
        )
    if first_row is None and not ours:
        warnings.warn(
            f"{path.name}: does not say which way up its pictures are; the first row is taken for "
            f"the lowest y. "
            "If it is the top, state --first-row top: otherwise the map is a mirror image.",
            SpeculariaWarning,
            stacklevel=2,
        )
    pair = np.broadcast_to(np.asarray(pitch, float), 2)
    return Stack(
        frames=frames[:, ::-1] if first_row == "top" else frames,
        pitch_um=(float(pair[0]), float(pair[1])),
        step_um=float(step),
        z0_um=float(said.get("z0_um", 0.0)),
        name=path.stem,
        attributes={"synthetic": str(said["synthetic"])} if said.get("synthetic") else {},
        source=path,
    )


def _npy(path: Path) -> NDArray[Any]:
    try:
        return np.load(path, mmap_mode="r", allow_pickle=False)
    except (ValueError, OSError, EOFError) as error:
        raise FormatError(
            file=path,
            expected="a whole .npy file",
            found=f"one that cannot be read ({error})",
            advice="It may be truncated: make it again or copy it again.",
        ) from error


def _folder(path: Path) -> NDArray[Any]:
    """Pictures of a folder, decoded one by one into a temporary file on disk."""
    import imageio.v3 as imageio

    def place(p: Path) -> list[Any]:
        return [(0, int(w), "") if w.isdigit() else (1, 0, w) for w in re.split(r"(\d+)", p.name)]

    files = sorted((p for p in path.iterdir() if p.suffix.lower() in _PICTURES), key=place)
    if not files:
        raise FormatError(
            file=path, expected=f"pictures ({', '.join(_PICTURES)})", found="none in this folder"
        )
    files = _series(path, files)
    frames: NDArray[Any] | None = None
    for k, file in enumerate(files):
        try:
            picture = np.asarray(imageio.imread(file))
        except (OSError, ValueError, SyntaxError) as error:
            raise FormatError(
                file=file, expected="a whole picture", found=f"one that cannot be read ({error})"
            ) from error
        if frames is None:
            with tempfile.TemporaryFile() as store:
                frames = np.memmap(store, dtype=picture.dtype, mode="w+", shape=(len(files), *picture.shape))
        if picture.shape != frames.shape[1:] or picture.dtype != frames.dtype:
            raise FormatError(
                file=file,
                expected=f"{frames.shape[1:]} {frames.dtype} as in {files[0].name}",
                found=f"{picture.shape} {picture.dtype}",
            )
        frames[k] = picture
        release(frames)
    assert frames is not None
    return frames


def _series(folder: Path, files: list[Path]) -> list[Path]:
    """The pictures whose names differ by their numbers alone, where others lie beside them."""
    groups: dict[str, list[Path]] = {}
    for file in files:
        groups.setdefault(re.sub(r"\d+", "#", file.name), []).append(file)
    largest = max(groups.values(), key=len)
    if len(groups) == 1 or len(largest) < 5:
        return files
    others = [f.name for group in groups.values() if group is not largest for f in group]
    if len(others) >= len(largest):
        raise FormatError(
            file=folder,
            expected="the pictures of one stack",
            found=f"several series: {', '.join(sorted(groups))}",
            advice="Put each into a folder of its own.",
        )
    warnings.warn(
        f"{folder.name}: {', '.join(others[:3])}{' and others' if len(others) > 3 else ''} left out: not of "
        f"the series from {largest[0].name} to {largest[-1].name}.",
        SpeculariaWarning,
        stacklevel=4,
    )
    return largest


@contextmanager
def _complaints() -> Iterator[list[str]]:
    """What tifffile logs: it goes on after a broken chain of pages and only says so there."""
    said: list[str] = []

    class Listen(logging.Handler):
        def emit(self, record: logging.LogRecord) -> None:
            said.append(record.getMessage())

    logger, handler = logging.getLogger("tifffile"), Listen(logging.WARNING)
    propagate, logger.propagate = logger.propagate, False
    logger.addHandler(handler)
    try:
        yield said
    finally:
        logger.removeHandler(handler)
        logger.propagate = propagate


def _tiff(path: Path) -> tuple[NDArray[Any], dict[str, Any]]:
    import tifffile

    try:
        with _complaints() as complaints, tifffile.TiffFile(path) as tiff:
            # Uncompressed frames are mapped from the file itself, others are decoded to a temporary one.
            frames = tiff.series[0].asarray(out="memmap")
            axes = tiff.series[0].axes
            said = _metadata(tiff)
    except Exception as error:
        # tifffile lets through whatever a damaged file makes its parsers raise.
        raise FormatError(
            file=path,
            expected="a whole TIFF file",
            found=f"one that cannot be read ({type(error).__name__}: {error})",
            advice="It may be truncated: copy it again.",
        ) from error
    if complaints:
        raise FormatError(
            file=path,
            expected="a whole TIFF file",
            found=f"a damaged one ({complaints[0]})",
            advice="It may be truncated: copy it again.",
        )
    single = tuple(k for k, (axis, n) in enumerate(zip(axes, frames.shape)) if n == 1 and axis not in "YX")
    return np.squeeze(frames, axis=single), said


def _metadata(tiff: Any) -> dict[str, Any]:
    """pitch_um, step_um, z0_um and synthetic, as far as the file states them."""
    description = tiff.pages[0].description or ""
    try:
        own = json.loads(description)
    except ValueError:
        own = None
    if isinstance(own, dict) and "pitch_um" in own:
        return own
    if tiff.is_ome:
        return _ome(tiff.ome_metadata)
    if tiff.is_imagej:
        return _imagej(tiff)
    return {}


def _ome(text: str) -> dict[str, Any]:
    from defusedxml import ElementTree

    for element in ElementTree.fromstring(text).iter():
        if element.tag.rsplit("}", 1)[-1] != "Pixels":
            continue
        sizes = {}
        for axis in "XYZ":
            size = element.get(f"PhysicalSize{axis}")
            unit = unit_in(element.get(f"PhysicalSize{axis}Unit", "µm"))
            if size is not None and unit is not None:
                sizes[axis] = float(size) * UNITS[unit]
        said: dict[str, Any] = {}
        if "X" in sizes:
            said["pitch_um"] = (sizes["X"], sizes.get("Y", sizes["X"]))
        if "Z" in sizes:
            said["step_um"] = sizes["Z"]
        return said
    return {}


def _imagej(tiff: Any) -> dict[str, Any]:
    values = tiff.imagej_metadata or {}
    unit = unit_in(str(values.get("unit", "")).replace("\\u00B5", "µ"))
    if unit is None:
        return {}
    said: dict[str, Any] = {}
    if "spacing" in values:
        said["step_um"] = float(values["spacing"]) * UNITS[unit]
    tags = tiff.pages[0].tags
    if "XResolution" in tags and "YResolution" in tags:
        (nx, dx), (ny, dy) = tags["XResolution"].value, tags["YResolution"].value
        if nx and ny:
            said["pitch_um"] = (dx / nx * UNITS[unit], dy / ny * UNITS[unit])
    return said
