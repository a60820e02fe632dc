"""What is answered on a file that is no calibration of a known form: what it looks like, and what to do."""

from __future__ import annotations

from circlepose.errors import CalibrationError
from circlepose.io.calibration.document import Document
from circlepose.io.text.validation import some_keys


def unknown_form(document: Document) -> CalibrationError:
    """Return the error: the file, what it looks like, the step to take."""
    name = document.name
    if document.text is None:
        return CalibrationError(f"{name}: is a binary file of no known form; expected the calibration of a camera.")
    if document.problem is not None:
        return document.problem
    return CalibrationError(
        f"{name}: is no calibration of a known form (OpenCV, ROS camera_info, Kalibr, circlepose); expected "
        f"camera_matrix, or fx, fy, cx, cy; found {some_keys(document.entries)}."
    )
