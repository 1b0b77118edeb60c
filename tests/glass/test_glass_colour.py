"""Colour: bands from one trace against a trace at every wavelength, pigments, files, and what Radiance
sees."""

from dataclasses import replace

import numpy as np
import pytest
from glass_reference import smooth_map

from specularia import bsdf
from specularia.bsdf import TensorTree, check_render
from specularia.bsdf.chroma import chroma_trees
from specularia.errors import CoverageError, FormatError, PhysicsError
from specularia.glass import (
    GLASSES,
    Face,
    IronManganese,
    Medium,
    Slab,
    Spectrum,
    closed_form,
    colour,
    colouring,
    read_slab,
    swatches,
    trace_paths,
)
from specularia.glass.checkpoint import Store
from specularia.glass.colour import CIE_BANDS, WAVELENGTHS_NM, delta_e, lab, viewing
from specularia.glass.directions import ColouredOutcome, Direction, Task, trace_direction
from specularia.glass.effort import Effort
from specularia.glass.model import traced_model

BK7 = (1.03961212, 0.231792344, 1.01046945, 0.00600069867, 0.0200179144, 103.560653)
MEDIA = {name: Medium(index=BK7, absorption_per_mm=g.spectrum()) for name, g in GLASSES.items()}


@pytest.fixture(scope="module")
def rough() -> Slab:
    return Slab(
        thickness_mm=3.0,
        medium=MEDIA["green"],
        front=Face(smooth_map((64, 64), seed=1, rms_slope=0.33), 1.5, 1.5),
        back=Face(smooth_map((60, 64), seed=2, rms_slope=0.51), 1.5, 1.5),
        synthetic=True,
    )


@pytest.fixture(scope="module")
def traced(rough):
    return traced_model(rough, theta_deg=[0.0, 60.0], paths=16_000, seed=1, colour="D65")


@pytest.fixture(scope="module")
def xml(traced, tmp_path_factory):
    """Transmission alone, coarse, for the time it takes to build trees of three bands."""
    model = traced.model

    def through(tables):
        return {side: t for side, t in tables.items() if side.startswith("transmission")}

    model = replace(model, tables=through(model.tables), more={b: through(t) for b, t in model.more.items()})
    return bsdf.write(model, tmp_path_factory.mktemp("colour") / "pane.xml", resolution=3)


@pytest.mark.parametrize("theta", [0.0, 60.0])
@pytest.mark.parametrize("thickness", [1.5, 5.0])
def test_one_trace_at_3_mm_has_the_colour_of_a_trace_every_5_nm_with_dispersion_at_other_thicknesses(
    rough, theta, thickness
):
    found = swatches(rough, MEDIA, thickness_mm=[thickness], theta_deg=theta, paths=8000, seed=3)
    other = replace(rough, thickness_mm=thickness)
    light = {name: [] for name in MEDIA}
    for w in WAVELENGTHS_NM:
        p = trace_paths(other, theta_deg=theta, phi_deg=None, paths=8000, seed=3, wavelength_nm=w, clear=True)
        for name, medium in MEDIA.items():
            left = p.weight * np.exp(-medium.absorption_at(w) * p.glass_length_mm)
            light[name].append(left[p.transmitted].sum() / len(p))
    for m, name in enumerate(MEDIA):
        exact = lab(viewing().weights @ np.array(light[name]))
        assert delta_e(exact, found.lab[m, 0]) < 1.0, (name, exact, found.lab[m, 0])


