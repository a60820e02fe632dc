"""Kalibr camchain of one camera, `cam0`: `pinhole` with `radtan` (k1 k2 p1 p2) or `equidistant` (k1 k2 k3 k4).

Pixels are OpenCV's. Kalibr wants floats with a point, a principal point that is not negative, whole numbers for the
resolution, and a topic. Source: Kalibr's wiki, page yaml-formats, and kalibr_common/ConfigReader.py.
"""

from __future__ import annotations

from circlepose.io.calibration.number_text import number_list_text
from circlepose.io.calibration.writers.writer import NAME, Contents, Lens, Writer
from circlepose.io.marks import COMMENT

_CAMERA, _TOPIC = "cam0", "/cam0/image_raw"


def _text(contents: Contents) -> str:
    width, height = contents.size
    return (
        f"{COMMENT}\n"
        f"{_CAMERA}:\n"
        "  camera_model: pinhole\n"
        f"  intrinsics: [{number_list_text(contents.focal_and_center)}]\n"
        f"  distortion_model: {contents.lens.name}\n"
        f"  distortion_coeffs: [{number_list_text(contents.camera.dist_coeffs)}]\n"
        f"  resolution: [{width}, {height}]\n"
        f"  rostopic: {_TOPIC}\n"
    )


def _refusal(contents: Contents) -> str | None:
    *_, cx, cy = contents.focal_and_center
    if min(cx, cy) < 0.0:
        return f"takes no negative principal point, and it is ({cx:g}, {cy:g}) px"
    return None


def _remarks(contents: Contents) -> tuple[str, ...]:
    said = f"rostopic is {_TOPIC}: put the topic of your images there, where Kalibr is to use it"
    if contents.name and contents.name != _CAMERA:
        return (said, f"the camera {contents.name} is called {_CAMERA}: Kalibr counts its cameras from there")
    return (said,)


WRITER = Writer(
    "kalibr",
    "Kalibr camchain",
    (Lens("radtan", "pinhole", 4), Lens("equidistant", "fisheye", 4)),
    (".yaml", ".yml"),
    _text,
    frozenset({NAME}),
    refusal=_refusal,
    remarks=_remarks,
)
