"""The command `specularia doctor`."""

from __future__ import annotations

import typer

from specularia.cli._common import Json, Quiet, emit, session

__all__ = ["doctor"]


def doctor(as_json: Json = False, quiet: Quiet = False) -> None:
    """Whether this machine can do the work: versions, Radiance, threads, memory, GPU. Exit code 1 if not."""
    with session(quiet=quiet):
        from specularia.study import diagnose

        checks = diagnose()
    good = all(c.ok for c in checks)
    width = max(len(c.name) for c in checks)
    lines = []
    for check in checks:
        lines.append(f"{'ok  ' if check.ok else 'NOT '} {check.name:{width}}  {check.value}")
        if check.advice:
            lines.append(f"     {'':{width}}  {check.advice}")
    wrong = sum(not c.ok for c in checks)
    lines.append("All is well." if good else f"{wrong} thing{'s' if wrong > 1 else ''} to mend.")
    emit({"ok": good, "checks": [vars(c) for c in checks]}, as_json=as_json, lines=lines)
    if not good:
        raise typer.Exit(1)
