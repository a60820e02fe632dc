"""docs/calibrations: every form has a page, a row in the table, and an example that the reader reads."""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
import pytest

from circlepose.errors import CalibrationError
from circlepose.io.calibration.reader import read_camera, read_camera_file
from circlepose.io.calibration.registry import FORMS
from circlepose.io.calibration.writers.registry import WRITERS
from circlepose.io.calibration.writers.writer import NAME, SIGMA, SKEW, TARGET, Writer
from tests.support.paths import ROOT

PAGES = ROOT / "docs" / "calibrations"
README = (PAGES / "README.md").read_text(encoding="utf-8")
FENCE = re.compile(r"^```([\w-]*)( refused)?\n(.*?)^```$", re.MULTILINE | re.DOTALL)
COMMANDS = ("", "sh", "bash", "console", "python", "cpp", "c++")
"""languages of fences that are no calibration"""


@dataclass(frozen=True)
class Example:
    page: str
    number: int
    content: bytes
    is_refused: bool


def pages() -> dict[str, str]:
    """Return the page of each form of the table, by the form's name."""
    return dict(re.findall(r"^\| \[([^\]]+)\]\(([\w-]+)\.md\) \|", README, re.MULTILINE))


def examples() -> list[Example]:
    found = []
    for page in sorted(PAGES.glob("*.md")):
        fences = FENCE.findall(page.read_text(encoding="utf-8")) if page.name != "README.md" else []
        data = [fence for fence in fences if fence[0] not in COMMANDS]
        found += [Example(page.stem, i, text.encode(), bool(refused)) for i, (_, refused, text) in enumerate(data)]
    return found


PAGE_OF = pages()
EXAMPLES = examples()


def test_each_form_has_a_row_of_the_table_in_which_its_page_is_linked() -> None:
    assert set(PAGE_OF) == {form.name for form in FORMS}
    assert {page.stem for page in PAGES.glob("*.md")} == {"README", *PAGE_OF.values()}


@pytest.mark.parametrize("writer", WRITERS.values(), ids=lambda writer: writer.key)
def test_each_form_that_is_written_has_a_row_with_what_it_holds(writer: Writer) -> None:
    row = next(line for line in README.splitlines() if f"| `{writer.key}` |" in line)
    name, _, lenses, others, endings = [cell.strip() for cell in row.strip("|").split(" | ")]
    assert name == f"[{writer.name}]({PAGE_OF[writer.name]}.md)"
    assert {int(number) for number in re.findall(r"\d+", lenses)} == {lens.count for lens in writer.lenses}
    assert ("fisheye" in lenses.lower() or "equidistant" in lenses) == (
        "fisheye" in {lens.model for lens in writer.lenses}
    )
    words = {SKEW: "skew", SIGMA: "how well", TARGET: "target", NAME: "the camera's"}
    assert writer.holds == {held for held, word in words.items() if word in others}
    plain = {ending for ending in writer.endings if not ending.endswith(".gz")}
    assert set(re.findall(r"`(\.\w+)`", endings)) - {".gz"} == plain
    assert ("`.gz`" in endings) == (len(plain) < len(writer.endings))
    page = (PAGES / f"{PAGE_OF[writer.name]}.md").read_text(encoding="utf-8")
    assert f"**Written** by `circlepose camera --to {writer.key}`" in page


@pytest.mark.parametrize("example", EXAMPLES, ids=lambda example: f"{example.page}-{example.number}")
def test_each_example_is_read_as_its_page_says(example: Example) -> None:
    if example.is_refused:
        with pytest.raises(CalibrationError):
            read_camera_file(example.content)
        return
    file = read_camera_file(example.content)
    assert PAGE_OF[file.form] == example.page
    assert not any(doubt.is_grave for doubt in file.doubts)
    again = read_camera_file(example.content)
    assert again.camera == file.camera
    assert again.notes == file.notes


