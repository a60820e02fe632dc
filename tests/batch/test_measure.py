from __future__ import annotations

import os
import subprocess
import sys
from dataclasses import replace

import cv2
import numpy as np
import pytest

from circlepose import pipeline
from circlepose.batch import measure
from circlepose.batch.measure import MeasureOptions, WorkItem, measure_file, measure_files
from circlepose.batch.workers.pool import Failed, Loss, Lost
from circlepose.camera.camera import Camera
from circlepose.errors import ArgumentError, OutputError
from circlepose.io.tables.json_records import dumps, image_record
from circlepose.results import ImageResult, Status
from circlepose.targets.target import Target
from tests.support.discs import CAMERA, CENTER_MM, RADIUS_MM, write_disc

TARGET = Target.circle(RADIUS_MM)
OPTIONS = MeasureOptions()


def item_for(path, **changes) -> WorkItem:
    return replace(WorkItem(path, path.name, CAMERA, TARGET), **changes)


@pytest.fixture
def item(tmp_path) -> WorkItem:
    return item_for(write_disc(tmp_path / "disc.png"))


def test_a_disc_is_measured(item):
    result = measure_file(item, OPTIONS)
    assert (result.image, result.status, result.image_size) == ("disc.png", Status.OK, (320, 240))
    best = min(np.linalg.norm(c.center - CENTER_MM) for c in result.circles[0].candidates)
    assert best < 1.0


def test_a_file_that_is_no_image_is_a_result(tmp_path):
    path = tmp_path / "note.png"
    path.write_text("no image")
    result = measure_file(item_for(path), OPTIONS)
    assert result.status is Status.NOT_AN_IMAGE
    assert "note.png" not in result.reason
    assert measure_file(item_for(tmp_path / "gone.png"), OPTIONS).status is Status.UNREADABLE


def test_an_overlay_is_written_where_asked(item, tmp_path):
    measure_file(replace(item, overlay=tmp_path / "picture.png"), OPTIONS)
    assert cv2.imread(str(tmp_path / "picture.png")).shape[1] == 1280
    with pytest.raises(OutputError):
        measure_file(replace(item, overlay=tmp_path / "gone" / "picture.png"), OPTIONS)


def test_an_overlay_of_a_resized_image_fits_it(item, tmp_path):
    twice = Camera.create([[800, 0, 319.5], [0, 800, 239.5], [0, 0, 1]], (), (640, 480))
    scaled = replace(item, camera=twice, overlay=tmp_path / "scaled.png")
    plain = replace(item, overlay=tmp_path / "plain.png")
    assert measure_file(scaled, MeasureOptions(scale_calibration=True)).status is Status.OK
    measure_file(plain, OPTIONS)
    pictures = [cv2.imread(str(tmp_path / name)) for name in ("scaled.png", "plain.png")]
    assert np.mean(pictures[0] != pictures[1]) < 0.01


def test_a_bug_is_told_with_the_images_name(item, monkeypatch):
    def broken(*_, **__):
        raise ZeroDivisionError("oh")

    monkeypatch.setattr(pipeline, "estimate", broken)
    with pytest.raises(RuntimeError, match=r"disc\.png: ZeroDivisionError: oh"):
        list(measure_files([item], OPTIONS))
    told = []
    results = list(measure_files([item], OPTIONS, on_bug=lambda name, error: told.append((name, str(error)))))
    assert [(r.status, r.reason) for r in results] == [(Status.INTERNAL_ERROR, "ZeroDivisionError: oh")]
    assert told == [("disc.png", "while measuring disc.png: ZeroDivisionError: oh")]


def test_memory_that_runs_out_costs_the_image(item, monkeypatch):
    def greedy(*_, **__):
        raise cv2.error("Insufficient memory")

    def greedier(*_, **__):
        raise MemoryError

    monkeypatch.setattr(pipeline, "estimate", greedier)
    assert [r.status for r in measure_files([item], OPTIONS)] == [Status.WORKER_DIED]
    monkeypatch.setattr(pipeline, "estimate", greedy)
    monkeypatch.setattr(cv2.error, "code", cv2.Error.StsNoMem, raising=False)
    assert [r.status for r in measure_files([item], OPTIONS)] == [Status.WORKER_DIED]


def test_misuse_is_not_a_bug(item):
    with pytest.raises(ArgumentError, match="method"):
        list(measure_files([item], MeasureOptions(method="guess"), on_bug=lambda *_: None))
    with pytest.raises(ArgumentError, match="jobs"):
        list(measure_files([item], OPTIONS, jobs=0))
    with pytest.raises(ArgumentError, match="timeout_s"):
        list(measure_files([item], OPTIONS, timeout_s=0))


