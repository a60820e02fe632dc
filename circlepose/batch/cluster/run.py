"""Many image files on a cluster of dask: read and measured by its workers, results in input order, bounded memory.

Whatever becomes of workers or the scheduler, each image has its result: what was lost is handed out again, and an
image with which a worker is lost twice has a result that says so.
"""

from __future__ import annotations

import json
import math
import os
import time
from collections import deque
from collections.abc import Callable, Generator, Iterable
from contextlib import closing
from dataclasses import dataclass, field, replace
from multiprocessing.connection import wait
from pathlib import Path
from typing import Any

from circlepose.batch.cluster.connection import Connection
from circlepose.batch.cluster.events import Began, Broken, Done, Ended, Event, WorkersDied
from circlepose.batch.cluster.worker import measure_chunk, pack
from circlepose.batch.measure import (
    DEFAULT_TIMEOUT_S,
    BugReport,
    MeasureOptions,
    WorkItem,
    result_of_bug,
    result_of_timeout,
)
from circlepose.batch.versions import versions
from circlepose.batch.workers.feed import Feed
from circlepose.batch.workers.pool import DEATHS_ALLOWED
from circlepose.errors import OutputError, UsageError
from circlepose.io.tables.lossless import restored_result
from circlepose.results import ImageResult, Status

CHUNK_MOST = 16
"""Images handed out together: the scheduler needs about as long for one as for so many."""
PER_THREAD = 3
"""Chunks handed out for each thread of a worker: one is measured, one waits there, one at the scheduler."""
_CHUNKS_LEAST = 64
"""Chunks handed out however few workers there are, from which a cluster may see that it needs more."""
_LOOK_S = 2.0
_TRIES_TO_BEGIN = 3


def measure_on_cluster(
    items: Iterable[WorkItem | ImageResult],
    options: MeasureOptions,
    address: str,
    timeout_s: float | None = None,
    on_bug: BugReport | None = None,
    on_note: Callable[[str], None] = lambda _: None,
) -> Generator[ImageResult, None, None]:
    """Measure `items` by the workers of the cluster whose scheduler is at `address`, such as `tcp://host:8786`.

    As `measure_files`, but that the workers read the images: paths have to lead to the same files there. `on_note` gets
    a sentence on each worker that is missing or refused, and on a scheduler that has gone. It
    connects at once.

    Raises
    ------
    UsageError
        Where there is no such scheduler, or it does not come back; when dask is not installed; when all workers have
        other versions than this process.
    CircleposeError
        On misuse, as `measure_files`.
    """
    return _measured(items, Connection(address, on_note), options, timeout_s or DEFAULT_TIMEOUT_S, on_bug)


def _measured(
    items: Iterable[WorkItem | ImageResult],
    connection: Connection,
    options: MeasureOptions,
    timeout_s: float,
    on_bug: BugReport | None,
) -> Generator[ImageResult, None, None]:
    with closing(connection):
        run = _Run(connection, options, timeout_s, on_bug)
        window = CHUNK_MOST * run.most_chunks
        feed = Feed(items, window)
        places: deque[_Place | ImageResult] = deque()
        looked_s = time.monotonic()
        try:
            while True:
                while places and (result := _result(places[0])) is not None:
                    places.popleft()
                    feed.finished_one()
                    yield result
                for item in feed.take():
                    place = item if isinstance(item, ImageResult) else _Place(item)
                    places.append(place)
                    if isinstance(place, _Place):
                        run.waiting.append(place)
                if feed.ended and not places:
                    feed.raise_error()
                    return
                run.hand_out()
                if not places or _result(places[0]) is None:
                    wait([feed.signal, connection.bell], _LOOK_S)
                for event in connection.events():
                    run.handle(event)
                if connection.is_lost:
                    connection.reconnect()
                    run.resubmit_all()
                elif time.monotonic() - looked_s > _LOOK_S:
                    connection.look()
                    looked_s = time.monotonic()
                for _ in range(CHUNK_MOST * run.most_chunks - window):
                    # More workers have come.
                    feed.finished_one()
                    window += 1
        finally:
            feed.close()


def _result(place: _Place | ImageResult) -> ImageResult | None:
    return place if isinstance(place, ImageResult) else place.result


def _for_others(item: WorkItem) -> WorkItem:
    """Return `item` with the paths that hold in any folder."""
    path = Path(os.path.abspath(item.path)) if isinstance(item.path, Path) else item.path  # noqa: PTH100 - keeps links
    overlay = None if item.overlay is None else Path(os.path.abspath(item.overlay))  # noqa: PTH100
    return replace(item, path=path, overlay=overlay)


