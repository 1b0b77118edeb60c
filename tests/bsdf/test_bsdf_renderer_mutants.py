"""A pane without any symmetry, and what the renderer shows when one thing about it is turned round."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from specularia import bsdf
from specularia.bsdf import xml_write
from specularia.bsdf.cells import grid
from specularia.bsdf.check_render import rendered_sun
from specularia.bsdf.xml_model import TreePart

SUNS = ((40.0, 60.0), (50.0, 250.0), (140.0, 25.0), (150.0, 60.0))
OTHER_NORMAL = "-1 1 0  1 1 0  1 -1 0  -1 -1 0"


def _front(ix: Any, iy: Any, ux: Any, uy: Any) -> Any:
    """One lobe, off the undeflected direction by amounts that differ along x and y."""
    r2 = (ux + 0.6 * ix - 0.25) ** 2 + (uy + 0.5 * iy - 0.3 * ix - 0.35) ** 2
    return 0.6 * np.exp(-r2 / (2 * 0.25**2)) / (2 * np.pi * 0.25**2)


def _parts(mirror: int = 1) -> dict[str, TreePart]:
    """Both sides as trees of rank 4 with 16 cells along each edge; the back follows by reciprocity.

    Incident cells are those of (ix, -iy), outgoing ones of (-ux, uy).
    """
    x, y = (v.ravel() for v in grid(16))
    incident, outgoing = (x[:, None], -mirror * y[:, None]), (-x[None, :], mirror * y[None, :])
    values = {
        "transmission_front": _front(*incident, *outgoing),
        "transmission_back": _front(*outgoing, *incident),
    }
    return {
        side: TreePart(
            bsdf.TensorTree(
                rank=4,
                log2=np.array([4], np.int8),
                start=np.zeros(1, np.int64),
                child=np.zeros(0, np.int32),
                values=v.astype(np.float32).ravel(),
            )
        )
        for side, v in values.items()
    }


def _written(folder: Path, parts: dict[str, TreePart]) -> Path:
    path = folder / "pane.xml"
    path.write_text(xml_write.document(parts, band="Visible"))
    return path


def _apart(path: Path, **pane: str) -> list[float]:
    """For each sun the integral of |rendered - true| over that of the truth."""
    out = []
    for k, (theta, phi) in enumerate(SUNS):
        ux, uy, seen = rendered_sun(
            path, theta_deg=theta, phi_deg=phi, size=96, rng=np.random.default_rng(k), **pane
        )
        s = np.sin(np.radians(theta))
        incident = s * np.cos(np.radians(phi)), s * np.sin(np.radians(phi))
        true = _front(*incident, ux, uy) if theta < 90 else _front(ux, uy, *incident)
        out.append(float(np.abs(seen - true).sum() / true.sum()))
    return out


@pytest.fixture(scope="module")
def right(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return _written(tmp_path_factory.mktemp("right"), _parts())


def test_an_asymmetric_pane_is_rendered_as_it_is(right: Path) -> None:
    assert max(_apart(right)) < 0.3


@pytest.mark.parametrize(
    "pane", [{"corners": OTHER_NORMAL}, {"up": "0 -1 0"}], ids=["flipped normal", "flipped up"]
)
def test_a_pane_put_in_the_wrong_way_is_seen(right: Path, pane: dict[str, str]) -> None:
    assert min(_apart(right, **pane)) > 0.5


def test_front_and_back_that_changed_places_are_seen(tmp_path: Path) -> None:
    parts = _parts()
    swapped = dict(zip(parts, reversed(parts.values())))
    assert min(_apart(_written(tmp_path, swapped))) > 0.5


def test_a_mirrored_azimuth_is_seen(tmp_path: Path) -> None:
    assert min(_apart(_written(tmp_path, _parts(mirror=-1)))) > 0.5
