"""What a worker of a cluster does with a few images: it has them measured by a process of its own.

So an image that crashes the decoder, or takes too long, ends that process and not the worker of the cluster, which
could neither survive the one nor end the other.
"""

from __future__ import annotations

import json
import multiprocessing
import pickle
import threading
import time
from collections.abc import Mapping, Sequence
from contextlib import closing
from typing import Any, TypeAlias

from circlepose.batch.measure import MeasureOptions, WorkItem, measure_alone
from circlepose.batch.versions import difference, versions
from circlepose.batch.workers.pool import Failed, Loss, Lost, Pool
from circlepose.errors import CircleposeError
from circlepose.io.tables.lossless import plain_result
from circlepose.results import ImageResult

Task: TypeAlias = tuple[WorkItem, MeasureOptions]
Outcome: TypeAlias = ImageResult | Lost[Task] | Failed[Task]

_TOLD_S = 0.5
_IDLE_S = 60.0
"""after which a process without work is ended"""


def pack(items: Sequence[WorkItem], options: MeasureOptions, timeout_s: float, *, suspected: bool = False) -> bytes:
    """Return what `measure_chunk` is given; `suspected` are images with which a worker was lost before."""
    return pickle.dumps((list(items), options, timeout_s, suspected))


def measure_chunk(expected: Mapping[str, str], packed: bytes, topic: str, number: int) -> bytes:
    """Measure images on a worker of a cluster; return JSON: the worker's address and an outcome for each.

    `expected` are the versions that a result has to come from; others give `refused`, how they differ. That the
    work begins, and that it ends, are events of `topic`: a second beginning means that the first worker has died.
    """
    from distributed import get_worker  # noqa: PLC0415 - only there

    worker = get_worker()
    differing = difference(versions(), expected)
    if differing:
        return json.dumps({"worker": worker.address, "refused": differing}).encode()
    items, options, timeout_s, suspected = pickle.loads(packed)
    if suspected:
        # A worker reports what it has done a little later. If that is lost with it, the image before would be blamed.
        time.sleep(_TOLD_S)
    worker.log_event(topic, {"number": number, "begins": True})
    outcomes = _processes.measured([(item, options) for item in items], timeout_s)
    answer = {"worker": worker.address, "outcomes": [_plain(each) for each in outcomes]}
    worker.log_event(topic, {"number": number, "begins": False})
    return json.dumps(answer).encode()


def _plain(outcome: Outcome) -> dict[str, Any]:
    if isinstance(outcome, Lost):
        return {"timed_out": True} if outcome.loss is Loss.TIMED_OUT else {"died": outcome.detail}
    if isinstance(outcome, Failed):
        kind = "misuse" if isinstance(outcome.error, CircleposeError) else "bug"
        return {kind: str(outcome.error), "notes": getattr(outcome.error, "__notes__", [])}
    return {"result": plain_result(outcome)}


def _measure(task: Task) -> ImageResult:
    return measure_alone(*task)


class _Processes:
    """Pools of one process each, as many as threads of the worker ask for at a time; they outlive a chunk."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._idle: list[tuple[Pool[Task, ImageResult], float]] = []
        self._watched = False

    def measured(self, tasks: Sequence[Task], timeout_s: float) -> list[Outcome]:
        pool = self._taken()
        pool.timeout_s = timeout_s
        try:
            with closing(pool.run(tasks, window=len(tasks))) as outcomes:
                return list(outcomes)
        finally:
            self._give_back(pool)

    def _taken(self) -> Pool[Task, ImageResult]:
        # Workers of dask are daemons, which multiprocessing lets have no children; these end with their parent.
        multiprocessing.current_process()._config["daemon"] = False  # type: ignore[attr-defined]
        with self._lock:
            if self._idle:
                return self._idle.pop()[0]
        # Whether an image that a process died of is tried again, is decided where other workers are known.
        return Pool(_measure, jobs=1, timeout_s=0.0, deaths_allowed=0)

    def _give_back(self, pool: Pool[Task, ImageResult]) -> None:
        with self._lock:
            self._idle.append((pool, time.monotonic()))
            if not self._watched:
                self._watched = True
                threading.Thread(target=self._end_idle, name="circlepose-idle", daemon=True).start()

    def _end_idle(self) -> None:
        while True:
            time.sleep(_IDLE_S / 4.0)
            with self._lock:
                old = [pool for pool, since in self._idle if time.monotonic() - since > _IDLE_S]
                self._idle = [each for each in self._idle if each[0] not in old]
                self._watched = bool(self._idle)
            for pool in old:
                pool.close()
            if not self._watched:
                return


_processes = _Processes()
