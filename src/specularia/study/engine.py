"""A graph of stages with content-addressed results.

The key of a stage is a digest of its name and code, its parameters, the bytes of its input files and the
keys of the stages it needs. Its result is a folder `stages/<stage>-<key>` that appears whole or not at all,
so a run that is killed leaves only finished results behind, and the next run takes them up.
"""

from __future__ import annotations

import json
import shutil
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from graphlib import CycleError, TopologicalSorter
from pathlib import Path
from typing import Any, Literal

from specularia import files, progress, provenance
from specularia.errors import FormatError, OutputError, SpeculariaError
from specularia.study.code import code_digest

__all__ = ["Run", "Stage", "Step", "Work", "execute", "plan"]

_MANIFEST = "stage.json"
_NEW = "no result yet"


@dataclass(frozen=True)
class Work:
    """What a stage is given.

    Parameters
    ----------
    folder : where it writes its products.
    parameters : its settings.
    inputs : files from outside the study, by role.
    within : files in the results of other stages, by role: names of the stages and patterns.
    results : result folders of the stages it needs.
    """

    folder: Path
    parameters: Mapping[str, Any]
    inputs: Mapping[str, tuple[Path, ...]]
    within: Mapping[str, tuple[tuple[str, str], ...]]
    results: Mapping[str, Path]

    def files(self, role: str) -> list[Path]:
        """All files of a role, those from outside first; empty if the study does not have the role."""
        found = list(self.inputs.get(role, ()))
        for stage, pattern in self.within.get(role, ()):
            here = sorted(self.results[stage].glob(pattern))
            if not here:
                raise FormatError(
                    file=self.results[stage] / pattern,
                    expected=f"a file that the stage {stage} made",
                    found="none of that name",
                    advice="Look into that folder and correct the path in the study.",
                )
            found += here
        return found

    def file(self, role: str) -> Path:
        """The one file of a role."""
        (path,) = self.files(role)
        return path

    def manifest(self, stage: str) -> dict[str, Any]:
        """The record of a needed stage's result: its key, inputs, parameters, versions and summary."""
        return _read_manifest(self.results[stage])

    def summary(self, stage: str) -> dict[str, Any]:
        """What a needed stage returned: a few numbers and names, as JSON holds them."""
        return dict(self.manifest(stage)["summary"])


@dataclass(frozen=True)
class Stage:
    """One step of a study.

    Parameters
    ----------
    name : letters, digits and underscores.
    run : writes its products into `Work.folder` and returns a summary that JSON can hold.
    needs : names of stages whose results it reads.
    parameters : settings that shape the result.
    inputs : files or folders from outside that it reads, by role.
    within : what it reads in the results of stages it needs, by role: stage and pattern.
    link : name of the link in the output folder that leads to the current result; the stage's name if empty.
    """

    name: str
    run: Callable[[Work], Mapping[str, Any]]
    needs: tuple[str, ...] = ()
    parameters: Mapping[str, Any] = field(default_factory=dict)
    inputs: Mapping[str, tuple[Path, ...]] = field(default_factory=dict)
    within: Mapping[str, tuple[tuple[str, str], ...]] = field(default_factory=dict)
    link: str = ""


@dataclass(frozen=True)
class Step:
    """What happens to one stage: run it now, keep the result that is there, or skip it; and why."""

    stage: Stage
    key: str
    folder: Path
    action: Literal["run", "keep", "skip"]
    why: str
    ingredients: Mapping[str, Any]


@dataclass(frozen=True)
class Run:
    """A finished run: seconds spent now on each stage (0 where a result was kept) and the result folders."""

    seconds: dict[str, float]
    folders: dict[str, Path]
    computed: tuple[str, ...]


