"""Ctrl-C and SIGTERM as a clean end: what is measured is written, the rest is counted."""

from __future__ import annotations

import signal
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType
from typing import Self

EXIT_CODE = 130
_SIGNALS = (signal.SIGINT, signal.SIGTERM)


class Interruption:
    """Notes the first signal; ends a wait with KeyboardInterrupt, but never tears a row that is being written.

    A second signal ends everything at once.
    """

    def __init__(self) -> None:
        self.received = False
        self._waiting = False

    def __enter__(self) -> Self:
        self._before = [signal.signal(number, self._note) for number in _SIGNALS]
        return self

    def __exit__(self, *_: object) -> None:
        for number, handler in zip(_SIGNALS, self._before, strict=True):
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
            yield
        finally:
            self._waiting = False
