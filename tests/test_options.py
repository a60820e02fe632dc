"""The numbers of every stage reach it through `estimate(options=)`."""

from __future__ import annotations

from dataclasses import replace

import pytest

import circlepose
from circlepose.detection.options import DetectionOptions
from circlepose.disambiguation.options import DisambiguationOptions
from circlepose.errors import ArgumentError
from circlepose.measurement.options import MeasurementOptions
from circlepose.photometry.options import PhotometryOptions
from circlepose.pipeline import EstimateOptions
from circlepose.results import Flag, Status
from circlepose.rings.options import RingOptions
from circlepose.targets.hints import DirectionHint
from circlepose.targets.target import Target
from tests.support.discs import CAMERA, NORMAL, RADIUS_MM, disc_image

DISC = Target.circle(RADIUS_MM)


def of_detection(**numbers: float) -> EstimateOptions:
    return EstimateOptions(MeasurementOptions(detection=DetectionOptions(**numbers)))


def test_detection():
    assert circlepose.estimate(disc_image(), CAMERA, DISC, options=of_detection()).status is Status.OK
    options = of_detection(least_step_share=2.0)
    assert circlepose.estimate(disc_image(), CAMERA, DISC, options=options).status is Status.NO_CIRCLE


def test_photometry():
    wide = PhotometryOptions(band_half_width_px=6.0)
    default, wider = (
        circlepose.estimate(disc_image(), CAMERA, DISC, options=of_detection(photometry=each)).circles[0].pose
        for each in (PhotometryOptions(), wide)
    )
    assert tuple(default.center) != tuple(wider.center)
    assert max(abs(default.center - wider.center)) < 0.5


def test_measurement():
    options = EstimateOptions(MeasurementOptions(poor_fit_px=0.0))
    (circle,) = circlepose.estimate(disc_image(), CAMERA, DISC, options=options).circles
    assert Flag.POOR_FIT in circle.flags


def test_disambiguation():
    target = replace(DISC, normal_hint=DirectionHint(tuple(NORMAL.tolist()), 10.0))
    options = EstimateOptions(disambiguation=DisambiguationOptions(undecided=0.0))
    settled, left_open = (
        circlepose.estimate(disc_image(), CAMERA, target, options=each).circles[0].flags
        for each in (EstimateOptions(), options)
    )
    assert Flag.AMBIGUOUS not in settled
    assert Flag.AMBIGUOUS in left_open


def test_rings(project_root):
    folder = project_root / "sample_images" / "coplanar"
    image = circlepose.read_image(folder / "a.png")
    camera, target = circlepose.read_camera(folder / "camera.yml"), circlepose.read_target(folder / "target.yaml")
    options = EstimateOptions(rings=RingOptions(undecided=0.0))
    for circle in circlepose.estimate(image, camera, target, options=options).circles:
        assert Flag.AMBIGUOUS in circle.flags


def test_other_options_are_refused():
    with pytest.raises(ArgumentError, match="options"):
        circlepose.estimate(disc_image(), CAMERA, DISC, options=MeasurementOptions())
