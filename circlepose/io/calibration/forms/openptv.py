"""OpenPTV and 3D-PTV: .ori and .addpar files, which are recognized and refused, since one alone is no calibration.

An .ori file has lengths in mm, of pixels whose size only ptv.par states. The distortion, in .addpar, is centered on
the sensor and not on the principal point, so that OpenCV's models hold it only where xh and yh are 0.
"""

from __future__ import annotations

import re
from typing import NoReturn

from circlepose.errors import CalibrationError
from circlepose.io.calibration.document import Document
from circlepose.io.calibration.form import Form

_NUMBER = re.compile(r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?")
_ORI = (3, 3, 3, 3, 3, 2, 1)
"""numbers a line: position, angles, rotation matrix, xh yh, focal length"""
_ADDPAR_COUNT = 7
"""k1 k2 k3 p1 p2, scale, shear"""
_LONGEST = 4000
"""characters"""


def _recognizes(document: Document) -> bool:
    """Whether the text is nothing but numbers, so many a line as an .ori or .addpar file has."""
    return _kind(document) is not None


def _read(document: Document, camera_name: str | None) -> NoReturn:  # noqa: ARG001 - as every form
    """Refuse the file, with the way out."""
    kind = _kind(document)
    has = "lengths in mm and no pixel size" if kind == ".ori" else "distortion in mm and no focal length"
    raise CalibrationError(
        f"{document.name}: is OpenPTV's {kind}, which has {has}; write camera.yaml with fx, fy (the focal length "
        "divided by ptv.par's pixel size), cx, cy and image_size, or calibrate with OpenCV if there is distortion."
    )


def _kind(document: Document) -> str | None:
    text = document.text
    if text is None or len(text) > _LONGEST:
        return None
    lines = [line.split() for line in text.splitlines() if line.strip()]
    words = [word for line in lines for word in line]
    if not all(_NUMBER.fullmatch(word) for word in words):
        return None
    if tuple(map(len, lines[: len(_ORI)])) == _ORI:
        return ".ori"
    # Its scale is close to 1 and its shear to 0, which a list of other numbers hardly is.
    is_addpar = len(words) == _ADDPAR_COUNT and 0.5 < float(words[5]) < 2.0 and abs(float(words[6])) < 0.5
    return ".addpar" if is_addpar else None


FORM = Form("OpenPTV", _recognizes, _read)
