from __future__ import annotations

import csv
from pathlib import Path

import cv2
import numpy as np
import pytest

from circlepose.errors import CalibrationError, CircleposeError, OutputError, SceneError, TargetError
from circlepose.io.calibration.reader import read_camera, write_camera
from circlepose.io.images.reader import read_image
from circlepose.io.scenes.produce import TRUTH_COLUMNS, render_to_folder
from circlepose.io.scenes.reader import read_scenes
from circlepose.io.target_file import read_target
from circlepose.synthesis.render import render, truth_rows
from circlepose.synthesis.scene import CoaxialPart, Disc, Rings
from tests.support.paths import ROOT

SAMPLES = ("cd", "coplanar", "coaxial", "clutter")
SCENE = """
camera: {fx: 200, fy: 200, cx: 39.5, cy: 29.5, image_size: [80, 60]}
background: {level: 190}
planes:
  wall: {center_mm: [0, 0, 300], normal: [0.1, 0, 1]}
shapes:
  - {kind: box, plane: wall, size_mm: [90, 60], angle_deg: 3, corner_radius_mm: 4, level: 150}
targets:
  - {kind: disc, center_mm: [2, 1, 290], normal: [0, 0.2, -1], radius_mm: 20, level: 40}
"""


def scene_file(folder: Path, text: str = SCENE, name: str = "view.yaml") -> Path:
    path = folder / name
    path.write_text(text, encoding="utf-8")
    return path


def rows_of(path: Path) -> list[dict[str, str]]:
    with path.open(newline="") as handle:
        return list(csv.DictReader(handle))


def test_one_image_takes_its_name_from_the_file(tmp_path: Path) -> None:
    read = read_scenes(scene_file(tmp_path))
    (scene,) = read.scenes
    assert scene.name == "view"
    assert scene.image_size == (80, 60)
    assert isinstance(scene.targets[0], Disc)
    assert read.target is not None
    assert (read.target.kind, read.target.radii_mm, read.target.count) == ("circle", (20.0,), 1)


def test_views_inherit_and_replace(tmp_path: Path) -> None:
    text = SCENE + (
        "noise_levels: 1\nnoise_seed: 7\n"
        "views:\n"
        "  - {image: a}\n"
        "  - {image: b, shapes: [], background: {level: 90}, blur_px: 0}\n"
        "  - image: c\n"
        "    noise_seed: 3\n"
        "    targets: [{kind: disc, plane: wall, at_mm: [5, 6], radius_mm: 20, level: 40}]\n"
    )
    a, b, c = read_scenes(scene_file(tmp_path, text)).scenes
    assert (len(a.shapes), len(b.shapes)) == (1, 0)
    assert (a.background.level, b.background.level) == (190.0, 90.0)
    assert (a.blur_px, b.blur_px) == (0.7, 0.0)
    assert [scene.noise_seed for scene in (a, b, c)] == [7, 8, 3]
    (disc,) = c.targets
    np.testing.assert_allclose(disc.normal @ (disc.center_mm - [0.0, 0.0, 300.0]), 0.0, atol=1e-12)
    assert float(np.linalg.norm(disc.center_mm - [0.0, 0.0, 300.0])) == pytest.approx(np.hypot(5.0, 6.0))


def test_camera_may_be_a_file_beside_the_scene(tmp_path: Path) -> None:
    camera = read_scenes(scene_file(tmp_path)).camera
    write_camera(camera, tmp_path / "cam.yml")
    named = SCENE.replace(SCENE.strip().splitlines()[0], "camera: cam.yml")
    other = read_scenes(scene_file(tmp_path, named)).camera
    np.testing.assert_array_equal(other.camera_matrix, camera.camera_matrix)
    assert other.image_size == camera.image_size


