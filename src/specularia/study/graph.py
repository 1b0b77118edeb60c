"""The stages of a study: what its STUDY.toml asks for and nothing else."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from specularia.daylight.fragment_job import FragmentJob
from specularia.daylight.job import RoomJob
from specularia.glass import read_slab
from specularia.jobs import load_toml
from specularia.study.engine import Stage
from specularia.study.job import StudyJob
from specularia.study.sources import TWIN, Sources, files_named_by
from specularia.study.stages import (
    causes,
    comparison,
    finds,
    fragment,
    healed,
    measured,
    models,
    report,
    room,
    surfaces,
    view,
)
from specularia.study.stages import twin as twins
from specularia.twin import TwinSettings

__all__ = ["FACES", "stages_of"]

FACES = ("front", "back")

CLEAR_INDEX, CLEAR_THICKNESS_MM = 1.52, 3.0
"""Clear slab of comparison where the study has no [glass]; without absorption the thickness is idle."""


def stages_of(job: StudyJob, file: Path, *, seed: int | None = None) -> list[Stage]:
    """The stages of a study, in the order in which a reader would do them.

    Parameters
    ----------
    job, file : a study and the file it was read from.
    seed : takes the place of the seed in [trace].

    Raises
    ------
    FormatError : a file that the study names is missing, or the settings of its glass or room are wrong.
    """
    sources = Sources.of(job, file)
    seed = job.trace.seed if seed is None else seed
    stages: list[Stage] = []
    if job.twin:
        load_toml(job.twin.settings, TwinSettings)  # a wrong key is said now, not after other work
        stages.append(
            Stage(
                TWIN,
                twins.twin,
                parameters={"seed": job.twin.seed},
                inputs={"settings": (job.twin.settings,)},
                link=job.twin.folder,
            )
        )
    if job.gonio:
        files = _files(sources, tables=job.gonio.tables)
        said = job.gonio.model_dump(exclude={"tables"})
        stages.append(Stage("measured", measured.measured, parameters=said, **files))
        stages.append(Stage("model_m", measured.model_m, parameters=said | job.xml.model_dump(), **files))
    if job.surface:
        stages += _faces(job, sources)
    if job.glass:
        stages.append(_model_c(job, seed))
    if job.healing:
        stages += _healed(job, sources, seed)
    names = [s.name for s in stages]
    made = tuple(n for n in ("model_m", "model_c", "model_h") if n in names)
    if made:
        tabled = (*(n for n in ("measured",) if n in names), *made)
        stages.append(Stage("table_1", comparison.table_1, needs=tabled, parameters=_clear_slab(job)))
        stages.append(
            Stage("dsf", comparison.dsf, needs=made, parameters={"theta_deg": job.report.dsf_theta_deg})
        )
        if job.report.view:
            stages.append(_view(job, sources, made))
    if job.fragment:
        stages.append(_fragment(job, made))
    if job.room:
        needed = files_named_by(load_toml(job.room.settings, RoomJob))
        stages.append(
            Stage(
                "room",
                room.room,
                needs=made,
                parameters={"seed": seed},
                inputs={"settings": (job.room.settings,), "named": needed},
            )
        )
    for name, run in (("explain", causes.explain), ("infer", causes.infer)):
        if getattr(job, name):
            stages.append(_causes(name, run, job, sources, seed))
    if job.finds:
        named = {k: [getattr(job.finds, k)] for k in ("table", "plan", "mapping")}
        stages.append(Stage("finds", finds.finds, **_files(sources, **named)))
    stages.append(
        Stage(
            "report",
            report.report,
            needs=tuple(s.name for s in stages),
            parameters={
                "title": job.report.title,
                "note": job.report.note,
                "study": _as_written(job, file.resolve().parent),
            },
        )
    )
    return stages


def _files(sources: Sources, **roles: Sequence[str | None]) -> dict[str, Any]:
    """The arguments of a stage that say which files it reads."""
    within = {role: sources.within(patterns) for role, patterns in roles.items()}
    return {
        "inputs": {role: sources.outside(patterns) for role, patterns in roles.items()},
        "within": within,
        "needs": tuple(dict.fromkeys(stage for found in within.values() for stage, _ in found)),
    }


def _faces(job: StudyJob, sources: Sources) -> list[Stage]:
    """A stage for each face that is given, and one that draws them."""
    assert job.surface is not None
    said = job.surface.model_dump(include={"pitch_um", "step_um", "first_row", "unit"})
    given = {face: pattern for face in FACES if (pattern := getattr(job.surface, face)) is not None}
    stages = [
        Stage(
            f"heights_{face}",
            surfaces.heights,
            parameters={"face": face, **said},
            **_files(sources, face=[pattern]),
        )
        for face, pattern in given.items()
    ]
    pictures = _files(sources, **{f"{face}_image": [getattr(job.surface, f"{face}_image")] for face in FACES})
    pictures["needs"] = (*(s.name for s in stages), *pictures["needs"])
    return [*stages, Stage("surfaces", surfaces.surfaces, **pictures)]


def _model_c(job: StudyJob, seed: int) -> Stage:
    """The traced model; faces of the study take the place of those that the glass names."""
    assert job.glass is not None
    slab = read_slab(job.glass.settings)
    given = [face for face in FACES if job.surface and getattr(job.surface, face) is not None]
    return Stage(
        "model_c",
        models.model_c,
        needs=tuple(f"heights_{face}" for face in given),
        parameters={
            **job.trace.model_dump(exclude={"seed"}),
            "seed": seed,
            "tiling": job.surface.tiling if job.surface else None,
            "denoise": job.surface.denoise if job.surface else False,
            **job.xml.model_dump(),
        },
        inputs={"settings": (job.glass.settings,), "named": slab.sources},
    )


def _healed(job: StudyJob, sources: Sources, seed: int) -> list[Stage]:
    """A stage for each face that is healed, and the model of the pane between them."""
    assert job.glass is not None and job.surface is not None and job.healing is not None
    slab = read_slab(job.glass.settings)
    given = [face for face in FACES if getattr(job.surface, face) is not None]
    stages = []
    for k, face in enumerate(given):
        picture = _files(sources, image=[getattr(job.surface, f"{face}_image")])
        picture["needs"] = (f"heights_{face}", *picture["needs"])
        parameters = {"face": face, "ensemble": job.healing.ensemble, "seed": seed + k}
        stages.append(Stage(f"healed_{face}", healed.healed, parameters=parameters, **picture))
    return [
        *stages,
        Stage(
            "model_h",
            healed.model_h,
            needs=tuple(s.name for s in stages),
            parameters={
                "paths": job.healing.model_paths or job.trace.paths,
                "wavelength_nm": job.trace.wavelength_nm,
                "seed": seed,
                "tiling": job.surface.tiling,
                "interval": job.healing.model_dump(include={"theta_deg", "paths"}),
                **job.xml.model_dump(),
            },
            inputs={"settings": (job.glass.settings,), "named": slab.sources},
        ),
    ]


def _view(job: StudyJob, sources: Sources, made: tuple[str, ...]) -> Stage:
    """The interactive view, with the measured tables where there are any."""
    files: dict[str, Any] = _files(sources, tables=job.gonio.tables) if job.gonio else {"needs": ()}
    said = job.gonio.model_dump(exclude={"tables"}) if job.gonio else None
    files["needs"] = (*made, *files["needs"])
    parameters = {"gonio": said}
    return Stage("view", view.interactive, parameters=parameters, **files)


def _fragment(job: StudyJob, made: tuple[str, ...]) -> Stage:
    """The specimen over a printed sheet; a model of a reflection alone has nothing to show there."""
    assert job.fragment is not None
    settings = job.fragment.settings
    inputs: dict[str, tuple[Path, ...]] = {}
    if settings is not None:
        inputs = {"settings": (settings,), "named": files_named_by(load_toml(settings, FragmentJob))}
    return Stage("fragment", fragment.fragment, needs=made, inputs=inputs)


def _causes(name: str, run: Any, job: StudyJob, sources: Sources, seed: int) -> Stage:
    """What compares the traced pane with the tables: explain or infer."""
    assert job.gonio is not None and job.glass is not None
    given = getattr(job, name)
    files = _files(sources, tables=job.gonio.tables, settings=[given.settings])
    if given.settings is None:
        files["inputs"]["settings"] = (job.glass.settings,)
    named = [f for p in files["inputs"]["settings"] for f in read_slab(p).sources]
    files["inputs"] |= {"named": tuple(named)}
    faces = [face for face in FACES if job.surface and getattr(job.surface, face) is not None]
    files["needs"] = (*(f"heights_{face}" for face in faces), *files["needs"])
    parameters = {
        **given.model_dump(exclude={"settings"}),
        "gonio": job.gonio.model_dump(exclude={"tables"}),
        "wavelength_nm": job.trace.wavelength_nm,
        "seed": seed,
        "tiling": job.surface.tiling if job.surface else None,
        "denoise": job.surface.denoise if job.surface else False,
    }
    return Stage(name, run, parameters=parameters, **files)


def _clear_slab(job: StudyJob) -> dict[str, Any]:
    """The clear slab that the table ends with: as thick and as refracting as the study's glass."""
    nm = job.trace.wavelength_nm
    if job.glass is None:
        return {"index": CLEAR_INDEX, "thickness_mm": CLEAR_THICKNESS_MM, "wavelength_nm": nm}
    slab = read_slab(job.glass.settings)
    return {
        "index": slab.medium.index_at(nm),
        "thickness_mm": slab.thickness_mm,
        "wavelength_nm": nm,
    }


def _as_written(job: StudyJob, folder: Path) -> dict[str, Any]:
    """The settings of a study with paths as its file has them, so that they say nothing about the machine."""

    def plain(value: Any) -> Any:
        if isinstance(value, dict):
            return {k: plain(v) for k, v in value.items()}
        if isinstance(value, Path):
            return value.relative_to(folder).as_posix() if value.is_relative_to(folder) else value.name
        return value

    return plain(job.model_dump(exclude_none=True, exclude={"report"}))
