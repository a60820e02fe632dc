"""The state of objects that come by name only, asked for ahead: many requests wait for their answers at a time."""

from __future__ import annotations

import threading
from collections.abc import Iterable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import suppress
from dataclasses import replace
from queue import Full, Queue

from circlepose.batch.measure import WorkItem
from circlepose.batch.workers.feed import signals_blocked
from circlepose.io.remote.images import RemoteFile

REQUESTS = 32
_AHEAD = 4 * REQUESTS
_LOOK_S = 1.0


def with_states(items: Iterable[WorkItem]) -> Iterator[WorkItem]:
    """Yield `items` in their order, each as soon as it may be, those at URLs with the state that they have there.

    Items are taken by a thread, a few ahead, so that a silent source holds back nothing. An object whose state is not
    to be had is passed on as it is.
    """
    coming: Queue[WorkItem | Future[WorkItem] | BaseException | None] = Queue(_AHEAD)
    closed = threading.Event()

    def put(each: WorkItem | Future[WorkItem] | BaseException | None) -> None:
        while not closed.is_set():
            with suppress(Full):
                coming.put(each, timeout=_LOOK_S)
                return

    def take_all() -> None:
        try:
            for item in items:
                if closed.is_set():
                    return
                known = not isinstance(item.path, RemoteFile) or item.path.listed is not None
                put(item if known else requests.submit(_with_state, item))
            put(None)
        except BaseException as error:
            put(error)

    requests = ThreadPoolExecutor(REQUESTS, thread_name_prefix="circlepose-states")
    with signals_blocked():
        threading.Thread(target=take_all, name="circlepose-states", daemon=True).start()
    try:
        while (each := coming.get()) is not None:
            if isinstance(each, BaseException):
                raise each
            yield each.result() if isinstance(each, Future) else each
    finally:
        closed.set()
        requests.shutdown(wait=False, cancel_futures=True)


def _with_state(item: WorkItem) -> WorkItem:
    if not isinstance(item.path, RemoteFile):
        return item
    try:
        state = item.path.stat()
    except OSError:
        return item
    return replace(item, path=replace(item.path, listed=state))
