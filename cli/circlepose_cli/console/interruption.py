"""Ctrl-C, SIGTERM and a terminal that is closed: the program ends with 130, without a traceback, at any instant."""

from __future__ import annotations

import os
import signal
import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from types import FrameType
from typing import Self

EXIT_CODE = 130
_NAMES = ("SIGINT", "SIGTERM", "SIGHUP")


def handle_signals() -> None:
    """Have signals end the process at once, but for unfinished files, which are removed."""
    for number in _numbers():
        signal.signal(number, _end_at_once)


def ignore_signals() -> None:
    """Have signals do nothing any more."""
    for number in _numbers():
        signal.signal(number, signal.SIG_IGN)


def _numbers() -> list[signal.Signals]:
    numbers = [getattr(signal, name) for name in _NAMES if hasattr(signal, name)]
    # nohup has asked for a run that outlives its terminal.
    return [n for n in numbers if not (n.name == "SIGHUP" and signal.getsignal(n) is signal.SIG_IGN)]


def _end_at_once(_number: int, _frame: FrameType | None) -> None:
    # No exception: raised within an import or a callback it would be printed, or swallowed.
    # A module that is not there, or still being imported, has written nothing.
    remove_unfinished = getattr(sys.modules.get("circlepose.io.atomic"), "remove_unfinished", None)
    if remove_unfinished is not None:
        remove_unfinished()
    with suppress(OSError, ValueError):
        show_cursor = b"\x1b[?25h" if os.isatty(2) else b""
        os.write(2, show_cursor + b"circlepose: interrupted\n")
    os._exit(EXIT_CODE)


class Interruption:
    """Notes the first signal; ends a wait with KeyboardInterrupt, but never tears a row that is being written.

    A second signal ends everything at once, and so does one before the first row is waited for.
    """

    def __init__(self) -> None:
        self.received = False
        self._begun = False
        self._waiting = False

    def __enter__(self) -> Self:
        self._before = {number: signal.signal(number, self._note) for number in _numbers()}
        self._unraisable_before = sys.unraisablehook
        sys.unraisablehook = self._unraisable
        return self

    def __exit__(self, *_: object) -> None:
        for number, handler in self._before.items():
            signal.signal(number, handler)
        sys.unraisablehook = self._unraisable_before

    def _note(self, number: int, frame: FrameType | None) -> None:
        if self.received or not self._begun:
            _end_at_once(number, frame)
        self.received = True
        if self._waiting:
            raise KeyboardInterrupt

    def _unraisable(self, unraisable: sys.UnraisableHookArgs) -> None:
        # An interrupt that strikes within a callback (of an import, of a collected object) is lost there.
        # It is noted all the same, and the wait ends with its row.
        if not (self.received and isinstance(unraisable.exc_value, KeyboardInterrupt)):
            self._unraisable_before(unraisable)

    @contextmanager
    def waiting(self) -> Iterator[None]:
        """Mark work that a signal may end half-way."""
        self._waiting = self._begun = True
        try:
            if self.received:
                # It came a moment ago, and nothing else would end the wait.
                raise KeyboardInterrupt
            yield
        finally:
            self._waiting = False
