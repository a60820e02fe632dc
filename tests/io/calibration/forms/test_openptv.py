from __future__ import annotations

import pytest

from tests.support.refusals import refused_calibration

ORI = """105.26 102.75 403.88
    -0.238 0.244 0.055

    0.968830 -0.053590 0.241859
    -0.003342 0.973404 0.229070
    -0.247702 -0.222739 0.942885

    0.0 0.0
    70.0

    0.0001 0.0001 150.0
"""


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (ORI, "is OpenPTV's .ori, which has lengths in mm and no pixel size; write camera.yaml with fx, fy"),
        (
            "-1.2e-4 3.1e-8 0 1e-6 0.0 1.0 0.0\n",
            "is OpenPTV's .addpar, which has distortion in mm and no focal length",
        ),
    ],
)
def test_its_files_are_refused_with_the_way_out(text: str, words: str) -> None:
    assert words in refused_calibration(text.encode())


@pytest.mark.parametrize("text", [ORI.replace("70.0\n", ""), "1 2 3 4 5 6 7", ORI.replace("70", "f")])
def test_other_numbers_are_not_called_openptvs(text: str) -> None:
    assert "OpenPTV's" not in refused_calibration(text.encode())
