"""Rooms in colour: tristimulus values follow from what the bands of a model say, and grey stays grey."""

from __future__ import annotations

from contextlib import nullcontext
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from daylight_models import Diffuser, Lobe, room, sensors

from specularia import bsdf, daylight
from specularia.daylight.colour import RGB_TO_XYZ, chromaticity, colour_temperature, shown, to_rgb, to_xyz
from specularia.daylight.fragment_job import FragmentJob
from specularia.errors import CoverageError, SpeculariaWarning
from specularia.glass import Face, Slab
from specularia.glass import model as trace_model
from specularia.radiance import run
from specularia.report import figures
from specularia.report.figures.colour import screen

UP = (0.0, 0.0, 1.0)
QUICK = daylight.Quality(sampling=0.25, repeats=2)
SUN = {"elevation_deg": 45.0, "azimuth_deg": 20.0, "normal_illuminance_lx": 8e4}
SKY = {"kind": "overcast", "horizontal_illuminance_lx": 1e4}
VIEW = {
    "name": "in",
    "position_m": (2.5, 4.0, 1.5),
    "direction": (0, -1, 0),
    "horizontal_deg": 70.0,
    "size_px": (40, 30),
}
GREY = {"ceiling": 0.7, "walls": 0.5, "floor": 0.3, "frames": 0.3}
PLACES = sensors([(2.5, 1.0, 0.0), (1.0, 3.0, 0.0), (2.5, 6.0, 1.5)], [UP, UP, (0, -1, 0)])
AMBER = (0.62, 0.55, 0.18)
"""Transmission in X, Y and Z of a yellow-brown pane; invented."""


class Scaled:
    """A model with all its values times a factor."""

    def __init__(self, model: Any, factor: float, band: str) -> None:
        self.model, self.factor, self.band, self.sides = model, factor, band, model.sides

    def evaluate(self, *arguments: Any) -> Any:
        return self.factor * self.model.evaluate(*arguments)

    def direct_hemispherical(self, *arguments: Any) -> Any:
        return self.factor * self.model.direct_hemispherical(*arguments)

    def quadrature(self, *arguments: Any) -> Any:
        return self.model.quadrature(*arguments)


def coloured(model: Any, xyz: tuple[float, float, float]) -> daylight.Coloured:
    return daylight.Coloured(*(Scaled(model, f, f"CIE-{b}") for f, b in zip(xyz, "XYZ")))


def test_white_of_equal_energy_is_white_in_both_spaces_and_the_primaries_are_radiance_s() -> None:
    assert to_xyz(np.ones(3)) == pytest.approx([1, 1, 1], abs=1e-12)
    # Radiance's own factors of its bright(), from its src/common/color.h.
    assert RGB_TO_XYZ[1] == pytest.approx([0.265074126, 0.670114631, 0.064811243], abs=1e-4)
    for primary, xy in zip(np.eye(3), [(0.64, 0.33), (0.29, 0.6), (0.15, 0.06)]):
        assert chromaticity(to_xyz(primary)) == pytest.approx(xy, abs=1e-12)
    green = to_rgb(np.array([0.2, 0.7, 0.05]))
    assert green.min() < 0 <= shown(green).min()
    assert to_xyz(shown(green))[1] == pytest.approx(0.7)


@pytest.mark.parametrize(
    ("xy", "kelvin"), [((0.44757, 0.40745), 2856.0), ((0.31272, 0.32903), 6504.0), ((1 / 3, 1 / 3), 5455.0)]
)
def test_colour_temperatures_of_the_cie_s_illuminants(xy: tuple[float, float], kelvin: float) -> None:
    assert colour_temperature(np.array(xy)) == pytest.approx(kelvin, abs=5.0)
    assert colour_temperature(np.array([0.2, 0.5])) is None


def test_a_grey_model_of_three_bands_lights_the_room_as_one_of_one_band(tmp_path: Path) -> None:
    job = room(reflectance=GREY, sun=SUN, sky=SKY, sensor=PLACES, view=[VIEW])
    model = Lobe(20.0, shift=(0.1, 0.3), cells=64)
    three = daylight.Coloured(model, model, model)
    one, grey = (
        daylight.run(job, models={"m": m}, quality=QUICK, folder=tmp_path / str(k))
        for k, m in enumerate((model, three))
    )
    for a, b in zip(one.points, grey.points):
        assert b.illuminance_lx == pytest.approx(a.illuminance_lx, rel=2e-6)
        assert b.se == pytest.approx(a.se, rel=1e-3, abs=1e-4)
        assert a.chromaticity_xy is None
        assert b.chromaticity_xy == pytest.approx((1 / 3, 1 / 3), abs=1e-6)
    (p,), (q,) = one.images, grey.images
    assert q.luminance == pytest.approx(p.luminance, rel=1e-5)
    assert q.xyz is not None and p.xyz is None
    assert q.xyz == pytest.approx(np.repeat(p.luminance[..., None], 3, axis=2), rel=1e-5)
    assert grey.panes[0].luminance_cd_m2 == one.panes[0].luminance_cd_m2


