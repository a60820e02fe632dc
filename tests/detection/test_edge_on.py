"""Circles seen edge-on without any option, and other thin things, which are none."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

import circlepose
from benchmarks.edge_on import CAMERA, Views, better, in_sigmas
from circlepose.detection.detect import find_contours
from circlepose.results import Flag, Status
from circlepose.synthesis.render import render

DISC = Views("240 px", 60.0, 600.0, 40.0, 2.0)


def thin_shape(taper: float, semi_minor: float, noise: float = 2.0) -> np.ndarray:
    """A dark shape 200 px long whose width falls off as (1 - (x/a)^2)^taper: 1/2 is an ellipse, 0 a bar."""
    finer, x = 8, np.linspace(-1.0, 1.0, 801)
    half = semi_minor * np.maximum(1.0 - x * x, 0.0) ** taper
    outline = np.concatenate([np.stack([100.0 * x, half], 1), np.stack([100.0 * x, -half], 1)[::-1]])
    outline = outline @ np.array([[0.96, 0.28], [-0.28, 0.96]]) + [140.3, 70.2]
    large = np.full((140 * finer, 280 * finer), 200, np.uint8)
    cv2.fillPoly(large, [np.round(((outline + 0.5) * finer - 0.5) * 16).astype(np.int32)], 40, shift=4)
    levels = cv2.GaussianBlur(cv2.resize(large, (280, 140), interpolation=cv2.INTER_AREA).astype(float), (0, 0), 0.7)
    return np.clip(np.rint(levels + np.random.default_rng(0).normal(0.0, noise, levels.shape)), 0, 255).astype(
        np.uint8
    )


@pytest.mark.parametrize("tilt_deg", [88.0, 88.5, 89.0, 89.4, 89.7])
def test_a_disc_nearly_edge_on_is_found_and_keeps_to_its_covariance(tilt_deg):
    scene = DISC.scene(tilt_deg, 1)
    result = circlepose.estimate(render(scene), CAMERA, circlepose.Target("circle", (60.0,)))
    assert result.status is Status.OK
    sigmas = in_sigmas(better(result.circles[0].candidates, scene.targets[0]), scene.targets[0])
    assert sigmas is not None
    assert max(sigmas) < 5.0


@pytest.mark.parametrize("tilt_deg", [89.8, 89.9, 89.95, 90.0])
@pytest.mark.parametrize("interval", [None, (80.0, 440.0)])
def test_no_pose_has_a_length_that_is_not_settled(tilt_deg, interval):
    scene = DISC.scene(tilt_deg, 3)
    target = circlepose.Target("circle", (60.0,), axis_intervals=circlepose.AxisIntervals(major_px=interval))
    result = circlepose.estimate(render(scene), CAMERA, target)
    if result.status is not Status.OK:
        assert result.reason
        assert not any(circle.candidates for circle in result.circles)
        return
    assert Flag.NEAR_DEGENERATE in result.circles[0].flags
    candidate = better(result.circles[0].candidates, scene.targets[0])
    sigmas = in_sigmas(candidate, scene.targets[0])
    assert sigmas is not None
    assert max(sigmas) < 5.0
    assert np.sqrt(np.trace(candidate.covariance[:3, :3])) < 0.03 * 600.0


@pytest.mark.parametrize("semi_minor", [1.0, 2.0, 4.0])
@pytest.mark.parametrize(("taper", "number"), [(0.0, 0), (0.25, 0), (0.5, 1), (0.75, 0), (1.0, 0)])
def test_what_is_thin_is_a_circle_only_where_it_tapers_like_one(taper, number, semi_minor):
    for noise in (2.0, 6.0):
        found = find_contours(thin_shape(taper, semi_minor, noise), circlepose.AxisIntervals(), enough=1)
        assert len(found.contours) == number
