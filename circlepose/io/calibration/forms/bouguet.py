"""Bouguet's Camera Calibration Toolbox for Matlab: Calib_Results.m and .mat, and those of its stereo calibration.

The toolbox counts pixels from 0, as OpenCV does; kc is k1 k2 p1 p2 k3.
"""

from __future__ import annotations

from circlepose.errors import CalibrationError
from circlepose.io.calibration import numbers, terms
from circlepose.io.calibration.document import Document
from circlepose.io.calibration.form import Form, Reading, choose, refuse_name
from circlepose.io.calibration.lens_models import pinhole_coefficients
from circlepose.io.calibration.mat_file import is_mat_file
from circlepose.io.calibration.matlab_values import Fields, assigns, values_of, vector

_ENDS = ("", "_left", "_right")
_SIGMAS = 3.0
"""standard deviations that the toolbox states as the error of a value"""


def _recognizes(document: Document) -> bool:
    """Whether the file gives fc and cc, of one camera or of the left and right one."""
    if is_mat_file(document.content):
        fields = values_of(document).fields
        return any(f"fc{end}" in fields and f"cc{end}" in fields for end in _ENDS)
    return any(assigns(document.text, f"fc{end}") and assigns(document.text, f"cc{end}") for end in _ENDS)


def _read(document: Document, camera_name: str | None) -> Reading:
    """Return the camera; of a stereo calibration the left one, or that of `camera_name`."""
    where, values = document.name, values_of(document)
    fields = values.fields
    ends = [end for end in _ENDS if f"fc{end}" in fields and f"cc{end}" in fields]
    if not ends:
        raise CalibrationError(f"{where}: fc, cc: expected two numbers each, such as fc = [ 657.4 ; 657.8 ];.")
    if ends == [""]:
        refuse_name(camera_name, where)
        end, notes = "", tuple[str, ...]()
    else:
        chosen, notes = choose([each[1:] for each in ends if each], camera_name, where)
        end = f"_{chosen}"
    twice = sorted(name for name in values.ambiguous if name.removesuffix(end) in {"fc", "cc", "kc", "alpha_c"})
    if twice:
        raise CalibrationError(f"{where}: {twice[0]}: has several values; keep one.")
    return _reading(fields, end, where, notes)


def _reading(fields: Fields, end: str, where: str, notes: tuple[str, ...]) -> Reading:
    fx, fy = vector(fields, f"fc{end}", where, (2,))
    cx, cy = vector(fields, f"cc{end}", where, (2,))
    alpha = vector(fields, f"alpha_c{end}", where, (1,))[0] if f"alpha_c{end}" in fields else 0.0
    kc = vector(fields, f"kc{end}", where, (2, 4, 5))
    if len(kc) == 4 and any(kc):
        notes += (
            "the 4 numbers of kc are taken for k1 k2 p1 p2; "
            "for a fisheye lens write OpenCV's form with fisheye_model: 1",
        )
    size = None
    if "nx" in fields and "ny" in fields:
        size = numbers.image_size(
            vector(fields, "nx", where, (1,))[0], vector(fields, "ny", where, (1,))[0], where, "nx, ny"
        )
    if alpha:
        notes += (f"alpha_c is a skew of fc(1) alpha_c = {fx * alpha:g} px",)
    matrix = terms.rows(fx, fy, cx, cy, fx * alpha)
    dist = pinhole_coefficients(kc, where, f"kc{end}")
    camera = numbers.build_camera(where, (f"fc{end}, cc{end}", matrix), (f"kc{end}", dist), size, "pinhole")
    errors = (f"fc{end}_error", f"cc{end}_error")
    if all(key in fields for key in errors):
        focal, center = (max(vector(fields, key, where, (2,))) / _SIGMAS for key in errors)
        camera = numbers.with_sigma(camera, where, focal, center)
        notes += (f"a third of {errors[0]} and {errors[1]} is taken as the standard deviations",)
    return Reading(camera, notes)


FORM = Form("Bouguet toolbox", _recognizes, _read)
