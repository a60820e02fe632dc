from __future__ import annotations

import multiprocessing
import threading
import time
from contextlib import closing

import pytest

from circlepose.batch.workers import pool
from circlepose.batch.workers.feed import Feed
from circlepose.batch.workers.pool import Failed, Known, Loss, Lost, run_in_workers
from tests.support.faulty import UnsendableError, Unwelcome, act


def outcomes(items, **changes):
    settings = {"jobs": 2, "timeout_s": 60.0, "window": 16} | changes
    return run_in_workers(act, items, **settings)


def test_whatever_becomes_of_workers_each_item_has_its_outcome_in_its_place(tmp_path):
    marker = tmp_path / "died"
    tasks = [
        ("echo", None),
        ("sleep", 0.3),
        ("exit", 2),
        ("echo", 3),
        Known("known"),
        ("kill once", str(marker)),
        ("raise", "oh"),
        ("memory", 7),
        ("raise unsendable", "error"),
        ("sleep", 30),
        ("kill", 10),
        *(("echo", number) for number in range(11, 30)),
    ]
    results = list(outcomes(iter(tasks), timeout_s=1.5))
    assert len(results) == len(tasks)
    for number, (task, result) in enumerate(zip(tasks, results, strict=True)):
        if isinstance(result, (Lost, Failed)):
            assert result.item == task
        elif isinstance(task, Known):
            assert result == task.result
        else:
            assert (number, result) == (number, task[1])
    lost = {n: (r.loss, r.detail) for n, r in enumerate(results) if isinstance(r, Lost)}
    assert lost == {
        2: (Loss.DIED, "exit code 3"),
        7: (Loss.DIED, "memory ran out"),
        9: (Loss.TIMED_OUT, ""),
        10: (Loss.DIED, "killed by SIGKILL"),
    }
    failed = {n: r.error for n, r in enumerate(results) if isinstance(r, Failed)}
    assert {n: (type(e), str(e)) for n, e in failed.items()} == {
        6: (ValueError, "oh"),
        8: (RuntimeError, f"{UnsendableError.__name__}: odd error"),
    }
    assert all("faulty.py" in error.__notes__[0] for error in failed.values())
    assert marker.exists()
    assert not multiprocessing.active_children()


def test_a_silent_source_holds_back_nothing_and_its_error_comes_last():
    may_end = threading.Event()

    def source():
        yield ("sleep", 0.2)
        yield ("echo", 2)
        assert may_end.wait(60)
        raise ValueError("the source broke")

    with closing(outcomes(source())) as results:
        assert [next(results), next(results)] == [0.2, 2]
        may_end.set()
        with pytest.raises(ValueError, match="the source broke"):
            next(results)


def test_an_abandoned_run_leaves_no_process_and_takes_no_more():
    taken = []

    def source():
        for number in range(1000):
            taken.append(number)
            yield ("echo", number)

    with closing(outcomes(source(), window=5)) as results:
        assert [next(results) for _ in range(3)] == [0, 1, 2]
        assert len(taken) <= 3 + 5
    assert not multiprocessing.active_children()
    assert len(taken) <= 3 + 5 + 1


def test_what_is_known_starts_no_worker(monkeypatch):
    monkeypatch.setattr(pool.Pool, "_start_worker", None)
    assert list(outcomes(Known(number) for number in range(100))) == list(range(100))


def test_a_source_that_ends_just_after_it_was_asked_is_not_waited_for(monkeypatch):
    ended = Feed.ended.fget
    got = []
    may_end = threading.Event()

    def source():
        yield Known(1)
        may_end.wait(60)

    def outdated(feed):
        answer = ended(feed)
        if got:
            may_end.set()
            while not feed._ended:
                time.sleep(0.001)
        return answer

    monkeypatch.setattr(Feed, "ended", property(outdated))
    thread = threading.Thread(target=lambda: [got.append(each) for each in outcomes(source())], daemon=True)
    thread.start()
    thread.join(30)
    assert got == [1]
    assert not thread.is_alive()


def test_workers_that_never_begin_end_the_run():
    with pytest.raises(RuntimeError, match=r"before they are ready to work \(exit code 7\)"):
        list(run_in_workers(Unwelcome(), [("echo", 1)], jobs=1, timeout_s=60.0, window=4))


def test_a_feed_takes_no_more_than_its_window_ahead():
    taken = []

    def source():
        for number in range(100):
            taken.append(number)
            yield number

    feed = Feed(source(), window=3)
    got = []
    for number in range(20):
        while number not in got:
            assert feed.signal.poll(60)
            got += feed.take()
        assert len(taken) <= number + 3
        feed.finished_one()
    assert got[:20] == list(range(20))
    assert not feed.ended
    feed.close()
