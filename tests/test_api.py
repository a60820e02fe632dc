"""What a program that imports circlepose sees: names, laws of results, equality, warnings."""

from __future__ import annotations

import copy
import pickle
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import circlepose
from circlepose import CameraSigma, CircleposeError, ConeKind, DirectionHint, Ellipse, Flag, Status, Target
from circlepose.camera.camera import circle_contour
from circlepose.errors import ArgumentError, TargetError, UsageError
from circlepose.geometry.cone import circle_frame, factor_from_circle
from circlepose.geometry.cone_perturbation import pose_derivatives
from circlepose.geometry.ellipse import signed_distance
from circlepose.io.tables.columns import COLUMNS, csv_cell, pose_rows
from circlepose.io.target_file import target_from_mapping, target_to_mapping
from circlepose.synthesis.render import render
from circlepose.synthesis.scene import Disc, Paint, Scene
from tests.support.cases import circle_case
from tests.support.discs import (
    CAMERA,
    CAMERA_YAML,
    CENTER_MM,
    NORMAL,
    RADIUS_MM,
    disc_folder,
    disc_image,
    made_circle,
    made_result,
)

TARGET = Target.circle(RADIUS_MM)
UNIT = st.tuples(*[st.floats(-1.0, 1.0)] * 3).filter(lambda v: np.linalg.norm(v) > 1e-3)


def rendered(center: np.ndarray = CENTER_MM, normal: np.ndarray = NORMAL) -> np.ndarray:
    """The exact image of a disc, with noise."""
    disc = Disc(center, normal, RADIUS_MM, Paint(40.0))
    return render(Scene(camera=CAMERA, targets=(disc,), noise_levels=1.0, noise_seed=1))


@pytest.fixture(scope="module")
def measured() -> circlepose.ImageResult:
    return circlepose.estimate(rendered(), CAMERA, TARGET, name="disc.png")


# The chosen candidate and its frame


def test_the_pose_is_the_chosen_candidate(measured: circlepose.ImageResult) -> None:
    (circle,) = measured.circles
    assert circle.pose is circle.candidates[0]
    assert replace(circle, chosen=1).pose is circle.candidates[1]
    assert replace(circle, candidates=()).pose is None


@given(UNIT)
def test_a_circle_has_a_right_handed_frame_with_z_along_its_normal(direction: tuple[float, float, float]) -> None:
    normal = np.array(direction) / np.linalg.norm(direction)
    frame = circle_frame(normal)
    np.testing.assert_allclose(frame.T @ frame, np.eye(3), atol=1e-14)
    assert np.linalg.det(frame) == pytest.approx(1.0, abs=1e-14)
    np.testing.assert_allclose(frame[:, 2], normal, atol=1e-15)
    # The smallest rotation from the camera's -z to the normal leaves their common perpendicular where it is.
    axis = np.cross([0.0, 0.0, -1.0], normal)
    np.testing.assert_allclose(frame @ np.diag([1.0, -1.0, -1.0]) @ axis, axis, atol=1e-14)


@pytest.mark.parametrize("tilt", [1e-3, 1e-6, 1e-7, 1e-9, 1e-12, 0.0])
def test_the_frame_is_one_also_where_no_rotation_is_smallest(tilt: float) -> None:
    frame = circle_frame(np.array([tilt, 0.0, np.sqrt(1.0 - tilt**2)]))
    np.testing.assert_allclose(frame.T @ frame, np.eye(3), atol=1e-14)
    np.testing.assert_allclose(frame, np.diag([-1.0, -1.0, 1.0]), atol=2.0 * tilt + 1e-14)


def test_a_circle_that_faces_the_camera_has_x_to_the_right_and_y_up() -> None:
    np.testing.assert_array_equal(circle_frame(np.array([0.0, 0.0, -1.0])), np.diag([1.0, -1.0, -1.0]))


