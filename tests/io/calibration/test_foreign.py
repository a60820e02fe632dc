"""Calibrations of tools whose forms are not read: each is named, with the step to take."""

from __future__ import annotations

import json

import pytest

from circlepose.errors import CalibrationError
from circlepose.io.calibration.reader import read_camera_file
from tests.support.refusals import refused_calibration

SFM = {
    "version": ["1", "2", "6"],
    "views": [{"viewId": "1", "intrinsicId": "7"}],
    "intrinsics": [{"intrinsicId": "7", "width": "640", "pxFocalLength": "900", "distortionParams": ["0", "0", "0"]}],
}
QUALISYS = """<?xml version="1.0" encoding="UTF-8"?>
<calibration calibrated="2024-05-01" source="a.qca"><cameras><camera serial="1">
<intrinsic focallength="8" focalLengthU="107620" focalLengthV="107620" centerPointU="40960" centerPointV="30720"/>
</camera></cameras></calibration>
"""
MIDDLEBURY = "cam0=[3000 0 1240; 0 3000 1010; 0 0 1]\ncam1=[3000 0 1360; 0 3000 1010; 0 0 1]\ndoffs=120\nwidth=2964\n"


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("# INTERNAL CAMERA PARAMETERS\n\nParGroup: Camera: Parameter;\n", "is a HALCON camera"),
        ("# Bundle file v0.3\n2 100\n600 0.1 0.0\n", "is Bundler's result"),
        ("NVM_V3\n\n2\n", "is VisualSFM's model (.nvm)"),
        ("Pix4D camera calibration file 0\n#Focal Length mm\nF 8.5\n", "is Pix4D's calibration; write fx = fy = F /"),
        ("<ExportAPERO><CalibrationInternConique/></ExportAPERO>", "is MicMac's calibration"),
        ('<?xml version="1.0"?>\n<BlocksExchange version="2.1"></BlocksExchange>', "is ContextCapture's (iTwin)"),
        ('<x:xmpmeta xmlns:x="adobe:ns:meta/"><d xcr:Version="3"/></x:xmpmeta>', "is RealityCapture's (RealityScan)"),
        ('<x:xmpmeta xmlns:x="adobe:ns:meta/"><d stCamera:Make="A"/></x:xmpmeta>', "is Adobe's lens profile"),
        ('<!DOCTYPE lensdatabase>\n<lensdatabase version="2"/>', "is Lensfun's database"),
        (QUALISYS, "is Qualisys' calibration"),
        ('<Cameras><Camera><KeyFrame VICON_RADIAL2="1 2"/></Camera></Cameras>', "is Vicon's calibration"),
        ("Pinhole 0.5 0.6 0.5 0.5 0\n640 480\ncrop\n640 480\n", "is DSO's camera.txt"),
        ("RadTan 500 500 320 240 0.1 0.2 0 0\n640 480\nnone\n", "is DSO's camera.txt"),
        (MIDDLEBURY, "is Middlebury's calib.txt of rectified images; write cam0 as camera_matrix"),
        ("colorWidth = 1296\nfx_color = 1170.5\nfy_color = 1170.5\n", "is ScanNet's scene file"),
        ("P0: 718.5 0 607.25 0 0 718.5 185.25 0 0 0 1 0\nP1: 1\n", "is KITTI's calib.txt of rectified images"),
        ("cam_model: Pinhole\nscale: 0.5\ncam_fx: 431\ncam_d0: -0.1\n", "is SVO's or FAST-LIVO's camera"),
        (json.dumps({"CalibrationInformation": {"Cameras": []}}), "is an Azure Kinect's calibration"),
        (json.dumps({"camera_data_": [{"key": "a", "value": {}}]}), "is Argoverse's vehicle calibration"),
        (json.dumps({"0": {"cam_K": [1.0] * 9}, "1": {"cam_K": [1.0] * 9}}), "is BOP's scene_camera.json"),
        (json.dumps(SFM), "is AliceVision's (Meshroom's) scene"),
    ],
)  # fmt: skip
def test_each_is_named_with_a_step(text: str, says: str) -> None:
    sentence = refused_calibration(text)
    assert says in sentence
    assert any(step in sentence for step in ("write", "convert", "calibrate", "export"))


@pytest.mark.parametrize(
    ("content", "says"),
    [
        (b"BLENDER-v405", "is a Blender scene"),
        (b"ARROW1\0\0", "is a table (Arrow)"),
        ("fx: 900\n".encode("utf-32"), "is UTF-32 text; save it as UTF-8"),
        (b"cposix\nsystem\np0\n(S'true'\n", "is a Python pickle, which is never loaded"),
        (b"9.0e+02 0.0e+00 6.4e+02\n0 9.0e+02 4.8e+02\n0 0 1\n", "[[900.0, 0.0, 640.0], [0.0, 900.0, 480.0], "),
        (b"900,0,640\n0,900,480\n0,0,1\n", "and the distortion in the next line as `dist_coeffs: [k1, k2, p1, "),
        (b"900 0 640 0 900 480 0 0 1\n", "write this matrix as `camera_matrix: [[900.0"),
        (b"900 0 640 0\n0 900 480 0\n0 0 1 0\n0 0 0 1\n", "write this matrix as `camera_matrix: [[900.0"),
        (b"1 2 3\n4 5 6\n7 8 9\n", "of no known form of a calibration; expected camera_matrix and dist_coeffs, "),
    ],
)  # fmt: skip
def test_binaries_and_bare_matrices(content: bytes, says: str) -> None:
    assert says in refused_calibration(content)


def test_a_matrix_as_text_is_read_as_the_sentence_says() -> None:
    sentence = refused_calibration("900.125,0,640.5\n0,900.25,480.75\n0,0,1\n")
    line = sentence.split("`")[1]
    file = read_camera_file(f"{line}\ndist_coeffs: []\n".encode())
    assert file.camera.camera_matrix.tolist() == [[900.125, 0.0, 640.5], [0.0, 900.25, 480.75], [0.0, 0.0, 1.0]]


@pytest.mark.parametrize(
    "text",
    [
        "\n" * 300_000,
        " " * 300_000 + "x",
        "P0: " + "1" * 300_000,
        "P0:" + " 1" * 150_000,
        "Pinhole" + " 1" * 150_000,
        "a=1\n[" + "a." * 29_000 + "a]",
        "cam0=[" * 50_000,
        "cam_model:\n" * 20_000,
    ],
)
def test_long_texts_of_nothing_are_refused_soon(text: str) -> None:
    with pytest.raises(CalibrationError):
        read_camera_file(text.encode())
