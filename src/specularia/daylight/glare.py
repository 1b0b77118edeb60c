"""Discomfort glare by daylight at the eye of a fisheye view, by evalglare.

    DGP = 5.87e-5 E_v + 0.0918 log10(1 + sum L_s^2 omega_s / (E_v^1.87 P_s^2)) + 0.16

(Wienold and Christoffersen 2006, doi:10.1016/j.enbuild.2006.03.017), with the vertical illuminance at the eye
E_v, and of each source its luminance L_s, solid angle omega_s and position index P_s. evalglare takes what is
brighter than 2000 cd/m2 as a source, its default. Release 3.06 adds 0.159 instead of 0.16, and does not lower
the value in dim light unless asked to.
"""

from __future__ import annotations

import warnings

import numpy as np

from specularia.daylight.ambient import Ambient
from specularia.daylight.beam import beam_illuminance
from specularia.daylight.colour import luminous
from specularia.daylight.interreflection import Interreflection
from specularia.daylight.results import Glare, Image
from specularia.daylight.scene import Scene
from specularia.errors import RadianceError, SpeculariaWarning
from specularia.radiance import run

__all__ = ["glare_at"]

_APART = 0.05
"""Share by which picture and sensor may differ before a warning."""


def glare_at(image: Image, scene: Scene, light: Interreflection | Ambient, *, fineness: float) -> Glare:
    """Glare in a fisheye picture, and the illuminance at its eye as a sensor there would have it.

    Parameters
    ----------
    image : of a fisheye view.
    scene, light : the room that it shows, for the sensor.
    fineness : see `Scene.illuminance`.

    Raises
    ------
    RadianceError : evalglare is not there, or gives no number.
    """
    command = ["evalglare", "-d", str(image.hdr)]
    lines = run(command).decode(errors="replace").splitlines()
    names, _, values = (lines[-1] if lines else "").partition(":")
    try:
        found = dict(zip(names.split(","), map(float, values.split()), strict=True))
        dgp, ev, omega = found["dgp"], found["E_v"], found["omega_sources"]
        sources, luminance = int(lines[0].split()[0]), found["lum_sources"]
    except (ValueError, KeyError, IndexError) as error:
        raise RadianceError(command=command, code=0, stderr=f"an answer without DGP: {lines[-1:]}") from error
    eye = np.array([image.view.position_m], float)
    sight = np.array([image.view.direction], float)
    octree = scene.octree("eye", cell=0.11 / scene.sampling)
    received = scene.illuminance(octree, eye, sight, fineness=fineness) + light.illuminance(eye, sight)
    received = received + beam_illuminance(scene.box, scene.lights, eye, sight)
    sensor = float(luminous(received)[0])
    if abs(ev - sensor) > _APART * max(sensor, 1.0):
        warnings.warn(
            f"view {image.name!r}, model {image.model!r}: the picture holds {ev:.4g} lx at the eye, a sensor "
            f"there {sensor:.4g} lx. The picture is too coarse for a narrow lobe; raise its size_px. Its DGP "
            "is as far off.",
            SpeculariaWarning,
            stacklevel=2,
        )
    return Glare(
        view=image.name,
        model=image.model,
        dgp=dgp,
        vertical_illuminance_lx=ev,
        sensor_illuminance_lx=sensor,
        sources=sources,
        source_luminance_cd_m2=luminance if sources else None,
        source_sr=omega if sources else 0.0,
    )
