"""Synthetic tables with exactly known truth, for the tests of measured tables."""

from __future__ import annotations

import importlib.util
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from specularia import gonio

Measure = Callable[..., gonio.Table]


@pytest.fixture(scope="session")
def oracle(oracles: Path) -> Any:
    """The generator of tables from an analytic BTDF, as a module."""
    spec = importlib.util.spec_from_file_location("gonio_synthetic", oracles / "gonio_synthetic.py")
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.fixture(scope="session")
def measure(oracle: Any) -> Measure:
    """Measure the oracle's sample at few points (about 12,000), in the frame of the package."""

    def make(
        theta: float, phi: float = 0.0, *, scale: float = 0.075, seed: int = 5, **options: Any
    ) -> gonio.Table:
        counts = {
            "n_base": round(100000 * scale),
            "n_mid": round(35000 * scale),
            "n_peak": round(25000 * scale),
        }
        theta_s, phi_s, dsf = oracle.measure(
            oracle.Truth(), theta, phi, np.random.default_rng(seed), dirs=counts, **options
        )
        return gonio.Table(
            file="",
            quantity="DSF",
            side="transmission_front",
            theta_i_deg=theta,
            phi_i_deg=phi,
            theta_s_deg=theta_s,
            phi_s_deg=phi_s,
            values=dsf,
            name="analytic BTDF",
            synthetic=True,
        )

    return make


@pytest.fixture
def table_text(measure: Measure, tmp_path: Path) -> tuple[list[str], list[str]]:
    """Header and rows of a right table at theta_i = 20, phi_i = 0, to be spoiled."""
    written = gonio.write(measure(20.0, shadow=False), tmp_path / "right.dat").read_text().splitlines()
    header = [line for line in written if line.startswith("#")]
    return header, written[len(header) :]


@pytest.fixture
def save(tmp_path: Path) -> Callable[..., Path]:
    """Write lines to a file and return its path."""

    def write(lines: list[str], *, name: str = "table.dat", end: str = "\n") -> Path:
        path = tmp_path / name
        path.write_bytes((end.join(lines) + end).encode())
        return path

    return write
