"""Lists of bubbles in files."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from specularia.errors import FormatError, PhysicsError
from specularia.files import atomic, existing, write_text
from specularia.glass.bubbles import AIR, Bubbles

__all__ = ["read_bubbles", "write_bubbles"]

_COLUMNS = ("x_mm", "y_mm", "z_mm", "long_mm", "short_mm", "axis_x", "axis_y", "axis_z")


def read_bubbles(path: str | Path) -> Bubbles:
    """Read a list of bubbles.

    A .npz holds centre_mm, long_mm, short_mm, axis and cell_mm. A .csv has a first line "# cell_mm: X, Y", a
    line of names x_mm, y_mm, z_mm, long_mm, short_mm, axis_x, axis_y, axis_z, and one bubble a line.
    """
    path = existing(path, what="a list of bubbles (.csv or .npz)")
    if path.suffix.lower() == ".npz":
        try:
            with np.load(path, allow_pickle=False) as f:
                cell = np.asarray(f["cell_mm"], float)
                return Bubbles(
                    f["centre_mm"],
                    f["long_mm"],
                    f["short_mm"],
                    f["axis"],
                    (float(cell[0]), float(cell[1])),
                )
        except PhysicsError:
            raise
        except Exception as error:
            raise FormatError(
                file=path,
                expected="arrays centre_mm, long_mm, short_mm, axis and cell_mm",
                found=f"{error}",
            ) from error
    if path.suffix.lower() != ".csv":
        raise FormatError(
            file=path, expected="a list of bubbles in .csv or .npz", found=path.suffix or "no suffix"
        )
    try:
        lines = path.read_text(encoding="utf-8").splitlines()
    except (UnicodeDecodeError, OSError) as error:
        raise FormatError(file=path, expected="a text file", found=str(error)) from error
    first = lines[0] if lines else ""
    try:
        word, _, rest = first.lstrip("# ").partition(":")
        cell_x, cell_y = (float(c) for c in rest.split(","))
        if word.strip() != "cell_mm":
            raise ValueError
    except ValueError:
        raise FormatError(file=path, line=1, expected="# cell_mm: X, Y", found=repr(first)) from None
    names = tuple(c.strip() for c in lines[1].split(",")) if len(lines) > 1 else ()
    if names != _COLUMNS:
        raise FormatError(
            file=path, line=2, expected=", ".join(_COLUMNS), found=", ".join(names) or "nothing"
        )
    rows = []
    for number, line in enumerate(lines[2:], 3):
        if not line.strip():
            continue
        try:
            row = [float(c) for c in line.split(",")]
        except ValueError:
            row = []
        if len(row) != len(_COLUMNS) or not np.all(np.isfinite(row)):
            raise FormatError(file=path, line=number, expected=f"{len(_COLUMNS)} numbers", found=repr(line))
        rows.append(row)
    a = np.array(rows).reshape(-1, len(_COLUMNS))
    return Bubbles(a[:, :3], a[:, 3], a[:, 4], a[:, 5:], (cell_x, cell_y))


def write_bubbles(bubbles: Bubbles, path: str | Path) -> Path:
    """Write a list of bubbles as .csv or .npz, in the form that `read_bubbles` reads."""
    path = Path(path)
    if any(i != AIR for i in bubbles.inside):
        raise PhysicsError("a list in a file holds air bubbles; what fills inclusions is said in GLASS.toml.")
    if path.suffix.lower() == ".npz":
        with atomic(path) as temporary:
            np.savez(
                temporary,
                centre_mm=bubbles.centre_mm,
                long_mm=bubbles.long_mm,
                short_mm=bubbles.short_mm,
                axis=bubbles.axis,
                cell_mm=np.asarray(bubbles.cell_mm),
            )
        return path
    table = np.column_stack([bubbles.centre_mm, bubbles.long_mm, bubbles.short_mm, bubbles.axis])
    lines = [f"# cell_mm: {bubbles.cell_mm[0]!r}, {bubbles.cell_mm[1]!r}", ", ".join(_COLUMNS)]
    lines += [", ".join(repr(float(v)) for v in row) for row in table]
    return write_text(path, "\n".join(lines) + "\n")
