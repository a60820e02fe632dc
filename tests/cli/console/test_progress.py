from __future__ import annotations

import io
import os
import threading
from contextlib import ExitStack
from dataclasses import replace

import pytest

from circlepose.detection.contour import Rejection
from circlepose.results import Flag, ImageResult, Status
from circlepose.targets.target import Target
from circlepose_cli.console.progress import Pace, Reporter, duration
from circlepose_cli.console.stdin_lines import standard_input
from circlepose_cli.options.declared import StdinChoice
from tests.support.discs import made_circle, made_result


class Clock:
    now = 0.0

    def __call__(self) -> float:
        return self.now


def test_without_a_terminal_a_line_comes_each_half_minute(capsys):
    clock = Clock()
    reporter = Reporter(quiet=False, verbose=False, clock=clock)
    with reporter.running(1000, shows_bar=True):
        for number in range(1, 301):
            clock.now = number / 4
            reporter.count(ImageResult("b.png", Status.NO_CIRCLE) if number == 100 else made_result())
    assert capsys.readouterr().err.splitlines() == [
        "b.png: no_circle",
        "120 of 1000 done, 4.0 a second, 1 failed (no_circle 1), 3 min 40 s left",
        "240 of 1000 done, 4.0 a second, 1 failed (no_circle 1), 3 min 10 s left",
    ]


def test_of_a_stream_neither_total_nor_end_is_known(capsys):
    clock = Clock()
    reporter = Reporter(quiet=False, verbose=False, clock=clock)
    with reporter.running(None, shows_bar=False):
        for number in range(31):
            clock.now = float(number)
            reporter.count(made_result())
    assert capsys.readouterr().err == "31 done, 1.0 a second\n"


def test_quiet_says_nothing(capsys):
    clock = Clock()
    reporter = Reporter(quiet=True, verbose=False, clock=clock)
    with reporter.running(2, shows_bar=True):
        clock.now = 100.0
        reporter.count(ImageResult("b.png", Status.TIMED_OUT))
    reporter.summary(2, interrupted=True, resumable=True)
    assert capsys.readouterr().err == ""
    assert reporter.lost == 1


def test_the_pace_is_that_of_the_last_half_minute():
    pace = Pace(0.0)
    assert (pace.per_second(0.0), pace.left_s(0.0, 10)) == (0.0, None)
    for _ in range(100_000):
        pace.count(0.5)
    for number in range(1, 101):
        pace.count(0.5 + number)
    assert pace.per_second(100.5) == pytest.approx(1.0, rel=0.05)
    assert pace.left_s(100.5, 100_200) == pytest.approx(100.0, rel=0.05)


@pytest.mark.parametrize(
    ("seconds", "text"),
    [(0.2, "0 s"), (59.6, "1 min 0 s"), (3600, "1 h"), (18_725, "5 h 12 min"), (200_000, "2 d 7 h")],
)
def test_durations(seconds, text):
    assert duration(seconds) == text


def test_lines_come_as_soon_as_they_are_there():
    read, write = os.pipe()
    with open(read, "rb") as stream, open(write, "wb", buffering=0) as producer:  # noqa: PTH123
        got = standard_input(stream, StdinChoice.PATHS, ExitStack(), nul=False)
        producer.write(b"a.png\nb.p")
        assert next(got) == b"a.png"
        finish = threading.Timer(0.05, lambda: (producer.write(b"ng\r\n\nlast"), producer.close()))
        finish.start()
        assert list(got) == [b"b.png\r", b"", b"last"]
        finish.join()


def test_lines_of_what_is_no_real_file():
    assert list(standard_input(io.BytesIO(b"a\nb"), StdinChoice.AUTO, ExitStack(), nul=False)) == [b"a", b"b"]
    assert list(standard_input(io.BytesIO(b"a\nb\0c"), StdinChoice.AUTO, ExitStack(), nul=True)) == [b"a\nb", b"c"]


def counted(reporter, **options):
    ambiguous = made_result(replace(made_circle(), flags=(Flag.AMBIGUOUS,)))
    reporter.count(replace(ambiguous, rejected={str(Rejection.BEYOND_COUNT): 11}))
    reporter.count(made_result())
    reporter.summary(2, interrupted=False, resumable=False, **options)


def test_the_closing_lines_name_what_to_type_next(capsys):
    counted(Reporter(quiet=False, verbose=False))
    assert capsys.readouterr().err.splitlines() == [
        "11 more circles were found: --count all measures all",
        "2 measured, 0 failed, 1 ambiguous: either pose may be the right one; give --count all if three or "
        "more circles lie in one plane, or --facing, --normal or --up, or a target of two circles",
    ]


def test_who_gave_a_count_is_not_asked_for_another(capsys):
    counted(Reporter(quiet=False, verbose=False), counted=True)
    assert "--count" not in capsys.readouterr().err


@pytest.mark.parametrize(
    ("target", "said"),
    [
        (Target.circle(20.0, count=2), True),
        (Target.circle(20.0, count=2, same_plane="yes"), False),
        (Target.circle(20.0, count=2, same_plane="no"), False),
        (Target.rings([50.0, 30.0], count=2), False),
    ],
)
def test_a_plane_is_suggested_where_there_are_several_lone_circles_and_nothing_was_said(capsys, target, said):
    reporter = Reporter(quiet=False, verbose=False)
    reporter.expect(target)
    reporter.count(made_result(*(replace(made_circle(i), flags=(Flag.AMBIGUOUS,)) for i in range(2))))
    reporter.summary(1, interrupted=False, resumable=False, counted=True)
    advice = "--coplanar if all circles of an image lie in one plane"
    assert (advice in capsys.readouterr().err) == said
