"""What the gallery and the tutorial need beyond Sphinx: their pictures, their notes, their cells."""

from __future__ import annotations

import contextlib
import hashlib
import io
import json
import os
import warnings
from pathlib import Path
from typing import Any

_drawn: dict[Path, int] = {}
"""Pictures that were shown already (or left by an earlier run), with the time they were written."""


def before_script(gallery_conf: Any, name: str) -> None:
    """Forget nothing of an earlier run but its pictures; show warnings as a reader would want them."""
    _drawn.clear()
    _drawn.update((picture, picture.stat().st_mtime_ns) for picture in Path().rglob("*.png"))
    warnings.formatwarning = plain_note


def plain_note(message: Warning | str, *_: Any, **__: Any) -> str:
    """A warning without the file and line it came from."""
    return f"note: {message}\n"


def pictures(block: Any, block_vars: dict[str, Any], gallery_conf: Any) -> str:
    """Pictures that a block of a script wrote below its folder, in the order of writing.

    The figures of this package are files, each with its numbers beside it; none is left open for others to
    find.
    """
    from sphinx_gallery.scrapers import figure_rst

    folder = block_vars["example_globals"].get("folder")
    if folder is None:
        return ""
    shown, names = [], []
    for picture in new_pictures(Path(folder)):
        names.append(f"{picture.stem.replace('_', ' ')}, synthetic data")
        target = Path(next(block_vars["image_path_iterator"]))
        target.write_bytes(picture.read_bytes())
        shown.append(str(target))
    return str(figure_rst(shown, gallery_conf["src_dir"], "; ".join(names)))


def new_pictures(folder: Path) -> list[Path]:
    """PNG files below a folder that are new since the last call."""
    times = {picture: picture.stat().st_mtime_ns for picture in folder.rglob("*.png")}
    new = [picture for picture, time in times.items() if _drawn.get(picture) != time]
    _drawn.update(times)
    return sorted(new, key=lambda picture: times[picture])


def run_cells(notebook: Path, folder: Path) -> list[tuple[str, str, str, list[bytes]]]:
    """Run the cells of a notebook one after the other, in a folder of their own.

    Returns
    -------
    For each cell its kind ("markdown" or "code"), its text, what it printed, and its open figures as PNG.
    """
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    names: dict[str, Any] = {"__name__": "__main__"}
    out = []
    before, warnings.formatwarning = (Path.cwd(), warnings.formatwarning), plain_note
    folder.mkdir(parents=True, exist_ok=True)
    os.chdir(folder)
    try:
        for number, cell in enumerate(json.loads(notebook.read_text(encoding="utf-8"))["cells"], 1):
            text = "".join(cell["source"])
            printed, drawn = io.StringIO(), []
            if cell["cell_type"] == "code":
                with contextlib.redirect_stdout(printed), contextlib.redirect_stderr(printed):
                    exec(compile(text, f"{notebook.name}, cell {number}", "exec"), names)
                for figure in map(plt.figure, plt.get_fignums()):
                    picture = io.BytesIO()
                    figure.savefig(picture, dpi=150, bbox_inches="tight", metadata={"Software": None})
                    drawn.append(picture.getvalue())
                plt.close("all")
            out.append((cell["cell_type"], text, printed.getvalue(), drawn))
    finally:
        os.chdir(before[0])
        warnings.formatwarning = before[1]
    return out


def write_notebook(notebook: Path, page: Path, folder: Path) -> None:
    """Run a notebook in a folder and write its page, with what it printed and drew; a current page stays."""
    digest = hashlib.sha256(notebook.read_bytes()).hexdigest()
    first = f"% made from {notebook.name} {digest}\n"
    if page.exists() and page.read_text(encoding="utf-8").startswith(first):
        return
    lines = [first]
    count = 0
    for kind, text, printed, drawn in run_cells(notebook, folder / "work"):
        if kind == "markdown":
            lines += [text, ""]
            continue
        lines += ["```python", text, "```", ""]
        if printed:
            lines += ["```text", printed.rstrip(), "```", ""]
        for picture in drawn:
            count += 1
            shown = folder / f"{page.stem}_{count}.png"
            shown.write_bytes(picture)
            lines += [f"![Figure {count}]({shown.relative_to(page.parent).as_posix()})", ""]
    page.write_text("\n".join(lines), encoding="utf-8")
