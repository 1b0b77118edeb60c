"""Files: written whole or not at all, and read with a clear answer when they are not what they should be."""

from __future__ import annotations

import csv
import os
import shutil
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

from specularia.errors import FormatError, OutputError

if TYPE_CHECKING:
    import xarray as xr

__all__ = [
    "atomic",
    "atomic_folder",
    "existing",
    "make_folder",
    "read_netcdf",
    "writable",
    "write_csv",
    "write_json",
    "write_netcdf",
    "write_text",
]


def existing(path: str | Path, *, what: str = "a file") -> Path:
    """The path, if a file or folder stands there; a FormatError that says so if not."""
    path = Path(path)
    if not path.exists():
        raise FormatError(
            file=path, expected=what, found="nothing", advice="Check the spelling and the folder you are in."
        )
    return path


def make_folder(path: str | Path) -> Path:
    """The folder, made if it is missing; an OutputError where that is not possible."""
    path = Path(path)
    try:
        path.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise OutputError(
            f"{path}: cannot make this folder ({error.strerror}). Name another place."
        ) from error
    return path


def writable(path: str | Path) -> Path:
    """The path, if a file can be written there; an OutputError if not. Ask before long work, not after it."""
    path = Path(path)
    if path.is_dir():
        raise OutputError(f"{path}: is a folder; name a file to write.")
    if not path.parent.is_dir():
        raise OutputError(f"{path}: the folder {path.parent} does not exist. Make it first or name another.")
    if not os.access(path.parent, os.W_OK):
        raise OutputError(f"{path}: cannot write in the folder {path.parent}. Name another place.")
    return path


@contextmanager
def atomic(path: str | Path) -> Iterator[Path]:
    """A temporary path beside `path`, renamed to it when the block ends well, removed when it does not.

    The temporary name keeps the suffix of `path`, since several writers choose a format by it.
    """
    path = writable(path)
    try:
        handle, name = tempfile.mkstemp(prefix=f".{path.stem}-", suffix=path.suffix, dir=path.parent)
        os.close(handle)
    except OSError as error:
        raise OutputError(f"{path}: cannot write here ({error.strerror}). Name another place.") from error
    temporary = Path(name)
    try:
        yield temporary
        umask = os.umask(0)
        os.umask(umask)
        temporary.chmod(0o666 & ~umask)
        temporary.replace(path)
    except OSError as error:
        if isinstance(error.filename, str) and Path(error.filename) in (temporary, path):
            raise OutputError(f"{path}: cannot write here ({error.strerror}).") from error
        raise
    finally:
        temporary.unlink(missing_ok=True)


@contextmanager
def atomic_folder(path: str | Path) -> Iterator[Path]:
    """A temporary folder that becomes `path` when the block ends well; an older `path` is replaced."""
    path = Path(path)
    make_folder(path.parent)
    try:
        temporary = Path(tempfile.mkdtemp(prefix=f".{path.name}-", dir=path.parent))
    except OSError as error:
        raise OutputError(f"{path}: cannot write here ({error.strerror}). Name another place.") from error
    try:
        yield temporary
        umask = os.umask(0)
        os.umask(umask)
        temporary.chmod(0o777 & ~umask)
        if path.exists():
            shutil.rmtree(path)
        temporary.replace(path)
    finally:
        shutil.rmtree(temporary, ignore_errors=True)


def write_text(path: str | Path, text: str) -> Path:
    """Write UTF-8 text, whole or not at all."""
    with atomic(path) as temporary:
        temporary.write_text(text, encoding="utf-8")
    return Path(path)


def write_csv(path: str | Path, header: Sequence[str], rows: Sequence[Sequence[Any]]) -> Path:
    """Write rows as CSV; floats in their shortest exact form, NaN and None as empty cells."""
    path = Path(path)
    with atomic(path) as temporary, temporary.open("w", newline="", encoding="utf-8") as f:
        writer = csv.writer(f, lineterminator="\n")
        writer.writerow(header)
        writer.writerows([[_exact(v) for v in row] for row in rows])
    return path


def _exact(value: Any) -> Any:
    if hasattr(value, "item"):  # a number of numpy's
        value = value.item()
    if value is None or (isinstance(value, float) and value != value):
        return ""
    return repr(value) if isinstance(value, float) else value


def write_json(path: str | Path, value: Any) -> Path:
    """Write a value as indented JSON, whole or not at all."""
    from specularia.provenance import to_json

    return write_text(path, to_json(value, indent=1) + "\n")


def write_netcdf(
    path: str | Path, groups: Mapping[str, xr.Dataset], attributes: Mapping[str, str] | None = None
) -> Path:
    """Write datasets as the groups of one netCDF-4 file; "/" is the root group.

    Parameters
    ----------
    path : ends in .nc.
    groups : datasets with named dimensions; float variables are compressed.
    attributes : provenance, stored on the root group.
    """
    import xarray as xr

    root = groups.get("/", xr.Dataset()).assign_attrs(dict(attributes or {}))
    with atomic(path) as temporary:
        root.to_netcdf(temporary, mode="w", engine="h5netcdf", encoding=_compressed(root))
        for name, dataset in groups.items():
            if name != "/":
                dataset.to_netcdf(
                    temporary, mode="a", group=name, engine="h5netcdf", encoding=_compressed(dataset)
                )
    return Path(path)


def _compressed(dataset: xr.Dataset) -> dict[str, dict[str, Any]]:
    return {
        str(k): {"zlib": True, "complevel": 1, "shuffle": True}
        for k, v in dataset.data_vars.items()
        if v.dtype.kind in "fiu" and v.size > 1024
    }


def read_netcdf(path: str | Path) -> dict[str, xr.Dataset]:
    """All groups of a netCDF-4 file by name ("/" is the root), loaded; a FormatError otherwise."""
    import h5netcdf
    import xarray as xr

    path = existing(path, what="a netCDF file")
    try:
        with h5netcdf.File(path, "r") as f:
            names = ["/", *f.groups]
        found = {}
        for name in names:
            with xr.open_dataset(path, group=name, engine="h5netcdf") as dataset:
                found[name] = dataset.load()
    except (OSError, ValueError, KeyError, RuntimeError) as error:
        raise FormatError(
            file=path,
            expected="a netCDF-4 file",
            found=f"one that cannot be read ({error})",
            advice="It may be truncated: make it again or copy it again.",
        ) from error
    return found
