"""Readers give back what was written, in the frame of the package, whatever the dialect of the file."""

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
from specularia.errors import FormatError, PhysicsError, SpeculariaWarning

pytestmark = pytest.mark.filterwarnings("ignore::specularia.errors.SpeculariaWarning")

AS_FILES_COME = settings(
    max_examples=60, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture]
)


def rows_of(theta: np.ndarray, phi: np.ndarray, values: np.ndarray) -> list[tuple[str, str, str]]:
    return [(f"{t:.4f}", f"{p:.4f}", f"{v:.6e}") for t, p, v in zip(theta, phi, values)]


def same_azimuth(a: Any, b: Any) -> np.ndarray:
    return np.abs((np.asarray(a) - np.asarray(b) + 180) % 360 - 180)


@AS_FILES_COME
@given(
    order=st.permutations(range(6)),
    separator=st.sampled_from([" ", "\t", "   ", " \t"]),
    end=st.sampled_from(["\n", "\r\n", "\r"]),
    signed=st.booleans(),
    blank_lines=st.booleans(),
    key_style=st.sampled_from(["#{} {}", "#{}\t{}", "#{}: {}", "# {} {}", "#{}={}"]),
    incident=st.sampled_from(["incident_angle", "intheta and inphi"]),
    upphi=st.sampled_from([None, 0.0, 90.0, 45.5, 270.0, -90.0]),
    label=st.sampled_from(["DSF", "BSDF", "BTDF", "dsf"]),
    phi_i=st.sampled_from([0.0, 90.0, 180.0, -90.0, 347.25]),
    bom=st.booleans(),
)
def test_every_dialect_of_a_table_reads_the_same(
    tmp_path: Path,
    order: list[int],
    separator: str,
    end: str,
    signed: bool,
    blank_lines: bool,
    key_style: str,
    incident: str,
    upphi: float | None,
    label: str,
    phi_i: float,
    bom: bool,
) -> None:
    rng = np.random.default_rng(3)
    theta, phi = rng.uniform(91, 179, 50), rng.uniform(0, 360, 50)
    values = rng.normal(1.0, 1.0, 50)
    shown = np.where(signed & (phi > 180), phi - 360, phi)
    rows = rows_of(theta, shown, values)
    angles = (
        [key_style.format("incident_angle", f"33.25{separator}{phi_i:g}")]
        if incident == "incident_angle"
        else [key_style.format("intheta", "33.25"), key_style.format("inphi", f"{phi_i:g}")]
    )
    entries = [
        [key_style.format("format", f"theta{separator}phi{separator}{label}")],
        angles,
        [] if upphi is None else [key_style.format("upphi", f"{upphi:g}")],
        [key_style.format("datapoints_in_file", "50")],
        ["#colorimetry: CIE-Y", "#"],
        ['#sample_name "a pane"'],
    ]
    lines = [line for k in order for line in entries[k]]
    lines += [separator.join(row) for row in rows]
    if blank_lines:
        lines = [piece for line in lines for piece in ("", line)]
    path = tmp_path / "dialect.txt"
    path.write_bytes((b"\xef\xbb\xbf" if bom else b"") + end.join(lines).encode())
    (table,) = gonio.read(path)
    assert table.quantity == ("DSF" if label.upper() == "DSF" else "BSDF")
    assert table.side == "transmission_front"
    assert (table.theta_i_deg, table.phi_i_deg) == (33.25, phi_i)
    turned = 90.0 - (upphi or 0.0)
    assert same_azimuth(table.azimuth_deg, phi_i + turned) < 1e-9
    np.testing.assert_allclose(table.theta_s_deg, theta, atol=6e-5)
    assert same_azimuth(table.phi_s_deg, phi + turned).max() < 6e-5
    np.testing.assert_allclose(table.values, values, rtol=1e-6)
    assert table.name == "a pane" and table.band == "Visible"


