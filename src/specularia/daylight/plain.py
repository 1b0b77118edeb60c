"""The published route to the lit room, for comparison: panes as BSDF polygons, all light by ambient sampling.

Nothing of `lit` is used: the pane is a polygon with a tensor tree, sky and ground shine on it from outside,
and every ray inside finds the window by chance. What the paper states of the renderer stands in `STATED`;
it says nothing of the sky, the resolution of the tree or the number of runs, which are chosen here.

Radiance seeds its chance by the clock, so two runs differ; the standard error comes from whole runs, started
in different seconds of the clock. It does not know of what all runs have in common: the cells of the tree,
which smooth the sun's lobe, and the light that is left after the last bounce.
"""

from __future__ import annotations

import os
import tempfile
import time
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from specularia import bsdf
from specularia.bsdf.cells import is_isotropic
from specularia.conventions import LUMINOUS_EFFICACY
from specularia.daylight.camera import Camera
from specularia.daylight.colour import luminous
from specularia.daylight.geometry import Box, Pane
from specularia.daylight.job import Reflectance, View
from specularia.daylight.lit import file_name, sensor_pixels
from specularia.daylight.obstacles import obstacle_faces
from specularia.daylight.outdoors import (
    SUN_DIAMETER_DEG,
    Outdoors,
    hemisphere,
    incident_illuminance,
)
from specularia.daylight.own_geometry import OwnRoom
from specularia.daylight.panes import Glazing
from specularia.daylight.picture import write_hdr
from specularia.daylight.references import Undeflected
from specularia.daylight.results import DaylightResult, Image, PaneLuminance, Point
from specularia.daylight.scene import polygon, walls
from specularia.daylight.shading import Outside, outer_reveal
from specularia.errors import FormatError
from specularia.files import atomic
from specularia.progress import task
from specularia.radiance import run

__all__ = ["CHOSEN", "STATED", "Plain", "light"]

Array = NDArray[np.float64]

STATED: Final = ("-ss", "32", "-aa", ".1", "-ab", "4", "-ad", "8192", "-as", "4096", "-lw", "1e-5")
"""Options that the paper gives; all others are rtrace's defaults."""

CHOSEN: Final = "tree at 2^7, three runs, sky, ground and sun as for the other method, one ray a pixel"
"""What the paper does not give."""


_LARGEST_RANK_4: Final = 6
"""Resolution of trees of samples that are not isotropic; each step takes 16 times the memory."""


@dataclass(frozen=True)
class Plain:
    """Settings of this route.

    Attributes
    ----------
    options : of rtrace.
    resolution : g of the tree that models without one of their own are written with; those read from XML are
        rendered as they are. The program that the paper names makes 6 unless told otherwise; the sun's patch
        needs 7 at least.
    repeats : runs of the points; with one there is no standard error (NaN).
    """

    options: tuple[str, ...] = STATED
    resolution: int = 7
    repeats: int = 3


def light(
    box: Box | OwnRoom,
    held: Mapping[str, Glazing],
    own: Mapping[str, Glazing],
    outdoors: Outdoors,
    *,
    file: Path,
    folder: Path | None,
    provenance: Mapping[str, str],
    settings: Plain | None = None,
) -> DaylightResult:
    """Light a room through each of the models; see `specularia.daylight.run`, which checks them before.

    Parameters
    ----------
    box : the room, with its niches, outer reveals and obstacles.
    held, own : models under comparison and those of single panes, by name.
    outdoors : sun, sky and ground.
    file : ROOM.toml, for messages.
    folder : where pictures go; none are made if it is None.
    provenance : of the result; method and options are added.

    Returns
    -------
    DaylightResult. The shares of a point, direct and indirect, are NaN: this route knows only their sum.
    """
    settings = settings or Plain()
    box = _fit(box, held, outdoors, file)
    provenance = {
        **provenance,
        "method": "plain: BSDF polygons and ambient sampling by Radiance, seeded by the clock",
        "radiance_options": " ".join(settings.options),
        "tree_resolution": str(settings.resolution),
    }
    job = box.job
    points: list[Point] = []
    images: list[Image] = []
    panes: list[PaneLuminance] = []
    steps = 1 + settings.repeats + (0 if folder is None else len(job.view))
    share = _sun_share(box, outdoors)
    with task("room, plain route", steps * len(held)) as progress:
        for name, glazing in held.items():
            with tempfile.TemporaryDirectory(prefix="specularia-plain-") as scratch:
                scene = _Scene(Path(scratch), box, outdoors, settings)
                scene.write(glazing, own)
                panes += _panes(name, scene, share)
                progress.advance()
                runs = []
                for k in range(settings.repeats):
                    if job.sensor:
                        runs.append(scene.illuminance(k))
                    progress.advance()
                points += _points(name, box, runs)
                if folder is not None:
                    for view in job.view:
                        images.append(_image(name, view, scene, folder, provenance))
                        progress.advance()
    why = "the plain route has no daylight factors"
    none = "none: the plain route knows nothing of the models' uncertainty"
    return DaylightResult(
        points=points,
        images=images,
        panes=panes,
        grids=[],
        glare=[],
        no_daylight_factor=why,
        provenance=dict(provenance),
        intervals=dict.fromkeys(held, none),
    )