def test_a_trace_that_absorbs_on_its_way_ends_as_the_weights_say(rough):
    """The kernel's own absorption at one wavelength, against the weight of a band of that wavelength
    alone."""
    how = colouring(rough.medium)
    k = int(np.argmin(np.abs(WAVELENGTHS_NM - 650.0)))
    one = np.zeros((3, len(WAVELENGTHS_NM)))
    one[:, k] = 1.0
    how = replace(how, weights=one)
    how = replace(how, log_share=np.log(np.maximum(how.share(how.way_mm), 1e-300)))
    clear = trace_paths(rough, theta_deg=30.0, paths=6400, seed=5, clear=True, wavelength_nm=650.0)
    own = trace_paths(rough, theta_deg=30.0, paths=6400, seed=5, wavelength_nm=650.0)
    weighed = how.apply(clear, 1)
    # The kernel ends a path of which nothing is left.
    assert np.all((weighed.exit_side == own.exit_side) | (weighed.weight < 1e-12))
    assert np.allclose(weighed.weight, own.weight, rtol=2e-5, atol=1e-12)
    assert np.allclose(weighed.weight + weighed.absorbed, 1.0, atol=1e-12)


def test_a_flat_pane_has_the_colour_that_colour_science_computes_from_its_spectrum():
    from colour import MSDS_CMFS, SDS_ILLUMINANTS, SpectralDistribution, XYZ_to_Lab, sd_to_XYZ, xy_to_XYZ

    found = swatches(Slab(thickness_mm=3.0), MEDIA, thickness_mm=[1.5, 3.0, 5.0], paths=200_000)
    wide = np.arange(380.0, 781.0, 1.0)
    for m, medium in enumerate(MEDIA.values()):
        for t, d in enumerate(found.thickness_mm):
            spectrum = [
                float(
                    closed_form.flat_slab(
                        0.0, index=1.52, absorption_per_mm=medium.absorption_at(w), thickness_mm=d
                    ).transmitted
                )
                for w in wide
            ]
            xyz = sd_to_XYZ(
                SpectralDistribution(spectrum, wide),
                MSDS_CMFS["CIE 1931 2 Degree Standard Observer"],
                SDS_ILLUMINANTS["D65"],
            )
            white = xy_to_XYZ((0.31270, 0.32900))
            exact = XYZ_to_Lab(xyz / 100.0, illuminant=white[:2] / white.sum())
            assert delta_e(exact, found.lab[m, t]) < 0.2


def test_neutral_glass_has_three_equal_bands_and_clear_glass_takes_nothing():
    grey = colouring(Medium(absorption_per_mm=0.1))
    way = np.array([0.0, 1.0, 30.0, 3e4])
    assert np.allclose(grey.share(way), np.exp(-0.1 * way), rtol=1e-12)
    for band in range(3):
        assert np.allclose(grey.quick_share(way)[band], np.exp(-0.1 * way), rtol=1e-5)
        assert colouring(Medium()).quick_share(way)[band] == pytest.approx(1.0, abs=1e-12)


def test_the_table_of_shares_is_right_to_1e_5():
    how = colouring(MEDIA["yellow-brown"])
    way = np.random.default_rng(1).exponential(8.0, 2000)
    exact = how.share(way)
    for band in range(3):
        assert np.allclose(how.quick_share(way)[band], exact[band], rtol=1e-5)


def test_the_white_is_that_of_the_illuminant():
    assert viewing("D65").white == pytest.approx([0.95047, 1.0, 1.08883], abs=2e-3)
    assert viewing("E").white == pytest.approx([1.0, 1.0, 1.0], abs=2e-3)
    assert viewing("A").white == pytest.approx([1.09850, 1.0, 0.35585], abs=2e-3)
    with pytest.raises(PhysicsError, match="D65"):
        viewing("D66")


def test_a_spectrum_that_misses_part_of_the_visible_is_refused():
    with pytest.raises(CoverageError, match="450"):
        colouring(Medium(absorption_per_mm=Spectrum(np.array([450.0, 800.0]), np.array([0.1, 0.1]))))


