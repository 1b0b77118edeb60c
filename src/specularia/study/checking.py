"""What is wrong with a study, found by reading all that it names before any work is done."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path

from specularia.errors import CoverageError, FormatError, SpeculariaError
from specularia.jobs import load_toml
from specularia.study.graph import FACES, stages_of
from specularia.study.job import StudyJob, read_job
from specularia.study.sources import Sources
from specularia.study.stages.surfaces import is_stack

__all__ = ["check"]


@dataclass(frozen=True)
class _Notebook:
    """Collects what goes wrong, so that one problem does not hide the next."""

    problems: list[str] = field(default_factory=list)

    @contextmanager
    def page(self) -> Iterator[None]:
        try:
            yield
        except SpeculariaError as error:
            self.problems.append(str(error))


def check(study: str | Path) -> list[str]:
    """Everything that would stop a study, each as one sentence; empty if nothing would.

    All files on disk are read as the stages would read them. What lies within a twin that is not made yet
    cannot be looked at.

    Parameters
    ----------
    study : STUDY.toml.
    """
    path = Path(study)
    notes = _Notebook()
    with notes.page():
        job = read_job(path)
        sources = Sources.of(job, path)
        for part in (_twin, _tables, _faces, _glass, _fragment, _room, _causes, _finds):
            part(job, sources, notes)
        if not notes.problems:
            stages_of(job, path)
    return list(dict.fromkeys(notes.problems))


def _twin(job: StudyJob, sources: Sources, notes: _Notebook) -> None:
    """The settings of the specimen are right."""
    from specularia.twin import TwinSettings

    if job.twin:
        with notes.page():
            load_toml(job.twin.settings, TwinSettings)


def _tables(job: StudyJob, sources: Sources, notes: _Notebook) -> None:
    """Each measured table can be read, and together they make one model."""
    from specularia import gonio

    if job.gonio is None:
        return
    said = job.gonio.model_dump(exclude={"tables"})
    tables = []
    for pattern in job.gonio.tables:
        files: tuple[Path, ...] = ()
        with notes.page():
            files = sources.outside([pattern])
        for file in files:
            with notes.page():
                tables += gonio.read(file, **said)
    bands = sorted({t.band for t in tables})
    with notes.page():
        if len(bands) > 1:
            raise CoverageError(
                f"{sources.file}: the tables are for {', '.join(bands)}; one model is for one band. Make a "
                "study for each, or state wavelength_nm in [gonio]."
            )
        if job.room and tables and not any(t.kind == "transmission" for t in tables):
            raise CoverageError(
                f"{sources.file}: no table is of transmission, so Model M lets no light into the room. "
                "Leave [room] out or add tables."
            )


def _faces(job: StudyJob, sources: Sources, notes: _Notebook) -> None:
    """Stacks, maps and pictures of the faces are there, one for each, and can be read."""
    from specularia import surface

    if job.surface is None:
        return
    given = job.surface
    for key in (*FACES, *(f"{face}_image" for face in FACES)):
        with notes.page():
            files = sources.outside([getattr(given, key)])
            if len(files) > 1:
                names = ", ".join(f.name for f in files[:4])
                raise FormatError(
                    file=sources.file, expected=f"one file for surface.{key}", found=f"{len(files)}: {names}"
                )
            for file in files:
                if key not in FACES:
                    continue
                if is_stack(file):
                    surface.read_stack(
                        file, pitch_um=given.pitch_um, step_um=given.step_um, first_row=given.first_row
                    )
                else:
                    surface.read(file, pitch_um=given.pitch_um, unit=given.unit)


def _glass(job: StudyJob, sources: Sources, notes: _Notebook) -> None:
    """The slab can be put together."""
    from specularia.glass import read_slab

    if job.glass:
        with notes.page():
            read_slab(job.glass.settings)


def _fragment(job: StudyJob, sources: Sources, notes: _Notebook) -> None:
    """The sheet and what lies on it are described rightly."""
    from specularia.daylight import FragmentJob

    if job.fragment and job.fragment.settings is not None:
        with notes.page():
            load_toml(job.fragment.settings, FragmentJob)


def _causes(job: StudyJob, sources: Sources, notes: _Notebook) -> None:
    """The panes of the budget and of the inference can be put together."""
    from specularia.glass import read_slab

    for name in ("explain", "infer"):
        given = getattr(job, name)
        if given is not None:
            with notes.page():
                for file in sources.outside([given.settings]):
                    read_slab(file)


def _room(job: StudyJob, sources: Sources, notes: _Notebook) -> None:
    """The room can be built."""
    from specularia.daylight.checks import room_of
    from specularia.daylight.job import RoomJob
    from specularia.daylight.moment import at

    if job.room:
        with notes.page():
            room_of(at(load_toml(job.room.settings, RoomJob), file=job.room.settings), job.room.settings)


def _finds(job: StudyJob, sources: Sources, notes: _Notebook) -> None:
    """Catalogue and plan can be read."""
    from specularia import finds

    if job.finds is None:
        return
    with notes.page():
        mappings = sources.outside([job.finds.mapping])
        for file in sources.outside([job.finds.table]):
            finds.read(file, mappings[0] if mappings else None)
    with notes.page():
        for file in sources.outside([job.finds.plan]):
            finds.read_plan(file)