@given(st.floats(5.0, 80.0), st.floats(0.0, 360.0), st.floats(0.0, 2.0 * np.pi))
def test_the_transform_takes_points_of_the_circle_to_its_image(tilt: float, azimuth: float, angle: float) -> None:
    case = circle_case(20.0, 300.0, 5.0, azimuth, tilt, 20.0)
    contour = circle_contour(CAMERA, case.center, case.normal, case.radius)
    circle = circlepose.estimate_from_contour(contour, CAMERA, case.radius)
    assert circle.ellipse is not None
    assert len(circle.candidates) == 2
    for candidate in circle.candidates:
        rim, middle = ([r * np.cos(angle), r * np.sin(angle), 0.0, 1.0] for r in (case.radius, 0.0))
        pixel = CAMERA.project((candidate.transform @ rim)[:3])
        # Both candidates have the same image.
        assert signed_distance(circle.ellipse, pixel[None])[0] == pytest.approx(0.0, abs=1e-6)
        np.testing.assert_allclose(CAMERA.project((candidate.transform @ middle)[:3]), candidate.imaged_center)
        assert candidate.transform[3].tolist() == [0.0, 0.0, 0.0, 1.0]


def test_sigmas_are_the_roots_of_the_covariance(measured: circlepose.ImageResult) -> None:
    pose = measured.circles[0].pose
    assert pose is not None
    assert pose.covariance is not None
    assert pose.sigma_mm is not None
    np.testing.assert_allclose(pose.sigma_mm**2, np.diagonal(pose.covariance)[:3], rtol=1e-12)
    assert np.radians(pose.sigma_deg) ** 2 == pytest.approx(np.trace(pose.covariance[3:, 3:]), rel=1e-12)
    np.testing.assert_allclose(pose.tilt_axes @ pose.normal, 0.0, atol=1e-15)
    row = next(pose_rows(measured))
    assert [row[f"sigma_{axis}_mm"] for axis in "xyz"] == pose.sigma_mm.tolist()
    assert row["sigma_normal_deg"] == pose.sigma_deg
    bare = replace(pose, covariance=None)
    assert (bare.sigma_mm, bare.sigma_deg) == (None, None)


# The measured cone


def test_the_cone_is_that_of_both_candidates_within_its_covariance(measured: circlepose.ImageResult) -> None:
    (circle,) = measured.circles
    cone = circle.cone
    assert cone is not None
    assert cone.modes_covariance is not None
    for candidate in circle.candidates:
        np.testing.assert_allclose(cone.modes_of(candidate.center, candidate.normal, RADIUS_MM), 0.0, atol=1e-9)
        slopes = pose_derivatives(cone.factor, candidate.center, candidate.normal, RADIUS_MM)[:, :5]
        assert candidate.covariance is not None
        by_pose = slopes @ candidate.covariance @ slopes.T
        np.testing.assert_allclose(by_pose, cone.modes_covariance, atol=1e-9 * np.abs(by_pose).max())
    np.testing.assert_array_equal(cone.modes_covariance, cone.modes_covariance.T)
    modes = cone.modes_of(CENTER_MM, NORMAL, RADIUS_MM)
    # A chi-square of five degrees of freedom.
    assert modes @ np.linalg.solve(cone.modes_covariance, modes) < 20.0


def test_a_cone_of_edges_alone_has_no_covariance() -> None:
    result = circlepose.estimate(disc_image(), CAMERA, TARGET, refine=False)
    cone = result.circles[0].cone
    assert cone is not None
    assert cone.modes_covariance is None


def test_the_kind_of_a_cone_has_its_own_name(measured: circlepose.ImageResult) -> None:
    (circle,) = measured.circles
    assert circle.cone_kind is ConeKind.ELLIPTICAL
    assert next(pose_rows(measured))["cone"] == "elliptical"
    # What was the kind once can still be compared with one.
    for kind in ("elliptical", ConeKind.ELLIPTICAL):
        with pytest.warns(DeprecationWarning, match="cone_kind"):
            assert circle.cone == kind
    with pytest.warns(DeprecationWarning, match="cone_kind"):
        assert circle.cone != "right"


def test_results_pass_through_pickle_and_copy(measured: circlepose.ImageResult) -> None:
    for again in (pickle.loads(pickle.dumps(measured)), copy.deepcopy(measured)):
        assert repr(again.circles) == repr(measured.circles)
        np.testing.assert_array_equal(again.circles[0].cone.factor, measured.circles[0].cone.factor)
        np.testing.assert_array_equal(
            again.circles[0].cone.modes_covariance, measured.circles[0].cone.modes_covariance
        )


# Texts


