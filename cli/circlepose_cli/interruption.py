"""Ctrl-C, SIGTERM and a terminal that is closed as a clean end: what is measured is written, the rest counted."""

from __future__ import annotations

import signal
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType
from typing import Self

EXIT_CODE = 130
_NAMES = ("SIGINT", "SIGTERM", "SIGHUP")


class Interruption:
    """Notes the first signal; ends a wait with KeyboardInterrupt, but never tears a row that is being written.

    A second signal ends everything at once.
    """

    def __init__(self) -> None:
        self.received = False
        self._waiting = False

    def __enter__(self) -> Self:
        self._before = {}
        for number in (getattr(signal, name) for name in _NAMES if hasattr(signal, name)):
            # nohup has asked for a run that outlives its terminal.
            if not (number.name == "SIGHUP" and signal.getsignal(number) is signal.SIG_IGN):
                self._before[number] = signal.signal(number, self._note)
        return self

    def __exit__(self, *_: object) -> None:
        for number, handler in self._before.items():
            signal.signal(number, handler)

    def _note(self, _number: int, _frame: FrameType | None) -> None:
        again, self.received = self.received, True
        if again or self._waiting:
            raise KeyboardInterrupt

    @contextmanager
    def waiting(self) -> Iterator[None]:
        """Mark work that a signal may end half-way."""
        self._waiting = True
        try:
            if self.received:
                # It came a moment ago, and nothing else would end the wait.
                raise KeyboardInterrupt
            yield
        finally:
            self._waiting = False