def test_a_traced_model_with_cie_bands_lights_the_room_in_their_colours(tmp_path: Path) -> None:
    """As `glass trace --colour` writes it: all bands in one .nc, X and Z here known shares of Y."""
    one = trace_model(
        Slab(3.0, back=Face.flat(micro_slope=0.2)), paths=3200, theta_deg=(0, 30, 60, 80), seed=1
    )
    more = {
        f"CIE-{band}": {
            side: replace(t, base=f * t.base, patch=f * t.patch, tau=f * t.tau, tau_se=f * t.tau_se)
            for side, t in one.tables.items()
        }
        for band, f in (("X", 0.9), ("Z", 0.4))
    }
    bsdf.write(replace(one, band="Visible", more=more), tmp_path / "amber.nc")
    job = room(sky=SKY, sensor=PLACES[:2])
    lit = daylight.run(job, models={"amber": tmp_path / "amber.nc"}, quality=QUICK)
    for point in lit.points:
        assert point.chromaticity_xy == pytest.approx((0.9 / 2.3, 1.0 / 2.3), abs=2e-3)


def test_in_a_black_room_tristimulus_values_are_those_of_the_pane(tmp_path: Path) -> None:
    """Sun and sky are white, so light from the pane has the ratios X : Y : Z of its transmission."""
    job = room(sun=SUN, sky=SKY, sensor=PLACES[:2], view=[VIEW])
    model = Lobe(25.0, tau=1.0, cells=64)
    one = daylight.run(job, models={"m": Scaled(model, AMBER[1], "Visible")}, quality=QUICK)
    lit = daylight.run(job, models={"m": coloured(model, AMBER)}, quality=QUICK, folder=tmp_path)
    xy = tuple(np.array(AMBER[:2]) / sum(AMBER))
    for a, b in zip(one.points, lit.points):
        assert b.illuminance_lx == pytest.approx(a.illuminance_lx, rel=1e-5)
        assert b.chromaticity_xy == pytest.approx(xy, abs=1e-4)
    (image,) = lit.images
    assert image.xyz is not None
    seen = image.xyz[image.luminance > 1.0]
    assert len(seen) > 40
    ratios = np.tile(np.array(AMBER) / AMBER[1], (len(seen), 1))
    # A bin of directions whose middle lies on the horizon is sky or ground by the last digit of its place.
    assert seen / seen[:, 1:2] == pytest.approx(ratios, rel=4e-3)
    assert lit.panes[0].chromaticity_xy == pytest.approx(xy, abs=1e-3)
    # The files: Radiance's own reader, its channels turned into X, Y and Z by the published primaries.
    raw = run(["pvalue", "-h", "-H", "-d", "-df", str(image.hdr)])
    rgb = np.frombuffer(raw, "<f4").reshape(30, 40, 3).astype(float)
    xyz = 179.0 * rgb @ RGB_TO_XYZ.T
    bright = image.luminance > 10.0
    assert xyz[bright] == pytest.approx(image.xyz[bright], rel=0.03)
    assert xyz[..., 1].sum() == pytest.approx(image.luminance.sum(), rel=3e-3)
    with np.load(image.npz) as held:
        assert held["xyz"] == pytest.approx(image.xyz, rel=1e-6)


def test_colours_of_walls_multiply_at_every_bounce() -> None:
    """One reflectance on all faces and panes: mean illuminance = flux / (area (1 - rho)), in each channel."""
    rho = np.array([0.7, 0.5, 0.2])
    shade = tuple(map(float, rho))
    names = ("ceiling", "walls", "floor", "frames")
    grid = [
        {"name": f, "face": f, "spacing_m": 0.5}
        for f in ("floor", "ceiling", "south", "north", "west", "east")
    ]
    job = room(
        room={"width_m": 3.0, "depth_m": 3.0, "height_m": 3.0},
        reflectance=dict.fromkeys(names, shade),
        sky=SKY,
        ground={"reflectance": 0.0},
        grid=grid,
    )
    lit = daylight.run(job, models={"m": coloured(Diffuser(1.0), AMBER)}, quality=QUICK)
    total, area = np.zeros(3), 0.0
    for g in lit.grids:
        assert g.chromaticity_xy is not None
        x, y = np.moveaxis(g.chromaticity_xy, -1, 0)
        xyz = np.stack([x / y, np.ones_like(x), (1 - x - y) / y], axis=-1) * g.illuminance_lx[..., None]
        total += to_rgb(xyz).mean(axis=(0, 1)) * 9.0
        area += 9.0
    # A wall sees half of an overcast sky: E_h (pi / 2 + 4 / 3) / 3 / (pi 7 / 9).
    vertical = 1e4 * (np.pi / 2 + 4 / 3) / 3 / (np.pi * 7 / 9)
    flux = to_rgb(np.array(AMBER)) * vertical * 0.8 * 1.1
    # The pane itself is black for light from the room.
    swallowed = 1.0 - rho * (1.0 - 0.8 * 1.1 / area)
    assert total == pytest.approx(flux / swallowed, rel=0.03)