def _fit(box: Box | OwnRoom, held: Mapping[str, Glazing], outdoors: Outdoors, file: Path) -> Box:
    """The room, if this route can light it."""
    found = ""
    if isinstance(box, OwnRoom):
        found = "[geometry]"
    elif box.job.grid:
        found = "[[grid]]"
    elif any(isinstance(g, Undeflected) for g in held.values()):
        found = "a reference pane that lets light pass undeflected"
    elif outdoors.kind not in _KINDS:
        found = f"a sky of kind {outdoors.kind}"
    if isinstance(box, OwnRoom) or found:
        raise FormatError(
            file=file,
            expected="a box room with sensors and views under a clear, overcast, uniform or black sky",
            found=f"{found}, which --method plain does not know",
            advice="Leave out --method.",
        )
    return box


_SKY = """{ Sky above and ground below the horizon, without a blend between them.
  A1: 1 clear, 2 overcast, 3 uniform, 4 none; A2: zenith; A3: ground; A4: clear sky's norm; A5..A7: sun. }
up = max(Dz, 1e-3);
cosgamma = max(min(Dx*A5 + Dy*A6 + Dz*A7, 1), -1);
clear = (.91 + 10*exp(-3*acos(cosgamma)) + .45*cosgamma*cosgamma) * (1 - exp(-.32/up)) / A4;
plainsky = if(Dz, A2 * select(A1, clear, (1 + 2*up)/3, 1, 0), A3);
"""

_KINDS: Final = {"clear": 1, "overcast": 2, "uniform": 3, "none": 4}


class _Scene:
    """Octrees of one room with the panes of one model."""

    def __init__(self, folder: Path, box: Box, outdoors: Outdoors, settings: Plain) -> None:
        self.folder, self.box, self.outdoors, self.settings = folder, box, outdoors, settings

    def write(self, glazing: Glazing, own: Mapping[str, Glazing]) -> None:
        """Write all files and make the octrees: "room", and "dark" with black walls."""
        box, files = self.box, {}
        for number, (name, one) in enumerate([(None, glazing), *own.items()]):
            if any(p.model == name for p in box.panes):
                files[name] = f"pane{number}.xml"
                _write_tree(one, self.folder / files[name], self.settings.resolution)
        glass = "".join(
            _pane(k, p, files[p.model], box, (own[p.model] if p.model else glazing))
            for k, p in enumerate(box.panes)
        )
        shown = [
            (corners, box.job.reflectance.outside)
            for k, window in enumerate(box.job.window)
            for corners in outer_reveal(box, k, window)
        ]
        shown += [(corners, o.reflectance) for o in box.job.obstacle for corners in obstacle_faces(o)]
        opaque = []
        for k, (corners, r) in enumerate(shown):
            opaque.append(f"void plastic outside{k}\n0\n0\n5 {r:.9g} {r:.9g} {r:.9g} 0 0\n\n")
            opaque.append(polygon(f"outside{k}", f"outer{k}", corners))
        (self.folder / "plain.cal").write_text(_SKY)
        (self.folder / "outdoors.rad").write_text("".join([_backing(box), *opaque, _sky(self.outdoors)]))
        nothing = Reflectance(ceiling=0.0, walls=0.0, floor=0.0, frames=0.0, reveals=0.0)
        dark = Box(box.job.model_copy(update={"reflectance": nothing}))
        for name, shell in (("room", box), ("dark", dark)):
            (self.folder / f"{name}.rad").write_text(walls(shell) + glass)
            octree = run(["oconv", f"{name}.rad", "outdoors.rad"], cwd=self.folder)
            (self.folder / f"{name}.oct").write_bytes(octree)

    def illuminance(self, number: int) -> Array:
        """[sensors] lx, one run of its own."""
        sensors = self.box.job.sensor
        at = self.box.lifted(np.array([s.position_m for s in sensors]))
        data = np.hstack([at, np.array([s.normal for s in sensors])])
        return self._trace("room", data, [*self.settings.options, "-I", "-af", f"run{number}.amb"])

    def look(self, octree: str, origins: Array, directions: Array, *options: str) -> Array:
        """[K] cd/m2 along rays."""
        chosen = options or (*self.settings.options, "-af", "picture.amb")
        return self._trace(octree, np.hstack([origins, directions]), chosen)

    def _trace(self, octree: str, data: Array, options: Any) -> Array:
        # Runs that begin within one second of the clock would draw the same numbers.
        time.sleep(1.001 - time.time() % 1.0)
        workers = str(min(os.cpu_count() or 1, 8))
        out = run(
            ["rtrace", "-h", "-ff", "-n", workers, *options, f"{octree}.oct"],
            data=data.astype("<f4").tobytes(),
            cwd=self.folder,
        )
        return luminous(np.frombuffer(out, "<f4").reshape(-1, 3).astype(float)) * LUMINOUS_EFFICACY


