"""The command line. One file per command group; no science here."""

from __future__ import annotations

import importlib
import os
import sys
from collections.abc import Sequence

import typer

__all__ = ["entry", "main"]

_GROUPS = ("gonio", "surface", "glass", "bsdf", "daylight", "finds", "study")
"""Modules with a Typer object `app`, mounted under their own name."""

_SINGLE = ("demo", "twin", "explain", "infer", "hybrid", "doctor")
"""Modules with one function of that name, mounted as a command."""


def _build() -> typer.Typer:

    app = typer.Typer(
        name="specularia",
        help="Window glass from the instrument to the light in the room.",
        no_args_is_help=True,
        pretty_exceptions_enable=False,
        context_settings={"help_option_names": ["-h", "--help"]},
    )

    def version(wanted: bool) -> None:
        if wanted:
            from specularia import __version__

            print(__version__)
            raise typer.Exit

    @app.callback()
    def root(
        version: bool = typer.Option(
            False, "--version", callback=version, is_eager=True, help="Print the version and end."
        ),
    ) -> None:
        pass

    for name in _SINGLE:
        module = importlib.import_module(f"specularia.cli.{name}")
        app.command(name)(getattr(module, name))
    for name in _GROUPS:
        app.add_typer(importlib.import_module(f"specularia.cli.{name}").app, name=name)
    return app


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one command and return its exit code: 0 fine, 1 our fault, 2 wrong usage, 3 bad data."""
    from specularia.errors import SpeculariaError

    words = list(sys.argv[1:] if arguments is None else arguments)
    try:
        code = _build()(args=words, standalone_mode=True, prog_name="specularia")
    except SystemExit as stop:
        code = stop.code
    except KeyboardInterrupt:
        print("specularia: interrupted; finished work is kept.", file=sys.stderr)
        return 130
    except SpeculariaError as error:
        print(f"specularia: {error}", file=sys.stderr)
        return error.exit_code
    except Exception as error:
        if os.environ.get("SPECULARIA_DEBUG"):
            raise
        print(
            f"specularia: a fault of the program ({type(error).__name__}: {error}). "
            "Set SPECULARIA_DEBUG=1 to see where, and report it.",
            file=sys.stderr,
        )
        return 1
    return code if isinstance(code, int) else (0 if code is None else 1)


def entry() -> None:
    """Entry point of the `specularia` program."""
    sys.exit(main())