def test_a_neutral_model_in_a_room_with_coloured_walls_is_lit_in_their_colour(tmp_path: Path) -> None:
    red = {"ceiling": 0.7, "walls": (0.6, 0.1, 0.1), "floor": 0.3}
    wall = sensors([(2.5, 6.0, 1.5)], (0, -1, 0))
    view = VIEW | {"position_m": (2.5, 1.0, 1.5), "direction": (0, 1, 0)}
    job = room(reflectance=red, sun=SUN, sky=SKY, sensor=wall, view=[view])
    lit = daylight.run(job, models={"m": Lobe(30.0, cells=64)}, quality=QUICK, folder=tmp_path)
    (point,), (image,) = lit.points, lit.images
    assert "neutral" in lit.colour["m"]
    assert point.chromaticity_xy is not None and image.xyz is not None
    assert point.chromaticity_xy[0] > 0.34
    column, row = (int(v) for v in image.pixels["p0"])
    x, y = point.chromaticity_xy
    received = np.array([x / y, 1.0, (1 - x - y) / y]) * point.illuminance_lx
    expected = to_xyz(to_rgb(received) * np.array(red["walls"])) / np.pi
    assert image.xyz[row, column] == pytest.approx(expected, rel=0.05)


def no_visible_band() -> Any:
    return pytest.warns(SpeculariaWarning, match="no Visible band; CIE-Y is used")


def klems_of_three_bands(path: Path, *, y: str, uv: bool = False) -> None:
    """A file of somebody else's: even scatterers, each band with a transmission of its own, as matrices.

    With `uv` the chromaticity stands in bands CIE-u and CIE-v, which hold u' and v' themselves.
    """
    n = 145
    text, held = [], dict(zip(("CIE-X", y, "CIE-Z"), AMBER))
    if uv:
        whole = AMBER[0] + 15 * AMBER[1] + 3 * AMBER[2]
        held = {y: AMBER[1], "CIE-u": np.pi * 4 * AMBER[0] / whole, "CIE-v": np.pi * 9 * AMBER[1] / whole}
    for band, tau in held.items():
        values = ", ".join([f"{tau / np.pi:.9f}"] * (n * n))
        text += [
            f"<WavelengthData><Wavelength unit='Integral'>{band}</Wavelength><WavelengthDataBlock>"
            f"<WavelengthDataDirection>{side}</WavelengthDataDirection>"
            "<ColumnAngleBasis>LBNL/Klems Full</ColumnAngleBasis>"
            "<RowAngleBasis>LBNL/Klems Full</RowAngleBasis>"
            "<ScatteringDataType>BTDF</ScatteringDataType>"
            f"<ScatteringData>{values}</ScatteringData></WavelengthDataBlock></WavelengthData>"
            for side in ("Transmission Front", "Transmission Back")
        ]
    path.write_text(
        "<?xml version='1.0'?><WindowElement><Optical><Layer>"
        "<Material><Name>amber, synthetic</Name></Material>"
        "<DataDefinition><IncidentDataStructure>Columns</IncidentDataStructure></DataDefinition>"
        + "".join(text)
        + "</Layer></Optical></WindowElement>"
    )


@pytest.mark.parametrize(("y", "uv"), [("Visible", False), ("CIE-Y", False), ("Visible", True)])
def test_a_file_of_three_bands_from_anyone_lights_the_room_in_colour(
    tmp_path: Path, y: str, uv: bool
) -> None:
    klems_of_three_bands(tmp_path / "amber.xml", y=y, uv=uv)
    job = room(sky=SKY, sensor=PLACES[:1])
    with no_visible_band() if y == "CIE-Y" else nullcontext():
        lit = daylight.run(job, models={"amber": tmp_path / "amber.xml"}, quality=QUICK)
    assert lit.points[0].chromaticity_xy == pytest.approx(tuple(np.array(AMBER[:2]) / sum(AMBER)), abs=1e-5)
    if y == "CIE-Y" or uv:
        return
    again = bsdf.write(bsdf.read(tmp_path / "amber.xml"), tmp_path / "again.xml")
    same = daylight.run(job, models={"amber": again.path}, quality=QUICK)
    assert same.points[0].chromaticity_xy == pytest.approx(lit.points[0].chromaticity_xy, abs=1e-5)
    assert same.points[0].illuminance_lx == pytest.approx(lit.points[0].illuminance_lx, rel=1e-5)


