from __future__ import annotations

import io
import json

import numpy as np
import pytest
from scipy.io import savemat

from circlepose.io.calibration.reader import read_camera_file
from tests.support.projected_points import assert_pixels, brown
from tests.support.refusals import refused_calibration

PRINTED = """cameraParams =

  cameraParameters with properties:

   Camera Intrinsics
                     IntrinsicMatrix: [3\u00d73 double]
                         FocalLength: [1.7851e+03 1.7799e+03]
                      PrincipalPoint: [941.6524 546.5905]
                                Skew: 1.25
                           ImageSize: [1080 1920]

   Lens Distortion
                    RadialDistortion: [-0.1740 0.0739 0.0710]
                TangentialDistortion: [0.0011 -0.0022]

   Camera Extrinsics
                    RotationMatrices: [3\u00d73\u00d712 double]
"""


def pixel(x: float, y: float) -> tuple[float, float]:
    """Formulas of cameraParameters; the center of MATLAB's first pixel is (1, 1)."""
    u, v = brown(x, y, (-0.174, 0.0739, 0.071), 0.0011, -0.0022)
    return 1785.1 * u + 1.25 * v + 941.6524 - 1.0, 1779.9 * v + 546.5905 - 1.0


TRANSPOSED = [[1785.1, 0.0, 0.0], [1.25, 1779.9, 0.0], [941.6524, 546.5905, 1.0]]
STRUCTURE = {
    "RadialDistortion": [-0.174, 0.0739, 0.071],
    "TangentialDistortion": [0.0011, -0.0022],
    "ImageSize": [1080, 1920],
    "WorldPoints": [[0.0, 0.0], [0.0, 29.0]],
    "WorldUnits": "mm",
    "EstimateSkew": True,
    "NumRadialDistortionCoefficients": 3,
    "IntrinsicMatrix": TRANSPOSED,
}
NEWER = {
    **{key: value for key, value in STRUCTURE.items() if key != "IntrinsicMatrix"},
    "K": np.transpose(TRANSPOSED).tolist(),
}
SCRIPT = f"""focal.FocalLength = [1785.1, 1779.9];   % px
PrincipalPoint = [941.6524 ...
    546.5905];
Skew = 1.25;
ImageSize = [1080 1920];
RadialDistortion = [-0.174; 0.0739; 0.071];
TangentialDistortion = {STRUCTURE["TangentialDistortion"]};
"""
FACTORED = """>> cameraParams.IntrinsicMatrix

IntrinsicMatrix =

   1.0e+03 *

    1.7851         0         0
    0.00125   1.7799         0
    0.9416524 0.5465905 0.0010

RadialDistortion =

   -0.1740    0.0739    0.0710

TangentialDistortion =

    0.0011   -0.0022

ImageSize =

        1080        1920
"""


def saved(**variables: object) -> bytes:
    handle = io.BytesIO()
    savemat(handle, variables)
    return handle.getvalue()


@pytest.mark.parametrize(
    "content",
    [
        PRINTED.encode(),
        PRINTED.replace("\n", "\r\n").encode("utf-16"),
        SCRIPT.encode(),
        FACTORED.encode(),
        json.dumps(STRUCTURE).encode(),
        json.dumps({"cameraParams": NEWER}).encode(),
        saved(**STRUCTURE),
        saved(params=NEWER),
    ],
)
def test_whichever_way_it_was_saved(content: bytes) -> None:
    file = read_camera_file(content)
    assert file.form == "MATLAB"
    assert file.camera.image_size == (1920, 1080)
    assert_pixels(file.camera, pixel)
    assert file.notes[-1] == "principal point moved by -1 px: the center of MATLAB's top left pixel is (1, 1)"


def test_a_stereo_structure_has_two_cameras() -> None:
    content = saved(
        stereo={"CameraParameters1": STRUCTURE, "CameraParameters2": {**NEWER, "ImageSize": [1080.0, 1921.0]}}
    )
    assert read_camera_file(content).notes[0].startswith("CameraParameters1 taken, of the 2 cameras")
    assert read_camera_file(content, "CameraParameters2").camera.image_size == (1921, 1080)


@pytest.mark.parametrize(
    ("content", "words"),
    [
        (SCRIPT.replace("RadialDistortion", "Radial").encode(), "RadialDistortion: is missing, or shown without"),
        (
            SCRIPT.replace("-0.174;", "").encode() + b"RadialDistortion = [1 2];",
            "RadialDistortion: has several values",
        ),
        (SCRIPT.replace("; 0.071", "; 0.071; 1").encode(), "RadialDistortion: expected 2 or 3 numbers, got 4 x 1"),
        (SCRIPT.replace("1785.1, ", "").encode(), "FocalLength: expected 2 numbers, got 1 x 1"),
        (SCRIPT.replace("[1080 1920]", "[1080 0]").encode(), "ImageSize: expected a positive width and height"),
        (saved(p={**STRUCTURE, "IntrinsicMatrix": NEWER["K"]}), "if the matrix is not transposed, call it K"),
        (saved(p={**STRUCTURE, "K": 3.0, "IntrinsicMatrix": "x"}), "K: expected a 3 x 3 matrix, got 1 x 1"),
        (b"fisheyeIntrinsics with properties:\n MappingCoefficients: [800 -4e-4 3e-7 -1e-10]\n", "Scaramuzza's"),
        (PRINTED.replace("[1.7851e+03 1.7799e+03]", "[1\u00d72 double]").encode(), "FocalLength, PrincipalPoint"),
    ],
)
def test_what_is_wrong_is_said_in_a_sentence(content: bytes, words: str) -> None:
    assert words in refused_calibration(content)
