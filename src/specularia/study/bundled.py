"""The bundled study: a synthetic specimen from its instrument files to the lit room."""

from __future__ import annotations

from importlib.resources import files
from pathlib import Path

from specularia.files import make_folder, write_text
from specularia.progress import note

__all__ = ["copy_bundled", "write_demo"]

QUICK = ("study.toml", "twin.toml", "glass.toml", "fragment.toml", "room.toml")
FULL = ("study_full.toml", "twin_full.toml", "glass.toml", "fragment.toml", "room_full.toml")


def copy_bundled(name: str, folder: Path) -> Path:
    """Copy one file of the bundled study; one that is there already may have been changed and is kept."""
    target = folder / name
    if target.exists():
        note(f"{target} is there already and is kept")
        return target
    source = files("specularia.study") / "demo" / name
    return write_text(target, source.read_text(encoding="utf-8"))


def write_demo(folder: str | Path, *, full: bool = False) -> Path:
    """Copy the bundled study to a folder and return the path of its STUDY.toml.

    Parameters
    ----------
    folder : made if missing.
    full : settings for publication in place of the quick ones.
    """
    folder = make_folder(folder)
    study, *_ = [copy_bundled(name, folder) for name in (FULL if full else QUICK)]
    return study
