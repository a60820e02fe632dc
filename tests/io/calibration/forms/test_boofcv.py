from __future__ import annotations

import pytest

from circlepose.io.calibration.reader import read_camera_file
from tests.support.lens_formulas import POINTS, brown, check_pixels, kannala_brandt
from tests.support.refusals import refused_calibration

FOCAL, CENTER = (905.5, 907.0), (640.25, 355.75)
PINHOLE = (
    "pinhole:\n  fx: 905.5\n  fy: 907.0\n  cx: 640.25\n  cy: 355.75\n  width: 1280\n  height: 720\n  skew: {skew}\n"
)
BROWN = (
    "# Pinhole camera model with radial and tangential distortion\n\nradial_tangential:\n  radial:\n  - -0.06\n"
    f"  - 0.02\n  t1: 0.001\n  t2: -0.002\n{PINHOLE}model: pinhole_radial_tangential\nversion: 0\n"
)
KANNALA = (
    f"model: kannala_brandt\nversion: 0\n{PINHOLE}symmetric: [1.25, 0.03, -0.01, 0.002, 0.001]\n"
    "radial: []\nradial_trig: []\ntangent: []\ntangent_trig: []\n"
)
OMNI = (
    f"model: omnidirectional_universal\nversion: 0\n{PINHOLE}mirror_offset: 0.9\n"
    "radial_tangential: {t1: 0.0, t2: 0.0}\n"
)


def with_skew(text: str, skew: float = 0.0) -> str:
    return text.replace("{skew}", str(skew))


def test_t1_and_t2_are_p1_and_p2() -> None:
    file = read_camera_file(with_skew(BROWN).encode())
    assert file.form == "BoofCV camera"
    assert file.camera.image_size == (1280, 720)
    check_pixels(file.camera, [brown(p, FOCAL, CENTER, [-0.06, 0.02], (0.001, -0.002)) for p in POINTS])


def test_skew_and_a_third_radial_term() -> None:
    text = with_skew(BROWN, 1.5).replace("  - 0.02\n", "  - 0.02\n  - 0.004\n")
    expected = []
    for p in POINTS:
        u, v = brown(p, FOCAL, CENTER, [-0.06, 0.02, 0.004], (0.001, -0.002))
        expected.append((u + 1.5 * (v - 355.75) / 907.0, v))
    check_pixels(read_camera_file(text.encode()).camera, expected)


def test_a_pinhole_without_distortion() -> None:
    camera = read_camera_file(with_skew(f"model: pinhole\nversion: 0\n{PINHOLE}").encode()).camera
    check_pixels(camera, [brown(p, FOCAL, CENTER, []) for p in POINTS])


def test_kannala_brandt_is_scaled_so_that_the_first_term_is_one() -> None:
    file = read_camera_file(with_skew(KANNALA).encode())
    terms = [0.03 / 1.25, -0.01 / 1.25, 0.002 / 1.25, 0.001 / 1.25]
    check_pixels(file.camera, [kannala_brandt(p, (1.25 * 905.5, 1.25 * 907.0), CENTER, terms) for p in POINTS])
    assert any("symmetric[0] = 1.25" in note for note in file.notes)


def test_a_stereo_file() -> None:
    left = "\n".join("  " + line for line in with_skew(BROWN).splitlines())
    right = left.replace("905.5", "911.0")
    text = f"model: stereo_camera\nversion: 0\nleft:\n{left}\nright:\n{right}\nrightToLeft:\n  x: 0.1\n"
    assert any("left taken" in note for note in read_camera_file(text.encode()).notes)
    assert read_camera_file(text.encode(), "right").camera.camera_matrix[0, 0] == 911.0
    assert "its cameras are left, right" in refused_calibration(text, "center")


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (OMNI, "omnidirectional"),
        (KANNALA.replace("radial: []", "radial: [0.1]"), "not symmetric"),
        (KANNALA.replace("symmetric: [1.25", "symmetric: [-1.25"), "symmetric: expected"),
        (KANNALA.replace("0.001]", "0.001, 0.1]"), "symmetric[5]"),
        (BROWN.replace("  - 0.02\n", "  - 0.02\n  - 0.0\n  - 0.1\n"), "radial_tangential.radial[3]"),
        (BROWN.replace("radial_tangential:\n", "radial:\n", 1), "radial_tangential: is missing"),
        (BROWN.replace("fy: 907.0", "fz: 907.0"), "pinhole.fy: is missing"),
        (BROWN.replace("model: pinhole_radial", "model: wide_radial"), "model: expected one of pinhole"),
    ],
)
def test_what_is_refused(text: str, said: str) -> None:
    assert said in refused_calibration(with_skew(text))
    assert "leave out the name" in refused_calibration(with_skew(text), "left")