@pytest.mark.parametrize("page", sorted({*PAGE_OF.values()} - {example.page for example in EXAMPLES}))
def test_a_binary_form_has_code_that_writes_it(page: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    names = {
        "np": np,
        "cv2": cv2,
        "mtx": np.array([[600.0, 0.0, 319.5], [0.0, 601.0, 239.5], [0.0, 0.0, 1.0]]),
        "dist": np.array([[-0.2, 0.1, 1e-3, 2e-3, 0.01]]),
        "width": 640,
        "height": 480,
    }
    code = [text for language, _, text in FENCE.findall((PAGES / f"{page}.md").read_text()) if language == "python"]
    assert code
    for text in code:
        exec(text, dict(names))
    written = list(tmp_path.iterdir())
    assert written
    for path in written:
        file = read_camera_file(path)
        assert PAGE_OF[file.form] == page
        np.testing.assert_array_equal(file.camera.camera_matrix, names["mtx"])
        assert file.camera.image_size == (640, 480)


def test_the_code_for_those_without_a_calibration(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys) -> None:
    monkeypatch.chdir(tmp_path)
    matrix = np.array([[620.0, 0.0, 322.0], [0.0, 618.0, 241.0], [0.0, 0.0, 1.0]])
    (tmp_path / "board").mkdir()
    for number, tilt in enumerate(
        ((0, 0, 0), (0.5, 0, 0.1), (-0.5, 0, 0), (0, 0.5, -0.1), (0, -0.5, 0), (0.4, 0.4, 0.8))
    ):
        cv2.imwrite(f"board/{number}.png", chessboard(matrix, tilt))
    code = next(text for language, _, text in FENCE.findall(README) if language == "python")
    exec(code, {})
    assert "6 of 6 photographs used, rms 0." in capsys.readouterr().out
    camera = read_camera("camera.yaml")
    assert camera.image_size == (640, 480)
    np.testing.assert_allclose(camera.camera_matrix, matrix, rtol=0.01, atol=2.0)


def chessboard(matrix: np.ndarray, tilt: tuple[float, float, float]) -> np.ndarray:
    """Return a photograph (480, 640) of a board of 10 x 7 squares of 25 mm, 60 px each when it was drawn."""
    squares = np.kron(np.indices((7, 10)).sum(axis=0) % 2, np.ones((60, 60))) * 200 + 25
    board = np.pad(squares, 60, constant_values=225.0).astype(np.uint8)
    rotation, _ = cv2.Rodrigues(np.array(tilt, dtype=np.float64))
    # From the board's pixels to mm about its middle, and through the camera.
    to_mm = np.array([[25 / 60, 0.0, -125 - 25], [0.0, 25 / 60, -87.5 - 25], [0.0, 0.0, 1.0]])
    pose = np.column_stack([rotation[:, 0], rotation[:, 1], [0.0, 0.0, 420.0]])
    big = np.diag([4.0, 4.0, 1.0])
    big[:2, 2] = 1.5
    photo = cv2.warpPerspective(board, big @ matrix @ pose @ to_mm, (2560, 1920), borderValue=225)
    return cv2.resize(photo, (640, 480), interpolation=cv2.INTER_AREA)


@pytest.mark.parametrize("page", sorted(PAGES.glob("*.md")), ids=lambda page: page.stem)
def test_links_lead_somewhere(page: Path) -> None:
    for target, anchor in re.findall(r"\]\(([\w./-]*\.md)?(#[\w-]+)?\)", page.read_text(encoding="utf-8")):
        linked = page.parent / target if target else page
        assert linked.is_file(), target
        headings = re.findall(r"^#+ (.*)$", linked.read_text(encoding="utf-8"), re.MULTILINE)
        anchors = {f"#{re.sub(r'[^a-z0-9 -]', '', heading.lower()).replace(' ', '-')}" for heading in headings}
        assert not anchor or anchor in anchors, anchor
