"""A study run as a whole, or as much of it as is asked for."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from specularia.study.engine import Step, execute, plan
from specularia.study.graph import stages_of
from specularia.study.job import read_job
from specularia.study.stages.report import PAGE

__all__ = ["StudyRun", "run", "steps"]


@dataclass(frozen=True)
class StudyRun:
    """What a run left behind.

    Attributes
    ----------
    report : the page, absolute path; None where the run was told to leave the report alone.
    seconds : spent now on each stage; 0 where a result was there.
    folders : result of each stage.
    computed : the stages that ran.
    """

    report: Path | None
    seconds: dict[str, float]
    folders: dict[str, Path]
    computed: tuple[str, ...]


def steps(
    study: str | Path,
    out: str | Path,
    *,
    only: Sequence[str] = (),
    start: str | None = None,
    seed: int | None = None,
) -> list[Step]:
    """What `run` would do, and why, without doing any of it.

    Parameters
    ----------
    study : STUDY.toml.
    out : output folder.
    only : stages to bring up to date, with what they need; empty for all.
    start : a stage to run again with all that follows from it, even where results are there.
    seed : takes the place of the seed in [trace].

    Raises
    ------
    FormatError : the study, or a file that it names, is missing or wrong.
    ValueError : `only` or `start` is no stage of this study.
    """
    path = Path(study)
    return plan(stages_of(read_job(path), path, seed=seed), out, only=only, start=start)


def run(
    study: str | Path,
    out: str | Path,
    *,
    only: Sequence[str] = (),
    start: str | None = None,
    seed: int | None = None,
) -> StudyRun:
    """Run a study: only what has changed or is missing. Parameters as those of `steps`.

    A stage that fails ends the run; what is finished is kept and taken up by the next run.
    """
    out = Path(out).resolve()
    done = execute(steps(study, out, only=only, start=start, seed=seed), out)
    page = done.folders["report"] / PAGE if "report" in done.folders else None
    return StudyRun(page, done.seconds, done.folders, done.computed)
