from __future__ import annotations

import json
from dataclasses import replace

import pytest

from circlepose.camera.camera import Camera, CameraSigma
from circlepose.errors import CalibrationError
from circlepose.io.calibration.reader import CameraFile, read_camera_file
from circlepose_cli.app import main
from circlepose_cli.reports.camera import describe, report_record
from tests.support.paths import ROOT
from tests.support.refusals import refused_calibration

MATRIX = [[801.25 / 3.0, 1.0 / 7.0, 319.5], [0.0, 802.0 / 3.0, 239.1], [0.0, 0.0, 1.0]]


@pytest.mark.parametrize(
    "camera",
    [
        Camera.create(MATRIX, [0.1 / 3.0, -0.02, 1e-3, 2e-3, 1e-17], (640, 480), sigma=CameraSigma(0.1, 0.7)),
        Camera.create(MATRIX, [0.1 / 3.0, -0.02, 1e-3, 2e-3], None, "fisheye"),
        Camera.create(MATRIX),
    ],
)
def test_a_report_is_read_as_the_camera_that_it_is_of(camera: Camera) -> None:
    text = json.dumps(report_record(describe(CameraFile(camera, "circlepose", ROOT / "cam.yaml"))))
    file = read_camera_file(text.encode())
    assert file.form == "circlepose camera report"
    assert file.camera == camera
    assert file.notes == ()


def test_what_the_command_prints_is_read_and_reported_alike(capsys, tmp_path) -> None:
    def reported(path) -> dict[str, object]:
        assert main(["camera", str(path), "--format", "json"]) == 0
        return json.loads(capsys.readouterr().out)

    first = reported(ROOT / "configs" / "calibration" / "ros_camera_info.yaml")
    path = tmp_path / "report.json"
    path.write_text(json.dumps(first))
    again = reported(path)
    assert again == {**first, "file": str(path), "form": "circlepose camera report"}


def test_the_target_is_lost_with_a_remark() -> None:
    camera = Camera.create(MATRIX, (), (640, 480))
    report = replace(describe(CameraFile(camera, "circlepose", ROOT)), target="a circle of radius 60 mm")
    file = read_camera_file(json.dumps(report_record(report)).encode())
    assert file.target is None
    assert file.notes == ("the target of the reported calibration is not part of its report",)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"schema": "circlepose.camera/9"}, "schema: expected"),
        ({"model": "omni"}, "model: expected one of pinhole, fisheye, got 'omni'"),
        ({"dist_coeffs": "none"}, "dist_coeffs: expected a list of numbers"),
        ({"image_size_px": [640]}, "image_size_px: expected 2 numbers, got 1"),
        ({"focal_sigma_px": -1.0}, "focal_sigma_px: expected a standard deviation"),
    ],
)
def test_what_is_wrong_is_said_in_a_sentence(change: dict[str, object], words: str) -> None:
    record = report_record(describe(CameraFile(Camera.create(MATRIX), "circlepose", ROOT)))
    assert words in refused_calibration(json.dumps({**record, **change}).encode())


def test_a_report_without_its_matrix_is_refused() -> None:
    with pytest.raises(CalibrationError, match="camera_matrix: is missing; write the report again"):
        read_camera_file(b'{"schema": "circlepose.camera/1", "fx": 3}')
