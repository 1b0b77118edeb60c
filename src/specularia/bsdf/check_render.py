"""A BSDF proved by the renderer: what rtrace finds behind the pane under a uniform dome and under a sun.

The model stands in a pane in the plane z = 0 of Radiance's frame, whose normal +z points into the room and
whose up is y, so that the frames of `conventions.to_radiance` apply as they are.
"""

from __future__ import annotations

import tempfile
import warnings
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from specularia.bsdf.cells import cell_means
from specularia.bsdf.check_sun import sun_response
from specularia.bsdf.finding import Check
from specularia.bsdf.io import write
from specularia.bsdf.model import Array, ScatteringModel
from specularia.bsdf.xml_model import XmlModel
from specularia.bsdf.xml_read import read_xml
from specularia.conventions import direction_cosines, square_to_disk, to_radiance
from specularia.errors import SpeculariaWarning
from specularia.radiance import run

__all__ = ["ANGLES", "rendered", "rendered_dome", "rendered_domes", "rendered_sun", "rendered_sun_tau"]

ANGLES = (0.0, 2.0, 30.0, 60.0, 75.0)
_SUN_DEG, _PHI_DEG = 0.5, 30.0
_PANE = """void BSDF pane
6 0 {xml} {up} .
0
0
pane polygon window
0
0
12 {corners}
{light}"""
_TOWARDS_ROOM = "-1 -1 0  1 -1 0  1 1 0  -1 1 0"


def _octree(folder: Path, xml: Path, light: str, *, up: str, corners: str) -> None:
    (folder / "scene.rad").write_text(_PANE.format(xml=xml, up=up, corners=corners, light=light))
    (folder / "scene.oct").write_bytes(run(["oconv", "scene.rad"], cwd=folder))


def _trace(folder: Path, towards: Array, *options: str) -> Array:
    """Radiance that leaves the middle of the pane in the directions `towards` [N, 3]."""
    rays = np.concatenate([0.5 * towards, -towards], axis=1).astype("<f4")
    # Without -st 0, rtrace leaves part of the light of panes that pass little to its ambient calculation.
    fixed = ["-h", "-ffd", "-ab", "1", "-aa", "0", "-lw", "1e-4", "-st", "0"]
    out = run(["rtrace", *fixed, *options, "scene.oct"], data=rays.tobytes(), cwd=folder)
    return np.frombuffer(out, "<f8").reshape(-1, 3)[:, 1]


def _world(theta_deg: float, phi_deg: float) -> Array:
    return np.array([float(c) for c in to_radiance(*direction_cosines(theta_deg, phi_deg))])


def rendered_domes(
    xml: Path,
    *,
    theta_deg: Sequence[float],
    phi_deg: float = 30.0,
    rays: int = 300,
    folder: Path | None = None,
) -> Array:
    """Radiance of the pane before a uniform dome of radiance 1 on its other side, for several eyes.

    By reciprocity it is the direct-hemispherical transmission for light that arrives from where the eye is.

    Parameters
    ----------
    xml : the file.
    theta_deg, phi_deg : where the eyes are, from the front normal, all on one side of the pane; theta above
        90 is behind it.
    rays : for each eye, each with 256 rays of its own towards the dome.
    folder : for the scene; None takes one that is removed again.

    Returns
    -------
    [N], one value for each eye.
    """
    if folder is None:
        with tempfile.TemporaryDirectory() as name:
            return rendered_domes(xml, theta_deg=theta_deg, phi_deg=phi_deg, rays=rays, folder=Path(name))
    eyes = np.array([_world(t, phi_deg) for t in theta_deg])
    up = -np.sign(eyes[0, 2])
    dome = f"void glow sky\n0\n0\n4 1 1 1 0\nsky source dome\n0\n0\n4 0 0 {up:g} 180\n"
    _octree(folder, xml.resolve(), dome, up="0 1 0", corners=_TOWARDS_ROOM)
    return _trace(folder, np.repeat(eyes, rays, axis=0), "-ad", "256").reshape(-1, rays).mean(axis=1)


