from __future__ import annotations

import io
import os
import threading

import pytest

from circlepose.pose import ImageResult, Status
from circlepose_cli.lines import lines
from circlepose_cli.pace import Pace, duration
from circlepose_cli.progress import Reporter
from discs import made_result


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
        got = lines(stream)
        producer.write(b"a.png\nb.p")
        assert next(got) == b"a.png"
        finish = threading.Timer(0.05, lambda: (producer.write(b"ng\r\n\nlast"), producer.close()))
        finish.start()
        assert list(got) == [b"b.png\r", b"", b"last"]
        finish.join()


def test_lines_of_what_is_no_real_file():
    assert list(lines(io.BytesIO(b"a\nb"))) == [b"a\n", b"b"]
