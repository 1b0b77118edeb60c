"""Reflected light in a room of the user's own, by Radiance's ambient calculation.

Both the whole light and that straight from the panes are asked of the same octree, so that what is left is
reflected light alone. In that octree the panes reflect (`Scene.make`, plates) and sunlight that passes
undeflected is a lobe of some degrees, which Radiance can find; where it falls is blurred by as much, what it
sheds further on hardly changes.

Radiance seeds its chance by the clock unless its samples are correlated (-u-), and several processes that
work on one list of rays take them in any order. Every block of rays therefore has a process of its own with
-u-: then a second run gives the same numbers, on any number of processors. The standard error comes from two
runs with different numbers of samples.
"""

from __future__ import annotations

import os
from concurrent.futures import ThreadPoolExecutor

import numpy as np
from numpy.typing import NDArray

from specularia.daylight.scene import Scene
from specularia.files import make_folder
from specularia.radiance import run

__all__ = ["Ambient"]

Array = NDArray[np.float64]

_POINTS = "-ab 8 -aa 0 -as 0 -lw 1e-7 -lr 12"
_DIVISIONS = (4096, 3600)
_PICTURE = "-ab 5 -aa .2 -ar 16 -ad 256 -as 64 -lw 2e-3 -lr 8"
_SOURCES = "-u- -n 1 -dj 0 -dt 0 -dc 1 -dr 0 -ds .2 -st 1 -ss 0"

_BLOCK = 8
"""Points that one process works out."""


class Ambient:
    """Light that reaches points after one reflection or more.

    Parameters
    ----------
    scene : of an `own_geometry.OwnRoom`.
    number : of the run, 0 or 1; they differ in their samples.
    """

    def __init__(self, scene: Scene, number: int = 0) -> None:
        folder = make_folder(scene.folder / f"ambient{number}")
        lights = scene.lights.blurred(scene.box)
        self._scene = Scene.make(folder, scene.box, lights, sampling=scene.sampling, plates=True)
        # A lobe must be cut finely, or it falls on the floor as a row of spots that samples miss or meet.
        cell = 0.1 if np.any(lights.beam > 0.0) else 0.4
        self._octree = self._scene.octree("ambient", cell=cell / scene.sampling)
        self._points = f"{_POINTS} -ad {_DIVISIONS[number]}"

    def illuminance(self, points: Array, normals: Array) -> Array:
        """[K, C] lx of reflected light at points [K, 3] with normals [K, 3]."""
        if len(points) == 0:
            return np.zeros((0, self._scene.channels))
        rays = np.hstack([points, normals])
        blocks = [rays[k : k + _BLOCK] for k in range(0, len(rays), _BLOCK)]
        with ThreadPoolExecutor(min(os.cpu_count() or 1, 8)) as pool:
            whole = np.concatenate(list(pool.map(lambda b: self._trace(f"-I {self._points}", b), blocks)))
        return np.maximum(whole - self._trace("-I -ab 0", rays), 0.0)

    def luminance(self, origins: Array, directions: Array) -> Array:
        """[K, C] cd/m2 that rays see of reflected light; one file of ambient values serves them all."""
        rays = np.hstack([origins, directions])
        file = self._scene.folder / "picture.amb"
        file.unlink(missing_ok=True)
        options = f"{_PICTURE} -af {file.name}"
        # A first, sparse pass fills the file, so that the second interpolates between all of its values.
        self._trace(options, rays[:: max(len(rays) // 4000, 1)])
        return np.maximum(self._trace(options, rays) - self._trace("-ab 0", rays), 0.0)

    def _trace(self, options: str, rays: Array) -> Array:
        words = f"rtrace -h -ff -av 0 0 0 {_SOURCES} {options} {self._octree}".split()
        out = run(words, data=rays.astype("<f4").tobytes(), cwd=self._scene.folder)
        return self._scene.read(np.frombuffer(out, "<f4").reshape(-1, 3))
