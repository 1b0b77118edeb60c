"""The view: what the browser reads out of it is what Python put in."""

from __future__ import annotations

import importlib.resources
import json
import re
import subprocess
from dataclasses import dataclass
from functools import cache, partial
from pathlib import Path

import numpy as np
import pytest

from specularia import bsdf
from specularia.bsdf.klems import BASES
from specularia.bsdf.tabulated import SideTable, cell_centres
from specularia.bsdf.xml_model import KlemsPart
from specularia.conventions import SIDES, direction_cosines
from specularia.gonio import Table
from specularia.report import _view_data, viewer

FRONT, BACK = "transmission_front", "transmission_back"


def console(log: str) -> list[str]:
    """What the page wrote to the console."""
    return [line for line in log.splitlines() if "CONSOLE" in line]


def shown(html: str, name: str) -> tuple[dict[str, float | None], str]:
    """The exact values and the text of one of the page's read-outs."""
    found = re.search(rf'<p ([^>]*id="{name}"[^>]*)>(.*?)</p>', html, re.S)
    assert found, name
    data = {k: (float(v) if v else None) for k, v in re.findall(r'data-(\w+)="([^"]*)"', found.group(1))}
    return data, found.group(2)


def acting(path: Path, script: str) -> Path:
    """The page with something done in it once it stands."""
    made = path.with_name("acted.html")
    text = path.read_text(encoding="utf-8")
    made.write_text(text.replace("</body>", f"<script>{script}</script></body>"), encoding="utf-8")
    return made


@pytest.fixture
def browse(browse):
    """All that these pages do is done when they are loaded: no need to wait for anything."""
    return partial(browse, clock=True)


DRAG = """
function drag(id, steps) {
  const c = document.getElementById(id), box = c.getBoundingClientRect();
  const send = (type, [x, y]) => c.dispatchEvent(new PointerEvent(type, {
    clientX: box.left + x * box.width, clientY: box.top + y * box.height, pointerId: 1, pointerType: "mouse",
    bubbles: true }));
  send("pointerdown", steps[0]); steps.forEach(s => send("pointermove", s)); send("pointerup", steps.at(-1));
}
const press = (key, target, shiftKey = false) => (target || document.body).dispatchEvent(
  new KeyboardEvent("keydown", { key, shiftKey, bubbles: true, cancelable: true }));
const say = (name, value) => { document.documentElement.dataset[name] = value; };
const text = id => document.getElementById(id).textContent;
"""


@pytest.fixture
def view(lobe, tmp_path):
    models = {"Model M": lobe(width=0.05), "Model C": lobe(width=0.1, even=0.02, last_deg=70.0)}
    path = viewer.write_view(models, tmp_path / "view.html", theta_deg=[0, 20, 40, 60, 80])
    return models, path


@pytest.mark.parametrize(("phi", "x", "y"), [(0, -38.1, 5.2), (0, 25, 61), (70, -17, -36), (233, 3, -88.7)])
def test_values_in_the_browser_equal_those_of_evaluate_at_the_direction_it_names(view, browse, phi, x, y):
    models, path = view
    html, log = browse(path, f"#side=transmission_front&theta=40&phi={phi}&x={x}&y={y}")
    assert not console(log)
    assert 'data-ready="yes"' in html
    for k, model in enumerate(models.values()):
        value, text = shown(html, f"value-{k}")
        # Transmitted light leaves at more than 90 degrees from the front normal.
        ux, uy, uz = direction_cosines(value["theta"], value["phi"])
        assert uz < 0
        exact = float(model.evaluate(FRONT, 40.0, float(phi), ux, uy))
        assert value["value"] == pytest.approx(exact, rel=2.5e-4)
        assert value["dsf"] == pytest.approx(exact * abs(uz), rel=2.5e-4)
        # The direction named is the one pointed at, to half a step of the grid there.
        off = 180.0 - value["theta"]
        at = off * np.cos(np.radians(value["phi"])), off * np.sin(np.radians(value["phi"]))
        near = np.hypot(x + 40 * np.cos(np.radians(phi)), y + 40 * np.sin(np.radians(phi))) < 12
        assert np.hypot(at[0] - x, at[1] - y) < (0.36 if near else 1.5 if abs(y) < 88 else 2.5)
        assert text.startswith(
            f"θₛ {value['theta']:.1f}°, φₛ {value['phi']:.1f}° ({off:.1f}° off the normal)"
        )
        assert f"BSDF {value['value']:.4g}".rstrip("0") in text and "DSF" in text
        tau, _ = shown(html, f"tau-{k}")
        assert tau["value"] == pytest.approx(float(model.direct_hemispherical("", 40.0)))


