"""Mutated files: what is read is what stands in the file, or the file is refused with its name."""

from __future__ import annotations

import re
import warnings
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from specularia import bsdf
from specularia.bsdf.klems import BASES
from specularia.bsdf.xml_model import KlemsPart, TreePart
from specularia.conventions import SIDES
from specularia.errors import CoverageError, FormatError

_NUMBER = re.compile(rb"(?<![\w.])[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?(?![\w.])")
_NUMBERS_TO_PUT = (
    b"nan",
    b"-nan",
    b"inf",
    b"1e308",
    b"1e39",
    b"1e999",
    b"-1",
    b"1_000",
    b"two",
    b"",
    b"0x1F",
)
_WORDS = (
    (b"Transmission Front", b"Transmission Back"),
    (b"Reflection Back", b"Sideways"),
    (b"LBNL/Klems Quarter", b"LBNL/Klems Half"),
    (b"LBNL/Klems Quarter", b"My Own"),
    (b"TensorTree3", b"TensorTree4"),
    (b"TensorTree3", b"Columns"),
    (b"TensorTree4", b"TensorTree3"),
    (b"Columns", b"TensorTree3"),
    (b"Columns", b"Rows"),
    (b"Visible", b"Invisible"),
    (b"<nPhis>8</nPhis>", b"<nPhis>9</nPhis>"),
    (b"<nPhis>8</nPhis>", b"<nPhis>888888888888</nPhis>"),
    (b"<UpperTheta>27</UpperTheta>", b"<UpperTheta>nan</UpperTheta>"),
    (b"<UpperTheta>27</UpperTheta>", b"<UpperTheta>7</UpperTheta>"),
    (b"<Optical>", b"<Optical><Layer/>"),
    (b"</ScatteringData>", b"<b/>3 4</ScatteringData>"),
    (b"<ScatteringData>", b"<ScatteringData>{"),
    (b'encoding="UTF-8"', b'encoding="bogus"'),
    (b'encoding="UTF-8"', b'encoding="UTF-16"'),
    (b"<WindowElement ", b'<!DOCTYPE x [<!ENTITY a "1 2 3">]><WindowElement '),
    (b"<WindowElement ", b'<!DOCTYPE x SYSTEM "file:///etc/hostname"><WindowElement '),
    (b"<Geometry></Geometry>", b"<Geometry>" + b"<a>" * 5000 + b"</a>" * 5000 + b"</Geometry>"),
)


def _mutate(raw: bytes, rng: np.random.Generator, kind: int) -> bytes:
    """One fault of one of ten kinds, at a random place."""
    at = int(rng.integers(0, len(raw)))
    length = int(2 ** rng.uniform(0, 9))
    if kind == 0:
        return raw[:at] + bytes([raw[at] ^ (1 << int(rng.integers(0, 8)))]) + raw[at + 1 :]
    if kind == 1:
        return raw[:at] + raw[at + length :]
    if kind == 2:
        return raw[:at] + raw[at : at + length] + raw[at:]
    if kind == 3:
        return raw[:at]
    if kind == 4:
        return raw[:at] + bytes(rng.integers(0, 256, 3).tolist()) + raw[at:]
    if kind == 5:
        found = list(_NUMBER.finditer(raw, raw.index(b"<Optical>")))
        m = found[int(rng.integers(0, len(found)))]
        return raw[: m.start()] + _NUMBERS_TO_PUT[int(rng.integers(0, 11))] + raw[m.end() :]
    if kind == 6:
        fits = [(a, b) for a, b in _WORDS if a in raw]
        a, b = fits[int(rng.integers(0, len(fits)))]
        return raw.replace(a, b, 1 if rng.random() < 0.5 else -1)
    if kind == 7:
        blocks = list(re.finditer(rb"<WavelengthData>.*?</WavelengthData>", raw, re.DOTALL))
        m = blocks[int(rng.integers(0, len(blocks)))]
        return raw[: m.end()] + m.group() + raw[m.end() :]
    if kind == 8:
        found = list(_NUMBER.finditer(raw, raw.index(b"<ScatteringData>"), raw.rindex(b"</ScatteringData>")))
        m = found[int(rng.integers(0, len(found)))]
        return raw[: m.start()] + b"%.3e" % rng.uniform(0, 5) + raw[m.end() :]
    place = raw.find(rb"{" if rng.random() < 0.5 else rb"}", at)
    return raw[:place] + raw[place + 1 :] if place >= 0 else raw[:at]


def _stored(raw: bytes, band: str) -> dict[str, Any] | None:
    """The numbers of each side, found without the reader's help; None where this simple look is unsure."""
    out: dict[str, Any] = {}
    for block in re.findall(rb"<WavelengthData>(.*?)</WavelengthData>", raw, re.DOTALL):
        named = re.search(rb"<Wavelength [^>]*>\s*([^<]*?)\s*</Wavelength>", block)
        side = re.search(rb"<WavelengthDataDirection>([^<]*)</WavelengthDataDirection>", block)
        data = re.search(rb"<ScatteringData>([^<]*)</ScatteringData>", block)
        if not (named and side and data) or b"&" in data.group(1):
            return None
        if named.group(1).decode(errors="replace").casefold() != band.casefold():
            continue
        key = side.group(1).decode(errors="replace").strip().casefold().replace(" ", "_")
        if key in SIDES:
            words = re.split(rb"[\s,;{}]+", data.group(1))
            out[key] = np.sort(np.array([float(w) for w in words if w]))
    return out


