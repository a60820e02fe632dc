"""What the reader of calibrations answers on a file that it refuses."""

from __future__ import annotations

from circlepose.errors import CalibrationError
from circlepose.io.calibration.reader import read_camera_file


def refusal(content: bytes, camera_name: str | None = None) -> str:
    """Return the message, which is one line; fails where the file is read."""
    try:
        file = read_camera_file(content, camera_name)
    except CalibrationError as error:
        assert "\n" not in str(error)
        return str(error)
    raise AssertionError(f"read as {file.form}")