def test_results_have_a_short_text_with_units(measured: circlepose.ImageResult) -> None:
    (circle,) = measured.circles
    assert repr(measured) == "ImageResult('disc.png', 320 x 240 px, ok, 1 circle)"
    for value in (circle, circle.pose, circle.cone, *circle.candidates):
        assert len(repr(value)) < 240
        assert "array" not in repr(value)
    assert repr(circle.pose).startswith("Candidate(center (")
    assert " mm, normal (" in repr(circle.pose)
    assert repr(circle.pose).endswith(" deg)")
    assert repr(circle).startswith("CircleResult(0 disc, radius 20 mm, center (")
    assert "ambiguity 0.5" in repr(circle)
    assert repr(circle.cone).endswith(") deg, with covariance)")


def test_the_text_of_what_failed_says_why() -> None:
    nothing = circlepose.estimate(np.full((240, 320), 90, np.uint8), CAMERA, TARGET, name="a.png")
    assert repr(nothing) == f"ImageResult('a.png', 320 x 240 px, no_circle: {nothing.reason})"
    failed = circlepose.estimate_from_contour(np.zeros((3, 2)), CAMERA, 20.0)
    assert repr(failed) == f"CircleResult(0 disc, radius 20 mm, too_few_points: {failed.reason})"


# Equality


def test_two_reads_of_one_calibration_are_equal(tmp_path: Path) -> None:
    path = tmp_path / "camera.yaml"
    path.write_text(CAMERA_YAML)
    one, other = circlepose.read_camera(path), circlepose.read_camera(path)
    assert one == other
    assert hash(one) == hash(other)
    assert len({one, other, pickle.loads(pickle.dumps(one))}) == 1


@pytest.mark.parametrize(
    "changed",
    [
        {"camera_matrix": CAMERA.camera_matrix + np.eye(3, k=2)},
        {"dist_coeffs": np.array([0.1, 0.0, 0.0, 0.0])},
        {"image_size": None},
        {"image_size": (320, 241)},
        {"sigma": CameraSigma(1.0)},
    ],
)
def test_cameras_that_differ_in_one_number_are_not_equal(changed: dict[str, object]) -> None:
    assert replace(CAMERA, **changed) != CAMERA  # type: ignore[arg-type]
    assert CAMERA != "camera"


# Targets


def test_targets_are_made_by_what_they_are() -> None:
    hint = DirectionHint((0.0, 0.0, -1.0), 20.0)
    lone = Target.circle(5.0, count="all", same_plane=True, radius_sigma_mm=0.1, normal_hint=hint, facing="left")
    assert lone == Target(
        "circle", (5.0,), count=None, same_plane=True, radius_sigma_mm=0.1, normal_hint=hint, facing="left"
    )
    rings = Target.rings([50, 30, 10.0], flatness_sigma_mm=0.2, count=2)
    assert rings == Target("coplanar", (50.0, 30.0, 10.0), flatness_sigma_mm=0.2, count=2)
    by_generatrix = Target.coaxial((45.0, 30.0), generatrix_mm=25.0)
    assert by_generatrix == Target("coaxial", (45.0, 30.0), generatrix_mm=25.0)
    assert Target.coaxial(np.array([45.0, 30.0]), height_mm=20.0) == by_generatrix
    for target in (lone, rings, by_generatrix):
        assert target_from_mapping(target_to_mapping(target), "f") == target


@pytest.mark.parametrize(
    ("call", "match"),
    [
        (lambda: Target.rings([]), "radii_mm: expected radii in mm"),
        (lambda: Target.rings(50.0), "radii_mm: expected radii in mm"),  # type: ignore[arg-type]
        (lambda: Target.rings([50.0]), "radii_mm: .* has two or more radii, got 1"),
        (lambda: Target.coaxial([50.0, 30.0, 20.0], height_mm=5.0), "radii_mm: .* has two radii, got 3"),
        (lambda: Target.coaxial([50.0, 30.0], height_mm=5.0, generatrix_mm=30.0), "give one of them"),
        (lambda: Target.coaxial([50.0, 30.0], height_mm=-5.0), "height_mm: expected a positive height"),
        (lambda: Target.circle(5.0, count="many"), "count: expected"),  # type: ignore[arg-type]
        (lambda: Target.circle(5.0, same_plane=True), "same_plane: .* count of 2"),
    ],
)
def test_targets_that_cannot_be_are_refused(call: object, match: str) -> None:
    with pytest.raises(TargetError, match=match):
        call()  # type: ignore[operator]


