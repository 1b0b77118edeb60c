"""The lit room: panes as sources, light straight from them by Radiance, the rest by radiosity."""

from __future__ import annotations

import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtri

from specularia.bsdf import ScatteringModel
from specularia.daylight.ambient import Ambient
from specularia.daylight.beam import beam_illuminance
from specularia.daylight.camera import Camera
from specularia.daylight.checks import check_models, room_of
from specularia.daylight.colour import Coloured, chromaticity, colour_temperature, luminous, to_xyz
from specularia.daylight.geometry import Box
from specularia.daylight.glare import glare_at
from specularia.daylight.grids import grid_sensors, reference_illuminance, split
from specularia.daylight.interreflection import Interreflection, Mesh, mesh, reflectances
from specularia.daylight.job import Quality, RoomJob, Sensor, View
from specularia.daylight.moment import at
from specularia.daylight.outdoors import Outdoors, incident_illuminance, outdoors
from specularia.daylight.own_geometry import OwnRoom
from specularia.daylight.panes import Glazing, Lights, lights, named_glazing
from specularia.daylight.picture import IndirectField, render, write_hdr
from specularia.daylight.references import reference
from specularia.daylight.results import DaylightResult, Glare, GridResult, Image, PaneLuminance, Point
from specularia.daylight.scene import Scene
from specularia.daylight.uncertainty import LEVEL, relative_error, spread_interval
from specularia.errors import FormatError
from specularia.files import atomic, make_folder
from specularia.jobs import load_toml
from specularia.progress import task
from specularia.provenance import record

if TYPE_CHECKING:
    from specularia.daylight.plain import Plain

__all__ = ["file_name", "run", "sensor_pixels"]

Array = NDArray[np.float64]

_FINE = 4.0
"""Fineness for sensors (see `Scene.illuminance`), where a steep flank or a narrow peak must be right."""


