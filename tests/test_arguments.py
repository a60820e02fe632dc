"""The library is called in odd ways: one sentence that names the parameter, and never a bare error."""

from __future__ import annotations

import inspect
import warnings
from collections.abc import Callable
from pathlib import Path

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import circlepose
from benchmarks.support.fuzz.arguments import check_message, unfuzzed
from circlepose import Camera, CameraSigma, CircleposeError, Cone, ConeKind, DirectionHint, Ellipse, Target
from circlepose._arguments import LENGTHS_MM, shown
from circlepose.errors import ArgumentError, CalibrationError, TargetError
from circlepose.geometry.cone import factor_from_circle

MATRIX = [[60.0, 0.0, 31.5], [0.0, 60.0, 23.5], [0.0, 0.0, 1.0]]
CAMERA = Camera.create(MATRIX, (), (64, 48))
FISHEYE = Camera.create(MATRIX, (0.1, 0.0, 0.0, 0.0), (64, 48), "fisheye")
TARGET = Target.circle(20.0)
CONE = Cone(factor_from_circle(np.array([0.0, 0.0, 100.0]), np.array([0.0, 0.0, -1.0]), 20.0), ConeKind.RIGHT)
IMAGE = np.full((48, 64), 90, np.uint8)
CONTOUR = cv2.ellipse2Poly((30, 24), (15, 11), 20, 0, 360, 5)


def estimate(**changed: object) -> object:
    given_: dict[str, object] = {"image": IMAGE, "camera": CAMERA, "target": TARGET, **changed}
    return circlepose.estimate(**given_)  # type: ignore[arg-type]


def create(**changed: object) -> object:
    given_: dict[str, object] = {"camera_matrix": MATRIX, **changed}
    return Camera.create(**given_)  # type: ignore[arg-type]


def target(**changed: object) -> object:
    given_: dict[str, object] = {"kind": "circle", "radii_mm": (20.0,), **changed}
    return Target(**given_)  # type: ignore[arg-type]


def ellipse(**changed: object) -> object:
    given_: dict[str, object] = {name: np.zeros(()) for name in ("semi_major", "semi_minor", "angle")}
    return Ellipse(**{"center": np.zeros(2), **given_, **changed})  # type: ignore[arg-type]


def rim_points(**changed: object) -> object:
    return ellipse().points(**changed)  # type: ignore[attr-defined]


def project(**changed: object) -> object:
    return [CAMERA.project(**changed), CAMERA.project_with_jacobian(**changed)]  # type: ignore[arg-type]


def rays(**changed: object) -> object:
    return [camera.rays(**changed) for camera in (CAMERA, FISHEYE)]  # type: ignore[arg-type]


def rays_with_jacobian(**changed: object) -> object:
    return [camera.rays_with_jacobian(**changed) for camera in (CAMERA, FISHEYE)]  # type: ignore[arg-type]


def scaled(**changed: object) -> object:
    return CAMERA.scaled_to(**changed)  # type: ignore[arg-type]


def modes_of(**changed: object) -> object:
    circle = {"center": (0.0, 0.0, 100.0), "normal": (0.0, 0.0, -1.0), "radius_mm": 20.0}
    return CONE.modes_of(**{**circle, **changed})  # type: ignore[arg-type]