@AS_FILES_COME
@given(
    up=st.sampled_from([0.0, 90.0, 33.5, -120.0]),
    theta_i=st.sampled_from([0.0, 60.0, 120.0, 180.0]),
    quantity=st.sampled_from(["DSF", "BSDF"]),
    band=st.sampled_from(["Visible", "520 nm"]),
    synthetic=st.booleans(),
    seed=st.integers(0, 1000),
)
def test_a_written_table_reads_back(
    tmp_path: Path, up: float, theta_i: float, quantity: str, band: str, synthetic: bool, seed: int
) -> None:
    rng = np.random.default_rng(seed)
    n = 40
    there = rng.uniform(0, 89, n) if theta_i > 90 else rng.uniform(91, 180, n)
    table = gonio.Table(
        file="",
        quantity=quantity,
        side="transmission_front" if theta_i < 90 else "transmission_back",
        theta_i_deg=theta_i,
        phi_i_deg=12.5,
        theta_s_deg=there,
        phi_s_deg=rng.uniform(0, 360, n),
        values=rng.normal(size=n),
        up_phi_deg=up,
        band=band,
        name="a pane",
        synthetic=synthetic,
    )
    (back,) = gonio.read(gonio.write(table, tmp_path / "t.dat"))
    for name in ("quantity", "side", "theta_i_deg", "phi_i_deg", "up_phi_deg", "band", "name", "synthetic"):
        assert getattr(back, name) == getattr(table, name), name
    np.testing.assert_allclose(back.theta_s_deg, table.theta_s_deg, atol=6e-5)
    assert same_azimuth(back.phi_s_deg, table.phi_s_deg).max() < 6e-5
    np.testing.assert_allclose(back.values, table.values, rtol=1e-6, atol=1e-12)
    assert back.azimuth_deg == pytest.approx(table.azimuth_deg)


