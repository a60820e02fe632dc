"""What is said on standard error: a bar on a terminal, a line per failed image, a summary."""

from __future__ import annotations

import sys
import time
import traceback
from collections import Counter, deque
from collections.abc import Callable, Generator, Iterable, Iterator
from contextlib import AbstractContextManager, closing, contextmanager
from typing import TYPE_CHECKING

from circlepose.batch.resume import LOST
from circlepose.detection.contour import Rejection
from circlepose.io.text.escaping import printable, redacted
from circlepose.results import Flag, ImageResult, Status
from circlepose.targets.target import Target
from circlepose_cli.console import process
from circlepose_cli.console.board_remarks import BoardTally
from circlepose_cli.console.doubtful_radius import doubt
from circlepose_cli.console.interruption import Interruption
from circlepose_cli.options.parse import with_options_named

if TYPE_CHECKING:
    from rich.progress import Progress, TaskID

_INTERVAL_S = 30.0
_SPAN_S = 30.0
_STEP_S = 1.0


class Pace:
    """Counts what is done; rates are of the last half minute, so that a slow start or a resumed part is forgotten."""

    def __init__(self, now_s: float) -> None:
        self.done = 0
        self._marks: deque[tuple[float, int]] = deque([(now_s, 0)])

    def count(self, now_s: float) -> None:
        """Note that one more is done."""
        self.done += 1
        if now_s - self._marks[-1][0] >= _STEP_S:
            self._marks.append((now_s, self.done))
        while len(self._marks) > 1 and now_s - self._marks[1][0] >= _SPAN_S:
            self._marks.popleft()

    def per_second(self, now_s: float) -> float:
        """Return the rate, 0 where nothing is known."""
        since, done = self._marks[0]
        return (self.done - done) / (now_s - since) if now_s > since else 0.0

    def left_s(self, now_s: float, total: int | None) -> float | None:
        """Return the time that the rest takes, in s, or None where it is not known."""
        rate = self.per_second(now_s)
        return None if total is None or rate == 0.0 else (total - self.done) / rate