def from_contour(**changed: object) -> object:
    given_: dict[str, object] = {"contour": CONTOUR, "camera": CAMERA, "radius_mm": 20.0, **changed}
    return circlepose.estimate_from_contour(**given_)  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("call", "name", "values", "error"),
    [
        (
            estimate,
            "image",
            [None, "a.png", ["a.png", "b.png"], np.array([None]), np.zeros((0, 5)), np.zeros((5, 0), np.uint8), 7],
            ArgumentError,
        ),
        (estimate, "image", [IMAGE.astype(kind) for kind in ("i2", "i4", "c8", "O", "U3")], ArgumentError),
        (estimate, "image", [np.full((48, 64), np.nan), np.full((48, 64), np.inf, np.float32)], ArgumentError),
        (estimate, "camera", [None, MATRIX, "cam.yaml", Camera], ArgumentError),
        (estimate, "target", [None, "x", 60.0, Target], ArgumentError),
        (estimate, "method", [None, "Chen-Huang", ["all"], np.array(["all", "all"])], ArgumentError),
        (estimate, "extraction", [None, "edge", 3], ArgumentError),
        (estimate, "refine", [None, "yes", 1, np.array([True])], ArgumentError),
        (estimate, "scale_calibration", [None, "no", 0], ArgumentError),
        (estimate, "name", [None, 3, b"a"], ArgumentError),
        (from_contour, "contour", [None, "x", [], [[1, 2, 3]], [1, 2]], ArgumentError),
        (from_contour, "contour", [[[1.0, np.nan]] * 9, [[1e7, 0.0]] * 9, np.eye(2) * 1j], ArgumentError),
        (from_contour, "camera", [None, MATRIX], ArgumentError),
        (from_contour, "radius_mm", [None, "6cm", 0.0, -1.0, np.nan, 1e308, 1e-308, True, [20.0]], ArgumentError),
        (from_contour, "method", [None, "all", ["chen-huang"]], ArgumentError),
        (
            create,
            "camera_matrix",
            [None, "x", [[1.0]], np.full((3, 3), np.nan), np.diag([np.inf, 1, 1]), np.diag([1e10, 1, 1])],
            CalibrationError,
        ),
        (create, "dist_coeffs", [None, "x", [1.0], [np.nan] * 4, [1e300] * 4, [[], [1.0]]], CalibrationError),
        (create, "image_size", [(512,), 512, "ab", (0, 5), (1.5, 2), (np.nan, 5), (10**400, 5)], CalibrationError),
        (ellipse, "center", [None, [1.0, 2.0], "x", 3.0, np.zeros(3), np.zeros(())], ArgumentError),
        (ellipse, "semi_major", [None, [1.0], "x", 3.0], ArgumentError),
        (ellipse, "angle", [None, [1.0], 0], ArgumentError),
        (rim_points, "number", [None, 0, -1, 1.5, "many", True], ArgumentError),
        (project, "points", [None, "x", 3.0, [1.0, 2.0], [[1, 2, 3], [1]], np.zeros(2), [1j, 0, 1]], ArgumentError),
        (rays, "pixels", [None, "x", 3.0, [1.0, 2.0, 3.0], [[1, 2], [1]], np.zeros((2, 3)), [1j, 0]], ArgumentError),
        (rays_with_jacobian, "pixels", [None, "x", [], np.zeros(3)], ArgumentError),
        (scaled, "image_size", [None, 640, "ab", (1, 2, 3), (0, 0), (640.5, 480), (np.nan, 1)], CalibrationError),
        (modes_of, "center", [None, "x", 3.0, (1.0, 2.0), (1.0, 2.0, np.nan), CONTOUR], ArgumentError),
        (modes_of, "normal", [None, "x", (0.0, 0.0, 0.0), (0.0, 0.0, 2.0), (0.0, 1.0), (0, 0, 1e300)], ArgumentError),
        (modes_of, "radius_mm", [None, "6cm", 0.0, -1.0, np.nan, (20.0,)], ArgumentError),
        (create, "model", [None, "Pinhole", ["pinhole"]], CalibrationError),
        (create, "sigma", [None, 0.1, (0.1, 0.1)], CalibrationError),
        (target, "kind", [None, "disc", np.array(["circle"])], TargetError),
        (target, "radii_mm", [None, 20.0, "20", {20.0: 1}], TargetError),
        (target, "radius_mm", [None, "6cm", 0.0, -1.0, np.nan, np.inf, 1e308, 1e-308, 10**400, True], TargetError),
        (target, "count", [0, -1, 1.5, "many", True, [1]], TargetError),
        (target, "polarity", [None, "black", 1], TargetError),
        (target, "axis_intervals", [(5.0, 9.0), "x"], TargetError),
        (target, "depth_range_mm", [(1.0,), 5.0, (9.0, 5.0), (0.0, 1e308), (np.nan, 5.0), "ab"], TargetError),
        (target, "same_plane", [None, "maybe", 1], TargetError),
        (target, "normal_hint", [(0.0, 0.0, -1.0), "up"], TargetError),
        (target, "up_hint", [(0, 1, 0), DirectionHint("xyz", 5.0), DirectionHint((0, 1, 0), "x")], TargetError),
        (target, "facing", [5, "sideways", (1.0,), (0.0, 0.0, 0.0), (1e200, 1e200, 0.0)], TargetError),
        (target, "radius_sigma_mm", [None, "x", -1.0, np.nan, 20.0], TargetError),
    ],
)  # fmt: skip
def test_misuse_is_one_sentence_that_names_the_parameter(
    call: Callable[..., object], name: str, values: list[object], error: type[CircleposeError]
) -> None:
    for value in values:
        changed = {"radii_mm": (value,)} if call is target and name == "radius_mm" else {name: value}
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            with pytest.raises(error) as caught:
                call(**changed)
        message = str(caught.value)
        assert message.startswith(name), message
        check_message(message)