def test_the_former_name_of_same_plane_still_works() -> None:
    new = Target.circle(5.0, count="all", same_plane=True)
    with pytest.warns(DeprecationWarning, match=r"Target\(coplanar=\) is now called Target\(same_plane=\)") as caught:
        assert Target("circle", (5.0,), count=None, coplanar=True) == new  # type: ignore[call-arg]
    assert caught[0].filename == __file__
    with pytest.warns(DeprecationWarning, match="same_plane"):
        assert replace(new, coplanar=False) == replace(new, same_plane=False)  # type: ignore[call-arg]
    with pytest.warns(DeprecationWarning, match="same_plane"):
        assert new.coplanar


def test_the_former_key_of_a_file_is_read_and_the_new_one_written() -> None:
    new = Target.circle(5.0, count="all", same_plane=True)
    assert circlepose.read_target(b"radius_mm: 5\ncount: all\ncoplanar: true\n") == new
    assert circlepose.read_target(b"radius_mm: 5\ncount: all\nsame_plane: true\n") == new
    assert target_to_mapping(new)["same_plane"] == "yes"
    with pytest.raises(TargetError, match="same_plane, coplanar: are two names of one key"):
        circlepose.read_target(b"radius_mm: 5\ncount: all\ncoplanar: true\nsame_plane: true\n")
    for key in ("coplanar", "same_plane"):
        with pytest.raises(TargetError, match=f": {key}: says that several"):
            circlepose.read_target(f"radius_mm: 5\n{key}: true\n".encode())


# One's own ellipse and contour


@given(st.floats(3.0, 80.0), st.floats(0.0, 360.0), st.floats(0.0, 30.0), st.floats(100.0, 3000.0))
def test_the_exact_ellipse_gives_the_exact_pose(tilt: float, azimuth: float, lean: float, distance: float) -> None:
    case = circle_case(60.0, distance, 5.0, azimuth, tilt, lean)
    factor = CAMERA.camera_matrix @ factor_from_circle(case.center, case.normal, case.radius)
    ellipses, found = Ellipse.from_factor(factor[None])
    if not found[0] or float(ellipses[0].semi_minor) < 1.0:
        return
    circle = circlepose.estimate_from_ellipse(ellipses[0], CAMERA, case.radius)
    nearest = max(circle.candidates, key=lambda candidate: float(candidate.normal @ case.normal))
    np.testing.assert_allclose(nearest.center, case.center, atol=1e-9 * distance)
    np.testing.assert_allclose(nearest.normal, case.normal, atol=1e-9)
    assert circle.contour is None
    assert circle.residual_px is None


def test_an_ellipse_that_is_a_circle_has_one_pose() -> None:
    middle = Ellipse.from_axes(CAMERA.camera_matrix[:2, 2], (40.0, 40.0), 0.0)
    circle = circlepose.estimate_from_ellipse(middle, CAMERA, RADIUS_MM)
    assert circle.cone_kind is ConeKind.RIGHT
    np.testing.assert_allclose(circle.candidates[0].center, [0.0, 0.0, 10.0 * RADIUS_MM], atol=1e-9)


def test_a_segment_is_a_circle_seen_edge_on() -> None:
    circle = circlepose.estimate_from_ellipse(Ellipse.from_axes((160, 120), (40, 0), 0.3), CAMERA, RADIUS_MM)
    assert circle.cone_kind is ConeKind.DEGENERATE
    assert len(circle.candidates) == 2


def test_under_distortion_the_pose_of_an_ellipse_is_close() -> None:
    camera = replace(CAMERA, dist_coeffs=np.array([-0.2, 0.0, 0.0, 0.0]))
    contour = circle_contour(camera, CENTER_MM, NORMAL, RADIUS_MM)
    center, axes, angle = cv2.fitEllipseDirect(contour.astype(np.float32))
    ellipse = Ellipse.from_axes(center, np.array(axes) / 2, np.radians(angle))
    circle = circlepose.estimate_from_ellipse(ellipse, camera, RADIUS_MM)
    nearest = max(circle.candidates, key=lambda candidate: float(candidate.normal @ NORMAL))
    assert np.linalg.norm(nearest.center - CENTER_MM) < 0.002 * CENTER_MM[2]
    outside = Ellipse.from_axes((1e5, 1e5), (30, 20), 0.0)
    assert circlepose.estimate_from_ellipse(outside, camera, RADIUS_MM).status is Status.NO_POSE


