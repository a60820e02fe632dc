"""What errors of the camera and of the radius do to a pose, told and tried."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import circlepose
from circlepose.camera.camera import Camera, CameraSigma, circle_contour
from circlepose.errors import CalibrationError, TargetError
from circlepose.fitting.cone_fit import fit_cone
from circlepose.geometry.cone import plane_basis
from circlepose.io.calibration.reader import read_camera, write_camera
from circlepose.io.tables.json_records import image_record
from circlepose.io.tables.lossless import plain_result, restored_result
from circlepose.io.target_file import target_from_mapping, target_to_mapping
from circlepose.results import CircleResult, CovarianceTerms
from circlepose.solvers.registry import solve
from circlepose.targets.target import Target
from circlepose.uncertainty.systematic import camera_slopes, camera_term, radius_term, shares, with_all_terms
from circlepose_cli.app import main
from tests.support.cases import circle_case, circle_cases
from tests.support.discs import CAMERA, RADIUS_MM, disc_folder, disc_image, made_circle

PINHOLE = Camera.create([[900.0, 0.0, 639.5], [0.0, 930.0, 479.5], [0.0, 0.0, 1.0]], (), (1280, 960))
LENS = Camera.create(PINHOLE.camera_matrix, [-0.25, 0.08, 0.001, -0.0005, 0.01], (1280, 960))
FISHEYE = Camera.create(PINHOLE.camera_matrix, [0.02, -0.01, 0.001, 0.0], (1280, 960), "fisheye")
IMAGE_TERM = np.diag([1e-4, 1e-4, 4e-4, 1e-8, 1e-8])


def changed(camera, focal=0.0, x=0.0, y=0.0):
    matrix = camera.camera_matrix.copy()
    matrix[:2, :2] *= 1.0 + focal
    matrix[:2, 2] += [x, y]
    return replace(camera, camera_matrix=matrix)


def measured(camera, pixels, case, radius):
    """Pose (5,) from pixels, about that of the case, of which it is the nearest candidate."""
    fit = fit_cone(camera, pixels)
    solutions = solve("chen-huang", fit.factor, camera.rays(pixels), radius)
    nearest = int(np.argmax(solutions.normals @ case.normal))
    tilts = np.stack(plane_basis(case.normal)) @ solutions.normals[nearest]
    return np.concatenate([solutions.centers[nearest] - case.center, tilts])


@pytest.mark.parametrize("camera", [PINHOLE, LENS, FISHEYE], ids=["pinhole", "lens", "fisheye"])
@pytest.mark.parametrize(("off_deg", "tilt_deg"), [(0.0, 30.0), (20.0, 12.0), (25.0, 70.0)])
def test_slopes_are_what_a_changed_camera_measures_from_the_same_pixels(camera, off_deg, tilt_deg):
    case = circle_case(60.0, 600.0, off_deg, 35.0, tilt_deg, 160.0)
    pixels = circle_contour(camera, case.center, case.normal, case.radius, 720)
    told = camera_slopes(camera, case.center, case.normal, [(case.radius, 0.0)])
    steps = {"focal": 1e-5, "x": 0.01, "y": 0.01}
    for column, (name, step) in enumerate(steps.items()):
        up, down = (measured(changed(camera, **{name: s}), pixels, case, case.radius) for s in (step, -step))
        found = (up - down) / (2.0 * step)
        size = np.array([np.linalg.norm(found[:3])] * 3 + [np.linalg.norm(found[3:]) + 1e-6] * 2)
        # Where the lens bends a wrong camera's rim into no ellipse, points and length weigh a little differently.
        np.testing.assert_allclose(told[:, column] / size, found / size, atol=1e-4 if camera is PINHOLE else 0.05)


@pytest.mark.parametrize(("name", "step"), [("focal", 0.01), ("x", 2.0), ("y", 2.0)])
def test_the_whole_estimate_moves_with_the_camera_as_told(name, step):
    image, target = disc_image(), Target.circle(RADIUS_MM)
    before = circlepose.estimate(image, CAMERA, target).circles[0].candidates
    up, down = (
        circlepose.estimate(image, changed(CAMERA, **{name: s}), target).circles[0].candidates for s in (step, -step)
    )
    for number, candidate in enumerate(before):
        told = camera_slopes(CAMERA, candidate.center, candidate.normal, [(RADIUS_MM, 0.0)])
        column = told[:, ["focal", "x", "y"].index(name)]
        moved = [(up[number].center - down[number].center), plane_basis(candidate.normal)]
        tilts = np.stack(moved[1]) @ (up[number].normal - down[number].normal)
        np.testing.assert_allclose(moved[0] / (2 * step), column[:3], atol=0.03 * np.linalg.norm(column[:3]))
        np.testing.assert_allclose(tilts / (2 * step), column[3:], atol=0.03 * np.linalg.norm(column[3:]))


@given(circle_cases(25.0, st.floats(10.0, 75.0)), st.floats(0.1, 10.0))
def test_the_camera_term_scales_with_the_lengths(case, longer):
    camera = replace(PINHOLE, sigma=CameraSigma(1.5, 0.7))
    told = camera_term(camera, case.center, case.normal, [(case.radius, 0.0)])
    scaled = camera_term(camera, longer * case.center, case.normal, [(longer * case.radius, 0.0)])
    units = np.array([longer] * 3 + [1.0] * 2)
    # Of a plane that faces the image's plane no camera changes the tilt.
    size = (np.sqrt(np.diag(told)) + np.array([0.0] * 3 + [1e-6] * 2)) * units
    np.testing.assert_allclose(scaled / np.outer(size, size), told * np.outer(units / size, units / size), atol=1e-6)
    doubled = camera_term(
        replace(camera, sigma=CameraSigma(3.0, 1.4)), case.center, case.normal, [(case.radius, 0.0)]
    )
    plain = np.outer(size / units, size / units)
    np.testing.assert_allclose(doubled / plain, 4.0 * told / plain, atol=1e-9)


def test_of_a_small_circle_near_the_axis_the_camera_term_is_known_by_heart():
    """The range errs as the focal length does, the place as the principal point."""
    case = circle_case(2.0, 1000.0, 0.0, 0.0, 45.0, 20.0)
    camera = Camera.create([[1000.0, 0, 639.5], [0, 1000.0, 479.5], [0, 0, 1]], (), (1280, 960))
    rims = [(case.radius, 0.0)]
    focal = camera_term(replace(camera, sigma=CameraSigma(5.0, 0.0)), case.center, case.normal, rims)
    center = camera_term(replace(camera, sigma=CameraSigma(0.0, 0.3)), case.center, case.normal, rims)
    assert np.sqrt(focal[2, 2]) == pytest.approx(5.0, rel=1e-3)
    assert np.sqrt(np.diag(center)[:2]) == pytest.approx([0.3, 0.3], rel=1e-2)


@given(circle_cases(20.0, st.floats(10.0, 60.0)), st.floats(-0.3, 0.3))
def test_one_pose_by_two_rims_moves_the_same_seen_from_either(case, share):
    """About the other circle's centre: the same motion, of a rigid target."""
    along = share * case.radius
    big, small = (case.radius, 0.0), (0.6 * case.radius, along)
    here = camera_slopes(LENS, case.center, case.normal, [big, small])
    there = camera_slopes(
        LENS, case.center + along * case.normal, case.normal, [(small[0], 0.0), (case.radius, -along)]
    )
    moved = here.copy()
    moved[:3] += along * np.stack(plane_basis(case.normal), axis=-1) @ here[3:]
    size = np.linalg.norm(here[:3], axis=0), np.linalg.norm(here[3:], axis=0) + 1e-6
    np.testing.assert_allclose((there - moved)[:3] / size[0], 0.0, atol=1e-6)
    np.testing.assert_allclose((there - moved)[3:] / size[1], 0.0, atol=1e-5)