def plan(
    stages: Sequence[Stage],
    out: str | Path,
    *,
    only: Sequence[str] = (),
    start: str | None = None,
) -> list[Step]:
    """Decide, without running anything, which stages have to run.

    Parameters
    ----------
    stages : in any order; stages that do not depend on each other keep the order given.
    out : output folder of the study; need not exist.
    only : bring these stages and what they need up to date, and leave the rest alone. Empty for all.
    start : run this stage and all that depend on it, even where their results are there.

    Returns
    -------
    steps in the order they run.

    Raises
    ------
    ValueError : unknown names, or a circle of stages.
    """
    out = Path(out)
    by_name = {s.name: s for s in stages}
    unknown = [n for n in (*only, *([start] if start else [])) if n not in by_name]
    if unknown:
        raise ValueError(f"no stage {unknown[0]!r} in this study; it has {', '.join(by_name)}")
    wanted = _with_needs(by_name, only) if only else set(by_name)
    previous = _read_links(out)
    digests: dict[Path, str] = {}
    steps: dict[str, Step] = {}
    for name in _ordered(stages):
        stage = by_name[name]
        ingredients = _ingredients(stage, steps, digests)
        key = provenance.digest(ingredients)
        folder = out / "stages" / f"{name}-{key[:12]}"
        missing = _incomplete(folder, key)
        action: Literal["run", "keep", "skip"] = "run"
        if name not in wanted:
            action, why = "skip", "not asked for"
        elif name == start:
            why = "asked for"
        elif missing:
            why = _reason(missing, out, previous.get(name), ingredients)
            upstream = [n for n in stage.needs if steps[n].action == "run"]
            if upstream and why.startswith(_NEW):
                why = f"needs {upstream[0]}, which runs"
        elif start is not None and start in _with_needs(by_name, [name]):
            why = f"{start} runs again"
        else:
            action, why = "keep", "up to date"
        steps[name] = Step(stage, key, folder, action, why, ingredients)
    return list(steps.values())


def execute(steps: Sequence[Step], out: str | Path) -> Run:
    """Run what has to run, in order. A stage that fails ends the run; finished results are kept."""
    out = files.make_folder(out)
    folders = {s.stage.name: s.folder for s in steps}
    seconds = {s.stage.name: 0.0 for s in steps if s.action != "skip"}
    computed = [s for s in steps if s.action == "run"]
    with _alone(out), progress.task("study", total=len(computed)) as bar:
        for left in (out / "stages").glob(".*"):
            shutil.rmtree(left, ignore_errors=True)  # of a run that was killed
        for step in steps:
            if step.action == "run":
                progress.note(f"{step.stage.name}: {step.why}")
                try:
                    seconds[step.stage.name] = _compute(step, folders)
                except SpeculariaError:
                    progress.note(f"{step.stage.name}: failed; what is finished is kept")
                    raise
                progress.note(f"{step.stage.name}: {seconds[step.stage.name]:.1f} s")
                bar.advance()
            if step.action != "skip":
                _link(out, step)
    return Run(seconds, {n: folders[n] for n in seconds}, tuple(s.stage.name for s in computed))


def _compute(step: Step, folders: Mapping[str, Path]) -> float:
    stage = step.stage
    began = time.perf_counter()
    with files.atomic_folder(step.folder) as folder:
        results = {n: folders[n] for n in stage.needs}
        summary = stage.run(Work(folder, stage.parameters, stage.inputs, stage.within, results))
        seconds = time.perf_counter() - began
        made = {p.relative_to(folder).as_posix(): p.stat().st_size for p in folder.rglob("*") if p.is_file()}
        files.write_json(
            folder / _MANIFEST,
            {
                "stage": stage.name,
                "key": step.key,
                "seconds": round(seconds, 2),
                "summary": summary,
                **step.ingredients,
                "versions": provenance.versions(),
                "files": dict(sorted(made.items())),
            },
        )
    return round(seconds, 2)


def _ingredients(stage: Stage, steps: Mapping[str, Step], digests: dict[Path, str]) -> dict[str, Any]:
    def file(path: Path) -> list[str]:
        if path not in digests:
            digests[path] = provenance.file_digest(files.existing(path))
        return [path.name, digests[path]]

    return {
        "name": stage.name,
        "code": code_digest(stage.run),
        "parameters": json.loads(provenance.to_json(stage.parameters)),
        "inputs": {role: [file(p) for p in paths] for role, paths in stage.inputs.items()},
        "within": json.loads(provenance.to_json(stage.within)),
        "needs": {name: steps[name].key for name in stage.needs},
    }


