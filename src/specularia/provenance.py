"""Where a result comes from: hashes of its inputs, parameters, seed and versions."""

from __future__ import annotations

import hashlib
import json
import platform
from collections.abc import Iterable, Mapping
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

__all__ = ["digest", "file_digest", "record", "to_json", "versions"]

_PACKAGES = ("specularia", "numpy", "scipy", "numba", "xarray", "pyradiance", "pvlib", "SurfaceTopography")


def file_digest(path: str | Path) -> str:
    """SHA-256 of a file's bytes, or of a folder's files with their names, in hexadecimal."""
    path = Path(path)
    h = hashlib.sha256()
    files = sorted(p for p in path.rglob("*") if p.is_file()) if path.is_dir() else [path]
    for p in files:
        if path.is_dir():
            h.update(p.relative_to(path).as_posix().encode())
        with p.open("rb") as f:
            while block := f.read(1 << 20):
                h.update(block)
    return h.hexdigest()


def digest(value: Any) -> str:
    """SHA-256 of a value that JSON can hold, independent of the order of keys."""
    return hashlib.sha256(to_json(value, sort_keys=True).encode()).hexdigest()


def versions() -> dict[str, str]:
    """Versions of Python, this package and those that its numbers depend on."""
    found = {"python": platform.python_version()}
    for name in _PACKAGES:
        try:
            found[name] = version(name)
        except PackageNotFoundError:
            continue
    return found


def record(
    *,
    what: str,
    inputs: Iterable[str | Path] = (),
    parameters: Mapping[str, Any] | None = None,
    seed: int | None = None,
    synthetic: bool = False,
) -> dict[str, str]:
    """Attributes to store with a product: flat strings, the structured ones as JSON.

    Parameters
    ----------
    what : one sentence on what the product is.
    inputs : files it was made from; name and SHA-256 of each are kept.
    parameters : settings that shaped it.
    seed : of the random streams, where chance plays a part.
    synthetic : True where any input is synthetic; the label goes with the product.
    """
    out = {
        "title": what,
        "source": json.dumps({Path(p).name: file_digest(p) for p in inputs}),
        "parameters": to_json(dict(parameters or {})),
        "versions": json.dumps(versions()),
    }
    if seed is not None:
        out["seed"] = str(seed)
    if synthetic:
        out["synthetic"] = "synthetic: made by a computer program, not measured"
    return out


def _plain(value: Any) -> Any:
    if isinstance(value, Mapping):
        return {str(k): _plain(v) for k, v in value.items()}
    if isinstance(value, (list, tuple, set, frozenset)):
        return [_plain(v) for v in value]
    if isinstance(value, Path):
        return str(value)
    if hasattr(value, "model_dump"):
        return _plain(value.model_dump(mode="python"))
    if hasattr(value, "tolist"):
        return _plain(value.tolist())
    if isinstance(value, float):
        return value if value == value and abs(value) != float("inf") else None
    return value


def to_json(value: Any, *, indent: int | None = None, sort_keys: bool = False) -> str:
    """JSON text of arrays, records and paths; NaN and infinities become null."""
    return json.dumps(_plain(value), indent=indent, sort_keys=sort_keys, ensure_ascii=False)
