"""All forms of calibration files, and which of them a document is of.

To add one: a module in `forms/` with a `FORM`, and its line here.
"""

from __future__ import annotations

from circlepose.errors import CalibrationError
from circlepose.io.calibration.document import Document
from circlepose.io.calibration.foreign import kind_of_foreign
from circlepose.io.calibration.form import Form
from circlepose.io.calibration.forms import (
    basalt,
    boofcv,
    bouguet,
    calib_io,
    camodocal,
    colmap,
    depthai,
    kalibr,
    kitti,
    limelight,
    mat,
    matlab,
    metashape,
    mrcal,
    native,
    nerfstudio,
    numpy_arrays,
    open3d,
    opencv,
    openptv,
    opensfm,
    orb_slam,
    photonvision,
    plain,
    realsense,
    report,
    ros,
    ros_ini,
    stella_vslam,
    zed,
    zivid,
)
from circlepose.io.calibration.unknown import unknown_form

FORMS: tuple[Form, ...] = (
    kalibr.FORM,
    ros.FORM,
    colmap.FORM,
    numpy_arrays.FORM,
    mrcal.FORM,
    orb_slam.FORM,
    stella_vslam.FORM,
    camodocal.FORM,
    basalt.FORM,
    photonvision.FORM,
    realsense.FORM,
    boofcv.FORM,
    zivid.FORM,
    calib_io.FORM,
    limelight.FORM,
    ros_ini.FORM,
    report.FORM,
    depthai.FORM,
    open3d.FORM,
    nerfstudio.FORM,
    metashape.FORM,
    bouguet.FORM,
    matlab.FORM,
    openptv.FORM,
    opensfm.FORM,
    mat.FORM,
    kitti.FORM,
    zed.FORM,
    native.FORM,
    opencv.FORM,
    plain.FORM,
)
"""generic ones in the order in which they are asked"""


def form_of(document: Document) -> Form:
    """Return the form of a document; raises `CalibrationError` where it is none that is known, or two at once."""
    foreign = kind_of_foreign(document)
    if foreign is not None:
        raise CalibrationError(f"{document.name}: {foreign}.")
    specific = [form for form in FORMS if not form.is_generic and form.recognizes(document)]
    if len(specific) > 1:
        names = " and ".join(form.name for form in specific)
        raise CalibrationError(f"{document.name}: looks like two forms at once, {names}; keep the keys of one.")
    generic = (form for form in FORMS if form.is_generic and form.recognizes(document))
    form = specific[0] if specific else next(generic, None)
    if form is None:
        raise unknown_form(document)
    return form