def test_jobs_change_neither_results_nor_their_order(item, tmp_path):
    bad = tmp_path / "bad.png"
    bad.write_bytes(b"")
    known = ImageResult("known.png", Status.NO_CIRCLE, "as before")
    items = [item, item_for(bad), known, *(replace(item, name=f"{i}.png") for i in range(4)), item]
    here, there = (list(measure_files(iter(items), OPTIONS, jobs)) for jobs in (None, 2))
    assert [dumps(image_record(result)) for result in there] == [dumps(image_record(result)) for result in here]
    assert [result.image for result in there] == [getattr(each, "name", "known.png") for each in items]


def test_few_images_start_no_worker(item, monkeypatch):
    monkeypatch.setattr(measure, "run_in_workers", None)
    assert len(list(measure_files([item] * measure.IN_PROCESS_MOST, OPTIONS))) == measure.IN_PROCESS_MOST


@pytest.mark.parametrize(
    ("count", "changes"), [(measure.IN_PROCESS_MOST + 1, {}), (1, {"jobs": 1}), (1, {"timeout_s": 9})]
)
def test_many_images_jobs_and_time_limits_are_for_workers(item, monkeypatch, count, changes):
    def run_in_workers(function, items, *, jobs, timeout_s, window):
        assert (jobs, timeout_s) == (changes.get("jobs", 4), changes.get("timeout_s", measure.DEFAULT_TIMEOUT_S))
        assert window >= 2 * jobs
        return (item.name for item in items)

    monkeypatch.setattr(measure, "run_in_workers", run_in_workers)
    monkeypatch.setattr(measure, "available_cores", lambda: 4)
    assert list(measure_files([item] * count, OPTIONS, **changes)) == [item.name] * count


def test_what_workers_say_becomes_results(item, monkeypatch):
    error = RuntimeError("while measuring disc.png: ValueError: oh")
    outcomes = [Lost(item, Loss.DIED, "killed by SIGKILL"), Lost(item, Loss.TIMED_OUT, ""), Failed(item, error)]
    monkeypatch.setattr(measure, "run_in_workers", lambda *_, **__: (outcome for outcome in outcomes))
    results = list(measure_files([item], OPTIONS, jobs=1, timeout_s=7, on_bug=lambda *_: None))
    assert [(r.image, r.status, r.reason) for r in results] == [
        ("disc.png", Status.WORKER_DIED, "its worker process died twice (killed by SIGKILL)"),
        ("disc.png", Status.TIMED_OUT, "was not measured within 7 s"),
        ("disc.png", Status.INTERNAL_ERROR, "ValueError: oh"),
    ]
    with pytest.raises(RuntimeError, match="oh"):
        list(measure_files([item], OPTIONS, jobs=1))
    outcomes[:] = [Failed(item, OutputError("overlay: is full."))]
    with pytest.raises(OutputError):
        list(measure_files([item], OPTIONS, jobs=1, on_bug=lambda *_: None))


def test_threads_of_opencv_are_as_before(item):
    before = cv2.getNumThreads()
    list(measure_files([item], OPTIONS))
    assert cv2.getNumThreads() == before


def test_cores_are_those_of_the_process():
    assert 1 <= measure.available_cores() <= (os.cpu_count() or 1)


ABANDONED = """
import sys
import circlepose
if __name__ == "__main__":
    camera = circlepose.Camera.create([[900.0, 0.0, 160.0], [0.0, 900.0, 120.0], [0.0, 0.0, 1.0]], (), (320, 240))
    results = circlepose.measure(iter([sys.argv[1]] * 9), camera, circlepose.Target.circle(20.0), jobs=2)
    next(results)
    print("one", flush=True)
"""


def test_a_program_may_end_with_a_run_abandoned_half_way(tmp_path):
    (tmp_path / "abandoned.py").write_text(ABANDONED)
    command = [sys.executable, str(tmp_path / "abandoned.py"), str(tmp_path / "none.png")]
    done = subprocess.run(command, capture_output=True, text=True, timeout=120, check=False)
    assert (done.returncode, done.stdout) == (0, "one\n"), done.stderr


def test_a_time_without_end_is_waited_for(item):
    (result,) = measure_files([item], OPTIONS, jobs=1, timeout_s=1e300)
    assert result.status is Status.OK