def _ordered(stages: Sequence[Stage]) -> list[str]:
    """Names in an order in which everything needed comes first, otherwise as given."""
    place = {s.name: k for k, s in enumerate(stages)}
    for stage in stages:
        for name in stage.needs:
            if name not in place:
                raise ValueError(f"stage {stage.name} needs {name}, which this study does not have")
    sorter = TopologicalSorter({s.name: s.needs for s in stages})
    try:
        sorter.prepare()
    except CycleError as error:
        raise ValueError(f"stages need each other in a circle: {' -> '.join(error.args[1])}") from error
    order: list[str] = []
    ready = list(sorter.get_ready())
    while ready:
        ready.sort(key=place.__getitem__)
        order.append(ready.pop(0))
        sorter.done(order[-1])
        ready += sorter.get_ready()
    return order


def _with_needs(by_name: Mapping[str, Stage], names: Sequence[str]) -> set[str]:
    found: set[str] = set()
    todo = list(names)
    while todo:
        name = todo.pop()
        if name not in found:
            found.add(name)
            todo += by_name[name].needs
    return found


def _incomplete(folder: Path, key: str) -> str:
    """Why a result cannot be kept; empty where it can."""
    if not folder.is_dir():
        return _NEW
    manifest = _read_manifest(folder)
    if manifest.get("key") != key:
        return "its result is damaged"
    for name, size in manifest["files"].items():
        path = folder / name
        if not path.is_file() or path.stat().st_size != size:
            return f"{name} of its result is missing or cut short"
    return ""


def _reason(missing: str, out: Path, previous: str | None, now: Mapping[str, Any]) -> str:
    """What changed since the result that the output folder last led to."""
    if missing != _NEW or previous is None:
        return missing
    before = _read_manifest(out / "stages" / previous)
    changes = {
        "code": "the program changed",
        "parameters": "settings changed",
        "inputs": "input files changed",
        "within": "input files changed",
        "needs": f"{_NEW} for what it needs now",
    }
    for part, text in changes.items():
        old, new = before.get(part), now[part]
        if old is None or old == new:
            continue
        if isinstance(new, Mapping) and part != "needs":
            text += ": " + ", ".join(sorted(k for k in {*old, *new} if old.get(k) != new.get(k)))
        return text
    return missing


def _read_manifest(folder: Path) -> dict[str, Any]:
    return _read_json(folder / _MANIFEST)


def _read_links(out: Path) -> dict[str, str]:
    """Names of the result folders that the output folder last led to, by stage."""
    return dict(_read_json(out / "study.json").get("stages", {}))


def _read_json(path: Path) -> dict[str, Any]:
    """The object in a JSON file; empty where there is none or it cannot be read."""
    try:
        return dict(json.loads(path.read_text(encoding="utf-8")))
    except (OSError, ValueError):
        return {}


def _link(out: Path, step: Step) -> None:
    """Lead from the output folder to the result: in study.json, and by a link where the system has them."""
    stages = _read_links(out)
    stages[step.stage.name] = step.folder.name
    files.write_json(out / "study.json", {"stages": stages})
    link = out / (step.stage.link or step.stage.name)
    target = step.folder.relative_to(out)
    if link.is_symlink():
        if link.readlink() == target:
            return
        link.unlink()
    if not link.exists():
        try:
            link.symlink_to(target, target_is_directory=True)
        except OSError:
            progress.note(f"no links here; the result of {step.stage.name} is {step.folder}")


@contextmanager
def _alone(out: Path) -> Iterator[None]:
    """Keep a second run out of the same output folder; the system lets go when this one ends, however."""
    try:
        import fcntl
    except ImportError:  # no such locks on this system
        yield
        return
    try:
        handle = (out / ".lock").open("w")
    except OSError as error:
        raise OutputError(f"{out}: cannot write here ({error.strerror}). Name another place.") from error
    with handle:
        try:
            fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError as error:
            raise OutputError(
                f"{out}: another run is at work here. Wait for it or name another folder."
            ) from error
        yield
