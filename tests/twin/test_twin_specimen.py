"""The whole twin, small: files, labels, truth, and the same again from the same seed."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from specularia import finds, gonio
from specularia.daylight.job import RoomJob
from specularia.glass import read_slab, trace
from specularia.glass.photometer import SHADOW_DEPTH, SHADOW_HALF_WIDTH_DEG, SHADOW_HEIGHT_DEG, scan
from specularia.jobs import load_toml
from specularia.twin import TwinFiles, make
from specularia.twin.settings import GonioSettings

# The readers tell of negative values and of the shadow, which these tables are meant to have.
pytestmark = pytest.mark.filterwarnings("ignore::specularia.errors.SpeculariaWarning")

TOML = """
[maps]
pixels = 128
[front]
radius_um = [6.0, 30.0]
relief_um = 12.0
[back]
radius_um = [6.0, 35.0]
relief_um = 20.0
[gonio]
theta_deg = [0.0, 40.0, 82.5]
paths = 64000
base = 24000
middle = 8000
peak = 5000
aperture_deg = 1.0
[truth]
paths = 32000
[finds]
fragments = 600
weight_kg = 3.0
"""


@pytest.fixture(scope="session")
def settings(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("settings") / "twin.toml"
    path.write_text(TOML)
    return path


@pytest.fixture(scope="session")
def twin(settings: Path, tmp_path_factory: pytest.TempPathFactory) -> TwinFiles:
    return make(settings, tmp_path_factory.mktemp("twin"), seed=4)


@pytest.fixture(scope="session")
def truth(twin: TwinFiles) -> dict[str, Any]:
    found: dict[str, Any] = json.loads(twin.truth.read_text())
    return found


def digests(folder: Path) -> dict[str, str]:
    return {
        str(p.relative_to(folder)): hashlib.sha256(p.read_bytes()).hexdigest()
        for p in sorted(folder.rglob("*"))
        if p.is_file()
    }


def test_same_seed_gives_the_same_specimen_and_another_seed_another(
    twin: TwinFiles, settings: Path, tmp_path: Path
) -> None:
    first, again = digests(twin.folder), digests(make(settings, tmp_path / "again", seed=4).folder)
    assert first == again
    different = digests(make(settings, tmp_path / "different", seed=5).folder)
    for path in (twin.front_stack, twin.finds, twin.bubbles, *twin.tables):
        key = str(path.relative_to(twin.folder))
        assert first[key] != different[key], key


def test_every_file_says_that_it_is_synthetic(twin: TwinFiles) -> None:
    for path in twin.folder.rglob("*"):
        if path.is_file():
            assert b"synthetic" in path.read_bytes().lower(), path


def test_tables_read_back_as_what_they_are(twin: TwinFiles) -> None:
    for path, theta in zip(twin.tables, (0.0, 40.0, 82.5)):
        (table,) = gonio.read(path)
        assert (table.quantity, table.side, table.band) == ("DSF", "transmission_front", "520 nm")
        assert (table.theta_i_deg, table.phi_i_deg, table.azimuth_deg) == (theta, 0.0, 0.0)
        assert table.synthetic
        assert len(table.values) > 0.9 * (24000 + 8000 + 5000)


@pytest.mark.parametrize("theta", GonioSettings().theta_deg)
def test_default_scan_has_150000_directions(theta: float) -> None:
    wanted = GonioSettings()
    directions = scan(
        theta, base=wanted.base, middle=wanted.middle, peak=wanted.peak, rng=np.random.default_rng(1)
    )
    assert len(directions[0]) >= 150_000


def test_tables_integrate_to_the_true_transmission(twin: TwinFiles, truth: dict[str, Any]) -> None:
    for k, path in enumerate(twin.tables):
        tau, _ = gonio.integrate(gonio.read(path)[0])
        # 0.3 % of the density estimate, and the shadow, which is filled from the other side of the
        # plane of incidence: a small specimen is not quite symmetric.
        assert tau == pytest.approx(truth["tau"]["520 nm"]["phi_0"][k], rel=6e-3)


def test_fitted_model_lies_within_one_per_cent_of_the_truth(twin: TwinFiles, truth: dict[str, Any]) -> None:
    model = gonio.fit([table for path in twin.tables for table in gonio.read(path)])
    tau = model.direct_hemispherical("transmission_front", np.array(truth["theta_deg"]))
    assert tau == pytest.approx(np.array(truth["tau"]["520 nm"]["phi_0"]), rel=0.01)


def test_peak_lies_where_undeflected_light_leaves(twin: TwinFiles) -> None:
    for path, theta in zip(twin.tables[:2], (0.0, 40.0)):
        (table,) = gonio.read(path)
        brightest = np.argsort(table.values)[-50:]
        assert table.ux[brightest].mean() == pytest.approx(-np.sin(np.radians(theta)), abs=0.02)
        assert table.uy[brightest].mean() == pytest.approx(0.0, abs=0.02)


def test_mount_shades_phi_minus_90_near_the_horizon_and_nothing_else(
    twin: TwinFiles, settings: Path, tmp_path: Path
) -> None:
    clear = tmp_path / "clear.toml"
    clear.write_text(settings.read_text().replace("[gonio]", "[gonio]\nshadow = false"))
    whole = make(clear, tmp_path / "clear", seed=4)
    (table,), (without,) = gonio.read(twin.tables[2]), gonio.read(whole.tables[2])
    aside, above = np.abs(table.phi_s_deg - 270.0), np.abs(90.0 - table.theta_s_deg)
    # Its edges are soft.
    mount = (aside < SHADOW_HALF_WIDTH_DEG + 4.0) & (above < SHADOW_HEIGHT_DEG + 4.0)
    inner = (aside < SHADOW_HALF_WIDTH_DEG - 3.0) & (above < SHADOW_HEIGHT_DEG - 3.0)
    np.testing.assert_allclose(table.values[~mount], without.values[~mount], rtol=1e-3)
    assert table.values[inner].mean() < 2.0 * (1.0 - SHADOW_DEPTH) * without.values[inner].mean()


def test_truth_is_that_of_the_written_slab(twin: TwinFiles, truth: dict[str, Any]) -> None:
    balance = trace(read_slab(twin.glass), theta_deg=truth["theta_deg"], paths=64000, seed=77)
    said, said_se = (np.array(truth["tau"]["520 nm"][k]) for k in ("phi_0", "phi_0_se"))
    assert np.all(np.abs(balance.tau - said) < 4.0 * np.hypot(balance.tau_se, said_se))
    clear = trace(read_slab(twin.glass_clear), theta_deg=[0.0], paths=32000, seed=77)
    assert clear.absorbed[0] == 0.0
    # Without absorption a path of 3 mm or a little more keeps 1 / exp(-0.21) or a little more.
    assert 1.2 < clear.tau[0] / said[0] < 1.45


def test_daylight_truth_lies_above_that_at_520_nm(truth: dict[str, Any]) -> None:
    for key in ("phi_0", "azimuth_mean"):
        ratio = np.array(truth["tau"]["D65"][key]) / np.array(truth["tau"]["520 nm"][key])
        # The ratio of the internal transmittances of 3 mm is 1.070; longer paths show more colour.
        assert 1.06 < ratio[0] < 1.12
        assert np.all(np.diff(ratio) > 0.0)
        assert np.all(np.array(truth["tau"]["520 nm"][key + "_se"]) > 0.0)


def test_room_is_one_that_the_daylight_part_accepts(twin: TwinFiles) -> None:
    job = load_toml(twin.room, RoomJob)
    window = job.window[0]
    assert (window.width_m, window.height_m) == (0.80, 1.10) and window.frame_m > 0
    assert (job.reflectance.ceiling, job.reflectance.walls) == (0.70, 0.70)
    assert (job.reflectance.floor, job.reflectance.frames) == (0.15, 0.15)
    assert job.sun is not None and (job.sun.elevation_deg, job.sun.azimuth_deg) == (75.0, 0.0)
    assert job.sun.wall == window.wall


def test_finds_and_plan_read_back_as_synthetic(twin: TwinFiles) -> None:
    table = finds.read(twin.finds)
    assert table.synthetic and table.count.sum() == 600
    assert table.weight_g.sum() == pytest.approx(3000.0, abs=1e-6)
    places = {(area.kind, area.name) for area in finds.read_plan(twin.plan).areas}
    assert {("square", name) for name in table.square} | {("room", name) for name in table.room} <= places


def test_command_prints_the_path_of_the_truth(
    command: Callable[..., tuple[int, Any, str]], settings: Path, tmp_path: Path
) -> None:
    short = tmp_path / "short.toml"
    short.write_text(TOML.replace("theta_deg = [0.0, 40.0, 82.5]", "theta_deg = [20.0]"))
    older = tmp_path / "t" / "gonio" / "SYN_t40.00_p0.dat"
    older.parent.mkdir(parents=True)
    older.write_text("left by an older twin")
    code, payload, _ = command("twin", short, "-o", tmp_path / "t", "--seed", "9", "--json")
    assert code == 0
    assert [Path(p) for p in payload["tables"]] == list(older.parent.iterdir())
    path = Path(payload["truth"])
    assert path.is_absolute() and json.loads(path.read_text())["seed"] == 9


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("[front]\npited_share = 0.5\n", "pitted_share"),
        ("[maps]\npixels = 100\n", "power of two"),
        ("[gonio]\ntheta_deg = [20.0, 0.0]\n", "ascending"),
        ("[back]\npitted_share = 1.5\n", "pitted_share"),
    ],
)
def test_wrong_settings_end_with_3_and_a_word_on_what_is_right(
    command: Callable[..., tuple[int, Any, str]], tmp_path: Path, text: str, expected: str
) -> None:
    path = tmp_path / "twin.toml"
    path.write_text(text)
    code, _, said = command("twin", path, "-o", tmp_path / "t")
    assert code == 3
    assert "twin.toml, line" in said and expected in said
    assert not (tmp_path / "t").exists()


def test_missing_settings_and_unwritable_folder_end_with_3(
    command: Callable[..., tuple[int, Any, str]], settings: Path, tmp_path: Path
) -> None:
    code, _, said = command("twin", tmp_path / "none.toml", "-o", tmp_path / "t")
    assert code == 3 and "none.toml" in said
    (tmp_path / "file").write_text("in the way")
    code, _, said = command("twin", settings, "-o", tmp_path / "file" / "t")
    assert code == 3 and "cannot make this folder" in said
