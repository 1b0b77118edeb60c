"""Job files in TOML: every key documented, unknown keys refused by name, paths relative to the file."""

from __future__ import annotations

import difflib
import re
import tomllib
from pathlib import Path
from typing import Annotated, Any, TypeVar, get_args

from pydantic import AfterValidator, BaseModel, ConfigDict, ValidationError, ValidationInfo

from specularia.errors import FormatError
from specularia.files import existing

__all__ = ["FilePath", "Job", "load_toml", "parse_job"]


def _from_file(path: Path, info: ValidationInfo) -> Path:
    base = (info.context or {}).get("base")
    return path if base is None or path.is_absolute() else (Path(base) / path)


FilePath = Annotated[Path, AfterValidator(_from_file)]
"""A path in a job file, counted from the file's own folder."""


class Job(BaseModel):
    """Base of all job files and their tables: frozen, and unknown keys are an error."""

    model_config = ConfigDict(extra="forbid", frozen=True, arbitrary_types_allowed=True)


J = TypeVar("J", bound=BaseModel)


def load_toml(path: str | Path, kind: type[J]) -> J:
    """Read and check a job file.

    Raises
    ------
    FormatError : not TOML, an unknown key (with the nearest known one), or a value that does not fit; it
        names file, line, what was expected and what was found.
    """
    path = existing(path, what="a TOML job file")
    try:
        text = path.read_text(encoding="utf-8")
        data = tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        line = re.search(r"line (\d+)", str(error))
        raise FormatError(
            file=path, line=int(line.group(1)) if line else None, expected="TOML", found=str(error)
        ) from error
    except (UnicodeDecodeError, IsADirectoryError, PermissionError) as error:
        raise FormatError(file=path, expected="a UTF-8 text file in TOML", found=str(error)) from error
    return parse_job(data, kind, file=path, text=text)


def parse_job(data: dict[str, Any], kind: type[J], *, file: Path, text: str = "") -> J:
    """Check already parsed TOML against a job; `text` lets errors name the line."""
    try:
        return kind.model_validate(data, context={"base": file.resolve().parent})
    except ValidationError as error:
        # A misspelt key also makes the right one missing: the misspelling is the fault to name.
        first = min(error.errors(), key=lambda e: e["type"] != "extra_forbidden")
        where = _keys_in(data, first["loc"])
        key = ".".join(str(p) for p in where)
        names = [p for p in where if isinstance(p, str)]
        line = _line_of(names, text)
        more = f" ({error.error_count() - 1} more found.)" if error.error_count() > 1 else ""
        if first["type"] == "extra_forbidden":
            known = _keys_at(kind, names[:-1])
            near = difflib.get_close_matches(names[-1], known, n=1)
            advice = f"Did you mean {near[0]}?" if near else f"Known keys here: {', '.join(sorted(known))}."
            raise FormatError(
                file=file, line=line, expected="a known key", found=f"{key}", advice=advice + more
            ) from error
        expected = first["msg"].removeprefix("Value error, ")
        if first["type"] == "missing":
            raise FormatError(
                file=file, line=line, expected=f"the key {key}", found="none", advice=more.strip()
            ) from error
        raise FormatError(
            file=file,
            line=line,
            expected=f"{key}: {expected[0].lower() + expected[1:]}",
            found=repr(first.get("input")),
            advice=more.strip(),
        ) from error


def _keys_in(data: Any, place: tuple[int | str, ...]) -> list[int | str]:
    """The parts of an error's place that are keys and positions in the file; names of types are left out."""
    keys: list[int | str] = []
    for k, part in enumerate(place):
        if isinstance(data, list) and isinstance(part, int):
            keys.append(part)
            data = data[part] if part < len(data) else None
        elif isinstance(data, dict) and (part in data or k == len(place) - 1):
            keys.append(part)
            data = data.get(part)
    return keys


def _line_of(names: list[str], text: str) -> int | None:
    """The line on which a dotted key stands: the key itself, or the nearest table header above it."""
    for name in reversed(names):
        pattern = re.compile(rf"^\s*(?:{re.escape(name)}\s*=|\[+[^\]]*\b{re.escape(name)}\b[^\]]*\]+)")
        inline = re.compile(rf"\b{re.escape(name)}\s*=")
        for test in (pattern, inline):
            for number, line in enumerate(text.splitlines(), 1):
                if test.search(line.split("#", 1)[0]):
                    return number
    return None


def _keys_at(kind: Any, names: list[str]) -> list[str]:
    """Keys that the table reached by `names` knows."""
    for name in names:
        fields = getattr(kind, "model_fields", {})
        if name in fields:
            kind = _model_in(fields[name].annotation)
    return list(getattr(kind, "model_fields", {}))


def _model_in(annotation: Any) -> Any:
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return annotation
    for part in get_args(annotation):
        found = _model_in(part)
        if found is not None:
            return found
    return None
