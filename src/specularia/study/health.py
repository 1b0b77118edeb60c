"""Whether this machine can do the work: versions, Radiance, threads, memory, places to write, graphics."""

from __future__ import annotations

import ctypes
import os
import platform
import shutil
import sys
import tempfile
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from specularia import radiance

__all__ = ["HealthCheck", "diagnose"]

_LEAST_MEMORY, _LEAST_DISK = 2e9, 1e9
_PROGRAMS = (
    "rtrace",
    "oconv",
    "rcontrib",
    "rfluxmtx",
    "evalglare",
    "pabopto2bsdf",
    "bsdf2ttree",
    "gendaylit",
)


@dataclass(frozen=True)
class HealthCheck:
    """One thing that was looked at.

    Parameters
    ----------
    name : what.
    ok : whether the program can work with it as it is.
    value : what was found.
    advice : what to do, or what follows from it.
    """

    name: str
    ok: bool
    value: str
    advice: str = ""


def diagnose() -> tuple[HealthCheck, ...]:
    """Look at everything that the program needs; a fault in one check does not end the others."""
    checks: tuple[tuple[str, Callable[[], HealthCheck | list[HealthCheck]]], ...] = (
        ("python", _python),
        ("packages", _packages),
        ("radiance programs", _programs),
        ("radiance", _light),
        ("compiler", _compiler),
        ("threads", _threads),
        ("memory", _memory),
        ("temporary files", _disk),
        ("GPU", _graphics),
    )
    out: list[HealthCheck] = []
    for name, check in checks:
        try:
            found = check()
        except Exception as error:
            found = HealthCheck(name, False, f"{type(error).__name__}: {error}", _ADVICE.get(name, ""))
        out += found if isinstance(found, list) else [found]
    return tuple(out)


_REINSTALL = "Install again: pip install --force-reinstall -c constraints.txt ."
_ADVICE = {
    "packages": _REINSTALL,
    "radiance programs": "Install again: pip install --force-reinstall 'pyradiance>=1.3.1,<1.4'",
    "radiance": "Rooms, checks with --render and the radiance methods will not work. Install pyradiance "
    "again; on systems without glibc (musl) there is no wheel that runs.",
    "compiler": "Nothing that traces or fits will work. Install numba again.",
}


def _python() -> HealthCheck:
    good = sys.version_info >= (3, 11)
    found = f"{platform.python_version()} on {platform.system()} {platform.machine()}"
    return HealthCheck("python", good, found, "" if good else "Use Python 3.11 or newer.")


def _packages() -> list[HealthCheck]:
    """Every package that this one asks for, in the version that it asks for."""
    from importlib.metadata import PackageNotFoundError, requires, version

    from packaging.requirements import Requirement

    out = [HealthCheck("specularia", True, version("specularia"))]
    for text in requires("specularia") or ():
        wanted = Requirement(text)
        if wanted.marker is not None and not wanted.marker.evaluate({"extra": ""}):
            continue
        advice = f"pip install '{wanted.name}{wanted.specifier}'"
        try:
            found = version(wanted.name)
        except PackageNotFoundError:
            out.append(HealthCheck(wanted.name, False, "not installed", advice))
            continue
        good = wanted.specifier.contains(found, prereleases=True)
        out.append(HealthCheck(wanted.name, good, found, "" if good else advice))
    return out


def _programs() -> HealthCheck:
    missing = [name for name in _PROGRAMS if not (radiance.folder() / "bin" / name).exists()]
    found = f"{len(_PROGRAMS) - len(missing)} of {len(_PROGRAMS)}" + (
        f"; missing: {', '.join(missing)}" if missing else ""
    )
    return HealthCheck(
        "radiance programs", not missing, found, _ADVICE["radiance programs"] if missing else ""
    )