def run(
    room: str | Path | RoomJob,
    *,
    models: Mapping[str, ScatteringModel | Coloured | Glazing | str | Path] | None = None,
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
    job = at(job, file=file)
    box = room_of(job, file)
    held = named_glazing(job.model, models or {})
    held.update({name: reference(name) for name in job.references})
    if not held:
        raise FormatError(
            file=file,
            expected="at least one scattering model for the panes",
            found="none",
            advice="Add [[model]] to the room or give --model NAME=FILE.",
        )
    own = {g.name: Glazing.of(g.file, cie_x=g.cie_x, cie_z=g.cie_z) for g in job.glass}
    every = {**own, **held}
    check_models({name: g.model for name, g in every.items()})
    check_models({f"{n}, {m.band}": m for n, g in every.items() for m in g.chroma or ()})
    out = outdoors(job)
    if folder is not None:
        folder = make_folder(folder)
    inputs = [] if job.geometry is None else [job.geometry.file]
    inputs += [g.source for g in held.values() if g.source is not None] + [g.file for g in job.glass]
    inputs += [f for m in job.model for f in m.members]
    inputs += job.other_bands
    provenance = record(
        what=f"daylight in {job.name}",
        inputs=inputs if isinstance(room, RoomJob) else [file, *inputs],
        parameters={
            "room": job,
            "bands": {name: g.bands for name, g in every.items()},
            "white": "sun, sky and ground: equal energy",
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

        return light_plainly(
            box, held, own, out, file=file, folder=folder, provenance=provenance, settings=plain
        )
    points: list[Point] = []
    images: list[Image] = []
    panes: list[PaneLuminance] = []
    grids: list[GridResult] = []
    glare: list[Glare] = []
    intervals: dict[str, str] = {}
    colour: dict[str, str] = {}
    sampling = job.quality.sampling
    members = {m.name: [Glazing.of(f) for f in m.members] for m in job.model if m.members}
    steps = len(held) * (3 + (len(job.view) if folder is not None else 0))
    with task("room", steps + 2 * sum(len(m) for m in members.values())) as progress:
        spacing = 0.35 / np.sqrt(sampling)
        meshes = [
            mesh(box, k * spacing, points=0.09 * k / sampling) if isinstance(box, Box) else None
            for k in (1.0, 1.5)
        ]

        def emitted_by(glazing: Glazing) -> tuple[list[Glazing], Lights]:
            each = [own.get(p.model or "", glazing) for p in box.panes]
            coloured = box.coloured or any(g.chroma is not None for g in each)
            return each, lights(box, each, out, sampling=sampling, colour=coloured)

        for name, glazing in held.items():
            each, emitted = emitted_by(glazing)
            colour[name] = _colour(glazing, emitted)
            progress.advance()
            with tempfile.TemporaryDirectory(prefix="specularia-room-") as scratch:
                scene = Scene.make(Path(scratch), box, emitted, sampling=sampling)
                light = [_interreflection(scene, m, k) for k, m in enumerate(meshes)]
                progress.advance()
                control = Scene.make(
                    make_folder(Path(scratch) / "control"), box, emitted.coarsened(), sampling=sampling
                )
                found = _points(name, scene, control, light, seed)
                progress.advance()
                if folder is not None:
                    field = _field(light[0], 0.3 / np.sqrt(sampling))
                    for view in job.view:
                        images.append(_image(name, view, scene, field, folder, provenance))
                        if view.wants_glare:
                            glare.append(glare_at(images[-1], scene, light[0], fineness=_FINE))
                        progress.advance()
            panes += _panes(name, box, emitted, out)
            others = []
            for member in members.get(name, []):
                _, theirs = emitted_by(member)
                progress.advance()
                with tempfile.TemporaryDirectory(prefix="specularia-room-") as scratch:
                    scene = Scene.make(Path(scratch), box, theirs, sampling=sampling)
                    others.append(_levels(scene, _interreflection(scene, meshes[0]), seed))
                progress.advance()
            with_them, intervals[name] = _intervals(found, relative_error(box, each, emitted), others)
            named, surveyed = split(with_them, model=name, box=box, out=out)
            points += named
            grids += surveyed
    return DaylightResult(
        points=points,
        images=images,
        panes=panes,
        grids=grids,
        glare=glare,
        no_daylight_factor=reference_illuminance(out)[1],
        provenance=provenance,
        intervals=intervals,
        colour=colour,
    )


def _colour(glazing: Glazing, emitted: Lights) -> str:
    """Whether the room is lit in colour, and what the model says of it."""
    if emitted.chroma is None:
        return "none: one band"
    white = "sun and sky of equal-energy white"
    return f"bands {glazing.bands}; {white}" if glazing.chroma else f"one band, taken as neutral; {white}"


def _intervals(points: list[Point], relative: float | None, members: list[Array]) -> tuple[list[Point], str]:
    """Points with the interval that the model's own uncertainty gives, and what it rests on."""
    middle, se = (np.array([getattr(p, k) for p in points]) for k in ("illuminance_lx", "se"))
    if members:
        low, high = spread_interval(np.array(members), middle, se)
        what = f"spread of {len(members)} members, 95 %"
    elif relative is not None:
        half = ndtri(0.5 + 0.5 * LEVEL) * np.hypot(relative * middle, se)
        low, high = np.maximum(middle - half, 0.0), middle + half
        what = f"interval of the transmission, {100 * relative:.2g} % (standard error), 95 %"
    else:
        return points, "none: the model's file states no uncertainty"
    return [replace(p, interval_lx=(float(a), float(b))) for p, a, b in zip(points, low, high)], what


def _field(light: Interreflection | Ambient, spacing: float) -> IndirectField | Ambient:
    """Reflected light, ready for pictures."""
    return light if isinstance(light, Ambient) else IndirectField(light.mesh.box, light, spacing)


def _interreflection(scene: Scene, m: Mesh | None, number: int = 0) -> Interreflection | Ambient:
    if m is None:
        return Ambient(scene, number)
    octree = scene.octree("coarse", cell=(0.14 if scene.box.has_niches else 0.28) / scene.sampling)
    points, normals = m.points.reshape(-1, 3), m.normals.reshape(-1, 3)
    lifted = m.box.lifted(points)
    direct = scene.illuminance(octree, lifted, normals, fineness=0.5)
    direct = direct + beam_illuminance(scene.box, scene.lights, lifted, normals)
    rho = reflectances(m, scene.lights.pane_reflectance)
    flux = np.array([band.flux for band in scene.lights.bands])
    return Interreflection(m, direct.reshape(*m.points.shape[:2], -1), rho, flux)


def _at_sensors(box: Box | OwnRoom) -> list[Sensor]:
    """Named sensors, then the points of grids."""
    return [*box.job.sensor, *grid_sensors(box)]


def _sensors(box: Box | OwnRoom) -> tuple[Array, Array]:
    sensors = _at_sensors(box)
    return box.lifted(np.array([s.position_m for s in sensors])), np.array([s.normal for s in sensors])


def _direct(scene: Scene, shift: Array, fineness: float) -> Array:
    """[K, C] lx straight from the panes at the sensors, the panes cut at places that `shift` chooses."""
    # A pane that a niche hides in part is seen or not piece by piece, so the pieces must be small.
    cell = (0.03 if scene.box.has_niches else 0.11) / scene.sampling
    octree = scene.octree("sensors", cell=cell, shift=(float(shift[0]), float(shift[1])))
    return scene.illuminance(octree, *_sensors(scene.box), fineness=fineness)


def _shifts(scene: Scene, seed: int) -> Array:
    return np.random.default_rng(seed).random((scene.box.job.quality.repeats, 2))


def _levels(scene: Scene, light: Interreflection | Ambient, seed: int) -> Array:
    """[K] lx at the sensors."""
    if not _at_sensors(scene.box):
        return np.zeros(0)
    at, normals = _sensors(scene.box)
    first = np.mean([_direct(scene, shift, _FINE) for shift in _shifts(scene, seed)], axis=0)
    beam = beam_illuminance(scene.box, scene.lights, at, normals)
    return luminous(first + beam + light.illuminance(at, normals))


def _points(
    name: str, scene: Scene, control: Scene, light: Sequence[Interreflection | Ambient], seed: int
) -> list[Point]:
    """Illuminance at the sensors, then at the points of grids.

    The standard error joins three parts: the spread over differently cut panes; a third of the change when
    emission map and points on the panes are half as dense (both errors fall with the square of the density);
    and the change of the reflected light when the mesh of the walls is coarser by half.
    """
    if not _at_sensors(scene.box):
        return []
    at, normals = _sensors(scene.box)
    shifts = _shifts(scene, seed)
    every = np.stack([_direct(scene, shift, _FINE) for shift in shifts])
    runs = luminous(every)
    spread = runs.std(axis=0, ddof=1) / np.sqrt(len(runs))
    resolution = (runs[0] - luminous(_direct(control, shifts[0], _FINE / 2))) / 3
    beam = beam_illuminance(scene.box, scene.lights, at, normals)
    reflected = [part.illuminance(at, normals) for part in light]
    first, fine, coarse = runs.mean(axis=0) + beam[:, 0], *(luminous(v) for v in reflected)
    se = np.sqrt(spread**2 + resolution**2 + (fine - coarse) ** 2)
    found = [
        Point(s.name, name, float(d + i), float(e), float(d), float(i))
        for s, d, i, e in zip(_at_sensors(scene.box), first, fine, se)
    ]
    if scene.channels == 1:
        return found
    xy = chromaticity(to_xyz(every.mean(axis=0) + beam + reflected[0]))
    return [
        replace(p, chromaticity_xy=(float(c[0]), float(c[1])), colour_temperature_k=colour_temperature(c))
        for p, c in zip(found, xy)
    ]


def file_name(text: str) -> str:
    """A name that any file system takes: letters, digits, dots and dashes stay, all else becomes _."""
    return "".join(c if c.isalnum() or c in "-." else "_" for c in text)


def _image(
    name: str,
    view: View,
    scene: Scene,
    field: IndirectField | Ambient,
    folder: Path,
    provenance: Mapping[str, str],
) -> Image:
    # Radiance divides a source into 64 parts at most: larger pieces would show the needle of light that
    # smooth patches of the glass let through as a row of separate images.
    octree = scene.octree("picture", cell=0.05 if scene.box.has_niches else 0.1)
    camera = Camera.of(view, scene.box.size)
    picture = render(camera, scene=scene, octree=octree, field=field, fineness=1.0 / scene.sampling)
    luminance = luminous(picture)
    xyz = None if scene.channels == 1 else to_xyz(picture)
    stem = file_name(f"{name}_{view.name}")
    hdr = write_hdr(folder / f"{stem}.hdr", picture, camera, what=f"specularia daylight, model {name}")
    with atomic(folder / f"{stem}.npz") as temporary:
        arrays: dict[str, Any] = {"luminance": luminance.astype(np.float32), "units": "cd/m2", **provenance}
        if xyz is not None:
            arrays["xyz"] = xyz.astype(np.float32)
        np.savez_compressed(temporary, **arrays)
    pixels = sensor_pixels(scene.box.job, camera)
    return Image(name, view.name, hdr, folder / f"{stem}.npz", luminance, view, pixels, xyz)


def sensor_pixels(job: RoomJob, camera: Camera) -> dict[str, tuple[float, float]]:
    """Picture positions of sensors whose lit side faces the eye."""
    sensors = job.sensor
    if not sensors:
        return {}
    at = np.array([s.position_m for s in sensors])
    facing = np.sum(camera.towards_eye(at) * np.array([s.normal for s in sensors]), axis=1) > 0
    found = camera.project(at)
    return {
        s.name: (float(c), float(r)) for s, (c, r), f in zip(sensors, found, facing) if f and np.isfinite(c)
    }


def _panes(name: str, box: Box | OwnRoom, emitted: Lights, out: Outdoors) -> list[PaneLuminance]:
    found = []
    for index, pane in enumerate(box.panes):
        sun, sky = incident_illuminance(out, pane.axes[2])
        parts = emitted.of(index)
        area = np.array([light.rectangle.area for light in parts])
        exitance = float(emitted.sunlit[index] + emitted.skylit[index]) / pane.glass.area
        eyes = [("normal", -pane.axes[2])]
        placed = [v for v in box.job.view if v.position_m is not None]
        eyes += [(v.name, np.array(v.position_m) - pane.centre) for v in placed]
        for eye, direction in eyes:
            local = pane.axes @ (direction / np.linalg.norm(direction))
            seen = np.array(
                [[float(b.maps[p.map].towards(local[0], local[1])) for p in parts] for b in emitted.bands]
            )
            towards = seen @ area / area.sum() if local[2] < 0 else np.zeros(len(seen))
            xy = chromaticity(towards) if len(seen) == 3 and towards.all() else None
            found.append(
                PaneLuminance(
                    window=pane.name,
                    model=name,
                    view=eye,
                    luminance_cd_m2=float(towards[len(seen) // 2]),
                    exitance_lm_m2=exitance,
                    sun_lx=sun,
                    sky_lx=sky,
                    sun_share=float(emitted.sun[index]),
                    chromaticity_xy=None if xy is None else (float(xy[0]), float(xy[1])),
                )
            )
    return found
