from __future__ import annotations

import json

import numpy as np
import pytest

from circlepose.camera.camera import Camera
from circlepose.camera.plausibility import doubts
from circlepose.io.calibration.reader import CameraFile, write_camera
from circlepose_cli.app import main
from circlepose_cli.reports.camera import describe, report_record, report_text
from tests.support.discs import CAMERA_YAML


def report_on(matrix, coefficients=(), size=(640, 480), model="pinhole", notes=()):
    camera = Camera.create(matrix, coefficients, size, model)
    return describe(CameraFile(camera, "circlepose", "cam.yaml", None, notes, doubts(camera)))


SQUARE = [[500.0, 0.0, 319.5], [0.0, 500.0, 239.5], [0.0, 0.0, 1.0]]


def test_a_plain_pinhole_camera():
    report = report_on(SQUARE)
    half = np.degrees(np.arctan(np.array([320.0, 240.0, 400.0]) / 500.0))
    np.testing.assert_allclose(list(report.field_of_view_deg.values()), 2.0 * half, rtol=1e-12)
    assert report.principal_point_offset_px == (0.0, 0.0)
    assert [shift.shift_px for shift in report.corner_shifts] == pytest.approx([0.0] * 4, abs=1e-9)
    assert report.warnings == ()
    assert "no distortion" in report_text(report)


@pytest.mark.parametrize(("k1", "direction"), [(-0.1, "inwards"), (0.1, "outwards")])
def test_distortion_is_told_in_px_with_its_direction(k1, direction):
    report = report_on(SQUARE, [k1, 0.0, 0.0, 0.0])
    corner = np.array([319.5, 239.5]) / 500.0
    for shift in report.corner_shifts:
        # The corner's undistorted radius solves r (1 + k1 r^2) = distorted radius.
        r = np.roots([k1, 0.0, 1.0, -np.linalg.norm(corner)])
        real = r[np.abs(r.imag) < 1e-9].real
        undistorted = min(real[real > 0.0])
        assert shift.shift_px == pytest.approx(500.0 * (np.linalg.norm(corner) - undistorted), rel=1e-9)
    assert report_text(report).count(direction) == 4


def test_a_fisheye_that_sees_more_than_half_a_turn():
    report = report_on([[150.0, 0, 319.5], [0, 150.0, 239.5], [0, 0, 1]], [0.0] * 4, model="fisheye")
    angles = report.field_of_view_deg
    assert angles["horizontal"] == pytest.approx(np.degrees(640.0 / 150.0), rel=1e-9)
    assert angles["vertical"] == pytest.approx(np.degrees(480.0 / 150.0), rel=1e-9)
    # Beyond a right angle off the axis a pinhole camera has no image to compare with.
    assert all(shift.shift_px is None and shift.off_axis_deg > 90.0 for shift in report.corner_shifts)
    assert report.warnings == ()


@pytest.mark.parametrize(
    ("report", "warning"),
    [
        (report_on([[500, 0, 319.5], [0, 530, 239.5], [0, 0, 1]]), "fx and fy differ by 6.0 %"),
        (report_on([[500, 0, 400], [0, 500, 239.5], [0, 0, 1]]), "principal point (400, 239.5) px is 13 %"),
        (report_on(SQUARE, size=None), "image size is not given"),
        (report_on([[8, 0, 319.5], [0, 8, 239.5], [0, 0, 1]]), "focal length in mm"),
        (report_on([[8, 0, 319.5], [0, 8, 239.5], [0, 0, 1]]), "estimate refuses it without --force-calib"),
        (report_on(SQUARE, [-0.5, 0.0, 0.0, 0.0]), "cannot be inverted"),
        (report_on(SQUARE, [-2.0, 0.0, 0.0, 0.0]), "folds inside the image"),
    ],
)
def test_what_looks_wrong_is_told(report, warning):
    assert any(warning in text for text in report.warnings)
    assert warning in report_text(report)


def test_the_report_is_strict_json():
    record = report_record(report_on(SQUARE, [-0.6, 0.0, 0.0, 0.0], notes=("odd",)))
    again = json.loads(json.dumps(record, allow_nan=False))
    assert again["schema"] == "circlepose.camera/1"
    assert again["notes"] == ["odd"]


