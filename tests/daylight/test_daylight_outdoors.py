"""Sun, sky and ground, and what a pane makes of them, against closed forms, quadrature and Radiance."""

from __future__ import annotations

import numpy as np
import pytest
from daylight_models import Diffuser, Lobe, room

from specularia.daylight.emission import back_reflectance, emission_map
from specularia.daylight.geometry import pane_axes
from specularia.daylight.outdoors import incident_illuminance, outdoors, sun_disc
from specularia.errors import SpeculariaWarning
from specularia.radiance import run

SOUTH = pane_axes("south")


def test_a_uniform_sky_and_the_ground_below_it_light_a_wall_by_half_each() -> None:
    job = room(
        sky={"kind": "uniform", "horizontal_illuminance_lx": 1e4},
        sun={"elevation_deg": 30.0, "normal_illuminance_lx": 0.0},
        ground={"reflectance": 0.3},
    )
    out = outdoors(job)
    assert out.zenith == pytest.approx(1e4 / np.pi, rel=1e-4)
    sun, sky = incident_illuminance(out, SOUTH[2])
    assert sun == 0.0
    assert sky == pytest.approx(1e4 / 2 + 0.3 * 1e4 / 2, rel=2e-3)


def test_an_overcast_sky_lights_a_wall_by_the_closed_form() -> None:
    """E_h = 7 pi L_z / 9 and E_v = L_z (pi / 2 + 4 / 3) / 3 for L = L_z (1 + 2 cos z) / 3."""
    job = room(sky={"kind": "overcast", "horizontal_illuminance_lx": 7 * np.pi / 9 * 1000})
    out = outdoors(job)
    assert out.zenith == pytest.approx(1000.0, rel=1e-4)
    assert incident_illuminance(out, SOUTH[2])[1] == pytest.approx(1000 * (np.pi / 2 + 4 / 3) / 3, rel=2e-3)


@pytest.mark.parametrize(("kind", "switch"), [("clear", "+s"), ("overcast", "-c"), ("uniform", "-u")])
def test_skies_left_to_gensky_light_as_radiance_says(kind: str, switch: str, tmp_path) -> None:  # type: ignore[no-untyped-def]
    """Ours against gensky's own sky seen by rtrace: vertical and horizontal, sun from the west of south."""
    job = room(sky={"kind": kind}, sun={"elevation_deg": 50.0, "azimuth_deg": 40.0})
    out = outdoors(job)
    sky = run(["gensky", "-ang", "50", "40", switch, "-g", "0.0"]).decode()
    (tmp_path / "sky.rad").write_text(
        sky + "\nskyfunc glow glowing\n0\n0\n4 1 1 1 0\n\nglowing source dome\n0\n0\n4 0 0 1 360\n"
    )
    (tmp_path / "sky.oct").write_bytes(run(["oconv", "sky.rad"], cwd=tmp_path))
    normals = [(0.0, 0.0, 1.0), (0.0, -1.0, 0.0), (1.0, 0.0, 0.0)]
    rays = "\n".join(f"0 0 0 {x} {y} {z}" for x, y, z in normals).encode()
    options = "-h -I -ab 1 -ad 40000 -as 0 -lw 1e-8"
    peer = np.array(run(["rtrace", *options.split(), "sky.oct"], data=rays, cwd=tmp_path).split(), float)
    peer = peer.reshape(-1, 3)[:, 1] * 179
    # gensky's sky fades into the black ground over some degrees about the horizon, hence a source that goes
    # all around. Behind an overcast or uniform sky there is no sun.
    ours = [sum(incident_illuminance(out, np.array(n))) for n in normals]
    assert ours == pytest.approx(peer.tolist(), rel=0.015)


def test_the_disc_of_the_sun_keeps_its_direction_and_its_width() -> None:
    sun = np.array([0.3, -0.5, np.sqrt(1 - 0.34)])
    directions, weights = sun_disc(sun)
    assert weights.sum() == pytest.approx(1.0)
    assert np.linalg.norm(directions, axis=1) == pytest.approx(np.ones(7))
    mean = weights @ directions
    assert mean / np.linalg.norm(mean) == pytest.approx(sun, abs=1e-12)
    # Mean square distance from the centre of an even disc: half the squared radius.
    assert weights @ np.sum((directions - sun) ** 2, axis=1) == pytest.approx(
        0.5 * np.radians(0.533 / 2) ** 2, rel=1e-3
    )