def test_a_radius_known_to_half_a_percent_moves_the_range_by_half_a_percent():
    image = disc_image()
    target = replace(Target.circle(RADIUS_MM), radius_sigma_mm=0.005 * RADIUS_MM)
    chosen = circlepose.estimate(image, CAMERA, target).circles[0].candidates[0]
    larger = circlepose.estimate(image, CAMERA, Target.circle(1.005 * RADIUS_MM)).circles[0].candidates[0]
    radius = chosen.covariance_terms.radius
    moved = larger.center - chosen.center
    np.testing.assert_allclose(radius[:3, :3], np.outer(moved, moved), rtol=1e-6)
    assert np.sqrt(np.trace(radius)) == pytest.approx(0.005 * np.linalg.norm(chosen.center), rel=1e-9)
    assert not radius[3:].any()
    assert not radius[:, 3:].any()


def test_terms_add_up_to_the_covariance_and_are_stored_and_written():
    camera = replace(CAMERA, sigma=CameraSigma(2.0, 1.0))
    target = replace(Target.circle(RADIUS_MM), radius_sigma_mm=0.02)
    plain = circlepose.estimate(disc_image(), CAMERA, Target.circle(RADIUS_MM), name="a")
    result = circlepose.estimate(disc_image(), camera, target, name="a")
    for before, after in zip(plain.circles[0].candidates, result.circles[0].candidates, strict=True):
        terms = after.covariance_terms
        np.testing.assert_array_equal(terms.image, before.covariance)
        np.testing.assert_allclose(after.covariance, terms.image + terms.camera + terms.radius, rtol=1e-12)
        assert np.linalg.eigvalsh(after.covariance)[0] > 0.0
        np.testing.assert_array_equal(after.center, before.center)
        assert sum(position for position, _ in shares(terms).values()) == pytest.approx(1.0)
    again = restored_result(json.loads(json.dumps(plain_result(result))))
    assert image_record(again) == image_record(result)
    written = image_record(result)["circles"][0]["solutions"][0]["covariance_terms"]
    assert list(written) == ["image", "camera", "radius"]
    assert written["camera"] == result.circles[0].candidates[0].covariance_terms.camera.tolist()


