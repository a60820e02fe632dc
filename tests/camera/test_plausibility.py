"""What no camera has is refused; what cameras have, however odd, is not."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import circlepose
from circlepose.camera.camera import Camera
from circlepose.camera.image_size import is_resized, size_mismatch
from circlepose.camera.plausibility import doubts, misfit
from circlepose.io.calibration.reader import read_camera_file
from circlepose.results import Status
from circlepose_cli.app import main
from tests.support.discs import CAMERA, RADIUS_MM, disc_folder, disc_image


@pytest.fixture
def run(capsys: pytest.CaptureFixture[str]) -> Any:
    """Run a command line; returns exit code, standard output and standard error."""

    def run_it(*args: object) -> tuple[int, str, str]:
        code = main([str(arg) for arg in args])
        captured = capsys.readouterr()
        return code, captured.out, captured.err

    return run_it


SIDES = st.integers(64, 6000)
SIZES = st.tuples(SIDES, SIDES)


def camera(
    size: tuple[int, int] | None, focal_px: float, center: Any, dist: Any = (), model: Any = "pinhole"
) -> Camera:
    cx, cy = center
    return Camera.create([[focal_px, 0, cx], [0, focal_px, cy], [0, 0, 1]], dist, size, model)


def centered(size: tuple[int, int], focal_px: float, dist: Any = (), model: Any = "pinhole") -> Camera:
    return camera(size, focal_px, ((size[0] - 1) / 2, (size[1] - 1) / 2), dist, model)


def is_refused(made: Camera) -> bool:
    return any(doubt.is_grave for doubt in doubts(made))


# --- The focal length ---


@given(SIZES, st.floats(1.0, 135.0), st.floats(-0.1, 0.1), st.floats(-0.1, 0.1))
def test_every_pinhole_camera_that_exists_passes(
    size: tuple[int, int], diagonal_deg: float, right: float, down: float
) -> None:
    focal_px = 0.5 * math.hypot(*size) / math.tan(math.radians(diagonal_deg / 2))
    center = ((size[0] - 1) / 2 + right * size[0], (size[1] - 1) / 2 + down * size[1])
    made = camera(size, focal_px, center)
    assert not is_refused(made)
    assert (
        misfit(replace(made, image_size=None), size) is None or max(right, down) > 0.099 or min(right, down) < -0.099
    )


@given(SIZES, st.floats(100.0, 280.0))
def test_every_fisheye_that_exists_passes(size: tuple[int, int], degrees: float) -> None:
    # Its image circle fills the shorter side.
    assert not is_refused(centered(size, 0.5 * min(size) / math.radians(degrees / 2), [0.0] * 4, "fisheye"))


@given(st.floats(1.0, 50.0), st.floats(0.001, 0.006), SIZES.filter(lambda size: min(size) >= 480))
def test_a_focal_length_in_mm_is_refused_whatever_lens_and_sensor(
    focal_mm: float, pixel_mm: float, size: tuple[int, int]
) -> None:
    # Up to the wide end of telephoto lenses, in mm, on any sensor of usual pixels.
    if math.hypot(*size) / 2 / focal_mm < math.tan(math.radians(75)):
        return
    assert not is_refused(centered(size, max(focal_mm / pixel_mm, 0.3 * math.hypot(*size))))
    for made in (centered(size, focal_mm), replace(centered(size, focal_mm), image_size=None)):
        (doubt,) = (doubt for doubt in doubts(made) if doubt.is_grave)
        assert doubt.about == "camera_matrix"
        assert "looks like a focal length in mm" in doubt.text
    fisheye = centered(size, focal_mm, [0.0] * 4, "fisheye")
    assert is_refused(fisheye) is (min(size) / 2 / focal_mm > math.pi)


# --- The principal point ---


@pytest.mark.parametrize("factor", [0.25, 0.5, 2 / 3, 0.75, 0.8, 1.3, 4 / 3, 1.5, 2.0, 4.0])
def test_a_calibration_for_another_resolution_is_seen_by_its_principal_point(factor: float) -> None:
    size = (1280, 960)
    other = (round(size[0] * factor), round(size[1] * factor))
    unsized = replace(centered(size, 1200.0), image_size=None)
    reason = misfit(unsized, other)
    assert reason is not None
    assert "another resolution, about 1280 x 960 px" in reason
    assert misfit(unsized, size) is None


@pytest.mark.parametrize("size", [(1280, 960), (1920, 1080), (640, 480)])
def test_a_turned_image_is_seen_by_the_principal_point(size: tuple[int, int]) -> None:
    reason = misfit(replace(centered(size, 1200.0), image_size=None), size[::-1])
    assert reason is not None
    assert "looks turned by 90 deg" in reason


@given(st.floats(0.46, 50.0), st.sampled_from([(1, 0), (0, 1), (-1, 0), (0, -1), (1, 1), (-1, 1)]))
def test_a_principal_point_at_the_border_or_beyond_is_refused(offset: float, way: tuple[int, int]) -> None:
    center = (639.5 + offset * way[0] * 1280, 479.5 + offset * way[1] * 960)
    assert is_refused(camera((1280, 960), 1200.0, center))
    assert misfit(camera(None, 1200.0, center), (1280, 960)) is not None


# --- The lens ---


def test_lenses_as_they_are_pass() -> None:
    for size, focal_px, dist in (
        ((640, 480), 536.0, [-0.266, -0.039, 0.0018, -0.0003, 0.238]),
        ((752, 480), 459.0, [-0.288, 0.078, 0.0002, -0.0001]),
        # A lens of 120 deg by the rational model, and small images of strong coefficients that cancel.
        ((2880, 1860), 1495.0, [0.93, 0.166, 0.0, 0.0, 0.0029, 1.3314, 0.4358, 0.0276]),
        ((250, 250), 203.0, [-3.475, -38.57, 0.0003, -9e-5, 286.44, -3.641, -36.69, 279.05]),
        # Corners beyond the lens model.
        ((640, 512), 440.6, [-0.429, 0.197, 0.0, 0.0, -0.045]),
    ):
        assert not is_refused(centered(size, focal_px, dist))
    assert not is_refused(centered((512, 512), 191.0, [0.0035, 0.0007, -0.002, 0.0002], "fisheye"))


@pytest.mark.parametrize(("model", "count"), [("pinhole", 5), ("fisheye", 4)])
@given(k1=st.floats(-30.0, -3.0))
def test_a_lens_that_folds_inside_the_image_is_refused(model: str, count: int, k1: float) -> None:
    made = centered((640, 480), 400.0 if model == "pinhole" else 150.0, [k1, *[0.0] * (count - 1)], model)
    (doubt,) = (doubt for doubt in doubts(made) if doubt.is_grave)
    assert doubt.about == "dist_coeffs"
    assert "folds inside the image" in doubt.text


@given(st.floats(2.5, 100.0))
def test_a_pincushion_that_no_lens_has_is_refused(k1: float) -> None:
    assert is_refused(centered((640, 480), 400.0, [k1, 0.0, 0.0, 0.0, 0.0]))


def test_coefficients_are_judged_by_what_they_do_in_the_image_not_by_their_size() -> None:
    dist = [2.58, -140.2, 0.0, 0.0, 2697.3]
    assert [doubt.about for doubt in doubts(centered((640, 480), 1430.0, dist))] == ["dist_coeffs"]
    assert doubts(centered((640, 480), 14300.0, dist)) == ()


@given(st.lists(st.floats(-9e8, 9e8), min_size=9, max_size=9))
def test_no_number_is_too_odd_to_be_judged(values: list[float]) -> None:
    fx, fy, cx, cy = abs(values[0]) + 1e-3, abs(values[1]) + 1e-3, values[2], values[3]
    for count, model in ((5, "pinhole"), (4, "fisheye")):
        made = Camera.create([[fx, 0, cx], [0, fy, cy], [0, 0, 1]], values[4 : 4 + count], None, model)  # type: ignore[arg-type]
        for one in (made, replace(made, image_size=(640, 480))):
            assert all(len(doubt.text) < 500 for doubt in doubts(one))
            misfit(one, (640, 480))


# --- The size of the image ---


@given(SIZES, st.floats(0.05, 20.0), st.sampled_from([math.floor, round, math.ceil]), st.booleans())
def test_a_resized_image_is_taken_whatever_way_its_size_was_rounded(
    size: tuple[int, int], factor: float, rounded: Any, is_even: bool
) -> None:
    step = 2 if is_even else 1
    width, height = (step * rounded(side * factor / step) for side in size)
    if min(width, height) < 8 or width == size[0] or height == size[1]:
        return
    if factor > 1.0 and is_even:
        # Only the smaller image's pixels are coarse.
        return
    assert is_resized((width, height), size)
    assert size_mismatch((width, height), size, scaled=True) is None
    assert "set scale_calibration" in (size_mismatch((width, height), size) or "")


@given(SIZES, st.floats(0.1, 1.0), st.integers(3, 5000))
def test_an_image_that_was_cropped_by_more_than_rounding_is_refused(
    size: tuple[int, int], factor: float, cut: int
) -> None:
    width, height = round(size[0] * factor), round(size[1] * factor)
    # More than two pixels of rounding along either side can make up for.
    if width < 64 or height - cut < 64 or cut < 2.0 * (height / width + 1.0) + 2.0:
        return
    cropped = (width, height - cut)
    if is_resized(cropped, size[::-1]):
        return
    reason = size_mismatch(cropped, size, scaled=True)
    assert reason is not None
    assert "looks cropped" in reason


@pytest.mark.parametrize("size", [(960, 1280), (480, 640), (1440, 1920)])
def test_a_turned_image_is_called_so(size: tuple[int, int]) -> None:
    for scaled in (False, True):
        assert "looks turned by 90 deg" in (size_mismatch(size, (1280, 960), scaled=scaled) or "")


def test_a_strip_cut_off_one_side_is_no_resizing() -> None:
    assert size_mismatch((1280, 959), (1280, 960), scaled=True)
    assert size_mismatch((1279, 960), (1280, 960), scaled=True)


# --- estimate ---


def test_estimate_refuses_what_cannot_fit_and_can_be_made_to() -> None:
    image, target = disc_image(), circlepose.Target.circle(RADIUS_MM)

    def status(made: Camera, **options: bool) -> Status:
        return circlepose.estimate(image, made, target, **options).status

    double = centered((640, 480), 800.0)
    assert status(CAMERA) is Status.OK
    assert status(double) is Status.SIZE_MISMATCH
    assert status(double, force_calibration=True) is Status.SIZE_MISMATCH
    assert status(double, scale_calibration=True) is Status.OK
    assert status(centered((240, 320), 400.0), scale_calibration=True) is Status.SIZE_MISMATCH
    assert status(centered((240, 320), 400.0), scale_calibration=True, force_calibration=True) is Status.OK
    corner = replace(double, image_size=None)
    assert status(corner) is Status.SIZE_MISMATCH
    assert status(corner, force_calibration=True) is Status.OK
    in_mm = circlepose.estimate(image, camera(None, 8.0, (4.0, 3.0)), target)
    assert (in_mm.status, "in mm" in in_mm.reason, "set force_calibration" in in_mm.reason) == (
        Status.SIZE_MISMATCH,
        True,
        True,
    )


def test_the_judgement_of_a_batch_is_made_once_for_equal_cameras(monkeypatch: pytest.MonkeyPatch) -> None:
    calls = []
    rays = Camera.rays
    monkeypatch.setattr(Camera, "rays", lambda self, pixels: calls.append(1) or rays(self, pixels))
    for _ in range(3):
        misfit(centered((641, 479), 512.25, [-0.01, 0.0, 0.0, 0.0]), (641, 479))
    assert len(calls) <= 3


# --- The command ---


@pytest.mark.parametrize(
    ("yaml", "says"),
    [
        ("fx: 8\nfy: 8\ncx: 159.5\ncy: 119.5\nimage_size: [320, 240]\n", "fx: a focal length of 8 px in an image of"),
        ("fx: 8\nfy: 8\ncx: 159.5\ncy: 119.5\n", "fx: a focal length of 8 px would see 17"),
        (
            "fx: 400\nfy: 400\ncx: 319.5\ncy: 239.5\nimage_size: [320, 240]\n",
            "fx: the principal point (319.5, 239.5) px",
        ),
        (
            "fx: 400\nfy: 400\ncx: 159.5\ncy: 119.5\ndist_coeffs: [-9, 0, 0, 0]\nimage_size: [320, 240]\n",
            "dist_coeffs:",
        ),
    ],
)
def test_what_the_file_alone_shows_ends_with_2_and_can_be_insisted_on(run: Any, tmp_path: Any, yaml: str, says: str):
    folder = disc_folder(tmp_path / "imgs", 1)
    (folder / "camera.yaml").write_text(yaml)
    for command in (["estimate", folder], ["explain", folder / "disc0.png"]):
        code, out, err = run(*command)
        assert (code, out) == (2, "")
        assert err.startswith(f"circlepose: {folder / 'camera.yaml'}: {says}")
        assert err.count("\n") == 1
        assert "--force-calib" in err
        code, _, err = run(*command, "--force-calib")
        assert code in {0, 3}
        # What is doubtful is still said.
        assert says.partition(": ")[2] in err
    code, out, _ = run("camera", folder / "camera.yaml")
    assert code == 0
    assert "warning" in out
    assert says.partition(": ")[2] in " ".join(out.split())


def test_what_the_image_shows_is_a_status_of_its_row(run: Any, tmp_path: Any):
    folder = disc_folder(tmp_path / "imgs", 0)
    image = disc_image()
    cv2.imwrite(str(folder / "cropped.png"), image[:, 40:])
    cv2.imwrite(str(folder / "half.png"), cv2.resize(image, None, fx=0.5, fy=0.5, interpolation=cv2.INTER_AREA))
    cv2.imwrite(str(folder / "turned.png"), np.rot90(image))
    cv2.imwrite(str(folder / "whole.png"), image)
    code, out, err = run("estimate", folder, "--scale-calib", "--format", "csv")
    assert code == 3
    statuses = {line.split(",")[0]: line.split(",")[6] for line in out.splitlines()[1:]}
    assert statuses == {
        "cropped.png": "size_mismatch",
        "half.png": "ok",
        "turned.png": "size_mismatch",
        "whole.png": "ok",
    }
    assert "cropped.png: the image is 280 x 240 px, the calibration holds for 320 x 240, which has other prop" in err
    assert (
        "turned.png: the image is 240 x 320 px, the calibration holds for 320 x 240: it looks turned by 90 deg" in err
    )
    (folder / "camera.yaml").write_text("fx: 400\nfy: 400\ncx: 159.5\ncy: 119.5\n")
    code, out, err = run("estimate", folder, "--format", "csv")
    statuses = {line.split(",")[0]: line.split(",")[6] for line in out.splitlines()[1:]}
    # What was cut off one side moves the principal point by as little as some lenses do.
    assert (statuses["half.png"], statuses["turned.png"], statuses["whole.png"]) == (
        "size_mismatch",
        "size_mismatch",
        "ok",
    )
    assert "half.png: the principal point (159.5, 119.5) px is 50 % of the size of an image of 160 x 120 px" in err


def test_real_calibrations_pass(shared_data: Any) -> None:
    files = sorted(shared_data.glob("*/camera.yml"))
    assert files
    for file in files:
        read_camera_file(file).refuse_grave()
