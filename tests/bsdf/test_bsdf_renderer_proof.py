"""tau through the renderer at 2^6 and 2^7, under a dome and a sun, both sides, and the check of it."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from specularia import bsdf
from specularia.bsdf.build_tree import bin_mean_tau
from specularia.bsdf.check import sun_response
from specularia.bsdf.check_render import ANGLES, rendered_dome, rendered_sun

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


@pytest.mark.parametrize("side", SIDES)
def test_a_sun_is_seen_with_tau_on_and_near_the_normal_and_as_predicted_elsewhere(
    written: tuple[Any, Path], side: str
) -> None:
    model, path = written
    read = bsdf.read(path)
    rng = np.random.default_rng(1)
    for theta in ANGLES:
        at = theta if side == SIDES[0] else 180.0 - theta
        seen = np.pi * rendered_sun(path, theta_deg=at, size=256, rng=rng)[2].mean()
        # 30 degrees is the edge between two rings of cells, and rounding decides which one is read.
        either = sun_response(read, side, np.array([theta - 1e-3, theta + 1e-3]).clip(0))  # type: ignore[arg-type]
        assert np.abs(seen / either - 1).min() < 0.01, theta
        tau = float(model.direct_hemispherical(side, theta))
        assert seen == pytest.approx(tau, rel=0.015 if theta < 5.0 or theta == 60.0 else 0.07), theta


def test_the_check_renders_a_sound_file_as_sound(written: tuple[Any, Path]) -> None:
    checks = {c.name: c for c in bsdf.check(bsdf.read(written[1]), render=True)}
    for side in ("front", "back"):
        assert checks[f"rendered dome transmission {side}"].ok
        # At 75 degrees the lobe reaches the horizon, and the tree at 2^6 shows the sun 6 % too strong.
        assert checks[f"rendered sun transmission {side}"].value < 0.08


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
    (finding,) = [c for c in bsdf.check(pane_xml.model) if c.name == "direct sun near the normal"]
    assert not finding.ok and finding.value > 0.1
    assert "1 to 9 degrees" in finding.advice
