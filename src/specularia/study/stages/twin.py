"""Stage twin: the synthetic specimen."""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from specularia.study.stages.blocks import table

if TYPE_CHECKING:
    from specularia.study.engine import Work

__all__ = ["twin"]


def twin(work: Work) -> Mapping[str, Any]:
    """Make the specimen that the settings describe, with its measurements and its truth."""
    from specularia.twin import make

    files = make(work.file("settings"), work.folder, seed=work.parameters["seed"])
    truth = json.loads(files.truth.read_text(encoding="utf-8"))
    shown = [
        (band, words, found[key], found[f"{key}_se"])
        for band, found in truth["tau"].items()
        for key, words in (("phi_0", "φᵢ = 0"), ("azimuth_mean", "mean over φᵢ"))
    ]
    rows = [[f"{band}, {words}", *(f"{value:.4f}" for value in tau)] for band, words, tau, _ in shown]
    error = max(max(v) for found in truth["tau"].values() for k, v in found.items() if k.endswith("_se"))
    faces = "; ".join(
        f"{name}: {100 * face['pitted_share']:.1f} % of the area pitted, relief {face['relief_um']:.1f} µm"
        for name, face in truth["faces"].items()
    )
    caption = (
        "The truth about the synthetic specimen: direct-hemispherical transmission, traced through its true "
        f"faces, absorbing glass and {truth['bubbles']:,} bubbles; standard errors are {error:.1g} at most. "
        f"{faces[0].upper()}{faces[1:]}."
    )
    theta = [f"{angle:g}" for angle in truth["theta_deg"]]
    header = ["τ", *(f"{angle}°" for angle in theta)]
    columns = ["band", "azimuth", *(f"tau_{t}_deg" for t in theta), *(f"se_{t}_deg" for t in theta)]
    block = table(
        work.folder / "truth_tau.csv",
        header,
        rows,
        caption,
        numbers=(columns, [[band, words, *tau, *se] for band, words, tau, se in shown]),
        synthetic=True,
    )
    return {
        "synthetic": True,
        "theta_deg": truth["theta_deg"],
        "tau": truth["tau"],
        "blocks": [block],
    }