def test_a_model_with_standard_errors_shows_them_to_three_percent(browse, tmp_path):
    model = tabulated()
    path = viewer.write_view({"M": model}, tmp_path / "view.html", theta_deg=[25, 50])
    for side in (FRONT, BACK):
        html, log = browse(path, f"#side={side}&theta=25&phi=10&x=-20&y=-8")
        assert not console(log)
        value, text = shown(html, "value-0")
        ux, uy, uz = direction_cosines(value["theta"], value["phi"])
        assert (uz < 0) == (side == FRONT)
        assert value["value"] == pytest.approx(float(model.evaluate(side, 25.0, 10.0, ux, uy)), rel=2.5e-4)
        error = float(model.standard_error(side, 25.0, 10.0, ux, uy))
        assert error > 0
        assert value["error"] == pytest.approx(error, rel=0.03)
        assert " ± " in text
    assert "by reciprocity" in shown(html, "tau-0")[1]
    data = data_of(path)["models"][0]["bands"]["520 nm"][FRONT]
    for side in (FRONT, BACK):
        low, high = model.tau_interval(side, 50.0, level=0.95)
        curve = data_of(path)["models"][0]["bands"]["520 nm"][side]["curves"][0]
        at = next(row for row in curve if row[0] == 50)
        assert at[2:] == pytest.approx([float(low), float(high)], rel=1e-6)
    assert [k[0] for k in data["knots"]] == [0.0, 20.0, 40.0, 60.0]


def test_a_drag_on_the_hemisphere_sets_the_incident_direction(view, browse):
    models, path = view
    # The disc has 8 pixels around it; three quarters right of the middle is some 50 degrees off the normal.
    act = (
        DRAG
        + """
    drag("incident", [[.5, .5], [.75, .5], [.5, .27]]);
    say("after", text("angle") + " " + text("azimuth"));
    const c = document.getElementById("incident");
    press("ArrowUp", c); press("ArrowLeft", c);
    say("keys", text("angle") + " " + text("azimuth"));
    const s = document.getElementById("theta"); s.value = "1"; s.dispatchEvent(new Event("input"));
    const p = document.getElementById("phi"); p.value = "200"; p.dispatchEvent(new Event("input"));
    """
    )
    html, log = browse(acting(path, act), "#x=10&y=-20")
    assert not console(log)
    assert 'data-after="θᵢ = 40° φᵢ = 90°"' in html
    assert 'data-keys="θᵢ = 60° φᵢ = 95°"' in html
    assert ">θᵢ = 20°</output>" in html and ">φᵢ = 200°</output>" in html
    for k, model in enumerate(models.values()):
        value, _ = shown(html, f"value-{k}")
        ux, uy, _ = direction_cosines(value["theta"], value["phi"])
        assert value["value"] == pytest.approx(float(model.evaluate(FRONT, 20.0, 200.0, ux, uy)), rel=2.5e-4)


