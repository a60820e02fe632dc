from __future__ import annotations

from dataclasses import replace
from typing import get_args

import numpy as np
import pytest
from hypothesis import given

from circlepose.camera.camera import EXACT, Camera, CameraSigma
from circlepose.errors import CalibrationError, TargetError
from circlepose.io.calibration.reader import read_camera_file
from circlepose.io.calibration.registry import FORMS
from circlepose.io.calibration.writers import WrittenForm
from circlepose.io.calibration.writers.conversion import convert
from circlepose.io.calibration.writers.registry import WRITERS
from circlepose.io.marks import is_marked
from tests.support.written_cameras import (
    POINTS,
    cameras,
    check_same_pixels,
    file_of,
    fisheye,
    pinhole,
    written,
)

ALL = get_args(WrittenForm)
EXACT_UP_TO = {"opencv": 14, "ros": 8, "kalibr": 4, "colmap": 8, "mrcal": 12, "circlepose": 14}
"""the most pinhole coefficients that each form has"""


def test_each_written_form_is_read_and_has_a_writer() -> None:
    assert tuple(WRITERS) == ALL
    assert {writer.name for writer in WRITERS.values()} <= {form.name for form in FORMS}


@pytest.mark.parametrize("to", ALL)
def test_a_form_gives_every_camera_back_that_it_holds(to: WrittenForm) -> None:
    @given(camera=cameras(EXACT_UP_TO[to], fisheye=to != "mrcal", skew=to == "circlepose"), points=POINTS)
    def law(camera: Camera, points: np.ndarray) -> None:
        again = check_same_pixels(camera, to, points)
        count = min(len(camera.dist_coeffs), len(again.dist_coeffs))
        # To the last bit, but for the sign of a zero.
        assert again.dist_coeffs[:count].tolist() == camera.dist_coeffs[:count].tolist()
        assert not again.dist_coeffs[count:].any()
        if to != "colmap":
            assert again.camera_matrix.tolist() == camera.camera_matrix.tolist()

    law()


@pytest.mark.parametrize("to", ALL)
@pytest.mark.parametrize("count", [0, 4, 5, 8, 12, 14])
def test_a_lens_is_written_exactly_or_refused(to: WrittenForm, count: int) -> None:
    camera = pinhole(count)
    if count <= EXACT_UP_TO[to]:
        assert read_camera_file(written(camera, to).text.encode()).camera.dist_coeffs[:count].tolist() == list(
            camera.dist_coeffs
        )
        return
    with pytest.raises(CalibrationError, match=f"cannot hold a pinhole lens of {count} coefficients") as caught:
        written(camera, to)
    sentence = str(caught.value)
    assert sentence.startswith("cam.yaml: ")
    assert "px rms" in sentence
    assert "\n" not in sentence
    for other in ALL:
        assert (f"--to {other}" in sentence) == (count <= EXACT_UP_TO[other])


def test_mrcal_has_no_fisheye_and_the_sentence_says_what_would_be_lost() -> None:
    with pytest.raises(CalibrationError, match="cannot hold a fisheye lens") as caught:
        written(fisheye(), "mrcal")
    assert "nearest model, LENSMODEL_OPENCV12, is off by" in str(caught.value)
    assert "% of the image within 80 deg of the axis" in str(caught.value)


@pytest.mark.parametrize("to", [each for each in ALL if each != "circlepose"])
def test_a_skew_is_refused_by_all_forms_but_ours(to: WrittenForm) -> None:
    with pytest.raises(CalibrationError, match=r"with a skew of 2\.5 px exactly.*--to circlepose holds it exactly\."):
        written(pinhole(4, skew=2.5), to)


def test_a_skew_without_an_image_size_says_that_there_is_no_residual() -> None:
    with pytest.raises(CalibrationError, match="cannot be said, as the calibration states no image size"):
        written(pinhole(4, skew=2.5, size=None), "opencv")


@pytest.mark.parametrize("to", ALL)
def test_an_image_size_that_is_not_known(to: WrittenForm) -> None:
    camera = pinhole(4, size=None)
    if to in ("opencv", "circlepose"):
        assert read_camera_file(written(camera, to).text.encode()).camera.image_size is None
        return
    with pytest.raises(CalibrationError, match=r"states no image size, which .* needs"):
        written(camera, to)


@pytest.mark.parametrize("to", ALL)
def test_what_a_form_has_no_place_for_is_said(to: WrittenForm) -> None:
    camera = replace(pinhole(4), sigma=CameraSigma(0.8, 0.5))
    conversion = convert(file_of(camera, target={"radius_mm": 60}, name="left"), to)
    remarks = "\n".join(conversion.remarks)
    again = read_camera_file(conversion.text.encode())
    assert ("--camera-sigma 0.8,0.5" in remarks) == (again.camera.sigma == EXACT)
    assert ("not written: target" in remarks) == (again.target is None)
    assert ("left" in remarks) == (again.name != "left")
    assert again.camera.sigma in (EXACT, camera.sigma)


def test_a_target_that_is_none_is_refused() -> None:
    with pytest.raises(TargetError, match=r"cam\.yaml: target"):
        convert(file_of(pinhole(4), target={"radius": 60}), "circlepose")


@pytest.mark.parametrize("to", ALL)
def test_what_we_write_bears_our_mark(to: WrittenForm) -> None:
    for ending in WRITERS[to].endings:
        assert is_marked(written(pinhole(4), to, ending).text.encode())


@pytest.mark.parametrize("to", ALL)
def test_no_remark_is_made_of_what_was_not_there(to: WrittenForm) -> None:
    assert not any("not written" in remark for remark in written(pinhole(4), to).remarks)