def _write_tree(glazing: Glazing, path: Path, resolution: int) -> None:
    model = glazing.model
    if isinstance(model, bsdf.XmlModel):
        bsdf.write(model, path)
    else:
        if is_isotropic(model):
            bsdf.write(model, path, resolution=resolution)
        else:
            bsdf.write(model, path, resolution=min(resolution, _LARGEST_RANK_4), basis="tensor4")


def _pane(index: int, pane: Pane, xml: str, box: Box, glazing: Glazing) -> str:
    """A pane as a polygon of type BSDF whose normal points into the room."""
    face, g = box.faces[pane.face], pane.glass
    up = " ".join(f"{c:.9g}" for c in pane.axes[1])
    # The polygon's own diffuse reflectance stands in where the model knows of none.
    known = "reflection_back" in glazing.model.sides
    given = box.job.window[pane.window].pane_reflectance
    r = 0.0 if known else (glazing.reflectance if given is None else given)
    corners = face.point(np.array([g.u0, g.u1, g.u1, g.u0]), np.array([g.v0, g.v0, g.v1, g.v1]))
    if float(np.cross(face.along, face.across) @ face.normal) < 0.0:
        corners = corners[::-1]
    return f"void BSDF glass{index}\n6 0 {xml} {up} .\n0\n3 {r:.9g} {r:.9g} {r:.9g}\n\n" + polygon(
        f"glass{index}", f"pane{index}", corners
    )


_BEHIND_M: Final = 5e-5
"""Backing behind the walls; it reaches as far again under the borders of panes and niches."""


def _backing(box: Box) -> str:
    """Black sheets just behind everything opaque, each a little larger than what it backs.

    Radiance overlooks surfaces nearer than 1e-6 m to where a ray starts, so that from about one of a million
    points, in the corners of the room, the sun is seen through a wall.
    """
    text = ["void plastic backing\n0\n0\n5 0 0 0 0 0\n\n"]
    for number, face in enumerate(box.faces.values()):
        for k, cell in enumerate(box.cells(face.name, 1e9, follow=True)):
            if cell.part < 0:
                q, more = cell.rectangle, 2.0 * _BEHIND_M
                u = np.array([q.u0 - more, q.u1 + more, q.u1 + more, q.u0 - more])
                v = np.array([q.v0 - more, q.v0 - more, q.v1 + more, q.v1 + more])
                corners = face.point(u, v) - _BEHIND_M * face.normal
                text.append(polygon("backing", f"backing{number}.{k}", corners))
    return "".join(text)


def _sky(out: Outdoors) -> str:
    """Sky and ground as one source all around, and the sun."""
    x, y, z = (0.0, 0.0, 1.0) if out.sun is None else out.sun
    norm = (0.91 + 10.0 * np.exp(-3.0 * np.arccos(np.clip(z, -1.0, 1.0))) + 0.45 * z * z) * (
        1.0 - np.exp(-0.32)
    )
    zenith, ground = out.zenith / LUMINOUS_EFFICACY, out.ground / LUMINOUS_EFFICACY
    numbers = f"{_KINDS[out.kind]} {zenith:.9g} {ground:.9g} {norm:.9g} {x:.9g} {y:.9g} {z:.9g}"
    text = (
        f"void brightfunc bright\n2 plainsky plain.cal\n0\n7 {numbers}\n\n"
        "bright glow outdoors\n0\n0\n4 1 1 1 0\n\noutdoors source all\n0\n0\n4 0 0 1 360\n\n"
    )
    if out.sun is None or out.sun_illuminance <= 0.0:
        return text
    solid = np.pi * np.sin(np.radians(SUN_DIAMETER_DEG / 2)) ** 2
    radiance = out.sun_illuminance / solid / LUMINOUS_EFFICACY
    return text + (
        f"void light sunlight\n0\n0\n3 {radiance:.9g} {radiance:.9g} {radiance:.9g}\n\n"
        f"sunlight source sun\n0\n0\n4 {x:.9g} {y:.9g} {z:.9g} {SUN_DIAMETER_DEG:g}\n\n"
    )


