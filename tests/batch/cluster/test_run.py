"""What a run does about each event of a cluster; the cluster is played here, and dask is not needed."""

from __future__ import annotations

import json
import pickle
from collections import deque
from collections.abc import Callable, Iterator
from multiprocessing import Pipe
from pathlib import Path
from typing import Any

import pytest

from circlepose.batch.cluster import run as cluster
from circlepose.batch.cluster.events import Began, Broken, Done, Dropped, Ended, Event, WorkersDied
from circlepose.batch.measure import MeasureOptions, WorkItem
from circlepose.errors import CircleposeError, UsageError
from circlepose.io.tables.lossless import plain_result
from circlepose.results import ImageResult, Status
from circlepose.targets.target import Target
from tests.support.discs import CAMERA, RADIUS_MM, made_result

WORKER = "tcp://w:1"


class Played:
    """A cluster of one thread that answers each chunk, in the order handed out, as `play` says."""

    def __init__(self, play: Callable[[Played, int, list[str]], list[Event]]) -> None:
        self.play = play
        self.threads = {WORKER: 1}
        self.bell, self._ringer = Pipe(duplex=False)
        self.is_lost = False
        self.is_closed = False
        self.handed: dict[int, list[str]] = {}
        self.wanted: set[int] = set()
        self.history: list[tuple[list[str], str | None]] = []
        self.refused: list[str] = []
        self._events: deque[Event] = deque()

    def submit(self, number: int, _function: object, _expected: object, packed: bytes, avoid: str | None) -> None:
        items, _, _, _ = pickle.loads(packed)
        assert all(item.path.is_absolute() for item in items)
        assert number not in self.handed
        self.handed[number] = [item.name for item in items]
        self.wanted.add(number)
        self.history.append((self.handed[number], avoid))
        self._events += self.play(self, number, self.handed[number])
        self._ringer.send_bytes(b"!")

    def forget(self, number: int) -> None:
        self.wanted.discard(number)

    def events(self) -> Iterator[Event]:
        while self.bell.poll():
            self.bell.recv_bytes()
        while self._events:
            event = self._events.popleft()
            if event.number in self.wanted:
                if isinstance(event, Done | WorkersDied | Broken):
                    self.wanted.discard(event.number)
                yield event

    def look(self) -> None:
        pass

    def reconnect(self) -> None:
        self.is_lost = False
        self.wanted.clear()
        self._events.clear()

    def refuse(self, worker: str, _how: str) -> None:
        self.refused.append(worker)

    def close(self) -> None:
        self.is_closed = True


def answer(number: int, *outcomes: object) -> Done:
    return Done(number, json.dumps({"worker": WORKER, "outcomes": outcomes}).encode())


def measured(name: str) -> dict[str, object]:
    return {"result": plain_result(made_result(image=name))}


def fine(number: int, names: list[str]) -> Done:
    return answer(number, *(measured(name) for name in names))


def run(
    monkeypatch: pytest.MonkeyPatch,
    play: Callable[[Played, int, list[str]], list[Event]],
    names: str = "abcdefgh",
    **options: Any,
) -> tuple[dict[str, tuple[Status, str]], Played]:
    played = Played(play)
    monkeypatch.setattr(cluster, "Connection", lambda *_: played)
    items = [WorkItem(Path(name), name, CAMERA, Target.circle(RADIUS_MM)) for name in names]
    results = list(cluster.measure_on_cluster(items, MeasureOptions(), "tcp://s:1", **options))
    assert [result.image for result in results] == list(names)
    assert played.is_closed
    return {result.image: (result.status, result.reason) for result in results}, played


def statuses(found: dict[str, tuple[Status, str]]) -> dict[str, Status]:
    return {name: status for name, (status, _) in found.items() if status is not Status.OK}


def test_chunks_keep_the_order_and_pass_known_results_on(monkeypatch: pytest.MonkeyPatch) -> None:
    played = Played(lambda _, number, names: [Began(number), Ended(number), fine(number, names)])
    monkeypatch.setattr(cluster, "Connection", lambda *_: played)
    items = [
        ImageResult(f"{n}", Status.NO_CIRCLE)
        if n % 7 == 3
        else WorkItem(Path("a"), f"{n}", CAMERA, Target.circle(9.0))
        for n in range(500)
    ]
    results = cluster.measure_on_cluster(items, MeasureOptions(), "tcp://s:1")
    assert [result.image for result in results] == [f"{n}" for n in range(500)]
    assert max(len(names) for names, _ in played.history) <= cluster.CHUNK_MOST