def test_switches_and_keys_change_what_is_shown(view, browse):
    _, path = view
    act = (
        DRAG
        + """
    document.querySelector('[data-face="back"]').click();
    const map = document.getElementById("map-0"), other = document.getElementById("map-1");
    const together = other.toDataURL();
    document.getElementById("lock").click();
    // The scale of the brighter model was that of both: only the other changes.
    say("unlocked", String(other.toDataURL() !== together));
    press("l");
    say("relocked", String(other.toDataURL() === together));
    const s = document.getElementById("theta"); s.value = "4"; s.dispatchEvent(new Event("input"));
    press("d");
    say("dark", getComputedStyle(document.body).backgroundColor);
    say("lobes", [0, 1].map(k => document.getElementById("lobe-" + k).dataset.faces).join());
    press("ArrowRight", map); press("ArrowUp", map, true);
    // The eye goes around all lobes at once, by hand and by key; never over the pole.
    const from = [state.az, state.el], lobe = document.getElementById("lobe-1");
    drag("lobe-1", [[.5, .5], [.5, .7]]);
    press("ArrowLeft", lobe);
    say("eye", [Math.sign(state.el - from[1]), state.az - from[0]].join());
    drag("lobe-1", [[.5, .1], [.5, 9]]);
    say("pole", state.el);
    """
    )
    html, log = browse(acting(path, act), "#x=0&y=0&theme=light")
    assert not console(log)
    assert re.search(r'data-face="back"[^>]*aria-pressed="true"', html)
    assert re.search(r'id="lock"[^>]*aria-pressed="true"', html)
    assert 'data-dark="rgb(21, 23, 26)"' in html and 'data-theme="dark"' in html
    assert 'data-unlocked="true"' in html and 'data-relocked="true"' in html
    assert ">θᵢ = 80°</output>" in html
    assert shown(html, "tau-0")[1] == "τ = 0.7000 (extrapolated)"
    assert shown(html, "tau-1") == ({"value": None}, "no data at this angle")
    assert shown(html, "value-1")[1].endswith("no data")
    assert 'data-eye="1,5"' in html and 'data-pole="85"' in html
    # A lobe of nothing has no faces; the other has all.
    assert 'data-lobes="2820,0"' in html
    value, _ = shown(html, "value-0")
    # Far from the lobe only the even background is left; light on the back leaves through the front.
    assert value["value"] == pytest.approx(0.1 / np.pi, rel=2.5e-4)
    assert value["theta"] < 7


@pytest.mark.parametrize(("webgl", "width"), [("on", 1280), ("off", 390)])
def test_the_lobe_is_drawn_with_and_without_webgl(view, browse, chromium, tmp_path, webgl, width):
    """Seen in a picture of the page, which is kept: below the map stand the lobe's bright colours."""
    from PIL import Image

    _, path = view
    picture, state = tmp_path / f"view_{width}.png", f"#theta=40&webgl={webgl}&theme=light&x=-38&y=5"
    flags = ["--headless", "--no-sandbox", "--disable-dev-shm-usage", "--enable-unsafe-swiftshader"]
    subprocess.run(
        [chromium, *flags, f"--user-data-dir={tmp_path / 'p'}", "--hide-scrollbars",
         f"--window-size={width},3000", f"--screenshot={picture}", path.resolve().as_uri() + state],
        check=True, capture_output=True, timeout=120,
    )  # fmt: skip
    html, log = browse(path, state)
    assert not console(log)
    drawn = re.search(r'data-lobe="(\w+)"', html).group(1)
    if webgl == "off":
        assert drawn == "canvas"
    elif drawn == "canvas":
        pytest.skip("this browser has no WebGL")
    pixels = np.asarray(Image.open(picture).convert("RGB")).astype(int)
    assert pixels.shape[1] == width
    # On either screen the first map ends above these rows and the lobes stand in them.
    red, green, blue = np.moveaxis(pixels[760:1060], -1, 0)
    orange = (red > 200) & (green > 80) & (green < 220) & (blue < 90)
    assert orange.sum() > 150


def test_measured_points_are_drawn_at_their_angle_only(lobe, browse, tmp_path):
    theta_s, phi_s = np.meshgrid(np.arange(92.0, 180.0, 4.0), np.arange(0.0, 360.0, 10.0))
    dsf = np.where(theta_s < 100, -1.0, 0.3)
    table = Table(
        "t.dat", "DSF", FRONT, 33.0, 0.0, theta_s.ravel(), phi_s.ravel(), dsf.ravel(), band="520 nm"
    )
    path = viewer.write_view({"M": lobe()}, tmp_path / "view.html", theta_deg=[0, 40], measured=[table])
    assert data_of(path)["theta"] == [0.0, 33.0, 40.0]
    # In the plane: azimuths 0 and 180 of every polar angle; those near the normal lie near the plane anyway.
    polar = 180.0 - theta_s
    near = np.abs(polar * np.sin(np.radians(phi_s - table.azimuth_deg))) < 1.0
    by_hand = int((near & (dsf > 0)).sum())
    assert by_hand >= 40
    for theta, points in [(33, by_hand), (40, 0)]:
        html, log = browse(path, f"#theta={theta}")
        assert not console(log)
        assert f'data-measured="{points}"' in html


