"""What is answered on a file that is no calibration of a known form: what it looks like, and what to do."""

from __future__ import annotations

from circlepose.errors import CalibrationError
from circlepose.io.calibration.document import Document
from circlepose.io.calibration.matrix_text import kind_of_matrix
from circlepose.io.calibration.signatures import kind_of, kind_of_keys, kind_of_text
from circlepose.io.text.sections import looks_like_sections
from circlepose.io.text.validation import some_keys

_EXPECTED = "expected camera_matrix and dist_coeffs, or fx, fy, cx, cy and k1, k2, p1, p2"
_LIKE_YAML = ":"


def unknown_form(document: Document) -> CalibrationError:
    """Return the error: the file, what it looks like, the step to take."""
    name, text = document.name, document.text
    what = kind_of(document.content)
    if what is None and text is not None:
        what = kind_of_text(text) or kind_of_matrix(text) or kind_of_keys(document.entries)
    if what is not None:
        return CalibrationError(f"{name}: {what}.")
    if text is None:
        return CalibrationError(
            f"{name}: is a binary file of no known form; expected the calibration of a camera, such as YAML, JSON, "
            "XML or .npz."
        )
    if document.problem is not None and (_is_meant_as_keys(text) or looks_like_sections(text)):
        return document.problem
    if not document.entries:
        return CalibrationError(f"{name}: is text of no known form of a calibration; {_EXPECTED}.")
    return CalibrationError(
        f"{name}: is no calibration of a known form; {_EXPECTED}; found the keys {some_keys(document.entries)}."
    )


def _is_meant_as_keys(text: str) -> bool:
    """Whether a text is YAML, JSON or XML, if perhaps with a slip: it begins as one, or lines of it have keys."""
    if text.lstrip()[:1] in ("{", "<", "%", "["):
        return True
    lines = [line.strip() for line in text.splitlines()[:200]]
    kept = [line for line in lines if line and line[0] not in "#;"]
    keys = [line for line in kept if _LIKE_YAML in line or line.startswith("- ")]
    return 2 * len(keys) >= len(kept)
