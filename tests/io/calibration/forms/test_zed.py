from __future__ import annotations

import pytest

from circlepose.io.calibration.reader import read_camera_file
from tests.support.lens_formulas import POINTS, brown, check_pixels
from tests.support.refusals import refused_calibration

LENS = "k1=-0.1725\nk2=0.0265\np1=0.0002\np2=-0.0001\nk3=0.001\n"
LEFT = "[LEFT_CAM_FHD]\nfx=1399.25\nfy=1399.5\ncx=971.75\ncy=541.5\n"
RIGHT = "[RIGHT_CAM_HD]\nfx=699.625\nfy=699.75\ncx=645.5\ncy=361.25\n"
STEREO = "[STEREO]\nBaseline=119.9\nCV_HD=0.01\n"
TERMS = ([-0.1725, 0.0265, 0.001], (0.0002, -0.0001))


def test_the_section_that_is_asked_for_with_its_size() -> None:
    text = f"{LEFT}{LENS}\n{RIGHT}{LENS}\n{STEREO}".encode()
    first = read_camera_file(text)
    assert (first.form, first.camera.image_size) == ("ZED", (1920, 1080))
    assert "LEFT_CAM_FHD taken, of the 2 cameras LEFT_CAM_FHD, RIGHT_CAM_HD" in first.notes
    assert any("rectified" in note for note in first.notes)
    check_pixels(first.camera, [brown(p, (1399.25, 1399.5), (971.75, 541.5), *TERMS) for p in POINTS])
    second = read_camera_file(text, "right_cam_hd")
    assert second.camera.image_size == (1280, 720)
    check_pixels(second.camera, [brown(p, (699.625, 699.75), (645.5, 361.25), *TERMS) for p in POINTS])
    assert "holds no camera 'LEFT_CAM_VGA'" in refused_calibration(text, "LEFT_CAM_VGA")


@pytest.mark.parametrize("own", ["", "k1=0\nk2=0\np1=0\n"])
def test_distortion_in_a_section_of_its_own(own: str) -> None:
    rational = [-0.1725, 0.0265, 0.001, 0.02, -0.01, 0.003]
    apart = f"[LEFT_DISTO]\n{LENS}k4=0.02\nk5=-0.01\nk6=0.003\n"
    file = read_camera_file(f"{LEFT}{own}{apart}".encode())
    check_pixels(file.camera, [brown(p, (1399.25, 1399.5), (971.75, 541.5), rational, TERMS[1]) for p in POINTS])
    both = read_camera_file(f"{LEFT}{LENS}{apart}".encode())
    check_pixels(both.camera, [brown(p, (1399.25, 1399.5), (971.75, 541.5), *TERMS) for p in POINTS])
    assert "the distortion of [LEFT_CAM_FHD] is used, not [LEFT_DISTO]" in both.notes


def test_what_is_wrong_is_named_with_its_section() -> None:
    assert "LEFT_CAM_FHD: cy: missing" in refused_calibration(LEFT.replace("cy=541.5\n", ""))
    assert "fx: is given twice" in refused_calibration(f"{LEFT}fx=3\n")
