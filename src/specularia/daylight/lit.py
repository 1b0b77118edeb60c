"""The lit room: panes as sources, light straight from them by Radiance, the rest by radiosity."""

from __future__ import annotations

import tempfile
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from specularia.bsdf import ScatteringModel
from specularia.daylight.camera import Camera
from specularia.daylight.checks import check_models, check_room
from specularia.daylight.emission import EmissionMap, back_reflectance, emission_map
from specularia.daylight.geometry import Box, Pane
from specularia.daylight.glare import glare_at
from specularia.daylight.grids import grid_sensors, reference_illuminance, split
from specularia.daylight.interreflection import Interreflection, Mesh, mesh, reflectances
from specularia.daylight.job import Quality, RoomJob, View
from specularia.daylight.outdoors import Outdoors, incident_illuminance, outdoors
from specularia.daylight.picture import IndirectField, render, write_hdr
from specularia.daylight.results import DaylightResult, Glare, GridResult, Image, PaneLuminance, Point
from specularia.daylight.scene import Scene
from specularia.errors import FormatError
from specularia.files import atomic, make_folder
from specularia.jobs import load_toml
from specularia.progress import task
from specularia.provenance import record

__all__ = ["file_name", "run"]

Array = NDArray[np.float64]

_CLEAR_GLASS = 0.15
"""Diffuse-diffuse reflectance of a clear pane, n = 1.5, both faces."""

_FINE = 4.0
"""Fineness for sensors (see `Scene.illuminance`), where a steep flank or a narrow peak must be right."""


def run(
    room: str | Path | RoomJob,
    *,
    models: Mapping[str, ScatteringModel | str | Path] | None = None,
    folder: str | Path | None = None,
    seed: int = 0,
    quality: Quality | None = None,
) -> DaylightResult:
    """Light a room through each of the given models.

    Parameters
    ----------
    room : a ROOM.toml (see `specularia.daylight.job`) or its content.
    models : scattering models, or files that hold them, by name; they come after those that the room names
        itself, and one of the same name takes its place.
    folder : where pictures go; no pictures are made if it is None.
    seed : of the places where panes are cut for the standard error. The same seed gives the same answer.
    quality : settings to use instead of the room's own, such as `FULL`.

    Raises
    ------
    FormatError : a room, sensor, view or sun that cannot be.
    CoverageError : a model that lacks the transmission, or the sun's direction.
    """
    file = Path("room") if isinstance(room, RoomJob) else Path(room)
    job = room if isinstance(room, RoomJob) else load_toml(room, RoomJob)
    if quality is not None:
        job = job.model_copy(update={"quality": quality})
    box = Box(job)
    check_room(box, file)
    given: dict[str, ScatteringModel | str | Path] = {m.name: m.file for m in job.model}
    given.update(models or {})
    if not given:
        raise FormatError(
            file=file,
            expected="at least one scattering model for the panes",
            found="none",
            advice="Add [[model]] to the room or give --model NAME=FILE.",
        )
    held = {name: _model(m) for name, m in given.items()}
    check_models(held)
    out = outdoors(job)
    if folder is not None:
        folder = make_folder(folder)
    inputs = [Path(m) for m in given.values() if isinstance(m, (str, Path))]
    provenance = record(
        what=f"daylight in {job.name}",
        inputs=inputs if isinstance(room, RoomJob) else [file, *inputs],
        parameters={
            "room": job,
            "bands": {name: m.band for name, m in held.items()},
            "sun_normal_lx": out.sun_illuminance,
            "sky_zenith_cd_m2": out.zenith,
            "sky_horizontal_lx": out.sky_illuminance,
            "ground_cd_m2": out.ground,
        },
        seed=seed,
        synthetic=any("synthetic" in getattr(m, "attributes", {}) for m in held.values()),
    )
    points: list[Point] = []
    images: list[Image] = []
    panes: list[PaneLuminance] = []
    grids: list[GridResult] = []
    glare: list[Glare] = []
    with task("room", len(held) * (3 + len(job.view))) as progress:
        spacing = 0.35 / np.sqrt(job.quality.sampling)
        meshes = [mesh(box, k * spacing, points=0.09 * k / job.quality.sampling) for k in (1.0, 1.5)]
        for name, model in held.items():
            maps = _maps(model, box, out)
            progress.advance()
            with tempfile.TemporaryDirectory(prefix="specularia-room-") as scratch:
                scene = Scene.make(Path(scratch), box, maps, sampling=job.quality.sampling)
                rho = [_reflectance(p, model) for p in box.panes]
                light = [_interreflection(scene, m, rho) for m in meshes]
                progress.advance()
                control = Scene.make(
                    make_folder(Path(scratch) / "control"),
                    box,
                    [m.coarsened() for m in maps],
                    sampling=job.quality.sampling,
                )
                named, surveyed = split(
                    _points(name, scene, control, light, seed), model=name, box=box, out=out
                )
                points += named
                grids += surveyed
                progress.advance()
                if folder is not None:
                    field = IndirectField(box, light[0], 0.3 / np.sqrt(job.quality.sampling))
                    for view in job.view:
                        images.append(_image(name, view, scene, field, rho, folder, provenance))
                        if view.wants_glare:
                            glare.append(glare_at(images[-1], scene, light[0], fineness=_FINE))
                        progress.advance()
            panes += _panes(name, box, maps, out)
    return DaylightResult(
        points=points,
        images=images,
        panes=panes,
        grids=grids,
        glare=glare,
        no_daylight_factor=reference_illuminance(out)[1],
        provenance=provenance,
    )


def _model(given: ScatteringModel | str | Path) -> ScatteringModel:
    if isinstance(given, (str, Path)):
        from specularia import bsdf

        return bsdf.read(given)
    return given