@pytest.mark.parametrize(
    "ellipse",
    [
        None,
        ((160, 120), (40, 30), 0.0),
        Ellipse.from_axes(np.zeros((2, 2)), np.ones((2, 2)), np.zeros(2)),
        Ellipse.from_axes((160, 120), (0, 0), 0.0),
        Ellipse.from_axes((np.nan, 120), (9, 5), 0.0),
        Ellipse.from_axes((1e9, 120), (9, 5), 0.0),
    ],
)
def test_what_is_no_ellipse_is_refused(ellipse: object) -> None:
    with pytest.raises(ArgumentError, match=r"^ellipse: expected"):
        circlepose.estimate_from_ellipse(ellipse, CAMERA, RADIUS_MM)  # type: ignore[arg-type]


def off(circle: circlepose.CircleResult) -> float:
    return min(float(np.linalg.norm(candidate.center - CENTER_MM)) for candidate in circle.candidates)


@pytest.mark.parametrize("seed", range(3))
def test_the_image_makes_a_noisy_contour_exact(seed: int) -> None:
    noise = np.random.default_rng(seed).normal(0.0, 0.8, (120, 2))
    contour = circle_contour(CAMERA, CENTER_MM, NORMAL, RADIUS_MM, 120) + noise
    raw = circlepose.estimate_from_contour(contour, CAMERA, RADIUS_MM)
    refined = circlepose.estimate_from_contour(contour, CAMERA, RADIUS_MM, image=rendered())
    assert refined.status is Status.OK
    assert off(refined) < 0.2 * off(raw)
    assert refined.pose is not None
    assert refined.pose.covariance is not None
    assert raw.candidates[0].covariance is None
    # It is the pose that the search finds.
    searched = circlepose.estimate(rendered(), CAMERA, TARGET).circles[0]
    np.testing.assert_allclose(refined.candidates[0].center, searched.candidates[0].center, atol=0.02)


def test_a_contour_of_a_few_points_is_enough_with_the_image() -> None:
    contour = circle_contour(CAMERA, CENTER_MM, NORMAL, RADIUS_MM, 8)
    refined = circlepose.estimate_from_contour(contour.round(), CAMERA, RADIUS_MM, image=rendered())
    assert off(refined) < 0.2


def test_the_camera_and_the_image_give_their_terms() -> None:
    camera = replace(CAMERA, sigma=CameraSigma(1.0, 0.5))
    contour = circle_contour(camera, CENTER_MM, NORMAL, RADIUS_MM)
    refined = circlepose.estimate_from_contour(contour, camera, RADIUS_MM, image=rendered())
    assert refined.candidates[0].covariance_terms is not None
    assert refined.candidates[0].covariance_terms.camera is not None


def test_a_contour_where_the_image_has_no_edge_keeps_its_own_pose() -> None:
    contour = circle_contour(CAMERA, CENTER_MM, NORMAL, RADIUS_MM)
    plain = np.full((240, 320), 90, np.uint8)
    refined = circlepose.estimate_from_contour(contour, CAMERA, RADIUS_MM, image=plain)
    assert Flag.EDGES_ONLY in refined.flags
    assert refined.candidates[0].covariance is None
    assert off(refined) < 1e-6


def test_a_segment_with_its_image_has_a_pose() -> None:
    normal = np.array([0.0, -1.0, 0.0])
    center = np.array([0.0, 0.0, 200.0])
    contour = circle_contour(CAMERA, center, normal, RADIUS_MM)
    circle = circlepose.estimate_from_contour(contour, CAMERA, RADIUS_MM, image=rendered(center, normal))
    assert circle.status is Status.OK
    assert len(circle.candidates) == 2


def test_an_image_of_another_size_is_refused() -> None:
    contour = circle_contour(CAMERA, CENTER_MM, NORMAL, RADIUS_MM)
    circle = circlepose.estimate_from_contour(contour, CAMERA, RADIUS_MM, image=rendered()[:-1])
    assert circle.status is Status.SIZE_MISMATCH
    assert "320 x 239" in circle.reason


