"""The examples of the pages in docs/calibrations are files that are read."""

from __future__ import annotations

import pytest

from benchmarks.support.fuzz.calibrations import binary_calibrations, text_calibrations
from circlepose.errors import CalibrationError
from circlepose.io.calibration.reader import read_camera_file

TEXTS, BINARIES = text_calibrations(), binary_calibrations()


@pytest.mark.parametrize("page", TEXTS)
def test_the_example_of_each_page_is_read(page: str) -> None:
    assert read_camera_file(TEXTS[page]).camera.camera_matrix[0, 0] > 0.0


@pytest.mark.parametrize("page", TEXTS)
@pytest.mark.parametrize("encoding", ["utf-8-sig", "utf-16"])
def test_a_byte_order_mark_and_other_line_ends_change_nothing(page: str, encoding: str) -> None:
    text = TEXTS[page].decode()
    other = read_camera_file(text.replace("\n", "\r\n").encode(encoding))
    assert other.camera == read_camera_file(TEXTS[page]).camera


@pytest.mark.parametrize("name", BINARIES)
def test_binary_files(name: str) -> None:
    assert read_camera_file(BINARIES[name]).camera.image_size in {(640, 480), None}


@pytest.mark.parametrize("name", [*TEXTS, *BINARIES])
def test_a_file_that_is_cut_is_read_or_refused_in_a_sentence(name: str) -> None:
    content = (TEXTS | BINARIES)[name]
    said = [_said(content[:end]) for end in range(1, len(content), max(1, len(content) // 24))]
    assert all("\n" not in text for text in said)
    assert any(text for text in said)


def _said(content: bytes) -> str:
    try:
        read_camera_file(content)
    except CalibrationError as error:
        return str(error)
    return ""
