"""The connection to a scheduler of dask: which workers may be used, what was handed out, and what came of it."""

from __future__ import annotations

import logging
import multiprocessing
import re
import time
import uuid
import warnings
from collections import deque
from collections.abc import Callable, Collection, Iterator, Mapping, Set
from contextlib import suppress
from functools import partial
from typing import Any

from circlepose.batch.cluster.events import Began, Broken, Done, Dropped, Ended, Event, WorkersDied
from circlepose.batch.versions import difference, versions
from circlepose.batch.workers.feed import signals_blocked
from circlepose.errors import UsageError
from circlepose.io.text.escaping import redacted

_ADDRESS = re.compile(r"(?:tcp|tls|ws|wss)://[^\s/@]+:[0-9]+/?")
INSTALL = "pip install 'circlepose[cluster]'"
_CONNECT_S = 10.0
_PATIENCE_S = 600.0
"""for a scheduler that has gone"""
_RETRY_S = 1.0
_RESULT_S = 60.0
_BY_NAME = ("circlepose", "numpy", "scipy")
"""what dask knows the version of by the name of the package; a worker looks at OpenCV itself"""
_LOUD = ("distributed", "tornado", "asyncio")


class Connection:
    """Hands work out to the workers of a cluster; what becomes of it comes as events, in no order."""

    def __init__(self, address: str, on_note: Callable[[str], None]) -> None:
        """Connect to the scheduler at `address`; raises `UsageError` where that fails, or all workers are refused."""
        try:
            import distributed  # noqa: F401, PLC0415 - only where a cluster is asked for
        except ImportError as error:
            raise UsageError(f"--cluster: needs dask ({error}); {INSTALL}.") from None
        if not _ADDRESS.fullmatch(address):
            raise UsageError(
                f"--cluster {redacted(address)}: expected the address of a scheduler, as tcp://host:8786."
            )
        self._address = address
        self._on_note = on_note
        self._versions = versions()
        self.topic = f"circlepose-{uuid.uuid4().hex}"
        self.threads: Mapping[str, int] = {}
        """of the workers that may be used, by address"""
        self.bell, self._ringer = multiprocessing.Pipe(duplex=False)
        """readable, for `multiprocessing.connection.wait`, when there are events"""
        self._has_rung = False
        self._events: deque[Event] = deque()
        self._futures: dict[int, Any] = {}
        self._only: dict[int, Collection[str]] = {}
        """the workers that each may go to, where it may not go to all"""
        self._refused: dict[str, str] = {}
        self._accepted: set[str] = set()
        self._is_alone = False
        self._levels = {logger: logger.level for logger in _loud_loggers()}
        for logger in self._levels:
            # What becomes of a worker is reported in a row, or by `on_note`.
            logger.setLevel(logging.CRITICAL + 1)
        try:
            self._client = self._connected()
            self.look()
        except BaseException:
            self.close()
            raise

    def submit(self, number: int, function: Callable[..., bytes], *args: object, avoid: str | None = None) -> None:
        """Hand out work under a `number` that is new; not to the worker `avoid`, if there are others."""
        only: Collection[str] = ()
        if self._refused or avoid in self.threads:
            only = [each for each in self.threads if each != avoid] or list(self.threads)
        if only:
            self._only[number] = only
        future = self._client.submit(
            function,
            *args,
            self.topic,
            number,
            key=f"{self.topic}-{number}",
            pure=False,
            workers=list(only) or None,
        )
        self._futures[number] = future
        future.add_done_callback(partial(self._finished, number))

    def forget(self, number: int) -> None:
        """Want no more of what was handed out."""
        self._only.pop(number, None)
        future = self._futures.pop(number, None)
        if future is not None:
            with suppress(Exception):
                future.cancel()

    def events(self) -> Iterator[Event]:
        """Yield what has happened to what is still wanted."""
        while self.bell.poll():
            self.bell.recv_bytes()
        self._has_rung = False
        if self._is_alone and any(isinstance(event, Began | Ended | Done) for event in list(self._events)):
            # Somebody worked, and may be done with all before the next look.
            self.look()
        while self._events:
            event = self._events.popleft()
            if event.number in self._futures:
                if isinstance(event, Done | WorkersDied | Broken):
                    self._futures.pop(event.number).release()
                    self._only.pop(event.number, None)
                yield event

    @property
    def is_lost(self) -> bool:
        """Whether the scheduler has gone, and with it all that was handed out."""
        return str(self._client.status) != "running"

    def reconnect(self) -> None:
        """Wait for the scheduler to come back; raises `UsageError` when it does not."""
        self._on_note(f"{redacted(self._address)}: the scheduler has gone; waiting for it to come back")
        self._drop_client()
        self._refused, self._accepted, self.threads = {}, set(), {}
        end = time.monotonic() + _PATIENCE_S
        while True:
            try:
                self._client = self._connected()
            except UsageError:
                if time.monotonic() > end:
                    raise
                time.sleep(_RETRY_S)
            else:
                break
        self._on_note(f"{redacted(self._address)}: the scheduler is back")
        self.look()

    def look(self) -> None:
        """Look which workers there are, and hand out again what waits for some that are gone.

        Raises `UsageError` when all have other versions than this process.
        """
        try:
            there: dict[str, int] = self._client.nthreads()
            new = there.keys() - self._accepted - self._refused.keys()
            if new:
                self._check_versions(new)
        except OSError:
            # As the loss of the scheduler, it is seen next time.
            return
        self._accepted &= there.keys()
        self._refused = {each: why for each, why in self._refused.items() if each in there}
        self.threads = {each: number for each, number in there.items() if each in self._accepted}
        if self._refused and not self.threads:
            address, how = next(iter(self._refused.items()))
            raise UsageError(f"--cluster: the worker {address} has {how}; install there what is installed here.")
        if self._is_alone != (not self.threads):
            self._is_alone = not self.threads
            what = "there is no worker; waiting for one" if self._is_alone else "a worker has come"
            self._on_note(f"{redacted(self._address)}: {what}")
        for number in [each for each, only in self._only.items() if self.threads.keys().isdisjoint(only)]:
            self._happened(Dropped(number))

    def refuse(self, worker: str, how: str) -> None:
        """Hand out no more to a worker, whose versions differ."""
        if worker not in self._refused:
            self._on_note(f"{worker}: is not used: this worker has {how}")
        self._accepted.discard(worker)
        self._refused[worker] = how
        self.look()

    def close(self) -> None:
        """Take back what is not done, and part."""
        for number in list(self._futures):
            self.forget(number)
        self._drop_client()
        for logger, level in self._levels.items():
            logger.setLevel(level)
        self.bell.close()

    def _connected(self) -> Any:
        from distributed import Client  # noqa: PLC0415 - only where a cluster is asked for

        try:
            # Threads that took a signal would leave the main one waiting.
            with signals_blocked(), warnings.catch_warnings():
                # Of other versions of dask at the scheduler: what does not work is reported when it fails.
                warnings.simplefilter("ignore")
                client = Client(self._address, timeout=_CONNECT_S, set_as_default=False, name="circlepose")
        except (OSError, ValueError, TypeError, ImportError) as error:
            why = str(error).partition("\n")[0] or type(error).__name__
            raise UsageError(
                f"--cluster {redacted(self._address)}: no scheduler of dask answers there ({redacted(why)[:200]}); "
                "start one with: dask scheduler."
            ) from None
        client.subscribe_topic(self.topic, self._told)
        return client

    def _drop_client(self) -> None:
        self._futures.clear()
        self._only.clear()
        self._events.clear()
        client = getattr(self, "_client", None)
        if client is not None:
            with suppress(Exception):
                client.close(timeout=2)

    def _check_versions(self, new: Set[str]) -> None:
        """Accept or refuse new workers; raises `UsageError` where the scheduler, which unpacks work, is another."""
        # Without code of ours: what is there may not know it.
        reports = self._client.get_versions(packages=list(_BY_NAME))
        how = difference(_told_versions(reports["scheduler"], ("circlepose", "python")), self._versions)
        if how:
            raise UsageError(f"--cluster: the scheduler has {how}; install there what is installed here.")
        for worker in new & reports["workers"].keys():
            how = difference(_told_versions(reports["workers"][worker], (*_BY_NAME, "python")), self._versions)
            if how:
                self._on_note(f"{worker}: is not used: this worker has {how}")
                self._refused[worker] = how
            else:
                self._accepted.add(worker)

    def _told(self, event: tuple[float, Mapping[str, Any]]) -> None:
        """Note what a worker said of itself."""
        number = event[1]["number"]
        self._happened(Began(number) if event[1]["begins"] else Ended(number))

    def _finished(self, number: int, future: Any) -> None:
        """Note, in a thread of dask's, what came of work."""
        from distributed import KilledWorker  # noqa: PLC0415 - only where a cluster is asked for

        if number not in self._futures:
            return
        try:
            event: Event = Done(number, future.result(timeout=_RESULT_S))
        except KilledWorker:
            event = WorkersDied(number)
        except Exception as error:
            if future.status in ("cancelled", "lost", "pending", "finished"):
                event = Dropped(number)
            else:
                event = Broken(number, f"{type(error).__name__}: {error}".partition("\n")[0])
        except BaseException:
            # CancelledError is no Exception.
            event = Dropped(number)
        self._happened(event)

    def _happened(self, event: Event) -> None:
        self._events.append(event)
        # Once for many: a pipe that is full would hold up the threads of dask.
        if not self._has_rung:
            self._has_rung = True
            with suppress(OSError):
                self._ringer.send_bytes(b"!")


def _loud_loggers() -> list[logging.Logger]:
    # Those of dask have levels and handlers of their own.
    names = [name for name in logging.root.manager.loggerDict if name.partition(".")[0] in _LOUD]
    return [logging.getLogger(name) for name in {*names, *_LOUD}]


def _told_versions(report: Mapping[str, Any], names: Collection[str]) -> dict[str, str | None]:
    """Return the versions in a report of dask's."""
    reported = {**report["packages"], "python": ".".join(report["host"]["python"].split(".")[:2])}
    return {name: reported.get(name) for name in names}
