"""KITTI's calib_cam_to_cam.txt: of each camera the raw image's K, D and S, and what belongs to the rectified one."""

from __future__ import annotations

import re

from circlepose.errors import CalibrationError
from circlepose.io.calibration import numbers
from circlepose.io.calibration.document import Document
from circlepose.io.calibration.form import Form, Reading, choose
from circlepose.io.calibration.lens_models import pinhole_coefficients
from circlepose.io.text.validation import brief

_MATRIX = re.compile(r"^K_(\d\d):[ \t]*[-+.\d]", re.MULTILINE)
_DISTORTION = re.compile(r"^D_\d\d:[ \t]*[-+.\d]", re.MULTILINE)
_LINE = re.compile(r"([A-Za-z]\w*):[ \t]*(.*)")


def _recognizes(document: Document) -> bool:
    """Whether lines `K_00: ` and `D_00: ` of plain numbers are there."""
    text = document.text
    return text is not None and _MATRIX.search(text) is not None and _DISTORTION.search(text) is not None


def _read(document: Document, camera_name: str | None) -> Reading:
    """Return the camera of the raw images; `camera_name` is its number, as 02."""
    where, text = document.name, document.text or ""
    lines: dict[str, tuple[int, str]] = {}
    for number, line in enumerate(text.splitlines(), 1):
        match = _LINE.fullmatch(line.strip())
        if match is None:
            continue
        if match[1] in lines:
            raise CalibrationError(f"{where}, line {number}: {match[1]}: is given twice; remove one of them.")
        lines[match[1]] = number, match[2]
    asked = camera_name
    if asked is not None:
        digits = re.fullmatch(r"(?:K_|image_|cam)?(\d{1,2})", asked, re.IGNORECASE)
        asked = digits[1].zfill(2) if digits else asked
    name, notes = choose(list(dict.fromkeys(_MATRIX.findall(text))), asked, where)
    matrix = _numbers(lines, f"K_{name}", where, (9,))
    dist = _numbers(lines, f"D_{name}", where, (4, 5, 8))
    size = None
    if f"S_{name}" in lines:
        width, height = _numbers(lines, f"S_{name}", where, (2,))
        size = numbers.image_size(width, height, where, f"S_{name}")
    grid = numbers.camera_matrix(matrix, where, f"K_{name}")
    dist = pinhole_coefficients(dist, where, f"D_{name}")
    camera = numbers.build_camera(where, (f"K_{name}", grid), (f"D_{name}", dist), size, "pinhole")
    notes += (
        f"K_{name} and D_{name} hold for the raw images; for the rectified ones (of S_rect_{name}) write fx, fy, cx, "
        f"cy of P_rect_{name}, without distortion",
    )
    return Reading(camera, notes, {"camera_matrix": f"K_{name}", "dist_coeffs": f"D_{name}"})


def _numbers(lines: dict[str, tuple[int, str]], key: str, where: str, counts: tuple[int, ...]) -> list[float]:
    if key not in lines:
        raise CalibrationError(f"{where}: {key}: is missing; expected this line of KITTI's calib_cam_to_cam.txt.")
    number, rest = lines[key]
    expected = " or ".join(map(str, counts))
    try:
        values = [float(word) for word in rest.split()]
    except ValueError:
        raise CalibrationError(
            f"{where}, line {number}: {key}: expected {expected} numbers, got {brief(rest)!r}; correct it."
        ) from None
    if len(values) not in counts:
        raise CalibrationError(
            f"{where}, line {number}: {key}: expected {expected} numbers, got {len(values)}; correct it."
        )
    return values


FORM = Form("KITTI", _recognizes, _read)
