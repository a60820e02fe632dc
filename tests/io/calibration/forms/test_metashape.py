from __future__ import annotations

import pytest

from circlepose.io.calibration.reader import read_camera_file
from tests.support.projected_points import assert_pixels, brown, equidistant
from tests.support.refusals import refused_calibration

HEAD = '<?xml version="1.0" encoding="UTF-8"?>\n'


def calibration(projection: str = "frame", **terms: float | str) -> bytes:
    size = "  <width>1920</width>\n  <height>1080</height>\n"
    inner = "".join(f"  <{name}>{value}</{name}>\n" for name, value in terms.items())
    text = (
        f"<calibration>\n  <projection>{projection}</projection>\n{size}{inner}  <date>2021-03-04T05:06:07Z</date>\n"
    )
    return f"{HEAD}{text}</calibration>\n".encode()


def metashape_frame(x: float, y: float) -> tuple[float, float]:
    """Appendix "Camera models" of the manual, frame cameras, moved by half a pixel to OpenCV's pixels."""
    k1, k2, k3, p1, p2, b1, b2, f, cx, cy = -0.11, 0.06, -0.01, 3e-4, -8e-4, 1.5, -4.25, 1430.5, -24.25, 17.5
    r2 = x * x + y * y
    radial = 1 + k1 * r2 + k2 * r2**2 + k3 * r2**3
    u = x * radial + p1 * (r2 + 2 * x * x) + 2 * p2 * x * y
    v = y * radial + p2 * (r2 + 2 * y * y) + 2 * p1 * x * y
    return 1920 * 0.5 + cx + u * f + u * b1 + v * b2 - 0.5, 1080 * 0.5 + cy + v * f - 0.5


TERMS = {"f": 1430.5, "cx": -24.25, "cy": 17.5, "b1": 1.5, "b2": -4.25, "k1": -0.11, "k2": 0.06, "k3": -0.01}
TERMS |= {"p1": 3e-4, "p2": -8e-4}


def test_a_frame_camera_as_the_manual_has_it() -> None:
    file = read_camera_file(calibration(**TERMS))
    assert file.form == "Metashape"
    assert file.camera.image_size == (1920, 1080)
    assert_pixels(file.camera, metashape_frame)
    assert [note.split(":")[0] for note in file.notes] == [
        "cx, cy moved by (959.5, 539.5) px",
        "b1 is part of fx, and b2 is the skew",
        "p1 and p2 exchanged",
    ]


def test_a_fisheye_camera_has_k4() -> None:
    file = read_camera_file(calibration("fisheye", f=600.0, cx=3.0, k1=0.02, k2=-0.01, k3=2e-3, k4=1e-4))

    def pixel(x: float, y: float) -> tuple[float, float]:
        u, v = equidistant(x, y, (0.02, -0.01, 2e-3, 1e-4))
        return 960 + 3.0 + 600.0 * u - 0.5, 540 + 600.0 * v - 0.5

    assert_pixels(file.camera, pixel)


def test_the_former_form_states_the_principal_point_from_the_corner() -> None:
    terms = {"fx": 1400.0, "fy": 1402.0, "cx": 955.0, "cy": 530.0, "skew": 2.0, "k1": -0.1, "k2": 0.02, "k3": 1e-3}
    file = read_camera_file(calibration(**terms, k4=0, p1=1e-3, p2=-2e-3))

    def pixel(x: float, y: float) -> tuple[float, float]:
        # Manual of Agisoft Lens: x' = ... + P2 (r^2 + 2 x^2) + 2 P1 x y, as in OpenCV.
        u, v = brown(x, y, (-0.1, 0.02, 1e-3), 1e-3, -2e-3)
        return 955.0 + 1400.0 * u + 2.0 * v - 0.5, 530.0 + 1402.0 * v - 0.5

    assert_pixels(file.camera, pixel)
    assert file.notes == ("cx, cy moved by -0.5 px: the center of Agisoft's top left pixel is (0.5, 0.5)",)


def sensor(label: str, number: int, f: float, kind: str = "adjusted") -> str:
    inner = f'<resolution width="1920" height="1080"/><f>{f}</f><k1>0.01</k1>'
    calibrated = f'<calibration type="frame" class="{kind}">{inner}</calibration>'
    size = '<resolution width="1920" height="1080"/>'
    return f'<sensor id="{number}" label="{label}" type="frame">{size}{calibrated}</sensor>'


def document(*sensors: str) -> bytes:
    inner = "".join(sensors)
    cameras = '<cameras><camera id="0" sensor_id="0" label="a.jpg"><transform>1 0 0 0</transform></camera></cameras>'
    return f'{HEAD}<document version="2.0.0"><chunk><sensors>{inner}</sensors>{cameras}</chunk></document>'.encode()


def test_the_sensors_of_a_project() -> None:
    content = document(sensor("left", 0, 1000.0), sensor("right", 1, 1100.0), '<sensor id="2" label="none"/>')
    file = read_camera_file(content)
    assert file.notes[0] == "left taken, of the 2 cameras left, right"
    assert_pixels(file.camera, lambda x, y: tuple(map(sum, zip(
        (959.5, 539.5), (1000.0 * each for each in brown(x, y, (0.01,))), strict=True
    ))))  # fmt: skip
    assert read_camera_file(content, "right").camera.camera_matrix[0, 0] == 1100.0


def test_the_adjusted_calibration_goes_before_the_initial_one() -> None:
    initial = '<calibration class="initial"><resolution width="1920" height="1080"/><f>900</f></calibration>'
    content = document(sensor("one", 0, 1000.0).replace("</sensor>", f"{initial}</sensor>"))
    assert read_camera_file(content).camera.camera_matrix[0, 0] == 1000.0


@pytest.mark.parametrize(
    ("content", "words"),
    [
        (calibration(**TERMS, k4=1e-3), "k4: is 0.001, a term that OpenCV's lens models do not have"),
        (calibration(**TERMS, p3=1e-3), "p3: is 0.001, a term"),
        (calibration(**TERMS, k5=1e-3), "k5: is 0.001, a term"),
        (calibration("fisheye", f=600.0, p1=1e-3), "p1: is 0.001, a term"),
        (calibration("spherical", f=600.0), "projection: is 'spherical'; only frame and"),
        (calibration(cx=1.0), "f: is missing"),
        (calibration(f=600.0, skew=1.0), "f: stands beside fx, fy or skew, of a former version"),
        (calibration(f="long"), "f: expected a number, got 'long'"),
        (calibration(f=600.0).replace(b"<width>1920</width>", b""), "width, height: are missing"),
        (calibration(f=600.0, k1="0</k1><k1>1"), "k1: is given twice"),
        (document(), "holds no sensor with a calibration"),
        (calibration(f=600.0)[:-9], "is not valid XML"),
        (calibration(f=600.0).replace(b"frame", b"<!ENTITY a 'b'>"), "declares a document type or entities"),
        (calibration(f=-600.0), "f, cx, cy: is singular or mirrored"),
    ],
)
def test_what_is_wrong_is_said_in_a_sentence(content: bytes, words: str) -> None:
    content = content.replace(b"<sensors></sensors>", b"<sensors><sensor/></sensors>")
    assert words in refused_calibration(content)
