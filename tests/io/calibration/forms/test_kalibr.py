from __future__ import annotations

import pytest

from circlepose.errors import CalibrationError
from circlepose.io.calibration.reader import read_camera_file
from tests.support.lens_formulas import CX, CY, FX, FY, SIZE, check_terms

D = [-0.215, 0.094, 4.5e-4, -2.5e-4]
TERMS = dict(zip(("k1", "k2", "p1", "p2"), D, strict=True))
FISHEYE = {"k1": -0.02, "k2": 0.004, "k3": -0.001, "k4": 0.0002}


def camera(model: str = "radtan", dist: list[float] = D, camera_model: str = "pinhole") -> str:
    return (
        f"  cam_overlaps: [1]\n  camera_model: {camera_model}\n  distortion_coeffs: {dist}\n"
        f"  distortion_model: {model}\n  intrinsics: [{FX}, {FY}, {CX}, {CY}]\n  resolution: [1280, 960]\n"
        "  rostopic: /cam/image_raw\n"
    )


@pytest.mark.parametrize("model", ["radtan", "plumb_bob", "radial-tangential"])
@pytest.mark.parametrize("third", [[], [0.013]])
def test_pinhole(model: str, third: list[float]) -> None:
    file = read_camera_file(f"cam0:\n{camera(model, D + third)}".encode())
    assert (file.form, file.camera.image_size) == ("Kalibr camchain", SIZE)
    check_terms(file, {**TERMS, "k3": sum(third)})


def test_equidistant_alone_and_in_a_chain() -> None:
    fisheye = camera("equidistant", list(FISHEYE.values()))
    alone = "\n".join(line.strip() for line in fisheye.splitlines())
    check_terms(read_camera_file(alone.encode()), FISHEYE, fisheye=True)
    chain = f"cam0:\n{camera()}cam1:\n  T_cn_cnm1:\n  - [1.0, 0.0, 0.0, 0.0]\n{fisheye}".encode()
    first = read_camera_file(chain)
    check_terms(first, TERMS)
    assert first.notes == ("cam0 taken, of the 2 cameras cam0, cam1",)
    check_terms(read_camera_file(chain, "cam1"), FISHEYE, fisheye=True)


@pytest.mark.parametrize(
    ("text", "says"),
    [
        (camera("fov", [0.9]), "'fov' is the field-of-view model, which circlepose does not have; calibrate again"),
        (camera("none", [], "ds"), "'ds' is the double sphere model"),
        (camera("none", [0.1]), "stand beside the distortion model none"),
        (camera("equidistant", D[:3]), "equidistant has 4 coefficients, got 3"),
        (camera("radtan", D, "fisheye"), "camera_model, distortion_model: contradict each other"),
        (camera("radtn"), "distortion_model: expected a pinhole model"),
    ],
)
def test_what_is_refused(text: str, says: str) -> None:
    with pytest.raises(CalibrationError) as caught:
        read_camera_file(f"cam0:\n{text}".encode())
    assert str(caught.value).startswith("<bytes>: cam0: ")
    assert says in str(caught.value)


def test_the_report_of_kalibr_is_answered_with_the_file_to_give() -> None:
    text = "Camera-system parameters:\n\tcam0 (/cam/image_raw):\n\t distortion: [ 0.1 ] +- [ 0.01 ]\n"
    with pytest.raises(CalibrationError, match="is Kalibr's report; give the camchain"):
        read_camera_file(text.encode())
