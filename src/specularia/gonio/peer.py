"""The paper's own route from measured tables to a BSDF file: Radiance's pabopto2bsdf and bsdf2ttree.

pabopto2bsdf fits radial basis functions to each table and finds how to carry one incident direction to the
next (Ward et al. 2014); bsdf2ttree writes that as a tensor tree. Both take much in silence that ruins their
result, so they are given files that are written here from tables that have been read and checked:

* numbers in columns, in degrees, no comment or nan among them, the quantity named, no direction on the
  horizon;
* one hemisphere and one side of incidence at a time, as `-t`, whose sides then carry the names of
  `conventions.SIDES`;
* azimuths counted from up (`upphi` 0): with `-t` any other value but 180 turns or mirrors the sample;
* the light of an isotropic sample from one azimuth, since with two opposite ones bsdf2ttree fails.

What they lose in silence is said: incidence bins that are centred outside the data, and angles whose
transmission in the file is not the measured one. The file gets all transmission sides, the missing one by
reciprocity: without it a renderer sees a black pane from inside.

References
---------- Ward, G., Kurt, M. and Bonneel, N. (2014), Reducing anisotropic BSDF measurement to common
practice, Proceedings of the Eurographics Workshop on Material Appearance Modeling, doi:10.2312/mam.20141292
"""

from __future__ import annotations

import tempfile
import warnings
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from specularia import progress, radiance
from specularia.bsdf import XmlModel, build, read_xml, xml_write
from specularia.bsdf.xml_model import TreePart
from specularia.conventions import SIDES, fold_azimuth
from specularia.errors import CoverageError, SpeculariaWarning
from specularia.files import writable, write_text
from specularia.gonio.integration import Summary
from specularia.gonio.pab import write
from specularia.gonio.table import GRAZING, Table
from specularia.provenance import record

__all__ = ["LostAngle", "Peer", "fit_with_radiance", "lost_angles"]

_OFF = 0.05
"""Relative distance of the file's value from the measured one beyond which the user is told."""

_SAME_ANGLE = 0.02


@dataclass(frozen=True)
class Peer:
    """What Radiance's programs made.

    Attributes
    ----------
    path : the XML file.
    model : as it stands in the file.
    messages : what the programs said, line by line.
    notes : what was done to the tables, and what was found in the result.
    """

    path: Path
    model: XmlModel
    messages: tuple[str, ...]
    notes: tuple[str, ...]


@dataclass(frozen=True)
class LostAngle:
    """A measured angle in an incidence bin whose centre lies outside the data."""

    theta_deg: float
    centre_deg: float


def lost_angles(theta_deg: Sequence[float], *, resolution: int) -> list[LostAngle]:
    """Measured angles that a tree of rank 3 loses: bsdf2ttree asks at the centres of its incidence bins.

    >>> [(a.theta_deg, round(a.centre_deg, 2)) for a in lost_angles([0.0, 60.0, 82.5], resolution=7)]
    [(82.5, 82.84)]
    >>> lost_angles([0.0, 60.0, 82.5], resolution=6)
    []
    """
    bins = 1 << (resolution - 1)
    last = np.sin(np.radians(max(theta_deg)))
    out = []
    for theta in theta_deg:
        centre = (np.floor(np.sin(np.radians(theta)) * bins) + 0.5) / bins
        if centre > last and theta > 0:
            out.append(LostAngle(float(theta), float(np.degrees(np.arcsin(centre)))))
    return out


def fit_with_radiance(
    summaries: Sequence[Summary],
    path: str | Path,
    *,
    resolution: int = 6,
    cull: float | None = None,
    isotropic: bool = True,
) -> Peer:
    """Tables to an XML file by pabopto2bsdf and bsdf2ttree.

    Parameters
    ----------
    summaries : of tables of one sample in one band, which their making has checked.
    path : ends in .xml.
    resolution : g of the tree, 5 to 8.
    cull : percentage of the tree's cells to remove; None leaves it to bsdf2ttree (90).
    isotropic : True turns every table so that its light comes from one azimuth, which gives a tree of rank 3;
        False leaves the azimuths to pabopto2bsdf, which finds the symmetry and may give one of rank 4.

    Raises
    ------
    CoverageError : fewer than two incident directions on a side.
    RadianceError : with what the program said.
    """
    path = writable(path)
    tables = [s.table for s in summaries]
    notes: list[str] = []
    messages: list[str] = []
    with (
        tempfile.TemporaryDirectory() as name,
        progress.task("Radiance: pabopto2bsdf and bsdf2ttree", 2.0) as task,
    ):
        folder, interpolants = Path(name), []
        for side in SIDES:
            chosen = [t for t in tables if t.side == side]
            if not chosen:
                continue
            notes += _check_angles(chosen, side, resolution=resolution, isotropic=isotropic)
            files = []
            for k, table in enumerate(chosen):
                clean, done = clean_table(table, isotropic=isotropic)
                notes += done
                files.append(write(clean, folder / f"{side}_{k}.dat").name)
            interpolants.append(f"{side}.sir")
            found = radiance.run(["pabopto2bsdf", "-t", *files], cwd=folder, said=messages)
            (folder / interpolants[-1]).write_bytes(found)
        task.advance()
        culling = [] if cull is None else ["-t", f"{cull:g}"]
        command = ["bsdf2ttree", "-p0", "-g", str(resolution), *culling, *interpolants]
        (folder / "peer.xml").write_bytes(radiance.run(command, cwd=folder, said=messages))
        task.advance()
        model = _whole(read_xml(folder / "peer.xml"), resolution=resolution, cull=cull)
    notes += _compare(model, summaries)
    _store(model, path, tables, resolution=resolution, cull=cull)
    said = tuple(dict.fromkeys(m.strip() for m in messages))
    for note in (*(f"it says: {m.rstrip('.')}" for m in said), *notes):
        warnings.warn(f"Radiance's route: {note}.", SpeculariaWarning, stacklevel=2)
    return Peer(path=path, model=model, messages=said, notes=tuple(notes))


