"""Models with known distributions, and a real browser, for the tests of figures and pages."""

from __future__ import annotations

import shutil
import subprocess
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import ArrayLike, NDArray

from specularia.bsdf.model import Quadrature

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Lobe:
    """A Gaussian lobe in direction cosines on top of an even background; tau in closed form.

    The lobe sits `up` above the undeflected direction, so that a turned or mirrored picture shows.
    """

    width: float = 0.03
    direct: float = 0.6
    even: float = 0.1
    up: float = 0.0
    last_deg: float = 90.0
    band: str = "520 nm"
    sides: tuple[str, ...] = ("transmission_front", "transmission_back")

    @property
    def extrapolated_beyond_deg(self) -> dict[str, float]:
        return dict.fromkeys(self.sides, 60.0)

    def evaluate(
        self, side: str, theta_i_deg: ArrayLike, phi_i_deg: ArrayLike, ux: ArrayLike, uy: ArrayLike
    ) -> Array:
        theta, phi, x, y = np.broadcast_arrays(
            np.radians(theta_i_deg), np.radians(phi_i_deg), np.asarray(ux, float), np.asarray(uy, float)
        )
        s = np.sin(theta)
        r2 = (x + s * np.cos(phi)) ** 2 + (y + s * np.sin(phi) - self.up) ** 2
        lobe = self.direct * np.exp(-r2 / (2 * self.width**2)) / (2 * np.pi * self.width**2)
        return np.where(x * x + y * y <= 1.0, lobe + self.even / np.pi, np.nan)

    def direct_hemispherical(self, side: str, theta_i_deg: ArrayLike, phi_i_deg: ArrayLike = 0.0) -> Array:
        """Exact while the lobe lies several widths inside the unit disk."""
        theta = np.asarray(theta_i_deg, float)
        return np.where(theta < self.last_deg, self.direct + self.even, np.nan)

    def quadrature(self, side: str, theta_i_deg: float, phi_i_deg: float = 0.0) -> Quadrature:
        raise NotImplementedError


@pytest.fixture
def lobe() -> type[Lobe]:
    return Lobe


@pytest.fixture(scope="session")
def chromium() -> str:
    """A real browser; tests that need it are skipped where there is none."""
    for name in ("chromium", "chromium-browser", "google-chrome", "chrome"):
        found = shutil.which(name)
        if found:
            return found
    pytest.skip("no Chromium on this machine")


@pytest.fixture
def browse(chromium: str, tmp_path: Path) -> Callable[..., tuple[str, str]]:
    """Open a file in headless Chromium: (HTML after its scripts ran, what it logged)."""

    def run(path: Path, address: str = "", width: int = 1280, *, clock: bool = False) -> tuple[str, str]:
        # By the virtual clock timers and animations run through at once; by the real one time can be told.
        wait = [] if clock else ["--virtual-time-budget=4000"]
        done = subprocess.run(
            [
                chromium,
                "--headless",
                "--no-sandbox",
                "--disable-gpu",
                "--disable-dev-shm-usage",
                "--disable-background-networking",
                "--disable-component-update",
                "--no-first-run",
                f"--user-data-dir={tmp_path / 'profile'}",
                # A frame in a process of its own would run by its own clock, not by the virtual time below.
                "--disable-features=IsolateSandboxedIframes",
                "--host-resolver-rules=MAP * ~NOTFOUND",
                "--enable-logging=stderr",
                f"--window-size={width},8000",
                # Without a graphics card WebGL is computed.
                "--enable-unsafe-swiftshader",
                *wait,
                "--dump-dom",
                path.resolve().as_uri() + address,
            ],
            capture_output=True,
            timeout=120,
            check=True,
        )
        # What the graphics driver says of itself is not the page's word.
        said = done.stderr.decode(errors="replace").splitlines(keepends=True)
        drivers = ("GL Driver Message", "software WebGL")
        return done.stdout.decode(), "".join(line for line in said if not any(d in line for d in drivers))

    return run
