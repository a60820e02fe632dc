"""mrcal's `.cameramodel`: a Python dict with `lensmodel`, `intrinsics`, `extrinsics` and `imagersize`.

The intrinsics are fx, fy, cx, cy and OpenCV's coefficients, in OpenCV's pixels. mrcal has neither the tilt of the
14-coefficient model nor OpenCV's fisheye: its wide models are splines. The camera stands at mrcal's reference.
Source: mrcal's doc/lensmodels.org, doc/cameramodels.org and mrcal/cameramodel.py.
"""

from __future__ import annotations

from circlepose.io.calibration.number_text import number_list_text
from circlepose.io.calibration.writers.writer import Contents, Lens, Writer
from circlepose.io.marks import COMMENT

_COUNTS = (4, 5, 8, 12)


def _text(contents: Contents) -> str:
    width, height = contents.size
    intrinsics = number_list_text([*contents.focal_and_center, *contents.camera.dist_coeffs.tolist()])
    return (
        f"{COMMENT}\n"
        "{\n"
        f"    'lensmodel':  '{contents.lens.name}',\n\n"
        "    # fx, fy, cx, cy, then OpenCV's coefficients\n"
        f"    'intrinsics': [ {intrinsics} ],\n\n"
        "    # from the reference to the camera: rotation vector, translation\n"
        "    'extrinsics': [ 0, 0, 0, 0, 0, 0 ],\n\n"
        f"    'imagersize': [ {width}, {height} ],\n"
        "}\n"
    )


def _remarks(_: Contents) -> tuple[str, ...]:
    return ("extrinsics are 0: the camera stands at mrcal's reference",)


WRITER = Writer(
    "mrcal",
    "mrcal cameramodel",
    (
        Lens("LENSMODEL_PINHOLE", "pinhole", 0),
        *(Lens(f"LENSMODEL_OPENCV{count}", "pinhole", count) for count in _COUNTS),
    ),
    (".cameramodel",),
    _text,
    remarks=_remarks,
)