def test_pigments_follow_lambert_and_beer():
    """1 % of FeO in glass of 2.5 g/cm3 is 0.348 mol/L; at extinction 27, 9.4 per cm decadic."""
    feo = 0.01 * 2500.0 / 71.844
    glass = IronManganese(fe2o3_percent=1.0 * 159.69 / (2 * 71.844), ferrous=1.0)
    assert glass.absorption_per_mm(1050.0) == pytest.approx(np.log(10) * 27.0 * feo / 10.0, rel=1e-3)
    w = np.linspace(380.0, 780.0, 41)
    parts = [IronManganese(fe2o3_percent=0.7, ferrous=f).absorption_per_mm(w) for f in (0.0, 0.5, 1.0)]
    assert np.allclose(parts[1], 0.5 * (parts[0] + parts[2]), rtol=1e-12)
    both = IronManganese(fe2o3_percent=0.7, ferrous=0.5, mno_percent=1.0, mn3=0.1)
    purple = IronManganese(mno_percent=1.0, mn3=0.1)
    assert np.allclose(both.absorption_per_mm(w), parts[1] + purple.absorption_per_mm(w), rtol=1e-12)
    assert w[np.argmax(purple.absorption_per_mm(w))] == pytest.approx(490.0)
    amber = IronManganese(amber_per_mm=0.3)
    assert amber.absorption_per_mm(410.0) == pytest.approx(0.3)
    with pytest.raises(PhysicsError, match="ferrous"):
        IronManganese(ferrous=1.2)


def test_the_three_glasses_have_the_hues_of_their_names():
    found = swatches(Slab(thickness_mm=3.0), MEDIA, thickness_mm=[3.0], paths=3200)
    aqua, green, brown = found.lab[:, 0]
    hue = np.degrees(np.arctan2(found.lab[:, 0, 2], found.lab[:, 0, 1])) % 360
    assert 160 < hue[0] < 230 and 110 < hue[1] < 160 and 60 < hue[2] < 100
    assert aqua[0] > brown[0] and green[0] > brown[0]


def test_bands_of_a_model_add_up_to_the_light_of_a_balance_of_its_own(rough, traced):
    seen = swatches(rough, {"own": rough.medium}, thickness_mm=[3.0], theta_deg=60.0, paths=64_000, seed=9)
    for k, band in enumerate(CIE_BANDS):
        table = traced.model.in_band(band).tables["transmission_front"]
        assert abs(table.tau[1] - seen.xyz[0, 0, k]) < 4 * np.hypot(table.tau_se[1], seen.xyz_se[0, 0, k])
        whole = table.base[1].astype(float).sum() * np.pi / table.base.shape[1] ** 2
        assert whole == pytest.approx(table.tau[1], rel=1e-5)
    balance = traced.balances["front"]
    assert np.allclose(balance.tau + balance.rho + balance.absorbed, 1.0, atol=1e-9)


def test_bands_survive_files_and_a_model_of_one_band_is_written_as_before(rough, traced, tmp_path):
    model = traced.model
    assert model.bands == ("Visible", "CIE-X", "CIE-Z")
    again = bsdf.read_model(bsdf.write_model(model, tmp_path / "pane.nc"))
    assert again.bands == model.bands
    z = bsdf.read(tmp_path / "pane.nc", band="CIE-Z")
    assert z.band == "CIE-Z" and z.bands == ("CIE-Z",)
    assert np.array_equal(z.tables["reflection_back"].base, model.more["CIE-Z"]["reflection_back"].base)
    with pytest.raises(CoverageError, match="CIE-X"):
        model.in_band("Solar")
    bsdf.write_model(model.in_band("CIE-Y"), tmp_path / "one.nc")
    import h5netcdf

    with h5netcdf.File(tmp_path / "one.nc") as f:
        assert f.attrs["format"].endswith(" 2") and len(f.groups) == 4


def test_an_xml_file_holds_every_band_with_its_own_light(traced, xml):
    assert xml.model.bands == (*CIE_BANDS, "CIE-u", "CIE-v")
    found = [bsdf.read(xml.path, band=band) for band in CIE_BANDS]
    theta = [5.0, 40.0]
    tau = np.array([one.direct_hemispherical("transmission_front", theta) for one in found])
    exact = [traced.model.in_band(b).direct_hemispherical("transmission_front", theta) for b in CIE_BANDS]
    # Rings of so coarse a tree are wide; the colour within one hardly changes.
    assert tau == pytest.approx(np.array(exact), rel=0.05)
    assert tau / tau[1] == pytest.approx(np.array(exact) / exact[1], rel=0.01)


