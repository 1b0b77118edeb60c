"""Files that are not what they should be get an answer, never a wrong value or a crash."""

from __future__ import annotations

import re
import warnings
from pathlib import Path

import numpy as np
import pytest

from specularia import bsdf
from specularia.errors import CoverageError, FormatError, SpeculariaWarning

KLEMS = "bsdf_xml/SEATEX_Midnight_46016.xml"
TREE = "bsdf_xml/testBSDF.xml"


def _refused(path: Path, text: str | bytes) -> FormatError:
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    with pytest.raises(FormatError) as caught:
        bsdf.read(path)
    return caught.value


def test_a_missing_file_is_named(tmp_path: Path) -> None:
    with pytest.raises(FormatError, match=r"nowhere\.xml"):
        bsdf.read(tmp_path / "nowhere.xml")
    with pytest.raises(FormatError):
        bsdf.read(tmp_path)


@pytest.mark.parametrize("content", [b"", b"hello", b"\x00\x01", b"\x89HDF\r\n\x1a\nbroken"])
def test_other_content_is_refused(content: bytes, tmp_path: Path) -> None:
    _refused(tmp_path / "x.xml", content)


@pytest.mark.parametrize("text", ["<html><body/></html>", "<WindowElement/>", "<a", "<?xml version='1.0'?>"])
def test_other_xml_is_refused(text: str, tmp_path: Path) -> None:
    _refused(tmp_path / "x.xml", text)


@pytest.mark.parametrize("name", [KLEMS, TREE])
@pytest.mark.parametrize("share", [0.3, 0.6, 0.95])
def test_a_truncated_file_is_refused_with_a_line(
    name: str, share: float, shared_data: Path, tmp_path: Path
) -> None:
    text = (shared_data / name).read_text()
    error = _refused(tmp_path / "x.xml", text[: int(share * len(text))])
    assert error.line is not None and error.line > 1


def test_entities_are_refused(tmp_path: Path) -> None:
    bomb = '<!DOCTYPE x [<!ENTITY a "aaaaaaaaaa"><!ENTITY b "&a;&a;&a;">]><WindowElement>&b;</WindowElement>'
    external = '<!DOCTYPE x [<!ENTITY e SYSTEM "file:///etc/hostname">]><WindowElement>&e;</WindowElement>'
    for text in (bomb, external):
        assert "refused" in _refused(tmp_path / "x.xml", text).found


def test_data_that_cannot_be_right_are_refused_with_their_line(shared_data: Path, tmp_path: Path) -> None:
    tree, klems = (shared_data / TREE).read_text(), (shared_data / KLEMS).read_text()
    path = tmp_path / "x.xml"
    error = _refused(path, tree.replace("2.287500e+01", "two"))
    assert error.line is not None and 28 <= error.line <= 70
    assert "finite" in _refused(path, tree.replace("2.287500e+01", "nan")).expected
    assert "values in a leaf" in _refused(path, tree.replace("{ 3.225000e+01 }", "{ 3.2 3.3 }")).expected
    _refused(path, tree.replace("{ 3.225000e+01 }", ""))
    _refused(path, tree.replace("TensorTree3", "TensorTree5"))
    error = _refused(path, klems.replace("1.614498,", "", 1))
    assert "21025" in error.expected and error.found == "21024"
    assert error.line is not None and error.line > 100
    _refused(path, klems.replace("1.614498,", "1.61x,", 1))
    _refused(path, re.sub("<RowAngleBasis>LBNL/Klems Full", "<RowAngleBasis>My Own", klems))
    _refused(path, re.sub("<WavelengthDataDirection>[^<]*", "<WavelengthDataDirection>Sideways", klems))


def test_odd_spellings_are_read(shared_data: Path, tmp_path: Path) -> None:
    text = (shared_data / KLEMS).read_text()
    plain = bsdf.read(shared_data / KLEMS)
    odd = text.replace("Transmission Front", " transmission  FRONT ").replace(
        "LBNL/Klems Full", " lbnl/klems full "
    )
    odd = odd.replace(">Columns<", "> columns\n<").replace(">Visible<", "> visible <")
    odd = odd.replace('unit="Millimeter">0.48', 'unit="inch">').replace(",", " ;\t")
    path = tmp_path / "odd.xml"
    path.write_text(odd)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        model = bsdf.read(path)
    assert "thickness_mm" not in model.attributes and plain.attributes["thickness_mm"] == "0.48"
    np.testing.assert_array_equal(
        model.direct_hemispherical("transmission_front", [0.0, 44.0]),
        plain.direct_hemispherical("transmission_front", [0.0, 44.0]),
    )


def test_negative_values_count_as_zero_with_one_warning(shared_data: Path, tmp_path: Path) -> None:
    path = tmp_path / "x.xml"
    path.write_text((shared_data / TREE).read_text().replace("3.225000e+01", "-5", 1))
    with pytest.warns(SpeculariaWarning, match="1 negative") as caught:
        model = bsdf.read(path)
    assert len(caught) == 1
    assert float(model.direct_hemispherical("reflection_back", 22.0)) == pytest.approx(
        79.730 - np.pi * 32.25 / 16, abs=0.01
    )


def test_a_band_or_side_that_is_not_there_is_said_to_be_missing(shared_data: Path) -> None:
    with pytest.raises(CoverageError, match="Visible, Solar"):
        bsdf.read(shared_data / KLEMS, band="CIE-X")
    with pytest.raises(CoverageError, match="reflection_back"):
        bsdf.read(shared_data / TREE).evaluate("transmission_front", 0.0, 0.0, 0.0, 0.0)


def test_directions_outside_are_nan_not_a_number_from_elsewhere(pane_xml: bsdf.Written) -> None:
    model = pane_xml.model
    assert np.isnan(model.evaluate("transmission_front", 20.0, 0.0, 0.9, 0.9))
    assert np.isnan(model.evaluate("transmission_front", [90.0, -1.0, 120.0], 0.0, 0.0, 0.0)).all()
    assert np.isnan(model.direct_hemispherical("transmission_front", [90.0, -1.0, np.nan])).all()
