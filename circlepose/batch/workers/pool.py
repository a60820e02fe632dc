"""Worker processes that may crash or hang: what they were at is tried again or given up, and they are replaced.

`concurrent.futures` gives up a whole run when a worker dies, and cannot end a task that takes too long.
"""

from __future__ import annotations

import multiprocessing
import time
from collections import deque
from collections.abc import Callable, Generator, Iterable
from contextlib import closing
from dataclasses import dataclass, field
from enum import Enum
from multiprocessing import connection, util
from typing import Any, Generic, TypeVar

from circlepose.batch.workers.feed import Feed, signals_blocked
from circlepose.batch.workers.worker import how_it_ended, work

Item = TypeVar("Item")
Result = TypeVar("Result")

DEATHS_ALLOWED = 1
"""how often a worker may die of an item before it is given up"""
STILLBORN_ALLOWED = 3
"""workers in a row that may end before they are ready; more have a cause that does not go away"""
_START_S = 120.0
_PARTING_S = 2.0
_LONGEST_WAIT_S = 3600.0
"""At once: the operating system takes no times that are much longer than years."""
_CONTEXT = multiprocessing.get_context("spawn")


@dataclass(frozen=True, slots=True)
class Known(Generic[Result]):
    """A result among the items: it needs no work, and passes through in its place."""

    result: Result


class Loss(Enum):
    """Why there is no result."""

    DIED = "died"
    TIMED_OUT = "timed out"


@dataclass(frozen=True, slots=True)
class Lost(Generic[Item]):
    """An item that was given up."""

    item: Item
    loss: Loss
    detail: str
    """how the last worker ended; empty when it timed out"""


@dataclass(frozen=True, slots=True)
class Failed(Generic[Item]):
    """An item at which the function raised."""

    item: Item
    error: Exception


@dataclass(slots=True, eq=False)
class _Place(Generic[Item, Result]):
    """An item on its way; places are in the order of the items."""

    item: Item
    deaths: int = 0
    outcomes: list[Result | Lost[Item] | Failed[Item]] = field(default_factory=list)
    """none or one"""


@dataclass(slots=True, eq=False)
class _Worker(Generic[Item, Result]):
    process: multiprocessing.process.BaseProcess
    pipe: connection.Connection[Any, Any]
    deadline: float
    """when it is to be ready, or the first of its tasks to be done"""
    ready: bool = False
    tasks: deque[_Place[Item, Result]] = field(default_factory=deque)
    """the first is at work, the second waits so that the worker need not"""


def run_in_workers(
    function: Callable[[Item], Result],
    items: Iterable[Item | Known[Result]],
    *,
    jobs: int,
    timeout_s: float,
    window: int,
) -> Generator[Result | Lost[Item] | Failed[Item], None, None]:
    """Yield what `function` makes of each item, in their order, each as soon as it and those before it are there.

    Parameters
    ----------
    function
        Importable by its name, and called in another process; so items and results are pickled.
    items
        Taken by a thread, at most `window` ahead of what was yielded. What the iterable raises is raised when
        all before it is out.
    jobs
        Worker processes at most; they are started when there is work for them.
    timeout_s
        Time for one item. A worker that takes longer is killed, and the item is `Lost`.

    Raises
    ------
    RuntimeError
        When workers end before they begin: a script without a `__main__` guard, or a machine out of memory.
    """
    with closing(Pool(function, jobs, timeout_s)) as pool:
        yield from pool.run(items, window)