def _maps(model: ScatteringModel, box: Box, out: Outdoors) -> list[EmissionMap]:
    """The emission map of each pane; panes in one wall share theirs."""
    by_wall: dict[str, EmissionMap] = {}
    for pane in box.panes:
        if pane.window.wall not in by_wall:
            by_wall[pane.window.wall] = emission_map(
                model, axes=pane.axes, outdoors=out, sampling=box.job.quality.sampling
            )
    return [by_wall[pane.window.wall] for pane in box.panes]


def _reflectance(pane: Pane, model: ScatteringModel) -> float:
    if pane.window.pane_reflectance is not None:
        return pane.window.pane_reflectance
    measured = back_reflectance(model)
    return _CLEAR_GLASS if measured is None else measured


def _interreflection(scene: Scene, m: Mesh, panes: Sequence[float]) -> Interreflection:
    octree = scene.octree("coarse", cell=0.28 / scene.sampling)
    points, normals = m.points.reshape(-1, 3), m.normals.reshape(-1, 3)
    direct = scene.illuminance(octree, scene.box.lifted(points), normals, fineness=0.5)
    flux = sum(e.exitance() * p.glass.area for e, p in zip(scene.maps, scene.box.panes))
    return Interreflection(m, direct.reshape(m.points.shape[:2]), reflectances(scene.box, m, panes), flux)


def _points(
    name: str, scene: Scene, control: Scene, light: Sequence[Interreflection], seed: int
) -> list[Point]:
    """Illuminance at the sensors, then at the points of grids.

    The standard error joins three parts: the spread over differently cut panes; a third of the change when
    emission map and points on the panes are half as dense (both errors fall with the square of the density);
    and the change of the reflected light when the mesh of the walls is coarser by half.
    """
    sensors = [*scene.box.job.sensor, *grid_sensors(scene.box)]
    if not sensors:
        return []
    at = scene.box.lifted(np.array([s.position_m for s in sensors]))
    normals = np.array([s.normal for s in sensors])
    repeats = scene.box.job.quality.repeats
    shifts = np.random.default_rng(seed).random((repeats, 2))

    def direct(which: Scene, shift: Array, fineness: float) -> Array:
        octree = which.octree("sensors", cell=0.11 / scene.sampling, shift=(float(shift[0]), float(shift[1])))
        return which.illuminance(octree, at, normals, fineness=fineness)

    runs = np.stack([direct(scene, shift, _FINE) for shift in shifts])
    spread = runs.std(axis=0, ddof=1) / np.sqrt(repeats)
    resolution = (runs[0] - direct(control, shifts[0], _FINE / 2)) / 3
    first = runs.mean(axis=0)
    fine, coarse = (part.illuminance(at, normals) for part in light)
    se = np.sqrt(spread**2 + resolution**2 + (fine - coarse) ** 2)
    return [
        Point(s.name, name, float(d + i), float(e), float(d), float(i))
        for s, d, i, e in zip(sensors, first, fine, se)
    ]


def file_name(text: str) -> str:
    """A name that any file system takes: letters, digits, dots and dashes stay, all else becomes _."""
    return "".join(c if c.isalnum() or c in "-." else "_" for c in text)


def _image(
    name: str,
    view: View,
    scene: Scene,
    field: IndirectField,
    panes: Sequence[float],
    folder: Path,
    provenance: Mapping[str, str],
) -> Image:
    # Radiance divides a source into 64 parts at most: larger pieces would show the needle of light that
    # smooth patches of the glass let through as a row of separate images.
    octree = scene.octree("picture", cell=0.1)
    camera = Camera.of(view, scene.box.size)
    luminance = render(
        camera, scene=scene, octree=octree, field=field, panes=panes, fineness=1.0 / scene.sampling
    )
    stem = file_name(f"{name}_{view.name}")
    hdr = write_hdr(folder / f"{stem}.hdr", luminance, camera, what=f"specularia daylight, model {name}")
    with atomic(folder / f"{stem}.npz") as temporary:
        arrays: dict[str, Any] = {"luminance": luminance.astype(np.float32), "units": "cd/m2", **provenance}
        np.savez_compressed(temporary, **arrays)
    return Image(name, view.name, hdr, folder / f"{stem}.npz", luminance, view, _pixels(scene.box, camera))


def _pixels(box: Box, camera: Camera) -> dict[str, tuple[float, float]]:
    """Picture positions of sensors whose lit side faces the eye."""
    sensors = box.job.sensor
    if not sensors:
        return {}
    at = np.array([s.position_m for s in sensors])
    facing = np.sum(camera.towards_eye(at) * np.array([s.normal for s in sensors]), axis=1) > 0
    found = camera.project(at)
    return {
        s.name: (float(c), float(r)) for s, (c, r), f in zip(sensors, found, facing) if f and np.isfinite(c)
    }


def _panes(name: str, box: Box, maps: Sequence[EmissionMap], out: Outdoors) -> list[PaneLuminance]:
    found = []
    for pane, emission in zip(box.panes, maps):
        sun, sky = incident_illuminance(out, pane.axes[2])
        eyes = [("normal", -pane.axes[2])]
        placed = [v for v in box.job.view if v.position_m is not None]
        eyes += [(v.name, np.array(v.position_m) - pane.centre) for v in placed]
        for eye, direction in eyes:
            local = pane.axes @ (direction / np.linalg.norm(direction))
            luminance = float(emission.towards(local[0], local[1])) if local[2] < 0 else 0.0
            found.append(PaneLuminance(pane.window.name, name, eye, luminance, emission.exitance(), sun, sky))
    return found
