"""The lit room: panes as sources, light straight from them by Radiance, the rest by radiosity."""

from __future__ import annotations

import tempfile
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from numpy.typing import NDArray

from specularia.bsdf import ScatteringModel
from specularia.daylight.checks import check_models, check_room
from specularia.daylight.geometry import Box
from specularia.daylight.interreflection import Interreflection, Mesh, mesh, reflectances
from specularia.daylight.job import Quality, RoomJob, View
from specularia.daylight.outdoors import Outdoors, incident_illuminance, outdoors
from specularia.daylight.panes import Glazing, Lights, lights
from specularia.daylight.picture import IndirectField, project, render, write_hdr
from specularia.daylight.results import DaylightResult, Image, PaneLuminance, Point
from specularia.daylight.scene import Scene
from specularia.errors import FormatError
from specularia.files import atomic, make_folder
from specularia.jobs import load_toml
from specularia.progress import task
from specularia.provenance import record

if TYPE_CHECKING:
    from specularia.daylight.plain import Plain

__all__ = ["file_name", "run"]

Array = NDArray[np.float64]

_FINE = 4.0
"""Fineness for sensors (see `Scene.illuminance`), where a steep flank or a narrow peak must be right."""


def run(
    room: str | Path | RoomJob,
    *,
    models: Mapping[str, ScatteringModel | Glazing | str | Path] | None = None,
    folder: str | Path | None = None,
    seed: int = 0,
    quality: Quality | None = None,
    method: Literal["sources", "plain"] = "sources",
    plain: Plain | None = None,
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
    method : "sources", panes as tabulated light sources; or "plain", the published route for comparison, see
        `specularia.daylight.plain`, which takes no heed of `seed` and `quality`.
    plain : settings of that route.

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
    given: dict[str, ScatteringModel | Glazing | str | Path] = {m.name: m.file for m in job.model}
    given.update(models or {})
    if not given:
        raise FormatError(
            file=file,
            expected="at least one scattering model for the panes",
            found="none",
            advice="Add [[model]] to the room or give --model NAME=FILE.",
        )
    held = {name: _glazing(m) for name, m in given.items()}
    own = {g.name: _glazing(g.file) for g in job.glass}
    check_models({name: g.model for name, g in {**own, **held}.items()})
    out = outdoors(job)
    if folder is not None:
        folder = make_folder(folder)
    inputs = [Path(m) for m in given.values() if isinstance(m, (str, Path))] + [g.file for g in job.glass]
    provenance = record(
        what=f"daylight in {job.name}",
        inputs=inputs if isinstance(room, RoomJob) else [file, *inputs],
        parameters={
            "room": job,
            "bands": {name: g.model.band for name, g in {**own, **held}.items()},
            "sun_normal_lx": out.sun_illuminance,
            "sky_zenith_cd_m2": out.zenith,
            "sky_horizontal_lx": out.sky_illuminance,
            "ground_cd_m2": out.ground,
        },
        seed=seed,
        synthetic=any(
            "synthetic" in getattr(g.model, "attributes", {}) for g in [*own.values(), *held.values()]
        ),
    )
    if method == "plain":
        from specularia.daylight.plain import light as light_plainly

        return light_plainly(box, held, own, out, folder=folder, provenance=provenance, settings=plain)
    points: list[Point] = []
    images: list[Image] = []
    panes: list[PaneLuminance] = []
    with task("room", len(held) * (3 + len(job.view))) as progress:
        sampling = job.quality.sampling
        spacing = 0.35 / np.sqrt(sampling)
        meshes = [mesh(box, k * spacing, points=0.09 * k / sampling) for k in (1.0, 1.5)]
        for name, glazing in held.items():
            emitted = lights(
                box, [own.get(p.model or "", glazing) for p in box.panes], out, sampling=sampling
            )
            progress.advance()
            with tempfile.TemporaryDirectory(prefix="specularia-room-") as scratch:
                scene = Scene.make(Path(scratch), box, emitted, sampling=sampling)
                light = [_interreflection(scene, m) for m in meshes]
                progress.advance()
                control = Scene.make(
                    make_folder(Path(scratch) / "control"), box, emitted.coarsened(), sampling=sampling
                )
                points += _points(name, scene, control, light, seed)
                progress.advance()
                if folder is not None:
                    field = IndirectField(box, light[0], 0.3 / np.sqrt(sampling))
                    for view in job.view:
                        images.append(_image(name, view, scene, field, folder, provenance))
                        progress.advance()
            panes += _panes(name, box, emitted, out)
    return DaylightResult(points=points, images=images, panes=panes, provenance=provenance)


def _glazing(given: ScatteringModel | Glazing | str | Path) -> Glazing:
    if isinstance(given, Glazing):
        return given
    if isinstance(given, (str, Path)):
        from specularia import bsdf

        return Glazing(bsdf.read(given))
    return Glazing(given)


def _interreflection(scene: Scene, m: Mesh) -> Interreflection:
    octree = scene.octree("coarse", cell=0.28 / scene.sampling)
    points, normals = m.points.reshape(-1, 3), m.normals.reshape(-1, 3)
    direct = scene.illuminance(octree, scene.box.lifted(points), normals, fineness=0.5)
    rho = reflectances(m, scene.lights.reflectance)
    return Interreflection(m, direct.reshape(m.points.shape[:2]), rho, scene.lights.flux)


def _points(
    name: str, scene: Scene, control: Scene, light: Sequence[Interreflection], seed: int
) -> list[Point]:
    """Illuminance at the sensors.

    The standard error joins three parts: the spread over differently cut panes; a third of the change when
    emission map and points on the panes are half as dense (both errors fall with the square of the density);
    and the change of the reflected light when the mesh of the walls is coarser by half.
    """
    sensors = scene.box.job.sensor
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
    folder: Path,
    provenance: Mapping[str, str],
) -> Image:
    # Radiance divides a source into 64 parts at most: larger pieces would show the needle of light that
    # smooth patches of the glass let through as a row of separate images.
    octree = scene.octree("picture", cell=0.1)
    luminance = render(view, scene=scene, octree=octree, field=field, fineness=1.0 / scene.sampling)
    stem = file_name(f"{name}_{view.name}")
    hdr = write_hdr(folder / f"{stem}.hdr", luminance, view, what=f"specularia daylight, model {name}")
    with atomic(folder / f"{stem}.npz") as temporary:
        arrays: dict[str, Any] = {"luminance": luminance.astype(np.float32), "units": "cd/m2", **provenance}
        np.savez_compressed(temporary, **arrays)
    return Image(name, view.name, hdr, folder / f"{stem}.npz", luminance, view, _pixels(scene.box, view))


