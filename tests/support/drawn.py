"""Pictures that OpenCV draws, and of which the figures in a test are."""

from __future__ import annotations

import cv2
import pytest

drawn_by_opencv_5 = pytest.mark.skipif(
    int(cv2.__version__.split(".")[0]) < 5,
    reason="the figures are of a picture whose letters or blur releases of OpenCV before 5 draw otherwise",
)