def _points(name: str, box: Box, runs: list[Array]) -> list[Point]:
    if not runs:
        return []
    values = np.stack(runs)
    se = (
        values.std(axis=0, ddof=1) / np.sqrt(len(runs)) if len(runs) > 1 else np.full(values.shape[1], np.nan)
    )
    return [
        Point(s.name, name, float(v), float(e), float("nan"), float("nan"))
        for s, v, e in zip(box.job.sensor, values.mean(axis=0), se)
    ]


def _image(name: str, view: View, scene: _Scene, folder: Path, provenance: Mapping[str, str]) -> Image:
    camera = Camera.of(view, scene.box.size)
    columns, rows = camera.size_px
    c, r = (a.ravel() for a in np.meshgrid(np.arange(columns) + 0.5, np.arange(rows) + 0.5))
    origins, directions, inside = camera.rays(c, r)
    seen = np.zeros(len(c))
    seen[inside] = scene.look("room", origins[inside], directions[inside])
    luminance = seen.reshape(rows, columns)
    stem = file_name(f"{name}_{view.name}")
    hdr = write_hdr(
        folder / f"{stem}.hdr", luminance[..., None], camera, what=f"specularia daylight, plain, model {name}"
    )
    with atomic(folder / f"{stem}.npz") as temporary:
        arrays: dict[str, Any] = {"luminance": luminance.astype(np.float32), "units": "cd/m2", **provenance}
        np.savez_compressed(temporary, **arrays)
    return Image(
        name, view.name, hdr, folder / f"{stem}.npz", luminance, view, sensor_pixels(scene.box.job, camera)
    )


_DARK: Final = ("-ab", "1", "-aa", "0", "-ad", "256", "-as", "0", "-ss", "256", "-lw", "1e-7")
"""For panes seen from a black room."""

_TOWARDS_EYE: Final = 64
"""Rays from one eye to a pane, spread over it."""


def _panes(name: str, scene: _Scene, share: Array) -> list[PaneLuminance]:
    """Luminance of the panes towards the views and straight in, and light emitted, in a black room."""
    box, found = scene.box, []
    k = (np.arange(8) + 0.5) / 8
    s, t = (v.ravel() for v in np.meshgrid(k, k))
    for index, pane in enumerate(box.panes):
        face, g = box.faces[pane.face], pane.glass
        sun, sky = incident_illuminance(scene.outdoors, pane.axes[2])
        places = face.point(g.u0 + (g.u1 - g.u0) * s, g.v0 + (g.v1 - g.v0) * t)
        eyes = [("normal", -pane.axes[2])]
        placed = [v for v in box.job.view if v.position_m is not None]
        eyes += [(v.name, np.array(v.position_m) - pane.centre) for v in placed]
        towards = [(n, d / np.linalg.norm(d)) for n, d in eyes]
        around, _ = hemisphere(-pane.axes[2], 32, 64)
        all_around = np.vstack([np.repeat([d for _, d in towards], _TOWARDS_EYE, axis=0), around])
        at = np.vstack([np.tile(places, (len(towards), 1)), np.tile(places, (len(around) // len(places), 1))])
        seen = scene.look("dark", at + 1e-3 * all_around, -all_around, *_DARK)
        exitance = float(np.pi * seen[-len(around) :].mean())
        for j, (eye, d) in enumerate(towards):
            mine = seen[j * _TOWARDS_EYE : (j + 1) * _TOWARDS_EYE]
            found.append(
                PaneLuminance(
                    window=pane.name,
                    model=name,
                    view=eye,
                    luminance_cd_m2=float(mine.mean()) if d @ pane.axes[2] < 0.0 else 0.0,
                    exitance_lm_m2=exitance,
                    sun_lx=sun,
                    sky_lx=sky,
                    sun_share=float(share[index]),
                )
            )
    return found


def _sun_share(box: Box, outdoors: Outdoors) -> Array:
    """[panes] share of the sun's light that nothing outside keeps from each pane."""
    outside, share = Outside(box, outdoors), np.ones(len(box.panes))
    if len(outside.triangles):
        for k, pane in enumerate(box.panes):
            shaded = outside.shade(pane, 1.0)
            area = np.array([place.area for place in shaded.places])
            share[k] = float(area @ shaded.sun / area.sum())
    return share