def test_the_command(capsys, tmp_path):
    file = tmp_path / "camera.yaml"
    file.write_text(CAMERA_YAML)
    assert main(["camera", str(file)]) == 0
    out = capsys.readouterr().out
    for words in ("320 x 240 px", "fx 400.00 px", "(159.50, 119.50) px", "horizontal 43.60 deg", "pixel's center"):
        assert words in out
    assert main(["camera", str(file), "--format", "json"]) == 0
    assert json.loads(capsys.readouterr().out)["focal_lengths_px"] == [400.0, 400.0]


def test_a_file_written_by_us_is_described_the_same(tmp_path, capsys):
    camera = Camera.create(SQUARE, [-0.1, 0.01, 0.0, 0.0, 0.0], (640, 480))
    write_camera(camera, tmp_path / "a.yml")
    assert main(["camera", str(tmp_path / "a.yml")]) == 0
    assert "OpenCV FileStorage" in capsys.readouterr().out


def test_a_file_that_is_no_calibration_ends_with_2(capsys, tmp_path):
    (tmp_path / "x.yaml").write_text("a: 1\n")
    assert main(["camera", str(tmp_path / "x.yaml")]) == 2
    assert "x.yaml" in capsys.readouterr().err


RECESS = "kind: coaxial\nradii_mm: [45, 30]\nheight_mm: 1\n"


def described(capsys, tmp_path, target):
    (tmp_path / "camera.yaml").write_text(CAMERA_YAML)
    (tmp_path / "target.yaml").write_text(target)
    code = main(["camera", str(tmp_path / "camera.yaml"), "--target", str(tmp_path / "target.yaml")])
    return code, capsys.readouterr()


def test_a_shallow_recess_is_warned_of_with_its_ambiguous_views(capsys, tmp_path):
    code, shown = described(capsys, tmp_path, RECESS + "depth_range_mm: [714, 800]\n")
    assert code == 0
    (warning,) = (line for line in shown.out.splitlines() if line.startswith("warning"))
    for words in ("recess 1 mm deep", "51 deg from 714 mm", "45 deg from 800 mm", "none beyond 1126 mm"):
        assert words in warning
    _, shown = described(capsys, tmp_path, RECESS)
    assert "60 deg from 563 mm" in shown.out


@pytest.mark.parametrize(
    "target",
    [
        RECESS + "depth_range_mm: [1200, 1500]\n",
        RECESS.replace("height_mm: 1", "generatrix_mm: 45.21"),
        RECESS.replace("height_mm: 1\n", ""),
        "kind: coplanar\nradii_mm: [45, 30]\n",
        "radius_mm: 60\n",
    ],
)
def test_targets_without_ambiguous_views_get_no_warning(capsys, tmp_path, target):
    code, shown = described(capsys, tmp_path, target)
    assert code == 0
    assert "target           " in shown.out
    assert "warning" not in shown.out


def test_a_target_that_is_none_ends_with_2(capsys, tmp_path):
    code, shown = described(capsys, tmp_path, "radius: 60\n")
    assert code == 2
    assert "target.yaml" in shown.err


def test_the_target_of_the_calibration_is_described_where_none_is_given(capsys, tmp_path):
    path = tmp_path / "camera.yaml"
    block = "target:\n" + "".join(f"  {line}\n" for line in (RECESS + "depth_range_mm: [714, 800]").splitlines())
    path.write_text(CAMERA_YAML + block)
    assert main(["camera", str(path)]) == 0
    shown = capsys.readouterr().out
    assert "recess 1 mm deep" in shown
    (tmp_path / "target.yaml").write_text("radius_mm: 60\n")
    assert main(["camera", str(path), "--target", str(tmp_path / "target.yaml")]) == 0
    shown = capsys.readouterr().out
    assert "60 mm" in shown
    assert "recess" not in shown


def test_a_target_of_the_calibration_that_is_none_ends_with_2(capsys, tmp_path):
    path = tmp_path / "camera.yaml"
    path.write_text(CAMERA_YAML + "target: {radius: 60}\n")
    assert main(["camera", str(path)]) == 2
    err = capsys.readouterr().err
    assert f"{path}: target: radius" in err
    assert "Traceback" not in err
