"""Rows of a map that are done, kept on disk so that work that was cut off goes on where it was."""

from __future__ import annotations

import json
import shutil
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from specularia import provenance
from specularia.errors import OutputError

__all__ = ["Rows"]


class Rows:
    """Arrays [row, column] by name, with a mark for each row that is done.

    Parameters
    ----------
    shape : (rows, columns).
    layers : type of number of each array.
    output : the file that will be written at the end; the arrays then lie in the folder
        `OUTPUT.DIGEST.partial` beside it, the digest being that of `what`. None keeps them in memory.
    what : everything that the arrays depend on; other work gets another folder.
    """

    def __init__(
        self,
        shape: tuple[int, int],
        layers: Mapping[str, str],
        *,
        output: Path | None = None,
        what: Mapping[str, Any] | None = None,
    ) -> None:
        self.folder: Path | None = None
        self.layers: dict[str, NDArray[Any]] = {}
        if output is None:
            self.layers = {name: np.zeros(shape, dtype) for name, dtype in layers.items()}
            self.done = np.zeros(shape[0], np.uint8)
            return
        key = provenance.digest({"shape": shape, "layers": dict(layers), "what": dict(what or {})})
        self.folder = output.with_name(f"{output.name}.{key[:12]}.partial")
        ready = self.folder / "ready.json"
        try:
            if not ready.is_file():
                # Cut off while the arrays were laid out: start again.
                shutil.rmtree(self.folder, ignore_errors=True)
                self.folder.mkdir()
                for name, dtype in {**layers, "done": "u1"}.items():
                    size = shape if name != "done" else shape[:1]
                    np.lib.format.open_memmap(self.folder / f"{name}.npy", "w+", dtype, size).flush()
                ready.write_text(json.dumps(dict(what or {}), default=str), encoding="utf-8")
            for name in layers:
                self.layers[name] = np.load(self.folder / f"{name}.npy", mmap_mode="r+")
            self.done = np.load(self.folder / "done.npy", mmap_mode="r+")
        except OSError as error:
            raise OutputError(
                f"{self.folder}: cannot keep unfinished work here ({error.strerror}). Name another place."
            ) from error

    def put(self, first: int, last: int, values: Mapping[str, NDArray[Any]]) -> None:
        """Store rows first..last-1; they count as done only once they are all there."""
        for name, value in values.items():
            self.layers[name][first:last] = value
        if self.folder is not None:
            for array in self.layers.values():
                array.flush()  # type: ignore[attr-defined]
        self.done[first:last] = 1
        if self.folder is not None:
            self.done.flush()  # type: ignore[attr-defined]

    def missing(self, first: int, last: int) -> bool:
        """Whether any of the rows is still to be done."""
        return not bool(self.done[first:last].all())

    def take(self, name: str) -> NDArray[Any]:
        """An array, in memory."""
        return np.array(self.layers[name])

    def remove(self) -> None:
        """Forget the folder; called once the result is written."""
        if self.folder is not None:
            self.layers, self.done = {}, np.zeros(0, np.uint8)
            shutil.rmtree(self.folder, ignore_errors=True)
