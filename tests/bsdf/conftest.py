"""Models with known answers."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from specularia import bsdf
from specularia.bsdf.cells import grid
from specularia.bsdf.tabulated import cell_centres


@dataclass
class Chiral:
    """Analytic, reciprocal, and asymmetric in azimuth: a lobe that leaves the plane of incidence to one side.

    Seen with the light from phi_i = 0, the lobe of light on the front stands at
    (ux, uy) = (-0.7 s + 0.1, 0.25 s) with s = sin(theta_i). Light on the back follows by reciprocity.
    """

    width: float = 0.1
    tau: float = 0.6
    band: str = "Visible"
    sides: tuple[str, ...] = ("transmission_front", "transmission_back")
    isotropic: bool = True
    points: bsdf.Quadrature = field(init=False)

    def __post_init__(self) -> None:
        x, y = grid(96)
        self.points = bsdf.Quadrature(x.ravel(), y.ravel(), np.full(x.size, np.pi / x.size))

    def _front(self, ix: Any, iy: Any, ux: Any, uy: Any) -> Any:
        s = np.hypot(ix, iy)
        c = np.where(s > 0, ix / np.where(s > 0, s, 1), 1.0)
        d = np.where(s > 0, iy / np.where(s > 0, s, 1), 0.0)
        x, y = ux * c + uy * d, uy * c - ux * d
        r2 = (x + 0.7 * s - 0.1) ** 2 + (y - 0.25 * s) ** 2
        return self.tau * np.exp(-r2 / (2 * self.width**2)) / (2 * np.pi * self.width**2)

    def evaluate(self, side: str, theta_i_deg: Any, phi_i_deg: Any, ux: Any, uy: Any) -> Any:
        theta, phi, ux, uy = np.broadcast_arrays(
            np.radians(theta_i_deg), np.radians(phi_i_deg), np.asarray(ux, float), np.asarray(uy, float)
        )
        ix, iy = np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi)
        front = side == "transmission_front"
        f = self._front(ix, iy, ux, uy) if front else self._front(ux, uy, ix, iy)
        return np.where(ux**2 + uy**2 <= 1, f, np.nan)

    def direct_hemispherical(self, side: str, theta_i_deg: Any, phi_i_deg: Any = 0.0) -> Any:
        theta, _ = np.broadcast_arrays(np.asarray(theta_i_deg, float), np.asarray(phi_i_deg, float))
        f = self.evaluate(side, theta[..., None], 0.0, self.points.ux, self.points.uy)
        return np.where((theta >= 0) & (theta < 90), f @ self.points.weight, np.nan)

    def quadrature(self, side: str, theta_i_deg: float, phi_i_deg: float = 0.0) -> bsdf.Quadrature:
        return self.points


def _pane(width: float = 0.03) -> bsdf.TabulatedModel:
    """A hazy pane with a lobe of Gaussian shape, tabulated; its back is left to reciprocity."""
    theta = np.array([0.0, 20.0, 40.0, 60.0, 75.0, 82.5])
    tau = np.array([0.72, 0.71, 0.68, 0.58, 0.38, 0.20])
    half, n, m = 0.25, 48, 64
    x, y = cell_centres(n)
    offset = (np.arange(m) + 0.5) * 2 * half / m - half

    def lobe(dx: Any, dy: Any) -> Any:
        r2 = dx**2 + dy**2
        return sum(
            share * np.exp(-r2 / (2 * w**2)) / (2 * np.pi * w**2) for share, w in ((0.9, width), (0.1, 0.2))
        )

    base, patch = [], []
    for s in np.sin(np.radians(theta)):
        base.append(lobe(x + s, y))
        px, py = np.meshgrid(offset - s, offset, indexing="ij")
        patch.append(np.where(px**2 + py**2 <= 1, lobe(px + s, py), 0.0))
    mirror = [0.05 + 0 * b for b in base]
    tables = {
        "transmission_front": bsdf.SideTable(
            theta_i_deg=theta,
            base=np.array(base, np.float32),
            patch=np.array(patch, np.float32),
            half_width=half,
            tau=tau,
            tau_se=1e-3 * tau,
            origin="synthetic",
        ),
        "reflection_front": bsdf.SideTable(
            theta_i_deg=theta,
            base=np.array(mirror, np.float32),
            patch=np.zeros_like(patch, np.float32) + np.float32(0.05),
            half_width=half,
            tau=np.array([0.08, 0.08, 0.09, 0.14, 0.3, 0.5]),
            tau_se=1e-3 * tau,
            origin="synthetic",
        ),
    }
    return bsdf.TabulatedModel(
        tables=tables, band="520 nm", attributes={"synthetic": "synthetic: an example"}
    )


@pytest.fixture(scope="session")
def pane_of() -> Callable[[float], bsdf.TabulatedModel]:
    """Panes by the width of their lobe (standard deviation in direction cosines)."""
    return _pane


@pytest.fixture(scope="session")
def pane() -> bsdf.TabulatedModel:
    return _pane()


@pytest.fixture(scope="session")
def pane_xml(pane: bsdf.TabulatedModel, tmp_path_factory: pytest.TempPathFactory) -> bsdf.Written:
    """The pane as a tree at 2^6, all sides, reduced as by default."""
    return bsdf.write(pane, tmp_path_factory.mktemp("pane") / "pane.xml", resolution=6, thickness_mm=3.0)


@pytest.fixture(scope="session")
def chiral() -> Chiral:
    return Chiral()


@pytest.fixture(scope="session")
def chiral_xml(chiral: Chiral, tmp_path_factory: pytest.TempPathFactory) -> Path:
    return bsdf.write(chiral, tmp_path_factory.mktemp("chiral") / "chiral.xml", resolution=5).path


@pytest.fixture
def directions() -> Callable[[int, int], tuple[Any, Any, Any, Any]]:
    """Random pairs of directions, even in projected solid angle: theta_i, phi_i in degrees, ux, uy."""

    def draw(count: int, seed: int) -> tuple[Any, Any, Any, Any]:
        rng = np.random.default_rng(seed)
        theta = np.degrees(np.arcsin(np.sqrt(rng.uniform(0.0, 0.999, count))))
        r, a = np.sqrt(rng.uniform(0.0, 0.999, count)), rng.uniform(0.0, 2 * np.pi, count)
        return theta, rng.uniform(0.0, 360.0, count), r * np.cos(a), r * np.sin(a)

    return draw
