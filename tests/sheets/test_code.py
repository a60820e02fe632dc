"""The QR code: read back by OpenCV from the pixels of a sheet."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from benchmarks.support.sheet_rasters import svg_pixels
from circlepose.diagnostics.inspection import inspect
from circlepose.sheets.code import MOST_BYTES, code_of, has_segno
from circlepose.sheets.figure import figure_of
from circlepose.sheets.pages import lay_out
from circlepose.sheets.svg import svg_of
from circlepose.targets.target import Target

pytestmark = pytest.mark.skipif(not has_segno(), reason="needs segno, of the extra print")


def pixels(text, px_per_mm):
    pytest.importorskip("resvg_py")
    (page,) = lay_out(figure_of(Target.circle(20.0)), ("disc.",), code_of(text)).pages
    return svg_pixels(svg_of(page, "disc"), px_per_mm)


@pytest.mark.parametrize("text", ["kind: circle\nradius_mm: 20.0\n", "a" * 150, "key: äö\n"])
def test_it_is_read_back(text):
    found, _, _ = cv2.QRCodeDetector().detectAndDecode(pixels(text, 12.0))
    assert found == text


@pytest.mark.parametrize("px_per_mm", [4.0, 8.0, 16.0, 24.0])
def test_no_part_of_it_is_found_as_a_circle(px_per_mm):
    contours = inspect(pixels("kind: circle\nradius_mm: 20.0\n" * 6, px_per_mm)).extraction.contours
    assert len(contours) == 1
    assert contours[0].ellipse.semi_major / px_per_mm == pytest.approx(20.0, abs=0.1)


def test_the_longest_text_is_no_wider_than_stated():
    side, boxes = code_of("x" * MOST_BYTES)
    assert side == pytest.approx(0.5 * (77 + 8))
    assert max(box.right_mm for box in boxes) == pytest.approx(side - 2.0)
    assert np.isclose(min(box.x_mm for box in boxes), 2.0)
