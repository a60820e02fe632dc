from __future__ import annotations

import os
from contextlib import closing
from dataclasses import replace

import pytest

from circlepose.batch.journal import Journal
from circlepose.batch.measure import MeasureOptions, WorkItem
from circlepose.batch.resume import conditions, journal_path, measure_with_journal
from circlepose.camera.camera import Camera, CameraSigma
from circlepose.errors import UsageError
from circlepose.io.tables.json_records import dumps, image_record
from circlepose.results import ImageResult, Status
from circlepose.targets.target import Target
from tests.support.discs import CAMERA, RADIUS_MM, made_result

TARGET = Target.circle(RADIUS_MM)
OPTIONS = MeasureOptions()


class Run:
    """Runs over files, by a measurement that only notes which files it is given."""

    def __init__(self, folder):
        self.folder = folder
        self.measured = []
        self.warnings = []
        self.status = {}
        self.items = []
        for number in range(5):
            path = folder / f"{number}.png"
            path.write_bytes(b"x" * (number + 1))
            self.items.append(WorkItem(path, path.name, CAMERA, TARGET))

    def measure(self, items):
        for item in items:
            if isinstance(item, ImageResult):
                yield item
                continue
            self.measured.append(item.name)
            status = self.status.get(item.name, Status.OK)
            yield made_result(image=item.name) if status is Status.OK else ImageResult(item.name, status, "oh")

    def go(self, until=None, options=OPTIONS, resume=True):
        """Resume, stop after `until` results, and return them as texts."""
        self.measured.clear()
        path = journal_path(self.folder / "out.csv")
        texts = []
        with (
            Journal(path, conditions(options), resume=resume, output="out.csv") as journal,
            closing(measure_with_journal(self.items, journal, self.measure, self.warnings.append)) as results,
        ):
            for result in results:
                texts.append(dumps(image_record(result)))
                if len(texts) == until:
                    break
        return texts


@pytest.fixture
def run(tmp_path):
    return Run(tmp_path)


@pytest.mark.parametrize("done", range(6))
def test_finished_images_are_not_measured_again_and_all_come_in_order(run, done):
    whole = run.go(resume=False)
    run.go(until=done, resume=False) if done else run.go(until=1, resume=False)
    assert run.go() == whole
    assert run.measured == [f"{number}.png" for number in range(max(done, 1), 5)]


def test_a_changed_image_is_measured_again(run):
    run.go()
    run.items[1].path.write_bytes(b"longer")
    stat = run.items[3].path.stat()
    os.utime(run.items[3].path, ns=(stat.st_atime_ns, stat.st_mtime_ns + 1))
    run.go()
    assert run.measured == ["1.png", "3.png"]
    run.go()
    assert run.measured == []


def test_images_may_come_and_go(run):
    run.go()
    new = replace(run.items[0], name="new.png")
    run.items = [run.items[4], new, run.items[0]]
    assert [text.split('"')[3] for text in run.go()] == ["4.png", "new.png", "0.png"]
    assert run.measured == ["new.png"]


@pytest.mark.parametrize(
    ("what", "change"),
    [
        ("camera", {"camera": Camera.create([[401, 0, 159.5], [0, 400, 119.5], [0, 0, 1]], (), (320, 240))}),
        ("camera", {"camera": replace(CAMERA, sigma=CameraSigma(0.5))}),
        ("target", {"target": Target.circle(RADIUS_MM + 1e-9)}),
    ],
)
def test_another_camera_or_target_is_refused(run, what, change):
    run.go(until=3)
    run.items[2] = replace(run.items[2], **change)
    with pytest.raises(UsageError, match=rf"2\.png was measured with another {what}\. Give the"):
        run.go()
    # The same camera, read again, is no other one.
    run.items[2] = replace(run.items[2], camera=replace(CAMERA), target=Target.circle(RADIUS_MM))
    assert len(run.go()) == 5


def test_other_options_are_refused(run):
    run.go(until=3)
    with pytest.raises(UsageError, match="method was chen-huang and is all"):
        run.go(options=MeasureOptions(method="all"))


def test_what_another_try_may_change_is_tried_again(run):
    run.status = {"0.png": Status.TIMED_OUT, "1.png": Status.WORKER_DIED, "2.png": Status.NO_CIRCLE}
    run.go()
    run.items[4].path.unlink()
    run.go()
    assert run.measured == ["0.png", "1.png", "4.png"]


def test_a_picture_that_is_missing_is_drawn_again(run, tmp_path):
    pictures = [tmp_path / f"picture{number}.png" for number in range(5)]
    run.go()
    run.items = [replace(item, overlay=picture) for item, picture in zip(run.items, pictures, strict=True)]
    for picture in pictures:
        picture.touch()
    run.go()
    assert len(run.measured) == 5
    pictures[2].unlink()
    run.go()
    assert run.measured == ["2.png"]


@pytest.mark.parametrize("spoil", [{"result": 3}, {"result": {"image": "a", "status": "odd"}}, {"size": None}])
def test_an_entry_that_cannot_be_read_is_named_and_its_image_measured_again(run, spoil):
    whole = run.go()
    path = journal_path(run.folder / "out.csv")
    with Journal(path, conditions(OPTIONS), resume=True, output="out.csv") as journal:
        key = f"2.png\0{run.items[2].path}"
        values = journal.find(key)
        values = (
            {name: value for name, value in values.items() if name != "size"} if "size" in spoil else values | spoil
        )
        journal.add(key, values)
    assert run.go() == whole
    assert run.measured == ["2.png"]
    assert len(run.warnings) == 1
    assert "the entry of 2.png cannot be read (" in run.warnings[0]
    assert run.warnings[0].endswith("; the image is measured again.")
