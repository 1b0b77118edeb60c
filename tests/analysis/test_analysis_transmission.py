"""Table 1: measured values, models and the clear slab, with errors that add up."""

from __future__ import annotations

import csv
from dataclasses import dataclass, field

import numpy as np
import pytest

from specularia import analysis
from specularia.analysis import TauPoints, measured_tau, table_1, write_table_1
from specularia.bsdf.tabulated import SideTable, TabulatedModel, cell_centres
from specularia.errors import CoverageError, PhysicsError, SpeculariaWarning
from specularia.gonio import Table

THETA = np.array([0.0, 20.0, 40.0, 60.0, 82.5])
# The paper's Table 1.
MEASURED = TauPoints(THETA, np.array([0.697, 0.676, 0.579, 0.410, 0.158]), np.full(5, 0.002), band="520 nm")
PAPER_C = np.array([0.860, 0.835, 0.713, 0.497, 0.266])


@dataclass(frozen=True)
class Known:
    """A model that knows its tau at the measured angles."""

    tau: np.ndarray
    band: str = "520 nm"
    sides: tuple[str, ...] = ("transmission_front",)
    extrapolated_beyond_deg: dict[str, float] = field(default_factory=lambda: {"transmission_front": 60.0})

    def direct_hemispherical(self, side, theta_i_deg, phi_i_deg=0.0):
        return np.interp(theta_i_deg, THETA, self.tau)


def lambertian(tau: float, se: float) -> TabulatedModel:
    """An even model with the standard error se at 0 and 2 se at 60 degrees."""
    x, _ = cell_centres(8)
    base = np.full((2, *x.shape), tau / np.pi, np.float32)
    table = SideTable(
        np.array([0.0, 60.0]), base, base, 0.3, np.full(2, tau), np.array([se, 2 * se]), "measured"
    )
    return TabulatedModel({"transmission_front": table}, band="520 nm")


def test_the_ratio_of_model_c_to_the_measurement_is_that_of_the_paper():
    table = table_1(MEASURED, {"C": Known(PAPER_C)}, index=1.52, thickness_mm=3.0)
    assert table.rows == ("measured", "C", "clear slab")
    np.testing.assert_allclose(100 * (table.ratio[1] - 1), [23.4, 23.5, 23.1, 21.2, 68.4], atol=0.06)
    np.testing.assert_array_equal(table.tau[0], MEASURED.tau)
    assert np.isnan(table.ratio[0]).all()
    assert table.band == "520 nm"


def test_the_clear_slab_keeps_polarisation_and_may_absorb():
    table = table_1(None, {}, THETA, index=1.52, thickness_mm=3.0)
    np.testing.assert_allclose(table.tau[-1, [0, 3, 4]], [0.9183, 0.8435, 0.3568], atol=5e-5)
    assert (table.se[-1] == 0).all()
    yellow = table_1(None, {}, [0.0], index=1.52, thickness_mm=3.0, absorption_per_mm=0.07)
    assert yellow.tau[-1, 0] / table.tau[-1, 0] == pytest.approx(np.exp(-0.21), rel=2e-3)


def test_standard_errors_of_ratios_agree_with_a_simulation():
    model = lambertian(0.8, 0.004)
    table = table_1(MEASURED, {"M": model}, [0.0], index=1.52, thickness_mm=3.0)
    rng = np.random.default_rng(1)
    drawn = rng.normal(0.8, 0.004, 400_000) / rng.normal(0.697, 0.002, 400_000)
    assert table.ratio_se[1, 0] == pytest.approx(drawn.std(), rel=0.01)


def test_standard_errors_are_interpolated_between_the_angles_of_a_model_and_unknown_beyond():
    table = table_1(
        None, {"M": lambertian(0.8, 0.004)}, [0.0, 30.0, 60.0, 80.0], index=1.52, thickness_mm=3.0
    )
    np.testing.assert_allclose(table.se[0, :3], [0.004, 0.006, 0.008])
    assert np.isnan(table.se[0, 3])
    np.testing.assert_array_equal(table.extrapolated[0], [False, False, False, True])


