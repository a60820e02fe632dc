from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest

from circlepose.camera.approximation import approximate
from circlepose.camera.camera import Camera
from tests.support.written_cameras import SIZE, fisheye, pinhole


@pytest.mark.parametrize(
    ("camera", "model", "count"),
    [(pinhole(4), "pinhole", 4), (pinhole(4), "pinhole", 12), (pinhole(8), "pinhole", 8), (fisheye(), "fisheye", 4)],
)
def test_a_model_that_holds_the_camera_is_off_by_nothing(camera: Camera, model: str, count: int) -> None:
    fit = approximate(camera, model, count)  # type: ignore[arg-type]
    assert fit is not None
    assert fit.max_px < 1e-6
    assert fit.share == 1.0


def test_a_skew_alone_costs_what_a_line_fitted_to_it_leaves() -> None:
    """Without distortion fx, fy, cx, cy cannot follow skew * y at all: what is left is the skew's own scatter."""
    camera = pinhole(0, skew=3.0)
    fit = approximate(camera, "pinhole", 0)
    assert fit is not None
    rows = np.linspace(0.0, SIZE[1] - 1.0, 61)
    shift = 3.0 * (rows - rows.mean()) / camera.camera_matrix[1, 1]
    # Skew moves the rays of a row together, and fx takes up none of it as the image is symmetric about its middle.
    assert fit.rms_px == pytest.approx(np.sqrt(np.mean(shift**2)), rel=1e-3)
    assert fit.max_px == pytest.approx(np.abs(shift).max(), rel=1e-2)


def test_more_coefficients_never_fit_worse() -> None:
    camera = pinhole(12)
    rms = [fit.rms_px for count in (0, 4, 5, 8, 12) if (fit := approximate(camera, "pinhole", count)) is not None]
    assert len(rms) == 5
    for fewer, more in pairwise(rms):
        assert more <= fewer + 1e-9


def test_a_pinhole_model_is_compared_only_where_it_has_an_image() -> None:
    fit = approximate(fisheye(), "pinhole", 8)
    assert fit is not None
    assert 0.5 < fit.share < 1.0


def test_without_an_image_size_there_is_nothing_to_compare() -> None:
    assert approximate(pinhole(5, size=None), "pinhole", 4) is None
