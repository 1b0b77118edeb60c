"""GLASS.toml written back: a pane's description with some of its numbers changed."""

from __future__ import annotations

import json
import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from specularia.files import atomic
from specularia.glass.settings import GlassJob
from specularia.jobs import load_toml

__all__ = ["write_inferred"]


def write_inferred(
    glass: str | Path, path: str | Path, values: Mapping[str, float], *, comment: str = ""
) -> Path:
    """Write the pane of a GLASS.toml with values in place of what was inferred.

    Parameters
    ----------
    glass : the description to begin with.
    path : of the new one; paths in it are counted from its own folder.
    values : by the names of `analysis.PARAMETERS`, and thickness_mm. Bubbles become one kind, placed in free
        flight, that keeps the spread of sizes and the axis of the first kind of the description.
    comment : lines for the head of the file.
    """
    glass, path = Path(glass), Path(path)
    data = load_toml(glass, GlassJob).model_dump(exclude_unset=True)
    data["thickness_mm"] = values.get("thickness_mm", data["thickness_mm"])
    if "absorption_per_mm" in values:
        medium = data.setdefault("medium", {})
        medium.pop("spectrum", None)
        medium["absorption_per_mm"] = values["absorption_per_mm"]
    for side in ("front", "back"):
        if f"micro_slope_{side}" in values:
            data[side]["micro_slope"] = values[f"micro_slope_{side}"]
    if any(n.startswith("bubble") for n in values):
        kinds = [k for k in data.get("bubbles", ()) if "list" not in k]
        kind: dict[str, Any] = kinds[0] if kinds else {"per_cm3": 1.0, "diameter_mm": {"median": 0.2}}
        size = {**kind["diameter_mm"]}
        size["median"] = values.get("bubble_diameter_mm", size["median"])
        kind |= {
            "per_cm3": values.get("bubbles_per_cm3", kind["per_cm3"]),
            "diameter_mm": size,
            "elongation": values.get("bubble_elongation", kind.get("elongation", 1.0)),
            "placing": "free flight",
        }
        data["bubbles"] = [kind]
    folder = path.resolve().parent
    with atomic(path) as temporary:
        head = "".join(f"# {line}\n" for line in comment.splitlines())
        temporary.write_text(head + _toml(data, folder), encoding="utf-8")
    return path


def _toml(data: Mapping[str, Any], folder: Path) -> str:
    """A table of tables as TOML."""
    lines = [f"{k} = {_value(v, folder)}" for k, v in data.items() if not _is_table(v)]
    for key, value in data.items():
        if isinstance(value, Mapping):
            lines += ["", f"[{key}]", *(f"{k} = {_value(v, folder)}" for k, v in value.items())]
        elif _is_table(value):
            for one in value:
                lines += ["", f"[[{key}]]", *(f"{k} = {_value(v, folder)}" for k, v in one.items())]
    return "\n".join(lines) + "\n"


def _is_table(value: Any) -> bool:
    if isinstance(value, (list, tuple)):
        return bool(value) and all(isinstance(v, Mapping) for v in value)
    return isinstance(value, Mapping)


def _value(value: Any, folder: Path) -> str:
    if isinstance(value, Mapping):
        inner = ", ".join(f"{k} = {_value(v, folder)}" for k, v in value.items())
        return "{ " + inner + " }"
    if isinstance(value, (list, tuple)):
        return "[" + ", ".join(_value(v, folder) for v in value) + "]"
    if isinstance(value, Path):
        return json.dumps(Path(os.path.relpath(value.resolve(), folder)).as_posix())
    if isinstance(value, float):
        return f"{value:.6g}" if value != int(value) else f"{value:.1f}"
    return json.dumps(value)