def rendered_dome(xml: Path, *, theta_deg: float, phi_deg: float = 30.0, rays: int = 300) -> float:
    """As `rendered_domes`, for one eye."""
    return float(rendered_domes(xml, theta_deg=[theta_deg], phi_deg=phi_deg, rays=rays)[0])


def rendered_sun(
    xml: Path,
    *,
    theta_deg: float,
    phi_deg: float = 17.0,
    size: int = 192,
    rng: np.random.Generator,
    up: str = "0 1 0",
    corners: str = _TOWARDS_ROOM,
    folder: Path | None = None,
) -> tuple[Array, Array, Array]:
    """BSDF that the renderer shows all over the other hemisphere under a small sun.

    Parameters
    ----------
    xml : the file.
    theta_deg, phi_deg : where the sun is, from the front normal; theta above 90 is behind the pane.
    size : eye directions along an edge of the Shirley-Chiu square, one at random in each cell.
    rng : the generator for them.
    up, corners : of the pane, as Radiance takes them; other ones than these turn it.
    folder : for the scene; None takes one that is removed again.

    Returns
    -------
    (ux, uy, bsdf), each [size^2]; pi times the mean of bsdf is the direct-hemispherical transmission.
    """
    if folder is None:
        with tempfile.TemporaryDirectory() as name:
            return rendered_sun(
                xml,
                theta_deg=theta_deg,
                phi_deg=phi_deg,
                size=size,
                rng=rng,
                up=up,
                corners=corners,
                folder=Path(name),
            )
    sun = _sun_scene(folder, xml, theta_deg, phi_deg, up=up, corners=corners)
    k = np.arange(size)
    a, b = (v + rng.random((size, size)) for v in np.meshgrid(k, k, indexing="ij"))
    x, y = (v.ravel() for v in square_to_disk(a / size, b / size))
    return -x, y, _sun_seen(folder, sun, -x, y)


