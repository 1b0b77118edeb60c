"""The pipeline: STUDY.toml, its stages, their cache, and the page at the end."""

from specularia.study.bundled import write_demo
from specularia.study.checking import check
from specularia.study.engine import Stage, Step, Work, execute, plan
from specularia.study.graph import stages_of
from specularia.study.health import HealthCheck, diagnose
from specularia.study.job import StudyJob, read_job
from specularia.study.new import new
from specularia.study.running import StudyRun, run, steps

__all__ = [
    "HealthCheck",
    "Stage",
    "Step",
    "StudyJob",
    "StudyRun",
    "Work",
    "check",
    "diagnose",
    "execute",
    "new",
    "plan",
    "read_job",
    "run",
    "stages_of",
    "steps",
    "write_demo",
]
