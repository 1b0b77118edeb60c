"""Files read here and by Radiance give the same numbers."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from specularia import bsdf
from specularia.bsdf import xml_write
from specularia.bsdf.klems import BASES
from specularia.bsdf.tensor_tree import TensorTree
from specularia.bsdf.xml_model import KlemsPart, TreePart
from specularia.errors import SpeculariaWarning

FILES = [
    "bsdf_xml/2011-SA1.xml",
    "bsdf_xml/SEATEX_Midnight_46016.xml",
    "bsdf_xml/pyradiance_DiffuseGlass.xml",
    "bsdf_xml/pyradiance_t3.xml",
    "bsdf_xml/testBSDF.xml",
    "geometry/sawtooth.xml",
]


def _expected(model: bsdf.XmlModel, side: str, theta: Any, phi: Any, ux: Any, uy: Any) -> Any:
    """The values that Radiance's query returns for what is stored in a file.

    It takes out the smallest value as diffuse and multiplies the rest by up to 1 +- 1.5e-4 (trees) or
    1 +- 3e-4 (matrices) depending on its place, so that no two neighbours are equal (src/common/bsdf_t.c,
    SDqueryTre; src/common/bsdf_m.c, mBSDF_color). Its direct-hemispherical values are free of this.
    """
    part = model.parts[side]
    s, p = np.sin(np.radians(theta)), np.radians(phi)
    ix, iy = s * np.cos(p), s * np.sin(p)
    value: Any = model.evaluate(side, theta, phi, ux, uy)
    if isinstance(part, TreePart):
        rank, resolution = part.tree.rank, part.tree.resolution
        _, corner, _ = part.tree.locate(part.position(ix, iy, ux, uy))
        x = 2.0 * 2.0 ** np.arange(rank) / (corner + 0.01687)
        ripple = 1e-4 * np.sum(x - np.floor(x) - 0.5, axis=1)
        centres = (np.arange(1 << (resolution - 1)) + 0.5) / (1 << resolution)
        least = float(part.tree.values.min())
        if rank == 3:
            least = min(float(part.tree.outgoing(np.array([t]))[3].min()) for t in centres)
        diffuse = least if 0.01 / np.pi < least < 1.5 / np.pi else 0.0
    else:
        assert isinstance(part, KlemsPart)

        def at(column: Any, row: Any) -> Any:
            x = 2 * part.incident.patches / (column + 0.22545) + 4 * part.outgoing.patches / (row + 0.70281)
            return 6e-4 * (x - np.floor(x) - 0.5)

        row, column = part.outgoing.index(-ux, uy), part.incident.index(ix, -iy)
        ripple = at(column, row)
        rows, columns = np.indices(part.matrix.shape)
        least = float((part.matrix * (1.0 + at(columns, rows))).min())
        diffuse = least if least > 0.01 / np.pi else 0.0
    return (value - diffuse) * (1.0 + ripple) + diffuse


@pytest.mark.parametrize("name", FILES)
def test_direct_hemispherical_values_of_real_files_are_radiances(name, shared_data, referee) -> None:  # type: ignore[no-untyped-def]
    path = shared_data / name
    model = bsdf.read(path)
    assert isinstance(model, bsdf.XmlModel)
    for side in model.parts:
        for theta in (0.0, 3.0, 12.0, 33.0, 52.0, 71.0, 84.0):
            for phi in (0.0, 100.0, 217.0):
                mine = float(model.direct_hemispherical(side, theta, phi))
                assert mine == pytest.approx(referee.direct_hemispherical(path, side, theta, phi), rel=1e-5)
                q = model.quadrature(side, theta, phi)
                total = np.sum(q.weight * model.evaluate(side, theta, phi, q.ux, q.uy))
                assert total == pytest.approx(mine, rel=1e-6)


@pytest.mark.parametrize("name", FILES)
def test_values_of_real_files_are_radiances_at_random_directions(  # type: ignore[no-untyped-def]
    name, shared_data, referee, directions
) -> None:
    path = shared_data / name
    model = bsdf.read(path)
    assert isinstance(model, bsdf.XmlModel)
    for side in model.parts:
        where = directions(400, 7)
        np.testing.assert_allclose(
            _expected(model, side, *where), referee.query(path, side, *where), rtol=1e-6, atol=1e-7
        )


def test_other_bands_are_read(shared_data: Path) -> None:
    path = shared_data / "bsdf_xml" / "2011-SA1.xml"
    visible, solar = bsdf.read(path), bsdf.read(path, band="solar")
    assert solar.band == "Solar"
    assert solar.direct_hemispherical("transmission_front", 0.0) != visible.direct_hemispherical(
        "transmission_front", 0.0
    )
    assert visible.attributes["thickness_mm"] == "1"


@pytest.mark.parametrize("basis", BASES, ids=lambda b: b.name.split()[-1])
@pytest.mark.parametrize("structure", ["Columns", "Rows"])
def test_matrices_in_each_klems_basis_are_read_as_radiance_reads_them(  # type: ignore[no-untyped-def]
    basis, structure, tmp_path, referee, directions
) -> None:
    rng = np.random.default_rng(5)
    shape = (basis.patches, basis.patches)
    parts = {
        side: KlemsPart(matrix=rng.uniform(0.0, 0.3, shape), incident=basis, outgoing=basis)
        for side in xml_write.DIRECTIONS
    }
    text = xml_write.document(parts, band="Visible")
    text = text.replace(">Columns<", f">{structure}<").replace(", ", " \t" if structure == "Rows" else ",\n")
    path = tmp_path / f"{structure}{basis.patches}.xml"
    path.write_text(text)
    model = bsdf.read(path)
    for side in parts:
        where = directions(200, 11)
        np.testing.assert_allclose(
            _expected(model, side, *where), referee.query(path, side, *where), rtol=1e-6, atol=1e-7
        )
        assert float(model.direct_hemispherical(side, 47.0, 60.0)) == pytest.approx(
            referee.direct_hemispherical(path, side, 47.0, 60.0), rel=1e-6
        )


def test_a_missing_klems_side_follows_by_reciprocity_as_in_radiance(  # type: ignore[no-untyped-def]
    shared_data, tmp_path, referee, directions
) -> None:
    text = (shared_data / "bsdf_xml" / "2011-SA1.xml").read_text()
    path = tmp_path / "front.xml"
    path.write_text(re.sub("Transmission Back", "Left Out", text))
    with pytest.warns(SpeculariaWarning, match="left out"):
        model = bsdf.read(path)
    assert "transmission_back" in model.sides
    assert model.origin("transmission_back") == "reciprocity of transmission_front"
    where = directions(300, 3)
    # Radiance's query adds up to 3e-4 of its own; see `_expected`.
    np.testing.assert_allclose(
        model.evaluate("transmission_back", *where),
        referee.query(path, "transmission_back", *where),
        rtol=3.1e-4,
    )
    for theta in (0.0, 50.0):
        assert float(model.direct_hemispherical("transmission_back", theta)) == pytest.approx(
            referee.direct_hemispherical(path, "transmission_back", theta), rel=1e-5
        )


def test_trees_of_rank_4_are_read_as_radiance_reads_them_both_ways(tmp_path, referee, directions) -> None:  # type: ignore[no-untyped-def]
    rng = np.random.default_rng(2)

    def leaf() -> str:
        values = rng.uniform(0.0, 0.6, 16 if rng.random() < 0.5 else 1)
        return "{ " + " ".join(f"{v:.6f}" for v in values) + " }"

    text = "{" + "".join("{" + "".join(leaf() for _ in range(16)) + "}\n" for _ in range(16)) + "}"
    part = TreePart(TensorTree.from_text(text, 4))
    path = tmp_path / "rank4.xml"
    path.write_text(xml_write.document({"transmission_front": part}, band="Visible"))
    model = bsdf.read(path)
    assert isinstance(model, bsdf.XmlModel) and not model.isotropic
    where = directions(300, 4)
    np.testing.assert_allclose(
        _expected(model, "transmission_front", *where),
        referee.query(path, "transmission_front", *where),
        rtol=1e-6,
    )
    for side in ("transmission_front", "transmission_back"):
        for theta, phi in ((1.0, 10.0), (35.0, 120.0), (70.0, 290.0)):
            assert float(model.direct_hemispherical(side, theta, phi)) == pytest.approx(
                referee.direct_hemispherical(path, side, theta, phi), rel=1e-5
            )
