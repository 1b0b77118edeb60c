"""Stages healed_front, healed_back and model_h: the pane as it may have been, before decay."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from specularia.study.stages.blocks import figure, table, text
from specularia.study.stages.models import write_model

if TYPE_CHECKING:
    from specularia.glass.tiling import Tiling
    from specularia.study.engine import Work

__all__ = ["healed", "model_h"]


def healed(work: Work) -> Mapping[str, Any]:
    """Heal one face; its map holds the ensemble."""
    from specularia import surface
    from specularia.report import figures

    face = work.parameters["face"]
    given = surface.read(work.results[f"heights_{face}"] / f"{face}.nc")
    named = work.files("image")
    result = surface.heal(
        given,
        ensemble=work.parameters["ensemble"],
        seed=work.parameters["seed"],
        picture=surface.read_picture(named[0]) if named else None,
    )
    surface.write_healed(result, work.folder / f"{face}.nc")
    synthetic = "synthetic" in given.attributes
    assert result.Sdq_interval is not None
    low, high = result.Sdq_interval
    header = ["pits", "Sdq, decayed", "Sdq, healed", "Sdq, 90 % interval", "without evidence", "members"]
    row = [
        f"{100 * result.pit_coverage:.1f} %",
        result.Sdq_before,
        result.Sdq_after,
        f"{low:.4f} to {high:.4f}",
        f"{100 * result.no_evidence_share:.1f} %",
        len(result.members),
    ]
    columns = [
        "pits_percent",
        "Sdq_decayed",
        "Sdq_healed",
        "Sdq_low_90",
        "Sdq_high_90",
        "without_evidence_percent",
        "members",
    ]
    numbers = [
        100 * result.pit_coverage,
        result.Sdq_before,
        result.Sdq_after,
        low,
        high,
        100 * result.no_evidence_share,
        len(result.members),
    ]
    caption = (
        "Healing: share of pits, rms slope of the face as it is, of the most probable original surface "
        "(which is smoother than the original where little is left) and of the possible originals, and the "
        f"share of the face of which the plateaux say too little. File: {face}.nc."
    )
    picture = figures.healed(given, result, work.folder / "healed.png", synthetic=synthetic)
    drawn = (
        "The face as it is, what is left of its original surface, the most probable original surface "
        "(hatched where too little is known of it) and two of the possible ones, drawn by chance from what "
        "the plateaux say."
    )
    return {
        "synthetic": synthetic,
        "pit_coverage": result.pit_coverage,
        "no_evidence": result.no_evidence_share,
        "Sdq_before": result.Sdq_before,
        "Sdq_after": result.Sdq_after,
        "Sdq_members_90": [low, high],
        "blocks": [
            table(
                work.folder / f"healed_{face}.csv",
                header,
                [row],
                caption,
                numbers=(columns, [numbers]),
                synthetic=synthetic,
            ),
            figure(picture, drawn, synthetic=synthetic),
        ],
    }


def _faces(work: Work) -> dict[str, Path]:
    """Healed maps by face."""
    names = {stage.removeprefix("healed_"): folder for stage, folder in work.results.items()}
    return {face: folder / f"{face}.nc" for face, folder in names.items() if face in ("front", "back")}


def model_h(work: Work) -> Mapping[str, Any]:
    """Trace the glass between typical members of the healed faces, and the interval from all members."""
    from dataclasses import replace

    import numpy as np

    from specularia import analysis, glass, surface
    from specularia.provenance import to_json

    given = work.parameters
    slab = glass.read_slab(work.file("settings"), seed=given["seed"])
    # Members do not repeat at the edges of the map, even where the measured face does.
    tiling: Tiling = "mirror" if given["tiling"] == "periodic" else given["tiling"]
    faces = {}
    for name, file in _faces(work).items():
        base = surface.read(file)
        members = surface.read_members(file)
        faces[name] = [
            replace(base, heights_um=m.astype(float), sigma_um=None, image=None, reliability=None)
            for m in members
        ]
        slab = replace(
            slab,
            sources=(*slab.sources, file),
            synthetic=slab.synthetic or "synthetic" in base.attributes,
        )
    interval = given["interval"]
    pane = analysis.healed_pane(
        slab,
        faces,
        theta_deg=interval["theta_deg"],
        paths=interval["paths"],
        seed=given["seed"],
        wavelength_nm=given["wavelength_nm"],
        tiling=tiling,
    )
    typical = analysis.member_slab(slab, {n: m[pane.typical] for n, m in faces.items()}, tiling)
    model = glass.model(
        typical, paths=given["paths"], seed=given["seed"], wavelength_nm=given["wavelength_nm"]
    )
    # Between one member and the next lies what the room must know of the model's uncertainty.
    spread = pane.tau.std(axis=0, ddof=1) * np.sqrt(1.0 + 1.0 / len(pane.tau))
    ensemble = {"theta_deg": pane.theta_deg, "members": len(pane.tau), "tau_sd": spread}
    model = replace(model, attributes={**model.attributes, "ensemble": to_json(ensemble)})
    said = write_model(work, "H", model, synthetic=slab.synthetic)
    tau, width = pane.interval("tau"), pane.interval("fwhm_deg")
    rows = [
        [
            f"{theta:g}",
            f"{pane.tau[:, k].mean():.4f}",
            f"{tau[k, 0]:.4f} to {tau[k, 1]:.4f}",
            f"{pane.fwhm_deg[:, k].mean():.3g}",
            f"{width[k, 0]:.3g} to {width[k, 1]:.3g}",
        ]
        for k, theta in enumerate(pane.theta_deg)
    ]
    header = ["θᵢ (°)", "τ", "90 % interval", "FWHM of the lobe (°)", "90 % interval"]
    caption = (
        f"The healed pane, traced with each of {len(pane.Sdq)} possible pairs of faces: mean and 90 % "
        "interval of the direct-hemispherical transmission and of the full width at half maximum of the "
        "transmitted lobe along its wide axis. The interval holds what the plateaux leave open and the "
        "chance of tracing; it does not hold the uncertainty of index, absorption and thickness."
    )
    note = (
        "The pane as it may have been: the same glass between healed faces. The model below, which goes into "
        "tables, figures and the room, is that of the possible faces whose rms slope is the median."
    )
    columns = ["theta_i_deg", "tau", "tau_low_90", "tau_high_90", "fwhm_deg", "fwhm_low_90", "fwhm_high_90"]
    numbers = [
        [theta, pane.tau[:, k].mean(), *tau[k], pane.fwhm_deg[:, k].mean(), *width[k]]
        for k, theta in enumerate(pane.theta_deg)
    ]
    interval_table = table(
        work.folder / "healed_pane.csv",
        header,
        rows,
        caption,
        numbers=(columns, numbers),
        synthetic=slab.synthetic,
    )
    blocks = [text(note), interval_table, *said["blocks"]]
    return {
        **said,
        "theta_deg": pane.theta_deg.tolist(),
        "tau_90": tau.tolist(),
        "fwhm_deg_90": width.tolist(),
        "blocks": blocks,
    }