def test_zero_sigmas_change_nothing():
    plain = circlepose.estimate(disc_image(), CAMERA, Target.circle(RADIUS_MM), name="a")
    zero = circlepose.estimate(
        disc_image(),
        replace(CAMERA, sigma=CameraSigma(0.0, 0.0)),
        replace(Target.circle(RADIUS_MM), radius_sigma_mm=0.0),
        name="a",
    )
    assert image_record(zero) == image_record(plain)
    assert plain.circles[0].candidates[0].covariance is not None
    assert plain.circles[0].candidates[0].covariance_terms is None


def ring(center, normal, circle, radius):
    candidate = replace(made_circle().candidates[0], center=center, normal=normal, covariance=IMAGE_TERM)
    return CircleResult(0, circle, "chen-huang", radius, (candidate,))


def test_rings_measured_together_share_a_term_and_others_do_not():
    camera = replace(CAMERA, sigma=CameraSigma(2.0, 1.0))
    case = circle_case(20.0, 200.0, 10.0, 30.0, 40.0, 250.0)
    target = Target("coplanar", (20.0, 12.0))
    turned = case.normal + 1e-3 * plane_basis(case.normal)[0]
    joint = [ring(case.center, case.normal, name, r) for name, r in (("outer", 20.0), ("inner", 12.0))]
    apart = [joint[0], ring(case.center, turned / np.linalg.norm(turned), "inner", 12.0)]
    terms = {
        name: [c.candidates[0].covariance_terms.camera for c in with_all_terms(circles, camera, target)]
        for name, circles in {"joint": joint, "apart": apart}.items()
    }
    np.testing.assert_allclose(*terms["joint"], rtol=1e-9)
    alone = camera_term(camera, case.center, case.normal, [(20.0, 0.0)])
    np.testing.assert_allclose(terms["apart"][0], alone, rtol=1e-9)
    assert not np.allclose(terms["joint"][0], alone, rtol=1e-6)


def test_a_tilt_that_the_camera_leaves_open_has_no_covariance():
    camera = replace(CAMERA, sigma=CameraSigma(0.0, 40.0))
    case = circle_case(20.0, 200.0, 10.0, 30.0, 4.0, 250.0)
    circle = ring(case.center, case.normal, "disc", 20.0)
    (after,) = with_all_terms([circle], camera, Target.circle(20.0))
    assert circle.candidates[0].covariance is not None
    assert after.candidates[0].covariance is None
    assert after.candidates[0].covariance_terms is None


def test_a_pose_without_covariance_stays_so():
    circle = made_circle()
    (after,) = with_all_terms([circle], replace(CAMERA, sigma=CameraSigma(1.0, 1.0)), Target.circle(RADIUS_MM))
    assert [c.covariance for c in after.candidates] == [None, None]


def test_shares_name_what_dominates():
    terms = CovarianceTerms(IMAGE_TERM, radius=radius_term(np.array([0.0, 0.0, 500.0]), 0.01))
    assert shares(terms)["radius"][0] > 0.99
    assert shares(terms)["image"][1] == 1.0
    assert shares(terms)["camera"] == (0.0, 0.0)


def test_a_resized_image_is_known_as_well_as_the_camera():
    camera = replace(PINHOLE, sigma=CameraSigma(1.2, 0.6))
    half = camera.scaled_to((640, 480))
    assert (half.sigma.focal_px, half.sigma.center_px) == pytest.approx((0.6, 0.3))
    case = circle_case(20.0, 300.0, 10.0, 30.0, 40.0, 250.0)
    rims = [(case.radius, 0.0)]
    np.testing.assert_allclose(
        camera_term(half, case.center, case.normal, rims),
        camera_term(camera, case.center, case.normal, rims),
        rtol=1e-6,
    )


OWN = "fx: 400\nfy: 400\ncx: 159.5\ncy: 119.5\n"


def test_files_say_how_well_camera_and_radius_are_known():
    assert read_camera(OWN.encode()).sigma == CameraSigma()
    assert read_camera(f"{OWN}focal_sigma_px: 0.8\ncenter_sigma_px: 0.5\n".encode()).sigma == CameraSigma(0.8, 0.5)
    target = target_from_mapping({"radius_mm": 60.0, "radius_sigma_mm": 0.05}, "t")
    assert target.radius_sigma_mm == 0.05
    assert target_from_mapping(target_to_mapping(target), "t") == target
    assert "radius_sigma_mm" not in target_to_mapping(Target.circle(60.0))


