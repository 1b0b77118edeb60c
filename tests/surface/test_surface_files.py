"""Real surface files come in with the right pixel size, field, span, missing pixels and way up."""

from __future__ import annotations

import json
import struct
import zipfile
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest

from specularia import surface
from specularia.errors import FormatError, OutputError, SpeculariaError, SpeculariaWarning

pytestmark = pytest.mark.filterwarnings("ignore::specularia.errors.SpeculariaWarning")

REAL = {
    # name: rows, columns, pitch x, pitch y (um), span (um), missing
    "st_al3d-1.al3d": (296, 200, 0.438027, 0.438027, 34.95067, 0),
    "st_csv-1.csv": (1, 8, 0.0386143, None, 0.15444, 0),
    "st_nms-1.nms": (512, 512, 0.3125, 0.3125, 3.318278, 0),
    "st_opd-1.opd": (480, 640, 0.19673303, 0.19673303, 0.12915416, 116),
    "st_plu-1.plu": (576, 768, 1.66, 1.66, 10.015625, 0),
    "st_sdf-1.sdf": (4, 7, 1.0, 1.0, 0.05093, 0),
    "st_sur-2.sur": (484, 563, 3.484, 3.484, 1.476, 117),
    "st_x3p-2.x3p": (650, 650, 0.12765651, 0.31458211, 0.5543362, 0),
    "st_xyz-1.txt": (4, 4, 1.0, 1.0, 1.0, 0),
}


@pytest.fixture
def real(shared_data):
    return shared_data / "surface"


@pytest.mark.parametrize("name", sorted(REAL))
def test_grid_span_and_missing_pixels_of_a_real_file(real, name):
    rows, columns, dx, dy, span, missing = REAL[name]
    found = surface.read(real / name)
    assert found.shape == (rows, columns)
    assert found.pitch_x_um == pytest.approx(dx, rel=1e-5)
    assert found.field_um[0] == pytest.approx(columns * dx, rel=1e-5)
    if dy is None:
        assert found.is_profile and np.isnan(found.pitch_y_um) and np.isnan(found.field_um[1])
    else:
        assert found.pitch_y_um == pytest.approx(dy, rel=1e-5)
        assert found.field_um[1] == pytest.approx(rows * dy, rel=1e-5)
    assert found.range_um == pytest.approx(span, rel=1e-6)
    assert found.missing == missing


@pytest.mark.parametrize("name", sorted(REAL))
def test_info_works_on_every_real_file_and_warns_of_what_is_odd(real, command, name):
    code, out, err = command("surface", "info", real / name, "--json")
    assert code == 0
    keys = (
        "format shape pitch_x_um pitch_y_um field_x_um field_y_um range_um missing Sa_um Sq_um Sdq warnings"
    )
    assert set(keys.split()) <= set(out)
    assert out["Sa_um"] <= out["Sq_um"] and out["Sdq"] > 0
    odd = {
        "st_csv-1.csv": ("no unit", "profile"),
        "st_xyz-1.txt": ("no unit",),
        "st_x3p-2.x3p": ("not square",),
    }
    told = odd.get(name, ())
    assert len(out["warnings"]) == len(told)
    for words in told:
        assert sum(words in w for w in out["warnings"]) == 1
        assert err.count(words) == 1


def test_the_plu_map_is_the_one_in_the_bytes(real):
    data = (real / "st_plu-1.plu").read_bytes()
    # Date (128 bytes), time (4), comment (256); then calibration (40), configuration and scan (72), grid (8).
    rows, columns, _, _, dx, dy = struct.unpack_from("<IIIfff", data, 388)
    assert struct.unpack_from("<II", data, 500) == (rows, columns)
    raw = np.frombuffer(data, "<f4", rows * columns, 508).reshape(rows, columns)
    found = surface.read(real / "st_plu-1.plu")
    assert (found.pitch_x_um, found.pitch_y_um) == (dx, dy)
    assert np.array_equal(found.heights_um, raw[::-1])  # the first stored row is the top of the picture


