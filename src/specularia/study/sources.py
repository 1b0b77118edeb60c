"""Files that a study names: on disk, or in what its twin makes."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from pydantic import BaseModel

from specularia.errors import FormatError
from specularia.study.job import StudyJob

__all__ = ["Sources", "files_named_by"]

TWIN = "twin"
"""Name of the stage that makes the synthetic specimen."""


@dataclass(frozen=True)
class Sources:
    """Finds the files that a study names.

    Parameters
    ----------
    file : STUDY.toml; patterns count from its folder.
    twin_folder : first part of the paths that lie in the twin's result; None without a twin.
    """

    file: Path
    twin_folder: str | None

    @classmethod
    def of(cls, job: StudyJob, file: Path) -> Sources:
        """The sources of a study."""
        return cls(file, job.twin.folder if job.twin else None)

    def outside(self, patterns: Iterable[str | None]) -> tuple[Path, ...]:
        """Files and folders on disk that the patterns stand for, sorted within each pattern.

        Raises
        ------
        FormatError : a pattern that nothing matches.
        """
        found: list[Path] = []
        for pattern in patterns:
            if pattern is None or self._in_twin(pattern) is not None:
                continue
            here = _matching(self.file.resolve().parent, pattern)
            if not here:
                raise FormatError(
                    file=self.file,
                    expected=f"files named {pattern}",
                    found="none",
                    advice=f"Paths count from the folder {self.file.resolve().parent}.",
                )
            found += here
        return tuple(dict.fromkeys(found))

    def within(self, patterns: Iterable[str | None]) -> tuple[tuple[str, str], ...]:
        """Patterns that lie in the twin's result, each with the name of that stage."""
        inside = (None if p is None else self._in_twin(p) for p in patterns)
        return tuple((TWIN, p) for p in inside if p is not None)

    def _in_twin(self, pattern: str) -> str | None:
        first, _, rest = pattern.partition("/")
        return rest if self.twin_folder is not None and first == self.twin_folder and rest else None


def _matching(folder: Path, pattern: str) -> list[Path]:
    """Files and folders that a pattern stands for; an absolute pattern counts from its own root."""
    path = Path(pattern)
    return sorted(
        Path(path.anchor).glob(str(path.relative_to(path.anchor))) if path.anchor else folder.glob(pattern)
    )


def files_named_by(job: BaseModel) -> tuple[Path, ...]:
    """All paths that stand in a job file as paths, in order."""
    found: list[Path] = []

    def look(value: Any) -> None:
        if isinstance(value, Path):
            found.append(value)
        elif isinstance(value, BaseModel):
            for name in type(value).model_fields:
                look(getattr(value, name))
        elif isinstance(value, (list, tuple)):
            for item in value:
                look(item)
        elif isinstance(value, dict):
            look(list(value.values()))

    look(job)
    return tuple(dict.fromkeys(found))