@settings(max_examples=80, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(text=st.text(alphabet="0123456789.+-eE \t\nx#,naif", max_size=120))
def test_any_rows_are_either_read_or_refused_with_a_line(tmp_path: Path, text: str) -> None:
    path = tmp_path / "any.dat"
    good = [f"{100 + k}.5 {10 * k} 0.5" for k in range(20)]
    lines = ["#format: theta phi DSF", "#incident_angle 10 0", *good, text, *good]
    path.write_text("\n".join(lines))
    expected: list[list[float]] = []
    right = True
    for line in lines[2:][0:20] + text.split("\n") + good:
        words = line.split()
        if not words:
            continue
        try:
            numbers = [float(w) for w in words]
        except ValueError:
            numbers = []
        right &= len(numbers) == 3 and bool(np.isfinite(numbers).all())
        right &= right and 0 <= numbers[0] <= 180 and abs(numbers[1]) <= 360
        expected.append(numbers)
    if right:
        tables = gonio.read(path)
        assert sum(len(t.values) for t in tables) in (len(expected), sum(r[0] >= 90 for r in expected))
    else:
        with pytest.raises(FormatError) as caught:
            gonio.read(path)
        assert caught.value.line is not None and caught.value.line > 22


@pytest.mark.parametrize("theta_i,face", [(20.0, "front"), (160.0, "back")])
def test_the_side_of_the_light_is_reflection_and_the_far_side_transmission(
    tmp_path: Path, theta_i: float, face: str
) -> None:
    rng = np.random.default_rng(1)
    path = tmp_path / "both.dat"
    theta = np.concatenate([rng.uniform(0, 89, 30), rng.uniform(91, 180, 50)])
    rows = rows_of(theta, rng.uniform(0, 360, 80), np.full(80, 0.1))
    lines = ["#format: theta phi BSDF", f"#incident_angle {theta_i} 0", *(" ".join(r) for r in rows)]
    path.write_text("\n".join(lines))
    with pytest.warns(SpeculariaWarning, match="both hemispheres"):
        tables = gonio.read(path)
    assert [t.side for t in tables] == [f"transmission_{face}", f"reflection_{face}"]
    assert [len(t.values) for t in tables] == ([50, 30] if face == "front" else [30, 50])
    assert all(t.polar_deg == 20.0 for t in tables)


def test_a_few_stray_points_of_the_other_hemisphere_are_left_out(tmp_path: Path) -> None:
    theta = np.concatenate([np.linspace(91, 179, 60), np.full(5, 89.5)])
    rows = rows_of(theta, np.linspace(0, 350, 65), np.full(65, 0.1))
    path = tmp_path / "stray.dat"
    path.write_text("\n".join(["#format: theta phi BSDF", "#incident_angle 20 0", *map(" ".join, rows)]))
    with pytest.warns(SpeculariaWarning, match="60 points transmitted, 5 reflected; reflection is left out"):
        (table,) = gonio.read(path)
    assert table.kind == "transmission" and len(table.values) == 60


def test_headers_that_disagree_on_the_incident_direction_are_warned_of(tmp_path: Path) -> None:
    rows = rows_of(np.linspace(91, 179, 60), np.linspace(0, 350, 60), np.full(60, 0.1))
    path = tmp_path / "two.dat"
    lines = ["#format: theta phi BSDF", "#intheta 30", "#inphi 0", "#incident_angle 20 0"]
    path.write_text("\n".join([*lines, *map(" ".join, rows)]))
    with pytest.warns(SpeculariaWarning, match="differ"):
        (table,) = gonio.read(path)
    assert table.theta_i_deg == 20.0


class TestRawExports:
    """Instrument files whose unit is neither DSF nor BSDF."""

    @pytest.fixture
    def raw(self, measure: Any, tmp_path: Path) -> Callable[..., Path]:
        def make(*, integral: float | None, theta_max: float = 90.0) -> Path:
            table = measure(60.0, shadow=False)
            low = table.theta_s_deg > 180.0 - theta_max
            signed = (table.phi_s_deg + 180) % 360 - 180
            rows = rows_of(table.theta_s_deg[low], signed[low], table.values[low])
            lines = [
                '#mountain-version\t"1.0"',
                "#incident_angle\t60.0000\t0",
                f"#datapoints_in_file\t{len(rows)}",
                *([] if integral is None else [f"#front_integral\t{integral}"]),
                "#format: theta\tphi\t[uA]",
                *("\t".join(r) for r in rows),
            ]
            path = tmp_path / "raw.txt"
            path.write_bytes("\r\n".join(lines).encode())
            return path

        return make

    def test_the_quantity_has_to_be_stated(self, raw: Callable[..., Path]) -> None:
        with pytest.raises(FormatError, match=r"line 4: expected DSF.*uA.*--quantity"):
            gonio.read(raw(integral=None))
        (table,) = gonio.read(raw(integral=None), quantity="DSF")
        assert table.quantity == "DSF"

    def test_the_files_own_integral_proves_dsf(self, raw: Callable[..., Path]) -> None:
        with pytest.warns(SpeculariaWarning, match="taken as DSF"):
            (table,) = gonio.read(raw(integral=0.41))
        assert table.quantity == "DSF" and table.up_phi_deg == 0.0
        assert gonio.integrate(table)[0] == pytest.approx(0.41, rel=0.01)

    def test_the_integral_is_carried_on_to_the_horizon(self, raw: Callable[..., Path]) -> None:
        (table,) = gonio.read(raw(integral=0.41, theta_max=82.0))
        assert gonio.integrate(table)[0] == pytest.approx(0.41, rel=0.02)

    def test_an_integral_that_fits_neither_reading_proves_nothing(self, raw: Callable[..., Path]) -> None:
        with pytest.raises(FormatError, match="does not prove"):
            gonio.read(raw(integral=3.1))


class TestViavi:
    """The vendor's text format, on real files."""

    def test_straight_through_leaves_opposite_to_the_light(self, shared_data: Path) -> None:
        for theta in (0, 10, 20):
            (table,) = gonio.read(shared_data / "gonio" / "eds10" / f"EDS10_{theta}-0.txt")
            assert (table.side, table.quantity) == ("transmission_front", "BSDF")
            assert (table.theta_i_deg, table.phi_i_deg) == (theta, 0.0)
            assert table.theta_s_deg.min() >= 95.0 and table.theta_s_deg.max() == 180.0
            weight = table.values * np.sin(np.radians(table.theta_s_deg)) * table.cos_s
            middle = np.sum(weight * table.ux) / weight.sum(), np.sum(weight * table.uy) / weight.sum()
            assert middle == pytest.approx((-np.sin(np.radians(theta)), 0.0), abs=0.02)

    def test_the_pole_counts_as_one_direction(self, shared_data: Path) -> None:
        path = shared_data / "gonio" / "eds10" / "EDS10_10-0.txt"
        with pytest.warns(SpeculariaWarning, match="359 rows repeat a direction, 360 of them at the pole"):
            (table,) = gonio.read(path)
        pole = table.values[table.theta_s_deg == 180.0]
        assert pole.size == 360 and np.ptp(pole) > 0
        found = gonio.distribution(table)
        assert found.at(np.zeros(1), np.zeros(1)) == pytest.approx(pole.mean())

    def test_the_user_can_say_that_it_is_reflection(self, shared_data: Path) -> None:
        path = shared_data / "gonio" / "eds10" / "EDS10_10-0.txt"
        (table,) = gonio.read(path, side="reflection", quantity="DSF", wavelength_nm=633)
        assert not any("taken as" in w for w in table.warnings)
        assert (table.side, table.quantity, table.band) == ("reflection_front", "DSF", "633 nm")
        assert table.theta_s_deg.max() <= 85.0

    def test_faults_name_the_line(self, shared_data: Path, tmp_path: Path) -> None:
        lines = (shared_data / "gonio" / "eds10" / "EDS10_0-0.txt").read_text().splitlines()
        path = tmp_path / "bad.txt"
        for spoiled, said in (
            ([*lines[:100], "1.0\tnan\t2.0", *lines[101:]], r"line 101: .*nan"),
            ([lines[0], "!!Intensity Data", *lines[2:]], r"line 2: expected a line '!!BSDF Data'"),
            ([lines[0], *lines[2:]], "without the quantity"),
            ([*lines[:2], "0.000", *lines[3:]], "line 3: expected the incident direction"),
            ([*lines[:40], "91.0\t1.0\t2.0", *lines[40:]], "line 41: expected theta_s within 0 to 90"),
        ):
            path.write_text("\n".join(spoiled))
            with pytest.raises(FormatError, match=said):
                gonio.read(path)


def test_the_azimuth_convention_holds_for_upphi_90_0_and_none(measure: Any, tmp_path: Path) -> None:
    """One sample measured in three frames is one distribution: the lobe leaves opposite to the light."""
    for upphi, phi_file in ((90.0, 30.0), (0.0, 300.0), (None, 300.0)):
        ours = measure(40.0, 30.0, shadow=False)
        table = replace(ours, phi_i_deg=phi_file, up_phi_deg=upphi or 0.0)
        text = gonio.write(table, tmp_path / "frame.dat").read_text()
        if upphi is None:
            text = "\n".join(line for line in text.splitlines() if not line.startswith("#upphi"))
            (tmp_path / "frame.dat").write_text(text)
        (back,) = gonio.read(tmp_path / "frame.dat")
        assert back.phi_i_deg == phi_file
        assert back.azimuth_deg == pytest.approx(30.0)
        brightest = np.argsort(back.values)[-200:]
        lobe = np.mean(back.ux[brightest]), np.mean(back.uy[brightest])
        s = np.sin(np.radians(40.0))
        assert lobe == pytest.approx((-s * np.cos(np.pi / 6), -s * np.sin(np.pi / 6)), abs=0.01)
        # In the model's frame the light comes from phi_i = 0.
        found = gonio.distribution(back)
        x, y = np.meshgrid(np.linspace(-0.7, -0.6, 41), np.linspace(-0.05, 0.05, 41), indexing="ij")
        k = np.argmax(found.at(x, y))
        assert (x.flat[k], y.flat[k]) == pytest.approx((-s, 0.0), abs=0.02)


def test_radiance_reads_what_is_written(measure: Any, tmp_path: Path) -> None:
    from specularia import radiance

    files = [
        gonio.write(replace(measure(theta, scale=0.02, shadow=False), file=""), tmp_path / f"t{theta:g}.dat")
        for theta in (0.0, 40.0)
    ]
    out = radiance.run(["pabopto2bsdf", "-t", *files])
    assert b"SCATTERING_REPRESENTATION" in out[:4000] or b"#?RADIANCE" in out[:40]
    assert len(out) > 1000


def test_a_band_that_the_format_cannot_hold_is_not_lost_in_silence(
    measure: Callable[..., gonio.Table], tmp_path: Path
) -> None:
    solar = replace(measure(20.0, scale=0.02, shadow=False), file="", band="Solar")
    with pytest.raises(PhysicsError, match="Solar"):
        gonio.write(solar, tmp_path / "t.dat")
    assert list(tmp_path.iterdir()) == []


@settings(max_examples=60, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(
    head=st.lists(
        st.sampled_from(
            [
                "#format: theta phi DSF",
                "#format: theta phi [uA]",
                "#format: theta",
                "#incident_angle 20 0",
                "#incident_angle 20",
                "#incident_angle\tx\ty",
                "#intheta 20",
                "#inphi 0",
                "#colorimetry: CIE-XYZ",
                "#colorimetry: CIE-Q",
                "#upphi",
                "#upphi 90",
                "#front_integral nan",
                "#datapoints_in_file many",
                "#",
                "!!BSDF Data",
                "theta_i,phi_i,theta_s,phi_s,DSF",
                "\x00\xff",
            ]
        ),
        max_size=6,
    ),
    rows=st.sampled_from(["", "170 10 1\n" * 20, "".join(f"{91 + 4 * k} {17 * k} 0.1\n" for k in range(20))]),
    end=st.sampled_from(["\n", "\r", "\r\n"]),
)
def test_any_header_is_either_read_or_refused(tmp_path: Path, head: list[str], rows: str, end: str) -> None:
    path = tmp_path / "any.dat"
    path.write_bytes((end.join(head) + end + rows.replace("\n", end)).encode("latin-1"))
    try:
        tables = gonio.read(path)
    except FormatError as error:
        assert error.expected and error.found
    else:
        assert all(np.isfinite(t.values).all() for t in tables)