def clean_table(table: Table, *, isotropic: bool) -> tuple[Table, list[str]]:
    """A table as pabopto2bsdf can take it, and what was done to it.

    Its azimuths are counted from up. Directions on the horizon (theta_s of 90 would be written outside an
    array) are left out, as are values that are not finite.
    """
    known = (table.cos_s > GRAZING) & np.isfinite(table.values)
    left = int(np.sum(~known))
    notes = [f"{table.label}: {left} directions on the horizon are left out"] if left else []
    turn = table.azimuth_deg if isotropic else 0.0
    clean = replace(
        table,
        phi_i_deg=float(fold_azimuth(table.azimuth_deg - turn - 90.0)),
        up_phi_deg=0.0,
        theta_s_deg=table.theta_s_deg[known],
        phi_s_deg=fold_azimuth(table.phi_s_deg[known] - turn),
        values=table.values[known],
        others={},
        band="Visible",
        name=table.name.replace('"', ""),
    )
    return clean, notes


def _check_angles(tables: Sequence[Table], side: str, *, resolution: int, isotropic: bool) -> list[str]:
    """Say what the programs would lose or refuse."""
    spoken = side.replace("_", " ")
    polar = sorted({round(t.polar_deg / _SAME_ANGLE) * _SAME_ANGLE for t in tables})
    directions = {
        (round(t.polar_deg / _SAME_ANGLE), 0 if isotropic else round(t.azimuth_deg, 1)) for t in tables
    }
    if len(directions) < 2:
        raise CoverageError(
            f"{spoken}: Radiance's pabopto2bsdf takes two incident directions or more, these tables hold "
            "one; use specularia's own method."
        )
    notes = []
    azimuths = sorted({round(t.azimuth_deg, 1) % 360.0 for t in tables if t.polar_deg > 0})
    if isotropic and len(azimuths) > 1:
        notes.append(
            f"{spoken}: the tables of {len(azimuths)} azimuths of incidence are turned to one, as an "
            "isotropic sample allows; with opposite azimuths bsdf2ttree fails"
        )
    if isotropic:
        for lost in lost_angles(polar, resolution=resolution):
            notes.append(
                f"{spoken}: at --resolution {resolution} the incidence bin that holds {lost.theta_deg:g} "
                f"degrees is centred at {lost.centre_deg:.2f}, outside the data, and bsdf2ttree leaves it "
                "nearly empty"
            )
    return notes


def _whole(model: XmlModel, *, resolution: int, cull: float | None) -> XmlModel:
    """The model with the transmission side that it lacks, by reciprocity."""
    missing = [s for s in model.sides if s not in model.parts]
    if not missing or model.rank == 4:
        # Trees of rank 4 are read in reverse by the renderer.
        return model
    with progress.task("the other side by reciprocity", len(missing)) as task:
        parts = dict(model.parts)
        origins = {s: "Radiance's pabopto2bsdf and bsdf2ttree" for s in parts}
        for side in missing:
            built = build(model, side, resolution=resolution, cull=cull)
            parts[side] = TreePart(built.tree)
            origins[side] = f"{model.origin(side)}, by specularia"
            task.advance()
    return replace(model, parts=parts, attributes={**model.attributes, **origins})


def _compare(model: XmlModel, summaries: Sequence[Summary]) -> list[str]:
    """Measured angles whose value in the file is far from the measured one."""
    notes = []
    for s in sorted(summaries, key=lambda s: (s.table.side, s.table.polar_deg)):
        if s.table.side not in model.parts or not s.tau > 0:
            continue
        found = float(model.direct_hemispherical(s.table.side, s.table.polar_deg, s.table.azimuth_deg))
        if abs(found / s.tau - 1.0) > _OFF:
            notes.append(
                f"{s.table.label}: {found:.4f} in the file at theta_i = {s.table.polar_deg:g}, "
                f"{s.tau:.4f} measured ({100 * (found / s.tau - 1):+.1f} %)"
            )
    return list(dict.fromkeys(notes))


def _store(
    model: XmlModel, path: Path, tables: Sequence[Table], *, resolution: int, cull: float | None
) -> None:
    """Write the file with its provenance; the numbers of Radiance's sides are kept as they are."""
    attributes = record(
        what=f"{tables[0].name or 'a sample'}, measured, by Radiance's pabopto2bsdf and bsdf2ttree",
        inputs=sorted({t.file for t in tables if t.file}),
        parameters={"method": "radiance", "resolution": resolution, "cull": cull},
        synthetic=any(t.synthetic for t in tables),
    )
    origins = {s: model.attributes.get(s, "Radiance's pabopto2bsdf and bsdf2ttree") for s in model.parts}
    text = xml_write.document(
        model.parts,
        band=tables[0].band,
        attributes={"name": tables[0].name, **attributes} if tables[0].name else attributes,
        origins=origins,
    )
    write_text(path, text)