def test_the_nms_map_is_the_one_in_the_bytes(real):
    data = (real / "st_nms-1.nms").read_bytes()
    low, high = struct.unpack_from("<dd", data, 16)
    columns, rows, dx_nm, dy_nm = struct.unpack_from("<IIdd", data, 1368)
    raw = np.frombuffer(data, "<u2", rows * columns, len(data) - 3 * rows * columns).reshape(rows, columns)
    assert (raw.min(), raw.max()) == (0, 65535)  # so the stored extremes belong to 0 and 65535
    found = surface.read(real / "st_nms-1.nms")
    assert found.pitch_x_um == pytest.approx(dx_nm * 1e-3) and found.pitch_y_um == pytest.approx(dy_nm * 1e-3)
    assert found.field_um == pytest.approx((160.0, 160.0), rel=1e-6)
    assert np.allclose(found.heights_um, (low + raw / 65535.0 * (high - low))[::-1], atol=1e-12)
    assert found.range_um == pytest.approx(high - low, rel=1e-12)
    bright = np.frombuffer(data, "u1", rows * columns, len(data) - rows * columns).reshape(rows, columns)
    assert np.array_equal(found.image, bright[::-1])


def test_the_peer_reads_nms_a_million_times_too_wide_and_our_check_would_refuse_it(real):
    from SurfaceTopography import read_topography

    peer = read_topography(str(real / "st_nms-1.nms"))
    assert peer.unit == "µm" and peer.physical_sizes[0] == pytest.approx(160e6, rel=1e-3)
    wrong = surface.HeightMap(peer.heights().T, peer.pixel_size[0], peer.pixel_size[1])
    with pytest.raises(FormatError, match=r"1\.6e\+08 um"):
        surface.check(wrong, file=real / "st_nms-1.nms")


def test_the_sur_file_misses_the_points_that_its_bytes_mark(real):
    data = (real / "st_sur-2.sur").read_bytes()
    raw = np.frombuffer(data[-484 * 563 * 4 :], "<i4").reshape(484, 563)
    marked = raw == raw.min()
    found = surface.read(real / "st_sur-2.sur")
    assert marked.sum() == 117
    assert np.array_equal(~found.valid, marked[::-1])


