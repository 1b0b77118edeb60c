"""What all commands share: options, JSON on stdout, everything else on stderr."""

from __future__ import annotations

import math
import sys
import warnings
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from typing import Annotated, Any

import typer

__all__ = [
    "Cull",
    "Json",
    "Quiet",
    "Resolution",
    "Seed",
    "emit",
    "named_numbers",
    "numbers",
    "session",
    "table",
]

Json = Annotated[bool, typer.Option("--json", help="Print one JSON object on stdout and nothing else there.")]
Quiet = Annotated[bool, typer.Option("-q", "--quiet", help="No progress, no notes.")]
Seed = Annotated[int, typer.Option("--seed", help="Seed of the random streams; same seed, same answer.")]
Resolution = Annotated[
    int, typer.Option("--resolution", min=5, max=8, help="XML: N of 2^N x 2^N outgoing cells.")
]
Cull = Annotated[
    float | None,
    typer.Option(
        "--cull",
        min=0.0,
        max=100.0,
        help="XML: percentage of the cells to remove; without it as many as move 1 % of the light.",
    ),
]


@contextmanager
def session(*, quiet: bool) -> Iterator[None]:
    """Progress and warnings go to stderr while a command runs; each warning is printed once."""
    from specularia import progress

    progress.show(not quiet)
    seen: set[str] = set()

    def tell(message: Warning | str, category: type[Warning], *_: Any, **__: Any) -> None:
        from specularia.errors import SpeculariaWarning

        text = str(message)
        if issubclass(category, SpeculariaWarning) and text not in seen:
            seen.add(text)
            print(f"warning: {text}", file=sys.stderr, flush=True)

    with warnings.catch_warnings():
        warnings.simplefilter("always")
        warnings.showwarning = tell
        try:
            yield
        finally:
            progress.show(False)


def emit(payload: Mapping[str, Any], *, as_json: bool, lines: Sequence[str]) -> None:
    """Print the payload as one JSON object, or the lines for a person to read."""
    from specularia.provenance import to_json

    print(to_json(payload) if as_json else "\n".join(lines))


def table(header: Sequence[str], rows: Sequence[Sequence[Any]]) -> list[str]:
    """Rows aligned in columns under a header; floats get four significant digits, None a dash."""

    def text(value: Any) -> str:
        if value is None or (isinstance(value, float) and value != value):
            return "-"
        return f"{value:.4g}" if isinstance(value, float) else str(value)

    cells = [list(map(str, header)), *[[text(v) for v in row] for row in rows]]
    widths = [max(len(row[k]) for row in cells) for k in range(len(header))]
    return ["  ".join(c.rjust(w) for c, w in zip(row, widths)) for row in cells]


def numbers(text: str, *, option: str) -> list[float]:
    """Numbers separated by commas, as in --theta 0,20,40; finite, and at least one."""
    try:
        found = [float(part) for part in text.split(",") if part.strip()]
    except ValueError:
        found = []
    if not found or not all(math.isfinite(x) for x in found):
        raise typer.BadParameter(f"{text!r} is not a list of numbers like 0,20,40", param_hint=option)
    return found


def named_numbers(
    texts: Sequence[str] | None, *, names: Sequence[str], form: str, option: str
) -> dict[str, list[float]]:
    """Numbers by name, as in --prior NAME=MEDIAN,SIGMA, which is `form`; `names` may stand there."""
    found = {}
    for text in texts or ():
        name, _, rest = (part.strip() for part in text.partition("="))
        if name not in names:
            raise typer.BadParameter(f"{name!r} is none of {', '.join(names)}", param_hint=option)
        found[name] = numbers(rest, option=option) if rest else []
        if len(found[name]) != 1 + form.count(","):
            raise typer.BadParameter(f"{text!r} is no {form}", param_hint=option)
    return found
