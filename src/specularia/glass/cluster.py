"""Directions handed to other processes or machines by dask.distributed.

Every direction is a task of its own, and its outcome does not depend on where it is traced. A worker that
dies takes only the directions with it that it was tracing; the scheduler gives them to others.
"""

from __future__ import annotations

import os
import pickle
import threading
import warnings
from collections.abc import Iterator, Sequence
from contextlib import ExitStack
from importlib import import_module
from types import TracebackType
from typing import Any, Self

from specularia.errors import SpeculariaError
from specularia.glass.checkpoint import code_digest
from specularia.glass.directions import Direction, Outcome, Task, trace_direction
from specularia.glass.slab import Slab
from specularia.glass.trace import compile_kernel
from specularia.progress import note

__all__ = ["Cluster"]

_TRIES = 5
"""Workers that may die over one direction before it counts as its fault."""

_WAIT_S = 30

_one_at_a_time = threading.Lock()


class Cluster:
    """Workers to trace on: a pool for `model.traced_model`, to be used in a `with` block.

    Parameters
    ----------
    workers : number of processes to start on this machine, or None.
    scheduler : address of a running scheduler, such as "tcp://10.0.0.1:8786", or None. Exactly one of the
        two.

    Raises
    ------
    SpeculariaError : dask.distributed is not installed, no scheduler answers, or it has no workers.
    """

    def __init__(self, *, workers: int | None = None, scheduler: str | None = None) -> None:
        if (workers is None) == (scheduler is None):
            raise SpeculariaError("name either a number of workers or the address of a scheduler.")
        self.workers, self.scheduler = workers, scheduler
        self._stack = ExitStack()
        self.client: Any = None

    def __enter__(self) -> Self:
        try:
            dask, distributed = (import_module(name) for name in ("dask", "distributed"))
        except ImportError as error:
            raise SpeculariaError(
                "tracing on several processes or machines needs dask.distributed: "
                "pip install dask distributed."
            ) from error
        address = self.scheduler
        if self.workers is not None:
            # By default a scheduler blames a task after three workers died over it.
            self._stack.enter_context(dask.config.set({"distributed.scheduler.allowed-failures": _TRIES}))
            address = self._stack.enter_context(
                distributed.LocalCluster(
                    n_workers=self.workers,
                    threads_per_worker=1,
                    processes=True,
                    dashboard_address=None,
                    memory_limit=0,
                )
            )
        try:
            self.client = self._stack.enter_context(distributed.Client(address, timeout=_WAIT_S))
            self.client.wait_for_workers(1, timeout=_WAIT_S)
        except (OSError, TimeoutError) as error:
            self._stack.close()
            raise SpeculariaError(
                f"no scheduler with workers answers at {address} within {_WAIT_S} s ({error}). Start one "
                "with `dask scheduler` and workers with `dask worker ADDRESS`, in environments like this one."
            ) from error
        note(f"{len(self.client.nthreads())} workers at {self.client.scheduler.address}")
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._stack.close()

    def outcomes(
        self, slab: Slab, directions: Sequence[Direction], work: Task
    ) -> Iterator[tuple[Direction, Outcome]]:
        """Directions with their outcomes, in the order in which they are finished."""
        distributed = import_module("distributed")
        slab.geometry  # noqa: B018 (made once, and sent along)
        threads = None if self.workers is None else max(1, (os.cpu_count() or 1) // self.workers)

        def submit(direction: Direction) -> Any:
            future = self.client.submit(
                _trace, pane, direction, work, threads, code_digest(), pure=False, retries=0
            )
            waiting[future.key] = direction
            return future

        waiting: dict[str, Direction] = {}
        with warnings.catch_warnings():
            # The pane goes to the scheduler, not straight to a worker: so no worker's death loses it.
            warnings.filterwarnings("ignore", message="Sending large graph")
            pane = self.client.submit(pickle.loads, pickle.dumps(slab), pure=False)
            finished = distributed.as_completed([submit(d) for d in directions])
        died: dict[Direction, int] = {}
        for future in finished:
            direction = waiting.pop(future.key)
            try:
                outcome = future.result()
            except distributed.KilledWorker as error:
                died[direction] = died.get(direction, 0) + 1
                if died[direction] >= _TRIES:
                    raise SpeculariaError(
                        f"workers died again and again over the direction {direction.name}: {error}."
                    ) from error
                finished.add(submit(direction))
                continue
            yield direction, outcome


def _trace(slab: Slab, direction: Direction, work: Task, threads: int | None, digest: str) -> Outcome:
    """Trace a direction on a worker."""
    if digest != code_digest():
        raise SpeculariaError(
            "a worker runs another version of this program, or of the packages that its numbers depend on, "
            "than this machine; install the same on all."
        )
    from numba import config, set_num_threads

    # The tracer is parallel in itself, and a worker may have several threads of its own.
    with _one_at_a_time:
        if threads is not None:
            set_num_threads(min(threads, config.NUMBA_NUM_THREADS))  # type: ignore[attr-defined]
        compile_kernel()
        return trace_direction(slab, direction, work)