def rendered_sun_tau(
    xml: Path,
    *,
    theta_deg: float,
    phi_deg: float = 17.0,
    rays: int = 30_000,
    rng: np.random.Generator,
    model: XmlModel | None = None,
    folder: Path | None = None,
) -> tuple[float, float]:
    """Direct-hemispherical transmission for a small sun, summed over what the renderer shows.

    Eye directions are drawn where the file sends light, and one in ten anywhere, so that light which should
    not be there is found as well; each counts with the inverse of its density.

    Parameters
    ----------
    xml, theta_deg, phi_deg, folder : as for `rendered_sun`.
    rays : eye directions.
    rng : the generator for them.
    model : what `read_xml` gives for the file, if it is at hand.

    Returns
    -------
    (tau, standard error); the error counts the rays as independent, which is on the safe side.
    """
    if folder is None:
        with tempfile.TemporaryDirectory() as name:
            return rendered_sun_tau(
                xml,
                theta_deg=theta_deg,
                phi_deg=phi_deg,
                rays=rays,
                rng=rng,
                model=model,
                folder=Path(name),
            )
    sun = _sun_scene(folder, xml, theta_deg, phi_deg, up="0 1 0", corners=_TOWARDS_ROOM)
    model = read_xml(xml) if model is None else model
    side = "transmission_front" if theta_deg < 90 else "transmission_back"
    n = 128
    polar = min(theta_deg, 180.0 - theta_deg)
    light = cell_means(model, side, theta_i_deg=polar, phi_i_deg=phi_deg, n=n).ravel()
    share = 0.9 * light / max(light.sum(), 1e-12) + 0.1 / n**2
    cell = np.searchsorted(np.cumsum(share), (np.arange(rays) + rng.random()) / rays * share.sum())
    cell = np.minimum(cell, n * n - 1)
    a, b = (cell // n + rng.random(rays)) / n, (cell % n + rng.random(rays)) / n
    x, y = square_to_disk(a, b)
    c, d = np.cos(np.radians(phi_deg)), np.sin(np.radians(phi_deg))
    seen = _sun_seen(folder, sun, x * c - y * d, x * d + y * c)
    weighed = seen * (np.pi / n**2) * share.sum() / share[cell]
    return float(weighed.mean()), float(weighed.std() / np.sqrt(rays))


def _sun_scene(folder: Path, xml: Path, theta_deg: float, phi_deg: float, *, up: str, corners: str) -> Array:
    """The pane under a small sun of radiance 1e6; returns the direction of the sun."""
    sun = _world(theta_deg, phi_deg)
    place = " ".join(f"{c:.9g}" for c in sun)
    light = f"void light l\n0\n0\n3 1e6 1e6 1e6\nl source sun\n0\n0\n4 {place} {_SUN_DEG}\n"
    _octree(folder, xml.resolve(), light, up=up, corners=corners)
    return sun


def _sun_seen(folder: Path, sun: Array, ux: Array, uy: Array) -> Array:
    """BSDF towards eyes at the direction cosines (ux, uy) of ours on the other side."""
    x, y = -ux, uy
    z = np.sqrt(np.maximum(1.0 - x * x - y * y, 0.0)) * -np.sign(sun[2])
    seen = _trace(folder, np.stack([x, y, z], axis=1), "-dj", "0", "-dc", "1", "-dt", "0", "-ad", "1")
    irradiance = 1e6 * 2 * np.pi * (1 - np.cos(np.radians(_SUN_DEG / 2))) * abs(sun[2])
    return seen / irradiance


def rendered(model: ScatteringModel, sides: Sequence[str]) -> list[Check]:
    """Check tau as rtrace finds it under a uniform dome and under a sun.

    Parameters
    ----------
    model : any scattering model; one that does not come from XML is rendered as the tree at 2^6 that `write`
        makes of it.
    sides : transmission sides.

    Returns
    -------
    For each side and either light the worst deviation at `ANGLES` from what the file should show, over that
    or a quarter of the largest, whichever is more: where little passes, errors do little harm. Under a dome
    it should show its own direct-hemispherical value, and under a sun what `sun_response` says.
    """
    found = []
    rng = np.random.default_rng(0)
    with tempfile.TemporaryDirectory() as name:
        with warnings.catch_warnings():
            # What writing has to say is not about the file that is checked.
            warnings.simplefilter("ignore", SpeculariaWarning)
            xml = write(model, Path(name) / "pane.xml").path
        written = read_xml(xml)
        for side in sides:
            # On the edge between two bins, as 30 degrees is, rounding decides which one is read.
            around = (np.array(ANGLES) + np.array([[-1e-3], [1e-3]])).clip(0.0)
            tau = np.nan_to_num(written.direct_hemispherical(side, around, _PHI_DEG))
            sun = np.array([sun_response(written, side, row, _PHI_DEG) for row in around])
            from_front = side == "transmission_front"
            at = [t if from_front else 180.0 - t for t in ANGLES]
            dome = rendered_domes(xml, theta_deg=at, phi_deg=_PHI_DEG).tolist()
            suns = [
                rendered_sun_tau(xml, theta_deg=t, phi_deg=_PHI_DEG, rng=rng, model=written)[0] for t in at
            ]
            for light, seen, expected in (("dome", dome, tau), ("sun", suns, sun)):
                low, high = expected.min(axis=0), expected.max(axis=0)
                scale = np.maximum(np.maximum(high, 0.25 * high.max()), 1e-3)
                off = np.maximum(np.maximum(low - seen, seen - high), 0.0) / scale
                k = int(off.argmax())
                own = float(tau[:, k].mean())
                found.append(_as_rendered(side, light, float(off[k]), ANGLES[k], float(seen[k]), own))
    return found


_LIMIT = 0.015
"""One percent, and what chance leaves of it with this many rays."""


def _as_rendered(side: str, light: str, off: float, theta: float, seen: float, tau: float) -> Check:
    ok = off <= _LIMIT
    where = f"at {theta:g} degrees rtrace finds {seen:.3f}, and the file holds {tau:.3f}"
    if ok and light == "dome":
        advice = f"Sky light is rendered as it stands in the file; the worst is {where}."
    elif ok:
        advice = f"Direct sun is rendered as theory predicts; the worst is {where}."
    elif light == "dome":
        advice = f"Sky light comes out wrong: {where}. A side is missing or mislabelled; write it again."
    else:
        advice = f"Direct sun comes out as nothing explains: {where}. A side is missing or mislabelled."
    return Check(f"rendered {light} {side.replace('_', ' ')}", ok, off, _LIMIT, advice)
