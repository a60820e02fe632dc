"""All forms of calibration files, and which of them a document is of.

To add one: a module in `forms/` with a `FORM`, and its line here.
"""

from __future__ import annotations

from circlepose.errors import CalibrationError
from circlepose.io.calibration.document import Document
from circlepose.io.calibration.form import Form
from circlepose.io.calibration.forms import (
    bouguet,
    depthai,
    kalibr,
    mat,
    matlab,
    metashape,
    native,
    nerfstudio,
    open3d,
    opencv,
    openptv,
    report,
    ros,
)
from circlepose.io.calibration.unknown import unknown_form

FORMS: tuple[Form, ...] = (
    kalibr.FORM,
    ros.FORM,
    report.FORM,
    depthai.FORM,
    open3d.FORM,
    nerfstudio.FORM,
    metashape.FORM,
    bouguet.FORM,
    matlab.FORM,
    openptv.FORM,
    mat.FORM,
    native.FORM,
    opencv.FORM,
)
"""generic ones in the order in which they are asked"""


def form_of(document: Document) -> Form:
    """Return the form of a document; raises `CalibrationError` where it is none that is known, or two at once."""
    found = [form for form in FORMS if form.recognizes(document)]
    specific = [form for form in found if not form.is_generic]
    if len(specific) > 1:
        names = " and ".join(form.name for form in specific)
        raise CalibrationError(f"{document.name}: looks like two forms at once, {names}; keep the keys of one.")
    if found:
        return (specific or found)[0]
    raise unknown_form(document)