# Files


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    made = disc_folder(tmp_path_factory.mktemp("imgs") / "imgs", images=3)
    (made / "disc10.png").write_bytes(b"no image")
    return made


NAMES = ["disc0.png", "disc1.png", "disc2.png", "disc10.png"]


def test_a_folder_is_measured_in_order(folder: Path) -> None:
    camera = circlepose.read_camera(folder / "camera.yaml")
    results = list(circlepose.measure(folder, camera, TARGET))
    assert [result.image for result in results] == NAMES
    assert [result.status for result in results] == [Status.OK] * 3 + [Status.NOT_AN_IMAGE]
    alone = circlepose.estimate(circlepose.read_image(folder / "disc0.png"), camera, TARGET)
    assert repr(results[0].circles) == repr(alone.circles)


def test_files_are_given_in_many_ways(folder: Path) -> None:
    paths = [folder / name for name in NAMES]
    for images in (paths, list(map(str, paths)), iter(paths), str(folder / "*.png"), (path for path in paths)):
        results = circlepose.measure(images, CAMERA, TARGET)
        assert [Path(result.image).name for result in results] == NAMES
    assert list(circlepose.measure([], CAMERA, TARGET)) == []
    assert list(circlepose.measure(iter(()), CAMERA, TARGET)) == []


def test_jobs_do_not_change_results(folder: Path) -> None:
    alone = list(circlepose.measure(folder, CAMERA, TARGET))
    together = list(circlepose.measure(folder, CAMERA, TARGET, jobs=2))
    assert [(result.image, result.status) for result in together] == [(r.image, r.status) for r in alone]
    # NumPy's threads, of which a worker has one, make a difference of rounding.
    for one, other in zip(circlepose.to_rows(alone), circlepose.to_rows(together), strict=True):
        assert one["center_z_mm"] == pytest.approx(other["center_z_mm"], abs=1e-4)


def test_an_endless_stream_is_measured_as_it_is_asked_for(folder: Path) -> None:
    taken = 0

    def paths() -> Iterator[Path]:
        nonlocal taken
        while True:
            taken += 1
            yield folder / "disc0.png"

    results = circlepose.measure(paths(), CAMERA, TARGET)
    assert taken == 0
    assert [next(results).status for _ in range(2)] == [Status.OK] * 2
    assert taken == 2


@pytest.mark.parametrize(
    ("changed", "error"),
    [
        ({"images": None}, ArgumentError),
        ({"images": [None]}, ArgumentError),
        ({"images": ""}, ArgumentError),
        ({"images": "no such folder/*.png"}, UsageError),
        ({"camera": "cam.yaml"}, ArgumentError),
        ({"target": 60.0}, ArgumentError),
        ({"method": "best"}, ArgumentError),
        ({"method": "fu-zhou"}, ArgumentError),
        ({"jobs": 0}, ArgumentError),
        ({"jobs": 1.5}, ArgumentError),
        ({"timeout_s": -1.0}, ArgumentError),
        ({"refine": "yes"}, ArgumentError),
    ],
)
def test_misuse_of_measure_is_raised_at_the_call(
    folder: Path, changed: dict[str, object], error: type[CircleposeError]
) -> None:
    arguments: dict[str, object] = {"images": folder, "camera": CAMERA, "target": TARGET, **changed}
    with pytest.raises(error):
        circlepose.measure(**arguments)  # type: ignore[arg-type]