def _pixels(box: Box, view: View) -> dict[str, tuple[float, float]]:
    """Picture positions of sensors whose lit side faces the eye."""
    sensors = box.job.sensor
    if not sensors:
        return {}
    at = np.array([s.position_m for s in sensors])
    facing = np.sum((np.array(view.position_m) - at) * np.array([s.normal for s in sensors]), axis=1) > 0
    found = project(view, at)
    return {
        s.name: (float(c), float(r)) for s, (c, r), f in zip(sensors, found, facing) if f and np.isfinite(c)
    }


def _panes(name: str, box: Box, emitted: Lights, out: Outdoors) -> list[PaneLuminance]:
    found = []
    for index, pane in enumerate(box.panes):
        sun, sky = incident_illuminance(out, pane.axes[2])
        parts = emitted.of(index)
        area = np.array([light.rectangle.area for light in parts])
        exitance = float(emitted.sunlit[index] + emitted.skylit[index]) / pane.glass.area
        eyes = [("normal", -pane.axes[2])]
        eyes += [(v.name, np.array(v.position_m) - pane.centre) for v in box.job.view]
        for eye, direction in eyes:
            local = pane.axes @ (direction / np.linalg.norm(direction))
            seen = [float(emitted.maps[p.map].towards(local[0], local[1])) for p in parts]
            luminance = float(area @ seen / area.sum()) if local[2] < 0 else 0.0
            found.append(
                PaneLuminance(
                    window=pane.name,
                    model=name,
                    view=eye,
                    luminance_cd_m2=luminance,
                    exitance_lm_m2=exitance,
                    sun_lx=sun,
                    sky_lx=sky,
                    sun_share=float(emitted.sun[index]),
                )
            )
    return found