@pytest.mark.parametrize(
    ("target", "kind", "names"),
    [
        ("{kind: rings, plane: wall, at_mm: [0, 0], radii_mm: [20, 12], levels: [40, 200]}", Rings, "outer inner"),
        (
            "{kind: boss, plane: wall, at_mm: [0, 0], radii_mm: [20, 12], generatrix_mm: 10, "
            "side_level: 40, cap_level: 200}",
            CoaxialPart,
            "big small",
        ),
        (
            "{kind: recess, plane: wall, at_mm: [0, 0], radii_mm: [20, 12], height_mm: 6, "
            "side_level: 40, cap_level: 200}",
            CoaxialPart,
            "big small",
        ),
    ],
)
def test_other_targets(tmp_path: Path, target: str, kind: type, names: str) -> None:
    text = SCENE.partition("targets:")[0] + f"targets:\n  - {target}\ntarget: {{polarity: dark}}\n"
    read = read_scenes(scene_file(tmp_path, text))
    assert isinstance(read.scenes[0].targets[0], kind)
    assert [row.circle.name for row in truth_rows(read.scenes[0])] == names.split()
    assert read.target is not None
    assert read.target.radii_mm == (20.0, 12.0)
    assert read.target.polarity == "dark"
    assert read.target.generatrix_mm == (10.0 if kind is CoaxialPart else None)


@pytest.mark.parametrize(
    ("old", "new", "error", "words"),
    [
        ("radius_mm: 20", "radius_mm: big", SceneError, "targets[0]: radius_mm: expected a positive radius in mm"),
        ("radius_mm: 20", "radius: 20", SceneError, "targets[0]: radius: is no known key; did you mean radius_mm?"),
        ("radius_mm: 20", "radius_mm: -2", SceneError, "radius_mm: expected a positive radius"),
        (
            "kind: disc",
            "kind: dsic",
            SceneError,
            "kind: expected one of disc, rings, boss, recess, board; got 'dsic'",
        ),
        ("kind: disc, ", "", SceneError, "kind: expected one of disc, rings, boss, recess, board; it is missing"),
        ("[0, 0.2, -1]", "[0, 0, 0]", SceneError, "targets[0]: disc: normal: expected a direction"),
        ("[0, 0.2, -1]", "[0, 1]", SceneError, "targets[0]: normal: expected [x, y, z]"),
        ("center_mm: [2, 1, 290]", "at_mm: [1, 2]", SceneError, "either center_mm and normal, or plane and at_mm"),
        ("level: 40", "level: 400", SceneError, "targets[0]: level: expected a gray level from 0 to 255, got 400"),
        ("level: 190", "lvl: 190", SceneError, "background: lvl: is no known key"),
        ("level: 190", "level: 190, texture: {amplitude: 2, scale_mm: 3}", SceneError, "as scale_px"),
        ("background", "backgroud", SceneError, "backgroud: is no known key; did you mean background?"),
        (
            "plane: wall",
            "plane: walls",
            SceneError,
            "shapes[0]: plane: expected the name of one of the file's planes",
        ),
        ("size_mm", "size_px", SceneError, "shapes[0]: size_px: a shape with a plane is measured in mm"),
        ("size_mm: [90, 60], ", "", SceneError, "shapes[0]: size_mm: is missing"),
        ("kind: box", "kind: disc", SceneError, "does not belong to a disc"),
        ("corner_radius_mm: 4", "corner_radius_mm: 40", SceneError, "corner_radius: at most half the shorter side"),
        ("[0, 0, 300]", "[0, 0, .nan]", SceneError, "planes.wall: center_mm: expected [x, y, z] in mm"),
        (", image_size: [80, 60]", "", SceneError, "camera: image_size: is missing"),
        ("fx: 200, ", "", CalibrationError, "camera: fx: missing"),
        (
            "targets:",
            "target: {cuont: 2}\ntargets:",
            SceneError,
            "target.cuont: is no known key; did you mean count?",
        ),
        ("targets:", "target: {count: 0}\ntargets:", TargetError, "target: count: expected a whole number"),
        ("targets:", "blur_px: -1\ntargets:", SceneError, "blur_px: expected a number of at least 0"),
        ("targets:", "bit_depth: 12\ntargets:", SceneError, "bit_depth: expected 8 or 16, got 12"),
        ("targets:", "views: []\ntargets:", SceneError, "views: expected a list of images"),
        ("targets:", "views: [{}]\ntargets:", SceneError, "views[0]: image: is missing"),
        ("targets:", "views: [{image: a}, {image: a}]\ntargets:", SceneError, "views[1]: image: 'a' is the name of"),
        ("targets:", "views: [{image: ../a}]\ntargets:", SceneError, "image: expected a name without folder"),
        (
            "targets:",
            "targets:\n  - {kind: disc, plane: wall, at_mm: [0, 0], radius_mm: 9, level: 3}",
            SceneError,
            "targets: expected targets of one kind and size",
        ),
        ("camera:", "camera: [", SceneError, "is not valid YAML"),
    ],
)
def test_mistakes_are_told_with_file_key_and_expectation(
    tmp_path: Path, old: str, new: str, error: type[CircleposeError], words: str
) -> None:
    path = scene_file(tmp_path, SCENE.replace(old, new, 1))
    with pytest.raises(error) as caught:
        render_to_folder(path, tmp_path / "out")
    assert words in str(caught.value)
    assert str(path) in str(caught.value)
    assert not (tmp_path / "out").exists()