@pytest.mark.parametrize("read", [circlepose.read_camera, circlepose.read_target])
@pytest.mark.parametrize("source", [None, 5, ["a"], object(), Path("no such file"), Path()])
def test_what_is_no_file_is_said_in_one_sentence(read: Callable[[object], object], source: object) -> None:
    with pytest.raises(CircleposeError) as caught:
        read(source)
    check_message(str(caught.value))


@given(
    st.one_of(
        st.none(), st.booleans(), st.integers(), st.floats(), st.complex_numbers(), st.text(max_size=9),
        st.binary(max_size=9), st.lists(st.floats(), max_size=4), st.dictionaries(st.text(max_size=2), st.integers()),
    )
)  # fmt: skip
def test_a_length_is_within_the_stated_limits_or_refused(value: object) -> None:
    message = ""
    try:
        made = Target.circle(value)  # type: ignore[arg-type]
    except TargetError as error:
        message = str(error)
    if message:
        assert message.startswith("radius_mm: expected a positive radius in mm")
    else:
        assert LENGTHS_MM[0] <= made.radii_mm[0] <= LENGTHS_MM[1]


@pytest.mark.parametrize("radius_mm", LENGTHS_MM)
def test_the_longest_and_shortest_radius_are_measured_in_proportion(radius_mm: float) -> None:
    image = cv2.GaussianBlur(
        cv2.ellipse(np.full((48, 64), 200, np.uint8), (30, 24), (17, 12), 20, 0, 360, 60, -1), (0, 0), 1
    )
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        unit, result = (circlepose.estimate(image, CAMERA, Target.circle(r)) for r in (1.0, radius_mm))
    (one,), (circle,) = unit.circles, result.circles
    for a, b in zip(one.candidates, circle.candidates, strict=True):
        np.testing.assert_allclose(b.center, a.center * radius_mm, rtol=1e-9)


def test_what_numpy_calls_a_number_or_a_truth_is_one() -> None:
    made = Target("circle", np.array([20]), count=np.int8(2), same_plane=np.True_, radius_sigma_mm=np.float32(0.5))
    assert (made.radii_mm, made.count) == ((20.0,), 2)
    assert Target.circle(20, count="all").count is None  # type: ignore[arg-type]
    assert Camera.create(MATRIX, image_size=np.array([64, 48])).image_size == (64, 48)
    assert estimate(refine=np.False_).status == estimate(refine=False).status  # type: ignore[attr-defined]