@dataclass
class Turned:
    """A model that is not isotropic: the value tells both directions."""

    band: str = "Visible"
    sides: tuple[str, ...] = (FRONT, "reflection_front")
    isotropic: bool = False
    factor: float = 1.0

    def evaluate(self, side, theta_i_deg, phi_i_deg, ux, uy):
        scale = self.factor * (2.0 if side == FRONT else 1.0) * (100.0 + theta_i_deg + phi_i_deg / 1000.0)
        return scale * np.exp(ux + 2.0 * uy)

    def direct_hemispherical(self, side, theta_i_deg, phi_i_deg=0.0):
        theta, phi = np.broadcast_arrays(np.asarray(theta_i_deg, float), np.asarray(phi_i_deg, float))
        return self.factor * (0.3 + phi / 1e4 + 0.0 * theta)


def test_a_model_that_is_not_isotropic_has_its_own_azimuths(lobe, browse, tmp_path):
    models = {"L": Turned(), "M": lobe()}
    path = viewer.write_view(models, tmp_path / "view.html", theta_deg=[0, 30])
    phis = data_of(path)["phi"]
    assert len(phis) >= 8 and phis == sorted(phis)
    near = min(phis, key=lambda p: abs(p - 101))
    html, log = browse(path, "#theta=30&phi=101&x=40&y=7&side=transmission_front")
    assert not console(log)
    assert f">φᵢ = {near:g}°</output>" in html
    for k, model in enumerate(models.values()):
        value, _ = shown(html, f"value-{k}")
        ux, uy, _ = direction_cosines(value["theta"], value["phi"])
        assert value["value"] == pytest.approx(float(model.evaluate(FRONT, 30.0, near, ux, uy)), rel=2.5e-4)
    assert shown(html, "tau-0")[0]["value"] == pytest.approx(0.3 + near / 1e4)
    html, _ = browse(acting(path, DRAG + 'press("t");'), "#theta=30&phi=101&x=40&y=7")
    value, _ = shown(html, "value-0")
    ux, uy, uz = direction_cosines(value["theta"], value["phi"])
    assert uz > 0
    exact = float(models["L"].evaluate("reflection_front", 30.0, near, ux, uy))
    assert value["value"] == pytest.approx(exact, rel=2.5e-4)
    assert shown(html, "tau-1")[1] == "no data on this side"


def test_bands_are_switched_and_models_of_one_band_stay(lobe, browse, tmp_path):
    models = {"X": [Turned(band="Visible"), Turned(band="Solar", factor=0.5)], "M": lobe(band="520 nm")}
    path = viewer.write_view(models, tmp_path / "view.html", theta_deg=[0])
    first, _ = browse(path, "#x=3&y=4")
    html, log = browse(acting(path, """document.querySelector('[data-band="Solar"]').click();"""), "#x=3&y=4")
    assert not console(log)
    assert shown(html, "value-0")[0]["value"] == pytest.approx(
        0.5 * shown(first, "value-0")[0]["value"], rel=5e-4
    )
    assert shown(html, "value-1")[1] == shown(first, "value-1")[1]
    assert "<span>Solar</span>" in html and "<span>520 nm</span>" in html
    key, _ = browse(acting(path, DRAG + 'press("b");'), "#x=3&y=4")
    assert shown(key, "value-0")[1] == shown(html, "value-0")[1]


