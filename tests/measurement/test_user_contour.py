from __future__ import annotations

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import circlepose
from benchmarks.support.scoring import TrueCircle, error
from circlepose.camera.camera import Camera, circle_contour
from circlepose.errors import ArgumentError
from circlepose.fitting.cone_projection import factor_from_ellipse
from circlepose.fitting.ransac import local_scatter, on_one_ellipse
from circlepose.geometry.cone import factor_from_circle, principal_frame
from circlepose.geometry.ellipse import Ellipse, signed_distance
from circlepose.photometry.thin.fit import fit_thin_ellipse
from circlepose.results import Flag, Status
from circlepose.solvers import METHODS
from circlepose.solvers.chen_huang import poses_from_frame
from circlepose.solvers.chords import Chords, chords_from_contour
from tests.support.cases import circle_case

CAMERA = Camera.create([[1200.0, 0, 639.5], [0, 1200.0, 479.5], [0, 0, 1]], (-0.1, 0.02, 0.0, 0.0), (1280, 960))
CASE = circle_case(60.0, 800.0, 5.0, 30.0, 50.0, 20.0)
TRUTH = TrueCircle(CASE.center, CASE.normal, None, None, "disc")


def contour(number: int = 400, noise: float = 0.0, seed: int = 0) -> np.ndarray:
    points = circle_contour(CAMERA, CASE.center, CASE.normal, CASE.radius, number)
    return points + noise * np.random.default_rng(seed).normal(size=points.shape)


@pytest.mark.parametrize("method", ["chen-huang", "chen-huang-contour", "kanatani-liu"])
def test_a_contour_gives_the_pose(method):
    result = circlepose.estimate_from_contour(contour(), CAMERA, 60.0, method=method)
    assert result.status is Status.OK
    measured = error(result, TRUTH)
    assert measured.position_mm < 1e-6
    assert measured.normal_deg < 1e-6


def test_the_number_of_points_may_be_small():
    assert circlepose.estimate_from_contour(contour(6), CAMERA, 60.0).status is Status.OK


CROSSED = contour(40)[[*range(20), *range(39, 19, -1)]]
CUT = np.concatenate([contour(200), np.stack([np.full(40, 0.0), np.linspace(400.0, 500.0, 40)], axis=1)])


@pytest.mark.parametrize(
    ("points", "status"),
    [
        (contour(5), Status.TOO_FEW_POINTS),
        (np.zeros((0, 2)), Status.TOO_FEW_POINTS),
        (np.full((30, 2), 100.0), Status.POINTS_COINCIDE),
        (CROSSED, Status.SELF_CROSSING),
        (CUT, Status.TOUCHES_BORDER),
        (np.stack([np.linspace(60, 1200, 50), np.linspace(60, 200, 50)], axis=1), Status.NO_POSE),
        (
            np.stack(
                [np.linspace(100, 300, 50), 100 + 0.5 * (np.arange(50) == 20) + 0.5 * (np.arange(50) == 30)], axis=1
            ),
            Status.NO_POSE,
        ),
    ],
    ids=["five", "none", "equal", "crossing", "border", "bent line", "ragged line"],
)
def test_what_is_wrong_with_a_contour_is_a_status(points, status):
    result = circlepose.estimate_from_contour(points, CAMERA, 60.0)
    assert result.status is status
    assert result.reason
    assert result.candidates == ()


TURN_BACK = np.concatenate([np.linspace(-1.0, 1.0, 40), np.linspace(1.0, -1.0, 40)[1:-1]])