class Pool(Generic[Item, Result]):
    """Worker processes that are kept from one `run` to the next, until `close`; the settings may change between."""

    def __init__(
        self,
        function: Callable[[Item], Result],
        jobs: int,
        timeout_s: float,
        deaths_allowed: int = DEATHS_ALLOWED,
    ) -> None:
        """Take what `run_in_workers` does, and how often a worker may die of an item."""
        self.timeout_s = timeout_s
        self._waiting: deque[_Place[Item, Result]] = deque()
        self._function = function
        self._jobs = jobs
        self._deaths_allowed = deaths_allowed
        self._workers: list[_Worker[Item, Result]] = []
        self._stillborn = 0
        # At the end of the program, a run may be abandoned half-way. Workers ignore SIGTERM, by which multiprocessing
        # would end them, and it would wait for them forever.
        util.Finalize(self, _kill, args=(self._workers,), exitpriority=10)

    def run(
        self, items: Iterable[Item | Known[Result]], window: int
    ) -> Generator[Result | Lost[Item] | Failed[Item], None, None]:
        """Yield as `run_in_workers` does; the workers stay unless it is abandoned half-way."""
        feed = Feed(items, window)
        places: deque[_Place[Item, Result]] = deque()
        try:
            while True:
                while places and places[0].outcomes:
                    feed.finished_one()
                    yield places.popleft().outcomes[0]
                for item in feed.take():
                    if isinstance(item, Known):
                        places.append(_Place(item, outcomes=[item.result]))  # type: ignore[arg-type]
                    else:
                        places.append(_Place(item))
                        self._waiting.append(places[-1])
                # Asked after what has arrived was taken, and with it the sign that would end the wait below.
                if feed.ended and not places:
                    feed.raise_error()
                    return
                self._hand_out()
                if not (places and places[0].outcomes):
                    self._wait(feed)
        finally:
            feed.close()
            if places:
                self.close()

    def _hand_out(self) -> None:
        """Give waiting items to workers, the idle ones first; start workers while there is more to do."""
        while self._waiting:
            ready = [worker for worker in self._workers if worker.ready]
            starting = len(self._workers) - len(ready)
            if len(self._workers) < self._jobs and len(self._waiting) > starting + sum(not w.tasks for w in ready):
                self._start_worker()
                continue
            worker = min(ready, key=lambda each: len(each.tasks), default=None)
            room = 2 if len(self._waiting) > starting else 1
            if worker is None or len(worker.tasks) >= room:
                return
            self._give(worker)

    def _wait(self, feed: Feed[Any]) -> None:
        """Wait for a result, a new item, the end of a worker or the end of its time."""
        timeout = None
        if busy := [worker.deadline for worker in self._workers if worker.tasks or not worker.ready]:
            timeout = min(max(0.0, min(busy) - time.monotonic()), _LONGEST_WAIT_S)
        changed = connection.wait([feed.signal, *(worker.pipe for worker in self._workers)], timeout)
        for worker in list(self._workers):
            if worker.pipe in changed:
                self._receive(worker)
            elif (worker.tasks or not worker.ready) and worker.deadline <= time.monotonic():
                self._end_late(worker)

    def close(self) -> None:
        """End all workers, soon: those at work finish the item that they are at, unless it takes long."""
        try:
            for worker in self._workers:
                worker.pipe.close()
            end = time.monotonic() + _PARTING_S
            for worker in self._workers:
                worker.process.join(max(0.0, end - time.monotonic()))
        finally:
            for worker in self._workers:
                worker.process.kill()
                worker.process.join()
            self._workers.clear()
            self._waiting.clear()

    def _start_worker(self) -> None:
        ours, theirs = _CONTEXT.Pipe()
        process = _CONTEXT.Process(target=work, args=(self._function, theirs), daemon=True)
        with signals_blocked():
            process.start()
            theirs.close()
            self._workers.append(_Worker(process, ours, time.monotonic() + _START_S))

    def _give(self, worker: _Worker[Item, Result]) -> None:
        place = self._waiting.popleft()
        if not worker.tasks:
            worker.deadline = time.monotonic() + self.timeout_s
        worker.tasks.append(place)
        try:
            worker.pipe.send(place.item)
        except OSError:
            self._bury(worker)

    def _receive(self, worker: _Worker[Item, Result]) -> None:
        try:
            succeeded, value = worker.pipe.recv()
        except (EOFError, OSError):
            self._bury(worker)
            return
        worker.deadline = time.monotonic() + self.timeout_s
        if not worker.ready:
            worker.ready = True
            self._stillborn = 0
            return
        place = worker.tasks.popleft()
        place.outcomes.append(value if succeeded else Failed(place.item, value))

    def _bury(self, worker: _Worker[Item, Result]) -> None:
        """Do without a worker that has ended; the item that it was at gets another chance."""
        self._workers.remove(worker)
        worker.pipe.close()
        worker.process.join(_PARTING_S)
        how = how_it_ended(worker.process.exitcode)
        worker.process.kill()
        if not worker.ready:
            self._count_stillborn(how)
        elif worker.tasks:
            place = worker.tasks[0]
            place.deaths += 1
            if place.deaths > self._deaths_allowed:
                worker.tasks.popleft()
                place.outcomes.append(Lost(place.item, Loss.DIED, how))
        self._waiting.extendleft(reversed(worker.tasks))

    def _end_late(self, worker: _Worker[Item, Result]) -> None:
        self._workers.remove(worker)
        worker.process.kill()
        worker.process.join()
        worker.pipe.close()
        if not worker.ready:
            self._count_stillborn(f"not ready after {_START_S:g} s")
            return
        place = worker.tasks.popleft()
        place.outcomes.append(Lost(place.item, Loss.TIMED_OUT, ""))
        self._waiting.extendleft(reversed(worker.tasks))

    def _count_stillborn(self, how: str) -> None:
        self._stillborn += 1
        if self._stillborn >= STILLBORN_ALLOWED:
            raise RuntimeError(f"worker processes end before they are ready to work ({how})")


def _kill(workers: list[_Worker[Any, Any]]) -> None:
    """End workers without waiting for what they are at."""
    for worker in workers:
        worker.process.kill()
