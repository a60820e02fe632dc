from __future__ import annotations

import re
from pathlib import Path

import pytest

from circlepose.errors import CircleposeError
from circlepose.io.calibration.reader import read_camera_file
from circlepose.io.inputs.images import expand_inputs
from circlepose.io.target_file import read_target
from circlepose.results import Status
from tests.support.paths import ROOT

DOCS = ROOT / "docs"
FORMATS = (DOCS / "file-formats.md").read_text(encoding="utf-8")
TROUBLES = (DOCS / "troubleshooting.md").read_text(encoding="utf-8")
EXAMPLES = re.findall(r"```yaml\n(.*?)```", FORMATS, re.DOTALL)


def test_every_example_is_read() -> None:
    assert [read_target(text.encode()).kind for text in EXAMPLES] == [
        "circle",
        "coplanar",
        "coaxial",
        "board",
        "circle",
    ]


@pytest.mark.parametrize("status", [status for status in Status if status is not Status.OK])
def test_every_status_is_explained(status: Status) -> None:
    assert f"| `{status}`" in TROUBLES


OWN = "fx: 2607\nfy: 2607\ncx: 255.5\ncy: 239.5\nimage_size: [512, 480]\n"
CV = (
    "camera_matrix: !!opencv-matrix {rows: 3, cols: 3, dt: d, data: [2607, 0, 255.5, 0, 2607, 239.5, 0, 0, 1]}\n"
    "distortion_coefficients: !!opencv-matrix {rows: 1, cols: 6, dt: d, data: [0, 0, 0, 0, 0, 0]}\n"
)


@pytest.mark.parametrize(
    "content",
    [
        CV,
        CV.replace("2607, 0,", ".nan, 0,").replace("cols: 6", "cols: 5").replace("[0, ", "["),
        CV.replace("2607", "0"),
        CV.replace("[2607, 0, 255.5, 0, 2607, 239.5, 0, 0, 1]", "[0, 0, 0, 0, 0, 0, 0, 0, 0]"),
        CV.replace(", 0, 0, 1]", ", 0, 1]"),
        OWN + "dist_cofs: [0.1]\n",
        OWN + "modell: pinhole\n",
        "cam0: {camera_model: omni, intrinsics: [1, 2, 3, 4, 5]}\n",
        "a: 1\n",
    ],
)
def test_messages_on_calibrations_are_those_of_the_program(content: str) -> None:
    with pytest.raises(CircleposeError) as caught:
        read_camera_file(content.encode())
    check_quoted(str(caught.value))


@pytest.mark.parametrize(
    "content",
    [
        "radius_mm: -60",
        "kind: coplanar\nradii_mm: [30, 50]",
        "diameter_mm: 120",
        "radius: 60",
        "radius_mm: 60\npolarty: dark",
        "radii_mm: [50, 30]",
        "kind: coaxial\nradii_mm: [50, 30]\ngeneratrix_mm: 5",
    ],
)
def test_messages_on_targets_are_those_of_the_program(content: str) -> None:
    with pytest.raises(CircleposeError) as caught:
        read_target(content.encode())
    check_quoted(str(caught.value))


def test_messages_on_inputs_are_those_of_the_program(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    folder = Path("imgs")
    folder.mkdir()
    messages = [message("imgs"), message("imgs/*.tif"), message("-")]
    (folder / "a.txt").touch()
    (folder / "b.txt").touch()
    messages.append(message("imgs"))
    (folder / "below").mkdir()
    (folder / "below" / "a.png").touch()
    messages.append(message("imgs"))
    assert len(set(messages)) == 5
    for each in messages:
        check_quoted(each)


def message(typed: str) -> str:
    with pytest.raises(CircleposeError) as caught:
        list(expand_inputs([typed], []))
    return str(caught.value)


def check_quoted(text: str) -> None:
    """Assert that the page quotes the message: without the file's name, and from its beginning at least."""
    quotes = [quote.strip(". ") for quote in re.findall(r"`([^`]+)`", TROUBLES) if len(quote) > 12]
    plain = text.removeprefix("<bytes>: ").removeprefix("cam0: ")
    assert any(plain.startswith(quote) or plain.startswith(quote.removeprefix("cam.yaml: ")) for quote in quotes), (
        plain
    )
