"""Tables with named columns, and tables of three colours: read right, or refused with their line."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from specularia import gonio
from specularia.errors import CoverageError, FormatError

pytestmark = pytest.mark.filterwarnings("ignore::specularia.errors.SpeculariaWarning")

TITLES = ["theta_i", "phi_i", "theta_s", "phi_s", "DSF"]
IN_FILES = [HealthCheck.function_scoped_fixture]


def angles(n: int = 40) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    rng = np.random.default_rng(4)
    return rng.uniform(91, 179, n), rng.uniform(0, 360, n), rng.normal(1.0, 0.5, n)


def text(
    titles: list[str],
    *columns: Any,
    mark: str = ",",
    comma: bool = False,
    end: str = "\n",
) -> bytes:
    lines = [mark.join(titles)]
    for row in zip(*columns):
        cells = [f"{v:.6f}" for v in row]
        lines.append(mark.join(c.replace(".", ",") if comma else c for c in cells))
    return (end.join(lines) + end).encode()


@pytest.fixture
def write(tmp_path: Path) -> Callable[[bytes], Path]:
    def make(data: bytes) -> Path:
        path = tmp_path / "table.csv"
        path.write_bytes(data)
        return path

    return make


@settings(max_examples=30, deadline=None, suppress_health_check=IN_FILES)
@given(
    order=st.permutations(range(5)),
    mark=st.sampled_from([",", ";", "\t"]),
    comma=st.booleans(),
    end=st.sampled_from(["\n", "\r\n", "\r"]),
    radians=st.booleans(),
    style=st.sampled_from(["{} [{}]", "{} ({})", "{}_{}"]),
    names=st.sampled_from(
        [("theta_i", "phi_i", "theta_s", "phi_s"), ("Theta in", "Phi in", "theta-out", "phi-out")]
    ),
    label=st.sampled_from(["DSF", "BSDF (1/sr)", "BTDF [sr^-1]", "ccBSDF"]),
    comments=st.booleans(),
)
def test_named_columns_read_the_same_in_any_dialect(
    tmp_path: Path,
    order: list[int],
    mark: str,
    comma: bool,
    end: str,
    radians: bool,
    style: str,
    names: tuple[str, ...],
    label: str,
    comments: bool,
) -> None:
    theta, phi, values = angles()
    unit, factor = ("rad", np.pi / 180) if radians else ("deg", 1.0)
    columns = [np.full(40, 33.25), np.full(40, 90.0), theta, phi]
    columns = [c * factor for c in columns] + [values]
    titles = [style.format(n, unit) for n in names] + [label]
    data = text(
        [titles[k] for k in order],
        *(columns[k] for k in order),
        mark=mark,
        comma=comma and mark == ";",
        end=end,
    )
    path = tmp_path / "table.csv"
    path.write_bytes((b"# a pane" + end.encode() if comments else b"") + data)
    (table,) = gonio.read(path)
    assert table.quantity == ("DSF" if label in ("DSF", "ccBSDF") else "BSDF")
    assert table.side == "transmission_front"
    assert table.azimuth_deg == pytest.approx(90.0, abs=1e-4)
    assert table.theta_i_deg == pytest.approx(33.25, abs=1e-4)
    np.testing.assert_allclose(table.theta_s_deg, theta, atol=1e-4)
    np.testing.assert_allclose(table.phi_s_deg, phi, atol=1e-4)
    np.testing.assert_allclose(table.values, values, atol=1e-6)


def test_several_incident_directions_in_one_file_become_several_tables(write: Any) -> None:
    theta, phi, values = angles(120)
    incident = np.repeat([20.0, 20.0, 40.0], 40)
    azimuth = np.repeat([0.0, 45.0, 0.0], 40)
    shuffled = np.random.default_rng(1).permutation(120)
    rows = [c[shuffled] for c in (incident, azimuth, theta, phi, values)]
    tables = gonio.read(write(text(TITLES, *rows)))
    assert [(t.theta_i_deg, t.phi_i_deg) for t in tables] == [(20.0, 0.0), (20.0, 45.0), (40.0, 0.0)]
    for k, table in enumerate(tables):
        here = slice(40 * k, 40 * k + 40)
        np.testing.assert_allclose(np.sort(table.values), np.sort(values[here]), atol=1e-6)


def test_the_same_sample_as_columns_and_as_pab_opto_has_one_tau(
    write: Any, measure: Any, tmp_path: Path
) -> None:
    table = measure(40.0, 30.0, scale=0.02)
    n = len(table.values)
    data = text(
        TITLES, np.full(n, 40.0), np.full(n, 30.0), table.theta_s_deg, table.phi_s_deg, 1e3 * table.values
    )
    (first,) = gonio.read(write(data))
    (second,) = gonio.read(gonio.write(table, tmp_path / "t.dat"))
    one = gonio.distribution(replace(first, values=first.values / 1e3))
    other = gonio.distribution(second)
    assert one.integral == pytest.approx(other.integral, rel=1e-4)


def test_a_column_without_a_quantity_has_to_be_named(write: Any) -> None:
    theta, phi, values = angles()
    columns = (np.full(40, 10.0), np.zeros(40), theta, phi, values)
    for title in ("value", "signal [uA]", "DSF [uA]"):
        path = write(text([*TITLES[:4], title], *columns))
        with pytest.raises(FormatError, match=r"line 1: expected DSF, BSDF.*--quantity"):
            gonio.read(path)
        (table,) = gonio.read(path, quantity="BSDF")
        assert table.quantity == "BSDF"


@pytest.mark.parametrize(
    "titles,said",
    [
        ([*TITLES[:3], "azimuth", "DSF"], r"line 1: .*no phi_s"),
        ([*TITLES[:3], "theta_s", "DSF"], r"line 1: .*no phi_s"),
        ([*TITLES[:4], "DSF", "BSDF"], r"line 1: expected one column of each kind.*several for value"),
        (["theta_i [gon]", *TITLES[1:]], r"line 1: expected theta_i in degrees or radians"),
    ],
)
def test_wrong_columns_are_refused(write: Any, titles: list[str], said: str) -> None:
    theta, phi, values = angles()
    columns = (np.full(40, 10.0), np.zeros(40), theta, phi, values, values)[: len(titles)]
    with pytest.raises(FormatError, match=said):
        gonio.read(write(text(titles, *columns)))


def test_rows_that_cannot_be_right_name_their_line(write: Any) -> None:
    theta, phi, values = angles()
    columns = (np.full(40, 10.0), np.zeros(40), theta, phi, values)
    lines = text(TITLES, *columns).decode().splitlines()
    for spoiled, said in (
        (lines[7].rsplit(",", 1)[0] + ",nan", r"line 8: .*nan"),
        (lines[7] + ",3", r"line 8: .*6 columns"),
        (lines[7].rsplit(",", 1)[0] + ",", r"line 8: .*4 columns"),
        ("# pause", r"line 8: .*a comment inside the data"),
        ("90.0,0.0,120.0,3.0,1.0", r"line 8: expected theta_i within 0 to 180 degrees, not 90"),
        ("10.0,0.0,190.0,3.0,1.0", r"line 8: expected theta_s within 0 to 180"),
    ):
        with pytest.raises(FormatError, match=said):
            gonio.read(write("\n".join([*lines[:7], spoiled, *lines[8:]]).encode()))
    radians = (np.full(40, 0.2), np.zeros(40), np.radians(theta), np.radians(phi), values)
    with pytest.raises(FormatError, match=r"line 2: expected angles in degrees.*as in radians"):
        gonio.read(write(text(TITLES, *radians)))


def test_columns_that_are_not_known_are_named(write: Any) -> None:
    theta, phi, values = angles()
    columns = (np.full(40, 10.0), np.zeros(40), theta, phi, values, values)
    (table,) = gonio.read(write(text([*TITLES, "gain"], *columns)))
    assert any("gain" in w and "not heeded" in w for w in table.warnings)


@settings(max_examples=40, deadline=None, suppress_health_check=IN_FILES)
@given(
    head=st.text(alphabet='theta_i,phi_s;DSF[] \t#\n"0.5', max_size=60),
    body=st.text(alphabet="0123456789.,;-eE \t\nx#nai", max_size=80),
)
def test_any_text_is_read_or_refused(tmp_path: Path, head: str, body: str) -> None:
    path = tmp_path / "any.csv"
    path.write_bytes((head + "\n" + body).encode())
    try:
        tables = gonio.read(path)
    except FormatError as error:
        assert error.expected and error.found
    else:
        assert all(np.isfinite(t.values).all() for t in tables)


class TestThreeColours:
    """pab-opto tables with #colorimetry: CIE-XYZ."""

    @pytest.fixture
    def coloured(self, measure: Any) -> gonio.Table:
        table: gonio.Table = measure(20.0, scale=0.02, shadow=False)
        return replace(table, others={"CIE-X": 1.1 * table.values, "CIE-Z": 0.5 * table.values})

    def test_the_y_is_taken_and_the_others_are_kept(self, coloured: gonio.Table, tmp_path: Path) -> None:
        path = gonio.write(coloured, tmp_path / "xyz.dat")
        (table,) = gonio.read(path)
        assert table.band == "Visible"
        np.testing.assert_allclose(table.values, coloured.values, rtol=1e-6)
        for band, factor in (("CIE-X", 1.1), ("CIE-Z", 0.5), ("CIE-Y", 1.0)):
            (other,) = gonio.read(path, band=band)
            assert other.band == ("Visible" if band == "CIE-Y" else band)
            np.testing.assert_allclose(other.values, factor * coloured.values, rtol=2e-6, atol=1e-12)
            assert set(other.others) == {"CIE-X", "Visible", "CIE-Z"} - {other.band}
        # Written again, byte for byte.
        assert gonio.write(table, tmp_path / "again.dat").read_bytes() == path.read_bytes()

    def test_titles_of_the_columns_may_stand_in_the_format_line(
        self, coloured: gonio.Table, tmp_path: Path
    ) -> None:
        path = gonio.write(coloured, tmp_path / "xyz.dat")
        right = path.read_text()
        for titles in ("DSF_X DSF_Y DSF_Z", "DSF X Y Z"):
            path.write_text(right.replace("theta phi DSF", f"theta phi {titles}"))
            (table,) = gonio.read(path)
            assert table.quantity == "DSF"
        path.write_text(right.replace("theta phi DSF", "theta phi X Y Z"))
        with pytest.raises(FormatError, match="--quantity"):
            gonio.read(path)

    def test_a_wrong_number_of_columns_is_refused(self, coloured: gonio.Table, tmp_path: Path) -> None:
        path = gonio.write(coloured, tmp_path / "xyz.dat")
        lines = path.read_text().splitlines()
        lines[20] = lines[20].rsplit(" ", 2)[0]
        path.write_text("\n".join(lines))
        with pytest.raises(FormatError, match=r"line 21: expected rows of five numbers.*3 columns"):
            gonio.read(path)

    def test_a_band_that_a_table_lacks_is_refused(self, measure: Any) -> None:
        with pytest.raises(CoverageError, match="holds Visible, not CIE-X"):
            measure(20.0, scale=0.01).in_band("CIE-X")

    def test_radiance_reads_three_colours(self, coloured: gonio.Table, tmp_path: Path) -> None:
        from specularia import radiance

        other = replace(coloured, theta_i_deg=0.0)
        files = [gonio.write(t, tmp_path / f"t{k}.dat") for k, t in enumerate((other, coloured))]
        out = radiance.run(["pabopto2bsdf", "-t", *files])
        assert b"COLORIMETRY=CIE-XYZ" in out[:4000].upper().replace(b" ", b"")
        assert len(out) > 1000