@dataclass(slots=True, eq=False)
class _Place:
    """An image on its way; places are in the order of the images."""

    item: WorkItem
    deaths: int = 0
    avoid: str | None = None
    """the worker where its process died"""
    result: ImageResult | None = None


@dataclass(slots=True, eq=False)
class _Chunk:
    """Images handed out together."""

    places: list[_Place]
    begun: int = 0
    broken: int = 0


@dataclass(slots=True)
class _Run:
    connection: Connection
    options: MeasureOptions
    timeout_s: float
    on_bug: BugReport | None
    expected: dict[str, str] = field(default_factory=versions)
    waiting: deque[_Place] = field(default_factory=deque)
    alone: deque[_Place] = field(default_factory=deque)
    """to be handed out one by one: something happened to them"""
    chunks: dict[int, _Chunk] = field(default_factory=dict)
    count: int = 0

    @property
    def most_chunks(self) -> int:
        return max(PER_THREAD * sum(self.connection.threads.values()), _CHUNKS_LEAST)

    def hand_out(self) -> None:
        """Hand out what waits; the chunks are small where little waits, so that all workers have some."""
        threads = max(sum(self.connection.threads.values()), 1)
        while self.alone:
            self._submit(_Chunk([self.alone.popleft()]))
        while self.waiting and len(self.chunks) < self.most_chunks:
            size = min(max(math.ceil(len(self.waiting) / (2 * threads)), 1), CHUNK_MOST, len(self.waiting))
            self._submit(_Chunk([self.waiting.popleft() for _ in range(size)]))

    def _submit(self, chunk: _Chunk) -> None:
        self.count += 1
        chunk.begun = 0
        self.chunks[self.count] = chunk
        suspected = any(place.deaths for place in chunk.places)
        items = [_for_others(place.item) for place in chunk.places]
        packed = pack(items, self.options, self.timeout_s, suspected=suspected)
        avoid = chunk.places[0].avoid
        self.connection.submit(self.count, measure_chunk, self.expected, packed, avoid=avoid)

    def resubmit_all(self) -> None:
        """Hand out again what a scheduler that is gone was given."""
        chunks = list(self.chunks.values())
        self.chunks.clear()
        for chunk in chunks:
            self._submit(chunk)

    def handle(self, event: Event) -> None:
        """Do what follows from an event."""
        number = event.number
        if isinstance(event, Began):
            self.chunks[number].begun += 1
            if self.chunks[number].begun > 1:
                self._blame(number, tried_again=True)
        elif isinstance(event, Ended):
            # What happens to its worker from now on is not its fault.
            self.chunks[number].begun = 0
        elif isinstance(event, WorkersDied):
            self._blame(number, tried_again=False)
        elif isinstance(event, Done):
            self._answered(self.chunks.pop(number), json.loads(event.answer))
        else:
            chunk = self.chunks.pop(number)
            self.connection.forget(number)
            if isinstance(event, Broken):
                chunk.broken += 1
                if chunk.broken > _TRIES_TO_BEGIN:
                    raise UsageError(f"--cluster: the workers cannot begin ({event.reason}).")
            self._submit(chunk)

    def _blame(self, number: int, *, tried_again: bool) -> None:
        """Count a worker that was lost with a chunk; one image alone the scheduler has `tried_again` by itself."""
        chunk = self.chunks[number]
        for place in chunk.places:
            place.deaths += 1
        chunk.begun = 1
        if tried_again and len(chunk.places) == 1 and chunk.places[0].deaths <= DEATHS_ALLOWED:
            return
        del self.chunks[number]
        self.connection.forget(number)
        for place in chunk.places:
            self._try_again(place, "a worker of the cluster was lost with it")

    def _try_again(self, place: _Place, how: str) -> None:
        if place.deaths > DEATHS_ALLOWED:
            place.result = ImageResult(place.item.name, Status.WORKER_DIED, f"its worker process died twice ({how})")
        else:
            self.alone.append(place)

    def _answered(self, chunk: _Chunk, answer: dict[str, Any]) -> None:
        if "refused" in answer:
            self.connection.refuse(answer["worker"], answer["refused"])
            self._submit(chunk)
            return
        for place, outcome in zip(chunk.places, answer["outcomes"], strict=True):
            if "result" in outcome:
                place.result = restored_result(outcome["result"])
            elif "died" in outcome:
                place.deaths += 1
                place.avoid = answer["worker"]
                self._try_again(place, outcome["died"])
            elif "timed_out" in outcome:
                place.result = result_of_timeout(place.item, self.timeout_s)
            elif "misuse" in outcome:
                raise OutputError(outcome["misuse"])
            else:
                error = RuntimeError(outcome["bug"])
                for note in outcome["notes"]:
                    error.add_note(note)
                place.result = result_of_bug(place.item, error, self.on_bug)