def test_the_sky_through_an_asymmetric_pane_equals_forward_quadrature() -> None:
    """Emission worked out by reciprocity against the plain sum over what each part of the sky sends in."""
    job = room(
        sky={"kind": "clear", "horizontal_illuminance_lx": 2e4},
        sun={"elevation_deg": 35.0, "azimuth_deg": 50.0, "normal_illuminance_lx": 0.0},
        ground={"reflectance": 0.2},
    )
    model = Lobe(16.0, shift=(0.15, -0.1))
    out = outdoors(job)
    emission = emission_map(model, axes=SOUTH, outdoors=out)
    # Incident directions on an even grid of cosines (sx, sy) of the outer hemisphere.
    n = 700
    c = (np.arange(n) + 0.5) / n * 2 - 1
    sx, sy = (v.ravel() for v in np.meshgrid(c, c))
    inside = sx**2 + sy**2 < 1
    sx, sy = sx[inside], sy[inside]
    # South wall, in the room's frame: x right, y up and z out of the sample are east, up and south.
    sky = out.luminance(np.stack([sx, -np.sqrt(1 - sx**2 - sy**2), sy], axis=1))
    for ux, uy in [(0.0, 0.0), (0.4, -0.3), (-0.4, -0.3), (0.1, 0.6), (-0.5, 0.2), (0.0, -0.8)]:
        truth = np.sum(model.value("transmission_front", sx, sy, ux, uy) * sky) * (2 / n) ** 2
        assert float(emission.towards(np.array(ux), np.array(uy))) == pytest.approx(truth, rel=0.02)
    # The bright sky west of south is thrown east, and the sky, brighter than the ground, down.
    right, left = (float(emission.towards(np.array(x), np.array(-0.3))) for x in (0.6, -0.6))
    assert right > 1.5 * left


def test_a_diffuser_emits_the_same_luminance_everywhere() -> None:
    job = room(
        sky={"kind": "uniform", "horizontal_illuminance_lx": 1e4},
        sun={"elevation_deg": 30.0, "normal_illuminance_lx": 5e4},
    )
    out = outdoors(job)
    emission = emission_map(Diffuser(0.4), axes=SOUTH, outdoors=out)
    incident = sum(incident_illuminance(out, SOUTH[2]))
    assert incident == pytest.approx(5e4 * np.cos(np.radians(30)) + 5e3, rel=2e-3)
    assert emission.exitance() == pytest.approx(0.4 * incident, rel=5e-3)
    assert np.ptp(emission.luminance) < 1e-2 * emission.luminance.mean()
    assert emission.luminance.mean() == pytest.approx(0.4 * incident / np.pi, rel=5e-3)


def test_a_lobe_too_narrow_for_the_map_keeps_its_flux_and_says_so() -> None:
    job = room(sun={"elevation_deg": 30.0, "normal_illuminance_lx": 5e4})
    out = outdoors(job)
    with pytest.warns(SpeculariaWarning, match="narrower than the map"):
        emission = emission_map(Narrow(0.05), axes=SOUTH, outdoors=out, sampling=0.3)
    assert emission.exitance() == pytest.approx(0.6 * 5e4 * np.cos(np.radians(30)), rel=1e-4)


class Narrow(Lobe):
    """A lobe whose transmission is stated, since a quadrature on even cells would miss it."""

    def direct_hemispherical(self, side, theta_i_deg, phi_i_deg=0.0):  # type: ignore[no-untyped-def]
        return np.full(np.shape(theta_i_deg), self.tau)


def test_a_pane_without_reflection_data_says_none_and_one_with_it_gives_the_diffuse_mean() -> None:
    class Mirror(Diffuser):
        sides = ("transmission_front", "transmission_back", "reflection_back")

        def direct_hemispherical(self, side, theta_i_deg, phi_i_deg=0.0):  # type: ignore[no-untyped-def]
            return np.sin(np.radians(np.asarray(theta_i_deg))) ** 2

    assert back_reflectance(Diffuser(0.5)) is None
    # Mean of sin^2 over d sin^2.
    assert back_reflectance(Mirror(0.5)) == pytest.approx(0.5)
