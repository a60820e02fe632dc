from __future__ import annotations

import io

import numpy as np
import pytest
from scipy.io import savemat

from circlepose.io.calibration.reader import read_camera_file
from tests.support.projected_points import assert_pixels, brown
from tests.support.refusals import refused_calibration

SCRIPT = """% Intrinsic and Extrinsic Camera Parameters
%
% This script file can be directly executed under Matlab to recover the camera intrinsic and extrinsic parameters.

%-- Focal length:
fc = [ 657.395434197230010 ; 658.125171394432780 ];

%-- Principal point:
cc = [ 302.983753365107560 ; 242.616284651021110 ];

%-- Skew coefficient:
alpha_c = 0.000250000000000;

%-- Distortion coefficients:
kc = [ -0.255841301230030 ; 0.127573512345678 ; -0.000211234567890 ; 0.000031234567890 ; 0.010000000000000 ];

%-- Focal length uncertainty:
fc_error = [ 0.346893 ; 0.371100 ];

%-- Principal point uncertainty:
cc_error = [ 0.705410 ; 0.645900 ];

%-- Image size:
nx = 640;
ny = 480;

%-- Various other variables (may be ignored if you do not use the Matlab Calibration Toolbox):
n_ima = 20;						% Number of calibration images
est_dist = [ 1 ; 1 ; 1 ; 1 ; 1 ];	% Estimation indicator of the distortion coefficients
omc_1 = [ 1.654822e+00 ; 1.651970e+00 ; -6.700054e-01 ];
"""
KC = (-0.25584130123003, 0.127573512345678, -0.00021123456789, 0.00003123456789, 0.01)


def pixel(x: float, y: float) -> tuple[float, float]:
    """Description of the parameters in the toolbox's manual; its first pixel has the coordinates (0, 0)."""
    u, v = brown(x, y, (KC[0], KC[1], KC[4]), KC[2], KC[3])
    return 657.39543419723001 * (u + 0.00025 * v) + 302.98375336510756, 658.12517139443278 * v + 242.61628465102111


def saved(**variables: object) -> bytes:
    handle = io.BytesIO()
    savemat(handle, variables, do_compression=True)
    return handle.getvalue()


def test_the_script_that_the_toolbox_writes() -> None:
    file = read_camera_file(SCRIPT.encode())
    assert file.form == "Bouguet toolbox"
    assert file.camera.image_size == (640, 480)
    assert_pixels(file.camera, pixel)
    assert file.camera.sigma.focal_px == pytest.approx(0.3711 / 3.0)
    assert file.camera.sigma.center_px == pytest.approx(0.70541 / 3.0)


def test_several_assignments_of_a_line() -> None:
    text = "fc = [600; 601]; cc = [320 240]; kc = zeros(5, 1); kc = [0 0 0 0 0], nx = 640; ny = 480;  % by hand\n"
    file = read_camera_file(text.encode())
    assert file.camera.image_size == (640, 480)
    assert_pixels(file.camera, lambda x, y: (600.0 * x + 320.0, 601.0 * y + 240.0))


def test_its_mat_file() -> None:
    content = saved(
        fc=np.array([[657.39543419723001], [658.12517139443278]]),
        cc=np.array([[302.98375336510756], [242.61628465102111]]),
        kc=np.array([KC]).T,
        alpha_c=0.00025,
        nx=640,
        ny=480,
        X_1=np.zeros((3, 156)),
        calib_name="Image",
    )
    file = read_camera_file(content)
    assert file.form == "Bouguet toolbox"
    assert file.camera.image_size == (640, 480)
    assert_pixels(file.camera, pixel)


def test_a_stereo_calibration() -> None:
    two = {"fc_left": [[500.0], [501.0]], "fc_right": [[600.0], [601.0]]}
    two |= {f"{name}_{side}": [[320.0], [240.0]] for name in ("cc",) for side in ("left", "right")}
    content = saved(**two, kc_left=np.zeros((5, 1)), kc_right=np.zeros((5, 1)), nx=640, ny=480)
    assert read_camera_file(content).notes[0] == "left taken, of the 2 cameras left, right"
    assert_pixels(read_camera_file(content, "right").camera, lambda x, y: (600.0 * x + 320.0, 601.0 * y + 240.0))


def test_four_numbers_are_taken_for_a_pinhole_with_a_remark() -> None:
    file = read_camera_file(SCRIPT.replace(" ; 0.010000000000000 ]", " ]").encode())
    assert file.camera.dist_coeffs.tolist() == list(KC[:4])
    assert "fisheye_model: 1" in file.notes[0]


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("fc = [ 657.395434197230010 ;", "fc = [", "fc: expected 2 numbers, got 1 x 1"),
        ("kc = [", "kd = [", "kc: is missing; expected 2 or 4 or 5 numbers"),
        ("0.010000000000000 ]", "0.01 ; 1 ]", "kc: expected 2 or 4 or 5 numbers, got 6 x 1"),
        ("nx = 640", "nx = 640.5", "nx, ny: expected a positive width and height"),
        ("n_ima = 20", "fc = [ 1 ; 2 ]", "fc: has several values"),
        ("fc = [ 657.395434197230010", "fc = [ -657.395434197230010", "fc, cc: is singular or mirrored"),
        ("fc = [ 657.395434197230010", "fc = [ focal", "fc, cc: expected two numbers each"),
        ("0.346893", "-0.4; 1; 2", "fc_error: expected 2 numbers, got 4 x 1"),
    ],
)
def test_what_is_wrong_is_said_in_a_sentence(old: str, new: str, words: str) -> None:
    assert old in SCRIPT
    assert words in refused_calibration(SCRIPT.replace(old, new).encode())
