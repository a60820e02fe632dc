from __future__ import annotations

import io
import json
import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from circlepose import pipeline
from circlepose.io.tables import LAYOUTS
from circlepose.io.tables.lossless import plain_result, restored_result
from circlepose.io.tables.paper_layouts import write_results
from circlepose.results import Candidate, ImageResult, Status
from circlepose.targets.target import Target
from tests.support.discs import CAMERA, RADIUS_MM, disc_image, made_circle, made_result


def stored(result: ImageResult) -> ImageResult:
    return restored_result(json.loads(json.dumps(plain_result(result))))


def texts(*results: ImageResult) -> list[str]:
    """All that can be written of results."""
    written = []
    for data_format in ("csv", "json", "jsonl"):
        for layout in LAYOUTS:
            handle = io.StringIO()
            write_results(results, handle, data_format=data_format, layout=layout)
            written.append(handle.getvalue())
    return written


@pytest.mark.parametrize("method", ["chen-huang", "all"])
def test_a_measured_result_is_written_the_same(method):
    result = pipeline.estimate(disc_image(), CAMERA, Target.circle(RADIUS_MM), method=method, name="a.png")
    assert result.status is Status.OK
    assert texts(stored(result)) == texts(result)
    assert stored(result).rejected == result.rejected


def test_results_without_a_pose_are_written_the_same():
    results = [
        ImageResult("caf\udce9.png", Status.UNREADABLE, "there is no such file"),
        ImageResult("", Status.NO_CIRCLE, "nothing\nthere", image_size=(3, 2), rejected={"small": 3}),
        made_result(made_circle(), replace(made_circle(1), candidates=(), status=Status.NO_POSE, reason="none")),
    ]
    assert texts(*map(stored, results)) == texts(*results)
    assert [stored(each).image_size for each in results] == [None, (3, 2), (320, 240)]


FINITE = st.floats(allow_nan=False, allow_infinity=False)


@given(st.lists(FINITE, min_size=5, max_size=5), st.integers(0, 999), st.floats(0.0, 1e300))
def test_numbers_are_kept_to_the_last_bit(values, seed, residual):
    normal = np.random.default_rng(seed).normal(size=3)
    center = np.array(values[:3])
    assume(np.abs(center).max() < 1e150)
    normal *= -1.0 if normal @ center > 0.0 else 1.0
    candidate = Candidate(center, normal / np.linalg.norm(normal), np.array(values[3:]))
    result = made_result(replace(made_circle(), candidates=(candidate,), residual_px=residual))
    circle = stored(result).circles[0]
    for name in ("center", "normal", "imaged_center"):
        before, after = getattr(candidate, name), getattr(circle.candidates[0], name)
        assert np.array_equal(before.view(np.int64), after.view(np.int64))
    assert np.array_equal(circle.residual_px, residual, equal_nan=True)


def test_contours_are_left_out_and_all_else_is_kept():
    circle = made_circle(covariance=np.eye(5))
    after = stored(made_result(circle)).circles[0]
    assert after.contour is None
    assert after.flags == circle.flags
    assert after.cone is circle.cone
    assert np.array_equal(after.candidates[0].covariance, np.eye(5))


@pytest.mark.parametrize("plain", [None, 3, [], {"image": "a", "status": "odd"}, {"images": "a"}, {"circles": 3}])
def test_what_is_no_stored_result_is_refused(plain):
    with pytest.raises(ValueError, match=r"stored result|Status"):
        restored_result(plain)


@pytest.mark.parametrize(
    ("path", "value"),
    [
        ("chosen", 7),
        ("chosen", -1),
        ("chosen", True),
        ("chosen", 0.0),
        ("ambiguity", 1.5),
        ("ambiguity", "0.5"),
        ("radius_mm", -3.0),
        ("radius_mm", None),
        ("method", 3),
        ("instance", "0"),
        ("flags", ["odd"]),
        ("flags", "ambiguous"),
        ("status", None),
        ("candidates", [3]),
        ("candidates", {}),
        ("candidates.0.center", [1.0, 2.0]),
        ("candidates.0.center", [math.nan, 0.0, 1.0]),
        ("candidates.0.center", [math.inf, 0.0, 1.0]),
        ("candidates.0.center", ["1", "2", "x"]),
        ("candidates.0.center", None),
        ("candidates.0.normal", [0.0, 0.0, -2.0]),
        ("candidates.0.normal", [[0.0, 0.0, -1.0]]),
        ("candidates.0.imaged_center", [1.0]),
        ("candidates.0.covariance", [[1.0]]),
        ("candidates.0.generatrix_mm", "3"),
        ("candidates.0.odd", 1),
    ],
)
def test_values_that_cannot_be_are_refused(path, value):
    plain = json.loads(json.dumps(plain_result(made_result())))
    *way, last = path.split(".")
    place = plain["circles"][0]
    for key in way:
        place = place[int(key) if key.isdigit() else key]
    place[last] = value
    with pytest.raises(ValueError, match=r".*"):
        restored_result(plain)


@pytest.mark.parametrize(
    ("key", "value"), [("image_size", [3]), ("rejected", 3), ("rejected", {"a": "b"}), ("image", 3)]
)
def test_values_of_an_image_that_cannot_be_are_refused(key, value):
    plain = json.loads(json.dumps(plain_result(made_result())))
    with pytest.raises(ValueError, match=r".*"):
        restored_result(plain | {key: value})
