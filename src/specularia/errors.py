"""What can go wrong, said so that the reader knows what to do next."""

from __future__ import annotations

from pathlib import Path

__all__ = [
    "CoverageError",
    "FormatError",
    "OutputError",
    "PhysicsError",
    "RadianceError",
    "SpeculariaError",
    "SpeculariaWarning",
]


class SpeculariaWarning(UserWarning):
    """Something the user should know; the result stands."""


class SpeculariaError(Exception):
    """Root of all errors of this package.

    `exit_code` is what the command line returns: 3, bad data, unless a subclass says otherwise.
    """

    exit_code = 3


class FormatError(SpeculariaError):
    """A file does not hold what it should.

    Parameters
    ----------
    file : path of the file.
    line : line number counted from 1, where there is one.
    expected, found : what the reader needed and what stood there.
    advice : what to do next.
    """

    def __init__(
        self,
        *,
        file: str | Path,
        expected: str,
        found: str,
        line: int | None = None,
        advice: str = "",
    ) -> None:
        self.file, self.line = Path(file), line
        self.expected, self.found, self.advice = expected, found, advice
        place = f"{file}, line {line}" if line is not None else str(file)
        text = f"{place}: expected {expected}, found {found}."
        super().__init__(f"{text} {advice}".rstrip())


class PhysicsError(SpeculariaError):
    """The numbers break a law: energy gained, a direction in the wrong hemisphere."""


class CoverageError(SpeculariaError):
    """A direction, wavelength or side outside the data was asked for."""


class OutputError(SpeculariaError):
    """A result could not be written; what stood there before is untouched."""


class RadianceError(SpeculariaError):
    """A Radiance program failed.

    Parameters
    ----------
    command : the command with its arguments.
    code : its exit status.
    stderr : what it said.
    """

    exit_code = 1

    def __init__(self, *, command: list[str], code: int, stderr: str) -> None:
        self.command, self.code, self.stderr = command, code, stderr
        said = stderr.strip() or "(it said nothing)"
        super().__init__(f"{' '.join(command)} ended with exit code {code}: {said}")
