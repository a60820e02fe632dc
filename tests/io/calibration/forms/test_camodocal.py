from __future__ import annotations

import pytest

from circlepose.io.calibration.reader import read_camera_file
from tests.support.lens_formulas import POINTS, brown, check_pixels, kannala_brandt
from tests.support.refusals import refused_calibration

HEAD = "%YAML:1.0\n---\nmodel_type: {}\ncamera_name: camera\nimage_width: 1280\nimage_height: 720\n"
PINHOLE = (
    HEAD.format("PINHOLE")
    + "distortion_parameters:\n   k1: -0.06\n   k2: 2e-02\n   p1: 0.001\n   p2: -0.002\n"
    + "projection_parameters:\n   fx: 7.055e+02\n   fy: 707.0\n   cx: 640.25\n   cy: 355.75\n"
)
FISHEYE = (
    HEAD.format("KANNALA_BRANDT")
    + "projection_parameters:\n   k2: 0.03\n   k3: -0.01\n   k4: 0.002\n   k5: 0.001\n"
    + "   mu: 705.5\n   mv: 707.0\n   u0: 640.25\n   v0: 355.75\n"
)
MEI = (
    HEAD.format("MEI")
    + "mirror_parameters:\n   xi: 1.9\ndistortion_parameters:\n   k1: 0.1\n   k2: 0\n   p1: 0\n   p2: 0\n"
    + "projection_parameters:\n   gamma1: 1200\n   gamma2: 1200\n   u0: 640\n   v0: 355\n"
)
FOCAL, CENTER = (705.5, 707.0), (640.25, 355.75)


def test_pinhole() -> None:
    file = read_camera_file(PINHOLE.encode(), "camera")
    assert file.form == "camodocal (VINS)"
    assert file.camera.image_size == (1280, 720)
    check_pixels(file.camera, [brown(p, FOCAL, CENTER, [-0.06, 0.02], (0.001, -0.002)) for p in POINTS])


def test_pinhole_full() -> None:
    text = PINHOLE.replace("PINHOLE", "PINHOLE_FULL").replace(
        "   p1:", "   k3: 0.004\n   k4: 0.03\n   k5: -0.01\n   k6: 0.002\n   p1:"
    )
    radial = [-0.06, 0.02, 0.004, 0.03, -0.01, 0.002]
    check_pixels(
        read_camera_file(text.encode()).camera, [brown(p, FOCAL, CENTER, radial, (0.001, -0.002)) for p in POINTS]
    )


def test_kannala_brandt_counts_from_k2() -> None:
    camera = read_camera_file(FISHEYE.encode()).camera
    check_pixels(camera, [kannala_brandt(p, FOCAL, CENTER, [0.03, -0.01, 0.002, 0.001]) for p in POINTS])


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (MEI, "omnidirectional"),
        (MEI.replace("MEI", "SCARAMUZZA"), "omnidirectional"),
        (MEI.replace("MEI", "FISHEYE9"), "model_type"),
        (PINHOLE.replace("   p2:", "   k3: 0.1\n   p2:"), "distortion_parameters.k3: is 0.1"),
        (FISHEYE.replace("k5", "k6"), "projection_parameters.k6"),
        (PINHOLE.replace("   p2:", "   q2:").replace("-0.002", "0"), "distortion_parameters.p2: is missing"),
        (PINHOLE.replace("distortion_parameters", "distortion"), "distortion_parameters: is missing"),
        (PINHOLE.replace("707.0", "seven"), "projection_parameters.fy: expected a number"),
        (
            '%YAML:1.0\nimu: 1\nnum_of_cam: 2\ncam0_calib: "left.yaml"\ncam1_calib: "right.yaml"\n',
            "left.yaml, right.yaml",
        ),
    ],
)
def test_what_is_wrong_is_named(text: str, said: str) -> None:
    assert said in refused_calibration(text)


def test_another_name() -> None:
    assert "only camera" in refused_calibration(PINHOLE, "cam0")