def test_folder_holds_all_that_a_measurement_needs(tmp_path: Path) -> None:
    path = scene_file(tmp_path, SCENE + "views: [{image: a}, {image: b, bit_depth: 16}]\n")
    written = render_to_folder(path, tmp_path / "deep" / "out")
    assert [each.name for each in written] == ["a.png", "b.png", "camera.yml", "target.yaml", "truth.csv"]
    read = read_scenes(path)
    a, b = (read_image(each) for each in written[:2])
    np.testing.assert_array_equal(a, render(read.scenes[0]))
    assert (a.shape, a.dtype, b.dtype) == ((60, 80), np.uint8, np.uint16)
    np.testing.assert_array_equal(read_camera(written[2]).camera_matrix, read.camera.camera_matrix)
    assert read_target(written[3]) == read.target
    rows = rows_of(written[4])
    assert tuple(rows[0]) == TRUTH_COLUMNS
    assert [(row["image"], row["instance"], row["circle"]) for row in rows] == [
        ("a.png", "0", "disc"),
        ("b.png", "0", "disc"),
    ]
    normal = [float(rows[0][f"normal_{axis}"]) for axis in "xyz"]
    np.testing.assert_allclose(normal, np.array([0.0, 0.2, -1.0]) / np.sqrt(1.04), atol=1e-9)


def test_a_scene_without_targets_has_no_target_file(tmp_path: Path) -> None:
    path = scene_file(tmp_path, SCENE.partition("targets:")[0])
    assert [each.name for each in render_to_folder(path, tmp_path)] == ["view.png", "camera.yml", "truth.csv"]
    assert rows_of(tmp_path / "truth.csv") == []


def test_a_folder_that_cannot_be_made_is_told(tmp_path: Path) -> None:
    path = scene_file(tmp_path)
    with pytest.raises(OutputError, match="cannot be made a folder"):
        render_to_folder(path, path / "out")


@pytest.mark.parametrize("name", SAMPLES)
def test_samples_are_described_by_their_scenes(name: str) -> None:
    read = read_scenes(ROOT / "configs" / "scenes" / f"{name}.yaml")
    folder = ROOT / "sample_images" / name
    assert sorted(path.name for path in folder.glob("*.png")) == sorted(f"{s.name}.png" for s in read.scenes)
    np.testing.assert_array_equal(read_camera(folder / "camera.yml").camera_matrix, read.camera.camera_matrix)
    assert read_target(folder / "target.yaml") == read.target
    expected = [(row.image, row.instance, row.circle) for scene in read.scenes for row in truth_rows(scene)]
    for row, (image, instance, circle) in zip(rows_of(folder / "truth.csv"), expected, strict=True):
        assert (row["image"], int(row["instance"]), row["circle"]) == (f"{image}.png", instance, circle.name)
        center = [float(row[f"center_{axis}_mm"]) for axis in "xyz"]
        normal = np.array([float(row[f"normal_{axis}"]) for axis in "xyz"])
        np.testing.assert_allclose(center, circle.center, atol=1e-6)
        np.testing.assert_allclose(normal, circle.normal, atol=1e-8)
        assert float(np.dot(normal, center)) < 0.0


@pytest.mark.parametrize("image", ["a", "c"])
def test_sample_is_rendered_again_as_it_is_stored(image: str) -> None:
    (scene,) = (s for s in read_scenes(ROOT / "configs" / "scenes" / "cd.yaml").scenes if s.name == image)
    stored = cv2.imread(str(ROOT / "sample_images" / "cd" / f"{image}.png"), cv2.IMREAD_UNCHANGED)
    assert stored.dtype == np.uint8
    difference = np.abs(render(scene).astype(int) - stored.astype(int))
    # Another machine may round a grey level the other way.
    assert difference.max() <= 1
    assert (difference > 0).mean() < 1e-3


def test_samples_are_small() -> None:
    assert sum(path.stat().st_size for path in (ROOT / "sample_images").rglob("*")) < 6_000_000
