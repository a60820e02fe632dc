from __future__ import annotations

import re
from pathlib import Path

import cv2
import numpy as np
import pytest

from circlepose.io.calibration.reader import read_camera, read_camera_file
from circlepose.io.scenes.reader import read_scenes
from circlepose.io.target_file import read_target, target_from_mapping
from circlepose.targets import KINDS
from circlepose.targets.board import PATTERNS
from tests.support.paths import ROOT

CONFIGS = ROOT / "configs"
FOLDERS = ("calibration", "chen_huang_1999", "fu_zhou_2019", "targets")
FILES = [path.relative_to(CONFIGS) for folder in FOLDERS for path in sorted((CONFIGS / folder).iterdir())]
TARGETS = [path for path in FILES if path.parts[0] == "targets" or path.stem.startswith("target")]
CAMERAS = [path for path in FILES if path not in TARGETS]
FORMS = {
    "opencv": "OpenCV FileStorage",
    "opencv_fisheye": "OpenCV FileStorage",
    "ros_camera_info": "ROS camera_info",
    "kalibr_camchain": "Kalibr camchain",
}


def test_both_kinds_are_there() -> None:
    assert len(CAMERAS) == 7
    assert len(TARGETS) == 7


@pytest.mark.parametrize("path", CAMERAS, ids=str)
def test_cameras_are_read_without_doubts(path: Path) -> None:
    file = read_camera_file(CONFIGS / path)
    assert file.form == FORMS.get(path.stem, "circlepose")
    assert file.camera.image_size is not None
    assert (file.camera.model == "fisheye") == (path.stem == "opencv_fisheye")
    assert [note for note in file.notes if "taken, of" not in note] == []
    if file.target is not None:
        assert target_from_mapping(file.target, str(path)).radii_mm == (60.0,)


@pytest.mark.parametrize("path", TARGETS, ids=str)
def test_targets_are_read(path: Path) -> None:
    target = read_target(CONFIGS / path)
    assert target.kind == (path.stem.removeprefix("target_") if path.stem != "target" else "circle")


def test_every_kind_has_a_template() -> None:
    texts = {path.stem: path.read_text(encoding="utf-8") for path in (CONFIGS / "targets").iterdir()}
    assert set(texts) == set(KINDS)
    (kinds,) = re.findall(r"^kind: circle # (.*)$", texts["circle"], re.MULTILINE)
    assert all(kind in kinds for kind in KINDS)


def test_the_forms_of_a_board_in_comments_are_read(tmp_path: Path) -> None:
    text = (CONFIGS / "targets" / "board.yaml").read_text(encoding="utf-8")
    others = re.findall(r"^# ((grid|marks|omit): .*)$", text, re.MULTILINE)
    assert {key for _, key in others} == {"grid", "marks", "omit"}
    patterns = set()
    for line, key in others:
        layout = read_target(re.sub(rf"^{key}: .*$", "", text, flags=re.MULTILINE).encode() + line.encode()).layout
        assert layout is not None
        assert layout.grid is not None
        patterns.add(layout.grid.pattern)
    assert patterns == set(PATTERNS)

    plain = re.sub(r"^(grid|marks): .*$", "", text, flags=re.MULTILINE)
    (tmp_path / "holes.csv").write_text("x_mm,y_mm\n0,0\n60,0\n0,40\n", encoding="utf-8")
    for block in re.findall(r"^# circles:.*\n(?:#   - .*\n)*", text, re.MULTILINE):
        for side in re.findall(r"^# (side: .*)$", text, re.MULTILINE) if "- " not in block else ("",):
            (tmp_path / "board.yaml").write_text(plain + block.replace("# ", "") + side, encoding="utf-8")
            layout = read_target(tmp_path / "board.yaml").layout
            assert layout is not None
            assert len(layout) == 3


def test_a_scene_of_a_board_is_read() -> None:
    read = read_scenes(CONFIGS / "scenes" / "board.yaml")
    assert read.target is not None
    assert read.target.kind == "board"
    assert len(read.scenes) == 2


def test_the_templates_of_one_lens_agree() -> None:
    cameras = [
        read_camera(CONFIGS / "calibration" / f"{stem}.yaml")
        for stem in ("circlepose", "opencv", "ros_camera_info", "kalibr_camchain")
    ]
    for camera in cameras[1:]:
        np.testing.assert_array_equal(camera.camera_matrix, cameras[0].camera_matrix)
        np.testing.assert_array_equal(camera.dist_coeffs[:4], cameras[0].dist_coeffs[:4])


@pytest.mark.parametrize("stem", ["opencv", "opencv_fisheye"])
def test_opencv_reads_its_templates(stem: str) -> None:
    path = CONFIGS / "calibration" / f"{stem}.yaml"
    storage = cv2.FileStorage(str(path), cv2.FILE_STORAGE_READ)
    np.testing.assert_array_equal(storage.getNode("camera_matrix").mat(), read_camera(path).camera_matrix)
    storage.release()


def test_the_papers_cameras_are_those_of_the_rendered_scenes(shared_data: Path) -> None:
    chen_huang = read_camera(CONFIGS / "chen_huang_1999" / "camera.yaml")
    rendered = read_camera(shared_data / "rendered_cd" / "camera.yml")
    np.testing.assert_array_equal(chen_huang.camera_matrix, rendered.camera_matrix)
    fu_zhou = read_camera(CONFIGS / "fu_zhou_2019" / "camera.yaml")
    halved = read_camera(shared_data / "rendered_coaxial" / "camera.yml")
    assert halved.image_size == (1228, 1029)
    np.testing.assert_allclose(fu_zhou.scaled_to((1228, 1029)).camera_matrix, halved.camera_matrix, rtol=1e-12)
