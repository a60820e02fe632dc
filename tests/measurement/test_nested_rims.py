"""Of concentric rims the one that the target declares is measured, and it is said where nothing declares it."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

import circlepose
from circlepose.camera.camera import Camera, circle_contour
from circlepose.io.tables.lossless import plain_result, restored_result
from circlepose.results import Flag
from circlepose.targets.target import AxisIntervals, Target

CAMERA = Camera.create([[700.0, 0.0, 199.5], [0.0, 700.0, 149.5], [0.0, 0.0, 1.0]], (), (400, 300))
RADIUS_MM, DISTANCE_MM = 20.0, 400.0
CENTER = DISTANCE_MM * np.array([0.03, -0.02, 1.0]) / np.linalg.norm([0.03, -0.02, 1.0])
NORMAL = np.array([0.3, 0.2, -0.9]) / np.linalg.norm([0.3, 0.2, -0.9])
DARK, BRIGHT, GRAY = 40, 200, 120
RING = ((1.3, DARK), (1.15, BRIGHT), (1.0, DARK))
_FINER = 4


def image_of(*rims: tuple[float, int], background: int = BRIGHT) -> np.ndarray:
    """Concentric circles, given by radius over that of the disc and level inside, from outside inwards."""
    width, height = 400, 300
    large = np.full((height * _FINER, width * _FINER), background, np.uint8)
    for share, level in rims:
        rim = (circle_contour(CAMERA, CENTER, NORMAL, share * RADIUS_MM) + 0.5) * _FINER - 0.5
        cv2.fillPoly(large, [np.round(rim * 16).astype(np.int32)], level, shift=4)
    small = cv2.GaussianBlur(cv2.resize(large, (width, height), interpolation=cv2.INTER_AREA), (0, 0), 0.7)
    return np.clip(small + np.random.default_rng(0).normal(0.0, 1.0, small.shape), 0, 255).astype(np.uint8)


def measured(image: np.ndarray, **of_target: object) -> circlepose.CircleResult:
    (circle,) = circlepose.estimate(image, CAMERA, Target.circle(RADIUS_MM, **of_target)).circles
    return circle


def distance(circle: circlepose.CircleResult) -> float:
    return float(np.linalg.norm(circle.pose.center))


def test_without_a_declaration_the_outermost_is_measured_and_flagged():
    circle = measured(image_of(*RING))
    assert Flag.NESTED_RIMS in circle.flags
    assert distance(circle) == pytest.approx(DISTANCE_MM / 1.3, rel=0.01)
    assert [rim.is_taken for rim in circle.nested_rims] == [True, False, False]
    assert [rim.polarity for rim in circle.nested_rims] == [1, -1, 1]
    # Each is at the distance that its own radius says.
    expected = [DISTANCE_MM / share for share, _ in RING]
    np.testing.assert_allclose([rim.distance_mm for rim in circle.nested_rims], expected, rtol=0.01)


@pytest.mark.parametrize(
    "declared",
    [
        {"depth_range_mm": (370.0, 430.0)},
        {"depth_range_mm": (340.0, 430.0)},
        {"axis_intervals": AxisIntervals(major_px=(60.0, 76.0))},
    ],
    ids=["narrow range", "range whose sizes hold all rims", "size"],
)
def test_a_declared_size_or_range_chooses(declared):
    disc = measured(image_of((1.0, DARK)))
    circle = measured(image_of((1.3, DARK), (1.2, BRIGHT), (1.0, DARK)), **declared)
    assert Flag.NESTED_RIMS not in circle.flags
    assert distance(circle) == pytest.approx(distance(disc), rel=0.002)


def test_of_those_in_the_range_the_outermost_is_taken():
    circle = measured(
        image_of((1.6, DARK), (1.4, BRIGHT), (1.2, DARK), (1.1, BRIGHT), (0.8, DARK)), depth_range_mm=(310, 600)
    )
    assert Flag.NESTED_RIMS in circle.flags
    taken = next(rim for rim in circle.nested_rims if rim.is_taken)
    admitted = [rim for rim in circle.nested_rims if rim.is_admitted]
    assert taken is admitted[0]
    assert all(rim.distance_mm < 310 for rim in circle.nested_rims if not rim.is_admitted)
    assert distance(circle) == pytest.approx(DISTANCE_MM / 1.2, rel=0.02)


def test_a_declared_polarity_leaves_out_the_others():
    circle = measured(image_of(*RING), polarity="bright")
    assert distance(circle) == pytest.approx(DISTANCE_MM / 1.15, rel=0.01)
    assert Flag.NESTED_RIMS not in circle.flags


@pytest.mark.parametrize("inner", [0.5, 0.6, 0.8])
@pytest.mark.parametrize("level", [BRIGHT, 5], ids=["washer", "countersunk hole"])
def test_what_has_two_rims_is_flagged(inner, level):
    circle = measured(image_of((1.0, GRAY), (inner, level)))
    assert Flag.NESTED_RIMS in circle.flags
    assert len(circle.nested_rims) == 2


@pytest.mark.parametrize(
    "rims",
    [
        [(1.0, DARK)],
        [(1.0, DARK), (0.95, BRIGHT)],
        [(1.0, DARK), (0.3, BRIGHT)],
        [(1.0, DARK), (0.15, GRAY)],
    ],
    ids=["disc", "drawn line", "hole", "dot"],
)
def test_what_has_one_rim_is_not_flagged(rims):
    circle = measured(image_of(*rims))
    assert Flag.NESTED_RIMS not in circle.flags
    assert circle.nested_rims == ()


def test_a_ring_target_has_no_such_doubt():
    target = Target("coplanar", (1.3 * RADIUS_MM, RADIUS_MM))
    result = circlepose.estimate(image_of(*RING), CAMERA, target)
    assert result.circles
    assert not any(circle.nested_rims or Flag.NESTED_RIMS in circle.flags for circle in result.circles)


def test_the_rims_are_kept_by_a_journal():
    result = circlepose.estimate(image_of(*RING), CAMERA, Target.circle(RADIUS_MM))
    assert plain_result(restored_result(plain_result(result))) == plain_result(result)