@pytest.mark.parametrize("coefficients", [(), (-0.1, 0.02, 0.0, 0.0)])
@pytest.mark.parametrize("along", [np.linspace(-1.0, 1.0, 40), TURN_BACK], ids=["one way", "and back"])
@pytest.mark.parametrize("method", ["chen-huang", "chen-huang-contour"])
def test_a_segment_has_the_two_poses_of_the_paper(coefficients, along, method):
    """O = (0, 0, R sqrt(1 + s^2)/s) on the bisector w of the segment's ends, n = +-v (section III)."""
    camera = Camera.create(CAMERA.camera_matrix, coefficients, (1280, 960))
    first, last = (np.array(ray) / np.linalg.norm(ray) for ray in ([-0.1, 0.05, 1.0], [0.1, 0.02, 1.0]))
    w, v = first + last, np.cross(first, last)
    pixels = camera.project(w / 2.0 + (last - first) / 2.0 * along[:, None])
    result = circlepose.estimate_from_contour(pixels, camera, 60.0, method=method)
    assert result.status is Status.OK
    assert result.cone_kind == "degenerate"
    assert len(result.candidates) == 2
    s = np.linalg.norm(last - first) / np.linalg.norm(w)
    for candidate in result.candidates:
        np.testing.assert_allclose(
            candidate.center, 60.0 * np.sqrt(1.0 + s**2) / s * w / np.linalg.norm(w), atol=1e-6
        )
        assert abs(candidate.normal @ v) / np.linalg.norm(v) == pytest.approx(1.0, abs=1e-12)
    assert result.candidates[0].normal @ result.candidates[1].normal == pytest.approx(-1.0, abs=1e-12)


@pytest.mark.parametrize("method", ["kanatani-liu", "kabuka-arenas"])
def test_methods_that_need_an_ellipse_have_none_of_a_segment(method):
    pixels = np.stack([np.linspace(500, 700, 40), np.linspace(480, 490, 40)], axis=1)
    result = circlepose.estimate_from_contour(pixels, Camera.create(CAMERA.camera_matrix), 60.0, method=method)
    assert result.status is Status.NO_POSE
    assert "edge-on" in result.reason


@given(
    st.floats(0.0, 2e-4), st.floats(0.0, 360.0), st.floats(0.0, 360.0), st.sampled_from(["chen-huang", METHODS[1]])
)
def test_contours_of_circles_within_the_width_of_rounding_of_edge_on(off_rad, azimuth, lean, method):
    """A contour 1e-13 to 0.03 px wide has a pose with the length of its image, not one with a made-up length."""
    case = circle_case(60.0, 800.0, 5.0, azimuth, 90.0 - np.degrees(off_rad), lean)
    camera = Camera.create(CAMERA.camera_matrix)
    pixels = circle_contour(camera, case.center, case.normal, case.radius, 200)
    result = circlepose.estimate_from_contour(pixels, camera, 60.0, method=method)
    assert result.status is Status.OK
    truth = TrueCircle(case.center, case.normal, None, None, "disc")
    # With no width at all the ends are points of the contour: within 1 - cos(pi/n) of the circle's own.
    assert error(result, truth).position_mm < 1.01 * 800.0 * (1.0 - np.cos(np.pi / 200))
    assert error(result, truth).normal_deg < 1.1 * np.degrees(off_rad) + 1e-6


EXACT = ["chen-huang", "chen-huang-contour", "kanatani-liu"]


@given(st.floats(-9.0, -1.0), st.floats(0.0, 360.0), st.sampled_from([16, 33, 200]), st.sampled_from(EXACT))
def test_an_exact_contour_close_to_edge_on_is_no_segment(exponent, lean, number, method):
    """However narrow it is: nothing but its scatter says how exact a contour is."""
    width = 10.0**exponent
    case = circle_case(45.0, 700.0, 5.0, 30.0, 90.0 - np.degrees(width), lean)
    camera = Camera.create(CAMERA.camera_matrix)
    pixels = circle_contour(camera, case.center, case.normal, case.radius, number)
    result = circlepose.estimate_from_contour(pixels, camera, case.radius, method=method)
    assert result.cone_kind == "elliptical"
    assert len(result.candidates) == 2
    measured = error(result, TrueCircle(case.center, case.normal, None, None, "disc"))
    assert measured.position_mm < 700.0 * 2e-15 / width + 1e-9
    assert measured.normal_deg < 1e-7


@given(st.floats(-4.0, -2.0), st.floats(0.0, 360.0), st.sampled_from([16, 200]), st.sampled_from(EXACT))
def test_an_exact_contour_close_to_frontal_keeps_its_tilt(exponent, lean, number, method):
    tilt = 10.0**exponent
    case = circle_case(45.0, 700.0, 5.0, 30.0, np.degrees(tilt), lean)
    camera = Camera.create(CAMERA.camera_matrix)
    pixels = circle_contour(camera, case.center, case.normal, case.radius, number)
    result = circlepose.estimate_from_contour(pixels, camera, case.radius, method=method)
    measured = error(result, TrueCircle(case.center, case.normal, None, None, "disc"))
    assert np.radians(measured.normal_deg) < 1e-4 * tilt