def _accepted(model: bsdf.XmlModel, raw: bytes) -> bool:
    """Asserts that what was read is in the file and makes sense; whether the numbers could be compared."""
    for side in model.sides:
        tau = model.direct_hemispherical(side, [0.0, 31.0, 74.0], 20.0)
        assert np.all(np.isfinite(tau)) and np.all(tau >= 0)
        f = model.evaluate(side, 40.0, [0.0, 130.0], [-0.6, 0.1], [0.0, 0.2])
        assert np.all(np.isfinite(f)) and np.all(f >= 0)
    stored = _stored(raw, model.band)
    if not stored:
        return False
    assert set(stored) == set(model.parts)
    for side, part in model.parts.items():
        assert isinstance(part, KlemsPart | TreePart)
        mine = part.matrix if isinstance(part, KlemsPart) else part.tree.values
        np.testing.assert_allclose(np.sort(mine, axis=None), stored[side], rtol=1e-6, atol=1e-30)
    return True


@pytest.fixture(scope="module")
def seeds(shared_data: Path, chiral_xml: Path) -> dict[str, tuple[bytes, int]]:
    """Files to damage, and how often: small ones often, large ones seldom."""
    rng = np.random.default_rng(1)
    basis = BASES[2]
    parts: dict[str, Any] = {side: KlemsPart(rng.uniform(0.0, 0.3, (41, 41)), basis, basis) for side in SIDES}
    from specularia.bsdf import xml_write

    klems = xml_write.document(parts, band="Visible", more={"Solar": parts}).encode()
    real = shared_data / "bsdf_xml"
    return {
        "testBSDF": ((real / "testBSDF.xml").read_bytes(), 200),
        "quarter": (klems, 90),
        "sawtooth": ((shared_data / "geometry/sawtooth.xml").read_bytes(), 40),
        "chiral": (chiral_xml.read_bytes(), 40),
        "2011-SA1": ((real / "2011-SA1.xml").read_bytes(), 10),
        "t3": ((real / "pyradiance_t3.xml").read_bytes(), 10),
    }


@pytest.mark.parametrize("name", ["testBSDF", "quarter", "sawtooth", "chiral", "2011-SA1", "t3"])
def test_a_damaged_file_is_read_as_it_stands_or_refused(
    name: str, seeds: dict[str, tuple[bytes, int]], tmp_path: Path
) -> None:
    raw, count = seeds[name]
    rng = np.random.default_rng([7, *name.encode()])
    refused = compared = 0
    path = tmp_path / f"{name}.xml"
    for k in range(count):
        damaged = _mutate(raw, rng, k % 10)
        path.write_bytes(damaged)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            warnings.simplefilter("error", RuntimeWarning)
            try:
                model = bsdf.read(path)
            except FormatError as error:
                assert error.file == path and error.expected and error.found
                refused += 1
                continue
            except CoverageError:
                pytest.fail("a band was asked for that nobody named")
        assert isinstance(model, bsdf.XmlModel)
        compared += _accepted(model, damaged)
    assert refused >= count // 3
    assert compared >= count // 20


@pytest.mark.parametrize("number", ["nan", "inf", "1e39", "1e308", "1e11", "1_0", "\u0661"])
def test_a_value_that_cannot_be_is_refused_with_its_line(
    number: str, seeds: dict[str, tuple[bytes, int]], tmp_path: Path
) -> None:
    for name in ("testBSDF", "quarter"):
        raw = seeds[name][0]
        place = raw.index(b"<ScatteringData>")
        m = _NUMBER.search(raw, place + 40)
        assert m is not None
        path = tmp_path / "x.xml"
        path.write_bytes(raw[: m.start()] + number.encode() + raw[m.end() :])
        with pytest.raises(FormatError) as caught:
            bsdf.read(path)
        assert caught.value.line is not None
        assert caught.value.line > raw.count(b"\n", 0, place)


def test_a_side_given_twice_and_bands_that_differ_are_told(
    seeds: dict[str, tuple[bytes, int]], tmp_path: Path
) -> None:
    raw = seeds["quarter"][0]
    path = tmp_path / "x.xml"
    path.write_bytes(raw.replace(b"Reflection Back", b"Reflection Front"))
    with pytest.raises(FormatError, match="second time"):
        bsdf.read(path)
    path.write_bytes(raw.replace(b">Visible<", b">Visiblf<", 1))
    with pytest.warns(Warning, match="different sides"):
        bsdf.read(path)


def test_entities_that_grow_or_reach_outside_are_refused_at_once(tmp_path: Path) -> None:
    laughs = "".join(f'<!ENTITY l{k} "{f"&l{k - 1};" * 10}">' for k in range(1, 12))
    heads = (
        f'<!DOCTYPE x [<!ENTITY l0 "lol">{laughs}]>',
        f'<!DOCTYPE x [<!ENTITY l11 "{"a" * 100_000}">]>',
        '<!DOCTYPE x [<!ENTITY l11 SYSTEM "file:///etc/hostname">]>',
        '<!DOCTYPE x [<!ENTITY % p SYSTEM "http://localhost:9/x.dtd"> %p;]>',
        '<!DOCTYPE x SYSTEM "http://localhost:9/x.dtd">',
    )
    path = tmp_path / "x.xml"
    for head in heads:
        path.write_text(f"{head}<WindowElement><Name>&l11;</Name></WindowElement>")
        with pytest.raises(FormatError, match="refused"):
            bsdf.read(path)