def _light() -> HealthCheck:
    """Irradiance under a uniform sky of radiance 1 is pi, whatever the directions that are drawn."""
    import math

    scene = "void glow sky\n0\n0\n4 1 1 1 0\n\nsky source dome\n0\n0\n4 0 0 1 360\n"
    with tempfile.TemporaryDirectory() as folder:
        Path(folder, "scene.rad").write_text(scene, encoding="ascii")
        octree = radiance.run(["oconv", "scene.rad"], cwd=folder)
        Path(folder, "scene.oct").write_bytes(octree)
        answer = radiance.run(
            ["rtrace", "-h", "-I+", "-ab", "1", "-ad", "256", "-lw", "1e-4", "scene.oct"],
            data=b"0 0 0 0 0 1\n",
            cwd=folder,
        )
    value = float(answer.split()[0])
    good = abs(value / math.pi - 1.0) < 1e-3
    text = f"rtrace gives {value:.5g} W/m2 under a uniform sky; exact: {math.pi:.5g}"
    return HealthCheck("radiance", good, text, "" if good else _ADVICE["radiance"])


def _compiler() -> HealthCheck:
    """Numba compiles and runs a function."""
    import numba

    compiled = numba.njit(lambda n: n * (n + 1) // 2)
    good = compiled(100) == 5050
    return HealthCheck("compiler", good, f"numba {numba.__version__}", "" if good else _ADVICE["compiler"])


def _threads() -> HealthCheck:
    own = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else (os.cpu_count() or 1)
    limit = os.environ.get("NUMBA_NUM_THREADS", "")
    advice = "" if own > 1 else "Everything works, but takes longer than it says."
    if limit:
        advice = f"NUMBA_NUM_THREADS limits them to {limit}."
    return HealthCheck("threads", True, f"{own} of {os.cpu_count() or own}", advice)


def _memory() -> HealthCheck:
    import psutil

    found = psutil.virtual_memory()
    free = float(found.available)
    limit = _container_limit()
    text = f"{free / 1e9:.1f} GB free of {found.total / 1e9:.1f} GB"
    if limit is not None and limit < found.total:
        text += f"; this process may have {limit / 1e9:.1f} GB"
        free = min(free, limit)
    good = free >= _LEAST_MEMORY
    advice = "" if good else "Close other programs; large height maps and trees at 2^8 need several GB."
    return HealthCheck("memory", good, text, advice)


def _container_limit() -> float | None:
    """Bytes that the container allows, where there is one that does not allow all."""
    for name in ("/sys/fs/cgroup/memory.max", "/sys/fs/cgroup/memory/memory.limit_in_bytes"):
        try:
            text = Path(name).read_text(encoding="ascii").strip()
        except OSError:
            continue
        if text.isdigit():
            return float(text)
    return None


def _disk() -> HealthCheck:
    with tempfile.TemporaryFile() as f:
        f.write(b"x")
    free = shutil.disk_usage(tempfile.gettempdir()).free
    good = free >= _LEAST_DISK
    advice = "" if good else "Make room, or set TMPDIR to a larger place."
    return HealthCheck("temporary files", good, f"{free / 1e9:.0f} GB free", advice)


def _graphics() -> HealthCheck:
    """Graphics processors by NVIDIA's driver; nothing here needs one."""
    advice = "Not needed: all work is done by the processor."
    for library in ("libcuda.so.1", "nvcuda.dll"):
        try:
            driver = ctypes.CDLL(library)
        except OSError:
            continue
        count, name = ctypes.c_int(0), ctypes.create_string_buffer(96)
        if driver.cuInit(0) != 0 or driver.cuDeviceGetCount(ctypes.byref(count)) != 0 or count.value == 0:
            return HealthCheck("GPU", True, "a driver, but no device that it can use", advice)
        names = []
        for k in range(count.value):
            device = ctypes.c_int(0)
            driver.cuDeviceGet(ctypes.byref(device), k)
            driver.cuDeviceGetName(name, len(name), device)
            names.append(name.value.decode(errors="replace"))
        return HealthCheck(
            "GPU", True, ", ".join(names), f"{advice} Mitsuba 3 can render exported models on it."
        )
    return HealthCheck("GPU", True, "none", advice)
