"""tau through the renderer at 2^6 and 2^7, under a dome and a sun, both sides, and the check of it."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from specularia import bsdf
from specularia.bsdf.build_tree import _assemble, bin_mean_tau
from specularia.bsdf.check import sun_response
from specularia.bsdf.check_render import ANGLES, rendered_dome, rendered_sun_tau

SIDES = ("transmission_front", "transmission_back")


@pytest.fixture(scope="module", params=[6, 7], ids=["2^6", "2^7"])
def written(request: Any, chiral: Any, tmp_path_factory: pytest.TempPathFactory) -> tuple[Any, Path]:
    """A lobe of 0.1 in direction cosines (13 degrees across) about the undeflected direction, as a file."""

    class Straight(type(chiral)):  # type: ignore[misc]
        def _front(self, ix: Any, iy: Any, ux: Any, uy: Any) -> Any:
            r2 = (ux + ix) ** 2 + (uy + iy) ** 2
            return self.tau * np.exp(-r2 / (2 * self.width**2)) / (2 * np.pi * self.width**2)

    folder = tmp_path_factory.mktemp("straight")
    model = Straight(width=0.1)
    return model, bsdf.write(model, folder / "pane.xml", resolution=request.param).path


def _bin(model: Any, side: str, theta: float, resolution: int) -> float:
    """tau averaged over the incidence bin that holds theta; the one below where theta is an edge."""
    bins = 1 << (resolution - 1)
    k = int(np.clip(np.ceil(np.sin(np.radians(theta)) * bins - 1e-9) - 1, 0, bins - 1))
    return bin_mean_tau(model, side, low=k / bins, high=(k + 1) / bins, count=24)


@pytest.mark.parametrize("side", SIDES)
def test_a_dome_is_seen_with_tau_within_one_percent_at_all_angles(
    written: tuple[Any, Path], side: str
) -> None:
    model, path = written
    resolution = bsdf.read(path).resolution  # type: ignore[union-attr]
    for theta in ANGLES:
        seen = rendered_dome(path, theta_deg=theta if side == SIDES[0] else 180.0 - theta)
        assert seen == pytest.approx(_bin(model, side, theta, resolution), rel=0.01), theta


def test_a_pane_that_passes_little_is_seen_before_a_dome_with_all_its_light(
    chiral: Any, tmp_path: Path
) -> None:
    """rtrace's threshold for specular light, 0.15, would take a tenth of it away at 75 degrees."""
    dim = replace(chiral, tau=0.16)
    path = bsdf.write(dim, tmp_path / "dim.xml", resolution=5).path
    for theta in (5.0, 40.0):
        seen = rendered_dome(path, theta_deg=theta)
        assert seen == pytest.approx(_bin(dim, SIDES[0], theta, 5), rel=0.005), theta


@pytest.mark.parametrize("side", SIDES)
def test_a_sun_is_seen_within_one_percent_of_what_theory_predicts(
    written: tuple[Any, Path], side: str
) -> None:
    _, path = written
    read: Any = bsdf.read(path)
    rng = np.random.default_rng(1)
    for theta in ANGLES:
        at = theta if side == SIDES[0] else 180.0 - theta
        seen, _ = rendered_sun_tau(path, theta_deg=at, rng=rng, model=read)
        # 30 degrees is the edge between two rings of cells, and either may be read.
        either = sun_response(read, side, np.array([theta - 1e-3, theta + 1e-3]).clip(0))
        assert 0.99 * either.min() <= seen <= 1.01 * either.max(), theta


def test_the_check_renders_a_sound_file_as_sound(written: tuple[Any, Path]) -> None:
    checks = {c.name: c for c in bsdf.check(bsdf.read(written[1]), render=True)}
    for side in ("front", "back"):
        for light in ("dome", "sun"):
            finding = checks[f"rendered {light} transmission {side}"]
            assert finding.ok, finding


def test_nothing_is_rendered_unless_asked_for(chiral_xml: Path) -> None:
    assert not any(c.name.startswith("rendered") for c in bsdf.check(bsdf.read(chiral_xml)))


def test_the_check_renders_a_file_with_one_side_as_black(chiral_xml: Path, tmp_path: Path) -> None:
    text = chiral_xml.read_text()
    cut = text.index("<WavelengthData>", text.index("Transmission Front"))
    path = tmp_path / "front.xml"
    path.write_text(text[:cut] + text[text.index("</Layer>") :])
    checks = {c.name: c for c in bsdf.check(bsdf.read(path), render=True)}
    assert not checks["rendered dome transmission back"].ok
    assert "wrong" in checks["rendered dome transmission back"].advice


def test_a_lobe_too_narrow_for_the_rings_is_named_with_its_error(pane_xml: bsdf.Written) -> None:
    found = {c.name: c for c in bsdf.check(pane_xml.model)}
    near = found["direct sun near the normal"]
    assert not near.ok and near.value > 0.1 and near.limit == 0.01
    assert "1 to 9 degrees" in near.advice and "tensor4" in near.advice


def test_the_advice_for_a_sun_on_the_normal_fits_the_cause(written: tuple[Any, Path]) -> None:
    """Four cells that differ are made alike by writing; sides that contradict each other are not."""
    model: Any = bsdf.read(written[1])

    def advice(changed: Any) -> str:
        (finding,) = [c for c in bsdf.check(changed) if c.name == "theta 0 sun"]
        assert not finding.ok
        return finding.advice

    back = model.parts["transmission_back"]
    louder = replace(back, tree=replace(back.tree, values=back.tree.values * np.float32(1.05)))
    said = advice(replace(model, parts={**model.parts, "transmission_back": louder}))
    assert "differ near the normal" in said and "bsdf.write" not in said
    n = 1 << back.tree.resolution
    t, a = (np.arange(n // 2) + 0.5) / n, (np.arange(n) + 0.5) / n
    at = np.stack([v.ravel() for v in np.meshgrid(t, a, a, indexing="ij")], axis=-1)
    cells = back.tree.lookup(at).reshape(n // 2, n, n).copy()
    cells[:, n // 2, n // 2] *= 2.0
    sizes = [n // 2 >> k for k in range(back.tree.resolution)]
    merged = [np.full((s, 2 * s, 2 * s), s == n // 2) for s in sizes]
    uneven = replace(back, tree=_assemble(cells, merged))
    assert "bsdf.write" in advice(replace(model, parts={**model.parts, "transmission_back": uneven}))