STORAGE = """<?xml version="1.0"?>
<opencv_storage>
<cameraResolution>
  1280 720</cameraResolution>
<cameraMatrix type_id="opencv-matrix">
  <rows>3</rows><cols>3</cols><dt>d</dt>
  <data>1250. 0. 666. 0. 1250. 363. 0. 0. 1.</data></cameraMatrix>
<cameraMatrix_std_dev type_id="opencv-matrix">
  <rows>4</rows><cols>1</cols><dt>d</dt>
  <data>{}</data></cameraMatrix_std_dev>
<dist_coeffs type_id="opencv-matrix">
  <rows>1</rows><cols>5</cols><dt>d</dt>
  <data>0.1 0. 0. 0. 0.</data></dist_coeffs>
</opencv_storage>
"""


def test_opencvs_interactive_calibration_is_read_with_its_deviations():
    camera = read_camera(STORAGE.format("0. 12.5 2.8 2.9").encode())
    # The aspect ratio was kept fixed, so fx has the deviation of fy.
    assert camera.sigma == CameraSigma(12.5, 2.9)
    assert camera.image_size == (1280, 720)


def test_a_written_camera_is_known_as_well(tmp_path, capsys):
    write_camera(replace(PINHOLE, sigma=CameraSigma(0.1 + 0.2, 0.5)), tmp_path / "a.yml")
    assert read_camera(tmp_path / "a.yml").sigma == CameraSigma(0.1 + 0.2, 0.5)
    assert main(["camera", str(tmp_path / "a.yml")]) == 0
    assert "focal length to 0.3 px, principal point to 0.5 px (one sigma)" in capsys.readouterr().out


@pytest.mark.parametrize("values", ["0. -12.5 2.8 2.9", "0. 12.5 2.8 .Nan", "0. .Inf 2.8 1."])
def test_deviations_that_are_none_are_refused(values):
    with pytest.raises(CalibrationError, match="cameraMatrix_std_dev"):
        read_camera(STORAGE.format(values).encode())


@pytest.mark.parametrize("value", [-0.1, 60.0, float("nan"), float("inf"), "much"])
def test_a_radius_known_so_is_refused(value):
    with pytest.raises(TargetError, match="radius_sigma_mm"):
        target_from_mapping({"radius_mm": 60.0, "radius_sigma_mm": value}, "t")


@pytest.mark.parametrize("key", ["focal_sigma_px", "center_sigma_px"])
@pytest.mark.parametrize("value", ["-1", ".nan", "much", ""])
def test_a_camera_known_so_is_refused(key, value):
    with pytest.raises(CalibrationError, match=key):
        read_camera(f"{OWN}{key}: {value}\n".encode())


def sigmas(capsys, *options):
    assert main(["estimate", *options, "--format", "json", "-q"]) == 0
    solution = json.loads(capsys.readouterr().out)["images"][0]["circles"][0]["solutions"][0]
    return solution["sigma_z_mm"], solution["covariance_terms"]


def test_options_go_before_files(capsys, tmp_path):
    folder = disc_folder(tmp_path / "a", 1)
    plain, no_terms = sigmas(capsys, str(folder))
    assert no_terms is None
    wide, terms = sigmas(capsys, str(folder), "--camera-sigma", "4,1", "--radius-sigma-mm", "0.1")
    assert np.sqrt(terms["radius"][2][2]) == pytest.approx(0.005 * 200.0, rel=0.01)
    assert wide**2 == pytest.approx(sum(terms[name][2][2] for name in terms))
    assert wide > 50.0 * plain
    (folder / "target.yaml").write_text(f"radius_mm: {RADIUS_MM}\nradius_sigma_mm: 0.1\n")
    with (folder / "camera.yaml").open("a") as camera:
        camera.write("focal_sigma_px: 4\ncenter_sigma_px: 1\n")
    assert sigmas(capsys, str(folder)) == (wide, terms)
    assert sigmas(capsys, str(folder), "--camera-sigma", "0,0", "--radius-sigma-mm", "0") == (plain, None)


@pytest.mark.parametrize(
    "options",
    [["--camera-sigma", text] for text in ("1", "1,2,3", "-1,0", "nan,0", "1,inf", "a,b", "")]
    + [["--radius-sigma-mm", text] for text in ("-1", "nan", "20")],
)
def test_impossible_deviations_end_with_2(capsys, tmp_path, options):
    folder = disc_folder(tmp_path / "a", 1)
    assert main(["estimate", str(folder), *options]) == 2
    out = capsys.readouterr()
    assert out.out == ""
    assert "expected" in out.err