def test_angles_that_were_not_measured_stay_empty():
    table = table_1(MEASURED, {"C": Known(PAPER_C)}, [0.0, 30.0], index=1.52, thickness_mm=3.0)
    assert table.tau[0, 0] == 0.697
    assert np.isnan(table.tau[0, 1])
    assert np.isnan(table.ratio[1, 1])
    assert np.isfinite(table.tau[1]).all()


def test_rows_of_different_bands_are_told():
    with pytest.warns(SpeculariaWarning, match="different bands"):
        table = table_1(MEASURED, {"C": Known(PAPER_C, band="Visible")}, index=1.52, thickness_mm=3.0)
    assert table.band == "520 nm / Visible"


def test_angles_are_needed_without_a_measurement():
    with pytest.raises(PhysicsError):
        table_1(None, {}, index=1.52, thickness_mm=3.0)


def even_table(theta_i: float, tau: float, side: str = "transmission_front", band: str = "520 nm") -> Table:
    """A measured Lambertian distribution."""
    theta, phi = np.meshgrid(np.arange(0.5, 90.0, 1.0), np.arange(0.0, 360.0, 2.0))
    return Table(
        file=f"even_{theta_i}.txt",
        quantity="BSDF",
        side=side,
        theta_i_deg=theta_i,
        phi_i_deg=0.0,
        theta_s_deg=180.0 - theta.ravel() if side.startswith("transmission") else theta.ravel(),
        phi_s_deg=phi.ravel(),
        values=np.full(theta.size, tau / np.pi),
        band=band,
    )


def test_measured_tables_are_integrated_and_sorted_by_angle():
    points = measured_tau(
        [even_table(40.0, 0.5), even_table(0.0, 0.6), even_table(0.0, 0.1, "reflection_front")]
    )
    np.testing.assert_array_equal(points.theta_deg, [0.0, 40.0])
    np.testing.assert_allclose(points.tau, [0.6, 0.5], rtol=2e-3)
    assert (points.se >= 0).all()
    assert points.band == "520 nm"
    reflected = measured_tau([even_table(0.0, 0.1, "reflection_front")], side="reflection_front")
    np.testing.assert_allclose(reflected.tau, 0.1, rtol=2e-3)


def test_tables_of_several_bands_or_of_no_fitting_side_are_refused():
    with pytest.raises(PhysicsError, match="several bands"):
        measured_tau([even_table(0.0, 0.6), even_table(20.0, 0.6, band="Visible")])
    with pytest.raises(CoverageError):
        measured_tau([even_table(0.0, 0.1, "reflection_front")])


def test_several_tables_at_one_angle_make_one_column_of_their_mean():
    points = TauPoints(np.array([0.0, 0.0]), np.array([0.6, 0.7]), np.array([0.01, 0.01]), "520 nm")
    table = table_1(points, {}, index=1.52, thickness_mm=3.0)
    np.testing.assert_array_equal(table.theta_deg, [0.0])
    assert table.tau[0, 0] == pytest.approx(0.65)
    assert table.se[0, 0] == pytest.approx(0.01 / np.sqrt(2))


def test_the_written_table_holds_all_values(tmp_path):
    table = table_1(MEASURED, {"C": Known(PAPER_C)}, index=1.52, thickness_mm=3.0)
    path = write_table_1(table, tmp_path / "table_1.csv")
    with path.open(newline="", encoding="utf-8") as f:
        rows = list(csv.DictReader(f))
    assert len(rows) == 15
    chosen = [r for r in rows if r["source"] == "C"]
    np.testing.assert_array_equal([float(r["tau"]) for r in chosen], table.tau[1])
    np.testing.assert_array_equal([float(r["ratio_to_measured"]) for r in chosen], table.ratio[1])
    assert [r["extrapolated"] for r in chosen] == ["0", "0", "0", "0", "1"]
    assert {r["tau_se"] for r in chosen} == {""}  # this model carries none


def test_public_names_are_listed():
    assert set(analysis.__all__) <= set(dir(analysis))
