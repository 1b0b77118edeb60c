"""The whole specimen: faces, instruments, finds and room, and the truth about them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from specularia import gonio, surface
from specularia.files import atomic, make_folder, write_json, write_netcdf, write_text
from specularia.glass import photometer
from specularia.glass.bubbles import BubbleKind, Bubbles, sample_bubbles
from specularia.glass.faces import Face
from specularia.glass.medium import Medium, Spectrum
from specularia.glass.slab import Slab
from specularia.glass.trace import REPLICATES, Paths, trace_paths
from specularia.jobs import load_toml
from specularia.progress import task
from specularia.provenance import record
from specularia.twin import light, microscope, room, site
from specularia.twin.faces import FaceTruth, make_face
from specularia.twin.settings import TwinSettings

__all__ = ["TwinFiles", "make"]

Array = NDArray[np.float64]

_BAND_NM = 520.0
_SYNTHETIC = "synthetic: made by a computer program, not measured"
_FACES = ("front", "back")
# Streams of chance, one for each part, so that a change of one part leaves the others as they were.
_STREAMS = ("front", "back", "front_stack", "back_stack", "scan", "noise", "finds")


@dataclass(frozen=True)
class TwinFiles:
    """Where everything of a twin lies.

    Attributes
    ----------
    truth : truth.json: transmissions with standard errors, shares, relief, seed, parameters.
    front_stack, back_stack, front_image, back_image : what the microscope saw, TIFF.
    tables : what the gonio-photometer recorded, in the order of theta_i.
    finds, plan, room : CSV, GeoJSON, ROOM.toml.
    heights : true maps by name: front_pristine, front_decayed, back_pristine, back_decayed.
    pits : masks by face.
    bubbles, spectrum : list of bubbles (None without any); absorption.
    glass, glass_clear : GLASS.toml of the true decayed faces; with true medium and bubbles, and with neither.
    """

    folder: Path
    truth: Path
    front_stack: Path
    back_stack: Path
    front_image: Path
    back_image: Path
    tables: tuple[Path, ...]
    finds: Path
    plan: Path
    room: Path
    heights: Mapping[str, Path]
    pits: Mapping[str, Path]
    bubbles: Path | None
    spectrum: Path
    glass: Path
    glass_clear: Path


def make(
    settings: TwinSettings | str | Path | None = None, folder: str | Path = "twin", seed: int = 1
) -> TwinFiles:
    """Make a synthetic specimen like the paper's, with what instruments would say of it and the truth.

    Parameters
    ----------
    settings : settings, the path of a TWIN.toml, or None for the defaults.
    folder : where it goes; made if missing, files of an older twin are replaced.
    seed : whole number >= 0; the same seed and settings give the same specimen.

    Returns
    -------
    TwinFiles, all paths absolute. Every file says that it is synthetic.
    """
    if settings is None:
        settings = TwinSettings()
    elif not isinstance(settings, TwinSettings):
        settings = load_toml(settings, TwinSettings)
    base = make_folder(folder).resolve()
    parts = {name: make_folder(base / name) for name in ("truth", "microscope", "gonio", "site", "room")}
    rng = {name: np.random.default_rng([seed, k]) for k, name in enumerate(_STREAMS)}
    with task("making the specimen", 3 + 2 * len(settings.gonio.theta_deg)) as progress:
        faces = {
            name: make_face(getattr(settings, name), settings.maps.of(name), rng[name]) for name in _FACES
        }
        heights, pits = _write_faces(faces, settings, parts["truth"], seed)
        progress.advance()
        seen = _microscope(faces, settings, parts["microscope"], rng)
        progress.advance()
        spectrum = write_text(parts["truth"] / "absorption.csv", light.absorption_csv(settings.glass))
        slab = make_slab(faces, settings, seed=seed)
        listed = (
            None if slab.bubbles is None else _write_bubbles(slab.bubbles, parts["truth"] / "bubbles.npz")
        )
        named = {"front": "front_decayed.nc", "back": "back_decayed.nc"}
        glass = write_text(
            parts["truth"] / "glass.toml",
            room.glass_toml(
                settings, **named, spectrum=spectrum.name, bubbles=None if listed is None else listed.name
            ),
        )
        clear = write_text(
            parts["truth"] / "glass_clear.toml",
            room.glass_toml(settings, **named, spectrum=None, bubbles=None),
        )
        finds = write_text(
            parts["site"] / "finds.csv", site.finds_csv(site.finds(settings.finds, rng["finds"]))
        )
        plan = write_text(parts["site"] / "plan.geojson", site.plan_geojson())
        place = write_text(parts["room"] / "room.toml", room.room_toml(settings))
        progress.advance()
        tables, tau = _photometer(slab, settings, parts["gonio"], seed, rng, progress.advance)
    truth = write_json(
        parts["truth"] / "truth.json",
        {
            "synthetic": _SYNTHETIC,
            "name": settings.label,
            "seed": seed,
            "theta_deg": settings.gonio.theta_deg,
            "tau": tau,
            "faces": {
                name: {
                    "pitted_share": float(face.pitted.mean()),
                    "relief_um": float(np.ptp(face.decayed_um)),
                    "pristine_relief_um": float(np.ptp(face.pristine_um)),
                }
                for name, face in faces.items()
            },
            "bubbles": 0 if slab.bubbles is None else len(slab.bubbles),
            "parameters": settings,
            "provenance": record(what="truth about a synthetic specimen", seed=seed, synthetic=True),
        },
    )
    return TwinFiles(
        folder=base,
        truth=truth,
        **seen,
        tables=tables,
        finds=finds,
        plan=plan,
        room=place,
        heights=heights,
        pits=pits,
        bubbles=listed,
        spectrum=spectrum,
        glass=glass,
        glass_clear=clear,
    )


def make_slab(faces: Mapping[str, FaceTruth], settings: TwinSettings, *, seed: int) -> Slab:
    """The specimen as the tracer knows it: true decayed faces, true medium, and its bubbles one by one."""
    glass, wanted, pitch = settings.glass, settings.bubbles, settings.maps.pitch_um
    front, back = (Face(faces[name].decayed_um, pitch, pitch, name=f"{name} (synthetic)") for name in _FACES)
    spectrum = Spectrum(light.WAVELENGTHS_NM, light.absorption(light.WAVELENGTHS_NM, glass))
    slab = Slab(
        thickness_mm=glass.thickness_mm,
        medium=Medium(index=glass.index, absorption_per_mm=spectrum),
        front=front,
        back=back,
        synthetic=True,
    )
    if wanted.per_cm3 == 0.0:
        return slab
    low, high = slab.bulk_mm
    kind = BubbleKind(
        per_cm3=wanted.per_cm3,
        median_mm=wanted.diameter_median_mm,
        sigma=wanted.diameter_sigma,
        elongation=wanted.elongation,
        axis=(0.0, 1.0, 0.0),
    )
    bubbles = sample_bubbles(
        [kind],
        thickness_mm=glass.thickness_mm,
        low_mm=low,
        high_mm=high,
        seed=seed,
        cell_mm=(wanted.cell_mm, wanted.cell_mm),
    )
    return replace(slab, bubbles=bubbles)


def _write_bubbles(bubbles: Bubbles, path: Path) -> Path:
    """The list of bubbles as `glass.read_bubbles` wants it, with a label beside the numbers."""
    with atomic(path) as temporary:
        np.savez(temporary, **asdict(bubbles), synthetic=_SYNTHETIC)
    return path


def _write_faces(
    faces: Mapping[str, FaceTruth], settings: TwinSettings, folder: Path, seed: int
) -> tuple[dict[str, Path], dict[str, Path]]:
    """True heights and pit masks as netCDF."""
    import xarray as xr

    heights, pits = {}, {}
    pitch = settings.maps.pitch_um
    for name, face in faces.items():
        parameters = getattr(settings, name).model_dump()
        for state, values in (("pristine", face.pristine_um), ("decayed", face.decayed_um)):
            what = f"true {state} heights of the {name} of a synthetic specimen"
            attributes = record(what=what, parameters=parameters, seed=seed, synthetic=True)
            map_ = surface.HeightMap(
                values, pitch, pitch, name=f"{settings.label}, {name}, {state}", attributes=attributes
            )
            heights[f"{name}_{state}"] = surface.write(map_, folder / f"{name}_{state}.nc")
        mask = xr.Dataset(
            {"pitted": (("y", "x"), face.pitted.astype(np.int8), {"long_name": "1 inside pits"})}
        )
        pits[name] = write_netcdf(
            folder / f"{name}_pits.nc",
            {"/": mask},
            record(what=f"true pits of the {name} of a synthetic specimen", seed=seed, synthetic=True),
        )
    return heights, pits


def _microscope(
    faces: Mapping[str, FaceTruth],
    settings: TwinSettings,
    folder: Path,
    rng: Mapping[str, np.random.Generator],
) -> dict[str, Path]:
    """Focus stacks and images of both faces; paths by the names in `TwinFiles`."""
    pitch = settings.maps.pitch_um
    out = {}
    for name, face in faces.items():
        label = f"{_SYNTHETIC} ({settings.label}, {name})"
        stack = microscope.focus_stack(
            face.decayed_um, settings.microscope, pitch_um=pitch, rng=rng[f"{name}_stack"]
        )
        out[f"{name}_stack"] = microscope.write_stack(
            stack, folder / f"{name}_stack.tif", pitch_um=pitch, label=label
        )
        image = microscope.white_light(
            face.decayed_um, settings.microscope, pitch_um=pitch, rng=rng[f"{name}_stack"]
        )
        out[f"{name}_image"] = microscope.write_image(
            image, folder / f"{name}_image.tif", pitch_um=pitch, label=label
        )
    return out


def _photometer(
    slab: Slab,
    settings: TwinSettings,
    folder: Path,
    seed: int,
    rng: Mapping[str, np.random.Generator],
    advance: Any,
) -> tuple[tuple[Path, ...], dict[str, Any]]:
    """Trace the specimen; write the tables and return the true transmissions with their standard errors.

    The truth at phi_i = 0 is the plain mean weight of the paths that the tables are read off from, before the
    density estimate, the scan, the shadow and the noise; the mean over azimuth has paths of its own.
    """
    wanted = settings.gonio
    daylight = light.photopic_d65()
    absorption = light.absorption(light.WAVELENGTHS_NM, settings.glass)
    tau: dict[str, Any] = {
        band: {key: [] for key in ("phi_0", "phi_0_se", "azimuth_mean", "azimuth_mean_se")}
        for band in ("520 nm", "D65")
    }
    tables, floor = [], None
    for k, theta in enumerate(wanted.theta_deg):
        traced = trace_paths(
            slab, theta_deg=theta, paths=wanted.paths, seed=_seed(seed, 2 * k), wavelength_nm=_BAND_NM
        )
        turned = trace_paths(
            slab,
            theta_deg=theta,
            phi_deg=None,
            paths=settings.truth.paths,
            seed=_seed(seed, 2 * k + 1),
            wavelength_nm=_BAND_NM,
        )
        for name, paths in (("phi_0", traced), ("azimuth_mean", turned)):
            for band, weight in (
                ("520 nm", paths.weight),
                ("D65", _daylight_weight(paths, absorption, daylight)),
            ):
                value, se = _transmission(paths, weight)
                tau[band][name].append(value)
                tau[band][f"{name}_se"].append(se)
        advance()
        directions = photometer.scan(
            theta, base=wanted.base, middle=wanted.middle, peak=wanted.peak, rng=rng["scan"]
        )
        clean = photometer.read_off(
            traced,
            theta_deg=theta,
            directions=directions,
            aperture_deg=wanted.aperture_deg,
            wavelength_nm=_BAND_NM,
            name=settings.label,
            synthetic=True,
        )
        floor = wanted.floor * float(clean.values.max()) if floor is None else floor
        table = photometer.recorded(
            clean, relative_noise=wanted.relative_noise, floor=floor, shadow=wanted.shadow, rng=rng["noise"]
        )
        tables.append(gonio.write(table, folder / f"SYN_t{theta:05.2f}_p0.dat"))
        advance()
    # Tables that an older twin left at other angles would pass for this one's.
    for stale in set(folder.glob("SYN_t*_p0.dat")) - set(tables):
        stale.unlink()
    return tuple(tables), tau


def _seed(seed: int, stream: int) -> int:
    """Seed of one trace, different for every stream of every twin."""
    return int(np.random.SeedSequence([seed, 1000 + stream]).generate_state(1, np.uint32)[0])


def _transmission(paths: Paths, weight: Array) -> tuple[float, float]:
    """Direct-hemispherical transmission and its standard error, from the spread of the replicates."""
    through = np.where(paths.transmitted, weight, 0.0)
    each = np.bincount(paths.replicate, through, REPLICATES) / np.bincount(
        paths.replicate, minlength=REPLICATES
    )
    return float(each.mean()), float(each.std(ddof=1) / np.sqrt(REPLICATES))


def _daylight_weight(paths: Paths, absorption: Array, share: Array) -> Array:
    """Weight of each path for daylight: sum over wavelengths of share * exp(-absorption * length in glass).

    Tabulated over the length, since it depends on nothing else.
    """
    length = paths.glass_length_mm
    grid = np.linspace(0.0, max(float(length.max()), 1e-6), 4000)
    return np.interp(length, grid, np.exp(-np.outer(grid, absorption)) @ share)