def test_a_contour_that_scatters_is_frontal_or_a_segment_within_its_own_errors():
    camera = Camera.create(CAMERA.camera_matrix)
    for tilt_deg, kind in ((0.02, "right"), (89.999, "degenerate")):
        case = circle_case(45.0, 700.0, 5.0, 30.0, tilt_deg, 20.0)
        points = circle_contour(camera, case.center, case.normal, case.radius, 150)
        noise = 0.02 * np.random.default_rng(4).normal(size=points.shape)
        if kind == "degenerate":
            noise = np.abs(noise) * np.sign(points - points.mean(axis=0))
        assert circlepose.estimate_from_contour(points + noise, camera, 45.0).cone_kind == kind


@pytest.mark.parametrize("points", [np.zeros(7), np.full((9, 2), np.nan), np.zeros((9, 3))])
def test_what_is_no_contour_is_refused(points):
    with pytest.raises(ArgumentError, match="contour"):
        circlepose.estimate_from_contour(points, CAMERA, 60.0)


def test_a_radius_must_be_one():
    with pytest.raises(ArgumentError, match="radius_mm"):
        circlepose.estimate_from_contour(contour(), CAMERA, -1.0)


# The paper's route: four points of the contour and nothing else.


def rays(points: np.ndarray) -> np.ndarray:
    return CAMERA.rays(points)


def pose_error(chords: Chords) -> tuple[float, float]:
    centers, normals = poses_from_frame(chords.frame, 60.0)
    angle = np.degrees(np.arccos(np.clip(normals @ CASE.normal, -1.0, 1.0)))
    best = int(np.argmin(angle))
    return float(np.linalg.norm(centers[best] - CASE.center)), float(angle[best])


def test_sub_pixel_chords_are_less_biased_than_extreme_points():
    errors = {True: [], False: []}
    for seed in range(20):
        for sub_pixel, found in errors.items():
            chords = chords_from_contour(rays(contour(400, 0.1, seed)), sub_pixel)
            assert isinstance(chords, Chords)
            found.append(pose_error(chords)[0])
    assert np.median(errors[True]) < 0.5 * np.median(errors[False])


def test_an_outlier_elsewhere_does_no_harm():
    """The paper's claim: a bump between the four points leaves them, and so the pose, as they are."""
    clean = contour(400)
    chords = chords_from_contour(rays(clean))
    four = CAMERA.project(np.stack([chords.p, chords.q, chords.b, chords.c]))
    distance = np.linalg.norm(clean[:, None] - four[None], axis=-1).min(axis=1)
    far = int(np.argmax(distance))
    bumped = clean.copy()
    middle = clean.mean(axis=0)
    inwards = np.arange(far - 12, far + 13) % 400
    bumped[inwards] += 0.25 * (middle - bumped[inwards])
    found = chords_from_contour(rays(bumped))
    assert not found.mended
    assert pose_error(found)[0] < 0.3
    whole = error(circlepose.estimate_from_contour(bumped, CAMERA, 60.0), TRUTH)
    assert whole.position_mm > 3.0 * pose_error(found)[0]


@pytest.mark.parametrize("which", ["p", "q", "b", "c"])
def test_an_outlier_on_one_of_the_four_is_noticed_and_mended(which):
    clean = contour(400, 0.05)
    chords = chords_from_contour(rays(clean))
    point = CAMERA.project(getattr(chords, which))
    index = int(np.argmin(np.linalg.norm(clean - point, axis=1)))
    bumped = clean.copy()
    stretch = np.arange(index - 10, index + 11) % 400
    bumped[stretch] += 0.2 * (bumped[stretch] - clean.mean(axis=0))
    found = chords_from_contour(rays(bumped))
    assert isinstance(found, Chords)
    assert found.mended
    assert pose_error(found)[0] < 4.0
    result = circlepose.estimate_from_contour(bumped, CAMERA, 60.0, method="chen-huang-contour")
    assert Flag.CHORD_MENDED in result.flags