def test_the_page_asks_nothing_of_the_network(view, browse):
    _, path = view
    act = """
    let bad = 0;
    document.addEventListener("securitypolicyviolation", () => { bad++; });
    document.documentElement.dataset.asked = performance.getEntriesByType("resource").length;
    document.documentElement.dataset.bad = bad;
    """
    html, log = browse(acting(path, act))
    assert not console(log)
    assert 'data-asked="0"' in html and 'data-bad="0"' in html
    text = path.read_text(encoding="utf-8")
    assert "default-src 'none'" in text
    # Nothing but the names of namespaces and the sources' own address looks like one.
    found = set(re.findall(r"""https?://[^\s"'`)<]+""", text))
    assert found <= {"http://www.w3.org/1999/xhtml"}
    assert not re.search(r"<(script|link|img)[^>]*(src|href)=(?!.?data:)", text)


def test_a_drag_is_answered_and_its_time_is_known(lobe, browse, tmp_path, capsys):
    """The bar is 100 ms for a measured model and a tree; here it is printed, since machines differ."""
    path = viewer.write_view({"M": lobe(), "C": lobe()}, tmp_path / "view.html", theta_deg=range(0, 88, 4))
    act = (
        DRAG
        + """
    const steps = [...Array(24).keys()].map(i => [.5 + .3 * Math.cos(i / 4), .5 + .3 * Math.sin(i / 4)]);
    drag("incident", steps.slice(0, 3));
    const begun = performance.now();
    drag("incident", steps);
    say("perStep", ((performance.now() - begun) / (steps.length + 1)).toFixed(1));
    """
    )
    html, log = browse(acting(path, act), "#x=-20&y=0")
    assert not console(log)
    took = float(re.search(r'data-per-step="([\d.]+)"', html).group(1))
    with capsys.disabled():
        print(f"\nview: a step of a drag is answered in {took:.0f} ms (two models, graphics computed)")
    assert 0 < took < 5000
    assert ">φᵢ = 0°</output>" not in html


@pytest.mark.parametrize(("width", "columns"), [(1280, 2), (390, 1)])
def test_wide_screens_show_models_side_by_side_and_phones_below_each_other(view, browse, width, columns):
    _, path = view
    act = """
    const [a, b] = [0, 1].map(k => document.getElementById("map-" + k).getBoundingClientRect());
    document.documentElement.dataset.columns = b.top < a.bottom ? 2 : 1;
    const all = document.documentElement;
    all.dataset.over = all.scrollWidth - all.clientWidth;
    """
    html, log = browse(acting(path, act), width=width)
    assert not console(log)
    # Headless windows have a least width of their own, still a phone's.
    assert f'data-columns="{columns}"' in html and 'data-over="0"' in html


def test_a_page_of_two_models_with_errors_stays_below_fifteen_megabytes(tmp_path):
    directions = viewer._directions({k: {"": tabulated()} for k in "MH"}, SIDES, [], None, 12e6)
    assert len(directions.theta_deg) >= 40
    each = directions.count * _view_data.GRID.stride * 3 * 4 / 3
    assert 2 * 2 * each + 1e6 < 15e6
    many = {str(k): {"": Turned()} for k in range(2)}
    held = viewer._directions(many, SIDES, [], None, 12e6)
    assert 2 * 2 * held.count * _view_data.GRID.stride * 2 * 4 / 3 < 14e6


def test_codes_keep_values_to_a_thousandth_and_tell_nothing_from_zero():
    values = np.concatenate([np.logspace(-7, 2, 1000), [0.0, -1.0, np.nan]])
    codes, low, step = _view_data.coded(values)
    back = 10.0 ** (low + (codes[:1000].astype(float) - 2) * step)
    np.testing.assert_allclose(back, values[:1000], rtol=2.5e-4)
    assert codes[1000] == codes[1001] == 1
    assert codes[1002] == 0


def test_a_view_holds_the_sides_and_the_size_that_are_asked_for(lobe, tmp_path):
    whole = viewer.write_view({"M": lobe()}, tmp_path / "whole.html")
    part = viewer.write_view({"M": lobe()}, tmp_path / "part.html", sides=[FRONT], largest_mb=0.5)
    assert data_of(whole)["sides"] == [FRONT, BACK]
    assert data_of(part)["sides"] == [FRONT]
    assert list(data_of(part)["models"][0]["bands"]["520 nm"]) == [FRONT]
    assert len(data_of(part)["theta"]) < len(data_of(whole)["theta"])
    library = (importlib.resources.files("specularia.report") / "view_page" / "three.min.js").read_bytes()
    assert part.stat().st_size < 0.5e6 + len(library) + 1e5


