"""Reflection of a flat slab in the place of one that was not measured."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from specularia import bsdf, gonio
from specularia.errors import PhysicsError, SpeculariaWarning
from specularia.glass.closed_form import flat_slab
from specularia.gonio.slab_reflection import with_slab_reflection

pytestmark = pytest.mark.filterwarnings("ignore::specularia.errors.SpeculariaWarning")


@pytest.fixture(scope="module")
def model(measure: Any) -> bsdf.TabulatedModel:
    return gonio.fit([measure(t, scale=0.03, shadow=False) for t in (0.0, 40.0)])


def test_it_is_the_closed_form_and_leaves_as_from_a_mirror(model: bsdf.TabulatedModel) -> None:
    whole = with_slab_reflection(model, index=1.6)
    theta = np.array([0.0, 33.0, 60.0, 80.0])
    exact = flat_slab(theta, index=1.6).reflected
    for side in ("reflection_front", "reflection_back"):
        rho = whole.direct_hemispherical(side, theta)
        assert rho == pytest.approx(exact, rel=5e-3)
        q = whole.quadrature(side, 33.0)
        light = q.weight * whole.evaluate(side, 33.0, 0.0, q.ux, q.uy)
        assert light.sum() == pytest.approx(rho[1], rel=1e-3)
        assert light @ q.ux / light.sum() == pytest.approx(-np.sin(np.radians(33.0)), abs=1e-3)
        assert "computed, not measured" in whole.origin(side)


def test_measured_reflection_is_kept(model: bsdf.TabulatedModel) -> None:
    own = replace(model.tables["transmission_front"], origin="measured")
    given = replace(model, tables={**model.tables, "reflection_front": own})
    whole = with_slab_reflection(given)
    assert whole.tables["reflection_front"] is own
    assert "computed" in whole.origin("reflection_back")


def test_what_is_not_there_cannot_be_reflected(model: bsdf.TabulatedModel) -> None:
    side = model.tables["transmission_front"]
    bright = replace(model, tables={"transmission_front": replace(side, tau=0.97 * np.ones(2))})
    with pytest.warns(SpeculariaWarning, match="add up to more than 1"):
        whole = with_slab_reflection(bright)
    assert whole.direct_hemispherical("reflection_front", 0.0) == pytest.approx(0.03, abs=1e-6)
    with pytest.raises(PhysicsError, match="between 1 and 3"):
        with_slab_reflection(model, index=0.9)


def test_radiance_reads_the_reflection_of_the_bins(
    model: bsdf.TabulatedModel, tmp_path: Path, referee: Any
) -> None:
    from specularia.bsdf.build_tree import bin_edges, bin_mean_tau

    whole = with_slab_reflection(model)
    path = tmp_path / "m.xml"
    bsdf.write(whole, path, resolution=5)
    assert "computed, not measured" in path.read_text()[:3000]
    edges = bin_edges(5)
    for high, low in list(pairwise(edges))[::4]:
        centre = float(np.degrees(np.arcsin((low + high) / 2)))
        found = referee.direct_hemispherical(path, "reflection_front", centre)
        mean = bin_mean_tau(whole, "reflection_front", low=float(low), high=float(high))
        assert found == pytest.approx(mean, rel=5e-3), centre
