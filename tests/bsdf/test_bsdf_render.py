"""Written files in a pane, through the renderer."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from specularia import bsdf
from specularia.bsdf.check import sun_response
from specularia.bsdf.check_render import rendered_sun_tau
from specularia.conventions import direction_cosines, square_to_disk, to_radiance
from specularia.radiance import run

PANE = """void BSDF pane
6 0 {xml} 0 1 0 .
0
0
pane polygon window
0
0
12 -1 -1 0  1 -1 0  1 1 0  -1 1 0
{light}"""


def _octree(folder: Path, xml: Path, light: str) -> None:
    """A pane in the plane z = 0 whose normal, +z, points into the room; y is up. Our front looks to -z."""
    (folder / "scene.rad").write_text(PANE.format(xml=xml, light=light))
    (folder / "scene.oct").write_bytes(run(["oconv", "scene.rad"], cwd=folder))


def _trace(folder: Path, towards: Any, *options: str) -> Any:
    """Radiance that leaves the middle of the pane in the directions `towards` [N, 3]."""
    rays = np.concatenate([0.5 * towards, -towards], axis=1).astype("<f4")
    out = run(
        ["rtrace", "-h", "-ffd", "-ab", "1", "-aa", "0", "-lw", "1e-4", *options, "scene.oct"],
        data=rays.tobytes(),
        cwd=folder,
    )
    return np.frombuffer(out, "<f8").reshape(-1, 3)[:, 1]


def _to_world(theta_deg: float, phi_deg: float) -> Any:
    return np.array([float(c) for c in to_radiance(*direction_cosines(theta_deg, phi_deg))])


def _dome_seen(folder: Path, xml: Path, side: str, theta: float, phi: float = 30.0) -> float:
    """Radiance of the pane before a dome of radiance 1, seen from where light of `side` would arrive.

    By reciprocity it is the direct-hemispherical transmission of that side.
    """
    front = side == "transmission_front"
    _octree(
        folder,
        xml,
        "void glow sky\n0\n0\n4 1 1 1 0\nsky source dome\n0\n0\n" + f"4 0 0 {1 if front else -1} 180\n",
    )
    eye = _to_world(theta if front else 180.0 - theta, phi)
    return float(_trace(folder, np.tile(eye, (300, 1)), "-ad", "256").mean())


def _sun_seen(folder: Path, xml: Path, theta: float, phi: float, n: int = 128, seed: int = 0) -> Any:
    """BSDF seen from all over the other side, for a small sun at (theta, phi): (ux, uy, value)."""
    sun = _to_world(theta, phi)
    _octree(
        folder,
        xml,
        "void light l\n0\n0\n3 1e6 1e6 1e6\nl source sun\n0\n0\n" + f"4 {sun[0]} {sun[1]} {sun[2]} 0.5\n",
    )
    rng = np.random.default_rng(seed)
    k = np.arange(n)
    a, b = (v + rng.random((n, n)) for v in np.meshgrid(k, k, indexing="ij"))
    x, y = (v.ravel() for v in square_to_disk(a / n, b / n))
    z = np.sqrt(np.maximum(1.0 - x * x - y * y, 0.0)) * -np.sign(sun[2])
    seen = _trace(folder, np.stack([x, y, z], axis=1), "-dj", "0", "-dc", "1", "-dt", "0", "-ad", "1")
    irradiance = 1e6 * 2 * np.pi * (1 - np.cos(np.radians(0.25))) * abs(sun[2])
    return -x, y, seen / irradiance


@pytest.mark.parametrize("side", ["transmission_front", "transmission_back"])
def test_a_uniform_dome_is_seen_through_the_pane_with_tau_of_the_side(pane, pane_xml, side, tmp_path) -> None:  # type: ignore[no-untyped-def]
    for theta in (0.0, 30.0, 60.0):
        seen = _dome_seen(tmp_path, pane_xml.path, side, theta)
        assert seen == pytest.approx(float(pane.direct_hemispherical(side, theta)), rel=0.02), theta


def test_a_tree_with_one_side_only_is_black_in_reverse_and_the_check_says_so(pane_xml, tmp_path) -> None:  # type: ignore[no-untyped-def]
    text = pane_xml.path.read_text()
    cut = text.index("<WavelengthData>", text.index("Transmission Front"))
    path = tmp_path / "front_only.xml"
    path.write_text(text[:cut] + text[text.index("</Layer>") :])
    assert _dome_seen(tmp_path, path, "transmission_back", 30.0) < 0.05
    (finding,) = [c for c in bsdf.check(bsdf.read(path)) if c.name == "transmission sides"]
    assert not finding.ok and "black" in finding.advice
    assert all(c.ok for c in bsdf.check(bsdf.read(pane_xml.path)) if c.name == "transmission sides")


@pytest.mark.parametrize(("theta", "phi"), [(40.0, 60.0), (40.0, 230.0), (140.0, 25.0), (130.0, 300.0)])
def test_sunlight_leaves_at_the_azimuth_of_the_conventions(chiral, chiral_xml, theta, phi, tmp_path) -> None:  # type: ignore[no-untyped-def]
    ux, uy, seen = _sun_seen(tmp_path, chiral_xml, theta, phi)
    side, theta_i = ("transmission_front", theta) if theta < 90 else ("transmission_back", 180.0 - theta)
    true = chiral.evaluate(side, theta_i, phi, ux, uy)
    for u in (ux, uy):
        assert np.sum(seen * u) / seen.sum() == pytest.approx(np.sum(true * u) / true.sum(), abs=0.02)
    assert np.corrcoef(seen, true)[0, 1] > 0.96
    # The lobe is far from where a flipped file would put it.
    for flipped in ((-ux, uy), (ux, -uy), (-ux, -uy)):
        assert np.corrcoef(seen, chiral.evaluate(side, theta_i, phi, *flipped))[0, 1] < 0.9


def test_sun_on_the_normal_creates_no_light(pane, pane_xml) -> None:  # type: ignore[no-untyped-def]
    seen, _ = rendered_sun_tau(pane_xml.path, theta_deg=0.0, phi_deg=0.0, rng=np.random.default_rng(0))
    tau = float(pane.direct_hemispherical("transmission_front", 0.0))
    expected = float(sun_response(bsdf.read(pane_xml.path), "transmission_front", np.zeros(1))[0])
    assert seen == pytest.approx(expected, rel=0.01)
    assert seen == pytest.approx(tau, rel=0.02)


def test_what_the_renderer_makes_of_direct_sun_is_predicted(pane_xml) -> None:  # type: ignore[no-untyped-def]
    model = bsdf.read(pane_xml.path)
    assert isinstance(model, bsdf.XmlModel)
    for theta in (2.0, 10.6):
        seen, _ = rendered_sun_tau(pane_xml.path, theta_deg=theta, rng=np.random.default_rng(0))
        expected = float(sun_response(model, "transmission_front", np.array([theta]))[0])
        assert seen == pytest.approx(expected, rel=0.01), theta