def test_the_drawing_library_is_shipped_with_its_licence_and_the_licence_with_each_view(view):
    parts = importlib.resources.files("specularia.report") / "view_page"
    licence = (parts / "three.LICENSE.txt").read_text(encoding="utf-8")
    assert "MIT License" in licence and "three.js authors" in licence
    assert "Permission is hereby granted" in licence
    script = (parts / "three.min.js").read_text(encoding="utf-8")
    assert script.startswith("/*! three.js r") and len(script) > 100_000
    page = view[1].read_text(encoding="utf-8")
    assert licence in page and script in page


def test_the_command_views_files_and_tables_side_by_side(command, browse, tmp_path):
    model = tabulated()
    bsdf.write(model, tmp_path / "pane.nc")
    bsdf.write(klems(), tmp_path / "pane.xml")
    code, out, _ = command(
        "bsdf", "view", tmp_path / "pane.nc", tmp_path / "pane.xml", "-o", tmp_path / "v.html", "--json",
        "--theta", "40",
    )  # fmt: skip
    assert code == 0
    assert out["models"] == ["pane", "pane (2)"] and out["path"] == str((tmp_path / "v.html").resolve())
    html, log = browse(tmp_path / "v.html", "#theta=40&x=-35&y=3")
    assert not console(log)
    matrix = bsdf.read(tmp_path / "pane.xml")
    for k, held in enumerate((model, matrix)):
        value, _ = shown(html, f"value-{k}")
        ux, uy, _ = direction_cosines(value["theta"], value["phi"])
        assert value["value"] == pytest.approx(float(held.evaluate(FRONT, 40.0, 0.0, ux, uy)), rel=3e-4)
    code, _, err = command("bsdf", "view", tmp_path / "pane.nc", "-o", tmp_path / "v.html", "--theta", "0,95")
    assert code == 2 and "theta < 90" in err


def data_of(path: Path) -> dict:
    text = path.read_text(encoding="utf-8")
    return json.loads(re.search(r'<script id="data" type="application/json">(.*?)</script>', text, re.S)[1])


def klems() -> bsdf.XmlModel:
    """A matrix whose numbers grow from patch to patch; both transmission sides."""
    basis = BASES[-1]
    n = len(basis.solid_angle)
    matrix = np.linspace(0.05, 0.3, n * n).reshape(n, n)
    parts = {side: KlemsPart(matrix, basis, basis) for side in (FRONT, BACK)}
    return bsdf.XmlModel(
        parts=parts, band="Visible", structure="Columns", bands=("Visible",), all_bands={"Visible": parts}
    )


@cache
def tabulated() -> bsdf.TabulatedModel:
    """A small model with standard errors: a leaning lobe around the undeflected direction, in tables."""

    def lobe(theta: float, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        r2 = (x + np.sin(np.radians(theta))) ** 2 + y**2
        return np.exp(-r2 / (2 * 0.06**2)) * (1 + 0.3 * np.tanh(y / 0.06)) + 0.02

    angles, half = [0.0, 20.0, 40.0, 60.0], 0.2
    bx, by = cell_centres(48)
    offset = (np.arange(48) + 0.5) * 2 * half / 48 - half
    base = np.array([lobe(t, bx, by) for t in angles], np.float32)
    squares = [np.meshgrid(offset - np.sin(np.radians(t)), offset, indexing="ij") for t in angles]
    patch = np.array([lobe(t, *square) for t, square in zip(angles, squares)], np.float32)
    table = SideTable(
        theta_i_deg=np.array(angles),
        base=base,
        patch=patch,
        half_width=half,
        tau=np.array([0.8, 0.79, 0.75, 0.6]),
        tau_se=np.full(4, 0.01),
        origin="analytic",
        base_se=0.05 * base + np.float32(1e-4),
        patch_se=0.03 * patch,
    )
    return bsdf.TabulatedModel(tables={FRONT: table}, band="520 nm")
