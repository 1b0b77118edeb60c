"""Finished parts of long work, kept on disk until the whole is done.

The folder's name holds a digest of everything that the parts depend on, the program's own text included, so a
run never goes on with the parts of another.
"""

from __future__ import annotations

import hashlib
import shutil
import zipfile
from collections.abc import Mapping
from dataclasses import fields, is_dataclass
from functools import cache
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from specularia.errors import OutputError
from specularia.files import atomic, writable
from specularia.progress import note
from specularia.provenance import versions

__all__ = ["Store", "code_digest", "content_digest"]

T = TypeVar("T")


@cache
def code_digest() -> str:
    """SHA-256 of this package's text and of the versions that its numbers depend on."""
    h = hashlib.sha256(repr(sorted(versions().items())).encode())
    for path in sorted(Path(__file__).parent.glob("*.py")):
        h.update(path.read_bytes())
    return h.hexdigest()


def content_digest(*values: Any) -> str:
    """SHA-256 of records, arrays and plain values by what they hold; file names do not count."""
    h = hashlib.sha256()

    def add(value: Any) -> None:
        h.update(type(value).__name__.encode())
        if isinstance(value, np.ndarray):
            h.update(f"{value.dtype}{value.shape}".encode())
            h.update(np.ascontiguousarray(value).tobytes())
        elif is_dataclass(value):
            for f in fields(value):
                h.update(f.name.encode())
                add(getattr(value, f.name))
        elif isinstance(value, Mapping):
            for key in value:
                add(key)
                add(value[key])
        elif isinstance(value, (list, tuple)):
            for part in value:
                add(part)
        elif not isinstance(value, Path):
            h.update(repr(value).encode())

    for value in values:
        add(value)
    return h.hexdigest()


class Store:
    """A folder beside an output that keeps finished parts until the output is written.

    Parameters
    ----------
    output : the file that the work will end in.
    key : digest of all that the parts depend on.
    """

    def __init__(self, output: str | Path, *, key: str) -> None:
        output = writable(output)
        self.path = output.with_name(f"{output.name}.{key[:12]}.partial")
        for other in sorted(output.parent.glob(f"{output.name}.*.partial")):
            if other != self.path:
                note(f"{other} holds unfinished work of other settings; delete it if it is not wanted.")

    def load(self, name: str, kind: type[T]) -> T | None:
        """A part that an earlier run finished; None where there is none."""
        path = self.path / f"{name}.npz"
        if not path.is_file():
            return None
        try:
            with np.load(path, allow_pickle=False) as held:
                return _unflatten(kind, dict(held))
        except (OSError, ValueError, KeyError, zipfile.BadZipFile):
            return None

    def save(self, name: str, part: Any) -> None:
        """Keep a finished part, whole or not at all."""
        try:
            self.path.mkdir(exist_ok=True)
        except OSError as error:
            raise OutputError(f"{self.path}: cannot keep finished directions here ({error}).") from error
        with atomic(self.path / f"{name}.npz") as temporary:
            np.savez_compressed(temporary, **_flatten(part))

    def remove(self) -> None:
        """The whole is written: the parts are no longer needed."""
        shutil.rmtree(self.path, ignore_errors=True)


def _flatten(record: Any, prefix: str = "") -> dict[str, Any]:
    """Fields of a record, those of records in it under "field.field"."""
    out: dict[str, Any] = {}
    for f in fields(record):
        value = getattr(record, f.name)
        out |= _flatten(value, f"{prefix}{f.name}.") if is_dataclass(value) else {prefix + f.name: value}
    return out


def _unflatten(kind: Any, held: Mapping[str, Any], prefix: str = "") -> Any:
    from typing import get_type_hints

    hints, out = get_type_hints(kind), {}
    for f in fields(kind):
        hint = hints[f.name]
        if is_dataclass(hint):
            out[f.name] = _unflatten(hint, held, f"{prefix}{f.name}.")
        else:
            value = held[prefix + f.name]
            out[f.name] = value.item() if value.ndim == 0 else value
    return kind(**out)
