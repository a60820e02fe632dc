"""Items of a slow source, taken by a thread so that whoever works on them need not wait for the next."""

from __future__ import annotations

import multiprocessing
import signal
import threading
from collections import deque
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from typing import Generic, TypeVar

T = TypeVar("T")


class Feed(Generic[T]):
    """Takes items from an iterable in a thread of its own, at most `window` more than have been finished.

    The thread is not waited for: it may be held by a source that never gives another item.
    """

    def __init__(self, items: Iterable[T], window: int) -> None:
        self._items = items
        self._arrived: deque[T] = deque()
        self._room = threading.Semaphore(window)
        self._ended = False
        self._closed = False
        self._error: BaseException | None = None
        self.signal, self._bell = multiprocessing.Pipe(duplex=False)
        """readable, for `multiprocessing.connection.wait`, when there is something new"""
        thread = threading.Thread(target=self._run, name="circlepose-feed", daemon=True)
        # A signal that this thread took would not end a wait of the main one.
        with signals_blocked():
            thread.start()

    @property
    def ended(self) -> bool:
        """Whether all items have been taken from here."""
        return self._ended and not self._arrived

    def take(self) -> Iterator[T]:
        """Yield what has arrived."""
        while self.signal.poll():
            self.signal.recv_bytes()
        while self._arrived:
            yield self._arrived.popleft()

    def finished_one(self) -> None:
        """Allow one more item to be taken from the source."""
        self._room.release()

    def raise_error(self) -> None:
        """Raise what ended the source early, if anything did."""
        if self._error is not None:
            raise self._error

    def close(self) -> None:
        """Take no more."""
        self._closed = True
        self._room.release()
        # The other end stays open as long as the thread, which may just be writing to it.
        self.signal.close()

    def _run(self) -> None:
        try:
            items = iter(self._items)
            while self._room.acquire() and not self._closed:
                try:
                    item = next(items)
                except StopIteration:
                    break
                self._arrived.append(item)
                self._ring()
        except BaseException as error:
            self._error = error
        finally:
            self._ended = True
            self._ring()

    def _ring(self) -> None:
        try:
            self._bell.send_bytes(b"!")
        except OSError:
            # It was closed meanwhile.
            self._closed = True


@contextmanager
def signals_blocked() -> Iterator[None]:
    """Keep Ctrl-C and the like waiting; a thread or process started meanwhile is born deaf to them."""
    if not hasattr(signal, "pthread_sigmask"):
        yield
        return
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT, signal.SIGTERM, signal.SIGHUP})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)
