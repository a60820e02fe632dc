"""A radius in meters is doubted by the distance that it gives; a microscope's, or a phone's, is not."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from circlepose.results import ImageResult, Status
from circlepose_cli.console.doubtful_radius import doubt
from tests.support.discs import RADIUS_MM, made_circle, made_result


def scaled(factor, image_size=(320, 240)):
    """The result that another radius gives: all lengths in mm in proportion, the image the same."""
    circle = made_circle()
    candidates = tuple(replace(each, center=each.center * factor) for each in circle.candidates)
    scaled_circle = replace(circle, radius_mm=circle.radius_mm * factor, candidates=candidates)
    return replace(made_result(scaled_circle), image_size=image_size)


@pytest.mark.parametrize("factor", [0.06, 1.0, 50.0, 1e6])
def test_a_radius_that_puts_the_circle_where_cameras_focus_is_not_doubted(factor):
    assert doubt(scaled(factor)) is None


def test_a_radius_in_meters_is_doubted():
    assert doubt(scaled(1e-3)) == (
        "a circle of radius 0.02 mm would be only 0.2 mm from the camera; if the radius is 0.02 m, give 20 mm"
    )


def test_a_microscope_is_not_doubted():
    """The same circle at the same distance, in an image of a field of a few degrees."""
    assert doubt(scaled(1e-3, (24, 18))) is None


def test_what_has_no_pose_or_size_is_not_doubted():
    unmeasured = replace(made_circle(), candidates=(), status=Status.NO_POSE)
    behind = replace(
        made_circle(), candidates=tuple(replace(c, center=np.zeros(3)) for c in made_circle().candidates)
    )
    for result in (
        ImageResult("a.png", Status.NO_CIRCLE),
        made_result(unmeasured),
        made_result(behind),
        replace(scaled(1e-3), image_size=None),
        made_result(replace(scaled(1e-3).circles[0], ellipse=None)),
    ):
        assert doubt(result) is None


def test_it_is_asked_once_a_run_and_blocks_nothing(run, folder):
    question = "a circle of radius 0.02 mm would be only"
    code, out, err = run("estimate", folder, "--radius-mm", RADIUS_MM / 1000)
    assert (code, err.count(question), out.count("\n")) == (0, 1, 5)
    assert question not in run("estimate", folder, "--radius-mm", RADIUS_MM / 1000, "-q")[2]
    assert question not in run("estimate", folder)[2]
    code, _, err = run("explain", folder / "disc0.png", "--radius-mm", RADIUS_MM / 1000)
    assert (code, err.count(question)) == (0, 1)
