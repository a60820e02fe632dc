"""How round is round: `min_score` and `max_residual_px`."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

import circlepose
from circlepose.batch.files import measure
from circlepose.batch.measure import MeasureOptions
from circlepose.batch.resume import conditions
from circlepose.detection.contour import Rejection
from circlepose.detection.options import DEFAULT, DetectionOptions
from circlepose.errors import ArgumentError
from circlepose.measurement.options import MeasurementOptions
from circlepose.pipeline import EstimateOptions
from circlepose.results import Flag, Status
from circlepose.targets.target import Target
from tests.support.discs import CAMERA, RADIUS_MM

ANY = Target.circle(RADIUS_MM, count=None)
LEAST = DetectionOptions().least_score


def shape(wave_px: float, waves: int, center: tuple[float, float], radius: float = 40.0) -> np.ndarray:
    """The outline (n, 2) px of something round that is wavy."""
    turn = np.linspace(0.0, 2.0 * np.pi, 720, endpoint=False)
    distance = radius + wave_px * np.sin(waves * turn)
    return np.stack([center[0] + distance * np.cos(turn), center[1] + distance * np.sin(turn)], axis=-1)


def image_of(*outlines: np.ndarray) -> np.ndarray:
    large = np.full((960, 1280), 200, np.uint8)
    for outline in outlines:
        cv2.fillPoly(large, [np.round((4.0 * outline + 1.5) * 16).astype(np.int32)], 40, shift=4)
    small = cv2.GaussianBlur(cv2.resize(large, (320, 240), interpolation=cv2.INTER_AREA), (0, 0), 0.7)
    return np.clip(small + np.random.default_rng(0).normal(0.0, 1.0, small.shape), 0, 255).astype(np.uint8)


@pytest.fixture(scope="module")
def image() -> np.ndarray:
    """A circle on the left, and on the right something 0.28 px rms from one."""
    return image_of(shape(0.0, 7, (90.0, 120.0)), shape(0.4, 7, (230.0, 120.0)))


def dots(radius_px: float, number: int = 17) -> np.ndarray:
    centers = [(25.0 + 52.0 * (i % 6), 40.0 + 70.0 * (i // 6)) for i in range(number)]
    return image_of(*(shape(0.0, 1, center, radius_px) for center in centers))


def test_rims_beyond_the_residual_are_left_out_with_the_reason(image):
    every = circlepose.estimate(image, CAMERA, ANY)
    assert len(every.circles) == 2
    even, uneven = sorted(circle.residual_px for circle in every.circles)
    bounded = circlepose.estimate(image, CAMERA, ANY, max_residual_px=(even + uneven) / 2.0)
    assert [circle.residual_px for circle in bounded.circles] == [even]
    assert bounded.rejected[str(Rejection.RESIDUAL)] == 1
    assert [circle.instance for circle in bounded.circles] == [0]
    none = circlepose.estimate(image, CAMERA, ANY, max_residual_px=even / 2.0)
    assert none.status is Status.NO_CIRCLE
    assert "--max-residual-px" in none.reason


def test_a_rim_that_is_left_out_does_not_use_up_the_count():
    large = shape(0.4, 7, (210.0, 120.0), 90.0)
    image = image_of(large, shape(0.0, 7, (60.0, 120.0), 40.0))
    one = Target.circle(RADIUS_MM)
    (first,) = circlepose.estimate(image, CAMERA, one).circles
    (second,) = circlepose.estimate(image, CAMERA, one, max_residual_px=0.15).circles
    assert float(first.ellipse.semi_major) > 80.0
    assert float(second.ellipse.semi_major) < 50.0


def test_the_least_score_is_what_it_says(image):
    scores = sorted(circle.score for circle in circlepose.estimate(image, CAMERA, ANY).circles)
    assert all(score >= LEAST for score in scores)
    sure = circlepose.estimate(image, CAMERA, ANY, min_score=(scores[0] + scores[1]) / 2.0)
    assert [circle.score for circle in sure.circles] == scores[1:]
    assert not circlepose.estimate(image, CAMERA, ANY, min_score=1.0).circles


def test_a_lower_least_score_takes_doubtful_circles_and_flags_them(image):
    low, high = sorted(circle.score for circle in circlepose.estimate(image, CAMERA, ANY).circles)
    strict = EstimateOptions(MeasurementOptions(detection=DetectionOptions(least_score=(low + high) / 2.0)))
    (sure,) = circlepose.estimate(image, CAMERA, ANY, options=strict).circles
    assert (sure.score, Flag.DOUBTFUL in sure.flags) == (high, False)
    asked = circlepose.estimate(image, CAMERA, ANY, options=strict, min_score=0.9 * low).circles
    assert {circle.score: Flag.DOUBTFUL in circle.flags for circle in asked} == {low: True, high: False}


@pytest.mark.parametrize("score", [0.0, 0.1, 0.2, 0.5, 1.0])
def test_what_is_found_grows_as_the_least_score_falls(score):
    rough = image_of(shape(0.0, 1, (90.0, 120.0)), shape(0.9, 6, (230.0, 120.0), 14.0))
    found = circlepose.estimate(rough, CAMERA, ANY, min_score=score).circles
    assert all(circle.score >= score for circle in found)
    assert len(found) >= len(circlepose.estimate(rough, CAMERA, ANY, min_score=min(score + 0.3, 1.0)).circles)


def test_the_default_bounds_change_nothing(image):
    assert DEFAULT.with_least_score(None) is DEFAULT
    plain = circlepose.estimate(image, CAMERA, ANY)
    bounded = circlepose.estimate(image, CAMERA, ANY, min_score=LEAST, max_residual_px=100.0)
    assert [c.pose.center.tolist() for c in plain.circles] == [c.pose.center.tolist() for c in bounded.circles]
    assert [c.flags for c in plain.circles] == [c.flags for c in bounded.circles]


def test_a_resumed_run_sees_that_the_bounds_changed():
    before = conditions(MeasureOptions())
    for changed in ({"min_score": 0.2}, {"max_residual_px": 0.2}):
        after = conditions(MeasureOptions(**changed))
        assert [name for name in after if after[name] != before[name]] == list(changed)


def test_explain_inspect_and_batches_have_them(image, tmp_path):
    cv2.imwrite(str(tmp_path / "a.png"), image)
    assert len(circlepose.explain(image, CAMERA, ANY, max_residual_px=0.15).circles) == 1
    assert len(next(measure(tmp_path / "a.png", CAMERA, ANY, max_residual_px=0.15)).circles) == 1
    found = circlepose.inspect(image, max_residual_px=0.15).extraction
    assert len(found.contours) == 1
    assert Rejection.RESIDUAL in found.refused_why
    assert len(found.refused) == len(found.refused_why)
    assert not circlepose.inspect(image, min_score=1.0).extraction.contours


@pytest.mark.parametrize(
    "bad",
    [
        {"min_score": -0.1},
        {"min_score": 1.1},
        {"min_score": "0.2"},
        {"max_residual_px": 0.0},
        {"max_residual_px": float("nan")},
    ],
    ids=str,
)
def test_other_bounds_are_refused_by_name(image, bad):
    (name,) = bad
    for call in (circlepose.estimate, circlepose.explain):
        with pytest.raises(ArgumentError, match=f"^{name}: expected"):
            call(image, CAMERA, ANY, **bad)
    with pytest.raises(ArgumentError, match=f"^{name}: expected"):
        circlepose.inspect(image, **bad)


@pytest.mark.parametrize("radius_px", [1.0, 1.5, 2.0, 2.5])
def test_dots_below_the_limit_are_counted(radius_px):
    result = circlepose.estimate(dots(radius_px), CAMERA, ANY)
    assert result.reason.startswith("no contour is the target's image; 17 came close: smaller than is looked for")


@pytest.mark.parametrize("sigma", [2.0, 20.0])
def test_noise_is_not_taken_for_dots(sigma):
    noise = np.random.default_rng(1).normal(120.0, sigma, (240, 320))
    result = circlepose.estimate(np.clip(noise, 0, 255).astype(np.uint8), CAMERA, ANY)
    assert str(Rejection.TOO_SMALL) not in result.rejected
