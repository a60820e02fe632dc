from __future__ import annotations

import threading
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

from circlepose.batch import remote_states
from circlepose.batch.measure import WorkItem
from circlepose.batch.remote_states import with_states
from circlepose.io.remote import images
from circlepose.io.remote.images import RemoteFile
from circlepose.targets.target import Target
from tests.support.discs import CAMERA, RADIUS_MM


def item(name: str) -> WorkItem:
    path = RemoteFile(name) if "://" in name else Path(name)
    return WorkItem(path, name, CAMERA, Target.circle(RADIUS_MM))


@pytest.fixture
def slow_server(monkeypatch: pytest.MonkeyPatch) -> list[int]:
    """Takes 0.1 s for an answer; returns how many wait at a time."""
    waiting = [0, 0]
    lock = threading.Lock()

    def info(file: RemoteFile) -> dict[str, object]:
        with lock:
            waiting[0] += 1
            waiting[1] = max(waiting)
        time.sleep(0.1)
        with lock:
            waiting[0] -= 1
        if "gone" in file.url:
            raise FileNotFoundError
        return {"size": 5, "ETag": file.url}

    monkeypatch.setattr(images, "_info", info)
    return waiting


def test_states_are_asked_for_many_at_a_time_and_come_in_order(slow_server: list[int]) -> None:
    names = [f"s3://b/{number}.png" for number in range(100)] + ["a.png", "s3://b/gone.png"]
    found = list(with_states(map(item, names)))
    assert [each.name for each in found] == names
    sizes = [each.path.listed and each.path.listed.st_size for each in found if isinstance(each.path, RemoteFile)]
    assert sizes == [5] * 100 + [None]
    assert 1 < slow_server[1] <= remote_states.REQUESTS


def test_a_silent_source_holds_back_nothing_and_its_error_comes_last(slow_server: list[int]) -> None:
    may_end = threading.Event()

    def source() -> Iterator[WorkItem]:
        yield item("s3://b/1.png")
        yield item("2.png")
        assert may_end.wait(60)
        raise ValueError("the source broke")

    found = with_states(source())
    assert [next(found).name, next(found).name] == ["s3://b/1.png", "2.png"]
    may_end.set()
    with pytest.raises(ValueError, match="the source broke"):
        next(found)


def test_an_endless_source_is_taken_a_little_ahead_and_no_more_once_closed() -> None:
    taken = []

    def source() -> Iterator[WorkItem]:
        for number in range(10**9):
            taken.append(number)
            yield item("a.png")

    found = with_states(source())
    next(found)
    time.sleep(0.2)
    assert len(taken) <= remote_states._AHEAD + 3
    found.close()  # type: ignore[attr-defined]
    time.sleep(0.2)
    before = len(taken)
    time.sleep(0.2)
    assert len(taken) == before
