"""Files written again hold the same numbers, in all bands and on all sides, and Radiance loads them."""

from __future__ import annotations

import warnings
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from specularia import bsdf
from specularia.bsdf.klems import BASES, KlemsBasis
from specularia.bsdf.xml_model import KlemsPart, TreePart, XmlModel
from specularia.conventions import SIDES

FILES = [
    "bsdf_xml/2011-SA1.xml",
    "bsdf_xml/SEATEX_Midnight_46016.xml",
    "bsdf_xml/pyradiance_DiffuseGlass.xml",
    "bsdf_xml/pyradiance_t3.xml",
    "bsdf_xml/testBSDF.xml",
    "geometry/sawtooth.xml",
]


def _values(part: Any) -> Any:
    return np.maximum(part.matrix if isinstance(part, KlemsPart) else part.tree.values, 0.0)


@pytest.mark.parametrize("name", FILES)
def test_real_files_written_again_keep_every_band_side_and_value(
    name: str, shared_data: Path, tmp_path: Path, referee: Any
) -> None:
    first = bsdf.read(shared_data / name)
    assert isinstance(first, XmlModel)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        path = bsdf.write(first, tmp_path / "again.xml").path
    for band in first.bands:
        before, after = bsdf.read(shared_data / name, band=band), bsdf.read(path, band=band)
        assert isinstance(before, XmlModel) and isinstance(after, XmlModel)
        assert after.bands == first.bands and after.geometry == before.geometry
        assert after.structure == before.structure and set(after.parts) == set(before.parts)
        for side, part in before.parts.items():
            again = after.parts[side]
            np.testing.assert_allclose(_values(again), _values(part), rtol=1e-6, atol=0)
            if isinstance(part, TreePart):
                assert isinstance(again, TreePart)
                np.testing.assert_array_equal(again.tree.log2, part.tree.log2)
                np.testing.assert_array_equal(again.tree.child, part.tree.child)
            else:
                assert isinstance(part, KlemsPart) and isinstance(again, KlemsPart)
                assert again.incident == part.incident and again.outgoing == part.outgoing
    for side in first.parts:
        for theta, phi in ((0.0, 0.0), (38.0, 70.0), (66.0, 250.0)):
            read = referee.direct_hemispherical(path, side, theta, phi)
            assert read == pytest.approx(float(first.direct_hemispherical(side, theta, phi)), rel=1e-5)


def test_bands_of_one_file_stay_apart(shared_data: Path, tmp_path: Path) -> None:
    first = shared_data / "bsdf_xml/2011-SA1.xml"
    again = bsdf.write(bsdf.read(first, band="Solar"), tmp_path / "again.xml").path
    found = {b: bsdf.read(again, band=b) for b in ("Visible", "Solar")}
    true = {b: bsdf.read(first, band=b) for b in ("Visible", "Solar")}
    side = "transmission_front"
    assert true["Visible"].direct_hemispherical(side, 0.0) != true["Solar"].direct_hemispherical(side, 0.0)
    for b, model in found.items():
        assert float(model.direct_hemispherical(side, 0.0)) == pytest.approx(
            float(true[b].direct_hemispherical(side, 0.0)), rel=1e-6
        )


def test_bands_that_the_format_does_not_know_keep_their_names_on_rewriting(
    shared_data: Path, tmp_path: Path
) -> None:
    first = tmp_path / "first.xml"
    text = (shared_data / "bsdf_xml/2011-SA1.xml").read_text()
    first.write_text(text.replace(">Solar<", ">CIE-Y<"))
    again = bsdf.write(bsdf.read(first, band="CIE-Y"), tmp_path / "again.xml").path
    for band in ("Visible", "CIE-Y"):
        before, after = bsdf.read(first, band=band), bsdf.read(again, band=band)
        assert isinstance(after, XmlModel) and after.bands == ("Visible", "CIE-Y")
        assert float(after.direct_hemispherical("transmission_front", 0.0)) == pytest.approx(
            float(before.direct_hemispherical("transmission_front", 0.0)), rel=1e-6
        )


def test_a_basis_of_ones_own_with_odd_bounds_is_kept_on_rewriting(tmp_path: Path, referee: Any) -> None:
    own = KlemsBasis("My Own", (0.0, 10.123456789, 48.3, 90.0), (1, 6, 10))
    rng = np.random.default_rng(3)
    parts: Any = {s: KlemsPart(rng.uniform(0, 0.3, (17, 17)), own, own) for s in SIDES}
    model = XmlModel(parts=parts, band="Visible", structure="Columns", bands=("Visible",))
    path = bsdf.write(model, tmp_path / "own.xml").path
    again = bsdf.read(path)
    assert isinstance(again, XmlModel)
    part = again.parts["transmission_front"]
    assert isinstance(part, KlemsPart) and part.incident.phi_count == own.phi_count
    np.testing.assert_allclose(part.incident.bounds_deg, own.bounds_deg, rtol=1e-9)
    for side in SIDES:
        assert referee.direct_hemispherical(path, side, 30.0, 12.0) == pytest.approx(
            float(model.direct_hemispherical(side, 30.0, 12.0)), rel=1e-5
        )


@pytest.mark.parametrize("basis", BASES, ids=lambda b: b.name.split()[-1])
def test_matrices_written_in_each_klems_basis_are_loaded_by_radiance(
    basis: KlemsBasis, tmp_path: Path, referee: Any
) -> None:
    rng = np.random.default_rng(4)
    shape = (basis.patches, basis.patches)
    parts: Any = {s: KlemsPart(rng.uniform(0, 0.3, shape), basis, basis) for s in SIDES}
    model = XmlModel(parts=parts, band="Visible", structure="Columns", bands=("Visible",))
    path = bsdf.write(model, tmp_path / "k.xml").path
    for side in SIDES:
        for theta, phi in ((0.0, 0.0), (41.0, 200.0), (80.0, 77.0)):
            assert referee.direct_hemispherical(path, side, theta, phi) == pytest.approx(
                float(model.direct_hemispherical(side, theta, phi)), rel=1e-5
            )