def test_lists_are_arrays_wherever_arrays_are_taken() -> None:
    points, pixels = [[0.0, 1.0, 50.0], [2.0, 3.0, 60.0]], [[10, 20], [30, 40]]
    for camera in (CAMERA, FISHEYE):
        assert np.array_equal(camera.project(points), camera.project(np.array(points)))  # type: ignore[arg-type]
        assert np.array_equal(camera.rays(pixels), camera.rays(np.array(pixels)))  # type: ignore[arg-type]
        for ours, theirs in zip(
            camera.rays_with_jacobian(pixels),  # type: ignore[arg-type]
            camera.rays_with_jacobian(np.array(pixels)),
            strict=True,
        ):
            assert np.array_equal(ours, theirs)
    assert CAMERA.scaled_to([128, 96]).image_size == (128, 96)  # type: ignore[arg-type]
    assert modes_of() == pytest.approx(np.zeros(5), abs=1e-12)


def test_a_camera_made_without_create_is_checked_too() -> None:
    for matrix, coefficients in ((MATRIX, np.zeros(0)), (np.eye(2), np.zeros(0)), (np.eye(3), np.zeros((4, 1)))):
        with pytest.raises(CalibrationError, match=r"^(camera_matrix|dist_coeffs): "):
            Camera(matrix, coefficients)  # type: ignore[arg-type]


def test_a_size_mismatch_names_the_parameter() -> None:
    reason = circlepose.estimate(np.zeros((10, 10), np.uint8), CAMERA, TARGET).reason
    assert "scale_calibration" in reason
    assert "--" not in reason


def test_what_cannot_be_shown_has_a_text() -> None:
    class Unlike:
        def __repr__(self) -> str:
            raise RuntimeError

    assert "Unlike" in shown(Unlike())
    assert "\n" not in shown(np.zeros((9, 9)))


def test_every_public_call_is_fuzzed() -> None:
    # The rest are values that the library makes: they only hold what they are given.
    assert unfuzzed() == {
        "Candidate", "CircleResult", "Cone", "CovarianceTerms", "Explanation", "ImageResult", "Inspection",
        "Plane",
    }  # fmt: skip
    assert all(inspect.isclass(getattr(circlepose, name)) for name in unfuzzed())


def test_sigmas_of_a_camera() -> None:
    for value in (None, "x", -1.0, np.nan, 1e300):
        with pytest.raises(CalibrationError, match=r"^focal_sigma_px: "):
            CameraSigma(value)  # type: ignore[arg-type]


def found_contours(gray: np.ndarray) -> tuple[object, tuple[np.ndarray, ...]]:
    found = cv2.findContours(gray, cv2.RETR_LIST, cv2.CHAIN_APPROX_NONE)
    return found, tuple(found[0])


def test_a_contour_of_opencv_is_taken_as_it_comes() -> None:
    gray = cv2.ellipse(np.zeros((48, 64), np.uint8), (30, 24), (17, 12), 20, 0, 360, 255, -1)
    _, (contour,) = found_contours(gray)
    assert (contour.shape[1:], contour.dtype) == ((1, 2), np.int32)
    plain = circlepose.estimate_from_contour(contour[:, 0].astype(float), CAMERA, 20.0)
    assert plain.status == "ok"
    for same in (
        contour,
        contour[:, 0],
        contour.tolist(),
        contour[:, 0].tolist(),
        list(contour),
        tuple(map(tuple, contour[:, 0])),
    ):
        again = circlepose.estimate_from_contour(same, CAMERA, 20.0)
        assert np.array_equal(again.candidates[0].center, plain.candidates[0].center)


def test_of_several_contours_one_is_to_be_given() -> None:
    gray = cv2.circle(cv2.circle(np.zeros((48, 64), np.uint8), (15, 20), 9, 255, -1), (45, 20), 6, 255, -1)
    found, contours = found_contours(gray)
    for several in (found, contours, list(contours), contours[:1], np.array([*contours, None], dtype=object)[:2]):
        with pytest.raises(
            ArgumentError, match=r"contour: expected one contour, got \d .* max\(contours, key=len\)\.$"
        ):
            circlepose.estimate_from_contour(several, CAMERA, 20.0)  # type: ignore[arg-type]
