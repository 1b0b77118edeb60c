"""Matrices of models against draws from closed forms, and what conversions between matrices keep exactly."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.stats import ncx2

from specularia import bsdf
from specularia.bsdf.cells import grid
from specularia.bsdf.klems import BASES, KlemsBasis
from specularia.bsdf.to_klems import klems_part, matrix_between
from specularia.bsdf.xml_model import KlemsPart

FRONT = "transmission_front"


@dataclass
class Lobe:
    """A lobe of Gaussian shape in direction cosines that leaves the plane of incidence.

    Its tau is the share of a normal distribution within the unit disk, a noncentral chi-squared probability.
    """

    isotropic: bool
    width: float = 0.08
    tau: float = 0.6
    band: str = "Visible"
    sides: tuple[str, ...] = (FRONT,)

    def centre(self, ix: Any, iy: Any) -> tuple[Any, Any]:
        c, d = 0.8 * np.cos(0.3), 0.8 * np.sin(0.3)
        x, y = -(ix * c - iy * d), -(ix * d + iy * c)
        return (x, y) if self.isotropic else (x + 0.12, 0.5 * y + 0.2)

    def _around(self, theta: Any, phi: Any) -> tuple[Any, Any]:
        s, p = np.sin(np.radians(theta)), np.radians(phi)
        return self.centre(s * np.cos(p), s * np.sin(p))

    def evaluate(self, side: str, theta: Any, phi: Any, ux: Any, uy: Any) -> Any:
        x, y = self._around(theta, phi)
        r2 = (ux - x) ** 2 + (uy - y) ** 2
        f = self.tau * np.exp(-r2 / (2 * self.width**2)) / (2 * np.pi * self.width**2)
        return np.where(np.asarray(ux) ** 2 + np.asarray(uy) ** 2 <= 1, f, np.nan)

    def direct_hemispherical(self, side: str, theta: Any, phi: Any = 0.0) -> Any:
        x, y = self._around(theta, phi)
        return self.tau * ncx2.cdf(1 / self.width**2, 2, (x**2 + y**2) / self.width**2)

    def quadrature(self, side: str, theta: float, phi: float = 0.0) -> bsdf.Quadrature:
        x, y = grid(96)
        return bsdf.Quadrature(x.ravel(), y.ravel(), np.full(x.size, np.pi / x.size))

    def column(self, basis: KlemsBasis, patch: int, count: int) -> Any:
        """One column of the matrix, drawn: incident directions evenly, outgoing ones from the lobe itself."""
        rng = np.random.default_rng(patch)
        ring = int(np.searchsorted(basis.first, patch, side="right")) - 1
        low, high = np.sin(np.radians(basis.bounds_deg[ring : ring + 2])) ** 2
        r = np.sqrt(rng.uniform(low, high, count))
        psi = (patch - basis.first[ring] - 0.5 + rng.random(count)) * 2 * np.pi / basis.phi_count[ring]
        x, y = self.centre(r * np.cos(psi), -r * np.sin(psi))
        x, y = (v + self.width * rng.standard_normal(count) for v in (x, y))
        inside = x * x + y * y < 1
        share = np.bincount(basis.index(-x[inside], y[inside]), minlength=basis.patches) / count
        return self.tau * share / basis.solid_angle


@pytest.mark.parametrize("basis", BASES, ids=lambda b: b.name.split()[-1])
@pytest.mark.parametrize("isotropic", [True, False])
def test_a_matrix_holds_the_means_over_pairs_of_patches_and_keeps_tau(
    isotropic: bool, basis: KlemsBasis, tmp_path: Path, referee: Any
) -> None:
    model = Lobe(isotropic)
    part = klems_part(model, FRONT, basis)
    for patch in (0, 5, basis.patches // 2, basis.patches - 3):
        true = model.column(basis, patch, 300_000)
        light = float(basis.solid_angle @ true)
        assert basis.solid_angle @ np.abs(part.matrix[:, patch] - true) <= 0.015 * light
    sums = basis.solid_angle @ part.matrix
    for ring, first in enumerate(basis.first[:-1]):
        low, high = np.sin(np.radians(basis.bounds_deg[ring : ring + 2])) ** 2
        theta = np.degrees(np.arcsin(np.sqrt(low + (np.arange(200) + 0.5) / 200 * (high - low))))
        count = basis.phi_count[ring]
        for k in range(count):
            phi = -(k - 0.5 + (np.arange(48) + 0.5) / 48) * 360.0 / count
            tau = model.direct_hemispherical(FRONT, theta[:, None], phi[None, :]).mean()
            assert sums[first + k] == pytest.approx(tau, rel=1e-3)
    made = bsdf.XmlModel(parts={FRONT: part}, band="Visible", structure="Columns", bands=("Visible",))
    path = bsdf.write(made, tmp_path / "lobe.xml").path
    for theta, phi in ((0.0, 0.0), (31.0, 100.0), (60.0, 200.0), (80.0, 310.0)):
        column = int(basis.index(*(np.sin(np.radians(theta)) * f for f in _patch_direction(phi))))
        assert referee.direct_hemispherical(path, FRONT, theta, phi) == pytest.approx(sums[column], rel=1e-5)


def _patch_direction(phi: float) -> tuple[float, float]:
    return float(np.cos(np.radians(phi))), -float(np.sin(np.radians(phi)))


@pytest.fixture(scope="module")
def random_matrix() -> KlemsPart:
    return KlemsPart(np.random.default_rng(2).uniform(0.0, 0.3, (145, 145)), BASES[0], BASES[0])


@pytest.mark.parametrize("basis", BASES, ids=lambda b: b.name.split()[-1])
@pytest.mark.parametrize("angles", [[0.0], [37.3], [10.0, 90.0, 201.5]], ids=["still", "turned", "mean"])
def test_other_patches_keep_the_light_from_everywhere_to_rounding(
    basis: KlemsBasis, angles: list[float], random_matrix: KlemsPart
) -> None:
    """Light from everywhere is the sum over incident patches, whatever the patches are."""
    made = matrix_between(random_matrix, basis, angles)
    before = BASES[0].solid_angle @ random_matrix.matrix @ BASES[0].solid_angle
    assert basis.solid_angle @ made.matrix @ basis.solid_angle == pytest.approx(before, rel=1e-12)


def test_a_lambertian_matrix_stays_one_on_any_patches_at_any_angle() -> None:
    flat = KlemsPart(np.full((145, 145), 0.2), BASES[0], BASES[0])
    for basis in BASES:
        made = matrix_between(flat, basis, [12.3])
        np.testing.assert_allclose(made.matrix, 0.2, rtol=1e-12)


def test_finer_patches_keep_tau_where_they_lie_within_one() -> None:
    """Full in half: the patch around the normal of the full basis lies within that of the half one."""
    half = KlemsPart(np.random.default_rng(4).uniform(0.0, 0.3, (77, 77)), BASES[1], BASES[1])
    made = matrix_between(half, BASES[0])
    assert BASES[0].solid_angle @ made.matrix[:, 0] == pytest.approx(
        BASES[1].solid_angle @ half.matrix[:, 0], rel=1e-12
    )


def test_a_mean_over_azimuth_does_not_change_when_it_is_turned(random_matrix: KlemsPart) -> None:
    model: Any = bsdf.XmlModel(
        parts={FRONT: random_matrix}, band="Visible", structure="Columns", bands=("Visible",)
    )
    part: Any = bsdf.convert(model, isotropic=True).parts[FRONT]
    for ring, count in enumerate(BASES[0].phi_count):
        sums = BASES[0].solid_angle @ part.matrix[:, BASES[0].first[ring] : BASES[0].first[ring + 1]]
        np.testing.assert_allclose(sums, sums[0], rtol=1e-9)
        block = slice(BASES[0].first[ring], BASES[0].first[ring + 1])
        own = part.matrix[block, block]
        np.testing.assert_allclose(np.roll(own, (1, 1), (0, 1)), own, rtol=1e-9)
        assert count == own.shape[0]
