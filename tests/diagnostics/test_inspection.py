"""What `inspect` shows: the circles found, those refused and why, intervals that hold the circles found."""

from __future__ import annotations

import json

import cv2
import numpy as np
import pytest

from circlepose.diagnostics.inspection import inspect, suggested_intervals
from circlepose.errors import ArgumentError
from circlepose.io.images.reader import read_image
from circlepose.targets.target import AxisIntervals
from circlepose_cli.app import main


@pytest.fixture(scope="module")
def clutter(project_root):
    return read_image(project_root / "sample_images" / "clutter" / "clutter.png")


def test_discs_are_found_and_other_shapes_refused_with_reasons(clutter):
    inspection = inspect(clutter)
    found = inspection.extraction
    assert len(found.contours) == 4
    assert all(0.9 < contour.score <= 1.0 for contour in found.contours)
    assert len(found.refused) == len(found.refused_why) > 0
    assert inspection.image_size == clutter.shape[1::-1]


def test_suggested_intervals_hold_what_was_found(clutter):
    inspection = inspect(clutter)
    again = inspect(clutter, inspection.suggested)
    assert len(again.extraction.contours) == len(inspection.extraction.contours)
    for contour in inspection.extraction.contours:
        assert inspection.suggested.holds_major(2.0 * float(contour.ellipse.semi_major))
        assert inspection.suggested.holds_minor(2.0 * float(contour.ellipse.semi_minor))


def test_suggested_intervals_are_of_the_largest_family():
    image = np.full((400, 600), 200, np.uint8)
    for x in range(100, 600, 100):
        cv2.circle(image, (x, 80), 15, 40, -1, cv2.LINE_AA)
    cv2.circle(image, (300, 260), 100, 40, -1, cv2.LINE_AA)
    contours = inspect(cv2.GaussianBlur(image, (0, 0), 0.8)).extraction.contours
    assert len(contours) == 6
    low, high = suggested_intervals(contours).major_px
    assert 20.0 < low < 30.0 < high < 45.0


def test_nothing_to_suggest_without_circles():
    inspection = inspect(np.full((100, 200), 80, np.uint8))
    assert inspection.extraction.contours == ()
    assert inspection.suggested is None
    with pytest.raises(ArgumentError):
        inspect(np.zeros(5))


def test_rings_are_kept_when_asked_for(project_root):
    image = read_image(project_root / "sample_images" / "coplanar" / "b.png")
    assert len(inspect(image, rings=True).extraction.contours) == 2 * len(inspect(image).extraction.contours)


def test_the_command_prints_what_was_found_and_draws_it(project_root, tmp_path, capsys):
    image = str(project_root / "sample_images" / "clutter" / "clutter.png")
    picture = tmp_path / "seen.png"
    assert main(["inspect", image, "--picture", str(picture)]) == 0
    out = capsys.readouterr().out
    assert "4 found" in out
    assert "rejected:" in out
    assert "suggested: --major-px " in out
    assert cv2.imread(str(picture)).ndim == 3
    assert main(["inspect", image, "--format", "json", "--major-px", "10:20"]) == 0
    record = json.loads(capsys.readouterr().out)
    assert record["found"] == []
    assert record["suggested"] is None
    assert sum(record["rejected"].values()) > 0


def test_the_command_obeys_polarity_and_intervals(project_root, capsys):
    image = str(project_root / "sample_images" / "clutter" / "clutter.png")
    assert main(["inspect", image, "--polarity", "bright", "--format", "json"]) == 0
    assert json.loads(capsys.readouterr().out)["found"] == []
    assert main(["inspect", image, "--major-px", "105:120", "--format", "json"]) == 0
    (found,) = json.loads(capsys.readouterr().out)["found"]
    assert 105.0 <= 2.0 * found["semi_major_px"] <= 120.0
    assert found["inside"] == "darker"
    assert main(["inspect", "nowhere.png"]) == 3


def test_intervals_given_are_the_only_ones(clutter):
    assert inspect(clutter, AxisIntervals(major_px=(10.0, 20.0))).extraction.contours == ()