@pytest.mark.parametrize("told", [True, False])
def test_the_image_that_workers_die_of_is_given_up_and_no_other(monkeypatch: pytest.MonkeyPatch, told: bool) -> None:
    """By events of workers that begin what another had begun, or by what the scheduler says at last."""

    def play(_: Played, number: int, names: list[str]) -> list[Event]:
        if "d" not in names:
            return [Began(number), Ended(number), fine(number, names)]
        return [Began(number), Began(number), Began(number)] if told else [WorkersDied(number)]

    found, played = run(monkeypatch, play)
    reason = "its worker process died twice (a worker of the cluster was lost with it)"
    assert {name: each for name, each in found.items() if each[0] is not Status.OK} == {
        "d": (Status.WORKER_DIED, reason)
    }
    assert (["d"], None) in played.history


def test_a_worker_that_is_lost_once_costs_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    lost: list[int] = []

    def play(_: Played, number: int, names: list[str]) -> list[Event]:
        if len(lost) < 2:
            lost.append(number)
            # A lone image the scheduler has tried again by itself, when that is told.
            return [Began(number), Began(number), Ended(number), fine(number, names)]
        return [Began(number), Ended(number), fine(number, names)]

    assert not statuses(run(monkeypatch, play)[0])
    lost.clear()
    assert not statuses(run(monkeypatch, play, names="a")[0])


def test_an_answer_that_is_lost_with_its_worker_is_no_death(monkeypatch: pytest.MonkeyPatch) -> None:
    def play(_: Played, number: int, names: list[str]) -> list[Event]:
        again = [Began(number), Ended(number)] * 5
        return [*again, fine(number, names)]

    assert not statuses(run(monkeypatch, play)[0])


def test_an_image_that_its_process_dies_of_is_tried_once_more_elsewhere(monkeypatch: pytest.MonkeyPatch) -> None:
    def play(_: Played, number: int, names: list[str]) -> list[Event]:
        died = {"died": "killed by SIGKILL"}
        return [answer(number, *(died if n == "b" else measured(n) for n in names))]

    found, played = run(monkeypatch, play)
    assert found["b"] == (Status.WORKER_DIED, "its worker process died twice (killed by SIGKILL)")
    assert len(statuses(found)) == 1
    assert (["b"], WORKER) in played.history
    assert sum("b" in names for names, _ in played.history) == 2


def test_time_that_is_over_and_bugs_are_rows(monkeypatch: pytest.MonkeyPatch) -> None:
    outcomes = {"a": {"timed_out": True}, "b": {"bug": "while measuring b: ValueError: oh", "notes": ["a note"]}}
    told: list[tuple[str, list[str]]] = []

    def play(_: Played, number: int, names: list[str]) -> list[Event]:
        return [answer(number, *(outcomes.get(n, measured(n)) for n in names))]

    found, _ = run(monkeypatch, play, timeout_s=7.0, on_bug=lambda name, error: told.append((name, error.__notes__)))
    assert found["a"] == (Status.TIMED_OUT, "was not measured within 7 s")
    assert found["b"] == (Status.INTERNAL_ERROR, "ValueError: oh")
    assert told == [("b", ["a note"])]
    outcomes["b"] = {"misuse": "overlay: is full.", "notes": []}
    with pytest.raises(CircleposeError, match="is full"):
        run(monkeypatch, play, on_bug=lambda *_: None)


def test_what_was_dropped_or_never_begun_is_handed_out_again(monkeypatch: pytest.MonkeyPatch) -> None:
    def play(played: Played, number: int, names: list[str]) -> list[Event]:
        tries = sum(names == before for before, _ in played.history)
        return [Dropped(number) if tries == 1 else Broken(number, "oh") if tries < 5 else fine(number, names)]

    assert not statuses(run(monkeypatch, play)[0])
    with pytest.raises(UsageError, match=r"the workers cannot begin \(oh\)"):
        run(monkeypatch, lambda _, number, __: [Broken(number, "oh")])


def test_a_scheduler_that_was_restarted_is_given_everything_again(monkeypatch: pytest.MonkeyPatch) -> None:
    def play(played: Played, number: int, names: list[str]) -> list[Event]:
        if len(played.history) == 2:
            played.is_lost = True
        return [] if played.is_lost else [fine(number, names)]

    assert not statuses(run(monkeypatch, play)[0])


def test_a_worker_that_refuses_is_told_and_others_have_its_images(monkeypatch: pytest.MonkeyPatch) -> None:
    def play(played: Played, number: int, names: list[str]) -> list[Event]:
        if played.refused:
            return [fine(number, names)]
        return [Done(number, json.dumps({"worker": WORKER, "refused": "numpy 1 (here 2)"}).encode())]

    found, played = run(monkeypatch, play, names="a")
    assert not statuses(found)
    assert played.refused == [WORKER]
