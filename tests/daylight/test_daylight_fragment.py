"""The fragment over print against closed forms. All models here are synthetic."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from daylight_models import Diffuser, Lobe

from specularia import daylight
from specularia.bsdf import Quadrature
from specularia.daylight.fragment_job import FragmentJob, Sample
from specularia.daylight.fragment_optics import Placed, lambert_transfer
from specularia.errors import FormatError

SQUARE = [[-25.0, -25.0], [25.0, -25.0], [25.0, 25.0], [-25.0, 25.0]]
THIN = {"outline_mm": SQUARE, "scatters_at": 0.0, "reflectance": 0.0}


def job(**changes: Any) -> FragmentJob:
    content: dict[str, Any] = {
        "sample": THIN,
        "sheet": {"pattern": "bars", "stroke_mm": 1.0, "paper": 0.8, "ink": 0.05},
        "light": {"diffuse_lx": 600.0},
        "picture": {"pixel_mm": 0.25, "border_mm": 15.0},
        "gap_mm": [2.0],
        "contrast_gap_mm": [0.0, 1.0],
    }
    return FragmentJob.model_validate(content | changes)


class Clear(Lobe):
    """Almost clear glass: a lobe of 0.05 degrees, with points of its own around the undeflected direction."""

    def __init__(self, tau: float = 0.8) -> None:
        super().__init__(0.05, tau=tau, cells=4)

    def quadrature(self, side: str, theta_i_deg: float, phi_i_deg: float = 0.0) -> Quadrature:
        s, phi = np.sin(np.radians(theta_i_deg)), np.radians(phi_i_deg)
        step = self.width / 3
        k = np.arange(-15, 16) * step
        x, y = (v.ravel() for v in np.meshgrid(k, k))
        x, y = x - s * np.cos(phi), y - s * np.sin(phi)
        return Quadrature(ux=x, uy=y, weight=np.full(x.size, step**2))

    def direct_hemispherical(self, side: str, theta_i_deg: Any, phi_i_deg: Any = 0.0) -> Any:
        return np.broadcast_to(self.tau, np.broadcast_shapes(np.shape(theta_i_deg), np.shape(phi_i_deg)))


class Glossy(Diffuser):
    """A diffuser whose faces also reflect evenly."""

    sides = ("transmission_front", "transmission_back", "reflection_front", "reflection_back")

    def value(self, side: str, sx: Any, sy: Any, ux: Any, uy: Any) -> Any:
        share = self.tau if side.startswith("transmission") else 0.2
        return np.broadcast_to(share / np.pi, np.broadcast_shapes(*(np.shape(v) for v in (sx, sy, ux, uy))))


def middle(picture: daylight.FragmentPicture) -> float:
    """Mean over the inner square centimetre."""
    rows, columns = picture.luminance.shape
    half = 20
    return float(
        picture.luminance[
            rows // 2 - half : rows // 2 + half, columns // 2 - half : columns // 2 + half
        ].mean()
    )


def test_over_an_even_sheet_the_glass_shows_what_two_passes_and_the_light_between_leave() -> None:
    """L = tau R E / (pi (1 - rho R)), with E = tau (E_sky + E_lamp cos theta) under an even diffuser."""
    even = {"pattern": "bars", "paper": 0.8, "ink": 0.8 - 1e-9}
    light = {"diffuse_lx": 600.0, "lamp_lx": 1000.0, "lamp_elevation_deg": 50.0}
    sample = THIN | {"reflectance": 0.3}
    seen = daylight.look_through(job(sheet=even, light=light, sample=sample), models={"d": Diffuser(0.5)})
    received = 0.5 * (600.0 + 1000.0 * np.sin(np.radians(50.0)))
    truth = 0.5 * 0.8 * received / (np.pi * (1 - 0.3 * 0.8))
    assert middle(seen.pictures[0]) == pytest.approx(truth, rel=0.015)
    # Beside the glass, 20 gaps away from it, the sheet is as bright as on an empty table.
    corner = seen.pictures[0].luminance[:4, :4].mean()
    bare = 0.8 * (600.0 + 1000.0 * np.sin(np.radians(50.0))) / np.pi
    assert corner == pytest.approx(bare, rel=0.01)


def test_reflection_of_the_top_adds_a_veil_that_lowers_the_contrast_by_its_share() -> None:
    light = {"diffuse_lx": 600.0, "lamp_lx": 1000.0, "lamp_elevation_deg": 30.0}
    seen = daylight.look_through(job(light=light), models={"g": Glossy(0.5), "d": Diffuser(0.5)})
    glossy, plain = (middle(p) for p in seen.pictures)
    veil = 0.2 * (600.0 + 1000.0 * 0.5) / np.pi
    assert glossy - plain == pytest.approx(veil, rel=1e-6)
    c = seen.contrast[0]
    assert c.reflects and not seen.contrast[1].reflects
    # Contact, no light back and forth: paper and ink as printed, then the veil.
    received = 0.5 * 1100.0
    paper, ink = (0.5 * r * received / np.pi for r in (0.8, 0.05))
    assert c.transmitted[0] == pytest.approx((paper - ink) / (paper + ink), rel=1e-6)
    assert c.contrast[0] == pytest.approx((paper - ink) / (paper + ink + 2 * veil), rel=1e-6)


def test_glass_on_the_sheet_shows_the_print_as_sharp_as_it_is() -> None:
    seen = daylight.look_through(job(gap_mm=[0.0]), models={"lobe": Lobe(15.0), "d": Diffuser(0.4)})
    for picture, curve in zip(seen.pictures, seen.contrast):
        rows, columns = picture.luminance.shape
        inner = picture.luminance[rows // 2, columns // 2 - 40 : columns // 2 + 40]
        assert (inner.max() - inner.min()) / (inner.max() + inner.min()) == pytest.approx(
            curve.bare, rel=1e-6
        )
        assert curve.contrast[0] == pytest.approx(curve.bare, rel=1e-6)


@pytest.mark.parametrize("gap", [4.0, 8.0, 12.0])
def test_a_gaussian_lobe_blurs_a_sine_pattern_as_its_closed_form_says(gap: float) -> None:
    """exp(-2 (pi f g sigma)^2) for the displacement g sigma, at small angles."""
    lobe = Lobe(3.0, cells=400)
    sigma, f = lobe.width, 0.5
    truth = np.exp(-2 * (np.pi * f * gap * sigma) ** 2)
    fan = Placed(lobe, Sample(scatters_at=0.0), name="lobe").fan(0.0, 0.0)
    transfer = abs(fan.transfer(np.array([0.0, f]), gap=gap, depth=0.0, index=1.52))
    assert transfer[1] / transfer[0] == pytest.approx(truth, rel=0.01)
    # The same in a picture: what is left of the fundamental of bars 1 mm wide.
    seen = daylight.look_through(job(gap_mm=[gap], picture={"pixel_mm": 0.125}), models={"lobe": lobe})
    picture = seen.pictures[0].luminance
    rows, columns = picture.shape
    line = picture[rows // 2, columns // 2 - 80 : columns // 2 + 80]
    wave = abs(np.exp(2j * np.pi * f * 0.125 * np.arange(line.size)) @ line) / line.sum()
    square = 2 / np.pi * seen.contrast[0].bare
    # Pixels of an eighth of a millimetre take another 0.6 %.
    assert wave / square == pytest.approx(truth, rel=0.02)


def test_scattering_within_the_glass_counts_as_a_gap_shorter_by_the_index() -> None:
    fan = Placed(Lobe(3.0, cells=300), Sample(), name="lobe").fan(0.0, 0.0)
    f = np.array([0.5])
    inside = abs(fan.transfer(f, gap=0.0, depth=15.2, index=1.52))
    assert inside == pytest.approx(abs(fan.transfer(f, gap=10.0, depth=0.0, index=1.52)), rel=2e-3)


def test_clear_glass_keeps_the_print_and_an_even_diffuser_loses_it_within_millimetres() -> None:
    seen = daylight.look_through(
        job(contrast_gap_mm=[0.0, 3.0, 20.0, 50.0]), models={"clear": Clear(), "d": Diffuser(0.5)}
    )
    clear, diffuser = seen.contrast
    assert np.all(clear.contrast > 0.99 * clear.bare)
    assert diffuser.contrast[0] == pytest.approx(diffuser.bare, rel=1e-6)
    assert np.all(diffuser.contrast[1:] < 0.01)


def test_the_shadow_lies_away_from_the_lamp_by_the_gap_over_the_tangent_of_its_elevation() -> None:
    light = {"diffuse_lx": 0.0, "lamp_lx": 1000.0, "lamp_elevation_deg": 45.0, "lamp_azimuth_deg": 180.0}
    even = {"pattern": "bars", "paper": 0.8, "ink": 0.8 - 1e-9}
    seen = daylight.look_through(
        job(light=light, sheet=even, gap_mm=[6.0], sample=THIN | {"scatters_at": 0.0}),
        models={"clear": Clear(tau=0.5)},
    )
    (picture,) = seen.pictures
    row = picture.luminance[picture.luminance.shape[0] // 2]
    x = np.linspace(picture.extent_mm[0], picture.extent_mm[1], row.size + 1)[:-1] + 0.125
    bare = 0.8 * 1000.0 * np.sin(np.radians(45.0)) / np.pi
    # The lamp stands at the left: the shadow of the right edge falls 6 mm further right.
    assert row[(x > 25.5) & (x < 30.5)] == pytest.approx(0.5 * bare, rel=0.01)
    assert row[x > 31.5] == pytest.approx(bare, rel=0.01)
    # Through the glass the lit strip at the left edge loses only the way back.
    assert row[(x > -24.5) & (x < -19.5)] == pytest.approx(0.5 * bare, rel=0.01)
    assert row[(x > -18.5) & (x < 24.5)] == pytest.approx(0.25 * bare, rel=0.01)


@pytest.mark.parametrize(
    ("front", "turn", "way"), [("up", 0, (1, 0)), ("down", 0, (-1, 0)), ("up", 90, (0, 1))]
)
def test_a_lobe_to_one_side_shows_the_print_from_there(front: str, turn: float, way: tuple[int, int]) -> None:
    sample = Sample.model_validate(THIN | {"front": front, "turn_deg": turn})
    fan = Placed(Lobe(5.0, shift=(0.2, 0.0)), sample, name="lobe").fan(0.0, 0.0)
    at = fan.displaced(fan.ux, fan.uy, gap=10.0, depth=0.0, index=1.52)
    mean = fan.share @ at / fan.share.sum()
    assert mean == pytest.approx(10.0 * np.tan(np.arcsin(0.2)) * np.array(way), abs=0.05)


def test_a_picture_moves_with_a_lobe_to_one_side() -> None:
    """The eye sees the sheet at x + g tan: a dark half at the right moves to the left in the picture."""
    from specularia.daylight import fragment

    class Half(fragment._Table):
        def __init__(self, *args: Any) -> None:
            super().__init__(*args)
            columns = self.paper.shape[1]
            self.paper = np.where(np.arange(columns) < columns // 2, 0.8, 0.1) * np.ones_like(self.paper)

    table = Half(job(gap_mm=[10.0]), Path("test"))
    model = Lobe(5.0, shift=(0.2, 0.0))
    lit = fragment._Lit(Placed(model, Sample.model_validate(THIN), name="lobe"), job(gap_mm=[10.0]))
    picture = table.picture("lobe", lit, 10.0).luminance
    row = picture[picture.shape[0] // 2]
    inner = np.arange(row.size)[80:-80]
    edge = inner[np.argmin(np.gradient(row)[inner])]
    sheet = np.argmin(np.gradient(table.paper[0])) - table.margin
    assert (edge - sheet) * 0.25 == pytest.approx(-10.0 * np.tan(np.arcsin(0.2)), abs=0.5)


def test_light_of_an_even_scatterer_falls_off_as_its_transform_says() -> None:
    """D^2 / (pi (r^2 + D^2)^2) against x K1(x), by a sum over a fine grid."""
    d, f = 2.0, np.array([0.05, 0.15])
    x = (np.arange(-1500, 1500) + 0.5) * 0.1
    line = (d**2 / (np.pi * (x[:, None] ** 2 + x[None, :] ** 2 + d**2) ** 2)).sum(axis=1) * 0.01
    total = np.cos(2 * np.pi * f[:, None] * x) @ line
    assert lambert_transfer(f, d) == pytest.approx(total, rel=2e-3)
    assert lambert_transfer(np.array([0.0, 1e4]), d).tolist() == pytest.approx([1.0, 0.0])


FRAGMENT = """
gap_mm = [0, 5]
contrast_gap_mm = [0, 1, 5]
[picture]
pixel_mm = 0.4
[sheet]
pattern = "text"
text = "one line"
"""


@pytest.mark.parametrize(
    ("change", "says"),
    [
        (("gap_mm = [0, 5]", "gap_mm = [5, 0]"), "gaps that rise"),
        (("gap_mm = [0, 5]", "gaps_mm = [5, 0]"), "gap_mm"),
        (('text = "one line"', 'image = "x.png"'), "image"),
        (("pixel_mm = 0.4", "pixel_mm = 0.011"), "million pixels"),
        (("[picture]", "[sample]\noutline_mm = [[0, 0], [1, 1], [2, 2]]\n[picture]"), "encloses an area"),
        (("[picture]", "[light]\ndiffuse_lx = 0\n[picture]"), "some light"),
        (("[picture]", '[sample]\nmask = "none.png"\nmask_width_mm = 70\n[picture]'), "none.png"),
    ],
)
def test_a_fragment_that_cannot_be_is_refused(tmp_path: Path, change: tuple[str, str], says: str) -> None:
    assert change[0] in FRAGMENT
    path = tmp_path / "FRAGMENT.toml"
    path.write_text(FRAGMENT.replace(*change))
    with pytest.raises(FormatError) as caught:
        daylight.look_through(path, models={"d": Diffuser(0.5)})
    assert says in str(caught.value)


def test_a_mask_and_a_printed_picture_lie_the_way_up_they_were_drawn(tmp_path: Path) -> None:
    import imageio.v3 as iio

    mask = np.zeros((50, 70), np.uint8)
    mask[:25] = 255
    iio.imwrite(tmp_path / "mask.png", mask)
    page = np.full((80, 100), 255, np.uint8)
    page[:, :50] = 0
    iio.imwrite(tmp_path / "page.png", page)
    todo = job(
        sample={"mask": tmp_path / "mask.png", "mask_width_mm": 70.0, "scatters_at": 0.0},
        sheet={"pattern": "image", "image": tmp_path / "page.png", "image_width_mm": 100.0},
        gap_mm=[0.0],
        picture={"pixel_mm": 0.5},
    )
    seen = daylight.look_through(todo, models={"d": Diffuser(0.5)})
    (picture,) = seen.pictures
    rows, columns = picture.luminance.shape
    assert picture.covered.sum() == pytest.approx(70 * 25 / 0.25, rel=0.01)
    assert picture.covered[rows // 2 + 1 :].sum() == 0
    beside = picture.luminance[rows // 2 + 5 :]
    assert beside[:, : columns // 2 - 2].max() < 0.2 * beside[:, columns // 2 + 2 :].min()


def test_the_command_writes_pictures_contrast_and_one_json(tmp_path: Path, command) -> None:  # type: ignore[no-untyped-def]
    from test_daylight_room_file import tabulated

    model = tabulated(tmp_path / "m.nc")
    path = tmp_path / "FRAGMENT.toml"
    path.write_text(FRAGMENT + '\n[[model]]\nname = "A"\nfile = "m.nc"\n')
    out = tmp_path / "out"
    code, result, err = command(
        "daylight", "fragment", path, "-o", out, "--model", f"B={model}", "--json", "-q"
    )
    assert code == 0, err
    assert [(p["model"], p["gap_mm"]) for p in result["pictures"]] == [("A", 0), ("A", 5), ("B", 0), ("B", 5)]
    assert all(Path(f).is_file() for f in result["figures"].values())
    assert result["outline"] == "synthetic"
    a, b = result["contrast"]
    assert a["contrast"] == b["contrast"] and a["contrast"][0] > a["contrast"][2]
    numbers = np.load(out / "fragment.npz")
    assert numbers["luminance_0"].shape == numbers["luminance_3"].shape and str(numbers["model_3"]) == "B"
    assert (out / "fragment.json").is_file() and (out / "contrast.csv").is_file()


def test_the_example_in_the_documentation_of_the_job_is_a_fragment_and_so_is_an_empty_file() -> None:
    import textwrap
    import tomllib

    from specularia.daylight import fragment_job

    assert fragment_job.__doc__ is not None
    example = tomllib.loads(textwrap.dedent(fragment_job.__doc__.split("::\n", 1)[1]))
    assert FragmentJob.model_validate(example).gap_mm == (0.0, 5.0, 20.0)
    assert FragmentJob.model_validate({}).sample.outline_mm is None
