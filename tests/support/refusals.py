"""What comes of a calibration file that is refused: one sentence."""

from __future__ import annotations

import pytest

from circlepose.errors import CalibrationError
from circlepose.io.calibration.reader import read_camera_file


def refused_calibration(content: bytes | str, camera_name: str | None = None) -> str:
    """Return the sentence with which a calibration is refused."""
    with pytest.raises(CalibrationError) as caught:
        read_camera_file(content.encode() if isinstance(content, str) else content, camera_name)
    text = str(caught.value)
    assert text.startswith("<bytes>")
    assert text[-1] in ".?"
    assert "\n" not in text
    return text
