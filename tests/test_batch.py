from __future__ import annotations

import os
from dataclasses import replace

import cv2
import numpy as np
import pytest

from circlepose import pipeline
from circlepose.batch import local
from circlepose.batch.local import MeasureOptions, WorkItem, measure_file, measure_files
from circlepose.camera import Camera
from circlepose.errors import ArgumentError, OutputError
from circlepose.files.records import dumps, image_record
from circlepose.pose import Status
from circlepose.target import Target
from discs import CAMERA, CENTER_MM, RADIUS_MM, write_disc

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
        list(measure_files([item], OPTIONS, jobs=1))


def test_misuse_is_not_a_bug(item):
    with pytest.raises(ArgumentError, match="method"):
        list(measure_files([item], MeasureOptions(method="guess"), jobs=1))
    with pytest.raises(ArgumentError, match="jobs"):
        list(measure_files([item], OPTIONS, jobs=0))


def test_jobs_change_neither_results_nor_their_order(item, tmp_path):
    bad = tmp_path / "bad.png"
    bad.write_bytes(b"")
    items = [item, item_for(bad), *(replace(item, name=f"{i}.png") for i in range(7))]
    texts = [[dumps(image_record(result)) for result in measure_files(iter(items), OPTIONS, jobs)] for jobs in (1, 2)]
    assert texts[0] == texts[1]
    assert [text.split('"')[3] for text in texts[0]] == [each.name for each in items]


def test_items_are_taken_only_as_they_are_needed(item):
    taken = []

    def stream():
        for number in range(1000):
            taken.append(number)
            yield item

    results = measure_files(stream(), OPTIONS, jobs=1)
    next(results)
    assert len(taken) == 1
    results.close()


def test_few_images_start_no_worker(item, monkeypatch):
    monkeypatch.setattr(local, "ProcessPoolExecutor", None)
    monkeypatch.setattr(local, "available_cores", lambda: 4)
    assert len(list(measure_files([item] * local.IN_PROCESS_FIRST, OPTIONS))) == local.IN_PROCESS_FIRST


class FakePool:
    """Stands in for the pool: measures at once, and counts what is in flight."""

    def __init__(self, *_, **__):
        self.submitted = 0

    def submit(self, function, *arguments):
        self.submitted += 1
        future = local.Future()
        future.set_result(function(*arguments))
        return future

    def shutdown(self, **_):
        pass


def test_what_is_in_flight_is_bounded(item, monkeypatch):
    pool = FakePool()
    monkeypatch.setattr(local, "ProcessPoolExecutor", lambda *_, **__: pool)
    monkeypatch.setattr(local, "measure_file", lambda item, options: item.name)
    results = measure_files(iter([item] * 1000), OPTIONS, jobs=2)
    for done in range(1, 11):
        next(results)
        assert pool.submitted <= done + 2 * local.IN_FLIGHT_PER_JOB
    assert len(list(results)) == 990


def test_threads_of_opencv_are_as_before(item):
    before = cv2.getNumThreads()
    list(measure_files([item], OPTIONS, jobs=1))
    assert cv2.getNumThreads() == before


def test_cores_are_those_of_the_process():
    assert 1 <= local.available_cores() <= (os.cpu_count() or 1)