def test_a_file_of_two_bands_is_refused_and_files_of_single_bands_are_joined(tmp_path: Path) -> None:
    klems_of_three_bands(tmp_path / "amber.xml", y="Visible")
    model = bsdf.read(tmp_path / "amber.xml")
    assert isinstance(model, bsdf.XmlModel)
    two = replace(model, all_bands={b: p for b, p in model.all_bands.items() if b != "CIE-Z"})
    job = room(sky=SKY, sensor=PLACES[:1])
    with pytest.raises(CoverageError, match="CIE-X beside Visible"):
        daylight.run(job, models={"m": two}, quality=QUICK)
    for name, band in (("x", "CIE-X"), ("y", "Visible"), ("z", "CIE-Z")):
        part = replace(model, parts=model.all_bands[band], band=band, bands=(band,), all_bands={})
        bsdf.write(part, tmp_path / f"{name}.xml")
    files = {k: str(tmp_path / f"{n}.xml") for k, n in (("file", "y"), ("cie_x", "x"), ("cie_z", "z"))}
    lit = daylight.run(room(sky=SKY, sensor=PLACES[:1], model=[{"name": "m", **files}]), quality=QUICK)
    assert lit.points[0].chromaticity_xy == pytest.approx(tuple(np.array(AMBER[:2]) / sum(AMBER)), abs=1e-5)
    with pytest.raises(ValueError, match="cie_x and cie_z together"):
        room(model=[{"name": "m", "file": files["file"], "cie_x": files["cie_x"]}])


def test_a_fragment_of_three_bands_is_seen_in_the_colour_that_it_gives_to_white(tmp_path: Path) -> None:
    """Bare paper stays white; under an even diffuser on grey paper light passes twice, once for each way."""
    job = {
        "sheet": {"pattern": "bars", "stroke_mm": 0.5, "paper": 0.5, "ink": 0.4999},
        "sample": {"reflectance": 0.0, "outline_mm": [[-90, -90], [90, -90], [90, 90], [-90, 90]]},
        "picture": {"pixel_mm": 1.0, "border_mm": 30.0},
        "gap_mm": [0.0],
    }
    seen = daylight.look_through(
        FragmentJob.model_validate(job),
        models={"amber": coloured(Diffuser(1.0), AMBER), "y": Scaled(Diffuser(1.0), AMBER[1], "Visible")},
    )
    amber, grey = seen.pictures
    assert grey.xyz is None and amber.xyz is not None
    assert amber.luminance == pytest.approx(grey.luminance, rel=1e-12)
    middle, corner = (amber.xyz[k, k] for k in (amber.xyz.shape[0] // 2, 0))
    assert corner / corner[1] == pytest.approx([1, 1, 1], abs=0.05)
    assert middle / middle[1] == pytest.approx((np.array(AMBER) / AMBER[1]) ** 2, rel=0.01)
    path = figures.fragment_pictures(seen.pictures, tmp_path / "f.png", synthetic=True)
    with np.load(path.with_suffix(".npz")) as held:
        assert held["xyz_0"].shape == amber.xyz.shape and "xyz_1" not in held


def test_pictures_in_colour_keep_hues_and_show_grey_as_grey(tmp_path: Path) -> None:
    luminance = np.geomspace(1.0, 3000.0, 12).reshape(3, 4)
    amber = luminance[..., None] * np.array(AMBER) / AMBER[1]
    grey = np.repeat(luminance[..., None], 3, axis=2)
    one, two = screen([amber, grey])
    assert two == pytest.approx(np.repeat(two[..., :1], 3, axis=2), abs=2e-3)
    assert np.all(np.diff(two[..., 0].ravel()) > 0.0)
    assert (
        one[..., 0].max() <= 1.0 and np.all(one[..., 0] > one[..., 1]) and np.all(one[..., 1] > one[..., 2])
    )
    images = [SimpleNamespace(model=m, luminance=luminance, xyz=x) for m, x in (("a", amber), ("b", None))]
    path = figures.colour_pictures(images, tmp_path / "c.png")
    with np.load(path.with_suffix(".npz")) as held:
        assert held["xyz_1"][..., 0] == pytest.approx(luminance, rel=1e-6)
