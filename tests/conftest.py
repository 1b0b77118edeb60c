"""Fixtures shared by all tests."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from specularia.cli import main
from specularia.conventions import direction_angles, direction_cosines, to_radiance

SHARED = Path(__file__).resolve().parents[2] / "shared"


@pytest.fixture(scope="session")
def shared_data() -> Path:
    """Real files from others; the folder lies beside the repository and is not part of it."""
    folder = SHARED / "data"
    if not folder.is_dir():
        pytest.skip("the folder with real files (../shared/data) is not here")
    return folder


@pytest.fixture(scope="session")
def oracles() -> Path:
    """Generators of data with exactly known truth, beside the repository."""
    folder = SHARED / "oracles"
    if not folder.is_dir():
        pytest.skip("the folder with oracles (../shared/oracles) is not here")
    return folder


@pytest.fixture
def command(capsys: pytest.CaptureFixture[str]) -> Callable[..., tuple[int, Any, str]]:
    """Run a command in this process: (exit code, parsed JSON or text of stdout, text of stderr)."""

    def run(*words: str | Path) -> tuple[int, Any, str]:
        capsys.readouterr()
        code = main([str(w) for w in words])
        out, err = capsys.readouterr()
        if "--json" in words and code == 0:
            return code, json.loads(out), err
        return code, out, err

    return run


class Referee:
    """Radiance's library, through pyradiance, asked with our directions."""

    def __init__(self, folder: Path) -> None:
        from pyradiance import bsdf as library

        self.library, self.folder = library, folder
        self._kept: dict[Path, Any] = {}

    def load(self, path: Path) -> Any:
        """The file's data. They stay loaded, each under a name of its own.

        The library's cache goes by the file's name alone, and still points to data that Python let go of.
        """
        if path not in self._kept:
            copy = self.folder / f"{len(self._kept)}.xml"
            copy.write_bytes(path.read_bytes())
            self._kept[path] = self.library.load_file(str(copy))
            assert self._kept[path] is not None
        return self._kept[path]

    @staticmethod
    def _angles(theta: float, phi: float) -> tuple[float, float]:
        t, p = direction_angles(*to_radiance(*direction_cosines(theta, phi)))
        return float(t), float(p)

    def direct_hemispherical(
        self, path: Path, side: str, theta_i_deg: float, phi_i_deg: float = 0.0
    ) -> float:
        part = self.library.SAMPLE_R if side.startswith("transmission") else self.library.SAMPLE_T
        theta = theta_i_deg if side.endswith("front") else 180.0 - theta_i_deg
        return float(
            self.library.direct_hemi(
                self.load(path), *self._angles(theta, phi_i_deg), self.library.SAMPLE_ALL & ~part
            )
        )

    def query(self, path: Path, side: str, theta_i: Any, phi_i: Any, ux: Any, uy: Any) -> Any:
        front = side.endswith("front")
        up = front != side.startswith("transmission")
        out = np.empty(np.size(theta_i))
        for k in range(out.size):
            incident = self._angles(theta_i[k] if front else 180.0 - theta_i[k], phi_i[k])
            z = np.sqrt(max(1.0 - ux[k] ** 2 - uy[k] ** 2, 0.0)) * (1 if up else -1)
            t, p = direction_angles(*to_radiance(ux[k], uy[k], z))
            out[k] = self.library.query(self.load(path), *incident, float(t), float(p))[1]
        return out


@pytest.fixture(scope="session")
def referee(tmp_path_factory: pytest.TempPathFactory) -> Referee:
    return Referee(tmp_path_factory.mktemp("read_by_radiance"))