def test_trees_hold_the_chromaticity_of_their_leaves():
    ones = "{ 1 } " * 7
    x, y, z = (TensorTree.from_text(f"{{ {ones}{{ {v} }} }}", 3) for v in (2, 4, 0))
    u, v = chroma_trees(x, y, z)
    assert u.values[0] == pytest.approx(4 / 19) and v.values[0] == pytest.approx(9 / 19)
    assert u.values[-1] == pytest.approx(8 / 62) and v.values[-1] == pytest.approx(36 / 62)
    dark = replace(y, values=np.zeros_like(y.values))
    assert chroma_trees(x, dark, z)[0].values == pytest.approx(4 / 19)


def test_conversion_keeps_the_bands_and_makes_chromaticities_again_for_trees_alone(xml):
    model = bsdf.read(xml.path)
    matrices = bsdf.convert(model, basis="klems-quarter")
    assert matrices.bands == CIE_BANDS
    tau = [bsdf.read(xml.path, band=b).direct_hemispherical("transmission_front", 0.0) for b in CIE_BANDS]
    for band, value in zip(CIE_BANDS, tau):
        one = replace(matrices, parts=matrices.all_bands[band], band=band)
        assert one.direct_hemispherical("transmission_front", 0.0) == pytest.approx(value, rel=0.05)
    same = bsdf.convert(model, flip=True)
    assert set(same.bands) == {*CIE_BANDS, "CIE-u", "CIE-v"}


def test_radiance_sees_the_colour_that_the_file_holds(xml, tmp_path):
    from colour import normalised_primary_matrix

    path = xml.path
    eye = check_render._world(40.0, 30.0)
    up = -np.sign(eye[2])
    dome = f"void glow sky\n0\n0\n4 1 1 1 0\nsky source s\n0\n0\n4 0 0 {up:g} 180\n"
    corners = check_render._TOWARDS_ROOM
    check_render._octree(tmp_path, path, dome, up="0 1 0", corners=corners)
    rays = np.concatenate([0.5 * eye, -eye]).astype("<f4")
    fixed = ["-ab", "1", "-aa", "0", "-lw", "1e-4", "-st", "0", "-ad", "256"]
    words = ["rtrace", "-h", "-ffd", *fixed, "scene.oct"]
    rgb = np.frombuffer(check_render.run(words, data=np.tile(rays, 300).tobytes(), cwd=tmp_path), "<f8")
    # Radiance's primaries (color.h); its white has equal X, Y and Z.
    primaries = np.array([[0.640, 0.330], [0.290, 0.600], [0.150, 0.060]])
    xyz = normalised_primary_matrix(primaries, np.array([1.0, 1.0]) / 3.0) @ rgb.reshape(-1, 3).mean(axis=0)
    exact = [
        float(bsdf.read(path, band=b).direct_hemispherical("transmission_front", 40.0)) for b in CIE_BANDS
    ]
    assert xyz == pytest.approx(exact, rel=0.02)
    assert exact[2] < 0.8 * exact[1]


def test_a_direction_in_colour_is_kept_and_taken_up_again_bit_for_bit(rough, tmp_path):
    work = Task(Effort(3200), colour=colouring(rough.medium))
    found = trace_direction(rough, Direction("front", 20.0), work)
    store = Store(tmp_path / "pane.nc", key="0" * 12)
    store.save("one", found)
    again = store.load("one", ColouredOutcome)
    assert again is not None
    assert np.array_equal(again.z.transmitted.patch, found.z.transmitted.patch)
    assert (again.x.absorbed, again.transmitted.share) == (found.x.absorbed, found.transmitted.share)


