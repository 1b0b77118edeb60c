"""Progress of long work, on stderr. Nothing is shown until `show` has been called, as the commands do."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

__all__ = ["Task", "note", "show", "task"]

_display: Any = None
_shown = False


class Task:
    """A piece of work of known length; `advance` is cheap and safe to call from the thread that made it."""

    def __init__(self, handle: Any = None) -> None:
        self._handle = handle

    def advance(self, steps: float = 1.0) -> None:
        """Say that `steps` more of the total are done."""
        if self._handle is not None and _display is not None:
            _display.advance(self._handle, steps)


def show(visible: bool) -> None:
    """Turn the display of progress and notes on or off (off for -q)."""
    global _shown
    _shown = visible


def note(text: str) -> None:
    """One line on stderr about what goes on, unless progress is off."""
    if not _shown:
        return
    if _display is not None:
        _display.console.print(text, highlight=False, markup=False)
    else:
        print(text, file=sys.stderr, flush=True)


@contextmanager
def task(description: str, total: float) -> Iterator[Task]:
    """Show a bar with the time left while the block runs; tasks may nest.

    >>> with task("tracing", 3) as t:
    ...     for _ in range(3):
    ...         t.advance()
    """
    global _display
    if not _shown or not sys.stderr.isatty():
        note(f"{description} ...")
        yield Task()
        return
    from rich.console import Console
    from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn, TimeRemainingColumn

    outermost = _display is None
    if outermost:
        _display = Progress(
            TextColumn("{task.description}"),
            BarColumn(),
            TextColumn("{task.percentage:>3.0f} %"),
            TimeElapsedColumn(),
            TimeRemainingColumn(),
            console=Console(stderr=True),
            transient=True,
        )
        _display.start()
    handle = _display.add_task(description, total=total)
    try:
        yield Task(handle)
    finally:
        _display.remove_task(handle)
        if outermost:
            _display.stop()
            _display = None
