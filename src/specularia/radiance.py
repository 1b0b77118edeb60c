"""Radiance, from the pyradiance wheel: the only module of this package that starts a program."""

from __future__ import annotations

import os
import subprocess
from collections.abc import Sequence
from functools import cache
from pathlib import Path

from specularia.errors import RadianceError

__all__ = ["folder", "run"]


@cache
def folder() -> Path:
    """The folder of the pyradiance package, with its programs in `bin` and its library in `lib`."""
    from importlib.util import find_spec

    spec = find_spec("pyradiance")
    if spec is None or spec.origin is None:
        raise RadianceError(
            command=["pyradiance"], code=127, stderr="not installed; pip install 'pyradiance>=1.3.1,<1.4'"
        )
    return Path(spec.origin).parent


def run(
    command: Sequence[str | Path],
    *,
    data: bytes | None = None,
    cwd: str | Path | None = None,
    said: list[str] | None = None,
) -> bytes:
    """Run a Radiance program and return what it wrote to its standard output.

    Parameters
    ----------
    command : program name and arguments.
    data : bytes for its standard input.
    cwd : folder it runs in; scene files are best written there and named without a folder.
    said : takes the lines that the program wrote to its standard error, where it ended well.

    Raises
    ------
    RadianceError : with command, exit code and what the program said, where the exit code is not 0.
    """
    words = [str(c) for c in command]
    program = folder() / "bin" / words[0]
    environment = dict(os.environ)
    environment["RAYPATH"] = os.pathsep.join([".", str(folder() / "lib")])
    environment["PATH"] = os.pathsep.join([str(folder() / "bin"), environment.get("PATH", "")])
    if not program.exists():
        raise RadianceError(command=words, code=127, stderr="this program is not part of pyradiance")
    done = subprocess.run(
        [str(program), *words[1:]],
        input=data,
        stdin=subprocess.DEVNULL if data is None else None,
        capture_output=True,
        cwd=cwd,
        env=environment,
        check=False,
    )
    if done.returncode != 0:
        raise RadianceError(command=words, code=done.returncode, stderr=done.stderr.decode(errors="replace"))
    if said is not None:
        said += [line for line in done.stderr.decode(errors="replace").splitlines() if line.strip()]
    return done.stdout