def test_stated_errors_of_colour_are_the_spread_over_seeds():
    rough = Slab(thickness_mm=2.0, front=Face(smooth_map((48, 48), seed=4, rms_slope=0.4), 1.5, 1.5))
    green = {"green": MEDIA["green"]}
    runs = [swatches(rough, green, thickness_mm=[2.0], theta_deg=50.0, paths=3200, seed=s) for s in range(24)]
    spread = np.std([r.xyz[0, 0] for r in runs], axis=0, ddof=1)
    stated = np.sqrt(np.mean([r.xyz_se[0, 0] ** 2 for r in runs], axis=0))
    assert np.all((spread < 1.6 * stated) & (stated < 1.6 * spread))


TOML = """thickness_mm = 3.0
[medium]
{medium}
[front]
flat = true
[back]
flat = true
[trace]
{trace}
"""


@pytest.mark.parametrize(
    ("medium", "trace", "word"),
    [
        ('glass = "aqua"\nabsorption_per_mm = 0.1', "", "not both"),
        ('glass = "blue"', "", "aqua"),
        ("iron_manganese = { iron = 1.0 }", "", "fe2o3_percent"),
        ("iron_manganese = { ferrous = 1.5 }", "", "less than or equal to 1"),
        ("", 'colour = "D66"', "D65"),
    ],
)
def test_a_wrong_glass_or_illuminant_is_refused_by_name(tmp_path, medium, trace, word):
    (tmp_path / "glass.toml").write_text(TOML.format(medium=medium, trace=trace))
    with pytest.raises(FormatError, match=word):
        read_slab(tmp_path / "glass.toml")


def test_a_glass_may_be_named_or_given_by_what_colours_it(tmp_path):
    own = GLASSES["aqua"]
    words = f"iron_manganese = {{ fe2o3_percent = {own.fe2o3_percent}, ferrous = {own.ferrous} }}"
    found = []
    for medium in ('glass = "aqua"', words, ""):
        (tmp_path / "glass.toml").write_text(TOML.format(medium=medium, trace='colour = "E"'))
        found.append(read_slab(tmp_path / "glass.toml"))
    assert found[0].medium.absorption_at(650.0) == pytest.approx(found[1].medium.absorption_at(650.0))
    assert found[2].medium.absorption_at(650.0) == 0.0
    assert all(slab.colour == "E" for slab in found)


def test_the_command_tells_colour_only_when_asked(tmp_path, command):
    (tmp_path / "glass.toml").write_text(TOML.format(medium='glass = "yellow-brown"', trace=""))
    words = ("glass", "trace", tmp_path / "glass.toml", "--tau-only", "--theta", "0,60", "--paths", 3200)
    words = (*words, "--json")
    code, plain, _ = command(*words)
    assert code == 0 and not {"xyz", "lab", "illuminant"} & set(plain)
    code, found, err = command(*words, "--colour")
    assert code == 0, err
    assert {k: v for k, v in found.items() if k in plain and k != "seconds"} == {
        k: v for k, v in plain.items() if k != "seconds"
    }
    assert np.shape(found["xyz"]) == (2, 3) and found["illuminant"] == "CIE D65"
    assert found["lab"] == pytest.approx(lab(found["xyz"]))
    code, table, _ = command("glass", "colours", "-o", tmp_path / "s.png", "--thickness", "1.5,3", "--json")
    assert code == 0 and (tmp_path / "s.png").read_bytes().startswith(b"\x89PNG")
    assert table["glasses"]["yellow-brown"]["lab"][1] == pytest.approx(found["lab"][0], abs=0.5)
    assert len((tmp_path / "s.csv").read_text().splitlines()) == 1 + 3 * 2
    words = ("glass", "trace", tmp_path / "glass.toml", "-o", tmp_path / "m.nc")
    code, _, _ = command(*words, "--colour", "--patches", 2)
    assert code != 0
    assert colour.OBSERVER in found["observer"]
