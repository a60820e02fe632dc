"""What is said on standard error: a bar on a terminal, a line per failed image, a summary."""

from __future__ import annotations

import sys
from collections import Counter
from collections.abc import Generator, Iterator
from contextlib import AbstractContextManager, closing, contextmanager
from typing import TYPE_CHECKING

from circlepose.pose import ImageResult, Status
from circlepose_cli.interruption import Interruption

if TYPE_CHECKING:
    from rich.progress import Progress, TaskID


class Reporter:
    """Counts results and tells a person about them."""

    def __init__(self, *, quiet: bool, verbose: bool) -> None:
        self.measured = 0
        self.failures: Counter[str] = Counter()
        self._quiet = quiet
        self._verbose = verbose
        self._bar: tuple[Progress, TaskID] | None = None

    @contextmanager
    def running(self, total: int | None, *, shows_bar: bool) -> Iterator[None]:
        """Show a bar meanwhile, if standard error is a terminal."""
        if self._quiet or not shows_bar or not sys.stderr.isatty():
            yield
            return
        with _new_bar() as bar:
            self._bar = (bar, bar.add_task("measuring", total=total))
            try:
                yield
            finally:
                self._bar = None

    def count(self, result: ImageResult) -> None:
        """Take note of one image."""
        status, reason = _outcome(result)
        if status is Status.OK:
            self.measured += 1
        else:
            self.failures[status] += 1
            self.note(f"{result.image}: {reason or status}")
        if result.rejected:
            counts = ", ".join(f"{reason} {number}" for reason, number in result.rejected.items())
            self.detail(f"{result.image}: contours not used: {counts}")
        if self._bar is not None:
            bar, task = self._bar
            bar.advance(task)

    def note(self, message: str) -> None:
        """Say something, unless told to be quiet."""
        if self._quiet:
            return
        shown = printable(message)
        if self._bar is not None:
            self._bar[0].console.print(shown, markup=False, highlight=False, soft_wrap=True)
        else:
            print(shown, file=sys.stderr, flush=True)

    def detail(self, message: str) -> None:
        """Say something, if told to be verbose."""
        if self._verbose:
            self.note(message)

    def summary(self, total: int | None, *, interrupted: bool) -> None:
        """Say what became of all images."""
        failed = self.failures.total()
        kinds = ", ".join(f"{status} {number}" for status, number in self.failures.most_common())
        parts = [f"{self.measured} measured", f"{failed} failed ({kinds})" if failed else "0 failed"]
        if interrupted:
            rest = "the rest" if total is None else str(total - self.measured - failed)
            parts.append(f"interrupted: {rest} not done")
        self.note(", ".join(parts))


def follow(
    results: Generator[ImageResult, None, None],
    reporter: Reporter,
    bar: AbstractContextManager[None],
    interruption: Interruption,
) -> Iterator[ImageResult]:
    """Pass `results` on, telling of each and showing `bar` meanwhile, until they end or a signal ends them."""
    with bar, closing(results):
        while not interruption.received:
            try:
                with interruption.waiting():
                    result = next(results, None)
            except KeyboardInterrupt:
                return
            if result is None:
                return
            reporter.count(result)
            yield result


def printable(message: str) -> str:
    """Return `message` without what would steer a terminal, or break a line, or be no text."""
    return "".join(c if c.isprintable() else c.encode("unicode_escape").decode() for c in message)


def _outcome(result: ImageResult) -> tuple[Status, str]:
    """Return the first status that is not ok, of the image or of a circle in it, and its reason."""
    if result.status is not Status.OK:
        return result.status, result.reason
    for circle in result.circles:
        if circle.status is not Status.OK:
            return circle.status, f"{circle.circle} {circle.instance}: {circle.reason or circle.status}"
    return Status.OK, ""


def _new_bar() -> Progress:
    from rich.console import Console  # noqa: PLC0415 - only where there is a terminal
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn  # noqa: PLC0415

    return Progress(
        TextColumn("{task.description}"),
        BarColumn(),
        MofNCompleteColumn(),
        TimeRemainingColumn(),
        console=Console(stderr=True),
        transient=True,
        redirect_stdout=False,
        redirect_stderr=False,
    )