def test_a_hidden_arc_at_a_crossing_is_a_reason_not_a_pose():
    clean = contour(400)
    chords = chords_from_contour(rays(clean))
    index = int(np.argmin(np.linalg.norm(clean - CAMERA.project(chords.b), axis=1)))
    away = np.abs((np.arange(400) - index + 200) % 400 - 200)
    result = chords_from_contour(rays(clean[away > 25]))
    assert isinstance(result, str)
    assert "hidden" in result


# What stands along a part of the rim.


def test_points_of_one_ellipse_are_told_from_a_chord_that_hides_a_part():
    points = contour(240, 0.05)
    hidden = np.arange(40, 110)
    ends = points[hidden[0]], points[hidden[-1]]
    points[hidden] = np.linspace(*ends, len(hidden)) + 0.05 * np.random.default_rng(1).normal(size=(len(hidden), 2))
    scatter = local_scatter(points)
    assert 0.03 < scatter < 0.08
    agreeing = on_one_ellipse(points, scatter)
    inner = hidden[6:-6]
    assert agreeing[inner].mean() < 0.1
    assert np.delete(agreeing, hidden).mean() > 0.9


# Circles seen nearly edge-on.


@pytest.mark.parametrize("semi_minor", [0.3, 1.0, 3.0, 7.0])
def test_a_thin_ellipse_is_measured_from_its_levels(semi_minor):
    truth = Ellipse.from_axes([160.3, 60.8], [120.0, semi_minor], 0.1)
    fine = np.stack(np.meshgrid((np.arange(320 * 4) + 0.5) / 4 - 0.5, (np.arange(120 * 8) + 0.5) / 8 - 0.5), axis=-1)
    cover = np.clip(0.5 - 8.0 * signed_distance(truth, fine.reshape(-1, 2)), 0.0, 1.0).reshape(960, 1280)
    cover = cv2.GaussianBlur(cover, (0, 0), sigmaX=0.7 * 4, sigmaY=0.7 * 8).reshape(120, 8, 320, 4).mean(axis=(1, 3))
    image = 40.0 + 160.0 * cover + np.random.default_rng(0).normal(size=cover.shape)
    start = Ellipse.from_axes(truth.center + np.array([0.5, -0.4]), [118.0, semi_minor + 0.5], 0.102)
    found = fit_thin_ellipse(np.clip(np.rint(image), 0, 255).astype(np.uint8), start)
    assert found is not None
    sigma = np.sqrt(np.diag(found.covariance))
    assert abs(found.ellipse.semi_major - 120.0) < max(4.0 * sigma[2], 0.05)
    assert abs(found.ellipse.semi_minor - semi_minor) < max(4.0 * sigma[3], 0.02)
    assert np.linalg.norm(found.ellipse.center - truth.center) < 0.3
    assert found.sigma_px == pytest.approx(np.hypot(0.7, 12**-0.5), abs=0.06)


def test_the_factor_of_a_segment_gives_the_edge_on_pose():
    edge_on = circle_case(60.0, 900.0, 10.0, 30.0, 90.0, 20.0)
    camera = Camera.create([[1200.0, 0, 639.5], [0, 1200.0, 479.5], [0, 0, 1]])
    exact = principal_frame(factor_from_circle(edge_on.center, edge_on.normal, 60.0))
    tips = exact.rotation @ np.array([[1.0, -1.0], [0.0, 0.0], [0.0, 0.0]]) * float(exact.tan_half_major)
    pixels = camera.project((tips + exact.rotation[:, 2:]).T)
    half = (pixels[0] - pixels[1]) / 2.0
    segment = Ellipse.from_axes(pixels.mean(axis=0), [np.hypot(*half), 0.0], np.arctan2(half[1], half[0]))
    frame = principal_frame(factor_from_ellipse(camera, segment))
    centers, normals = poses_from_frame(frame, 60.0)
    np.testing.assert_allclose(centers[0], edge_on.center, atol=1e-6)
    assert abs(abs(normals[0] @ edge_on.normal) - 1.0) < 1e-9