def test_the_opd_map_is_in_wavelengths_column_by_column_with_a_mark_for_missing_points(real):
    data = (real / "st_opd-1.opd").read_bytes()
    size = struct.unpack_from("<l", data, 2 + 18)[0]
    blocks, at = {}, 2 + size
    for k in range(1, size // 24):
        name, _, length, _ = struct.unpack_from("<16shlH", data, 2 + 24 * k)
        blocks.setdefault(name.strip(b"\0"), data[at : at + max(length, 0)])
        at += max(length, 0)
    columns, rows, _ = struct.unpack_from("<HHH", blocks[b"Raw"])
    raw = np.frombuffer(blocks[b"Raw"], "<f4", columns * rows, 6).reshape(columns, rows).T
    wavelength_um, pixel_mm = (struct.unpack("<f", blocks[k])[0] for k in (b"Wavelength", b"Pixel_size"))
    missing = raw > 1e38
    found = surface.read(real / "st_opd-1.opd")
    assert missing.sum() == 116
    assert np.array_equal(~found.valid, missing)
    assert np.allclose(found.heights_um[~missing], raw[~missing] * wavelength_um * 1e-3, rtol=1e-6)
    assert found.pitch_x_um == pytest.approx(pixel_mm * 1e3)


def test_the_al3d_map_is_the_one_in_the_bytes(real):
    data = (real / "st_al3d-1.al3d").read_bytes()
    tags = dict(
        (data[k : k + 20].strip(b"\0"), data[k + 20 : k + 50].strip(b"\0"))
        for k in range(17, 17 + 19 * 52, 52)
    )
    rows, columns, start = (int(tags[k]) for k in (b"Rows", b"Cols", b"DepthImageOffset"))
    raw = np.frombuffer(data, "<f4", rows * columns, start).reshape(rows, columns)  # metres
    found = surface.read(real / "st_al3d-1.al3d")
    assert found.pitch_x_um == pytest.approx(float(tags[b"PixelSizeXMeter"]) * 1e6)
    assert np.allclose(found.heights_um, raw[::-1].astype(float) * 1e6, rtol=1e-12)


def test_x3p_and_sdf_have_y_as_a_coordinate_so_their_first_row_is_the_lowest(real):
    with zipfile.ZipFile(real / "st_x3p-2.x3p") as archive:
        main = ElementTree.fromstring(archive.read("main.xml"))
        raw = np.frombuffer(archive.read("bindata/data.bin"), "<f8").reshape(650, 650)
        steps = [float(e.text) for e in main.iter() if e.tag == "Increment"]
    found = surface.read(real / "st_x3p-2.x3p")
    assert np.allclose(found.heights_um, raw * 1e6, atol=1e-12)
    assert (found.pitch_x_um, found.pitch_y_um) == pytest.approx((steps[0] * 1e6, steps[1] * 1e6))
    lines = (real / "st_sdf-1.sdf").read_text().split("*")[1].split()
    values = np.array(lines, float).reshape(4, 7)
    assert np.allclose(surface.read(real / "st_sdf-1.sdf").heights_um, values, atol=1e-12)


def test_a_table_of_points_is_placed_by_its_coordinates_whatever_the_order_of_lines(tmp_path):
    rng = np.random.default_rng(1)
    y, x = np.mgrid[0:5, 0:7]
    z = rng.normal(size=(5, 7))
    rows = np.stack([3.0 + 200.0 * x.ravel(), -1.0 + 50.0 * y.ravel(), z.ravel()], axis=1)
    rows = np.delete(rows, 12, axis=0)  # row 1, column 5 is not in the table
    rng.shuffle(rows)
    path = tmp_path / "points.csv"
    np.savetxt(path, rows, delimiter=",", header="x [nm],y [nm],z [um]", comments="")
    found = surface.read(path)
    assert (found.pitch_x_um, found.pitch_y_um) == pytest.approx((0.2, 0.05))
    assert found.missing == 1 and np.isnan(found.heights_um[1, 5])
    keep = found.valid
    assert np.allclose(found.heights_um[keep], z[keep])


def test_a_unit_is_taken_from_the_file_or_stated_and_assumed_only_with_a_warning(tmp_path):
    path = tmp_path / "bare.txt"
    path.write_text("".join(f"{x} {y} {x * y}\n" for x in range(3) for y in range(3)))
    with pytest.warns(SpeculariaWarning, match="um is assumed"):
        assumed = surface.read(path)
    stated = surface.read(path, unit="mm")
    assert assumed.pitch_x_um == 1.0 and stated.pitch_x_um == 1000.0
    assert np.allclose(stated.heights_um, 1000.0 * assumed.heights_um)
    with pytest.raises(SpeculariaError, match="furlong"):
        surface.read(path, unit="furlong")


def test_a_unit_or_pitch_that_contradicts_the_file_is_refused(real):
    with pytest.raises(FormatError, match="Leave the unit out"):
        surface.read(real / "st_plu-1.plu", unit="mm")
    with pytest.raises(FormatError, match=r"2 um, as stated.*1\.66 um in the file"):
        surface.read(real / "st_plu-1.plu", pitch_um=2.0)
    assert surface.read(real / "st_plu-1.plu", pitch_um=1.66).pitch_x_um == pytest.approx(1.66)


def test_npy_needs_a_pitch_and_keeps_rows_and_missing_pixels(tmp_path):
    z = np.arange(12.0).reshape(3, 4)
    z[2, 1] = np.nan
    np.save(tmp_path / "map.npy", z)
    with pytest.raises(FormatError, match="pitch"):
        surface.read(tmp_path / "map.npy")
    found = surface.read(tmp_path / "map.npy", pitch_um=(1.5, 2.0))
    assert np.array_equal(found.heights_um, z, equal_nan=True)
    assert (found.pitch_x_um, found.pitch_y_um, found.missing) == (1.5, 2.0, 1)
    np.savez(tmp_path / "map.npz", heights_um=z, pitch_um=1.5, sigma_um=np.ones_like(z))
    packed = surface.read(tmp_path / "map.npz")
    assert packed.pitch_y_um == 1.5 and packed.sigma_um is not None and packed.sigma_um.shape == (3, 4)


def test_our_own_file_gives_back_every_bit(tmp_path):
    rng = np.random.default_rng(2)
    z = rng.normal(size=(6, 5)) * 1e3
    z[0, 0] = np.nan
    layer = rng.random((6, 5)).astype(np.float32).astype(float)
    given = surface.HeightMap(
        z,
        0.1 + 0.2,
        1.0 / 3.0,
        sigma_um=layer,
        image=2 * layer,
        reliability=layer,
        name="a",
        attributes={"k": "v"},
    )
    back = surface.read(surface.write(given, tmp_path / "a.nc", {"title": "t"}))
    assert np.array_equal(back.heights_um, z, equal_nan=True)
    assert (back.pitch_x_um, back.pitch_y_um) == (given.pitch_x_um, given.pitch_y_um)
    assert np.array_equal(back.sigma_um, layer) and np.array_equal(back.image, 2 * layer)
    assert np.array_equal(back.reliability, layer)
    assert back.name == "a" and back.attributes["k"] == "v" and back.attributes["title"] == "t"


@pytest.mark.parametrize("name", sorted(set(REAL) - {"st_xyz-1.txt"}))
def test_a_file_cut_in_half_ends_with_code_3_and_leaves_no_output(real, tmp_path, command, name):
    data = (real / name).read_bytes()
    cut = tmp_path / name
    cut.write_bytes(data[: len(data) // 2])
    for words in (("info", cut), ("heal", cut, "-o", tmp_path / "out.nc")):
        code, out, err = command("surface", *words, "--json")
        assert code == 3 and out == ""
        assert name in err and "expected" in err and "found" in err
    assert [p.name for p in tmp_path.iterdir()] == [name]


def test_a_cut_or_foreign_netcdf_is_refused(tmp_path):
    z = np.random.default_rng(3).normal(size=(64, 64))
    path = surface.write(surface.HeightMap(z, 1.0, 1.0), tmp_path / "a.nc")
    path.write_bytes(path.read_bytes()[:9000])
    with pytest.raises(FormatError, match="truncated"):
        surface.read(path)
    import xarray as xr

    xr.Dataset({"t": ("k", [1.0])}).to_netcdf(tmp_path / "b.nc", engine="h5netcdf")
    with pytest.raises(FormatError, match=r"height_um\(y, x\)"):
        surface.read(tmp_path / "b.nc")


def test_a_missing_file_and_an_unwritable_output_are_said_so(tmp_path, command):
    code, _, err = command("surface", "info", tmp_path / "none.plu")
    assert code == 3 and "none.plu" in err and "found nothing" in err
    with pytest.raises(OutputError, match="does not exist"):
        surface.write(surface.HeightMap(np.ones((2, 2)), 1.0, 1.0), tmp_path / "no" / "a.nc")


def test_a_line_that_is_no_point_is_named(tmp_path):
    path = tmp_path / "bad.csv"
    path.write_text("x (um),z (um)\n0,1\n1,2\n2,3\n3,oops\n4,5\n" + "".join(f"{k},1\n" for k in range(5, 30)))
    with pytest.raises(FormatError, match="line 5") as caught:
        surface.read(path)
    assert caught.value.line == 5


@pytest.mark.parametrize("pitch", [1e-7, 1e5])
def test_an_implausible_field_is_refused(tmp_path, pitch):
    np.save(tmp_path / "m.npy", np.zeros((64, 64)))
    with pytest.raises(FormatError, match="between 50 nm and 1 m"):
        surface.read(tmp_path / "m.npy", pitch_um=pitch)


def test_what_is_unlikely_is_warned_of(tmp_path):
    z = np.full((20, 20), np.nan)
    z[:5] = np.linspace(0, 5000, 100).reshape(5, 20)
    np.save(tmp_path / "m.npy", z)
    with pytest.warns(SpeculariaWarning) as told:
        surface.read(tmp_path / "m.npy", pitch_um=1.0)
    texts = " ".join(str(w.message) for w in told)
    assert "300 of 400 pixels (75%) are missing" in texts and "height unit may be wrong" in texts


def test_attributes_of_a_written_map_hold_its_provenance(tmp_path, command, real):
    code, _, _ = command("surface", "heal", real / "st_plu-1.plu", "-o", tmp_path / "h.nc", "--json")
    assert code == 0
    attributes = surface.read(tmp_path / "h.nc").attributes
    assert "st_plu-1.plu" in json.loads(attributes["source"]) and "numpy" in json.loads(
        attributes["versions"]
    )


def test_a_folder_is_no_map(tmp_path):
    with pytest.raises(FormatError, match="folder"):
        surface.read(Path(tmp_path))