def duration(seconds: float) -> str:
    """Return a duration in the two largest units that it has: 45 s, 3 min 20 s, 5 h 12 min, 2 d 3 h."""
    whole = round(seconds)
    units = (("d", whole // 86400), ("h", whole // 3600 % 24), ("min", whole // 60 % 60), ("s", whole % 60))
    first = next((number for number, (_, value) in enumerate(units) if value), len(units) - 1)
    return " ".join(f"{value} {unit}" for unit, value in units[first : first + 2] if value or unit == "s")


class Reporter:
    """Counts results and reports them on standard error."""

    def __init__(self, *, quiet: bool, verbose: bool, clock: Callable[[], float] = time.monotonic) -> None:
        self.measured = 0
        self.bugs = 0
        self._targets = 0
        self._ambiguous = 0
        self._with_several = 0
        self._not_measured = 0
        self._is_radius_doubted = False
        self._is_plane_declared = False
        self._boards = BoardTally()
        self.failures: Counter[str] = Counter()
        self._quiet = quiet
        self._verbose = verbose
        self._clock = clock
        self._total: int | None = None
        self._pace = Pace(clock())
        self._noted_s = clock()
        self._bar: tuple[Progress, TaskID] | None = None

    @property
    def lost(self) -> int:
        """How many images another try may still measure."""
        return sum(self.failures[status] for status in LOST)

    @contextmanager
    def running(self, total: int | None, *, shows_bar: bool) -> Iterator[None]:
        """Show a bar meanwhile, if standard error is a terminal; else a line now and then."""
        self._total = total
        self._pace = Pace(self._clock())
        if self._quiet or not shows_bar or not sys.stderr.isatty():
            yield
            return
        with _new_bar() as bar:
            self._bar = (bar, bar.add_task("measuring", total=total, pace=""))
            try:
                yield
            finally:
                self._bar = None

    def expect(self, target: Target) -> None:
        """Take note of a target: whether there is more to say of a plane of lone circles, and of what boards."""
        if target.layout is not None:
            self._boards.expect(target.layout)
        self._is_plane_declared |= target.kind != "circle" or target.same_plane != "auto"

    def count(self, result: ImageResult) -> None:
        """Take note of one image."""
        status, reason = _outcome(result)
        self._boards.count(result)
        if status is Status.OK:
            self.measured += 1
            targets = {circle.instance for circle in result.circles}
            # What to do about boards is another matter.
            ambiguous = {
                circle.instance for circle in result.circles if Flag.AMBIGUOUS in circle.flags and not result.boards
            }
            self._targets += len(targets)
            self._ambiguous += len(ambiguous)
            self._with_several += bool(ambiguous) and len(targets) > 1
            self._not_measured += result.rejected.get(str(Rejection.BEYOND_COUNT), 0)
        else:
            self.failures[status] += 1
            self.note(f"{result.image}: {reason or status}")
        if not self._is_radius_doubted and (question := doubt(result)) is not None:
            self._is_radius_doubted = True
            self.note(f"{result.image}: {question}")
        if result.remark and status is Status.OK:
            self.note(f"{result.image}: {result.remark}")
        if result.rejected:
            counts = ", ".join(f"{reason} {number}" for reason, number in result.rejected.items())
            self.detail(f"{result.image}: contours not used: {counts}")
        self._show_pace()

    def bug(self, _image: str, error: Exception) -> None:
        """Take note of a bug; the row of its image is counted like all others."""
        self.bugs += 1
        if process.tracebacks_shown():
            for line in "".join(traceback.format_exception(error)).splitlines():
                self.note(line)

    def _show_pace(self) -> None:
        now = self._clock()
        self._pace.count(now)
        if self._bar is not None:
            bar, task = self._bar
            failed = f"failed: {self._kinds()}" if self.failures else ""
            bar.update(task, advance=1, pace=f"{self._pace.per_second(now):.1f}/s  {failed}")
        elif now - self._noted_s >= _INTERVAL_S:
            self._noted_s = now
            self.note(self._pace_line(now))

    def _pace_line(self, now: float) -> str:
        done = str(self._pace.done) if self._total is None else f"{self._pace.done} of {self._total}"
        parts = [f"{done} done", f"{self._pace.per_second(now):.1f} a second"]
        if self.failures:
            parts.append(f"{self.failures.total()} failed ({self._kinds()})")
        left = self._pace.left_s(now, self._total)
        return ", ".join(parts if left is None else [*parts, f"{duration(left)} left"])

    def _kinds(self) -> str:
        return ", ".join(f"{status} {number}" for status, number in self.failures.most_common())

    def note(self, message: str) -> None:
        """Print a line, unless --quiet."""
        if self._quiet:
            return
        shown = printable(redacted(message))
        if self._bar is not None:
            self._bar[0].console.print(shown, markup=False, highlight=False, soft_wrap=True)
        else:
            # One piece, as threads speak here.
            print(f"{shown}\n", end="", file=sys.stderr, flush=True)

    def notes(self, messages: Iterable[str]) -> None:
        """Print a line for each message."""
        for message in messages:
            self.note(message)

    def detail(self, message: str) -> None:
        """Print a line, if --verbose."""
        if self._verbose:
            self.note(message)

    def _how_to_settle(self, *, counted: bool) -> str:
        ways = ["--facing, --normal or --up", "a target of two circles"]
        is_open = not self._is_plane_declared
        if is_open and self._not_measured and not counted:
            ways.insert(0, "--count all if three or more circles lie in one plane")
        elif is_open and self._with_several:
            ways.insert(0, "--coplanar if all circles of an image lie in one plane")
        return f"either pose may be the right one; give {', or '.join(ways)}"

    def summary(
        self,
        total: int | None,
        *,
        interrupted: bool,
        resumable: bool,
        counted: bool = False,
    ) -> None:
        """Say what became of all images, and what to type next.

        `counted` is whether the user said how many circles to measure.
        """
        failed = self.failures.total()
        parts = [f"{self.measured} measured", f"{failed} failed ({self._kinds()})" if failed else "0 failed"]
        if interrupted:
            rest = "the rest" if total is None else str(total - self.measured - failed)
            parts.append(f"interrupted: {rest} not done")
        if self._ambiguous:
            of = f" of {self._targets} targets" if self._targets > self.measured else ""
            how = self._how_to_settle(counted=counted)
            parts.append(f"{self._ambiguous}{of} ambiguous: {how}")
        if self._not_measured and not counted:
            circles = "circle was" if self._not_measured == 1 else "circles were"
            self.note(f"{self._not_measured} more {circles} found: --count all measures all")
        if self._boards.number:
            parts.insert(1, f"{self._boards.number} board{'' if self._boards.number == 1 else 's'}")
        self.notes(self._boards.lines())
        self.note(", ".join(parts))
        if resumable:
            self.note("the same command with --resume measures only what is left")
        elif interrupted:
            self.note("with -o FILE, an interrupted run can be continued with --resume")
        if self.bugs:
            self.note("internal_error is a bug: please report it with the command line and what --verbose shows")


def follow(
    results: Generator[ImageResult, None, None],
    reporter: Reporter,
    bar: AbstractContextManager[None],
    interruption: Interruption,
) -> Generator[ImageResult, None, None]:
    """Pass `results` on, count each and show `bar` meanwhile, until they end or a signal ends them."""
    with bar, closing(results):
        while not interruption.received:
            try:
                with interruption.waiting():
                    result = next(results, None)
            except KeyboardInterrupt:
                return
            if result is None:
                return
            result = with_options_named(result)
            reporter.count(result)
            yield result


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
        TextColumn("{task.fields[pace]}"),
        console=Console(stderr=True),
        transient=True,
        redirect_stdout=False,
        redirect_stderr=False,
    )