def test_a_bug_is_a_status_and_is_logged(
    folder: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    def broken(*_: object, **__: object) -> object:
        raise ZeroDivisionError("oh")

    monkeypatch.setattr("circlepose.pipeline.estimate", broken)
    (result,) = circlepose.measure(folder / "disc0.png", CAMERA, TARGET)
    assert result.status is Status.INTERNAL_ERROR
    assert "disc0.png" in caplog.text
    assert "ZeroDivisionError" in caplog.text


# Tables and pictures


def test_rows_are_those_of_the_table(measured: circlepose.ImageResult) -> None:
    failed = circlepose.ImageResult("b.png", Status.UNREADABLE, "gone")
    rows = circlepose.to_rows([measured, failed])
    assert rows == circlepose.to_rows(measured) + circlepose.to_rows(iter([failed]))
    assert all(tuple(row) == COLUMNS for row in rows)
    assert rows[-1] == dict.fromkeys(COLUMNS) | {"image": "b.png", "status": "unreadable"}
    assert {type(value) for row in rows for value in row.values()} == {str, int, float, bool, type(None)}
    for row, written in zip(rows, pose_rows(measured), strict=False):
        for column in COLUMNS:
            assert csv_cell(column, row[column]) == csv_cell(column, written.get(column))
    with pytest.raises(ArgumentError, match=r"^results: expected"):
        circlepose.to_rows("disc.png")  # type: ignore[arg-type]


def test_a_data_frame_has_the_rows_of_the_table(measured: circlepose.ImageResult) -> None:
    pytest.importorskip("pandas")
    failed = circlepose.ImageResult("b.png", Status.UNREADABLE, "gone")
    frame = circlepose.to_dataframe([measured, failed])
    assert tuple(frame.columns) == COLUMNS
    assert len(frame) == 3
    assert frame.loc[frame.chosen.fillna(False), "center_z_mm"].tolist() == [measured.circles[0].pose.center[2]]
    assert frame.status.tolist() == ["ok", "ok", "unreadable"]
    # Types do not depend on what is there.
    assert (circlepose.to_dataframe([failed]).dtypes == frame.dtypes).all()
    assert (circlepose.to_dataframe([]).dtypes == frame.dtypes).all()


def test_without_pandas_the_message_says_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("circlepose.io.tables.frames.find_spec", lambda _: None)
    with pytest.raises(UsageError, match="pip install pandas"):
        circlepose.to_dataframe(made_result())


def test_a_picture_shows_the_result_in_an_image_of_any_size(measured: circlepose.ImageResult) -> None:
    small = circlepose.draw_overlay(disc_image(), measured, CAMERA)
    half = cv2.resize(disc_image(), None, fx=0.5, fy=0.5, interpolation=cv2.INTER_AREA)
    result = circlepose.estimate(half, CAMERA, TARGET, scale_calibration=True)
    resized = circlepose.draw_overlay(half, result, CAMERA)
    for picture in (small, resized):
        assert picture.dtype == np.uint8
        assert picture.shape[2] == 3
        assert (np.ptp(picture.astype(int), axis=2) > 50).any()
    for bad in ({"image": None}, {"result": made_circle()}, {"camera": None}):
        arguments: dict[str, object] = {"image": disc_image(), "result": measured, "camera": CAMERA, **bad}
        with pytest.raises(ArgumentError, match=f"^{next(iter(bad))}: "):
            circlepose.draw_overlay(**arguments)  # type: ignore[arg-type]


def test_inspection_and_explanation_are_of_the_same_image(measured: circlepose.ImageResult) -> None:
    found = circlepose.inspect(disc_image())
    assert len(found.extraction.contours) == 1
    explained = circlepose.explain(rendered(), CAMERA, TARGET, name="disc.png")
    assert repr(explained.result.circles) == repr(measured.circles)
    for bad in ({"image": 3}, {"intervals": (1, 2)}, {"polarity": "black"}, {"rings": 1}):
        with pytest.raises(ArgumentError, match=f"^{next(iter(bad))}: "):
            circlepose.inspect(**({"image": disc_image()} | bad))


def test_what_is_no_image_file_is_refused(tmp_path: Path) -> None:
    with pytest.raises(ArgumentError, match=r"^path: expected"):
        circlepose.read_image(3)  # type: ignore[arg-type]
    with pytest.raises(circlepose.ImageError) as caught:
        circlepose.read_image(tmp_path / "a.png")
    assert caught.value.status == "unreadable"


# Names


def test_every_public_name_is_there_and_documented() -> None:
    for name in circlepose.__all__:
        value = getattr(circlepose, name)
        assert name == "__version__" or value.__doc__, name
    assert set(circlepose.__all__) <= set(dir(circlepose))


def test_names_are_loaded_when_first_used() -> None:
    code = (
        "import sys, circlepose; circlepose.Target.circle(5.0); "
        "sys.exit(any(name in sys.modules for name in ('cv2', 'scipy', 'pydantic', 'pandas', 'circlepose.pipeline')))"
    )
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0
