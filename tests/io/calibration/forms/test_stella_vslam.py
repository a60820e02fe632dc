from __future__ import annotations

import pytest

from circlepose.io.calibration.reader import read_camera_file
from tests.support.lens_formulas import POINTS, brown, check_pixels, kannala_brandt
from tests.support.refusals import refused_calibration

FOCAL, CENTER = (705.5, 707.0), (640.25, 355.75)
PERSPECTIVE = {"model": '"perspective"', "k1": -0.06, "k2": 0.02, "p1": 0.001, "p2": -0.002, "k3": 0.004}
FISHEYE = {"model": '"fisheye"', "k1": 0.03, "k2": -0.01, "k3": 0.002, "k4": 0.001}
SHARED = {
    **{"name": '"Bench cam"', "setup": '"monocular"', "fx": 705.5, "fy": 707.0, "cx": 640.25, "cy": 355.75},
    **{"fps": 30.0, "cols": 1280, "rows": 720, "color_order": '"RGB"'},
}


def nested(lens: dict[str, object]) -> str:
    lines = "".join(f"  {key}: {value}\n" for key, value in (SHARED | lens).items())
    return f"Camera:\n{lines}\nPreprocessing:\n  min_size: 800\nFeature:\n  scale_factor: 1.2\n"


def flat(lens: dict[str, object]) -> str:
    return "".join(f"Camera.{key}: {value}\n" for key, value in (SHARED | lens).items()) + "Feature.num_levels: 8\n"


@pytest.mark.parametrize("written", [nested, flat])
def test_perspective_and_fisheye(written) -> None:  # type: ignore[no-untyped-def]
    file = read_camera_file(written(PERSPECTIVE).encode(), "Bench cam")
    assert file.form == "stella_vslam configuration"
    assert file.camera.image_size == (1280, 720)
    check_pixels(file.camera, [brown(p, FOCAL, CENTER, [-0.06, 0.02, 0.004], (0.001, -0.002)) for p in POINTS])
    camera = read_camera_file(written(FISHEYE).encode()).camera
    check_pixels(camera, [kannala_brandt(p, FOCAL, CENTER, [0.03, -0.01, 0.002, 0.001]) for p in POINTS])


@pytest.mark.parametrize(
    ("lens", "said"),
    [
        ({"model": '"equirectangular"'}, "map of directions"),
        ({"model": '"radial_division"', "distortion": 0.1}, "division model"),
        (PERSPECTIVE | {"k4": 0.1}, "Camera.k4: is 0.1"),
        (FISHEYE | {"p1": 0.1}, "Camera.p1: is 0.1"),
        ({"model": '"fisheye"', "k1": 0.1}, "Camera.k2: is missing"),
        (PERSPECTIVE | {"fx": "none"}, "Camera.fx: expected a number"),
        (PERSPECTIVE | {"rows": 0}, "Camera.cols, Camera.rows"),
    ],
)
def test_what_is_wrong_is_named(lens: dict[str, object], said: str) -> None:
    assert said in refused_calibration(nested(lens))


def test_another_name() -> None:
    assert "only Bench cam" in refused_calibration(nested(PERSPECTIVE), "cam0")
