"""Reflected light in a room of the user's own, by Radiance's ambient calculation.

Radiance seeds its chance by the clock: here a second run gives slightly other numbers. Both the whole light
and that straight from the panes are asked of the same octree, so that what is left is reflected light alone;
its standard error comes from two such runs.
"""

from __future__ import annotations

import os
import time

import numpy as np
from numpy.typing import NDArray

from specularia.daylight.scene import Scene
from specularia.radiance import run

__all__ = ["Ambient"]

Array = NDArray[np.float64]

_POINTS = "-ab 8 -aa 0 -ad 4096 -as 0 -lw 1e-5 -lr 12"
_PICTURE = "-ab 5 -aa .2 -ar 16 -ad 256 -as 64 -lw 2e-3 -lr 8"
_SOURCES = "-dj 0 -dt 0 -dc 1 -dr 0 -ds .2 -st 1 -ss 0"


class Ambient:
    """Light that reaches points after one reflection or more.

    Parameters
    ----------
    scene : of an `own_geometry.OwnRoom`.
    """

    def __init__(self, scene: Scene) -> None:
        self.scene = scene
        self._octree = scene.octree("ambient", cell=0.4 / scene.sampling)

    def illuminance(self, points: Array, normals: Array) -> Array:
        """[K, C] lx of reflected light at points [K, 3] with normals [K, 3]."""
        if len(points) == 0:
            return np.zeros((0, self.scene.channels))
        # Runs that start in the same second draw the same numbers.
        time.sleep(1.1)
        rays = np.hstack([points, normals]).astype("<f4").tobytes()
        whole = self._trace(f"-I {_POINTS}", rays)
        return np.maximum(whole - self._trace("-I -ab 0", rays), 0.0)

    def luminance(self, origins: Array, directions: Array) -> Array:
        """[K, C] cd/m2 that rays see of reflected light; one file of ambient values serves them all."""
        rays = np.hstack([origins, directions]).astype("<f4").tobytes()
        file = self.scene.folder / "picture.amb"
        options = f"{_PICTURE} -af {file.name}"
        # A first, sparse pass fills the file, so that the second interpolates between all of its values.
        sparse = np.hstack([origins, directions])[:: max(len(origins) // 4000, 1)].astype("<f4").tobytes()
        self._trace(options, sparse)
        return np.maximum(self._trace(options, rays) - self._trace("-ab 0", rays), 0.0)

    def _trace(self, options: str, rays: bytes) -> Array:
        workers = min(os.cpu_count() or 1, 8)
        words = f"rtrace -h -ff -n {workers} -av 0 0 0 {_SOURCES} {options} {self._octree}".split()
        return self.scene.read(
            np.frombuffer(run(words, data=rays, cwd=self.scene.folder), "<f4").reshape(-1, 3)
        )
